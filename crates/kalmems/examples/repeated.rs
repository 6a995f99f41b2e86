//! Writes a recording of any length to standard output: the last rows of a short one again and again, the time going on.
//!
//! For trying what long recordings do, such as through a pipe:
//! `cargo run --release --example repeated -- recording.csv 40000 370000000 | kalmems estimate long.toml`. Where the rows
//! that are repeated last a whole number of cycles of a settled motion, so does the whole.

use std::io::{BufWriter, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, file, last, rows] = arguments.as_slice() else {
        eprintln!("usage: repeated RECORDING.csv ROWS_TO_REPEAT ROWS_IN_ALL");
        return ExitCode::from(2);
    };
    let (Ok(last), Ok(rows)) = (last.parse(), rows.parse()) else {
        eprintln!("error: numbers of rows are expected");
        return ExitCode::from(2);
    };
    if let Err(e) = write(file, last, rows) {
        eprintln!("error: {e}");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// The first column is the time in s, in steps of a whole number of nanoseconds.
fn write(file: &str, last: usize, rows: u64) -> Result<(), Box<dyn std::error::Error>> {
    let text = std::fs::read_to_string(file)?;
    let mut lines = text.lines();
    let header = lines.next().ok_or("the file is empty")?;
    let all: Vec<(&str, &str)> = lines.filter_map(|line| line.split_once(',')).collect();
    let repeated = all.get(all.len().saturating_sub(last.max(2))..).unwrap_or_default();
    let [(first, _), (second, _), ..] = repeated else { return Err("there are less than two rows".into()) };
    let step_s = second.parse::<f64>()? - first.parse::<f64>()?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of nanoseconds
    let step = (step_s * 1e9).round() as u64;
    let mut out = BufWriter::with_capacity(1 << 20, std::io::stdout().lock());
    writeln!(out, "{header}")?;
    let (mut time, mut line) = (0, Vec::new());
    for (_, cells) in repeated.iter().cycle().take(usize::try_from(rows)?) {
        line.clear();
        digits(time / 1_000_000_000, 1, &mut line);
        line.push(b'.');
        digits(time % 1_000_000_000, 9, &mut line);
        line.push(b',');
        line.extend_from_slice(cells.as_bytes());
        line.push(b'\n');
        out.write_all(&line)?;
        time += step;
    }
    Ok(out.flush()?)
}

/// A number in decimals, with zeros in front up to this width.
fn digits(mut number: u64, width: usize, into: &mut Vec<u8>) {
    let begin = into.len();
    while number > 0 || into.len() - begin < width {
        into.push(b'0' + (number % 10) as u8);
        number /= 10;
    }
    into[begin..].reverse();
}

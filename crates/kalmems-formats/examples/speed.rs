//! How fast tables are read, and how much memory that takes: `cargo run --release -p kalmems-formats --example speed --
//! [POWER] FILE …`. All columns of numbers are read, times 10^POWER if one is given before the file;
//! `tests/fixtures/large.py` writes large files of every format.

use kalmems_formats::{Block, Hints, WantedColumn, open};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "{:<24} {:>9} {:>12} {:>8} {:>9} {:>12} {:>9}",
        "file", "MB", "numbers", "s", "MB/s", "numbers/µs", "peak MB"
    );
    let mut power = 0;
    for argument in std::env::args().skip(1) {
        if let Ok(given) = argument.parse() {
            power = given;
            continue;
        }
        let path = Path::new(&argument);
        // Arrays without names have these three.
        let names = ["time_s", "drive_V", "cap_V"].map(str::to_owned).to_vec();
        let plain = path.extension().is_some_and(|ending| ending == "npy");
        let hints = Hints { columns: plain.then_some(names), ..Hints::default() };
        let start = Instant::now();
        let mut table = open(path, &hints)?;
        let mut wanted = Vec::new();
        for column in 0..table.description().columns.len() {
            wanted.push(WantedColumn::Number { column, power });
            if table.want(&wanted).is_err() {
                wanted.pop();
            }
        }
        table.want(&wanted)?;
        let mut block = Block::with_capacity(16_384);
        let (mut numbers, mut sum) = (0_u64, 0.0);
        loop {
            table.read(&mut block)?;
            if block.is_end() {
                break;
            }
            numbers += (block.rows * block.numbers.len()) as u64;
            sum += block.numbers.iter().flatten().sum::<f64>();
        }
        std::hint::black_box(sum);
        let (seconds, bytes) = (start.elapsed().as_secs_f64(), std::fs::metadata(path)?.len());
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        println!(
            "{name:<24} {:>9.1} {numbers:>12} {seconds:>8.3} {:>9.0} {:>12.1} {:>9}",
            bytes as f64 / 1e6,
            bytes as f64 / 1e6 / seconds,
            numbers as f64 / 1e6 / seconds,
            peak().unwrap_or_else(|| "?".to_owned()),
        );
    }
    Ok(())
}

/// The most memory that the program held so far, of all files before as well.
fn peak() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(format!("{:.0}", kilobytes / 1e3))
}

//! `kalmems stream`.

use crate::Ending;
use crate::args::StreamArguments;
use kalmems::config::Experiment;
use kalmems::stream::{AheadSummary, Outputs, StreamError, StreamSummary, stream};
use serial2::SerialPort;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

pub fn run(arguments: &StreamArguments) -> Result<(), Ending> {
    let wrong = |e: &dyn std::fmt::Display| Ending::Wrong(e.to_string());
    let experiment = Experiment::load(&arguments.experiment).map_err(|e| wrong(&e))?;
    let (lines, frames) = (arguments.lines.as_deref(), arguments.frames.as_deref());
    let standard = Path::new("-");
    let lines = lines.or(if frames.is_none() { Some(standard) } else { None });
    if lines == Some(standard) && frames == Some(standard) {
        let why = "lines and frames cannot both go to standard output; give one of them a file";
        return Err(Ending::Wrong(why.to_owned()));
    }
    let outputs = Outputs { lines: lines.map(output).transpose()?, frames: frames.map(output).transpose()? };
    let state = arguments.state.as_deref();
    let input = input(&arguments.from, arguments.baud)
        .map_err(|e| Ending::Wrong(format!("cannot read samples from `{}`: {e}", arguments.from)))?;
    let summary = match stream(&experiment, input, outputs, state, &crate::interrupt::requested) {
        // A reader that closes the pipe has what it wanted.
        Err(StreamError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
        summary => summary.map_err(|e| wrong(&e))?,
    };
    if arguments.json {
        let json = serde_json::to_string_pretty(&summary).map_err(|e| wrong(&e))?;
        eprintln!("{json}");
    } else {
        eprint!("{}", text(&summary));
    }
    Ok(())
}

/// Opens what the samples come from.
fn input(from: &str, baud: Option<u32>) -> io::Result<Box<dyn Read + Send>> {
    if let Some(baud) = baud {
        let mut port = SerialPort::open(from, baud)?;
        // A pause is no end.
        port.set_read_timeout(Duration::from_secs(u64::from(u32::MAX)))?;
        return Ok(Box::new(Device { port, from: from.to_owned() }));
    }
    if from == "-" {
        return Ok(Box::new(io::stdin()));
    }
    if let Some(address) = from.strip_prefix("tcp://") {
        return Ok(Box::new(TcpStream::connect(address)?));
    }
    if let Some(address) = from.strip_prefix("listen://") {
        let listener = TcpListener::bind(address)?;
        eprintln!("waiting for samples at {}", listener.local_addr()?);
        return Ok(Box::new(listener.accept()?.0));
    }
    Ok(Box::new(File::open(from)?))
}

/// A serial device. That it is unplugged is an end of the samples, and said.
struct Device {
    port: SerialPort,
    from: String,
}

/// What a system says of a device that is not there any more, where it gives no bytes without an error: EIO, ENXIO and ENODEV.
const GONE: [i32; 3] = [5, 6, 19];

impl Read for Device {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.port.read(bytes);
        let gone = |e: &io::Error| cfg!(unix) && e.raw_os_error().is_some_and(|code| GONE.contains(&code));
        if matches!(&read, Ok(0)) || read.as_ref().is_err_and(gone) {
            eprintln!("`{}` is not connected any more", self.from);
            return Ok(0);
        }
        read
    }
}

/// Opens what estimates go to.
fn output(to: &Path) -> Result<Box<dyn Write>, Ending> {
    if to == Path::new("-") {
        return Ok(Box::new(BufWriter::new(io::stdout())));
    }
    let file = File::create(to).map_err(|e| Ending::Wrong(format!("cannot write {}: {e}", to.display())))?;
    Ok(Box::new(BufWriter::new(file)))
}

/// The summary for people.
fn text(summary: &StreamSummary) -> String {
    let order = &summary.received.order;
    let mut text = format!("{} samples estimated, {} events\n", summary.estimated, summary.events);
    for (count, what) in [
        (order.dropped, "samples never came"),
        (order.duplicated, "samples came twice"),
        (order.late, "samples came late and were put in their place"),
        (order.too_late, "samples came too late"),
        (order.without_time, "samples had no time"),
        (summary.received.passed_over, "samples were acknowledged by an earlier run"),
        (summary.received.damaged_lines, "lines were no samples"),
        (summary.received.damaged_bytes, "bytes belonged to no frame"),
    ] {
        if count > 0 {
            text += &format!("{count} {what}\n");
        }
    }
    if let Some(AheadSummary { counts, overdue }) = &summary.ahead {
        text += &format!("{} zero phases told before they happened", counts.told);
        for (count, what) in [
            (counts.late, "told later than asked for"),
            (counts.missed, "not told"),
            (*overdue, "written when they had happened, if samples arrive when they are taken"),
        ] {
            text += &format!(", {count} {what}");
        }
        text += "\n";
        if counts.without_drive > 0 {
            text += &format!("{} samples at which the drive was not foreseeable\n", counts.without_drive);
        }
    }
    if let Some(origin) = &summary.origin {
        text += &format!("{}\n", origin.sentence());
    }
    for finding in &summary.diagnosis {
        text += &format!("{finding}\n");
    }
    let latency = &summary.latency;
    let micro = |d: Duration| format!("{:.0} us", d.as_secs_f64() * 1e6);
    let quantiles = [0.5, 0.9, 0.99, 0.999].map(|share| latency.quantile(share).map(micro));
    if let [Some(half), Some(ninth), Some(hundredth), Some(thousandth)] = quantiles {
        text += &format!(
            "from arrival to estimate: half within {half}, 90 % {ninth}, 99 % {hundredth}, 99.9 % {thousandth}, all {}\n",
            micro(latency.longest())
        );
        let most = latency.filled().map(|(_, count)| count).max().unwrap_or(1).max(1);
        for (end, count) in latency.filled() {
            #[allow(clippy::cast_possible_truncation)] // at most 40
            let bar = "#".repeat((40 * count).div_ceil(most) as usize);
            text += &format!("  up to {:>10}  {count:>10}  {bar}\n", micro(end));
        }
    }
    text
}

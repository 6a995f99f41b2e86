//! `kalmems stream`.

use crate::CommandEnding;
use crate::args::StreamArguments;
use crate::interrupt;
use crate::target::write_page;
use crate::tell::{StandardError, line, tell};
use kalmems::recording::ReadError;
use kalmems::results::create_file;
use kalmems::rigs::Workbench;
use kalmems::stream::{
    AheadSummary, StreamEnd, StreamError, StreamOutputs, StreamSummary, is_frames, is_lines, stream,
    stream_with_page,
};
use std::io::{self, BufWriter, ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::time::Duration;

#[cfg(all(feature = "mcap", not(target_family = "wasm")))]
mod mcap_file;
#[cfg(not(target_family = "wasm"))]
mod messages;
mod source;
#[cfg(not(target_family = "wasm"))]
mod viewer;
#[cfg(not(target_family = "wasm"))]
mod watch;
#[cfg(not(target_family = "wasm"))]
mod wires;

/// The exit code where the connection broke.
const BROKEN: u8 = 4;

/// The exit code where the user stopped it.
const INTERRUPTED: u8 = 130;

pub fn run(workbench: &Workbench, arguments: &StreamArguments) -> Result<(), CommandEnding> {
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let experiment = workbench.load(&arguments.experiment).map_err(|e| wrong(&e))?;
    let (lines, frames) = (arguments.lines.as_deref(), arguments.frames.as_deref());
    let standard = Path::new("-");
    // On a terminal megabytes of lines would pass that nobody reads.
    let own_folder = Path::new("out").join("streams");
    let own_file = own_folder.join(format!("{}.txt", experiment.name));
    let lines = lines.or(match (frames, io::stdout().is_terminal()) {
        _ if arguments.to.is_some() => None,
        (Some(_), _) => None,
        (None, false) => Some(standard),
        (None, true) => Some(&*own_file),
    });
    if lines == Some(standard) && frames == Some(standard) {
        let why = "lines and frames cannot both go to standard output; give one of them a file";
        return Err(CommandEnding::Wrong(why.to_owned()));
    }
    if lines == Some(&*own_file) {
        let failed = |e: io::Error| wrong(&format!("cannot make the folder {}: {e}", own_folder.display()));
        std::fs::create_dir_all(&own_folder).map_err(failed)?;
    }
    let mut written = lines.map(|to| output(to, is_lines, arguments.force)).transpose()?;
    let to = arguments.to.as_deref();
    let finish = to.map(|to| watched(to, &mut written, arguments.force)).transpose()?;
    let outputs = StreamOutputs {
        lines: written,
        frames: frames.map(|to| output(to, is_frames, arguments.force)).transpose()?,
        notices: Some(Box::new(StandardError)),
    };
    let state = arguments.state.as_deref();
    let unreadable =
        |e: &io::Error| CommandEnding::Wrong(format!("cannot read samples from `{}`: {e}", arguments.from));
    let source = source::open(&arguments.from, arguments.baud).map_err(|e| unreadable(&e))?;
    if experiment.stream.as_ref().is_some_and(|stream| stream.reconnect.is_some()) && !source.reopens() {
        tell!(
            "note: `{}` is read once: `reconnect` is for `tcp://`, `listen://` and serial devices",
            arguments.from
        );
    }
    let stop = &interrupt::requested;
    let ended = match &arguments.report {
        Some(_) => stream_with_page(workbench, &experiment, source, outputs, state, stop)
            .map(|(summary, html)| (summary, Some(html))),
        None => stream(workbench, &experiment, source, outputs, state, stop).map(|summary| (summary, None)),
    };
    let (summary, html) = match ended {
        // A reader that closes the pipe has what it wanted.
        Err(StreamError::Output(e)) if e.kind() == ErrorKind::BrokenPipe => return Ok(()),
        Err(StreamError::Read(ReadError::Io { source, .. })) => return Err(unreadable(&source)),
        ended => ended.map_err(|e| wrong(&e))?,
    };
    if let Some(finish) = finish {
        finish()?;
    }
    if let (Some(path), Some(html)) = (&arguments.report, html) {
        write_page(path, &html, arguments.force)?;
        tell!("the report: {}", path.display());
    }
    if let Some(StreamEnd { why, samples, time_s }) = &summary.broken {
        let at = time_s.map_or_else(String::new, |time_s| format!(", at {time_s} s"));
        line(format_args!("error: `{}` broke after {samples} samples{at}: {why}", arguments.from));
    }
    if lines == Some(&*own_file) {
        tell!("estimates and events as lines in {}; `--lines -` shows them here", own_file.display());
    }
    if arguments.json {
        let json = serde_json::to_string_pretty(&summary).map_err(|e| wrong(&e))?;
        line(format_args!("{json}"));
    } else {
        tell!("{}", text(&summary).trim_end());
    }
    match (summary.interrupted, summary.broken) {
        (true, _) => Err(CommandEnding::Told(INTERRUPTED)),
        (false, Some(_)) => Err(CommandEnding::Told(BROKEN)),
        (false, None) => Ok(()),
    }
}

/// Completes what `--to` names.
type WatchEnd = Box<dyn FnOnce() -> Result<(), CommandEnding>>;

/// Lets what `--to` names take the lines as well as where they are written to.
#[cfg(not(target_family = "wasm"))]
fn watched(to: &str, written: &mut Option<Box<dyn Write>>, force: bool) -> Result<WatchEnd, CommandEnding> {
    let watch = watch::Watch::open(to, written, force)?;
    Ok(Box::new(move || watch.finish()))
}

/// A browser sends nothing.
#[cfg(target_family = "wasm")]
fn watched(_: &str, _: &mut Option<Box<dyn Write>>, _: bool) -> Result<WatchEnd, CommandEnding> {
    Err(CommandEnding::Wrong("`--to`: a browser has no connections here".to_owned()))
}

/// Opens what estimates go to; what another stream wrote there is kept beside it.
fn output(to: &Path, is_own: fn(&[u8]) -> bool, force: bool) -> Result<Box<dyn Write>, CommandEnding> {
    if to == Path::new("-") {
        return Ok(Box::new(BufWriter::new(io::stdout())));
    }
    let file = create_file(to, is_own, force).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    Ok(Box::new(BufWriter::new(file)))
}

/// The summary for people.
fn text(summary: &StreamSummary) -> String {
    let order = &summary.received.order;
    let mut text = format!("{} samples estimated, {} events\n", summary.estimated, summary.events);
    if summary.interrupted {
        text += "stopped\n";
    }
    let received = &summary.received;
    for (count, what) in [
        (order.dropped, "samples were lost"),
        (order.duplicated, "samples came twice"),
        (order.late, "samples came late and were sorted in"),
        (order.too_late, "samples came too late"),
        (order.without_time, "samples had no time"),
        (order.misplaced, "samples had a time far from those around them, and were left out"),
        (received.same_time, "frames had the time of the one before, and were left out"),
        (received.passed_over, "samples were acknowledged by an earlier run"),
        (received.damaged_lines, "lines were no samples"),
        (received.damaged_bytes, "bytes were outside of any frame"),
        (received.cut_off, "lines or frames had no end, which may have cut them off, and were left out"),
        (received.steps_back, "times the clock went back"),
        (received.breaks, "times the connection broke"),
        (received.reconnections, "times the connection was restored"),
        (summary.stretches.restarts as u64, "times the estimate began again"),
        (summary.not_estimated, "samples could not be estimated"),
        (summary.noise_only, "times the signal was noise only"),
        (summary.withheld, "zero phases or crossings were not reported, because the signal was noise"),
        (
            summary.crossings_by_fallback,
            "crossings were timed by the steepest slope of the signal, which has no zero there or one that may be noise",
        ),
        (summary.crossings_refused, "crossings were not reported, because noise hides their time"),
    ] {
        if count > 0 {
            text += &format!("{count} {what}\n");
        }
    }
    if let Some(AheadSummary { counts, overdue }) = &summary.ahead {
        text += &format!("{} zero phases announced in advance", counts.told);
        for (count, what) in [
            (counts.late, "announced with less than the wanted lead"),
            (counts.missed, "not announced"),
            (*overdue, "written after they had happened, if samples arrive when they are taken"),
        ] {
            text += &format!(", {count} {what}");
        }
        text += "\n";
        if counts.without_drive > 0 {
            text += &format!("{} samples at which the drive could not be predicted\n", counts.without_drive);
        }
    }
    if let Some(origin) = &summary.origin {
        text += &format!("{}\n", origin.sentence());
    }
    for finding in &summary.diagnosis {
        text += &format!("{finding}\n");
    }
    let latency = &summary.latency;
    let micro = |d: Duration| format!("{:.0} µs", d.as_secs_f64() * 1e6);
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

//! `kalmems stream`.

use crate::CommandEnding;
use crate::args::StreamArguments;
use crate::interrupt;
use crate::target::write_page;
use crate::tell::{StandardError, line, tell};
use kalmems::recording::ReadError;
use kalmems::rigs::Workbench;
use kalmems::stream::{
    AheadSummary, SYNC_ORIGIN, StreamEnd, StreamError, StreamOutputs, StreamSummary, Supervisor, is_frames,
    is_lines, stream, stream_with_page,
};
use kalmems::units::{Value, kind};
use rotation::{FileRotation, FileSeries, SeriesWriter};
use std::io::{self, BufWriter, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

#[cfg(not(target_family = "wasm"))]
mod mcap_file;
#[cfg(not(target_family = "wasm"))]
mod mcap_writer;
#[cfg(not(target_family = "wasm"))]
mod messages;
mod rotation;
mod source;
#[cfg(not(target_family = "wasm"))]
mod supervisor;
#[cfg(not(target_family = "wasm"))]
mod viewer;
#[cfg(not(target_family = "wasm"))]
mod watch;
#[cfg(not(target_family = "wasm"))]
mod wires;

/// A file is followed by the next after so long at least, so that their names differ.
const SHORTEST_SERIES: Duration = Duration::from_secs(1);

/// Bytes of standard output that are written at once: each write is looked through for the end of a line.
const OUTPUT: usize = 1 << 16;

/// The exit code where the connection broke.
const BROKEN: u8 = 4;

/// The exit code where no filter follows the motion at the end: all have stopped or lost the signal, or none could begin.
const WITHOUT_ESTIMATE: u8 = 6;

/// The exit code where nobody reads any more what is written, as of a program that a closed pipe ends.
const UNREAD: u8 = 141;

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
        _ if !arguments.to.is_empty() => None,
        (Some(_), _) => None,
        (None, false) => Some(standard),
        (None, true) => Some(&*own_file),
    });
    if lines == Some(standard) && frames == Some(standard) {
        let why = "lines and frames cannot both go to standard output; give one of them a file";
        return Err(CommandEnding::Wrong(why.to_owned()));
    }
    refuse_same_files(arguments, lines)?;
    if lines == Some(&*own_file) {
        let failed = |e: io::Error| wrong(&format!("cannot make the folder {}: {e}", own_folder.display()));
        std::fs::create_dir_all(&own_folder).map_err(failed)?;
    }
    // What a reader that goes leaves unread is no reason to end what others read, and what is kept.
    let kept = [lines.is_some(), frames.is_some(), arguments.state.is_some(), arguments.report.is_some()];
    let goes_on = kept.into_iter().filter(|is_there| *is_there).count() + arguments.to.len() > 1;
    let with = (arguments.force, rotation(arguments)?);
    let opened = |to: Option<&Path>, form| to.map(|to| output(to, form, goes_on, with)).transpose();
    let is_head = |line: &[u8]| line.starts_with(b"# ") || line.starts_with(b"origin,");
    let mut written = opened(lines, (is_lines, is_head))?;
    let frames = opened(frames, (is_frames, |frame| frame.starts_with(&SYNC_ORIGIN)))?;
    let to = arguments.to.iter();
    let ends: Vec<WatchEnd> = to.map(|to| watched(to, &mut written, with)).collect::<Result<_, _>>()?;
    if ![&io::stdin() as &dyn IsTerminal, &io::stdout(), &io::stderr()].iter().any(|one| one.is_terminal()) {
        interrupt::outlive_hangups();
    }
    let outputs = StreamOutputs {
        lines: written,
        frames,
        supervisor: supervisor(arguments.metrics.as_deref())?,
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
        Err(StreamError::Output(e)) if e.kind() == ErrorKind::BrokenPipe => {
            line(format_args!("nobody reads standard output any more: the stream was ended"));
            return Err(CommandEnding::Told(UNREAD));
        }
        Err(StreamError::Read(ReadError::Io { source, .. })) => return Err(unreadable(&source)),
        ended => ended.map_err(|e| wrong(&e))?,
    };
    ends.into_iter().try_for_each(|finish| finish())?;
    if let (Some(path), Some(html)) = (&arguments.report, html) {
        write_page(path, &html, arguments.force)?;
        tell!("the report: {}", path.display());
    }
    if let Some(StreamEnd { why, samples, time_s }) = &summary.broken {
        let at = time_s.map_or_else(String::new, |time_s| format!(", at {time_s} s"));
        line(format_args!("error: `{}` broke after {samples} samples{at}: {why}", arguments.from));
    }
    if !summary.ends_with_estimate && !summary.interrupted && summary.broken.is_none() {
        line(format_args!(
            "error: no filter follows the motion at the end of the stream: each has lost it, has stopped, or could not begin"
        ));
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
    match (summary.interrupted, &summary.broken) {
        (true, _) => Err(CommandEnding::Told(INTERRUPTED)),
        (false, Some(_)) => Err(CommandEnding::Told(BROKEN)),
        (false, None) if !summary.ends_with_estimate => Err(CommandEnding::Told(WITHOUT_ESTIMATE)),
        (false, None) => Ok(()),
    }
}

/// Completes what `--to` names.
type WatchEnd = Box<dyn FnOnce() -> Result<(), CommandEnding>>;

/// Lets what `--to` names take the lines as well as where they are written to.
#[cfg(not(target_family = "wasm"))]
fn watched(
    to: &str,
    written: &mut Option<Box<dyn Write>>,
    with: (bool, FileRotation),
) -> Result<WatchEnd, CommandEnding> {
    let watch = watch::Watch::open(to, written, with)?;
    Ok(Box::new(move || watch.finish()))
}

#[cfg(not(target_family = "wasm"))]
fn supervisor(metrics: Option<&Path>) -> Result<Option<(Duration, Supervisor)>, CommandEnding> {
    supervisor::open(metrics).map_err(|e| CommandEnding::Wrong(format!("the socket of `NOTIFY_SOCKET`: {e}")))
}

/// Nothing watches a browser.
#[cfg(target_family = "wasm")]
fn supervisor(_: Option<&Path>) -> Result<Option<(Duration, Supervisor)>, CommandEnding> {
    Ok(None)
}

/// A browser sends nothing.
#[cfg(target_family = "wasm")]
fn watched(
    _: &str,
    _: &mut Option<Box<dyn Write>>,
    _: (bool, FileRotation),
) -> Result<WatchEnd, CommandEnding> {
    Err(CommandEnding::Wrong("`--to`: a browser has no connections here".to_owned()))
}

/// Tells what some bytes are.
type BytesTest = fn(&[u8]) -> bool;

/// Opens what estimates go to; what another stream wrote there, by `is_own` of its beginning, is kept beside it.
fn output(
    to: &Path,
    (is_own, is_head): (BytesTest, BytesTest),
    goes_on: bool,
    with: (bool, FileRotation),
) -> Result<Box<dyn Write>, CommandEnding> {
    if to == Path::new("-") {
        let reader = StandardOutput { goes_on, is_gone: false };
        return Ok(Box::new(BufWriter::with_capacity(OUTPUT, reader)));
    }
    Ok(Box::new(SeriesWriter::new(FileSeries::begin(to, is_own, with)?, is_head)))
}

/// When files are completed, and followed by the next.
fn rotation(arguments: &StreamArguments) -> Result<FileRotation, CommandEnding> {
    let wrong = |option: &str, why: &dyn std::fmt::Display| CommandEnding::Wrong(format!("{option}: {why}"));
    let size = |text: &String| {
        let units = [("kB", 1e3), ("MB", 1e6), ("GB", 1e9)];
        let of = |(unit, bytes)| Some(text.strip_suffix(unit)?.trim().parse::<f64>().ok()? * bytes);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating
        let bytes = units.into_iter().find_map(of).filter(|bytes| *bytes >= 1e3).map(|bytes| bytes as u64);
        let why = format!("found `{text}`; expected a size of 1 kB or more such as `100 MB`");
        bytes.ok_or_else(|| wrong("--rotate-size", &why))
    };
    let time = |text: &String| {
        let time_s = Value::parse(text).and_then(|value| value.of_kind(&kind::TIME));
        let time_s = time_s.map_err(|e| wrong("--rotate-every", &e))?;
        let every = Duration::try_from_secs_f64(time_s).ok().filter(|every| *every >= SHORTEST_SERIES);
        let why = format!("found `{text}`; expected a time of 1 s or more such as `1 h`");
        every.ok_or_else(|| wrong("--rotate-every", &why))
    };
    Ok(FileRotation {
        bytes: arguments.rotate_size.as_ref().map(size).transpose()?,
        every: arguments.rotate_every.as_ref().map(time).transpose()?,
    })
}

/// Refuses two outputs that are one file, and one that is read.
fn refuse_same_files(arguments: &StreamArguments, lines: Option<&Path>) -> Result<(), CommandEnding> {
    let kept = arguments.to.iter().filter_map(|to| to.strip_prefix("mcap://"));
    let named = [
        ("--from", Some(Path::new(&arguments.from))),
        ("the experiment", Some(arguments.experiment.as_path())),
        ("--lines", lines),
        ("--frames", arguments.frames.as_deref()),
        ("--state", arguments.state.as_deref()),
        ("--report", arguments.report.as_deref()),
        ("--metrics", arguments.metrics.as_deref()),
    ];
    let mut before: Vec<(&str, PathBuf)> = Vec::new();
    for (option, path) in named.into_iter().chain(kept.map(|path| ("--to", Some(Path::new(path))))) {
        let Some(path) = path.filter(|path| *path != Path::new("-")) else { continue };
        let place = place_of(path);
        // What is no file, such as `/dev/null`, is not replaced.
        if place.exists() && !place.is_file() {
            continue;
        }
        if let Some((other, _)) = before.iter().find(|(_, own)| *own == place) {
            let why = format!("{other} and {option} name one file, {}; give each its own", path.display());
            return Err(CommandEnding::Wrong(why));
        }
        before.push((option, place));
    }
    Ok(())
}

/// Where a path leads, whether there is something or not.
fn place_of(path: &Path) -> PathBuf {
    if let Ok(place) = path.canonicalize() {
        return place;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    path.file_name().map_or_else(|| path.to_owned(), |name| folder.join(name))
}

/// Standard output, whose reader may go.
struct StandardOutput {
    /// Whether the stream goes on without it.
    goes_on: bool,
    is_gone: bool,
}

impl StandardOutput {
    fn taken<T>(&mut self, taken: io::Result<T>, instead: T) -> io::Result<T> {
        match taken {
            Err(e) if e.kind() == ErrorKind::BrokenPipe && self.goes_on => {
                line(format_args!("nobody reads standard output any more; the other outputs go on"));
                self.is_gone = true;
                Ok(instead)
            }
            Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(named_error("standard output", &e)),
            taken => taken,
        }
    }
}

impl Write for StandardOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.is_gone {
            return Ok(bytes.len());
        }
        let taken = io::stdout().write(bytes);
        self.taken(taken, bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.is_gone {
            return Ok(());
        }
        let taken = io::stdout().flush();
        self.taken(taken, ())
    }
}

/// An output whose errors say what it is.
struct NamedOutput<W> {
    name: String,
    output: W,
}

impl<W: Write> Write for NamedOutput<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.output.write(bytes).map_err(|e| named_error(&self.name, &e))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush().map_err(|e| named_error(&self.name, &e))
    }
}

fn named_error(name: &str, e: &io::Error) -> io::Error {
    io::Error::new(e.kind(), format!("{name}: {e}"))
}

/// The summary for people.
fn text(summary: &StreamSummary) -> String {
    let order = &summary.received.order;
    let mut text = String::new();
    for answer in &summary.answer {
        text += &format!("{answer}\n");
    }
    text += &format!("{} samples estimated, {} events\n", summary.estimated, summary.events);
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
        (order.misplaced, "samples had a time that does not fit those around them, and were left out"),
        (order.same_time, "frames had the time of the one before, and were left out"),
        (received.passed_over, "samples were acknowledged by an earlier run"),
        (received.damaged_lines, "lines were no samples"),
        (received.damaged_bytes, "bytes were outside of any frame"),
        (received.damaged_frames, "frames had another checksum than they state, and were left out"),
        (received.cut_off, "lines or frames had no end, which may have cut them off, and were left out"),
        (received.steps_back, "times the clock went back"),
        (received.turned_away, "clients connected and sent no sample"),
        (received.breaks, "times the connection broke"),
        (received.reconnections, "times the connection was restored"),
        (summary.stretches.restarts as u64, "times the estimate began again"),
        (summary.not_estimated, "samples have no estimate"),
        (summary.stopped, "times a filter stopped, as its state or covariance was no number"),
        (summary.disturbed, "times a sample disturbed a filter that was settling"),
        (summary.restarted, "times a filter that was settling was started again from the signal"),
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
    for (filter, steps) in summary.step_errors.iter().filter(|(_, steps)| steps.is_remarkable()) {
        text += &format!("`{filter}`: {steps}\n");
    }
    if let Some(origin) = &summary.origin {
        text += &format!("{}\n", origin.sentence());
    }
    for finding in &summary.diagnosis {
        text += &format!("{finding}\n");
    }
    if let Some(sustained_hz) = summary.sustained_hz {
        let behind = if sustained_hz < summary.rate_hz {
            ": fewer than come, so that estimates of a live stream fall behind; a larger `every`, fewer filters or fewer samples help"
        } else {
            ""
        };
        text += &format!(
            "{:.0} samples could be estimated in a second, of {:.0} that come{behind}\n",
            sustained_hz, summary.rate_hz
        );
    }
    let latency = &summary.latency;
    let micro = |d: Duration| format!("{:.0} µs", d.as_secs_f64() * 1e6);
    let quantiles = [0.5, 0.9, 0.99, 0.999].map(|share| latency.quantile(share).map(micro));
    if let [Some(half), Some(ninth), Some(hundredth), Some(thousandth)] = quantiles {
        text += &format!(
            "from arrival to estimate, which waits for the next {} sample{}: half within {half}, 90 % {ninth}, 99 % {hundredth}, 99.9 % {thousandth}, \
             all {}\n",
            summary.waits_for,
            if summary.waits_for == 1 { "" } else { "s" },
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

//! What a file of data holds, without any experiment file.
//!
//! The time column and the column that tells records apart are recognised by rule, and the inspection says by
//! which. A file that cannot be used as a recording is inspected all the same, as far as its columns can be told.

mod channel;
mod character;
mod course;
mod envelope;
mod pipe;
mod plot;
mod quantity;
mod reduced_segment;
mod spectrum;
mod statistics;
mod survey;
#[cfg(test)]
mod tests;
mod text;
mod unitless_time;

pub use character::{Character, SwingCourse};
pub use course::ChannelCourse;
pub use envelope::{Envelope, EnvelopePoint, envelope};
pub use quantity::{fitting_unit, quantity};
pub use spectrum::magnitudes as spectrum_magnitudes;
pub use spectrum::{MOST_LINES, SegmentLines, SignalLine, WINDOW};
pub use statistics::Statistics;
pub use unitless_time::{StatedFile, StatedTime, UnitlessTime};

use crate::recording::plural;
use crate::recording::request::{ColumnSelection, ReadRequest};
use crate::recording::{
    Finding, FindingKind, ReadError, RecordingSource, Restarts, SATURATION_RUN, Severity, Stretch,
    StretchSize, Stretches, TimeOrigin, TimeSource,
};
use channel::ChannelDraft;
use reduced_segment::ReducedSegment;
use serde::Serialize;
use std::ops::{ControlFlow, Range};
use std::path::Path;

/// What a file holds.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// The file.
    pub source: RecordingSource,
    /// The number of rows.
    pub rows: usize,
    /// What was recognised, and why, in sentences.
    pub recognised: Vec<String>,
    /// The time column, where there is one.
    pub time: Option<String>,
    /// A column that may be the time and has no unit, where no column is the time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unitless_time: Option<UnitlessTime>,
    /// The column that tells records apart, where there is one.
    pub segment_column: Option<String>,
    /// The records.
    pub segments: Vec<SegmentSummary>,
    /// The channels.
    pub channels: Vec<InspectedChannel>,
    /// The window of the spectra.
    pub window: &'static str,
    /// The unit of the frequencies: `Hz`, or `1/sample` where there is no time column.
    pub frequency_unit: &'static str,
    /// All that was found, what would keep the file from being used first.
    pub diagnosis: Vec<Finding>,
    /// Checks that the file did not allow, and why, in words that follow "not checked".
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unchecked: Vec<String>,
    /// What every check ran for and did not find, such as "missing".
    #[serde(skip)]
    checked: Vec<&'static str>,
    #[serde(skip)]
    timed: bool,
    /// The longest segment, the first of several, and its interval.
    #[serde(skip)]
    longest: Option<(usize, ReducedSegment, Option<f64>)>,
}

/// Rows of a stretch where there are few columns, and the numbers that it holds at most: a segment that fits in it is
/// looked at as a whole, a longer one in stretches.
const ROWS: usize = 1 << 18;
const NUMBERS: usize = 1 << 20;

/// How many cycles a close-up shows.
pub const CYCLES: f64 = 6.0;

/// A record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentSummary {
    /// Its label; empty where the file is one record.
    pub label: String,
    /// Which stretch of its record it is, where the clock went back before it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stretch: Option<usize>,
    /// The number of its rows.
    pub rows: usize,
    /// Its first time, where there is a time column.
    pub start_s: Option<f64>,
    /// From its first time to its last.
    pub duration_s: Option<f64>,
    /// The inverse of the median interval.
    pub rate_hz: Option<f64>,
    /// Whether all intervals are the median one.
    pub uniform: bool,
}

/// A channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InspectedChannel {
    /// Its name in the file.
    pub column: String,
    /// Its unit in the file; empty where its name ends with none.
    pub unit: String,
    /// The unit of all figures here.
    pub si_unit: String,
    /// Figures over all rows.
    #[serde(flatten)]
    pub statistics: Statistics,
    /// The main lines of the longest segment that is uniform and without gaps.
    pub spectrum: Option<SegmentLines>,
    /// Why there is no spectrum, where there is none.
    pub no_spectrum: Option<String>,
    /// What of its course the figures do not show.
    #[serde(skip)]
    pub course: ChannelCourse,
}

/// A channel in few points, for a figure: a point spans from its time to the next one's.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSeries {
    /// The times where the points begin, in seconds, or row numbers where there is no time column.
    pub start: Vec<f64>,
    /// The lowest value of each, in SI.
    pub minimum: Vec<f64>,
    /// The highest value of each, in SI.
    pub maximum: Vec<f64>,
    /// How many values are missing.
    pub missing: usize,
}

/// Values as a small plot of braille dots for a terminal, in lines of `width` characters.
pub fn sketch(values: &[f64], width: usize, height: usize) -> Vec<String> {
    plot::plot(&envelope(values, 2 * width), values.len(), width, height)
}

/// Inspects a file.
pub fn inspect(path: &Path) -> Result<Inspection, ReadError> {
    inspect_with(path, &mut |_, _| ControlFlow::Continue(()))
}

/// Inspects a file and calls `progress` now and then with the bytes read and the bytes in all; as it is read twice,
/// these are twice its length. Where `progress` breaks, the inspection ends with [`ReadError::Interrupted`].
///
/// The memory does not grow with the file. A segment of more than 2^18 rows (fewer where there are more than four columns) is
/// looked at in stretches of as many: its spectrum is the mean over them, and a plot of all is drawn from at least 4096
/// pieces. A pipe is read once; what its columns are is told from its beginning.
pub fn inspect_with(
    path: &Path,
    progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Result<Inspection, ReadError> {
    inspect_stated(path, &StatedFile::default(), progress)
}

/// Inspects a file as [`inspect_with`] does, read as it is stated.
pub fn inspect_stated(
    path: &Path,
    stated: &StatedFile,
    progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Result<Inspection, ReadError> {
    let hints = &stated.hints;
    let (survey, table) =
        pipe::survey(path, stated, &mut |done, total| progress(done, total.saturating_mul(2)))?;
    let declared: Vec<_> = stated.time.as_ref().map(StatedTime::declared).into_iter().collect();
    let clock = match (&survey.time, stated.rate_hz) {
        (_, Some(rate_hz)) => TimeSource::Rate { rate_hz, start_s: 0.0 },
        (Some(name), None) => TimeSource::Column(name.clone()),
        // A row is a sample.
        (None, None) => TimeSource::Rate { rate_hz: 1.0, start_s: 0.0 },
    };
    let request = ReadRequest {
        clock: &clock,
        segment_column: survey.segment.as_deref(),
        columns: ColumnSelection::AllBut(&survey.text),
        declared: &declared,
        hints,
        nominal_rate_hz: None,
        origin: None,
        restarts: Some(Restarts::WHERE_THE_CLOCK_GOES_BACK),
    };
    let rows = (NUMBERS / table.description().columns.len().max(1)).clamp(4096, ROWS);
    let around = StretchSize { rows, first: rows, before: 1, after: 0 };
    let line = usize::try_from(table.header_line()).unwrap_or(usize::MAX);
    let mut stretches = Stretches::of_table(table, path, &request, around)?;
    // It may be a file that was not meant: what it holds is not shown.
    if !survey.holds_numbers {
        return Err(ReadError::without_numbers(path, line));
    }
    let timed = survey.time.is_some() || stated.rate_hz.is_some();
    let mut draft = RunningInspection { timed, rows, ..RunningInspection::default() };
    while let Some(stretch) = stretches.next_of_any(false, &mut |done, total| {
        progress(total.saturating_add(done), total.saturating_mul(2))
    })? {
        draft.take(&stretch);
        stretches.reuse(stretch);
    }
    let rows = stretches.rows();
    let (source, mut diagnosis) = stretches.finish();
    if let Some((column, detail)) = survey.mixed {
        let finding = Finding::of_column(FindingKind::MixedRows, &column, line + 1, rows, detail);
        diagnosis.insert(0, finding);
    }
    if rows == 0 {
        return Err(ReadError::Unusable { file: path.display().to_string(), findings: diagnosis });
    }
    let channels: Vec<InspectedChannel> = draft.channels.into_iter().map(ChannelDraft::finish).collect();
    let (checked, unchecked) = checks(timed, &draft.segments, &channels, &survey.text);
    let mut recognised = vec![format!("{}.", source.format)];
    recognised.extend(survey.sentences);
    recognised.extend(source.origin.as_ref().map(TimeOrigin::sentence));
    Ok(Inspection {
        source,
        rows,
        recognised,
        time: survey.time,
        unitless_time: survey.unitless_time,
        segment_column: survey.segment,
        segments: draft.segments,
        channels,
        window: WINDOW,
        frequency_unit: if timed { "Hz" } else { "1/sample" },
        diagnosis,
        unchecked,
        checked,
        timed,
        longest: draft.longest,
    })
}

/// The checks that ran, as what they look for, and those that did not, as far as they did not.
fn checks(
    timed: bool,
    segments: &[SegmentSummary],
    channels: &[InspectedChannel],
    left_out: &[String],
) -> (Vec<&'static str>, Vec<String>) {
    let (mut checked, mut unchecked) = (Vec::new(), Vec::new());
    let rows: Vec<usize> = segments.iter().map(|segment| segment.rows).collect();
    if channels.is_empty() {
        unchecked.push("any signal, as no column is one".to_owned());
    } else {
        checked.push("missing");
    }
    let mut look = |word, what: &str, rows: &[usize], least: usize| match long_enough(rows, least) {
        Ok(()) => checked.push(word),
        Err(why) => unchecked.push(format!("{what}, {why}")),
    };
    if timed {
        look("irregular", "whether the times are regular", &rows, 3);
    }
    if !channels.is_empty() {
        // A run at a rail is compared with as many rows before and after it.
        look("saturated", "whether a signal is saturated", &rows, 3 * SATURATION_RUN);
        // A recording of one record is looked at as a whole, a record among others where it is longer than a run.
        let records = rows_of_records(segments);
        let least = if records.len() > 1 { SATURATION_RUN } else { 2 };
        look("constant", "whether a signal is constant", &records, least);
    }
    if !timed {
        unchecked.push("whether the times are regular, as no column is the time".to_owned());
    }
    let few = channels.iter().filter(|channel| {
        let statistics = &channel.statistics;
        rows.iter().any(|rows| *rows >= 3 * SATURATION_RUN) && statistics.count < 3 * SATURATION_RUN
    });
    for InspectedChannel { column, statistics, .. } in few {
        unchecked.push(format!(
            "whether `{column}` is saturated or constant, as it has no more than {} values",
            statistics.count
        ));
    }
    if !left_out.is_empty() {
        let names: Vec<String> = left_out.iter().take(8).map(|name| format!("`{name}`")).collect();
        let more = if left_out.len() > 8 { ", …" } else { "" };
        unchecked.push(format!("the columns that are left out ({}{more})", names.join(", ")));
    }
    (checked, unchecked)
}

/// Whether each of some segments has so many rows, and otherwise in which the check did not run.
fn long_enough(rows: &[usize], least: usize) -> Result<(), String> {
    let short = rows.iter().filter(|rows| **rows < least).count();
    let longest = rows.iter().max().copied().unwrap_or(0);
    match short {
        0 => Ok(()),
        _ if short == rows.len() => Err(format!("as no segment has more than {}", plural(longest, "row"))),
        _ => Err(format!("in {} of fewer than {least} rows", plural(short, "segment"))),
    }
}

/// The rows of each record, whose stretches are counted together.
fn rows_of_records(segments: &[SegmentSummary]) -> Vec<usize> {
    let mut records = Vec::new();
    for segment in segments {
        match records.last_mut() {
            Some(rows) if segment.stretch.is_some() => *rows += segment.rows,
            _ => records.push(segment.rows),
        }
    }
    records
}

/// An inspection that goes on.
#[derive(Default)]
struct RunningInspection {
    timed: bool,
    /// Rows of a stretch.
    rows: usize,
    segments: Vec<SegmentSummary>,
    channels: Vec<ChannelDraft>,
    present: Option<ReducedSegment>,
    longest: Option<(usize, ReducedSegment, Option<f64>)>,
}

impl RunningInspection {
    fn take(&mut self, stretch: &Stretch) {
        let Some(segment) = stretch.recording.segments().first() else { return };
        let time = &segment.time;
        let finite = |value: f64| Some(value).filter(|v| self.timed && v.is_finite());
        if stretch.begins {
            self.segments.push(SegmentSummary {
                label: segment.label.clone(),
                stretch: Some(segment.stretch.number).filter(|number| *number > 1),
                rows: 0,
                start_s: finite(time.at(stretch.fresh.start)),
                duration_s: None,
                rate_hz: time.interval_s().map(f64::recip).and_then(finite),
                uniform: true,
            });
            self.present = Some(ReducedSegment::begin(stretch));
        } else if let Some(present) = &mut self.present {
            present.add(stretch, self.rows);
        }
        let Some(summary) = self.segments.last_mut() else { return };
        summary.rows += stretch.fresh.len();
        summary.uniform &= time.is_uniform();
        if stretch.ends {
            let last = time.at(stretch.fresh.end.saturating_sub(1));
            summary.duration_s = summary.start_s.and_then(|start| finite(last - start));
        }
        let columns = stretch.recording.columns();
        if self.channels.is_empty() {
            self.channels = columns.iter().map(ChannelDraft::new).collect();
        }
        for (channel, column) in self.channels.iter_mut().zip(columns) {
            channel.take(stretch, column, summary);
        }
        if stretch.ends
            && let Some(present) = self.present.take()
            && self.longest.as_ref().is_none_or(|(_, longest, _)| present.rows() > longest.rows())
        {
            self.longest = Some((self.segments.len() - 1, present, time.interval_s()));
        }
    }
}

impl Inspection {
    /// Whether nothing was found that keeps the file from being used as a recording.
    pub fn is_usable(&self) -> bool {
        self.diagnosis.iter().all(|finding| finding.severity() != Severity::Fatal)
    }

    /// Whether its rows have times, from a column or from a stated rate.
    pub const fn is_timed(&self) -> bool {
        self.timed
    }

    /// The segment with the most rows, the first of several.
    pub fn longest_segment(&self) -> Option<&SegmentSummary> {
        self.segments.get(self.longest.as_ref()?.0)
    }

    /// The rows of the longest segment with the last [`CYCLES`] cycles of its slowest main line, where it holds so many more
    /// that they cannot be distinguished in a plot of all.
    pub fn close_up(&self) -> Option<Range<usize>> {
        let (_, kept, interval) = self.longest.as_ref()?;
        let main =
            |channel: &InspectedChannel| channel.spectrum.as_ref()?.lines.first().map(|line| line.frequency);
        let slowest = self.channels.iter().filter_map(main).fold(f64::INFINITY, f64::min);
        let interval = if self.timed { (*interval)? } else { 1.0 };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of rows, saturating
        let rows = (CYCLES / (slowest * interval)).ceil() as usize;
        let all = kept.rows();
        (rows >= 8 && rows.saturating_mul(5) <= all && rows <= kept.tail()).then(|| all - rows..all)
    }

    /// A channel over the longest segment, or over its [`close_up`](Self::close_up), in at most `points` points from which no
    /// extreme value is missing. `None` where there is no such channel.
    pub fn series(&self, column: &str, rows: Range<usize>, points: usize) -> Option<ChannelSeries> {
        let (_, kept, _) = self.longest.as_ref()?;
        let start = rows.start;
        let Envelope { points, missing } = self.envelope(column, rows, points)?;
        Some(ChannelSeries {
            start: points.iter().map(|point| kept.time(start + point.first)).collect(),
            minimum: points.iter().map(|point| point.minimum).collect(),
            maximum: points.iter().map(|point| point.maximum).collect(),
            missing,
        })
    }

    fn envelope(&self, column: &str, rows: Range<usize>, points: usize) -> Option<Envelope> {
        let channel = self.channels.iter().position(|channel| channel.column == column)?;
        Some(self.longest.as_ref()?.1.envelope(channel, rows, points))
    }

    /// The time of a row of the longest segment.
    fn time_of(&self, row: usize) -> f64 {
        self.longest.as_ref().map_or(f64::NAN, |(_, kept, _)| kept.time(row))
    }

    /// The inspection as text for a terminal, with a small plot of each channel.
    pub fn to_text(&self) -> String {
        text::render(self)
    }
}

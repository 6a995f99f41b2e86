//! What a file of data holds, without any experiment file.
//!
//! The time column and the column that tells records apart are recognised by rule, and the inspection says by
//! which. A file that cannot be used as a recording is inspected all the same, as far as its columns can be told.

mod envelope;
mod plot;
mod quantity;
mod spectrum;
mod statistics;
mod survey;
#[cfg(test)]
mod tests;
mod text;

pub use envelope::{Envelope, EnvelopePoint, envelope};
pub use spectrum::{Line, MOST_LINES, Spectrum, WINDOW};
pub use statistics::Statistics;

use crate::recording::read;
use crate::recording::request::{Request, Wanted};
use crate::recording::{Clock, Column, Finding, ReadError, Recording, Segment, Source};
use kalmems_formats::Hints;
use serde::Serialize;
use std::ops::{ControlFlow, Range};
use std::path::Path;

/// What a file holds.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// The file.
    pub source: Source,
    /// The number of rows.
    pub rows: usize,
    /// What was recognised, and why, in sentences.
    pub recognised: Vec<String>,
    /// The time column, where there is one.
    pub time: Option<String>,
    /// The column that tells records apart, where there is one.
    pub segment_column: Option<String>,
    /// The records.
    pub segments: Vec<SegmentSummary>,
    /// The channels.
    pub channels: Vec<Channel>,
    /// The window of the spectra.
    pub window: &'static str,
    /// The unit of the frequencies: `Hz`, or `1/sample` where there is no time column.
    pub frequency_unit: &'static str,
    /// All that was found, what would keep the file from being used first.
    pub diagnosis: Vec<Finding>,
    #[serde(skip)]
    recording: Recording,
}

/// How many cycles a close-up shows.
pub const CYCLES: f64 = 6.0;

/// A record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentSummary {
    /// Its label; empty where the file is one record.
    pub label: String,
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
pub struct Channel {
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
    pub spectrum: Option<Spectrum>,
    /// Why there is no spectrum, where there is none.
    pub no_spectrum: Option<String>,
}

/// A channel in few points, for a figure: a point spans from its time to the next one's.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The times where the points begin, in seconds, or row numbers where there is no time column.
    pub start: Vec<f64>,
    /// The lowest value of each, in SI.
    pub minimum: Vec<f64>,
    /// The highest value of each, in SI.
    pub maximum: Vec<f64>,
    /// How many values are missing.
    pub missing: usize,
}

/// Inspects a file.
pub fn inspect(path: &Path) -> Result<Inspection, ReadError> {
    inspect_with(path, &mut |_, _| ControlFlow::Continue(()))
}

/// Inspects a file and calls `progress` now and then with the bytes read and the bytes in all; as it is read twice,
/// these are twice its length. Where `progress` breaks, the inspection ends with [`ReadError::Interrupted`].
pub fn inspect_with(
    path: &Path,
    progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Result<Inspection, ReadError> {
    let hints = Hints::default();
    let table = kalmems_formats::open(path, &hints).map_err(|source| ReadError::of_format(path, source))?;
    let survey = survey::survey(table, path, &mut |done, total| progress(done, total.saturating_mul(2)))?;
    let clock = match &survey.time {
        Some(name) => Clock::Column(name.clone()),
        // A row is a sample.
        None => Clock::Rate { rate_hz: 1.0, start_s: 0.0 },
    };
    let request = Request {
        clock: &clock,
        segment_column: survey.segment.as_deref(),
        columns: Wanted::AllBut(&survey.text),
        hints: &hints,
    };
    let recording = read::read(path, &request, &mut |done, total| {
        progress(total.saturating_add(done), total.saturating_mul(2))
    })?;
    if recording.rows() == 0 {
        return Err(ReadError::Unusable {
            file: path.display().to_string(),
            findings: recording.diagnosis().to_vec(),
        });
    }
    let timed = survey.time.is_some();
    Ok(Inspection {
        source: recording.source().clone(),
        rows: recording.rows(),
        recognised: survey.sentences,
        time: survey.time,
        segment_column: survey.segment,
        segments: recording.segments().iter().map(|segment| summary(segment, timed)).collect(),
        channels: recording.columns().iter().map(|column| channel(column, &recording)).collect(),
        window: WINDOW,
        frequency_unit: if timed { "Hz" } else { "1/sample" },
        diagnosis: recording.diagnosis().to_vec(),
        recording,
    })
}

fn summary(segment: &Segment, timed: bool) -> SegmentSummary {
    let time = &segment.time;
    let finite = |value: f64| Some(value).filter(|v| timed && v.is_finite());
    SegmentSummary {
        label: segment.label.clone(),
        rows: segment.rows.len(),
        start_s: finite(time.start_s()),
        duration_s: finite(time.at(time.len().saturating_sub(1)) - time.start_s()),
        rate_hz: time.interval_s().map(f64::recip).and_then(finite),
        uniform: time.is_uniform(),
    }
}

fn channel(column: &Column, recording: &Recording) -> Channel {
    let found = lines(column, recording);
    Channel {
        column: column.header.column.clone(),
        unit: column.header.unit_text.clone(),
        si_unit: quantity::si_unit(&column.header),
        statistics: Statistics::of(&column.values),
        no_spectrum: found.as_ref().err().map(|reason| (*reason).to_owned()),
        spectrum: found.ok(),
    }
}

/// The spectrum of the longest segment that can have one, or why there is none.
fn lines(column: &Column, recording: &Recording) -> Result<Spectrum, &'static str> {
    let mut uniform: Vec<&Segment> = recording.segments().iter().filter(|s| s.time.is_uniform()).collect();
    // Stable, so that the first of several of the same length is taken.
    uniform.sort_by_key(|segment| std::cmp::Reverse(segment.rows.len()));
    if uniform.is_empty() {
        return Err("no segment has a uniform time");
    }
    let complete = |segment: &&&Segment| column.of(segment).iter().all(|v| v.is_finite());
    let Some(segment) = uniform.iter().find(complete) else {
        return Err("values are missing in every uniform segment");
    };
    let rate = segment.time.interval_s().map_or(f64::NAN, f64::recip);
    spectrum::spectrum(column.of(segment), rate, &segment.label).ok_or("the segments are too short")
}

impl Inspection {
    /// The recording as it was read, findings of any severity included.
    pub const fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The segment with the most rows, the first of several.
    pub fn longest_segment(&self) -> Option<&Segment> {
        self.recording.segments().iter().rev().max_by_key(|segment| segment.rows.len())
    }

    /// The rows of a segment with the last [`CYCLES`] cycles of its slowest main line, where it holds so many more
    /// that they cannot be told apart in a plot of all.
    pub fn close_up(&self, segment: &Segment) -> Option<Range<usize>> {
        let main = |channel: &Channel| channel.spectrum.as_ref()?.lines.first().map(|line| line.frequency);
        let slowest = self.channels.iter().filter_map(main).fold(f64::INFINITY, f64::min);
        let interval = if self.time.is_some() { segment.time.interval_s()? } else { 1.0 };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of rows, saturating
        let rows = (CYCLES / (slowest * interval)).ceil() as usize;
        let all = segment.rows.len();
        (rows >= 8 && rows.saturating_mul(5) <= all).then(|| all - rows..all)
    }

    /// Some rows of a channel over a segment in at most `points` points from which no extreme value is missing.
    pub fn series(
        &self,
        column: &str,
        segment: &Segment,
        rows: Range<usize>,
        points: usize,
    ) -> Result<Series, ReadError> {
        let start = rows.start;
        let values = self.recording.column(column)?.of(segment).get(rows).unwrap_or_default();
        let Envelope { points, missing } = envelope(values, points);
        Ok(Series {
            start: points.iter().map(|point| segment.time.at(start + point.first)).collect(),
            minimum: points.iter().map(|point| point.minimum).collect(),
            maximum: points.iter().map(|point| point.maximum).collect(),
            missing,
        })
    }

    /// The inspection as text for a terminal, with a small plot of each channel.
    pub fn to_text(&self) -> String {
        text::render(self)
    }
}

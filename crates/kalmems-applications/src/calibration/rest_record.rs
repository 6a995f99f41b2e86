//! The record at rest of a calibration file: read, divided at its gaps, and looked at for motion.

use super::error::CalibrationError;
use super::files::{InputFiles, columns, require_usable};
use super::motion::{RestMotion, motions};
use super::rest::{AxisAtRest, finite_runs};
use super::stretches::stretches;
use super::tone::AXES;
use crate::calibration::file::GyroscopeCalibration;
use crate::config::{Clock, Key};
use crate::recording::{SampledRecording, Segment};
use crate::units::kind;
use std::ops::Range;

/// What the record at rest shows.
#[derive(Default)]
pub(super) struct MeasuredRest {
    pub axes: Vec<AxisAtRest>,
    /// Motions in it, in sentences: it is none at rest.
    pub motions: Vec<String>,
    /// What else its reader has to know, in sentences.
    pub remarks: Vec<String>,
}

pub(super) fn measure(files: &mut InputFiles) -> Result<MeasuredRest, CalibrationError> {
    let file = files.file;
    let Some(record) = &file.rest else { return Ok(MeasuredRest::default()) };
    let (channels, layout) = (record.channels(&file.gyroscope), record.layout(&file.gyroscope));
    let path = file.resolve(&record.file, "");
    let recording = files.read(Key::from("rest").child("file"), &path, &layout)?;
    for segment in recording.segments() {
        require_usable(&recording, segment, &columns(Some(channels)))?;
    }
    let mut remarks = Vec::new();
    let time = RestTime::of(&recording, file, &mut remarks);
    let (mut rest, mut moves) = (Vec::<AxisAtRest>::new(), Vec::new());
    for axis in AXES {
        let Some(column) = channels.column(axis) else { continue };
        let values = &recording.column_of(column, &kind::ANGULAR_RATE)?.values;
        let whole = time.rows.iter().map(|rows| values.get(rows.clone()).unwrap_or_default());
        let runs: Vec<&[f64]> = whole.flat_map(finite_runs).collect();
        let place = || format!("{}, column `{column}`", path.display());
        let samples = runs.iter().map(|run| run.len()).sum();
        let found = AxisAtRest::of_stretches(axis, &runs, time.interval_s);
        rest.push(found.ok_or_else(|| CalibrationError::Rest { place: place(), samples })?);
        if runs.len() > 1 {
            let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0) as f64 * time.interval_s;
            remarks.push(format!(
                "{}: at rest it is in {} stretches, as samples or their numbers are missing between them; the longest lasts {:.4} s. \
                 No difference is taken across a gap, so that averaging times beyond half of that are not known.",
                place(),
                runs.len(),
                longest
            ));
        }
        let all_finite = values.iter().enumerate().filter(|(_, value)| value.is_finite());
        let rows: Vec<usize> = all_finite.map(|(row, _)| row).collect();
        for motion in motions(&runs) {
            let said = describe(&motion, &recording, &rows, time.interval_s);
            moves.push(format!("{}: the record is called one at rest, and {said}", place()));
        }
        let found = rest.last();
        if let Some(why) = found.and_then(|found| found.not_fitted.as_ref()) {
            remarks.push(format!("{}: {why}.", place()));
        }
        if let Some(fit) = found.and_then(|found| found.noise_fit).filter(|fit| fit.left_out > 0) {
            remarks.push(format!(
                "{}: the fit of the noise begins at an averaging time of {:.4} s: at shorter ones the deviations are not those of \
                 quantisation, white noise behind a low pass of first order, flicker and a random walk.",
                place(),
                fit.from_s
            ));
        }
        if let Some(drift) = found.and_then(|found| found.drift) {
            remarks.push(format!(
                "{}: the second half of the record lies {drift:+.3e} rad/s from the first, more than white noise and flicker explain: the bias drifts, \
                 as it does while a unit warms up. The fitted random walk holds for this record and not for a unit in thermal equilibrium.",
                place()
            ));
        }
    }
    Ok(MeasuredRest { axes: rest, motions: moves, remarks })
}

/// The rows between gaps in time, and the interval of their samples in s.
struct RestTime {
    rows: Vec<Range<usize>>,
    interval_s: f64,
}

impl RestTime {
    fn of(recording: &SampledRecording, file: &GyroscopeCalibration, remarks: &mut Vec<String>) -> Self {
        let place = &recording.source().file;
        let mut rows = Vec::new();
        // By the number of samples, as the interval of a longer segment is known better.
        let (mut weight, mut sum) = (0.0, 0.0);
        for segment in recording.segments() {
            let start = segment.rows.start;
            let whole = || std::iter::once(0..segment.rows.len()).collect();
            let regular = segment.time.interval_s().filter(|_| segment.time.is_uniform());
            let (found, interval_s) = match regular {
                Some(interval_s) => (whole(), interval_s),
                None => match stretches(&segment.time.to_vec()) {
                    Some(found) => {
                        remarks.extend(irregular(place, segment, &found));
                        (found.rows, found.interval_s)
                    }
                    None => (whole(), f64::NAN),
                },
            };
            rows.extend(found.into_iter().map(|rows| start + rows.start..start + rows.end));
            if interval_s.is_finite() {
                weight += segment.rows.len() as f64;
                sum += segment.rows.len() as f64 * interval_s;
            }
        }
        let interval_s = match recording.segments() {
            [one] if one.time.is_uniform() => one.time.interval_s().unwrap_or(f64::NAN),
            _ => sum / weight,
        };
        remarks.extend(off_nominal(place, interval_s, file));
        Self { rows, interval_s }
    }
}

/// What a reader has to know of times that are not equidistant.
fn irregular(place: &str, segment: &Segment, found: &super::stretches::RecordStretches) -> Vec<String> {
    let of = if segment.label.is_empty() { String::new() } else { format!(", segment `{}`", segment.label) };
    let mut said = Vec::new();
    if found.burst > 1 {
        said.push(format!(
            "{place}{of}: the times come in bursts of up to {} samples, as a host gives them; the samples count as equidistant, \
             {:.6} Hz over the whole. Where the rate is known, write `clock = {{ rate = \"…\" }}`.",
            found.burst,
            found.interval_s.recip()
        ));
    }
    if let Some([gap_s, before_s]) = found.longest_gap {
        let places = match found.rows.len() - 1 {
            1 => "one place".to_owned(),
            several => format!("{several} places"),
        };
        said.push(format!(
            "{place}{of}: samples are missing in {places}; the longest gap is one of {gap_s:.6} s after {before_s} s."
        ));
    }
    said
}

/// What a column of times shows beside the nominal rate.
fn off_nominal(place: &str, interval_s: f64, file: &GyroscopeCalibration) -> Option<String> {
    let record = file.rest.as_ref()?;
    let Some(Clock::Column(_)) = record.clock else { return None };
    let unit = &file.gyroscope;
    let (nominal, tolerance) = (unit.rate.si(), unit.clock_tolerance.as_ref()?.si());
    let off = interval_s.recip() / nominal - 1.0;
    // The rounding of a rate that is written with few digits is none of the clock.
    let is_off = off.abs() > tolerance + 1e-6;
    is_off.then(|| {
        format!(
            "{place}: its times show {:.6} Hz, {:+.3} % off the nominal rate of `{}`, and `clock_tolerance` is {:.3} %: the rate \
             of the times is used. If the unit gave its samples at another rate here, write `clock = {{ rate = \"…\" }}`; \
             otherwise correct `gyroscope.rate` or the tolerance.",
            interval_s.recip(),
            100.0 * off,
            unit.rate.text(),
            100.0 * tolerance
        )
    })
}

fn describe(motion: &RestMotion, recording: &SampledRecording, rows: &[usize], interval_s: f64) -> String {
    let time = |sample: usize| {
        let row = rows.get(sample.min(rows.len().saturating_sub(1))).copied().unwrap_or(0);
        let segment = recording.segments().iter().find(|segment| segment.rows.contains(&row));
        segment.map_or(f64::NAN, |segment| segment.time.at(row - segment.rows.start))
    };
    match motion {
        RestMotion::Passing { samples, times } => format!(
            "between {:.6} s and {:.6} s it moves: the standard deviation there is up to {times:.1} times the usual (noise alone \
             shows that in less than one record of 1000). Leave that time out: bias, noise and deviations are not those of rest.",
            time(samples.start),
            time(samples.end.saturating_sub(1)),
        ),
        RestMotion::Line { frequency, amplitude } => format!(
            "a line of {amplitude:.3e} rad/s at {:.6} Hz stands out of its noise (noise alone shows one in less than one record \
             of 1000): it vibrates, or something interferes. The deviations at times about half a cycle of it are not those of \
             rest.",
            frequency / interval_s
        ),
    }
}

//! What the estimators see of a segment.

use super::columns;
use super::drive::Drive;
use super::settings::Settings;
use crate::config::Experiment;
use crate::estimate::{EstimateError, Motion, Trajectory};
use crate::recording::Recording;
use crate::rigs::{Axis, SegmentEstimate};
use crate::units::kind;
use std::f64::consts::TAU;

/// One segment of a recording as the estimators see it.
#[derive(Clone, Debug)]
pub struct SegmentData<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The demodulated signal in V.
    pub signal: &'a [f64],
    /// The drive.
    pub drive: Drive<'a>,
    /// The usual interval between samples in s.
    pub interval_s: f64,
}

/// Estimates every segment of a recording. `each` is given a name of the segment for messages, and says what the axes
/// are, the first one's first, and what the filters make of them.
///
/// A segment without a signal is refused, and one whose drive is not known throughout.
pub fn estimate_segments(
    (experiment, index): (&Experiment, usize),
    recording: &Recording,
    skip_s: f64,
    each: impl Fn(&str, &SegmentData) -> Result<(Axis, Vec<Axis>, Vec<Trajectory>), EstimateError>,
) -> Result<Vec<SegmentEstimate>, EstimateError> {
    let [drive_column, signal_column] = columns(experiment, index)?;
    let drive = recording.column_of(drive_column, &kind::VOLTAGE)?;
    let signal = recording.column_of(signal_column, &kind::VOLTAGE)?;
    let mut estimates = Vec::new();
    for segment in recording.segments() {
        let place = match segment.label.as_str() {
            "" => recording.source().file.clone(),
            label => format!("{}, segment `{label}`", recording.source().file),
        };
        let time_s = segment.time.to_vec();
        let Some(interval_s) = segment.time.interval_s() else {
            return Err(EstimateError::TooShort { place, found_s: 0.0, skip_s });
        };
        let data = SegmentData::new(&time_s, drive.of(segment), signal.of(segment), interval_s);
        if !data.signal.iter().any(|y| y.is_finite()) {
            return Err(EstimateError::NoSignal { place, column: signal_column.to_owned() });
        }
        if let Some((first_s, count)) = data.drive.unknown(interval_s) {
            let column = drive_column.to_owned();
            return Err(EstimateError::DriveUnknown { place, column, count, first_s });
        }
        let (axis, other_axes, trajectories) = each(&place, &data)?;
        estimates.push(SegmentEstimate {
            segment: segment.clone(),
            drive_column: drive_column.to_owned(),
            signal_column: signal_column.to_owned(),
            drive: axis.drive,
            motion: axis.motion,
            other_axes,
            skip_s,
            parts: 1,
            trajectories,
        });
    }
    Ok(estimates)
}

impl<'a> SegmentData<'a> {
    /// Takes the samples: time in s, drive and signal in V; `interval_s` is the usual one.
    pub fn new(time_s: &'a [f64], drive: &'a [f64], signal: &'a [f64], interval_s: f64) -> Self {
        Self { time_s, signal, drive: Drive::new(time_s, drive, interval_s), interval_s }
    }

    /// The end of the settling time in s; refused where ten cycles of the slowest motion do not follow it.
    pub fn scored_from(&self, place: &str, skip_s: f64, slowest_hz: f64) -> Result<f64, EstimateError> {
        let [first, last] = [self.time_s.first(), self.time_s.last()].map(|t| t.copied().unwrap_or(0.0));
        if last - first < skip_s + 10.0 / slowest_hz {
            return Err(EstimateError::TooShort { place: place.to_owned(), found_s: last - first, skip_s });
        }
        Ok(first + skip_s)
    }

    /// How fast the mirror moves: at half the frequency of a steady drive, else at its own.
    pub fn motion(&self, settings: &Settings) -> Motion {
        match self.drive.sine() {
            Some(sine) => Motion { frequency_hz: sine.frequency_hz / 2.0, is_driven: true },
            None => Motion {
                frequency_hz: settings.hardware.scanner.resonator.natural_rate() / TAU,
                is_driven: false,
            },
        }
    }

    /// The first drive peak after the settling time; the end of the settling time where there is none.
    pub fn first_drive_peak(&self, settings: &Settings) -> f64 {
        let start = self.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
        self.drive.sine().map_or(start, |sine| sine.peak_after(start))
    }
}

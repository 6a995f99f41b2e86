//! A recording, segment by segment.

use super::{EstimateError, Motion, Trajectory};
use crate::recording::{Recording, Segment};
use crate::signal::Sine;
use crate::units::Kind;

/// What the filters say of one segment.
#[derive(Clone, Debug)]
pub struct SegmentEstimate {
    /// The segment.
    pub segment: Segment,
    /// The column of the drive in V, by its name.
    pub drive_column: String,
    /// The column of the signal, by its name.
    pub signal_column: String,
    /// What the signal is.
    pub signal_kind: &'static Kind,
    /// The drive, where it is a steady sine.
    pub drive: Option<Sine>,
    /// How fast the device moves.
    pub motion: Motion,
    /// The axes beside the one that `drive` and `motion` are of.
    pub other_axes: Vec<Axis>,
    /// How long the filters have to settle, in s.
    pub skip_s: f64,
    /// In how many parts of its duration it is judged beside the whole; 1 for the whole alone.
    pub parts: u32,
    /// What a reader of the figures has to know and cannot see from them, in sentences.
    pub remarks: Vec<String>,
    /// One per filter.
    pub trajectories: Vec<Trajectory>,
}

/// One axis of several.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// The name of its angle among the states.
    pub angle: &'static str,
    /// How fast it moves.
    pub motion: Motion,
    /// Its part of the drive, where that is a steady sine.
    pub drive: Option<Sine>,
}

impl SegmentEstimate {
    /// The end of the settling time in s.
    pub fn from_s(&self) -> f64 {
        self.segment.time.start_s() + self.skip_s
    }
}

/// One segment and its signal, on the way to an estimate.
#[derive(Clone, Copy, Debug)]
pub struct SignalSegment<'a> {
    /// The segment.
    pub segment: &'a Segment,
    /// What messages call it: the file, and the segment's label where it has one.
    pub place: &'a str,
    /// When, in s.
    pub time_s: &'a [f64],
    /// The signal, with at least one finite sample.
    pub signal: &'a [f64],
    /// Its column.
    pub signal_column: &'a str,
    /// What it is.
    pub signal_kind: &'static Kind,
    /// The usual interval between samples in s.
    pub interval_s: f64,
    /// How long the filters have to settle, in s.
    pub skip_s: f64,
}

/// Estimates these segments of a recording, which has a signal in this column, of this kind.
///
/// A segment of less than two samples is refused, and one without a signal.
pub fn estimate_segments<'a>(
    recording: &Recording,
    segments: impl IntoIterator<Item = &'a Segment>,
    (column, signal_kind): (&str, &'static Kind),
    skip_s: f64,
    each: impl Fn(&SignalSegment) -> Result<SegmentEstimate, EstimateError>,
) -> Result<Vec<SegmentEstimate>, EstimateError> {
    let signal = recording.column_of(column, signal_kind)?;
    let one = |segment: &Segment| {
        let place = match segment.label.as_str() {
            "" => recording.source().file.clone(),
            label => format!("{}, segment `{label}`", recording.source().file),
        };
        let Some(interval_s) = segment.time.interval_s() else {
            return Err(EstimateError::TooShort { place, found_s: 0.0, skip_s });
        };
        let signal = signal.of(segment);
        if !signal.iter().any(|y| y.is_finite()) {
            return Err(EstimateError::NoSignal { place, column: column.to_owned() });
        }
        let time_s = &segment.time.to_vec();
        let place = place.as_str();
        let signal_column = column;
        each(&SignalSegment {
            segment,
            place,
            time_s,
            signal,
            signal_column,
            signal_kind,
            interval_s,
            skip_s,
        })
    };
    segments.into_iter().map(one).collect()
}

/// Refuses samples that do not last this long after the settling time, all in s; `place` names them in the message.
pub(super) fn require_after_settling(
    place: &str,
    time_s: &[f64],
    skip_s: f64,
    lasting_s: f64,
) -> Result<(), EstimateError> {
    let found_s = time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first);
    if found_s < skip_s + lasting_s {
        return Err(EstimateError::TooShort { place: place.to_owned(), found_s, skip_s });
    }
    Ok(())
}

impl SignalSegment<'_> {
    /// Refuses a segment that does not last this long after the settling time, in s.
    pub fn require_after_settling(&self, lasting_s: f64) -> Result<(), EstimateError> {
        require_after_settling(self.place, self.time_s, self.skip_s, lasting_s)
    }

    /// What the filters say of it, of a device with one axis and no drive.
    pub fn estimated(&self, motion: Motion, trajectories: Vec<Trajectory>) -> SegmentEstimate {
        SegmentEstimate {
            segment: self.segment.clone(),
            drive_column: String::new(),
            signal_column: self.signal_column.to_owned(),
            signal_kind: self.signal_kind,
            drive: None,
            motion,
            other_axes: Vec::new(),
            skip_s: self.skip_s,
            parts: 1,
            remarks: Vec::new(),
            trajectories,
        }
    }
}

//! What the estimators see of a segment with a drive.

use super::SegmentDrive;
use crate::estimate::{
    AngleAxis, EstimateError, LockInWindows, Past, SampleSelection, SegmentEstimate, SignalSegment,
    Trajectory,
};
use crate::progress::{Interruption, Progress};
use crate::units::kind;

/// Rows of a segment with a drive voltage, as the estimators see them.
#[derive(Clone, Debug)]
pub struct DrivenSegment<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The signal in V.
    pub signal: &'a [f64],
    /// The drive.
    pub drive: SegmentDrive<'a>,
    /// The usual interval between samples in s.
    pub interval_s: f64,
    /// Which of them are new.
    pub samples: SampleSelection,
    /// When the segment began, in s.
    pub start_s: f64,
}

impl<'a> DrivenSegment<'a> {
    /// Takes all samples of a segment: time in s, drive and signal in V; `interval_s` is the usual one.
    pub fn new(time_s: &'a [f64], drive: &'a [f64], signal: &'a [f64], interval_s: f64) -> Self {
        Self {
            time_s,
            signal,
            drive: SegmentDrive::new(time_s, drive, interval_s),
            interval_s,
            samples: SampleSelection::whole(time_s.len(), interval_s),
            start_s: time_s.first().copied().unwrap_or(0.0),
        }
    }

    /// A part of a segment with the drive in this column; refused where the drive is not known throughout, and where it is stopped.
    pub fn of(
        segment: &'a SignalSegment<'a>,
        drive_column: &str,
        past: &mut Past,
        progress: &dyn Progress,
    ) -> Result<Self, EstimateError> {
        let column = (segment.recording.column_of(drive_column, &kind::VOLTAGE)?, segment.segment);
        let samples = segment.samples();
        let stop = Interruption::by(progress);
        let drive = SegmentDrive::of_column(column, &segment.time_s, &samples, &mut past.drive, &stop);
        if stop.is_requested() {
            return Err(EstimateError::Interrupted);
        }
        if let Some((first_s, count)) = drive.unknown() {
            let (place, column) = (segment.place.clone(), drive_column.to_owned());
            return Err(EstimateError::DriveUnknown { place, column, count, first_s });
        }
        let SignalSegment { signal, interval_s, start_s, .. } = *segment;
        Ok(Self { time_s: &segment.time_s, signal, drive, interval_s, samples, start_s })
    }

    /// Its samples as a lock-in takes them that has windows of this length in s, with these signals, such as its own.
    pub fn windows<'b>(&'b self, signals: &'b [&'b [f64]], length_s: f64) -> LockInWindows<'b> {
        LockInWindows {
            time_s: self.time_s,
            signals,
            samples: &self.samples,
            start_s: self.start_s,
            length_s,
        }
    }

    /// The end of the settling time in s.
    pub fn scored_from(&self, skip_s: f64) -> f64 {
        self.start_s + skip_s
    }
}

/// Cycles of the slowest motion that have to follow the settling time.
const CYCLES: f64 = 10.0;

impl SignalSegment<'_> {
    /// Refuses a segment in which ten cycles of the slowest motion do not follow the settling time.
    pub fn require_cycles(&self, slowest_hz: f64) -> Result<(), EstimateError> {
        self.require_after_settling(CYCLES / slowest_hz)
    }

    /// What the filters say of it, of a device with a drive: of its first axis, and of others.
    pub fn estimated_under(
        &self,
        drive_column: &str,
        (axis, other_axes): (AngleAxis, Vec<AngleAxis>),
        trajectories: Vec<Trajectory>,
    ) -> SegmentEstimate {
        SegmentEstimate {
            drive_column: drive_column.to_owned(),
            drive: axis.drive,
            other_axes,
            ..self.estimated(axis.motion, trajectories)
        }
    }
}

//! Segments on the way to an estimate.

use super::{EstimateError, MotionRate, Past, SegmentPart, Trajectory, TrajectoryKind};
use crate::recording::{SampledRecording, Segment};
use crate::signal::Sine;
use crate::units::Kind;
use std::borrow::Cow;
use std::ops::Range;

/// What the filters say of one segment.
#[derive(Clone, Debug)]
pub struct SegmentEstimate {
    /// The samples of the segment that it is about.
    pub segment: Segment,
    /// When the segment began, in s.
    pub start_s: f64,
    /// The column of the drive in V, by its name.
    pub drive_column: String,
    /// The column of the signal, by its name.
    pub signal_column: String,
    /// What the signal is.
    pub signal_kind: &'static Kind,
    /// The drive, where it is a steady sine.
    pub drive: Option<Sine>,
    /// How fast the device moves.
    pub motion: MotionRate,
    /// The axes beside the one that `drive` and `motion` are of.
    pub other_axes: Vec<AngleAxis>,
    /// How long the filters have to settle, in s.
    pub skip_s: f64,
    /// When an angle was passed or an event happened, as the recording itself shows it of these samples or some before them, in the
    /// order in which that became known; none of a device without a threshold or events.
    pub crossings: Vec<RecordedPassing>,
    /// Crossings of which the signal tells hardly more than that there may be one, and which are not among those.
    pub crossings_refused: usize,
    /// Whether the signal is the same for the mirrored motion, so that the experiment states its sign.
    pub sign_is_hidden: bool,
    /// What a reader of the figures has to know and cannot see from them, in sentences.
    pub remarks: Vec<String>,
    /// One per filter.
    pub trajectories: Vec<Trajectory>,
}

/// A time at which the recording shows that an angle was passed, or that an event happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedPassing {
    /// What it was.
    pub of: PassedMark,
    /// When, in s.
    pub time_s: f64,
    /// The standard deviation of that, in s.
    pub sd_s: f64,
    /// Whether the signal shows it by its steepest slope and not by passing its offset.
    pub is_fallback: bool,
}

/// What happened at a time that the recording shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PassedMark {
    /// An angle in rad was passed.
    Angle(f64),
    /// An event of the device, by its name.
    Event(&'static str),
}

/// One axis of several.
#[derive(Clone, Copy, Debug)]
pub struct AngleAxis {
    /// The name of its angle among the states.
    pub angle: &'static str,
    /// How fast it moves.
    pub motion: MotionRate,
    /// Its part of the drive, where that is a steady sine.
    pub drive: Option<Sine>,
}

impl SegmentEstimate {
    /// What of it is judged: all, but for the samples at which a filter has lost the signal or settles again behind that, of which it says nothing
    /// here. The model alone had no signal to lose.
    pub fn without_lost(&self) -> Cow<'_, Self> {
        let loses = |trajectory: &Trajectory| {
            trajectory.kind != TrajectoryKind::ModelAlone && !trajectory.lock.lost_spans.is_empty()
        };
        if !self.trajectories.iter().any(loses) {
            return Cow::Borrowed(self);
        }
        let mut judged = self.clone();
        judged
            .trajectories
            .iter_mut()
            .filter(|trajectory| loses(trajectory))
            .for_each(Trajectory::leave_out_lost);
        Cow::Owned(judged)
    }

    /// The end of the settling time in s.
    pub fn from_s(&self) -> f64 {
        self.start_s + self.skip_s
    }
}

/// A part of a segment and its signal, on the way to an estimate.
#[derive(Clone, Debug)]
pub struct SignalSegment<'a> {
    /// The recording.
    pub recording: &'a SampledRecording,
    /// The rows that are there.
    pub segment: &'a Segment,
    /// What messages call it: the file, and the segment's label where it has one.
    pub place: String,
    /// When, in s.
    pub time_s: Vec<f64>,
    /// The signal; with at least one finite sample, where the segment begins.
    pub signal: &'a [f64],
    /// Its column.
    pub signal_column: &'a str,
    /// What it is.
    pub signal_kind: &'static Kind,
    /// The usual interval between samples in s.
    pub interval_s: f64,
    /// How long the filters have to settle, in s.
    pub skip_s: f64,
    /// When the segment began, in s.
    pub start_s: f64,
    /// Which of the rows are new.
    pub fresh: Range<usize>,
    /// Whether the segment begins with the first of them.
    pub begins: bool,
    /// Whether it ends with the last of them.
    pub ends: bool,
}

impl<'a> SignalSegment<'a> {
    /// A part of a segment with a signal in this column, of this kind.
    ///
    /// A segment of less than two samples is refused, and one without a signal where it begins. What the past keeps of
    /// another segment is dropped.
    pub fn of(
        part: &SegmentPart<'a>,
        (column, signal_kind): (&'a str, &'static Kind),
        skip_s: f64,
        past: &mut Past,
    ) -> Result<Self, EstimateError> {
        let SegmentPart { recording, segment, ref fresh, begins, ends } = *part;
        let signal = recording.column_of(column, signal_kind)?;
        let place = match segment.label.as_str() {
            "" => recording.source().file.clone(),
            label => format!("{}, segment `{label}`", recording.source().file),
        };
        let Some(interval_s) = segment.time.interval_s() else {
            return Err(EstimateError::TooShort { place, found_s: 0.0, skip_s });
        };
        let signal = signal.of(segment);
        if begins && !signal.iter().any(|y| y.is_finite()) {
            return Err(EstimateError::NoSignal { place, column: column.to_owned() });
        }
        if begins {
            past.begin(segment.time.start_s());
        }
        Ok(Self {
            recording,
            segment,
            place,
            time_s: segment.time.to_vec(),
            signal,
            signal_column: column,
            signal_kind,
            interval_s,
            skip_s,
            start_s: past.start_s,
            fresh: fresh.clone(),
            begins,
            ends,
        })
    }
}

impl SignalSegment<'_> {
    /// Refuses a segment that does not last this long after the settling time, in s.
    pub fn require_after_settling(&self, lasting_s: f64) -> Result<(), EstimateError> {
        // Of a segment that goes on, more is to come.
        if !(self.begins && self.ends) {
            return Ok(());
        }
        let found_s = self.time_s.last().zip(self.time_s.first()).map_or(0.0, |(last, first)| last - first);
        if found_s < self.skip_s + lasting_s {
            return Err(EstimateError::TooShort { place: self.place.clone(), found_s, skip_s: self.skip_s });
        }
        Ok(())
    }

    /// What the filters say of it, of a device with a drive in this column: of its first axis, and of others.
    pub fn estimated_under(
        &self,
        drive_column: &str,
        (axis, other_axes): (AngleAxis, Vec<AngleAxis>),
        trajectories: Vec<Trajectory>,
    ) -> SegmentEstimate {
        SegmentEstimate {
            segment: self.segment.part(&self.fresh),
            start_s: self.start_s,
            drive_column: drive_column.to_owned(),
            signal_column: self.signal_column.to_owned(),
            signal_kind: self.signal_kind,
            drive: axis.drive,
            motion: axis.motion,
            other_axes,
            skip_s: self.skip_s,
            crossings: Vec::new(),
            crossings_refused: 0,
            sign_is_hidden: false,
            remarks: Vec::new(),
            trajectories,
        }
    }
}

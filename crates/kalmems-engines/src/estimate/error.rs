//! Why a recording cannot be estimated.

use super::{MOST_OF_EVERY_METHOD, MOST_STATES};
use crate::config::ConfigError;
use crate::recording::{Finding, FindingKind, ReadError, unusable_signal};
use kalmems_figures::number;

/// What keeps an estimate from being made.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A column is not in the recording.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// There is not enough of a segment.
    #[error(
        "{place}: {} s of samples; expected more than the settling time of {} s (`estimate.skip`) and \
         ten cycles of the motion; shorten it or record for longer",
        number(*found_s), number(*skip_s)
    )]
    TooShort {
        /// The recording and its segment.
        place: String,
        /// How long the segment is.
        found_s: f64,
        /// The settling time.
        skip_s: f64,
    },
    /// A long recording would have to be held for longer than a part before the filters can begin.
    #[error(
        "`{place}`: the filters need the first {needed} samples together, for the settling time (`estimate.skip`) or the \
         drive's sine, and of a long recording {held} are held; shorten the settling time or record at a lower rate"
    )]
    LongStart {
        /// The file.
        place: String,
        /// Samples that are needed.
        needed: usize,
        /// Samples that are held.
        held: usize,
    },
    /// A filter cannot go on from the state that it was left in.
    #[error("a filter cannot go on from the state that was kept of it: {why}; begin anew without it")]
    Resumed {
        /// Why.
        why: String,
    },
    /// An uncertain number of the device, one standard deviation off, is more than the filters take.
    #[error(
        "how the uncertainty of `{number}` enters the answer is not known: with it one standard deviation off the estimate fails ({why}); \
         state a smaller uncertainty, or make it a state of the filter"
    )]
    Varied {
        /// The number, by its key below the device's table.
        number: String,
        /// What stops the estimate then.
        why: Box<EstimateError>,
    },
    /// The signal holds no finite sample.
    #[error("{place}: the signal `{column}` has no finite sample; there is nothing to estimate from")]
    NoSignal {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
    },
    /// The drive is missing in places, and does not follow a sine that would say what it was there.
    #[error(
        "{place}: the drive `{column}` is not known at {count} samples, the first at {} s, and it is not a \
         steady sine that would tell; split the recording there with a segment column",
        number(*first_s)
    )]
    DriveUnknown {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// Samples without a drive, those that a gap leaves out included.
        count: usize,
        /// The time of the first.
        first_s: f64,
    },
    /// A filter needs the phase of the drive, and there is none.
    #[error(
        "{place}: `{filter}` needs the phase of the drive, which is not a steady sine here; give the filter a start \
         of values, or leave a lock-in out"
    )]
    NoSteadyDrive {
        /// The recording and its segment.
        place: String,
        /// The filter.
        filter: String,
    },
    /// The drive of a device that is modelled under a steady sine changes.
    #[error(
        "{place}: the drive `{column}` is not a steady sine behind {} s; the device is estimated under a steady sine alone, by which its \
         drive's part of the signal is known: end the recording there, or tell steady parts apart by a segment column",
        number(*time_s)
    )]
    DriveChanges {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// When, in s.
        time_s: f64,
    },
    /// The drive's feedthrough of a device without a drive.
    #[error(
        "the filter `{filter}` has `readout.feedthrough`, and this device has no recorded drive in V that could reach the signal; leave it out"
    )]
    NoDriveToFeedThrough {
        /// The filter.
        filter: String,
    },
    /// The readout's states of a filter that takes several signals.
    #[error(
        "the filter `{filter}` takes several signals, and its table `readout` is for one; name one in `channels`, or leave it out"
    )]
    SeveralReadouts {
        /// The filter.
        filter: String,
    },
    /// A filter of the caller's own, of two states, is to follow the table of a filter that has others or no process.
    #[error(
        "the filter `{filter}` has {found}; a filter of one's own with {expected} states needs a table of one filter with as many, and a process"
    )]
    OtherStates {
        /// The filter.
        filter: String,
        /// What its table asks for.
        found: String,
        /// How many states the own one has.
        expected: usize,
    },
    /// A gain that does not change cannot be computed for this device.
    #[error("the filter `{filter}` has no gain: {why}; change its noise or its bandwidth, or use `ekf`")]
    NoGain {
        /// The filter.
        filter: String,
        /// Why.
        why: String,
    },
    /// There is no filter of so many states.
    #[error(
        "the filter `{filter}` would have {states} states; there are filters of 1 to {MOST_OF_EVERY_METHOD} by every method, and of up to \
         {MOST_STATES} by `model`, `ekf`, `euler_ekf`, `hybrid_ekf` and `square_root_ekf`; leave out some of those in `states`, or take one of \
         these methods"
    )]
    TooManyStates {
        /// The filter.
        filter: String,
        /// How many.
        states: usize,
    },
    /// The feedback that was recorded is not the one that moved the mass.
    #[error(
        "{place}: the signal follows from the feedback `{column}` only with {found} (log-likelihood higher by {gain:.0}); \
         correct the column, or its wiring: a value must be what is applied from its sample to the next, with the \
         sign that pushes away from the first plate"
    )]
    FeedbackMismatch {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// What would be right.
        found: &'static str,
        /// By how much.
        gain: f64,
    },
    /// Euler's method runs away at this interval between samples.
    #[error(
        "the filter `{filter}`: Euler's method enlarges what decays as fast as this device in each interval of {} s; sample \
         faster than {:.0} Hz, or use `ekf`",
        number(*interval_s), rate_hz
    )]
    EulerUnstable {
        /// The filter.
        filter: String,
        /// The interval between samples in s.
        interval_s: f64,
        /// The sampling rate in Hz from which on it does not.
        rate_hz: f64,
    },
    /// The signal does not tell where the motion starts.
    #[error("{place}: `{filter}` cannot start from the signal: {why}; give it a start of values")]
    NoStart {
        /// The recording and its segment.
        place: String,
        /// The filter.
        filter: String,
        /// Why.
        why: String,
    },
    /// There is no such detector of crossings.
    #[error("{place}: {why}; correct the table `[estimate.crossings]`")]
    Detector {
        /// The recording and its segment.
        place: String,
        /// Why.
        why: kalmems_core::detect::DetectError,
    },
    /// The signal passes no threshold more often than noise does.
    #[error(
        "{place}: the signal `{column}` holds no crossing of the threshold: {count} were found, and noise alone would be \
         taken for {by_noise:.1}; its steepest rise is {largest:.1} standard deviations. Is the device moving, and is the \
         signal that of its comb?"
    )]
    NoCrossing {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// Crossings that were found.
        count: usize,
        /// Those that noise alone would be taken for.
        by_noise: f64,
        /// The largest response, in standard deviations of that to noise.
        largest: f64,
    },
    /// The signal falls where it should rise.
    #[error(
        "{place}: the signal `{column}` has the opposite sign of the device's comb: its steepest flanks are {falling:.1} \
         standard deviations down and {rising:.1} up; write the `gain` of the comb with the other sign, or swap the leads"
    )]
    SignReversed {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// The largest response against the sign, in standard deviations of that to noise.
        falling: f64,
        /// The largest response with the sign.
        rising: f64,
    },
    /// The signal left the range of its instrument.
    #[error(
        "{place}: the signal `{column}` is clipped in {count} samples; what it was there is not known, and it would \
         be taken for the motion: widen the range of the converter, or leave those samples empty"
    )]
    Clipped {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// How many samples.
        count: usize,
    },
    /// A bit of the signal is the same in all samples.
    #[error(
        "{place}: the signal `{column}` {found}; half of its samples are wrong by this weight, and would be taken for the motion: check the \
         converter, its cable and the number format of the file"
    )]
    DroppedBit {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// What was found.
        found: String,
    },
    /// The signal is another channel.
    #[error(
        "{place}: the signal `{column}` {found}; it is no signal of the device: name the column that is, or check the wiring"
    )]
    Repeated {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// What was found.
        found: String,
    },
    /// The mass lay on a plate.
    #[error(
        "{place}: the mass was pulled in to a plate at {} s: the signal `{column}` is {volts:.3} V there, and so in \
         {count} samples, where a mass at its stops gives ±{stopped_v:.3} V; it measures nothing from there on: shorten the \
         recording, or lower acceleration, carrier or bias",
        number(*time_s)
    )]
    PulledIn {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// When first.
        time_s: f64,
        /// What was read there.
        volts: f64,
        /// What is read of a mass at its stops.
        stopped_v: f64,
        /// In how many samples.
        count: usize,
    },
    /// There are too few samples per cycle to follow the motion.
    #[error(
        "{place}: sampled at {rate_hz:.1} Hz, which is not above twice the {motion_hz:.1} Hz of the motion: its frequency would be \
         taken for {alias_hz:.1} Hz, and between samples it would be off by up to {error:.1e} {unit}; sample faster"
    )]
    SampledTooSlowly {
        /// The recording and its segment.
        place: String,
        /// The sampling rate.
        rate_hz: f64,
        /// The frequency of the motion.
        motion_hz: f64,
        /// What it would be taken for.
        alias_hz: f64,
        /// How far the motion goes, and the unit of that.
        error: f64,
        /// See `error`.
        unit: String,
    },
    /// Zero phases cannot be told that long before they happen.
    #[error("zero phases of `{filter}` cannot be predicted: {why}; correct `stream.trigger.ahead`")]
    Ahead {
        /// The filter.
        filter: String,
        /// Why.
        why: kalmems_models::control::UnusableTrigger,
    },
    /// A trigger that tells no frequency.
    #[error("{place}: the trigger `{column}` {why}; correct the column, or leave it out of `channels`")]
    Trigger {
        /// The recording and its segment.
        place: String,
        /// The column.
        column: String,
        /// Why.
        why: String,
    },
    /// A recording that the estimate needs beside the one it is of cannot be used.
    #[error("{place}: {why}")]
    Unfit {
        /// The recording and its segment.
        place: String,
        /// What was found, what was expected, and what to do.
        why: String,
    },
    /// Fewer rows are there around the new ones than the filters need.
    #[error(
        "{place}: {held} samples are there beside the new ones where {needed} are needed: they come faster than was said; \
         correct `rate` in the table `[stream]`"
    )]
    FewAround {
        /// The recording and its segment.
        place: String,
        /// How many there are.
        held: usize,
        /// How many are needed.
        needed: usize,
    },
    /// Stopped from outside.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl EstimateError {
    /// Whether other samples of the same recording can be estimated all the same.
    pub fn is_of_the_samples(&self) -> bool {
        match self {
            Self::Varied { why, .. } => why.is_of_the_samples(),
            Self::TooShort { .. }
            | Self::NoSignal { .. }
            | Self::NoSteadyDrive { .. }
            | Self::DriveChanges { .. }
            | Self::NoStart { .. }
            | Self::NoCrossing { .. }
            | Self::DriveUnknown { .. }
            | Self::Trigger { .. } => true,
            _ => false,
        }
    }

    /// Whether there are too few samples for an estimate, so that a part of them is none the better.
    pub(super) const fn is_of_too_few(&self) -> bool {
        matches!(self, Self::TooShort { .. } | Self::NoSignal { .. })
    }
}

impl EstimateError {
    /// Refuses a recording one of whose signals is clipped, lacks a bit or is another channel, in the segments that are wanted by their labels; `place` is
    /// what messages call it.
    pub fn of_unusable_signal(
        diagnosis: &[Finding],
        (place, columns): (&str, &[&str]),
        wanted: impl Fn(&str) -> bool,
    ) -> Result<(), Self> {
        let Some(finding) = unusable_signal(diagnosis, columns, wanted) else { return Ok(()) };
        let (place, column) = (place.to_owned(), finding.column.clone().unwrap_or_default());
        Err(match finding.kind {
            FindingKind::DroppedBit => Self::DroppedBit { place, column, found: finding.detail.clone() },
            FindingKind::Repeats => Self::Repeated { place, column, found: finding.detail.clone() },
            _ => Self::Clipped { place, column, count: finding.count },
        })
    }
}

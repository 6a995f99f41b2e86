//! The threshold-sensing scanner: a comb senses how fast a mirror turns, and most sharply when it passes the comb.
//!
//! Chen et al., Improved Extended Kalman Filter Estimation using Threshold Signal Detection with a MEMS Electrostatic
//! Microscanner, 2019, and chapter 4 of Chen's dissertation, 2018. The current of a biased comb gives a voltage h(θ)·θ̇ whose sign changes at one angle, which stays where it is while gain
//! and resonance drift. Filters take the signal sample by sample, and the times at which that angle is passed.

mod course;
pub mod device;
mod expanded;
mod export;
mod filters;
mod hardware;
pub mod identification;
mod lock_in;
mod plant;
mod segment;
mod settings;
mod simulation;
mod verdict;

use super::{Estimator, NumberForm, OmittedNumber, Rig, StateDensity, Template, TemplateChannel};
use crate::Expansion;
use crate::config::{ConfigError, DeviceKind, DeviceUses, Experiment, Key, Method, RecordingRole};
use crate::crossings::{CrossingReading, LevelCrossing, RowsNeeded, SearchState, SearchedSignal};
use crate::estimate::driven::{BLOCK, DrivenSegment};
use crate::estimate::{
    self, AngleAxis, DeviceParameter, EstimateError, Past, RowsAround, SegmentEstimate, SegmentPart,
    SignalSegment, rows_for_start, rows_to_start_again,
};
use crate::evaluate::Instruments;
use crate::evaluate::{ComparisonExtent, MotionErrors, ReferenceLag, ReferenceMotion, evaluate_motion};
use crate::export::{ExportError, ExportableFilter};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::{Outlook, OutlookTopic};
use crate::progress::{Interruption, Progress};
use crate::recording::{Finding, RecordingLayout};
use crate::simulate::{SimulateError, Simulation};
use crate::threshold_scanner::device::ThresholdScanner;
use crate::units::kind;
pub use filters::{ThresholdFilterSettings, ThresholdSettings};
pub use hardware::ThresholdHardware;
pub use segment::{ThresholdSamples, estimate as estimate_segment};
pub use settings::ThresholdScannerSettings;
use simulation::ThresholdSimulation;

/// The rig.
pub struct ThresholdScannerRig;

/// The channels that an estimate needs.
const MEANINGS: [&str; 2] = ["drive", "signal"];

/// A channel that a recording may hold beside them: what a position detector shows.
const POSITION: &str = "position";

/// What a current does not allow.
static NO_METHODS: [(Method, &str); 1] = [(
    Method::DirectInversion,
    "one sample is the product of the rate and of a function of the angle, and tells neither; use `lock_in` or `ekf`",
)];

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
    references: &[
        TemplateChannel::ANGLE,
        TemplateChannel::RATE,
        TemplateChannel::optional(
            "position",
            ("the output of the position detector", "V"),
            &["psd", "position", "detector"],
        ),
    ],
};

impl Rig for ThresholdScannerRig {
    fn name(&self) -> &'static str {
        "threshold_scanner"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<ThresholdScanner>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        experiment.device::<ThresholdScanner>().map(|_| true)
    }

    fn uses(&self, _: &Experiment) -> DeviceUses {
        DeviceUses {
            crossings: true,
            signal_variance: true,
            no_methods: &NO_METHODS,
            ..DeviceUses::default()
        }
    }

    fn instruments(&self, experiment: &Experiment) -> Result<Instruments, ConfigError> {
        instruments(experiment)
    }

    fn left_out(&self, _: &Experiment) -> Vec<OmittedNumber> {
        let number = |key, unit, step| OmittedNumber {
            key,
            unit,
            step,
            is_never_negative: false,
            form: NumberForm::Number,
            filter_switch: None,
        };
        vec![number("readout.feedthrough_capacitance", "pF", 1e-3), number("readout.offset", "mV", 0.1)]
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        &filters::PARAMETERS
    }

    fn densities(&self, _: &Experiment) -> Vec<StateDensity> {
        filters::NOISE.map(|entry| StateDensity::angular_acceleration(entry, "the rate")).into()
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        ThresholdScannerSettings::of(experiment)?;
        experiment.to_estimate(
            &[RecordingRole::Test, RecordingRole::SteadyState, RecordingRole::RingDown],
            |index| columns(experiment, index),
        )
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let cycle_s = 1.0 / ThresholdHardware::of(experiment)?.natural_hz();
        experiment.layout_to_estimate(index, &columns(experiment, index)?, cycle_s)
    }

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        expanded::expanded(experiment)
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let settings = ThresholdScannerSettings::of(experiment)?;
        let columns = columns(experiment, index)?;
        Ok(Box::new(ThresholdEstimator {
            settings,
            columns,
            past: Past::default(),
            search: None,
            refused: None,
            progress,
        }))
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(ThresholdSimulation::of(experiment)?))
    }

    fn evaluate(
        &self,
        estimate: &SegmentEstimate,
        references: &[ReferenceMotion],
        stop: &Interruption,
    ) -> Vec<Option<MotionErrors>> {
        let motion_hz = estimate.motion.frequency_hz;
        let extent =
            ComparisonExtent { from_s: estimate.from_s(), motion_hz, drive: estimate.drive.as_ref() };
        let time = &estimate.segment.time;
        let end_s = time.at(time.len().saturating_sub(1)) + time.interval_s().unwrap_or(0.0);
        let one = |trajectory| {
            let reference = references.first()?;
            let mut errors = evaluate_motion(trajectory, reference, extent, stop)?;
            if estimate.parts > 1 {
                errors.parts = errors.error.parts(time.start_s(), end_s, estimate.parts);
            }
            errors.reference_lag = ReferenceLag::of(trajectory, reference, (extent.from_s, motion_hz), stop);
            Some(errors)
        };
        estimate.trajectories.iter().map(one).collect()
    }

    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }

    fn exported(
        &self,
        experiment: &Experiment,
        place: usize,
    ) -> Result<(Box<dyn ExportableFilter>, [String; 2]), ExportError> {
        let index = self.wanted(experiment)?.first().copied().unwrap_or(0);
        Ok((Box::new(export::exported(experiment, place)?), columns(experiment, index)?.map(str::to_owned)))
    }
}

/// Estimates recordings of the scanner.
struct ThresholdEstimator<'a> {
    settings: ThresholdScannerSettings,
    /// Those of drive and signal.
    columns: [&'a str; 2],
    past: Past,
    /// The search for crossings, from one part of a segment to the next.
    search: Option<SearchState>,
    /// Why the recording is no good, where only its end has shown it.
    refused: Option<EstimateError>,
    progress: &'a dyn Progress,
}

impl Estimator for ThresholdEstimator<'_> {
    fn around(&self, interval_s: f64) -> RowsAround {
        let settings = &self.settings;
        let start_s = settings.skip_s + STARTING_CYCLES / settings.hardware.natural_hz();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let head = ((start_s / interval_s).ceil() as usize).max(BLOCK);
        let from_signal = settings.filters.iter().filter(|filter| filter.from_signal);
        let cycle_s = settings.hardware.natural_hz().recip();
        let rows = from_signal.map(|filter| rows_for_start((cycle_s, interval_s), filter.states().len()));
        let head = rows.fold(head, usize::max);
        let RowsNeeded { before, after } = needed(settings, interval_s).with_a_margin();
        let again = settings.filters.iter().map(|filter| filter.states().len());
        let again =
            again.map(|states| rows_to_start_again((cycle_s, interval_s), states)).fold(0, usize::max);
        let smooths = settings.filters.iter().any(|filter| filter.basics.smooth);
        RowsAround { head, before: before + again, after, smooths }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, [drive_column, signal_column]) = (&self.settings, self.columns);
        let (past, natural_hz) = (&mut self.past, settings.hardware.natural_hz());
        let segment = SignalSegment::of(part, (signal_column, &kind::VOLTAGE), settings.skip_s, past)?;
        if segment.begins {
            self.search = None;
        }
        segment.require_after_settling(CYCLES / natural_hz)?;
        let (place, is_whole) = ((segment.place.as_str(), signal_column), segment.begins && segment.ends);
        // The flanks that tell of a crossing are the first to be clipped.
        segment.require_usable_signals(&[signal_column])?;
        let data = DrivenSegment::of(&segment, drive_column, past, self.progress)?;
        let drive_slope = slope(&data, &settings.hardware);
        let mut kept = match self.search.take() {
            Some(search) => search,
            None => begun_search(settings, &segment, &past.numbers)?,
        };
        let first = kept.first(&segment);
        kept.require_around(needed(settings, kept.interval_s), &segment)?;
        let volts = without_drive(settings, &data, &drive_slope);
        // The drive's slope at the last row depends on the next one, but at the end of a segment.
        let until = if segment.ends { volts.len() } else { volts.len().saturating_sub(1) };
        let found = kept.look(&segment, &data.time_s[..until], &volts[..until]);
        if let Some((_, tally)) = found
            && let Some(why) = verdict::judge(tally, &segment, place)?
        {
            self.refused.get_or_insert(why);
        }
        let motion = data.motion(natural_hz);
        let crossings = if settings.crossings.is_some() { kept.crossings.as_slice() } else { &[] };
        let samples = ThresholdSamples { data: &data, drive_slope: &drive_slope, crossings, first, motion };
        let trajectories = segment::estimate(settings, samples, past, &segment.place, self.progress)?;
        let axis = AngleAxis { angle: "angle", motion, drive: data.drive.sine().copied() };
        let mut estimate = segment.estimated_under(drive_column, (axis, Vec::new()), trajectories);
        let new = found.map_or(0, |(count, _)| count);
        let new = &crossings[crossings.len().saturating_sub(new)..];
        (estimate.crossings, estimate.crossings_refused) =
            told(new, settings.judged_angle(), 2.0 * settings.hardware.natural_hz());
        if is_whole {
            estimate.parts = settings.parts;
        } else if settings.parts > 1 {
            estimate.remarks.push(PARTS_OF_WHAT.to_owned());
        }
        kept.pass(&segment);
        past.numbers = kept.numbers();
        self.search = Some(kept);
        Ok(estimate)
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        EstimateError::of_unusable_signal(diagnosis, (place, &self.columns[1..]), |_| true)?;
        self.refused.take().map_or(Ok(()), Err)
    }
}

/// Crossings as they are told beside what the filters say, and how many are not told, as their time is hardly better known than
/// that of any crossing.
fn told(crossings: &[LevelCrossing], angle: f64, passes_hz: f64) -> (Vec<estimate::RecordedPassing>, usize) {
    let largest_s = LARGEST_SHARE * 0.5 / passes_hz / 3.0_f64.sqrt();
    let told = |crossing: &LevelCrossing| {
        let CrossingReading { time_s, sd_s, .. } = crossing.best();
        estimate::RecordedPassing {
            of: estimate::PassedMark::Angle(angle),
            time_s,
            sd_s,
            is_fallback: crossing.fallback.is_some(),
        }
    };
    let (told, refused): (Vec<_>, Vec<_>) =
        crossings.iter().map(told).partition(|crossing| !crossing.is_fallback || crossing.sd_s <= largest_s);
    (told, refused.len())
}

/// The largest standard deviation of a crossing that is told without a zero, as a part of that of a time of which nothing is known
/// but that it is the nearest crossing: half of the time between two, over √3.
const LARGEST_SHARE: f64 = 0.5;

/// Cycles of the motion that have to follow the settling time.
const CYCLES: f64 = 10.0;

/// Those after it in which a signal with its sign reversed is told.
const STARTING_CYCLES: f64 = 4.0;

/// Said of a long recording.
const PARTS_OF_WHAT: &str = "The errors in equal parts of the duration, `parts`, are not given of a recording that is taken in \
                             parts: its duration is not known before its end.";

/// Rows of a recording of this interval in s that the search and the filters need around the new ones.
fn needed(settings: &ThresholdScannerSettings, interval_s: f64) -> RowsNeeded {
    RowsNeeded::by(settings.detector().as_ref(), settings.deliveries(), interval_s)
}

/// The search for crossings at the beginning of a segment, or where another run left it, which has written these numbers.
fn begun_search(
    settings: &ThresholdScannerSettings,
    segment: &SignalSegment,
    written: &[f64],
) -> Result<SearchState, EstimateError> {
    let ThresholdHardware { noise_variance, readout, mirror, .. } = settings.hardware;
    let sought = |interval_s| {
        let samples = (interval_s, noise_variance, readout.offset);
        settings
            .detector()
            .map(|detector| (SearchedSignal::of_comb(samples, readout.comb, mirror.resonator), detector))
    };
    SearchState::of(sought, segment, written)
        .map_err(|why| EstimateError::Detector { place: segment.place.clone(), why })
}

/// A drive that bends by more than this many standard deviations of the signal within a sample has no known slope there.
const BEND: f64 = 3.0;

/// dV/dt at each sample by central differences, in V/s. Where the drive bends so sharply, as where its power is cut off,
/// that what it adds to the signal is not known to its noise, it is not a number.
fn slope(data: &DrivenSegment, hardware: &ThresholdHardware) -> Vec<f64> {
    let last = data.time_s.len().saturating_sub(1);
    let volts = |k: usize| data.drive.sample(k).0;
    let between = |a: usize, b: usize| (volts(b) - volts(a)) / (data.time_s[b] - data.time_s[a]);
    let largest = BEND * hardware.noise_variance.sqrt();
    (0..data.time_s.len())
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            if before < k && k < after {
                let bend = between(k, after) - between(before, k);
                if (bend * hardware.feedback_resistance * hardware.feedthrough).abs() > largest {
                    return f64::NAN;
                }
            }
            between(before, after)
        })
        .collect()
}

/// The signal without what the drive adds to it, in V.
fn without_drive(settings: &ThresholdScannerSettings, data: &DrivenSegment, drive_slope: &[f64]) -> Vec<f64> {
    let per_slope = settings.hardware.feedback_resistance * settings.hardware.feedthrough;
    data.signal.iter().zip(drive_slope).map(|(y, slope)| y + per_slope * slope).collect()
}

fn columns(experiment: &Experiment, index: usize) -> Result<[&str; 2], ConfigError> {
    let channels = &experiment.recording(index)?.channels;
    let key = Key::from("recording").index(index).child("channels");
    if channels.column(POSITION).is_some() {
        let [drive, signal, _] = experiment.columns(key, channels, [MEANINGS[0], MEANINGS[1], POSITION])?;
        return Ok([drive, signal]);
    }
    experiment.columns(key, channels, MEANINGS)
}

fn outlook(experiment: &Experiment) -> Result<Outlook, SimulateError> {
    let hardware = ThresholdHardware::of(experiment)?;
    let resonator = &hardware.mirror.resonator;
    let decay_s = 1.0 / (resonator.damping_ratio * resonator.natural_rate);
    let (hz, steepest) = (hardware.natural_hz(), hardware.readout.comb.steepest());
    let noise = hardware.noise_variance.sqrt();
    let flank = |amplitude: f64| steepest * (amplitude * resonator.natural_rate).powi(2);
    let device = OutlookTopic::new("Device").with(
        "natural_hz",
        [hz],
        format!(
            "The mirror swings at {hz:.2} Hz; without a drive it loses a factor e in {:.2} ms.",
            1e3 * decay_s
        ),
    );
    let signal = [0.15_f64, 0.05, 0.02].into_iter().fold(OutlookTopic::new("What the signal determines"), |topic, amplitude| {
        let rise = flank(amplitude);
        topic.with(
            "flank_v_per_s",
            [amplitude, rise],
            format!(
                "At an amplitude of {amplitude} rad the signal rises by {rise:.3e} V/s where the threshold is passed: \
                 noise of one sample, {noise:.3e} V, is {:.2} µs there.",
                1e6 * noise / rise.abs()
            ),
        )
    });
    Ok(Outlook::of(experiment, "threshold_scanner", vec![device, signal]))
}

/// The detector of the beam's position, where the device table describes one.
fn instruments(experiment: &Experiment) -> Result<Instruments, ConfigError> {
    let device = experiment.device::<ThresholdScanner>()?;
    let beam = device.position_detector.as_ref().map(device::PositionDetector::beam);
    Ok(Instruments { beam, ..Instruments::default() })
}

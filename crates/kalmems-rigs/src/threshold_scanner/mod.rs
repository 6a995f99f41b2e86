//! The threshold-sensing scanner: a comb senses how fast a mirror turns, and most sharply when it passes the comb.
//!
//! Chen et al., Improved Extended Kalman Filter Estimation using Threshold Signal Detection with a MEMS Electrostatic
//! Microscanner, 2019, and chapter 4 of Chen's dissertation, 2018. The current of a biased comb gives a voltage h(θ)·θ̇ whose sign changes at one angle, which stays where it is while gain
//! and resonance drift. Filters take the signal sample by sample, and the times at which that angle is passed.

mod course;
mod crossings;
mod export;
mod filters;
mod hardware;
pub mod identification;
mod plant;
mod reproduction;
mod segment;
mod settings;
mod simulation;

use super::{Estimator, Rig};
use crate::config::{ConfigError, Device, Experiment, Key, Method, Role};
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{Around, Axis, EstimateError, Part, Past, Progress, SegmentEstimate, SignalSegment};
use crate::evaluate::{Extent, MotionErrors, Reference, ReferenceLag, evaluate_motion};
use crate::export::{ExportError, Filter};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::{Outlook, Topic};
use crate::recording::{FindingKind, Layout};
use crate::reproduce::Program;
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
use crossings::{Found, Signal, find};
use hardware::Hardware;
use segment::Samples;
use settings::{DetectorSettings, Settings};
use simulation::ThresholdSimulation;

/// The rig.
pub struct ThresholdScannerRig;

/// The channels that an estimate needs.
const MEANINGS: [&str; 2] = ["drive", "signal"];

/// A channel that a recording may hold beside them: what a position detector shows.
const POSITION: &str = "position";

impl Rig for ThresholdScannerRig {
    fn name(&self) -> &'static str {
        "threshold_scanner"
    }

    fn takes(&self, device: &Device) -> bool {
        matches!(device, Device::ThresholdScanner(_))
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        Settings::of(experiment)?;
        let wanted = experiment.to_estimate(&[Role::Test, Role::SteadyState, Role::RingDown])?;
        for index in &wanted {
            columns(experiment, *index)?;
        }
        Ok(wanted)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<Layout, ConfigError> {
        Ok(experiment.recording(index)?.layout(&columns(experiment, index)?))
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let settings = Settings::of(experiment)?;
        let columns = columns(experiment, index)?;
        Ok(Box::new(ThresholdEstimator { settings, columns, past: Past::default(), progress }))
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(ThresholdSimulation::of(experiment)?))
    }

    fn evaluate(&self, estimate: &SegmentEstimate, references: &[Reference]) -> Vec<Option<MotionErrors>> {
        let motion_hz = estimate.motion.frequency_hz;
        let extent = Extent { from_s: estimate.from_s(), motion_hz, drive: estimate.drive.as_ref() };
        let time = &estimate.segment.time;
        let end_s = time.at(time.len().saturating_sub(1)) + time.interval_s().unwrap_or(0.0);
        let one = |trajectory| {
            let reference = references.first()?;
            let mut errors = evaluate_motion(trajectory, reference, extent)?;
            if estimate.parts > 1 {
                errors.parts = errors.error.parts(time.start_s(), end_s, estimate.parts);
            }
            errors.reference_lag = ReferenceLag::of(trajectory, reference, extent.from_s, motion_hz);
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

    fn exported(&self, experiment: &Experiment, place: usize) -> Result<(Filter, [String; 2]), ExportError> {
        let index = self.wanted(experiment)?.first().copied().unwrap_or(0);
        Ok((export::exported(experiment, place)?, columns(experiment, index)?.map(str::to_owned)))
    }

    fn reproduction(&self) -> Option<&'static Program> {
        Some(&reproduction::PROGRAM)
    }
}

/// Estimates recordings of the scanner.
struct ThresholdEstimator<'a> {
    settings: Settings,
    /// Those of drive and signal.
    columns: [&'a str; 2],
    past: Past,
    progress: &'a dyn Progress,
}

impl Estimator for ThresholdEstimator<'_> {
    /// Crossings are looked for over a whole segment.
    fn around(&self, _: f64) -> Around {
        Around::WHOLE
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &Part) -> Result<SegmentEstimate, EstimateError> {
        let (settings, [drive_column, signal_column]) = (&self.settings, self.columns);
        let (past, natural_hz) = (&mut self.past, settings.hardware.natural_hz());
        let segment = SignalSegment::of(part, (signal_column, &kind::VOLTAGE), settings.skip_s, past)?;
        segment.require_after_settling(CYCLES / natural_hz)?;
        require_unclipped(&segment)?;
        let data = DrivenSegment::of(&segment, drive_column, past)?;
        let drive_slope = slope(&data, &settings.hardware);
        let found = found(settings, &data, &drive_slope, (&segment.place, signal_column))?;
        let motion = data.motion(natural_hz);
        let samples = Samples { data: &data, drive_slope: &drive_slope, crossings: &found, motion };
        let trajectories = segment::estimate(settings, samples, past, self.progress)?;
        let axis = Axis { angle: "angle", motion, drive: data.drive.sine().copied() };
        let estimate = segment.estimated_under(drive_column, (axis, Vec::new()), trajectories);
        Ok(SegmentEstimate { parts: settings.parts, ..estimate })
    }
}

/// Cycles of the motion that have to follow the settling time.
const CYCLES: f64 = 10.0;

/// Refuses a segment whose signal is clipped: the flanks that tell of a crossing are the first to go.
fn require_unclipped(segment: &SignalSegment) -> Result<(), EstimateError> {
    let clipped = segment.recording.diagnosis().iter().find(|finding| {
        finding.kind == FindingKind::Saturation
            && finding.column.as_deref() == Some(segment.signal_column)
            && finding.segment.as_ref().is_none_or(|label| *label == segment.segment.label)
    });
    let Some(finding) = clipped else { return Ok(()) };
    let (place, column) = (segment.place.clone(), segment.signal_column.to_owned());
    Err(EstimateError::Clipped { place, column, count: finding.count })
}

/// A drive that bends by more than this many standard deviations of the signal within a sample has no known slope there.
const BEND: f64 = 3.0;

/// dV/dt at each sample by central differences, in V/s. Where the drive bends so sharply, as where its power is cut off,
/// that what it adds to the signal is not known to its noise, it is not a number.
fn slope(data: &DrivenSegment, hardware: &Hardware) -> Vec<f64> {
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

/// The crossings, or why there are none. Where the file asks for none they are looked for all the same, to see that the
/// signal is the comb's, as soon as a filter relies on it.
fn found(
    settings: &Settings,
    data: &DrivenSegment,
    drive_slope: &[f64],
    (place, column): (&str, &str),
) -> Result<Vec<crossings::Crossing>, EstimateError> {
    if settings.crossings.is_none() && settings.filters.iter().all(|f| f.basics.method == Method::Model) {
        return Ok(Vec::new());
    }
    let detector = &settings.crossings.unwrap_or(DetectorSettings::usual(&settings.hardware));
    let hardware = &settings.hardware;
    let per_slope = hardware.feedback_resistance * hardware.feedthrough;
    let alone: Vec<f64> =
        data.signal.iter().zip(drive_slope).map(|(y, slope)| y + per_slope * slope).collect();
    let looked_at = Signal {
        time_s: data.time_s,
        volts: &alone,
        interval_s: data.interval_s,
        noise_variance: hardware.noise_variance,
        offset: hardware.readout.offset,
        comb: hardware.readout.comb,
        passes_hz: 2.0 * hardware.natural_hz(),
    };
    let (place, column) = (place.to_owned(), column.to_owned());
    let found = find(looked_at, detector);
    let Found { crossings, rising, falling, threshold, by_noise } =
        found.map_err(|why| EstimateError::Detector { place: place.clone(), why })?;
    if falling > SIGN_RATIO * rising && falling > threshold {
        return Err(EstimateError::SignReversed { place, column, falling, rising });
    }
    // As many as noise alone has, within four standard deviations of that, and none that noise could not be.
    let count = crossings.len();
    let is_few = count as f64 <= by_noise + 4.0 * by_noise.sqrt() + 1.0;
    if count == 0 || (is_few && rising < LOUD) {
        return Err(EstimateError::NoCrossing { place, column, count, by_noise, largest: rising });
    }
    Ok(if settings.crossings.is_some() { crossings } else { Vec::new() })
}

/// A response, in standard deviations of that to noise, that noise does not reach in a year.
const LOUD: f64 = 8.0;

/// How many times as steep as its rises a signal must fall to be taken for reversed.
const SIGN_RATIO: f64 = 1.5;

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
    let hardware = Hardware::of(experiment)?;
    let resonator = &hardware.mirror.resonator;
    let decay_s = 1.0 / (resonator.damping_ratio * resonator.natural_rate);
    let (hz, steepest) = (hardware.natural_hz(), hardware.readout.comb.steepest());
    let noise = hardware.noise_variance.sqrt();
    let flank = |amplitude: f64| steepest * (amplitude * resonator.natural_rate).powi(2);
    let device = Topic::new("Device").with(
        "natural_hz",
        [hz],
        format!(
            "The mirror swings at {hz:.2} Hz; without a drive it loses a factor e in {:.2} ms.",
            1e3 * decay_s
        ),
    );
    let signal = [0.15_f64, 0.05, 0.02].into_iter().fold(Topic::new("What the signal tells"), |topic, amplitude| {
        let rise = flank(amplitude);
        topic.with(
            "flank_v_per_s",
            [amplitude, rise],
            format!(
                "At an amplitude of {amplitude} rad the signal rises by {rise:.3e} V/s where the threshold is passed: \
                 noise of one sample, {noise:.3e} V, is {:.2} us there.",
                1e6 * noise / rise.abs()
            ),
        )
    });
    Ok(Outlook {
        experiment: experiment.name.to_string(),
        device: "threshold_scanner",
        topics: vec![device, signal],
        response: None,
        start: None,
        information: Vec::new(),
        frequencies: Vec::new(),
    })
}

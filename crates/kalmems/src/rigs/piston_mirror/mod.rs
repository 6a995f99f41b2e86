//! The piston mirror: a mirror before a plate, its distance read by a carrier through their capacitance.
//!
//! Faller and Zangl, Feasibility Considerations on an Inkjet-Printed Capacitive Position Sensor for Electrostatically
//! Actuated Resonant MEMS-Mirror Systems, 2017. One sample of the capacitance tells the position to a few tenths of a
//! micrometre; that the motion is a sinusoid makes nanometres of it.

mod bound;
mod course;
mod data;
mod driven;
mod mechanics;
mod metamodel;
mod observability;
mod outlook;
mod phase_lock;
mod phasor;
mod plates;
mod range;
mod remarks;
mod reproduction;
mod segment;
mod settings;
mod simulation;
mod start;
mod trigger;

use super::{Rig, SegmentEstimate};
use crate::config::{ConfigError, Device, DriveSource, Experiment, Fault, Key, Role};
use crate::estimate::{EstimateError, Progress};
use crate::evaluate::{MotionErrors, PositionErrors, Reference, evaluate_position};
use crate::outlook::Outlook;
use crate::recording::{Layout, ReadError, Recording};
use crate::reproduce::Program;
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
pub use bound::{MotionBound, motion_bound};
pub use data::SegmentData;
pub use metamodel::{DegreeError, Metamodel, MetamodelError, OutsideTable, fit_table};
pub use plates::{COEFFICIENTS, Plates, distance_at};
use settings::Settings;
pub use start::{BatchStart, NoBatchStart, batch_fit, batch_start, canonical};

/// The rig.
pub struct PistonMirrorRig;

/// The channels that an estimate may have: the capacitance, and a trigger of the drive.
const MEANINGS: [&str; 2] = ["signal", "trigger"];

/// The columns of a recording.
struct Columns<'a> {
    signal: &'a str,
    trigger: Option<&'a str>,
}

impl Rig for PistonMirrorRig {
    fn name(&self) -> &'static str {
        "piston_mirror"
    }

    fn takes(&self, device: &Device) -> bool {
        matches!(device, Device::PistonMirror(_))
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        Settings::of(experiment)?;
        let wanted: Vec<usize> = (0..experiment.recordings.len())
            .filter(|i| experiment.recordings[*i].role == Role::Test)
            .collect();
        if wanted.is_empty() {
            let why = "no recording has the role `test`; those are estimated".to_owned();
            return Err(experiment.error("recording", Fault::Value { why }));
        }
        for index in &wanted {
            columns(experiment, *index)?;
        }
        Ok(wanted)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<Layout, ConfigError> {
        let columns = columns(experiment, index)?;
        let all: Vec<&str> = [Some(columns.signal), columns.trigger].into_iter().flatten().collect();
        Ok(experiment.recording(index)?.layout(&all))
    }

    fn angles(&self) -> &'static [[&'static str; 2]] {
        &[["position", "velocity"]]
    }

    fn estimate(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &Recording,
        progress: &dyn Progress,
    ) -> Result<Vec<SegmentEstimate>, EstimateError> {
        let settings = Settings::of(experiment)?;
        let columns = columns(experiment, index)?;
        let name = columns.signal;
        let signal = recording.column_of(name, &kind::CAPACITANCE)?;
        let trigger = columns
            .trigger
            .map(|name| Ok::<_, ReadError>((name, recording.column_of(name, &kind::VOLTAGE)?)));
        let trigger = trigger.transpose()?;
        let mut estimates = Vec::new();
        for segment in recording.segments() {
            let place = match segment.label.as_str() {
                "" => recording.source().file.clone(),
                label => format!("{}, segment `{label}`", recording.source().file),
            };
            let time_s = segment.time.to_vec();
            let span = time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first);
            let too_short =
                || EstimateError::TooShort { place: place.clone(), found_s: span, skip_s: settings.skip_s };
            let interval_s = segment.time.interval_s().ok_or_else(too_short)?;
            let noise_variance = settings.hardware.noise_variance(interval_s);
            let kept = range::without_impossible(&settings.hardware, signal.of(segment), noise_variance)
                .map(|(kept, _)| kept);
            let motion_hz = trigger.map(|(column, values)| {
                trigger::motion_frequency(&time_s, values.of(segment), interval_s).map_err(|why| {
                    let (place, column) = (place.clone(), column.to_owned());
                    EstimateError::Trigger { place, column, why: why.to_string() }
                })
            });
            let data = SegmentData {
                time_s: &time_s,
                signal: kept.as_deref().unwrap_or_else(|| signal.of(segment)),
                interval_s,
                noise_variance,
                motion_hz: motion_hz.transpose()?,
            };
            require_fast_enough(&settings.hardware, &data, &place)?;
            if !data.signal.iter().any(|y| y.is_finite()) {
                return Err(EstimateError::NoSignal { place, column: name.to_owned() });
            }
            let (trajectories, motion) = segment::estimate(&settings, &data, &place, progress)?;
            if span < settings.skip_s + 10.0 / motion.frequency_hz {
                return Err(too_short());
            }
            estimates.push(SegmentEstimate {
                segment: segment.clone(),
                drive_column: String::new(),
                signal_column: name.to_owned(),
                drive: None,
                motion,
                other_axes: Vec::new(),
                skip_s: settings.skip_s,
                parts: 1,
                trajectories,
            });
        }
        Ok(estimates)
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        if let Some(simulate) = &experiment.simulate
            && !matches!(simulate.drive, DriveSource::Prescribed(_))
        {
            return Ok(Box::new(driven::DrivenSimulation::of(experiment, simulate)?));
        }
        Ok(Box::new(simulation::PhasorSimulation::of(experiment)?))
    }

    fn remarks(
        &self,
        experiment: &Experiment,
        recording: &Recording,
        estimate: &SegmentEstimate,
    ) -> Vec<String> {
        let hardware = Settings::of(experiment).map(|settings| settings.hardware);
        let signal = recording.column_of(&estimate.signal_column, &kind::CAPACITANCE);
        let (Ok(hardware), Ok(signal), Some(interval_s)) =
            (hardware, signal, estimate.segment.time.interval_s())
        else {
            return Vec::new();
        };
        let time_s = estimate.segment.time.to_vec();
        let data = SegmentData {
            time_s: &time_s,
            signal: signal.of(&estimate.segment),
            interval_s,
            noise_variance: hardware.noise_variance(interval_s),
            motion_hz: None,
        };
        remarks::remarks(&hardware, &data, &estimate.trajectories)
    }

    fn reproduction(&self) -> Option<&'static Program> {
        Some(&reproduction::PROGRAM)
    }

    /// A position has no errors of an angle; see [`Rig::evaluate_positions`].
    fn evaluate(&self, estimate: &SegmentEstimate, _: &[Reference]) -> Vec<Option<MotionErrors>> {
        vec![None; estimate.trajectories.len()]
    }

    fn evaluate_positions(
        &self,
        estimate: &SegmentEstimate,
        references: &[Reference],
    ) -> Vec<Option<PositionErrors>> {
        let errors =
            |t| references.first().and_then(|reference| evaluate_position(t, reference, estimate.from_s()));
        estimate.trajectories.iter().map(errors).collect()
    }
}

fn columns(experiment: &Experiment, index: usize) -> Result<Columns<'_>, ConfigError> {
    let key = Key::from("recording").index(index).child("channels");
    let channels = &experiment.recording(index)?.channels;
    if let Some(trigger) = channels.column("trigger") {
        let [signal, _] = experiment.columns(key, channels, MEANINGS)?;
        return Ok(Columns { signal, trigger: Some(trigger) });
    }
    let [signal] = experiment.columns(key, channels, [MEANINGS[0]])?;
    Ok(Columns { signal, trigger: None })
}

/// Refuses samples that are too far apart for the motion that trigger or mechanics speak of.
fn require_fast_enough(
    hardware: &settings::Hardware,
    data: &SegmentData,
    place: &str,
) -> Result<(), EstimateError> {
    let stated = hardware.mechanics.map(|mechanics| mechanics.resonance_hz);
    let rate_hz = 1.0 / data.interval_s;
    let Some(motion_hz) = data.motion_hz.or(stated).filter(|motion_hz| rate_hz <= 2.0 * motion_hz) else {
        return Ok(());
    };
    let alias_hz = (motion_hz - rate_hz * (motion_hz / rate_hz).round()).abs();
    let distances = data.signal.iter().filter_map(|c| distance_at(&hardware.plates, *c));
    let (near, far) = distances.fold((f64::INFINITY, 0.0_f64), |(n, f), d| (n.min(d), f.max(d)));
    let error_m = (far - near).max(0.0);
    Err(EstimateError::SampledTooSlowly { place: place.to_owned(), rate_hz, motion_hz, alias_hz, error_m })
}

//! The piston mirror: a mirror before a plate, its distance read by a carrier through their capacitance.
//!
//! Faller and Zangl, Feasibility Considerations on an Inkjet-Printed Capacitive Position Sensor for Electrostatically
//! Actuated Resonant MEMS-Mirror Systems, 2017. One sample of the capacitance tells the position to a few tenths of a
//! micrometre; that the motion is a sinusoid makes nanometres of it.

mod bound;
mod course;
mod data;
pub mod device;
mod driven;
mod expanded;
mod identification;
mod mechanics;
mod metamodel;
mod observability;
mod outlook;
mod phase_lock;
mod phasor;
mod plates;
mod range;
mod remarks;
mod segment;
mod settings;
mod simulation;
mod start;
mod trigger;

use super::{Estimator, Rig, StateDensity, Template, TemplateChannel};
use crate::Expansion;
use crate::config::{ConfigError, DeviceKind, DeviceUses, DriveSource, Experiment, Key, RecordingRole};
use crate::estimate::{
    DeviceParameter, EstimateError, Past, RowsAround, SegmentEstimate, SegmentPart, SignalSegment,
};
use crate::evaluate::ValueState;
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::piston_mirror::device::PistonMirror;
use crate::progress::Progress;
use crate::recording::{Finding, RecordingLayout};
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
pub use bound::{MotionBound, motion_bound};
pub use data::PistonSegment;
use kalmems_engines::rig::LengthScale;
pub use mechanics::Mechanics;
pub use metamodel::{DegreeError, Metamodel, MetamodelError, OutsideTable, fit_table};
pub use plates::{COEFFICIENTS, Plates, distance_at};
use range::without_impossible;
use remarks::{RemarkTally, changes_of_frequency};
pub use segment::{PartData, estimate as estimate_segment};
pub use settings::{MotionKnowledge, PistonFilterSettings, PistonHardware, PistonSettings};
pub use start::{NoPistonBatchStart, PistonBatchStart, batch_fit, batch_start, canonical};
use trigger::motion_frequency;

/// The rig.
pub struct PistonMirrorRig;

/// Cycles of the motion that have to follow the settling time.
const CYCLES: f64 = 10.0;

/// What a reference may know; the first is what the instrument is for.
static VALUES: [ValueState; 2] = [
    ValueState { name: "position", kind: &kind::LENGTH, rate: Some("velocity") },
    ValueState { name: "velocity", kind: &kind::VELOCITY, rate: None },
];

/// The channels that an estimate may have: the capacitance, and a trigger of the drive.
const MEANINGS: [&str; 2] = ["signal", "trigger"];

/// The columns of a recording.
struct PistonColumns<'a> {
    signal: &'a str,
    trigger: Option<&'a str>,
}

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[TemplateChannel::needed(
        "signal",
        ("the measured capacitance", "F"),
        &["signal", "cap", "c_"],
    )],
    references: &[TemplateChannel::optional(
        "position",
        ("the position, measured otherwise", "m"),
        &["position", "displacement", "distance"],
    )],
};

impl Rig for PistonMirrorRig {
    fn name(&self) -> &'static str {
        "piston_mirror"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<PistonMirror>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn uses(&self, _: &Experiment) -> DeviceUses {
        DeviceUses { reads_capacitance: true, ..DeviceUses::default() }
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        experiment.device::<PistonMirror>().map(|_| true)
    }

    fn length_scale(&self, experiment: &Experiment) -> Result<Option<LengthScale>, ConfigError> {
        let mirror = experiment.device::<PistonMirror>()?;
        let length = mirror.capacitance.reference_distance.clone();
        Ok(Some(LengthScale { key: "device.piston_mirror.capacitance.reference_distance", length }))
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        &settings::PARAMETERS
    }

    fn densities(&self, experiment: &Experiment) -> Vec<StateDensity> {
        settings::densities(experiment)
    }

    fn identify(&self, experiment: &Experiment, _: &dyn Progress) -> Result<Identification, IdentifyError> {
        identification::identify(experiment)
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        PistonSettings::of(experiment)?;
        experiment.to_estimate(&[RecordingRole::Test], |index| columns(experiment, index))
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let columns = columns(experiment, index)?;
        let all: Vec<&str> = [Some(columns.signal), columns.trigger].into_iter().flatten().collect();
        experiment.layout_to_estimate(index, &all, PistonSettings::cycle_s(experiment)?)
    }

    fn angles(&self) -> &'static [[&'static str; 2]] {
        &[]
    }

    fn values(&self, _: &Experiment) -> &'static [ValueState] {
        &VALUES
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
        let settings = PistonSettings::of(experiment)?;
        let columns = columns(experiment, index)?;
        Ok(Box::new(PistonEstimator {
            settings,
            columns,
            past: Past::default(),
            tally: RemarkTally::default(),
            progress,
        }))
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        if let Some(simulate) = &experiment.simulate
            && !matches!(simulate.drive, DriveSource::Prescribed(_))
        {
            return Ok(Box::new(driven::DrivenPistonSimulation::of(experiment, simulate)?));
        }
        Ok(Box::new(simulation::PhasorSimulation::of(experiment)?))
    }
}

/// Estimates recordings of the mirror.
struct PistonEstimator<'a> {
    settings: PistonSettings,
    columns: PistonColumns<'a>,
    past: Past,
    tally: RemarkTally,
    progress: &'a dyn Progress,
}

impl Estimator for PistonEstimator<'_> {
    fn around(&self, interval_s: f64) -> RowsAround {
        let smooths = self.settings.filters.iter().any(|filter| filter.basics.smooth);
        RowsAround {
            head: self.head(interval_s),
            before: 1 + start::rows_of_window(interval_s),
            after: 1,
            smooths,
        }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, columns) = (&self.settings, &self.columns);
        let hardware = &settings.hardware;
        let segment =
            SignalSegment::of(part, (columns.signal, &kind::CAPACITANCE), settings.skip_s, &mut self.past)?;
        if segment.begins {
            self.tally = RemarkTally::default();
        }
        segment.require_usable_signals(&[columns.signal])?;
        let (time_s, interval_s) = (segment.time_s.as_slice(), segment.interval_s);
        let head = if segment.begins { segment.fresh.end.min(self.head(interval_s)) } else { 0 };
        let head = 0..head;
        let motion_hz = columns.trigger.filter(|_| segment.begins).map(|column| {
            let values = segment.recording.column_of(column, &kind::VOLTAGE)?.of(segment.segment);
            motion_frequency(&time_s[head.clone()], &values[head.clone()], interval_s).map_err(|why| {
                let (place, column) = (segment.place.clone(), column.to_owned());
                EstimateError::Trigger { place, column, why: why.to_string() }
            })
        });
        let recorded = PistonSegment {
            time_s,
            signal: segment.signal,
            interval_s,
            noise_variance: hardware.noise_variance(interval_s),
            motion_hz: motion_hz.transpose()?,
        };
        if segment.begins {
            require_fast_enough(hardware, &recorded, &segment.place)?;
        }
        let (kept, beyond) = without_impossible(hardware, &recorded, &segment.fresh);
        let data = PistonSegment { signal: kept.as_deref().unwrap_or(segment.signal), ..recorded };
        let part = PartData { data, samples: segment.samples(), head, place: &segment.place };
        let (trajectories, motion) = segment::estimate(settings, &part, &mut self.past, self.progress)?;
        segment.require_after_settling(CYCLES / motion.frequency_hz)?;
        self.tally.add(hardware, beyond, &trajectories);
        let mut remarks = changes_of_frequency(&trajectories);
        if segment.ends {
            remarks.extend(self.tally.remarks(hardware, &data, &trajectories));
        }
        Ok(SegmentEstimate { remarks, ..segment.estimated(motion, trajectories) })
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        EstimateError::of_unusable_signal(diagnosis, (place, &[self.columns.signal]), |_| true)
    }
}

/// Samples of a segment's beginning at least that a start from the signal may look at, and how long they last in s.
const HEAD: (usize, f64) = (4096, 2.0 * start::WINDOW_S);

impl PistonEstimator<'_> {
    /// The samples of a segment's beginning that tell the start, the settling time among them; more would not tell it
    /// better than the filters need it.
    fn head(&self, interval_s: f64) -> usize {
        let (least, least_s) = HEAD;
        let stated_s = self.settings.hardware.mechanics.map_or(0.0, |m| 2.0 * start::CYCLES / m.resonance_hz);
        let head_s = least_s.max(stated_s).max(self.settings.skip_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let head = (head_s / interval_s).ceil() as usize;
        head.clamp(least, RowsAround::LONGEST_HEAD)
    }
}

fn columns(experiment: &Experiment, index: usize) -> Result<PistonColumns<'_>, ConfigError> {
    let key = Key::from("recording").index(index).child("channels");
    let channels = &experiment.recording(index)?.channels;
    if let Some(trigger) = channels.column("trigger") {
        let [signal, _] = experiment.columns(key, channels, MEANINGS)?;
        return Ok(PistonColumns { signal, trigger: Some(trigger) });
    }
    let [signal] = experiment.columns(key, channels, [MEANINGS[0]])?;
    Ok(PistonColumns { signal, trigger: None })
}

/// Refuses samples that are too far apart for the motion that trigger or mechanics speak of.
fn require_fast_enough(
    hardware: &PistonHardware,
    data: &PistonSegment,
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

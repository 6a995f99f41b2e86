//! The micro-stage: a piezoelectric stage that shakes a gyroscope, and says by capacitors underneath how fast it turns.
//!
//! Chen, On-chip sensing and motion estimation for MEMS, dissertation, 2018, chapter 3. Up to four electrodes under the
//! stage give a voltage η·C′(θ)·θ̇ each; what the drive alone makes of them is known from the same record without bias. A
//! vibrometer at the stage's edge is what gaps and gains are identified with, and what estimates are judged by.

mod course;
pub mod device;
mod drive_sine;
mod expanded;
mod feedthrough;
mod feedthrough_error;
mod filters;
mod hardware;
pub mod identification;
mod lock_in;
mod outlook;
mod plant;
mod records;
mod segment;
mod settings;
mod simulation;

use super::{Estimator, Rig, StateDensity, Template, TemplateChannel};
use crate::Expansion;
use crate::config::{
    self, ConfigError, ConfigFault, DeviceKind, DeviceUses, Experiment, Key, Method, RecordingRole,
};
use crate::estimate::{
    AngleAxis, DeviceParameter, EstimateError, MotionRate, Past, RowsAround, SegmentEstimate, SegmentPart,
    SignalSegment, rows_for_start,
};
use crate::evaluate::ValueState;
use crate::evaluate::{EdgeVelocity, Instruments};
use crate::identify::{Identification, IdentifyError};
use crate::micro_stage::device::MicroStage;
use crate::outlook::Outlook;
use crate::progress::Progress;
use crate::recording::{Finding, RecordingLayout};
use crate::signal::{Sine, fit_sine};
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
use drive_sine::{DriveSine, leaves_at};
pub use feedthrough::{BiasOffRecord, without_drive};
pub use hardware::{ElectrodeChannel, StageHardware};
use records::{DRIVE, StageRecords, columns, of_role, place, require_one_frequency};
use segment::StageSamples;
use settings::StageSettings;
use simulation::StageSimulation;
use std::ops::Range;

/// Electrodes that a stage has for one axis.
pub const ELECTRODES: usize = identification::ELECTRODES;

/// The rig.
pub struct MicroStageRig;

/// What a reference may know: the rate is what the stage is for.
static VALUES: [ValueState; 2] = [
    ValueState { name: "rate", kind: &kind::ANGULAR_RATE, rate: None },
    ValueState { name: "angle", kind: &kind::ANGLE, rate: Some("rate") },
];

/// What currents of moving plates do not allow.
static NO_METHODS: [(Method, &str); 1] = [(
    Method::DirectInversion,
    "each of its currents is the product of the rate and of a function of the angle: one sample tells neither, and where the stage \
     turns round, samples of all electrodes together do not tell the angle; use `ekf` or `lock_in`",
)];

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[
        TemplateChannel::DRIVE,
        TemplateChannel::needed("signal_1A", ("the output of electrode 1A", "V"), &["1a"]),
        TemplateChannel::needed("signal_1B", ("the output of electrode 1B", "V"), &["1b"]),
        TemplateChannel::needed("signal_2A", ("the output of electrode 2A", "V"), &["2a"]),
        TemplateChannel::needed("signal_2B", ("the output of electrode 2B", "V"), &["2b"]),
    ],
    references: &[TemplateChannel::optional(
        "edge_velocity",
        ("the output of the vibrometer", "V"),
        &["ldv", "vibro", "edge"],
    )],
};

impl Rig for MicroStageRig {
    fn name(&self) -> &'static str {
        "micro_stage"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<MicroStage>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        experiment.device::<MicroStage>().map(|_| true)
    }

    fn uses(&self, _: &Experiment) -> DeviceUses {
        DeviceUses { several_signals: true, no_methods: &NO_METHODS, ..DeviceUses::default() }
    }

    fn instruments(&self, experiment: &Experiment) -> Result<Instruments, ConfigError> {
        let stage = experiment.device::<MicroStage>()?;
        Ok(Instruments { edge: stage.vibrometer.as_ref().map(EdgeVelocity::from), ..Instruments::default() })
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        &filters::PARAMETERS
    }

    fn densities(&self, _: &Experiment) -> Vec<StateDensity> {
        vec![StateDensity::angular_acceleration(filters::NOISE, "the rate")]
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        let settings = StageSettings::of(experiment)?;
        experiment.to_estimate(&[RecordingRole::Test, RecordingRole::BiasOn], |index| {
            let (_, signals) = columns(experiment, &settings.hardware, index)?;
            if signals.is_empty() {
                let key = Key::from("recording").index(index).child("channels");
                let meaning = settings.hardware.channels.first().map(ElectrodeChannel::meaning);
                let meaning = meaning.unwrap_or_default();
                let remedy =
                    format!("name the column of at least one electrode, such as `{meaning} = \"cap_V\"`");
                return Err(experiment.error(key.child(&meaning), ConfigFault::MissingKey { remedy }));
            }
            if experiment.recordings[index].role == RecordingRole::BiasOn {
                bias_off_index(experiment)?;
            }
            Ok(())
        })
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let hardware = StageHardware::of(experiment)?;
        let (drive, signals) = columns(experiment, &hardware, index)?;
        let names: Vec<&str> =
            [drive].into_iter().chain(signals.into_iter().map(|(_, column)| column)).collect();
        experiment.layout_to_estimate(index, &names, 1.0 / hardware.natural_hz())
    }

    fn angles(&self, _: &Experiment) -> &'static [[&'static str; 2]] {
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
        let settings = StageSettings::of(experiment)?;
        let described = experiment.recording(index)?;
        let columns = columns(experiment, &settings.hardware, index)?;
        let bias_off = match described.role {
            RecordingRole::BiasOn => Some(bias_off(experiment, &settings.hardware, progress)?),
            _ => None,
        };
        let (past, off, drive) = (Past::default(), None, None);
        Ok(Box::new(StageEstimator {
            experiment,
            settings,
            described,
            columns,
            bias_off,
            off,
            past,
            drive,
            progress,
        }))
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(StageSimulation::of(experiment)?))
    }

    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }
}

/// Estimates recordings of the stage.
struct StageEstimator<'a> {
    experiment: &'a Experiment,
    settings: StageSettings,
    described: &'a config::Recording,
    /// That of the drive, and those of the electrodes by their places in the hardware.
    columns: (&'a str, Vec<(usize, &'a str)>),
    /// The recording without bias, where that is needed.
    bias_off: Option<StageRecords>,
    /// Its record for the present segment, and the electrodes that its signals are of.
    off: Option<(BiasOffRecord, Vec<usize>)>,
    past: Past,
    /// What its drive has followed so far.
    drive: Option<FollowedDrive>,
    progress: &'a dyn Progress,
}

impl Estimator for StageEstimator<'_> {
    fn wants(&self, label: &str) -> bool {
        !(self.described.role == RecordingRole::BiasOn && is_training(self.experiment, label))
    }

    fn around(&self, interval_s: f64) -> RowsAround {
        let smooths = self.settings.filters.iter().any(|filter| filter.basics.smooth);
        let cycle_s = self.settings.hardware.natural_hz().recip();
        let again =
            self.settings.filters.iter().map(|filter| filter.rows_to_start_again((cycle_s, interval_s)));
        RowsAround { head: self.head(interval_s), before: 1 + again.fold(0, usize::max), after: 1, smooths }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (drive, signals) = &self.columns;
        let names: Vec<&str> = signals.iter().map(|(_, column)| *column).collect();
        let first = (names.first().copied().unwrap_or(DRIVE), &kind::VOLTAGE);
        let segment = SignalSegment::of(part, first, self.settings.skip_s, &mut self.past)?;
        if segment.begins {
            self.drive = None;
        }
        segment.require_after_settling(segment.interval_s)?;
        let place = self.place(&segment);
        segment.require_usable_signals(&names)?;
        let time_s = segment.time_s.as_slice();
        let volts = segment.recording.column_of(drive, &kind::VOLTAGE)?.of(segment.segment);
        let unknown: Vec<usize> = (0..volts.len()).filter(|k| !volts[*k].is_finite()).collect();
        if let Some(first) = unknown.first() {
            let (column, count, first_s) = ((*drive).to_owned(), unknown.len(), time_s[*first]);
            return Err(EstimateError::DriveUnknown { place, column, count, first_s });
        }
        let kept = self.drive.take();
        let mut followed = self.followed(kept, &segment, volts, &place)?;
        let sine = followed.sine.sine();
        if segment.begins || self.off.is_none() {
            let records = self.bias_off.as_ref();
            self.off =
                records.map(|records| off_of(records, &segment.segment.label, &place, &sine)).transpose()?;
        }
        let sines = followed.sine.over(segment.fresh.end, time_s.len());
        let (mut cleaned, mut feedthrough_sd) = (Vec::new(), Vec::new());
        for (electrode, column) in signals {
            let values = segment.recording.column_of(column, &kind::VOLTAGE)?.of(segment.segment);
            if segment.begins && !values.iter().any(|y| y.is_finite()) {
                return Err(EstimateError::NoSignal { place, column: (*column).to_owned() });
            }
            cleaned.push(self.cleaned(*electrode, (time_s, values), &sines, &place)?);
            feedthrough_sd.push(self.feedthrough_sd(*electrode));
        }
        let samples = StageSamples {
            place: &place,
            time_s,
            taken: segment.samples(),
            drive: volts,
            sines: &sines,
            drive_hz: followed.first_hz,
            electrodes: &signals.iter().map(|(electrode, _)| *electrode).collect::<Vec<_>>(),
            signals: cleaned,
            feedthrough_sd,
        };
        let trajectories = segment::estimate(&self.settings, &samples, &mut self.past, self.progress)?;
        let motion = MotionRate { frequency_hz: followed.first_hz, is_driven: true };
        self.past.numbers = std::iter::once(followed.first_hz).chain(followed.sine.numbers()).collect();
        self.drive = Some(followed);
        let axis = AngleAxis { angle: "angle", motion, drive: Some(sine) };
        Ok(segment.estimated_under(drive, (axis, Vec::new()), trajectories))
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        let names: Vec<&str> = self.columns.1.iter().map(|(_, column)| *column).collect();
        EstimateError::of_unusable_signal(diagnosis, (place, &names), |label| self.wants(label))
    }
}

/// What is known of the drive of a record.
struct FollowedDrive {
    /// The frequency that it had at the record's beginning, in Hz.
    first_hz: f64,
    /// The sine that it follows.
    sine: DriveSine,
}

/// Rows of a record's beginning at least, and cycles of the free tilt, that tell the sine of the drive; later on as many rows
/// tell how it goes on.
const HEAD: (usize, f64) = (4096, 12.0);

impl StageEstimator<'_> {
    fn place(&self, segment: &SignalSegment) -> String {
        let name = self.described.name.as_ref();
        let name = name.map_or_else(|| segment.recording.source().file.clone(), ToString::to_string);
        place(&name, &segment.segment.label)
    }

    /// The rows of a record's beginning, those of the settling time among them.
    fn head(&self, interval_s: f64) -> usize {
        let by_batch = self.settings.filters.iter().filter(|filter| filter.by_batch);
        let cycle_s = self.settings.hardware.natural_hz().recip();
        let for_start = by_batch
            .map(|filter| rows_for_start((cycle_s, interval_s), 2 + filter.basics.parameters().len()));
        let head = rows(self.settings.skip_s / interval_s).max(self.block(interval_s));
        for_start.fold(head, usize::max).min(RowsAround::LONGEST_HEAD)
    }

    /// The rows of a block that tells how the drive goes on.
    fn block(&self, interval_s: f64) -> usize {
        let (least, cycles) = HEAD;
        let cycles_s = cycles / self.settings.hardware.natural_hz();
        rows(cycles_s / interval_s).clamp(least, RowsAround::LONGEST_HEAD)
    }

    /// What the drive follows until the end of a part.
    fn followed(
        &self,
        kept: Option<FollowedDrive>,
        segment: &SignalSegment,
        volts: &[f64],
        place: &str,
    ) -> Result<FollowedDrive, EstimateError> {
        let not_steady = |time_s| EstimateError::DriveChanges {
            place: place.to_owned(),
            column: self.columns.0.to_owned(),
            time_s,
        };
        let (time_s, interval_s) = (segment.time_s.as_slice(), segment.interval_s);
        let resumed = || match self.past.numbers[..] {
            [first_hz, ref rest @ ..] if !segment.begins => {
                DriveSine::resumed(rest).map(|sine| FollowedDrive { first_hz, sine })
            }
            _ => None,
        };
        let mut fresh = segment.fresh.clone();
        let mut followed = if let Some(followed) = kept.or_else(resumed) {
            followed
        } else {
            let head = fresh.start..fresh.end.min(fresh.start + self.head(interval_s));
            fresh.start = head.end;
            let block = (interval_s, self.block(interval_s));
            let (time_s, volts) = (&time_s[head.clone()], &volts[head]);
            let sine = DriveSine::of_head(time_s, volts, block).ok_or_else(|| {
                // Where it begins with a sine, that tells when it changes.
                let part = time_s.len() / 4;
                let begins = fit_sine(&time_s[..part], &volts[..part], interval_s).filter(Sine::is_steady);
                let left_s = begins.and_then(|sine| leaves_at(&sine, time_s, volts));
                not_steady(left_s.or(time_s.first().copied()).unwrap_or(f64::NAN))
            })?;
            FollowedDrive { first_hz: sine.sine().frequency_hz, sine }
        };
        followed.sine.take(time_s, volts, fresh).map_err(|block_s| {
            let from = time_s.partition_point(|time_s| *time_s < block_s);
            not_steady(leaves_at(&followed.sine.sine(), &time_s[from..], &volts[from..]).unwrap_or(block_s))
        })?;
        Ok(followed)
    }

    /// How well each component of what is taken off the signal of an electrode is known by the record with the bias off, in V for each volt of the drive.
    fn feedthrough_sd(&self, electrode: usize) -> f64 {
        let known = self
            .off
            .as_ref()
            .and_then(|(off, order)| off.sd_per_volt(order.iter().position(|known| *known == electrode)?));
        known.unwrap_or(0.0)
    }

    /// The signal of an electrode without what the drive makes of it, whose sines these rows have.
    fn cleaned(
        &self,
        electrode: usize,
        (time_s, values): (&[f64], &[f64]),
        sines: &[(Range<usize>, Sine)],
        place: &str,
    ) -> Result<Vec<f64>, EstimateError> {
        let channel = &self.settings.hardware.channels[electrode];
        let place_in = |order: &[usize]| {
            order.iter().position(|e| *e == electrode).ok_or_else(|| EstimateError::Unfit {
                place: place.to_owned(),
                why: format!(
                    "the recording with the bias off has no channel `{}`; name its column there too",
                    channel.meaning()
                ),
            })
        };
        let off = self.off.as_ref().map(|(off, order)| place_in(order).map(|at| (off, at))).transpose()?;
        let part = |(rows, sine): &(Range<usize>, Sine)| {
            let (time_s, values) = (&time_s[rows.clone()], &values[rows.clone()]);
            match (off, channel.feedthrough) {
                (Some((off, at)), _) => off.cancel(at, time_s, sine, values),
                (None, Some(known)) => without_drive(time_s, sine, values, known),
                (None, None) => values.to_vec(),
            }
        };
        Ok(sines.iter().flat_map(part).collect())
    }
}

/// A count of rows.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
fn rows(count: f64) -> usize {
    count.ceil() as usize
}

/// Whether a record serves the identification alone.
fn is_training(experiment: &Experiment, label: &str) -> bool {
    experiment.identify.as_ref().is_some_and(|identify| identify.training.iter().any(|name| name == label))
}

/// The recording without bias that one with bias needs.
fn bias_off_index(experiment: &Experiment) -> Result<usize, ConfigError> {
    of_role(experiment, RecordingRole::BiasOff).first().copied().ok_or_else(|| {
        let why = "a recording has the role `bias_on` and none has `bias_off`: what of the signals is the drive's and not \
                   the motion's is not known. Record the same drives with the sensing bias off and add them as a \
                   `[[recording]]` with `role = \"bias_off\"` and the same labels; or, where the electrodes state their \
                   `feedthrough`, give the recording the role `test`"
            .to_owned();
        experiment.error("recording", ConfigFault::Value { why })
    })
}

fn bias_off(
    experiment: &Experiment,
    hardware: &StageHardware,
    progress: &dyn Progress,
) -> Result<StageRecords, EstimateError> {
    let index = bias_off_index(experiment)?;
    records::read(experiment, hardware, index, progress).map_err(as_estimate_error)
}

fn as_estimate_error(error: IdentifyError) -> EstimateError {
    match error {
        IdentifyError::Config(error) => error.into(),
        IdentifyError::Read(error) => error.into(),
        IdentifyError::Interrupted => EstimateError::Interrupted,
        IdentifyError::Unfit { recording, why } => EstimateError::Unfit { place: recording, why },
        other => EstimateError::Unfit {
            place: "the recording with the bias off".to_owned(),
            why: other.to_string(),
        },
    }
}

/// The record without bias that belongs to one with bias, and the electrodes that its signals are of.
fn off_of(
    records: &StageRecords,
    label: &str,
    place: &str,
    drive: &Sine,
) -> Result<(BiasOffRecord, Vec<usize>), EstimateError> {
    let (off, electrodes) = identification::off_of(records, label, place).map_err(as_estimate_error)?;
    require_one_frequency([(place, drive), (off.label.as_str(), &off.drive)]).map_err(as_estimate_error)?;
    Ok((off, electrodes.to_vec()))
}

//! The force-rebalance accelerometer: a mass between plates that sense it, and push it back where there is a loop.
//!
//! Zhang, Sensing and Control of MEMS Accelerometers Using Kalman Filter, 2010. The thesis's observer is given the
//! acceleration as a known input. An instrument that is to measure it does not have it: here the acceleration is a state,
//! and the known input is there for comparison, under a name that says so.

mod bank;
mod course;
mod data;
pub mod device;
mod dither;
mod expanded;
mod feedback;
mod filters;
mod identification;
mod instrument;
mod noise_estimate;
mod outlook;
mod pull_in;
mod run;
mod segment;
mod settings;
mod simulation;
mod uncertainty;
mod varied_instrument;

use super::{Estimator, NumberForm, OmittedNumber, Rig, Template, TemplateChannel};
use crate::Expansion;
use crate::accelerometer::device::AccelerometerTable;
use crate::config::{
    ConfigError, ConfigFault, DeviceKind, DeviceUses, Experiment, Key, Method, RecordingRole,
};
use crate::estimate::{
    DeviceParameter, EstimateError, Past, RowsAround, SegmentEstimate, SegmentPart, SignalSegment,
    rows_for_start, rows_to_start_again,
};
use crate::evaluate::ValueState;
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::progress::Progress;
use crate::recording::{Finding, RecordingLayout};
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
pub use data::AccelerometerSegment;
pub use filters::AccelerometerFilterSettings;
use instrument::Instrument;
pub use instrument::settled_acceleration_sd;
pub use run::{Acceleration, AccelerometerRun, ControllerInput, ControllerTiming, Moment};
pub use segment::{AccelerometerPast, estimate as estimate_segment};
pub use settings::{AccelerometerHardware, AccelerometerSettings};
use simulation::AccelerometerSimulation;
pub use simulation::closed_loop;
use std::f64::consts::TAU;

/// The rig.
pub struct AccelerometerRig;

/// What a reference may know; the first is what the instrument is for.
static VALUES: [ValueState; 3] = [
    ValueState { name: "acceleration", kind: &kind::ACCELERATION, rate: Some("jerk") },
    ValueState { name: "displacement", kind: &kind::LENGTH, rate: Some("velocity") },
    ValueState { name: "velocity", kind: &kind::VELOCITY, rate: None },
];

/// What an acceleration that no one knows does not allow.
static NO_METHODS: [(Method, &str); 1] = [(
    Method::LockIn,
    "the acceleration that it measures has no frequency of its own that a signal could be locked to; use `ekf`",
)];

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[
        TemplateChannel::SIGNAL,
        TemplateChannel::optional(
            "feedback",
            ("the voltage that the loop feeds back", "V"),
            &["feedback", "loop", "vfb"],
        ),
    ],
    references: &[TemplateChannel::optional(
        "acceleration",
        ("the acceleration, measured otherwise", "m/s²"),
        &["acc", "reference"],
    )],
};

impl Rig for AccelerometerRig {
    fn name(&self) -> &'static str {
        "accelerometer"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<AccelerometerTable>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        experiment.device::<AccelerometerTable>().map(|_| true)
    }

    fn uses(&self, experiment: &Experiment) -> DeviceUses {
        DeviceUses {
            no_methods: &NO_METHODS,
            acceleration: true,
            feedback: simulation::feedback(experiment).is_some(),
            ..DeviceUses::default()
        }
    }

    fn left_out(&self, _: &Experiment) -> Vec<OmittedNumber> {
        let squeezed_film = OmittedNumber {
            key: "proof_mass.squeezed_film",
            unit: "",
            step: 1e-3,
            is_never_negative: true,
            form: NumberForm::Number,
            filter_switch: None,
        };
        vec![squeezed_film]
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        &uncertainty::PARAMETERS
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        AccelerometerSettings::of(experiment)?;
        experiment.to_estimate(&[RecordingRole::Test], |index| AccelerometerColumns::of(experiment, index))
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let columns = AccelerometerColumns::of(experiment, index)?;
        let all = [Some(columns.signal), columns.feedback, columns.acceleration];
        let cycle_s = AccelerometerHardware::of(experiment)?.cycle_s();
        experiment.layout_to_estimate(index, &all.into_iter().flatten().collect::<Vec<_>>(), cycle_s)
    }

    fn input(&self) -> &'static str {
        "feedback"
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
        let settings = AccelerometerSettings::of(experiment)?;
        let columns = AccelerometerColumns::of(experiment, index)?;
        Ok(Box::new(AccelerometerEstimator {
            settings,
            columns,
            past: AccelerometerPast::default(),
            progress,
        }))
    }

    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(AccelerometerSimulation::of(experiment)?))
    }
}

/// Estimates recordings of the instrument.
struct AccelerometerEstimator<'a> {
    settings: AccelerometerSettings,
    columns: AccelerometerColumns<'a>,
    past: AccelerometerPast,
    progress: &'a dyn Progress,
}

/// Samples that show the sign of the feedback at least.
const HEAD: usize = 4096;

impl Estimator for AccelerometerEstimator<'_> {
    fn around(&self, interval_s: f64) -> RowsAround {
        let smooths = self.settings.filters.iter().any(|filter| filter.basics.smooth);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let skipped = (self.settings.skip_s / interval_s).ceil() as usize;
        let from_signal = self.settings.filters.iter().any(|filter| filter.from_signal);
        let fastest = Instrument::sensed(&self.settings.hardware).map_or(0.0, |device| device.fastest());
        let for_start =
            if from_signal { rows_for_start((TAU / fastest, interval_s), filters::MOST_STATES) } else { 0 };
        let before = 1 + rows_to_start_again((TAU / fastest, interval_s), filters::MOST_STATES);
        RowsAround { head: skipped.max(HEAD).max(for_start), before, after: 1, smooths }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past.segment
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, columns, past) = (&self.settings, &self.columns, &mut self.past);
        let segment =
            SignalSegment::of(part, (columns.signal, &kind::VOLTAGE), settings.skip_s, &mut past.segment)?;
        if segment.begins {
            past.begin();
        }
        segment.require_usable_signals(&[columns.signal])?;
        segment.require_after_settling(segment.interval_s)?;
        let optional = |name: Option<&str>, kind| {
            let column = name.map(|name| segment.recording.column_of(name, kind)).transpose();
            column.map(|column| column.map(|column| column.of(segment.segment)))
        };
        let data = AccelerometerSegment {
            time_s: &segment.time_s,
            signal: segment.signal,
            feedback: optional(columns.feedback, &kind::VOLTAGE)?,
            acceleration: optional(columns.acceleration, &kind::ACCELERATION)?,
            interval_s: segment.interval_s,
        };
        for (values, name) in [(data.feedback, columns.feedback), (data.acceleration, columns.acceleration)] {
            data.require_whole(values, name.unwrap_or_default(), &segment.place)?;
        }
        if !settings.hardware.has_feedback {
            feedback::require_none(&data, &segment.place)?;
        }
        pull_in::require_free(&settings.hardware, &data, columns.signal, &segment.place)?;
        let drive_column = columns.feedback.unwrap_or_default();
        if segment.begins {
            feedback::require_right(&settings.hardware, &data, drive_column, &segment.place)?;
        }
        let trajectories =
            segment::estimate(settings, &data, &segment.samples(), past, &segment.place, self.progress)?;
        let estimate = segment.estimated(segment::motion(settings), trajectories);
        Ok(SegmentEstimate { drive_column: drive_column.to_owned(), ..estimate })
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        EstimateError::of_unusable_signal(diagnosis, (place, &[self.columns.signal]), |_| true)
    }
}

/// The columns of a recording.
struct AccelerometerColumns<'a> {
    signal: &'a str,
    /// Where there is a loop.
    feedback: Option<&'a str>,
    /// Where a filter has it as a known input.
    acceleration: Option<&'a str>,
}

/// The channels that an estimate may need.
const MEANINGS: [&str; 3] = ["signal", "feedback", "acceleration"];

impl<'a> AccelerometerColumns<'a> {
    /// Those that the filters and the device need; that of the acceleration is left alone where no filter is to know it.
    fn of(experiment: &'a Experiment, index: usize) -> Result<Self, ConfigError> {
        let settings = AccelerometerSettings::of(experiment)?;
        let channels = &experiment.recording(index)?.channels;
        let key = || Key::from("recording").index(index).child("channels");
        if let Some((name, _)) = channels.iter().find(|(name, _)| !MEANINGS.contains(name)) {
            return Err(experiment.error(key().child(name), ConfigFault::unknown_key(name, MEANINGS)));
        }
        let wanted = |name: &str, example: &str, needed: bool| match channels.column(name) {
            Some(column) => Ok(Some(column)),
            None if needed => {
                let remedy = format!("name the column, such as `{name} = \"{example}\"`");
                Err(experiment.error(key().child(name), ConfigFault::MissingKey { remedy }))
            }
            None => Ok(None),
        };
        let known = settings.filters.iter().any(|filter| filter.known_acceleration);
        let acceleration = wanted("acceleration", "acceleration_m_per_s2", known)?;
        Ok(Self {
            signal: wanted("signal", "output_V", true)?.unwrap_or_default(),
            feedback: wanted("feedback", "feedback_V", settings.hardware.has_feedback)?,
            acceleration: acceleration.filter(|_| known),
        })
    }
}

//! A device of one's own: differential equations with units in the table `[device.equations]`, and everything works from them.

mod absent;
mod angles;
mod axes;
mod correction;
mod counted_once;
mod course;
mod curve;
mod event_search;
mod event_sensor;
mod event_times;
mod events;
mod export;
mod export_samples;
mod feedback;
mod feedthrough;
mod feedthrough_course;
mod feedthrough_error;
mod filter_devices;
mod filter_settings;
mod filter_task;
mod first_peak;
mod followed_sine;
mod held_source;
mod input_part;
mod instrument;
mod interpolation;
mod inversion;
mod judged_axes;
mod kinks;
mod known;
mod lines;
mod model;
mod names;
mod number;
mod ordered;
mod oscillation;
mod outlook;
mod own_device;
mod own_filter;
mod part_check;
mod phase_lock;
mod phases;
mod preset;
mod range;
mod reset_mixture;
mod sampled_inputs;
mod segment;
mod settings;
mod simulated_event;
mod simulation;
mod sine;
mod sine_filters;
mod sine_settings;
mod start;
mod swing_gain;
mod swing_start;
mod table;
mod threshold;
mod trigger;
mod visibility;
mod waveform;

pub use absent::AbsentInput;
pub use feedthrough::{BiasOffRecord, differs_in_frequency, without_drive};
pub use first_peak::sign_after_restart;
pub use own_filter::estimate_with;
pub use part_check::CheckedPart;
pub use preset::{OwnExport, Preset, PresetRig, PresetVariant, meant};
pub use table::{Demodulator, EquationsTable};
pub use threshold::PassedThreshold;

use crate::config::{ConfigError, ConfigFault, DeviceKind, DeviceUses, Experiment, Key, RecordingRole};
use crate::estimate::{DeviceParameter, EstimateError};
use crate::evaluate::ValueState;
use crate::export::{ExportError, ExportRequest, Exported};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::progress::Progress;
use crate::recording::{Finding, FindingKind, RecordingLayout, SampledRecording};
use crate::simulate::{SimulateError, Simulation};
use crate::{Estimator, Expansion, RecordingChannels, Rig, StateDensity, Template, TemplateChannel};
use interpolation::Interpolation;
use kalmems_equations::Named;
use own_device::OwnDevice;
use segment::EquationEstimator;
use settings::EquationSettings;
use simulation::EquationSimulation;
use table::refused;

/// The rig of any device that is described by equations.
pub struct EquationsRig;

/// A number in SI with three digits, with a power of ten where it is very small or large.
fn short(value: f64) -> String {
    // −0 is 0.
    let value = value + 0.0;
    let is_plain = value == 0.0 || (1e-3..1e6).contains(&value.abs());
    if is_plain { kalmems_figures::significant(value) } else { format!("{value:.2e}") }
}

/// The columns of a recording.
struct EquationColumns<'a> {
    /// Those of the stated inputs, in the order of the device.
    inputs: Vec<&'a str>,
    /// Those of measurements, with their places.
    measured: Vec<(usize, &'a str)>,
    /// Those of events, with their places: how long before its row each was.
    events: Vec<(usize, &'a str)>,
    /// That of a trigger that tells the frequency of a sine.
    trigger: Option<&'a str>,
    /// Those of states that filters know, in the order of their names.
    known: Vec<(usize, &'a str)>,
    /// Those of inputs that the device is described without.
    absent: Vec<(AbsentInput, &'a str)>,
    /// Whether what an input makes of the signals is taken off.
    takes_off: bool,
}

impl<'a> EquationColumns<'a> {
    /// Of a recording of an experiment.
    fn of(experiment: &'a Experiment, index: usize) -> Result<Self, ConfigError> {
        let (table, device) = EquationsTable::of(experiment)?;
        let key = Key::from("recording").index(index).child("channels");
        let channels = &experiment.recording(index)?.channels;
        let trigger = table.sine.as_ref().and_then(|sine| sine.trigger.as_ref());
        let trigger = trigger.filter(|trigger| channels.column(&trigger.channel).is_some());
        let known = |all: &[Named]| -> Vec<usize> {
            let there = |named: &Named| channels.column(&named.name).is_some();
            all.iter().enumerate().filter(|(_, named)| there(named)).map(|(place, _)| place).collect()
        };
        let (measures, events) = (known(device.measures()), known(device.events()));
        if measures.is_empty() {
            let names: Vec<String> =
                device.measures().iter().map(|named| format!("`{0} = \"{0}_V\"`", named.name)).collect();
            let remedy = format!("name the column of a measurement, such as {}", names.join(" or "));
            return Err(experiment.error(key, ConfigFault::MissingKey { remedy }));
        }
        for settings in events::events(experiment, &OwnDevice::of(experiment)?)? {
            settings.require_channel(experiment, &key, (&measures, &events))?;
        }
        let names = |all: &'_ [Named], places: &[usize]| -> Vec<String> {
            places.iter().map(|place| all[*place].name.to_string()).collect()
        };
        let known = known::known_of_all(experiment, &device)?;
        let of_known: Vec<String> =
            known.iter().map(|place| device.states()[*place].name.to_string()).collect();
        let absent =
            table.absent.iter().filter_map(|absent| Some((*absent, channels.column(absent.channel)?)));
        let absent: Vec<_> = absent.collect();
        // What the device is for may be recorded beside its signals, and a filter that is not given it does not take it.
        let unused = table.answer.iter().filter(|answer| channels.column(answer).is_some());
        let unused = unused.filter(|answer| !of_known.contains(answer)).cloned();
        let shown = table.instruments.iter().map(|(name, _)| name.to_owned());
        let shown = shown.filter(|name| channels.column(name).is_some());
        let stated = device.own_inputs();
        let meanings: Vec<String> = device
            .inputs()
            .iter()
            .take(stated)
            .map(|named| named.name.to_string())
            .chain(names(device.measures(), &measures))
            .chain(names(device.events(), &events))
            .chain(trigger.map(|trigger| trigger.channel.clone()))
            .chain(of_known.iter().cloned())
            .chain(absent.iter().map(|(absent, _)| absent.channel.to_owned()))
            .chain(unused)
            // What an instrument showed may stand there, and nothing takes it.
            .chain(shown)
            .collect();
        let meanings: Vec<&str> = meanings.iter().map(String::as_str).collect();
        let mut columns = experiment.columns_of(key, channels, &meanings)?;
        let mut others = columns.split_off(stated);
        let mut of_events = others.split_off(measures.len());
        let mut of_trigger = of_events.split_off(events.len());
        let of_known = of_trigger.split_off(usize::from(trigger.is_some()));
        Ok(Self {
            inputs: columns,
            measured: measures.into_iter().zip(others).collect(),
            events: events.into_iter().zip(of_events).collect(),
            trigger: of_trigger.first().copied(),
            known: known.into_iter().zip(of_known).collect(),
            absent,
            takes_off: table.feedthrough.is_some(),
        })
    }

    /// Refuses signals that are none of the device by what was found in the recording. One of several may repeat an input, as that of a loop does
    /// which measures what it applies, but where what the input makes of the signals is taken off.
    fn require_usable(
        &self,
        diagnosis: &[Finding],
        place: &str,
        wanted: impl Fn(&str) -> bool,
    ) -> Result<(), EstimateError> {
        let names: Vec<&str> = self.measured.iter().map(|(_, column)| *column).collect();
        let may_repeat = names.len() > 1 && !self.takes_off;
        let counts = |finding: &&Finding| !may_repeat || finding.kind != FindingKind::Repeats;
        let found: Vec<Finding> = diagnosis.iter().filter(counts).cloned().collect();
        EstimateError::of_unusable_signal(&found, (place, &names), wanted)
    }

    /// All of them.
    fn all(&self) -> Vec<&'a str> {
        let others = self.measured.iter().chain(&self.events).map(|(_, column)| *column);
        let others = others.chain(self.known.iter().map(|(_, column)| *column));
        let others = others.chain(self.absent.iter().map(|(_, column)| *column));
        self.inputs.iter().copied().chain(others).chain(self.trigger).collect()
    }
}

/// What an experiment with it begins from.
const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
    references: &[],
};

/// The recordings that are estimated, by their roles.
const ESTIMATED: [RecordingRole; 4] =
    [RecordingRole::Test, RecordingRole::SteadyState, RecordingRole::RingDown, RecordingRole::BiasOn];

/// The recordings with these roles, their filters and channels checked.
fn wanted(experiment: &Experiment, roles: &[RecordingRole]) -> Result<Vec<usize>, ConfigError> {
    EquationSettings::of(experiment)?;
    experiment.to_estimate(roles, |index| {
        EquationColumns::of(experiment, index)?;
        feedthrough::counterpart(experiment, index)
    })
}

impl Rig for EquationsRig {
    fn name(&self) -> &'static str {
        "equations"
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<EquationsTable>()
    }

    fn template(&self) -> Option<Template> {
        Some(TEMPLATE)
    }

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        let why = "the device is described by its differential equations already: change them in the table `[device.equations]`; \
                   `kalmems expand` is for the devices that have a table of their own"
            .to_owned();
        Err(experiment.error(Key::from("device").child("equations"), ConfigFault::Value { why }))
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        EquationsTable::of(experiment).map(|_| true)
    }

    fn uses(&self, experiment: &Experiment) -> DeviceUses {
        let has_angles = !self.angles(experiment).is_empty();
        DeviceUses {
            several_signals: true,
            simulated_channels: true,
            events: true,
            signal_variance: true,
            start_about: true,
            states_readout: true,
            angles: has_angles,
            equations: true,
            ..DeviceUses::default()
        }
    }

    fn channels(&self, experiment: &Experiment) -> RecordingChannels {
        let there = |named: &Named| {
            let column =
                experiment.recordings.first().and_then(|recording| recording.channels.column(&named.name));
            column.map(|_| named.name.to_string())
        };
        EquationsTable::of(experiment).map_or_else(
            |_| RecordingChannels::default(),
            |(table, device)| RecordingChannels {
                // What is held may be fed back, and follows the noise of the signals then: how these go with it at another time says nothing of when it
                // was recorded.
                inputs: (device.inputs().iter())
                    .filter(|named| table.interpolation.of(&named.name) != Interpolation::Hold)
                    .filter_map(there)
                    .collect(),
                signals: device.measures().iter().filter_map(there).collect(),
            },
        )
    }

    fn input(&self) -> &'static str {
        "input"
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        wanted(experiment, &ESTIMATED)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let all = EquationColumns::of(experiment, index)?.all();
        // Where nothing moves by itself, a gap is bounded as if a cycle took a second.
        let own = OwnDevice::of(experiment)?;
        let cycle_s =
            own.natural_hz().map(f64::recip).or_else(|| sine_settings::cycle_s(experiment)).unwrap_or(1.0);
        experiment.layout_to_estimate(index, &all, cycle_s)
    }

    fn angles(&self, experiment: &Experiment) -> &'static [[&'static str; 2]] {
        experiment.device_in_terms_of::<EquationsTable>().map_or(&[], |table| angles::angles(&table))
    }

    fn values(&self, experiment: &Experiment) -> &'static [ValueState] {
        EquationsTable::of(experiment).map_or(&[], |(table, device)| match angles::angles(&table) {
            [] => names::values(&table, &device),
            _ => &[],
        })
    }

    fn densities(&self, experiment: &Experiment) -> Vec<StateDensity> {
        EquationsTable::of(experiment).map_or_else(
            |_| Vec::new(),
            |(table, device)| sine_settings::densities(experiment, &table, &device),
        )
    }

    fn parameters(&self, experiment: &Experiment) -> &'static [DeviceParameter] {
        EquationsTable::of(experiment)
            .map_or(&[], |(table, device)| filter_settings::parameters(experiment, (&table, &device)))
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        Ok(Box::new(EquationEstimator::of(experiment, index, progress)?))
    }

    fn live<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let estimator = EquationEstimator::of(experiment, index, progress)?;
        let side_outputs = phases::wanted(experiment, &estimator.settings)?;
        Ok(Box::new(EquationEstimator { side_outputs, ..estimator }))
    }

    fn signs_from_s(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
    ) -> Result<Vec<f64>, EstimateError> {
        let settings = EquationSettings::of(experiment)?;
        if !settings.own.hides_angle() {
            return Ok(Vec::new());
        }
        let mut peaks_s = sampled_inputs::first_drive_peaks(
            &settings,
            &EquationColumns::of(experiment, index)?,
            recording,
        )?;
        // Of an angle that no axis is of, the drive of the last axis tells.
        let last = peaks_s.last().copied();
        peaks_s.resize(self.angles(experiment).len(), last.unwrap_or(f64::NAN));
        Ok(if last.is_some() { peaks_s } else { Vec::new() })
    }

    /// Its parameters are identified by likelihood, whichever the experiment names.
    fn identify(&self, experiment: &Experiment, _: &dyn Progress) -> Result<Identification, IdentifyError> {
        let table = experiment.device_in_terms_of::<EquationsTable>()?;
        let names: Vec<String> = table.parameters.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let remedy =
            format!("name the parameters that are sought, such as `parameters = [{}]`", names.join(", "));
        Err(experiment.error("identify.parameters", ConfigFault::MissingKey { remedy }).into())
    }

    fn export(&self, experiment: &Experiment, request: &ExportRequest) -> Result<Exported, ExportError> {
        export::export(experiment, request)
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        let mut outlook = outlook::outlook(experiment)?;
        outlook.topics.extend(visibility::visibility(experiment)?);
        Ok(outlook)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(EquationSimulation::of(experiment)?))
    }
}

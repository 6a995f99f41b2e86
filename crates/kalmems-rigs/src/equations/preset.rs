//! Published devices: a table of their own that means equations, and what goes beside these.

use super::table::ParameterKeys;
use super::threshold::PassedThreshold;
use super::{EquationsRig, EquationsTable};
use crate::config::{
    ConfigError, DeviceDescription, DeviceKind, DeviceUses, Experiment, RecordingRole, read_device,
};
use crate::estimate::{DeviceParameter, EstimateError};
use crate::evaluate::{Instruments, ValueState};
use crate::export::{ExportError, ExportRequest, ExportableFilter, Exported};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::{Outlook, OutlookTopic};
use crate::progress::Progress;
use crate::recording::{RecordingLayout, RecordingSource, SampledRecording};
use crate::simulate::{SimulateError, SimulatedColumn, SimulatedSample, Simulation, SimulationStart};
use crate::{Estimator, Expansion, OmittedNumber, RecordingChannels, Rig, StateDensity, Template};
use kalmems_engines::rig::{LengthScale, export_of_rig};
use std::ops::ControlFlow;

/// A filter as it is exported with parts of its own, and the columns of drive and signal.
pub type OwnExport = (Box<dyn ExportableFilter>, [String; 2]);

/// A published device: its table is what an operator writes, and means equations.
pub trait Preset: DeviceDescription {
    /// What an experiment with it begins from.
    const TEMPLATE: Template;
    /// The channels of a simulated recording, and of its reference, with the columns that they have.
    const COLUMNS: [&'static [SimulatedColumn]; 2];
    /// Whether its signal is recorded as a capacitance, and not as a voltage.
    const READS_CAPACITANCE: bool;

    /// The roles of recordings that are estimated; those of the others are for its identification alone.
    const ESTIMATED: &'static [RecordingRole] = &super::ESTIMATED;

    /// Whether it has simulations of its own.
    const SIMULATES_ITSELF: bool = false;

    /// The equations that the table means, for a reader to change, with what its filters are told of events.
    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError>;

    /// The equations that are simulated, where the experiment's drive asks for others than those of its filters.
    fn simulated(&self, experiment: &Experiment) -> Result<Option<EquationsTable>, ConfigError> {
        let _ = experiment;
        Ok(None)
    }

    /// Refuses a table that does not say what an estimate needs.
    fn require_estimated(&self, experiment: &Experiment) -> Result<(), ConfigError> {
        let _ = experiment;
        Ok(())
    }

    /// The length by which all lengths of its signal scale.
    fn length_scale(&self) -> Option<LengthScale> {
        None
    }

    /// The instruments whose voltage a reference may hold instead of an angle.
    fn instruments(&self) -> Instruments {
        Instruments::default()
    }

    /// Devices with the same table that have a name and a template of their own.
    const VARIANTS: &'static [PresetVariant<Self>] = &[];

    /// Numbers that its table may leave out and that may be what is wrong.
    fn left_out(&self) -> Vec<OmittedNumber> {
        Vec::new()
    }

    /// Whether a simulation of it may add a dither to its feedback.
    fn takes_dither(&self) -> bool {
        false
    }

    /// A simulation of its own, where its equations do not say how the experiment's recording is made.
    fn simulation(experiment: &Experiment) -> Result<Option<Box<dyn Simulation>>, SimulateError> {
        let _ = experiment;
        Ok(None)
    }

    /// A filter that is exported with parts of its own, such as a detector, and the columns of drive and signal; `None` for one that its equations
    /// say all of.
    fn exported(experiment: &Experiment, place: usize) -> Result<Option<OwnExport>, ExportError> {
        let _ = (experiment, place);
        Ok(None)
    }

    /// Identifies what its named protocol tells.
    fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError>;

    /// What can be said of it beside its equations, before anything is recorded.
    fn topics(experiment: &Experiment) -> Result<Vec<OutlookTopic>, SimulateError> {
        let _ = experiment;
        Ok(Vec::new())
    }

    /// The same added to what its equations say.
    fn outlook(experiment: &Experiment, of_equations: Outlook) -> Result<Outlook, SimulateError> {
        let Outlook { mut topics, .. } = of_equations;
        topics.extend(Self::topics(experiment)?);
        Ok(Outlook { topics, ..of_equations })
    }
}

/// The equations of an expansion as what another table means; `keys` says where each parameter stands in that, with the power of it there, and
/// `threshold` which event its keys of a threshold are of.
pub fn meant(
    expansion: &Expansion,
    keys: ParameterKeys,
    threshold: Option<PassedThreshold>,
) -> Result<EquationsTable, ConfigError> {
    let mut table: EquationsTable = read_device(&expansion.text)?;
    table.noise_keys.clone_from(&expansion.noise);
    table.channel_keys.clone_from(&expansion.channels);
    (table.keys, table.threshold) = (Some(keys), threshold);
    Ok(table)
}

/// A device that has the table of another one.
pub struct PresetVariant<T> {
    /// Its name, for `kalmems new`.
    pub name: &'static str,
    /// What an experiment with it begins from.
    pub template: Template,
    /// Whether a table is that of this device.
    pub is_meant: fn(&T) -> bool,
}

/// The rig of a published device: that of its equations.
pub struct PresetRig<T: 'static>(Option<&'static PresetVariant<T>>);

impl<T> PresetRig<T> {
    /// Of this device.
    pub const fn new() -> Self {
        Self(None)
    }

    /// Of a device that has its table.
    pub const fn of(variant: &'static PresetVariant<T>) -> Self {
        Self(Some(variant))
    }
}

impl<T> Default for PresetRig<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Preset> PresetRig<T> {
    /// The experiment, whose table has been read, so that its equations are known.
    fn read(experiment: &Experiment) -> Result<&Experiment, ConfigError> {
        experiment.device::<T>().map(|_| experiment)
    }
}

impl<T: Preset> Rig for PresetRig<T> {
    fn name(&self) -> &'static str {
        self.0.map_or(T::NAME, |variant| variant.name)
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<T>()
    }

    fn template(&self) -> Option<Template> {
        Some(self.0.map_or(T::TEMPLATE, |variant| variant.template))
    }

    fn uses(&self, experiment: &Experiment) -> DeviceUses {
        let uses =
            Self::read(experiment).map_or_else(|_| DeviceUses::default(), |read| EquationsRig.uses(read));
        let table = experiment.device_in_terms_of::<EquationsTable>();
        let has = |what: fn(&EquationsTable) -> bool| table.as_ref().is_ok_and(|table| what(table));
        let crossings = has(|table| table.threshold.is_some());
        DeviceUses {
            reads_capacitance: T::READS_CAPACITANCE,
            states_readout: false,
            crossings,
            events: !crossings && has(|table| !table.events.is_empty()),
            feedback: experiment.device::<T>().is_ok_and(|device| device.takes_dither()),
            simulated_channels: !T::SIMULATES_ITSELF && uses.simulated_channels,
            ..uses
        }
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        let device = experiment.device::<T>()?;
        let is_other = || T::VARIANTS.iter().any(|variant| (variant.is_meant)(&device));
        let is_meant = self.0.map_or_else(|| !is_other(), |variant| (variant.is_meant)(&device));
        Ok(is_meant && EquationsRig.claims(experiment)?)
    }

    fn length_scale(&self, experiment: &Experiment) -> Result<Option<LengthScale>, ConfigError> {
        Ok(experiment.device::<T>()?.length_scale())
    }

    fn channels(&self, experiment: &Experiment) -> RecordingChannels {
        Self::read(experiment)
            .map_or_else(|_| RecordingChannels::default(), |read| EquationsRig.channels(read))
    }

    fn parameters(&self, experiment: &Experiment) -> &'static [DeviceParameter] {
        Self::read(experiment).map_or(&[], |read| EquationsRig.parameters(read))
    }

    fn densities(&self, experiment: &Experiment) -> Vec<StateDensity> {
        Self::read(experiment).map_or_else(|_| Vec::new(), |read| EquationsRig.densities(read))
    }

    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        T::identify(experiment, progress)
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        experiment.device::<T>()?.require_estimated(experiment)?;
        super::wanted(experiment, T::ESTIMATED)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        EquationsRig.layout(Self::read(experiment)?, index)
    }

    fn angles(&self, experiment: &Experiment) -> &'static [[&'static str; 2]] {
        Self::read(experiment).map_or(&[], |read| EquationsRig.angles(read))
    }

    fn values(&self, experiment: &Experiment) -> &'static [ValueState] {
        Self::read(experiment).map_or(&[], |read| EquationsRig.values(read))
    }

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        experiment.device::<T>()?.expanded(experiment)
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        EquationsRig.estimator(Self::read(experiment)?, index, progress)
    }

    fn live<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        EquationsRig.live(Self::read(experiment)?, index, progress)
    }

    fn signs_from_s(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &SampledRecording,
    ) -> Result<Vec<f64>, EstimateError> {
        EquationsRig.signs_from_s(Self::read(experiment)?, index, recording)
    }

    fn instruments(&self, experiment: &Experiment) -> Result<Instruments, ConfigError> {
        Ok(experiment.device::<T>()?.instruments())
    }

    fn left_out(&self, experiment: &Experiment) -> Vec<OmittedNumber> {
        experiment.device::<T>().map_or_else(|_| Vec::new(), |device| device.left_out())
    }

    fn exported(&self, experiment: &Experiment, place: usize) -> Result<OwnExport, ExportError> {
        T::exported(experiment, place)?.ok_or(ExportError::Device { device: T::NAME })
    }

    fn export(&self, experiment: &Experiment, request: &ExportRequest) -> Result<Exported, ExportError> {
        match export_of_rig(self, experiment, request) {
            Err(ExportError::Device { .. }) => EquationsRig.export(Self::read(experiment)?, request),
            own => own,
        }
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        let mut told = experiment.clone();
        // What starts a simulation of other equations is not about those of the filters.
        if T::SIMULATES_ITSELF || Self::read(experiment)?.device::<T>()?.simulated(experiment)?.is_some() {
            told.simulate = None;
        }
        let outlook = EquationsRig.outlook(Self::read(&told)?)?;
        T::outlook(experiment, Outlook { device: T::NAME, ..outlook })
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        if let Some(own) = T::simulation(experiment)? {
            return Ok(own);
        }
        let simulation = match experiment.device::<T>()?.simulated(experiment)? {
            None => EquationsRig.simulate(experiment)?,
            Some(equations) => {
                let mut other = experiment.clone();
                other.set_device(equations);
                EquationsRig.simulate(&other)?
            }
        };
        Ok(Box::new(NamedSimulation::of(simulation, T::COLUMNS)))
    }
}

/// A simulation of which some channels are recorded, under names that a device's files have.
struct NamedSimulation {
    simulation: Box<dyn Simulation>,
    columns: [&'static [SimulatedColumn]; 2],
    /// The columns of the recording and of its reference that there are, and their places in the simulation.
    kept: [(Vec<SimulatedColumn>, Vec<usize>); 2],
}

impl NamedSimulation {
    fn of(simulation: Box<dyn Simulation>, columns: [&'static [SimulatedColumn]; 2]) -> Self {
        let kept = |all: &[SimulatedColumn],
                    wanted: &[SimulatedColumn]|
         -> (Vec<SimulatedColumn>, Vec<usize>) {
            let place = |one: &SimulatedColumn| all.iter().position(|column| column.meaning == one.meaning);
            wanted.iter().filter_map(|one| Some((*one, place(one)?))).unzip()
        };
        let kept = [kept(simulation.recorded(), columns[0]), kept(simulation.truth(), columns[1])];
        Self { simulation, columns, kept }
    }
}

impl Simulation for NamedSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &self.kept[0].0
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &self.kept[1].0
    }

    fn samples(&self) -> u64 {
        self.simulation.samples()
    }

    fn steps_per_s(&self) -> Option<f64> {
        self.simulation.steps_per_s()
    }

    fn is_exact(&self) -> bool {
        self.simulation.is_exact()
    }

    fn sources(&self) -> &[RecordingSource] {
        self.simulation.sources()
    }

    fn begin(&self) -> Result<SimulationStart, SimulateError> {
        self.simulation.begin()
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        self.run_from(&self.begin()?, each)
    }

    fn run_from(
        &self,
        start: &SimulationStart,
        each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>,
    ) -> Result<(), SimulateError> {
        let [mut recorded, mut truth] = self.columns.map(|columns| vec![0.0; columns.len()]);
        let [(_, of_recorded), (_, of_truth)] = &self.kept;
        self.simulation.run_from(start, &mut |sample| {
            let take = |to: &mut Vec<f64>, places: &[usize], all: &[f64]| {
                to.clear();
                to.extend(places.iter().map(|place| all.get(*place).copied().unwrap_or(f64::NAN)));
            };
            take(&mut recorded, of_recorded, sample.recorded);
            take(&mut truth, of_truth, sample.truth);
            each(&SimulatedSample { time_s: sample.time_s, recorded: &recorded, truth: &truth })
        })
    }
}

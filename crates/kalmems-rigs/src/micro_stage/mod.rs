//! The micro-stage: a piezoelectric stage that shakes a gyroscope, and says by capacitors underneath how fast it turns.
//!
//! Chen, On-chip sensing and motion estimation for MEMS, dissertation, 2018, chapter 3. Up to four electrodes under the
//! stage give a voltage η·C′(θ)·θ̇ each; what the drive alone makes of them is known from the same record without bias. A
//! vibrometer at the stage's edge is what gaps and gains are identified with, and what estimates are judged by.

pub mod device;
mod equations;
mod hardware;
pub mod identification;
mod outlook;
mod records;
mod simulation;

use super::{Template, TemplateChannel};
use crate::Expansion;
use crate::config::{ConfigError, Experiment, RecordingRole};
use crate::equations::Preset;
use crate::evaluate::{EdgeVelocity, Instruments};
use crate::identify::{Identification, IdentifyError};
use crate::micro_stage::device::MicroStage;
use crate::outlook::OutlookTopic;
use crate::progress::Progress;
use crate::simulate::{SimulateError, SimulatedColumn, Simulation};
pub use hardware::{ElectrodeChannel, StageHardware};
use simulation::StageSimulation;

/// Electrodes that a stage has for one axis.
pub const ELECTRODES: usize = identification::ELECTRODES;

impl Preset for MicroStage {
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

    const COLUMNS: [&'static [SimulatedColumn]; 2] = [&simulation::RECORDED, &simulation::TRUTH];

    const READS_CAPACITANCE: bool = false;

    const ESTIMATED: &'static [RecordingRole] = &[RecordingRole::Test, RecordingRole::BiasOn];

    const SIMULATES_ITSELF: bool = true;

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        Ok(equations::expanded(self, experiment))
    }

    fn require_estimated(&self, experiment: &Experiment) -> Result<(), ConfigError> {
        StageHardware::of(experiment)?;
        let unknown = self.electrodes.iter().find(|(_, electrode)| electrode.noise_variance.is_none());
        unknown.map_or(Ok(()), |(name, _)| Err(hardware::noise_missing(experiment, name)))
    }

    fn instruments(&self) -> Instruments {
        Instruments { edge: self.vibrometer.as_ref().map(EdgeVelocity::from), ..Instruments::default() }
    }

    fn simulation(experiment: &Experiment) -> Result<Option<Box<dyn Simulation>>, SimulateError> {
        Ok(Some(Box::new(StageSimulation::of(experiment)?)))
    }

    fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }

    fn topics(experiment: &Experiment) -> Result<Vec<OutlookTopic>, SimulateError> {
        outlook::topics(experiment)
    }
}

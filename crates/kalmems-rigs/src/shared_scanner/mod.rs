//! The shared-electrode scanner: one comb drives a resonant mirror and senses its tilt.
//!
//! Chen et al., Motion Estimation for a Compact Electrostatic Micro-scanner via Shared Driving and Sensing
//! Electrodes in Endomicroscopy, 2020. The mirror is driven parametrically; a carrier on the same electrodes,
//! demodulated, gives a voltage that is affine in the capacitance and even in the angle.

mod circuit;
pub mod device;
mod equations;
pub mod identification;
mod line;
mod outlook;
mod past;
pub mod regulation;
mod ring_down;
mod settings;
mod simulation;
pub mod two_axes;

use crate::config::{ConfigError, ConfigFault, DriveSource, Experiment, RecordingRole};
use crate::equations::{Preset, PresetVariant};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::progress::Progress;
use crate::simulate::{SimulateError, SimulatedColumn, Simulation};
use crate::{Expansion, NumberForm, OmittedNumber, Template, TemplateChannel};
use device::SharedScanner;
pub use outlook::CycleBound;
use ring_down::RingDownSimulation;
pub use settings::ScannerHardware;

/// The scanner in a gimbal that the same electrode drives and senses.
pub const SECOND_AXIS: PresetVariant<SharedScanner> = PresetVariant {
    name: "shared_scanner.second_axis",
    template: two_axes::TEMPLATE,
    is_meant: |device| device.second_axis.is_some(),
};

impl Preset for SharedScanner {
    const TEMPLATE: Template = Template {
        text: include_str!("template.toml"),
        channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
        references: &[TemplateChannel::ANGLE, TemplateChannel::RATE],
    };

    const COLUMNS: [&'static [SimulatedColumn]; 2] =
        [&simulation::RECORDED, &SimulatedColumn::ANGLE_AND_RATE];

    const READS_CAPACITANCE: bool = false;

    /// Its ring-downs are recorded through another channel.
    const ESTIMATED: &'static [RecordingRole] = &[RecordingRole::Test, RecordingRole::SteadyState];

    const SIMULATES_ITSELF: bool = true;

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        Ok(equations::expanded(self, experiment))
    }

    const VARIANTS: &'static [PresetVariant<Self>] = &[SECOND_AXIS];

    /// How late the readout may be of the motion, in steps of a two-thousandth of its cycle: as a whole, or by the poles of its demodulator.
    fn left_out(&self) -> Vec<OmittedNumber> {
        if self.second_axis.is_some() {
            return Vec::new();
        }
        let late = |key, form, filter_switch| OmittedNumber {
            key,
            unit: "s",
            step: 5e-4 / ScannerHardware::of_table(self).natural_hz(),
            is_never_negative: true,
            form,
            filter_switch,
        };
        vec![
            late("readout.delay", NumberForm::Number, None),
            late("readout.poles", NumberForm::TwoPoles, Some("demodulator")),
        ]
    }

    fn simulation(experiment: &Experiment) -> Result<Option<Box<dyn Simulation>>, SimulateError> {
        if experiment.device::<Self>()?.second_axis.is_some() {
            return two_axes::simulation::simulation(experiment).map(Some);
        }
        Ok(Some(match experiment.simulate.as_ref().map(|simulate| &simulate.drive) {
            Some(DriveSource::RingDown(drive)) => Box::new(RingDownSimulation::of(experiment, drive)?),
            Some(DriveSource::Regulated(_)) => Box::new(regulation::RegulatedSimulation::of(experiment)?),
            _ => simulation::simulation(experiment)?,
        }))
    }

    fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
        if experiment.device::<Self>()?.second_axis.is_some() {
            let why = "ring-down and steady state tell the numbers of one axis; of two axes name what is sought, such as \
                       `parameters = [\"resonator.stiffness\"]` in `[identify]`";
            return Err(experiment.error("device", ConfigFault::Value { why: why.to_owned() }).into());
        }
        identification::identify(experiment, progress)
    }

    fn outlook(experiment: &Experiment, of_equations: Outlook) -> Result<Outlook, SimulateError> {
        if experiment.device::<Self>()?.second_axis.is_some() {
            return two_axes::outlook::outlook(experiment, of_equations);
        }
        outlook::outlook(experiment, of_equations)
    }
}

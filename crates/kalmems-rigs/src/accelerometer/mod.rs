//! The force-rebalance accelerometer: a mass between plates that sense it, and push it back where there is a loop.
//!
//! Zhang, Sensing and Control of MEMS Accelerometers Using Kalman Filter, 2010. The thesis's observer is given the
//! acceleration as a known input. An instrument that is to measure it does not have it: here the acceleration is a state,
//! and the known input is there for comparison, under a name that says so.

mod data;
pub mod device;
mod dither;
mod equations;
mod feedback;
mod identification;
mod outlook;
mod pull_in;
mod run;
mod settings;
mod simulation;
mod varied_instrument;

use crate::accelerometer::device::AccelerometerTable;
use crate::config::{ConfigError, Experiment, RecordingRole};
use crate::equations::{CheckedPart, Preset};
use crate::estimate::EstimateError;
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::progress::Progress;
use crate::simulate::{SimulateError, SimulatedColumn, Simulation};
use crate::{Expansion, NumberForm, OmittedNumber, Template, TemplateChannel};
use data::AccelerometerSegment;
pub use run::{Acceleration, AccelerometerRun, ControllerInput, ControllerTiming, Moment};
pub use settings::AccelerometerHardware;
pub use simulation::closed_loop;
use simulation::{AccelerometerSimulation, RECORDED, TRUE};
pub use varied_instrument::settled_acceleration_sd;

impl Preset for AccelerometerTable {
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

    const COLUMNS: [&'static [SimulatedColumn]; 2] = [&RECORDED, &TRUE];

    const READS_CAPACITANCE: bool = false;

    const ESTIMATED: &'static [RecordingRole] = &[RecordingRole::Test];

    const SIMULATES_ITSELF: bool = true;

    fn expanded(&self, _: &Experiment) -> Result<Expansion, ConfigError> {
        Ok(equations::motion(self))
    }

    fn takes_dither(&self) -> bool {
        self.feedback.is_some()
    }

    fn left_out(&self) -> Vec<OmittedNumber> {
        vec![OmittedNumber {
            key: "proof_mass.squeezed_film",
            unit: "",
            step: 1e-3,
            is_never_negative: true,
            form: NumberForm::Number,
            filter_switch: None,
        }]
    }

    fn simulation(experiment: &Experiment) -> Result<Option<Box<dyn Simulation>>, SimulateError> {
        Ok(Some(Box::new(AccelerometerSimulation::of(experiment)?)))
    }

    fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }

    fn outlook(experiment: &Experiment, of_equations: Outlook) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment, of_equations)
    }
}

/// Refuses a recording that is none of the device as it is described: of one that has no rest, of a mass on its plate, and under a feedback that did
/// not move it.
fn require_right(experiment: &Experiment, part: &CheckedPart) -> Result<(), EstimateError> {
    let hardware = AccelerometerHardware::of(experiment)?;
    hardware.require_rest(experiment)?;
    let [(signal_column, signal)] = part.signals[..] else { return Ok(()) };
    let input = part.inputs.first();
    let feedback = input.map(|(_, values)| *values);
    let data = AccelerometerSegment { time_s: part.time_s, signal, feedback, interval_s: part.interval_s };
    pull_in::require_free(&hardware, &data, signal_column, part.place)?;
    match input {
        Some((column, _)) if part.begins => feedback::require_right(&hardware, &data, column, part.place),
        _ => Ok(()),
    }
}

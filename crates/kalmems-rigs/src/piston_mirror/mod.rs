//! The piston mirror: a mirror before a plate, its distance read by a carrier through their capacitance.
//!
//! Faller and Zangl, Feasibility Considerations on an Inkjet-Printed Capacitive Position Sensor for Electrostatically
//! Actuated Resonant MEMS-Mirror Systems, 2017. One sample of the capacitance tells the position to a few tenths of a
//! micrometre; that the motion is a sinusoid makes nanometres of it.

mod bound;
pub mod device;
mod equations;
mod identification;
mod mechanics;
mod metamodel;
mod observability;
mod outlook;
mod plates;

use crate::config::{
    ConfigError, ConfigFault, DriveSource, Experiment, PrescribedMotion, Quantity, read_device,
};
use crate::equations::{EquationsTable, Preset};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::OutlookTopic;
use crate::progress::Progress;
use crate::simulate::{SimulateError, SimulatedColumn};
use crate::{Expansion, Template, TemplateChannel};
pub use bound::{MotionBound, motion_bound};
use device::PistonMirror;
use kalmems_core::Portable;
use kalmems_engines::rig::LengthScale;
use mechanics::Mechanics;
pub use metamodel::{DegreeError, Metamodel, MetamodelError, OutsideTable, fit_table};
pub use plates::{COEFFICIENTS, Plates};

impl Preset for PistonMirror {
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

    const COLUMNS: [&'static [SimulatedColumn]; 2] = [
        &[
            SimulatedColumn { meaning: "signal", column: "cap_F" },
            SimulatedColumn { meaning: "trigger", column: "trigger_V" },
        ],
        &SimulatedColumn::POSITION_AND_VELOCITY,
    ];

    const READS_CAPACITANCE: bool = true;

    fn expanded(&self, _: &Experiment) -> Result<Expansion, ConfigError> {
        Ok(equations::motion(self))
    }

    fn simulated(&self, experiment: &Experiment) -> Result<Option<EquationsTable>, ConfigError> {
        let Some(simulate) = &experiment.simulate else { return Ok(None) };
        let text = match &simulate.drive {
            DriveSource::Prescribed(PrescribedMotion { second_harmonic: None, .. }) => return Ok(None),
            DriveSource::Prescribed(motion) => {
                let of = |size: &Option<Quantity<_, _>>| size.as_ref().map_or(0.0, Quantity::si);
                let phase = motion.second_harmonic_phase.as_ref().map_or(0.0, Quantity::si);
                let (sine, cosine) = phase.portable_sin_cos();
                equations::with_second_harmonic(
                    self,
                    [cosine, -sine].map(|part| of(&motion.second_harmonic) * part),
                )
            }
            DriveSource::Square(_) => {
                let Some(mirror) = &self.mirror else {
                    let remedy =
                        "add the table `[device.piston_mirror.mirror]`, or prescribe the motion with \
                                  `drive = { prescribed = {} }`"
                            .to_owned();
                    return Err(
                        experiment.error("device.piston_mirror.mirror", ConfigFault::MissingKey { remedy })
                    );
                };
                equations::driven(self, &Mechanics::of(mirror))
            }
            _ => {
                let why = "a piston mirror is simulated by its motion or by its pulses; write `drive = { prescribed = {} }` or a \
                           table `[simulate.drive.square]`";
                return Err(experiment.error("simulate.drive", ConfigFault::Value { why: why.to_owned() }));
            }
        };
        read_device(&text.text).map(Some)
    }

    fn length_scale(&self) -> Option<LengthScale> {
        let length = self.capacitance.reference_distance.clone();
        Some(LengthScale { key: "device.piston_mirror.capacitance.reference_distance", length })
    }

    fn identify(experiment: &Experiment, _: &dyn Progress) -> Result<Identification, IdentifyError> {
        identification::identify(experiment)
    }

    fn topics(experiment: &Experiment) -> Result<Vec<OutlookTopic>, SimulateError> {
        outlook::topics(experiment)
    }
}

//! What the rig takes from an experiment file, in SI.

use super::device::AccelerometerTable;
use crate::config::{ConfigError, ConfigFault, Experiment, Quantity};
use kalmems_figures::significant;
use kalmems_models::capacitance::DifferentialPlates;
use kalmems_models::constants::VACUUM_PERMITTIVITY;
use kalmems_models::dynamics::{Accelerometer, GaussMarkov, ProofMass, SensedAcceleration};
use kalmems_models::noise::brownian_force_density;
use kalmems_models::readout::DifferentialReadout;
use std::f64::consts::TAU;

/// The device, its noise, and what is known of the acceleration beforehand.
#[derive(Clone, Copy, Debug)]
pub struct AccelerometerHardware {
    /// How it moves, with the acceleration as a state.
    pub sensed: SensedAcceleration<f64>,
    /// What is recorded of it.
    pub readout: DifferentialReadout<f64>,
    /// The two-sided density of the Brownian force in N²/Hz.
    pub force_density: f64,
    /// The variance of the recorded signal's noise per sample, in V².
    pub noise_variance: f64,
    /// Whether the experiment describes a feedback.
    pub has_feedback: bool,
}

impl AccelerometerHardware {
    /// Reads what the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        Ok(Self::of_table(&*experiment.device::<AccelerometerTable>()?))
    }

    /// The same of its table.
    pub fn of_table(device: &AccelerometerTable) -> Self {
        let plates = DifferentialPlates {
            area: device.plates.area.si(),
            gap: device.plates.gap.si(),
            permittivity: device.plates.relative_permittivity.si() * VACUUM_PERMITTIVITY,
        };
        let (mass, readout, prior) = (&device.proof_mass, &device.readout, &device.acceleration);
        let carrier_amplitude = readout.carrier_amplitude.si();
        let instrument = Accelerometer {
            mass: ProofMass {
                mass: mass.mass.si(),
                damping: mass.damping.si(),
                squeezed: mass.squeezed_film.as_ref().map_or(0.0, Quantity::si),
                spring: mass.spring.si(),
            },
            plates,
            carrier_mean_square: readout.carrier_mean_square.si() * carrier_amplitude * carrier_amplitude,
            bias: device.feedback.as_ref().map_or(0.0, |feedback| feedback.bias.si()),
        };
        Self {
            sensed: SensedAcceleration {
                device: instrument,
                prior: GaussMarkov {
                    rms: prior.rms.si(),
                    rate: TAU * prior.bandwidth.si(),
                    damping_ratio: prior.damping_ratio.si(),
                },
            },
            readout: DifferentialReadout {
                plates,
                carrier_amplitude,
                feedback_capacitance: readout.feedback_capacitance.si(),
            },
            force_density: 0.5 * brownian_force_density(mass.damping.si(), mass.temperature.si()),
            noise_variance: readout.noise_variance.si(),
            has_feedback: device.feedback.is_some(),
        }
    }
}

impl AccelerometerHardware {
    /// Refuses a device without a feedback whose plates pull more than its spring holds: its mass lies on a plate.
    pub fn require_rest(&self, experiment: &Experiment) -> Result<(), ConfigError> {
        let (device, left) = (&self.sensed.device, self.sensed.device.softened_spring(0.0));
        if self.has_feedback || left > 0.0 {
            return Ok(());
        }
        let why = format!(
            "the spring holds with {} N/m and the carrier pulls the plates with {} N/m, so that the mass lies on a plate; expected a \
             stronger spring, a smaller `carrier_amplitude` or a feedback, `[device.accelerometer.feedback]`",
            significant(device.mass.spring),
            significant(device.electrostatic_spring(0.0))
        );
        Err(experiment.error("device.accelerometer.proof_mass.spring", ConfigFault::Value { why }))
    }
}

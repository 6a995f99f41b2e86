//! The device with its second axis, in SI.

use crate::config::{ConfigError, ConfigFault, Experiment, Quantity};
use crate::shared_scanner::device::SharedScanner;
use crate::shared_scanner::settings;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator, TwoAxisScanner};
use kalmems_models::readout::TwoAxisComb;

/// The device alone.
#[derive(Clone, Copy, Debug)]
pub struct TwoAxisHardware {
    /// How it moves.
    pub scanner: TwoAxisScanner<f64>,
    /// What is recorded of it.
    pub readout: TwoAxisComb<f64>,
    /// The variance of the recorded signal's noise per sample, in V².
    pub noise_variance: f64,
}

impl TwoAxisHardware {
    /// Reads what the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let first = settings::ScannerHardware::of(experiment)?;
        let device = experiment.device::<SharedScanner>()?;
        let Some(second) = &device.second_axis else {
            let remedy = "add the table `[device.shared_scanner.second_axis]`".to_owned();
            return Err(experiment.error("device", ConfigFault::MissingKey { remedy }));
        };
        let comb = GaussianComb {
            nominal: second.comb.nominal_capacitance.si(),
            angular_width: second.comb.angular_width.si(),
            bias: second.comb.bias_capacitance.si(),
        };
        let resonator = TorsionalResonator {
            inertia: second.resonator.inertia.si(),
            damping: second.resonator.damping.si(),
            stiffness: second.resonator.stiffness.si(),
        };
        Ok(Self {
            scanner: TwoAxisScanner {
                x: first.scanner,
                y: ParametricScanner {
                    resonator,
                    comb,
                    carrier_mean_square: first.scanner.carrier_mean_square,
                },
                gimbal_inertia: second.gimbal_inertia.as_ref().map_or(0.0, Quantity::si),
            },
            readout: TwoAxisComb {
                x: first.scanner.comb,
                y: comb,
                gain: first.readout.gain,
                offset: first.readout.offset,
            },
            noise_variance: first.noise_variance,
        })
    }
}

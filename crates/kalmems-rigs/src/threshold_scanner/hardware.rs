//! What the rig takes from the device table, in SI.

use crate::config::{ConfigError, Experiment, Quantity};
use crate::threshold_scanner::device::{CombShape, ThresholdScanner};
use kalmems_models::capacitance::{CombCurve, CombFingers, CurveShape};
use kalmems_models::dynamics::{CombDrivenMirror, MirrorResonator};
use kalmems_models::readout::CurrentReadout;
use std::f64::consts::TAU;

/// The threshold-sensing scanner: how it moves, how its comb is read, and the noise of a sample.
#[derive(Clone, Copy, Debug)]
pub struct ThresholdHardware {
    /// How it moves.
    pub mirror: CombDrivenMirror<f64>,
    /// What is recorded of it, but for the drive's part.
    pub readout: CurrentReadout<f64>,
    /// R_s in Ω.
    pub feedback_resistance: f64,
    /// C_ft in F.
    pub feedthrough: f64,
    /// The variance of the recorded signal's noise per sample, in V².
    pub noise_variance: f64,
}

impl ThresholdHardware {
    /// Reads what the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        experiment.device::<ThresholdScanner>().map(|device| Self::of_table(&device))
    }

    /// What the device's table says.
    pub fn of_table(device: &ThresholdScanner) -> Self {
        let feedback_resistance = device.readout.feedback_resistance.si();
        let from_fingers = device.comb.fingers.as_ref().map(|fingers| {
            let fingers = CombFingers {
                pairs: fingers.pairs.si(),
                gap: fingers.gap.si(),
                height: fingers.height.si(),
                inner: fingers.inner_radius.si(),
                outer: fingers.outer_radius.si(),
                permittivity: 1.0,
            };
            fingers.gain(feedback_resistance * device.readout.bias.si())
        });
        let comb = CombCurve {
            centre: device.comb.threshold_angle.si(),
            // The file was refused where it states neither.
            gain: device.comb.gain.as_ref().map_or(from_fingers.unwrap_or(0.0), Quantity::si),
            steepness: device.comb.steepness.si(),
            shape: match device.comb.shape {
                CombShape::Logistic => CurveShape::Logistic,
                CombShape::Gaussian => CurveShape::Gaussian,
            },
        };
        let resonator = MirrorResonator {
            natural_rate: TAU * device.resonator.natural_frequency.si(),
            damping_ratio: device.resonator.damping_ratio.si(),
        };
        Self {
            mirror: CombDrivenMirror {
                resonator,
                comb,
                drive_gain: device.drive.as_ref().map_or(0.0, |drive| drive.gain.si()),
            },
            readout: CurrentReadout { comb, offset: device.readout.offset.si() },
            feedback_resistance,
            feedthrough: device.readout.feedthrough_capacitance.si(),
            noise_variance: device.readout.noise_variance.si(),
        }
    }

    /// The frequency of the free motion in Hz.
    pub fn natural_hz(&self) -> f64 {
        self.mirror.resonator.natural_rate / TAU
    }
}

//! What the rig takes from the device table, in SI.

use crate::config::{ConfigError, ConfigFault, Experiment, Key, Quantity};
use crate::evaluate::EdgeVelocity;
use crate::micro_stage::device::{Electrode, MicroStage};
use kalmems_models::capacitance::TiltingPlate;
use kalmems_models::constants::VACUUM_PERMITTIVITY;
use kalmems_models::dynamics::{MirrorResonator, PiezoStage};
use kalmems_models::readout::PlateCurrent;
use std::f64::consts::TAU;

/// The device alone.
#[derive(Clone, Debug)]
pub struct StageHardware {
    /// How it tilts.
    pub stage: PiezoStage<f64>,
    /// How it rises and falls under the same drive, where the file says so.
    pub piston: Option<PiezoStage<f64>>,
    /// What is recorded of it, in the order of their names.
    pub channels: Vec<ElectrodeChannel>,
    /// The reference, where the file describes one.
    pub vibrometer: Option<EdgeVelocity>,
}

/// One electrode with its amplifier.
#[derive(Clone, Debug)]
pub struct ElectrodeChannel {
    /// Its name, such as `1A`.
    pub name: String,
    /// What it reads.
    pub current: PlateCurrent<f64>,
    /// The variance of one sample's noise in V², where it is known.
    pub noise_variance: Option<f64>,
    /// g and g′ of what it shows of the drive, in V/V and s, where the file says so.
    pub feedthrough: Option<[f64; 2]>,
}

impl ElectrodeChannel {
    /// The meaning of its column in a recording.
    pub fn meaning(&self) -> String {
        super::equations::meaning(&self.name)
    }

    fn of(name: &str, electrode: &Electrode) -> Self {
        let plate = TiltingPlate {
            w1: electrode.w1.si(),
            w2: electrode.w2.si(),
            w3: electrode.w3.si(),
            w4: electrode.w4.si(),
            gap: electrode.gap.si(),
            permittivity: VACUUM_PERMITTIVITY,
        };
        Self {
            name: name.to_owned(),
            current: PlateCurrent { plate, gain: electrode.gain.si() },
            noise_variance: electrode.noise_variance.as_ref().map(Quantity::si),
            feedthrough: electrode.feedthrough.as_ref().map(|f| [f.gain.si(), f.slope.si()]),
        }
    }
}

impl StageHardware {
    /// Reads what the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let device = experiment.device::<MicroStage>()?;
        let electrodes = device.electrodes.len();
        if electrodes > super::ELECTRODES {
            let why = format!(
                "found {electrodes} electrodes; an axis has at most {}: describe those of the axis that is driven",
                super::ELECTRODES
            );
            return Err(experiment.error("device.micro_stage.electrodes", ConfigFault::Value { why }));
        }
        Ok(Self::from_table(&device))
    }

    fn from_table(device: &MicroStage) -> Self {
        let resonator = &device.resonator;
        let piston = device.piston.as_ref().map(|piston| {
            let natural_rate = TAU * piston.natural_frequency.si();
            PiezoStage {
                resonator: MirrorResonator { natural_rate, damping_ratio: piston.damping_ratio.si() },
                drive_gain: piston.static_rise.si() * natural_rate * natural_rate,
            }
        });
        Self {
            stage: PiezoStage {
                resonator: MirrorResonator {
                    natural_rate: TAU * resonator.natural_frequency.si(),
                    damping_ratio: resonator.damping_ratio.si(),
                },
                drive_gain: resonator.drive_gain.si(),
            },
            piston,
            channels: device.electrodes.iter().map(|(name, e)| ElectrodeChannel::of(name, e)).collect(),
            vibrometer: device.vibrometer.as_ref().map(EdgeVelocity::from),
        }
    }

    /// The frequency of the free tilt in Hz.
    pub fn natural_hz(&self) -> f64 {
        self.stage.resonator.natural_rate / TAU
    }
}

/// That the noise of an electrode's channel is not known.
pub fn noise_missing(experiment: &Experiment, electrode: &str) -> ConfigError {
    let key = ["micro_stage", "electrodes", electrode, "noise_variance"];
    let key = key.into_iter().fold(Key::from("device"), Key::child);
    let remedy = "write it, such as `noise_variance = \"1.6e-11 V^2\"`, or let `kalmems identify` find it from a \
                  recording with the role `zero_drive`";
    experiment.error(key, ConfigFault::MissingKey { remedy: remedy.to_owned() })
}

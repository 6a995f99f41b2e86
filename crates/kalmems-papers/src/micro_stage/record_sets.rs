//! What is printed, and records that are made of it.

use super::failed;
use crate::config::Experiment;
use crate::program::ReproduceError;
use crate::signal::Sine;
use crate::simulate::WhiteNoise;
use kalmems_models::capacitance::StageLayout;
use kalmems_models::constants::VACUUM_PERMITTIVITY;
use kalmems_models::dynamics::{MirrorResonator, PiezoStage};
use kalmems_models::readout::PlateCurrent;
use kalmems_rigs::micro_stage::identification::WaveRecord;
use kalmems_rigs::published;
use std::f64::consts::TAU;
use std::path::Path;

/// D Table 3.3.
pub const NATURAL_HZ: f64 = 1714.5;
pub const DAMPING_RATIO: f64 = 0.005;
pub const DRIVE_GAIN: f64 = 3782.5;
pub const GAP: f64 = 19.2e-6;
pub const GAIN: f64 = -2.40752e7;

/// D Table 3.2: the drive's frequency in Hz while the sensors are identified, and its amplitudes in V.
pub const DRIVE_HZ: f64 = 1700.0;
pub const DRIVES_V: [f64; 4] = [1.0, 1.1, 1.2, 1.3];

/// Samples per second.
pub const RATE_HZ: f64 = 625e3;
/// What the noise of a sample is taken to be, in V: of a channel, of the vibrometer, of the drive.
pub const NOISE_V: [f64; 3] = [4e-6, 2e-4, 3e-4];
/// The vibrometer's volts per rad/s: 50 V/(m/s) at 1.5 mm from the axis.
pub const VOLTS_PER_RATE: f64 = 50.0 * 1.5e-3;

/// Samples of a record.
const SAMPLES: u32 = 2300;

pub fn stage() -> PiezoStage<f64> {
    let resonator = MirrorResonator { natural_rate: TAU * NATURAL_HZ, damping_ratio: DAMPING_RATIO };
    PiezoStage { resonator, drive_gain: DRIVE_GAIN }
}

pub fn channels() -> [PlateCurrent<f64>; 4] {
    StageLayout::PUBLISHED.plates(GAP, VACUUM_PERMITTIVITY).map(|plate| PlateCurrent { plate, gain: GAIN })
}

/// The angle in rad under a drive of this amplitude at [`DRIVE_HZ`], cosine and phase 0 of the drive.
pub fn angle(volts: f64) -> Sine {
    let (re, im) = stage().response(TAU * DRIVE_HZ);
    Sine {
        offset: 0.0,
        amplitude: volts * re.hypot(im),
        frequency_hz: DRIVE_HZ,
        phase_rad: im.atan2(re),
        residual_rms: 0.0,
    }
}

/// Records of the printed stage at the printed drives, with noise.
pub fn records(seed: u64) -> Vec<WaveRecord> {
    records_of(&channels(), seed)
}

/// Records of these channels at the printed drives, with noise.
pub fn records_of(channels: &[PlateCurrent<f64>; 4], seed: u64) -> Vec<WaveRecord> {
    let time_s: Vec<f64> = (0..SAMPLES).map(|k| f64::from(k) / RATE_HZ).collect();
    let mut noise = WhiteNoise::new(seed, 0);
    let one = |volts: f64| {
        let angle = angle(volts);
        let signals = channels.each_ref().map(|channel| {
            let sample = |t: &f64| {
                let (sine, cosine) = (TAU * DRIVE_HZ * t + angle.phase_rad).sin_cos();
                let rate = -angle.amplitude * TAU * DRIVE_HZ * sine;
                let clean: f64 = channel.voltage(angle.amplitude * cosine, rate);
                clean + NOISE_V[0] * noise.sample()
            };
            time_s.iter().map(sample).collect()
        });
        let drive = Sine { amplitude: volts, phase_rad: 0.0, ..angle };
        WaveRecord { time_s: time_s.clone(), drive, angle, signals: signals.to_vec() }
    };
    DRIVES_V.map(one).to_vec()
}

/// Gap and gain of each electrode as printed.
pub const PRINTED: [[f64; 2]; 4] = [[GAP, GAIN]; 4];

/// The stage under a drive of this amplitude, with these gaps in m and gains in V·Ω, ready to be simulated and estimated.
pub fn experiment(
    item: &'static str,
    volts: f64,
    seed: u64,
    electrodes: &[[f64; 2]; 4],
) -> Result<Experiment, ReproduceError> {
    let mut text = include_str!("stage.toml")
        .replace("AMPLITUDE", &format!("{volts} V"))
        .replace("FREQUENCY", &format!("{DRIVE_HZ} Hz"))
        .replace("SEED", &seed.to_string());
    for [gap, gain] in electrodes {
        text = text.replacen("GAP", &format!("{gap:e} m"), 1).replacen("GAIN", &format!("{gain:e} V ohm"), 1);
    }
    published().parse(&text, Path::new("stage.toml")).map_err(failed(item))
}

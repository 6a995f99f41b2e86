//! Detections in a steady motion, as the papers' parametric studies have them.

use super::bench::AMPLITUDE;
use crate::simulate::WhiteNoise;
use kalmems_core::detect::{DetectError, SlopeKernel};
use kalmems_rigs::threshold_scanner::ThresholdHardware;

/// One way to look for the passes of a steady motion.
#[derive(Clone, Copy, Debug)]
pub struct PassageSearch {
    /// s between two samples.
    pub interval_s: f64,
    /// The Gaussian's standard deviation in samples.
    pub sigma: f64,
    /// The noise of a sample in V.
    pub noise: f64,
}

/// s on either side of a pass within which the highest response is its detection.
const WITHIN_S: f64 = 0.3e-3;

/// The angles at so many detections minus that of the threshold, in rad; each detection is a sample, as in the papers.
pub fn angle_errors(
    device: &ThresholdHardware,
    look: PassageSearch,
    count: usize,
    seed: u64,
) -> Result<Vec<f64>, DetectError> {
    // Four standard deviations of the Gaussian on each side.
    match look.sigma {
        ..=15.0 => with::<60>(device, look, count, seed),
        ..=37.5 => with::<150>(device, look, count, seed),
        ..=75.0 => with::<300>(device, look, count, seed),
        _ => with::<600>(device, look, count, seed),
    }
}

fn with<const HALF: usize>(
    device: &ThresholdHardware,
    look: PassageSearch,
    count: usize,
    seed: u64,
) -> Result<Vec<f64>, DetectError> {
    let kernel = SlopeKernel::<f64, HALF>::new(look.sigma)?;
    let comb = device.readout.comb;
    let rate = device.mirror.resonator.natural_rate;
    let start = (comb.centre / AMPLITUDE).asin();
    let mut noise = WhiteNoise::new(seed, 0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at least one
    let within = ((WITHIN_S / look.interval_s).round() as usize).max(1);
    let length = 2 * (within + HALF) + 1;
    let (mut signal, mut response) = (vec![0.0; length], vec![0.0; length]);
    let mut errors = Vec::with_capacity(count);
    for i in 0..count {
        // The pass is anywhere between two samples.
        let late = (i as f64 + 0.5) / count as f64 - 0.5;
        let phase = |k: usize| start + rate * look.interval_s * (k as f64 - (within + HALF) as f64 + late);
        for (k, volts) in signal.iter_mut().enumerate() {
            let (sine, cosine) = phase(k).sin_cos();
            let clean = comb.sensitivity(AMPLITUDE * sine) * AMPLITUDE * rate * cosine;
            *volts = clean + look.noise * noise.sample();
        }
        kernel.responses(&signal, &mut response);
        let found = (HALF..length - HALF).max_by(|a, b| response[*a].total_cmp(&response[*b]));
        errors.extend(found.map(|k| AMPLITUDE * phase(k).sin() - comb.centre));
    }
    Ok(errors)
}

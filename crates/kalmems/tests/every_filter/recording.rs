//! Simulated recordings: the truth is known.

use crate::chance::{Chance, plus};
use crate::devices::Device;
use kalmems_core::{Cholesky, Covariance, Ekf, Filter, Measurement};

pub const SAMPLES: usize = 300;

/// The truth in the units of the filter's states, and what was measured of it.
pub struct Recording<const N: usize, const M: usize> {
    pub truth: Vec<[f64; N]>,
    pub signal: Vec<[f64; M]>,
    /// What another sensor says of the first state, at every sample; only few are used.
    pub events: Vec<f64>,
}

/// How the sensor's noise is distributed; both with the covariance of the device.
#[derive(Clone, Copy)]
pub enum Noise {
    Gaussian,
    /// Uniform before it is correlated, as is the start, so that no sample is an outlier by chance.
    Bounded,
}

/// The standard deviation of the other sensor, as a part of what is known of the first state at the start.
pub const EVENT: f64 = 0.2;

/// Simulates a device with its own process and noise. A filter without uncertainty follows its process exactly.
pub fn simulate<D: Device<f64, N, M>, const N: usize, const M: usize>(
    device: &D,
    seed: u64,
    noise: Noise,
) -> Recording<N, M> {
    let mut chance = Chance::new(seed);
    let (mean, deviations) = device.start();
    let root = Cholesky::of_semidefinite(device.noise());
    let white = |chance: &mut Chance| match noise {
        Noise::Gaussian => chance.gaussian(),
        Noise::Bounded => chance.between(-1.0, 1.0) * 3_f64.sqrt(),
    };
    let mut x = std::array::from_fn(|i| mean[i] + deviations[i] * white(&mut chance));
    let mut recording = Recording { truth: vec![], signal: vec![], events: vec![] };
    for sample in 0..SAMPLES {
        if sample > 0 {
            let mut exact = Ekf::new(x, Covariance::zero());
            let link = device.advance(&mut exact, sample).unwrap();
            x = plus(*exact.mean(), chance.vector(&link.noise));
        }
        let noise = std::array::from_fn(|_| white(&mut chance));
        recording.truth.push(x);
        recording.signal.push(plus(device.sensor().predict(&x), root.times_vector(&noise)));
        recording.events.push(x[0] + EVENT * deviations[0] * chance.gaussian());
    }
    recording
}

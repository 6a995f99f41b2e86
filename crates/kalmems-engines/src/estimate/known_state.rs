//! A filter put into a known state.

use super::transition::write_noise;
use super::{MeanAndCovariance, Transition};
use kalmems_core::{Gaussian, ProcessNoise};

/// A step to a known state, whatever was before.
pub struct KnownStateStep<const N: usize> {
    mean: [f64; N],
    noise: ProcessNoise<f64, N>,
}

impl<const N: usize> From<Gaussian<f64, N>> for KnownStateStep<N> {
    fn from(Gaussian { mean, covariance }: Gaussian<f64, N>) -> Self {
        Self { mean, noise: covariance.into() }
    }
}

impl<const N: usize> Transition for KnownStateStep<N> {
    fn advance(&self, _: &[f64], to: &mut [f64]) {
        to.copy_from_slice(&self.mean);
    }

    fn linearize(&self, _: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        to.copy_from_slice(&self.mean);
        jacobian.fill(0.0);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        write_noise(&self.noise, covariance, root);
    }
}

/// The same for any number of states.
#[derive(Clone, Debug)]
pub struct AnyKnownStateStep {
    mean: Vec<f64>,
    covariance: Vec<f64>,
    root: Vec<f64>,
}

impl From<&MeanAndCovariance> for AnyKnownStateStep {
    fn from(known: &MeanAndCovariance) -> Self {
        let n = known.mean.len();
        let mut covariance = vec![0.0; n * n];
        let places = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for ((i, j), entry) in places.zip(&known.lower) {
            covariance[i * n + j] = *entry;
        }
        // Cholesky's factor, which is 0 along what is known exactly.
        let mut root = vec![0.0; n * n];
        for j in 0..n {
            let known: f64 = (0..j).map(|k| root[j * n + k] * root[j * n + k]).sum();
            let pivot = (covariance[j * n + j] - known).max(0.0).sqrt();
            for i in j..n {
                let known: f64 = (0..j).map(|k| root[i * n + k] * root[j * n + k]).sum();
                let left = covariance[i * n + j] - known;
                root[i * n + j] = if pivot > 0.0 { left / pivot } else { 0.0 };
            }
        }
        Self { mean: known.mean.clone(), covariance, root }
    }
}

impl Transition for AnyKnownStateStep {
    fn advance(&self, _: &[f64], to: &mut [f64]) {
        to.copy_from_slice(&self.mean);
    }

    fn linearize(&self, _: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        to.copy_from_slice(&self.mean);
        jacobian.fill(0.0);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        covariance.copy_from_slice(&self.covariance);
        root.copy_from_slice(&self.root);
    }
}

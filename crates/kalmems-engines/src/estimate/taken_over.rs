//! A filter put into a known state.

use super::Step;
use kalmems_core::{Gaussian, Over, Process, ProcessNoise};

/// A step to a known state, whatever was before.
pub struct TakenOver<const N: usize> {
    mean: [f64; N],
    noise: ProcessNoise<f64, N>,
}

impl<const N: usize> From<Gaussian<f64, N>> for TakenOver<N> {
    fn from(Gaussian { mean, covariance }: Gaussian<f64, N>) -> Self {
        Self { mean, noise: covariance.into() }
    }
}

impl<const N: usize> TakenOver<N> {
    /// As a filter takes it.
    pub fn step(&self) -> Step<'_, Self, N> {
        Step::new(self, &())
    }
}

impl<const N: usize> Process<f64, N> for TakenOver<N> {
    type Input = ();

    fn step<S: Over<f64>>(&self, _: &[S; N], (): &()) -> [S; N] {
        self.mean.map(S::lift)
    }

    fn noise(&self) -> &ProcessNoise<f64, N> {
        &self.noise
    }
}

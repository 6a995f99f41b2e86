//! Linear steps.

use super::{Process, ProcessNoise};
use crate::discretize::discretize;
use crate::notation::{sum, vector};
use crate::{Mat, NoiseDensity, Over, Scalar};

/// x′ = Φ·x + Γ·u + w.
#[derive(Clone, Copy, Debug)]
pub struct LinearProcess<T, const N: usize, const U: usize> {
    /// Φ.
    pub transition: Mat<T, N, N>,
    /// Γ: what an input does that is held over the interval.
    pub input: Mat<T, N, U>,
    /// The covariance of w.
    pub noise: ProcessNoise<T, N>,
}

impl<T: Scalar, const N: usize, const U: usize> LinearProcess<T, N, U> {
    /// The exact step of ẋ = A·x + B·u + w over one interval with a held input. Where the input is sampled from
    /// a smooth one, give the mean of both ends.
    pub fn exact(a: &Mat<T, N, N>, b: &Mat<T, N, U>, density: &NoiseDensity<T, N>, interval: T) -> Self {
        let d = discretize(a, density, interval);
        Self { transition: d.transition, input: d.input_integral.times(b), noise: d.noise.into() }
    }
}

impl<T: Scalar, const N: usize, const U: usize> Process<T, N> for LinearProcess<T, N, U> {
    type Input = [T; U];

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &[T; U]) -> [S; N] {
        let moved = self.transition.times_vector(x);
        vector!(|i| moved[i] + sum!(U, |k| self.input.0[i][k] * u[k]))
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }

    #[inline(always)]
    fn linearize(&self, x: &[T; N], u: &[T; U]) -> ([T; N], Mat<T, N, N>) {
        (self.step(x, u), self.transition)
    }
}

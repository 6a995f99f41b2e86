//! The step of all devices under an input that is held.

use super::{Dynamics, Etdrk4, Nodes, Process, ProcessNoise};
use crate::{Mat, NoiseDensity, Over, Scalar};

/// The step of [`Etdrk4`] under an input that is held over the interval, as that of a loop which is closed from sample to sample.
///
/// ```
/// use kalmems_core::{Dynamics, HeldEtdrk4, NoiseDensity, Over, Process, Scalar};
/// /// Relaxes within a microsecond.
/// struct Relaxation;
/// impl<T: Scalar> Dynamics<T, 1> for Relaxation {
///     type Input = T;
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], u: &T) -> [S; 1] {
///         [-(x[0] - *u) * T::of(1e6)]
///     }
/// }
/// let millisecond = HeldEtdrk4::new(Relaxation, 1e-3, &NoiseDensity::none(), (&[0.0], &0.0));
/// let [there]: [f64; 1] = millisecond.step(&[5.0], &2.0);
/// assert!((there - 2.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct HeldEtdrk4<D, T, const N: usize>(Etdrk4<D, T, N>);

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> HeldEtdrk4<D, T, N> {
    /// Steps of `interval` seconds, linearised `at` a state and an input.
    pub fn new(dynamics: D, interval: T, density: &NoiseDensity<T, N>, at: (&[T; N], &D::Input)) -> Self {
        Self(Etdrk4::new(dynamics, interval, density, at))
    }
}

impl<T: Scalar, D, const N: usize> HeldEtdrk4<D, T, N> {
    /// e^{A·s}, see [`Etdrk4::transition`].
    pub fn transition(&self) -> Mat<T, N, N> {
        self.0.transition()
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for HeldEtdrk4<D, T, N> {
    type Input = D::Input;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &D::Input) -> [S; N] {
        self.0.step(x, &Nodes::held(*u))
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        self.0.noise()
    }
}

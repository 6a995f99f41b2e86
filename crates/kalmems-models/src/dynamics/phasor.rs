//! A sinusoidal motion as a phasor that turns.

use core::f64::consts::TAU;
use kalmems_core::discretize::discretize;
use kalmems_core::{Mat, NoiseDensity, Over, Process, ProcessNoise, Scalar};
use kalmems_macros::model;

/// A phasor of a held amplitude, states [A, f, φ] in m, Hz and rad: A′ = A, f′ = f, φ′ = φ + 2π·f·h − 2π·n.
///
/// The process of Faller and Zangl, 2017, equation 13, with φ the phase at the sample (their measurement takes it one
/// sample ahead). The input is the number n of whole turns that is taken off the phase. Whoever runs a filter gives
/// n = 1 when its φ has passed π, and so keeps the phase small, where it has most digits. n is the same for
/// whatever is predicted together, sigma points too; a phase that wrapped itself would tear them apart.
///
/// ```
/// use kalmems_core::{NoiseDensity, Process};
/// use kalmems_models::dynamics::SteadyPhasor;
/// let phasor = SteadyPhasor::new(1e-3, &NoiseDensity::none());
/// let [_, _, phase] = phasor.step(&[5e-4, 250.0, 3.0], &1.0);
/// assert!((phase - (3.0 - 1.5 * std::f64::consts::PI)).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyPhasor<T> {
    interval: T,
    noise: ProcessNoise<T, 3>,
}

impl<T: Scalar> SteadyPhasor<T> {
    /// The exact step over an interval in s, with the noise densities of A, f and φ in m²/s, Hz²/s and rad²/s.
    pub fn new(interval: T, density: &NoiseDensity<T, 3>) -> Self {
        let mut a = Mat::<T, 3, 3>::zero();
        a.0[2][1] = T::of(TAU);
        Self { interval, noise: discretize(&a, density, interval).noise.into() }
    }
}

#[model]
impl<T: Scalar> Process<T, 3> for SteadyPhasor<T> {
    type Input = T;

    fn step<S: Over<T>>(&self, x: &[S; 3], turns: &T) -> [S; 3] {
        [x[0], x[1], turned(x[2], x[1], self.interval, *turns)]
    }

    fn noise(&self) -> &ProcessNoise<T, 3> {
        &self.noise
    }

    fn depends(i: usize, j: usize) -> bool {
        i == j || (i == 2 && j == 1)
    }

    fn linearize(&self, x: &[T; 3], turns: &T) -> ([T; 3], Mat<T, 3, 3>) {
        let mut f = Mat::identity();
        f.0[2][1] = T::of(TAU) * self.interval;
        (self.step(x, turns), f)
    }
}

/// A phasor whose amplitude drifts about a rest position, states [A, f, φ, d₀, Ȧ] in m, Hz, rad, m and m/s:
/// A′ = A + h·Ȧ, f′ = f, φ′ = φ + 2π·f·h − 2π·n, d₀′ = d₀, Ȧ′ = Ȧ.
///
/// What [`SteadyPhasor`] lacks: with A alone a filter follows a drift by lagging behind it, and a rest position that
/// is not quite the assumed one ends up in A.
///
/// ```
/// use kalmems_core::{NoiseDensity, Process};
/// use kalmems_models::dynamics::DriftingPhasor;
/// let phasor = DriftingPhasor::new(1e-3, &NoiseDensity::none());
/// let [amplitude, ..] = phasor.step(&[5e-4, 250.0, 0.0, 1e-3, 1e-6], &0.0);
/// assert_eq!(amplitude, 5e-4 + 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftingPhasor<T> {
    interval: T,
    noise: ProcessNoise<T, 5>,
}

impl<T: Scalar> DriftingPhasor<T> {
    /// The exact step over an interval in s, with the noise densities of A, f, φ, d₀ and Ȧ in m²/s, Hz²/s, rad²/s,
    /// m²/s and m²/s³.
    pub fn new(interval: T, density: &NoiseDensity<T, 5>) -> Self {
        let mut a = Mat::<T, 5, 5>::zero();
        a.0[2][1] = T::of(TAU);
        a.0[0][4] = T::of(1.0);
        Self { interval, noise: discretize(&a, density, interval).noise.into() }
    }
}

#[model]
impl<T: Scalar> Process<T, 5> for DriftingPhasor<T> {
    type Input = T;

    fn step<S: Over<T>>(&self, x: &[S; 5], turns: &T) -> [S; 5] {
        [x[0] + x[4] * self.interval, x[1], turned(x[2], x[1], self.interval, *turns), x[3], x[4]]
    }

    fn noise(&self) -> &ProcessNoise<T, 5> {
        &self.noise
    }

    fn depends(i: usize, j: usize) -> bool {
        i == j || (i == 2 && j == 1) || (i == 0 && j == 4)
    }

    fn linearize(&self, x: &[T; 5], turns: &T) -> ([T; 5], Mat<T, 5, 5>) {
        let mut f = Mat::identity();
        f.0[2][1] = T::of(TAU) * self.interval;
        f.0[0][4] = self.interval;
        (self.step(x, turns), f)
    }
}

/// φ + 2π·(f·h − n).
#[model]
fn turned<T: Scalar, S: Over<T>>(phase: S, frequency: S, interval: T, turns: T) -> S {
    phase + (frequency * interval - turns) * T::of(TAU)
}

//! The step of all devices: exact for what is linear, of fourth order in the rest.

use super::stepper::{AsGiven, RightHandSide, VariedDynamics, held_dynamics};
use super::{Dynamics, Nodes, Process, ProcessNoise};
use crate::augmentation::{ParametricDynamics, ParametricProcess};
use crate::discretize::{discretize, phi_functions};
use crate::linalg::unrolled;
use crate::notation::{matrix, sum, vector};
use crate::{Mat, NoiseDensity, Over, Scalar};

/// The matrices of one step of [`Etdrk4`] over s seconds, for a linear part A.
///
/// With A = 0 they are the numbers of the classical Runge–Kutta method times the identity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EtdWeights<T, const N: usize> {
    /// A, in the states' units per second.
    pub linear: Mat<T, N, N>,
    /// s/2·φ₁(A·s/2).
    pub to_middle: Mat<T, N, N>,
    /// s·φ₂(A·s/2).
    pub bend_to_middle: Mat<T, N, N>,
    /// s·φ₁(A·s).
    pub to_end: Mat<T, N, N>,
    /// 2·s·φ₂(A·s).
    pub bend_to_end: Mat<T, N, N>,
    /// s·(2·φ₂ − 4·φ₃)(A·s).
    pub bend_of_middles: Mat<T, N, N>,
    /// s·(4·φ₃ − φ₂)(A·s).
    pub bend_of_end: Mat<T, N, N>,
}

impl<T: Scalar, const N: usize> EtdWeights<T, N> {
    /// For a step of `interval` seconds, which may be negative.
    pub fn new(linear: Mat<T, N, N>, interval: T) -> Self {
        let half = phi_functions(&linear, interval.half());
        let whole = half.doubled();
        let (s, two) = (interval, T::of(2.0));
        let sum = |a: T, b: T| matrix!(|i, j| whole.second.0[i][j] * a + whole.third.0[i][j] * b);
        Self {
            linear,
            to_middle: half.first.scaled(s.half()),
            bend_to_middle: half.second.scaled(s),
            to_end: whole.first.scaled(s),
            bend_to_end: whole.second.scaled(two * s),
            bend_of_middles: sum(two * s, T::of(-4.0) * s),
            bend_of_end: sum(T::of(0.0) - s, T::of(4.0) * s),
        }
    }
}

impl<T: Scalar, const N: usize> EtdWeights<T, N> {
    /// One step from `x` under inputs.
    #[inline(always)]
    fn step<S: Over<T>, I, F: RightHandSide<S, I, N>>(&self, x: &[S; N], u: &Nodes<I>, f: &F) -> [S; N] {
        let rate = f.at(x, &u.start);
        let first: [S; N] = self.to_middle.times_vector(&rate);
        let bend_a = self.bend::<S, I, F>(&f.at(&moved(x, &first), &u.middle), &rate, &first);
        let second = bent::<T, S, I, F, N>(&first, &self.bend_to_middle, &bend_a);
        let bend_b = self.bend::<S, I, F>(&f.at(&moved(x, &second), &u.middle), &rate, &second);
        let straight: [S; N] = self.to_end.times_vector(&rate);
        let third = bent::<T, S, I, F, N>(&straight, &self.bend_to_end, &bend_b);
        let bend_c = self.bend::<S, I, F>(&f.at(&moved(x, &third), &u.end), &rate, &third);
        let middles = vector!(|i| bend_a[i] + bend_b[i]);
        let way = bent::<T, S, I, F, N>(&straight, &self.bend_of_middles, &middles);
        moved(x, &bent::<T, S, I, F, N>(&way, &self.bend_of_end, &bend_c))
    }

    /// f(x + m) − f(x) − A·m: what the linear part does not describe.
    #[inline(always)]
    fn bend<S: Over<T>, I, F: RightHandSide<S, I, N>>(
        &self,
        there: &[S; N],
        here: &[S; N],
        by: &[S; N],
    ) -> [S; N] {
        let mut bend = [S::lift(T::of(0.0)); N];
        unrolled!(i < N {
            if F::bends(i) {
                bend[i] = there[i] - here[i] - sum!(N, |k| by[k] * self.linear.0[i][k]);
            }
        });
        bend
    }
}

/// A way, and what a bend adds to it by this matrix.
#[inline(always)]
fn bent<T: Scalar, S: Over<T>, I, F: RightHandSide<S, I, N>, const N: usize>(
    way: &[S; N],
    matrix: &Mat<T, N, N>,
    bend: &[S; N],
) -> [S; N] {
    let mut bent = *way;
    unrolled!(k < N {
        if F::bends(k) {
            bent = vector!(|i| bent[i].mac_by(bend[k], matrix.0[i][k]));
        }
    });
    bent
}

/// x + m.
#[inline(always)]
fn moved<S: Scalar, const N: usize>(x: &[S; N], by: &[S; N]) -> [S; N] {
    vector!(|i| x[i] + by[i])
}

/// Exponential time differencing of fourth order in Rosenbrock's form with a fixed linear part A, one step per interval.
///
/// Exact, for any interval, if f is linear in the state with the slopes A and the inputs are parabolas within the interval;
/// elsewhere of fourth order in what A leaves of f (Krogstad, J. Comput. Phys. 203, 72, 2005; Hochbruck and Ostermann,
/// Exponential integrators, Acta Numerica 19, 209, 2010). With A = 0 it is the classical Runge–Kutta method. A fast decay needs no
/// short step, and a resonance that the drive modulates weakly is followed with the error of that modulation alone. The process
/// noise is discretised exactly for A.
///
/// ```
/// use kalmems_core::{Dynamics, Etdrk4, Nodes, NoiseDensity, Over, Process, Scalar};
/// /// Relaxes within a microsecond.
/// struct Relaxation;
/// impl<T: Scalar> Dynamics<T, 1> for Relaxation {
///     type Input = T;
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], u: &T) -> [S; 1] {
///         [-(x[0] - *u) * T::of(1e6)]
///     }
/// }
/// let millisecond = Etdrk4::new(Relaxation, 1e-3, &NoiseDensity::none(), (&[0.0], &0.0));
/// let [there]: [f64; 1] = millisecond.step(&[5.0], &Nodes::held(2.0));
/// assert!((there - 2.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Etdrk4<D, T, const N: usize> {
    dynamics: D,
    interval: T,
    weights: EtdWeights<T, N>,
    noise: ProcessNoise<T, N>,
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Etdrk4<D, T, N> {
    /// Steps of `interval` seconds, with the linear part and the noise of the dynamics linearised `at` a state and an input.
    #[inline(always)]
    pub fn new(dynamics: D, interval: T, density: &NoiseDensity<T, N>, at: (&[T; N], &D::Input)) -> Self {
        let linear = dynamics.jacobian(at.0, at.1);
        let noise = discretize(&linear, density, interval).noise;
        Self { dynamics, interval, weights: EtdWeights::new(linear, interval), noise: noise.into() }
    }
}

impl<T: Scalar, D, const N: usize> Etdrk4<D, T, N> {
    /// e^{A·s}: how a small deviation gets over the interval, which is the derivative of the step where it was linearised.
    pub fn transition(&self) -> Mat<T, N, N> {
        let moved = self.weights.to_end.times(&self.weights.linear);
        matrix!(|i, j| T::of(if i == j { 1.0 } else { 0.0 }) + moved.0[i][j])
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for Etdrk4<D, T, N> {
    type Input = Nodes<D::Input>;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &Nodes<D::Input>) -> [S; N] {
        self.weights.step(x, u, &AsGiven::<T, D>::new(&self.dynamics))
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }
}

impl<T: Scalar, D: ParametricDynamics<T, N>, const N: usize> ParametricProcess<T, N> for Etdrk4<D, T, N> {
    held_dynamics!();

    #[inline(always)]
    fn step_of<S: Over<T>>(&self, varied: &D::Of<S>, x: &[S; N], u: &Nodes<D::Input>) -> [S; N] {
        self.weights.step(x, u, &VariedDynamics::<T, S, D>(varied))
    }
}

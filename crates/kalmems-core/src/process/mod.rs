//! How the state moves: in continuous time, and over one interval.

mod continuous;
mod etdrk4;
mod held_etdrk4;
mod linear;
mod noise;
mod numeric;
mod stepper;

pub use continuous::{ContinuousDiscrete, ContinuousLinear, IntervalError, Propagation};
pub use etdrk4::{EtdWeights, Etdrk4};
pub use held_etdrk4::HeldEtdrk4;
pub use linear::LinearProcess;
pub use noise::ProcessNoise;
pub use numeric::NumericProcess;
pub use stepper::{Euler, Nodes, Rk4};

use crate::notation::vector;
use crate::{Dual, Mat, Over, Scalar};

/// A differential equation ẋ = f(x, u) on `N` states.
///
/// ```
/// use kalmems_core::{Dynamics, Over, Scalar};
/// /// A driven, damped mass: x = [position, velocity], u = force.
/// struct Mass<T> {
///     damping: T,
/// }
/// impl<T: Scalar> Dynamics<T, 2> for Mass<T> {
///     type Input = T;
///     fn derivative<S: Over<T>>(&self, x: &[S; 2], force: &T) -> [S; 2] {
///         [x[1], S::lift(*force) - x[1] * self.damping]
///     }
/// }
/// assert_eq!(Mass { damping: 0.5 }.derivative(&[0.0, 2.0], &3.0), [2.0, 2.0]);
/// ```
pub trait Dynamics<T: Scalar, const N: usize> {
    /// What drives it at one instant; known, without noise.
    type Input: Copy;

    /// f(x, u), in the states' units per second.
    fn derivative<S: Over<T>>(&self, x: &[S; N], u: &Self::Input) -> [S; N];

    /// Whether component `i` of f is more than a linear function of the state whose slopes are the same at every state, input and
    /// parameter; where not, as of an angle whose rate is a state, a step need not look for what its linear part leaves of it. Must not
    /// depend on anything but its argument.
    #[inline(always)]
    fn bends(i: usize) -> bool {
        let _ = i;
        true
    }

    /// The size that each state has in this device, in the state's unit; one unless the model knows better.
    ///
    /// For filters in scaled states, see [`Scaled`](crate::Scaled). A rough figure is enough.
    #[inline(always)]
    fn natural_scales(&self) -> [T; N] {
        [T::of(1.0); N]
    }

    /// ∂f/∂x at one point.
    #[inline(always)]
    fn jacobian(&self, x: &[T; N], u: &Self::Input) -> Mat<T, N, N> {
        derivatives(&self.derivative(&Dual::variables(x), u)).1
    }
}

/// One step x′ = f(x, u) + w over one interval, with the covariance of w.
///
/// The interval belongs to the process: where samples come irregularly, a process is made for each interval,
/// noise included.
///
/// ```
/// use kalmems_core::{Covariance, Over, Process, ProcessNoise, Scalar};
/// /// A number that doubles.
/// struct Doubling(ProcessNoise<f64, 1>);
/// impl Process<f64, 1> for Doubling {
///     type Input = ();
///     fn step<S: Over<f64>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
///         [x[0].twice()]
///     }
///     fn noise(&self) -> &ProcessNoise<f64, 1> {
///         &self.0
///     }
/// }
/// let (x, f) = Doubling(ProcessNoise::none()).linearize(&[3.0], &());
/// assert_eq!((x, f[(0, 0)]), ([6.0], 2.0));
/// ```
pub trait Process<T: Scalar, const N: usize> {
    /// What drives it over the interval.
    type Input: Copy;

    /// f(x, u).
    fn step<S: Over<T>>(&self, x: &[S; N], u: &Self::Input) -> [S; N];

    /// The covariance of w.
    fn noise(&self) -> &ProcessNoise<T, N>;

    /// Whether component `i` of f may depend on state `j`; where not, ∂f_i/∂x_j is zero at every point.
    ///
    /// A compiler may not drop a product with a zero. A filter leaves these out, so that a state which only
    /// drifts costs little. Must not depend on anything but its arguments.
    #[inline(always)]
    fn depends(i: usize, j: usize) -> bool {
        let _ = (i, j);
        true
    }

    /// f(x, u) and ∂f/∂x, by dual numbers unless a model has something better.
    #[inline(always)]
    fn linearize(&self, x: &[T; N], u: &Self::Input) -> ([T; N], Mat<T, N, N>) {
        derivatives(&self.step(&Dual::variables(x), u))
    }
}

/// The value and the Jacobian of a function at `x`, by dual numbers.
#[inline(always)]
pub fn jacobian<T: Scalar, const N: usize, const M: usize>(
    x: &[T; N],
    f: impl Fn(&[Dual<T, N>; N]) -> [Dual<T, N>; M],
) -> ([T; M], Mat<T, M, N>) {
    derivatives(&f(&Dual::variables(x)))
}

/// What a function made of dual numbers: its value and its Jacobian.
#[inline(always)]
pub fn derivatives<T: Scalar, const N: usize, const M: usize>(y: &[Dual<T, N>; M]) -> ([T; M], Mat<T, M, N>) {
    (vector!(|i| y[i].value()), Mat(vector!(|i| y[i].gradient())))
}

//! The filters.
//!
//! Each holds a [`Gaussian`] and offers `predict` over one [`Process`](crate::Process) step and `update` with
//! one [`Measurement`](crate::Measurement). A step that cannot be taken is refused with a
//! [`FilterError`] and leaves the state as it was.

use crate::{Covariance, FilterError, Mat, NumericMeasurement, NumericProcess, Scalar};

mod extended;
mod factored;
mod gaussian;
mod information;
mod innovation;
mod iterated;
mod kalman;
mod linearized;
mod observer;
mod schmidt;
mod sigma;
mod square_root;
mod square_root_unscented;
mod steady_state;
mod unscented;

pub use extended::Ekf;
pub use gaussian::Gaussian;
pub use information::{Information, InformationError};
pub use innovation::Innovation;
pub use iterated::IteratedEkf;
pub use kalman::Kalman;
pub use observer::{ContinuousObserver, ObserverError, Placement, Pole, place_poles};
pub use schmidt::SchmidtEkf;
pub use sigma::SigmaPoints;
pub use square_root::SquareRootEkf;
pub use square_root_unscented::SquareRootUkf;
pub use steady_state::{FixedGain, OperatingPoint};
pub use unscented::Ukf;

use crate::update::{Always, Policy};

/// What the nonlinear filters have in common, so that one loop over a recording serves them all.
///
/// A step is taken, or refused with the reason, and the state is as it was then.
///
/// ```
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat, SigmaPoints, Ukf};
/// fn level(mut filter: impl Filter<f64, 1>, ys: &[f64]) -> f64 {
///     let seen = LinearMeasurement { matrix: Mat([[1.0]]) };
///     for y in ys {
///         // A refused measurement leaves the state as it was.
///         let _ = filter.update(&seen, &[*y], &Covariance::from_variances([1.0]));
///     }
///     filter.mean()[0]
/// }
/// let start = Covariance::from_variances([1e6]);
/// let ys = [3.0, f64::NAN, 5.0];
/// assert!((level(Ekf::new([0.0], start), &ys) - 4.0).abs() < 1e-4);
/// assert!((level(Ukf::new([0.0], start, SigmaPoints::standard()), &ys) - 4.0).abs() < 1e-4);
/// ```
pub trait Filter<T: Scalar, const N: usize> {
    /// The mean of the state.
    fn mean(&self) -> &[T; N];

    /// The covariance of the state.
    fn covariance(&self) -> Covariance<T, N>;

    /// Moves the state by one step, and says how the new state depends on the old one: what a smoother needs.
    fn predict_linked<P: NumericProcess<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<T, N>, FilterError>;

    /// Moves the state by one step.
    #[inline(always)]
    fn predict<P: NumericProcess<T, N>>(&mut self, process: &P, u: &P::Input) -> Result<(), FilterError> {
        self.predict_linked(process, u).map(|_| ())
    }

    /// Corrects the state with a measurement `y` of noise covariance `r`, where the policy takes it.
    ///
    /// Where it does not, the innovation is there all the same and says so in
    /// [`taken`](Innovation::taken).
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError>;

    /// Corrects the state with a measurement `y` of noise covariance `r`.
    #[inline(always)]
    fn update<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
    ) -> Result<Innovation<T, M>, FilterError> {
        self.update_where(measurement, y, r, &Always)
    }
}

/// How the state after a step depends on the state before: x′ ≈ F·x + c + w with w ~ N(0, Ω).
///
/// For a linearised filter F is the Jacobian and Ω the process noise; for a sigma-point filter F is the
/// regression of x′ on x over the points, and Ω holds what the regression leaves as well. F·P·Fᵀ + Ω is the
/// predicted covariance in either case.
#[derive(Clone, Copy, Debug)]
pub struct StateTransition<T: Scalar, const N: usize> {
    /// F.
    pub transition: Mat<T, N, N>,
    /// Ω.
    pub noise: Covariance<T, N>,
}

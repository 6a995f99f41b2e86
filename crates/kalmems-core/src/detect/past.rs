//! A crossing as a measurement of the angle at its own time.

use crate::discretize::matrix_exponential;
use crate::{LinearMeasurement, Mat, Scalar};

/// The first state as it was `delay` ago, as a measurement on the state now: H = the first row of e^{−A·delay}.
///
/// For ẋ = A·x without input. Exact without process noise; what noise does within the delay is left out, as in
/// [`Delayed`](crate::Delayed). The delay may be any fraction of an interval. With the threshold angle as the value,
/// [`angle_variance`] as the noise and a [`Gate`](crate::update::Gate) as the policy, it is the update by a crossing.
///
/// ```
/// use kalmems_core::detect::{angle_at, angle_variance};
/// use kalmems_core::update::Gate;
/// use kalmems_core::{Covariance, Ekf, Filter, Mat};
/// // A point that moves: it passed 1.0 half a second ago, at a rate of 2 per second.
/// let free = Mat([[0.0, 1.0], [0.0, 0.0]]);
/// let mut filter = Ekf::new([1.9_f64, 2.0], Covariance::from_variances([0.04, 1e-6]));
/// let r = Covariance::from_variances([angle_variance(1e-4, 2.0, 0.01)]);
/// let seen = filter.update_where(&angle_at(&free, 0.5), &[1.0], &r, &Gate { nis: 16.0 })?;
/// assert!(seen.taken);
/// assert!((filter.mean()[0] - 2.0).abs() < 1e-4);
/// // One that would have been a second earlier is a false detection.
/// assert!(!filter.update_where(&angle_at(&free, 1.5), &[1.0], &r, &Gate { nis: 16.0 })?.taken);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
pub fn angle_at<T: Scalar, const N: usize>(a: &Mat<T, N, N>, delay: T) -> LinearMeasurement<T, N, 1> {
    let back = matrix_exponential(&a.scaled(-delay));
    LinearMeasurement { matrix: Mat(core::array::from_fn(|i| back.0[i])) }
}

/// The variance of the angle at a detection whose time has `timing_variance` samples², where the angle moves at `rate`
/// and a sample takes `interval`: (ω·T)²·σ_t².
pub fn angle_variance<T: Scalar>(timing_variance: T, rate: T, interval: T) -> T {
    timing_variance * (rate * interval).sq()
}

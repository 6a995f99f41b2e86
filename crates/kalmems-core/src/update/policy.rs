//! Policies: whether a correction that could be made is made.

use crate::{Innovation, Scalar};

/// What a correction would do.
#[derive(Clone, Copy, Debug)]
pub struct Correction<T, const N: usize> {
    /// K·r: what it would add to the mean.
    pub change: [T; N],
    /// The variance of each state before it.
    pub variance: [T; N],
}

/// Decides on a correction before the work on the covariance is done.
///
/// Policies combine as tuples: all of them must take it.
///
/// ```
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat};
/// use kalmems_core::update::{Gate, OnNeed};
/// let seen = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let r = Covariance::from_variances([1.0]);
/// let mut filter = Ekf::new([0.0_f64], Covariance::from_variances([3.0]));
/// let policy = (Gate { nis: 9.0 }, OnNeed { fraction: 0.05 });
/// // 2σ of the innovation is 4: 10 is an outlier, 0.1 changes nothing, 2 is used.
/// assert!(!filter.update_where(&seen, &[10.0], &r, &policy)?.taken);
/// assert!(!filter.update_where(&seen, &[0.1], &r, &policy)?.taken);
/// assert!(filter.update_where(&seen, &[2.0], &r, &policy)?.taken);
/// assert_eq!(filter.mean(), &[1.5]);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
pub trait Policy<T: Scalar, const N: usize> {
    /// Where to take it.
    fn take<const M: usize>(&self, innovation: &Innovation<T, M>, correction: &Correction<T, N>) -> bool;
}

/// Takes every correction.
#[derive(Clone, Copy, Debug)]
pub struct Always;

impl<T: Scalar, const N: usize> Policy<T, N> for Always {
    #[inline(always)]
    fn take<const M: usize>(&self, _: &Innovation<T, M>, _: &Correction<T, N>) -> bool {
        T::of(0.0).is_finite()
    }
}

/// Takes what is not an outlier: NIS at most this.
///
/// A quantile of χ² with as many degrees of freedom as the measurement has components; k² for k standard
/// deviations of a single one.
#[derive(Clone, Copy, Debug)]
pub struct Gate<T> {
    /// The largest normalised innovation squared that is taken.
    pub nis: T,
}

impl<T: Scalar, const N: usize> Policy<T, N> for Gate<T> {
    #[inline(always)]
    fn take<const M: usize>(&self, innovation: &Innovation<T, M>, _: &Correction<T, N>) -> bool {
        !innovation.nis.gt(self.nis)
    }
}

/// Takes what changes the estimate: by at least this fraction of the standard deviation in some state.
///
/// What is skipped saves the work on the covariance. The filter does not count it as seen: its covariance grows as
/// it does without a measurement, and is then larger than the error, because a small innovation that was left out
/// is knowledge too. The next correction weighs more.
#[derive(Clone, Copy, Debug)]
pub struct OnNeed<T> {
    /// The fraction of σ.
    pub fraction: T,
}

impl<T: Scalar, const N: usize> Policy<T, N> for OnNeed<T> {
    #[inline(always)]
    fn take<const M: usize>(&self, _: &Innovation<T, M>, correction: &Correction<T, N>) -> bool {
        let square = self.fraction.sq();
        let mut needed = false;
        for (change, variance) in correction.change.iter().zip(&correction.variance) {
            needed |= !change.sq().lt(square * *variance);
        }
        needed
    }
}

impl<T: Scalar, A: Policy<T, N>, B: Policy<T, N>, const N: usize> Policy<T, N> for (A, B) {
    #[inline(always)]
    fn take<const M: usize>(&self, innovation: &Innovation<T, M>, correction: &Correction<T, N>) -> bool {
        self.0.take(innovation, correction) & self.1.take(innovation, correction)
    }
}

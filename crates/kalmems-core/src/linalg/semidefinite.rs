//! Factors of a covariance that may be singular.

use super::Mat;
use crate::notation::sum;
use crate::{Covariance, Scalar};

/// P = L·Lᵀ with L lower triangular and zero columns where P is singular to rounding.
///
/// A pivot within N·ε/2 of its diagonal entry is what rounding leaves of a zero and counts as zero: that
/// state is exactly known from those before it. So does a negative one within ε^¼ of it, which is what rounding
/// leaves after very many steps without noise: of a variance that is itself the small difference of larger ones, as of the speed of a resonator that
/// slowly follows its rest, rounding is no small part. A pivot further below zero than that, or a correlation beyond
/// one with a zero pivot, belongs to no covariance and clears `sound`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Semidefinite<T: Scalar, const N: usize> {
    /// L.
    pub root: Mat<T, N, N>,
    /// Where this is a covariance; L means nothing where not.
    pub sound: bool,
}

/// The distance from 1 to the next number, of whatever precision `T` has.
#[inline(always)]
pub(crate) fn epsilon<T: Scalar>() -> T {
    // 4/3 is rounded; three times its rounding error is one unit in the last place.
    ((T::of(4.0 / 3.0) - T::of(1.0)) * T::of(3.0) - T::of(1.0)).abs()
}

impl<T: Scalar, const N: usize> Semidefinite<T, N> {
    /// Factors a covariance.
    #[inline(never)]
    pub fn of(covariance: &Covariance<T, N>) -> Self {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let tolerance = epsilon::<T>() * T::of(0.5 * N as f64);
        let accumulated = epsilon::<T>().sqrt().sqrt();
        let mut l = Mat::<T, N, N>::zero();
        let mut sound = covariance.is_finite();
        for j in 0..N {
            let whole = covariance.get(j, j);
            let pivot = whole - sum!(j, |k| l.0[j][k].sq());
            let rounding = whole.abs() * tolerance;
            let usable = pivot.gt(rounding);
            sound &= !pivot.lt(-(whole.abs() * accumulated));
            let root = T::select(usable, pivot, zero).sqrt();
            let recip = T::select(usable, root, one).recip();
            l.0[j][j] = root;
            for i in (j + 1)..N {
                let left = covariance.get(i, j) - sum!(j, |k| l.0[i][k] * l.0[j][k]);
                let possible = !left.sq().gt((whole * covariance.get(i, i)).twice());
                sound = sound && (usable | possible);
                l.0[i][j] = T::select(usable, left * recip, zero);
            }
        }
        Self { root: l, sound }
    }
}

#[cfg(test)]
mod tests {
    use super::{Semidefinite, epsilon};
    use crate::{Covariance, Mat};

    #[test]
    fn what_is_singular_has_a_root() {
        // b·bᵀ + c·cᵀ with b = (1, 1/3, −2), c = (0, 0, 1/7): rank 2, and thirds do not cancel exactly.
        let (b, c) = ([1.0, 1.0 / 3.0, -2.0], [0.0, 0.0, 1.0 / 7.0]);
        let p = Mat::<f64, 3, 3>::from_fn(|i, j| b[i] * b[j] + c[i] * c[j]);
        let factors = Semidefinite::of(&Covariance::from_lower(p));
        assert!(factors.sound);
        let root = factors.root;
        let squared = root.times_transposed(&root);
        assert_eq!(root[(1, 1)], 0.0);
        for i in 0..3 {
            for j in 0..3 {
                assert!((squared[(i, j)] - p[(i, j)]).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn rounding_in_place_of_a_zero_does_not_grow() {
        // The second pivot is one ulp, beside a covariance that it would blow up to a correlation of seven.
        let p = Mat([[1.0_f64, 1.0, 0.0], [1.0, 1.0 + f64::EPSILON, 1e-7], [0.0, 1e-7, 1.0]]);
        let factors = Semidefinite::of(&Covariance::from_lower(p));
        assert!(factors.sound);
        let squared = factors.root.times_transposed(&factors.root);
        for i in 0..3 {
            for j in 0..3 {
                // The root of ε is what such a covariance says of its smallest part.
                assert!((squared[(i, j)] - p[(i, j)]).abs() <= 1e-7, "{squared:?}");
            }
        }
    }

    #[test]
    fn a_matrix_that_is_no_covariance_is_refused() {
        for m in [[[1.0_f64, 0.0], [2.0, 1.0]], [[0.0, 0.0], [1.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]]] {
            assert!(!Semidefinite::of(&Covariance::from_lower(Mat(m))).sound, "{m:?}");
        }
        assert!(!Semidefinite::of(&Covariance::from_lower(Mat([[f64::NAN]]))).sound);
        assert!(Semidefinite::of(&Covariance::<f64, 2>::zero()).sound);
    }

    #[test]
    fn the_precision_of_each_number() {
        assert_eq!(epsilon::<f64>(), f64::EPSILON);
        assert_eq!(epsilon::<f32>(), f32::EPSILON);
    }
}

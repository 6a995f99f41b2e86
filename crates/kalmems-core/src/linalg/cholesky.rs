//! The lower Cholesky factor.

use super::{Mat, epsilon, triangularize};
use crate::notation::{less, matrix, vector};
use crate::{Covariance, Scalar};

/// P = L·Lᵀ with L lower triangular.
#[derive(Clone, Copy, Debug)]
pub struct Cholesky<T: Scalar, const N: usize> {
    /// L; zeros above the diagonal. Not meaningful where `positive` is not set.
    pub factor: Mat<T, N, N>,
    /// Whether every pivot was positive and finite.
    pub positive: bool,
}

impl<T: Scalar, const N: usize> Cholesky<T, N> {
    /// Factors a covariance. A pivot that is not positive is told in `positive`, not repaired.
    #[inline(always)]
    pub fn of(covariance: &Covariance<T, N>) -> Self {
        let mut l = Mat::<T, N, N>::zero();
        let mut positive = T::of(0.0).is_finite();
        for j in 0..N {
            let pivot = less!(covariance.get(j, j), j, |k| l.0[j][k].sq());
            positive = positive & pivot.gt(T::of(0.0)) & pivot.is_finite();
            let root = pivot.sqrt();
            let recip = root.recip();
            l.0[j][j] = root;
            for i in (j + 1)..N {
                l.0[i][j] = less!(covariance.get(i, j), j, |k| l.0[i][k] * l.0[j][k]) * recip;
            }
        }
        Self { factor: l, positive }
    }

    /// L, not negative on its diagonal, of a covariance that may be singular.
    ///
    /// The states are taken in the order of how much of their variance is left unexplained (diagonal pivoting), and
    /// the columns made triangular afterwards. In the order in which they stand, a state that is all but explained by
    /// those before it would divide rounding by rounding, and L·Lᵀ would be right to √ε alone (Higham, Accuracy and
    /// Stability of Numerical Algorithms, section 10.3). What is left of 8·N·ε of a state's variance is rounding too,
    /// and ends it.
    ///
    /// Right for what is positive semi-definite; anything else has no such factor, and a filter that is given
    /// it is wrong from the start.
    #[inline(never)]
    pub fn of_semidefinite(covariance: &Covariance<T, N>) -> Mat<T, N, N> {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let rounding = epsilon::<T>() * T::of(8.0 * N as f64);
        let whole: [T; N] = vector!(|i| {
            let variance = covariance.get(i, i);
            T::select(variance.gt(zero), T::select(variance.gt(zero), variance, one).recip(), zero)
        });
        let mut left = covariance.to_full();
        let mut root = Mat::<T, N, N>::zero();
        for _ in 0..N {
            let share: [T; N] = vector!(|i| left.0[i][i] * whole[i]);
            let mut most = zero;
            for share in share {
                most = T::select(share.gt(most), share, most);
            }
            let mut open = most.gt(rounding);
            let mut chosen = [open; N];
            for i in 0..N {
                chosen[i] = open & !share[i].lt(most);
                open = open && !chosen[i];
            }
            // A row of zeros where none is chosen.
            let mut pivot = zero;
            let mut row = [zero; N];
            for i in 0..N {
                pivot = T::select(chosen[i], left.0[i][i], pivot);
                row = vector!(|j| T::select(chosen[i], left.0[j][i], row[j]));
            }
            let recip = T::select(pivot.gt(zero), pivot, one).sqrt().recip();
            let column: [T; N] = vector!(|i| T::select(chosen[i], pivot.sqrt(), row[i] * recip));
            root = matrix!(|i, j| T::select(chosen[j], column[i], root.0[i][j]));
            left = matrix!(|i, j| {
                let rest = left.0[i][j] - column[i] * column[j];
                T::select(chosen[i] | chosen[j], zero, rest)
            });
        }
        triangularize(root, Mat::<T, N, 0>::zero(), Mat::zero())
    }
}

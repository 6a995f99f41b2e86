//! The inverse of a small matrix.

use super::{Mat, epsilon};
use crate::Scalar;
use crate::notation::sum;

/// A⁻¹ by Gauss–Jordan elimination with row pivoting; `None` where a pivot is zero to rounding beside the
/// rest of its column as it was. For set-up code: it branches.
pub(crate) fn inverse<T: Scalar<Mask = bool>, const N: usize>(matrix: &Mat<T, N, N>) -> Option<Mat<T, N, N>> {
    let (mut a, mut inverse) = (*matrix, Mat::identity());
    for j in 0..N {
        let whole = sum!(N, |i| matrix.0[i][j].abs());
        let mut best = j;
        for i in (j + 1)..N {
            if a.0[i][j].abs().gt(a.0[best][j].abs()) {
                best = i;
            }
        }
        if best < N {
            a.0.swap(j, best);
            inverse.0.swap(j, best);
        }
        let pivot = a.0[j][j];
        if !(pivot.abs().gt(whole * epsilon::<T>()) && pivot.is_finite()) {
            return None;
        }
        let recip = pivot.recip();
        for k in 0..N {
            a.0[j][k] = a.0[j][k] * recip;
            inverse.0[j][k] = inverse.0[j][k] * recip;
        }
        for i in 0..N {
            if i != j {
                let factor = a.0[i][j];
                for k in 0..N {
                    a.0[i][k] = a.0[i][k] - factor * a.0[j][k];
                    inverse.0[i][k] = inverse.0[i][k] - factor * inverse.0[j][k];
                }
            }
        }
    }
    Some(inverse)
}

#[cfg(test)]
mod tests {
    use super::inverse;
    use crate::Mat;

    #[test]
    fn pivots_are_exchanged_and_singular_matrices_refused() {
        let a = Mat([[0.0, 2.0, 1.0], [1.0, 0.0, 3.0], [4.0, -1.0, 0.0]]);
        let product = a.times(&inverse(&a).unwrap());
        for i in 0..3 {
            for j in 0..3 {
                assert!((product[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-15);
            }
        }
        assert!(inverse(&Mat([[1.0, 1.0 / 3.0], [3.0, 1.0]])).is_none());
        assert!(inverse(&Mat([[f64::NAN]])).is_none());
    }
}

//! Linear equations with a general matrix.

use super::Mat;
use crate::Scalar;
use crate::notation::sum;

/// P·A = L·U with partial pivoting (L unit lower triangular, U upper triangular, P a permutation of rows).
///
/// For set-up work; nothing in a filter's step solves a general system.
///
/// ```
/// use kalmems_core::{Lu, Mat};
/// let a = Mat([[0.0, 2.0], [4.0, 1.0]]);
/// assert_eq!(Lu::of(&a).map(|lu| lu.solve(&Mat([[6.0], [7.0]]))), Some(Mat([[1.0], [3.0]])));
/// assert!(Lu::of(&Mat([[1.0, 2.0], [2.0, 4.0]])).is_none());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Lu<T, const N: usize> {
    /// U, and below its diagonal L.
    factors: Mat<T, N, N>,
    /// Whether rows j and i > j changed places when column j was reduced, in the order of i.
    swapped: [[bool; N]; N],
}

impl<T: Scalar, const N: usize> Lu<T, N> {
    /// Factors a matrix; `None` where a pivot is zero or not finite.
    pub fn of(matrix: &Mat<T, N, N>) -> Option<Self> {
        let mut a = *matrix;
        let mut swapped = [[false; N]; N];
        for j in 0..N {
            // Exchanging with each larger entry in turn ends with the largest, by indices of loops alone.
            for i in (j + 1)..N {
                swapped[j][i] = a.0[i][j].abs().gt(a.0[j][j].abs());
                if swapped[j][i] {
                    exchange_rows(&mut a, i, j);
                }
            }
            let pivot = a.0[j][j];
            if !pivot.abs().gt(T::of(0.0)) || !pivot.is_finite() {
                return None;
            }
            for i in (j + 1)..N {
                let factor = a.0[i][j] / pivot;
                a.0[i][j] = factor;
                for k in (j + 1)..N {
                    a.0[i][k] = a.0[i][k] - factor * a.0[j][k];
                }
            }
        }
        Some(Self { factors: a, swapped })
    }

    /// A⁻¹·B.
    #[must_use]
    pub fn solve<const K: usize>(&self, b: &Mat<T, N, K>) -> Mat<T, N, K> {
        let a = &self.factors;
        let mut x = *b;
        for j in 0..N {
            for i in (j + 1)..N {
                if self.swapped[j][i] {
                    exchange_rows(&mut x, i, j);
                }
            }
        }
        for k in 0..K {
            for i in 0..N {
                x.0[i][k] = x.0[i][k] - sum!(i, |j| a.0[i][j] * x.0[j][k]);
            }
            for i in (0..N).rev() {
                let above = sum!(N - i - 1, |j| a.0[i][i + 1 + j] * x.0[i + 1 + j][k]);
                x.0[i][k] = (x.0[i][k] - above) / a.0[i][i];
            }
        }
        x
    }

    /// A⁻¹.
    #[must_use]
    pub fn inverse(&self) -> Mat<T, N, N> {
        self.solve(&Mat::identity())
    }
}

/// Rows `i` and `j` change places.
fn exchange_rows<T: Scalar, const N: usize, const K: usize>(a: &mut Mat<T, N, K>, i: usize, j: usize) {
    for k in 0..K {
        let entry = a.0[i][k];
        a.0[i][k] = a.0[j][k];
        a.0[j][k] = entry;
    }
}

//! Singular values by one-sided Jacobi rotations.

use super::{Mat, epsilon};
use crate::Scalar;
use crate::notation::{sum, vector};

/// A = U·Σ·Vᵀ of a matrix with at least as many rows as columns, without U.
///
/// One-sided Jacobi (Hestenes, J. SIAM 6, 51, 1958): columns are rotated in pairs until all are orthogonal;
/// their lengths are the singular values. Small ones keep their relative accuracy where A = B·D with D
/// diagonal, however graded, and B well conditioned (Demmel & Veselić, SIAM J. Matrix Analysis 13, 1204,
/// 1992): the columns may have any units. The squares of the entries must neither overflow nor underflow.
///
/// ```
/// use kalmems_core::{Mat, Svd};
/// let svd = Svd::of(&Mat([[0.0_f64, 2.0], [3e-9, 0.0], [4e-9, 0.0]]));
/// assert_eq!(svd.values, [2.0, 5e-9]);
/// assert_eq!(svd.right.0[1][0].abs(), 1.0); // the largest comes from the second column
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Svd<T, const C: usize> {
    /// The singular values, largest first. Not a number where an entry of A is not finite.
    pub values: [T; C],
    /// V: column j is the direction that A stretches by `values[j]`.
    pub right: Mat<T, C, C>,
}

/// Sweeps over all pairs before it stops. Convergence is quadratic: fewer than ten are the rule.
const SWEEPS: usize = 60;

impl<T: Scalar, const C: usize> Svd<T, C> {
    /// Decomposes a matrix.
    pub fn of<const R: usize>(matrix: &Mat<T, R, C>) -> Self {
        const { assert!(R >= C, "a matrix needs at least as many rows as columns; transpose it") };
        let mut a = *matrix;
        let mut right = Mat::<T, C, C>::identity();
        let tolerance = epsilon::<T>();
        for _ in 0..SWEEPS {
            let mut orthogonal = true;
            for p in 0..C {
                for q in (p + 1)..C {
                    let (pp, qq) = (sum!(R, |i| a.0[i][p].sq()), sum!(R, |i| a.0[i][q].sq()));
                    let pq = sum!(R, |i| a.0[i][p] * a.0[i][q]);
                    // The root of a product of squares could underflow; that of each cannot.
                    if !pq.abs().gt(tolerance * (pp.sqrt() * qq.sqrt())) {
                        continue;
                    }
                    orthogonal = false;
                    let (c, s) = rotation(pp, pq, qq);
                    rotate(&mut a, (p, q), (c, s));
                    rotate(&mut right, (p, q), (c, s));
                }
            }
            if orthogonal {
                break;
            }
        }
        let mut svd = Self { values: vector!(|j| sum!(R, |i| a.0[i][j].sq()).sqrt()), right };
        svd.sort();
        svd
    }

    /// How many singular values exceed `tolerance` times the largest.
    pub fn rank(&self, tolerance: T) -> usize {
        let least = self.values.first().map_or(T::of(0.0), |largest| *largest * tolerance);
        self.values.iter().filter(|value| value.gt(least)).count()
    }

    fn sort(&mut self) {
        for _ in 1..C {
            for j in 1..C {
                if self.values[j].gt(self.values[j - 1]) {
                    self.values.swap(j - 1, j);
                    for row in &mut self.right.0 {
                        row.swap(j - 1, j);
                    }
                }
            }
        }
    }
}

/// c and s that make two columns with these squares and this product orthogonal, turning by 45° at most.
#[inline(always)]
fn rotation<T: Scalar>(pp: T, pq: T, qq: T) -> (T, T) {
    let one = T::of(1.0);
    let cot2 = (qq - pp) / pq.twice();
    // tan = sign/(|cot2| + √(1 + cot2²)); a square that overflows makes tan zero, which it is.
    let size = (cot2.abs() + (one + cot2.sq()).sqrt()).recip();
    let tan = T::select(cot2.lt(T::of(0.0)), -size, size);
    let c = (one + tan.sq()).sqrt().recip();
    (c, c * tan)
}

#[inline(always)]
fn rotate<T: Scalar, const R: usize, const C: usize>(
    m: &mut Mat<T, R, C>,
    (p, q): (usize, usize),
    (c, s): (T, T),
) {
    for row in &mut m.0 {
        let (x, y) = (row[p], row[q]);
        row[p] = c * x - s * y;
        row[q] = s * x + c * y;
    }
}

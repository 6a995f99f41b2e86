//! Lower triangular factors of covariances, kept triangular by rotations.
//!
//! Rotations (Givens) and not reflections or orthogonalisation, although those need fewer square roots: the
//! columns of a factor are sources of uncertainty, and after a precise measurement some are smaller than others
//! by as many digits as a number holds. A rotation mixes two columns without a difference of nearly equal
//! numbers; the others lose the small ones.

use super::{Mat, are_many};
use crate::Scalar;
use crate::notation::sum;

/// The rotation that turns (p, e) into (√(p² + e²), 0).
#[derive(Clone, Copy)]
struct Rotation<T> {
    cos: T,
    sin: T,
}

impl<T: Scalar> Rotation<T> {
    /// What becomes of another row in the same two columns.
    #[inline(always)]
    fn turned(self, pivot: T, entry: T) -> (T, T) {
        (pivot * self.cos + entry * self.sin, entry * self.cos - pivot * self.sin)
    }
}

/// The entries of one row, rotated into its pivot one after the other.
#[derive(Clone, Copy)]
struct Pivot<T> {
    /// Only before the first rotation may it be negative.
    value: T,
    square: T,
}

impl<T: Scalar> Pivot<T> {
    #[inline(always)]
    fn new(value: T) -> Self {
        Self { value, square: value.sq() }
    }

    /// The squares are summed apart from their roots, so that no root waits for another. Nothing is turned
    /// where both are zero.
    #[inline(always)]
    fn absorb(&mut self, entry: T) -> Rotation<T> {
        self.square = self.square + entry.sq();
        let root = self.square.sqrt();
        let some = root.gt(T::of(0.0));
        let recip = T::select(some, root, T::of(1.0)).recip();
        let rotation = Rotation { cos: T::select(some, self.value * recip, T::of(1.0)), sin: entry * recip };
        self.value = root;
        rotation
    }
}

/// The lower triangular L, not negative on its diagonal, with L·Lᵀ = A·Aᵀ + B·Bᵀ + C·Cᵀ; C is lower triangular
/// itself.
///
/// [A, B, C] is rotated row by row; the products are not formed.
#[inline(always)]
pub(crate) fn triangularize<T: Scalar, const N: usize, const K: usize>(
    a: Mat<T, N, N>,
    b: Mat<T, N, K>,
    c: Mat<T, N, N>,
) -> Mat<T, N, N> {
    if const { are_many::<T>(N, N, N) } { called(a, b, c) } else { written_out(a, b, c) }
}

/// One function for all users of a size of many states.
#[inline(never)]
fn called<T: Scalar, const N: usize, const K: usize>(
    a: Mat<T, N, N>,
    b: Mat<T, N, K>,
    c: Mat<T, N, N>,
) -> Mat<T, N, N> {
    written_out(a, b, c)
}

#[inline(always)]
fn written_out<T: Scalar, const N: usize, const K: usize>(
    mut a: Mat<T, N, N>,
    mut b: Mat<T, N, K>,
    mut c: Mat<T, N, N>,
) -> Mat<T, N, N> {
    for j in 0..N {
        if j + 1 == N {
            // No row below: the length is all that is wanted.
            let squares = a.0[j][j].sq() + (sum!(K, |k| b.0[j][k].sq()) + sum!(N, |k| c.0[j][k].sq()));
            a.0[j][j] = squares.sqrt();
            break;
        }
        let mut pivot = Pivot::new(a.0[j][j]);
        for k in (j + 1)..N {
            let rotation = pivot.absorb(a.0[j][k]);
            for i in (j + 1)..N {
                (a.0[i][j], a.0[i][k]) = rotation.turned(a.0[i][j], a.0[i][k]);
            }
            a.0[j][k] = T::of(0.0);
        }
        for k in 0..K {
            let rotation = pivot.absorb(b.0[j][k]);
            for i in (j + 1)..N {
                (a.0[i][j], b.0[i][k]) = rotation.turned(a.0[i][j], b.0[i][k]);
            }
        }
        for k in 0..N {
            if k > j {
                break;
            }
            let rotation = pivot.absorb(c.0[j][k]);
            for i in (j + 1)..N {
                (a.0[i][j], c.0[i][k]) = rotation.turned(a.0[i][j], c.0[i][k]);
            }
        }
        a.0[j][j] = pivot.value;
    }
    a
}

/// X with X·L = A, for a lower triangular L; a column of X is zero where the pivot of L is.
#[inline(always)]
pub(crate) fn times_inverse<T: Scalar, const R: usize, const N: usize>(
    a: &Mat<T, R, N>,
    l: &Mat<T, N, N>,
) -> Mat<T, R, N> {
    let mut x = *a;
    for j in (0..N).rev() {
        let some = l.0[j][j].gt(T::of(0.0));
        let recip = T::select(some, l.0[j][j], T::of(1.0)).recip();
        for row in &mut x.0 {
            let rest = row[j] - sum!(N, |k| k > j, |k| row[k] * l.0[k][j]);
            row[j] = T::select(some, rest * recip, T::of(0.0));
        }
    }
    x
}

/// L⁻¹·v for a lower triangular L; zero where the pivot of L is.
#[inline(always)]
pub(crate) fn inverse_times<T: Scalar, const N: usize>(l: &Mat<T, N, N>, v: &[T; N]) -> [T; N] {
    let mut x = *v;
    for i in 0..N {
        let some = l.0[i][i].gt(T::of(0.0));
        let recip = T::select(some, l.0[i][i], T::of(1.0)).recip();
        x[i] = T::select(some, (x[i] - sum!(i, |k| l.0[i][k] * x[k])) * recip, T::of(0.0));
    }
    x
}

//! Matrices and their products.

use crate::Scalar;
use core::array;
use core::ops::{Index, IndexMut};

/// The sum of `f(0) … f(n−1)`.
///
/// It starts at −0.0, the neutral element that a compiler may drop; 0.0 would turn −0.0 into 0.0 and stays.
#[inline(always)]
pub(crate) fn sum<T: Scalar>(n: usize, f: impl Fn(usize) -> T) -> T {
    let mut total = T::of(-0.0);
    for i in 0..n {
        total = total + f(i);
    }
    total
}

/// The sum of `f(k)` over those `k < n` that a pattern keeps; the pattern is constant and costs nothing.
#[inline(always)]
pub(crate) fn sum_where<T: Scalar>(n: usize, keep: impl Fn(usize) -> bool, f: impl Fn(usize) -> T) -> T {
    let mut total = T::of(-0.0);
    for k in 0..n {
        if keep(k) {
            total = total + f(k);
        }
    }
    total
}

/// `start` less `f(0) … f(n−1)`, and `start` itself where there is none: x − (−0.0) is an addition that stays.
#[inline(always)]
pub(crate) fn less<T: Scalar>(start: T, n: usize, f: impl Fn(usize) -> T) -> T {
    let mut rest = start;
    for i in 0..n {
        rest = rest - f(i);
    }
    rest
}

/// A matrix of `R` rows and `C` columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mat<T, const R: usize, const C: usize>(pub [[T; C]; R]);

impl<T: Scalar, const R: usize, const C: usize> Mat<T, R, C> {
    /// The matrix with `f(i, j)` in row `i` and column `j`.
    #[inline(always)]
    pub fn from_fn(f: impl Fn(usize, usize) -> T) -> Self {
        let mut matrix = Self::zero();
        for i in 0..R {
            for j in 0..C {
                matrix.0[i][j] = f(i, j);
            }
        }
        matrix
    }

    /// Zeros.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([[T::of(0.0); C]; R])
    }

    /// A·B.
    #[inline(always)]
    #[must_use]
    pub fn times<const K: usize>(&self, other: &Mat<T, C, K>) -> Mat<T, R, K> {
        Mat::from_fn(|i, j| sum(C, |k| self.0[i][k] * other.0[k][j]))
    }

    /// A·Bᵀ.
    #[inline(always)]
    #[must_use]
    pub fn times_transposed<const K: usize>(&self, other: &Mat<T, K, C>) -> Mat<T, R, K> {
        Mat::from_fn(|i, j| sum(C, |k| self.0[i][k] * other.0[j][k]))
    }

    /// A·v.
    #[inline(always)]
    pub fn times_vector<S: crate::Over<T>>(&self, v: &[S; C]) -> [S; R] {
        array::from_fn(|i| sum(C, |k| v[k] * self.0[i][k]))
    }

    /// A + B.
    #[inline(always)]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self::from_fn(|i, j| self.0[i][j] + other.0[i][j])
    }

    /// s·A.
    #[inline(always)]
    #[must_use]
    pub fn scaled(&self, s: T) -> Self {
        Self::from_fn(|i, j| self.0[i][j] * s)
    }

    /// Whether every entry is finite.
    #[inline(always)]
    pub fn is_finite(&self) -> T::Mask {
        use crate::Mask;
        let mut finite = T::of(0.0).is_finite();
        for row in &self.0 {
            for entry in row {
                finite = finite.and(entry.is_finite());
            }
        }
        finite
    }
}

impl<T: Scalar, const N: usize> Mat<T, N, N> {
    /// Ones on the diagonal.
    #[inline(always)]
    pub fn identity() -> Self {
        Self::from_fn(|i, j| T::of(if i == j { 1.0 } else { 0.0 }))
    }
}

impl<T, const R: usize, const C: usize> Index<(usize, usize)> for Mat<T, R, C> {
    type Output = T;
    #[inline(always)]
    fn index(&self, (i, j): (usize, usize)) -> &T {
        &self.0[i][j]
    }
}

impl<T, const R: usize, const C: usize> IndexMut<(usize, usize)> for Mat<T, R, C> {
    #[inline(always)]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut T {
        &mut self.0[i][j]
    }
}

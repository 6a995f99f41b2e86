//! Matrices and their products.

use super::many::{are_many, product};
use crate::Scalar;
use crate::notation::{Zeros, matrix, sum, vector};
use core::ops::{Index, IndexMut};

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
        if const { are_many::<T>(R, C, K) } {
            let mut to = Mat::zero();
            let (a, b) = (self.0.as_flattened(), other.0.as_flattened());
            product((a, C), (b, K), false, to.0.as_flattened_mut());
            return to;
        }
        matrix!(|i, j| sum!(C, |k| self.0[i][k] * other.0[k][j]))
    }

    /// A·Bᵀ.
    #[inline(always)]
    #[must_use]
    pub fn times_transposed<const K: usize>(&self, other: &Mat<T, K, C>) -> Mat<T, R, K> {
        matrix!(|i, j| sum!(C, |k| self.0[i][k] * other.0[j][k]))
    }

    /// A·v.
    #[inline(always)]
    pub fn times_vector<S: crate::Over<T>>(&self, v: &[S; C]) -> [S; R] {
        vector!(|i| sum!(C, |k| v[k] * self.0[i][k]))
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
    pub fn is_finite(&self) -> bool {
        let mut zeros = Zeros::none();
        for row in &self.0 {
            zeros = zeros.with_all(row);
        }
        zeros.finite()
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

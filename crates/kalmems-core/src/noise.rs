//! Noise: a continuous density and a covariance are different quantities, and different types.

use crate::linalg::{are_many, spread};
use crate::notation::{Zeros, dot, lower, matrix, vector};
use crate::{Mat, Scalar};

/// A covariance matrix.
///
/// Only its lower triangle is computed and read, so that it is symmetric by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance<T, const N: usize>(Mat<T, N, N>);

impl<T: Scalar, const N: usize> Covariance<T, N> {
    /// Zeros: what is exactly known.
    #[inline(always)]
    pub fn zero() -> Self {
        Self(Mat::zero())
    }

    /// From the lower triangle of a matrix; what stands above the diagonal is not read.
    #[inline(always)]
    pub fn from_lower(matrix: Mat<T, N, N>) -> Self {
        Self(matrix)
    }

    /// Uncorrelated components with these variances.
    #[inline(always)]
    pub fn from_variances(variances: [T; N]) -> Self {
        Self(matrix!(|i, j| if i == j { variances[i] } else { T::of(0.0) }))
    }

    /// Uncorrelated components with these standard deviations.
    #[inline(always)]
    pub fn from_standard_deviations(deviations: [T; N]) -> Self {
        Self::from_variances(vector!(|i| deviations[i].sq()))
    }

    /// One entry.
    #[inline(always)]
    pub fn get(&self, i: usize, j: usize) -> T {
        if i >= j { self.0.0[i][j] } else { self.0.0[j][i] }
    }

    /// The standard deviation of one component.
    #[inline(always)]
    pub fn standard_deviation(&self, i: usize) -> T {
        self.get(i, i).sqrt()
    }

    /// The whole symmetric matrix.
    #[inline(always)]
    pub fn to_full(&self) -> Mat<T, N, N> {
        matrix!(|i, j| self.get(i, j))
    }

    /// The matrix that holds the lower triangle; what stands above the diagonal means nothing.
    #[inline(always)]
    pub const fn lower_triangle(&self) -> &Mat<T, N, N> {
        &self.0
    }

    /// P + Q.
    #[inline(always)]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        lower!(|i, j| self.get(i, j) + other.get(i, j))
    }

    /// F·P·Fᵀ.
    #[inline(always)]
    #[must_use]
    pub fn transformed<const R: usize>(&self, f: &Mat<T, R, N>) -> Covariance<T, R> {
        if const { are_many::<T>(R, N, N) } {
            let (mut whole, mut fp, mut to) = (Mat::<T, N, N>::zero(), Mat::<T, R, N>::zero(), Mat::zero());
            let room = [whole.0.as_flattened_mut(), fp.0.as_flattened_mut()];
            spread(f.0.as_flattened(), (self.0.0.as_flattened(), N), room, to.0.as_flattened_mut());
            return Covariance(to);
        }
        self.transformed_where(f, |_, _| true)
    }

    /// F·P·Fᵀ where only those entries of F can differ from 0 that the pattern keeps.
    #[inline(always)]
    #[must_use]
    pub(crate) fn transformed_where<const R: usize>(
        &self,
        f: &Mat<T, R, N>,
        keep: impl Fn(usize, usize) -> bool,
    ) -> Covariance<T, R> {
        let fp: Mat<T, R, N> = matrix!(|i, j| dot!(N, |k| keep(i, k), |k| f.0[i][k], self.get(k, j)));
        let kept = |i: usize| (0..N).filter(|k| keep(i, *k)).count();
        let entry = |i: usize, j: usize| dot!(N, |k| keep(j, k), |k| fp.0[i][k], f.0[j][k]);
        // By the row with fewer entries; P is symmetric.
        lower!(|i, j| if kept(i) < kept(j) { entry(j, i) } else { entry(i, j) })
    }

    /// Computes `f(i, j)` for the lower triangle alone.
    #[inline(always)]
    pub(crate) fn lower(f: impl Fn(usize, usize) -> T) -> Self {
        let mut covariance = Self::zero();
        for i in 0..N {
            for j in 0..N {
                if i >= j {
                    covariance.0.0[i][j] = f(i, j);
                }
            }
        }
        covariance
    }

    /// Takes the entries of another: those that are computed, and no zeros beside them.
    #[inline(always)]
    pub(crate) fn set(&mut self, other: &Self) {
        for i in 0..N {
            for j in 0..N {
                if j <= i {
                    self.0.0[i][j] = other.0.0[i][j];
                }
            }
        }
    }

    /// The entries, to see whether they are finite.
    #[inline(always)]
    pub(crate) fn zeros(&self) -> Zeros<T> {
        let mut zeros = Zeros::none();
        for i in 0..N {
            for j in 0..N {
                if j <= i {
                    zeros = zeros.with(self.0.0[i][j]);
                }
            }
        }
        zeros
    }

    /// Whether every entry is finite.
    #[inline(always)]
    pub(crate) fn is_finite(&self) -> bool {
        self.zeros().finite()
    }
}

/// The density of the white noise that drives a differential equation ẋ = f(x, u) + w.
///
/// E[w(t) w(t′)ᵀ] = density · δ(t − t′), so that an entry has the unit of state² per second. It becomes a
/// [`Covariance`] only together with a time: see [`discretize`](crate::discretize::discretize). Two-sided, as
/// every process noise density of a Kalman filter; a one-sided density per hertz is twice that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseDensity<T, const N: usize>(Covariance<T, N>);

impl<T: Scalar, const N: usize> NoiseDensity<T, N> {
    /// No noise.
    #[inline(always)]
    pub fn none() -> Self {
        Self(Covariance::zero())
    }

    /// The same, with this density on the derivative of one state, in that state's unit² per second.
    #[inline(always)]
    #[must_use]
    pub fn on<const STATE: usize>(mut self, density: T) -> Self {
        const { assert!(STATE < N, "there is no such state") };
        self.0.0.0[STATE][STATE] = density;
        self
    }

    /// From the lower triangle of a matrix, where one source moves several states; what stands above the diagonal
    /// is not read.
    #[inline(always)]
    pub fn from_lower(matrix: Mat<T, N, N>) -> Self {
        Self(Covariance::from_lower(matrix))
    }

    /// One entry.
    #[inline(always)]
    pub fn get(&self, i: usize, j: usize) -> T {
        self.0.get(i, j)
    }

    /// The symmetric matrix itself, for equations that take a density as it is.
    #[inline(always)]
    pub(crate) const fn matrix(&self) -> &Covariance<T, N> {
        &self.0
    }
}

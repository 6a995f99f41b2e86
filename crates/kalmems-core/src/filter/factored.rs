//! A Gaussian by its factor, and the steps that square-root filters share.

use super::Innovation;
use super::gaussian::Refusal;
use crate::linalg::{Contraction, Decorrelation, triangularize};
use crate::notation::{lower, sum, vector};
use crate::update::{Correction, Policy};
use crate::{Cholesky, Covariance, FilterError, Mat, Scalar};

/// A Gaussian over the state, its covariance P = S·Sᵀ held as S: lower triangular, not negative on its
/// diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Factored<T, const N: usize> {
    pub mean: [T; N],
    pub factor: Mat<T, N, N>,
}

impl<T: Scalar, const N: usize> Factored<T, N> {
    /// From a covariance, which may be singular.
    pub fn of_covariance(mean: [T; N], covariance: &Covariance<T, N>) -> Self {
        Self { mean, factor: Cholesky::of_semidefinite(covariance) }
    }

    /// From any square root of a covariance.
    pub fn of_root(mean: [T; N], root: &Mat<T, N, N>) -> Self {
        Self { mean, factor: triangularize(*root, Mat::<T, N, 0>::zero(), Mat::zero()) }
    }

    /// S·Sᵀ.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, N> {
        lower!(|i, j| sum!(j + 1, |k| self.factor.0[i][k] * self.factor.0[j][k]))
    }

    #[inline(always)]
    fn is_finite(&self) -> bool {
        let mut finite = true;
        for i in 0..N {
            finite &= self.mean[i].is_finite();
            for j in 0..N {
                if j > i {
                    break;
                }
                finite &= self.factor.0[i][j].is_finite();
            }
        }
        finite
    }

    /// Takes `next` where it is finite and nothing speaks against it.
    #[inline(always)]
    pub fn take(&mut self, next: &Self, refused: Refusal) -> Result<(), FilterError> {
        Refusal { state: !next.is_finite(), ..refused }.to_error()?;
        *self = *next;
        Ok(())
    }

    /// The correction with a measurement that sees the state through F = H·S, one row for each component:
    /// y = h + F·z + v where the state is mean + S·z, and v has the covariance `noise`.
    ///
    /// The components are freed of the noise they share and taken one by one. Each turns the rows of F still to
    /// come and those of S by the same rotations; in the end the array [[√R, F], [0, S]] is triangular. `sees(i, j)`
    /// is not set where F_ij is zero at every point.
    #[inline(always)]
    pub fn correct<const M: usize>(
        &mut self,
        (y, predicted): (&[T; M], &[T; M]),
        f: &Mat<T, M, N>,
        sees: impl Fn(usize, usize) -> bool,
        (noise, apart): (&Covariance<T, M>, &Decorrelation<T, M>),
        policy: &impl Policy<T, N>,
        refused: Refusal,
    ) -> Result<Innovation<T, M>, FilterError> {
        const { assert!(M > 0, "a measurement has at least one component") };
        // What a component shares with those before it brings in what they see.
        let sees_apart = |i: usize, j: usize| (0..=i).any(|c| sees(c, j));
        let residual: [T; M] = vector!(|i| y[i] - predicted[i]);
        let mut rest = apart.lower.inverse_times(&residual);
        let mut rows = apart.of_rows(f);
        let mut factor = self.factor;
        let mut change = [T::of(-0.0); N];
        let mut nis = T::of(-0.0);
        let mut pivots = [T::of(0.0); M];
        let mut contraction = Contraction::new(rows.0[0], apart.diagonal[0], |k| sees_apart(0, k));
        for c in 0..M {
            if c > 0 {
                factor = contraction.applied(factor, |k| sees_apart(c - 1, k), |i, j| i >= j);
                rows = contraction.applied(rows, |k| sees_apart(c - 1, k), |i, _| i >= c);
                contraction = Contraction::new(rows.0[c], apart.diagonal[c], |k| sees_apart(c, k));
            }
            pivots[c] = contraction.total;
            let weighted = rest[c] * contraction.recip_total;
            nis = nis + rest[c] * weighted;
            for i in 0..N {
                change[i] = change[i] + along(&factor.0[i], &rows.0[c], i, |k| sees_apart(c, k)) * weighted;
            }
            for i in (c + 1)..M {
                rest[i] = rest[i] - along(&rows.0[i], &rows.0[c], N - 1, |k| sees_apart(c, k)) * weighted;
            }
        }

        let covariance = lower!(|i, j| {
            noise.get(i, j) + sum!(N, |k| sees(i, k) && sees(j, k), |k| f.0[i][k] * f.0[j][k])
        });
        let mut innovation = Innovation::of_pivots(residual, covariance, nis, pivots);
        let variance = vector!(|i| sum!(i + 1, |k| factor.0[i][k].sq()));
        let wanted = policy.take(&innovation, &Correction { change, variance });
        let finite = Refusal::of_measurement(y);
        let refused = Refusal {
            measurement: refused.measurement | finite.measurement,
            innovation: refused.innovation || !innovation.taken,
            ..refused
        };
        refused.to_error()?;
        innovation.taken = wanted;
        if !wanted {
            return Ok(innovation);
        }

        let next = Self {
            mean: vector!(|i| self.mean[i] + change[i]),
            factor: contraction.applied(factor, |k| sees_apart(M - 1, k), |i, j| i >= j),
        };
        self.take(&next, refused)?;
        Ok(innovation)
    }
}

/// The products of two rows up to column `last`, summed from there down, as the contraction sums them.
#[inline(always)]
fn along<T: Scalar, const N: usize>(
    row: &[T; N],
    other: &[T; N],
    last: usize,
    seen: impl Fn(usize) -> bool,
) -> T {
    let mut total = T::of(-0.0);
    for k in (0..N).rev() {
        if k <= last && seen(k) {
            total = total + row[k] * other[k];
        }
    }
    total
}

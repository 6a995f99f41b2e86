//! The state of knowledge, and the two steps that filters with a covariance share.

use super::{Filter, Innovation, StateTransition};
use crate::linalg::are_many;
use crate::notation::{Zeros, dot, finite, lower, matrix, nothing, plus, vector};
use crate::update::{Correction, Policy};
use crate::{Covariance, FilterError, Mat, NumericMeasurement, NumericProcess, Scalar};

/// A Gaussian over the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<T, const N: usize> {
    /// Its mean.
    pub mean: [T; N],
    /// Its covariance.
    pub covariance: Covariance<T, N>,
}

/// What a filter knows of the state.
impl<T: Scalar, F: Filter<T, N>, const N: usize> From<&F> for Gaussian<T, N> {
    #[inline(always)]
    fn from(filter: &F) -> Self {
        Self { mean: *filter.mean(), covariance: filter.covariance() }
    }
}

/// What a measurement says, and how much of it is taken.
pub(super) struct WeighedMeasurement<T: Scalar, const N: usize, const M: usize> {
    pub innovation: Innovation<T, M>,
    /// K = P·Hᵀ·S⁻¹.
    pub gain: Mat<T, N, M>,
    /// D⁻¹ of S = L·D·Lᵀ.
    pub recip: [T; M],
}

/// Why a step or a sample was refused, if it was.
#[derive(Clone, Copy)]
#[allow(clippy::struct_excessive_bools)] // each is a reason of its own, of which there may be several
pub(super) struct Refusal {
    pub measurement: bool,
    pub innovation: bool,
    pub covariance: bool,
    pub state: bool,
}

impl Refusal {
    /// It was not.
    #[inline(always)]
    pub const fn none() -> Self {
        Self { measurement: false, innovation: false, covariance: false, state: false }
    }

    /// Where a measurement is not finite.
    #[inline(always)]
    pub fn of_measurement<T: Scalar, const M: usize>(y: &[T; M]) -> Self {
        Self { measurement: !finite(y), ..Self::none() }
    }

    /// Whether it was.
    #[inline(always)]
    pub const fn happened(self) -> bool {
        self.measurement | self.innovation | self.covariance | self.state
    }

    /// The first reason, where it was.
    #[inline(always)]
    pub fn to_error(self) -> Result<(), FilterError> {
        if !self.happened() {
            Ok(())
        } else if self.measurement {
            Err(FilterError::NonFiniteMeasurement)
        } else if self.covariance {
            Err(FilterError::CovarianceNotPositive)
        } else if self.innovation {
            Err(FilterError::InnovationNotPositive)
        } else {
            Err(FilterError::NonFiniteState)
        }
    }
}

impl<T: Scalar, const N: usize> Gaussian<T, N> {
    /// Whether mean and covariance are finite.
    #[inline(always)]
    pub(super) fn is_finite(&self) -> bool {
        self.zeros().finite()
    }

    /// Mean and covariance, to see whether they are finite.
    #[inline(always)]
    pub(super) fn zeros(&self) -> Zeros<T> {
        self.covariance.zeros().with_all(&self.mean)
    }

    /// Takes the mean and what is computed of the covariance.
    #[inline(always)]
    pub(super) fn set(&mut self, next: &Self) {
        self.mean = next.mean;
        self.covariance.set(&next.covariance);
    }

    /// The prediction with a linear or linearised step: mean f(x), covariance F·P·Fᵀ + Q.
    #[inline(always)]
    pub(super) fn propagate<P: NumericProcess<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<T, N>, FilterError> {
        let (mean, f) = process.linearized(&self.mean, u);
        let next = self.propagated(mean, &f, process);
        self.accept(&next, Refusal::none())?;
        Ok(StateTransition { transition: f, noise: *process.noise_added().covariance() })
    }

    /// What the prediction gives.
    #[inline(always)]
    pub(super) fn propagated<P: NumericProcess<T, N>>(
        &self,
        mean: [T; N],
        f: &Mat<T, N, N>,
        process: &P,
    ) -> Self {
        let moved = process.spread(f, &self.covariance);
        Self { mean, covariance: moved.plus(process.noise_added().covariance()) }
    }

    /// Takes what a step or a sample has led to where it is finite and not refused already.
    #[inline(always)]
    pub(super) fn accept(&mut self, next: &Self, refused: Refusal) -> Result<(), FilterError> {
        Refusal { state: !next.is_finite(), ..refused }.to_error()?;
        *self = *next;
        Ok(())
    }

    /// The correction with a linear or linearised measurement.
    #[inline(always)]
    pub(super) fn correct<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        (y, predicted): (&[T; M], &[T; M]),
        h: &Mat<T, M, N>,
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let WeighedMeasurement { mut innovation, gain, .. } = self.weigh::<H, M>((y, predicted), h, r);
        let correction = self.correction(&gain, &innovation.residual);
        let wanted = policy.take(&innovation, &correction);
        let positive = innovation.taken;
        innovation.taken = wanted & positive;
        let mut refused = Refusal { innovation: !positive, ..Refusal::none() };
        if innovation.taken {
            let next = self.corrected::<H, M>(&innovation.residual, &gain, h, r);
            // A measurement that is not finite leaves no state that is: what is taken was.
            let finite = next.is_finite();
            if finite {
                *self = next;
                return Ok(innovation);
            }
            innovation.taken = false;
            refused.state = true;
        }
        refused.measurement = !finite(y);
        refused.to_error().map(|()| innovation)
    }

    /// What a gain makes of a residual.
    #[inline(always)]
    pub(super) fn corrected<H: NumericMeasurement<T, N, M>, const M: usize>(
        &self,
        residual: &[T; M],
        gain: &Mat<T, N, M>,
        h: &Mat<T, M, N>,
        r: &Covariance<T, M>,
    ) -> Self {
        Self {
            mean: vector!(|i| {
                let change = dot!(M, |k| gain.0[i][k], residual[k]);
                plus_products(self.mean[i], change, &gain.0[i], residual)
            }),
            covariance: self.joseph::<H, M>(gain, h, r),
        }
    }

    /// The innovation, and the gain K = P·Hᵀ·S⁻¹ with S = H·P·Hᵀ + R. The innovation's `taken` is where S was positive
    /// definite.
    #[inline(always)]
    pub(super) fn weigh<H: NumericMeasurement<T, N, M>, const M: usize>(
        &self,
        (y, predicted): (&[T; M], &[T; M]),
        h: &Mat<T, M, N>,
        r: &Covariance<T, M>,
    ) -> WeighedMeasurement<T, N, M> {
        let p = &self.covariance;
        let seen = |i: usize, k: usize| H::sees(i, k);
        // H·P, whose transpose times S⁻¹ is the gain.
        let hp: Mat<T, M, N> = matrix!(|i, j| dot!(N, |k| seen(i, k), |k| h.0[i][k], p.get(k, j)));
        let s = lower!(|i, j| r.get(i, j) + dot!(N, |k| seen(j, k), |k| hp.0[i][k], h.0[j][k]));
        let (innovation, ldl) = Innovation::new(y, predicted, s);
        let gain = Mat(vector!(|i| ldl.solve(&vector!(|j| hp.0[j][i]))));
        WeighedMeasurement { innovation, gain, recip: ldl.recip }
    }

    /// What a gain would do with a residual.
    #[inline(always)]
    pub(super) fn correction<const M: usize>(
        &self,
        gain: &Mat<T, N, M>,
        residual: &[T; M],
    ) -> Correction<T, N> {
        Correction {
            change: vector!(|i| dot!(M, |k| gain.0[i][k], residual[k])),
            variance: vector!(|i| self.covariance.get(i, i)),
        }
    }

    /// P⁺ = (I − K·H)·P·(I − K·H)ᵀ + K·R·Kᵀ: Joseph's form, right for any gain and positive semi-definite whatever the
    /// rounding of K.
    #[inline(always)]
    pub(super) fn joseph<H: NumericMeasurement<T, N, M>, const M: usize>(
        &self,
        gain: &Mat<T, N, M>,
        h: &Mat<T, M, N>,
        r: &Covariance<T, M>,
    ) -> Covariance<T, N> {
        let p = &self.covariance;
        // A = I − K·H, the columns that no component sees being those of I.
        let bare = |j: usize| !(0..M).any(|m| H::sees(m, j));
        let a: Mat<T, N, N> = matrix!(|i, j| {
            let kh = dot!(M, |m| gain.0[i][m], h.0[m][j]);
            if i != j {
                -kh
            } else if let ([k], [row]) = (gain.0[i].as_slice(), h.0.as_slice()) {
                T::of(1.0).mac(-*k, row[j])
            } else {
                T::of(1.0) - kh
            }
        });
        let kr: Mat<T, N, M> = matrix!(|i, j| dot!(M, |k| gain.0[i][k], r.get(k, j)));
        if const { are_many::<T>(N, N, N) } && !(0..N).any(bare) {
            let left = p.transformed(&a);
            return lower!(|i, j| plus_row_products(left.get(i, j), &kr.0[i], &gain.0[j]));
        }
        let ap: Mat<T, N, N> = matrix!(|i, j| row_times(&a.0[i], i, bare, |k| p.get(k, j)));
        lower!(|i, j| {
            plus_row_products(row_times(&a.0[j], j, bare, |k| ap.0[i][k]), &kr.0[i], &gain.0[j])
        })
    }
}

/// `start` + `products`, which is the sum of the products of two rows; fused where there is but one.
#[inline(always)]
fn plus_products<T: Scalar, const M: usize>(start: T, products: T, row: &[T; M], other: &[T; M]) -> T {
    match (row.as_slice(), other.as_slice()) {
        ([a], [b]) => start.mac(*a, *b),
        _ => start + products,
    }
}

/// `start` + the product of two rows.
#[inline(always)]
fn plus_row_products<T: Scalar, const M: usize>(start: T, row: &[T; M], other: &[T; M]) -> T {
    plus_products(start, dot!(M, |k| row[k], other[k]), row, other)
}

/// Row `i` of A = I − K·H times a vector; a bare column of A is a column of I.
#[inline(always)]
fn row_times<T: Scalar, const N: usize>(
    row: &[T; N],
    i: usize,
    bare: impl Fn(usize) -> bool,
    f: impl Fn(usize) -> T,
) -> T {
    // One product before the element that stands alone is added to it, which is the same sum, and fused.
    let alone_first = bare(i) && (0..i).filter(|k| !bare(*k)).count() <= 1;
    let mut begun = alone_first;
    let mut total = if begun { f(i) } else { nothing() };
    for k in 0..N {
        if bare(k) {
            if k == i && !alone_first {
                total = plus(total, f(k));
                begun = true;
            }
        } else {
            total = if begun { total.mac(row[k], f(k)) } else { row[k] * f(k) };
            begun = true;
        }
    }
    total
}

//! A vector measurement taken one number at a time.

use super::{Always, Policy};
use crate::linalg::Ldl;
use crate::notation::{finite, lower, vector};
use crate::{Covariance, Filter, FilterError, Innovation, Mat, Measurement, Over, Scalar};

/// Takes the `M` components of a measurement one by one, each with one division and no matrix to factor.
///
/// Correlated noise is decorrelated first: with R = L·D·Lᵀ the components of L⁻¹·y have the independent
/// variances D. For a linear measurement the result is the vector update to rounding, whatever the filter.
/// For a nonlinear one it is not: each component is linearised (or its sigma points drawn) at the mean that
/// the components before it have corrected, so that their order matters; that helps where the first component
/// is accurate and the prior is not. The measurement is evaluated once for each component.
///
/// A [`Policy`] decides on each component for itself.
///
/// Every filter has these methods. Source: Bierman, *Factorization Methods for Discrete Sequential
/// Estimation* (1977), where the decorrelation is by square roots; here it is by L·D·Lᵀ.
///
/// ```
/// use kalmems_core::update::{Always, Sequential};
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat};
/// let seen = LinearMeasurement { matrix: Mat([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) };
/// let r = Covariance::from_lower(Mat([[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [0.2, 0.1, 1.5]]));
/// let start = Ekf::new([0.0_f64, 0.0], Covariance::from_variances([4.0, 4.0]));
///
/// let (mut at_once, mut one_by_one) = (start, start);
/// let vector = at_once.update(&seen, &[1.0, 2.0, 2.5], &r)?;
/// let sequence = one_by_one.update_sequentially(&seen, &[1.0, 2.0, 2.5], &r)?;
/// assert!((vector.nis - sequence.nis).abs() < 1e-14);
/// assert!((at_once.mean()[1] - one_by_one.mean()[1]).abs() < 1e-14);
///
/// // A component that is missing is left out by name: here whatever is no number.
/// let y = [1.0, f64::NAN, 2.5];
/// let mut without = start;
/// let sequence = without.update_present(&seen, &y, y.map(f64::is_finite), &r, &Always)?;
/// assert_eq!(sequence.taken, [true, false, true]);
/// // The same as a sensor of the other two.
/// let pair = LinearMeasurement { matrix: Mat([[1.0, 0.0], [1.0, 1.0]]) };
/// let mut other = start;
/// other.update(&pair, &[1.0, 2.5], &Covariance::from_lower(Mat([[1.0, 0.0], [0.2, 1.5]])))?;
/// assert!((without.mean()[1] - other.mean()[1]).abs() < 1e-14);
/// // Not left out, it is refused as in any update.
/// assert!(without.update_sequentially(&seen, &y, &r).is_err());
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
pub trait Sequential<T: Scalar, const N: usize>: Filter<T, N> + Clone {
    /// Corrects the state with all components of `y`, noise covariance `r`, one after the other.
    #[inline(always)]
    fn update_sequentially<H: Measurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
    ) -> Result<Sequence<T, M>, FilterError> {
        self.update_present(measurement, y, [T::of(0.0).is_finite(); M], r, &Always)
    }

    /// The same with those components alone that are `present`, where the policy takes them.
    ///
    /// What is absent may be anything in `y`, not a number as well; its rows and columns of `r` are not used.
    ///
    /// All that the policy takes is taken, or, with an error, nothing.
    #[inline(always)]
    fn update_present<H: Measurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        present: [bool; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Sequence<T, M>, FilterError> {
        let y: [T; M] = vector!(|i| T::select(present[i], y[i], T::of(0.0)));
        if !finite(&y) {
            return Err(FilterError::NonFiniteMeasurement);
        }
        // An absent component becomes one of its own, uncorrelated with the others, and is then skipped.
        let noise = Ldl::of(&lower!(|i, j| {
            let alone = T::of(if i == j { 1.0 } else { 0.0 });
            T::select(present[i] & present[j], r.get(i, j), alone)
        }));
        if !noise.positive {
            return Err(FilterError::InnovationNotPositive);
        }
        let y = noise.decorrelate(&y);
        let inverse: [[T; M]; M] =
            vector!(|k| noise.decorrelate(&vector!(|i| T::of(if i == k { 1.0 } else { 0.0 }))));

        let before = self.clone();
        let mut sequence = Sequence::none();
        for i in 0..M {
            if !present[i] {
                continue;
            }
            let component = Combination { measurement, weights: vector!(|k| inverse[k][i]) };
            let variance = Covariance::from_variances([noise.diagonal[i]]);
            match self.update_where(&component, &[y[i]], &variance, policy) {
                Ok(innovation) => sequence.add(i, &innovation),
                Err(refused) => {
                    *self = before;
                    return Err(refused);
                }
            }
        }
        Ok(sequence)
    }
}

impl<T: Scalar, F: Filter<T, N> + Clone, const N: usize> Sequential<T, N> for F {}

/// What the components of a measurement said, each against its prediction by those before it.
///
/// For a linear measurement with the vector innovation r of covariance S = L·D·Lᵀ, `residual` is L⁻¹·r and
/// `variance` is D: the residuals are uncorrelated if the filter is right, where those of the vector are not.
/// NIS and log-likelihood are the same. A component that was absent or refused has a residual of zero and a
/// variance of one, and adds nothing.
#[derive(Clone, Copy, Debug)]
pub struct Sequence<T: Scalar, const M: usize> {
    /// Decorrelated measurement minus its prediction.
    pub residual: [T; M],
    /// Its variance if the filter is right.
    pub variance: [T; M],
    /// The sum of residual²/variance: on average the number of components seen if the filter is right.
    pub nis: T,
    /// Where each component corrected the state: neither absent, refused, nor declined by a policy.
    pub taken: [bool; M],
    /// ln p(y | past) of the components seen, in the units of L⁻¹·y, whose volume is that of y.
    pub log_likelihood: T,
}

impl<T: Scalar, const M: usize> Sequence<T, M> {
    fn none() -> Self {
        Self {
            residual: [T::of(0.0); M],
            variance: [T::of(1.0); M],
            nis: T::of(0.0),
            taken: [false; M],
            log_likelihood: T::of(0.0),
        }
    }

    #[inline(always)]
    fn add(&mut self, i: usize, innovation: &Innovation<T, 1>) {
        let seen = innovation.nis.is_finite();
        let zero = T::of(0.0);
        self.residual[i] = T::select(seen, innovation.residual[0], zero);
        self.variance[i] = T::select(seen, innovation.covariance.get(0, 0), T::of(1.0));
        self.nis = self.nis + T::select(seen, innovation.nis, zero);
        self.log_likelihood = self.log_likelihood + T::select(seen, innovation.log_likelihood(), zero);
        self.taken[i] = innovation.taken;
    }
}

/// Σ wₘ·hₘ(x).
struct Combination<'a, H, T, const M: usize> {
    measurement: &'a H,
    weights: [T; M],
}

impl<H, T: Scalar, const M: usize> Combination<'_, H, T, M> {
    /// Sums what has a weight; a component without one may be infinite.
    #[inline(always)]
    fn sum<S: Over<T>>(&self, f: impl Fn(usize) -> S) -> S {
        let mut total = S::of(-0.0);
        for m in 0..M {
            let weight = self.weights[m];
            if weight.gt(T::of(0.0)) | weight.lt(T::of(0.0)) {
                total = total + f(m) * weight;
            }
        }
        total
    }
}

impl<T: Scalar, H: Measurement<T, N, M>, const N: usize, const M: usize> Measurement<T, N, 1>
    for Combination<'_, H, T, M>
{
    #[inline(always)]
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        let y = self.measurement.predict(x);
        [self.sum(|m| y[m])]
    }

    #[inline(always)]
    fn depends(_: usize, j: usize) -> bool {
        (0..M).any(|m| H::depends(m, j))
    }

    #[inline(always)]
    fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
        let (y, h) = self.measurement.linearize(x);
        ([self.sum(|m| y[m])], Mat([vector!(|j| self.sum(|m| h.0[m][j]))]))
    }
}

//! Whether a filter is as good as it says.

use crate::linalg::Ldl;
use crate::notation::{sum, vector};
use crate::{Covariance, Innovation, Scalar};

/// The normalised estimation error squared eᵀ·P⁻¹·e: χ² with N degrees of freedom if the filter is right, N
/// on average.
///
/// Not a number where P is not positive definite. Source: Bar-Shalom, Li & Kirubarajan, *Estimation with
/// Applications to Tracking and Navigation* (2001), section 5.4.2.
///
/// ```
/// use kalmems_core::{Covariance, Mat, consistency::nees};
/// let p = Covariance::from_lower(Mat([[4.0, 0.0], [2.0, 2.0]]));
/// assert_eq!(nees(&[2.0, 1.0], &p), 1.0);
/// ```
#[inline(always)]
pub fn nees<T: Scalar, const N: usize>(error: &[T; N], covariance: &Covariance<T, N>) -> T {
    let ldl = Ldl::of(covariance);
    let weighted = ldl.solve(error);
    T::select(ldl.positive, sum!(N, |i| error[i] * weighted[i]), T::of(f64::NAN))
}

/// The innovations of a whole recording in a few numbers, without keeping them.
///
/// If a filter is right, its innovations have the covariances it states and are uncorrelated in time. Each
/// innovation r with S = L·D·Lᵀ is normalised to z = D^{-1/2}·L⁻¹·r, which should be white with unit
/// variances. Collected are NIS, the products z_k·z_{k−l} of `LAGS` lags, and the log-likelihood.
///
/// The mean of z is known to be zero and is not estimated: an offset counts as correlation, and shows in
/// [`mean`](Self::mean).
///
/// An innovation that a policy declined is counted like any other: it was predicted all the same. One that
/// was refused counts as [missing](Self::miss).
///
/// The quantiles of χ² that make a verdict of these numbers are not here: they need no place on a
/// microcontroller. For a single decision: with n samples of M components the mean NIS lies within M ±
/// 1.96·√(2M/n) in 95 cases of 100 if n is large.
///
/// ```
/// use kalmems_core::consistency::Consistency;
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat};
/// let seen = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let mut filter = Ekf::new([0.0], Covariance::from_variances([3.0]));
/// let mut consistency = Consistency::<f64, 1, 2>::new();
/// for y in [2.0, f64::NAN, -1.0] {
///     match filter.update(&seen, &[y], &Covariance::from_variances([1.0])) {
///         Ok(innovation) => consistency.add(&innovation),
///         Err(_) => consistency.miss(),
///     }
/// }
/// // 2² over 3 + 1; then (−1 − 1.5)² over 0.75 + 1.
/// assert_eq!(consistency.samples(), 2.0);
/// assert!((consistency.mean_nis() - (1.0 + 6.25 / 1.75) / 2.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Consistency<T: Scalar, const M: usize, const LAGS: usize> {
    samples: Total<T>,
    nis: Total<T>,
    log_likelihood: Total<T>,
    sums: [Total<T>; M],
    /// Σ z_k·z_{k−l} for l = 1 … LAGS, and how many products there were.
    products: [Total<T>; LAGS],
    pairs: [Total<T>; LAGS],
    /// The last z, the newest first; zeros where missing.
    past: [[T; M]; LAGS],
    /// One where there was a sample.
    present: [T; LAGS],
}

impl<T: Scalar, const M: usize, const LAGS: usize> Consistency<T, M, LAGS> {
    /// Nothing yet.
    pub fn new() -> Self {
        let zero = T::of(0.0);
        Self {
            samples: Total::none(),
            nis: Total::none(),
            log_likelihood: Total::none(),
            sums: [Total::none(); M],
            products: [Total::none(); LAGS],
            pairs: [Total::none(); LAGS],
            past: [[zero; M]; LAGS],
            present: [zero; LAGS],
        }
    }

    /// Counts the innovation of one sample.
    #[inline(always)]
    pub fn add(&mut self, innovation: &Innovation<T, M>) {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let ldl = Ldl::of(&innovation.covariance);
        let seen = ldl.positive & innovation.nis.is_finite();
        let residual = ldl.decorrelate(&innovation.residual);
        let z: [T; M] = vector!(|i| T::select(seen, residual[i] / ldl.diagonal[i].sqrt(), zero));
        let present = T::select(seen, one, zero);
        self.samples.add(present);
        self.nis.add(T::select(seen, innovation.nis, zero));
        self.log_likelihood.add(T::select(seen, innovation.log_likelihood(), zero));
        for (total, z) in self.sums.iter_mut().zip(&z) {
            total.add(*z);
        }
        for l in 0..LAGS {
            self.products[l].add(sum!(M, |i| z[i] * self.past[l][i]));
            self.pairs[l].add(present * self.present[l]);
        }
        self.shift(&z, present);
    }

    /// Counts a sample without an innovation, so that the lags stay lags in time.
    #[inline(always)]
    pub fn miss(&mut self) {
        self.shift(&[T::of(0.0); M], T::of(0.0));
    }

    #[inline(always)]
    fn shift(&mut self, z: &[T; M], present: T) {
        for l in (1..LAGS).rev() {
            self.past[l] = self.past[l - 1];
            self.present[l] = self.present[l - 1];
        }
        if let (Some(past), Some(last)) = (self.past.first_mut(), self.present.first_mut()) {
            *past = *z;
            *last = present;
        }
    }

    /// n, the samples that had an innovation.
    pub fn samples(&self) -> T {
        self.samples.value()
    }

    /// The mean of NIS: `M` if the filter is right, more if it is overconfident.
    pub fn mean_nis(&self) -> T {
        self.nis.value() / self.samples()
    }

    /// √(2M/n): the standard deviation of the mean NIS if the filter is right.
    ///
    /// n·mean is then χ² with n·M degrees of freedom.
    pub fn mean_nis_deviation(&self) -> T {
        (T::of(2.0 * M as f64) / self.samples()).sqrt()
    }

    /// The mean of z: zero with a standard deviation of 1/√n in each component if the filter is right.
    pub fn mean(&self) -> [T; M] {
        vector!(|i| self.sums[i].value() / self.samples())
    }

    /// The sum of ln p(y_k | past).
    pub fn log_likelihood(&self) -> T {
        self.log_likelihood.value()
    }

    /// The log-likelihood per sample.
    pub fn log_likelihood_per_sample(&self) -> T {
        self.log_likelihood.value() / self.samples()
    }

    /// ρ_l = Σ z_k·z_{k−l} / Σ z_k·z_k for l = 1 … `LAGS`, the components pooled.
    pub fn autocorrelations(&self) -> [T; LAGS] {
        let recip = self.nis.value().recip();
        vector!(|l| self.products[l].value() * recip)
    }

    /// 1.96/√(n·M): 95 of 100 autocorrelations of a white sequence lie within ± this.
    pub fn autocorrelation_band(&self) -> T {
        T::of(1.959_963_984_540_054) / (self.samples() * T::of(M as f64)).sqrt()
    }

    /// The statistic of Ljung and Box (Biometrika 65, 297, 1978): χ² with `LAGS` degrees of freedom if the
    /// innovations are white.
    ///
    /// With one component and none missing Q = n·(n + 2)·Σ ρ_l²/(n − l). Otherwise each ρ_l² is divided by
    /// its variance m_l·M/(nM·(nM + 2)), m_l being the pairs of samples l apart. A lag without any pair adds
    /// nothing, and has no degree of freedom.
    ///
    /// Only correlation of each component with itself is looked for.
    pub fn ljung_box(&self) -> LjungBox<T> {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let numbers = self.samples() * T::of(M as f64);
        let scale = numbers * (numbers + T::of(2.0)) * T::of(M as f64).recip();
        let correlations = self.autocorrelations();
        let mut whiteness = LjungBox { statistic: zero, degrees_of_freedom: zero };
        for l in 0..LAGS {
            let there = self.pairs[l].value().gt(zero);
            let pairs = T::select(there, self.pairs[l].value(), one);
            let term = scale * correlations[l].sq() / pairs;
            whiteness.statistic = whiteness.statistic + T::select(there, term, zero);
            whiteness.degrees_of_freedom = whiteness.degrees_of_freedom + T::select(there, one, zero);
        }
        whiteness
    }
}

impl<T: Scalar, const M: usize, const LAGS: usize> Default for Consistency<T, M, LAGS> {
    fn default() -> Self {
        Self::new()
    }
}

/// A test of whiteness.
#[derive(Clone, Copy, Debug)]
pub struct LjungBox<T> {
    /// Q.
    pub statistic: T,
    /// The degrees of freedom of χ² that Q has if the innovations are white.
    pub degrees_of_freedom: T,
}

/// A sum of two numbers, the second being what does not fit into the first (Dekker, Numerische Mathematik 18,
/// 224, 1971; the first step is Knuth's exact sum).
///
/// A plain sum in `f32` stops growing after 10⁷ samples. One that only adds up what it lost stops soon after,
/// when what was lost has become large itself: here it goes back into the sum at each term.
#[derive(Clone, Copy, Debug)]
struct Total<T> {
    sum: T,
    rest: T,
}

impl<T: Scalar> Total<T> {
    fn none() -> Self {
        Self { sum: T::of(0.0), rest: T::of(0.0) }
    }

    #[inline(always)]
    fn add(&mut self, term: T) {
        let sum = self.sum + term;
        let entered = sum - self.sum;
        let lost = (self.sum - (sum - entered)) + (term - entered);
        let rest = self.rest + lost;
        self.sum = sum + rest;
        self.rest = rest - (self.sum - sum);
    }

    #[inline(always)]
    fn value(&self) -> T {
        self.sum + self.rest
    }
}

//! Several models, weighed by what they predicted.

use crate::notation::{lower, sum, vector};
use crate::{Covariance, Filter, FilterError, Gaussian, NumericMeasurement, NumericProcess, Scalar};

/// `K` filters of one kind with models that differ, weighted by their likelihood: one of them is right, all
/// the time.
///
/// After each measurement the weight of a model is multiplied by the density it gave to that measurement,
/// Bayes' rule (Magill, IEEE Trans. Automatic Control 10, 434, 1965). The weights are kept as logarithms and
/// normalised by their largest, so that a model may be unlikely by any factor without becoming zero.
///
/// If the device can change from one model to another, this is not its model: a weight needs as many samples
/// to come back as it took to fall. A [floor](Self::with_floor) shortens that, and is a departure from Bayes'
/// rule: the weights then say what the recent past prefers.
///
/// ```
/// use kalmems_core::adapt::Bank;
/// use kalmems_core::{Covariance, Ekf, LinearMeasurement, Mat};
/// // A level of 0 or of 1?
/// let certain = |level: f64| Ekf::new([level], Covariance::zero());
/// let mut bank = Bank::<_, f64, 1, 2>::new([certain(0.0), certain(1.0)], [0.5, 0.5]);
/// let seen = [LinearMeasurement { matrix: Mat([[1.0]]) }; 2];
/// bank.update(&seen, &[0.9], &[Covariance::from_variances([0.25]); 2])?;
/// // Odds e^{(0.81 − 0.01)/(2·0.25)} = e^1.6 to one.
/// assert!((bank.weights()[1] - 1.0 / (1.0 + (-1.6_f64).exp())).abs() < 1e-15);
/// let mixture = bank.mixture();
/// assert!((mixture.covariance.get(0, 0) - bank.weights()[0] * bank.weights()[1]).abs() < 1e-15);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bank<F, T, const N: usize, const K: usize> {
    filters: [F; K],
    log_weights: [T; K],
    floor: Option<T>,
}

/// What a measurement said to the whole bank.
#[derive(Clone, Copy, Debug)]
pub struct BankEvidence<T: Scalar> {
    /// ln Σ weight·p(y | past, model).
    pub log_likelihood: T,
    /// Where all models took the measurement; elsewhere the weights are as before.
    pub taken: bool,
}

impl<T: Scalar, F: Filter<T, N> + Clone, const N: usize, const K: usize> Bank<F, T, N, K> {
    /// Starts from filters, each with its own mean and covariance, and the weights that the models have
    /// before any data. They need not add up to one; none may be negative, and one must be positive.
    pub fn new(filters: [F; K], prior: [T; K]) -> Self {
        let mut bank = Self { filters, log_weights: prior.map(Scalar::ln), floor: None };
        bank.log_weights = normalized(&bank.log_weights).0;
        bank
    }

    /// The same, with no weight below `floor`, which must be below 1/K.
    #[must_use]
    pub fn with_floor(self, floor: T) -> Self {
        Self { floor: Some(floor), ..self }
    }

    /// Moves all models by one step, each with its own process. An error leaves all of them as they were.
    #[inline(always)]
    pub fn predict<P: NumericProcess<T, N>>(
        &mut self,
        processes: &[P; K],
        u: &P::Input,
    ) -> Result<(), FilterError> {
        let mut next = self.filters.clone();
        for (filter, process) in next.iter_mut().zip(processes) {
            filter.predict(process, u)?;
        }
        self.filters = next;
        Ok(())
    }

    /// Corrects all models, each with its own sensor and noise, and weighs them. An error leaves all as it
    /// was.
    #[inline(always)]
    pub fn update<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurements: &[H; K],
        y: &[T; M],
        r: &[Covariance<T, M>; K],
    ) -> Result<BankEvidence<T>, FilterError> {
        let mut next = self.filters.clone();
        let mut taken = true;
        let mut log_weights = self.log_weights;
        for (((filter, measurement), r), log_weight) in
            next.iter_mut().zip(measurements).zip(r).zip(&mut log_weights)
        {
            let innovation = filter.update(measurement, y, r)?;
            *log_weight = *log_weight + innovation.log_likelihood();
            taken &= innovation.taken;
        }
        self.filters = next;
        let (mut log_weights, log_likelihood) = normalized(&log_weights);
        if let Some(floor) = self.floor {
            let least = floor.ln();
            log_weights = normalized(&log_weights.map(|l| T::select(l.lt(least), least, l))).0;
        }
        self.log_weights = vector!(|k| T::select(taken, log_weights[k], self.log_weights[k]));
        Ok(BankEvidence { log_likelihood, taken })
    }

    /// The filters, in the order given.
    pub const fn filters(&self) -> &[F; K] {
        &self.filters
    }

    /// The probability of each model.
    pub fn weights(&self) -> [T; K] {
        self.log_weights.map(Scalar::exp)
    }

    /// Its logarithm.
    pub const fn log_weights(&self) -> &[T; K] {
        &self.log_weights
    }

    /// Mean and covariance over all models: Σ w·x, and Σ w·(P + (x − x̄)(x − x̄)ᵀ), their spread included.
    pub fn mixture(&self) -> Gaussian<T, N> {
        let weights = self.weights();
        let mut mean = [T::of(0.0); N];
        for (filter, weight) in self.filters.iter().zip(weights) {
            mean = vector!(|i| mean[i] + filter.mean()[i] * weight);
        }
        let mut covariance = Covariance::zero();
        for (filter, weight) in self.filters.iter().zip(weights) {
            let (x, p) = (filter.mean(), filter.covariance());
            covariance = covariance
                .plus(&lower!(|i, j| { (p.get(i, j) + (x[i] - mean[i]) * (x[j] - mean[j])) * weight }));
        }
        Gaussian { mean, covariance }
    }
}

/// Logarithms of weights that add up to one, and the logarithm of what they added up to.
#[inline(always)]
fn normalized<T: Scalar, const K: usize>(log_weights: &[T; K]) -> ([T; K], T) {
    let mut largest = T::of(f64::NEG_INFINITY);
    for l in log_weights {
        largest = T::select(l.gt(largest), *l, largest);
    }
    let total = largest + sum!(K, |k| (log_weights[k] - largest).exp()).ln();
    (log_weights.map(|l| l - total), total)
}

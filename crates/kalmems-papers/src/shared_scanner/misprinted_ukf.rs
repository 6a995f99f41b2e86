//! The unscented Kalman filter as it was printed.

use kalmems_core::update::Policy;
use kalmems_core::{
    Cholesky, Covariance, Ekf, Filter, FilterError, Innovation, Ldl, Mat, Measurement, NumericMeasurement,
    NumericProcess, Over, SigmaPoints, StateTransition,
};

/// What Algorithm 2 of Chen et al., shared electrodes, 2020, prints in place of the filter; one at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misprint {
    /// Weights for L = 1 + 2·n in place of n states: they do not add up to 1.
    Weights,
    /// The measurement noise R, a number, added to every entry of the cross covariance P_xy.
    CrossCovariance,
    /// P = P⁻ + K·P_y·Kᵀ in place of P⁻ − K·P_y·Kᵀ.
    Covariance,
}

/// An unscented Kalman filter with one misprint, and otherwise as the [`Ukf`](kalmems_core::Ukf) of the core.
///
/// It is here to show what the printed equations do, and is no filter to use. Of several measurements at once the
/// variance of the first is what the misprint of the cross covariance adds.
#[derive(Clone, Copy, Debug)]
pub struct MisprintedUkf<const N: usize> {
    mean: [f64; N],
    covariance: Covariance<f64, N>,
    /// √(L + λ), the weight of the centre in the mean, its addition in a covariance, and the weight of the others.
    spread: f64,
    centre: f64,
    more: f64,
    outer: f64,
    misprint: Misprint,
}

impl<const N: usize> MisprintedUkf<N> {
    /// Starts from a mean and its covariance.
    pub fn new(
        mean: [f64; N],
        covariance: Covariance<f64, N>,
        points: SigmaPoints<f64>,
        misprint: Misprint,
    ) -> Self {
        let states = if misprint == Misprint::Weights { 1 + 2 * N } else { N };
        let total = points.alpha.powi(2) * (states as f64 + points.kappa);
        Self {
            mean,
            covariance,
            spread: total.sqrt(),
            centre: 1.0 - states as f64 / total,
            more: 1.0 - points.alpha.powi(2) + points.beta,
            outer: 0.5 / total,
            misprint,
        }
    }

    /// The points around the mean, the centre first.
    fn points(&self) -> Result<Vec<[f64; N]>, FilterError> {
        let cholesky = Cholesky::of(&self.covariance);
        if !cholesky.positive {
            return Err(FilterError::CovarianceNotPositive);
        }
        let column = |j: usize, sign: f64| {
            let factor = &cholesky.factor;
            std::array::from_fn(|i| {
                self.mean[i] + sign * self.spread * if i >= j { factor[(i, j)] } else { 0.0 }
            })
        };
        let pairs = (0..N).flat_map(|j| [column(j, 1.0), column(j, -1.0)]);
        Ok([self.mean].into_iter().chain(pairs).collect())
    }

    fn mean_of<const K: usize>(&self, points: &[[f64; K]]) -> [f64; K] {
        std::array::from_fn(|i| points.iter().enumerate().map(|(p, x)| self.weight(p, 0.0) * x[i]).sum())
    }

    /// The weight of a point, with an addition for the centre.
    fn weight(&self, point: usize, more: f64) -> f64 {
        if point == 0 { self.centre + more } else { self.outer }
    }

    /// Σ w·(a − ā)(b − b̄)ᵀ.
    fn moment<const A: usize, const B: usize>(
        &self,
        (a, a_mean): (&[[f64; A]], &[f64; A]),
        (b, b_mean): (&[[f64; B]], &[f64; B]),
    ) -> Mat<f64, A, B> {
        Mat::from_fn(|i, j| {
            let products = a.iter().zip(b).enumerate();
            products
                .map(|(p, (a, b))| self.weight(p, self.more) * (a[i] - a_mean[i]) * (b[j] - b_mean[j]))
                .sum()
        })
    }
}

impl<const N: usize> Filter<f64, N> for MisprintedUkf<N> {
    fn mean(&self) -> &[f64; N] {
        &self.mean
    }

    fn covariance(&self) -> Covariance<f64, N> {
        self.covariance
    }

    fn predict_linked<P: NumericProcess<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<f64, N>, FilterError> {
        let moved: Vec<[f64; N]> = self.points()?.iter().map(|x| process.moved(x, u)).collect();
        let mean = self.mean_of(&moved);
        let spread = Covariance::from_lower(self.moment((&moved, &mean), (&moved, &mean)));
        let covariance = spread.plus(process.noise_added().covariance());
        if !mean.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NonFiniteState);
        }
        let (_, transition) = process.linearized(&self.mean, u);
        (self.mean, self.covariance) = (mean, covariance);
        Ok(StateTransition { transition, noise: *process.noise_added().covariance() })
    }

    fn update_where<H: NumericMeasurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        policy: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        let points = self.points()?;
        let seen: Vec<[f64; M]> = points.iter().map(|x| measurement.expected(x)).collect();
        let predicted = self.mean_of(&seen);
        let s = Covariance::from_lower(self.moment((&seen, &predicted), (&seen, &predicted))).plus(r);
        // The innovation as a filter says it that knows its state exactly and takes S for the noise.
        let certain = &mut Ekf::new(self.mean, Covariance::zero());
        let innovation = certain.update_where(&Constant(predicted), y, &s, policy)?;
        if !innovation.taken {
            return Ok(innovation);
        }
        let mut cross: Mat<f64, N, M> = self.moment((&points, &self.mean), (&seen, &predicted));
        if self.misprint == Misprint::CrossCovariance {
            cross = Mat::from_fn(|i, j| cross[(i, j)] + r.get(0, 0));
        }
        let ldl = Ldl::of(&s);
        let gain: Mat<f64, N, M> = Mat(cross.0.map(|row| ldl.solve(&row)));
        let change = gain.times_vector(&innovation.residual);
        let sign = if self.misprint == Misprint::Covariance { 1.0 } else { -1.0 };
        let explained = s.transformed(&gain);
        let covariance = Mat::from_fn(|i, j| self.covariance.get(i, j) + sign * explained.get(i, j));
        self.mean = std::array::from_fn(|i| self.mean[i] + change[i]);
        self.covariance = Covariance::from_lower(covariance);
        Ok(innovation)
    }
}

/// A measurement that says the same whatever the state is.
struct Constant<const M: usize>([f64; M]);

impl<const N: usize, const M: usize> Measurement<f64, N, M> for Constant<M> {
    fn predict<S: Over<f64>>(&self, _: &[S; N]) -> [S; M] {
        self.0.map(S::lift)
    }

    fn depends(_: usize, _: usize) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kalmems_core::{LinearMeasurement, LinearProcess};

    /// On a linear system with one misprint taken out the filter is the Kalman filter; each misprint by hand.
    #[test]
    fn each_misprint_is_what_was_printed() {
        let still = LinearProcess::<f64, 1, 0> {
            transition: Mat([[2.0]]),
            input: Mat::zero(),
            noise: Covariance::from_variances([1.0]).into(),
        };
        let level = LinearMeasurement { matrix: Mat([[1.0]]) };
        let r = Covariance::from_variances([0.5]);
        let run = |misprint| {
            let mut filter = MisprintedUkf::new(
                [3.0],
                Covariance::from_variances([1.0]),
                SigmaPoints::standard(),
                misprint,
            );
            filter.predict(&still, &[]).unwrap();
            let predicted = (filter.mean[0], filter.covariance.get(0, 0));
            filter.update(&level, &[7.0], &r).unwrap();
            (predicted, filter.mean[0], filter.covariance.get(0, 0))
        };
        // P⁻ = 4 + 1, S = 5.5: K = 5/5.5, x = 6 + K; P = 5 + 25/5.5.
        let (predicted, mean, variance) = run(Misprint::Covariance);
        assert!((predicted.0 - 6.0).abs() < 1e-12 && (predicted.1 - 5.0).abs() < 1e-12);
        assert!((mean - 6.0 - 5.0 / 5.5).abs() < 1e-12 && (variance - 5.0 - 25.0 / 5.5).abs() < 1e-12);
        // K = (5 + 0.5)/5.5 = 1, P = 5 − 5.5 < 0.
        let (_, mean, variance) = run(Misprint::CrossCovariance);
        assert!((mean - 7.0).abs() < 1e-12 && (variance + 0.5).abs() < 1e-12);
        // L = 3, L + λ = 4: weights ¼ for the centre and ⅛ for each of the two others, so half of the mean is left.
        let (predicted, ..) = run(Misprint::Weights);
        assert!((predicted.0 - 3.0).abs() < 1e-12);
    }
}

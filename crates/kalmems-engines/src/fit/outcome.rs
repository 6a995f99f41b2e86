//! What a fit says.

use super::FitSettings;
use super::levenberg::Linearized;
use kalmems_core::{Covariance, Dual, Mat, Svd};

/// Parameters, and how well they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit<const P: usize> {
    /// The parameters at the minimum.
    pub parameters: [f64; P],
    /// Their covariance s²·(Jᵀ·J)⁻¹ with s² = sum of squares / degrees of freedom. Zero for parameters that were
    /// held; infinite for those that the data do not determine.
    pub covariance: Covariance<f64, P>,
    /// The sum of squared residuals.
    pub sum_of_squares: f64,
    /// Residuals less free parameters.
    pub degrees_of_freedom: usize,
    /// Combinations of parameters that the data say nothing of.
    pub undetermined: Vec<ParameterDirection<P>>,
    /// The combination that the data say least of, of those they say something of.
    pub weakest: Option<ParameterDirection<P>>,
    /// Parameters that stand at a bound: their minimum lies beyond it.
    pub at_bound: [bool; P],
    /// Jacobians computed.
    pub iterations: usize,
}

/// A direction in the space of parameters, each scaled by the length of its column of J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterDirection<const P: usize> {
    /// Its part along each parameter: the squares sum to one.
    pub parts: [f64; P],
    /// Its singular value relative to the largest; 1/this is how much worse it is known than the best direction.
    pub relative: f64,
}

/// A number computed from the parameters, with its standard deviation to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DerivedNumber {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// A singular value below this, relative to the largest, is rounding.
const ROUNDING: f64 = 1e-13;

impl<const P: usize> Fit<P> {
    pub(super) fn new(x: [f64; P], at: &Linearized<P>, settings: &FitSettings<P>, iterations: usize) -> Self {
        let free = settings.free.iter().filter(|f| **f).count();
        let degrees_of_freedom = at.count - free;
        let variance = at.cost / degrees_of_freedom.max(1) as f64;

        let norms = at.triangle.column_norms().map(|norm| if norm == 0.0 { 1.0 } else { norm });
        let svd = Svd::of(&Mat::<f64, P, P>::from_fn(|i, j| at.triangle.r[i][j] / norms[j]));
        let direction = |k: usize| ParameterDirection {
            parts: std::array::from_fn(|i| svd.right.0[i][k]),
            relative: svd.values[k] / svd.values[0].max(f64::MIN_POSITIVE),
        };
        // Held parameters have columns of zeros, and with them the last directions, one each.
        let (determined, undetermined): (Vec<_>, Vec<_>) = (0..P)
            .map(|k| (svd.values[k], direction(k)))
            .filter(|(_, d)| (0..P).any(|i| settings.free[i] && d.parts[i].abs() > 1e-8))
            .partition(|(_, d)| d.relative > ROUNDING);
        let undetermined: Vec<_> = undetermined.into_iter().map(|(_, d)| d).collect();
        let lost = |i: usize| undetermined.iter().any(|d| d.parts[i].abs() > 1e-8);
        let covariance = Mat::from_fn(|i, j| {
            if lost(i) || lost(j) {
                return if i == j { f64::INFINITY } else { f64::NAN };
            }
            let sum: f64 =
                determined.iter().map(|(value, d)| d.parts[i] * d.parts[j] / (value * value)).sum();
            if settings.free[i] && settings.free[j] { variance * sum / (norms[i] * norms[j]) } else { 0.0 }
        });
        Self {
            parameters: x,
            covariance: Covariance::from_lower(covariance),
            sum_of_squares: at.cost,
            degrees_of_freedom,
            weakest: determined.last().map(|(_, d)| *d),
            undetermined,
            at_bound: std::array::from_fn(|i| {
                settings.free[i] && (x[i] <= settings.bounds[i].low || x[i] >= settings.bounds[i].high)
            }),
            iterations,
        }
    }

    /// The standard deviation of one residual, √(sum of squares / degrees of freedom).
    pub fn residual_deviation(&self) -> f64 {
        (self.sum_of_squares / self.degrees_of_freedom.max(1) as f64).sqrt()
    }

    /// One parameter.
    pub fn parameter(&self, index: usize) -> DerivedNumber {
        DerivedNumber { value: self.parameters[index], deviation: self.covariance.standard_deviation(index) }
    }

    /// A function of the parameters, its standard deviation propagated to first order.
    pub fn derived(&self, f: impl FnOnce(&[Dual<f64, P>; P]) -> Dual<f64, P>) -> DerivedNumber {
        let y = f(&Dual::variables(&self.parameters));
        let gradient = y.gradient();
        let mut variance = 0.0;
        for i in 0..P {
            for j in 0..P {
                // What does not enter is not asked how well it is known.
                if gradient[i] != 0.0 && gradient[j] != 0.0 {
                    variance += gradient[i] * self.covariance.get(i, j) * gradient[j];
                }
            }
        }
        DerivedNumber {
            value: y.value(),
            deviation: if variance.is_nan() { f64::INFINITY } else { variance.sqrt() },
        }
    }
}

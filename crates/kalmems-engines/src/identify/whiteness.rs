//! Whether what a fit leaves is noise without a memory.

use kalmems_core::consistency::Consistency;
use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Samples back that the test looks.
const LAGS: usize = 20;

/// The whiteness of residuals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Whiteness {
    /// Residuals that were there.
    pub samples: usize,
    /// The correlation of neighbours.
    pub neighbours: f64,
    /// The statistic of Durbin and Watson (Biometrika 37, 409, 1950), from its relation to the correlation of
    /// neighbours: 2 of white residuals, 0 of slow ones, 4 of alternating ones.
    pub durbin_watson: f64,
    /// How probable a statistic of Ljung and Box over 20 lags as large as this is for white residuals.
    pub probability: f64,
    /// That statistic and its degrees of freedom.
    #[serde(skip)]
    ljung_box: [f64; 2],
}

impl Whiteness {
    /// Tests residuals; those that are not finite are left out, and lags stay lags in time.
    pub fn of(residuals: &[f64]) -> Self {
        let finite = || residuals.iter().filter(|r| r.is_finite());
        let count = finite().count();
        let deviation = (finite().map(|r| r * r).sum::<f64>() / count.max(1) as f64).sqrt();
        // The innovations of a filter that knows its state to be 0 are the residuals.
        let sees_nothing = LinearMeasurement { matrix: Mat([[0.0]]) };
        let mut filter = Ekf::new([0.0], Covariance::from_variances([0.0]));
        let mut consistency = Consistency::<f64, 1, LAGS>::new();
        for residual in residuals {
            match filter.update(&sees_nothing, &[residual / deviation], &Covariance::from_variances([1.0])) {
                Ok(innovation) => consistency.add(&innovation),
                Err(_) => consistency.miss(),
            }
        }
        let test = consistency.ljung_box();
        Self::told(count, consistency.autocorrelations()[0], [test.statistic, test.degrees_of_freedom])
    }

    fn told(samples: usize, neighbours: f64, ljung_box: [f64; 2]) -> Self {
        let probability = ChiSquared::new(ljung_box[1]).map_or(f64::NAN, |chi| 1.0 - chi.cdf(ljung_box[0]));
        Self { samples, neighbours, durbin_watson: 2.0 * (1.0 - neighbours), probability, ljung_box }
    }

    /// Of several stretches of a record together: the sum of their statistics is χ² with the sum of their degrees of
    /// freedom, since what one leaves says nothing of another where they are white.
    pub fn of_stretches(all: &[Self]) -> Self {
        let samples = all.iter().map(|w| w.samples).sum::<usize>();
        let weighted: f64 = all.iter().map(|w| w.samples as f64 * w.neighbours).sum();
        let sum = |i: usize| all.iter().map(|w| w.ljung_box[i]).sum();
        Self::told(samples, weighted / samples as f64, [sum(0), sum(1)])
    }

    /// Whether white residuals would look like this more often than once in a thousand times.
    pub fn is_white(&self) -> bool {
        self.probability > 1e-3
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    #[test]
    fn noise_is_white_and_a_memory_is_not() {
        let mut noise = WhiteNoise::new(3, 0);
        let white: Vec<f64> = (0..5000).map(|_| 1e-3 * noise.sample()).collect();
        let found = Whiteness::of(&white);
        assert!(found.is_white() && (found.durbin_watson - 2.0).abs() < 0.1, "{found:?}");
        let mut last = 0.0;
        let slow: Vec<f64> = white
            .iter()
            .map(|w| {
                last = 0.5 * last + w;
                last
            })
            .collect();
        let found = Whiteness::of(&slow);
        assert!(!found.is_white() && (found.neighbours - 0.5).abs() < 0.05, "{found:?}");
        // A gap does not make neighbours of what is none.
        let gappy: Vec<f64> = slow.iter().flat_map(|r| [*r, f64::NAN, f64::NAN]).collect();
        assert!(Whiteness::of(&gappy).neighbours.abs() < 1e-12);
    }
}

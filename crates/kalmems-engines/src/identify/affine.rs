//! A line through points whose noise may have a memory.

use super::Whiteness;
use crate::fit::DerivedNumber;
use kalmems_core::Portable;
use kalmems_core::{Covariance, Mat};

/// y = slope·x + intercept by least squares, with what its noise makes of it.
#[derive(Clone, Debug, PartialEq)]
pub struct AffineFit {
    /// In units of y per unit of x.
    pub slope: f64,
    /// In units of y.
    pub intercept: f64,
    /// The covariance of slope and intercept for the noise as it is: that of white noise where the residuals are
    /// white, else that of Newey and West.
    pub covariance: Covariance<f64, 2>,
    /// The standard deviation of one residual.
    pub residual_deviation: f64,
    /// What the residuals look like.
    pub whiteness: Whiteness,
    /// Measured less fitted; not a number where one of the two is missing.
    pub residuals: Vec<f64>,
}

impl AffineFit {
    /// The slope with its standard deviation.
    pub fn slope(&self) -> DerivedNumber {
        DerivedNumber { value: self.slope, deviation: self.covariance.standard_deviation(0) }
    }

    /// The value of the line at `x` with its standard deviation.
    pub fn at(&self, x: f64) -> DerivedNumber {
        let c = &self.covariance;
        let variance = x * x * c.get(0, 0) + 2.0 * x * c.get(0, 1) + c.get(1, 1);
        DerivedNumber { value: self.slope * x + self.intercept, deviation: variance.sqrt() }
    }
}

/// The line through points in the order of their times; those that are not finite are passed over. `None` of fewer
/// than three points, or where x does not vary.
///
/// Where the residuals are not white, s²·(XᵀX)⁻¹ claims too much, or too little. The covariance is then
/// (XᵀX)⁻¹·S·(XᵀX)⁻¹ with S = Σ_l w_l·Σ_k g_k·g_{k−l}ᵀ, g_k = (x_k, 1)·r_k, and weights that fall linearly to zero
/// (Newey and West, Econometrica 55, 703, 1987) over Andrews' bandwidth for the correlation of neighbours
/// 1.1447·(4ρ²·n/(1 − ρ²)²)^{1/3} (Econometrica 59, 817, 1991).
pub fn fit_affine(x: &[f64], y: &[f64]) -> Option<AffineFit> {
    let seen = || x.iter().zip(y).filter(|(x, y)| x.is_finite() && y.is_finite());
    let count = seen().count();
    if count < 3 {
        return None;
    }
    let n = count as f64;
    // From the means, so that a large mean of x costs no digits.
    let (mean_x, mean_y) = (seen().map(|(x, _)| x).sum::<f64>() / n, seen().map(|(_, y)| y).sum::<f64>() / n);
    let spread: f64 = seen().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let slope = seen().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / spread;
    if !(slope.is_finite() && spread > 0.0) {
        return None;
    }
    let residuals: Vec<f64> = x.iter().zip(y).map(|(x, y)| y - mean_y - slope * (x - mean_x)).collect();
    let sum: f64 = residuals.iter().filter(|r| r.is_finite()).map(|r| r * r).sum();
    let variance = sum / (n - 2.0);
    let whiteness = Whiteness::of(&residuals);
    // Of slope and mean: they are uncorrelated where the noise is white.
    let inverse = [1.0 / spread, 1.0 / n];
    let centred = if whiteness.is_white() {
        Mat([[variance * inverse[0], 0.0], [0.0, variance * inverse[1]]])
    } else {
        let rows: Vec<[f64; 2]> = x
            .iter()
            .zip(&residuals)
            .map(|(x, r)| if r.is_finite() { [(x - mean_x) * r, *r] } else { [0.0; 2] })
            .collect();
        let meat = newey_west(&rows, bandwidth(whiteness.neighbours, n));
        Mat::from_fn(|i, j| inverse[i] * meat.0[i][j] * inverse[j])
    };
    // intercept = mean − slope·mean_x.
    let [[ss, sm], [_, mm]] = centred.0;
    let covariance = Covariance::from_lower(Mat([
        [ss, 0.0],
        [sm - mean_x * ss, mm - 2.0 * mean_x * sm + mean_x * mean_x * ss],
    ]));
    Some(AffineFit {
        slope,
        intercept: mean_y - slope * mean_x,
        covariance,
        residual_deviation: variance.sqrt(),
        whiteness,
        residuals,
    })
}

/// Andrews' bandwidth for noise of which neighbours have this correlation.
fn bandwidth(neighbours: f64, n: f64) -> usize {
    let rho = neighbours.clamp(-0.97, 0.97);
    let alpha = 4.0 * rho * rho / (1.0 - rho * rho).powi(2);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most the number of samples
    let lags = (1.1447 * (alpha * n).portable_cbrt()).ceil().min(n - 1.0) as usize;
    lags
}

fn newey_west(rows: &[[f64; 2]], lags: usize) -> Mat<f64, 2, 2> {
    let mut sum = Mat::zero();
    for lag in 0..=lags {
        let weight = 1.0 - lag as f64 / (lags + 1) as f64;
        for (now, before) in rows.iter().skip(lag).zip(rows) {
            for i in 0..2 {
                for j in 0..2 {
                    let both =
                        if lag == 0 { now[i] * before[j] } else { now[i] * before[j] + before[i] * now[j] };
                    sum.0[i][j] += weight * both;
                }
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use approx::assert_relative_eq;

    #[test]
    fn four_points_by_hand() {
        // Σ(x − x̄)² = 5, slope 1.9, residuals 0.3, −0.6, 0.3, 0 (Σ 0.54).
        let fit = fit_affine(&[0.0, 1.0, f64::NAN, 2.0, 3.0], &[1.0, 2.0, 7.0, 4.8, 6.4]).unwrap();
        assert_relative_eq!(fit.slope, 1.9, max_relative = 1e-14);
        assert_relative_eq!(fit.intercept, 0.7, max_relative = 1e-13);
        assert_relative_eq!(fit.residual_deviation, (0.54_f64 / 2.0).sqrt(), max_relative = 1e-13);
        assert_relative_eq!(fit.slope().deviation, (0.27_f64 / 5.0).sqrt(), max_relative = 1e-13);
        assert_relative_eq!(
            fit.at(0.0).deviation,
            (0.27 * (0.25 + 2.25 / 5.0_f64)).sqrt(),
            max_relative = 1e-13
        );
        assert_relative_eq!(fit.at(1.5).deviation, (0.27_f64 / 4.0).sqrt(), max_relative = 1e-13);
        assert!(fit.residuals[2].is_nan());
    }

    #[test]
    fn nothing_is_no_line() {
        assert!(fit_affine(&[], &[]).is_none());
        assert!(fit_affine(&[2.0; 10], &[1.0; 10]).is_none());
        assert!(fit_affine(&[1.0, 2.0, f64::NAN], &[1.0, 2.0, 3.0]).is_none());
    }

    /// White noise and noise with a memory of 0.8, over 400 records each: the errors are as large as claimed. The
    /// spread of 400 normalised errors is 1 within 4·0.035. Bartlett's weights leave a little out.
    #[test]
    fn errors_are_as_large_as_claimed_whatever_the_memory() {
        for memory in [0.0, 0.8] {
            let mut squares = [0.0; 2];
            for seed in 0..400 {
                let mut noise = WhiteNoise::new(seed, 5);
                let mut r = 0.0;
                let x: Vec<f64> = (0..1500).map(|k| 3.0 + (0.02 * f64::from(k)).sin()).collect();
                let y: Vec<f64> = x
                    .iter()
                    .map(|x| {
                        r = memory * r + noise.sample();
                        0.5 * x - 1.0 + r
                    })
                    .collect();
                let fit = fit_affine(&x, &y).unwrap();
                squares[0] += ((fit.slope - 0.5) / fit.slope().deviation).powi(2);
                squares[1] += ((fit.at(3.0).value - 0.5) / fit.at(3.0).deviation).powi(2);
            }
            for square in squares {
                let ratio = (square / 400.0).sqrt();
                println!("memory {memory}: errors {ratio:.3} of the claimed");
                assert!((0.86..1.2).contains(&ratio), "memory {memory}: {ratio}");
            }
        }
    }
}

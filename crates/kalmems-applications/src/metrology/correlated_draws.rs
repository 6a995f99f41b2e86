//! Drawing inputs from their distributions.

use super::input::{Distribution, Input};
use crate::config::cholesky;
use crate::simulate::WhiteNoise;
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// As many normal numbers, correlated as a budget says of its inputs' places.
pub fn correlated_normals(
    correlations: &[(usize, usize, f64)],
    count: usize,
    noise: &mut WhiteNoise,
) -> Vec<f64> {
    let own: Vec<f64> = (0..count).map(|_| noise.sample()).collect();
    if correlations.is_empty() {
        return own;
    }
    let mut matrix = vec![vec![0.0; count]; count];
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for (i, j, correlation) in correlations {
        if *i < count && *j < count {
            (matrix[*i][*j], matrix[*j][*i]) = (*correlation, *correlation);
        }
    }
    // A file with correlations that no errors have is refused before.
    let Some(lower) = cholesky(&matrix) else { return own };
    lower.iter().map(|row| row.iter().zip(&own).map(|(l, x)| l * x).sum()).collect()
}

/// The error of an input for a normal number: in units of the input, as its distribution and degrees of freedom have it.
///
/// With finite degrees of freedom the normal distribution becomes t: N·u/√(χ²_ν/ν), as JCGM 101, 6.4.9, has it for what is known from
/// repeated readings or a certificate.
pub fn shared_error(input: &Input, normal: f64, noise: &mut WhiteNoise) -> f64 {
    let u = input.standard_uncertainty;
    match input.distribution {
        Distribution::Normal => u * normal / chi_by_freedom(input.degrees_of_freedom, noise),
        Distribution::Rectangular => u * 3.0_f64.sqrt() * (2.0 * part_below(normal) - 1.0),
        Distribution::Triangular => {
            let part = part_below(normal);
            let limit = u * 6.0_f64.sqrt();
            if part < 0.5 {
                limit * ((2.0 * part).sqrt() - 1.0)
            } else {
                limit * (1.0 - (2.0 * (1.0 - part)).sqrt())
            }
        }
        Distribution::Arcsine => {
            u * std::f64::consts::SQRT_2 * Scalar::sin(0.5 * TAU * (part_below(normal) - 0.5))
        }
    }
}

/// The part of a normal distribution below this number.
fn part_below(normal: f64) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    Normal::standard().cdf(normal)
}

/// √(χ²_ν/ν); 1 of infinitely many degrees of freedom.
pub fn chi_by_freedom(freedom: f64, noise: &mut WhiteNoise) -> f64 {
    if !freedom.is_finite() || freedom > 1e6 {
        return 1.0;
    }
    // χ²_ν is twice a gamma variable of ν/2 (Marsaglia and Tsang, ACM Transactions on Mathematical Software 26, 363, 2000).
    let shape = 0.5 * freedom;
    let (boosted, boost): (f64, f64) = if shape < 1.0 {
        (shape + 1.0, Scalar::exp(Scalar::ln(1.0 - noise.uniform()) / shape))
    } else {
        (shape, 1.0)
    };
    let d = boosted - 1.0 / 3.0;
    let c: f64 = (9.0 * d).sqrt().recip();
    loop {
        let x = noise.sample();
        let v: f64 = (1.0 + c * x).powi(3);
        if v > 0.0 && Scalar::ln(1.0 - noise.uniform()) < 0.5 * x * x + d - d * v + d * Scalar::ln(v) {
            return (2.0 * d * v * boost / freedom).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Evaluation;
    use super::*;

    const DRAWS: u32 = 200_000;

    fn input(distribution: Distribution, degrees_of_freedom: f64) -> Input {
        Input {
            name: "x".to_owned(),
            unit: "1",
            value: 0.0,
            standard_uncertainty: 2.0,
            distribution,
            degrees_of_freedom,
            evaluation: Evaluation::B,
            source: String::new(),
            sensitivity: 1.0,
        }
    }

    /// Variance and fourth moment of each distribution by their closed forms: kurtosis 3, 9/5, 12/5, 3/2, and of t with 10 degrees of
    /// freedom the variance 10/8.
    #[test]
    fn what_is_drawn_has_the_moments_of_its_distribution() {
        let cases = [
            (Distribution::Normal, f64::INFINITY, 1.0, 3.0),
            (Distribution::Rectangular, f64::INFINITY, 1.0, 1.8),
            (Distribution::Triangular, f64::INFINITY, 1.0, 2.4),
            (Distribution::Arcsine, f64::INFINITY, 1.0, 1.5),
            (Distribution::Normal, 10.0, 1.25, 4.0),
        ];
        let mut noise = WhiteNoise::new(5, 0);
        for (distribution, freedom, variance, kurtosis) in cases {
            let input = input(distribution, freedom);
            let (mut second, mut fourth) = (0.0, 0.0);
            for _ in 0..DRAWS {
                let normal = noise.sample();
                let square = (shared_error(&input, normal, &mut noise) / 2.0).powi(2);
                second += square / f64::from(DRAWS);
                fourth += square * square / f64::from(DRAWS);
            }
            assert!((second / variance - 1.0).abs() < 0.015, "{distribution:?} {freedom}: {second}");
            assert!((fourth / second.powi(2) / kurtosis - 1.0).abs() < 0.06, "{distribution:?}: {fourth}");
        }
    }

    #[test]
    fn correlated_errors_have_their_correlation() {
        let mut noise = WhiteNoise::new(6, 0);
        let mut sum = 0.0;
        for _ in 0..50_000 {
            let both = correlated_normals(&[(0, 2, -0.6)], 3, &mut noise);
            sum += both[0] * both[2] / 50_000.0;
        }
        assert!((sum + 0.6).abs() < 0.02, "{sum}");
    }
}

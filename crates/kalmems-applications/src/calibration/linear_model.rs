//! Values as sums of known terms, and which residuals of a fit stand out.

use crate::fit::{Fit, FitError, FitSettings, Regression, fit};
use crate::metrology::coverage_factor;

/// Values y_k = Σ x_kj·p_j.
pub(super) struct LinearModel<'a, const P: usize> {
    pub terms: &'a [[f64; P]],
    pub values: &'a [f64],
}

impl<const P: usize> Regression<P> for LinearModel<'_, P> {
    fn residuals(&self, parameters: &[f64; P], each: &mut impl FnMut(f64)) {
        for (terms, value) in self.terms.iter().zip(self.values) {
            each(terms.iter().zip(parameters).map(|(x, p)| x * p).sum::<f64>() - value);
        }
    }

    fn linearize(&self, parameters: &[f64; P], each: &mut impl FnMut(f64, &[f64; P])) {
        let mut terms = self.terms.iter();
        self.residuals(parameters, &mut |residual| {
            each(residual, terms.next().unwrap_or(&[0.0; P]));
        });
    }
}

impl<const P: usize> LinearModel<'_, P> {
    /// The fit by least squares, in which only some parameters are free.
    pub fn fit(&self, free: [bool; P]) -> Result<Fit<P>, FitError> {
        fit(self, &FitSettings { free, ..FitSettings::from_start([0.0; P]) })
    }
}

/// What a fit leaves, in words.
pub(super) fn residuals_left<const P: usize>(found: &Fit<P>, unit: &str) -> String {
    format!(
        "residuals of {:.2e} {unit} at {} degrees of freedom",
        found.residual_deviation(),
        found.degrees_of_freedom
    )
}

/// A residual stands out if in so many records of normal residuals one does.
const FALSE_ALARMS: f64 = 1e-3;

/// The residual of each value by the standard deviation that the other ones have about a fit without it: Student's t with one degree of freedom fewer
/// than the fit has (externally studentised residuals).
fn studentised<const P: usize>(regression: &impl Regression<P>, found: &Fit<P>) -> Vec<f64> {
    let freedom = found.degrees_of_freedom as f64;
    let variance = found.sum_of_squares / freedom.max(1.0);
    let mut each = Vec::new();
    regression.linearize(&found.parameters, &mut |residual, row| {
        let of = |i: usize| -> f64 { (0..P).map(|j| found.covariance.get(i, j) * row[j]).sum() };
        let along: f64 = (0..P).map(|i| row[i] * of(i)).sum();
        // What the value leaves of its own residual.
        let left = (1.0 - along / variance).max(f64::EPSILON);
        let others = (found.sum_of_squares - residual * residual / left).max(0.0) / (freedom - 1.0).max(1.0);
        each.push(residual / (others * left).sqrt().max(f64::MIN_POSITIVE));
    });
    each
}

/// The places of residuals that are not of the same noise as the others, each with its studentised size.
pub(super) fn standing_out<const P: usize>(
    regression: &impl Regression<P>,
    found: &Fit<P>,
) -> Vec<(usize, f64)> {
    let each = studentised(regression, found);
    let freedom = found.degrees_of_freedom.saturating_sub(1);
    if freedom == 0 {
        return Vec::new();
    }
    let limit = coverage_factor(1.0 - FALSE_ALARMS / each.len().max(1) as f64, freedom as f64);
    let sizes = each.into_iter().map(f64::abs).enumerate();
    sizes.filter(|(_, size)| *size > limit).collect()
}

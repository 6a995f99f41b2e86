//! Intervals from the sum of squares itself.

use super::{Fit, FitError, FitSettings, Regression, fit};

/// Where one parameter may lie: the others are fitted anew at each of its values, and its ends are where the sum of
/// squares has risen by `deviations`² residual variances (the profile likelihood for Gaussian noise).
///
/// Unlike value ± deviation it follows a curved or lopsided minimum. An end is `None` where the data do not set it:
/// the sum of squares stays below however far the parameter goes, up to its bound or 10⁴ standard deviations.
pub fn profile<R: Regression<P>, const P: usize>(
    regression: &R,
    settings: &FitSettings<P>,
    found: &Fit<P>,
    index: usize,
    deviations: f64,
) -> Result<[Option<f64>; 2], FitError> {
    let rise = deviations * deviations * found.residual_deviation().powi(2);
    let unit = found.covariance.standard_deviation(index);
    let unit =
        if unit.is_finite() && unit > 0.0 { unit } else { found.parameters[index].abs().max(1.0) * 1e-3 };
    let mut ends = [None; 2];
    for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
        let bounds = settings.bounds[index];
        let bound = if sign < 0.0 { bounds.low } else { bounds.high };
        let mut start = found.parameters;
        let mut excess_at = |value: f64| -> Result<f64, FitError> {
            let mut free = settings.free;
            free[index] = false;
            start[index] = value;
            let there = fit(regression, &FitSettings { start, free, ..*settings })?;
            start = there.parameters;
            Ok(there.sum_of_squares - found.sum_of_squares - rise)
        };
        let (mut inside, mut reach) = (found.parameters[index], deviations * unit);
        while reach <= 1e4 * unit * deviations.max(1.0) {
            let value = found.parameters[index] + sign * reach;
            let value = if sign < 0.0 { value.max(bound) } else { value.min(bound) };
            if excess_at(value)? > 0.0 {
                let mut outside = value;
                for _ in 0..50 {
                    let middle = inside.midpoint(outside);
                    if excess_at(middle)? > 0.0 {
                        outside = middle;
                    } else {
                        inside = middle;
                    }
                    if (outside - inside).abs() <= 1e-6 * (outside - found.parameters[index]).abs() {
                        break;
                    }
                }
                *end = Some(inside.midpoint(outside));
                break;
            }
            if value == bound {
                break;
            }
            inside = value;
            reach *= 2.0;
        }
    }
    Ok(ends)
}

//! Terms of second and third order of accelerometers from known attitudes (multi-point tumble, IEEE Std 1293).
//!
//! An accelerometer shows b + Σ K_j·f_j + K₂·f² + K₃·f³, f being the specific force along its own axis. Attitudes whose errors are independent of one
//! another make the residuals scatter, and so are in the uncertainty (type A).

use super::error::CalibrationError;
use super::linear_model::LinearModel;
use super::positions::Position;
use super::quantities::{QuantityUnit, RecordOutcome, STANDARD_GRAVITY, by_scatter};
use super::tone::AXES;
use crate::fit::{Fit, FitError};

/// Bias, the three axes of the fixture, square and cube of the own one, by gravity.
const TERMS: usize = 6;
const OWN: usize = 1;
const SQUARE: usize = 4;
const CUBE: usize = 5;
/// The part of a term's squares that the other terms leave at least if it is determined.
const LEFT: f64 = 1e-4;

/// Adds the terms of second and third order of all accelerometers at these attitudes, which are directions of the specific force in the frame of the fixture.
pub(super) fn tumble(
    outcome: &mut RecordOutcome,
    place: &str,
    positions: &[Position],
    attitudes: &[[f64; 3]],
    gravity: f64,
) -> Result<(), CalibrationError> {
    let sizes: Vec<f64> = attitudes
        .iter()
        .map(|attitude| attitude.iter().map(|part| part * part).sum::<f64>().sqrt())
        .collect();
    if attitudes.len() != positions.len() || sizes.iter().any(|size| !(size.is_finite() && *size > 0.0)) {
        let (place, stated, found) = (place.to_owned(), attitudes.len(), positions.len());
        return Err(CalibrationError::Attitudes { place, stated, found });
    }
    for (axis, name) in AXES.into_iter().enumerate() {
        let terms: Vec<[f64; TERMS]> = attitudes
            .iter()
            .zip(&sizes)
            .map(|(attitude, size)| {
                let [x, y, z] = attitude.map(|part| part / size);
                let own = [x, y, z][axis];
                [1.0, x, y, z, own * own, own.powi(3)]
            })
            .collect();
        let failed = |fault: FitError| CalibrationError::RecordFit { place: place.to_owned(), fault };
        let mut free = [true, true, true, true, false, false];
        for (term, order) in [(SQUARE, "second"), (CUBE, "third")] {
            free[term] = is_determined(&terms, term, free).map_err(failed)?;
            if !free[term] {
                outcome.not_observed.push(format!(
                    "the term of {order} order of the accelerometer {name}: in these attitudes there are too few different specific forces along its axis"
                ));
            }
        }
        let values: Vec<f64> = positions.iter().map(|position| position.force[axis]).collect();
        let found: Fit<TERMS> = LinearModel { terms: &terms, values: &values }.fit(free).map_err(failed)?;
        let [square, cube] = ORDERS;
        for (term, power, (what, unit, shown)) in [(SQUARE, 1, square), (CUBE, 2, cube)] {
            if free[term] {
                // By the slope, and so in units of the input.
                let derived = found.derived(|p| p[term] / p[OWN + axis]);
                let by = gravity.powi(-power);
                let inputs = by_scatter(by * derived.deviation, found.degrees_of_freedom);
                let unit = QuantityUnit::other(unit, 1e6 * STANDARD_GRAVITY.powi(power), shown);
                outcome.push_known(format!("accelerometer_{what}_{name}"), unit, by * derived.value, inputs);
            }
        }
    }
    Ok(())
}

/// The names and units of K₂ and K₃.
const ORDERS: [(&str, &str, &str); 2] =
    [("second_order", "s^2/m", "ugn/gn^2"), ("third_order", "s^4/m^2", "ugn/gn^3")];

/// Whether a term is no combination of those that are free.
fn is_determined(terms: &[[f64; TERMS]], term: usize, free: [bool; TERMS]) -> Result<bool, FitError> {
    let values: Vec<f64> = terms.iter().map(|terms| terms[term]).collect();
    let left = LinearModel { terms, values: &values }.fit(free)?.sum_of_squares;
    Ok(left > LEFT * values.iter().map(|value| value * value).sum::<f64>())
}

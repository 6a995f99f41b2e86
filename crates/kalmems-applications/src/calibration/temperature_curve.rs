//! Numbers over the temperature as polynomials or natural cubic splines, with intervals.

use super::inputs::PROBABILITY;
use super::linear_model::LinearModel;
use super::quantities::QuantityUnit;
use crate::config::{CurvePiece, TemperatureCurve};
use crate::fit::{Fit, FitError};
use crate::metrology::coverage_factor;
use crate::units::name;

/// Parameters of a curve at most.
pub(super) const MOST: usize = 8;

/// A number at a temperature.
#[derive(Clone, Copy)]
pub(super) struct AtTemperature {
    pub temperature_k: f64,
    pub value: f64,
}

/// What kind of curve is fitted.
pub(super) enum CurveBasis {
    /// A polynomial from a temperature on.
    Polynomial { reference_k: f64, order: usize },
    /// A natural cubic spline by its values at the knots, each with the pieces of the spline that is 1 at this knot and 0 at the others.
    Spline { knots_k: Vec<f64>, cardinal: Vec<Vec<CurvePiece>> },
}

impl CurveBasis {
    /// A spline with as many knots at equal distances over the range.
    pub fn spline([low, high]: [f64; 2], knots: usize) -> Self {
        let last = knots.saturating_sub(1).max(1) as f64;
        let knots_k: Vec<f64> = (0..knots).map(|knot| low + knot as f64 / last * (high - low)).collect();
        let unit =
            |knot: usize| -> Vec<f64> { (0..knots).map(|own| f64::from(u8::from(own == knot))).collect() };
        let cardinal = (0..knots).map(|knot| natural_spline(&knots_k, &unit(knot))).collect();
        Self::Spline { knots_k, cardinal }
    }

    /// Number of parameters.
    pub fn count(&self) -> usize {
        match self {
            Self::Polynomial { order, .. } => order + 1,
            Self::Spline { knots_k, .. } => knots_k.len(),
        }
    }

    /// The factors of the parameters at a temperature.
    fn row(&self, temperature_k: f64) -> [f64; MOST] {
        match self {
            Self::Polynomial { reference_k, .. } => {
                let mut power = 1.0;
                std::array::from_fn(|_| {
                    let now = power;
                    power *= temperature_k - reference_k;
                    now
                })
            }
            Self::Spline { cardinal, .. } => {
                std::array::from_fn(|knot| cardinal.get(knot).map_or(0.0, |pieces| at(pieces, temperature_k)))
            }
        }
    }

    /// What ends the name of a parameter.
    pub fn ending(&self, parameter: usize) -> String {
        match self {
            Self::Polynomial { .. } => parameter.to_string(),
            Self::Spline { knots_k, .. } => {
                format!("at_{:.2}_k", knots_k.get(parameter).copied().unwrap_or(f64::NAN))
            }
        }
    }

    /// The unit of a parameter of a number in this unit.
    pub fn unit(&self, of: QuantityUnit, parameter: usize) -> QuantityUnit {
        match self {
            Self::Polynomial { .. } => per_kelvin(of, parameter),
            Self::Spline { .. } => of,
        }
    }

    /// Whether a parameter has what shifts all values alike in it.
    pub const fn is_shifted(&self, parameter: usize) -> bool {
        matches!(self, Self::Spline { .. }) || parameter == 0
    }

    /// Temperatures of a table over the range.
    pub fn temperatures(&self, [low, high]: [f64; 2]) -> Vec<f64> {
        match self {
            Self::Polynomial { .. } => (0..5).map(|row| low + f64::from(row) / 4.0 * (high - low)).collect(),
            Self::Spline { knots_k, .. } => knots_k.clone(),
        }
    }
}

/// The unit of a coefficient of this power of the temperature.
fn per_kelvin(of: QuantityUnit, power: usize) -> QuantityUnit {
    let per = match power {
        0 => return of,
        1 => "/K".to_owned(),
        _ => format!("/K^{power}"),
    };
    let (factor, shown) = if of.unit == "1" { (1e6, "ppm") } else { (of.factor, of.shown) };
    QuantityUnit::other(name(&format!("{}{per}", of.unit)), factor, name(&format!("{shown}{per}")))
}

/// The value of pieces at a temperature; the first and the last one hold beyond the ends.
fn at(pieces: &[CurvePiece], temperature_k: f64) -> f64 {
    let after = pieces.partition_point(|piece| piece.reference_k <= temperature_k);
    let Some(piece) = pieces.get(after.saturating_sub(1)) else { return 0.0 };
    piece.coefficients.iter().rev().fold(0.0, |sum, own| sum * (temperature_k - piece.reference_k) + own)
}

/// The natural cubic spline through these values: second derivatives that are 0 at both ends, by elimination of the tridiagonal equations.
pub(super) fn natural_spline(knots: &[f64], values: &[f64]) -> Vec<CurvePiece> {
    let width = |k: usize| knots[k + 1] - knots[k];
    let slope = |k: usize| (values[k + 1] - values[k]) / width(k);
    let pieces = knots.len().min(values.len()).saturating_sub(1);
    // Of each inner knot, what is left on the diagonal and on the right.
    let mut second = vec![0.0; pieces + 1];
    let mut diagonal = vec![1.0; pieces + 1];
    for k in 1..pieces {
        let before = if k > 1 { width(k - 1) / diagonal[k - 1] } else { 0.0 };
        diagonal[k] = 2.0 * (width(k - 1) + width(k)) - before * width(k - 1);
        second[k] = 6.0 * (slope(k) - slope(k - 1)) - before * second[k - 1];
    }
    for k in (1..pieces).rev() {
        second[k] = (second[k] - width(k) * second[k + 1]) / diagonal[k];
    }
    let piece = |k: usize| CurvePiece {
        reference_k: knots[k],
        coefficients: vec![
            values[k],
            slope(k) - width(k) * (2.0 * second[k] + second[k + 1]) / 6.0,
            0.5 * second[k],
            (second[k + 1] - second[k]) / (6.0 * width(k)),
        ],
    };
    (0..pieces).map(piece).collect()
}

/// A fitted curve with the inflation of its standard deviations and its effective degrees of freedom.
pub(super) struct FittedCurve<'a> {
    pub basis: &'a CurveBasis,
    pub fit: Fit<MOST>,
    pub inflation: f64,
    pub freedom: usize,
}

impl<'a> FittedCurve<'a> {
    /// The curve through values that are independent.
    pub fn of(basis: &'a CurveBasis, values: &[AtTemperature]) -> Result<Self, FitError> {
        let terms: Vec<[f64; MOST]> = values.iter().map(|own| basis.row(own.temperature_k)).collect();
        let numbers: Vec<f64> = values.iter().map(|own| own.value).collect();
        let fit = LinearModel { terms: &terms, values: &numbers }
            .fit(std::array::from_fn(|parameter| parameter < basis.count()))?;
        let freedom = fit.degrees_of_freedom;
        Ok(Self { basis, fit, inflation: 1.0, freedom })
    }

    /// The curve through values in their order in time, of which neighbours may be correlated.
    pub fn in_time(basis: &'a CurveBasis, values: &[AtTemperature]) -> Result<Self, FitError> {
        let found = Self::of(basis, values)?;
        let residual = |k: usize| values[k].value - found.value(values[k].temperature_k).0;
        let products: f64 = (1..values.len()).map(|k| residual(k) * residual(k - 1)).sum();
        let correlation = (products / found.fit.sum_of_squares.max(f64::MIN_POSITIVE)).clamp(0.0, 0.9);
        let inflation = (1.0 + correlation) / (1.0 - correlation);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of blocks
        let freedom = ((found.freedom as f64 / inflation) as usize).max(1);
        Ok(Self { inflation: inflation.sqrt(), freedom, ..found })
    }

    /// The value at a temperature, and its standard deviation.
    pub fn value(&self, temperature_k: f64) -> (f64, f64) {
        let row = self.basis.row(temperature_k);
        let value = row.iter().zip(&self.fit.parameters).map(|(factor, own)| factor * own).sum();
        let free = 0..self.basis.count();
        let variance: f64 = free
            .clone()
            .map(|i| free.clone().map(|j| row[i] * self.fit.covariance.get(i, j) * row[j]).sum::<f64>())
            .sum();
        (value, self.inflation * variance.max(0.0).sqrt())
    }

    /// The curve as a number with this name has it. What is stated of all values alike, by the square of its expanded uncertainty, adds to that of the
    /// scatter.
    pub fn curve(&self, name: String, unit: &str, range_k: [f64; 2], stated: f64) -> TemperatureCurve {
        let parameters = self.fit.parameters.get(..self.basis.count()).unwrap_or_default();
        let pieces = match self.basis {
            CurveBasis::Polynomial { reference_k, .. } => {
                vec![CurvePiece { reference_k: *reference_k, coefficients: parameters.to_vec() }]
            }
            CurveBasis::Spline { knots_k, .. } => natural_spline(knots_k, parameters),
        };
        let mut expanded_square: Vec<CurvePiece> =
            (0..pieces.len()).map(|piece| self.expanded_square(piece, pieces[piece].reference_k)).collect();
        for constant in expanded_square.iter_mut().filter_map(|piece| piece.coefficients.first_mut()) {
            *constant += stated;
        }
        TemperatureCurve { name, unit: unit.to_owned(), range_k, pieces, expanded_square }
    }

    /// The square of the expanded uncertainty by the scatter over one of the pieces: k²·Σ C_ij·a_i·a_j, a being the polynomials by which the parameters
    /// are multiplied.
    fn expanded_square(&self, piece: usize, reference_k: f64) -> CurvePiece {
        let count = self.basis.count();
        let factors: Vec<Vec<f64>> = match self.basis {
            CurveBasis::Polynomial { .. } => (0..count)
                .map(|power| (0..=power).map(|k| f64::from(u8::from(k == power))).collect())
                .collect(),
            CurveBasis::Spline { cardinal, .. } => cardinal
                .iter()
                .map(|own| own.get(piece).map_or(Vec::new(), |own| own.coefficients.clone()))
                .collect(),
        };
        let k = coverage_factor(PROBABILITY, self.freedom as f64) * self.inflation;
        let most = factors.iter().map(Vec::len).max().unwrap_or(1);
        let mut coefficients = vec![0.0; 2 * most - 1];
        for (i, a) in factors.iter().enumerate() {
            for (j, b) in factors.iter().enumerate() {
                let part = k * k * self.fit.covariance.get(i, j);
                for (power, x) in a.iter().enumerate() {
                    for (other, y) in b.iter().enumerate() {
                        coefficients[power + other] += part * x * y;
                    }
                }
            }
        }
        CurvePiece { reference_k, coefficients }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.interpolate.CubicSpline(knots, values, bc_type="natural")` of SciPy 1.17.
    #[test]
    fn the_spline_is_that_of_scipy() {
        let pieces = natural_spline(&[280.0, 300.0, 315.0, 340.0, 350.0], &[1.0, -2.0, 0.5, 3.0, 2.5]);
        for (kelvin, expected) in [
            (285.0, -0.198_073_308_270_676_6),
            (300.0, -2.0),
            (309.5, -0.656_148_015_873_016_2),
            (333.0, 2.864_467_368_421_052_7),
            (347.0, 2.696_868_421_052_631_7),
        ] {
            assert!((at(&pieces, kelvin) - expected).abs() < 1e-12, "{kelvin}: {}", at(&pieces, kelvin));
        }
        // The spline that is 1 at one knot gives the row of the fit, and all of them together are 1 everywhere.
        let basis = CurveBasis::spline([280.0, 350.0], 5);
        assert!((basis.row(311.0).iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(basis.ending(4), "at_350.00_k");
    }
}

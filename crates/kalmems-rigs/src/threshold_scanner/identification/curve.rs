//! The comb's curve without a formula.

use crate::fit::{Fit, FitError, FitSettings, Regression, fit};

/// Splines of the curve.
const SPLINES: usize = 32;
/// And the offset.
const UNKNOWNS: usize = SPLINES + 1;

/// A point of the free-form curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// θ in rad.
    pub angle: f64,
    /// h in V·s/rad with its standard error.
    pub sensitivity: [f64; 2],
    /// C(θ) − C(θ_th) in F with its standard error.
    pub capacitance: [f64; 2],
}

/// Points over the range of the motion.
const POINTS: i32 = 80;

/// Steps of Simpson's rule in each interval between knots; the splines are cubics there, and the rule is exact.
const STEPS: usize = 2;

/// h(θ) as cubic B-splines and C(θ) from it, by linear least squares of y = Σ c_j·B_j(θ)·θ̇ + y₀ at a known motion.
///
/// C(θ) − C(θ_th) = −∫h dθ/(R_s·V_bias) from θ_th to θ (Chen, dissertation, 2018, equation 75 with the limit θ; the sign
/// is that of a stage that inverts). `transimpedance` is R_s·V_bias in Ω·V. Unlike the charge added up over time
/// (equation 73) it does not walk away with noise and offset. Standard errors are those of white noise in the signal; the
/// motion is taken as exact.
pub fn fit_curve(
    signal: &[f64],
    motion: &[[f64; 2]],
    threshold: f64,
    transimpedance: f64,
) -> Result<Vec<CurvePoint>, FitError> {
    let largest = motion.iter().map(|[angle, _]| angle.abs()).fold(0.0, f64::max);
    let splines = Splines { low: -largest, width: 2.0 * largest / (SPLINES - 3) as f64 };
    let found = fit(&CombCurveData { signal, motion, splines }, &FitSettings::from_start([0.0; UNKNOWNS]))?;
    let at_threshold = splines.integral(threshold);
    Ok((0..=POINTS)
        .map(|i| {
            let angle = largest * (2.0 * f64::from(i) / f64::from(POINTS) - 1.0);
            let integral = splines.integral(angle);
            let charge = std::array::from_fn(|j| (at_threshold[j] - integral[j]) / transimpedance);
            CurvePoint {
                angle,
                sensitivity: along(&found, &splines.at(angle)),
                capacitance: along(&found, &charge),
            }
        })
        .collect())
}

/// A linear function of the unknowns with its standard error.
fn along(found: &Fit<UNKNOWNS>, row: &[f64; UNKNOWNS]) -> [f64; 2] {
    let (mut value, mut variance) = (0.0, 0.0);
    for i in (0..UNKNOWNS).filter(|i| row[*i] != 0.0) {
        value += row[i] * found.parameters[i];
        for j in (0..UNKNOWNS).filter(|j| row[*j] != 0.0) {
            variance += row[i] * found.covariance.get(i, j) * row[j];
        }
    }
    [value, if variance.is_nan() { f64::INFINITY } else { variance.sqrt() }]
}

/// Cubic B-splines over equal intervals from `low` on.
#[derive(Clone, Copy)]
struct Splines {
    low: f64,
    width: f64,
}

impl Splines {
    /// The interval that an angle is in, and how far.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    fn place(&self, angle: f64) -> (usize, f64) {
        let u = (angle - self.low) / self.width;
        let interval = u.floor().clamp(0.0, (SPLINES - 4) as f64);
        (interval as usize, u - interval)
    }

    /// The values of all splines, and of the offset's place 0.
    fn at(&self, angle: f64) -> [f64; UNKNOWNS] {
        let (first, u) = self.place(angle);
        let v = 1.0 - u;
        let mut row = [0.0; UNKNOWNS];
        let four = [
            v.powi(3) / 6.0,
            (3.0 * u.powi(3) - 6.0 * u * u + 4.0) / 6.0,
            (3.0 * v.powi(3) - 6.0 * v * v + 4.0) / 6.0,
            u.powi(3) / 6.0,
        ];
        row[first..first + 4].copy_from_slice(&four);
        row
    }

    /// Their integrals from the first knot to an angle.
    fn integral(&self, angle: f64) -> [f64; UNKNOWNS] {
        let (last, _) = self.place(angle);
        let mut sum = [0.0; UNKNOWNS];
        for interval in 0..=last {
            let from = self.low + self.width * interval as f64;
            let to = if interval == last { angle } else { from + self.width };
            let step = (to - from) / STEPS as f64;
            for k in 0..=STEPS {
                let weight = if k == 0 || k == STEPS { 1.0 } else { 4.0 } * step / 3.0;
                // Just inside the interval, so that both ends belong to it.
                let inside = (from + step * k as f64).clamp(from, from + self.width * (1.0 - 1e-12));
                for (sum, value) in sum.iter_mut().zip(self.at(inside)) {
                    *sum += weight * value;
                }
            }
        }
        sum
    }
}

struct CombCurveData<'a> {
    signal: &'a [f64],
    motion: &'a [[f64; 2]],
    splines: Splines,
}

impl CombCurveData<'_> {
    fn rows(&self, mut each: impl FnMut(f64, [f64; UNKNOWNS])) {
        for (y, [angle, rate]) in self.signal.iter().zip(self.motion).filter(|(y, _)| y.is_finite()) {
            let mut row = self.splines.at(*angle).map(|value| value * rate);
            row[SPLINES] = 1.0;
            each(*y, row);
        }
    }
}

impl Regression<UNKNOWNS> for CombCurveData<'_> {
    fn residuals(&self, p: &[f64; UNKNOWNS], each: &mut impl FnMut(f64)) {
        self.rows(|y, row| each(row.iter().zip(p).map(|(a, p)| a * p).sum::<f64>() - y));
    }

    fn linearize(&self, p: &[f64; UNKNOWNS], each: &mut impl FnMut(f64, &[f64; UNKNOWNS])) {
        self.rows(|y, row| each(row.iter().zip(p).map(|(a, p)| a * p).sum::<f64>() - y, &row));
    }
}

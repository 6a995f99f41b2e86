//! Circles through points of a plane: resonances in a Nyquist plot.

use crate::fit::{ByDual, Fit, FitError, FitSettings, ResidualLaw, fit};
use crate::signal::NormalEquations;
use kalmems_core::Over;

/// A circle with how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Circle {
    /// [x, y] of the centre and the radius, their covariance, and the sum of the squared distances.
    pub fit: Fit<3>,
}

impl Circle {
    /// The centre.
    pub fn centre(&self) -> [f64; 2] {
        [self.fit.parameters[0], self.fit.parameters[1]]
    }

    /// The radius.
    pub fn radius(&self) -> f64 {
        self.fit.parameters[2]
    }
}

/// The circle with the least squared distances from the points.
///
/// It starts from Kåsa's algebraic circle (IEEE Trans. Instrumentation and Measurement 25, 8, 1976), which is too
/// small where the points cover a short arc; the distances themselves have no such bias to first order.
pub fn fit_circle(points: &[[f64; 2]]) -> Result<Circle, FitError> {
    let too_few = || FitError::TooFew { residuals: points.len(), parameters: 3 };
    let start = kasa(points).ok_or_else(too_few)?;
    fit(&ByDual(CircleDistances(points)), &FitSettings::from_start(start)).map(|fit| Circle { fit })
}

/// The algebraic circle: x² + y² = 2·a·x + 2·b·y + c in the sense of linear least squares.
fn kasa(points: &[[f64; 2]]) -> Option<[f64; 3]> {
    let n = points.len() as f64;
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / n;
    let (x0, y0) = (mean(0), mean(1));
    let mut normal = NormalEquations::new();
    for [x, y] in points {
        let row = [x - x0, y - y0, 1.0];
        normal.add(&row, row[0].powi(2) + row[1].powi(2));
    }
    let ([a, b, c], is_positive) = normal.solve();
    let radius = (c + (a * a + b * b) / 4.0).sqrt();
    (is_positive && radius.is_finite()).then_some([x0 + a / 2.0, y0 + b / 2.0, radius])
}

struct CircleDistances<'a>(&'a [[f64; 2]]);

impl ResidualLaw<3> for CircleDistances<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 3], each: &mut impl FnMut(S)) {
        for [x, y] in self.0 {
            let (dx, dy) = (S::lift(*x) - p[0], S::lift(*y) - p[1]);
            each((dx.sq() + dy.sq()).sqrt() - p[2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn arc(span: f64) -> Vec<[f64; 2]> {
        (0..40)
            .map(|i| {
                let angle = 0.3 + span * f64::from(i) / 39.0;
                [3.0 + 2.0 * angle.cos(), -1.0 + 2.0 * angle.sin()]
            })
            .collect()
    }

    #[test]
    fn points_on_a_circle_give_it_back() {
        for span in [6.0, 1.0, 0.2] {
            let found = fit_circle(&arc(span)).unwrap();
            assert_relative_eq!(found.radius(), 2.0, max_relative = 1e-9);
            assert_relative_eq!(found.centre()[0], 3.0, max_relative = 1e-9);
            assert_relative_eq!(found.centre()[1], -1.0, max_relative = 1e-9);
        }
    }

    #[test]
    fn what_is_no_circle_is_refused() {
        assert!(fit_circle(&[[0.0, 0.0], [1.0, 0.0]]).is_err());
        assert!(fit_circle(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]).is_err());
        assert!(fit_circle(&[]).is_err());
    }
}

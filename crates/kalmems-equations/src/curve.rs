//! Curves through points.

use crate::description::{CurveExtension, CurvePoints};
use crate::error::{EquationError, EquationFault};

/// The place of a curve among those of a device.
pub(crate) type CurveId = usize;

/// The highest derivative of a curve: it has a continuous second one.
pub(crate) const HIGHEST_ORDER: u8 = 2;

/// A cubic spline through points, with continuous first and second derivatives (de Boor, A Practical Guide to Splines,
/// 1978, chapter IV). At both ends the third derivative is continuous over the first and the last inner point ("not a knot"),
/// so that a cubic is reproduced exactly.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    x: Vec<f64>,
    y: Vec<f64>,
    /// The second derivative at each point.
    bend: Vec<f64>,
    outside: CurveExtension,
}

impl Curve {
    /// Through points; refuses fewer than four, and such as do not rise.
    pub(crate) fn through(points: &CurvePoints) -> Result<Self, EquationError> {
        let refuse =
            |why: String| Err(EquationError::whole(&points.place, &points.name, EquationFault::Value(why)));
        let (x, y) = (&points.x, &points.y);
        if let Some(file) = points.file.as_ref().filter(|_| x.is_empty()) {
            return refuse(format!("the points of the file `{file}` were not read"));
        }
        if x.len() != y.len() {
            return refuse(format!(
                "the curve has {} places and {} values; expected as many",
                x.len(),
                y.len()
            ));
        }
        if x.len() < 4 {
            return refuse(format!("the curve has {} points; expected at least 4", x.len()));
        }
        if let Some(row) = x.iter().zip(y).position(|(x, y)| !(x.is_finite() && y.is_finite())) {
            return refuse(format!("point {} of the curve is not a finite number", row + 1));
        }
        if let Some(row) = x.windows(2).position(|pair| pair[0] >= pair[1]) {
            let (a, b) = (x[row], x[row + 1]);
            return refuse(format!(
                "the curve's places must rise; point {} is at {a} and point {} at {b}",
                row + 1,
                row + 2
            ));
        }
        Ok(Self { x: x.clone(), y: y.clone(), bend: bends(x, y), outside: points.outside })
    }

    /// C(x), C′(x) and C″(x).
    pub(crate) fn at(&self, x: f64) -> [f64; 3] {
        let (Some(first), Some(last)) = (self.x.first(), self.x.last()) else { return [f64::NAN; 3] };
        if x >= *first && x <= *last {
            return self.inside(x);
        }
        // What is not a number is not inside either.
        let end = if x < *first { *first } else { *last };
        match self.outside {
            _ if x.is_nan() => [f64::NAN; 3],
            CurveExtension::Error => [f64::NAN; 3],
            CurveExtension::Clamp => [self.inside(end)[0], 0.0, 0.0],
            CurveExtension::Linear => {
                let [value, slope, _] = self.inside(end);
                [value + slope * (x - end), slope, 0.0]
            }
        }
    }

    /// The middle of its places, half their span, and its largest size; 1 where one of the last two is 0.
    pub(crate) fn extent(&self) -> (f64, f64, f64) {
        let (first, last) = (self.x.first().copied(), self.x.last().copied());
        let (first, last) = (first.unwrap_or(-1.0), last.unwrap_or(1.0));
        let size = self.y.iter().fold(0.0_f64, |size, y| size.max(y.abs()));
        (0.5 * (first + last), 0.5 * (last - first), if size > 0.0 { size } else { 1.0 })
    }

    /// Its places, and of each piece the coefficients of the powers 0 to 3 of the distance from the piece's first place.
    pub(crate) fn pieces(&self) -> (&[f64], Vec<[f64; 4]>) {
        let piece = |k: usize| {
            let h = self.x[k + 1] - self.x[k];
            let (p, q) = (self.bend[k], self.bend[k + 1]);
            let slope = (self.y[k + 1] - self.y[k]) / h - h / 6.0 * (2.0 * p + q);
            [self.y[k], slope, 0.5 * p, (q - p) / (6.0 * h)]
        };
        (&self.x, (0..self.x.len() - 1).map(piece).collect())
    }

    /// What it does beyond its ends.
    pub(crate) fn outside(&self) -> CurveExtension {
        self.outside
    }

    fn inside(&self, x: f64) -> [f64; 3] {
        let right = self.x.partition_point(|point| *point <= x).clamp(1, self.x.len() - 1);
        let left = right - 1;
        let h = self.x[right] - self.x[left];
        // Counted from the nearer side, so that the value at a point is that point's.
        let (a, b) = ((self.x[right] - x) / h, (x - self.x[left]) / h);
        let (p, q) = (self.bend[left], self.bend[right]);
        let value = a * self.y[left]
            + b * self.y[right]
            + ((a * a * a - a) * p + (b * b * b - b) * q) * (h * h / 6.0);
        let slope = (self.y[right] - self.y[left]) / h
            + ((3.0 * b * b - 1.0) * q - (3.0 * a * a - 1.0) * p) * (h / 6.0);
        [value, slope, a * p + b * q]
    }
}

/// The second derivatives at points of which there are four or more.
fn bends(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let step: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slope: Vec<f64> = y.windows(2).zip(&step).map(|(pair, h)| (pair[1] - pair[0]) / h).collect();
    // Rows of the inner points: lower, diagonal, upper, right side. The ends are put in by the condition there.
    let mut rows: Vec<[f64; 4]> = (1..n - 1)
        .map(|i| [step[i - 1], 2.0 * (step[i - 1] + step[i]), step[i], 6.0 * (slope[i] - slope[i - 1])])
        .collect();
    let last = rows.len() - 1;
    let (h0, h1) = (step[0], step[1]);
    rows[0][1] += h0 * (h0 + h1) / h1;
    rows[0][2] -= h0 * h0 / h1;
    let (g0, g1) = (step[n - 2], step[n - 3]);
    rows[last][1] += g0 * (g0 + g1) / g1;
    rows[last][0] -= g0 * g0 / g1;
    for i in 1..rows.len() {
        let factor = rows[i][0] / rows[i - 1][1];
        rows[i][1] -= factor * rows[i - 1][2];
        rows[i][3] -= factor * rows[i - 1][3];
    }
    let mut bend = vec![0.0; n];
    for i in (0..rows.len()).rev() {
        let after = if i == last { 0.0 } else { rows[i][2] * bend[i + 2] };
        bend[i + 1] = (rows[i][3] - after) / rows[i][1];
    }
    bend[0] = bend[1] + (bend[1] - bend[2]) * h0 / h1;
    bend[n - 1] = bend[n - 2] + (bend[n - 2] - bend[n - 3]) * g0 / g1;
    bend
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::TextPlace;

    fn through(f: impl Fn(f64) -> f64, x: &[f64], outside: CurveExtension) -> Curve {
        let points = CurvePoints {
            name: "C".to_owned(),
            place: TextPlace::default(),
            file: None,
            x: x.to_vec(),
            y: x.iter().map(|x| f(*x)).collect(),
            x_unit: "m".to_owned(),
            y_unit: "F".to_owned(),
            outside,
        };
        Curve::through(&points).unwrap()
    }

    #[test]
    fn a_cubic_is_reproduced_on_uneven_points() {
        let cubic = |x: f64| 2.0 - x + 3.0 * x * x - 0.5 * x * x * x;
        let curve = through(cubic, &[-1.0, -0.2, 0.1, 1.5, 2.0, 4.0], CurveExtension::Error);
        for k in 0..=100 {
            let x = -1.0 + 0.05 * f64::from(k);
            let [value, slope, bend] = curve.at(x);
            assert!((value - cubic(x)).abs() < 1e-13, "{x}");
            assert!((slope - (-1.0 + 6.0 * x - 1.5 * x * x)).abs() < 1e-13, "{x}");
            assert!((bend - (6.0 - 3.0 * x)).abs() < 1e-13, "{x}");
        }
    }

    /// Of the fourth order in the step: half the step, a sixteenth of the error.
    #[test]
    fn a_sine_is_met_to_the_fourth_order() {
        let error = |points: u32| {
            let x: Vec<f64> = (0..=points).map(|k| 3.0 * f64::from(k) / f64::from(points)).collect();
            let curve = through(f64::sin, &x, CurveExtension::Error);
            let places = (0..=3000).map(|k| f64::from(k) * 1e-3);
            places.map(|x| (curve.at(x)[0] - x.sin()).abs()).fold(0.0, f64::max)
        };
        let order = (error(20) / error(40)).log2();
        assert!((3.5..4.5).contains(&order), "{order}");
    }

    #[test]
    fn outside_is_what_is_stated() {
        let x = [0.0, 1.0, 2.0, 3.0];
        let at = |outside, at: f64| through(|x| x * x, &x, outside).at(at);
        assert!(at(CurveExtension::Error, 3.0 + 1e-12).iter().all(|v| v.is_nan()));
        assert_eq!(at(CurveExtension::Clamp, 5.0), [9.0, 0.0, 0.0]);
        let [value, slope, bend] = at(CurveExtension::Linear, 5.0);
        assert!((value - 21.0).abs() < 1e-13 && (slope - 6.0).abs() < 1e-13 && bend == 0.0);
        assert!(at(CurveExtension::Clamp, f64::NAN)[0].is_nan());
        assert_eq!(through(|x| x * x, &x, CurveExtension::Error).at(3.0)[0], 9.0);
    }
}

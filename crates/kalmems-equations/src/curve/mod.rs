//! Curves through points.

mod grid;
mod spline;

pub(crate) use grid::{GROUPS, Grid};

use crate::description::{CurveExtension, CurvePoints};
use crate::error::{EquationError, EquationFault};
use crate::limits::MOST_POINTS;
use spline::{bends, weights};

/// The place of a curve among those of a device.
pub(crate) type CurveId = usize;

/// The highest derivative of a curve: it has a continuous second one.
pub(crate) const HIGHEST_ORDER: u8 = 2;

/// A cubic spline through points, with continuous first and second derivatives (de Boor, A Practical Guide to Splines,
/// 1978, chapter IV). At both ends the third derivative is continuous over the first and the last inner point ("not a knot"),
/// so that a cubic is reproduced exactly. Of two arguments, the tensor product of two of them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    points: SplinePoints,
    outside: CurveExtension,
}

/// What a curve goes through.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SplinePoints {
    /// Places, values, and the second derivative at each.
    Line { x: Vec<f64>, y: Vec<f64>, bend: Vec<f64> },
    /// Of two arguments.
    Grid(Grid),
}

impl Curve {
    /// Through points; refuses fewer than four, and such as do not rise.
    pub(crate) fn through(points: &CurvePoints) -> Result<Self, EquationError> {
        let refuse =
            |why: String| Err(EquationError::whole(&points.place, &points.name, EquationFault::Value(why)));
        let CurvePoints { x, y, z, .. } = points;
        if let Some(file) = points.file.as_ref().filter(|_| x.is_empty()) {
            return refuse(format!("the points of the file `{file}` were not read"));
        }
        let count = x.len().max(y.len()).max(z.len());
        if count > MOST_POINTS {
            return refuse(format!(
                "the curve has {count} points; expected at most {MOST_POINTS}: leave out points, between which a spline is as good"
            ));
        }
        let outside = points.outside;
        let (values, expected) = if z.is_empty() { (y, x.len()) } else { (z, x.len() * y.len()) };
        if values.len() != expected {
            let of_grid = if z.is_empty() { "" } else { ", one for each x and y" };
            return refuse(format!(
                "the curve has {} values; expected {expected}, as many as places{of_grid}",
                values.len()
            ));
        }
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            return refuse(format!("value {} of the curve is not a finite number", row + 1));
        }
        for places in [x, y].into_iter().take(if z.is_empty() { 1 } else { 2 }) {
            if places.len() < 4 {
                return refuse(format!(
                    "the curve has {} points in a row; expected at least 4",
                    places.len()
                ));
            }
            if let Some(row) = places.iter().position(|place| !place.is_finite()) {
                return refuse(format!("place {} of the curve is not a finite number", row + 1));
            }
            if let Some(row) = places.windows(2).position(|pair| pair[0] >= pair[1]) {
                let (a, b) = (places[row], places[row + 1]);
                return refuse(format!(
                    "the curve's places must rise; point {} is at {a} and point {} at {b}",
                    row + 1,
                    row + 2
                ));
            }
        }
        let (x, y) = (x.clone(), y.clone());
        let points = if z.is_empty() {
            SplinePoints::Line { bend: bends(&x, &y), x, y }
        } else {
            SplinePoints::Grid(Grid::through(x, y, z))
        };
        Ok(Self { points, outside })
    }

    /// Of one argument C(x), C′(x) and C″(x); of two arguments the derivatives of a group of [`GROUPS`].
    pub(crate) fn at(&self, at: [f64; 2], group: usize) -> [f64; 3] {
        match &self.points {
            SplinePoints::Grid(grid) => grid.at(at, group, self.outside),
            SplinePoints::Line { x, y, bend } => {
                let Some((left, weights)) = weights(x, at[0], self.outside) else { return [f64::NAN; 3] };
                let nodes = [y[left], y[left + 1], bend[left], bend[left + 1]];
                weights.map(|of| of[0] * nodes[0] + of[1] * nodes[1] + (of[2] * nodes[2] + of[3] * nodes[3]))
            }
        }
    }

    /// The derivative of this order by each argument.
    pub(crate) fn derivative(&self, at: [f64; 2], order: [u8; 2]) -> f64 {
        let place = match &self.points {
            SplinePoints::Line { .. } => Some((0, usize::from(order[0]))),
            SplinePoints::Grid(_) => GROUPS
                .iter()
                .enumerate()
                .find_map(|(group, orders)| Some((group, orders.iter().position(|known| *known == order)?))),
        };
        place.and_then(|(group, place)| self.at(at, group).get(place).copied()).unwrap_or(f64::NAN)
    }

    /// The middle of its places and half their span, along each of its arguments, and its largest size, 1 where that is 0.
    pub(crate) fn extent(&self) -> ([[f64; 2]; 2], f64) {
        let span = |places: &[f64]| {
            let ends = places.first().zip(places.last()).map_or([-1.0, 1.0], |(first, last)| [*first, *last]);
            [0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])]
        };
        let (spans, size) = match &self.points {
            SplinePoints::Line { x, y, .. } => {
                ([span(x), [0.0, 1.0]], y.iter().fold(0.0_f64, |size, y| size.max(y.abs())))
            }
            SplinePoints::Grid(grid) => (grid.places().map(span), grid.size()),
        };
        (spans, if size > 0.0 { size } else { 1.0 })
    }

    /// What it goes through.
    pub(crate) fn points(&self) -> &SplinePoints {
        &self.points
    }

    /// Its places along each of its arguments.
    pub(crate) fn places(&self) -> Vec<&[f64]> {
        match &self.points {
            SplinePoints::Line { x, .. } => vec![x],
            SplinePoints::Grid(grid) => grid.places().to_vec(),
        }
    }

    /// What it does beyond its ends.
    pub(crate) fn outside(&self) -> CurveExtension {
        self.outside
    }
}

impl SplinePoints {
    /// Of one argument, of each piece the coefficients of the powers 0 to 3 of the distance from the piece's first place.
    pub(crate) fn pieces(&self) -> Vec<[f64; 4]> {
        let Self::Line { x, y, bend } = self else { return Vec::new() };
        let piece = |k: usize| {
            let h = x[k + 1] - x[k];
            let (p, q) = (bend[k], bend[k + 1]);
            let slope = (y[k + 1] - y[k]) / h - h / 6.0 * (2.0 * p + q);
            [y[k], slope, 0.5 * p, (q - p) / (6.0 * h)]
        };
        (0..x.len() - 1).map(piece).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::TextPlace;

    fn of_line(x: &[f64]) -> CurvePoints {
        CurvePoints {
            name: "C".to_owned(),
            place: TextPlace::default(),
            file: None,
            x: x.to_vec(),
            y: Vec::new(),
            z: Vec::new(),
            x_unit: "m".to_owned(),
            y_unit: "F".to_owned(),
            z_unit: "F".to_owned(),
            outside: CurveExtension::Error,
        }
    }

    fn through(f: impl Fn(f64) -> f64, x: &[f64], outside: CurveExtension) -> Curve {
        let points = CurvePoints { y: x.iter().map(|x| f(*x)).collect(), outside, ..of_line(x) };
        Curve::through(&points).unwrap()
    }

    #[test]
    fn a_cubic_is_reproduced_on_uneven_points() {
        let cubic = |x: f64| 2.0 - x + 3.0 * x * x - 0.5 * x * x * x;
        let curve = through(cubic, &[-1.0, -0.2, 0.1, 1.5, 2.0, 4.0], CurveExtension::Error);
        for k in 0..=100 {
            let x = -1.0 + 0.05 * f64::from(k);
            let [value, slope, bend] = curve.at([x, 0.0], 0);
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
            places.map(|x| (curve.at([x, 0.0], 0)[0] - x.sin()).abs()).fold(0.0, f64::max)
        };
        let order = (error(20) / error(40)).log2();
        assert!((3.5..4.5).contains(&order), "{order}");
    }

    #[test]
    fn outside_is_what_is_stated() {
        let x = [0.0, 1.0, 2.0, 3.0];
        let at = |outside, at: f64| through(|x| x * x, &x, outside).at([at, 0.0], 0);
        assert!(at(CurveExtension::Error, 3.0 + 1e-12).iter().all(|v| v.is_nan()));
        assert_eq!(at(CurveExtension::Clamp, 5.0), [9.0, 0.0, 0.0]);
        let [value, slope, bend] = at(CurveExtension::Linear, 5.0);
        assert!((value - 21.0).abs() < 1e-13 && (slope - 6.0).abs() < 1e-13 && bend == 0.0);
        assert!(at(CurveExtension::Clamp, f64::NAN)[0].is_nan());
        assert_eq!(through(|x| x * x, &x, CurveExtension::Error).at([3.0, 0.0], 0)[0], 9.0);
    }

    /// A product of cubics of either argument, and its derivatives up to the second order, on uneven places.
    #[test]
    fn a_product_of_cubics_is_reproduced_with_its_derivatives() {
        let of_x = |x: f64| [1.0 - x + 0.5 * x * x * x, -1.0 + 1.5 * x * x, 3.0 * x];
        let of_y = |y: f64| [2.0 + y * y - 0.2 * y * y * y, 2.0 * y - 0.6 * y * y, 2.0 - 1.2 * y];
        let (x, y) = ([-1.0, -0.3, 0.1, 1.2, 2.0], [0.0, 0.5, 0.7, 1.5, 2.5, 3.0]);
        let points = CurvePoints {
            z: x.iter().flat_map(|x| y.map(|y| of_x(*x)[0] * of_y(y)[0])).collect(),
            x: x.to_vec(),
            y: y.to_vec(),
            ..of_line(&[])
        };
        let surface = Curve::through(&points).unwrap();
        for (i, j) in (0..=30).flat_map(|i| (0..=30).map(move |j| (i, j))) {
            let at = [-1.0 + 0.1 * f64::from(i), 0.1 * f64::from(j)];
            let (x, y) = (of_x(at[0]), of_y(at[1]));
            for (group, orders) in GROUPS.iter().enumerate() {
                for (found, [k, l]) in surface.at(at, group).into_iter().zip(orders) {
                    let expected = x[usize::from(*k)] * y[usize::from(*l)];
                    assert!((found - expected).abs() < 1e-12, "{at:?} {k} {l}: {found} {expected}");
                }
            }
        }
        assert!(surface.at([2.1, 1.0], 0)[0].is_nan() && surface.at([0.0, -0.1], 0)[0].is_nan());
    }

    #[test]
    fn a_curve_of_more_points_than_it_needs_is_refused() {
        let x: Vec<f64> = (0..=MOST_POINTS).map(|k| k as f64).collect();
        let points = CurvePoints { y: x.clone(), ..of_line(&x) };
        let why = Curve::through(&points).map(|_| ()).unwrap_err().to_string();
        assert!(why.contains("1000001 points; expected at most 1000000"), "{why}");
    }

    /// Beyond the places of one argument along the tangent of that one, the other as inside.
    #[test]
    fn outside_of_a_grid_is_what_is_stated() {
        let places = [0.0, 1.0, 2.0, 3.0];
        let points = |outside| CurvePoints {
            x: places.to_vec(),
            y: places.to_vec(),
            z: places.iter().flat_map(|x| places.map(|y| x * x * (1.0 + y * y))).collect(),
            outside,
            ..of_line(&[])
        };
        let surface = Curve::through(&points(CurveExtension::Linear)).unwrap();
        let near = |found: [f64; 3], expected: [f64; 3]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        };
        // (9 + 6·2)·(1 + y²)
        near(surface.at([5.0, 0.5], 0), [21.0 * 1.25, 6.0 * 1.25, 21.0]);
        near(surface.at([5.0, 0.5], 1), [0.0, 6.0, 21.0 * 2.0]);
        near(surface.at([5.0, 4.0], 0), [21.0 * 16.0, 6.0 * 16.0, 21.0 * 6.0]);
        let surface = Curve::through(&points(CurveExtension::Clamp)).unwrap();
        near(surface.at([5.0, 0.5], 0), [9.0 * 1.25, 0.0, 9.0]);
        near(surface.at([5.0, 4.0], 1), [0.0; 3]);
        assert!(surface.at([f64::NAN, 1.0], 0)[0].is_nan());
    }
}

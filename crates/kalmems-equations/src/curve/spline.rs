//! The cubic spline of one argument: its second derivatives at the points, and what it is between them.

use crate::description::CurveExtension;

/// The place of the piece of a point, and the weights of the values and of the second derivatives at both ends of the piece in the spline, in its
/// slope and in its second derivative; `None` where there is nothing.
pub(super) fn weights(places: &[f64], at: f64, outside: CurveExtension) -> Option<(usize, [[f64; 4]; 3])> {
    let (first, last) = (*places.first()?, *places.last()?);
    let inside = at.clamp(first, last);
    if at.is_nan() || inside != at && outside == CurveExtension::Error {
        return None;
    }
    let right = places.partition_point(|place| *place <= inside).clamp(1, places.len() - 1);
    let left = right - 1;
    let h = places[right] - places[left];
    // Counted from the nearer side, so that the value at a point is that point's.
    let (a, b) = ((places[right] - inside) / h, (inside - places[left]) / h);
    let sixth = h / 6.0;
    let mut value = [a, b, (a * a * a - a) * h * sixth, (b * b * b - b) * h * sixth];
    let mut slope = [-1.0 / h, 1.0 / h, -(3.0 * a * a - 1.0) * sixth, (3.0 * b * b - 1.0) * sixth];
    let mut bend = [0.0, 0.0, a, b];
    if inside != at {
        bend = [0.0; 4];
        match outside {
            CurveExtension::Linear => {
                value.iter_mut().zip(slope).for_each(|(value, slope)| *value += (at - inside) * slope);
            }
            _ => slope = [0.0; 4],
        }
    }
    Some((left, [value, slope, bend]))
}

/// The second derivatives at points of which there are four or more.
pub(super) fn bends(x: &[f64], y: &[f64]) -> Vec<f64> {
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

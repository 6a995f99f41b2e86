//! Calibration of accelerometers and gyroscopes by positions without a table (Tedaldi, Pretto and Menegatti, ICRA 2014, 3042).
//!
//! At rest the specific force has the magnitude of gravity, whatever its direction. The scale factors, the angles between the sensitive
//! axes and the biases of three accelerometers are those for which it has this magnitude in every position. A motion between two positions
//! turns the direction of gravity by what the gyroscopes show; their matrix is the one that turns each direction into the next. The
//! residuals' own scatter is the standard deviation in both fits (type A).

use super::linear_model::{LinearModel, standing_out};
use crate::fit::{ByDual, Fit, FitError, FitSettings, Regression, ResidualLaw, fit};
use kalmems_core::{Covariance, Dual, Lu, Mat, Over, Scalar};
use kalmems_models::inertial::Alignment;

/// Positions that a fit of nine numbers takes at least, so that a few residuals are left.
pub(super) const FEWEST_POSITIONS: usize = 12;
/// Motions between positions that a fit of nine numbers takes at least, with two residuals each.
pub(super) const FEWEST_MOTIONS: usize = 8;

/// The means of a unit in a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Position {
    /// What the accelerometers show in m/s².
    pub force: [f64; 3],
    /// What the gyroscopes show in rad/s; zeros without any.
    pub rate: [f64; 3],
}

/// The samples of the gyroscopes between two positions, from the last sample of the first one to the first sample of the second one.
#[derive(Clone, Debug)]
pub(super) struct MotionBetween {
    /// The places of both positions.
    pub positions: [usize; 2],
    /// Rates in rad/s.
    pub rates: Vec<[f64; 3]>,
    /// From one sample to the next in s.
    pub interval_s: f64,
}

/// Nine parameters with their derivatives.
pub(super) type Dual9 = Dual<f64, 9>;

/// The accelerometers' parameters: M row by row, lower triangular, and b in m/s², of f = M·(a − b).
///
/// The frame is the accelerometers' own: x along the first sensitive axis, y in the plane of the first two.
pub(super) fn force<S: Over<f64>>(p: &[S; 9], shown: [f64; 3]) -> [S; 3] {
    let [x, y, z] = [0, 1, 2].map(|axis| S::lift(shown[axis]) - p[6 + axis]);
    [p[0] * x, p[1] * x + p[2] * y, p[3] * x + p[4] * y + p[5] * z]
}

/// K = M⁻¹, the matrix of a = K·f + b.
pub(super) fn accelerometer_matrix(p: &[Dual9; 9]) -> [[Dual9; 3]; 3] {
    let zero = Dual9::of(0.0);
    let [x, y, z] = [p[0].recip(), p[2].recip(), p[5].recip()];
    let yx = -(p[1] * x * y);
    let zy = -(p[4] * y * z);
    [[x, zero, zero], [yx, y, zero], [-(z * (p[3] * x + p[4] * yx)), zy, z]]
}

/// ‖f‖ − g in each position.
struct GravityResiduals<'a> {
    forces: &'a [[f64; 3]],
    gravity: f64,
}

impl ResidualLaw<9> for GravityResiduals<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 9], each: &mut impl FnMut(S)) {
        for shown in self.forces {
            each(norm(force(p, *shown)) - S::lift(self.gravity));
        }
    }
}

fn norm<S: Scalar>([x, y, z]: [S; 3]) -> S {
    (x * x + y * y + z * z).sqrt()
}

/// Fits the accelerometers' nine parameters to positions.
pub(super) fn fit_accelerometers(positions: &[Position], gravity: f64) -> Result<Fit<9>, FitError> {
    let forces: Vec<[f64; 3]> = positions.iter().map(|position| position.force).collect();
    let mut start = [1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    for (axis, place) in [0, 2, 5].into_iter().enumerate() {
        let values = || forces.iter().map(|force| force[axis]);
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        // Both ends of the range are near ±g if the axis pointed up and down.
        if high - low > gravity {
            start[place] = 2.0 * gravity / (high - low);
            start[6 + axis] = 0.5 * (high + low);
        }
    }
    fit(&ByDual(GravityResiduals { forces: &forces, gravity }), &FitSettings::from_start(start))
}

/// The gradient of the residual of a position in which gravity has this direction in the accelerometers' frame.
fn gradient_of(found: &Fit<9>, gravity: f64, direction: [f64; 3]) -> [f64; 9] {
    let at = Dual9::variables(&found.parameters);
    let k = accelerometer_matrix(&at);
    let shown: [f64; 3] = std::array::from_fn(|i| {
        let turned: f64 = (0..3).map(|j| k[i][j].value() * direction[j] * gravity).sum();
        turned + found.parameters[6 + i]
    });
    let mut gradient = [0.0; 9];
    let law = ByDual(GravityResiduals { forces: &[shown], gravity });
    law.linearize(&found.parameters, &mut |_, row| gradient = *row);
    gradient
}

/// A position that would make the accelerometers better known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NextPosition {
    /// The direction of the specific force, which at rest is upwards, in the accelerometers' frame.
    pub direction: [f64; 3],
    /// The root of the sum of the variances after the position over that before, with biases in units of gravity.
    pub remaining: f64,
}

/// What is known of the nine numbers before any position, as a standard deviation: of gravity for the biases.
const BEFORE: f64 = 0.1;

/// Of the faces, edges and corners of a cube the direction that reduces the sum of the variances most.
pub(super) fn next_position(positions: &[Position], found: &Fit<9>, gravity: f64) -> Option<NextPosition> {
    let variance = found.residual_deviation().powi(2).max(f64::MIN_POSITIVE);
    let unit = |place: usize| if place < 6 { 1.0 } else { gravity };
    let mut information =
        Mat::<f64, 9, 9>::from_fn(|i, j| if i == j { (BEFORE * unit(i)).powi(-2) } else { 0.0 });
    let forces: Vec<[f64; 3]> = positions.iter().map(|position| position.force).collect();
    ByDual(GravityResiduals { forces: &forces, gravity }).linearize(&found.parameters, &mut |_, row| {
        for i in 0..9 {
            for j in 0..9 {
                information.0[i][j] += row[i] * row[j] / variance;
            }
        }
    });
    let covariance = Lu::of(&information)?.inverse();
    let all: f64 = (0..9).map(|place| covariance.0[place][place] / unit(place).powi(2)).sum();
    let steps = [-1.0, 0.0, 1.0];
    let directions = steps
        .into_iter()
        .flat_map(|x| steps.into_iter().flat_map(move |y| steps.into_iter().map(move |z| [x, y, z])));
    let with = directions.filter(|direction| *direction != [0.0; 3]).map(|direction| {
        let size = norm(direction);
        let direction = direction.map(|part| part / size);
        let row = gradient_of(found, gravity, direction);
        // C·j, and by the formula of Sherman and Morrison what a further row takes from the diagonal of C.
        let moved: [f64; 9] = std::array::from_fn(|i| (0..9).map(|j| covariance.0[i][j] * row[j]).sum());
        let along: f64 = row.iter().zip(&moved).map(|(a, b)| a * b).sum();
        let taken: f64 = (0..9).map(|place| (moved[place] / unit(place)).powi(2)).sum();
        let left = all - taken / (variance + along);
        NextPosition { direction, remaining: (left.max(0.0) / all).sqrt() }
    });
    with.min_by(|a, b| a.remaining.total_cmp(&b.remaining))
}

/// How the direction of gravity in the gyroscopes' nine parameters, row by row of M in ω = M·(r − b), turns in each motion.
struct TurnResiduals<'a> {
    motions: &'a [MotionBetween],
    positions: &'a [Position],
    /// The direction of the specific force in each position.
    up: &'a [[f64; 3]],
}

fn cross<S: Scalar>(a: [S; 3], b: [S; 3]) -> [S; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot<S: Scalar>(a: [S; 3], b: [S; 3]) -> S {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Terms of the series of a rotation by less than a quarter of a radian.
const TERMS: usize = 6;

/// exp(\[v\]×)·u.
fn rotated<S: Over<f64>>(v: [S; 3], u: [S; 3]) -> [S; 3] {
    let (mut term, mut sum) = (u, u);
    for order in 1..=TERMS {
        let factor = S::lift((order as f64).recip());
        term = cross(v, term).map(|part| part * factor);
        sum = std::array::from_fn(|i| sum[i] + term[i]);
    }
    sum
}

/// Two directions square to a direction and to one another.
fn square_to(u: [f64; 3]) -> [[f64; 3]; 2] {
    let smallest = (0..3).min_by(|a, b| u[*a].abs().total_cmp(&u[*b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[smallest] = 1.0;
    let first = cross(u, other);
    let size = norm(first);
    let first = first.map(|part| part / size);
    [first, cross(u, first)]
}

impl ResidualLaw<9> for TurnResiduals<'_> {
    /// Twice the tangent of half the angle between the turned direction and the one that the accelerometers show, in both directions square to it.
    fn residuals<S: Over<f64>>(&self, p: &[S; 9], each: &mut impl FnMut(S)) {
        for motion in self.motions {
            let [from, to] = motion.positions;
            let (first, second) = (self.positions[from].rate, self.positions[to].rate);
            let last = motion.rates.len().saturating_sub(1).max(1) as f64;
            // The bias moves evenly from its mean in one position to that in the other.
            let rate = |place: usize| -> [S; 3] {
                let part = place as f64 / last;
                let shown: [f64; 3] = std::array::from_fn(|axis| {
                    motion.rates[place][axis] - (first[axis] + part * (second[axis] - first[axis]))
                });
                std::array::from_fn(|i| dot([p[3 * i], p[3 * i + 1], p[3 * i + 2]], shown.map(S::lift)))
            };
            let half = S::lift(-0.5 * motion.interval_s);
            let twelfth = S::lift(motion.interval_s.powi(2) / 12.0);
            let mut up = self.up[from].map(S::lift);
            if motion.rates.is_empty() {
                continue;
            }
            let mut before = rate(0);
            for place in 1..motion.rates.len() {
                let after = rate(place);
                // Magnus' series of du/dt = −ω × u to the fourth order, for a rate that changes evenly over the interval.
                let turning = cross(after, before);
                let step = std::array::from_fn(|i| half * (before[i] + after[i]) + twelfth * turning[i]);
                up = rotated(step, up);
                before = after;
            }
            let end = self.up[to];
            let scale = S::lift(2.0) / (S::lift(1.0) + dot(up, end.map(S::lift)));
            for direction in square_to(end) {
                each(scale * dot(up, direction.map(S::lift)));
            }
        }
    }
}

/// The matrix of r = K·ω + b from its inverse, which is fitted.
pub(super) fn gyroscope_matrix(p: &[Dual9; 9]) -> [[Dual9; 3]; 3] {
    let row = |i: usize| [p[3 * i], p[3 * i + 1], p[3 * i + 2]];
    let columns = [cross(row(1), row(2)), cross(row(2), row(0)), cross(row(0), row(1))];
    let inverse = dot(row(0), columns[0]).recip();
    std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i] * inverse))
}

/// The gyroscopes' fit, and what the accelerometers' errors add.
pub(super) struct GyroscopeFit {
    pub fit: Fit<9>,
    /// The covariance of the parameters by the errors of the accelerometers' parameters.
    pub by_accelerometers: Covariance<f64, 9>,
    /// The change of the parameters by that of the accelerometers' parameters.
    pub response: Mat<f64, 9, 9>,
}

impl GyroscopeFit {
    /// A function of the parameters: its value, its standard deviation by the motions, and that by the accelerometers.
    pub fn derived(&self, of: impl Fn(&[Dual9; 9]) -> Dual9) -> (f64, [f64; 2]) {
        let by_motions = self.fit.derived(&of);
        let other = Fit { covariance: self.by_accelerometers, ..self.fit.clone() };
        (by_motions.value, [by_motions.deviation, other.derived(&of).deviation])
    }
}

/// The direction of the specific force in each position.
fn directions(positions: &[Position], accelerometers: &[f64; 9]) -> Vec<[f64; 3]> {
    let of = |position: &Position| {
        let force = force(accelerometers, position.force);
        let size = norm(force).max(f64::MIN_POSITIVE);
        force.map(|part| part / size)
    };
    positions.iter().map(of).collect()
}

/// Fits the gyroscopes' nine parameters to the motions between positions of calibrated accelerometers.
pub(super) fn fit_gyroscopes(
    positions: &[Position],
    motions: &[MotionBetween],
    accelerometers: &Fit<9>,
) -> Result<GyroscopeFit, FitError> {
    let up = directions(positions, &accelerometers.parameters);
    let law = TurnResiduals { motions, positions, up: &up };
    let cost = |start: &[f64; 9]| {
        let mut sum = 0.0;
        law.residuals(start, &mut |residual: f64| sum += residual * residual);
        if sum.is_finite() { sum } else { f64::INFINITY }
    };
    // Axes may be exchanged or turned round: the likeliest such arrangement is where the search begins.
    let starts: Vec<[f64; 9]> = signed_permutations();
    let start = starts.into_iter().map(|start| (cost(&start), start)).min_by(|a, b| a.0.total_cmp(&b.0));
    let start = start.map_or([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], |(_, start)| start);
    let law = ByDual(law);
    let found = fit(&law, &FitSettings::from_start(start))?;
    let residuals = |accelerometers: &[f64; 9]| {
        let up = directions(positions, accelerometers);
        let mut each = Vec::with_capacity(2 * motions.len());
        TurnResiduals { motions, positions, up: &up }
            .residuals(&found.parameters, &mut |r: f64| each.push(r));
        each
    };
    let mut rows: Vec<[f64; 9]> = Vec::with_capacity(2 * motions.len());
    law.linearize(&found.parameters, &mut |_, row| rows.push(*row));
    // (JᵀJ)⁻¹ is the covariance without the variance of the residuals.
    let variance = found.sum_of_squares / found.degrees_of_freedom.max(1) as f64;
    let mut moved = Mat::<f64, 9, 9>::zero();
    for number in 0..9 {
        let step = accelerometers.covariance.standard_deviation(number).max(1e-9);
        let at = |sign: f64| {
            let mut parameters = accelerometers.parameters;
            parameters[number] += sign * step;
            residuals(&parameters)
        };
        let (more, less) = (at(1.0), at(-1.0));
        let mut right = [0.0; 9];
        for ((row, more), less) in rows.iter().zip(&more).zip(&less) {
            let by = (more - less) / (2.0 * step);
            right.iter_mut().zip(row).for_each(|(sum, part)| *sum += part * by);
        }
        for i in 0..9 {
            let sum: f64 = (0..9).map(|j| found.covariance.get(i, j) * right[j]).sum();
            moved.0[i][number] = -sum / variance.max(f64::MIN_POSITIVE);
        }
    }
    let by_accelerometers = accelerometers.covariance.transformed(&moved);
    Ok(GyroscopeFit { fit: found, by_accelerometers, response: moved })
}

/// The 48 matrices with one entry of ±1 in each row and column.
fn signed_permutations() -> Vec<[f64; 9]> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let each = |order: [usize; 3]| {
        (0..8_usize).map(move |signs| {
            let mut matrix = [0.0; 9];
            for (row, column) in order.into_iter().enumerate() {
                matrix[3 * row + column] = if signs >> row & 1 == 1 { -1.0 } else { 1.0 };
            }
            matrix
        })
    };
    orders.into_iter().flat_map(each).collect()
}

/// The residuals of the accelerometers' fit, one for each position, in m/s².
pub(super) fn gravity_residuals(positions: &[Position], found: &Fit<9>, gravity: f64) -> Vec<f64> {
    positions.iter().map(|position| norm(force(&found.parameters, position.force)) - gravity).collect()
}

/// The places of positions whose residual is not of the scatter of the others, with its size by that scatter.
pub(super) fn positions_standing_out(
    positions: &[Position],
    found: &Fit<9>,
    gravity: f64,
) -> Vec<(usize, f64)> {
    let forces: Vec<[f64; 3]> = positions.iter().map(|position| position.force).collect();
    standing_out(&ByDual(GravityResiduals { forces: &forces, gravity }), found)
}

/// Scale factors, non-orthogonality and mounting of a matrix, in the order of the axes.
pub(super) fn alignment_numbers(matrix: &[[Dual9; 3]; 3]) -> [[Dual9; 3]; 3] {
    let alignment = Alignment::of(matrix);
    [alignment.scale, alignment.non_orthogonality, alignment.mounting]
}

/// Bias in rad/s and sensitivity to the specific force in rad/s per m/s² of each gyroscope, from the means at rest. `vertical_rad_per_s` is
/// the vertical component of the Earth's rotation, which turns a unit at rest about the direction of the force.
pub(super) fn force_sensitivity(
    positions: &[Position],
    accelerometers: &Fit<9>,
    vertical_rad_per_s: f64,
) -> Result<[Fit<4>; 3], FitError> {
    let forces: Vec<[f64; 3]> =
        positions.iter().map(|position| force(&accelerometers.parameters, position.force)).collect();
    let terms: Vec<[f64; 4]> = forces.iter().map(|[x, y, z]| [1.0, *x, *y, *z]).collect();
    let of = |axis: usize| {
        let values: Vec<f64> = positions
            .iter()
            .zip(&forces)
            .map(|(position, force)| position.rate[axis] - vertical_rad_per_s * force[axis] / norm(*force))
            .collect();
        LinearModel { terms: &terms, values: &values }.fit([true; 4])
    };
    Ok([of(0)?, of(1)?, of(2)?])
}

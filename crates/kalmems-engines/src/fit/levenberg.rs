//! The Levenberg–Marquardt method with a trust region, scaling and bounds.

use super::triangle::Triangle;
use super::{Fit, FitError, Regression};
use crate::progress::{Progress, Silent};

/// An interval that a parameter may not leave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterBounds {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl ParameterBounds {
    /// All numbers.
    pub const FREE: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings<const P: usize> {
    /// Where to start.
    pub start: [f64; P],
    /// Which parameters are fitted; the others stay where they start.
    pub free: [bool; P],
    /// Where each parameter has to stay.
    pub bounds: [ParameterBounds; P],
    /// The relative change of the sum of squares and of the parameters that counts as none.
    pub tolerance: f64,
    /// The most Jacobians that are computed.
    pub iterations: usize,
    /// How far the first step may go from parameters that are all 0, where each is measured by the length of its column.
    pub first_radius: f64,
    /// Steps at the minimum that give the parameters more digits than the sum of squares tells, at most.
    pub polishes: usize,
}

impl<const P: usize> FitSettings<P> {
    /// All parameters free and without bounds.
    pub const fn from_start(start: [f64; P]) -> Self {
        Self {
            start,
            free: [true; P],
            bounds: [ParameterBounds::FREE; P],
            tolerance: 1e-14,
            iterations: 1000,
            first_radius: 100.0,
            polishes: 3,
        }
    }
}

/// Finds the parameters that make the sum of squared residuals smallest, from a start.
///
/// Moré's trust-region form of the Levenberg–Marquardt method (Lecture Notes in Mathematics 630, 105, 1978): each
/// step solves min |J·d + r| within |D·d| ≤ Δ, where D scales each parameter by the largest length its column of
/// J has had and Δ follows how well the linear model predicted the last step. A parameter at a bound that its
/// gradient pushes against is held for the step; a step that would leave the bounds stops at them.
///
/// The minimum that is found is the one that the start leads to.
pub fn fit<R: Regression<P>, const P: usize>(
    regression: &R,
    settings: &FitSettings<P>,
) -> Result<Fit<P>, FitError> {
    fit_until(regression, settings, &Silent)
}

/// The same, which asks before each pass over the data whether it is to stop.
pub fn fit_until<R: Regression<P>, const P: usize>(
    regression: &R,
    settings: &FitSettings<P>,
    progress: &dyn Progress,
) -> Result<Fit<P>, FitError> {
    check(settings)?;
    let go_on = || if progress.reached(0).is_break() { Err(FitError::Interrupted) } else { Ok(()) };
    let mut x = settings.start;
    let mut at = linearize(regression, &x, settings)?;
    let mut scale = [0.0_f64; P];
    let mut radius = None;
    for iteration in 0..settings.iterations {
        let norms = at.triangle.column_norms();
        for (d, norm) in scale.iter_mut().zip(norms) {
            *d = if *d == 0.0 && norm == 0.0 { 0.0 } else { d.max(norm) };
        }
        let d = scale.map(|s| if s == 0.0 { 1.0 } else { s });
        let free = free_to_move(&at, &x, settings);
        let triangle = at.triangle.restricted(&free);
        let size = length(&d, &x);
        // Lengths that no number holds would never be shorter than a step.
        if !size.is_finite() {
            return Err(not_converged(iteration, &x, at.cost));
        }
        let mut delta: f64 = radius.unwrap_or(if size > 0.0 { 100.0 * size } else { settings.first_radius });

        // Cosine of the angle between the residuals and each column: zero at a minimum.
        let gradient = triangle.gradient();
        let flat = at.cost == 0.0
            || (0..P).all(|i| {
                !free[i] || norms[i] == 0.0 || gradient[i].abs() <= 1e-15 * norms[i] * at.cost.sqrt()
            });
        if flat {
            return finish(regression, x, at, settings, iteration);
        }
        loop {
            let (step, lambda) = within(&triangle, &d, delta);
            let next: [f64; P] = std::array::from_fn(|i| {
                let moved = x[i] + if free[i] { step[i] } else { 0.0 };
                moved.clamp(settings.bounds[i].low, settings.bounds[i].high)
            });
            let step: [f64; P] = std::array::from_fn(|i| next[i] - x[i]);
            go_on()?;
            let size_of_step = length(&d, &step);
            if !size_of_step.is_finite() {
                return Err(not_converged(iteration, &x, at.cost));
            }
            let cost = cost(regression, &next);
            let linear = triangle.square_of(&step);
            let gradient_part: f64 = (0..P).map(|i| gradient[i] * step[i]).sum();
            let predicted = -(2.0 * gradient_part + linear);
            let gained = at.cost - cost;
            // 0 as well where it is no number, so that each pass that takes no step makes the next one shorter.
            let ratio = if predicted > 0.0 { (gained / predicted).max(0.0) } else { 0.0 };

            if ratio <= 0.25 {
                // Where along the step a parabola through both ends has its minimum.
                let slope = gradient_part;
                let shrink = if gained >= 0.0 {
                    0.5
                } else if cost.is_finite() {
                    (0.5 * slope / (slope + 0.5 * gained)).clamp(0.1, 0.5)
                } else {
                    0.1
                };
                delta = shrink * delta.min(10.0 * size_of_step);
            } else if lambda == 0.0 || ratio >= 0.75 {
                delta = 2.0 * size_of_step;
            }
            let taken = ratio >= 1e-4 && cost.is_finite();
            if taken {
                x = next;
                go_on()?;
                at = linearize(regression, &x, settings)?;
            }
            let still = predicted <= settings.tolerance * at.cost
                && gained.abs() <= settings.tolerance * at.cost
                && ratio <= 2.0;
            let tiny = delta <= settings.tolerance * size;
            if still || tiny {
                return finish(regression, x, at, settings, iteration + 1);
            }
            if taken {
                break;
            }
        }
        radius = Some(delta);
    }
    Err(not_converged(settings.iterations, &x, at.cost))
}

fn not_converged<const P: usize>(iterations: usize, x: &[f64; P], sum_of_squares: f64) -> FitError {
    FitError::NotConverged { iterations, parameters: x.to_vec(), sum_of_squares }
}

/// A few full Gauss–Newton steps at the minimum: where the sum of squares does not tell two points apart any more,
/// its gradient still does, and gives the parameters about twice as many digits.
fn finish<R: Regression<P>, const P: usize>(
    regression: &R,
    mut x: [f64; P],
    mut at: Linearized<P>,
    settings: &FitSettings<P>,
    mut iterations: usize,
) -> Result<Fit<P>, FitError> {
    for _ in 0..settings.polishes {
        let free = free_to_move(&at, &x, settings);
        let norms = at.triangle.column_norms();
        let step = at.triangle.restricted(&free).solve();
        let next: [f64; P] = std::array::from_fn(|i| if free[i] { x[i] + step[i] } else { x[i] });
        let inside = (0..P).all(|i| settings.bounds[i].low <= next[i] && next[i] <= settings.bounds[i].high);
        let small = length(&norms, &step) <= 1e-6 * length(&norms, &x);
        let same = (cost(regression, &next) - at.cost).abs() <= 1e-9 * at.cost;
        if !(inside && small && same) {
            break;
        }
        x = next;
        at = linearize(regression, &x, settings)?;
        iterations += 1;
    }
    Ok(Fit::new(x, &at, settings, iterations))
}

/// A regression linearised at one point.
pub(super) struct Linearized<const P: usize> {
    pub triangle: Triangle<P>,
    pub cost: f64,
    pub count: usize,
}

fn check<const P: usize>(settings: &FitSettings<P>) -> Result<(), FitError> {
    for (index, (start, bounds)) in settings.start.iter().zip(&settings.bounds).enumerate() {
        if !(bounds.low <= *start && *start <= bounds.high) {
            return Err(FitError::OutsideBounds { index, start: *start, low: bounds.low, high: bounds.high });
        }
    }
    Ok(())
}

#[allow(clippy::needless_range_loop)] // a row for each sample: an adapter of iterators is a call
fn linearize<R: Regression<P>, const P: usize>(
    regression: &R,
    x: &[f64; P],
    settings: &FitSettings<P>,
) -> Result<Linearized<P>, FitError> {
    let mut at = Linearized { triangle: Triangle::new(), cost: 0.0, count: 0 };
    let mut bad = None;
    regression.linearize(x, &mut |residual, gradient| {
        let mut is_finite = residual.is_finite();
        let mut row = [0.0; P];
        for i in 0..P {
            is_finite &= gradient[i].is_finite();
            row[i] = if settings.free[i] { gradient[i] } else { 0.0 };
        }
        if !is_finite {
            bad.get_or_insert(at.count);
        }
        at.triangle.push(row, residual);
        at.cost += residual * residual;
        at.count += 1;
    });
    if let Some(index) = bad {
        return Err(FitError::NotFiniteAtStart { index, start: x.to_vec() });
    }
    let parameters = settings.free.iter().filter(|f| **f).count();
    if at.count < parameters {
        return Err(FitError::TooFew { residuals: at.count, parameters });
    }
    Ok(at)
}

/// The sum of squares; infinite where a residual is not finite.
fn cost<R: Regression<P>, const P: usize>(regression: &R, x: &[f64; P]) -> f64 {
    let mut sum = 0.0;
    regression.residuals(x, &mut |residual| sum += residual * residual);
    if sum.is_finite() { sum } else { f64::INFINITY }
}

/// Free parameters that no bound holds against the gradient.
fn free_to_move<const P: usize>(at: &Linearized<P>, x: &[f64; P], settings: &FitSettings<P>) -> [bool; P] {
    let gradient = at.triangle.gradient();
    std::array::from_fn(|i| {
        let (bounds, downhill) = (settings.bounds[i], -gradient[i]);
        let held = (x[i] <= bounds.low && downhill < 0.0) || (x[i] >= bounds.high && downhill > 0.0);
        settings.free[i] && !held
    })
}

/// |D·v|.
fn length<const P: usize>(d: &[f64; P], v: &[f64; P]) -> f64 {
    d.iter().zip(v).map(|(d, v)| (d * v).powi(2)).sum::<f64>().sqrt()
}

/// The step that makes |J·d + r| smallest within |D·d| ≤ Δ, and the λ that keeps it there.
fn within<const P: usize>(triangle: &Triangle<P>, d: &[f64; P], radius: f64) -> ([f64; P], f64) {
    let scaled = |v: &[f64; P]| length(d, v);
    let full_rank = (0..P).all(|i| triangle.r[i][i] != 0.0);
    let newton = triangle.solve();
    let excess = scaled(&newton) - radius;
    if excess <= 0.1 * radius && newton.iter().all(|v| v.is_finite()) {
        return (newton, 0.0);
    }
    // |D·d(λ)| falls with λ; Newton's method on its reciprocal between safe ends.
    let mut low = 0.0;
    if full_rank && newton.iter().all(|v| v.is_finite()) {
        let v: [f64; P] = std::array::from_fn(|i| d[i] * d[i] * newton[i] / scaled(&newton));
        let w = length(&[1.0; P], &triangle.solve_transposed(&v));
        low = excess / (radius * w * w);
    }
    let gradient = triangle.gradient();
    let mut high = length(&d.map(f64::recip), &gradient) / radius;
    if !(low.is_finite() && low >= 0.0 && low < high) {
        low = 0.0;
    }
    let mut lambda = (low.max(1e-3 * high)).max(f64::MIN_POSITIVE);
    let mut step = newton;
    for _ in 0..60 {
        let mut damped = *triangle;
        for (i, scale) in d.iter().enumerate() {
            let row = std::array::from_fn(|j| if i == j { lambda.sqrt() * scale } else { 0.0 });
            damped.push(row, 0.0);
        }
        step = damped.solve();
        let size = scaled(&step);
        let excess = size - radius;
        if excess.abs() <= 0.1 * radius || (low == 0.0 && excess < 0.0 && lambda <= f64::MIN_POSITIVE) {
            break;
        }
        if excess > 0.0 {
            low = low.max(lambda);
        } else {
            high = high.min(lambda);
        }
        let v: [f64; P] = std::array::from_fn(|i| d[i] * d[i] * step[i] / size);
        let w = length(&[1.0; P], &damped.solve_transposed(&v));
        let newton = lambda + excess / (radius * w * w);
        lambda = if newton > low && newton < high {
            newton
        } else {
            (low * high).sqrt().max(0.5 * (low + 1e-3 * high))
        };
    }
    (step, lambda)
}

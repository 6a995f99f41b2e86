//! Two disks with all of their fringing field.

use super::VACUUM_PERMITTIVITY;
use core::f64::consts::{FRAC_1_PI, PI};
use kalmems_core::{Lu, Mat, Scalar};

/// Two equal coaxial disks without thickness in empty space, at opposite potentials.
///
/// C = 2·ε₀·a·∫f over [−1, 1] with Love's integral equation
///
/// f(x) − (1/π)·∫ κ/(κ² + (x − t)²)·f(t) dt = 1 over [−1, 1], κ = d/a
///
/// (Love, Quarterly Journal of Mechanics and Applied Mathematics 2, 428, 1949): exact, fringing fields included. Solved
/// at Gauss and Legendre's nodes (Nyström's method); the kernel's poles at ±i·κ make the error fall as
/// e^{−2·κ·nodes}.
///
/// For set-up work, such as a table C(d) to fit a [`DistanceSeries`](super::DistanceSeries) to.
///
/// ```
/// use kalmems_models::capacitance::{CoaxialDisks, ParallelPlate};
/// let disks = CoaxialDisks { radius: 1.9e-3 };
/// let plate = ParallelPlate { area: std::f64::consts::PI * 1.9e-3 * 1.9e-3, relative_permittivity: 1.0 };
/// // The fringing field adds seven tenths.
/// let fringe = disks.capacitance(1e-3).map(|c| c / plate.capacitance(1e-3_f64));
/// assert!(fringe.is_some_and(|fringe| (1.6..1.8).contains(&fringe)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoaxialDisks {
    /// a in m.
    pub radius: f64,
}

/// Nodes on [0, 1] of those on [−1, 1]: f is even.
const HALF: usize = 64;
/// The smallest κ: e^{−2·0.13·128} is 4e−15.
const NEAREST: f64 = 0.13;

impl CoaxialDisks {
    /// C(d) in F, d in m. `None` where d is below 0.13 radii, where the nodes are too few, or not a number.
    pub fn capacitance(&self, distance: f64) -> Option<f64> {
        let solution = solve(distance / self.radius)?;
        let integral = solution.nodes.iter().map(|node| 2.0 * node.weight * node.value).sum::<f64>();
        Some(2.0 * VACUUM_PERMITTIVITY * self.radius * integral)
    }
}

/// Love's f at the nodes.
struct Solution {
    nodes: [QuadratureNode; HALF],
}

#[derive(Clone, Copy, Default)]
struct QuadratureNode {
    x: f64,
    weight: f64,
    value: f64,
}

/// The kernel for an even f: from t and from −t.
fn kernel(kappa: f64, x: f64, t: f64) -> f64 {
    let one = |distance: f64| kappa / (kappa * kappa + distance * distance);
    FRAC_1_PI * (one(x - t) + one(x + t))
}

fn solve(kappa: f64) -> Option<Solution> {
    if !(kappa >= NEAREST && kappa.is_finite()) {
        return None;
    }
    let mut nodes = gauss_legendre();
    let mut matrix = Mat::<f64, HALF, HALF>::identity();
    for (row, at) in matrix.0.iter_mut().zip(&nodes) {
        for (entry, from) in row.iter_mut().zip(&nodes) {
            *entry -= kernel(kappa, at.x, from.x) * from.weight;
        }
    }
    let right = Mat::<f64, HALF, 1>([[1.0]; HALF]);
    let solved = Lu::of(&matrix)?.solve(&right);
    for (node, [value]) in nodes.iter_mut().zip(solved.0) {
        node.value = value;
    }
    Some(Solution { nodes })
}

impl Solution {
    /// f anywhere, from the equation itself.
    #[cfg(test)]
    fn at(&self, kappa: f64, x: f64) -> f64 {
        1.0 + self.nodes.iter().map(|node| kernel(kappa, x, node.x) * node.weight * node.value).sum::<f64>()
    }
}

/// The positive ones of 2·HALF nodes on [−1, 1], with their weights: zeros of the Legendre polynomial by Newton's method.
fn gauss_legendre() -> [QuadratureNode; HALF] {
    let order = 2.0 * HALF as f64;
    let mut nodes = [QuadratureNode::default(); HALF];
    for (i, node) in nodes.iter_mut().enumerate() {
        let mut x = Scalar::cos(PI * (i as f64 + 0.75) / (order + 0.5));
        let mut slope = 0.0;
        for _ in 0..10 {
            let (mut before, mut polynomial) = (1.0, x);
            for degree in 2..=2 * HALF {
                let n = degree as f64;
                let next = ((2.0 * n - 1.0) * x * polynomial - (n - 1.0) * before) / n;
                before = polynomial;
                polynomial = next;
            }
            slope = order * (x * polynomial - before) / (x * x - 1.0);
            x -= polynomial / slope;
        }
        *node = QuadratureNode { x, weight: 2.0 / ((1.0 - x * x) * slope * slope), value: 0.0 };
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Love's equation with κ = 1 is the usual test of programs for integral equations; its solution is tabulated
    /// (Baker, The Numerical Treatment of Integral Equations, 1977).
    #[test]
    fn the_solution_is_the_tabulated_one() {
        let solution = solve(1.0).unwrap();
        for (x, published) in
            [(0.0, 1.91903), (0.25, 1.89962), (0.5, 1.84239), (0.75, 1.75195), (1.0, 1.63970)]
        {
            let found = solution.at(1.0, x);
            assert!((found - published).abs() < 1e-5, "{x}: {found}");
        }
    }

    /// Near: Kirchhoff's C = ε₀·a·(π/κ + ln(16π/κ) − 1) and the next term, κ/(4π)·(ln²(16π/κ) − 2) (Reichert and
    /// Ristivojevic, Analytical results for the capacitance of a circular plate capacitor, 2020). Far: two disks of
    /// 8·ε₀·a in series.
    #[test]
    fn near_and_far_are_the_known_laws() {
        let scaled =
            |kappa: f64| CoaxialDisks { radius: 1.0 }.capacitance(kappa).unwrap() / VACUUM_PERMITTIVITY;
        let left = |kappa: f64| {
            let logarithm = (16.0 * PI / kappa).ln();
            let law = PI / kappa + logarithm - 1.0 + kappa / (4.0 * PI) * (logarithm.powi(2) - 2.0);
            scaled(kappa) - law
        };
        // What is left is of the next order, κ² times powers of the logarithm.
        for kappa in [0.13, 0.2] {
            assert!(left(kappa).abs() < kappa * kappa, "{kappa}: {}", left(kappa));
            let order = (left(2.0 * kappa) / left(kappa)).log2();
            assert!((1.5..2.2).contains(&order), "{kappa}: {order}");
        }
        for kappa in [30.0, 300.0] {
            // First order of the iterated equation: ∫f = 2 + 4/(π·κ).
            assert!(
                (scaled(kappa) / 4.0 - 1.0 - 2.0 / (PI * kappa)).abs() < 1.0 / (kappa * kappa),
                "{kappa}"
            );
        }
        assert_eq!(CoaxialDisks { radius: 1.0 }.capacitance(0.1), None);
        assert_eq!(CoaxialDisks { radius: 1.0 }.capacitance(f64::NAN), None);
    }
}

//! Where a device rests.

// Index loops over states are the notation of the equations.
#![allow(clippy::needless_range_loop)]

use crate::motion::{MOST_STATES, Motion};
use crate::program::ProgramNumbers;
use kalmems_core::{Lu, Mat};

/// Steps of Newton's method at most.
const MOST_STEPS: usize = 60;
/// How often a step is halved that leads away.
const MOST_HALVINGS: usize = 30;

impl Motion {
    /// The state in which the rates of its moving states vanish, but for those that are `held` as they are, by Newton's method
    /// from a start; `None` where none is found.
    ///
    /// Solves fᵢ(x, u) = 0 for every i that is not held. States that no rate pins down, such as a cyclic phase, are to be held.
    pub fn rest(
        &self,
        work: &mut ProgramNumbers,
        start: &[f64],
        held: &[bool],
        inputs: &[f64],
    ) -> Option<Vec<f64>> {
        let states = self.states();
        let is_held = |i: usize| i >= self.moving() || held.get(i).copied().unwrap_or(false);
        let mut x = start.to_vec();
        let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
        if x.len() != states || !self.linearize(work, &x, inputs, &mut rates, &mut jacobian) {
            return None;
        }
        for _ in 0..MOST_STEPS {
            // Rows and columns of held states, and those behind, are the identity's.
            let matrix = Mat::<f64, MOST_STATES, MOST_STATES>::from_fn(|i, j| {
                if i < states && j < states && !is_held(i) && !is_held(j) {
                    jacobian[i * states + j]
                } else {
                    f64::from(u8::from(i == j))
                }
            });
            let wanted = |i: usize| if i < states && !is_held(i) { -rates[i] } else { 0.0 };
            // Each row by its largest entry, so that rates in different units meet on equal terms.
            let largest = |i: usize| matrix.0[i].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
            let scaled = Mat::<f64, MOST_STATES, MOST_STATES>::from_fn(|i, j| matrix.0[i][j] / largest(i));
            let b = Mat::<f64, MOST_STATES, 1>::from_fn(|i, _| wanted(i) / largest(i));
            let step = Lu::of(&scaled)?.solve(&b);
            let size = |rates: &[f64]| {
                let of = |i: usize| if is_held(i) { 0.0 } else { (rates[i] / largest(i)).abs() };
                (0..states).map(of).fold(0.0, f64::max)
            };
            let before = size(&rates);
            let mut share = 1.0;
            let moved = (0..MOST_HALVINGS).find_map(|_| {
                let next: Vec<f64> = (0..states).map(|i| x[i] + share * step.0[i][0]).collect();
                let finite = self.linearize(work, &next, inputs, &mut rates, &mut jacobian);
                share *= 0.5;
                (finite && (size(&rates) < before || before == 0.0)).then_some(next)
            });
            let Some(next) = moved else {
                // No step is better: the rates are rounding, or there is no rest near here.
                self.linearize(work, &x, inputs, &mut rates, &mut jacobian);
                let tiny =
                    (0..states).all(|i| step.0[i][0].abs() <= 1e-9 * x[i].abs().max(f64::MIN_POSITIVE));
                return (tiny || before == 0.0).then_some(x);
            };
            let settled = next.iter().zip(&x).all(|(next, x)| (next - x).abs() <= 1e-14 * next.abs());
            x = next;
            if settled {
                return Some(x);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use crate::{Description, Device};

    #[test]
    fn a_plate_rests_where_spring_and_pull_agree() {
        // k·x = ε·A·V²/(2·(g − x)²): the root of a cubic, checked in the equation itself.
        let text = r#"
        [states]
        x = "m"
        v = "m/s"
        [inputs]
        V = "V"
        [parameters]
        m = "1e-9 kg"
        k = "5 N/m"
        b = "1e-6 N s/m"
        A = "1e-6 m^2"
        g = "2 um"
        eps = "8.8542 pF/m"
        [derivative]
        x = "v"
        v = "(eps*A*V^2/(2*(g - x)^2) - k*x - b*v)/m"
        [measure]
        out = "x*1[V/um] in V"
        "#;
        let device = Device::of(&Description::read(text).unwrap()).unwrap();
        let motion = device.motion(&[]).unwrap();
        let mut work = motion.work(&device.values());
        let rest = motion.rest(&mut work, &[0.0, 0.0], &[false, false], &[1.0]).unwrap();
        let pull = 8.8542e-12 * 1e-6 / (2.0 * (2e-6 - rest[0]).powi(2));
        assert!((5.0 * rest[0] / pull - 1.0).abs() < 1e-12, "{rest:?}");
        assert_eq!(rest[1], 0.0);
        // Beyond pull-in there is no rest between the plates.
        let beyond = motion.rest(&mut work, &[0.0, 0.0], &[false, false], &[10.0]);
        assert!(beyond.is_none_or(|rest| !(0.0..2e-6).contains(&rest[0])), "pull-in");
        // What is held stays.
        let held = motion.rest(&mut work, &[1e-7, 3.0], &[true, false], &[1.0]);
        assert!(held.is_none_or(|held| held[0] == 1e-7));
    }
}

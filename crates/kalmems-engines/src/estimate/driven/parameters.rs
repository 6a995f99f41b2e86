//! Parameters of a device that are states of a filter.

use crate::estimate::{MOST_STATES, Tracked};
use kalmems_core::ProcessNoise;
use kalmems_core::augmentation::AddedState;

/// The most parameters that a filter can have as states: of a motion with more there is no filter, which is refused before
/// any step.
const MOST_PARAMETERS: usize = MOST_STATES;

/// The step of parameters that are states behind those of a motion: each depends on itself alone.
#[derive(Clone, Copy, Debug)]
pub struct ParameterStep {
    count: usize,
    /// How much of each deviation is left after the interval, and the variance that is added to it.
    steps: [(f64, f64); MOST_PARAMETERS],
}

impl ParameterStep {
    /// Of so many added states, over an interval in s.
    pub fn of(added: impl Iterator<Item = AddedState<f64>>, interval_s: f64) -> Self {
        let (mut count, mut steps) = (0, [(1.0, 0.0); MOST_PARAMETERS]);
        for (step, added) in steps.iter_mut().zip(added) {
            *step = added.drift.over(interval_s);
            count += 1;
        }
        Self { count, steps }
    }

    /// Where the parameters go, behind `moving` states.
    pub fn advance(&self, moving: usize, x: &[f64], to: &mut [f64]) {
        for ((to, x), (persistence, _)) in to[moving..].iter_mut().zip(&x[moving..]).zip(self.steps) {
            *to = x * persistence;
        }
    }

    /// Their rows of a Jacobian.
    pub fn linearize(&self, moving: usize, states: usize, jacobian: &mut [f64]) {
        for i in moving..states {
            let row = &mut jacobian[i * states..(i + 1) * states];
            row.fill(0.0);
            row[i] = self.steps[i - moving].0;
        }
    }

    /// Covariance and root of the noise of all states, with that of a motion of so many.
    pub fn noise<const M: usize>(
        &self,
        (of_motion, moving): (&ProcessNoise<f64, M>, usize),
        covariance: &mut [f64],
        root: &mut [f64],
    ) {
        let states = moving + self.count;
        for (whole, part) in
            [(&mut *covariance, of_motion.covariance().lower_triangle()), (&mut *root, of_motion.root())]
        {
            whole.fill(0.0);
            for (row, part) in whole.chunks_exact_mut(states).zip(&part.0).take(moving) {
                row[..moving].copy_from_slice(&part[..moving]);
            }
        }
        for (i, (_, variance)) in (moving..states).zip(self.steps) {
            covariance[i * states + i] = variance;
            root[i * states + i] = variance.sqrt();
        }
    }
}

/// By how much each of these parameters is off in each of several models: as stated, and by its deviation to both sides, in all
/// combinations.
pub fn combinations(tracked: &[Tracked]) -> Vec<Vec<f64>> {
    let mut shifts: Vec<Vec<f64>> = vec![Vec::new()];
    for tracked in tracked {
        let off = tracked.sd * tracked.added.scale;
        shifts = [0.0, -off, off]
            .into_iter()
            .flat_map(|shift| shifts.iter().map(move |before| [&before[..], &[shift]].concat()))
            .collect();
    }
    shifts
}

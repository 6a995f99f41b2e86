//! What holds a measured state where it is, as far as that changes slowly: the acceleration of a mass, a force, a rate of turn.

use super::own_device::OwnDevice;
use super::start::groups;
use kalmems_core::{Lu, Mat};
use kalmems_equations::{Motion, ProgramNumbers};
use std::collections::BTreeSet;

/// States that move with a measured one, at most.
const MOST: usize = 8;
/// Newton's steps, at most; a force that does not depend on what it holds takes one.
const STEPS: usize = 20;
/// How far the last step may go, relative to where it leads.
const NEAR: f64 = 1e-12;

/// The one state outside of the motion of a measured one that acts on it.
pub struct HeldSource {
    motion: Motion,
    measured: usize,
    /// The states that move with the measured one, itself among them.
    moving: Vec<usize>,
    /// Those of them that are not known, and behind them what acts.
    unknown: Vec<usize>,
}

impl HeldSource {
    /// Of a measured state; `None` where no state acts on its motion, or several do.
    pub fn of(own: &OwnDevice, measured: usize) -> Option<Self> {
        let known: Vec<(usize, usize)> = own.motion.sparsity().collect();
        let moving =
            groups(own.device.own_states(), &known).into_iter().find(|group| group.contains(&measured))?;
        let acts = known.iter().filter(|(row, column)| moving.contains(row) && !moving.contains(column));
        let acting: BTreeSet<usize> = acts.map(|(_, column)| *column).collect();
        let (1, Some(source)) = (acting.len(), acting.first().copied()) else { return None };
        let is_unknown = |state: &usize| *state != measured;
        let unknown: Vec<usize> = moving.iter().copied().filter(is_unknown).chain([source]).collect();
        (moving.len() <= MOST).then(|| Self { motion: own.motion.clone(), measured, moving, unknown })
    }

    /// The state that acts.
    pub fn state(&self) -> usize {
        self.unknown.last().copied().unwrap_or_default()
    }

    /// What it works on, with these values of all parameters.
    pub fn work(&self, values: &[f64]) -> ProgramNumbers {
        self.motion.work(values)
    }

    /// The value under which nothing of the motion changes, with its slope by the measured state; `None` where there is none.
    pub fn value_at(&self, work: &mut ProgramNumbers, x: &mut [f64], inputs: &[f64]) -> Option<[f64; 2]> {
        let states = x.len();
        let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
        let count = self.moving.len();
        for _ in 0..STEPS {
            if !self.motion.linearize(work, x, inputs, &mut rates, &mut jacobian) {
                return None;
            }
            let slope =
                |i: usize, column: usize| self.moving.get(i).map(|row| jacobian[row * states + column]);
            let matrix = Mat::<f64, MOST, MOST>::from_fn(|i, j| {
                let one = if i == j { 1.0 } else { 0.0 };
                self.unknown.get(j).and_then(|column| slope(i, *column)).filter(|_| i < count).unwrap_or(one)
            });
            let left = Mat::<f64, MOST, 2>::from_fn(|i, j| match (self.moving.get(i), j) {
                (Some(row), 0) => -rates[*row],
                (Some(_), _) => -slope(i, self.measured).unwrap_or(0.0),
                (None, _) => 0.0,
            });
            let steps = Lu::of(&matrix)?.solve(&left).0;
            let mut is_near = true;
            for ([step, _], state) in steps.iter().zip(&self.unknown) {
                x[*state] += step;
                is_near &= step.abs() <= NEAR * x[*state].abs();
            }
            if is_near {
                return Some([x[self.state()], steps[count - 1][1]]).filter(|found| found[0].is_finite());
            }
        }
        None
    }
}

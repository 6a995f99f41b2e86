//! What happens to the states at once where an expression passes zero: a bounce, a switch with hysteresis, backlash.

use crate::device::Device;
use crate::error::EquationError;
use crate::graph::NodeId;
use crate::motion::{MOST_STATES, Motion, StepTables, padded};
use crate::program::ProgramNumbers;
use crate::readout::Reading;
use kalmems_core::Nodes;

/// Which way an expression passes zero where a reset happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrossingDirection {
    /// From below.
    Rising,
    /// From above.
    Falling,
    /// From either side.
    Either,
}

impl CrossingDirection {
    /// Whether it has passed from one value to another; one that begins at zero has passed it before.
    fn is_between(self, before: f64, after: f64) -> bool {
        let rises = before < 0.0 && after >= 0.0;
        let falls = before > 0.0 && after <= 0.0;
        match self {
            Self::Rising => rises,
            Self::Falling => falls,
            Self::Either => rises || falls,
        }
    }
}

/// A reset of a device, in its graph.
#[derive(Clone, Debug)]
pub(crate) struct DeviceReset {
    pub(crate) passing: CrossingDirection,
    pub(crate) crossing: NodeId,
    /// The states that are set, and what to.
    pub(crate) set: Vec<(usize, NodeId)>,
}

/// One of them, ready to run.
#[derive(Clone, Debug)]
struct Reset {
    passing: CrossingDirection,
    crossing: Reading,
    set: Vec<(usize, Reading)>,
}

/// The resets of a device, and a step of its motion with all that happen within it.
#[derive(Clone, Debug)]
pub struct Resets {
    all: Vec<Reset>,
    tables: StepTables,
}

/// A step that resets may interrupt: the motion with what it works on, the inputs over the step, its length in s, and what makes tables of a part
/// of it.
pub struct ResetStep<'a, 'b> {
    /// The motion.
    pub motion: &'a Motion,
    /// What it works on.
    pub work: &'a mut ProgramNumbers,
    /// The inputs at its start, middle and end.
    pub inputs: &'a Nodes<&'b [f64]>,
    /// The length of the step in s.
    pub length_s: f64,
    /// Makes tables those of a step of a length in s.
    pub set_tables: &'a mut dyn FnMut(&mut StepTables, f64),
}

/// Resets in one step at most: what happens more often has come to rest against what resets it.
const MOST_RESETS: usize = 16;
/// Halvings of the time in which a reset lies: to the last digit of a number.
const HALVINGS: usize = 80;

/// A number for each state.
type States = [f64; MOST_STATES];

impl Device {
    /// Its resets, with these values of all parameters and with some of these as states of the motion; `None` where it has none.
    ///
    /// # Errors
    ///
    /// Where their derivatives are too large.
    pub fn resets(
        &self,
        parameters: &[f64],
        (motion, free): (&Motion, &[usize]),
    ) -> Result<Option<Resets>, EquationError> {
        let reading = |node: NodeId| Ok(Reading::new(self.readout_of(node, free, "when")?, parameters));
        let one = |reset: &DeviceReset| {
            let set = reset.set.iter().map(|(state, node)| Ok((*state, reading(*node)?)));
            let set = set.collect::<Result<_, EquationError>>()?;
            Ok(Reset { passing: reset.passing, crossing: reading(reset.crossing)?, set })
        };
        let all: Vec<Reset> = self.resets.iter().map(one).collect::<Result<_, EquationError>>()?;
        Ok((!all.is_empty()).then(|| Resets { all, tables: motion.tables() }))
    }

    /// Whether something happens to its states at once.
    pub fn has_resets(&self) -> bool {
        !self.resets.is_empty()
    }
}

impl Resets {
    /// Takes what a step without resets has led to from x, `to` with its derivatives where there is room for them, for one with all resets
    /// within the step. False where a number is not finite, and where more than 16 resets happen in it.
    ///
    /// A reset x⁺ = r(x⁻) at the time at which g(x) = 0 moves what is near the motion by the saltation matrix
    /// ∂r/∂x + (f⁺ − ∂r/∂x·f⁻)·(∂g/∂x)/(∂g/∂x·f⁻), with the rates f⁻ and f⁺ before and behind it (Aizerman & Gantmakher, 1958; Kong, Payne,
    /// Zhu & Johnson, Saltation matrices, Proc. IEEE 112, 585, 2024).
    pub fn follow(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        x: &[f64],
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        let size = x.len();
        let mut at: States = padded(x, size);
        let mut from = 0.0;
        // The derivatives of `at` by x, from the first reset on.
        let mut before = Vec::new();
        for _ in 0..=MOST_RESETS {
            let Some((reset, part)) = self.first(step, &at[..size], to, from) else { return true };
            let mut slopes = vec![0.0; if jacobian.is_empty() { 0 } else { size * size }];
            let mut event = [0.0; MOST_STATES];
            let event = &mut event[..size];
            if !self.lead(step, &at[..size], (from, part), event, &mut slopes) {
                return false;
            }
            from += part;
            let mut behind = [0.0; MOST_STATES];
            let jumped = self.jump(step, (reset, from), event, &mut behind[..size]);
            let Some(saltation) = jumped else { return false };
            if !slopes.is_empty() {
                let led = if before.is_empty() { slopes } else { product(&slopes, &before, size) };
                before = product(&saltation, &led, size);
            }
            at = behind;
            // What is left of the step.
            let left = 1.0 - from;
            if left <= 0.0 {
                to.copy_from_slice(&at[..size]);
                if !jacobian.is_empty() {
                    jacobian.copy_from_slice(&before);
                }
                return true;
            }
            if !self.lead(step, &at[..size], (from, left), to, jacobian) {
                return false;
            }
            if !jacobian.is_empty() {
                let whole = product(jacobian, &before, size);
                jacobian.copy_from_slice(&whole);
            }
        }
        false
    }

    /// The first reset on the way from `at`, and the part of the step that leads to it; `None` where there is none.
    fn first(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        at: &[f64],
        to: &[f64],
        from: f64,
    ) -> Option<(usize, f64)> {
        let mut first: Option<(usize, f64)> = None;
        for place in 0..self.all.len() {
            let before = self.all[place].crossing.read(at, &[]);
            let after = self.all[place].crossing.read(to, &[]);
            if !self.all[place].passing.is_between(before, after) {
                continue;
            }
            // [low, high] holds the passing; where it ends the expression has passed.
            let (mut low, mut high) = (0.0, first.map_or(1.0 - from, |(_, part)| part));
            let mut lead = [0.0; MOST_STATES];
            let mut passed = |resets: &mut Self, part: f64| {
                let lead = &mut lead[..at.len()];
                let finite = resets.lead(step, at, (from, part), lead, &mut []);
                let value = resets.all[place].crossing.read(lead, &[]);
                finite.then(|| resets.all[place].passing.is_between(before, value))
            };
            // One that comes behind another is looked for again from there.
            if first.is_some() && passed(self, high) != Some(true) {
                continue;
            }
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                match passed(self, middle) {
                    Some(true) | None => high = middle,
                    Some(false) => low = middle,
                }
            }
            first = Some((place, high));
        }
        first
    }

    /// Where a part of a step leads to.
    fn lead(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        at: &[f64],
        (from, part): (f64, f64),
        to: &mut [f64],
        slopes: &mut [f64],
    ) -> bool {
        let mut nodes = [[0.0; MOST_STATES]; 3];
        let count = step.inputs.start.len().min(MOST_STATES);
        for (node, share) in nodes.iter_mut().zip([0.0, 0.5, 1.0]) {
            inputs_at(step.inputs, from + share * part, &mut node[..count]);
        }
        let [start, middle, end] = &nodes;
        let inputs = Nodes { start: &start[..count], middle: &middle[..count], end: &end[..count] };
        (step.set_tables)(&mut self.tables, part * step.length_s);
        let (motion, tables) = (step.motion, &self.tables);
        to[motion.moving()..].copy_from_slice(&at[motion.moving()..]);
        if slopes.is_empty() {
            motion.step(step.work, at, &inputs, tables, to)
        } else {
            motion.linearized_step(step.work, at, &inputs, tables, to, slopes)
        }
    }

    /// The states behind a reset and its saltation matrix; `None` where a number is not finite.
    fn jump(
        &mut self,
        step: &mut ResetStep<'_, '_>,
        (reset, when): (usize, f64),
        event: &[f64],
        behind: &mut [f64],
    ) -> Option<Vec<f64>> {
        let size = event.len();
        let mut inputs = [0.0; MOST_STATES];
        let count = step.inputs.start.len().min(MOST_STATES);
        let inputs = &mut inputs[..count];
        inputs_at(step.inputs, when, inputs);
        behind.copy_from_slice(event);
        let mut saltation = vec![0.0; size * size];
        (0..size).for_each(|k| saltation[k * (size + 1)] = 1.0);
        let Reset { crossing, set, .. } = &mut self.all[reset];
        for (state, reading) in set {
            behind[*state] =
                reading.linearize(event, &[], &mut saltation[*state * size..(*state + 1) * size]);
        }
        let (mut before, mut after) = ([0.0; MOST_STATES], [0.0; MOST_STATES]);
        let finite = step.motion.rates(step.work, event, inputs, &mut before[..size])
            && step.motion.rates(step.work, behind, inputs, &mut after[..size]);
        let mut normal = vec![0.0; size];
        crossing.linearize(event, &[], &mut normal);
        let speed: f64 = normal.iter().zip(&before).map(|(n, f)| n * f).sum();
        for (row, after) in saltation.chunks_exact_mut(size).zip(&after) {
            let moved: f64 = row.iter().zip(&before).map(|(slope, f)| slope * f).sum();
            for (entry, n) in row.iter_mut().zip(&normal) {
                *entry += (after - moved) * n / speed;
            }
        }
        let is_finite = finite && saltation.iter().chain(behind.iter()).all(|value| value.is_finite());
        is_finite.then_some(saltation)
    }
}

/// The inputs at a share of a step, on the parabola through its start, middle and end.
fn inputs_at(Nodes { start, middle, end }: &Nodes<&[f64]>, share: f64, to: &mut [f64]) {
    let [a, b, c] =
        [(2.0 * share - 1.0) * (share - 1.0), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)];
    for (k, to) in to.iter_mut().enumerate() {
        *to = a * start[k] + b * middle[k] + c * end[k];
    }
}

/// The product of two square matrices, row by row.
fn product(a: &[f64], b: &[f64], size: usize) -> Vec<f64> {
    let mut all = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..size {
            all[i * size + j] = (0..size).map(|k| a[i * size + k] * b[k * size + j]).sum();
        }
    }
    all
}

//! An event as a measurement: what its expression was when it happened, as the present state says it.

use super::model::{EquationModel, chain};
use crate::estimate::Sensor;
use crate::estimate::driven::SegmentDrive;
use crate::signal::quintic_between;
use kalmems_core::Nodes;
use kalmems_equations::{MOST_STATES, StepTables};

/// The way back from a row to the time of an event: the interval in equal steps, with the inputs at the ends and in the middle of each.
#[derive(Default)]
pub struct BackwardInterval {
    /// The tables of a step, which leads back, and how many there are.
    tables: Option<StepTables>,
    steps: usize,
    /// The inputs, at every half of a step.
    inputs: Vec<f64>,
    count: usize,
}

/// Steps of a way back at most.
const MOST_STEPS: f64 = 65_536.0;

impl BackwardInterval {
    /// Goes from row `k` to a time in s, in steps that follow the model's motion, along the inputs over the rows.
    pub fn to(
        &mut self,
        (time_s, k, then_s): (&[f64], usize, f64),
        (model, interval_s): (&EquationModel, f64),
        inputs: &[SegmentDrive<'_>],
    ) {
        let now_s = time_s[k];
        // Inputs are another polynomial from row to row, so that no step goes over several of them.
        let pace = if inputs.is_empty() { model.pace() } else { model.pace().max(interval_s.recip()) };
        let steps = ((now_s - then_s).abs() * pace).ceil().clamp(1.0, MOST_STEPS);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let count = steps as usize;
        let step_s = (then_s - now_s) / steps;
        (self.steps, self.count) = (count, inputs.len());
        self.tables = Some(model.tables_back(step_s));
        self.inputs.clear();
        let last = time_s.len().saturating_sub(1);
        for half in 0..=2 * self.steps {
            let at_s = now_s + 0.5 * step_s * half as f64;
            let to = time_s.partition_point(|t| *t < at_s).clamp(last.min(1), last);
            self.inputs
                .extend(inputs.iter().map(|input| quintic_between(time_s, |i| input.sample(i).0, to, at_s)));
        }
    }

    fn at(&self, half: usize) -> &[f64] {
        self.inputs.get(half * self.count..(half + 1) * self.count).unwrap_or_default()
    }

    fn nodes(&self, step: usize) -> Nodes<&[f64]> {
        Nodes { start: self.at(2 * step), middle: self.at(2 * step + 1), end: self.at(2 * step + 2) }
    }
}

/// The expression of an event at its time, as a function of the present state: the motion is taken back to it.
///
/// States that the event does not depend on stay as they are on the way back: a fast pole behind the motion would grow without bound.
pub struct EventSensor<'a> {
    /// The equations.
    pub model: &'a EquationModel,
    /// The event, by its place among those of the model.
    pub event: usize,
    /// The way back to it.
    pub way: &'a BackwardInterval,
    /// By how many s more of each state makes the event seem late, as a signal shows it to which inputs add more than is known; none without.
    pub late_s: &'a [f64],
}

/// The largest matrix of derivatives.
type Square = [f64; MOST_STATES * MOST_STATES];

impl EventSensor<'_> {
    /// How fast the expression grows at the time of the event, per s, for this present state.
    pub fn rate(&self, x: &[f64]) -> f64 {
        let mut slopes = [0.0; MOST_STATES];
        let Some(slopes) = slopes.get_mut(..x.len()) else { return f64::NAN };
        let mut then = self.then(x, &mut []);
        let Some(then) = then.get_mut(..x.len()) else { return f64::NAN };
        self.model.event(self.event, then, self.way.at(2 * self.way.steps), slopes);
        self.model.growth(then, self.way.at(2 * self.way.steps), slopes)
    }

    /// How late the event seems for a present state, in s.
    fn late_s(&self, x: &[f64]) -> f64 {
        self.late_s.iter().zip(x).map(|(late_s, x)| late_s * x).sum()
    }

    /// The state, parameters by their values, at the time of the event, and its derivatives by the present one where there is room.
    fn then(&self, x: &[f64], all: &mut [f64]) -> [f64; MOST_STATES] {
        let (model, n) = (self.model, x.len());
        let mut at = model.valued(x);
        let present = at;
        let mut next = [0.0; MOST_STATES];
        let mut one: Square = [0.0; MOST_STATES * MOST_STATES];
        for (place, entry) in all.iter_mut().enumerate() {
            *entry = f64::from(u8::from(place % (n + 1) == 0));
        }
        let Some(tables) = &self.way.tables else { return [f64::NAN; MOST_STATES] };
        for step in 0..self.way.steps {
            let (from, to, nodes) = (&at[..n], &mut next[..n], self.way.nodes(step));
            let one = one.get_mut(..all.len()).unwrap_or_default();
            model.step_back(from, (&nodes, tables), to, one);
            for (i, held) in model.apart_from(self.event).iter().enumerate() {
                if *held {
                    to[i] = present[i];
                    if let Some(row) = one.get_mut(i * n..(i + 1) * n) {
                        row.fill(0.0);
                        row[i] = 1.0;
                    }
                }
            }
            if !all.is_empty() {
                chain(all, one, model.moving(), n);
            }
            at[..n].copy_from_slice(&next[..n]);
        }
        at
    }
}

impl Sensor for EventSensor<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        let then = self.then(x, &mut []);
        let inputs = self.way.at(2 * self.way.steps);
        let value = |then: &[f64]| self.model.event(self.event, then, inputs, &mut []);
        let then = then.get(..x.len());
        let late = if self.late_s.is_empty() { 0.0 } else { self.rate(x) * self.late_s(x) };
        then.map_or(f64::NAN, |then| value(then) - late)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let n = x.len();
        let mut all: Square = [0.0; MOST_STATES * MOST_STATES];
        let Some(all) = all.get_mut(..n * n) else { return f64::NAN };
        let then = self.then(x, all);
        let mut own = [0.0; MOST_STATES];
        let Some((then, own)) = then.get(..n).zip(own.get_mut(..n)) else { return f64::NAN };
        let value = self.model.event(self.event, then, self.way.at(2 * self.way.steps), own);
        for (j, slope) in slopes.iter_mut().enumerate() {
            *slope = own.iter().zip(all.chunks_exact(n)).map(|(own, row)| own * row[j]).sum();
        }
        self.model.scale_parameters(slopes);
        if self.late_s.is_empty() {
            return value;
        }
        let rate = self.model.growth(then, self.way.at(2 * self.way.steps), own);
        for (slope, late_s) in slopes.iter_mut().zip(self.late_s) {
            *slope -= rate * late_s;
        }
        value - rate * self.late_s(x)
    }
}

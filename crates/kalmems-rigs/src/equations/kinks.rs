//! Steps through kinks: as many as a sample needs.

use super::model::{EquationModel, Interval, chain, set_part};
use crate::estimate::{Filtering, SampleCounts, Transition};
use kalmems_core::{FilterError, Nodes};
use kalmems_equations::MOST_STATES;

/// How far mean and Jacobian of so many steps and of twice as many may be apart, in standard deviations that the filter claims.
const ALIKE: f64 = 1e-3;
/// What a step of fourth order is off by, of what it differs from two of half the length by.
const OF_FOURTH_ORDER: f64 = 1.0 / 15.0;
/// Twice as many steps, at most so often: 64 from one sample to the next.
const DOUBLINGS: usize = 6;

/// How many steps are needed from a sample to the next, where no number is right for all of them: found by the state, the inputs and what the
/// filter claims there, so that it does not depend on where parts begin.
pub struct KinkSteps {
    /// Steps of 1, 1/2, 1/4, … of the usual interval.
    intervals: [Interval; DOUBLINGS + 1],
    covariance: Vec<f64>,
    /// Where some steps lead to, and where twice as many do; and room for the Jacobian of one.
    ways: [Led; 2],
    one: Vec<f64>,
}

/// The mean and the Jacobian that some steps lead to.
#[derive(Default)]
struct Led {
    mean: Vec<f64>,
    slopes: Vec<f64>,
}

impl KinkSteps {
    /// For this usual interval in s.
    pub fn new(interval_s: f64) -> Self {
        let halved = |doublings: usize| Interval::of(interval_s / f64::from(1_u32 << doublings));
        let (covariance, one) = (Vec::new(), Vec::new());
        Self { intervals: std::array::from_fn(halved), covariance, ways: Default::default(), one }
    }

    /// Predicts over the usual interval under inputs.
    pub fn advance(
        &mut self,
        model: &EquationModel,
        filter: &mut dyn Filtering,
        inputs: Nodes<&[f64]>,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let states = filter.mean().len();
        self.covariance.resize(states * states, 0.0);
        self.one.resize(states * states, 0.0);
        filter.covariance(&mut self.covariance);
        let mut sd = [0.0; MOST_STATES];
        for (i, sd) in sd.iter_mut().enumerate().take(states) {
            *sd = self.covariance[i * (states + 1)].max(0.0).sqrt();
        }
        let Self { intervals, ways: [coarse, fine], one, .. } = self;
        let mut doublings = 0;
        coarse.lead((model, &intervals[0]), filter.mean(), (inputs, 0), one);
        while doublings < DOUBLINGS {
            fine.lead((model, &intervals[doublings + 1]), filter.mean(), (inputs, doublings + 1), one);
            if are_alike(coarse, fine, &sd[..states]) {
                break;
            }
            std::mem::swap(coarse, fine);
            doublings += 1;
        }
        counts.unresolved_kinks += usize::from(doublings == DOUBLINGS);
        each_step((inputs, doublings), |nodes| {
            let step = model.under(&intervals[doublings], nodes, filter.mean());
            filter.predict(&step)
        })
    }
}

impl Led {
    /// Goes so many steps from a mean; `one` has room for the Jacobian of a step.
    fn lead(
        &mut self,
        (model, interval): (&EquationModel, &Interval),
        from: &[f64],
        inputs: (Nodes<&[f64]>, usize),
        one: &mut [f64],
    ) {
        let n = from.len();
        self.mean.clear();
        self.mean.extend_from_slice(from);
        self.slopes.clear();
        self.slopes.resize(n * n, 0.0);
        for i in 0..n {
            self.slopes[i * (n + 1)] = 1.0;
        }
        // It has no end of its own.
        let _ = each_step(inputs, |nodes| -> Result<(), FilterError> {
            let mut next = [0.0; MOST_STATES];
            let step = model.under(interval, nodes, &self.mean);
            step.linearize(&self.mean, &mut next[..n], one);
            chain(&mut self.slopes, one, n, n);
            self.mean.copy_from_slice(&next[..n]);
            Ok(())
        });
    }
}

/// Does something with the inputs of each of the steps of an interval, which is halved so often.
fn each_step<E>(
    (inputs, doublings): (Nodes<&[f64]>, usize),
    mut each: impl FnMut(Nodes<&[f64]>) -> Result<(), E>,
) -> Result<(), E> {
    let (steps, count) = (1_usize << doublings, inputs.start.len().min(MOST_STATES));
    let mut nodes = [[0.0; MOST_STATES]; 3];
    for step in 0..steps {
        set_part(&inputs, (step, steps), &mut nodes);
        let [start, middle, end] = &nodes;
        each(Nodes { start: &start[..count], middle: &middle[..count], end: &end[..count] })?;
    }
    Ok(())
}

/// Whether two ways over an interval lead to the same, as far as a filter with these standard deviations tells.
fn are_alike(coarse: &Led, fine: &Led, sd: &[f64]) -> bool {
    let n = sd.len();
    let bound = ALIKE / OF_FOURTH_ORDER;
    // A state that is known exactly has no deviation to compare with.
    (0..n).filter(|i| sd[*i] > 0.0).all(|i| {
        let mean = (coarse.mean[i] - fine.mean[i]).abs() <= bound * sd[i];
        mean && (0..n).all(|j| {
            let apart = (coarse.slopes[i * n + j] - fine.slopes[i * n + j]).abs();
            apart * sd[j] <= bound * sd[i]
        })
    })
}

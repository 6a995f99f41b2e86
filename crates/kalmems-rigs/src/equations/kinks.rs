//! Steps through kinks: as many as a sample needs.

use super::model::{EquationModel, Interval, chain};
use crate::estimate::driven::SegmentDrive;
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
}

/// The mean and the Jacobian that some steps lead to.
struct Led {
    mean: [f64; MOST_STATES],
    slopes: [f64; MOST_STATES * MOST_STATES],
}

impl KinkSteps {
    /// For this usual interval in s.
    pub fn new(interval_s: f64) -> Self {
        let halved = |doublings: usize| Interval::of(interval_s / f64::from(1_u32 << doublings));
        Self { intervals: std::array::from_fn(halved), covariance: Vec::new() }
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
        filter.covariance(&mut self.covariance);
        let mut sd = [0.0; MOST_STATES];
        for (i, sd) in sd.iter_mut().enumerate().take(states) {
            *sd = self.covariance[i * (states + 1)].max(0.0).sqrt();
        }
        let mut doublings = 0;
        let mut coarse = self.led(model, filter.mean(), (inputs, doublings));
        while doublings < DOUBLINGS {
            let fine = self.led(model, filter.mean(), (inputs, doublings + 1));
            if are_alike(&coarse, &fine, &sd[..states]) {
                break;
            }
            coarse = fine;
            doublings += 1;
        }
        counts.unresolved_kinks += usize::from(doublings == DOUBLINGS);
        each_step((inputs, doublings), |nodes| {
            let step = model.under(&self.intervals[doublings], nodes, filter.mean());
            filter.predict(&step)
        })
    }

    /// Where so many steps lead from a mean.
    fn led(&self, model: &EquationModel, from: &[f64], inputs: (Nodes<&[f64]>, usize)) -> Led {
        let n = from.len();
        let mut led = Led { mean: [0.0; MOST_STATES], slopes: [0.0; MOST_STATES * MOST_STATES] };
        led.mean[..n].copy_from_slice(from);
        for (place, entry) in led.slopes[..n * n].iter_mut().enumerate() {
            *entry = f64::from(u8::from(place % (n + 1) == 0));
        }
        let mut one = [0.0; MOST_STATES * MOST_STATES];
        // It has no end of its own.
        let _ = each_step(inputs, |nodes| -> Result<(), FilterError> {
            let (at, mut next) = (led.mean, [0.0; MOST_STATES]);
            let step = model.under(&self.intervals[inputs.1], nodes, &at[..n]);
            step.linearize(&at[..n], &mut next[..n], &mut one[..n * n]);
            chain(&mut led.slopes[..n * n], &one[..n * n], n, n);
            led.mean = next;
            Ok(())
        });
        led
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
        for k in 0..count {
            let whole = Nodes { start: inputs.start[k], middle: inputs.middle[k], end: inputs.end[k] };
            let part = SegmentDrive::nodes_of_part(&whole, step, steps);
            for (list, value) in nodes.iter_mut().zip([part.start, part.middle, part.end]) {
                list[k] = value;
            }
        }
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

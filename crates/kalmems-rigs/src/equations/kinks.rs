//! Steps through kinks: as many as a sample needs.

use super::model::{EquationModel, Interval, chain, set_part};
use crate::estimate::{Filtering, SampleCounts, Transition};
use kalmems_core::{FilterError, Nodes};
use kalmems_equations::MOST_STATES;

/// How far mean and Jacobian of so many steps and of twice as many may be apart, in standard deviations that the filter claims.
const ALIKE: f64 = 1e-3;
/// How far the variances of the noise that enters the motion may be apart, as a part of them: a claim is off by half of that at most. What is less
/// than this part of the variance that the filter claims does not count.
const NOISE_ALIKE: f64 = 0.02;
const NOISE_COUNTS: f64 = 1e-4;
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
    /// Where some steps lead to, and where twice as many do; and room for one step.
    ways: [Led; 2],
    one: OneStep,
}

/// The mean, the Jacobian and the covariance of the noise that some steps lead to.
#[derive(Default)]
struct Led {
    mean: Vec<f64>,
    slopes: Vec<f64>,
    noise: Vec<f64>,
}

/// Room for the Jacobian of one step, the covariance of its noise and the root of that, and a product.
#[derive(Default)]
struct OneStep {
    slopes: Vec<f64>,
    noise: Vec<f64>,
    root: Vec<f64>,
    product: Vec<f64>,
}

impl OneStep {
    fn resize(&mut self, size: usize) {
        for room in [&mut self.slopes, &mut self.noise, &mut self.root, &mut self.product] {
            room.resize(size, 0.0);
        }
    }
}

impl KinkSteps {
    /// For this usual interval in s.
    pub fn new(interval_s: f64) -> Self {
        let halved = |doublings: usize| Interval::of(interval_s / f64::from(1_u32 << doublings));
        let (covariance, one) = (Vec::new(), OneStep::default());
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
        self.one.resize(states * states);
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
    /// Goes so many steps from a mean; `one` has room for a step.
    fn lead(
        &mut self,
        (model, interval): (&EquationModel, &Interval),
        from: &[f64],
        inputs: (Nodes<&[f64]>, usize),
        one: &mut OneStep,
    ) {
        let n = from.len();
        self.mean.clear();
        self.mean.extend_from_slice(from);
        for own in [&mut self.slopes, &mut self.noise] {
            own.clear();
            own.resize(n * n, 0.0);
        }
        for i in 0..n {
            self.slopes[i * (n + 1)] = 1.0;
        }
        // It has no end of its own.
        let _ = each_step(inputs, |nodes| -> Result<(), FilterError> {
            let mut next = [0.0; MOST_STATES];
            let step = model.under(interval, nodes, &self.mean);
            step.linearize(&self.mean, &mut next[..n], &mut one.slopes);
            chain(&mut self.slopes, &one.slopes, n, n);
            step.noise(&mut one.noise, &mut one.root);
            self.add_noise(one);
            self.mean.copy_from_slice(&next[..n]);
            Ok(())
        });
    }

    /// The noise before a step goes on by its Jacobian, and its own comes in: F·Q·Fᵀ + Q₁.
    #[allow(clippy::needless_range_loop)] // for each step: an adapter of iterators is a call
    fn add_noise(&mut self, OneStep { slopes, noise, product, .. }: &mut OneStep) {
        let n = self.mean.len();
        for i in 0..n {
            for j in 0..n {
                let mut sum = 0.0;
                for k in 0..n {
                    sum += slopes[i * n + k] * self.noise[k * n + j];
                }
                product[i * n + j] = sum;
            }
        }
        for i in 0..n {
            for j in 0..n {
                let mut sum = noise[i.max(j) * n + i.min(j)];
                for k in 0..n {
                    sum += product[i * n + k] * slopes[j * n + k];
                }
                self.noise[i * n + j] = sum;
            }
        }
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
    let noise_is_alike = (0..n).all(|i| {
        let at = i * (n + 1);
        let apart = (coarse.noise[at] - fine.noise[at]).abs();
        apart <= (NOISE_ALIKE * fine.noise[at]).max(NOISE_COUNTS * sd[i] * sd[i])
    });
    // A state that is known exactly has no deviation to compare with.
    noise_is_alike
        && (0..n).filter(|i| sd[*i] > 0.0).all(|i| {
            let mean = (coarse.mean[i] - fine.mean[i]).abs() <= bound * sd[i];
            mean && (0..n).all(|j| {
                let apart = (coarse.slopes[i * n + j] - fine.slopes[i * n + j]).abs();
                apart * sd[j] <= bound * sd[i]
            })
        })
}

//! The step of a filter through a reset that has happened or not, as far as the filter knows.

#![allow(clippy::needless_range_loop)] // for each sample: an adapter of iterators is a call

use super::kinks::{Led, OneStep, each_step};
use super::model::{EquationModel, Interval, StateNumbers};
use crate::estimate::Transition;
use kalmems_core::{Nodes, Portable};
use kalmems_equations::{MOST_STATES, ResetPath};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Standard deviations of its margin within which a reset is not certain: what is beyond has a probability of 10⁻⁹.
const NEAR: f64 = 6.0;
/// The same for a margin that was found in one step.
const ROUGHLY_NEAR: f64 = 12.0;
/// A margin that grows by so many standard deviations of its growth does not fall to zero.
const GROWS: f64 = 3.0;
/// How many standard deviations beyond their mean states are looked for with which a reset happens that needs noise to happen at their mean.
const BEYOND: [f64; 3] = [0.0, 1.0, 2.5];

/// What half of a step takes off the error of a method of fourth order.
const FOURTH_ORDER: f64 = 16.0;

/// The mean and the covariance of a state, some of which has been reset within a sample and some not.
///
/// The margin g of a reset, what falls to zero there, is Gaussian at the end of a motion without it, with the mean z·σ. With g > 0 the state comes to its
/// end without the reset, with g < 0 through it: of either way mean and covariance are those given this half of the Gaussian, with the linear motion near
/// that way. The mean of both together, their covariance and their covariance with the state before are those of the step: the best linear step there is
/// (law of total covariance; of a Gaussian cut off at a point: Johnson, Kotz & Balakrishnan, Continuous Univariate Distributions 1, section 13.10.1).
#[derive(Default)]
pub struct ResetMixture {
    /// The way without the reset, from the mean, and with it.
    without: Led,
    with: Led,
    /// The covariance of the noise with the reset with that without, and room for the Jacobian of one step without.
    cross: Vec<f64>,
    slopes: Vec<f64>,
    step: LinearStep,
}

/// What is asked of a sample: the motion, the inputs with the number of doublings, and the mean with the lower triangle of its covariance.
#[derive(Clone, Copy)]
pub struct SampleAsked<'a> {
    pub model: &'a EquationModel,
    pub intervals: &'a [Interval],
    pub inputs: (Nodes<&'a [f64]>, usize),
    pub mean: &'a [f64],
    pub covariance: &'a [f64],
}

/// A step x′ = m + F·(x − x̄) + w.
#[derive(Default)]
pub struct LinearStep {
    from: Vec<f64>,
    to: Vec<f64>,
    slopes: Vec<f64>,
    noise: Vec<f64>,
    root: Vec<f64>,
    /// What half of its steps would add to its end, as these are of fourth order; empty if that is not known.
    of_halves: Vec<f64>,
}

impl Transition for LinearStep {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        let n = x.len();
        for (i, to) in to.iter_mut().enumerate() {
            let moved = (0..n).map(|k| self.slopes[i * n + k] * (x[k] - self.from[k]));
            *to = self.to[i] + moved.sum::<f64>();
        }
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        self.advance(x, to);
        jacobian.copy_from_slice(&self.slopes);
    }

    fn is_smooth(&self) -> bool {
        false
    }

    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        self.advance(x, to);
        to.iter_mut().zip(&self.of_halves).for_each(|(to, more)| *to += more);
        !self.of_halves.is_empty()
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        covariance.copy_from_slice(&self.noise);
        root.copy_from_slice(&self.root);
    }
}

/// The margin of a reset at the end of a way without it, in terms of a state and the noise on the way.
struct Margin {
    /// z: its mean in standard deviations.
    mean: f64,
    /// σ.
    sd: f64,
    /// ∂g/∂x at the end, and by the state before.
    normal: StateNumbers,
    before: StateNumbers,
    /// P·∂g/∂x by the state before, and Q·∂g/∂x.
    of_state: StateNumbers,
    of_noise: StateNumbers,
}

impl Margin {
    /// At the end of a way from a mean whose covariance is known; `None` of a reset that cannot happen, and of one whose margin is known exactly.
    fn of(asked: &SampleAsked, way: &Led, of: (usize, &ResetPath)) -> Option<Self> {
        let n = asked.mean.len();
        let mut normal = [0.0; MOST_STATES];
        let inputs = asked.inputs.0.end;
        let margin = asked.model.reset_margin(of, (&way.mean, inputs), &mut normal[..n])?;
        let (mut before, mut of_state, mut of_noise) = ([0.0; MOST_STATES], [0.0; MOST_STATES], normal);
        for k in 0..n {
            before[k] = (0..n).map(|i| way.slopes[i * n + k] * normal[i]).sum();
        }
        for i in 0..n {
            of_state[i] = (0..n).map(|k| symmetric(asked.covariance, n, i, k) * before[k]).sum();
            of_noise[i] = (0..n).map(|k| way.noise[i * n + k] * normal[k]).sum();
        }
        let sd = (dot(&before, &of_state, n) + dot(&normal, &of_noise, n)).sqrt();
        let mean = margin / sd;
        mean.is_finite().then_some(Self { mean, sd, normal, before, of_state, of_noise })
    }

    /// Whether it falls within the interval, as far as that is known.
    fn falls(&self, asked: &SampleAsked, of: (usize, &ResetPath)) -> bool {
        let n = asked.mean.len();
        let mut start = [0.0; MOST_STATES];
        let inputs = asked.inputs.0.start;
        let Some(margin) = asked.model.reset_margin(of, (asked.mean, inputs), &mut start[..n]) else {
            return false;
        };
        let mut growth = self.before;
        (0..n).for_each(|k| growth[k] -= start[k]);
        let of_states: f64 = (0..n)
            .map(|i| {
                growth[i] * (0..n).map(|k| symmetric(asked.covariance, n, i, k) * growth[k]).sum::<f64>()
            })
            .sum();
        let variance = of_states + dot(&self.normal, &self.of_noise, n);
        self.mean * self.sd - margin <= GROWS * variance.max(0.0).sqrt()
    }
}

/// A half of the margin's Gaussian, cut off at zero: its probability, the mean and the variance of what of it deviates from its mean, in standard deviations.
struct Half {
    probability: f64,
    mean: f64,
    variance: f64,
}

impl Half {
    /// The halves above and below zero of a Gaussian with this mean, in standard deviations.
    fn both(mean: f64) -> [Self; 2] {
        let density = (-0.5 * mean * mean).portable_exp() / (2.0 * PI).sqrt();
        let half = |sign: f64| {
            let probability = 0.5 * (-sign * mean * FRAC_1_SQRT_2).portable_erfc();
            let shift = sign * density / probability;
            Self { probability, mean: shift, variance: (1.0 - shift * (shift + mean)).clamp(0.0, 1.0) }
        };
        [half(1.0), half(-1.0)]
    }
}

impl ResetMixture {
    /// The step over an interval within which a reset has happened, or may have, the path at its end, and whether the reset is uncertain; `None` for an
    /// interval without a reset.
    ///
    /// `nominal` is the way from the mean, and `start` is the path at its beginning. If several resets are uncertain, the step is that of the least certain
    /// one.
    pub fn of(
        &mut self,
        asked: &SampleAsked,
        (nominal, start): (&Led, &ResetPath),
        one: &mut OneStep,
    ) -> Option<(&LinearStep, ResetPath, bool)> {
        let end = nominal.path?;
        if let Some(path) = self.mixed(asked, (nominal, start), one) {
            return Some((&self.step, path, true));
        }
        end.last()?;
        self.step.take(asked.mean, nominal);
        self.step.is_finite().then_some((&self.step, end, false))
    }

    /// The step of a way that leads over no reset, with what one of half as many steps leads to; `None` of one that is not finite.
    pub fn as_it_is(&mut self, mean: &[f64], (coarse, fine): (&Led, &Led)) -> Option<&LinearStep> {
        self.step.take(mean, fine);
        let apart = fine.mean.iter().zip(&coarse.mean).map(|(fine, coarse)| (fine - coarse) / FOURTH_ORDER);
        self.step.of_halves.extend(apart);
        self.step.is_finite().then_some(&self.step)
    }

    /// Sets the step where a reset has happened with a probability that is neither 0 nor 1.
    fn mixed(
        &mut self,
        asked: &SampleAsked,
        (nominal, start): (&Led, &ResetPath),
        one: &mut OneStep,
    ) -> Option<ResetPath> {
        let end = nominal.path?;
        let mut least: Option<(usize, Margin)> = None;
        for reset in (0..asked.model.resets()).filter(|reset| end.happened(*reset) == 0) {
            let of = (reset, start);
            let near = Margin::of(asked, nominal, of).filter(|margin| margin.mean.abs() < NEAR);
            if let Some(margin) = near.filter(|margin| margin.falls(asked, of))
                && least.as_ref().is_none_or(|(_, least)| margin.mean.abs() < least.mean.abs())
            {
                least = Some((reset, margin));
            }
        }
        if let Some(last) = end.last()
            && self.is_roughly_near(asked, (last, start), end.happened(last), one)
        {
            let held = start.holding_back(last, end.happened(last) - 1);
            self.lead(asked, asked.mean, [held, *start], one);
            let margin = Margin::of(asked, &self.without, (last, start));
            if let Some(margin) = margin.filter(|margin| margin.mean.abs() < NEAR)
                && least.as_ref().is_none_or(|(_, least)| margin.mean.abs() < least.mean.abs())
            {
                return self.joined(asked, (last, &margin, asked.mean), (start, end));
            }
        }
        let (reset, margin) = least?;
        let mut from = [0.0; MOST_STATES];
        let from = &mut from[..asked.mean.len()];
        let [_, below] = Half::both(margin.mean);
        for beyond in BEYOND {
            put_displaced(asked, &margin, below.mean - beyond, from);
            self.lead(asked, from, [start.holding_back(reset, 0), *start], one);
            if self.with.path.is_some_and(|path| path.happened(reset) > 0) {
                return self.joined(asked, (reset, &margin, from), (start, end));
            }
        }
        None
    }

    /// Whether a reset that has happened so often on the way from the mean might not have happened the last time, as far as one step tells.
    fn is_roughly_near(
        &mut self,
        asked: &SampleAsked,
        of: (usize, &ResetPath),
        happened: u8,
        one: &mut OneStep,
    ) -> bool {
        let (nodes, _) = asked.inputs;
        let held = of.1.holding_back(of.0, happened.saturating_sub(1));
        self.without.lead(asked.model, asked.intervals, asked.mean, ((nodes, 0), Some(held)), one);
        Margin::of(asked, &self.without, of).is_some_and(|margin| margin.mean.abs() < ROUGHLY_NEAR)
    }

    /// Goes along two paths side by side, from the mean and from another state, with the covariance of their noises.
    fn lead(
        &mut self,
        asked: &SampleAsked,
        from: &[f64],
        paths: [ResetPath; 2],
        OneStep { slopes, noise, root, product, room }: &mut OneStep,
    ) {
        let (model, n) = (asked.model, asked.mean.len());
        self.without.begin(asked.mean, Some(paths[0]));
        self.with.begin(from, Some(paths[1]));
        for room in [&mut self.cross, &mut self.slopes] {
            room.clear();
            room.resize(n * n, 0.0);
        }
        let (inputs, doublings) = (asked.inputs.0, asked.inputs.1);
        // It has no end of its own.
        let _ = each_step(asked.intervals, (inputs, doublings), |interval, nodes| -> Result<(), ()> {
            let mut reference = [0.0; MOST_STATES];
            reference[..n].copy_from_slice(&self.without.mean);
            // Whole turns are taken off both alike.
            let step = model.under(interval, nodes, &reference[..n], room);
            step.noise(noise, root);
            self.without.take(model, &step, (&mut self.slopes, noise, product));
            self.with.take(model, &step, (slopes, noise, product));
            for i in 0..n {
                for j in 0..n {
                    product[i * n + j] = (0..n).map(|k| slopes[i * n + k] * self.cross[k * n + j]).sum();
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let moved: f64 = (0..n).map(|k| product[i * n + k] * self.slopes[j * n + k]).sum();
                    self.cross[i * n + j] = moved + symmetric(noise, n, i, j);
                }
            }
            Ok(())
        });
        model.set_path(None);
    }

    /// Both ways together, of which that with the reset was led from a state.
    fn joined(
        &mut self,
        asked: &SampleAsked,
        (reset, margin, from): (usize, &Margin, &[f64]),
        (start, end): (&ResetPath, ResetPath),
    ) -> Option<ResetPath> {
        let n = asked.mean.len();
        let halves = Half::both(margin.mean);
        let mut ways = [[0.0; MOST_STATES]; 2];
        let mut ends = ways;
        // d: what of the end goes with the margin, by the state before and by the noise.
        for i in 0..n {
            let row = i * n..(i + 1) * n;
            let (without, with) = (&self.without.slopes[row.clone()], &self.with.slopes[row.clone()]);
            let by_noise = dot(&self.cross[row], &margin.normal, n);
            ways[0][i] = (dot(without, &margin.of_state, n) + margin.of_noise[i]) / margin.sd;
            ways[1][i] = (dot(with, &margin.of_state, n) + by_noise) / margin.sd;
            let back: f64 = (0..n).map(|k| with[k] * (from[k] - asked.mean[k])).sum();
            ends[0][i] = self.without.mean[i] + ways[0][i] * halves[0].mean;
            ends[1][i] = self.with.mean[i] - back + ways[1][i] * halves[1].mean;
        }
        let step = &mut self.step;
        step.begin(asked.mean);
        for i in 0..n {
            step.to[i] = halves[0].probability * ends[0][i] + halves[1].probability * ends[1][i];
        }
        let of_both = halves.iter().zip([&self.without, &self.with]).zip(ways.iter().zip(&ends));
        for ((half, led), (way, end)) in of_both {
            step.add(asked, (half, led), (way, end), margin);
        }
        step.conclude(asked);
        let is_below = start.below() & (1 << reset) != 0;
        step.is_finite().then_some(end.with_side(reset, is_below))
    }
}

/// Whether the claim of a filter reaches over the zero of what a reset waits for: one state then stands for what has been reset and what has not.
pub fn is_over_reset(asked: &SampleAsked) -> bool {
    let n = asked.mean.len();
    (0..asked.model.resets()).any(|reset| {
        let mut normal = [0.0; MOST_STATES];
        let value = asked.model.reset_crossing(reset, (asked.mean, asked.inputs.0.start), &mut normal[..n]);
        let variance: f64 = (0..n)
            .map(|i| {
                normal[i] * (0..n).map(|k| symmetric(asked.covariance, n, i, k) * normal[k]).sum::<f64>()
            })
            .sum();
        value * value < NEAR * NEAR * variance
    })
}

/// A state with which the margin is so many standard deviations from its mean, as near as can be.
fn put_displaced(asked: &SampleAsked, margin: &Margin, by: f64, to: &mut [f64]) {
    let n = asked.mean.len();
    let mut along = [0.0; MOST_STATES];
    for i in 0..n {
        along[i] = margin.of_state[i] + margin.of_noise[i];
    }
    let growth = dot(&margin.before, &along, n);
    for i in 0..n {
        to[i] = asked.mean[i] + along[i] * (by * margin.sd / growth);
    }
}

impl LinearStep {
    fn begin(&mut self, mean: &[f64]) {
        let n = mean.len();
        self.from.clear();
        self.from.extend_from_slice(mean);
        self.to.resize(n, 0.0);
        self.of_halves.clear();
        for room in [&mut self.slopes, &mut self.noise, &mut self.root] {
            room.clear();
            room.resize(n * n, 0.0);
        }
    }

    /// Takes a way from a mean as it is.
    fn take(&mut self, mean: &[f64], way: &Led) {
        self.begin(mean);
        self.to.copy_from_slice(&way.mean);
        self.slopes.copy_from_slice(&way.slopes);
        self.noise.copy_from_slice(&way.noise);
        EquationModel::put_root(&mut self.noise, &mut self.root, mean.len());
    }

    /// Adds one of both ways to the Jacobian and, for now, to the covariance at the end.
    fn add(
        &mut self,
        asked: &SampleAsked,
        (half, led): (&Half, &Led),
        (way, end): (&StateNumbers, &StateNumbers),
        margin: &Margin,
    ) {
        let (n, p) = (asked.mean.len(), half.probability);
        let known = 1.0 - half.variance;
        // J·P, row by row.
        let mut moved = [0.0; MOST_STATES];
        for i in 0..n {
            let (row, off) = (&led.slopes[i * n..(i + 1) * n], end[i] - self.to[i]);
            for (k, moved) in moved.iter_mut().enumerate().take(n) {
                *moved = (0..n).map(|l| row[l] * symmetric(asked.covariance, n, l, k)).sum();
            }
            for k in 0..n {
                let by_margin = (half.mean * off - known * way[i]) * margin.before[k] / margin.sd;
                self.slopes[i * n + k] += p * (row[k] + by_margin);
            }
            for j in 0..=i {
                let spread = dot(&moved, &led.slopes[j * n..(j + 1) * n], n) + led.noise[i * n + j];
                let apart = off * (end[j] - self.to[j]) - known * way[i] * way[j];
                self.noise[i * n + j] += p * (spread + apart);
            }
        }
    }

    /// Takes what the Jacobian explains off the covariance.
    fn conclude(&mut self, asked: &SampleAsked) {
        let n = self.to.len();
        let mut moved = [0.0; MOST_STATES];
        for i in 0..n {
            for (k, moved) in moved.iter_mut().enumerate().take(n) {
                *moved = (0..n).map(|l| self.slopes[i * n + l] * symmetric(asked.covariance, n, l, k)).sum();
            }
            for j in 0..=i {
                self.noise[i * n + j] -= dot(&moved, &self.slopes[j * n..(j + 1) * n], n);
            }
        }
        EquationModel::put_root(&mut self.noise, &mut self.root, n);
    }

    fn is_finite(&self) -> bool {
        [&self.to, &self.slopes, &self.noise].iter().all(|numbers| numbers.iter().all(|x| x.is_finite()))
    }
}

/// An entry of a symmetric matrix that is given by its lower triangle.
fn symmetric(lower: &[f64], n: usize, i: usize, j: usize) -> f64 {
    lower[i.max(j) * n + i.min(j)]
}

fn dot(a: &[f64], b: &[f64], n: usize) -> f64 {
    (0..n).map(|k| a[k] * b[k]).sum()
}

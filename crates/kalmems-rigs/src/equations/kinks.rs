//! Steps through kinks: as many as a sample needs.

use super::model::{EquationModel, Interval, StepRoom, UnderInputs, chain, set_part};
use super::reset_mixture::{ResetMixture, SampleAsked, is_over_reset};
use crate::estimate::{Filtering, SampleCounts, Transition};
use kalmems_core::{FilterError, Nodes};
use kalmems_equations::{MOST_STATES, ResetPath};

/// How far mean and Jacobian of so many steps and of twice as many may be apart, in standard deviations that the filter claims, along whatever axis of
/// its claim. The filter takes the finer ones, which are closer to what they converge to than the coarser ones.
const ALIKE: f64 = 1.6e-2;
/// How far the noise that enters the motion may be apart, as a part of it: a claim is off by a quarter of that at most. What is less than this part of the
/// variance that the filter claims does not count.
const NOISE_ALIKE: f64 = 0.04;
const NOISE_COUNTS: f64 = 2e-4;
/// A claim counts as no narrower along an axis than by this part of the standard deviation of a state. Behind the bounce off a stiff contact, place and
/// speed together are known a hundred times better than the speed alone, and the next bounce turns the one into the other.
const NARROWEST: f64 = 1e-2;
/// Twice as many steps, at most so often: 64 from one sample to the next.
const DOUBLINGS: usize = 6;

/// How many steps are needed from a sample to the next, where no number is right for all of them: found by the state, the inputs and what the
/// filter claims there, so that it does not depend on where parts begin.
pub struct KinkSteps {
    /// Steps of 1, 1/2, 1/4, … of the usual interval.
    intervals: [Interval; DOUBLINGS + 2],
    covariance: Vec<f64>,
    /// Where some steps lead to, and where twice as many do; and room for one step.
    ways: [Led; 2],
    one: OneStep,
    claim: ClaimAxes,
    mixture: ResetMixture,
    /// Whether the filter moves points of its own along each step: the mean of twice as many, with its Jacobian, is no step for them.
    moves_points: bool,
}

/// The mean, the Jacobian and the covariance of the noise that some steps lead to.
#[derive(Default)]
pub struct Led {
    pub mean: Vec<f64>,
    pub slopes: Vec<f64>,
    pub noise: Vec<f64>,
    /// The path at the end, of a device with resets, and the sides where each step began.
    pub path: Option<ResetPath>,
    sides: Vec<u32>,
}

/// Room for the Jacobian of one step, the covariance of its noise and the root of that, a product, and what the step takes of its mean.
#[derive(Default)]
pub struct OneStep {
    pub slopes: Vec<f64>,
    pub noise: Vec<f64>,
    pub root: Vec<f64>,
    pub product: Vec<f64>,
    pub room: StepRoom,
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
        let (covariance, one, claim) = (Vec::new(), OneStep::default(), ClaimAxes::default());
        let (ways, mixture) = Default::default();
        let intervals = std::array::from_fn(halved);
        Self { intervals, covariance, ways, one, claim, mixture, moves_points: false }
    }

    /// The same for a filter that moves points of its own, or for one that does not.
    #[must_use]
    pub fn moving_points(self, moves_points: bool) -> Self {
        Self { moves_points, ..self }
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
        let Self { intervals, covariance, ways: [coarse, fine], one, claim, mixture, moves_points } = self;
        claim.begin(covariance, states);
        let path = (model.resets() > 0).then(|| {
            let from_mean = || model.path_from(filter.mean(), inputs.start);
            filter.reset_sides().map_or_else(from_mean, ResetPath::of)
        });
        let (mut doublings, mut alike) = (0, false);
        coarse.lead(model, intervals, filter.mean(), ((inputs, 0), path), one);
        while doublings < DOUBLINGS {
            fine.lead(model, intervals, filter.mean(), ((inputs, doublings + 1), path), one);
            alike = claim.has_alike(coarse, fine);
            if alike {
                break;
            }
            std::mem::swap(coarse, fine);
            doublings += 1;
        }
        counts.unresolved_kinks += usize::from(!alike);
        // The steps that were found with room to spare are there already.
        if alike {
            doublings += 1;
        } else {
            std::mem::swap(coarse, fine);
        }
        let mut is_over = false;
        if let Some(start) = &path {
            let (mean, inputs) = (filter.mean(), (inputs, doublings));
            let asked = SampleAsked { model, intervals, inputs, mean, covariance };
            is_over = is_over_reset(&asked);
            if let Some((step, end, is_mixed)) = mixture.of(&asked, (fine, start), one) {
                filter.predict(step)?;
                filter.keep_reset_sides(Some(end.below()));
                if is_over || is_mixed {
                    filter.part();
                }
                return Ok(());
            }
        }
        if !*moves_points && let Some(step) = mixture.as_it_is(filter.mean(), (coarse, fine)) {
            let done = filter.predict(step);
            filter.keep_reset_sides(fine.path.map(|path| path.below()));
            if is_over {
                filter.part();
            }
            return done;
        }
        let mut sides = fine.sides.iter();
        let done = each_step(intervals, (inputs, doublings), |interval, nodes| {
            model.set_path(sides.next().map(|below| ResetPath::of(*below).staying()));
            let step = model.under(interval, nodes, filter.mean(), &mut one.room);
            filter.predict(&step)
        });
        model.set_path(None);
        filter.keep_reset_sides(fine.path.map(|path| path.below()));
        if is_over {
            filter.part();
        }
        done
    }
}

impl Led {
    /// Begins at a mean, on a path of a device with resets.
    pub fn begin(&mut self, from: &[f64], path: Option<ResetPath>) {
        let n = from.len();
        self.path = path;
        self.sides.clear();
        self.mean.clear();
        self.mean.extend_from_slice(from);
        for own in [&mut self.slopes, &mut self.noise] {
            own.clear();
            own.resize(n * n, 0.0);
        }
        for i in 0..n {
            self.slopes[i * (n + 1)] = 1.0;
        }
    }

    /// Goes so many steps from a mean, on a path of a device with resets; `one` has room for a step.
    pub fn lead(
        &mut self,
        model: &EquationModel,
        intervals: &[Interval],
        from: &[f64],
        (inputs, path): ((Nodes<&[f64]>, usize), Option<ResetPath>),
        one: &mut OneStep,
    ) {
        self.begin(from, path);
        // It has no end of its own.
        let _ = each_step(intervals, inputs, |interval, nodes| -> Result<(), FilterError> {
            let step = model.under(interval, nodes, &self.mean, &mut one.room);
            step.noise(&mut one.noise, &mut one.root);
            self.take(model, &step, (&mut one.slopes, &one.noise, &mut one.product));
            Ok(())
        });
        model.set_path(None);
    }

    /// Takes one step more, to whose Jacobian `slopes` is set; `product` has room for another matrix.
    pub fn take(
        &mut self,
        model: &EquationModel,
        step: &UnderInputs<'_>,
        (slopes, noise, product): (&mut [f64], &[f64], &mut [f64]),
    ) {
        let n = self.mean.len();
        let mut next = [0.0; MOST_STATES];
        self.sides.extend(self.path.map(|path| path.below()));
        model.set_path(self.path);
        step.linearize(&self.mean, &mut next[..n], slopes);
        self.path = model.path();
        chain(&mut self.slopes, slopes, n, n);
        self.add_noise(slopes, noise, product);
        self.mean.copy_from_slice(&next[..n]);
    }

    /// The noise before a step goes on by its Jacobian, and its own comes in: F·Q·Fᵀ + Q₁.
    #[allow(clippy::needless_range_loop)] // for each step: an adapter of iterators is a call
    fn add_noise(&mut self, slopes: &[f64], noise: &[f64], product: &mut [f64]) {
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

/// Does something with the length and the inputs of each step of an interval: of so many parts, a doubling each, it is cut in the middle of each. No cut
/// of one number of parts is one of another, so that what leads to a kink, and on from there, is never the same part of a step in two ways that are
/// compared.
pub fn each_step<E>(
    intervals: &[Interval],
    (inputs, doublings): (Nodes<&[f64]>, usize),
    mut each: impl FnMut(&Interval, Nodes<&[f64]>) -> Result<(), E>,
) -> Result<(), E> {
    let (halves, count) = (2_usize << doublings, inputs.start.len().min(MOST_STATES));
    let (mut nodes, mut behind) = ([[0.0; MOST_STATES]; 3], [[0.0; MOST_STATES]; 3]);
    let mut at = 0;
    while at < halves {
        let is_half = at == 0 || at + 1 == halves;
        set_part(&inputs, (at, halves), &mut nodes);
        if !is_half {
            set_part(&inputs, (at + 1, halves), &mut behind);
            (nodes[1], nodes[2]) = (behind[0], behind[2]);
        }
        let [start, middle, end] = &nodes;
        let interval = &intervals[doublings + usize::from(is_half)];
        each(interval, Nodes { start: &start[..count], middle: &middle[..count], end: &end[..count] })?;
        at += if is_half { 1 } else { 2 };
    }
    Ok(())
}

/// What a filter claims before and behind an interval, by lower triangular factors.
#[derive(Default)]
struct ClaimAxes {
    states: usize,
    before: Vec<f64>,
    behind: Vec<f64>,
    /// The covariance behind, or what of two ways is apart; and room beside it.
    product: Vec<f64>,
    noise: Vec<f64>,
    apart: Vec<f64>,
}

impl ClaimAxes {
    /// Takes the claim before an interval, the lower triangle of a covariance.
    fn begin(&mut self, covariance: &[f64], states: usize) {
        self.states = states;
        for room in [&mut self.before, &mut self.behind, &mut self.product, &mut self.noise, &mut self.apart]
        {
            room.resize(states * states, 0.0);
        }
        factor(covariance, &mut self.before, states);
    }

    /// Whether two ways over the interval lead to the same, as far as the filter tells: what is apart in mean, Jacobian and noise is little of what it
    /// claims behind the interval, F·P·Fᵀ + Q.
    fn has_alike(&mut self, coarse: &Led, fine: &Led) -> bool {
        let n = self.states;
        let Self { before, behind, product, noise, apart, .. } = self;
        times_lower(&fine.slopes, before, behind, n);
        for i in 0..n {
            for j in 0..=i {
                let moved: f64 = (0..n).map(|k| behind[i * n + k] * behind[j * n + k]).sum();
                product[i * n + j] = moved + fine.noise[i * n + j];
            }
        }
        factor(product, behind, n);
        let within = |apart: &[f64], bound: f64| apart.iter().all(|apart| apart.abs() <= bound);
        let mean = &mut product[..n];
        put_difference(mean, &coarse.mean, &fine.mean);
        solve(behind, mean, n, 1);
        if !within(mean, ALIKE) {
            return false;
        }
        put_difference(apart, &coarse.slopes, &fine.slopes);
        times_lower(apart, before, product, n);
        solve(behind, product, n, n);
        if !within(product, ALIKE) {
            return false;
        }
        put_difference(apart, &coarse.noise, &fine.noise);
        noise.copy_from_slice(&fine.noise);
        whiten(behind, apart, n);
        whiten(behind, noise, n);
        (0..n * n).all(|at| {
            let own = noise[at / n * (n + 1)].max(0.0) * noise[at % n * (n + 1)].max(0.0);
            apart[at].abs() <= (NOISE_ALIKE * own.sqrt()).max(NOISE_COUNTS)
        })
    }
}

/// L⁻¹·Q·L⁻ᵀ in place of a symmetric Q: twice from the left.
fn whiten(lower: &[f64], noise: &mut [f64], n: usize) {
    for _ in 0..2 {
        solve(lower, noise, n, n);
        for i in 0..n {
            for j in 0..i {
                noise.swap(i * n + j, j * n + i);
            }
        }
    }
}

/// What is left of some numbers without others.
fn put_difference(to: &mut [f64], of: &[f64], without: &[f64]) {
    for (to, (of, without)) in to.iter_mut().zip(of.iter().zip(without)) {
        *to = of - without;
    }
}

/// The lower triangular L with L·Lᵀ = P, from the lower triangle of P, no narrower than [`NARROWEST`]; a state without a variance has no row.
fn factor(covariance: &[f64], root: &mut [f64], n: usize) {
    root.fill(0.0);
    for j in 0..n {
        let variance = covariance[j * (n + 1)].max(0.0);
        let explained: f64 = root[j * n..j * n + j].iter().map(|entry| entry * entry).sum();
        let pivot = (variance - explained).max(NARROWEST * NARROWEST * variance).sqrt();
        root[j * (n + 1)] = pivot;
        for i in (j + 1)..n {
            let explained: f64 = (0..j).map(|k| root[i * n + k] * root[j * n + k]).sum();
            root[i * n + j] = if pivot > 0.0 { (covariance[i * n + j] - explained) / pivot } else { 0.0 };
        }
    }
}

/// A·L of square matrices, of which L is lower triangular.
fn times_lower(a: &[f64], lower: &[f64], to: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..n {
            to[i * n + j] = (j..n).map(|k| a[i * n + k] * lower[k * n + j]).sum();
        }
    }
}

/// X with L·X = B in place of B, of so many columns. A state that is known exactly has no deviation to compare with: its row is zero.
fn solve(lower: &[f64], b: &mut [f64], n: usize, columns: usize) {
    for i in 0..n {
        let pivot = lower[i * (n + 1)];
        for j in 0..columns {
            let known: f64 = (0..i).map(|k| lower[i * n + k] * b[k * columns + j]).sum();
            let left = b[i * columns + j] - known;
            b[i * columns + j] = if pivot > 0.0 { left / pivot } else { 0.0 };
        }
    }
}

//! How far the steps between samples lead a filter astray, in units of what it claims.

use super::engine::{Course, Filtering};
use super::transition::{KeptSensor, Transition, TransitionProcess};
use super::{SampleCounts, SampleSelection};
use kalmems_core::{Gaussian, Mat, NumericProcess};
use std::iter::successors;
use std::ops::Range;

/// The shadow of a filter: the difference between its mean and that of the same filter in steps of half the length, corrected by the
/// same gains.
///
/// The difference e goes on by e′ = F·e + (f₂(x) − f₁(x)), with the step f₁ from the mean x, the same interval f₂ in two halves, and
/// F = ∂f₁/∂x; a correction that moves the mean by Δ for an innovation ν takes Δ·(H·e)/ν off it. The error of the steps is 16/15 of it,
/// as they are of fourth order.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepWatch<const N: usize> {
    difference: [f64; N],
    /// What is left of the difference that longer steps have made before: shorter ones do not take it off.
    of_longer_steps: [f64; N],
    /// Σ (e/sd)² of each state since it was asked last, of both together and of the present steps alone, and over how many samples.
    squares: [f64; N],
    squares_of_present: [f64; N],
    /// Which states no noise moves, once a step has told that: they keep each error.
    keeps: Option<[bool; N]>,
    samples: usize,
    /// Sum and number of the normalised innovations squared of these samples.
    nis: (f64, f64),
    /// Whether any step since then was not exact.
    is_needed: bool,
    /// Whether the filter's mean goes on as the mean of sigma points, and not by the step itself.
    is_unscented: bool,
    /// How many steps one in two halves stands for, and how many there are until the next.
    stands_for: u32,
    until_next: u32,
}

/// What the shadow of a filter tells of some samples.
#[derive(Clone, Copy, Debug)]
pub struct StepFigure {
    /// The error of the steps in standard deviations that the filter claims.
    error: f64,
    /// The same of what the present steps have made, larger for states that keep it.
    of_present: f64,
    /// The mean NIS.
    mean_nis: f64,
}

impl StepFigure {
    /// As a trajectory keeps it, of so many samples until a time in s.
    pub(super) const fn until(self, until_s: f64, samples: usize) -> StepError {
        StepError { until_s, samples, error: self.error }
    }
}

/// Where the error of some samples is below this part of a claimed standard deviation, and nothing in the equations bends, one step of a few is
/// followed in two halves and stands for all of them: the halves cost twice what the step does. A prime number of steps, so that they come to
/// all phases of a motion.
const QUIET: f64 = 0.01;
const STANDS_FOR: u32 = 7;

/// The part of a value that its arithmetic leaves open after as many steps as a decay may take: ε to the power of 3/4, as smoothers have it.
const ARITHMETIC: f64 = 1.82e-12;

/// What a step of fourth order is off by, of what it differs from two of half the length by.
const OF_FOURTH_ORDER: f64 = 16.0 / 15.0;

#[allow(clippy::needless_range_loop)] // iterators that are zipped are not inlined: each costs a call for every sample
impl<const N: usize> StepWatch<N> {
    pub(super) const fn new(is_unscented: bool) -> Self {
        Self {
            difference: [0.0; N],
            of_longer_steps: [0.0; N],
            squares: [0.0; N],
            squares_of_present: [0.0; N],
            keeps: None,
            samples: 0,
            nis: (0.0, 0.0),
            is_needed: false,
            is_unscented,
            stands_for: 1,
            until_next: 0,
        }
    }

    /// Goes on in shorter steps.
    pub(super) fn shorten(&mut self) {
        for (longer, present) in self.of_longer_steps.iter_mut().zip(&mut self.difference) {
            *longer += std::mem::take(present);
        }
    }

    /// A step from one mean to another, which was linearised to `slopes`.
    pub(super) fn step(
        &mut self,
        transition: &dyn Transition,
        (mean, next): (&[f64; N], &[f64; N]),
        slopes: &Mat<f64, N, N>,
    ) {
        for difference in [&mut self.difference, &mut self.of_longer_steps] {
            let before = *difference;
            if before.iter().any(|e| *e != 0.0) {
                for i in 0..N {
                    difference[i] = product(&slopes.0[i], &before);
                }
            }
        }
        let stands_for = if transition.is_smooth() { self.stands_for } else { 1 };
        self.until_next = self.until_next.min(stands_for).saturating_sub(1);
        if self.until_next > 0 {
            return;
        }
        self.until_next = stands_for;
        let (mut whole, mut halves) = (*next, [0.0; N]);
        if !transition.advance_in_halves(mean, &mut halves) {
            return;
        }
        self.is_needed = true;
        if self.keeps.is_none() {
            let process = TransitionProcess::<N>::of(transition);
            let noise = process.noise_added();
            self.keeps = Some(std::array::from_fn(|i| noise.covariance().get(i, i) == 0.0));
        }
        if self.is_unscented {
            transition.advance(mean, &mut whole);
        }
        let weight = f64::from(stands_for);
        for i in 0..N {
            self.difference[i] += weight * (halves[i] - whole[i]);
        }
    }

    /// A correction from one mean to another, for an innovation.
    pub(super) fn correct(
        &mut self,
        sensor: &KeptSensor<'_, N>,
        (from, to): (&[f64; N], &[f64; N]),
        innovation: f64,
    ) {
        // A sample that was rejected, or one that is as predicted to the last bit, tells of no gain.
        if !self.is_needed || from == to || innovation == 0.0 {
            return;
        }
        let slopes = sensor.slopes_at(from);
        for difference in [&mut self.difference, &mut self.of_longer_steps] {
            let share = product(&slopes, difference) / innovation;
            for i in 0..N {
                difference[i] -= (to[i] - from[i]) * share;
            }
        }
    }

    /// Takes a sample into the figure, with what the filter claims of the state and the NIS of its innovation, not a number where there was none. No
    /// state counts as better known than its arithmetic: where nothing is random a claim decays without end, and the error of a step does not.
    pub(super) fn take(&mut self, known: &Gaussian<f64, N>, nis: f64) {
        if !self.is_needed {
            return;
        }
        if nis.is_finite() {
            self.nis = (self.nis.0 + nis, self.nis.1 + 1.0);
        }
        for i in 0..N {
            let (variance, present) = (known.covariance.get(i, i), self.difference[i]);
            // What is known exactly has no error to compare with.
            if variance > 0.0 {
                let variance = variance.max((ARITHMETIC * known.mean[i]).powi(2));
                let all = present + self.of_longer_steps[i];
                self.squares[i] += all * all / variance;
                self.squares_of_present[i] += present * present / variance;
            }
        }
        self.samples += 1;
    }

    /// The error of the steps since this was asked last: the root mean square of the worst state's, in standard deviations that the filter
    /// claims. `None` where the steps are exact.
    pub(super) fn error(&mut self) -> Option<StepFigure> {
        let samples = self.samples.max(1) as f64;
        let of_worst = |squares: &[f64; N]| {
            // One that is not a number is the worst.
            let worst = squares.iter().fold(0.0, |worst: f64, own| if *own <= worst { worst } else { *own });
            OF_FOURTH_ORDER * (worst / samples).sqrt()
        };
        let keeps = self.keeps.unwrap_or([false; N]);
        let urgent: [f64; N] = std::array::from_fn(|i| {
            self.squares_of_present[i] * if keeps[i] { (TOO_LARGE / TOO_LARGE_KEPT).powi(2) } else { 1.0 }
        });
        let (error, of_present) = (of_worst(&self.squares), of_worst(&urgent));
        self.stands_for = if error.max(of_present) < QUIET { STANDS_FOR } else { 1 };
        let known = self.is_needed && self.samples > 0;
        let (sum, count) = self.nis;
        let mean_nis = if count > 0.0 { sum / count } else { 1.0 };
        (self.squares, self.squares_of_present) = ([0.0; N], [0.0; N]);
        (self.samples, self.nis) = (0, (0.0, 0.0));
        known.then_some(StepFigure { error, of_present, mean_nis })
    }

    /// How many samples the figure is of.
    pub(super) const fn samples(&self) -> usize {
        self.samples
    }
}

/// Σ aᵢ·bᵢ, in the order of the indices.
#[inline]
#[allow(clippy::needless_range_loop)] // as above
fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sum = -0.0;
    for i in 0..N {
        sum += a[i] * b[i];
    }
    sum
}

/// The error of the steps over some samples of a filter's way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepError {
    /// The last of the samples, by its time in s.
    pub until_s: f64,
    /// How many they are.
    pub samples: usize,
    /// The root mean square of the worst state's error, in standard deviations that the filter claims.
    pub error: f64,
}

/// How many steps lead from each sample to the next, sample by sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepCounts {
    /// From which sample on, by its time in s, there are how many.
    changes: Vec<(f64, usize)>,
    /// Whether the course takes these numbers.
    are_taken: bool,
}

impl StepCounts {
    /// So many on a course that takes such a number, or that does not.
    pub(crate) fn begin(&mut self, from_s: f64, steps: usize, is_taken: bool) {
        self.are_taken = is_taken;
        self.change(from_s, steps);
    }

    /// So many from the sample of this time in s on.
    pub(super) fn change(&mut self, from_s: f64, steps: usize) {
        if self.changes.last().is_none_or(|(_, last)| *last != steps) {
            self.changes.push((from_s, steps));
        }
    }

    /// Those to the sample of this time in s.
    pub(super) fn at(&self, time_s: f64) -> usize {
        let next = self.changes.partition_point(|(from_s, _)| *from_s <= time_s);
        self.changes.get(next.saturating_sub(1)).map_or(1, |(_, steps)| *steps)
    }

    /// Those to the last sample; `None` if the course does not take a number, as its steps are exact or follow kinks of the equations.
    pub fn last(&self) -> Option<usize> {
        self.changes.last().filter(|_| self.are_taken).map(|(_, steps)| *steps)
    }

    /// Puts those of later samples behind.
    pub(super) fn append(&mut self, later: &Self) {
        self.are_taken = later.are_taken;
        later.changes.iter().for_each(|(from_s, steps)| self.change(*from_s, *steps));
    }

    /// Forgets what is not needed for samples behind this time in s.
    pub(super) fn forget_until(&mut self, time_s: f64) {
        let next = self.changes.partition_point(|(from_s, _)| *from_s <= time_s);
        self.changes.drain(..next.saturating_sub(1));
    }
}

/// How many steps a filter takes from here on that took so many, of which the shadow told this: as many more as bring the error down to
/// what a plan leaves; as many as before where it is not large, or where the filter does not follow its signal. What longer steps made before
/// does not count: a parameter without noise keeps it, however short the steps are now.
pub(super) fn followed_steps(steps: usize, StepFigure { of_present, mean_nis, .. }: StepFigure) -> usize {
    if mean_nis > ASTRAY {
        return steps;
    }
    // What is not a number is as large as can be.
    let mut left = if of_present.is_nan() { f64::INFINITY } else { of_present };
    if left <= TOO_LARGE {
        return steps;
    }
    let mut next = steps;
    while left > SHORT_ENOUGH && next < MOST_STEPS {
        (next, left) = (2 * next, left / 16.0);
    }
    next
}

/// Samples of one [`StepError`].
pub(super) const STEP_ERROR_SAMPLES: usize = 256;

/// Rows of a segment's beginning on which its steps are planned; the first part of a segment that comes in parts has as many.
const PLANNED_ON: usize = super::driven::BLOCK;
/// The error of the steps, in standard deviations that the filter claims, up to which they are short enough.
const SHORT_ENOUGH: f64 = 0.02;
/// The rows after which the error is looked at first, and again after twice as many, and the part of [`SHORT_ENOUGH`] below which it leaves no
/// doubt: what comes behind is watched in any case.
const FIRST_LOOK: usize = 512;
const NO_DOUBT: f64 = 0.25;
/// The error of some samples, in standard deviations that the filter claims, above which shorter steps are taken behind them.
const TOO_LARGE: f64 = 0.05;
/// The same of a state that no noise moves: it keeps the error, and with what the shorter steps add, at most [`SHORT_ENOUGH`], that stays below
/// the 0.05 that are remarked on.
const TOO_LARGE_KEPT: f64 = 0.03;
/// Steps from one sample to the next, at most.
const MOST_STEPS: usize = 64;

/// The mean NIS above which a filter does not follow its signal, and the part of it that shorter steps must take off for the step to be the
/// cause: those of a wrong device do not help.
const ASTRAY: f64 = 4.0;
const OF_THE_STEP: f64 = 0.05;

/// How many steps a filter on this course takes from one sample to the next: the smallest power of 2 with which its steps' error stays
/// below [`SHORT_ENOUGH`] on the later half of the segment's beginning, or that with the smallest error. A filter that does not follow the
/// signal, however short its steps are, takes those from which on shorter ones do not help.
///
/// The course is rewound afterwards.
pub(super) fn plan_steps(
    start: &dyn Fn() -> Option<Box<dyn Filtering>>,
    course: &mut dyn Course,
    samples: &SampleSelection,
) -> usize {
    let end = samples.fresh.end.min(samples.fresh.start + PLANNED_ON);
    let rows = samples.fresh.start..end;
    let (mut best, mut steps) = ((1, f64::INFINITY), 1);
    let mut last_nis = f64::INFINITY;
    while steps <= MOST_STEPS && course.divide(steps) {
        let Some(mut filter) = start() else { break };
        let found = error_over(&mut *filter, course, &rows);
        course.rewind();
        // Its steps are exact, if there is no error.
        let Some(StepFigure { error, mean_nis, .. }) = found else { break };
        if mean_nis > ASTRAY && mean_nis > (1.0 - OF_THE_STEP) * last_nis {
            break;
        }
        if error < best.1 {
            best = (steps, error);
        }
        if best.1 <= SHORT_ENOUGH {
            break;
        }
        (last_nis, steps) = (mean_nis, 2 * steps);
    }
    course.divide(best.0);
    best.0
}

/// What the shadow tells of the later half of some rows, or of the later half of fewer where that leaves no doubt; the error infinite where the
/// filter stops, and `None` where the steps are exact.
fn error_over(
    filter: &mut dyn Filtering,
    course: &mut dyn Course,
    rows: &Range<usize>,
) -> Option<StepFigure> {
    let mut counts = SampleCounts::default();
    let mut halves = successors(Some(FIRST_LOOK), |rows| Some(2 * rows)).map(|length| rows.start + length);
    let mut half = halves.next();
    for row in rows.clone() {
        let moved = if row > rows.start { course.advance(filter, row, &mut counts) } else { Ok(()) };
        let time_s = course.time_s().get(row).copied().unwrap_or(f64::NAN);
        if let Some(gate) = filter.watch() {
            gate.at(time_s);
        }
        let corrected = moved.and_then(|()| course.correct(filter, row, &mut counts));
        let Ok(innovation) = corrected else {
            return Some(StepFigure { error: f64::INFINITY, of_present: f64::INFINITY, mean_nis: 1.0 });
        };
        filter.take_step_error(innovation.map_or(f64::NAN, |innovation| innovation.nis));
        if half == Some(row) {
            half = halves.next();
            let figure = filter.step_error()?;
            if figure.error < NO_DOUBT * SHORT_ENOUGH {
                return Some(figure);
            }
        }
    }
    let figure = filter.step_error()?;
    Some(if figure.error.is_nan() { StepFigure { error: f64::INFINITY, ..figure } } else { figure })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kalmems_core::Covariance;

    /// A state that stays as it is, and of which each step makes an error.
    struct Drifting(f64);

    impl Transition for Drifting {
        fn advance(&self, x: &[f64], to: &mut [f64]) {
            to.copy_from_slice(x);
        }

        fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
            to.copy_from_slice(x);
            jacobian.copy_from_slice(&[1.0]);
        }

        fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
            to[0] = x[0] + self.0;
            true
        }

        fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
            covariance.fill(0.0);
            root.fill(0.0);
        }
    }

    /// A parameter without noise keeps the error that long steps have made of it: it counts, and asks for no shorter steps again and again.
    #[test]
    fn an_error_that_a_state_keeps_asks_for_shorter_steps_once() {
        let (mut watch, mut steps) = (StepWatch::<1>::new(false), 1);
        let known = Gaussian { mean: [0.0], covariance: Covariance::from_variances([1.0]) };
        let mut errors = Vec::new();
        for _ in 0..20 {
            for _ in 0..STEP_ERROR_SAMPLES {
                let error = 2.2e-5 / (steps as f64).powi(4);
                watch.step(&Drifting(error), (&[0.0], &[0.0]), &Mat([[1.0]]));
                watch.take(&known, 1.0);
            }
            let figure = watch.error().unwrap();
            errors.push(figure.error);
            let next = followed_steps(steps, figure);
            if next != steps {
                steps = next;
                watch.shorten();
            }
        }
        assert_eq!(steps, 2, "{errors:?}");
        // Until the first 0.03 is passed each sample adds 2.2e-5 · 16/15, and from there on a sixteenth of it.
        let last = errors.last().unwrap();
        assert!((0.03..0.05).contains(last), "{errors:?}");
    }

    /// Without process noise a claim decays below the rounding of its state, and an error of that size is none.
    #[test]
    fn no_state_counts_as_better_known_than_its_arithmetic() {
        let mut watch = StepWatch::<1>::new(false);
        let known = Gaussian { mean: [64.0], covariance: Covariance::from_variances([1e-90]) };
        let off = 2.0_f64.powi(-43);
        watch.step(&Drifting(off), (&[64.0], &[64.0]), &Mat([[1.0]]));
        watch.take(&known, 1.0);
        let error = watch.error().unwrap().error;
        assert!((error / (OF_FOURTH_ORDER * off / 64.0 / ARITHMETIC) - 1.0).abs() < 1e-12, "{error}");
    }
}

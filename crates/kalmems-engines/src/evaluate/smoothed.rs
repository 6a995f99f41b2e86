//! Whether a smoother changes its filter's answer by as much as it claims to.

use super::innovations::{InnovationTest, TestPlace, TestResult};
use crate::estimate::Trajectory;
use crate::progress::Interruption;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::VecDeque;
use std::ops::Range;

/// States that are looked at: those whose memory of errors is followed.
const STATES: usize = 4;

/// The part of a filter's variance below which what a smoother takes off it is no more than its arithmetic.
const ARITHMETIC: f64 = 1e-6;

/// How many times as large as claimed, root mean square, a smoother's changes are from which on they count, as of errors against a reference.
const DOUBTFUL: f64 = 1.3;

/// What a filter says of a sample for which its smoother has no answer yet.
#[derive(Clone)]
struct FilteredSample {
    time_s: f64,
    /// Mean and standard deviation of each state.
    states: [[f64; 2]; STATES],
    /// How one standard deviation in each uncertain direction of the device moves each of them.
    directions: Vec<[f64; STATES]>,
}

/// Sums over one state.
#[derive(Clone, Copy, Default)]
struct StateSums {
    /// Σ (x_s − x_f)².
    squares: f64,
    /// Σ of what is claimed of it, Σ of the squares of that, and what of the first sum is common to all samples.
    claimed: f64,
    claimed_squares: f64,
    common: f64,
    /// Σ P_f.
    filtered: f64,
    count: f64,
    /// Spans of time over which an error of the filter lasts.
    spans: f64,
}

/// A smoother's answer beside its filter's.
///
/// Of a right model x_s − x_f has the variance P_f − P_s, since x_f is the mean given a part of the samples that x_s is given: the difference is
/// a sum of the innovations to come and has nothing of the error of x_s. It lasts as long as an error of the filter does. Along a direction in which
/// the device is uncertain both answers move with the device, by D_f and D_s for one standard deviation: the difference has (D_s − D_f)² more of
/// its variance, where the claims have D_f² and D_s².
#[derive(Clone, Default)]
pub(super) struct SmoothingRecord {
    waiting: VecDeque<FilteredSample>,
    names: Vec<&'static str>,
    sums: [StateSums; STATES],
}

impl SmoothingRecord {
    /// Takes new samples of the filter in, and those that the smoother has become certain of; both in the order of time.
    pub(super) fn take(
        &mut self,
        (filtered, samples): (&Trajectory, Range<usize>),
        (smoothed, answered): (&Trajectory, Range<usize>),
        stop: &Interruption,
    ) {
        let states = filtered.own_states.min(STATES);
        if self.names.is_empty() {
            self.names = filtered.states.iter().take(states).map(|state| state.name).collect();
        }
        if let (Some(from_s), Some(to_s)) =
            (filtered.time_s.get(samples.start), filtered.time_s.get(samples.end.wrapping_sub(1)))
        {
            for (state, sums) in self.sums.iter_mut().enumerate().take(states) {
                sums.spans += filtered
                    .error_lasts_s(state, *from_s, *to_s)
                    .map_or(0.0, |lasts_s| (to_s - from_s) / lasts_s);
            }
        }
        self.waiting.extend(samples.map(|k| FilteredSample::of(filtered, k)));
        for k in answered {
            if stop.is_requested_at(k) {
                return;
            }
            let own = FilteredSample::of(smoothed, k);
            while self.waiting.front().is_some_and(|before| before.time_s < own.time_s) {
                self.waiting.pop_front();
            }
            if let Some(before) = self.waiting.front().filter(|before| before.time_s == own.time_s) {
                for (state, sums) in self.sums.iter_mut().enumerate().take(states) {
                    sums.take(before, &own, state);
                }
            }
        }
    }

    /// What is found of the state that speaks most against the smoother; `None` where there is none that could.
    pub(super) fn test(&self) -> Option<TestResult> {
        let judged = self.names.iter().zip(&self.sums).filter(|(_, sums)| sums.count > 0.0);
        let looks = judged.clone().count() as f64;
        let found = judged.map(|(name, sums)| (sums.ratio(), sums.p_value(), *name));
        let (size, p_value, name) = found.min_by(|a, b| a.1.total_cmp(&b.1).then(b.0.total_cmp(&a.0)))?;
        Some(TestResult {
            test: InnovationTest::Smoothing,
            p_value: (looks * p_value).min(1.0),
            size,
            place: Some(TestPlace::State { name }),
            signal: None,
        })
    }
}

impl FilteredSample {
    fn of(trajectory: &Trajectory, k: usize) -> Self {
        let number = |series: &[f64]| series.get(k).copied().unwrap_or(f64::NAN);
        let states = std::array::from_fn(|i| {
            trajectory
                .states
                .get(i)
                .map_or([f64::NAN; 2], |state| [&state.mean, &state.sd].map(|all| number(all)))
        });
        let direction = |part: &crate::estimate::Contribution| {
            std::array::from_fn(|i| part.states.get(i).map_or(0.0, |moves| number(moves)))
        };
        let directions = trajectory.considered.iter().map(direction).collect();
        Self { time_s: number(&trajectory.time_s), states, directions }
    }
}

impl StateSums {
    fn take(&mut self, before: &FilteredSample, after: &FilteredSample, state: usize) {
        let ([mean_f, sd_f], [mean_s, sd_s]) = (before.states[state], after.states[state]);
        let (mut own, mut common) = (sd_f * sd_f - sd_s * sd_s, 0.0);
        for (f, s) in before.directions.iter().zip(&after.directions) {
            let (f, s) = (f[state], s[state]);
            own -= f * f - s * s;
            common += (s - f) * (s - f);
        }
        let square = (mean_s - mean_f).powi(2);
        let claimed = own + common;
        if !(square + claimed).is_finite() {
            return;
        }
        self.squares += square;
        self.claimed += claimed;
        self.claimed_squares += claimed * claimed;
        self.common += common;
        self.filtered += sd_f * sd_f;
        self.count += 1.0;
    }

    /// What is claimed in all, but no less than what the arithmetic of two variances leaves of their difference.
    fn claim(&self) -> f64 {
        self.claimed.max(ARITHMETIC * self.filtered)
    }

    /// How many times as large as claimed the squares are.
    fn ratio(&self) -> f64 {
        self.squares / self.claim()
    }

    /// How probable so large changes are of a right model: those of so many independent ones, as the memory of the filter's errors says, fewer
    /// where the claim is not the same for all of them, and fewer where a part of them is common to all. Changes that are larger by less than
    /// counts are no finding.
    fn p_value(&self) -> f64 {
        if self.ratio() <= DOUBTFUL * DOUBTFUL {
            return 1.0;
        }
        let even = self.claimed * self.claimed / (self.count * self.claimed_squares);
        let even = if even.is_finite() { even.min(1.0) } else { 1.0 };
        let own = (self.spans * even).clamp(1.0, self.count.max(1.0));
        let shared = (self.common / self.claim()).clamp(0.0, 1.0).powi(2);
        let independent = ((1.0 - shared) / own + shared).recip();
        ChiSquared::new(independent).map_or(1.0, |law| law.sf(independent * self.ratio()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{ErrorSpan, TrajectoryKind};
    use crate::evaluate::innovations::WRONG;
    use crate::simulate::WhiteNoise;
    use crate::units::kind;

    /// A level that wanders and is measured in noise, x' = x + w: its Kalman filter and the smoother of Rauch, Tung and Striebel, both written out. The
    /// filter is told the variances `told` of process and measurement.
    fn answers(seed: u64, count: usize, told: [f64; 2]) -> [Vec<[f64; 2]>; 2] {
        let mut noise = WhiteNoise::new(seed, 1);
        let ([q, r], mut level) = (told, 0.0);
        let (mut mean, mut variance) = (0.0, 1.0);
        let (mut filtered, mut predicted) = (Vec::new(), Vec::new());
        for _ in 0..count {
            level += 0.1 * noise.sample();
            let sample = level + noise.sample();
            predicted.push([mean, variance + q]);
            let gain = (variance + q) / (variance + q + r);
            mean += gain * (sample - mean);
            variance = (1.0 - gain) * (variance + q);
            filtered.push([mean, variance]);
        }
        let mut smoothed = filtered.clone();
        for k in (0..count - 1).rev() {
            let ([m, p], [before, p_before], [after, p_after]) =
                (filtered[k], predicted[k + 1], smoothed[k + 1]);
            let back = p / p_before;
            smoothed[k] = [m + back * (after - before), p + back * back * (p_after - p_before)];
        }
        [filtered, smoothed]
    }

    fn trajectory(kind: TrajectoryKind, answer: &[[f64; 2]], from: usize) -> Trajectory {
        let time_s: Vec<f64> = (from..from + answer.len()).map(|k| k as f64).collect();
        let names = [("level", "m", &kind::LENGTH)];
        let mut of = Trajectory::blank(("", ""), kind, (&time_s, &time_s, &(0..time_s.len())), &names);
        of.own_states = 1;
        of.states[0].mean = answer.iter().map(|[mean, _]| *mean).collect();
        of.states[0].sd = answer.iter().map(|[_, variance]| variance.sqrt()).collect();
        // Of a gain of 0.095: (1 + a²)/(1 − a²) samples with a = 0.905.
        of.error_spans = vec![ErrorSpan { from_s: 0.0, to_s: 1e9, correlation_s: vec![10.06] }];
        of
    }

    /// The finding where the smoother is so many samples late.
    fn found([filtered, smoothed]: &[Vec<[f64; 2]>; 2], late: usize) -> TestResult {
        let mut record = SmoothingRecord::default();
        let (skip, stop) = (50, Interruption::never());
        let [filtered, smoothed] =
            [(TrajectoryKind::Filtered, filtered), (TrajectoryKind::Smoothed, smoothed)]
                .map(|(kind, answer)| trajectory(kind, answer, 0));
        let count = filtered.time_s.len();
        record.take((&filtered, skip..count), (&smoothed, skip..count - late), &stop);
        record.take((&filtered, count..count), (&smoothed, count - late..count), &stop);
        record.test().unwrap()
    }

    const RIGHT: [f64; 2] = [0.01, 1.0];

    #[test]
    fn what_a_right_smoother_changes_has_the_variance_that_it_takes_off_and_seldom_fails() {
        let (mut sum, sets) = (0.0, 300);
        for seed in 0..sets {
            let right = answers(seed, 2000, RIGHT);
            let own = found(&right, 300);
            assert_eq!(own, found(&right, 0), "{seed}");
            assert!(!own.fails(), "{own:?}");
            sum += own.size / f64::from(u32::try_from(sets).unwrap());
        }
        assert!((sum - 1.0).abs() < 0.03, "{sum}");
    }

    #[test]
    fn a_smoother_that_changes_more_than_it_claims_fails() {
        // The level wanders ten times as far as the filter is told.
        let told_too_little = found(&answers(1, 2000, [1e-4, 1.0]), 0);
        assert!(told_too_little.fails() && told_too_little.size > 2.0, "{told_too_little:?}");
        // A filter that is right, and a smoother whose means have gone astray, as rounding does it to one without process noise.
        let [filtered, smoothed] = answers(2, 2000, RIGHT);
        let astray = smoothed.iter().map(|[mean, variance]| [mean + 1.5, *variance]).collect();
        assert!(found(&[filtered.clone(), astray], 0).p_value < WRONG);
        // A smoother that claims more than its filter, and moves all the same.
        let wider = smoothed.iter().map(|[mean, variance]| [*mean, 4.0 * variance]).collect();
        let found = found(&[filtered, wider], 0);
        assert!(found.fails() && found.size > 1e3, "{found:?}");
    }
}

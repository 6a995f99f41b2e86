//! How long the error of an estimate lasts, by the filter's own account.

use kalmems_core::{Covariance, Ldl, Mat, StateTransition};

/// A part of a trajectory, and how long the errors of its first states last there.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorSpan {
    /// From here, in s.
    pub from_s: f64,
    /// To here, in s.
    pub to_s: f64,
    /// ∫ρ² over the time between two errors, in s, one for each of the first states: so much time holds one independent square
    /// of an error.
    pub correlation_s: Vec<f64>,
}

/// States that are followed: those of the motion come first.
const FOLLOWED: usize = 4;

/// The correlation that counts as none.
const FORGOTTEN: f64 = 0.05;

/// For how many times as long as it was followed an error is assumed to last in the same way, before another one is followed,
/// unless the filter settles further meanwhile.
const REST: u32 = 3;

/// The part of its variances at the beginning below which an error that is followed says nothing of those of now: a filter that settles forgets
/// the error of its start at once, while that of a parameter which it has learnt meanwhile lasts.
const SETTLED: f64 = 0.25;

/// The square of its correlation with an error of now from which on an error that is followed says something of that, however far the filter has
/// settled: where nothing is random, all errors are one.
const LASTS: f64 = 0.5;

/// The part of its variances that a covariance has more to be solved by, so that one in which some states follow from others has a solution as well.
const DISTINCT: f64 = 1e-12;

/// Updates of a span at least.
const SPAN: u32 = 1024;

/// Follows how errors of now show in the errors to come, one of each state.
///
/// With the gain K and the step F the error goes over as \\((1 - K H) F\\), and \\((1 - K H) = P^+ (P^-)^{-1}\\) of a filter whose gain is
/// the optimal one. So the covariance of an error with that of now is carried on, and its square, normalised, is summed up over time. Nothing of it
/// knows what the errors are: an error that does not go away, such as that of a wrong scale, does not excuse itself by lasting.
#[derive(Clone)]
pub(super) struct ErrorMemory<const N: usize> {
    followed: [FollowedError<N>; FOLLOWED],
    before_s: f64,
    /// When what is not given yet began, and its updates.
    span_began_s: f64,
    updates: u32,
}

/// An error of one state at some time.
#[derive(Clone, Copy)]
struct FollowedError<const N: usize> {
    state: MemoryState,
    /// Its covariance with all errors of now, and its variance then.
    column: [f64; N],
    variance: f64,
    /// Σ ρ²·Δt since then, and ρ² of the state with itself now.
    sum_s: f64,
    left: f64,
    began_s: f64,
    /// Updates since then for which the variance has been far below that of then.
    settled: u32,
    /// Since the last span: for how long errors were followed, and that over how long each lasted.
    followed_s: f64,
    independent: f64,
    /// How long the last of them lasted.
    lasted_s: Option<f64>,
}

/// What is going on.
#[derive(Clone, Copy)]
enum MemoryState {
    /// An error is to be followed from the next update on.
    Begins,
    /// One is followed, for so many updates.
    Follows(u32),
    /// None is, for so many updates more.
    Rests(u32),
}

impl<const N: usize> ErrorMemory<N> {
    pub(super) const fn new() -> Self {
        Self { followed: [FollowedError::NONE; FOLLOWED], before_s: 0.0, span_began_s: f64::NAN, updates: 0 }
    }

    /// Whether the covariance before the update will be asked for.
    pub(super) fn is_following(&self) -> bool {
        self.followed.iter().take(N).any(FollowedError::is_followed)
    }

    /// Takes a step and its update: how the state depends on the one before, and its covariance before and after the update.
    /// What is known of a part of the way, where enough of it is.
    #[allow(clippy::needless_range_loop)] // iterators that are zipped are not inlined: each costs a call for every sample
    pub(super) fn take(
        &mut self,
        time_s: f64,
        link: Option<&StateTransition<f64, N>>,
        (before, after): (Option<&Covariance<f64, N>>, &Covariance<f64, N>),
    ) -> Option<ErrorSpan> {
        if self.span_began_s.is_nan() {
            self.span_began_s = time_s;
        }
        self.updates += 1;
        // A filter that settles forgets the errors of its start at once.
        let of_all = &self.followed[..N.min(FOLLOWED)];
        let all_settled = of_all.iter().enumerate().all(|(i, one)| after.get(i, i) < SETTLED * one.variance);
        let is_past = all_settled && of_all.iter().all(|one| one.left < LASTS);
        let carried = link.zip(before).filter(|_| self.is_following()).map(|(link, before)| {
            let distinct = |i: usize, j: usize| before.get(i, j) * if i == j { 1.0 + DISTINCT } else { 1.0 };
            (link, Ldl::of(&Covariance::from_lower(Mat::from_fn(distinct))))
        });
        for i in 0..N.min(FOLLOWED) {
            let one = &mut self.followed[i];
            match (one.state, &carried) {
                (MemoryState::Follows(steps), _) if is_past || one.is_another(steps) => {
                    one.end(time_s);
                    one.begin(i, time_s, after);
                }
                (MemoryState::Follows(steps), Some((link, solver))) => {
                    let lasts = one.carry(i, (link, solver), after, time_s - self.before_s);
                    one.state = MemoryState::Follows(steps.saturating_add(1));
                    if !lasts {
                        one.end(time_s);
                        one.state = MemoryState::Rests(steps.saturating_add(1).saturating_mul(REST));
                    }
                }
                (MemoryState::Rests(left), _) if left > 0 && !all_settled => {
                    one.state = MemoryState::Rests(left - 1);
                }
                _ => one.begin(i, time_s, after),
            }
        }
        self.before_s = time_s;
        let of_all = &self.followed[..N.min(FOLLOWED)];
        let is_known =
            of_all.iter().all(|one| one.lasted_s.is_some()) && of_all.iter().any(|one| one.followed_s > 0.0);
        (self.updates >= SPAN && is_known).then(|| self.give(time_s))
    }

    /// What is known of the way since what was given last, at the end of a part. An error that has not gone away yet lasts, as far
    /// as is known, from its beginning to here.
    pub(super) fn rest(&mut self, time_s: f64) -> Option<ErrorSpan> {
        let is_known = self.followed.iter().take(N).all(|one| one.lasts_s(time_s).is_some());
        is_known.then(|| self.give(time_s))
    }

    fn give(&mut self, time_s: f64) -> ErrorSpan {
        let lasts_s = |one: &FollowedError<N>| one.lasts_s(time_s).unwrap_or(f64::NAN);
        let correlation_s = self.followed.iter().take(N).map(lasts_s).collect();
        let span = ErrorSpan { from_s: self.span_began_s, to_s: time_s, correlation_s };
        (self.span_began_s, self.updates) = (time_s, 0);
        for one in &mut self.followed {
            (one.followed_s, one.independent) = (0.0, 0.0);
        }
        span
    }
}

impl<const N: usize> FollowedError<N> {
    const NONE: Self = Self {
        state: MemoryState::Begins,
        column: [0.0; N],
        variance: 0.0,
        sum_s: 0.0,
        left: 1.0,
        began_s: 0.0,
        settled: 0,
        followed_s: 0.0,
        independent: 0.0,
        lasted_s: None,
    };

    const fn is_followed(&self) -> bool {
        matches!(self.state, MemoryState::Follows(_))
    }

    /// Whether the error of now is another one than that which is followed: for the last half of the way its variance has been far below that of
    /// then. In an oscillation it is at times, and in a filter that has just begun.
    const fn is_another(&self, steps: u32) -> bool {
        self.left < LASTS && steps >= SPAN && self.settled > steps / 2
    }

    fn begin(&mut self, i: usize, time_s: f64, covariance: &Covariance<f64, N>) {
        self.column = std::array::from_fn(|j| covariance.get(i, j));
        self.variance = covariance.get(i, i);
        (self.sum_s, self.left, self.settled) = (0.0, 1.0, 0);
        self.began_s = time_s;
        self.state = MemoryState::Follows(0);
    }

    /// Carries its covariances on; whether something of them is left.
    #[allow(clippy::needless_range_loop)] // as in `ErrorMemory::take`
    fn carry(
        &mut self,
        i: usize,
        (link, solver): (&StateTransition<f64, N>, &Ldl<f64, N>),
        after: &Covariance<f64, N>,
        interval_s: f64,
    ) -> bool {
        let mut moved = [-0.0; N];
        for r in 0..N {
            for c in 0..N {
                moved[r] += link.transition.0[r][c] * self.column[c];
            }
        }
        let weighted = solver.solve(&moved);
        self.column = [-0.0; N];
        for r in 0..N {
            for c in 0..N {
                self.column[r] += after.get(r, c) * weighted[c];
            }
        }
        let square = |j: usize| self.column[j] * self.column[j] / (self.variance * after.get(j, j));
        let own = square(i);
        // What is not a number ends it as well.
        let lasts = (0..N).map(square).filter(|s| s.is_finite()).fold(0.0, f64::max) > FORGOTTEN * FORGOTTEN;
        self.left = own;
        self.sum_s += own * interval_s;
        self.settled = if after.get(i, i) < SETTLED * self.variance { self.settled + 1 } else { 0 };
        lasts
    }

    /// How long the error that is followed has lasted until now: both ways in time, and the error itself.
    fn has_lasted_s(&self, time_s: f64) -> Option<f64> {
        let MemoryState::Follows(steps) = self.state else { return None };
        let passed_s = time_s - self.began_s;
        (steps > 0 && passed_s > 0.0).then(|| 2.0 * self.sum_s + passed_s / f64::from(steps))
    }

    /// How long errors last: those that went and the one that is followed, or if none went, the longer of that and the one before, because an error that
    /// has just begun tells nothing.
    fn lasts_s(&self, time_s: f64) -> Option<f64> {
        let now_s = self.has_lasted_s(time_s);
        if self.followed_s > 0.0 {
            let (passed_s, independent) =
                now_s.map_or((0.0, 0.0), |now_s| (time_s - self.began_s, (time_s - self.began_s) / now_s));
            return Some((self.followed_s + passed_s) / (self.independent + independent));
        }
        self.lasted_s.into_iter().chain(now_s).reduce(f64::max)
    }

    /// Counts what was followed.
    fn end(&mut self, time_s: f64) {
        let Some(lasted_s) = self.has_lasted_s(time_s) else { return };
        let passed_s = time_s - self.began_s;
        self.lasted_s = Some(lasted_s);
        self.followed_s += passed_s;
        self.independent += passed_s / lasted_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    const INTERVAL_S: f64 = 1e-3;

    /// A filter of a swing of two states that reads the first one, step by step, from its transition and noises.
    struct TwoStateSwing {
        transition: [[f64; 2]; 2],
        process: f64,
        measured: f64,
        covariance: [[f64; 2]; 2],
    }

    impl TwoStateSwing {
        fn new(turn: f64, decay: f64) -> Self {
            let (sin, cos) = turn.sin_cos();
            let transition = [[decay * cos, decay * sin], [-decay * sin, decay * cos]];
            Self { transition, process: 1e-4, measured: 1.0, covariance: [[1.0, 0.0], [0.0, 1.0]] }
        }

        /// Covariance before the update, gain, and covariance after it.
        fn step(&mut self) -> (Covariance<f64, 2>, [f64; 2], Covariance<f64, 2>) {
            let (f, p) = (self.transition, self.covariance);
            let spread = |i: usize, j: usize| {
                let sum = (0..2).flat_map(|a| (0..2).map(move |b| (a, b)));
                sum.map(|(a, b)| f[i][a] * p[a][b] * f[j][b]).sum::<f64>()
            };
            let before =
                [[spread(0, 0) + self.process, spread(0, 1)], [spread(1, 0), spread(1, 1) + self.process]];
            let gain = [0, 1].map(|i| before[i][0] / (before[0][0] + self.measured));
            self.covariance = [0, 1].map(|i| [0, 1].map(|j| before[i][j] - gain[i] * before[0][j]));
            (Covariance::from_lower(Mat(before)), gain, Covariance::from_lower(Mat(self.covariance)))
        }

        fn link(&self) -> StateTransition<f64, 2> {
            let noise = Covariance::from_variances([self.process; 2]);
            StateTransition { transition: Mat(self.transition), noise }
        }
    }

    /// How long an error of the first state lasts, over so many steps.
    fn lasts_s(swing: &mut TwoStateSwing, steps: usize) -> f64 {
        let mut memory = ErrorMemory::<2>::new();
        let (mut passed_s, mut independent) = (0.0, 0.0);
        let mut count = |span: Option<ErrorSpan>| {
            if let Some(span) = span {
                passed_s += span.to_s - span.from_s;
                independent += (span.to_s - span.from_s) / span.correlation_s[0];
            }
        };
        for k in 0..steps {
            let (before, _, after) = swing.step();
            count(memory.take(k as f64 * INTERVAL_S, Some(&swing.link()), (Some(&before), &after)));
        }
        count(memory.rest((steps - 1) as f64 * INTERVAL_S));
        // What follows the last error that was followed to its end is not told of.
        assert!(passed_s > 0.9 * steps as f64 * INTERVAL_S, "{passed_s}");
        passed_s / independent
    }

    #[test]
    fn of_a_level_it_is_that_of_a_geometric_series() {
        // ρ = a^l, so that 1 + 2·Σρ² = (1 + a²)/(1 − a²) steps.
        let mut memory = ErrorMemory::<1>::new();
        let (mut p, q, r) = (1.0_f64, 1e-3, 1.0);
        let mut spans = Vec::new();
        let mut remains = 0.0;
        for k in 0..40_000 {
            let before = p + q;
            remains = r / (before + r);
            p = before * remains;
            let [before, after] = [before, p].map(|p| Covariance::from_variances([p]));
            let noise = Covariance::from_variances([q]);
            let link = StateTransition { transition: Mat([[1.0]]), noise };
            spans.extend(memory.take(f64::from(k) * INTERVAL_S, Some(&link), (Some(&before), &after)));
        }
        let square = remains * remains;
        let expected_s = INTERVAL_S * (1.0 + square) / (1.0 - square);
        let found_s = spans.last().unwrap().correlation_s[0];
        // What is left of an error when it counts as forgotten is 0.05² of a sum.
        assert!((found_s / expected_s - 1.0).abs() < 0.01, "{found_s} for {expected_s}");
    }

    #[test]
    fn the_error_memory_predicts_how_much_a_mean_square_of_errors_varies() {
        let steps = 20_000;
        let mut swing = TwoStateSwing::new(0.3, 0.9999);
        for _ in 0..5000 {
            swing.step();
        }
        let lasts_s = lasts_s(&mut swing, steps);
        // The mean over a time T of squares that last τ has the variance 2τ/T: simulated errors of the same filter.
        let mut noise = WhiteNoise::new(5, 1);
        let sets = 400;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..sets {
            let mut e = [0, 1].map(|i: usize| swing.covariance[i][i].sqrt() * noise.sample());
            let mut mean = 0.0;
            for _ in 0..steps {
                let (_, gain, after) = swing.step();
                let f = swing.transition;
                let w =
                    [0, 1].map(|i| f[i][0] * e[0] + f[i][1] * e[1] + swing.process.sqrt() * noise.sample());
                let residual = w[0] + swing.measured.sqrt() * noise.sample();
                e = [0, 1].map(|i| w[i] - gain[i] * residual);
                mean += e[0] * e[0] / after.get(0, 0) / steps as f64;
            }
            sum += mean;
            squares += mean * mean;
        }
        let n = f64::from(sets);
        let variance = squares / n - (sum / n).powi(2);
        let expected = 2.0 * lasts_s / (steps as f64 * INTERVAL_S);
        // A variance of 400 numbers has a standard deviation of 7 %.
        assert!((variance / expected - 1.0).abs() < 0.25, "{variance} for {expected}");
        assert!((sum / n - 1.0).abs() < 4.0 * (expected / n).sqrt(), "{}", sum / n);
    }

    #[test]
    fn an_error_that_stays_lasts_as_long_as_the_way() {
        // Two states that are never told apart, nor read: no process noise, no decay.
        let mut memory = ErrorMemory::<2>::new();
        let covariance = Covariance::from_variances([1.0, 4.0]);
        let link =
            StateTransition { transition: Mat::identity(), noise: Covariance::from_variances([0.0; 2]) };
        for k in 0..5000 {
            let span = memory.take(f64::from(k) * INTERVAL_S, Some(&link), (Some(&covariance), &covariance));
            assert_eq!(span, None);
        }
        let span = memory.rest(4.999).unwrap();
        assert!(span.correlation_s.iter().all(|lasts_s| (lasts_s / 10.0 - 1.0).abs() < 1e-3), "{span:?}");
    }

    /// A swing whose frequency, a number that walks slowly, is learnt at the same time: the errors of the swing go, that of the number stays for as long
    /// as was learnt so far.
    #[test]
    fn an_error_of_what_is_learnt_slowly_lasts_while_others_go() {
        let mut memory = ErrorMemory::<2>::new();
        let (mut level, mut spans) = (1.0_f64, Vec::new());
        let (noise, steps) = (1.0, 200_000_u32);
        for k in 0..steps {
            // Of a constant that each sample shows the variance is that of the mean, and the correlation of two errors the root of their times' ratio.
            let known = noise / f64::from(k + 1);
            let before_level = level + 1e-2;
            level = before_level * noise / (before_level + noise);
            let [before, after] = [[before_level, noise / f64::from(k.max(1))], [level, known]];
            let [before, after] = [before, after].map(Covariance::from_variances);
            let link = StateTransition {
                transition: Mat::identity(),
                noise: Covariance::from_variances([1e-2, 0.0]),
            };
            spans.extend(memory.take(f64::from(k) * INTERVAL_S, Some(&link), (Some(&before), &after)));
        }
        spans.extend(memory.rest(f64::from(steps - 1) * INTERVAL_S));
        let independent = |state: usize| -> f64 {
            spans.iter().map(|span| (span.to_s - span.from_s) / span.correlation_s[state]).sum()
        };
        // The mean of ρ² over all pairs of times is a half: two errors. A sum over spans counts the early ones, of little time, as much as the late ones.
        assert!((1.0..30.0).contains(&independent(1)), "{}", independent(1));
        assert!(independent(0) > 5000.0, "{}", independent(0));
    }

    /// Two temperatures that decay, the second of which follows the first at once, of which nothing is random: one error, however small it becomes.
    #[test]
    fn an_error_that_decays_without_noise_is_one_as_long_as_it_lasts() {
        let mut memory = ErrorMemory::<2>::new();
        let (decay, part) = (0.999_f64, 0.3);
        let link = StateTransition {
            transition: Mat([[decay, 0.0], [decay * part, 0.0]]),
            noise: Covariance::from_variances([0.0; 2]),
        };
        let mut spans = Vec::new();
        for k in 0..5000 {
            let variance = 4.0 * decay.powi(2 * k);
            let entries = [[variance, 0.0], [part * variance, part * part * variance]];
            let covariance = Covariance::from_lower(Mat(entries));
            spans.extend(memory.take(
                f64::from(k) * INTERVAL_S,
                Some(&link),
                (Some(&covariance), &covariance),
            ));
        }
        spans.extend(memory.rest(4.999));
        let [span] = &spans[..] else { panic!("{spans:?}") };
        assert!(span.correlation_s.iter().all(|lasts_s| (lasts_s / 10.0 - 1.0).abs() < 1e-3), "{span:?}");
    }
}

//! The search for sizes that make the innovations of the fitted blocks the likeliest.

use super::bench::TrialBench;
use super::cause::Cause;
use super::coloured_noise::ColouredNoiseCause;
use super::suspect::Suspect;
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::evaluate::{InnovationTest, TestPlace};
use crate::fit::{Innovations, MostLikely, most_likely};
use kalmems_core::Portable;
use kalmems_core::Scalar;

/// What is searched among, and what a cause has to be better than.
pub(super) struct CauseSearch<'a> {
    pub(super) bench: &'a TrialBench<'a>,
    pub(super) suspects: &'a [Suspect],
    /// As the experiment is.
    pub(super) base: &'a DiagnosisTrial,
}

/// A cause with the sizes that fit the fitted blocks best.
#[derive(Clone, Debug)]
pub(super) struct FittedCause {
    pub(super) cause: Cause,
    /// ln p of the blocks that were not fitted, less that of the experiment as it is.
    pub(super) held_out: f64,
}

/// How far beyond the first sizes that are tried a search may go.
const BEYOND: f64 = 3.0;

/// Standard deviations from which on an innovation is an outlier.
const OUTLYING: f64 = 6.0;

/// Rounds of looking for outliers: those that are large hide others.
const ROUNDS: usize = 4;

/// A share of samples above which they are no outliers.
const MOST_OUTLIERS: f64 = 0.03;

/// Sizes in a row on one side that make the innovations less likely, from which on larger ones are not tried.
const ENOUGH_IN_VAIN: usize = 2;

/// ln p that a number must promise to gain, by its slope, to be followed up.
const LEAST_PROMISE: f64 = 2.0;

/// The share of the largest promise below which a number is not followed up: what gains so little at first cannot gain most.
const SMALL_PROMISE: f64 = 0.02;

/// Steps of a search for a line, for each frequency that the recording can tell from the next; and how many there are at most.
const FINE: f64 = 8.0;
const MOST_STEPS: f64 = 400.0;

/// Steps by which the frequency of a line is tuned, in parts of what the recording can tell from the next.
const TUNING: [f64; 4] = [0.3, 0.1, 0.03, 0.01];

/// Where a search for coloured noise begins, by what the innovations show of it: factors of its standard deviation and its correlation time.
const STARTS: [[f64; 2]; 4] = [[1.0, 1.0], [2.0, 2.0], [4.0, 4.0], [4.0, 16.0]];

/// A first step of the logarithm of either.
const COLOURED_STEP: f64 = 0.1;

/// Second causes that are followed up for a first.
const SECONDS: usize = 4;

impl CauseSearch<'_> {
    /// One run; `None` where it cannot be compared with the experiment as it is.
    pub(super) fn run(&self, cause: &Cause) -> Option<DiagnosisTrial> {
        self.comparable(cause, self.bench.run(&cause.changes(self.suspects)?)?)
    }

    /// The same without the tests of its innovations.
    pub(super) fn run_unjudged(&self, cause: &Cause) -> Option<DiagnosisTrial> {
        self.comparable(cause, self.bench.run_unjudged(&cause.changes(self.suspects)?)?)
    }

    fn comparable(&self, cause: &Cause, trial: DiagnosisTrial) -> Option<DiagnosisTrial> {
        // A filter that takes fewer samples in has more likely ones for that reason alone.
        let fewer = self.base.updates().saturating_sub(trial.updates());
        let allowed = match cause {
            Cause::Outliers { times, .. } => times.len(),
            _ => self.base.updates() / 1000,
        };
        (fewer <= allowed).then_some(trial)
    }

    /// Whether a number promises enough to be searched, with the largest promise of all; every one that has any effect, where the filter
    /// does not follow the motion and slopes say nothing.
    pub(super) fn is_worth(&self, promise: Option<f64>, largest: f64) -> bool {
        promise.is_some_and(|promise| {
            !self.base.follows() || promise > LEAST_PROMISE.max(SMALL_PROMISE * largest)
        })
    }

    /// A single number that may be wrong.
    pub(super) fn number(&self, place: usize) -> Option<FittedCause> {
        let own = self.base.log_likelihood(TrialBlocks::Fitted);
        let mut best = (0.0, own);
        // Of a filter that follows the motion the likelihood falls on the side where it is not: so far from there on in vain.
        let mut in_vain = [0_usize; 2];
        for size in &self.suspects.get(place)?.sizes {
            let side = usize::from(*size < 0.0);
            if self.base.follows() && in_vain[side] >= ENOUGH_IN_VAIN {
                continue;
            }
            in_vain[side] += 1;
            let Some(trial) = self.run_unjudged(&Cause::Numbers(vec![(place, *size)])) else { continue };
            let found = trial.log_likelihood(TrialBlocks::Fitted);
            if found > own {
                in_vain[side] = 0;
            }
            if found > best.1 {
                best = (*size, found);
            }
        }
        self.refined(&Cause::Numbers(vec![(place, best.0)]))
    }

    /// Pairs with a number that explains most by itself: the partners by which the likelihood rises most at first, followed up.
    pub(super) fn pairs(&self, first: &FittedCause) -> Vec<FittedCause> {
        let Cause::Numbers(numbers) = &first.cause else { return Vec::new() };
        let Some(&(place, size)) = numbers.first() else { return Vec::new() };
        let Some(alone) = self.run_unjudged(&first.cause) else { return Vec::new() };
        let mut seconds: Vec<(f64, usize)> = (0..self.suspects.len())
            .filter(|second| *second != place)
            .filter_map(|second| Some((self.promise(&[(place, size)], second, &alone)?, second)))
            .collect();
        seconds.sort_by(|a, b| b.0.total_cmp(&a.0));
        let followed = seconds.into_iter().take(SECONDS).filter_map(|(_, second)| {
            let sizes = self.suspects[second].sizes.iter().copied().chain([0.0]);
            let tried = sizes.filter_map(|other| {
                let cause = Cause::Numbers(vec![(place, size), (second, other)]);
                Some((self.run_unjudged(&cause)?.log_likelihood(TrialBlocks::Fitted), cause))
            });
            let (_, cause) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
            self.refined(&cause)
        });
        followed.collect()
    }

    /// What a number promises to gain beside others, by the slope of the innovations: g²/2I; `None` of one that changes nothing.
    pub(super) fn promise(
        &self,
        others: &[(usize, f64)],
        place: usize,
        alone: &DiagnosisTrial,
    ) -> Option<f64> {
        let step = self.step(place);
        let beside = self.run_unjudged(&Cause::Numbers([others, &[(place, step)]].concat()))?;
        let score = alone.part(TrialBlocks::Fitted).score(&beside.part(TrialBlocks::Fitted), step);
        (score.information > 0.0).then(|| 0.5 * score.gradient * score.gradient / score.information)
    }

    /// A line at each frequency at which the tests of the innovations find one, or too much power: where the innovations have most.
    pub(super) fn lines(&self) -> Vec<FittedCause> {
        let resolution_hz = 1.0 / self.duration_s();
        let mut frequencies: Vec<f64> = Vec::new();
        for found in self.base.failing() {
            let around = |hz: f64, by: f64| {
                [(hz - by * resolution_hz).max(0.25 * resolution_hz), hz + by * resolution_hz]
            };
            let range = match (found.test, &found.place) {
                (InnovationTest::Line, Some(TestPlace::Frequency { hz })) => around(*hz, 1.5),
                (InnovationTest::Harmonics, Some(TestPlace::Harmonic { number, of_hz })) => {
                    around(*number as f64 * of_hz, 0.5)
                }
                (InnovationTest::Bands, Some(TestPlace::Band { from_hz, to_hz })) => {
                    [around(*from_hz, 1.0)[0], around(*to_hz, 1.0)[1]]
                }
                _ => continue,
            };
            let frequency_hz = self.strongest(range, resolution_hz);
            if frequencies.iter().all(|known| (known - frequency_hz).abs() > resolution_hz) {
                frequencies.push(frequency_hz);
            }
        }
        frequencies.into_iter().filter_map(|hz| self.tuned(hz, resolution_hz)).collect()
    }

    /// A line near a frequency, where it makes the fitted blocks the likeliest: what follows of it in the innovations is not all at its own
    /// frequency.
    fn tuned(&self, frequency_hz: f64, resolution_hz: f64) -> Option<FittedCause> {
        let fitted = |frequency_hz: f64| {
            let (signal, harmonic) = (self.bench.signal.clone(), self.harmonic(frequency_hz, resolution_hz));
            let cause = Cause::Line { signal, frequency_hz, amplitude: [0.0; 2], harmonic };
            let cause = cause.resized(&self.fit(&cause, TrialBlocks::Fitted)?.0);
            let trial = self.run_unjudged(&cause)?;
            Some((trial.log_likelihood(TrialBlocks::Fitted), frequency_hz, cause))
        };
        let mut best = fitted(frequency_hz)?;
        for part in TUNING {
            for side in [-part, part] {
                for _ in 0..TUNING.len() {
                    match fitted(best.1 + side * resolution_hz) {
                        Some(found) if found.0 > best.0 => best = found,
                        _ => break,
                    }
                }
            }
        }
        self.refined(&best.2)
    }

    /// Which harmonic of the motion a frequency is, by the motion's frequency in the test of harmonics.
    fn harmonic(&self, frequency_hz: f64, resolution_hz: f64) -> Option<usize> {
        let of_hz = self.base.tests.iter().find_map(|test| match &test.place {
            Some(TestPlace::Harmonic { of_hz, .. }) => Some(*of_hz),
            _ => None,
        })?;
        let number = (frequency_hz / of_hz).round();
        let is_near = (frequency_hz - number * of_hz).abs() < 0.5 * resolution_hz;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 1 to below 1000
        (is_near && (1.0..1e3).contains(&number)).then_some(number as usize)
    }

    /// The frequency in a range at which the innovations of the first signal, over their standard deviations, have most.
    fn strongest(&self, [from_hz, to_hz]: [f64; 2], resolution_hz: f64) -> f64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of steps, bounded
        let steps = (FINE * (to_hz - from_hz) / resolution_hz).clamp(1.0, MOST_STEPS).ceil() as u32;
        let at = |step: u32| from_hz + (to_hz - from_hz) * f64::from(step) / f64::from(steps);
        let power = |hz: f64| {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for (k, (value, variance)) in
                self.base.innovations.value.iter().zip(&self.base.innovations.variance).enumerate()
            {
                let z = value / variance.sqrt();
                if self.base.is_of_first[k] && z.is_finite() {
                    let phase = std::f64::consts::TAU * hz * self.base.time_s[k];
                    cosine += z * Scalar::cos(phase);
                    sine += z * Scalar::sin(phase);
                }
            }
            cosine * cosine + sine * sine
        };
        let all = (0..=steps).map(|step| (power(at(step)), at(step)));
        all.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(from_hz, |(_, hz)| hz)
    }

    /// From the first innovation to the last, in s.
    fn duration_s(&self) -> f64 {
        let [first, last] =
            [self.base.time_s.first(), self.base.time_s.last()].map(|t| t.copied().unwrap_or(0.0));
        (last - first).abs().max(f64::MIN_POSITIVE)
    }

    /// Noise that a sample shares with those before it, where the innovations show some.
    pub(super) fn coloured_noise(&self) -> Option<FittedCause> {
        let shown = ColouredNoiseCause::of(self.base)?;
        // The filter has followed a part of it.
        let starts = STARTS.iter().map(|factors| Cause::ColouredNoise(shown.times(*factors)));
        let tried = starts
            .filter_map(|cause| Some((self.run_unjudged(&cause)?.log_likelihood(TrialBlocks::Fitted), cause)))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        self.refined(&tried.1)
    }

    /// Samples that are none of the noise, where there are some and not too many.
    pub(super) fn outliers(&self) -> Option<FittedCause> {
        let mut times: Vec<f64> = Vec::new();
        let mut lost = 0.0;
        for _ in 0..ROUNDS {
            let trial = if times.is_empty() {
                self.base.clone()
            } else {
                self.run_unjudged(&self.outliers_at(&times))?
            };
            let found = outlying(&trial);
            if found.is_empty() {
                break;
            }
            times.extend(found.iter().map(|(time, _)| time));
            let held_out = found.iter().filter(|(_, is_fitted)| !is_fitted).count();
            lost += held_out as f64 * self.density_of_outliers();
            times.sort_by(f64::total_cmp);
            times.dedup();
        }
        let share = times.len() as f64 / self.base.updates() as f64;
        if times.is_empty() || share > MOST_OUTLIERS {
            return None;
        }
        let cause = self.outliers_at(&times);
        let trial = self.run_unjudged(&cause)?;
        let held_out = trial.log_likelihood(TrialBlocks::HeldOut) + lost
            - self.base.log_likelihood(TrialBlocks::HeldOut);
        Some(FittedCause { cause, held_out })
    }

    fn outliers_at(&self, times: &[f64]) -> Cause {
        Cause::Outliers { signal: self.bench.signal.clone(), times: times.to_vec() }
    }

    /// ln p of a sample that may be anywhere among the innovations.
    fn density_of_outliers(&self) -> f64 {
        let finite = self.base.innovations.value.iter().filter(|value| value.is_finite());
        let largest = finite.fold(0.0_f64, |largest, value| largest.max(value.abs()));
        -(2.0 * largest).portable_ln()
    }

    /// The sizes of a cause that fit best, from these on.
    fn refined(&self, cause: &Cause) -> Option<FittedCause> {
        let found = self.fit(cause, TrialBlocks::Fitted)?;
        let cause = cause.resized(&found.0);
        let trial = self.run_unjudged(&cause)?;
        let held_out =
            trial.log_likelihood(TrialBlocks::HeldOut) - self.base.log_likelihood(TrialBlocks::HeldOut);
        held_out.is_finite().then_some(FittedCause { cause, held_out })
    }

    /// Sizes and their standard errors by some of the blocks.
    pub(super) fn fit(&self, cause: &Cause, blocks: TrialBlocks) -> Option<(Vec<f64>, Vec<f64>)> {
        if let Cause::Outliers { .. } = cause {
            return Some((Vec::new(), Vec::new()));
        }
        self.most_likely(cause, blocks).map(|found| (found.at, found.sd))
    }

    /// The same with the correlations of their errors.
    pub(super) fn most_likely(&self, cause: &Cause, blocks: TrialBlocks) -> Option<MostLikelySizes> {
        let steps: Vec<f64> = match cause {
            Cause::Numbers(numbers) => numbers.iter().map(|(place, _)| self.step(*place)).collect(),
            Cause::ColouredNoise(_) => vec![COLOURED_STEP; 2],
            Cause::Line { .. } | Cause::Outliers { .. } => vec![0.1 * self.base.innovation_sd(); 2],
        };
        most_likely_sizes(&cause.sizes(), &steps, &mut |at| self.innovations(cause, at, blocks))
    }

    /// The innovations of some blocks with a cause of these sizes; `None` of one far beyond what is tried, and where the filter cannot be run.
    pub(super) fn innovations(
        &self,
        cause: &Cause,
        sizes: &[f64],
        blocks: TrialBlocks,
    ) -> Option<Innovations> {
        if let Cause::Numbers(numbers) = cause {
            let beyond = numbers.iter().zip(sizes).any(|((place, _), size)| {
                let largest = self.suspects[*place].sizes.iter().fold(0.0_f64, |l, s| l.max(s.abs()));
                size.abs() > BEYOND * largest
            });
            if beyond {
                return None;
            }
        }
        let trial = self.run_unjudged(&cause.resized(sizes))?;
        Some(trial.part(blocks))
    }

    /// A first step of a number: half of the smallest size that is tried.
    pub(super) fn step(&self, place: usize) -> f64 {
        self.suspects.get(place).map_or(f64::INFINITY, Suspect::step)
    }
}

/// Sizes that make innovations the likeliest, with their standard errors and the correlations of these.
#[derive(Clone, Debug)]
pub(super) struct MostLikelySizes {
    pub(super) at: Vec<f64>,
    pub(super) sd: Vec<f64>,
    pub(super) correlation: Vec<Vec<f64>>,
    pub(super) log_likelihood: f64,
}

/// The most sizes that are fitted together.
pub(super) const MOST_SIZES: usize = 8;

/// As [`most_likely`], of as many sizes as there are, which are not more than [`MOST_SIZES`].
pub(super) fn most_likely_sizes(
    start: &[f64],
    steps: &[f64],
    filter: &mut dyn FnMut(&[f64]) -> Option<Innovations>,
) -> Option<MostLikelySizes> {
    macro_rules! by_count {
        ($($count:literal)+) => {
            match start.len() {
                $($count => {
                    let found: MostLikely<$count> = most_likely(
                        start.try_into().ok()?,
                        steps.try_into().ok()?,
                        &mut |at: &[f64; $count]| filter(at),
                    )?;
                    Some(MostLikelySizes {
                        at: found.at.to_vec(),
                        sd: found.sd.to_vec(),
                        correlation: found.correlation.iter().map(|row| row.to_vec()).collect(),
                        log_likelihood: found.log_likelihood,
                    })
                })+
                _ => None,
            }
        };
    }
    by_count!(1 2 3 4 5 6 7 8)
}

/// Innovations of the first signal that are far larger than the others, with whether their block is fitted.
fn outlying(trial: &DiagnosisTrial) -> Vec<(f64, bool)> {
    let z: Vec<f64> =
        trial.innovations.value.iter().zip(&trial.innovations.variance).map(|(v, s)| v / s.sqrt()).collect();
    let mut sizes: Vec<f64> = z.iter().filter(|z| z.is_finite()).map(|z| z.abs()).collect();
    if sizes.is_empty() {
        return Vec::new();
    }
    let middle = sizes.len() / 2;
    // The median of the size of a normal number is 0.6745 of its standard deviation; outliers do not move it.
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    let sd = (*median / 0.6745).max(1.0);
    let large = |k: &usize| trial.is_of_first[*k] && z[*k].abs() > OUTLYING * sd;
    // What follows an outlier is disturbed by it: the first of those that follow each other is taken alone.
    let mut last: Option<usize> = None;
    let first_of_run = |k: &usize| {
        let is_first = last.is_none_or(|last| *k > last + 1);
        last = Some(*k);
        is_first
    };
    (0..z.len()).filter(large).filter(first_of_run).map(|k| (trial.time_s[k], trial.is_fitted(k))).collect()
}

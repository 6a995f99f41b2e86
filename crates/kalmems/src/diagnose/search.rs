//! The search for sizes that make the innovations of the fitted blocks the likeliest.

use super::bench::TrialBench;
use super::cause::Cause;
use super::coloured_noise::ColouredNoiseCause;
use super::slopes::NumberSlopes;
use super::suspect::Suspect;
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::fit::{Innovations, MostLikely, most_likely};
use crate::progress::{Progress, map_on_threads, processors};
use kalmems_core::Portable;
use std::borrow::Cow;

/// What is searched among, and what a cause has to be better than.
#[derive(Clone, Copy)]
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

/// Where a search for coloured noise begins, by what the innovations show of it: factors of its standard deviation and its correlation time.
const STARTS: [[f64; 2]; 4] = [[1.0, 1.0], [2.0, 2.0], [4.0, 4.0], [4.0, 16.0]];

/// A first step of the logarithm of either.
const COLOURED_STEP: f64 = 0.1;

/// The part of what slopes promise that a run has to gain for them to be relied on.
const KEPT_PROMISE: f64 = 0.5;

/// The part of a recording that mistaken units are looked for in first, and the rows that it has at least.
const BEGINNING: usize = 40;
const LEAST_BEGINNING: usize = 512;

/// Mistaken units and signs that are followed up in whole recordings.
const FOLLOWED_SLIPS: usize = 6;

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
    pub(super) fn is_worth(&self, promise: f64, largest: f64) -> bool {
        !self.base.follows() || promise > LEAST_PROMISE.max(SMALL_PROMISE * largest)
    }

    /// A single number that may be wrong: from where its slopes say, or else from the likeliest of the sizes that are tried first.
    pub(super) fn number(&self, place: usize, slopes: &NumberSlopes) -> Option<FittedCause> {
        let promise = slopes.alone();
        let near = self.near(&Cause::Numbers(vec![(place, promise.sizes[0])]), promise.gain);
        near.or_else(|| self.beside(&[], place, self.base))
    }

    /// A cause with its sizes fitted from these on, where the run with them gains most of what their slopes promise: where it does not, the slopes say
    /// nothing.
    pub(super) fn near(&self, cause: &Cause, promise: f64) -> Option<FittedCause> {
        if !self.base.follows() {
            return None;
        }
        let trial = self.trial(cause, &cause.sizes())?;
        (trial.follows() && self.gained(&trial) > KEPT_PROMISE * promise)
            .then(|| self.refined(cause, Some(&trial)))?
    }

    /// By how much the fitted blocks are likelier than as the experiment is, ln p.
    fn gained(&self, trial: &DiagnosisTrial) -> f64 {
        trial.log_likelihood(TrialBlocks::Fitted) - self.base.log_likelihood(TrialBlocks::Fitted)
    }

    /// The pairs of numbers that promise most together, with what they promise: more than either alone.
    pub(super) fn promising_pairs(slopes: &[(usize, NumberSlopes)], most: usize) -> Vec<(Cause, f64)> {
        let mut pairs = Vec::new();
        for (at, (first, own)) in slopes.iter().enumerate() {
            for (second, other) in slopes.iter().skip(at + 1) {
                let Some(promise) = own.with(other) else { continue };
                if promise.gain > LEAST_PROMISE + own.alone().gain.max(other.alone().gain) {
                    let [a, b] = promise.sizes;
                    pairs.push((Cause::Numbers(vec![(*first, a), (*second, b)]), promise.gain));
                }
            }
        }
        pairs.sort_by(|a, b| b.1.total_cmp(&a.1));
        pairs.truncate(most);
        pairs
    }

    /// Those of these mistaken units and signs with which the filter follows the motion in the beginning of the recordings and is nearly the likeliest there,
    /// the likeliest first. `None` where the work is interrupted.
    pub(super) fn promising_slips(&self, slips: &[usize], progress: &dyn Progress) -> Option<Vec<usize>> {
        let beginning = self.bench.beginning(BEGINNING, LEAST_BEGINNING);
        let as_it_is = beginning.run_unjudged(&[]).map(|base| base.log_likelihood(TrialBlocks::All));
        let tried = |at: usize, heard: &dyn Progress| {
            heard.reached(0).is_continue().then(|| {
                let changes = Cause::Numbers(vec![(slips[at], 0.0)]).changes(self.suspects)?;
                let trial = beginning.run_while(&changes, &DiagnosisTrial::follows)?;
                let found = trial.log_likelihood(TrialBlocks::All);
                let is_likelier = as_it_is.is_none_or(|as_it_is| found - as_it_is > LEAST_PROMISE);
                (found.is_finite() && is_likelier).then(|| (found, trial.updates(), slips[at]))
            })
        };
        let what = (progress, "trying units, signs and wiring on the beginning");
        let tried = map_on_threads(what, processors(), (slips.len(), 1), tried)?;
        let mut promising: Vec<_> = tried.into_iter().flatten().collect();
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        // A mistake beside which other numbers are a little wrong has innovations that are larger than those of a right model, and not by much.
        if let Some(&(best, updates, _)) = promising.first() {
            promising.retain(|(found, ..)| *found > best - updates as f64);
        }
        promising.truncate(FOLLOWED_SLIPS);
        Some(promising.into_iter().map(|(.., place)| place).collect())
    }

    /// A mistaken unit or sign, or a choice, where the filter follows the motion with it and is likelier.
    pub(super) fn slip(&self, place: usize) -> Option<FittedCause> {
        let cause = Cause::Numbers(vec![(place, 0.0)]);
        let changes = cause.changes(self.suspects)?;
        let trial = self.bench.run_while(&changes, &DiagnosisTrial::follows)?;
        let trial = self.comparable(&cause, trial)?;
        (self.gained(&trial) > LEAST_PROMISE).then(|| self.refined(&cause, Some(&trial)))?
    }

    /// A number beside others, with all their sizes fitted: from the size, among those that are tried first, that makes the fitted blocks the
    /// likeliest, or from none. `alone` is the run with the others alone.
    pub(super) fn beside(
        &self,
        others: &[(usize, f64)],
        place: usize,
        alone: &DiagnosisTrial,
    ) -> Option<FittedCause> {
        let with = |size: f64| Cause::Numbers([others, &[(place, size)]].concat());
        let own = alone.log_likelihood(TrialBlocks::Fitted);
        // A run that stands in for another one is none with these sizes.
        let mut best = (0.0, own, Some(Cow::Borrowed(alone)).filter(|alone| alone.is_its_own()));
        // Of a filter that follows the motion the likelihood falls on the side where it is not: so far from there on in vain.
        let mut in_vain = [0_usize; 2];
        for size in &self.suspects.get(place)?.sizes {
            let side = usize::from(*size < 0.0);
            if alone.follows() && in_vain[side] >= ENOUGH_IN_VAIN {
                continue;
            }
            in_vain[side] += 1;
            let Some(trial) = self.run_unjudged(&with(*size)) else { continue };
            let found = trial.log_likelihood(TrialBlocks::Fitted);
            if found > own {
                in_vain[side] = 0;
            }
            if found > best.1 {
                best = (*size, found, Some(Cow::Owned(trial)));
            }
        }
        let (size, _, trial) = best;
        self.refined(&with(size), trial.as_deref())
    }

    /// The run with a cause that changes nothing, where it is known.
    pub(super) fn of_nothing(&self) -> Option<&DiagnosisTrial> {
        Some(self.base).filter(|base| base.is_its_own())
    }

    /// Pairs with a number that explains most by itself: the partners by which the likelihood rises most at first, followed up.
    pub(super) fn pairs(&self, first: &FittedCause) -> Vec<FittedCause> {
        let Cause::Numbers(numbers) = &first.cause else { return Vec::new() };
        let Some(&(place, size)) = numbers.first() else { return Vec::new() };
        let Some(alone) = self.run_unjudged(&first.cause) else { return Vec::new() };
        let mut seconds: Vec<(f64, usize)> = (0..self.suspects.len())
            .filter(|second| *second != place && !self.suspects[*second].is_further())
            .filter_map(|second| Some((self.slopes(&[(place, size)], second, &alone)?.alone().gain, second)))
            .collect();
        seconds.sort_by(|a, b| b.0.total_cmp(&a.0));
        let followed = seconds.into_iter().take(SECONDS);
        followed.filter_map(|(_, second)| self.beside(&[(place, size)], second, &alone)).collect()
    }

    /// What the innovations of the fitted blocks say of a number beside others; `None` of one that changes nothing.
    pub(super) fn slopes(
        &self,
        others: &[(usize, f64)],
        place: usize,
        alone: &DiagnosisTrial,
    ) -> Option<NumberSlopes> {
        let step = self.step(place);
        let beside = self.run_unjudged(&Cause::Numbers([others, &[(place, step)]].concat()))?;
        NumberSlopes::of(&alone.part(TrialBlocks::Fitted), &beside.part(TrialBlocks::Fitted), step)
    }

    /// Noise that a sample shares with those before it, where the innovations show some.
    pub(super) fn coloured_noise(&self) -> Option<FittedCause> {
        let shown = ColouredNoiseCause::of(self.base)?;
        // The filter has followed a part of it.
        let starts = STARTS.iter().map(|factors| Cause::ColouredNoise(shown.times(*factors)));
        let tried = starts
            .filter_map(|cause| {
                let trial = self.run_unjudged(&cause)?;
                Some((trial.log_likelihood(TrialBlocks::Fitted), cause, trial))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        let found = self.refined(&tried.1, Some(&tried.2))?;
        // An offset that steps or drifts is fitted best by noise that hardly changes over the recording.
        matches!(&found.cause, Cause::ColouredNoise(noise) if noise.is_told()).then_some(found)
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

    /// The sizes of a cause that fit best, from these on, whose run may be known.
    fn refined(&self, cause: &Cause, known: Option<&DiagnosisTrial>) -> Option<FittedCause> {
        let (found, trial) = self.most_likely_from(cause, known, TrialBlocks::Fitted)?;
        self.fitted(cause.resized(&found.at), &trial)
    }

    /// A cause that was fitted, with the run that has it.
    pub(super) fn fitted(&self, cause: Cause, trial: &DiagnosisTrial) -> Option<FittedCause> {
        let held_out =
            trial.log_likelihood(TrialBlocks::HeldOut) - self.base.log_likelihood(TrialBlocks::HeldOut);
        held_out.is_finite().then_some(FittedCause { cause, held_out })
    }

    /// Sizes and their standard errors by some of the blocks.
    pub(super) fn fit(&self, cause: &Cause, blocks: TrialBlocks) -> Option<MostLikelySizes> {
        if let Cause::Outliers { .. } = cause {
            let none = Vec::new;
            return Some(MostLikelySizes {
                at: none(),
                sd: none(),
                correlation: Vec::new(),
                log_likelihood: f64::NAN,
                promised: 0.0,
            });
        }
        self.most_likely(cause, blocks)
    }

    /// The same with the correlations of their errors.
    pub(super) fn most_likely(&self, cause: &Cause, blocks: TrialBlocks) -> Option<MostLikelySizes> {
        self.most_likely_from(cause, None, blocks).map(|(found, _)| found)
    }

    /// The same with the run there, where the run with the cause as it is may be known.
    pub(super) fn most_likely_from(
        &self,
        cause: &Cause,
        known: Option<&DiagnosisTrial>,
        blocks: TrialBlocks,
    ) -> Option<(MostLikelySizes, DiagnosisTrial)> {
        let steps: Vec<f64> = match cause {
            Cause::Numbers(numbers) => numbers.iter().map(|(place, _)| self.step(*place)).collect(),
            Cause::ColouredNoise(_) => vec![COLOURED_STEP; 2],
            Cause::Line { .. } | Cause::Outliers { .. } => vec![self.amplitude_step(); 2],
        };
        let start = cause.sizes();
        let (found, run) = most_likely_sizes(&start, &steps, &mut |at| {
            let known = known.filter(|_| at == start).cloned();
            known.or_else(|| self.trial(cause, at)).map(|trial| TrialPart::of(trial, blocks))
        })?;
        Some((found, run.trial))
    }

    /// The innovations of some blocks with a cause of these sizes; `None` of one far beyond what is tried, and where the filter cannot be run.
    pub(super) fn innovations(
        &self,
        cause: &Cause,
        sizes: &[f64],
        blocks: TrialBlocks,
    ) -> Option<Innovations> {
        self.trial(cause, sizes).map(|trial| trial.part(blocks))
    }

    /// The run with a cause of these sizes, likewise.
    fn trial(&self, cause: &Cause, sizes: &[f64]) -> Option<DiagnosisTrial> {
        if let Cause::Numbers(numbers) = cause {
            let mut placed = numbers.iter().zip(sizes);
            let beyond = placed.any(|((place, _), size)| size.abs() > self.suspects[*place].furthest());
            if beyond {
                return None;
            }
        }
        self.run_unjudged(&cause.resized(sizes))
    }

    /// A first step of the amplitudes of a line.
    pub(super) fn amplitude_step(&self) -> f64 {
        0.1 * self.base.innovation_sd()
    }

    /// A first step of a number: half of the smallest size that is tried.
    pub(super) fn step(&self, place: usize) -> f64 {
        self.suspects.get(place).map_or(f64::INFINITY, Suspect::step)
    }
}

/// A run, of which some of the blocks are fitted.
pub(super) struct TrialPart {
    pub(super) trial: DiagnosisTrial,
    innovations: Innovations,
}

impl TrialPart {
    pub(super) fn of(trial: DiagnosisTrial, blocks: TrialBlocks) -> Self {
        Self { innovations: trial.part(blocks), trial }
    }
}

impl AsRef<Innovations> for TrialPart {
    fn as_ref(&self) -> &Innovations {
        &self.innovations
    }
}

/// Sizes that make innovations the likeliest, with their standard errors and the correlations of these.
#[derive(Clone, Debug)]
pub(super) struct MostLikelySizes {
    pub(super) at: Vec<f64>,
    pub(super) sd: Vec<f64>,
    pub(super) correlation: Vec<Vec<f64>>,
    pub(super) log_likelihood: f64,
    /// What ln p would still gain where the search ended.
    pub(super) promised: f64,
}

/// What ln p may still gain at what counts as its maximum: half of a standard error from it.
const MAXIMUM: f64 = 0.125;

impl MostLikelySizes {
    /// Whether the search ended where no maximum is: at the end of what is tried, or of what the filter can be run with. Neither value nor standard
    /// error means anything there.
    pub(super) fn is_no_maximum(&self) -> bool {
        self.promised.is_nan() || self.promised > MAXIMUM
    }
}

/// The most sizes that are fitted together.
pub(super) const MOST_SIZES: usize = 8;

/// As [`most_likely`], of as many sizes as there are, which are not more than [`MOST_SIZES`]; with the run there.
pub(super) fn most_likely_sizes<R: AsRef<Innovations>>(
    start: &[f64],
    steps: &[f64],
    filter: &mut dyn FnMut(&[f64]) -> Option<R>,
) -> Option<(MostLikelySizes, R)> {
    macro_rules! by_count {
        ($($count:literal)+) => {
            match start.len() {
                $($count => {
                    let found: MostLikely<$count, R> = most_likely(
                        start.try_into().ok()?,
                        steps.try_into().ok()?,
                        &mut |at: &[f64; $count]| filter(at),
                    )?;
                    let sizes = MostLikelySizes {
                        at: found.at.to_vec(),
                        sd: found.sd.to_vec(),
                        correlation: found.correlation.iter().map(|row| row.to_vec()).collect(),
                        log_likelihood: found.log_likelihood,
                        promised: found.promised,
                    };
                    Some((sizes, found.run))
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

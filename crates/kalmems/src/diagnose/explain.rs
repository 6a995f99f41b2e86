//! Which causes explain a recording, and which of them it cannot tell apart.

use super::answer::AnswerChange;
use super::bench::TrialBench;
use super::cause::Cause;
use super::search::{CauseSearch, FittedCause};
use super::slopes::NumberSlopes;
use super::suspect::Suspect;
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::progress::{Progress, each_on_threads, map_on_threads, processors};
use kalmems_core::Portable;
use std::convert::Infallible;

/// A cause that was followed up.
#[derive(Clone, Debug)]
pub(super) struct ExaminedCause {
    /// With the sizes by all blocks.
    pub(super) cause: Cause,
    /// Their standard errors.
    pub(super) sd: Vec<f64>,
    /// By how much the blocks that were not fitted are likelier, ln p.
    pub(super) gain: f64,
    /// The run with it.
    pub(super) trial: DiagnosisTrial,
    /// What it makes of the answer.
    pub(super) answer: Option<AnswerChange>,
    /// Whether its sizes are the end of a search and make nothing the likeliest.
    pub(super) is_end_of_search: bool,
}

/// What is tried at once.
#[derive(Clone, Copy)]
enum Job {
    /// A number, by its place among those that are worth it.
    Number(usize),
    /// What is so or is not, by its place among the suspects.
    Choice(usize),
    /// Lines in the signal.
    Lines,
    /// Noise that a sample shares with those before it.
    ColouredNoise,
    /// Samples of the signal that are none of its noise.
    Outliers,
}

/// What came of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Explanations {
    /// Where one of the likeliest leaves nothing that the tests find: it, and those that the recording cannot tell from it, the likeliest
    /// first.
    pub(super) causes: Vec<ExaminedCause>,
    /// Where none does: those that explain most.
    pub(super) closest: Vec<ExaminedCause>,
    /// How many causes were tried.
    pub(super) tried: usize,
    /// What a gain has to be above.
    pub(super) needed: f64,
    /// What was not tried, so that the work does not become more than it may be.
    pub(super) left_out: Vec<String>,
    /// All that was fitted, the likeliest first.
    pub(super) ranking: Vec<FittedCause>,
    /// Whether the work was interrupted, so that no more than that is known.
    pub(super) is_interrupted: bool,
}

/// The probability that any of the causes that were tried gains as much without being one. The likelihood ratio of blocks that were
/// not fitted is 1 on average where nothing is wrong, so that its probability to be above c is below 1/c.
const BY_CHANCE: f64 = 1e-2;

/// Causes whose blocks that were not fitted are so nearly as likely, ln p, are the same to the recording: a factor of a thousand.
const SAME: f64 = 6.9;

/// Single causes that partners are looked for, and pairs that are followed up by what they promise.
const FIRSTS: usize = 4;
const PAIRS: usize = 4;

/// Causes that are listed where none passes.
const CLOSEST: usize = 3;

/// Causes that are tried before what was done is held against what may be done. It is the same number on every machine, as is then what is left out.
const AT_ONCE: usize = 8;

/// The mean NIS above which units and signs are tried before sizes.
const FAR_OFF: f64 = 100.0;

/// Mistaken units that are tried at once: each is the work of several runs.
const SLIPS_AT_ONCE: usize = 2;

/// The size up to which a mistaken unit is one with its factor as it is.
const PLAIN_SLIP: f64 = 0.1;

/// Numbers that are tried before what is in the signal.
const NUMBERS_FIRST: usize = 4;

/// The causes that are found at a place of what is tried.
type CausesAt<'t> = &'t (dyn Fn(usize) -> Vec<FittedCause> + Sync);

/// A search for explanations as it goes.
struct CauseHunt<'a> {
    search: CauseSearch<'a>,
    progress: &'a dyn Progress,
    /// The rows that may be filtered.
    most_rows: u64,
    found: Vec<FittedCause>,
    left_out: Vec<String>,
}

impl CauseHunt<'_> {
    fn is_interrupted(&self) -> bool {
        self.progress.reached(0).is_break()
    }

    /// Tries so many causes, those that promise most first, as far as the work may go, and returns how many were tried; what is left out has this name.
    fn attempt(&mut self, (what, at_once): (&str, usize), count: usize, causes: CausesAt<'_>) -> usize {
        let stop = &self.search.bench.stop;
        let (begun, mut done) = (stop.rows(), 0);
        while done < count && !self.is_interrupted() {
            let now = at_once.min(count - done);
            // As many rows for each as for those before it.
            let ahead = (stop.rows() - begun) * now as u64 / done.max(1) as u64;
            if stop.rows().saturating_add(ahead) >= self.most_rows {
                self.left_out.push(format!("{what} ({} of {count})", count - done));
                break;
            }
            self.progress
                .begin(&format!("trying {what}, {} to {} of {count}", done + 1, done + now), now as u64);
            let mut found = Vec::new();
            let point = |place: usize, heard: &dyn Progress| {
                let found = causes(done + place);
                // A search that was stopped in its middle has found nothing.
                heard.reached(0).is_continue().then_some(found)
            };
            let take = |place, causes| {
                found.push((place, causes));
                Ok::<(), Infallible>(())
            };
            let _ = each_on_threads(self.progress, processors(), (now, 1), point, take);
            found.sort_by_key(|(place, _)| *place);
            self.found.extend(found.into_iter().flat_map(|(_, causes)| causes));
            done += now;
        }
        done
    }

    /// What came of it, by so many tries.
    fn judged(&mut self, causes: Vec<FittedCause>, tries: usize) -> Explanations {
        let found = Explanations::of(&self.search, causes, tries);
        self.with_all(if self.is_interrupted() {
            Explanations { is_interrupted: true, tried: tries, ..Explanations::default() }
        } else {
            found
        })
    }

    /// The same of all that was found, where there is more than there was `before`, or else what came of that.
    fn judged_again(&mut self, last: &Explanations, before: usize, tries: usize) -> Explanations {
        let more = self.found.get(before..).is_some_and(|more| !more.is_empty());
        let again =
            if more || self.is_interrupted() { self.judged(self.found.clone(), tries) } else { last.clone() };
        // What explained it by itself does so beside what was found later and does not.
        let found = if again.is_end() { again } else { Explanations { tried: tries, ..last.clone() } };
        self.with_all(found)
    }

    /// Tries mistaken units, signs and wiring: those that promise something in the beginning of the recordings are followed up. How many there are.
    fn slips(&mut self) -> usize {
        let CauseSearch { suspects, .. } = self.search;
        let is_of = |place: &usize| suspects[*place].is_slip() || suspects[*place].is_wiring();
        let slips: Vec<usize> = (0..suspects.len()).filter(is_of).collect();
        let (search, promising) = (self.search, self.search.promising_slips(&slips, self.progress));
        let promising = promising.unwrap_or_default();
        self.attempt(("units, signs and wiring", SLIPS_AT_ONCE), promising.len(), &|at| {
            search.slip(promising[at]).into_iter().collect()
        });
        slips.len()
    }

    /// The same with all that was fitted and left out so far.
    fn with_all(&self, found: Explanations) -> Explanations {
        let ranking = likeliest_first(self.found.clone());
        Explanations { left_out: self.left_out.clone(), ranking, ..found }
    }
}

/// Each cause once, the likeliest first: a pair is found from either of its numbers.
fn likeliest_first(mut found: Vec<FittedCause>) -> Vec<FittedCause> {
    found.sort_by(|a, b| b.held_out.total_cmp(&a.held_out));
    let mut seen: Vec<Vec<usize>> = Vec::new();
    found.retain(|found| {
        let Cause::Numbers(numbers) = &found.cause else { return true };
        let mut places: Vec<usize> = numbers.iter().map(|(place, _)| *place).collect();
        places.sort_unstable();
        let is_new = !seen.contains(&places);
        if is_new {
            seen.push(places);
        }
        is_new
    });
    found
}

impl Explanations {
    /// What is left of it where the work is interrupted before it was tested: what was fitted.
    pub(super) fn interrupted(self) -> Self {
        Self { ranking: self.ranking, is_interrupted: true, tried: self.tried, ..Self::default() }
    }

    /// Whether no more is to be tried: the work was interrupted, or a cause explains the recording.
    fn is_end(&self) -> bool {
        self.is_interrupted || !self.causes.is_empty()
    }

    pub(super) fn by(
        bench: &TrialBench,
        suspects: &[Suspect],
        base: &DiagnosisTrial,
        (progress, most_rows): (&dyn Progress, u64),
    ) -> Self {
        let search = CauseSearch { bench, suspects, base };
        let mut hunt = CauseHunt { search, progress, most_rows, found: Vec::new(), left_out: Vec::new() };
        // So far off a slope tells nothing, and the sizes of all numbers are more work than their units.
        let is_far_off = !base.follows() || base.mean_nis() > FAR_OFF;
        let tried = if is_far_off { hunt.slips() } else { 0 };
        if is_far_off {
            let of_slips = hunt.judged(hunt.found.clone(), tried);
            if of_slips.is_interrupted || of_slips.is_mistake() {
                return of_slips;
            }
        }
        let count = suspects.iter().filter(|suspect| !suspect.is_further()).count();
        let slopes =
            map_on_threads((progress, "looking at slopes"), processors(), (count, 1), |place, heard| {
                heard.reached(0).is_continue().then(|| search.slopes(&[], place, base))
            });
        let slopes = slopes.unwrap_or_default();
        let slopes: Vec<(usize, NumberSlopes)> =
            slopes.into_iter().enumerate().filter_map(|(place, slopes)| Some((place, slopes?))).collect();
        let largest = slopes.iter().map(|(_, slopes)| slopes.alone().gain).fold(0.0, f64::max);
        let mut numbers: Vec<usize> =
            (0..slopes.len()).filter(|at| search.is_worth(slopes[*at].1.alone().gain, largest)).collect();
        numbers.sort_by(|a, b| slopes[*b].1.alone().gain.total_cmp(&slopes[*a].1.alone().gain));
        let mut jobs: Vec<Job> = numbers.into_iter().map(Job::Number).collect();
        let behind = jobs.split_off(NUMBERS_FIRST.min(jobs.len()));
        let is_choice = |place: &usize| suspects[*place].is_choice() && !suspects[*place].is_wiring();
        let choices = (0..suspects.len()).filter(is_choice).map(Job::Choice);
        let of_recording: Vec<Job> =
            [Job::Lines, Job::ColouredNoise, Job::Outliers].into_iter().chain(choices).collect();
        // The slopes of all numbers were looked at.
        let tries = tried + count + of_recording.len();
        jobs.extend(of_recording.into_iter().chain(behind));
        hunt.attempt(("causes", AT_ONCE), jobs.len(), &|place| match jobs[place] {
            Job::Number(at) => search.number(slopes[at].0, &slopes[at].1).into_iter().collect(),
            Job::Choice(place) => search.slip(place).into_iter().collect(),
            Job::Lines => search.lines(),
            Job::ColouredNoise => search.coloured_noise().into_iter().collect(),
            Job::Outliers => search.outliers().into_iter().collect(),
        });
        let alone = hunt.judged(hunt.found.clone(), tries);
        // Under a steady drive a line and a wrong number look the same.
        let is_number = |found: &ExaminedCause| matches!(found.cause, Cause::Numbers(_));
        if alone.is_interrupted || alone.causes.iter().any(is_number) {
            return alone;
        }
        Self::further(&mut hunt, &slopes, &alone, is_far_off)
    }

    /// Whether mistaken units or signs are the causes, with factors as they are.
    fn is_mistake(&self) -> bool {
        let is_plain = |found: &ExaminedCause| found.cause.sizes().iter().all(|size| size.abs() < PLAIN_SLIP);
        self.causes.first().is_some_and(is_plain)
    }

    /// What is tried where no number alone explains the recording: units, signs and wiring, and pairs.
    fn further(
        hunt: &mut CauseHunt,
        slopes: &[(usize, NumberSlopes)],
        alone: &Self,
        has_slips: bool,
    ) -> Self {
        let search = hunt.search;
        let singles = hunt.found.clone();
        let tried = if has_slips { 0 } else { hunt.slips() };
        let mut tries = alone.tried + tried;
        let of_slips = hunt.judged_again(alone, singles.len(), tries);
        if of_slips.is_end() {
            return of_slips;
        }
        let mut firsts: Vec<FittedCause> =
            singles.into_iter().filter(|found| matches!(found.cause, Cause::Numbers(_))).collect();
        firsts.sort_by(|a, b| b.held_out.total_cmp(&a.held_out));
        firsts.truncate(FIRSTS);
        let pairs = CauseSearch::promising_pairs(slopes, PAIRS);
        let before = hunt.found.len();
        let mut tried = hunt.attempt(("pairs", AT_ONCE), pairs.len(), &|place| {
            let (cause, gain) = &pairs[place];
            search.near(cause, *gain).into_iter().collect()
        });
        // Each is the work of many causes.
        tried += hunt.attempt(("pairs with the likeliest numbers", 1), firsts.len(), &|place| {
            search.pairs(&firsts[place])
        });
        // Which numbers are first was chosen by what they gain: any pair could have been.
        let count = slopes.len();
        if tried > 0 {
            tries += count * count.saturating_sub(1) / 2;
        }
        let mut found = hunt.judged(hunt.found.get(before..).unwrap_or_default().to_vec(), tries);
        if found.causes.is_empty() {
            found.closest = of_slips.closest;
        }
        found
    }

    /// Judges what was tried: the likeliest, and those as likely, are the causes if one of them leaves nothing that the tests find.
    fn of(search: &CauseSearch, tried: Vec<FittedCause>, tries: usize) -> Self {
        let tried = likeliest_first(tried);
        let needed = (tries as f64 / BY_CHANCE).portable_ln();
        let best = tried.first().map_or(0.0, |tried| tried.held_out);
        let worth = tried.iter().take_while(|tried| tried.held_out > needed).enumerate();
        let listed = worth.take_while(|(place, tried)| *place < CLOSEST || tried.held_out > best - SAME);
        let found: Vec<ExaminedCause> =
            listed.filter_map(|(_, tried)| ExaminedCause::of(search, tried)).collect();
        let best = found.first().map_or(0.0, |found| found.gain);
        let (mut causes, mut closest) = (Vec::new(), Vec::new());
        for found in found {
            if found.gain > best - SAME { &mut causes } else { &mut closest }.push(found);
        }
        if !causes.iter().any(|found| found.trial.is_explained()) {
            closest = [causes, closest].concat();
            closest.truncate(CLOSEST);
            causes = Vec::new();
        }
        Self { causes, closest, tried: tries, needed, ..Self::default() }
    }
}

impl ExaminedCause {
    /// With its sizes by all blocks.
    fn of(search: &CauseSearch, tried: &FittedCause) -> Option<Self> {
        let sizes = search.fit(&tried.cause, TrialBlocks::All)?;
        let cause = tried.cause.resized(&sizes.at);
        let trial = search.run(&cause)?;
        let answer = AnswerChange::between(search.base, &trial);
        let is_end_of_search = sizes.is_no_maximum();
        Some(Self { cause, sd: sizes.sd, gain: tried.held_out, trial, answer, is_end_of_search })
    }
}

//! Which causes explain a recording, and which of them it cannot tell apart.

use super::DiagnoseError;
use super::answer::AnswerChange;
use super::bench::TrialBench;
use super::cause::Cause;
use super::search::{CauseSearch, FittedCause};
use super::suspect::Suspect;
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::progress::{Progress, map_on_threads, processors};
use kalmems_core::Portable;

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
    /// A number, by its place among the suspects.
    Number(usize),
    /// Lines in the signal.
    Lines,
    /// Noise that a sample shares with those before it.
    ColouredNoise,
    /// Samples of the signal that are none of its noise.
    Outliers,
}

/// What came of it.
#[derive(Clone, Debug)]
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
}

/// The probability that any of the causes that were tried gains as much without being one. The likelihood ratio of blocks that were
/// not fitted is 1 on average where nothing is wrong, so that its probability to be above c is below 1/c.
const BY_CHANCE: f64 = 1e-2;

/// Causes whose blocks that were not fitted are so nearly as likely, ln p, are the same to the recording: a factor of a thousand.
const SAME: f64 = 6.9;

/// Single causes that partners are looked for.
const FIRSTS: usize = 2;

/// Causes that are listed where none passes.
const CLOSEST: usize = 3;

/// The causes that are found at a place of what is tried.
type CausesAt<'t> = &'t (dyn Fn(usize) -> Vec<FittedCause> + Sync);

impl Explanations {
    pub(super) fn by(
        bench: &TrialBench,
        suspects: &[Suspect],
        base: &DiagnosisTrial,
        progress: &dyn Progress,
    ) -> Result<Self, DiagnoseError> {
        let search = CauseSearch { bench, suspects, base };
        let each = |what, count, causes: CausesAt<'_>| -> Result<Vec<FittedCause>, DiagnoseError> {
            let found = map_on_threads((progress, what), processors(), (count, 1), |place, heard| {
                heard.reached(0).is_continue().then(|| causes(place))
            });
            Ok(found.ok_or(DiagnoseError::Interrupted)?.into_iter().flatten().collect())
        };
        let count = suspects.iter().filter(|suspect| !suspect.is_slip()).count();
        let promises =
            map_on_threads((progress, "looking at slopes"), processors(), (count, 1), |place, heard| {
                heard.reached(0).is_continue().then(|| search.promise(&[], place, base))
            });
        let promises = promises.ok_or(DiagnoseError::Interrupted)?;
        let largest = promises.iter().flatten().copied().fold(0.0, f64::max);
        let numbers = (0..count).filter(|place| search.is_worth(promises[*place], largest)).map(Job::Number);
        let jobs: Vec<Job> = numbers.chain([Job::Lines, Job::ColouredNoise, Job::Outliers]).collect();
        let tried = each("trying causes", jobs.len(), &|place| match jobs[place] {
            Job::Number(number) => search.number(number).into_iter().collect(),
            Job::Lines => search.lines(),
            Job::ColouredNoise => search.coloured_noise().into_iter().collect(),
            Job::Outliers => search.outliers().into_iter().collect(),
        })?;
        let alone = Self::of(&search, tried.clone(), count + 3);
        // Under a steady drive a line and a wrong number look the same.
        let is_number = |found: &ExaminedCause| matches!(found.cause, Cause::Numbers(_));
        if alone.causes.iter().any(is_number) {
            return Ok(alone);
        }
        let slips = suspects.len() - count;
        let slipped =
            each("trying units and signs", slips, &|place| search.slip(count + place).into_iter().collect())?;
        if !slipped.is_empty() {
            let slipped = Self::of(&search, [tried, slipped].concat(), alone.tried + slips);
            if !slipped.causes.is_empty() {
                return Ok(slipped);
            }
        }
        if !alone.causes.is_empty() {
            return Ok(alone);
        }
        let numbers = alone.closest.iter().filter(|found| matches!(found.cause, Cause::Numbers(_)));
        let firsts: Vec<FittedCause> = numbers
            .take(FIRSTS)
            .map(|found| FittedCause { cause: found.cause.clone(), held_out: found.gain })
            .collect();
        let tried = each("trying pairs", firsts.len(), &|place| search.pairs(&firsts[place]))?;
        // Which numbers are first was chosen by what they gain: any pair could have been.
        let tries = alone.tried + slips + count * count.saturating_sub(1) / 2;
        let mut pairs = Self::of(&search, tried, tries);
        if pairs.causes.is_empty() {
            pairs.closest = alone.closest;
        }
        Ok(pairs)
    }

    /// Judges what was tried: the likeliest, and those as likely, are the causes if one of them leaves nothing that the tests find.
    fn of(search: &CauseSearch, mut tried: Vec<FittedCause>, tries: usize) -> Self {
        tried.sort_by(|a, b| b.held_out.total_cmp(&a.held_out));
        // A pair is found from either of its numbers.
        let mut seen: Vec<Vec<usize>> = Vec::new();
        tried.retain(|tried| {
            let Cause::Numbers(numbers) = &tried.cause else { return true };
            let mut places: Vec<usize> = numbers.iter().map(|(place, _)| *place).collect();
            places.sort_unstable();
            let is_new = !seen.contains(&places);
            if is_new {
                seen.push(places);
            }
            is_new
        });
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
        Self { causes, closest, tried: tries, needed }
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

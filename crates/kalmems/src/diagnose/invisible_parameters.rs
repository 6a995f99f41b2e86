//! What no innovation shows: parameters that change the answer without a trace.

use super::answer::AnswerChange;
use super::bench::TrialBench;
use super::suspect::{NumberRole, Suspect};
use super::trial::DiagnosisTrial;
use crate::progress::{Progress, map_on_threads, processors};
use serde::Serialize;

/// A parameter that the signal alone cannot tell, and what it does to the answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScaleNote {
    /// The parameter, by its key below the device's table.
    pub parameter: String,
    /// By which part it may be wrong before the innovations show it: five standard deviations of what they tell of it if all else is
    /// right; at most 1.
    pub hidden: f64,
    /// The part of which `change` is the effect: one per cent, or what is hidden if that is less.
    pub by: f64,
    /// What that changes in the answer.
    pub change: AnswerChange,
    /// The state that is the answer.
    pub answer: &'static str,
    /// Its SI unit as column names have it.
    pub unit: &'static str,
}

/// The relative change over which differences are taken: small enough for what is linear, and large against rounding.
const STEP: f64 = 1e-3;

/// Standard deviations at which the innovations show something: half of its square is ln p, and its probability is below 10⁻⁶.
const SHOWN: f64 = 5.0;

/// A parameter is hidden where what it may be wrong by without a trace moves the answer by so many claimed standard deviations.
const MATTERS: f64 = 3.0;

/// A parameter that is worse known than this is measured before anything is estimated with it.
const LIKELY: f64 = 0.1;

/// The parameters whose error the innovations leave hidden and that move the answer by more than it claims, those that move it most
/// first; `None` where the work was stopped.
pub(super) fn notes(
    bench: &TrialBench,
    suspects: &[Suspect],
    base: &DiagnosisTrial,
    progress: &dyn Progress,
) -> Option<Vec<ScaleNote>> {
    let numbers: Vec<&Suspect> = suspects
        .iter()
        .filter(|suspect| matches!(suspect.what, NumberRole::Factor(_) | NumberRole::InputScale { .. }))
        .collect();
    let work = (progress, "computing what the signal cannot tell");
    let found = map_on_threads(work, processors(), (numbers.len(), 1), |place, heard| {
        heard.reached(0).is_continue().then(|| note(bench, numbers[place], base))
    })?;
    let mut notes: Vec<ScaleNote> = found.into_iter().flatten().collect();
    notes.sort_by(|a, b| b.change.rms.total_cmp(&a.change.rms));
    Some(notes)
}

fn note(bench: &TrialBench, suspect: &Suspect, base: &DiagnosisTrial) -> Option<ScaleNote> {
    let changed = bench.run(&suspect.changes(STEP)?)?;
    let information = base.innovations.score(&changed.innovations, STEP).information;
    let change = AnswerChange::between(base, &changed)?;
    if change.rms == 0.0 {
        return None;
    }
    let hidden = (SHOWN / information.sqrt()).min(1.0);
    let matters = change.rms / STEP * hidden.min(LIKELY) > MATTERS * change.claimed;
    let by = hidden.min(0.01);
    let change = change.times(by / STEP);
    let (answer, unit) = (base.answer_name, base.answer_unit);
    matters.then(|| ScaleNote { parameter: suspect.name(), hidden, by, change, answer, unit })
}

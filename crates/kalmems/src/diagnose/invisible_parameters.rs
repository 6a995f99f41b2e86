//! What no innovation shows: parameters that change the answer without a trace.

use super::answer::AnswerChange;
use super::bench::TrialBench;
use super::hidden_directions::{changes, hidden_directions, told};
use super::sensitivity::NumberSensitivity;
use super::trial::DiagnosisTrial;
use serde::Serialize;

/// A parameter that the signal alone cannot tell, and what it does to the answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScaleNote {
    /// The parameter, by its key below the device's table.
    pub parameter: String,
    /// The parameters that make up for it, if innovations show it by itself: by how many times its relative error each is wrong.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub with: Vec<(String, f64)>,
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

/// Standard deviations at which the innovations show something: half of its square is ln p, and its probability is below 10⁻⁶.
const SHOWN: f64 = 5.0;

/// A parameter is hidden where what it may be wrong by without a trace moves the answer by so many claimed standard deviations.
const MATTERS: f64 = 3.0;

/// The step along a combination of numbers, of the largest of them.
const STEP: f64 = 1e-3;

/// A parameter that is worse known than this is measured before anything is estimated with it.
const LIKELY: f64 = 0.1;

/// The parameters whose error the innovations leave hidden and that move the answer by more than it claims, those that move it most
/// first.
pub(super) fn notes(
    bench: &TrialBench,
    numbers: &[NumberSensitivity],
    base: &DiagnosisTrial,
) -> Vec<ScaleNote> {
    let mut notes: Vec<ScaleNote> = numbers.iter().filter_map(|number| note(number, base)).collect();
    let directions = hidden_directions(numbers);
    notes.extend(directions.iter().filter_map(|direction| of_direction(bench, numbers, direction, base)));
    notes.sort_by(|a, b| b.change.rms.total_cmp(&a.change.rms));
    notes
}

fn note(number: &NumberSensitivity, base: &DiagnosisTrial) -> Option<ScaleNote> {
    of_step(number.suspect.name(), (number.information, number.step), number.change, base)
}

/// A combination of numbers, by a run with all of them changed.
fn of_direction(
    bench: &TrialBench,
    numbers: &[NumberSensitivity],
    direction: &[(usize, f64)],
    base: &DiagnosisTrial,
) -> Option<ScaleNote> {
    let name = |place: usize| numbers[place].suspect.name();
    // First the number that is wrong by as much as the combination is: its share is 1 or −1.
    let (first, share) = *direction.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let trial = bench.run_unjudged(&changes(numbers, direction, STEP * share)?)?;
    let information = base.innovations.score(&trial.innovations, STEP).information;
    let others = told(direction).filter(|(place, _)| *place != first);
    let with = others.map(|(place, part)| (name(*place), part * share)).collect();
    let found = of_step(name(first), (information, STEP), AnswerChange::between(base, &trial), base)?;
    Some(ScaleNote { with, ..found })
}

/// By the information of a step and what it changes in the answer.
fn of_step(
    parameter: String,
    (information, step): (f64, f64),
    change: Option<AnswerChange>,
    base: &DiagnosisTrial,
) -> Option<ScaleNote> {
    let change = change.filter(|change| change.rms != 0.0)?;
    let hidden = (SHOWN / information.sqrt()).min(1.0);
    let matters = change.rms / step * hidden.min(LIKELY) > MATTERS * change.claimed;
    let by = hidden.min(0.01);
    let change = change.times(by / step);
    let (answer, unit) = (base.answer_name, base.answer_unit);
    matters.then(|| ScaleNote { parameter, with: Vec::new(), hidden, by, change, answer, unit })
}

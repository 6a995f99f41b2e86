//! What no innovation shows: parameters that change the answer without a trace.

use super::answer::AnswerChange;
use super::sensitivity::NumberSensitivity;
use super::trial::DiagnosisTrial;
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

/// Standard deviations at which the innovations show something: half of its square is ln p, and its probability is below 10⁻⁶.
const SHOWN: f64 = 5.0;

/// A parameter is hidden where what it may be wrong by without a trace moves the answer by so many claimed standard deviations.
const MATTERS: f64 = 3.0;

/// A parameter that is worse known than this is measured before anything is estimated with it.
const LIKELY: f64 = 0.1;

/// The parameters whose error the innovations leave hidden and that move the answer by more than it claims, those that move it most
/// first.
pub(super) fn notes(numbers: &[NumberSensitivity], base: &DiagnosisTrial) -> Vec<ScaleNote> {
    let mut notes: Vec<ScaleNote> = numbers.iter().filter_map(|number| note(number, base)).collect();
    notes.sort_by(|a, b| b.change.rms.total_cmp(&a.change.rms));
    notes
}

fn note(number: &NumberSensitivity, base: &DiagnosisTrial) -> Option<ScaleNote> {
    let change = number.change.filter(|change| change.rms != 0.0)?;
    let hidden = (SHOWN / number.information.sqrt()).min(1.0);
    let matters = change.rms / number.step * hidden.min(LIKELY) > MATTERS * change.claimed;
    let by = hidden.min(0.01);
    let change = change.times(by / number.step);
    let (answer, unit) = (base.answer_name, base.answer_unit);
    matters.then(|| ScaleNote { parameter: number.suspect.name(), hidden, by, change, answer, unit })
}

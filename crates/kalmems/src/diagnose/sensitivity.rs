//! What another value of a number would change in a filter's predictions and in its answer.

use super::answer::AnswerChange;
use super::bench::TrialBench;
use super::suspect::Suspect;
use super::trial::DiagnosisTrial;
use crate::progress::{Progress, map_on_threads, processors};

/// The first step, of what a search for the number begins with: small enough for most numbers to be linear, and large against rounding.
const FIRST: f64 = 0.2;

/// The largest step in standard errors of the number, by what the innovations tell of it; a larger step is not linear.
const LARGEST: f64 = 0.3;

/// Steps that are tried for one number.
const ATTEMPTS: usize = 4;

/// To first order what a number does, by two runs of the filter.
#[derive(Clone, Debug)]
pub(super) struct NumberSensitivity<'s> {
    pub(super) suspect: &'s Suspect,
    /// The change of the number behind the differences below.
    pub(super) step: f64,
    /// The slope of each prediction over the standard deviation of its innovation, for the number's unit.
    pub(super) slopes: Vec<f64>,
    /// What the innovations tell of the number, by their values and their variances.
    pub(super) information: f64,
    /// What the step changes in the answer, of a number that is wrong by a factor; `None` where the answers cannot be compared.
    pub(super) change: Option<AnswerChange>,
}

impl<'s> NumberSensitivity<'s> {
    /// Of these numbers; without those that the filter cannot be run with, and without those that change nothing. `None` where the work
    /// was stopped.
    pub(super) fn all(
        bench: &TrialBench,
        suspects: &[&'s Suspect],
        base: &DiagnosisTrial,
        progress: &dyn Progress,
    ) -> Option<Vec<Self>> {
        let work = (progress, "computing what the signal tells of each number");
        let found = map_on_threads(work, processors(), (suspects.len(), 1), |place, heard| {
            heard.reached(0).is_continue().then(|| Self::of(bench, suspects[place], base))
        })?;
        Some(found.into_iter().flatten().collect())
    }

    fn of(bench: &TrialBench, suspect: &'s Suspect, base: &DiagnosisTrial) -> Option<Self> {
        let (mut step, mut found) = (FIRST * suspect.step(), None);
        for _ in 0..ATTEMPTS {
            let Some(changed) = suspect.changes(step).and_then(|changes| bench.run_unjudged(&changes)) else {
                step *= 0.1;
                continue;
            };
            let information = base.innovations.score(&changed.innovations, step).information;
            found = Some(Self {
                suspect,
                step,
                slopes: base.innovations.slopes_in_sd(&changed.innovations, step),
                information,
                change: suspect.is_factor().then(|| AnswerChange::between(base, &changed)).flatten(),
            });
            let largest = LARGEST / information.sqrt();
            if step > 2.0 * largest {
                step = largest;
            } else {
                break;
            }
        }
        found.filter(|found| found.information > 0.0)
    }
}

//! A check of what filters are told by the beginning of their recordings.

use super::as_state::is_state;
use super::bench::{TestedRows, TrialBench, is_judged};
use super::input_fault::{InputFault, input_fault};
use super::number_test::{has_slope, number_test, uncertain_directions};
use super::sensitivity::NumberSensitivity;
use super::suspect::Suspect;
use super::trial::DiagnosisTrial;
use super::unseen::unseen;
use super::unused::UsedNames;
use super::{DiagnoseError, ScaleNote, begin, invisible_parameters};
use crate::config::Experiment;
use crate::evaluate::TestResult;
use crate::progress::Progress;
use crate::recording::SampledRecording;
use crate::rigs::Workbench;

/// Rows after the settling time that are looked at.
const ROWS: TestedRows = TestedRows(25_000);

/// What the innovations say of the numbers that filters are told.
#[derive(Clone, Debug, Default)]
pub struct NumberCheck {
    /// What the signal does not determine of the first filter's device, and by how much that changes its answer; nothing where the innovations say
    /// that something is wrong, as it is a question about a model that is right.
    pub notes: Vec<ScaleNote>,
    /// What no test of the innovations can see, by the equations of the device.
    pub unseen: Vec<String>,
    /// For each filter, by its name, whether its innovations ask for another number; without those in which another test finds something, and
    /// without those that estimate the same parameters as one before for which nothing was found.
    pub tests: Vec<(String, TestResult)>,
    /// A fault of the channels, where the first filter's innovations are larger than claimed and a fault explains them.
    pub input_fault: Option<InputFault>,
}

/// Checks the numbers that filters of an experiment are told, those with these names, by the beginning of its recordings; nothing where
/// the experiment does without (`check_numbers = false`).
pub fn check_numbers(
    workbench: &Workbench,
    experiment: &Experiment,
    filters: &[String],
    progress: &dyn Progress,
) -> Result<NumberCheck, DiagnoseError> {
    check((workbench, experiment, filters), progress, &|name| {
        TrialBench::of(workbench, experiment, Some(name))?.with_files(ROWS, progress)
    })
}

/// The same by a recording that is held in memory, in the place of the first that the rig wants.
pub fn check_numbers_of(
    workbench: &Workbench,
    experiment: &Experiment,
    (recording, filters): (&SampledRecording, &[String]),
    progress: &dyn Progress,
) -> Result<NumberCheck, DiagnoseError> {
    check((workbench, experiment, filters), progress, &|name| {
        TrialBench::of(workbench, experiment, Some(name))?.with_beginning(recording, ROWS)
    })
}

fn check<'a>(
    (workbench, experiment, names): (&Workbench, &Experiment, &[String]),
    progress: &dyn Progress,
    bench: &dyn Fn(&str) -> Result<TrialBench<'a>, DiagnoseError>,
) -> Result<NumberCheck, DiagnoseError> {
    let wanted = experiment.estimate.iter().filter(|estimate| estimate.check_numbers);
    let filters = wanted.flat_map(|estimate| &estimate.filters);
    let unseen = unseen(workbench, experiment);
    let (mut found, mut sound) = (NumberCheck { unseen, ..NumberCheck::default() }, Vec::new());
    for (place, filter) in filters.filter(|filter| is_judged(filter.method)).enumerate() {
        let is_asked_for = names.iter().any(|name| *name == filter.name.as_str());
        let parameters = (&filter.states, &filter.readout);
        if !is_asked_for && place == 0 {
            found.input_fault = input_fault(&bench(filter.name.as_str())?);
        }
        if !is_asked_for || sound.contains(&parameters) {
            continue;
        }
        let bench = bench(filter.name.as_str())?;
        // A filter that stops says nothing.
        let Ok((mut base, suspects)) = begin(&bench) else { continue };
        if !base.passes() {
            continue;
        }
        let numbers = take_numbers(&bench, &suspects, &mut base, progress)?;
        if place == 0 {
            found.notes = invisible_parameters::notes(&bench, &numbers, &base);
        }
        if base.passes() {
            sound.push(parameters);
        }
        found.tests.extend(base.number_test().map(|test| (bench.filter_name.clone(), test.clone())));
    }
    Ok(found)
}

/// The sensitivities of the numbers that may be wrong, and into the run the test of them.
pub(super) fn take_numbers<'s>(
    bench: &TrialBench,
    suspects: &'s [Suspect],
    base: &mut DiagnosisTrial,
    progress: &dyn Progress,
) -> Result<Vec<NumberSensitivity<'s>>, DiagnoseError> {
    // What a filter does not use changes nothing.
    let used = UsedNames::of(&bench.document);
    let is_used = |suspect: &&Suspect| used.as_ref().is_none_or(|used| !used.leaves_out(suspect));
    let is_free = |suspect: &&Suspect| has_slope(suspect) && !is_state(bench, suspect);
    let with_slopes: Vec<&Suspect> = suspects.iter().filter(is_free).filter(is_used).collect();
    let progress = &bench.stop.watching(progress);
    let numbers =
        NumberSensitivity::all(bench, &with_slopes, base, progress).ok_or(DiagnoseError::Interrupted)?;
    let uncertain = uncertain_directions(bench, base);
    base.tests.extend(number_test(base, &numbers, &uncertain));
    Ok(numbers)
}

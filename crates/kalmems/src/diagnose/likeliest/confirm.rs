//! Whether what was identified serves the estimate.

use super::judgement::{ADDS, by_chance};
use super::refused;
use crate::config::{ConfigError, Experiment, RecordingRole};
use crate::diagnose::DiagnoseError;
use crate::diagnose::answer::{AnswerChange, moved};
use crate::diagnose::bench::{TestedRows, TrialBench};
use crate::diagnose::document::{document, keep_recordings, text};
use crate::diagnose::trial::{DiagnosisTrial, TrialBlocks};
use crate::identify::{Identification, IdentifyError, Undetermined};
use crate::inspect::quantity;
use crate::progress::Progress;
use crate::rigs::Workbench;

/// Rows after the settling times that are looked at, in all.
const ROWS: TestedRows = TestedRows(50_000);

/// Leaves the experiment as it was where what was found would make its estimate worse; the numbers stay among what was found.
///
/// - Recordings of the role `test` that had no part in it must not be less likely with what was found. Numbers that are right make an
///   estimate worse where they stand beside a wrong one that the recordings do not determine, and the file's own made up for it: a
///   capacitance for the gain of the readout, say.
/// - Where the recordings do not speak against the numbers of the file, what remains unknown of those that were found must not move the
///   answer by more than a part of the error that the filter claims: who was told the truth is not to be told a guess.
///
/// - The filter must not lose the motion with what was found for longer than it did before.
///
/// The first two are not asked where the filter does not follow the motion with the numbers of the file: anything that follows it is better.
pub(super) fn confirmed(
    workbench: &Workbench,
    experiment: &Experiment,
    mut found: Identification,
    progress: &dyn Progress,
) -> Result<Identification, IdentifyError> {
    let is_used = found.materials.iter().any(|material| material.role == RecordingRole::Test);
    let tests = if is_used { None } else { of_tests(workbench, experiment)? };
    let of_found = match &tests {
        Some(_) => of_tests(workbench, &found.experiment)?,
        None => Some(found.experiment.clone()),
    };
    let (stated, Some(told)) = (tests.as_ref().unwrap_or(experiment), of_found) else { return Ok(found) };
    if found.parameters.is_empty() || stated.estimate.is_none() {
        return Ok(found);
    }
    progress.begin("trying the found numbers", 0);
    let Some(before) = bench(workbench, stated, progress)?.and_then(|bench| bench.run_unjudged(&[])) else {
        return Ok(found);
    };
    let Some(bench) = bench(workbench, &told, progress)? else { return Ok(found) };
    let after = bench.run_unjudged(&[]);
    if progress.reached(0).is_break() {
        return Err(IdentifyError::Interrupted);
    }
    let why = match after {
        Some(after) if after.lost_s() > before.lost_s() => {
            let lost_s = quantity(after.lost_s() - before.lost_s(), "s");
            Some(format!(
                "with what was found the filter loses the motion for {lost_s} more than with the numbers of the file: another number is wrong, which these recordings \
                 do not determine; identify it from a recording that determines it, or ask `kalmems diagnose`"
            ))
        }
        Some(_) if !before.follows() => None,
        Some(after) => harm(&bench, (&before, &after), tests.is_some()),
        None => Some("with what was found the filter cannot be run".to_owned()),
    };
    let Some(why) = why else { return Ok(found) };
    found.undetermined.push(Undetermined {
        what: "the device's table as a whole".to_owned(),
        why: format!("{why}; the experiment keeps what it says"),
    });
    found.experiment = experiment.clone();
    Ok(found)
}

/// A bench of the experiment's first filter that is judged; `None` without one, or without recordings that it can be run on.
fn bench<'a>(
    workbench: &'a Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Result<Option<TrialBench<'a>>, IdentifyError> {
    match TrialBench::of(workbench, experiment, None).and_then(|bench| bench.with_files(ROWS, progress)) {
        Ok(bench) => Ok(Some(bench)),
        Err(DiagnoseError::Config(_) | DiagnoseError::Read(_)) => Ok(None),
        Err(error) => Err(refused(error)),
    }
}

/// Why the estimate would be worse, if it would; `bench` is that of what was found.
fn harm(
    bench: &TrialBench,
    (before, after): (&DiagnosisTrial, &DiagnosisTrial),
    had_no_part: bool,
) -> Option<String> {
    let directions: Vec<DiagnosisTrial> = bench.in_uncertain_directions().collect();
    let count = directions.len() as f64;
    // A noise that is stated too small makes every difference as many times too large.
    let nis = after.mean_nis().max(1.0);
    let gain = (after.log_likelihood(TrialBlocks::All) - before.log_likelihood(TrialBlocks::All)) / nis;
    // Of numbers that are as stated ln p falls by half of a number on the average, and by more than this once in a few hundred times.
    if had_no_part && gain < -count - 3.0 * count.sqrt() {
        return Some(format!(
            "with what was found the recordings of the role `test` are less likely than with the numbers of the file (ln p falls by {:.0}): another \
             number is wrong, which these recordings do not determine and for which those of the file make up; identify it from a recording that \
             determines it, or ask `kalmems diagnose`",
            -gain
        ));
    }
    if directions.is_empty() || gain > by_chance(count) {
        return None;
    }
    let claimed = AnswerChange::between(before, before)?.claimed;
    let unknown: f64 = directions.iter().map(|there| moved(after, there).powi(2)).sum::<f64>().sqrt();
    (unknown > ADDS * claimed).then(|| {
        format!(
            "the recordings agree with the numbers of the file, and what remains unknown of those that were found moves the answer by {:.0} % of \
             the error that the filter claims: the estimate would not become better",
            100.0 * unknown / claimed
        )
    })
}

/// The experiment with its recordings of the role `test` alone; `None` without one, or without a filter.
fn of_tests(workbench: &Workbench, experiment: &Experiment) -> Result<Option<Experiment>, ConfigError> {
    let mut table = document(experiment)?;
    let left = keep_recordings(&mut table, experiment, |role| role == RecordingRole::Test);
    if left == 0 || experiment.estimate.is_none() {
        return Ok(None);
    }
    workbench.parse(&text(&table, experiment)?, experiment.path()).map(Some)
}

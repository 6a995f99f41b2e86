//! Whether what was identified serves the recordings that had no part in it.

use super::DiagnoseError;
use super::bench::{TestedRows, TrialBench};
use super::document::{document, keep_recordings, text};
use super::likeliest::refused;
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::config::{ConfigError, Experiment, RecordingRole};
use crate::identify::{Identification, IdentifyError, Undetermined};
use crate::progress::Progress;
use crate::rigs::Workbench;

/// Rows after the settling times that are looked at, in all.
const ROWS: TestedRows = TestedRows(200_000);

/// Leaves the experiment as it was where recordings of the role `test` are less likely with the numbers that were found than with its own.
///
/// Numbers that are right make an estimate worse where they stand beside a wrong one that the recordings do not determine, and the file's own
/// made up for it: a capacitance for the gain of the readout, say. The numbers stay among what was found, and are not written. Nothing is
/// asked of recordings from which numbers were found, nor where the filter does not follow the motion with the file's own numbers: anything
/// that follows it is better.
pub(super) fn confirmed(
    workbench: &Workbench,
    experiment: &Experiment,
    mut found: Identification,
    progress: &dyn Progress,
) -> Result<Identification, IdentifyError> {
    let is_used = found.materials.iter().any(|material| material.role == RecordingRole::Test);
    let Some(tests) = of_tests(workbench, experiment)?.filter(|_| !is_used && !found.parameters.is_empty())
    else {
        return Ok(found);
    };
    progress.begin("recordings that had no part", 0);
    let trial = |experiment: &Experiment| -> Result<Option<DiagnosisTrial>, IdentifyError> {
        let Some(tests) = of_tests(workbench, experiment)? else { return Ok(None) };
        let bench = match TrialBench::of(workbench, &tests, None).and_then(|b| b.with_files(ROWS, progress)) {
            Ok(bench) => bench,
            // Without a filter whose innovations tell, or without its files, there is nothing to compare.
            Err(DiagnoseError::Config(_) | DiagnoseError::Read(_)) => return Ok(None),
            Err(error) => return Err(refused(error)),
        };
        Ok(bench.run_unjudged(&[]))
    };
    let Some(before) = trial(&tests)?.filter(DiagnosisTrial::follows) else { return Ok(found) };
    let after = trial(&found.experiment)?;
    if progress.reached(0).is_break() {
        return Err(IdentifyError::Interrupted);
    }
    let likelihood = |trial: &DiagnosisTrial| trial.log_likelihood(TrialBlocks::All);
    let after = after.as_ref().map_or(f64::NEG_INFINITY, likelihood);
    let (fall, count) = (likelihood(&before) - after, found.parameters.len() as f64);
    // Of numbers that are as stated ln p falls by half of a number on the average, and by more than this once in a few hundred times.
    if fall < count + 3.0 * count.sqrt() {
        return Ok(found);
    }
    let falls = if fall.is_finite() { format!("by {fall:.0}") } else { "without limit".to_owned() };
    found.undetermined.push(Undetermined {
        what: "the device's table as a whole".to_owned(),
        why: format!(
            "with what was found the recordings of the role `test` are less likely than with the numbers of the file (ln p falls {falls}): another \
             number is wrong, which these recordings do not determine and for which those of the file make up; identify it from a recording that \
             does, or ask `kalmems diagnose`. The experiment keeps what it says"
        ),
    });
    found.experiment = experiment.clone();
    Ok(found)
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

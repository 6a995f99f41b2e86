//! Diagnosis: what of an experiment is wrong, by its recordings alone.
//!
//! A filter is run again and again over the beginning of its recordings, with one number of the device table, or of what was
//! recorded, changed. What makes its innovations the likeliest is found on every second block of the recording
//! ([`fit::most_likely`](crate::fit::most_likely)) and judged on the others, so that a cause gains nothing by being fitted: where
//! nothing is wrong the likelihood ratio of the others is 1 on average, as far as a block is longer than the filter remembers. A cause
//! explains a recording if no other is a thousand times as likely and the tests of the verdict find nothing in the innovations. Causes that the recording cannot tell apart are named
//! together.
//!
//! ```
//! use kalmems::{diagnose::{self, DiagnosisFinding}, progress::Silent, rigs};
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! let experiment = rigs::published().load(&root.join("examples/accelerometer/experiment.toml"))?;
//! let diagnosis = diagnose::diagnose(rigs::published(), &experiment, None, &Silent)?;
//! assert_eq!(diagnosis.finding, DiagnosisFinding::NothingToChange);
//! # Ok::<(), diagnose::DiagnoseError>(())
//! ```

mod advice;
mod answer;
mod as_state;
mod bench;
mod cause;
mod change;
mod check_numbers;
mod coloured_noise;
mod distinguish;
mod document;
mod effort;
mod error;
mod explain;
mod hidden_directions;
mod identified_experiment;
mod input_fault;
mod invisible_parameters;
mod likeliest;
mod line_search;
mod noise;
mod number_test;
mod paste;
mod report;
mod search;
mod sensitivity;
mod slopes;
mod step_cost;
mod stop;
mod suspect;
mod trial;
mod unseen;
mod unused;

pub use answer::AnswerChange;
pub use check_numbers::{NumberCheck, check_numbers, check_numbers_of};
pub use distinguish::Proposal;
pub use effort::DiagnosisEffort;
pub use error::DiagnoseError;
pub use identified_experiment::{with_found_numbers, with_noises};
pub use input_fault::InputFault;
pub use invisible_parameters::ScaleNote;
pub use likeliest::{identify, likeliest};
#[cfg(feature = "parquet-results")]
pub(crate) use noise::leaves_noise_open;
pub use noise::{FoundNoise, load_with_noise, noise_of_recording, with_noise};
pub use paste::pasted;
pub use report::{CauseGain, CauseReport, Diagnosis, DiagnosisFinding, Edit};
pub use step_cost::step_cost;
pub use unseen::unseen;

use crate::config::Experiment;
use crate::evaluate::StepErrors;
use crate::progress::Progress;
use crate::recording::SampledRecording;
use crate::rigs::Workbench;
use advice::withhold_what_is_worse;
use bench::{TestedRows, TrialBench};
use cause::Cause;
use change::TrialChange;
use check_numbers::take_numbers;
use explain::{ExaminedCause, Explanations};
use suspect::Suspect;
use trial::DiagnosisTrial;

/// Rows after the settling time that a diagnosis looks at.
const ROWS: TestedRows = TestedRows(50_000);

/// Finds what of an experiment is wrong, by the innovations of one of its filters: that with this name, or else the first whose
/// innovations are white when it is right.
pub fn diagnose(
    workbench: &Workbench,
    experiment: &Experiment,
    filter: Option<&str>,
    progress: &dyn Progress,
) -> Result<Diagnosis, DiagnoseError> {
    diagnose_with(workbench, experiment, (filter, DiagnosisEffort::Usual), progress)
}

/// The same with as much work as is said. Work that `progress` stops while causes are tried gives those that were found so far.
pub fn diagnose_with(
    workbench: &Workbench,
    experiment: &Experiment,
    (filter, effort): (Option<&str>, DiagnosisEffort),
    progress: &dyn Progress,
) -> Result<Diagnosis, DiagnoseError> {
    let bench = TrialBench::of(workbench, experiment, filter)?.with_files(ROWS, progress)?;
    of_bench((workbench, effort), experiment, &bench, &bench.stop.watching(progress))
}

/// The same by a recording that is held in memory, in the place of the first that the rig wants.
pub fn diagnose_recording(
    workbench: &Workbench,
    experiment: &Experiment,
    filter: Option<&str>,
    recording: SampledRecording,
    progress: &dyn Progress,
) -> Result<Diagnosis, DiagnoseError> {
    let bench = TrialBench::of(workbench, experiment, filter)?.with_recording(recording)?;
    of_bench((workbench, DiagnosisEffort::Usual), experiment, &bench, &bench.stop.watching(progress))
}

/// The run of the experiment as it is, and what may be wrong of it. Where the filter refuses the recording with what it is told, a run
/// with one of the numbers changed stands in.
fn begin(bench: &TrialBench) -> Result<(DiagnosisTrial, Vec<Suspect>), DiagnoseError> {
    let rig = bench.workbench.rig(&bench.experiment)?;
    let suspects = |noise_sd| Suspect::all(rig, &bench.experiment, &bench.document, noise_sd);
    let base = bench.run(&[]).or_else(|| {
        let known = suspects(0.0);
        let sizes =
            known.iter().flat_map(|suspect| suspect.sizes.iter().rev().map(move |size| (suspect, *size)));
        let slips = Suspect::slips(&known, &bench.document);
        let sizes = sizes.chain(slips.iter().map(|slip| (slip, 0.0)));
        let mut runs = sizes.filter_map(|(suspect, size)| bench.run(&suspect.changes(size)?));
        runs.next().map(DiagnosisTrial::standing_in)
    });
    let base = base.ok_or_else(|| DiagnoseError::Stops { filter: bench.filter_name.clone() })?;
    let noise_sd = base.innovation_sd();
    Ok((base, suspects(noise_sd)))
}

fn of_bench(
    (workbench, effort): (&Workbench, DiagnosisEffort),
    experiment: &Experiment,
    bench: &TrialBench,
    progress: &dyn Progress,
) -> Result<Diagnosis, DiagnoseError> {
    let (mut base, mut suspects) = begin(bench)?;
    let mut notes = Vec::new();
    // Before any number is blamed.
    let steps = bench.step_errors(None).map(|(steps, _)| steps);
    let filters = experiment.estimate.as_ref().map_or(1, |estimate| estimate.filters.len());
    let most_rows = effort.rows(
        bench,
        &base,
        (filters, steps.as_ref().and_then(|steps| steps.steps_per_sample).unwrap_or(1)),
    );
    let steps = steps.filter(StepErrors::is_large);
    let is_astray = steps.is_some();
    if base.passes() && !is_astray {
        let numbers = take_numbers(bench, &suspects, &mut base, progress)?;
        // What the signal does not determine is a question about a model that is right.
        if base.passes() {
            notes = invisible_parameters::notes(bench, &numbers, &base);
        }
    }
    let rig = workbench.rig(&bench.experiment)?;
    let slips = Suspect::slips(&suspects, &bench.document);
    suspects.extend(Suspect::further(rig, bench));
    suspects.extend(slips);
    let mut explained = if base.passes() || is_astray {
        None
    } else {
        Some(Explanations::by(bench, &suspects, &base, (progress, most_rows)))
    };
    let rig = rig.name();
    let causes: Vec<Vec<TrialChange>> = (explained.iter().flat_map(|found| &found.causes))
        .filter_map(|found| found.cause.changes(&suspects))
        .collect();
    let of_device =
        |changes: &Vec<TrialChange>| changes.iter().all(|change| matches!(change, TrialChange::Key(..)));
    // Noise of the readout is in any recording that could be proposed.
    let is_noise = |found: &ExaminedCause| matches!(found.cause, Cause::ColouredNoise(_));
    let has_noise = explained.iter().flat_map(|found| &found.causes).any(is_noise);
    let mut proposal = None;
    if causes.len() > 1 && !has_noise && causes.iter().all(of_device) {
        if bench.stop.rows() < most_rows {
            let found = distinguish::proposal(workbench, experiment, (bench, &base), &causes, progress);
            proposal = found.or_else(|e| if e.is_interruption() { Ok(None) } else { Err(e) })?;
        } else if let Some(found) = &mut explained {
            found.left_out.push("recordings that would distinguish the causes".to_owned());
        }
    }
    if progress.reached(0).is_break() {
        explained = explained.map(Explanations::interrupted);
    }
    let gains: Vec<f64> = (explained.iter().flat_map(|found| &found.causes))
        .map(|found| found.trial.density() - base.density())
        .collect();
    let mut found =
        Diagnosis::of((experiment, rig), (bench, &suspects), (&base, steps), (explained, notes, proposal));
    if base.is_its_own() && !found.causes.is_empty() {
        progress.begin("trying the advice on whole recordings", 0);
        withhold_what_is_worse((workbench, experiment), &mut found, &gains, &bench.stop);
        if progress.reached(0).is_break() {
            // Lines that were not tried are no advice.
            let causes = std::mem::take(&mut found.causes).into_iter();
            found.closest = causes.map(|cause| CauseReport { edits: Vec::new(), ..cause }).collect();
            found.finding = DiagnosisFinding::Interrupted;
        }
    }
    Ok(found)
}

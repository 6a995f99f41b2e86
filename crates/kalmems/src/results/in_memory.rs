//! An estimate with all that is computed from it, without a file.

use super::Metrics;
#[cfg(feature = "report")]
use super::{Output, ResultWriteError, RunInfo, WriteOptions, report::page, write_estimate};
use crate::config::{Experiment, Recording};
use crate::diagnose::{DiagnoseError, FoundNoise, NumberCheck, check_numbers, check_numbers_of};
use crate::estimate::EstimateError;
use crate::progress::Progress;
use crate::rigs::Workbench;
use crate::workflow::{self, Outcome, WorkflowError};
#[cfg(feature = "report")]
use kalmems_figures::{Figure, ReportError};

/// An estimate and its figures.
#[derive(Clone, Debug)]
pub struct Estimated {
    /// The trajectories, with recordings, references and judgements.
    pub outcome: Outcome,
    /// The figures.
    pub metrics: Metrics,
}

impl Estimated {
    /// Estimates an experiment whose recordings are held in memory; what its noises were found to be is told with the figures.
    pub fn of(
        workbench: &Workbench,
        experiment: &Experiment,
        noise: Vec<FoundNoise>,
        progress: &dyn Progress,
    ) -> Result<Self, WorkflowError> {
        let outcome = workflow::estimate(workbench, experiment, progress)?;
        let metrics = Metrics::of(&outcome);
        let numbers = number_check(workbench, experiment, &metrics.without_findings(), progress)?;
        let metrics = metrics.with_numbers(numbers).with_noise(noise);
        Ok(Self { outcome, metrics })
    }

    /// The report as a page of HTML, and its figures.
    #[cfg(feature = "report")]
    pub fn report(&self) -> Result<(String, Vec<Figure>), ReportError> {
        let (page, figures) = page(&self.outcome, &self.metrics);
        Ok((page.to_html()?, figures))
    }

    /// Writes all of it into a result; see [`write_estimate`].
    #[cfg(feature = "report")]
    pub fn write(
        &self,
        output: &Output,
        options: WriteOptions,
        info: RunInfo,
        stop: &dyn Fn() -> bool,
    ) -> Result<(), ResultWriteError> {
        write_estimate(&self.outcome, &self.metrics, output, options, info, stop)
    }
}

/// What the beginning of the recordings says of the numbers that these filters are told, where they can be read again.
pub fn number_check(
    workbench: &Workbench,
    experiment: &Experiment,
    filters: &[String],
    progress: &dyn Progress,
) -> Result<NumberCheck, WorkflowError> {
    let can_be_read = |recording: &Recording| experiment.can_be_read(&recording.file);
    if !experiment.recordings.iter().all(can_be_read) {
        return Ok(NumberCheck::default());
    }
    or_nothing(check_numbers(workbench, experiment, filters, progress))
}

/// The same by the first recording of an outcome, of the filters in whose innovations no test finds anything.
pub fn number_check_of(
    workbench: &Workbench,
    (outcome, metrics): (&Outcome, &Metrics),
    progress: &dyn Progress,
) -> Result<NumberCheck, WorkflowError> {
    let Some(first) = outcome.recordings.first() else { return Ok(NumberCheck::default()) };
    let work = (&first.recording, &metrics.without_findings()[..]);
    or_nothing(check_numbers_of(workbench, &outcome.experiment, work, progress))
}

/// A check says nothing of what it cannot look at, such as filters whose innovations are not white when they are right.
fn or_nothing(check: Result<NumberCheck, DiagnoseError>) -> Result<NumberCheck, WorkflowError> {
    match check {
        Err(e) if e.is_interruption() => Err(EstimateError::Interrupted.into()),
        found => Ok(found.unwrap_or_default()),
    }
}

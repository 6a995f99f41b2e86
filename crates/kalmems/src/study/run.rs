//! Runs what is not finished yet, on several threads, and keeps each run as it comes.

use super::calibration::{DrawnDeviation, RunClaims, judged, state_signs};
use super::error::RunError;
use super::journal::{FinishedRun, FinishedRuns, JournalHeader};
use super::plan::RunStart;
use super::{Shard, StudyError, StudyPlan};
use crate::journal::Journal;
use crate::progress::{Progress, each_on_threads, processors};
use crate::results::{Metrics, number_check_of};
use crate::rows::{ResultRow, rows};
use crate::simulate::ComputedRecording;
use crate::workflow::{self, Outcome};
use std::num::NonZero;
use std::path::{Path, PathBuf};

/// How to run a study.
#[derive(Clone, Copy, Debug)]
pub struct StudyOptions {
    /// Which part of it.
    pub shard: Shard,
    /// How many runs at once; as many as the machine can, if `None`.
    pub threads: Option<NonZero<usize>>,
    /// Begin anew where the journal is that of another study.
    pub force: bool,
}

/// What was there, and what was done.
#[derive(Clone, Debug)]
pub struct StudyProgress {
    /// The journal.
    pub journal: PathBuf,
    /// Runs of this part.
    pub runs: u64,
    /// How many of them were finished before.
    pub before: u64,
    /// Whether a run that was being written when the program was stopped was dropped from the journal.
    pub torn: bool,
}

impl StudyPlan {
    /// The journal for results in a folder: beside it, with its name.
    pub fn journal(&self, out: &Path, shard: Shard) -> PathBuf {
        let name = out
            .file_name()
            .map_or_else(|| self.name().to_owned(), |name| name.to_string_lossy().into_owned());
        let part = if shard.is_whole() {
            String::new()
        } else {
            format!(".{}", shard.to_string().replace('/', "-of-"))
        };
        out.with_file_name(format!("{name}{part}.journal"))
    }

    /// Runs all that the journal does not have yet. Each run is a line of it as soon as it is finished.
    ///
    /// The figures of a run follow from the study, the experiment and the run's index alone: not from the number of
    /// threads, nor from what was interrupted when.
    pub fn run_all(
        &self,
        out: &Path,
        options: StudyOptions,
        progress: &dyn Progress,
    ) -> Result<StudyProgress, StudyError> {
        let inputs = self.check()?;
        let path = self.journal(out, options.shard);
        let header = JournalHeader::of(self, self.digest(&inputs), options.shard);
        let (mut journal, finished, torn) = Journal::open(&path, &header, options.force)?;
        let runs = options.shard.share(self.runs());
        let before = finished.len() as u64;
        self.run_missing(&mut journal, &finished, options, progress)?.map_or(Ok(()), |done| {
            Err(StudyError::Interrupted { done: before + done, total: runs, journal: path.clone() })
        })?;
        Ok(StudyProgress { journal: path, runs, before, torn })
    }

    /// How many were done where the work was stopped; `None` where it came to its end.
    fn run_missing(
        &self,
        journal: &mut Journal<JournalHeader>,
        finished: &FinishedRuns,
        options: StudyOptions,
        progress: &dyn Progress,
    ) -> Result<Option<u64>, StudyError> {
        let missing: Vec<u64> =
            (0..self.runs()).filter(|run| options.shard.has(*run) && !finished.contains_key(run)).collect();
        let threads = options.threads.map_or_else(processors, NonZero::get);
        progress.begin("studying", missing.len() as u64);
        let mut done = 0;
        each_on_threads(
            progress,
            threads,
            (missing.len(), 1),
            |place, heard| self.finish(missing[place], heard),
            |_, finished| {
                done += 1;
                journal.add(&finished).map_err(StudyError::from)
            },
        )?;
        Ok((done < missing.len() as u64).then_some(done))
    }

    /// One run; `None` where it was stopped.
    fn finish(&self, index: u64, progress: &dyn Progress) -> Option<FinishedRun> {
        if progress.reached(0).is_break() {
            return None;
        }
        match self.outcome(index, progress) {
            Ok((rows, judged)) => Some(FinishedRun { run: index, error: None, rows, judged }),
            Err(e) if e.is_interruption() => None,
            Err(e) => {
                Some(FinishedRun { run: index, error: Some(e.text()), rows: Vec::new(), judged: Vec::new() })
            }
        }
    }

    /// The figures of a run; of a calibration, which is about the verdict, with all that one rests on.
    fn judged_metrics(&self, outcome: &Outcome, progress: &dyn Progress) -> Result<Metrics, RunError> {
        let metrics = Metrics::of(outcome);
        if self.calibration.is_none() {
            return Ok(metrics);
        }
        let numbers = number_check_of(&self.workbench, (outcome, &metrics), progress)?;
        Ok(metrics.with_numbers(numbers))
    }

    /// The rows of a run, and in a calibration what it says of the claims of its filters.
    fn outcome(
        &self,
        index: u64,
        progress: &dyn Progress,
    ) -> Result<(Vec<ResultRow>, Vec<RunClaims>), RunError> {
        let (ready, drawn) = self.ready(&self.run(index))?;
        let outcome = match ready {
            RunStart::Simulated(simulation, mut told) => {
                let simulated = ComputedRecording::of(&*simulation, progress)?;
                // From here on there is nothing of the device but what a file of it would hold.
                drop(simulation);
                if self.calibration.is_some() {
                    state_signs(&self.workbench, &mut told, &simulated)?;
                }
                workflow::estimate_computed(&self.workbench, &told, &simulated, progress)?
            }
            RunStart::Recorded(told) => workflow::estimate(&self.workbench, &told, progress)?,
        };
        let metrics = self.judged_metrics(&outcome, progress)?;
        let mut rows = rows(&metrics);
        if self.calibration.is_none() {
            return Ok((rows, Vec::new()));
        }
        for row in &mut rows {
            row.extend(drawn.iter().map(|DrawnDeviation { name, deviation }| {
                (format!("drawn.{name}"), serde_json::Value::String(format!("{deviation:?}")))
            }));
        }
        Ok((rows, judged(&outcome, &metrics, &drawn)))
    }
}

//! What the journal of a study holds: which study it is, and a line for each finished run.

use super::calibration::RunClaims;
use super::{Shard, StudyPlan};
use crate::journal::{self, JournalWork, kind};
use crate::rows::ResultRow;
use serde::{Deserialize, Serialize};

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct JournalHeader {
    /// What kind of file it is.
    kalmems: String,
    /// The version of the program.
    pub(super) version: String,
    /// What tells the study from others.
    pub(super) digest: String,
    /// How many runs the whole study has.
    pub(super) runs: u64,
    /// Which part of them this journal is for, such as `1/3`.
    pub(super) shard: String,
    /// The study file.
    pub(super) study: String,
    /// The experiment file.
    pub(super) experiment: String,
    /// Runs at each point of a calibration; `None` of a study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) calibration: Option<u64>,
}

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct FinishedRun {
    pub(super) run: u64,
    /// Why it has no rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) error: Option<String>,
    pub(super) rows: Vec<ResultRow>,
    /// What it says of the claims of its filters, in a calibration.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) judged: Vec<RunClaims>,
}

/// FinishedRun runs by their index.
pub(super) type FinishedRuns = journal::JournalPieces<JournalHeader>;

impl JournalHeader {
    pub(super) fn of(plan: &StudyPlan, digest: String, shard: Shard) -> Self {
        Self {
            kalmems: kind::<Self>(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            digest,
            runs: plan.runs(),
            shard: shard.to_string(),
            study: plan.source.text.clone(),
            experiment: plan.experiment.text.clone(),
            calibration: plan.calibration.as_ref().map(|_| plan.description.repeats),
        }
    }

    /// In what it is of another study than this one; `None` where both are parts of the same.
    pub(super) fn is_of_another_study(&self, from: &Self) -> Option<String> {
        if self.version != from.version {
            Some(format!("it was made by version {}, and this is {}", self.version, from.version))
        } else if self.digest != from.digest {
            Some("the study, its experiment or its recordings have changed".to_owned())
        } else {
            None
        }
    }
}

impl JournalWork for JournalHeader {
    type Piece = FinishedRun;
    type Key = u64;
    const NAME: &'static str = "study";

    fn kind(&self) -> &str {
        &self.kalmems
    }

    fn differs(&self, from: &Self) -> Option<String> {
        self.is_of_another_study(from).or_else(|| {
            (self.shard != from.shard).then(|| format!("it is shard {}, not {}", self.shard, from.shard))
        })
    }

    fn key(&self, finished: &FinishedRun) -> Result<u64, String> {
        let FinishedRun { run, .. } = *finished;
        if run < self.runs { Ok(run) } else { Err(format!("run {run} of {}", self.runs)) }
    }

    fn name(run: &u64) -> String {
        format!("run {run}")
    }
}

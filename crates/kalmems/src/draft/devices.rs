//! Which of the known devices a recording may be of.

use super::columns::{self, Assigned, Question};
use super::{DraftError, ExaminedRecording, templates};
use crate::rigs::Workbench;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// A device, and how the columns of a recording fit its channels.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceFit {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub description: String,
    /// Which column is which of its channels, as far as that is found.
    pub assigned: Vec<Assigned>,
    /// Channels for which several columns may stand.
    pub questions: Vec<Question>,
    /// Channels for which no column can stand, each with what it is and its unit.
    pub missing: Vec<String>,
    /// Columns that are none of its channels.
    pub left_over: Vec<String>,
}

impl DeviceFit {
    /// Whether the recording has a column for every channel that the device needs.
    pub fn is_possible(&self) -> bool {
        self.missing.is_empty()
    }
}

/// The known devices, those first whose channels the columns of a recording fit best.
///
/// # Errors
/// A template that is no experiment.
pub fn fitting(workbench: &Workbench, recording: &ExaminedRecording) -> Result<Vec<DeviceFit>, DraftError> {
    let channels = &recording.inspection.channels;
    let mut fits = Vec::new();
    for (rig, template) in templates(workbench) {
        let experiment = workbench.parse(template.text, Path::new("template.toml"));
        let experiment = experiment.map_err(|error| DraftError::Experiment(Box::new(error)))?;
        let (assigned, open) = columns::sort(&recording.name(), channels, &template, &[], |_| true);
        let columns: BTreeSet<&String> = open.iter().flat_map(|question| &question.candidates).collect();
        // Two channels cannot be one column.
        let enough = columns.len() >= open.len();
        let (questions, missing): (Vec<_>, Vec<_>) =
            open.iter().cloned().partition(|question| enough && !question.candidates.is_empty());
        let unit = |meaning: &str| {
            template.channels.iter().find(|one| one.meaning == meaning).map_or("", |channel| channel.unit)
        };
        let missing = missing
            .iter()
            .map(|one| format!("`{}` ({}, in {})", one.meaning, one.what, unit(one.meaning)))
            .collect();
        let is_used = |column: &String| {
            assigned.iter().any(|one| one.column == *column)
                || questions.iter().any(|one| one.candidates.contains(column))
        };
        let left_over = channels.iter().map(|one| one.column.clone()).filter(|one| !is_used(one)).collect();
        fits.push(DeviceFit {
            name: rig.name(),
            description: experiment.description.unwrap_or_default(),
            assigned,
            questions,
            missing,
            left_over,
        });
    }
    // A stable sort: devices that fit alike keep their order.
    fits.sort_by_key(|fit| (fit.missing.len(), fit.questions.len(), fit.left_over.len()));
    Ok(fits)
}

//! Recordings that were looked at, of which no device is known yet.

use super::columns::Assigned;
use super::guess::{ColumnUse, GuessedColumn, guess};
use super::kind::{FoundKind, RecordingKind, kind};
use super::{DraftError, templates};
use crate::config::RecordingRole;
use crate::inspect::{Inspection, StatedFile, inspect_stated, quantity};
use crate::rigs::Workbench;
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A recording that is to be looked at.
#[derive(Clone, Debug)]
pub struct RecordingToExamine {
    /// The file.
    pub path: PathBuf,
    /// What it was taken for, where somebody says it.
    pub role: Option<RecordingRole>,
    /// How it is read, where somebody says it.
    pub stated: StatedFile,
}

/// A recording that was looked at.
#[derive(Clone, Debug)]
pub struct ExaminedRecording {
    pub(super) path: PathBuf,
    pub(super) role: Option<RecordingRole>,
    pub(super) stated: StatedFile,
    pub(super) inspection: Inspection,
}

/// What a recording seems to hold.
#[derive(Clone, Debug, Serialize)]
pub struct RecordingDescription {
    /// The file.
    pub file: PathBuf,
    /// What was recognised, in sentences.
    pub recognised: Vec<String>,
    /// What the columns beside the time seem to be.
    pub columns: Vec<GuessedColumn>,
    /// What kind of motion it shows.
    pub kind: RecordingKind,
}

/// Looks at a recording.
///
/// # Errors
/// A file that cannot be read or used as a recording, and a stated column of times that it does not have.
pub fn examine(
    recording: &RecordingToExamine,
    progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Result<ExaminedRecording, DraftError> {
    let RecordingToExamine { path, role, stated } = recording.clone();
    let inspection = inspect_stated(&path, &stated, progress)?;
    if let Some(stated) = stated
        .time
        .as_ref()
        .filter(|_| stated.rate_hz.is_none())
        .filter(|stated| inspection.time.as_ref() != Some(&stated.column))
    {
        let known = inspection.channels.iter().map(|channel| channel.column.clone()).collect();
        return Err(DraftError::TimeColumn { found: stated.column.clone(), file: path, known });
    }
    if !inspection.is_usable() {
        return Err(DraftError::Unusable { file: path });
    }
    Ok(ExaminedRecording { path, role, stated, inspection })
}

impl ExaminedRecording {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What was found in it.
    pub const fn inspection(&self) -> &Inspection {
        &self.inspection
    }

    /// Its name without folders.
    pub(super) fn name(&self) -> String {
        self.path.file_name().map_or_else(|| "it".to_owned(), |name| name.to_string_lossy().into_owned())
    }

    /// Whether its samples have times, by a column or by a stated rate.
    ///
    /// # Errors
    /// They have none; what to state.
    pub fn check_time(&self, rate: Option<&str>) -> Result<(), DraftError> {
        if self.inspection.time.is_some() || rate.is_some() {
            return Ok(());
        }
        let file = self.path.clone();
        Err(match &self.inspection.unitless_time {
            Some(found) => DraftError::TimeWithoutUnit { file, found: found.clone() },
            None => DraftError::NoTime { file },
        })
    }

    /// What its columns seem to be, without a word on any device.
    pub fn describe(&self, workbench: &Workbench) -> RecordingDescription {
        let templates: Vec<_> = templates(workbench).map(|(_, template)| template).collect();
        let columns = guess(&self.inspection, &templates);
        let of = |wanted: ColumnUse| {
            let found = columns.iter().filter(move |one| one.seems == wanted);
            found.map(|one| one.column.as_str()).collect::<Vec<_>>()
        };
        let FoundKind { kind, sentence } =
            kind(&self.inspection, of(ColumnUse::Drive).first().copied(), &of(ColumnUse::Signal));
        let mut recognised = self.recording();
        for column in &columns {
            recognised.push(self.column(&column.column, &format!("seems to be {}", column.words)));
        }
        recognised.push(sentence);
        RecordingDescription { file: self.path.clone(), recognised, columns, kind }
    }

    /// What kind of motion it shows, by the columns of a device's channels.
    pub(super) fn kind(&self, assigned: &[Assigned]) -> FoundKind {
        let drive = assigned.iter().find(|one| one.meaning == "drive").map(|one| one.column.as_str());
        let signals = assigned.iter().filter(|one| !one.is_reference && one.meaning != "drive");
        let mut signals: Vec<&str> = signals.map(|one| one.column.as_str()).collect();
        if signals.is_empty() {
            // It is one of those that are nothing else.
            let columns = self.inspection.channels.iter().map(|channel| channel.column.as_str());
            signals = columns.filter(|column| assigned.iter().all(|one| one.column != *column)).collect();
        }
        kind(&self.inspection, drive, &signals)
    }

    /// What it seems to hold, by the columns of a device's channels, in sentences.
    pub(super) fn recognised(&self, assigned: &[Assigned], kind: &str) -> Vec<String> {
        let mut sentences = self.recording();
        for channel in &self.inspection.channels {
            let own = assigned.iter().find(|one| one.column == channel.column);
            let what = own.map_or_else(
                || "is no channel of the device".to_owned(),
                |own| {
                    let reference = if own.is_reference { "the reference" } else { "the channel" };
                    format!("is {reference} `{}`, {}", own.meaning, own.why)
                },
            );
            sentences.push(self.column(&channel.column, &what));
        }
        sentences.push(kind.to_owned());
        sentences
    }

    /// Its format, its times and its records.
    fn recording(&self) -> Vec<String> {
        let mut sentences = self.inspection.recognised.clone();
        if let Some(longest) = self.inspection.longest_segment()
            && let (Some(rate), Some(duration)) = (longest.rate_hz, longest.duration_s)
            && self.inspection.is_timed()
        {
            let of =
                if self.inspection.segments.len() > 1 { "The longest of its records has" } else { "It has" };
            let (rate, duration) = (quantity(rate, "Hz"), quantity(duration, "s"));
            sentences.push(format!("{of} {} samples at {rate}, {duration}.", longest.rows));
        }
        sentences
    }

    /// A column in a sentence, with what it is and what its values show.
    fn column(&self, column: &str, what: &str) -> String {
        let channel = self.inspection.channels.iter().find(|channel| channel.column == column);
        let shows = channel.and_then(|channel| {
            let character = self.inspection.character(channel)?;
            Some(character.sentence(&channel.si_unit, self.inspection.frequency_unit))
        });
        shows.map_or_else(|| format!("`{column}` {what}."), |shows| format!("`{column}` {what}: {shows}."))
    }
}

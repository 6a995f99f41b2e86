//! The recordings of `kalmems new`, looked at.

use super::{ask, wrong};
use crate::CommandEnding;
use crate::args::NewArguments;
use crate::commands::stated::{rate_hz, stated_time, unread};
use crate::progress::ProgressDisplay;
use kalmems::config::RecordingRole;
use kalmems::draft::{self, DraftError, ExaminedRecording, RecordingToExamine};
use kalmems::inspect::{StatedFile, StatedTime};
use kalmems::progress::ReaderProgress;
use kalmems::recording::ReadError;
use std::path::PathBuf;

/// Looks at all recordings; somebody at a terminal is asked for the times of one that has none.
pub fn examine(
    arguments: &NewArguments,
    rate: &mut Option<String>,
) -> Result<Vec<ExaminedRecording>, CommandEnding> {
    let stated = stated_time(arguments.time.as_ref())?;
    let (file, rate_hz) = (arguments.file.hints(), rate_hz(rate.as_deref())?);
    let mut wanted: Vec<(PathBuf, Option<RecordingRole>)> =
        arguments.recordings.iter().map(|path| (path.clone(), None)).collect();
    for (role, file) in &arguments.further {
        wanted.push((PathBuf::from(file), Some(role_of(role)?)));
    }
    let mut looked_at = Vec::new();
    for (path, role) in wanted {
        let mut recording = RecordingToExamine {
            path,
            role,
            stated: StatedFile { hints: file.clone(), ..StatedFile::default() },
        };
        let mut found = match look_at(&recording) {
            // The stated rate takes the place of times that cannot be used.
            Err(DraftError::Unusable { .. }) if rate_hz.is_some() => {
                recording.stated.rate_hz = rate_hz;
                one(&recording)?
            }
            found => found.map_err(not_examined)?,
        };
        let inspection = found.inspection();
        let columns = inspection.channels.iter().map(|channel| &channel.column).chain(&inspection.time);
        if let Some(time) = &stated
            && columns.into_iter().any(|column| *column == time.column)
        {
            recording.stated.time = Some(time.clone());
            found = one(&recording)?;
        }
        if rate_hz.is_some() && !found.inspection().is_timed() {
            recording.stated.rate_hz = rate_hz;
            found = one(&recording)?;
        }
        looked_at.push((recording, found));
    }
    // A column that no recording has is looked for in the first, whose columns are named.
    if let (Some(time), Some((first, _))) = (&stated, looked_at.first())
        && looked_at.iter().all(|(recording, _)| recording.stated.time.is_none())
    {
        let stated = StatedFile { time: Some(time.clone()), ..first.stated.clone() };
        one(&RecordingToExamine { stated, ..first.clone() })?;
    }
    looked_at.into_iter().map(|(recording, found)| with_time(recording, found, rate)).collect()
}

/// A recording with the times that somebody at a terminal states, where it has none.
fn with_time(
    mut recording: RecordingToExamine,
    found: ExaminedRecording,
    rate: &mut Option<String>,
) -> Result<ExaminedRecording, CommandEnding> {
    let Err(error) = found.check_time(rate.as_deref()) else { return Ok(found) };
    if !ask::is_answered() {
        return Err(wrong(error));
    }
    let file = recording.path.display().to_string();
    let answer = if let DraftError::TimeWithoutUnit { found, .. } = &error {
        ask::time(&file, found)?.map(|answer| (answer, &found.column))
    } else {
        *rate = ask::rate(&file)?;
        None
    };
    match answer {
        Some((ask::TimeAnswer::Unit(unit), column)) => {
            recording.stated.time = StatedTime::new(column, &unit);
            one(&recording)
        }
        Some((ask::TimeAnswer::Rate(stated), _)) => {
            *rate = Some(stated);
            Ok(found)
        }
        None if rate.is_some() => Ok(found),
        None => Err(wrong(error)),
    }
}

fn one(recording: &RecordingToExamine) -> Result<ExaminedRecording, CommandEnding> {
    look_at(recording).map_err(not_examined)
}

fn look_at(recording: &RecordingToExamine) -> Result<ExaminedRecording, DraftError> {
    let bar = ProgressDisplay::default();
    let mut reading = ReaderProgress::new(&bar, "reading");
    draft::examine(recording, &mut |done, total| reading.hear(done, total))
}

fn not_examined(error: DraftError) -> CommandEnding {
    match error {
        DraftError::Read(ReadError::Interrupted { .. }) => CommandEnding::Interrupted,
        DraftError::Read(e) => unread(&e),
        e => wrong(e),
    }
}

fn role_of(role: &str) -> Result<RecordingRole, CommandEnding> {
    RecordingRole::ALL.into_iter().find(|known| known.key() == role).ok_or_else(|| {
        let known: Vec<String> = RecordingRole::ALL.iter().map(|role| format!("`{}`", role.key())).collect();
        CommandEnding::Wrong(format!(
            "`--further`: found the role `{role}`; expected one of {}",
            known.join(", ")
        ))
    })
}

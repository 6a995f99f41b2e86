//! An experiment file to begin with, from the template of a device or from recordings of one.
//!
//! The template of a device has its published numbers, with comments on where one's own come from, a simulation, and filters
//! that estimate it. A draft from recordings has these in the place of the simulation: what their columns seem to be is found by
//! names, units and values ([`ExaminedRecording`]), which of them are the channels of a device by those of its template ([`sort`]),
//! and what cannot be found is asked for.
//!
//! ```
//! use kalmems::{draft, rigs::published};
//! use std::path::Path;
//!
//! let text = draft::of_device(published(), "piston_mirror")?;
//! let experiment = published().parse(&text, Path::new("mirror.toml")).expect("a template is an experiment");
//! assert!(experiment.simulate.is_some());
//! # Ok::<(), draft::DraftError>(())
//! ```

mod columns;
mod devices;
mod error;
mod examined;
mod guess;
mod kind;
mod listing;
mod names;
mod numbers;
mod text;

pub use columns::{Assigned, Question};
pub use devices::{DeviceFit, fitting};
pub use error::DraftError;
pub use examined::{ExaminedRecording, RecordingDescription, RecordingToExamine, examine};
pub use guess::{ColumnUse, GuessedColumn};
pub use kind::RecordingKind;
pub use listing::{ListedDevice, listed};
pub use names::{
    DescribedName, DeviceNames, NamedChannel, NamedParameter, NamedValue, names_of, schema_with_names,
};
pub use numbers::{OperatorNumber, operator_numbers};

use crate::config::{Experiment, RecordingRole};
use crate::rigs::{Rig, Template, TemplateChannel, Workbench};
use std::path::Path;

/// What a draft is to be made from.
#[derive(Clone, Debug)]
pub struct DraftRequest<'a> {
    /// The device, by the name of its rig.
    pub device: &'a str,
    /// The recordings; the motion of the first is to be estimated.
    pub recordings: &'a [ExaminedRecording],
    /// Meanings of channels with the columns that have them, where one knows them.
    pub channels: &'a [(String, String)],
    /// Numbers of the device, by the end of their keys, such as `comb.angular_width`, and their values.
    pub numbers: &'a [(String, String)],
    /// The rate of the samples, such as `1 MHz`, of recordings without a column of times.
    pub rate: Option<&'a str>,
    /// The folder in which the experiment file is to stand.
    pub folder: &'a Path,
}

/// An experiment file that recordings stand in.
#[derive(Clone, Debug)]
pub struct Draft {
    /// The file.
    pub text: String,
    /// What the recordings seem to hold, in sentences.
    pub recognised: Vec<String>,
    /// Which column of the first recording is what, and why.
    pub assigned: Vec<Assigned>,
}

/// A recording, and which of its columns is what as far as that is known.
#[derive(Clone, Debug)]
pub struct SortedRecording<'a> {
    examined: &'a ExaminedRecording,
    /// What kind of motion it shows.
    pub kind: RecordingKind,
    kind_sentence: String,
    /// What it is taken for.
    pub role: RecordingRole,
    /// Which column is what, and why.
    pub assigned: Vec<Assigned>,
}

/// Recordings that were looked at, and which of their columns is what as far as that is known.
#[derive(Clone, Debug)]
pub struct SortedRecordings<'a> {
    template: Template,
    recordings: Vec<SortedRecording<'a>>,
    /// What is not known and has to be.
    pub questions: Vec<Question>,
}

impl SortedRecordings<'_> {
    /// Which column of the first recording is what, and why.
    pub fn assigned(&self) -> &[Assigned] {
        self.recordings.first().map_or(&[], |first| &first.assigned)
    }
}

/// The rigs that have a template, with it.
fn templates(workbench: &Workbench) -> impl Iterator<Item = (&dyn Rig, Template)> {
    workbench.rigs().filter_map(|rig| Some((rig, rig.template()?)))
}

/// The rig of this name, and its template.
fn template<'w>(workbench: &'w Workbench, device: &str) -> Result<(&'w dyn Rig, Template), DraftError> {
    templates(workbench).find(|(rig, _)| rig.name() == device).ok_or_else(|| DraftError::Device {
        found: device.to_owned(),
        known: templates(workbench).map(|(rig, _)| rig.name()).collect(),
    })
}

/// The template of a device: an experiment file with comments that is simulated and estimated as it stands.
///
/// # Errors
/// A device without a template.
pub fn of_device(workbench: &Workbench, device: &str) -> Result<String, DraftError> {
    Ok(template(workbench, device)?.1.text.to_owned())
}

/// The text of an experiment file with these numbers of the device, by the ends of their keys, in the places of its own.
///
/// # Errors
/// Numbers that the device does not have or does not take.
pub fn with_numbers(
    workbench: &Workbench,
    text: &str,
    numbers: &[(String, String)],
) -> Result<String, DraftError> {
    let text = numbers::with(text, numbers)?;
    if !numbers.is_empty() {
        parsed(workbench, &text)?;
    }
    Ok(text)
}

/// Finds which column of each recording is what.
///
/// # Errors
/// A device without a template, a recording without times, and channels that are stated and not there.
pub fn sort<'a>(
    workbench: &Workbench,
    wanted: &DraftRequest<'a>,
) -> Result<SortedRecordings<'a>, DraftError> {
    let (rig, template) = template(workbench, wanted.device)?;
    for examined in wanted.recordings {
        examined.check_time(wanted.rate)?;
    }
    let columns: Vec<&[_]> = wanted.recordings.iter().map(|one| one.inspection.channels.as_slice()).collect();
    columns::check(wanted.channels, &template, &columns)?;
    let (mut recordings, mut questions) = (Vec::new(), Vec::new());
    for (place, examined) in wanted.recordings.iter().enumerate() {
        let columns = |kind: RecordingKind| {
            let is_needed =
                |channel: &TemplateChannel| place == 0 || channel.meaning != "drive" || kind.is_driven();
            let (name, channels) = (examined.name(), &examined.inspection.channels);
            columns::sort(&name, channels, &template, wanted.channels, is_needed)
        };
        // What kind it is follows from the columns, as many as are found without a drive, and from the kind which columns it needs.
        let found = examined.kind(&columns(RecordingKind::RingDown).0);
        let (assigned, open) = columns(found.kind);
        questions.extend(open);
        recordings.push(SortedRecording {
            examined,
            kind: found.kind,
            kind_sentence: found.sentence,
            role: RecordingRole::Test,
            assigned,
        });
    }
    let mut sorted = SortedRecordings { template, recordings, questions };
    if sorted.questions.is_empty() {
        find_roles(workbench, rig, &mut sorted, wanted)?;
    }
    Ok(sorted)
}

/// Gives each recording behind the first the role of its kind, or the one that is stated for it. A steady motion is to be estimated where the
/// device estimates no recording with the role `steady_state`.
fn find_roles(
    workbench: &Workbench,
    rig: &dyn Rig,
    sorted: &mut SortedRecordings,
    wanted: &DraftRequest,
) -> Result<(), DraftError> {
    for (place, recording) in sorted.recordings.iter_mut().enumerate() {
        recording.role = match recording.examined.role {
            Some(role) => role,
            None if place == 0 => RecordingRole::Test,
            None => recording.kind.role(),
        };
    }
    if sorted
        .recordings
        .iter()
        .all(|one| one.role != RecordingRole::SteadyState || one.examined.role.is_some())
    {
        return Ok(());
    }
    let experiment = parsed(workbench, &text::written(sorted, wanted, &[], ReadoutNoise::Published)?)?;
    let estimated = rig.wanted(&experiment).unwrap_or_default();
    for (place, recording) in sorted.recordings.iter_mut().enumerate() {
        let is_steady = recording.role == RecordingRole::SteadyState && recording.examined.role.is_none();
        if is_steady && !estimated.contains(&place) {
            recording.role = RecordingRole::Test;
        }
    }
    Ok(())
}

/// Writes the experiment file of recordings whose columns are known.
///
/// # Errors
/// Questions that are open, and numbers that the device does not have or that it does not take.
pub fn write(
    workbench: &Workbench,
    sorted: SortedRecordings,
    wanted: &DraftRequest,
) -> Result<Draft, DraftError> {
    if !sorted.questions.is_empty() {
        return Err(DraftError::Open(sorted.questions));
    }
    let recognised = text::recognised(&sorted);
    // The template is checked with them, as its noise is known.
    with_numbers(workbench, sorted.template.text, wanted.numbers)?;
    let text = text::written(&sorted, wanted, &recognised, ReadoutNoise::FromRecording)?;
    let assigned = sorted.recordings.into_iter().next().map(|first| first.assigned).unwrap_or_default();
    Ok(Draft { text, recognised, assigned })
}

/// Where a draft has the noise of its readout from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ReadoutNoise {
    /// As it was published.
    Published,
    /// It is to be found from the recording.
    FromRecording,
}

/// A draft as an experiment, whose device its rig takes.
fn parsed(workbench: &Workbench, text: &str) -> Result<Experiment, DraftError> {
    let wrong = |error| DraftError::Experiment(Box::new(error));
    let experiment = workbench.parse(text, Path::new("new.toml")).map_err(wrong)?;
    let rig = workbench.rig(&experiment).map_err(wrong)?;
    rig.claims(&experiment).map_err(wrong)?;
    Ok(experiment)
}

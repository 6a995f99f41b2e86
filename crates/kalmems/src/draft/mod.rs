//! An experiment file to begin with, from the template of a device or from a recording of one.
//!
//! The template of a device has its published numbers, with comments on where one's own come from, a simulation, and filters
//! that estimate it. A draft from a recording has the recording in the place of the simulation: which of its columns is what is told by
//! their names and units, and asked for where these do not tell.
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
mod error;
mod listing;
mod names;
mod text;

pub use columns::{Assigned, Question};
pub use error::DraftError;
pub use listing::{ListedDevice, listed};
pub use names::{
    DescribedName, DeviceNames, NamedChannel, NamedParameter, NamedValue, names_of, schema_with_names,
};

use crate::config::RecordingRole;
use crate::inspect::{Inspection, inspect_with};
use crate::rigs::{Rig, Template, Workbench};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// What a draft is to be made from.
#[derive(Clone, Debug)]
pub struct DraftRequest<'a> {
    /// The device, by the name of its rig.
    pub device: &'a str,
    /// The recording whose motion is to be estimated.
    pub recording: &'a Path,
    /// Further recordings, by their roles.
    pub further: &'a [(RecordingRole, PathBuf)],
    /// Meanings of channels with the columns that have them, where one knows them.
    pub channels: &'a [(String, String)],
    /// The rate of the samples, such as `1 MHz`, of a recording without a column of times.
    pub rate: Option<&'a str>,
    /// The folder in which the experiment file is to stand.
    pub folder: &'a Path,
}

/// An experiment file that a recording stands in.
#[derive(Clone, Debug)]
pub struct Draft {
    /// The file.
    pub text: String,
    /// What the recording seems to hold, in sentences.
    pub recognised: Vec<String>,
    /// Which column is what, and why.
    pub assigned: Vec<Assigned>,
}

/// A recording that was looked at, and which of its columns is what as far as that is known.
#[derive(Clone, Debug)]
pub struct SortedRecording {
    inspection: Inspection,
    template: Template,
    /// Which column is what, and why.
    pub assigned: Vec<Assigned>,
    /// What is not known and has to be.
    pub questions: Vec<Question>,
}

/// The rig of this name, and its template.
fn template<'w>(workbench: &'w Workbench, device: &str) -> Result<(&'w dyn Rig, Template), DraftError> {
    let templates = || workbench.rigs().filter_map(|rig| Some((rig, rig.template()?)));
    templates().find(|(rig, _)| rig.name() == device).ok_or_else(|| DraftError::Device {
        found: device.to_owned(),
        known: templates().map(|(rig, _)| rig.name()).collect(),
    })
}

/// The template of a device: an experiment file with comments that is simulated and estimated as it stands.
///
/// # Errors
/// A device without a template.
pub fn of_device(workbench: &Workbench, device: &str) -> Result<String, DraftError> {
    Ok(template(workbench, device)?.1.text.to_owned())
}

/// Looks at a recording and finds which of its columns is what.
///
/// # Errors
/// A device without a template, a file that cannot be read or used as a recording, and channels that are stated and not there.
pub fn sort(
    workbench: &Workbench,
    wanted: &DraftRequest,
    progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
) -> Result<SortedRecording, DraftError> {
    let (_, template) = template(workbench, wanted.device)?;
    let inspection = inspect_with(wanted.recording, progress)?;
    if !inspection.is_usable() {
        return Err(DraftError::Unusable { file: wanted.recording.to_owned() });
    }
    if inspection.time.is_none() && wanted.rate.is_none() {
        return Err(DraftError::NoTime { file: wanted.recording.to_owned() });
    }
    let (assigned, questions) = columns::sort(&inspection.channels, &template, wanted.channels)?;
    Ok(SortedRecording { inspection, template, assigned, questions })
}

/// Writes the experiment file of a recording whose columns are known.
///
/// # Errors
/// Questions that are open.
pub fn write(sorted: SortedRecording, wanted: &DraftRequest) -> Result<Draft, DraftError> {
    if !sorted.questions.is_empty() {
        return Err(DraftError::Open(sorted.questions));
    }
    let recognised = text::recognised(&sorted.inspection);
    let text = text::written(&sorted, wanted, &recognised);
    Ok(Draft { text, recognised, assigned: sorted.assigned })
}

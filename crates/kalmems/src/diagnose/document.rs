//! An experiment as a document that can be changed.

use crate::config::{ConfigError, ConfigFault, Experiment, Key, RecordingRole};
use toml::{Table, Value};

/// The experiment's document.
///
/// # Errors
/// An experiment that cannot be written as a file.
pub(super) fn document(experiment: &Experiment) -> Result<Table, ConfigError> {
    let unwritten = |why: String| experiment.error(Key::default(), ConfigFault::Value { why });
    let text = experiment.to_toml().map_err(|e| unwritten(e.to_string()))?;
    text.parse().map_err(|e: toml::de::Error| unwritten(e.to_string()))
}

/// The text of a document of this experiment.
///
/// # Errors
/// A document that cannot be written as a file.
pub(super) fn text(document: &Table, experiment: &Experiment) -> Result<String, ConfigError> {
    let unwritten = |why: String| experiment.error(Key::default(), ConfigFault::Value { why });
    toml::to_string(document).map_err(|e| unwritten(e.to_string()))
}

/// Leaves the recordings of some roles in an experiment's document; the number of those that are left.
pub(super) fn keep_recordings(
    document: &mut Table,
    experiment: &Experiment,
    keep: impl Fn(RecordingRole) -> bool,
) -> usize {
    let mut roles = experiment.recordings.iter().map(|recording| recording.role);
    let Some(Value::Array(recordings)) = document.get_mut("recording") else { return 0 };
    recordings.retain(|_| roles.next().is_some_and(&keep));
    recordings.len()
}

//! The names of files and pictures.

use crate::workflow::{Outcome, RecordingOutcome};

/// The recording's and the segment's name, each where there are several.
pub(super) fn prefix(outcome: &Outcome, recording: &RecordingOutcome, label: &str) -> String {
    of_parts([(outcome.recordings.len() > 1, &recording.name), (recording.segments.len() > 1, label)])
}

/// Those of these names that are wanted, as the beginning of a file's name.
pub(super) fn of_parts(parts: [(bool, &str); 2]) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let named = parts.iter().filter(|(wanted, _)| *wanted);
    named.flat_map(|(_, name)| name.chars().map(safe).chain(['_'])).collect()
}

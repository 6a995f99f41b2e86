//! The names of files and pictures.

use crate::workflow::{Outcome, RecordingOutcome};

/// The recording's and the segment's name, each where there are several.
pub(super) fn prefix(outcome: &Outcome, recording: &RecordingOutcome, label: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let parts =
        [(outcome.recordings.len() > 1, recording.name.as_str()), (recording.segments.len() > 1, label)];
    let named = parts.iter().filter(|(several, _)| *several);
    named.flat_map(|(_, name)| name.chars().map(safe).chain(['_'])).collect()
}

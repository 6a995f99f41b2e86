//! The names of files and pictures.

use crate::recording::Segment;
use crate::workflow::{Outcome, RecordingOutcome};

/// The recording's and the segment's name, each where there are several, and which stretch of its record a segment is.
pub(super) fn prefix(outcome: &Outcome, recording: &RecordingOutcome, segment: &Segment) -> String {
    let several = recording.segments.len() > 1 && !segment.label.is_empty();
    let parts = [(outcome.recordings.len() > 1, recording.name.as_str()), (several, segment.label.as_str())];
    of_parts(parts, segment.stretch.number)
}

/// Those of these names that are wanted, as the beginning of a file's name; a stretch after the first of its record adds its
/// number.
pub(super) fn of_parts(parts: [(bool, &str); 2], number: usize) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let stretch = format!("stretch_{number}");
    let parts = parts.into_iter().chain([(number > 1, stretch.as_str())]);
    let named = parts.filter(|(wanted, _)| *wanted);
    named.flat_map(|(_, name)| name.chars().map(safe).chain(['_'])).collect()
}

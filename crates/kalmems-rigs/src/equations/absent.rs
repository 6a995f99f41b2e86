//! Inputs that a device is described without.

use super::EquationColumns;
use crate::estimate::{EstimateError, SignalSegment};
use crate::units::Kind;
use kalmems_figures::number;

/// An input that a device's table leaves out, and of which a recording may hold nothing but zeros.
#[derive(Clone, Copy, Debug)]
pub struct AbsentInput {
    /// The name of its channel.
    pub channel: &'static str,
    /// What it is.
    pub kind: &'static Kind,
    /// What acts, and what to do: the words behind the value and the time.
    pub words: [&'static str; 2],
}

/// Refuses a segment in which such an input acts: what it moves would be taken for something else.
pub fn require_none(columns: &EquationColumns, segment: &SignalSegment) -> Result<(), EstimateError> {
    for (absent, column) in &columns.absent {
        let values = segment.recording.column_of(column, absent.kind)?.of(segment.segment);
        let acts = |value: &f64| value.is_finite() && *value != 0.0;
        let Some((time_s, value)) = segment.time_s.iter().zip(values).find(|(_, value)| acts(value)) else {
            continue;
        };
        let [what, remedy] = absent.words;
        let why = format!("{} {what} at {} s, and {remedy}", number(*value), number(*time_s));
        return Err(EstimateError::Unfit { place: segment.place.clone(), why });
    }
    Ok(())
}

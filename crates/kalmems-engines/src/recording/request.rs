//! What is asked of a file.

use super::{DeclaredColumn, RecordingLayout, Restarts, TimeSource};
use kalmems_formats::{Hints, Instant};

/// What to take from a file.
pub(crate) struct ReadRequest<'a> {
    pub(crate) clock: &'a TimeSource,
    pub(crate) segment_column: Option<&'a str>,
    pub(crate) columns: ColumnSelection<'a>,
    /// What the settings say of columns beyond their names.
    pub(crate) declared: &'a [DeclaredColumn],
    pub(crate) hints: &'a Hints,
    /// The rate at which the settings say that the rows of a column of times follow each other.
    pub(crate) nominal_rate_hz: Option<f64>,
    /// Where the times count from, where that is not for the file to say.
    pub(crate) origin: Option<Instant>,
    pub(crate) restarts: Option<Restarts>,
}

impl<'a> ReadRequest<'a> {
    /// What a layout says of the file.
    pub(crate) fn of(layout: &'a RecordingLayout) -> Self {
        Self {
            clock: &layout.clock,
            segment_column: layout.segment_column.as_deref(),
            columns: layout.columns.as_deref().map_or(ColumnSelection::AllBut(&[]), ColumnSelection::Named),
            declared: &layout.declared,
            hints: &layout.hints,
            nominal_rate_hz: layout.nominal_rate_hz,
            origin: layout.origin,
            restarts: layout.restarts,
        }
    }
}

/// The columns to take.
pub(crate) enum ColumnSelection<'a> {
    /// These; each must be there, and have a unit where that is needed.
    Named(&'a [String]),
    /// All but these, the time and the segments' labels.
    AllBut(&'a [String]),
}

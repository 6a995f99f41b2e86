//! What is asked of a file.

use super::{Clock, Restarts};
use kalmems_formats::Hints;

/// What to take from a file.
pub(crate) struct Request<'a> {
    pub(crate) clock: &'a Clock,
    pub(crate) segment_column: Option<&'a str>,
    pub(crate) columns: Wanted<'a>,
    pub(crate) hints: &'a Hints,
    pub(crate) restarts: Option<Restarts>,
}

/// The columns to take.
pub(crate) enum Wanted<'a> {
    /// These; each must be there and have a unit.
    Named(&'a [String]),
    /// All but these, the time and the segments' labels.
    AllBut(&'a [String]),
}

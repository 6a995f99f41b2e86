//! The figures of each signal of the filters of a batch.

use crate::rows::{BY_SIGNAL, ResultRow};
use crate::table::number;
use serde::Serialize;

/// The mean NIS of one of the signals that correct the trusted filter of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BatchSignal {
    /// Name of the recording.
    pub recording: String,
    /// Label of the segment; empty if the recording has one segment.
    pub segment: String,
    /// Name of the signal.
    pub signal: String,
    /// Mean of its normalised innovation squared, 1 on average for a consistent filter.
    pub mean_nis: f64,
    /// Lower end of its 95 % interval for a consistent filter.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// Number of its updates.
    pub updates: usize,
}

/// The signal of which a column of results has the mean NIS.
pub(super) fn signal_of(column: &str) -> Option<&str> {
    column.strip_prefix(BY_SIGNAL)?.strip_prefix('.')?.strip_suffix(".mean_nis")
}

/// The signals of a row of results; none of a filter that is not the trusted one, or that one signal corrects.
pub(super) fn signals(recording: &str, row: &ResultRow) -> Vec<BatchSignal> {
    let cell = |name: &str| row.get(name).and_then(|cell| cell.as_str()).unwrap_or_default();
    let of = |signal: &str| {
        let figure_cell = |what: &str| cell(&format!("{BY_SIGNAL}.{signal}.{what}"));
        let figure = |what: &str| number(figure_cell(what));
        Some(BatchSignal {
            recording: recording.to_owned(),
            segment: cell("segment").to_owned(),
            signal: signal.to_owned(),
            mean_nis: figure("mean_nis")?,
            lower: figure("lower")?,
            upper: figure("upper")?,
            updates: figure_cell("updates").parse().ok()?,
        })
    };
    let names = row.keys().filter_map(|name| signal_of(name)).filter(|_| cell("trusted") == "yes");
    names.filter_map(of).collect()
}

//! Tables without a time: the points of a curve, or a number measured at several values of another.

use crate::config::Experiment;
use crate::recording::{Hints, ReadError, RecordingLayout, SampledRecording, TimeSource};
use std::path::Path;

/// Reads these columns of a table that an experiment names. It has no time: its rows are counted.
pub fn read_table(
    experiment: &Experiment,
    file: &Path,
    columns: &[&str],
) -> Result<SampledRecording, ReadError> {
    let layout = RecordingLayout {
        clock: TimeSource::Rate { rate_hz: 1.0, start_s: 0.0 },
        segment_column: None,
        columns: Some(columns.iter().map(|&column| column.to_owned()).collect()),
        declared: Vec::new(),
        hints: Hints::default(),
        nominal_rate_hz: None,
        origin: None,
        restarts: None,
    };
    SampledRecording::read(&experiment.resolve(file), &layout)
}

//! Tables without a time: the points of a curve, or a number measured at several values of another.

use crate::config::Experiment;
use crate::recording::{Hints, ReadError, RecordingLayout, SampledRecording, TimeSource, has_more_rows};
use std::io;
use std::path::Path;

/// A table of more rows is no table of points, and is refused before it is held in memory.
const MOST_ROWS: u64 = 1 << 20;

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
    let path = experiment.resolve(file);
    if has_more_rows(&path, &layout, MOST_ROWS)? {
        let why = format!("a table of points has more than {MOST_ROWS} rows; leave out points");
        let source = io::Error::new(io::ErrorKind::InvalidInput, why);
        return Err(ReadError::Io { file: path.display().to_string(), source });
    }
    SampledRecording::read(&path, &layout)
}

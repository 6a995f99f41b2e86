//! The trajectories of a recording as one Parquet file.

use super::report::{columns, signal_unit};
use crate::parquet::{Cells, ParquetColumn, ParquetColumnKind, ParquetFile};
use crate::workflow::{RecordingOutcome, SegmentOutcome};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// What tells the rows of one trajectory from those of another, in front of its columns.
const OF: [&str; 3] = ["segment", "stretch", "filter"];

/// A file of all trajectories of a recording: a row for each sample of each filter, with segment, stretch and filter in front, and the
/// columns that a trajectory's file has. What a trajectory does not have is null.
pub(crate) struct TrajectoryFile<W: Write + Send> {
    file: ParquetFile<W>,
    columns: Vec<ParquetColumn>,
}

impl<W: Write + Send> TrajectoryFile<W> {
    /// Begins a file with the columns that the trajectories of these segments have.
    pub(crate) fn begin(to: W, outcome: &RecordingOutcome) -> io::Result<Self> {
        let all = outcome.segments.iter().flat_map(|segment| {
            let unit = signal_unit(outcome, segment);
            segment.estimate.trajectories.iter().map(move |trajectory| {
                columns(trajectory, &unit).into_iter().map(|(name, _)| name).collect::<Vec<String>>()
            })
        });
        let of = OF.map(|name| ParquetColumn { name: name.to_owned(), kind: ParquetColumnKind::Words });
        let numbers = crate::table::union(all)
            .into_iter()
            .map(|name| ParquetColumn { name, kind: ParquetColumnKind::Numbers });
        let columns: Vec<ParquetColumn> = of.into_iter().chain(numbers).collect();
        Ok(Self { file: ParquetFile::begin(to, &columns)?, columns })
    }

    /// Writes the trajectories of a recording, or of a part of it.
    pub(crate) fn add(&mut self, outcome: &RecordingOutcome) -> io::Result<()> {
        outcome.segments.iter().try_for_each(|segment| self.segment(outcome, segment))
    }

    fn segment(&mut self, outcome: &RecordingOutcome, segment: &SegmentOutcome) -> io::Result<()> {
        let (estimate, unit) = (&segment.estimate, signal_unit(outcome, segment));
        let (label, stretch) = (estimate.segment.label.as_str(), estimate.segment.stretch.number.to_string());
        for trajectory in &estimate.trajectories {
            let rows = trajectory.time_s.len();
            let own: BTreeMap<String, Cow<[f64]>> = columns(trajectory, &unit).into_iter().collect();
            if let Some(name) =
                own.keys().find(|name| self.columns.iter().all(|column| column.name != **name))
            {
                let why =
                    format!("a later part of the recording has a column `{name}`, which the first has not");
                return Err(io::Error::other(why));
            }
            let of = [label, stretch.as_str(), trajectory.key.as_str()];
            let cells = self.columns.iter().enumerate().map(|(place, column)| match of.get(place) {
                Some(word) => Cells::Words(vec![(!word.is_empty()).then_some(*word); rows]),
                None => Cells::Numbers(match own.get(&column.name) {
                    Some(values) => values.iter().map(|value| value.is_finite().then_some(*value)).collect(),
                    None => vec![None; rows],
                }),
            });
            self.file.rows(cells)?;
        }
        Ok(())
    }

    /// Writes what stands behind the rows.
    pub(crate) fn finish(self) -> io::Result<W> {
        self.file.finish()
    }
}

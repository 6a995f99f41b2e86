//! Recordings of one segment that grow at one end and shrink at the other.

use super::segment::SegmentTimes;
use super::{RecordingColumn, SampledRecording};

impl SampledRecording {
    /// What it would be if the numbers of a column were others: `change` is given times and values in SI of one segment after the
    /// other. For questions about a filter; what was found in the file stays as it was.
    #[must_use]
    pub fn what_if(&self, column: &str, change: impl Fn(&[f64], &mut [f64])) -> Self {
        let mut other = self.clone();
        if let Some(column) = other.columns.iter_mut().find(|own| own.header.column == column) {
            for segment in &other.segments {
                if let Some(values) = column.values_mut().get_mut(segment.rows.clone()) {
                    change(&segment.time.to_vec(), values);
                }
            }
        }
        other
    }

    /// What it would be if the numbers of two columns were exchanged, as `what_if`.
    #[must_use]
    pub fn exchanged(&self, one: &str, other: &str) -> Self {
        let mut exchanged = self.clone();
        let place = |name: &str| self.columns.iter().position(|own| own.header.column == name);
        if let (Some(one), Some(other)) = (place(one), place(other)) {
            let numbers = |place: usize| self.columns.get(place).map(|column| column.values.clone());
            for (to, from) in [(one, other), (other, one)] {
                if let (Some(column), Some(values)) = (exchanged.columns.get_mut(to), numbers(from)) {
                    *column.values_mut() = values;
                }
            }
        }
        exchanged
    }

    /// The first rows alone, as a copy; what was found in the whole stays said.
    #[must_use]
    pub fn first_rows(&self, rows: usize) -> Self {
        let rows = rows.min(self.rows);
        let cut = |column: &RecordingColumn| {
            let values = column.values.get(..rows).unwrap_or_default().to_vec();
            RecordingColumn::new(column.header.clone(), values)
        };
        let within = self.segments.iter().filter(|segment| segment.rows.start < rows);
        Self {
            source: self.source.clone(),
            columns: self.columns.iter().map(cut).collect(),
            segments: within
                .map(|segment| segment.part(&(0..segment.rows.end.min(rows) - segment.rows.start)))
                .collect(),
            diagnosis: self.diagnosis.clone(),
            rows,
            origin: self.origin,
        }
    }

    /// Puts the rows of a later stretch of the same segment behind.
    pub(crate) fn extend(&mut self, later: &Self) {
        for (column, more) in self.columns.iter_mut().zip(&later.columns) {
            column.values_mut().extend_from_slice(&more.values);
        }
        let (Some(segment), Some(more)) = (self.segments.first_mut(), later.segments.first()) else { return };
        match (&mut segment.time.times, &more.time.times) {
            (SegmentTimes::Column(times), SegmentTimes::Column(more)) => times.extend_from_slice(more),
            (SegmentTimes::Rate { len, .. }, SegmentTimes::Rate { len: more, .. }) => *len += more,
            // The clock is that of the experiment, for all stretches the same.
            _ => {}
        }
        segment.time.uniform &= more.time.uniform;
        segment.rows.end += more.rows.len();
        self.rows += later.rows;
    }

    /// Lets go of the rows before this time in s.
    pub(crate) fn forget_before(&mut self, time_s: f64) {
        let Some(segment) = self.segments.first_mut() else { return };
        let rows = segment.time.len();
        let at = |row: usize| segment.time.at(row);
        let (mut gone, mut end) = (0, rows);
        while gone < end {
            let middle = gone.midpoint(end);
            if at(middle) < time_s { gone = middle + 1 } else { end = middle }
        }
        match &mut segment.time.times {
            SegmentTimes::Column(times) => {
                times.drain(..gone);
            }
            SegmentTimes::Rate { first, len, .. } => {
                *first += gone;
                *len -= gone;
            }
        }
        for column in &mut self.columns {
            let values = column.values_mut();
            values.drain(..gone.min(values.len()));
        }
        segment.rows = 0..rows - gone;
        self.rows = rows - gone;
    }
}

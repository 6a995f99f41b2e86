//! Lanes of records that are not read from a file as they stand there.

use crate::Result;
use crate::records::RecordLane;
use std::ops::Range;

/// Texts that are in memory.
pub(crate) struct TextLane {
    pub(crate) texts: Vec<Vec<u8>>,
    pub(crate) next: usize,
}

impl RecordLane for TextLane {
    fn record(&self) -> usize {
        0
    }

    fn read(&mut self, _rows: usize, out: &mut Vec<u8>) -> Result<()> {
        out.clear();
        Ok(())
    }

    fn texts(&mut self, rows: usize, out: &mut Vec<Vec<u8>>) -> Result<()> {
        out.clear();
        out.extend(self.texts.iter().skip(self.next).take(rows).cloned());
        self.next += rows;
        Ok(())
    }
}

/// Records that stand in some rows of a longer table; the others are missing.
pub(crate) struct PaddedLane {
    inner: Option<Box<dyn RecordLane>>,
    present: Range<u64>,
    row: u64,
    missing: Vec<bool>,
}

impl PaddedLane {
    pub(crate) const NONE: Self = Self { inner: None, present: 0..0, row: 0, missing: Vec::new() };

    pub(crate) fn new(inner: Box<dyn RecordLane>, present: Range<u64>) -> Self {
        Self { inner: Some(inner), present, ..Self::NONE }
    }
}

impl RecordLane for PaddedLane {
    fn record(&self) -> usize {
        self.inner.as_ref().map_or(0, |inner| inner.record())
    }

    fn protection(&self) -> Option<&'static str> {
        self.inner.as_ref().and_then(|inner| inner.protection())
    }

    fn missing(&self) -> &[bool] {
        &self.missing
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()> {
        let end = self.row + rows as u64;
        let from = self.present.start.clamp(self.row, end);
        let to = self.present.end.clamp(from, end);
        // Both are no more than `rows`.
        let few = |count: u64| usize::try_from(count).unwrap_or(rows);
        let record = self.record();
        out.clear();
        if let Some(inner) = self.inner.as_mut().filter(|_| to > from) {
            inner.read(few(to - from), out)?;
        }
        out.splice(0..0, std::iter::repeat_n(0, few(from - self.row) * record));
        out.resize(rows * record, 0);
        self.missing.clear();
        self.missing.extend((self.row..end).map(|row| !self.present.contains(&row)));
        self.row = end;
        Ok(())
    }
}

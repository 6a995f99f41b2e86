//! Waveforms of a text that begin later than others beside which they stand: their values are held for as many rows.

use super::dialect::ColumnOrigin;
use crate::{Block, CellFault, CellFinding, FormatError, WantedColumn};
use std::collections::VecDeque;

/// The wanted columns of numbers, if any begins later.
#[derive(Default)]
pub(super) struct LaterWaveforms {
    columns: Vec<LaterColumn>,
    /// Rows that were given, and that the text lacks at its end.
    row: u64,
    behind: u64,
}

/// A wanted column of numbers.
struct LaterColumn {
    column: usize,
    /// Rows by which it begins later; none of a column that is computed.
    later: Option<u64>,
    /// Its values whose rows are not there yet, and what is wrong with some, by their rows.
    values: VecDeque<f64>,
    faults: VecDeque<(u64, CellFault)>,
}

impl LaterWaveforms {
    /// Those of a text whose first row stands in a line.
    pub(super) fn of(
        wanted: &[WantedColumn],
        first_line: u64,
        origin: impl Fn(usize) -> ColumnOrigin,
    ) -> Result<Self, FormatError> {
        let mut columns = Vec::new();
        for want in wanted {
            let (column, origin) = (want.column(), origin(want.column()));
            let later = match origin {
                ColumnOrigin::Later { rows, .. } => Some(rows),
                ColumnOrigin::Cell(_) => Some(0),
                _ => None,
            };
            if later.is_some_and(|rows| rows > 0) && !matches!(want, WantedColumn::Number { .. }) {
                let what = "a waveform that begins later than others as labels or times";
                return Err(FormatError::unsupported("CSV", what, "name it as numbers"));
            }
            if !want.is_label() {
                let values = (0..later.unwrap_or(0)).map(|_| f64::NAN).collect();
                let missing = |row: u64| (row, missing(column, 0, first_line + row));
                let faults = (0..later.unwrap_or(0)).map(missing).collect();
                columns.push(LaterColumn { column, later, values, faults });
            }
        }
        let behind = columns.iter().filter_map(|column| column.later).max().unwrap_or(0);
        if behind == 0 {
            columns.clear();
        }
        Ok(Self { columns, row: 0, behind })
    }

    /// Whether all begin together.
    pub(super) fn is_none(&self) -> bool {
        self.columns.is_empty()
    }

    /// How many rows follow behind the last of the text, as many as there is room for.
    pub(super) fn rows_behind(&mut self, room: usize) -> usize {
        let rows = usize::try_from(self.behind).unwrap_or(room).min(room);
        self.behind -= rows as u64;
        rows
    }

    /// Says of rows behind the last of the text that no cell of it is there.
    pub(super) fn leave_out_others(&self, block: &mut Block) {
        let line = block.lines.first().map_or(0, |(_, line)| *line);
        for row in 0..block.rows {
            let cells = self.columns.iter().filter(|column| column.later.is_some());
            block.faults.extend(cells.map(|column| missing(column.column, row, line + row as u64)));
        }
    }

    /// Puts values and faults to the rows that they belong to.
    pub(super) fn shift(&mut self, block: &mut Block) {
        let (first, end) = (self.row, self.row + block.rows as u64);
        for (column, numbers) in self.columns.iter_mut().zip(&mut block.numbers) {
            let Some(later) = column.later.filter(|later| *later > 0) else { continue };
            column.values.extend(numbers.drain(..));
            numbers.extend(column.values.drain(..block.rows.min(column.values.len())));
            let own = |fault: &CellFault| fault.column == Some(column.column);
            let found = block.faults.iter().filter(|fault| own(fault)).cloned();
            column.faults.extend(found.map(|fault| (first + fault.row as u64 + later, fault)));
            block.faults.retain(|fault| !own(fault));
            let count = column.faults.partition_point(|(row, _)| *row < end);
            for (row, fault) in column.faults.drain(..count) {
                // Less than the rows of the block.
                let row = usize::try_from(row - first).unwrap_or(0);
                block.faults.push(CellFault { row, ..fault });
            }
        }
        block.faults.sort_by_key(|fault| fault.row);
        self.row = end;
    }
}

fn missing(column: usize, row: usize, line: u64) -> CellFault {
    CellFault { row, line, column: Some(column), fault: CellFinding::Missing }
}

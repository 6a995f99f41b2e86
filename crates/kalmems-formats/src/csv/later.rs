//! Waveforms of a text that begin later than others beside which they stand: their values are held for as many rows. Times of their own are
//! compared with those of the rows.

use super::dialect::{ColumnOrigin, Dialect};
use crate::clock::WHOLE;
use crate::{Block, CellFault, CellFinding, FormatError, Result, WantedColumn};
use std::collections::VecDeque;

/// The columns of numbers that are read, if any begins later or has times of its own.
#[derive(Default)]
pub(super) struct LaterWaveforms {
    columns: Vec<LaterColumn>,
    /// As many of them are wanted; the others are times.
    wanted: usize,
    /// Which of them is the time of the rows, which the times of waveforms, and the last time.
    clock: usize,
    own_times: Vec<usize>,
    time: f64,
    /// Rows that were given, and that the text lacks at its end.
    row: u64,
    behind: u64,
}

/// A column of numbers that is read.
struct LaterColumn {
    column: usize,
    /// Rows by which it begins later; none of a column that is computed.
    later: Option<u64>,
    /// Its values whose rows are not there yet, and what is wrong with some, by their rows.
    values: VecDeque<f64>,
    faults: VecDeque<(u64, CellFault)>,
}

impl LaterWaveforms {
    /// Those of a text, and all columns that are read for them: those that are wanted, and behind them the times of waveforms among these.
    pub(super) fn of(wanted: &[WantedColumn], dialect: &Dialect) -> Result<(Self, Vec<WantedColumn>)> {
        let origin = |column: usize| dialect.columns.get(column).map(|column| column.origin);
        let mut all = wanted.to_vec();
        let times = dialect.text.own_times.iter();
        let times =
            times.filter(|(time, waveform)| *time > 0 && wanted.iter().any(|w| w.column() == *waveform));
        let mut compared: Vec<usize> = times.map(|(time, _)| *time).collect();
        if !compared.is_empty() {
            let is_clock = |want: &&WantedColumn| want.column() == 0 && !want.is_label();
            let clock =
                wanted.iter().find(is_clock).copied().unwrap_or(WantedColumn::Number { column: 0, power: 0 });
            compared.insert(0, 0);
            let others = compared.iter().filter(|column| !wanted.contains(&clock.of(**column)));
            all.extend(others.map(|column| clock.of(*column)));
        }
        let mut columns = Vec::new();
        for want in &all {
            let column = want.column();
            let later = match origin(column) {
                Some(ColumnOrigin::Later { rows, .. }) => Some(rows),
                Some(ColumnOrigin::Cell(_)) => Some(0),
                _ => None,
            };
            if later.is_some_and(|rows| rows > 0) && want.is_label() {
                let what = "a waveform that begins later than others as labels";
                return Err(FormatError::unsupported("CSV", what, "name it as numbers"));
            }
            if !want.is_label() {
                let values = (0..later.unwrap_or(0)).map(|_| f64::NAN).collect();
                let missing = |row: u64| (row, missing(column, 0, dialect.first_row_line + row));
                let faults = (0..later.unwrap_or(0)).map(missing).collect();
                columns.push(LaterColumn { column, later, values, faults });
            }
        }
        let behind = columns.iter().filter_map(|column| column.later).max().unwrap_or(0);
        if behind == 0 && compared.is_empty() {
            columns.clear();
        }
        let place = |column: &usize| columns.iter().rposition(|known| known.column == *column).unwrap_or(0);
        let mut own_times: Vec<usize> = compared.iter().map(place).collect();
        let clock = if own_times.is_empty() { 0 } else { own_times.remove(0) };
        let wanted = wanted.iter().filter(|want| !want.is_label()).count();
        Ok((Self { columns, wanted, clock, own_times, time: f64::NAN, row: 0, behind }, all))
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

    /// Puts values and faults to the rows that they belong to, and compares the times of the waveforms with those of the rows.
    pub(super) fn shift(&mut self, block: &mut Block) -> Result<()> {
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
        self.compare_times(block)?;
        block.numbers.truncate(self.wanted);
        let read = self.columns.get(self.wanted..).unwrap_or_default();
        block.faults.retain(|fault| !read.iter().any(|column| fault.column == Some(column.column)));
        block.faults.sort_by_key(|fault| fault.row);
        self.row = end;
        Ok(())
    }

    /// Refuses waveforms whose times are not those of the rows. Behind the last row of the text they are the only ones.
    fn compare_times(&mut self, block: &mut Block) -> Result<()> {
        for (row, line) in (0..block.rows).map(|row| (row, self.row + row as u64)) {
            let own = |place: &usize| Some((*place, *block.numbers.get(*place)?.get(row)?));
            let own: Vec<(usize, f64)> = self.own_times.iter().filter_map(own).collect();
            let clock = block.numbers.get_mut(self.clock).and_then(|times| times.get_mut(row));
            let (Some(time), Some(column)) = (clock, self.columns.get(self.clock)) else { return Ok(()) };
            if let Some((_, last)) = own.iter().find(|(_, own)| time.is_nan() && !own.is_nan()) {
                *time = *last;
                block.faults.retain(|fault| fault.row != row || fault.column != Some(column.column));
            }
            let apart = WHOLE * (*time - self.time).abs();
            if let Some((place, other)) = own.iter().find(|(_, own)| (own - *time).abs() > apart) {
                let column = self.columns.get(*place).map_or(0, |column| column.column + 1);
                let where_it_is = format!("column {column} with the time {other} in row {}", line + 1);
                let what =
                    format!("{where_it_is}, whose time is {time} by the column of the first waveform,");
                return Err(FormatError::unsupported(
                    "CSV",
                    what,
                    "write each waveform to a file of its own",
                ));
            }
            self.time = *time;
        }
        Ok(())
    }
}

fn missing(column: usize, row: usize, line: u64) -> CellFault {
    CellFault { row, line, column: Some(column), fault: CellFinding::Missing }
}

//! A table of records that is being put together, part by part, by the reader of a format.

use crate::clock::ChannelClock;
use crate::name::example_names;
use crate::records::{CellKind, RecordField, RecordLane, RecordTable, StoredCell};
use crate::stated_clock::{StatedNumbers, settle_each};
use crate::stream::{FileStretch, StreamLane};
use crate::{Column, FormatError, Hints, OmittedPart, Result, Table, limits, refuse_if};

/// Columns of an array of two axes that become columns beside others.
const BESIDE: u64 = 64;

/// An array of rows and columns in a stretch of the file.
pub(crate) struct StoredArray<'a> {
    pub(crate) stretch: &'a FileStretch,
    /// Where it begins in it.
    pub(crate) place: u64,
    pub(crate) rows: u64,
    pub(crate) cell: StoredCell,
    /// Its columns stand one after the other.
    pub(crate) by_column: bool,
}

/// Whether the columns of an array of two axes become columns beside others.
pub(crate) fn becomes_columns(rows: u64, columns: u64) -> bool {
    columns <= BESIDE.min(rows)
}

/// The only one of some tables, which have names; several are refused with these.
pub(crate) fn only<T>(format: &'static str, mut places: Vec<(String, T)>) -> Result<Option<(String, T)>> {
    if places.len() < 2 {
        return Ok(places.pop());
    }
    let mut names: Vec<String> = places.iter().map(|(name, _)| format!("`{name}`")).collect();
    names.sort();
    let remedy = format!("write `group` as one of {}", limits::list(&names));
    Err(FormatError::unsupported(format, "several tables at a time", remedy))
}

/// What was found so far.
#[derive(Default)]
pub(crate) struct TableParts {
    pub(crate) format: &'static str,
    /// What was recognised, as a sentence.
    pub(crate) recognised: String,
    pub(crate) left_out: Vec<OmittedPart>,
    pub(crate) fields: Vec<RecordField>,
    pub(crate) lanes: Vec<Box<dyn RecordLane>>,
    /// Single numbers that may state a clock for all columns.
    pub(crate) stated: StatedNumbers,
    /// What is stated of single columns, by their places among the fields.
    pub(crate) own_clocks: Vec<(usize, ChannelClock)>,
}

impl TableParts {
    pub(crate) fn new(format: &'static str) -> Self {
        Self { format, ..Self::default() }
    }

    /// Says why a part of the file is no column.
    pub(crate) fn leave_out(&mut self, name: impl Into<String>, why: impl Into<String>) {
        self.left_out.push(OmittedPart::new(name, why));
    }

    /// Adds a column with a lane of its own.
    pub(crate) fn add(&mut self, column: Column, cells: CellKind, rows: u64, lane: Box<dyn RecordLane>) {
        self.fields.push(RecordField::new(column, cells, rows));
        self.lanes.push(lane);
    }

    /// The names of the columns of an array of so many: those of the experiment, or else of the file. `what` is the array, for messages.
    pub(crate) fn names(
        &self,
        hints: &Hints,
        stored: Option<Vec<String>>,
        columns: u64,
        what: &str,
    ) -> Result<Vec<String>> {
        let has_others = stored.is_some() && hints.columns.is_some();
        match hints.columns.clone().or(stored) {
            Some(names) if names.len() as u64 == columns => Ok(names),
            names => {
                let with = names.map_or("out names".to_owned(), |names| format!(" {} names", names.len()));
                let kind = self.format.split(' ').next().unwrap_or_default().to_lowercase();
                let example = example_names(usize::try_from(columns).unwrap_or(usize::MAX));
                let remedy = if has_others {
                    "leave `columns` out, as the file has names for them".to_owned()
                } else {
                    format!(
                        "write their names, such as `format = {{ kind = \"{kind}\", columns = {example} }}`; rows are along the \
                         first axis"
                    )
                };
                Err(FormatError::unsupported(self.format, format!("{what} with{with}"), remedy))
            }
        }
    }

    /// Adds columns of numbers or texts whose cells stand beside each other in the records of a lane.
    pub(crate) fn add_rows(
        &mut self,
        lane: Box<dyn RecordLane>,
        rows: u64,
        cell: StoredCell,
        names: &[String],
    ) {
        for (number, name) in names.iter().enumerate() {
            let cells = CellKind::Stored { lane: self.lanes.len(), offset: number * cell.bytes(), cell };
            let column = Column::new(name).at(format!("column {}", number + 1));
            self.fields.push(RecordField::new(column, cells, rows));
        }
        self.lanes.push(lane);
    }

    /// Adds the columns of an array, which stand one after the other or beside each other.
    pub(crate) fn add_array(&mut self, array: &StoredArray, names: &[String]) -> Result<()> {
        let &StoredArray { stretch, place, rows, cell, by_column } = array;
        let (count, size) = (names.len(), cell.bytes());
        limits::at_most(self.format, "the number of columns", count, limits::COLUMNS)?;
        let wide = if by_column { size } else { count.saturating_mul(size) };
        limits::at_most(self.format, "the bytes of a row", wide, limits::ROW_BYTES)?;
        let first = self.fields.len();
        let (lanes, width) = if by_column { (count, 1) } else { (1, count) };
        for (number, names) in (0..lanes).zip(names.chunks(width.max(1))) {
            let skip = place + number as u64 * rows * size as u64;
            self.add_rows(Box::new(StreamLane::new(stretch.clone(), skip, wide)), rows, cell, names);
        }
        for (number, field) in self.fields.iter_mut().skip(first).enumerate() {
            field.column.place = (count > 1).then(|| format!("column {}", number + 1));
        }
        Ok(())
    }

    /// The table, with the time that the file states. `stated_by` says what states it, and `remedy` what to do where there is no column.
    pub(crate) fn finish(
        mut self,
        file_bytes: u64,
        stated_by: &'static str,
        remedy: &str,
    ) -> Result<Box<dyn Table>> {
        let mut clocks = vec![self.stated.clock(); self.fields.len()];
        for (field, own) in &self.own_clocks {
            if let Some(clock) = clocks.get_mut(*field).filter(|_| own.step.is_some()) {
                *clock = *own;
            }
        }
        let said = settle_each(&clocks, &mut self.fields, &mut self.lanes, stated_by);
        self.recognised.push_str(&said);
        self.table(file_bytes, "a file", remedy)
    }

    /// The same with the times that it has already. `what` is the place, for messages.
    pub(crate) fn table(self, file_bytes: u64, what: &str, remedy: &str) -> Result<Box<dyn Table>> {
        refuse_if(self.fields.is_empty(), || {
            let left_out = limits::list(&self.left_out);
            let what = format!("{what} without a column of numbers or labels ({left_out})");
            FormatError::unsupported(self.format, what, remedy)
        })?;
        Ok(Box::new(RecordTable::new(self, file_bytes)))
    }
}

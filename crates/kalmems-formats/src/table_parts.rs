//! A table of records that is being put together, part by part, by the reader of a format.

use crate::clock::ChannelClock;
use crate::records::{CellKind, RecordField, RecordLane, RecordTable};
use crate::stated_clock::{StatedNumbers, settle_each};
use crate::{Column, FormatError, OmittedPart, Table, limits};

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

    /// The table, with the time that the file states. `stated_by` says what states it, and `remedy` what to do where there is no column.
    pub(crate) fn finish(
        self,
        file_bytes: u64,
        stated_by: &'static str,
        remedy: &str,
    ) -> Result<Box<dyn Table>, FormatError> {
        let Self { format, mut recognised, left_out, mut fields, mut lanes, stated, own_clocks } = self;
        if fields.is_empty() {
            let what = format!("a file without a column of numbers or labels ({})", limits::list(&left_out));
            return Err(FormatError::unsupported(format, what, remedy));
        }
        let mut clocks = vec![stated.clock(); fields.len()];
        for (field, own) in own_clocks {
            if let Some(clock) = clocks.get_mut(field).filter(|_| own.step.is_some()) {
                *clock = own;
            }
        }
        recognised.push_str(&settle_each(&clocks, &mut fields, &mut lanes, stated_by));
        Ok(Box::new(RecordTable::new(format, recognised, left_out, fields, lanes, file_bytes)))
    }
}

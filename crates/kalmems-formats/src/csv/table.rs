//! A text as a table.

use super::cell::{CellReader, DigitGroups};
use super::dialect::{ColumnOrigin, Dialect, Heading, RecordShape, marks};
use super::input::CsvInput;
use super::later::LaterWaveforms;
use super::number::quick;
use super::split::{BLANKS, Split};
use crate::block::push_label;
use crate::table::refuse_apart;
use crate::{
    Block, CellFault, CellFinding, Digest, Result, Table, TableDescription, TimeKind, TimeReader, TimeUnit,
    WantedColumn, sentinels,
};

/// As much text is gone through for one block, so that a block does not take long where rows are left out.
const BYTES_PER_BLOCK: u64 = 16 << 20;

/// What is done with a cell.
#[derive(Clone, Copy, Debug, Default)]
struct CellUse {
    /// Read as a number, times this power of ten.
    power: Option<i32>,
    /// Numbers from this size on are looked at more closely.
    limit: f64,
    groups: DigitGroups,
    /// Read as a time, among the numbers.
    time: bool,
    /// Kept as a label.
    label: bool,
}

impl CellUse {
    /// Whether it is among the numbers.
    const fn is_number(self) -> bool {
        self.power.is_some() || self.time
    }
}

pub(super) struct CsvTable {
    input: CsvInput,
    dialect: Dialect,
    description: TableDescription,
    /// One for each cell of a row.
    uses: Vec<CellUse>,
    /// What is wanted; one for each wanted column of numbers, and one for each of labels.
    wanted: Vec<WantedColumn>,
    values: Vec<ColumnOrigin>,
    labels: Vec<ColumnOrigin>,
    /// Reads the cells that are times.
    times: TimeReader,
    /// The cells that are labels, in their order.
    label_cells: Vec<usize>,
    /// The column of the description that each cell is; none for those that are no column.
    column_of: Vec<Option<usize>>,
    /// The line of the next row, the record that it is of and its number therein, and blank lines before it: the first
    /// and how many.
    line: u64,
    record: RecordPlace,
    blank: (u64, u64),
    /// Rows of empty cells before the next row: the line of the first and how many. At the end they are none, as a spreadsheet writes them.
    empty: (u64, u64),
    /// Whether it was told that the last line has no end.
    end_is_told: bool,
    /// Columns whose values belong to later rows.
    later: LaterWaveforms,
    /// Memory that is used again.
    split: Split,
    cells: CellReader,
    numbers: Vec<f64>,
    stretches: Vec<(usize, usize)>,
}

/// Where in the records of a file the next row is.
struct RecordPlace {
    /// The number of the record, counted from 1, as a number and as a label.
    number: u64,
    label: Vec<u8>,
    /// The rows of it so far.
    row: u64,
}

impl RecordPlace {
    fn new(number: u64) -> Self {
        Self { number, label: number.to_string().into_bytes(), row: 0 }
    }

    /// After a row, where records have so many.
    #[inline]
    fn next_row(&mut self, rows: Option<u64>) {
        self.row += 1;
        if rows.is_some_and(|rows| self.row >= rows) {
            self.begin_next();
        }
    }

    /// Begins the next record.
    #[cold]
    fn begin_next(&mut self) {
        *self = Self::new(self.number + 1);
    }
}

/// What became of a piece of text.
enum RowOutcome {
    /// It was gone through.
    On,
    /// The block is full.
    Full,
    /// There is no more.
    End,
}

impl CsvTable {
    pub(super) fn new(input: CsvInput, dialect: Dialect) -> Self {
        let mut column_of = vec![None; dialect.text.cells];
        for (index, column) in dialect.columns.iter().enumerate() {
            if let Some(of) = column.origin.cell().and_then(|cell| column_of.get_mut(cell)) {
                *of = Some(index);
            }
        }
        let description = TableDescription {
            format: "CSV",
            recognised: dialect.recognised.clone(),
            columns: dialect.columns.iter().map(|column| column.column.clone()).collect(),
            rows: None,
            evidence: dialect.evidence,
            left_out: Vec::new(),
            protection: crate::table::protection(&[]),
        };
        Self {
            input,
            description,
            uses: vec![CellUse::default(); dialect.text.cells],
            wanted: Vec::new(),
            values: Vec::new(),
            labels: Vec::new(),
            times: TimeReader::new(TimeUnit::SECOND, None),
            label_cells: Vec::new(),
            column_of,
            line: dialect.first_row_line,
            record: RecordPlace::new(1),
            blank: (0, 0),
            empty: (0, 0),
            end_is_told: false,
            later: LaterWaveforms::default(),
            split: Split::default(),
            cells: CellReader::default(),
            numbers: Vec::new(),
            stretches: Vec::new(),
            dialect,
        }
    }

    /// Where the values of a column come from; of one that is not there from a cell that no row has.
    fn origin(&self, column: usize) -> ColumnOrigin {
        self.dialect.columns.get(column).map_or(ColumnOrigin::Cell(usize::MAX), |column| column.origin)
    }

    /// Where the numbers of a column come from, which count this unit; the cell is that among those that are read as numbers.
    fn value(&self, column: usize, unit: TimeUnit) -> ColumnOrigin {
        let number_of = |cell: usize| self.uses.iter().take(cell).filter(|usage| usage.is_number()).count();
        let (decimal, factor) = (10_f64.powi(unit.power), f64::from(unit.factor));
        match self.origin(column) {
            ColumnOrigin::Cell(cell) | ColumnOrigin::Later { cell, .. } => {
                ColumnOrigin::Cell(number_of(cell))
            }
            ColumnOrigin::Affine { cell, start, step } => {
                let (start, step) = (start * decimal * factor, step * factor);
                ColumnOrigin::Affine { cell: number_of(cell), start, step }
            }
            ColumnOrigin::Counted { start, step } => {
                ColumnOrigin::Counted { start: start * decimal * factor, step: step * decimal * factor }
            }
            ColumnOrigin::Record => ColumnOrigin::Record,
        }
    }

    /// Reads rows as they usually are: as many cells as there should be, and numbers where they should be. `BLANK`: any number
    /// of blanks separates the cells.
    fn quick_rows<const BLANK: bool>(&mut self, block: &mut Block) -> RowOutcome {
        // A row after blank lines is told differently.
        if self.blank.1 > 0 || self.empty.1 > 0 || self.dialect.text.named_cells {
            return RowOutcome::On;
        }
        // The first time, of a row that is one, says where they count from.
        if !self.settle_times() {
            return RowOutcome::On;
        }
        let text = self.input.lines();
        let mut place = 0;
        let headed = matches!(self.dialect.text.records, RecordShape::Headed(_));
        let record_rows = self.dialect.text.record_rows();
        while block.rows < block.capacity {
            // A header between records begins with a word, in what may be a cell that is not read.
            if headed && text.get(place).is_some_and(u8::is_ascii_alphabetic) {
                break;
            }
            let next = quick_row::<BLANK>(
                text,
                place,
                &self.dialect,
                &self.uses,
                (&mut self.numbers, &mut self.times),
                &mut self.stretches,
            );
            let Some(next) = next else { break };
            place = next;
            let stretch = |cell: usize| {
                let of = self.label_cells.iter().position(|label| *label == cell)?;
                let (start, end) = self.stretches.get(of).copied()?;
                text.get(start..end).map(<[u8]>::trim_ascii)
            };
            let sources = (&self.values[..], &self.labels[..]);
            let cell = |cell: usize| stretch(cell).unwrap_or_default();
            push_row(block, (&self.numbers, self.line), sources, &self.record, cell);
            self.record.next_row(record_rows);
            self.line += 1;
        }
        self.input.take(place);
        if block.rows < block.capacity { RowOutcome::On } else { RowOutcome::Full }
    }

    /// Whether it is known where the times count from, if there are any. Those that are plain numbers are read as such from
    /// then on.
    fn settle_times(&mut self) -> bool {
        let mut is_settled = true;
        for usage in self.uses.iter_mut().filter(|usage| usage.time) {
            if self.times.is_plain() {
                (usage.power, usage.time) = (Some(self.times.power()), false);
                usage.limit = f64::INFINITY;
            }
            is_settled = self.times.origin().is_some();
        }
        is_settled
    }

    /// Reads one row of any kind.
    fn slow_row(&mut self, block: &mut Block) -> Result<RowOutcome> {
        let extent = loop {
            let text = self.input.lines();
            if !text.is_empty()
                && let Some(extent) = self.split.row(text, self.dialect.text.separator, self.input.ended())
            {
                break extent;
            }
            if !self.input.more()? {
                if self.input.lines().is_empty() {
                    return Ok(RowOutcome::End);
                }
                // An open quote takes all that is left.
                break self
                    .split
                    .row(self.input.lines(), self.dialect.text.separator, true)
                    .unwrap_or_default();
            }
        };
        let lines = 1 + extent.inside;
        if self.pass_header()? {
            return Ok(RowOutcome::On);
        }
        if self.is_blank() {
            self.blank = (if self.blank.1 == 0 { self.line } else { self.blank.0 }, self.blank.1 + lines);
        } else if self.split.iter().all(<[u8]>::is_empty) {
            self.empty = (if self.empty.1 == 0 { self.line } else { self.empty.0 }, self.empty.1 + 1);
        } else if !self.take_empty_rows(block) || !self.take_blank_lines(block) {
            return Ok(RowOutcome::Full);
        } else if !self.dialect.text.fits(&self.split) {
            self.leave_out(block);
        } else if block.rows == block.capacity {
            return Ok(RowOutcome::Full);
        } else {
            self.take_row(block);
        }
        self.input.take(extent.bytes);
        self.line += lines;
        Ok(RowOutcome::On)
    }

    /// Whether the row that is split has nothing in it, not even as many empty cells as a row has.
    fn is_blank(&self) -> bool {
        let headed = matches!(self.dialect.text.records, RecordShape::Headed(_));
        let is_row = !headed && self.dialect.text.fits(&self.split);
        self.split.is_blank() || !is_row && self.split.iter().all(<[u8]>::is_empty)
    }

    /// Passes over a header between records, if the row that is split is the first line of one.
    fn pass_header(&mut self) -> Result<bool> {
        let RecordShape::Headed(heading) = self.dialect.text.records else { return Ok(false) };
        if !Heading::begins(self.split.cell(0)) {
            return Ok(false);
        }
        let channels = loop {
            if let Some(channels) = heading.next(self.input.lines(), self.line, self.input.ended())? {
                break channels;
            }
            self.input.more()?;
        };
        let (origins, bytes, lines) = channels.continue_with(&self.dialect.columns, self.input.lines())?;
        for (column, origin) in self.dialect.columns.iter_mut().zip(origins) {
            column.origin = origin;
        }
        self.bind();
        self.input.take(bytes);
        self.line += lines;
        self.blank = (0, 0);
        self.record.begin_next();
        Ok(true)
    }

    /// Tells that the last line has no end, once.
    fn tell_open_end(&mut self, block: &mut Block) {
        // A line with nothing in it holds no number that could be cut.
        let row = self.line > self.dialect.first_row_line && self.blank.1 == 0;
        if self.input.open_end() && row && !self.end_is_told {
            self.end_is_told = true;
            block.faults.push(CellFault::of_line(block.rows, self.line - 1, CellFinding::NoLineEnd));
        }
    }

    /// Finds where the wanted values come from.
    fn bind(&mut self) {
        self.values.clear();
        self.labels.clear();
        for want in &self.wanted {
            match *want {
                WantedColumn::Number { column, power } => {
                    self.values.push(self.value(column, TimeUnit::decimal(power)));
                }
                WantedColumn::Time { column, unit, .. } => self.values.push(self.value(column, unit)),
                WantedColumn::Label { column } => self.labels.push(self.origin(column)),
            }
        }
    }

    /// Takes the rows of empty cells before a row, each of which is a row without values; `false` where the block is full.
    fn take_empty_rows(&mut self, block: &mut Block) -> bool {
        let (line, count) = self.empty;
        self.empty = self.take_rows_of_nothing(block, line, count);
        self.empty.1 == 0
    }

    /// Takes rows with nothing in them before the row that is split; the line of the first that the block has no room for, and how many.
    fn take_rows_of_nothing(&mut self, block: &mut Block, line: u64, mut count: u64) -> (u64, u64) {
        if count == 0 {
            return (line, 0);
        }
        let after = std::mem::replace(&mut self.line, line);
        let row = std::mem::take(&mut self.split);
        while count > 0 && block.rows < block.capacity {
            self.take_row(block);
            self.line += 1;
            count -= 1;
        }
        self.split = row;
        (std::mem::replace(&mut self.line, after), count)
    }

    /// Tells of the blank lines before a row; `false` where they are rows and the block is full.
    fn take_blank_lines(&mut self, block: &mut Block) -> bool {
        let (line, count) = self.blank;
        // In a text with one column a blank line is a row with an empty cell.
        if self.dialect.text.cells == 1 {
            self.blank = self.take_rows_of_nothing(block, line, count);
            return self.blank.1 == 0;
        }
        if count > 0 {
            let before = |fault: &mut CellFinding| match fault {
                CellFinding::BlankLines { count: before } => {
                    *before += count;
                    true
                }
                _ => false,
            };
            tell_together(block, line, before, CellFinding::BlankLines { count });
            self.blank = (0, 0);
        }
        true
    }

    /// Tells of a row with another number of cells; several before one row are told together.
    fn leave_out(&self, block: &mut Block) {
        let before = |fault: &mut CellFinding| match fault {
            CellFinding::CellCount { rows, .. } => {
                *rows += 1;
                true
            }
            _ => false,
        };
        let (found, expected) = (self.split.len(), self.dialect.text.cells);
        tell_together(block, self.line, before, CellFinding::CellCount { found, expected, rows: 1 });
    }

    /// Takes the row that is split, cell by cell.
    fn take_row(&mut self, block: &mut Block) {
        self.numbers.clear();
        for (index, usage) in self.uses.iter_mut().enumerate() {
            let cell = self.split.cell(index);
            let cell = if self.dialect.text.named_cells { marks::behind_name(cell) } else { cell };
            let number = match usage.power {
                Some(power) => self.cells.read_in_groups(cell, self.dialect.point, power, &mut usage.groups),
                None if usage.time => self.times.cell(cell, self.dialect.point),
                None => continue,
            };
            self.numbers.push(number.unwrap_or_else(|fault| {
                let column = self.column_of.get(index).copied().flatten();
                block.faults.push(CellFault { row: block.rows, line: self.line, column, fault });
                f64::NAN
            }));
        }
        let sources = (&self.values[..], &self.labels[..]);
        push_row(block, (&self.numbers, self.line), sources, &self.record, |cell| self.split.cell(cell));
        self.record.next_row(self.dialect.text.record_rows());
    }
}

impl Table for CsvTable {
    fn description(&self) -> &TableDescription {
        &self.description
    }

    fn header_line(&self) -> u64 {
        self.dialect.text.header_line
    }

    fn want(&mut self, wanted: &[WantedColumn]) -> Result<()> {
        let columns = wanted.iter().filter_map(|want| self.description.columns.get(want.column()));
        refuse_apart(self.description.format, columns)?;
        let (later, all) = LaterWaveforms::of(wanted, &self.dialect)?;
        self.later = later;
        self.uses.fill(CellUse::default());
        for want in &all {
            let cell = self.origin(want.column()).cell();
            let usage = cell.and_then(|cell| self.uses.get_mut(cell));
            match (want, usage) {
                (WantedColumn::Number { power, .. }, Some(usage)) => {
                    (usage.power, usage.limit) = (Some(*power), sentinels::limit(*power));
                    usage.groups.are_sure = cell.is_some_and(|cell| self.dialect.grouped.contains(&cell));
                }
                // The header's own clock counts from where it says.
                (WantedColumn::Time { column, unit, .. }, Some(usage)) => {
                    let origin = self.dialect.columns.get(*column).map(|column| column.origin);
                    if matches!(origin, Some(ColumnOrigin::Affine { .. })) {
                        (usage.power, usage.limit) = (Some(unit.power), f64::INFINITY);
                    } else {
                        usage.time = true;
                    }
                }
                (WantedColumn::Label { .. }, Some(usage)) => usage.label = true,
                (_, None) => {}
            }
        }
        self.wanted = all;
        self.bind();
        if let Some((column, unit, origin)) = WantedColumn::time(wanted, self.description.format)? {
            self.times = match self.time_kind(column) {
                Some(_) => TimeReader::of_iso(origin),
                None => TimeReader::new(unit, origin),
            };
        }
        let label = |(index, usage): (usize, &CellUse)| usage.label.then_some(index);
        self.label_cells = self.uses.iter().enumerate().filter_map(label).collect();
        Ok(())
    }

    fn read(&mut self, block: &mut Block) -> Result<()> {
        block.clear(self.values.len(), self.labels.len());
        let read = self.rows_into(block);
        if read.is_ok() && !self.later.is_none() {
            // Behind the last row of the text stand values of waveforms that began later.
            if block.is_end() {
                for _ in 0..self.later.rows_behind(block.capacity) {
                    self.numbers.fill(f64::NAN);
                    let sources = (&self.values[..], &self.labels[..]);
                    push_row(block, (&self.numbers, self.line), sources, &self.record, |_| b"");
                    self.line += 1;
                    self.record.next_row(None);
                }
                self.later.leave_out_others(block);
            }
            self.later.shift(block)?;
        }
        block.set_times(&self.times);
        read
    }

    fn time_kind(&self, column: usize) -> Option<TimeKind> {
        self.dialect.columns.get(column)?.time
    }

    fn progress(&self) -> (u64, u64) {
        self.input.progress()
    }

    fn digest(&mut self) -> Option<Digest> {
        self.input.digest()
    }
}

impl CsvTable {
    /// Reads rows until the block is full.
    fn rows_into(&mut self, block: &mut Block) -> Result<()> {
        let (begin, _) = self.input.progress();
        let blanks = self.dialect.text.separator == BLANKS;
        loop {
            let step = if blanks { self.quick_rows::<true>(block) } else { self.quick_rows::<false>(block) };
            if matches!(step, RowOutcome::Full) {
                return Ok(());
            }
            match self.slow_row(block)? {
                RowOutcome::On => {}
                RowOutcome::Full => return Ok(()),
                RowOutcome::End => {
                    let (line, count) = std::mem::take(&mut self.empty);
                    if count > 0 {
                        let blank = CellFinding::BlankLines { count };
                        block.faults.push(CellFault::of_line(block.rows, line, blank));
                    }
                    self.tell_open_end(block);
                    return Ok(());
                }
            }
            let something = block.rows > 0 || !block.faults.is_empty();
            if something && self.input.progress().0 - begin > BYTES_PER_BLOCK {
                return Ok(());
            }
        }
    }
}

/// Adds a fault of a line before the next row to one of its kind that is told there, or tells it. `add` says whether it was added.
fn tell_together(block: &mut Block, line: u64, add: impl Fn(&mut CellFinding) -> bool, fault: CellFinding) {
    let row = block.rows;
    let mut same = block.faults.iter_mut().rev().take_while(|fault| fault.row == row);
    if !same.any(|told| add(&mut told.fault)) {
        block.faults.push(CellFault::of_line(row, line, fault));
    }
}

/// Reads the row at `place` into `numbers` and the places of its labels; where the next row begins. `None` where the row
/// needs a closer look. `BLANK`: any number of blanks separates the cells.
#[inline]
fn quick_row<const BLANK: bool>(
    text: &[u8],
    mut place: usize,
    dialect: &Dialect,
    uses: &[CellUse],
    (numbers, times): (&mut Vec<f64>, &mut TimeReader),
    labels: &mut Vec<(usize, usize)>,
) -> Option<usize> {
    numbers.clear();
    labels.clear();
    let separator = dialect.text.separator;
    for (index, usage) in uses.iter().enumerate() {
        if BLANK {
            let before = place;
            place = skip_blanks(text, place);
            if index > 0 && place == before {
                return None;
            }
        } else if index > 0 {
            if *text.get(place)? != separator {
                return None;
            }
            place += 1;
        }
        let start = place;
        if let Some(power) = usage.power {
            place = skip_spaces(text, place);
            let (number, end) = quick(text, place, dialect.point, power)?;
            if number.abs() >= usage.limit {
                return None;
            }
            numbers.push(number);
            place = if BLANK { end } else { skip_spaces(text, end) };
        } else if usage.time {
            place = skip_spaces(text, place);
            let (time, end) = times.quick(text, place, separator, dialect.point)?;
            numbers.push(time);
            place = if BLANK { end } else { skip_spaces(text, end) };
        } else {
            let rest = text.get(place..)?;
            if rest.first() == Some(&b'"') {
                return None;
            }
            place += if BLANK {
                memchr::memchr3(b' ', b'\t', b'\n', rest)?
            } else {
                memchr::memchr2(separator, b'\n', rest)?
            };
            // It could be a blank line, or end before this cell.
            if uses.len() == 1 && place <= start + 1 || BLANK && place == start {
                return None;
            }
        }
        if usage.label {
            labels.push((start, place));
        }
    }
    if BLANK {
        place = skip_blanks(text, place);
    }
    let end = *text.get(place)?;
    if end == b'\n' {
        return Some(place + 1);
    }
    if end == separator && dialect.text.trailing {
        place += 1;
    }
    place += usize::from(*text.get(place)? == b'\r');
    (*text.get(place)? == b'\n').then_some(place + 1)
}

#[inline]
fn skip_spaces(text: &[u8], mut place: usize) -> usize {
    while text.get(place) == Some(&b' ') {
        place += 1;
    }
    place
}

#[inline]
fn skip_blanks(text: &[u8], mut place: usize) -> usize {
    while let Some(b' ' | b'\t' | b'\r') = text.get(place) {
        place += 1;
    }
    place
}

/// Adds a row, whose numbers were read in a line, with what the wanted columns of numbers and of labels come from.
#[inline]
fn push_row<'a>(
    block: &mut Block,
    (numbers, line): (&[f64], u64),
    (values, labels): (&[ColumnOrigin], &[ColumnOrigin]),
    record: &'a RecordPlace,
    cell: impl Fn(usize) -> &'a [u8],
) {
    let number = |cell: usize| numbers.get(cell).copied().unwrap_or(f64::NAN);
    for (column, value) in block.numbers.iter_mut().zip(values) {
        column.push(match *value {
            ColumnOrigin::Cell(cell) | ColumnOrigin::Later { cell, .. } => number(cell),
            ColumnOrigin::Affine { cell, start, step } => start + number(cell) * step,
            ColumnOrigin::Counted { start, step } => start + record.row as f64 * step,
            ColumnOrigin::Record => record.number as f64,
        });
    }
    for (runs, label) in block.labels.iter_mut().zip(labels) {
        let label = match *label {
            ColumnOrigin::Cell(index) | ColumnOrigin::Affine { cell: index, .. } => cell(index),
            ColumnOrigin::Record => &record.label,
            // What is computed has none, and what begins later is refused by `want`.
            ColumnOrigin::Later { .. } | ColumnOrigin::Counted { .. } => b"",
        };
        push_label(runs, block.rows, label);
    }
    if block.line_of(block.rows) != Some(line) {
        block.lines.push((block.rows, line));
    }
    block.rows += 1;
}

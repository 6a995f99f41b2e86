//! A text as a table.

use super::cell::Cells;
use super::dialect::{Dialect, DialectColumn, Origin};
use super::input::Input;
use super::number::quick;
use super::split::Split;
use crate::{
    Block, CellFault, Description, Digest, Fault, FormatError, Table, TimeKind, TimeReader, TimeUnit, Wanted,
};

/// As much text is gone through for one block, so that a block does not take long where rows are left out.
const BYTES_PER_BLOCK: u64 = 16 << 20;

/// What is done with a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Use {
    /// Read as a number, times this power of ten.
    power: Option<i32>,
    /// Read as a time, among the numbers.
    time: bool,
    /// Kept as a label.
    label: bool,
}

impl Use {
    /// Whether it is among the numbers.
    const fn is_number(self) -> bool {
        self.power.is_some() || self.time
    }
}

/// Where the numbers of a wanted column come from.
#[derive(Clone, Copy, Debug)]
enum Value {
    /// The cell with this number among those that are read as numbers.
    Cell(usize),
    /// That cell times a step after a start.
    Affine { cell: usize, start: f64, step: f64 },
    /// Rows, counted from 0, times a step after a start.
    Counted { start: f64, step: f64 },
}

pub(super) struct CsvTable {
    input: Input,
    dialect: Dialect,
    description: Description,
    /// One for each cell of a row.
    uses: Vec<Use>,
    /// One for each wanted column of numbers, and the cells of the wanted columns of labels.
    values: Vec<Value>,
    labels: Vec<usize>,
    /// Reads the cells that are times.
    times: TimeReader,
    /// The cells that are labels, in their order.
    label_cells: Vec<usize>,
    /// The column of the description that each cell is; none for those that are no column.
    column_of: Vec<Option<usize>>,
    /// The line of the next row, the rows so far, and blank lines before the next row: the first and how many.
    line: u64,
    rows: u64,
    blank: (u64, u64),
    /// Memory that is used again.
    split: Split,
    cells: Cells,
    numbers: Vec<f64>,
    stretches: Vec<(usize, usize)>,
}

/// What became of a piece of text.
enum Step {
    /// It was gone through.
    On,
    /// The block is full.
    Full,
    /// There is no more.
    End,
}

impl CsvTable {
    pub(super) fn new(input: Input, dialect: Dialect) -> Self {
        let mut column_of = vec![None; dialect.cells];
        for (index, column) in dialect.columns.iter().enumerate() {
            if let Some(of) = column.origin.cell().and_then(|cell| column_of.get_mut(cell)) {
                *of = Some(index);
            }
        }
        let description = Description {
            format: "CSV",
            recognised: dialect.recognised.clone(),
            columns: dialect.columns.iter().map(|column| column.column.clone()).collect(),
            rows: None,
        };
        Self {
            input,
            description,
            uses: vec![Use::default(); dialect.cells],
            values: Vec::new(),
            labels: Vec::new(),
            times: TimeReader::new(TimeUnit::SECOND, None),
            label_cells: Vec::new(),
            column_of,
            line: dialect.first_row_line,
            rows: 0,
            blank: (0, 0),
            split: Split::default(),
            cells: Cells::default(),
            numbers: Vec::new(),
            stretches: Vec::new(),
            dialect,
        }
    }

    fn origin(&self, column: usize) -> Option<Origin> {
        self.dialect.columns.get(column).map(|column| column.origin)
    }

    /// Where the numbers of a column come from, which count this unit.
    fn value(&self, column: usize, unit: TimeUnit) -> Value {
        let number_of = |cell: usize| self.uses.iter().take(cell).filter(|usage| usage.is_number()).count();
        let (decimal, factor) = (10_f64.powi(unit.power), f64::from(unit.factor));
        match self.origin(column) {
            Some(Origin::Cell(cell)) => Value::Cell(number_of(cell)),
            Some(Origin::Affine { cell, start, step }) => {
                Value::Affine { cell: number_of(cell), start: start * decimal * factor, step: step * factor }
            }
            Some(Origin::Counted { start, step }) => {
                Value::Counted { start: start * decimal * factor, step: step * decimal * factor }
            }
            // A column that is not there has no numbers.
            None => Value::Cell(usize::MAX),
        }
    }

    /// Reads rows as they usually are: as many cells as there should be, and numbers where they should be.
    fn quick_rows(&mut self, block: &mut Block) -> Step {
        // A row after blank lines is told differently.
        if self.blank.1 > 0 {
            return Step::On;
        }
        // The first time, of a row that is one, says where they count from.
        if !self.settle_times() {
            return Step::On;
        }
        let text = self.input.lines();
        let mut place = 0;
        while block.rows < block.capacity {
            let next = quick_row(
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
            push_row(block, &self.numbers, &self.values, self.rows);
            push_labels(block, &self.labels, |cell| stretch(cell).unwrap_or_default());
            push_line(block, self.line);
            block.rows += 1;
            self.rows += 1;
            self.line += 1;
        }
        self.input.take(place);
        if block.rows < block.capacity { Step::On } else { Step::Full }
    }

    /// Whether it is known where the times count from, if there are any. Those that are plain numbers are read as such from
    /// then on.
    fn settle_times(&mut self) -> bool {
        let Some(usage) = self.uses.iter_mut().find(|usage| usage.time) else { return true };
        if self.times.is_plain() {
            (usage.power, usage.time) = (Some(self.times.power()), false);
        }
        self.times.origin().is_some()
    }

    /// Reads one row of any kind.
    fn slow_row(&mut self, block: &mut Block) -> Result<Step, FormatError> {
        let extent = loop {
            let text = self.input.lines();
            if !text.is_empty()
                && let Some(extent) = self.split.row(text, self.dialect.separator, self.input.ended())
            {
                break extent;
            }
            if !self.input.more()? {
                if self.input.lines().is_empty() {
                    return Ok(Step::End);
                }
                // An open quote takes all that is left.
                break self.split.row(self.input.lines(), self.dialect.separator, true).unwrap_or_default();
            }
        };
        let lines = 1 + extent.inside;
        if self.split.is_blank() {
            self.blank = (if self.blank.1 == 0 { self.line } else { self.blank.0 }, self.blank.1 + lines);
        } else if !self.take_blank_lines(block) {
            return Ok(Step::Full);
        } else if !self.dialect.fits(&self.split) {
            self.leave_out(block);
        } else if block.rows == block.capacity {
            return Ok(Step::Full);
        } else {
            self.take_row(block);
        }
        self.input.take(extent.bytes);
        self.line += lines;
        Ok(Step::On)
    }

    /// Tells of the blank lines before a row; `false` where they are rows and the block is full.
    fn take_blank_lines(&mut self, block: &mut Block) -> bool {
        let (line, count) = self.blank;
        // In a text with one column a blank line is a row with an empty cell.
        if self.dialect.cells == 1 && count > 0 {
            let after = std::mem::replace(&mut self.line, line);
            let row = std::mem::take(&mut self.split);
            while self.blank.1 > 0 && block.rows < block.capacity {
                self.take_row(block);
                self.line += 1;
                self.blank = (self.line, self.blank.1 - 1);
            }
            self.split = row;
            self.line = after;
            return self.blank.1 == 0;
        }
        if count > 0 {
            let row = block.rows;
            let same = block.faults.iter_mut().rev().take_while(|f| f.row == row);
            let same = same.filter_map(|f| {
                if let Fault::BlankLines { count } = &mut f.fault { Some(count) } else { None }
            });
            match same.last() {
                Some(before) => *before += count,
                None => block.faults.push(CellFault {
                    row,
                    line,
                    column: None,
                    fault: Fault::BlankLines { count },
                }),
            }
            self.blank = (0, 0);
        }
        true
    }

    /// Tells of a row with another number of cells; several before one row are told together.
    fn leave_out(&self, block: &mut Block) {
        let row = block.rows;
        let same = block.faults.iter_mut().rev().take_while(|f| f.row == row);
        let same = same
            .filter_map(|f| if let Fault::CellCount { rows, .. } = &mut f.fault { Some(rows) } else { None });
        match same.last() {
            Some(rows) => *rows += 1,
            None => block.faults.push(CellFault {
                row,
                line: self.line,
                column: None,
                fault: Fault::CellCount { found: self.split.len(), expected: self.dialect.cells, rows: 1 },
            }),
        }
    }

    /// Takes the row that is split, cell by cell.
    fn take_row(&mut self, block: &mut Block) {
        self.numbers.clear();
        for (index, usage) in self.uses.iter().enumerate() {
            let cell = self.split.cell(index);
            let number = match usage.power {
                Some(power) => self.cells.read(cell, self.dialect.point, power),
                None if usage.time => self.times.cell(cell, self.dialect.point),
                None => continue,
            };
            self.numbers.push(number.unwrap_or_else(|fault| {
                let column = self.column_of.get(index).copied().flatten();
                block.faults.push(CellFault { row: block.rows, line: self.line, column, fault });
                f64::NAN
            }));
        }
        push_row(block, &self.numbers, &self.values, self.rows);
        push_labels(block, &self.labels, |cell| self.split.cell(cell));
        push_line(block, self.line);
        block.rows += 1;
        self.rows += 1;
    }
}

impl Table for CsvTable {
    fn description(&self) -> &Description {
        &self.description
    }

    fn header_line(&self) -> u64 {
        self.dialect.header_line
    }

    fn want(&mut self, wanted: &[Wanted]) -> Result<(), FormatError> {
        self.uses.fill(Use::default());
        self.values.clear();
        self.labels.clear();
        for want in wanted {
            let cell = self.origin(want.column()).and_then(Origin::cell);
            let usage = cell.and_then(|cell| self.uses.get_mut(cell));
            match (want, usage) {
                (Wanted::Number { power, .. }, Some(usage)) => usage.power = Some(*power),
                // The header's own clock counts from where it says.
                (Wanted::Time { column, unit, .. }, Some(usage)) => match self.dialect.columns.get(*column) {
                    Some(DialectColumn { origin: Origin::Cell(_), .. }) => usage.time = true,
                    _ => usage.power = Some(unit.power),
                },
                (Wanted::Label { .. }, Some(usage)) => usage.label = true,
                (_, None) => {}
            }
        }
        for want in wanted {
            match *want {
                Wanted::Number { column, power } => {
                    let value = self.value(column, TimeUnit::decimal(power));
                    self.values.push(value);
                }
                Wanted::Time { column, unit, .. } => {
                    let value = self.value(column, unit);
                    self.values.push(value);
                }
                Wanted::Label { column } => {
                    self.labels.push(self.origin(column).and_then(Origin::cell).unwrap_or(usize::MAX));
                }
            }
        }
        if let Some((column, unit, origin)) = Wanted::time(wanted, self.description.format)? {
            self.times = match self.time_kind(column) {
                Some(_) => TimeReader::of_iso(origin),
                None => TimeReader::new(unit, origin),
            };
        }
        let label = |(index, usage): (usize, &Use)| usage.label.then_some(index);
        self.label_cells = self.uses.iter().enumerate().filter_map(label).collect();
        Ok(())
    }

    fn read(&mut self, block: &mut Block) -> Result<(), FormatError> {
        block.clear(self.values.len(), self.labels.len());
        let read = self.rows_into(block);
        block.tell_times(&self.times);
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
    fn rows_into(&mut self, block: &mut Block) -> Result<(), FormatError> {
        let (begin, _) = self.input.progress();
        loop {
            if matches!(self.quick_rows(block), Step::Full) {
                return Ok(());
            }
            match self.slow_row(block)? {
                Step::On => {}
                Step::Full | Step::End => return Ok(()),
            }
            let something = block.rows > 0 || !block.faults.is_empty();
            if something && self.input.progress().0 - begin > BYTES_PER_BLOCK {
                return Ok(());
            }
        }
    }
}

/// Reads the row at `place` into `numbers` and the places of its labels; where the next row begins. `None` where the row
/// needs a closer look.
#[inline]
fn quick_row(
    text: &[u8],
    mut place: usize,
    dialect: &Dialect,
    uses: &[Use],
    (numbers, times): (&mut Vec<f64>, &mut TimeReader),
    labels: &mut Vec<(usize, usize)>,
) -> Option<usize> {
    numbers.clear();
    labels.clear();
    let separator = dialect.separator;
    for (index, usage) in uses.iter().enumerate() {
        if index > 0 {
            if *text.get(place)? != separator {
                return None;
            }
            place += 1;
        }
        let start = place;
        if let Some(power) = usage.power {
            place = skip_spaces(text, place);
            let (number, end) = quick(text, place, dialect.point, power)?;
            numbers.push(number);
            place = skip_spaces(text, end);
        } else if usage.time {
            place = skip_spaces(text, place);
            let (time, end) = times.quick(text, place, separator, dialect.point)?;
            numbers.push(time);
            place = skip_spaces(text, end);
        } else {
            let rest = text.get(place..)?;
            if rest.first() == Some(&b'"') {
                return None;
            }
            place += memchr::memchr2(separator, b'\n', rest)?;
            // It could be a blank line.
            if uses.len() == 1 && place <= start + 1 {
                return None;
            }
        }
        if usage.label {
            labels.push((start, place));
        }
    }
    let end = *text.get(place)?;
    if end == b'\n' {
        return Some(place + 1);
    }
    if end == separator && dialect.trailing {
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
fn push_row(block: &mut Block, numbers: &[f64], values: &[Value], row: u64) {
    for (column, value) in block.numbers.iter_mut().zip(values) {
        column.push(match *value {
            Value::Cell(cell) => numbers.get(cell).copied().unwrap_or(f64::NAN),
            Value::Affine { cell, start, step } => {
                start + numbers.get(cell).copied().unwrap_or(f64::NAN) * step
            }
            Value::Counted { start, step } => start + row as f64 * step,
        });
    }
}

#[inline]
fn push_labels<'a>(block: &mut Block, labels: &[usize], cell: impl Fn(usize) -> &'a [u8]) {
    for (runs, index) in block.labels.iter_mut().zip(labels) {
        let label = cell(*index);
        if runs.last().is_none_or(|(_, last)| last != label) {
            runs.push((block.rows, label.to_vec()));
        }
    }
}

#[inline]
fn push_line(block: &mut Block, line: u64) {
    if block.line_of(block.rows) != Some(line) {
        block.lines.push((block.rows, line));
    }
}

//! Arrays of NumPy: NPY (NEP 1, versions 1 to 3) and, in zip files, NPZ.

mod header;
mod literal;
mod zip;

use crate::records::{CellKind, RecordField, StoredCell};
use crate::source::SharedFile;
use crate::stated_clock::StatedNumbers;
use crate::stream::{FileStretch, StreamLane, VERIFIED_AT_ONCE};
use crate::table_parts::{StoredArray, TableParts, becomes_columns};
use crate::{Column, FormatError, Hints, Result, Table, limits};
use header::{Cell, Descr, NpyHeader};
use std::sync::Arc;

/// Opens a single array.
pub(crate) fn open_npy(source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    const FORMAT: &str = "NPY";
    let source = Arc::new(source);
    let file_bytes = source.length();
    let stretch = FileStretch::stored(source, FORMAT, "the file");
    let array = NpyArray::open(stretch, String::new())?;
    let mut table = TableParts::new(FORMAT);
    array.add_table(hints, &mut table)?;
    finish(table, file_bytes)
}

/// Opens the arrays of a zip file.
pub(crate) fn open_npz(source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    const FORMAT: &str = "NPZ";
    let source = Arc::new(source);
    let file_bytes = source.length();
    let mut table = TableParts::new(FORMAT);
    let mut arrays = Vec::new();
    for member in zip::members(&source)? {
        let Some(name) = member.name.strip_suffix(".npy") else {
            table.leave_out(member.name, "no array");
            continue;
        };
        if hints.group.as_deref().is_some_and(|wanted| wanted != name) {
            continue;
        }
        let name = name.to_owned();
        arrays.push(NpyArray::open(member.stretch(Arc::clone(&source))?, name)?);
    }
    if let Some(wanted) = &hints.group {
        let array = arrays.into_iter().next().ok_or_else(|| {
            let what = format!("an array `{wanted}`, which is not in the file,");
            FormatError::unsupported(FORMAT, what, "write the name of one that is")
        })?;
        array.add_table(hints, &mut table)?;
        return finish(table, file_bytes);
    }
    let (vectors, others): (Vec<_>, Vec<_>) = arrays.into_iter().partition(NpyArray::is_column);
    if vectors.is_empty() && others.len() == 1 {
        for array in others {
            array.add_table(hints, &mut table)?;
        }
    } else {
        let any = !vectors.is_empty();
        for array in vectors {
            let names = [array.name.clone()];
            array.add_columns(&names, &mut table)?;
        }
        for array in others {
            match array.names_beside().filter(|_| any) {
                Some(names) => array.add_columns(&names, &mut table)?,
                None if array.states_a_clock(&mut table.stated)? => {}
                None => table.leave_out(&array.name, array.shape()),
            }
        }
    }
    finish(table, file_bytes)
}

/// The table of all that was found.
fn finish(mut table: TableParts, file_bytes: u64) -> Result<Box<dyn Table>> {
    if table.recognised.is_empty() {
        table.recognised = format!("{} arrays, a column each", table.fields.len());
    }
    let remedy = "write one array for each column, or name a 2-D one by `group` and its columns by `columns`";
    table.finish(file_bytes, "arrays of one number", remedy)
}

/// An array whose header is read.
struct NpyArray {
    name: String,
    header: NpyHeader,
    stretch: FileStretch,
}

impl NpyArray {
    /// Reads the header and compares what it claims with the bytes that there are.
    fn open(stretch: FileStretch, name: String) -> Result<Self> {
        let format = stretch.format;
        let mut stream = stretch.stream();
        let header = NpyHeader::read(format, &stretch.name, |count| stream.next_bytes(count))?;
        let (count, bytes) = header.size(format)?;
        limits::plausible_rows(format, count, stretch.source.length())?;
        let there = stretch.unpacked.saturating_sub(header.bytes);
        // What is not read may have any length.
        let other = matches!(header.element, Descr::Plain(Cell::Other { .. }));
        if bytes != there && !other {
            let place = stretch.name.clone();
            let found = format!("{there} bytes after the header");
            let expected = format!("{bytes}, for the shape {}", shape_text(&header.shape));
            return Err(FormatError::damaged(format, place, found, expected));
        }
        let array = Self { name, header, stretch };
        // What is left out is left out by its header, which nobody compares later.
        if !array.is_column() || array.stretch.unpacked <= VERIFIED_AT_ONCE {
            array.stretch.verify()?;
        }
        Ok(array)
    }

    fn shape(&self) -> String {
        match &self.header.element {
            Descr::Plain(Cell::Other { what, .. }) => what.clone(),
            _ => format!("shape {}", shape_text(&self.header.shape)),
        }
    }

    /// One axis, but for others of one element.
    fn is_column(&self) -> bool {
        matches!(self.header.element, Descr::Plain(Cell::Stored(_)))
            && matches!(self.header.shape[..], [_] | [1, _] | [_, 1])
    }

    /// Whether it is a single number that states a clock.
    fn states_a_clock(&self, stated: &mut StatedNumbers) -> Result<bool> {
        match (&self.header.element, &self.header.shape[..]) {
            (Descr::Plain(Cell::Stored(StoredCell::Number(element))), [] | [1]) => {
                Ok(stated.learn(&self.name, self.stretch.number(self.header.bytes, *element)?))
            }
            _ => Ok(false),
        }
    }

    /// The names of the columns of two axes that stand beside arrays of one, as Python names them; none where it is no such
    /// array, or has many columns.
    fn names_beside(&self) -> Option<Vec<String>> {
        let Descr::Plain(Cell::Stored(StoredCell::Number(_))) = self.header.element else { return None };
        let [rows, columns] = self.header.shape[..] else { return None };
        becomes_columns(rows, columns)
            .then(|| (0..columns).map(|column| format!("{}[:,{column}]", self.name)).collect())
    }

    /// The array as a table: fields with names, or columns that are named in the experiment.
    fn add_table(self, hints: &Hints, table: &mut TableParts) -> Result<()> {
        let NpyHeader { shape, element, .. } = &self.header;
        let unsupported =
            |what: String, remedy: &str| FormatError::unsupported(self.stretch.format, what, remedy);
        match (element, shape.len()) {
            (Descr::Fields(fields), 1) => {
                table.recognised = format!("an array of {} rows with {} fields", shape[0], fields.len());
                let (lane, mut offset) = (table.lanes.len(), 0);
                for (name, cell) in fields {
                    match cell {
                        Cell::Stored(cell) => {
                            let cells = CellKind::Stored { lane, offset, cell: *cell };
                            table.fields.push(RecordField::new(Column::new(name), cells, shape[0]));
                        }
                        // Padding has no name.
                        Cell::Other { .. } if name.is_empty() => {}
                        Cell::Other { what, .. } => table.leave_out(name, what),
                    }
                    offset += cell.bytes();
                }
                let lane = StreamLane::new(self.stretch.clone(), self.header.bytes, offset);
                table.lanes.push(Box::new(lane));
                return Ok(());
            }
            (Descr::Plain(Cell::Stored(_)), 1 | 2) => {}
            _ => {
                let remedy = "write an array with rows along its first axis and columns along its second, or one with fields";
                return Err(unsupported(format!("an array of {}", self.shape()), remedy));
            }
        }
        let (rows, columns) = (shape[0], shape.get(1).copied().unwrap_or(1));
        let what = format!("an array of {rows} rows and {columns} columns");
        let names = table.names(hints, None, columns, &what)?;
        table.recognised = format!("{what}, named by the experiment");
        self.add_columns(&names, table)
    }

    /// The columns of an array of one or two axes.
    fn add_columns(&self, names: &[String], table: &mut TableParts) -> Result<()> {
        let Descr::Plain(Cell::Stored(cell)) = self.header.element else { return Ok(()) };
        let columns = (names.len() as u64).max(1);
        let rows = self.header.shape.iter().product::<u64>() / columns;
        let (stretch, place, by_column) = (&self.stretch, self.header.bytes, self.header.fortran);
        table.add_array(&StoredArray { stretch, place, rows, cell, by_column }, names)
    }
}

fn shape_text(shape: &[u64]) -> String {
    let lengths: Vec<String> = shape.iter().take(8).map(u64::to_string).collect();
    format!("({})", lengths.join(", "))
}

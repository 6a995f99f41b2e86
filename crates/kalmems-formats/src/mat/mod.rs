//! MAT files of version 4, and of version 5 to 7: variables, packed or not.

mod array;
mod version4;

use crate::cursor::ByteCursor;
use crate::element::Element;
use crate::lanes::TextLane;
use crate::records::{CellKind, StoredCell};
use crate::source::SharedFile;
use crate::stream::{Compression, FileStretch, VERIFIED_AT_ONCE};
use crate::table_parts::{StoredArray, TableParts, becomes_columns, only};
use crate::{Column, FormatError, Hints, Result, Table, limits};
use array::{COMPRESSED, Elements, FORMAT, MATRIX, MatValue, MatVariable, MemoryBudget};
use std::sync::Arc;

/// Bytes before the first variable.
const HEADER: u64 = 128;

/// What MATLAB needs to be told to write what others can read.
const TABLE_REMEDY: &str = "save `S = table2struct(T, ToScalar=true)` with `save(…, \"-struct\", \"S\")`";

pub(crate) use version4::begins as begins_as_four;

pub(crate) fn open(source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    let source = Arc::new(source);
    let mut head = [0; 128];
    let count = source.read_some(0, &mut head)?;
    let is_old = !head.ends_with(b"IM")
        && !head.ends_with(b"MI")
        && version4::begins(&source.bytes(FORMAT, 0, count as u64)?);
    let (format, found) = if is_old {
        (version4::FORMAT, version4::variables(&source)?)
    } else {
        (FORMAT, variables(&source)?)
    };
    let mut table = MatTable(TableParts::new(format));
    // What MATLAB keeps behind the variables for their objects has no name.
    let found = found.into_iter().filter(|(_, variable)| !variable.name.is_empty());
    let chosen = match &hints.group {
        Some(path) => Some((path.clone(), at_path(format, found.collect(), path)?)),
        None => table.add_variables(found)?,
    };
    match chosen {
        Some((path, (stretch, MatValue::Fields(fields)))) => {
            table.0.recognised = match &hints.group {
                Some(_) => format!("the fields of `{path}`, a column each"),
                None => format!("the fields of the only struct, `{path}`, a column each"),
            };
            fields.into_iter().try_for_each(|field| table.add(&stretch, field))?;
        }
        Some((name, (stretch, value))) => table.add_matrix(&stretch, &MatVariable { name, value }, hints)?,
        None => {}
    }
    let remedy = "save one vector for each column, or name a struct or matrix by `group`; a table becomes a struct by \
                  `table2struct(T, ToScalar=true)`";
    table.0.finish(source.length(), "variables of one number", remedy)
}

/// Variables with the stretches that they are in.
type MatVariables = Vec<(FileStretch, MatVariable)>;

/// A value that may be a table, with its path and the stretch that it is in.
type MatPlace = (String, (FileStretch, MatValue));

/// The structs with columns, in a value and in its fields.
fn within(stretch: &FileStretch, path: String, value: MatValue, places: &mut Vec<MatPlace>) {
    let MatValue::Fields(fields) = value else { return };
    if fields.iter().any(|field| is_column(&field.value)) {
        places.push((path, (stretch.clone(), MatValue::Fields(fields))));
        return;
    }
    for MatVariable { name, value } in fields {
        within(stretch, format!("{path}.{name}"), value, places);
    }
}

/// All variables, and the stretches that they are in.
fn variables(source: &Arc<SharedFile>) -> Result<MatVariables> {
    let header = source.bytes(FORMAT, 0, 128)?;
    let big_endian = match &header[124..128] {
        [1, 0, b'M', b'I'] => true,
        [0, 1, b'I', b'M'] => false,
        _ => {
            let found = format!("`{}`", header[124..128].escape_ascii());
            let expected = "version 0x0100 and the order of bytes, IM or MI";
            return Err(FormatError::damaged(FORMAT, "byte 124", found, expected));
        }
    };
    let mut budget = MemoryBudget { text_bytes: limits::HEADER_BYTES, arrays: 4 * limits::COLUMNS as u64 };
    let mut found = Vec::new();
    let mut at = HEADER;
    while at < source.length() {
        let tag = source.bytes(FORMAT, at, 8)?;
        let words = |tag: &[u8]| {
            let mut tag = ByteCursor::new(FORMAT, tag, at).with(0, big_endian);
            Ok::<_, FormatError>((tag.u32()?, u64::from(tag.u32()?)))
        };
        let (kind, bytes) = words(&tag)?;
        let start = at + 8;
        let end = source.within(FORMAT, start, bytes)?;
        let (packing, start) = match kind {
            MATRIX => (Compression::Stored, at),
            COMPRESSED => (Compression::Zlib, start),
            _ => {
                let found = format!("an element of type {kind}");
                let expected = "an array (14), or one that is packed (15)";
                return Err(FormatError::damaged_at(FORMAT, at, found, expected));
            }
        };
        let whole = FileStretch::stored(Arc::clone(source), FORMAT, &format!("the variable at byte {at}"));
        let mut stretch = FileStretch { packing, start, end, unpacked: end - start, ..whole };
        if packing == Compression::Zlib {
            // An array with its tag of eight bytes.
            stretch.unpacked = 8 + words(&stretch.stream().next_bytes(8)?)?.1;
        }
        let mut elements = Elements { stream: stretch.stream(), big_endian };
        let variable = elements.array(&mut budget)?;
        // Vectors are compared with their checksum when they are read; what is used or left out by its header, now.
        if !is_column(&variable.value) || stretch.unpacked <= VERIFIED_AT_ONCE {
            stretch.verify()?;
        }
        limits::push(FORMAT, "the number of variables", &mut found, (stretch, variable))?;
        at = end;
    }
    Ok(found)
}

/// The value of a variable, or of a struct's field: `rig`, `rig.run_1`.
fn at_path(format: &'static str, found: MatVariables, path: &str) -> Result<(FileStretch, MatValue)> {
    let missing = |name: &str| {
        let what = format!("`{name}` of `{path}`, which is not in the file,");
        FormatError::unsupported(format, what, "write the name of a variable that is, or `struct.field`")
    };
    let mut words = path.split('.');
    let first = words.next().unwrap_or_default();
    let (stretch, variable) =
        found.into_iter().find(|(_, variable)| variable.name == first).ok_or_else(|| missing(first))?;
    let mut value = variable.value;
    for word in words {
        let MatValue::Fields(fields) = value else { return Err(missing(word)) };
        value = fields.into_iter().find(|field| field.name == word).ok_or_else(|| missing(word))?.value;
    }
    Ok((stretch, value))
}

/// More than one value along one axis.
fn is_column(value: &MatValue) -> bool {
    match value {
        MatValue::Numbers { rows, columns, .. } => (*rows == 1) != (*columns == 1),
        MatValue::Texts(texts) => texts.len() > 1,
        MatValue::Fields(_) | MatValue::Other(_) | MatValue::Object(_) => false,
    }
}

/// A table of variables that is being put together.
struct MatTable(TableParts);

impl MatTable {
    /// Adds the variables as columns; if none is one, gives the only table among them, if there is one.
    fn add_variables(
        &mut self,
        found: impl Iterator<Item = (FileStretch, MatVariable)>,
    ) -> Result<Option<MatPlace>> {
        self.0.recognised.push_str("the variables, a column each");
        let found: MatVariables = found.collect();
        let mut places = Vec::new();
        if !found.iter().any(|(_, variable)| is_column(&variable.value)) {
            for (stretch, MatVariable { name, value }) in found {
                match value {
                    MatValue::Fields(_) => within(&stretch, name, value, &mut places),
                    MatValue::Numbers { rows: 2.., columns: 2.., .. } => {
                        places.push((name, (stretch, value)));
                    }
                    value => self.add(&stretch, MatVariable { name, value })?,
                }
            }
            return only(self.0.format, places);
        }
        found.into_iter().try_for_each(|(stretch, variable)| self.add(&stretch, variable))?;
        Ok(None)
    }

    /// A matrix beside vectors: its columns as MATLAB names them.
    fn add_beside(&mut self, stretch: &FileStretch, matrix: MatVariable) -> Result<()> {
        let MatVariable { name, value } = matrix;
        let MatValue::Numbers { place, element, rows, columns } = value else { return Ok(()) };
        if !becomes_columns(rows, columns) {
            let why = format!("{rows} × {columns}: name it by `group`, and its columns by `columns`");
            self.0.leave_out(name, why);
            return Ok(());
        }
        let names: Vec<String> = (1..=columns).map(|column| format!("{name}(:,{column})")).collect();
        self.add_columns(stretch, (place, element, rows), &names)
    }

    /// The columns of a matrix.
    fn add_columns(
        &mut self,
        stretch: &FileStretch,
        (place, element, rows): (u64, Element, u64),
        names: &[String],
    ) -> Result<()> {
        let cell = StoredCell::Number(element);
        self.0.add_array(&StoredArray { stretch, place, rows, cell, by_column: true }, names)
    }

    fn add(&mut self, stretch: &FileStretch, variable: MatVariable) -> Result<()> {
        if let MatValue::Numbers { rows: 2.., columns: 2.., .. } = variable.value {
            return self.add_beside(stretch, variable);
        }
        let MatVariable { name, value } = variable;
        let lane = self.0.lanes.len();
        let single = !is_column(&value);
        match value {
            MatValue::Numbers { place, element, rows, columns } if !single => {
                self.add_columns(stretch, (place, element, rows * columns), &[name])?;
            }
            MatValue::Texts(texts) if !single => {
                let (rows, texts) = (texts.len() as u64, TextLane { texts, next: 0 });
                self.0.add(Column::new(&name), CellKind::Texts { lane }, rows, Box::new(texts));
            }
            MatValue::Numbers { place, element, rows: 1, columns: 1 }
                if stretch.number(place, element).is_ok_and(|number| self.0.stated.learn(&name, number)) => {}
            MatValue::Numbers { rows, columns, .. } => {
                self.0.leave_out(name, format!("{rows} × {columns}"));
            }
            MatValue::Texts(_) => self.0.leave_out(name, "a single text"),
            MatValue::Fields(_) => self.0.leave_out(name, "a struct"),
            MatValue::Other(what) => self.0.leave_out(name, what),
            MatValue::Object(class) => {
                let remedy = match class.as_str() {
                    "table" | "timetable" => TABLE_REMEDY,
                    _ => "save its numbers as vectors",
                };
                self.0.leave_out(name, format!("a {class} of MATLAB: {remedy}"));
            }
        }
        Ok(())
    }

    /// A matrix whose columns the experiment names.
    fn add_matrix(&mut self, stretch: &FileStretch, matrix: &MatVariable, hints: &Hints) -> Result<()> {
        let format = self.0.format;
        let unsupported = |what: String, remedy: &str| FormatError::unsupported(format, what, remedy);
        let MatValue::Numbers { place, element, rows, columns } = matrix.value else {
            let what = format!("`{}`, which is no struct and no matrix of numbers,", matrix.name);
            return Err(unsupported(what, "write the name of one that is"));
        };
        let what = format!("the matrix `{}` of {rows} rows and {columns} columns", matrix.name);
        let names = self.0.names(hints, None, columns, &what)?;
        self.0.recognised = format!("the matrix `{}`, its columns named by the experiment", matrix.name);
        self.add_columns(stretch, (place, element, rows), &names)
    }
}

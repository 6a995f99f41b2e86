//! MAT files of version 5 to 7: variables, packed or not.

mod array;

use crate::lanes::Texts;
use crate::records::{Cells, Field, Lane, RecordTable};
use crate::source::Source;
use crate::stream::{Packing, StreamLane, Stretch};
use crate::{Column, FormatError, Hints, Table, limits};
use array::{Budget, COMPRESSED, Elements, FORMAT, MATRIX, Value, Variable};
use std::sync::Arc;

/// Bytes before the first variable.
const HEADER: u64 = 128;

pub(crate) fn open(source: Source, hints: &Hints) -> Result<Box<dyn Table>, FormatError> {
    let source = Arc::new(source);
    let file_bytes = source.length();
    let found = variables(&source)?;
    let mut table = Parts::default();
    let (mut columns, mut structs, mut matrices) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(path) = &hints.group {
        let (stretch, value) = at_path(found, path)?;
        match value {
            Value::Fields(fields) => {
                table.recognised = format!("the fields of `{path}`, a column each");
                columns.extend(fields.into_iter().map(|field| (stretch.clone(), field)));
            }
            value => matrices.push((stretch, Variable { name: path.clone(), value })),
        }
    } else {
        for (stretch, variable) in found {
            match &variable.value {
                Value::Fields(_) => structs.push((stretch, variable)),
                Value::Numbers { rows, columns, .. } if *rows > 1 && *columns > 1 => {
                    matrices.push((stretch, variable));
                }
                _ => columns.push((stretch, variable)),
            }
        }
        table.recognised.push_str("the variables, a column each");
        let any = columns.iter().any(|(_, variable)| is_column(&variable.value));
        if let (false, [_], []) = (any, &structs[..], &matrices[..]) {
            for (stretch, Variable { name, value }) in structs.drain(..) {
                let Value::Fields(fields) = value else { continue };
                table.recognised = format!("the fields of the only struct, `{name}`, a column each");
                columns.extend(fields.into_iter().map(|field| (stretch.clone(), field)));
            }
        }
    }
    let whole = hints.group.is_some() || (structs.is_empty() && matrices.len() == 1);
    if columns.iter().any(|(_, variable)| is_column(&variable.value)) || !whole {
        let others = structs.iter().chain(&matrices).map(|(_, variable)| format!("`{}`", variable.name));
        table.left_out.extend(others);
        for (stretch, variable) in columns {
            table.add(&stretch, variable);
        }
    } else {
        for (stretch, matrix) in matrices {
            table.add_matrix(&stretch, &matrix, hints)?;
        }
    }
    table.finish(file_bytes)
}

/// All variables, and the stretches that they are in.
fn variables(source: &Arc<Source>) -> Result<Vec<(Stretch, Variable)>, FormatError> {
    let header = source.bytes(FORMAT, 0, 128)?;
    let big_endian = match &header[124..128] {
        [1, 0, b'M', b'I'] => true,
        [0, 1, b'I', b'M'] => false,
        _ => {
            return Err(FormatError::Damaged {
                format: FORMAT,
                place: "byte 124".to_owned(),
                found: format!("`{}`", header[124..128].escape_ascii()),
                expected: "version 0x0100 and the order of bytes, IM or MI".to_owned(),
            });
        }
    };
    let mut budget = Budget { text_bytes: limits::HEADER_BYTES, arrays: 4 * limits::COLUMNS as u64 };
    let mut found = Vec::new();
    let mut at = HEADER;
    while at < source.length() {
        let tag = source.bytes(FORMAT, at, 8)?;
        let word = |b: &[u8]| {
            let bytes = [b[0], b[1], b[2], b[3]];
            if big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
        };
        let (kind, bytes) = (word(&tag), u64::from(word(&tag[4..])));
        let start = at + 8;
        let end = source.within(FORMAT, start, bytes)?;
        let (packing, start) = match kind {
            MATRIX => (Packing::Stored, at),
            COMPRESSED => (Packing::Zlib, start),
            _ => {
                return Err(FormatError::Damaged {
                    format: FORMAT,
                    place: format!("byte {at}"),
                    found: format!("an element of type {kind}"),
                    expected: "an array (14), or one that is packed (15)".to_owned(),
                });
            }
        };
        limits::at_most(FORMAT, "the number of variables", found.len() as u64, limits::COLUMNS as u64)?;
        let name = format!("the variable at byte {at}");
        let stretch =
            Stretch { source: Arc::clone(source), format: FORMAT, name, packing, start, end, crc: None };
        let mut elements = Elements { stream: stretch.stream(), big_endian };
        found.push((stretch, elements.array(&mut budget)?));
        at = end;
    }
    Ok(found)
}

/// The value of a variable, or of a struct's field: `rig`, `rig.run_1`.
fn at_path(found: Vec<(Stretch, Variable)>, path: &str) -> Result<(Stretch, Value), FormatError> {
    let missing = |name: &str| FormatError::Unsupported {
        format: FORMAT,
        what: format!("`{name}` of `{path}`, which is not in the file,"),
        remedy: "write the name of a variable that is, or `struct.field`".to_owned(),
    };
    let mut words = path.split('.');
    let first = words.next().unwrap_or_default();
    let (stretch, variable) =
        found.into_iter().find(|(_, variable)| variable.name == first).ok_or_else(|| missing(first))?;
    let mut value = variable.value;
    for word in words {
        let Value::Fields(fields) = value else { return Err(missing(word)) };
        value = fields.into_iter().find(|field| field.name == word).ok_or_else(|| missing(word))?.value;
    }
    Ok((stretch, value))
}

/// More than one value along one axis.
fn is_column(value: &Value) -> bool {
    match value {
        Value::Numbers { rows, columns, .. } => (*rows == 1) != (*columns == 1),
        Value::Texts(texts) => texts.len() > 1,
        Value::Fields(_) | Value::Other(_) => false,
    }
}

/// A table that is being put together.
#[derive(Default)]
struct Parts {
    recognised: String,
    left_out: Vec<String>,
    fields: Vec<Field>,
    lanes: Vec<Box<dyn Lane>>,
}

impl Parts {
    fn add(&mut self, stretch: &Stretch, variable: Variable) {
        let Variable { name, value } = variable;
        let column = Column::new(&name);
        let lane = self.lanes.len();
        let single = !is_column(&value);
        match value {
            Value::Numbers { place, element, rows, columns } if !single => {
                let rows = rows * columns;
                self.lanes.push(Box::new(StreamLane::new(stretch.clone(), place, element.bytes, rows)));
                self.fields.push(Field::new(column, Cells::Numbers { lane, offset: 0, element }, rows));
            }
            Value::Texts(texts) if !single => {
                let rows = texts.len() as u64;
                self.lanes.push(Box::new(Texts { texts, next: 0 }));
                self.fields.push(Field::new(column, Cells::Texts { lane }, rows));
            }
            Value::Numbers { rows, columns, .. } => {
                self.left_out.push(format!("`{name}` ({rows} × {columns})"));
            }
            Value::Texts(_) => self.left_out.push(format!("`{name}` (a single text)")),
            Value::Fields(_) => self.left_out.push(format!("`{name}` (a struct)")),
            Value::Other(what) => self.left_out.push(format!("`{name}` ({what})")),
        }
    }

    /// A matrix whose columns the experiment names.
    fn add_matrix(&mut self, stretch: &Stretch, matrix: &Variable, hints: &Hints) -> Result<(), FormatError> {
        let unsupported = |what: String, remedy: &str| FormatError::Unsupported {
            format: FORMAT,
            what,
            remedy: remedy.to_owned(),
        };
        let Value::Numbers { place, element, rows, columns } = matrix.value else {
            let what = format!("`{}`, which is no struct and no matrix of numbers,", matrix.name);
            return Err(unsupported(what, "write the name of one that is"));
        };
        let names = match &hints.columns {
            Some(names) if names.len() as u64 == columns => names,
            found => {
                let what = format!(
                    "the matrix `{}` of {rows} rows and {columns} columns with {} names",
                    matrix.name,
                    found.as_ref().map_or(0, Vec::len)
                );
                return Err(unsupported(what, "write as many names in `columns` as there are columns"));
            }
        };
        self.recognised = format!("the matrix `{}`, its columns named by the experiment", matrix.name);
        for (number, name) in names.iter().enumerate() {
            let lane = self.lanes.len();
            let skip = place + number as u64 * rows * element.bytes as u64;
            self.lanes.push(Box::new(StreamLane::new(stretch.clone(), skip, element.bytes, rows)));
            let column = Column::new(name).at(format!("column {}", number + 1));
            self.fields.push(Field::new(column, Cells::Numbers { lane, offset: 0, element }, rows));
        }
        Ok(())
    }

    fn finish(mut self, file_bytes: u64) -> Result<Box<dyn Table>, FormatError> {
        if self.fields.is_empty() {
            return Err(FormatError::Unsupported {
                format: FORMAT,
                what: format!("a file without a column of numbers or labels ({})", limits::list(&self.left_out)),
                remedy: "save one vector for each column, or name a struct or matrix by `group`; a table becomes a \
                         struct by `table2struct(T, ToScalar=true)`"
                    .to_owned(),
            });
        }
        if !self.left_out.is_empty() {
            self.recognised.push_str(&format!("; left out: {}", limits::list(&self.left_out)));
        }
        Ok(Box::new(RecordTable::new(FORMAT, self.recognised, self.fields, self.lanes, file_bytes)))
    }
}

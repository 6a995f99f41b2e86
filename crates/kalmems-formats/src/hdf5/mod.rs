//! HDF5, and MAT files of version 7.3, which are HDF5 with conventions of their own.
//!
//! Groups, types and the places of chunks are looked up by `hdf5-pure`; the values are read here, chunk by chunk, so
//! that memory is bounded by chunks and what they unpack to by their own length.

mod cf;
mod chunks;
mod filters;
mod kind;

use crate::lanes::{Stretch, Texts};
use crate::name::with_unit;
use crate::records::{Cells, Code, Field, Lane, RecordTable};
use crate::source::Source;
use crate::time::{TimeCode, TimeKind};
use crate::{Column, FormatError, Hints, Table, limits};
use chunks::{ChunkLane, Grid};
use filters::Filter;
use hdf5_pure::{AttrValue, Dataset, Datatype, Error, File, Group, Layout};
use kind::{Kind, kind};
use std::collections::HashMap;
use std::sync::Arc;

const FORMAT: &str = "HDF5";
const MAT: &str = "MAT 7.3";
/// Groups within one another that are looked into.
const DEPTH: usize = 8;
/// Groups and datasets that are looked at.
const OBJECTS: usize = 4096;
/// Elements of a dataset of texts of several lengths.
const TEXTS: usize = 1 << 18;

/// A place in the file for the library.
struct Bytes(Arc<Source>);

impl hdf5_pure::Source for Bytes {
    fn len(&self) -> u64 {
        self.0.length()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), hdf5_pure::FormatError> {
        self.0
            .read_exact(FORMAT, offset, buffer)
            .map_err(|error| hdf5_pure::FormatError::Source(error.to_string()))
    }
}

/// What the library says of an object.
fn failed(path: &str, error: &Error) -> FormatError {
    if let Error::Format(hdf5_pure::FormatError::InvalidLayoutVersion(version)) = error {
        return unsupported(
            format!("`{path}`, whose values are laid out by version {version} of the format,"),
            "write it for older libraries, as with h5repack --high=v114 or h5py.File(…, libver=(\"earliest\", \"v114\"))",
        );
    }
    FormatError::Damaged {
        format: FORMAT,
        place: path.to_owned(),
        found: error.to_string(),
        expected: "an HDF5 file that is whole".to_owned(),
    }
}

fn unsupported(what: String, remedy: &str) -> FormatError {
    FormatError::Unsupported { format: FORMAT, what, remedy: remedy.to_owned() }
}

pub(crate) fn open(source: Source, hints: &Hints) -> Result<Box<dyn Table>, FormatError> {
    let source = Arc::new(source);
    let mut head = [0; 10];
    let matlab = source.read_some(0, &mut head)? == 10 && head == *b"MATLAB 7.3";
    let file = File::from_source(Bytes(Arc::clone(&source))).map_err(|error| failed("the file", &error))?;
    let mut parts = Parts {
        source,
        matlab,
        recognised: String::new(),
        left_out: Vec::new(),
        fields: Vec::new(),
        lanes: Vec::new(),
    };
    match &hints.group {
        Some(path) => {
            if let Ok(group) = file.group(path) {
                parts.add_group(&group, path)?;
            } else {
                let dataset = file.dataset(path).map_err(|_| {
                    let what = format!("`{path}`, which is not in the file,");
                    unsupported(what, "write the path of a group or dataset")
                })?;
                parts.add_table(dataset, path, hints)?;
            }
        }
        None => parts.find(&file, hints)?,
    }
    parts.finish()
}

/// A table that is being put together.
struct Parts {
    source: Arc<Source>,
    matlab: bool,
    recognised: String,
    left_out: Vec<String>,
    fields: Vec<Field>,
    lanes: Vec<Box<dyn Lane>>,
}

/// A dataset with what is needed to read it.
struct Found {
    dataset: Dataset,
    path: String,
    attributes: HashMap<String, AttrValue>,
    shape: Vec<u64>,
    kind: Kind,
}

impl Parts {
    /// Takes the only table that there is.
    fn find(&mut self, file: &File, hints: &Hints) -> Result<(), FormatError> {
        let mut budget = OBJECTS;
        let mut places = Vec::new();
        walk(&file.root(), "", DEPTH, &mut budget, &mut places)?;
        let tables: Vec<&(String, bool)> = match places.iter().find(|(path, _)| path == "/") {
            Some(root) => vec![root],
            None => places.iter().collect(),
        };
        match tables[..] {
            [(path, true)] => {
                let group = file.group(path).map_err(|error| failed(path, &error))?;
                self.add_group(&group, path)
            }
            [(path, false)] => {
                let dataset = file.dataset(path).map_err(|error| failed(path, &error))?;
                self.add_table(dataset, path, hints)
            }
            [] => Err(unsupported(
                "a file without a column of numbers".to_owned(),
                "write one dataset of one axis for each column",
            )),
            _ => {
                let paths: Vec<String> = tables.iter().map(|(path, _)| format!("`{path}`")).collect();
                Err(unsupported(
                    "several tables at a time".to_owned(),
                    &format!("write `group` as one of {}", limits::list(&paths)),
                ))
            }
        }
    }

    /// The datasets of a group as columns.
    fn add_group(&mut self, group: &Group, path: &str) -> Result<(), FormatError> {
        self.recognised = if self.matlab && path == "/" {
            "the variables, a column each".to_owned()
        } else {
            format!("the datasets of `{path}`, a column each")
        };
        let names = group.datasets().map_err(|error| failed(path, &error))?;
        limits::at_most(
            FORMAT,
            &format!("the number of datasets in `{path}`"),
            names.len() as u64,
            OBJECTS as u64,
        )?;
        for name in names {
            let dataset = group.dataset(&name).map_err(|error| failed(&name, &error))?;
            let place = format!("{}/{name}", path.trim_end_matches('/'));
            let found = match look(dataset, &place) {
                Ok(found) => found,
                Err(FormatError::Damaged { found, .. }) => {
                    self.left_out.push(format!("`{name}` ({found})"));
                    continue;
                }
                Err(error) => return Err(error),
            };
            // One that cannot be read does not stand in the way of the others.
            let columns = self.fields.len();
            match self.add_column(found, name.clone()) {
                Ok(()) => {}
                Err(FormatError::Io(error)) => return Err(error.into()),
                Err(error) => {
                    self.fields.truncate(columns);
                    self.left_out.push(format!("`{name}` ({error})"));
                }
            }
        }
        Ok(())
    }

    fn add_column(&mut self, found: Found, name: String) -> Result<(), FormatError> {
        let characters = self.matlab && text_attribute(&found.attributes, "MATLAB_class") == Some("char");
        let counted = cf::time(unit(&found.attributes));
        let column = |name: &str| Column {
            name: if counted.is_some() { name.to_owned() } else { with_unit(name, unit(&found.attributes)) },
            place: Some(found.path.clone()),
        };
        if found.attributes.contains_key("MATLAB_empty") {
            self.left_out.push(format!("`{name}` (empty)"));
            return Ok(());
        }
        if characters {
            return self.add_characters(found, name);
        }
        let (rows, turned) = match found.shape[..] {
            [rows] | [rows, 1] => (rows, false),
            [1, rows] => (rows, true),
            _ => {
                self.left_out.push(format!("`{name}` ({} axes or several columns)", found.shape.len()));
                return Ok(());
            }
        };
        let lane = self.lanes.len();
        let cells = match &found.kind {
            Kind::Number(element) => match counted {
                Some(unit) => {
                    let code = TimeCode::Counted { element: *element, unit, kind: TimeKind::Calendar };
                    Cells::Times { lane, offset: 0, code }
                }
                None => Cells::Numbers { lane, offset: 0, element: *element },
            },
            Kind::Text { bytes } => Cells::Text { lane, offset: 0, bytes: *bytes, code: Code::Bytes },
            Kind::Texts | Kind::References => {
                let column = column(&name);
                let texts = if found.kind == Kind::Texts { texts(&found)? } else { referred(&found)? };
                let Some(texts) = texts else {
                    self.left_out.push(format!("`{name}` (references)"));
                    return Ok(());
                };
                self.fields.push(Field { column, cells: Cells::Texts { lane }, rows: texts.len() as u64 });
                self.lanes.push(Box::new(Texts { texts, next: 0 }));
                return Ok(());
            }
            Kind::Fields { .. } => {
                self.left_out
                    .push(format!("`{name}` (a table of its own: write `group = \"{}\"`)", found.path));
                return Ok(());
            }
            Kind::Other(what) => {
                self.left_out.push(format!("`{name}` ({what})"));
                return Ok(());
            }
        };
        let column = column(&name);
        self.add_lane(found, rows, 1, turned)?;
        self.fields.push(Field { column, cells, rows });
        Ok(())
    }

    /// Characters of MATLAB: a text a row, along the second axis.
    fn add_characters(&mut self, found: Found, name: String) -> Result<(), FormatError> {
        let (Kind::Number(element), [width, rows]) = (&found.kind, &found.shape[..]) else {
            self.left_out.push(format!("`{name}` (characters)"));
            return Ok(());
        };
        let (width, rows) = (*width, *rows);
        if element.bytes != 2 || rows == 1 || width > limits::TEXT_BYTES as u64 {
            self.left_out.push(format!("`{name}` (a single text)"));
            return Ok(());
        }
        let column = Column { name, place: Some(found.path.clone()) };
        // At most TEXT_BYTES.
        let bytes = usize::try_from(width).unwrap_or(0) * 2;
        let cells = Cells::Text {
            lane: self.lanes.len(),
            offset: 0,
            bytes,
            code: Code::Utf16 { big_endian: element.big_endian },
        };
        self.add_lane(found, rows, width, true)?;
        self.fields.push(Field { column, cells, rows });
        Ok(())
    }

    /// A dataset that is a table: fields with names, or two axes and names for the columns.
    fn add_table(&mut self, dataset: Dataset, path: &str, hints: &Hints) -> Result<(), FormatError> {
        let found = look(dataset, path)?;
        if let (Kind::Fields { fields, .. }, [rows]) = (&found.kind, &found.shape[..]) {
            self.recognised = format!("`{path}` of {rows} rows with {} fields", fields.len());
            let (rows, lane) = (*rows, self.lanes.len());
            let units = found.attributes.get("units").or_else(|| found.attributes.get("unit"));
            let units = units.and_then(AttrValue::as_strings).filter(|units| units.len() == fields.len());
            for (number, (name, offset, kind)) in fields.iter().enumerate() {
                let cells = match kind {
                    Kind::Number(element) => Cells::Numbers { lane, offset: *offset, element: *element },
                    Kind::Text { bytes } => {
                        Cells::Text { lane, offset: *offset, bytes: *bytes, code: Code::Bytes }
                    }
                    _ => {
                        self.left_out.push(format!("`{name}` (no single number or text)"));
                        continue;
                    }
                };
                let name = with_unit(name, units.map_or("", |units| units[number].as_str()));
                self.fields.push(Field {
                    column: Column { name, place: Some(path.to_owned()) },
                    cells,
                    rows,
                });
            }
            return self.add_lane(found, rows, 1, false);
        }
        let Kind::Number(element) = found.kind else {
            return Err(unsupported(
                format!("`{path}`, which is no table of numbers,"),
                "write the path of a group of datasets, or of a dataset of numbers or of a compound type",
            ));
        };
        // MATLAB's first axis is HDF5's last.
        let (rows, columns) = match (&found.shape[..], self.matlab) {
            ([rows], _) => (*rows, 1),
            ([rows, columns], false) | ([columns, rows], true) => (*rows, *columns),
            _ => {
                return Err(unsupported(
                    format!("`{path}` of {} axes", found.shape.len()),
                    "write rows and columns",
                ));
            }
        };
        limits::at_most(
            FORMAT,
            &format!("the number of columns of `{path}`"),
            columns,
            limits::COLUMNS as u64,
        )?;
        let wide = columns.saturating_mul(element.bytes as u64);
        limits::at_most(FORMAT, &format!("the bytes of a row of `{path}`"), wide, limits::ROW_BYTES as u64)?;
        let names = names(&found, columns, hints)?;
        self.recognised = format!("`{path}` of {rows} rows and {columns} columns");
        let units = found.attributes.get("units").or_else(|| found.attributes.get("unit"));
        let units = units
            .and_then(AttrValue::as_strings)
            .filter(|units| units.len() == names.len() && hints.columns.is_none());
        let lane = self.lanes.len();
        for (number, name) in names.iter().enumerate() {
            let name = with_unit(name, units.map_or("", |units| units[number].as_str()));
            let column = Column { name, place: Some(format!("{path}, column {}", number + 1)) };
            let cells = Cells::Numbers { lane, offset: number * element.bytes, element };
            self.fields.push(Field { column, cells, rows });
        }
        let turned = self.matlab && found.shape.len() == 2;
        self.add_lane(found, rows, columns, turned)
    }

    /// The way to the values of a dataset.
    fn add_lane(&mut self, found: Found, rows: u64, columns: u64, turned: bool) -> Result<(), FormatError> {
        let Found { dataset, path, kind, shape, .. } = found;
        let element = kind.bytes();
        limits::at_most(
            FORMAT,
            &format!("the bytes of an element of `{path}`"),
            element as u64,
            limits::ROW_BYTES as u64,
        )?;
        limits::plausible_rows(FORMAT, rows.saturating_mul(columns), self.source.length())?;
        let bytes = rows.saturating_mul(columns).saturating_mul(element as u64);
        let layout = dataset.layout().map_err(|error| failed(&path, &error))?;
        let record = usize::try_from(columns).unwrap_or(0) * element;
        let whole =
            Grid { rows, columns, element, chunk_rows: rows.max(1), chunk_columns: columns.max(1), turned };
        let lane: Box<dyn Lane> = match layout {
            Layout::Contiguous { address, size } => {
                if size != bytes && rows > 0 {
                    return Err(FormatError::Damaged {
                        format: FORMAT,
                        place: path,
                        found: format!("{size} bytes"),
                        expected: format!("{bytes} for {rows} × {columns} elements"),
                    });
                }
                match address {
                    Some(offset) if !turned || columns == 1 => {
                        self.source.within(FORMAT, offset, bytes)?;
                        Box::new(Stretch { source: Arc::clone(&self.source), format: FORMAT, offset, record })
                    }
                    Some(offset) => {
                        self.source.within(FORMAT, offset, bytes)?;
                        Box::new(Turned {
                            source: Arc::clone(&self.source),
                            offset,
                            rows,
                            columns,
                            element,
                            row: 0,
                        })
                    }
                    None if rows == 0 => Box::new(Memory { bytes: Vec::new(), record, row: 0 }),
                    None => {
                        return Err(unsupported(
                            format!("`{path}`, which was never written,"),
                            "write its values",
                        ));
                    }
                }
            }
            Layout::Compact { size } => {
                limits::at_most(
                    FORMAT,
                    &format!("the bytes of `{path}` in its header"),
                    size.max(bytes),
                    limits::HEADER_BYTES,
                )?;
                let raw = dataset.read_raw().map_err(|error| failed(&path, &error))?;
                if raw.len() as u64 != bytes {
                    return Err(FormatError::Damaged {
                        format: FORMAT,
                        place: path,
                        found: format!("{} bytes", raw.len()),
                        expected: format!("{bytes}"),
                    });
                }
                let bytes = if turned && columns > 1 { turn(&raw, element, &whole) } else { raw };
                Box::new(Memory { bytes, record, row: 0 })
            }
            Layout::Chunked { chunk_shape, .. } => {
                let filters = filters_of(&dataset, &path)?;
                let (first, second) = match (chunk_shape[..].len(), shape.len()) {
                    (1, 1) => (chunk_shape[0], 1),
                    (2, 2) => (chunk_shape[0], chunk_shape[1]),
                    _ => {
                        return Err(unsupported(
                            format!("the chunks of `{path}`"),
                            "repack it with h5repack",
                        ));
                    }
                };
                let (chunk_rows, chunk_columns) = if turned { (second, first) } else { (first, second) };
                let grid = Grid { chunk_rows, chunk_columns, ..whole };
                grid.check(&path)?;
                Box::new(ChunkLane::new(Arc::clone(&self.source), dataset, path, grid, filters))
            }
            _ => {
                return Err(unsupported(
                    format!("`{path}`, whose values are in other files,"),
                    "copy them into one with h5repack",
                ));
            }
        };
        self.lanes.push(lane);
        Ok(())
    }

    fn finish(mut self) -> Result<Box<dyn Table>, FormatError> {
        if self.fields.is_empty() {
            return Err(unsupported(
                format!("a place without a column of numbers or labels ({})", limits::list(&self.left_out)),
                "write the path of another in `group`",
            ));
        }
        if !self.left_out.is_empty() {
            self.recognised.push_str(&format!("; left out: {}", limits::list(&self.left_out)));
        }
        let format = if self.matlab { MAT } else { FORMAT };
        let file_bytes = self.source.length();
        Ok(Box::new(RecordTable::new(format, self.recognised, self.fields, self.lanes, file_bytes)))
    }
}

/// Looks for tables: groups with columns (`true`) and datasets that are tables by themselves.
fn walk(
    group: &Group,
    path: &str,
    depth: usize,
    budget: &mut usize,
    places: &mut Vec<(String, bool)>,
) -> Result<(), FormatError> {
    let shown = if path.is_empty() { "/" } else { path };
    let (mut columns, mut tables) = (false, Vec::new());
    for name in group.datasets().map_err(|error| failed(shown, &error))? {
        spend(budget)?;
        let place = format!("{path}/{name}");
        let Ok(found) =
            group.dataset(&name).map_err(|error| failed(&place, &error)).and_then(|d| look(d, &place))
        else {
            continue;
        };
        match (&found.kind, &found.shape[..]) {
            _ if text_attribute(&found.attributes, "MATLAB_class") == Some("char") => {}
            (Kind::Number(_), [_] | [1, _] | [_, 1]) => columns = true,
            (Kind::Fields { .. }, [_]) | (Kind::Number(_), [_, _]) => tables.push((place, false)),
            _ => {}
        }
    }
    // Beside columns, other tables are left out, and said to be.
    if columns {
        places.push((shown.to_owned(), true));
    } else {
        places.append(&mut tables);
    }
    if depth == 0 {
        return Ok(());
    }
    for name in group.groups().map_err(|error| failed(shown, &error))? {
        spend(budget)?;
        // What MATLAB hides.
        if name.starts_with('#') {
            continue;
        }
        let inner = group.group(&name).map_err(|error| failed(&name, &error))?;
        walk(&inner, &format!("{path}/{name}"), depth - 1, budget, places)?;
    }
    Ok(())
}

fn spend(budget: &mut usize) -> Result<(), FormatError> {
    match budget.checked_sub(1) {
        Some(rest) => *budget = rest,
        None => {
            return Err(unsupported(
                format!("a file of more than {OBJECTS} objects"),
                "write the path of the table in `group`",
            ));
        }
    }
    Ok(())
}

fn look(dataset: Dataset, path: &str) -> Result<Found, FormatError> {
    let shape = dataset.shape().map_err(|error| failed(path, &error))?;
    let datatype: Datatype = dataset.datatype().map_err(|error| failed(path, &error))?;
    let attributes = dataset.attrs().map_err(|error| failed(path, &error))?;
    Ok(Found { kind: kind(&datatype), dataset, path: path.to_owned(), attributes, shape })
}

fn text_attribute<'a>(attributes: &'a HashMap<String, AttrValue>, name: &str) -> Option<&'a str> {
    attributes.get(name).and_then(AttrValue::as_str).map(|text| text.trim_end_matches('\0'))
}

fn unit(attributes: &HashMap<String, AttrValue>) -> &str {
    text_attribute(attributes, "units").or_else(|| text_attribute(attributes, "unit")).unwrap_or_default()
}

/// The names of the columns of two axes: of the experiment, or of an attribute.
fn names(found: &Found, columns: u64, hints: &Hints) -> Result<Vec<String>, FormatError> {
    let attribute = ["columns", "column_names", "names"].iter().find_map(|key| found.attributes.get(*key));
    let stored = attribute.and_then(AttrValue::as_strings);
    match hints.columns.as_deref().or(stored) {
        Some(names) if names.len() as u64 == columns => Ok(names.to_vec()),
        names => Err(unsupported(
            format!("`{}` of {columns} columns with {} names", found.path, names.map_or(0, <[String]>::len)),
            "write as many names as there are columns, in `columns` of the experiment or in an attribute `columns`",
        )),
    }
}

fn filters_of(dataset: &Dataset, path: &str) -> Result<Vec<Filter>, FormatError> {
    dataset
        .filter_pipeline()
        .iter()
        .map(|filter| {
            Filter::of(filter.id).ok_or_else(|| {
                unsupported(
                    format!("`{path}`, packed by filter {},", filter.id),
                    "pack it with gzip, shuffle, fletcher32 or lzf, for instance with h5repack -f GZIP=4",
                )
            })
        })
        .collect()
}

/// Texts of several lengths, all of them.
fn texts(found: &Found) -> Result<Option<Vec<Vec<u8>>>, FormatError> {
    check_size(found)?;
    let options = hdf5_pure::VlenStringReadOptions::new()
        .with_max_elements(TEXTS)
        .with_max_payload_bytes(usize::try_from(limits::HEADER_BYTES).unwrap_or(usize::MAX));
    let texts = found.dataset.read_vlen_strings(options).map_err(|error| failed(&found.path, &error))?;
    Ok(Some(texts.into_iter().map(String::into_bytes).collect()))
}

/// The texts that a cell array of MATLAB refers to; none where it refers to something else.
fn referred(found: &Found) -> Result<Option<Vec<Vec<u8>>>, FormatError> {
    check_size(found)?;
    let mut texts = Vec::new();
    let mut budget = limits::HEADER_BYTES;
    for object in found.dataset.dereference().map_err(|error| failed(&found.path, &error))? {
        let hdf5_pure::Object::Dataset(dataset) = object else { return Ok(None) };
        let text = look(*dataset, &found.path)?;
        let count =
            text.shape.iter().try_fold(1_u64, |count, length| count.checked_mul(*length)).unwrap_or(u64::MAX);
        let Kind::Number(element) = text.kind else { return Ok(None) };
        if element.bytes != 2 || text_attribute(&text.attributes, "MATLAB_class") != Some("char") {
            return Ok(None);
        }
        let bytes = count.saturating_mul(2).saturating_add(64);
        limits::at_most(FORMAT, &format!("the length of the texts of `{}`", found.path), bytes, budget)?;
        budget -= bytes;
        if text.attributes.contains_key("MATLAB_empty") {
            texts.push(Vec::new());
            continue;
        }
        check_size(&text)?;
        let raw = text.dataset.read_raw().map_err(|error| failed(&found.path, &error))?;
        let mut utf8 = Vec::new();
        Code::Utf16 { big_endian: element.big_endian }.read(&raw, &mut utf8);
        texts.push(utf8);
    }
    Ok(Some(texts))
}

/// Refuses what the library would take too much memory for.
fn check_size(found: &Found) -> Result<(), FormatError> {
    let count =
        found.shape.iter().try_fold(1_u64, |count, length| count.checked_mul(*length)).unwrap_or(u64::MAX);
    limits::at_most(FORMAT, &format!("the number of texts of `{}`", found.path), count, TEXTS as u64)?;
    let chunk = found.dataset.chunk_shape().map_err(|error| failed(&found.path, &error))?.unwrap_or_default();
    let elements =
        chunk.iter().try_fold(1_u64, |count, length| count.checked_mul(*length)).unwrap_or(u64::MAX);
    limits::at_most(
        FORMAT,
        &format!("the elements of a chunk of `{}`", found.path),
        elements,
        4 * TEXTS as u64,
    )
}

/// Records in memory.
struct Memory {
    bytes: Vec<u8>,
    record: usize,
    row: usize,
}

impl Lane for Memory {
    fn record(&self) -> usize {
        self.record
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        out.extend_from_slice(&self.bytes[self.row * self.record..(self.row + rows) * self.record]);
        self.row += rows;
        Ok(())
    }
}

/// Columns one after the other, as records.
struct Turned {
    source: Arc<Source>,
    offset: u64,
    rows: u64,
    columns: u64,
    element: usize,
    row: u64,
}

impl Lane for Turned {
    fn record(&self) -> usize {
        usize::try_from(self.columns).unwrap_or(0) * self.element
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let record = self.record();
        out.resize(rows * record, 0);
        let mut column_bytes = vec![0; rows * self.element];
        for column in 0..self.columns {
            let first = column * self.rows + self.row;
            self.source.read_exact(FORMAT, self.offset + first * self.element as u64, &mut column_bytes)?;
            let at = usize::try_from(column).unwrap_or(0) * self.element;
            for (row, cell) in out.chunks_exact_mut(record).zip(column_bytes.chunks_exact(self.element)) {
                row[at..at + self.element].copy_from_slice(cell);
            }
        }
        self.row += rows as u64;
        Ok(())
    }
}

fn turn(raw: &[u8], element: usize, grid: &Grid) -> Vec<u8> {
    let rows = usize::try_from(grid.rows).unwrap_or(0);
    let mut turned = Vec::with_capacity(raw.len());
    for row in 0..rows {
        for column in raw.chunks_exact(rows * element) {
            turned.extend_from_slice(&column[row * element..(row + 1) * element]);
        }
    }
    turned
}

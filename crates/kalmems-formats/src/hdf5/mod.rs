//! HDF5, and MAT files of version 7.3, which are HDF5 with conventions of their own.
//!
//! Everything is read here, block by block: no more of the metadata than a budget, no more of the values than the chunks
//! side by side that hold a row.

mod attributes;
mod cf;
mod checksum;
mod chunks;
mod datatype;
mod file;
mod filters;
mod header;
mod heap;
mod index;
mod layout;
mod links;
mod objects;
mod search;
mod tree;
mod values;

use crate::element::{Element, ElementKind};
use crate::name::with_unit;
use crate::records::{CellKind, RecordField, StoredCell, TextEncoding};
use crate::scaling::{self, Scaling, ScalingStep};
use crate::source::SharedFile;
use crate::stated_clock::StatedNumbers;
use crate::table_parts::{StoredArray, TableParts, becomes_columns};
use crate::time::{TimeCode, TimeForm, TimeKind};
use crate::{Column, FormatError, Hints, Result, Table, limits, refuse_if};
use attributes::{Attributes, Dataspace};
use datatype::DatatypeKind;
use header::{MessageKind as Message, ObjectHeader};
use links::{GroupLink, is_group, links};
use objects::{LinkedFiles, Object};
use std::sync::Arc;
use values::{DataShape, DatasetValues};

const FORMAT: &str = "HDF5";
const MAT: &str = "MAT 7.3";
/// Groups and datasets that are looked at.
const OBJECTS: usize = 4096;
/// Elements of a dataset of texts of several lengths.
const TEXTS: u64 = 1 << 18;
/// The attribute that says how long a tick of a device's clock is.
const TIMEBASE: &str = "timebase";
/// What to do with what h5py, MATLAB, LabVIEW and LabOne do not write unless they are asked to in C.
const NEW_FILE: &str = "write its values into a new file with h5py, such as by `new[name] = old[name][()]`";
/// What MATLAB needs to be told to write what others can read.
const TABLE_REMEDY: &str = "save it with `S = table2struct(T, ToScalar=true); save(…, \"-struct\", \"S\")`";

fn unsupported(what: impl Into<String>, remedy: &str) -> FormatError {
    FormatError::unsupported(FORMAT, what, remedy)
}

pub(crate) fn open(source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    let source = Arc::new(source);
    let mut head = [0; 10];
    let matlab = source.read_some(0, &mut head)? == 10 && head == *b"MATLAB 7.3";
    let mut parts = Hdf5TableParts {
        file_bytes: source.length(),
        files: LinkedFiles::new(source)?,
        matlab,
        table: TableParts::new(if matlab { MAT } else { FORMAT }),
        timebase_s: None,
    };
    match &hints.group {
        Some(path) => parts.at_path(path, hints)?,
        None => parts.find(hints)?,
    }
    let (file_bytes, stated_by) = (parts.file_bytes, "attributes, and datasets of one number");
    parts.table.finish(file_bytes, stated_by, "write the path of another place in `group`")
}

/// A table that is being put together.
struct Hdf5TableParts {
    files: LinkedFiles,
    file_bytes: u64,
    matlab: bool,
    /// Its stated numbers are those of the attributes of the root and of the group, and single ones in the group; the own clocks of columns
    /// are those of their attributes.
    table: TableParts,
    /// How long a tick of the device's clock is in s, where they state it (LabOne of Zurich Instruments).
    timebase_s: Option<f64>,
}

/// A dataset with what is needed to read it.
struct FoundDataset {
    object: Object,
    header: ObjectHeader,
    path: String,
    attributes: Attributes,
    space: Dataspace,
    kind: DatatypeKind,
}

impl FoundDataset {
    fn look(object: Object, header: ObjectHeader, path: &str) -> Result<Self> {
        let file = &object.file;
        let lacks = |what: &str| {
            let expected = "its type, its shape and its layout";
            FormatError::damaged(FORMAT, path, format!("a dataset without {what}"), expected)
        };
        let kind = header.first(file, Message::Datatype, datatype::read)?.ok_or_else(|| lacks("a type"))?;
        let space =
            header.first(file, Message::Dataspace, Dataspace::read)?.ok_or_else(|| lacks("a shape"))?;
        let attributes = Attributes::read(file, &header)?;
        // Of netCDF, which had no unsigned numbers.
        let unsigned = attributes.text("_Unsigned").is_some_and(|text| text.eq_ignore_ascii_case("true"));
        let kind = match kind {
            DatatypeKind::Number(element) if unsigned && element.kind == ElementKind::Signed => {
                DatatypeKind::Number(Element { kind: ElementKind::Unsigned, ..element })
            }
            kind => kind,
        };
        Ok(Self { object, header, path: path.to_owned(), attributes, space, kind })
    }

    fn is_class(&self, class: &str) -> bool {
        self.attributes.text("MATLAB_class") == Some(class)
    }

    /// What MATLAB keeps in a way that is not documented, and what to do; none where it is something else.
    fn of_matlab(&self) -> Option<String> {
        let decoded = self.attributes.get("MATLAB_object_decode").is_some();
        Some(match self.attributes.text("MATLAB_class")? {
            class @ ("table" | "timetable") => format!("a {class} of MATLAB: {TABLE_REMEDY}"),
            class if decoded => format!("an object of the class {class} of MATLAB"),
            _ => return None,
        })
    }

    /// Where its values are, for messages: the file too, where it is another.
    fn place(&self) -> String {
        match &self.object.file.name {
            Some(name) => format!("{} in {}", self.path, name.display()),
            None => self.path.clone(),
        }
    }

    /// What the conventions of netCDF say of its numbers.
    fn scaling(&self) -> Scaling {
        let one = |name: &str| match self.attributes.numbers(name) {
            [only] => Some(only.rounded()),
            _ => None,
        };
        let (factor, offset) = (one("scale_factor"), one("add_offset"));
        let steps = match (factor, offset) {
            (None, None) => Vec::new(),
            _ => vec![ScalingStep::Linear { factor: factor.unwrap_or(1.0), offset: offset.unwrap_or(0.0) }],
        };
        let DatatypeKind::Number(element) = self.kind else { return Scaling::default() };
        let missing = ["_FillValue", "missing_value"].iter().flat_map(|name| self.attributes.numbers(name));
        Scaling { missing: missing.map(|number| element.cast(*number)).collect(), steps }
    }
}

impl Hdf5TableParts {
    /// The group or dataset that the experiment names.
    fn at_path(&mut self, path: &str, hints: &Hints) -> Result<()> {
        let mut reached = self.files.at_path(path)?;
        if self.matlab && reached.is_err() {
            // As a field of a struct is called.
            reached = self.files.at_path(&path.replace('.', "/"))?;
        }
        let nowhere = |why| {
            let remedy = "write the path of a group or dataset that is there";
            unsupported(format!("`{path}`, {why},"), remedy)
        };
        let object = reached.map_err(nowhere)?;
        let header = object.header()?;
        if is_group(&header) {
            return self.add_group(&object, path);
        }
        refuse_if(!header.has(Message::Layout), || {
            unsupported(format!("`{path}`, which is no group and no dataset,"), "write the path of one")
        })?;
        self.add_table(&FoundDataset::look(object, header, path)?, hints)
    }

    /// The datasets of a group as columns.
    fn add_group(&mut self, group: &Object, path: &str) -> Result<()> {
        self.table.recognised = if self.matlab && path == "/" {
            "the variables, a column each".to_owned()
        } else {
            format!("the datasets of `{path}`, a column each")
        };
        self.learn_clock(group);
        let links = links(&group.file, &group.header()?)?;
        limits::at_most(FORMAT, &format!("the number of names in `{path}`"), links.len(), OBJECTS)?;
        for GroupLink { name, target } in links {
            // One that cannot be read does not stand in the way of the others.
            let columns = self.table.fields.len();
            let place = format!("{}/{name}", path.trim_end_matches('/'));
            let added = self.files.follow(group, &target).and_then(|reached| match reached {
                Ok(object) => self.add_object(object, &name, &place),
                Err(why) => {
                    self.table.leave_out(&name, &why);
                    Ok(())
                }
            });
            match added {
                Ok(()) => {}
                Err(FormatError::Io(error)) => return Err(error.into()),
                Err(error) => {
                    self.table.fields.truncate(columns);
                    self.table.leave_out(name, reason(&error));
                }
            }
        }
        Ok(())
    }

    fn add_object(&mut self, object: Object, name: &str, place: &str) -> Result<()> {
        let header = object.header()?;
        if header.has(Message::Layout)
            && let Some(why) = self.add_column(&FoundDataset::look(object, header, place)?, name)?
        {
            self.table.leave_out(name, why);
        }
        Ok(())
    }

    /// Learns what the attributes of a group, and of the root, state of clocks.
    fn learn_clock(&mut self, group: &Object) {
        for object in [group.clone(), self.files.root()] {
            // Attributes that cannot be read state nothing.
            let attributes = object.header().and_then(|header| Attributes::read(&object.file, &header));
            for (name, number) in attributes.unwrap_or_default().single_numbers() {
                self.table.stated.learn(name, number);
                if name == TIMEBASE {
                    self.timebase_s.get_or_insert(number);
                }
            }
        }
    }

    /// How long a tick is in s, of which the numbers of a column are counts.
    fn tick_s(&self, found: &FoundDataset, name: &str) -> Option<f64> {
        let counts = matches!(name.to_lowercase().as_str(), "timestamp" | "timestamps");
        let own = found.attributes.single_numbers().find(|(name, _)| *name == TIMEBASE).map(|(_, s)| s);
        own.or(self.timebase_s).filter(|tick_s| counts && (1e-15..1.0).contains(tick_s))
    }

    /// Adds a dataset as a column, or says why it is none.
    fn add_column(&mut self, found: &FoundDataset, name: &str) -> Result<Option<String>> {
        if let Some(what) = found.of_matlab() {
            return Ok(Some(what));
        }
        if found.attributes.get("MATLAB_empty").is_some() {
            return Ok(Some("empty".to_owned()));
        }
        if self.matlab && found.is_class("char") {
            return self.add_characters(found, name);
        }
        let (rows, turned) = match found.space.shape[..] {
            _ if found.space.count() == 1 => {
                let number = match found.kind {
                    DatatypeKind::Number(element) => values::single(found, element),
                    _ => None,
                };
                let is_stated = number.is_some_and(|number| self.table.stated.learn(name, number));
                return Ok((!is_stated).then(|| "a single value".to_owned()));
            }
            [rows] | [rows, 1] => (rows, false),
            [1, rows] => (rows, true),
            [_, _] if matches!(found.kind, DatatypeKind::Number(_)) => return self.add_beside(found, name),
            _ => {
                return Ok(Some(format!("{} axes", found.space.shape.len())));
            }
        };
        let lane = self.table.lanes.len();
        let counted = cf::time(found.attributes.units().first().map_or("", String::as_str));
        let cell = match &found.kind {
            DatatypeKind::Texts | DatatypeKind::References => {
                let Some(texts) = values::texts(found)? else {
                    return Ok(Some("references".to_owned()));
                };
                let column = Column::new(name).at(found.place());
                let rows = texts.len() as u64;
                let own = Box::new(crate::lanes::TextLane { texts, next: 0 });
                self.table.add(column, CellKind::Texts { lane }, rows, own);
                return Ok(None);
            }
            DatatypeKind::Fields { .. } => {
                return Ok(Some(format!("a table of its own: write `group = \"{}\"`", found.path)));
            }
            kind => kind.stored(),
        };
        let cell = match (cell, counted) {
            (Some(StoredCell::Number(element)), Some(unit)) => {
                let form = TimeForm::Counted(element);
                StoredCell::Time(TimeCode { form, unit, kind: TimeKind::Calendar })
            }
            (Some(cell), _) => cell,
            (None, _) => return Ok(Some(found.kind.what().to_owned())),
        };
        let cells = CellKind::Stored { lane, offset: 0, cell };
        let unit = found.attributes.units().first().map_or("", String::as_str);
        let tick_s = self.tick_s(found, name);
        let unit = match (counted, tick_s) {
            (Some(_), _) => "",
            (None, Some(_)) => "s",
            (None, None) => unit,
        };
        let column = Column::new(&with_unit(name, unit)).at(found.place());
        let mut scaling = found.scaling();
        scaling.steps.extend(tick_s.map(|factor| ScalingStep::Linear { factor, offset: 0.0 }));
        self.say(&column.name, &scaling);
        let mut own = StatedNumbers::default();
        if found.attributes.single_numbers().filter(|(name, number)| own.learn(name, *number)).count() > 0 {
            self.table.own_clocks.push((self.table.fields.len(), own.clock()));
        }
        let shape = DataShape { rows, columns: 1, element: found.kind.bytes(), turned };
        self.table.lanes.push(values::lane(found, shape)?);
        self.table.fields.push(RecordField { scaling, ..RecordField::new(column, cells, rows) });
        Ok(None)
    }

    /// Says what is done to the numbers of a column.
    fn say(&mut self, name: &str, scaling: &Scaling) {
        if !scaling.steps.is_empty() {
            self.table
                .recognised
                .push_str(&format!("; `{name}` = {} of the stored x", scaling::text(&scaling.steps)));
        }
        if !scaling.missing.is_empty() {
            let values: Vec<String> =
                scaling.missing.iter().map(|value| crate::element::shortest(value.rounded())).collect();
            self.table
                .recognised
                .push_str(&format!("; `{name}` has no value where {} is stored", values.join(" or ")));
        }
    }

    /// A dataset of rows and columns beside datasets that are columns.
    fn add_beside(&mut self, found: &FoundDataset, name: &str) -> Result<Option<String>> {
        let (rows, columns) = self.rows_and_columns(found)?;
        if !becomes_columns(rows, columns) {
            let what = format!("{rows} rows and {columns} columns");
            return Ok(Some(format!("{what}: write `group = \"{}\"` and `columns`", found.path)));
        }
        let names: Vec<String> = match stored_names(found) {
            Some(names) if names.len() as u64 == columns => names.to_vec(),
            // As Python and MATLAB name them.
            _ if self.matlab => (1..=columns).map(|column| format!("{name}(:,{column})")).collect(),
            _ => (0..columns).map(|column| format!("{name}[:,{column}]")).collect(),
        };
        self.add_columns(found, rows, &names, true).map(|()| None)
    }

    /// The rows and columns of a dataset of two axes: MATLAB's first axis is HDF5's last.
    fn rows_and_columns(&self, found: &FoundDataset) -> Result<(u64, u64)> {
        let path = &found.path;
        let (rows, columns) = match (&found.space.shape[..], self.matlab) {
            ([rows], _) => (*rows, 1),
            ([rows, columns], false) | ([columns, rows], true) => (*rows, *columns),
            (shape, _) => {
                let what = format!("`{path}` of {} axes", shape.len());
                return Err(unsupported(what, "write rows and columns"));
            }
        };
        let what = format!("the number of columns of `{path}`");
        limits::at_most(FORMAT, &what, columns, limits::COLUMNS)?;
        let wide = columns.saturating_mul(found.kind.bytes() as u64);
        limits::at_most(FORMAT, &format!("the bytes of a row of `{path}`"), wide, limits::ROW_BYTES)?;
        Ok((rows, columns))
    }

    /// The columns of a dataset of numbers with one or two axes. `united` adds the units that its attributes state.
    fn add_columns(&mut self, found: &FoundDataset, rows: u64, names: &[String], united: bool) -> Result<()> {
        let DatatypeKind::Number(element) = found.kind else { return Ok(()) };
        let units = match found.attributes.units() {
            // One for all, or one for each.
            [only] => vec![only.clone(); names.len()],
            units if units.len() == names.len() => units.to_vec(),
            _ => Vec::new(),
        };
        let (first, scaling) = (self.table.fields.len(), found.scaling());
        let (cell, turned) = (StoredCell::Number(element), self.is_turned(found));
        let shape = DataShape { rows, columns: names.len() as u64, element: element.bytes, turned };
        match values::values(found, shape)? {
            DatasetValues::Stretch(stretch, place) => {
                let array = StoredArray { stretch: &stretch, place, rows, cell, by_column: turned };
                self.table.add_array(&array, names)?;
            }
            DatasetValues::Chunks(lane) => self.table.add_rows(lane, rows, cell, names),
        }
        for (number, (field, name)) in self.table.fields.iter_mut().skip(first).zip(names).enumerate() {
            let unit = units.get(number).filter(|_| united).map_or("", String::as_str);
            let place = format!("{}, column {}", found.place(), number + 1);
            field.column = Column::new(&with_unit(name, unit)).at(place);
            field.scaling = scaling.clone();
        }
        self.say(&found.path, &scaling);
        Ok(())
    }

    /// Whether the last axis of a dataset of two are the rows, as MATLAB has them.
    fn is_turned(&self, found: &FoundDataset) -> bool {
        self.matlab && found.space.shape.len() == 2
    }

    /// Characters of MATLAB: a text a row, along the second axis.
    fn add_characters(&mut self, found: &FoundDataset, name: &str) -> Result<Option<String>> {
        let (DatatypeKind::Number(element), [width, rows]) = (&found.kind, &found.space.shape[..]) else {
            return Ok(Some("characters".to_owned()));
        };
        let (width, rows, element) = (*width, *rows, *element);
        if element.bytes != 2 || rows == 1 || width > limits::TEXT_BYTES as u64 {
            return Ok(Some("a single text".to_owned()));
        }
        let column = Column::new(name).at(found.place());
        // At most TEXT_BYTES.
        let bytes = usize::try_from(width).unwrap_or(0) * 2;
        let code = TextEncoding::Utf16 { big_endian: element.big_endian };
        let cell = StoredCell::Text { bytes, code };
        let cells = CellKind::Stored { lane: self.table.lanes.len(), offset: 0, cell };
        let shape = DataShape { rows, columns: width, element: 2, turned: true };
        self.table.lanes.push(values::lane(found, shape)?);
        self.table.fields.push(RecordField::new(column, cells, rows));
        Ok(None)
    }

    /// A dataset that is a table: fields with names, or two axes and names for the columns.
    fn add_table(&mut self, found: &FoundDataset, hints: &Hints) -> Result<()> {
        let path = found.path.clone();
        if let Some(what) = found.of_matlab() {
            return Err(unsupported(format!("`{path}`, {what},"), "name a variable that holds numbers"));
        }
        if let (DatatypeKind::Fields { fields, .. }, [rows]) = (&found.kind, &found.space.shape[..]) {
            self.table.recognised = format!("`{path}` of {rows} rows with {} fields", fields.len());
            let (rows, lane, fields) = (*rows, self.table.lanes.len(), fields.clone());
            let units = Some(found.attributes.units()).filter(|units| units.len() == fields.len());
            for (number, (name, offset, kind)) in fields.iter().enumerate() {
                let Some(cell) = kind.stored() else {
                    self.table.leave_out(name, kind.what());
                    continue;
                };
                let cells = CellKind::Stored { lane, offset: *offset, cell };
                let name = with_unit(name, units.map_or("", |units| units[number].as_str()));
                self.table.fields.push(RecordField::new(Column::new(&name).at(found.place()), cells, rows));
            }
            let shape = DataShape { rows, columns: 1, element: found.kind.bytes(), turned: false };
            self.table.lanes.push(values::lane(found, shape)?);
            return Ok(());
        }
        refuse_if(!matches!(found.kind, DatatypeKind::Number(_)), || {
            let what = format!("`{path}`, which holds {} and no table of numbers,", found.kind.what());
            let remedy =
                "write the path of a group of datasets, or of a dataset of numbers or of a compound type";
            unsupported(what, remedy)
        })?;
        let (rows, columns) = self.rows_and_columns(found)?;
        // Its own name, of a single column.
        let own = || (columns == 1).then(|| vec![path.rsplit('/').next().unwrap_or(&path).to_owned()]);
        let stored = stored_names(found).map(<[String]>::to_vec).or_else(own);
        let what = format!("`{path}` of {rows} rows and {columns} columns");
        let names = self.table.names(hints, stored, columns, &what)?;
        self.table.recognised = what;
        self.add_columns(found, rows, &names, hints.columns.is_none())
    }
}

/// The names of the columns of two axes that an attribute states.
fn stored_names(found: &FoundDataset) -> Option<&[String]> {
    ["columns", "column_names", "names"].iter().find_map(|key| found.attributes.texts(key))
}

/// Why a column is left out, in words that follow its name.
fn reason(error: &FormatError) -> String {
    match error {
        FormatError::Unsupported { what, remedy, .. } => format!("{what} is not read; {remedy}"),
        other => other.to_string(),
    }
}

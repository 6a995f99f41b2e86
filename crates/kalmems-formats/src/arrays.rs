//! Arrays in memory as a table, instead of a file.

use crate::element::{Element, ElementKind};
use crate::records::{CellKind, RecordLane, RecordTable, StoredCell, TextEncoding};
use crate::table_parts::TableParts;
use crate::time::{TimeCode, TimeForm};
use crate::{Column, Digest, FormatError, Result, Table, TimeKind, TimeUnit, limits};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeSet;
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

const FORMAT: &str = "arrays";

/// What the elements of an array are, little-endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArrayType {
    /// IEEE 754 of 2, 4 or 8 bytes.
    Float(usize),
    /// Signed integers of 1, 2, 4 or 8 bytes.
    Signed(usize),
    /// Unsigned integers of 1, 2, 4 or 8 bytes.
    Unsigned(usize),
    /// Signed integers of 8 bytes that count these from the beginning of 1970 in UTC.
    Dates(TimeUnit),
    /// Signed integers of 8 bytes that count these.
    Durations(TimeUnit),
    /// Texts in UTF-8 of so many bytes, NUL and white space at their ends not counted.
    Texts(usize),
}

impl ArrayType {
    const fn bytes(self) -> usize {
        match self {
            Self::Float(bytes) | Self::Signed(bytes) | Self::Unsigned(bytes) | Self::Texts(bytes) => bytes,
            Self::Dates(_) | Self::Durations(_) => 8,
        }
    }

    /// What an element is; `None` where there are no such numbers.
    fn cell(self) -> Option<StoredCell> {
        let kind = match self {
            Self::Float(_) => ElementKind::Float,
            Self::Signed(_) => ElementKind::Signed,
            Self::Unsigned(_) => ElementKind::Unsigned,
            Self::Dates(unit) | Self::Durations(unit) => {
                let is_date = matches!(self, Self::Dates(_));
                let kind = if is_date { TimeKind::Calendar } else { TimeKind::Elapsed };
                let form = TimeForm::Counted(Element::little(ElementKind::Signed, 8));
                return Some(StoredCell::Time(TimeCode { form, unit, kind }));
            }
            Self::Texts(bytes) => {
                return (bytes > 0).then_some(StoredCell::Text { bytes, code: TextEncoding::Bytes });
            }
        };
        let element = Element::little(kind, self.bytes());
        element.exists().then_some(StoredCell::Number(element))
    }
}

/// One array: a column.
#[derive(Clone, Debug)]
pub struct Array {
    name: String,
    of: ArrayType,
    bytes: Vec<u8>,
    missing: Vec<bool>,
}

impl Array {
    /// An array of this name, with its unit in it as in a file, of these bytes.
    pub fn new(name: &str, of: ArrayType, bytes: Vec<u8>) -> Self {
        Self { name: name.to_owned(), of, bytes, missing: Vec::new() }
    }

    /// An array of numbers.
    pub fn of_numbers(name: &str, numbers: &[f64]) -> Self {
        Self::new(name, ArrayType::Float(8), numbers.iter().flat_map(|number| number.to_le_bytes()).collect())
    }

    /// The same without the elements at which this is true; nothing takes their place.
    #[must_use]
    pub fn without(self, missing: Vec<bool>) -> Self {
        Self { missing, ..self }
    }

    fn rows(&self) -> usize {
        self.bytes.len() / self.of.bytes().max(1)
    }
}

/// Arrays of one length, a column each, that are read as a file of the same numbers would be: bit by bit, with the same findings. Their rows
/// count from 0, as samples.
///
/// Copies share the memory.
///
/// ```
/// use kalmems_formats::{Array, Arrays, Hints, open};
/// let arrays = Arrays::new(vec![Array::of_numbers("time_s", &[0.0, 1e-3]), Array::of_numbers("cap_V", &[0.1, 0.2])])?;
/// let table = open("recording".as_ref(), &Hints { arrays: Some(arrays), ..Hints::default() })?;
/// assert_eq!(table.description().columns[1].name, "cap_V");
/// # Ok::<(), kalmems_formats::FormatError>(())
/// ```
#[derive(Clone)]
pub struct Arrays(Arc<SharedArrays>);

struct SharedArrays {
    arrays: Vec<Array>,
    rows: usize,
    digest: OnceLock<Digest>,
}

impl Arrays {
    /// Puts arrays beside each other.
    ///
    /// # Errors
    /// Where they differ in length, where two have one name, and where there are no numbers of such a length.
    pub fn new(arrays: Vec<Array>) -> Result<Self> {
        let refuse = |what: String, remedy: &str| Err(FormatError::unsupported(FORMAT, what, remedy));
        limits::at_most(FORMAT, "the number of columns", arrays.len(), limits::COLUMNS)?;
        let rows = arrays.first().map_or(0, Array::rows);
        let mut names = BTreeSet::new();
        for array in &arrays {
            let Array { name, of, bytes, missing } = array;
            if of.cell().is_none() || bytes.len() % of.bytes() != 0 {
                let what = format!("`{name}` with elements of {} bytes", of.bytes());
                return refuse(what, "give numbers of 1, 2, 4 or 8 bytes, or texts");
            }
            if array.rows() != rows || (!missing.is_empty() && missing.len() != rows) {
                let first = arrays.first().map_or("", |first| first.name.as_str());
                let what = format!("`{name}` of {} samples next to `{first}` of {rows}", array.rows());
                return refuse(what, "give columns of one length, each with as many samples as its mask");
            }
            if !names.insert(name.trim()) {
                return refuse(format!("a second column `{name}`"), "give each a name of its own");
            }
        }
        Ok(Self(Arc::new(SharedArrays { arrays, rows, digest: OnceLock::new() })))
    }

    /// How many samples there are.
    pub fn rows(&self) -> usize {
        self.0.rows
    }

    /// The names of the columns.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.arrays.iter().map(|array| array.name.as_str())
    }

    /// What tells these arrays from others: a digest of their names, types, numbers and masks, and the length of the numbers.
    pub fn digest(&self) -> &Digest {
        self.0.digest.get_or_init(|| {
            let (mut hash, mut length) = (Sha256::new(), 0);
            for Array { name, of, bytes, missing } in &self.0.arrays {
                hash.update(format!("{} {name} {of:?} {} {}\n", name.len(), bytes.len(), missing.len()));
                hash.update(bytes);
                hash.update(missing.iter().map(|gone| u8::from(*gone)).collect::<Vec<u8>>());
                length += bytes.len() as u64;
            }
            Digest::new(hash, length)
        })
    }

    /// As a table that is being read.
    pub(crate) fn table(&self) -> Box<dyn Table> {
        let mut parts = TableParts::new(FORMAT);
        for (number, array) in self.0.arrays.iter().enumerate() {
            if let Some(cell) = array.of.cell() {
                let lane = ArrayLane { held: Arc::clone(&self.0), number, rows: 0..0 };
                let cells = CellKind::Stored { lane: number, offset: 0, cell };
                parts.add(Column::new(&array.name), cells, self.0.rows as u64, Box::new(lane));
            }
        }
        parts.recognised = format!("{} samples of {} columns in memory", self.0.rows, parts.fields.len());
        let bytes = self.0.arrays.iter().map(|array| array.bytes.len() as u64).sum();
        Box::new(RecordTable::new(parts, bytes).of_arrays(self.clone()))
    }
}

/// Two are equal where their numbers are.
impl PartialEq for Arrays {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) || self.digest() == other.digest()
    }
}

impl Eq for Arrays {}

impl fmt::Debug for Arrays {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Arrays")
            .field("names", &self.names().collect::<Vec<_>>())
            .field("rows", &self.0.rows)
            .finish()
    }
}

/// The elements of one array, one after the other.
struct ArrayLane {
    held: Arc<SharedArrays>,
    number: usize,
    /// Those that were read last.
    rows: Range<usize>,
}

impl RecordLane for ArrayLane {
    fn record(&self) -> usize {
        self.held.arrays.get(self.number).map_or(0, |array| array.of.bytes())
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()> {
        out.clear();
        let record = self.record();
        if let Some(array) = self.held.arrays.get(self.number) {
            let (start, end) = (self.rows.end, self.rows.end.saturating_add(rows).min(self.held.rows));
            out.extend_from_slice(array.bytes.get(start * record..end * record).unwrap_or_default());
            self.rows = start..end;
        }
        Ok(())
    }

    fn missing(&self) -> &[bool] {
        let array = self.held.arrays.get(self.number);
        array.and_then(|array| array.missing.get(self.rows.clone())).unwrap_or_default()
    }
}

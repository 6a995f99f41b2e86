//! What every format gives.

use crate::{Block, FormatError, Instant, Result, TimeKind, TimeUnit, limits, refuse_if};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeSet;
use std::fmt;

/// What is known of a table before its first row is read.
#[derive(Clone, Debug, PartialEq)]
pub struct TableDescription {
    /// The format, for people: `CSV`, `MAT 7.3`.
    pub format: &'static str,
    /// What was recognised and decided, in a sentence for people, such as "separated by semicolons, decimal commas,
    /// units in line 2".
    pub recognised: String,
    /// The columns in the order of the file.
    pub columns: Vec<Column>,
    /// How many rows there are, where the format says so.
    pub rows: Option<u64>,
    /// By what the file is known to be a table of numbers.
    pub evidence: TableEvidence,
    /// What is no column of it, where the format has names for that.
    pub left_out: Vec<OmittedPart>,
    /// Which of its numbers are under a checksum, as a sentence; empty of a text and of arrays, which have none.
    pub protection: String,
}

/// By what a file is known to be a table of numbers, so that messages may show what its names and cells are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TableEvidence {
    /// Its format, which holds tables and nothing else.
    Format,
    /// It is no file but [arrays](crate::Arrays): rows count from 0, as samples, and have no lines.
    Arrays,
    /// Rows of a text: among its first lines there are rows of as many cells as there are names, with a number below a name.
    Rows,
    /// Nothing: a text of another kind, or one whose first rows are empty. It may be a file that was not meant, and what it
    /// holds belongs in no message.
    #[default]
    Nothing,
}

/// A part of a file that is no column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OmittedPart {
    /// Its name or its place in the file.
    pub name: String,
    /// Why it is left out, in words that can follow its name.
    pub why: String,
}

impl OmittedPart {
    pub(crate) fn new(name: impl Into<String>, why: impl Into<String>) -> Self {
        Self { name: name.into(), why: why.into() }
    }
}

impl fmt::Display for OmittedPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` ({})", self.name, self.why)
    }
}

/// A column of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Column {
    /// Its name as the program has it: `name_unit`, put together where the format keeps the unit elsewhere.
    pub name: String,
    /// Where it stands in the file, for messages, where that is not its name: `/rig/cap`.
    pub place: Option<String>,
    /// It holds texts, which can be labels and never numbers. Of text files it is not known before the rows are read.
    pub text: bool,
    /// How many rows it has, where the columns of the file differ in that: those of one number belong together.
    pub rows: Option<u64>,
    /// Why its rows cannot stand beside those of most others, where the file states other times for them; in words that follow "as".
    pub apart: Option<String>,
    /// Columns of several groups do not stand beside each other; most are of the group 0.
    pub group: usize,
}

impl Column {
    /// One of numbers with a name.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }

    /// The same at a place of the file.
    pub(crate) fn at(self, place: String) -> Self {
        Self { place: Some(place), ..self }
    }
}

/// A column that is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WantedColumn {
    /// Numbers, times a power of ten, rounded once: the digits in the file (the shortest that stand for a binary
    /// number), with another exponent.
    Number {
        /// Which column of the description.
        column: usize,
        /// The power of ten.
        power: i32,
    },
    /// Times in seconds from [`Block::origin`] on, which stand among the numbers; of one column at most.
    Time {
        /// Which column of the description.
        column: usize,
        /// What its numbers count, where [`Table::time_kind`] does not say it.
        unit: TimeUnit,
        /// Where the times are to count from; where that is not given, from the first, or from zero where that is near.
        origin: Option<Instant>,
    },
    /// Labels: the text as it stands, or a number in its shortest form.
    Label {
        /// Which column of the description.
        column: usize,
    },
}

impl WantedColumn {
    /// Which column of the description.
    pub const fn column(self) -> usize {
        match self {
            Self::Number { column, .. } | Self::Time { column, .. } | Self::Label { column } => column,
        }
    }

    /// Another column that is wanted in the same way.
    pub(crate) const fn of(self, column: usize) -> Self {
        match self {
            Self::Number { power, .. } => Self::Number { column, power },
            Self::Time { unit, origin, .. } => Self::Time { column, unit, origin },
            Self::Label { .. } => Self::Label { column },
        }
    }

    /// Whether it is of labels; all else are numbers.
    pub const fn is_label(self) -> bool {
        matches!(self, Self::Label { .. })
    }

    /// The column of the times among what is wanted, what it counts and from where on. A second one is refused: a block has
    /// one origin.
    pub fn time(wanted: &[Self], format: &'static str) -> Result<Option<(usize, TimeUnit, Option<Instant>)>> {
        let mut times = wanted.iter().filter_map(|want| match *want {
            Self::Time { column, unit, origin } => Some((column, unit, origin)),
            _ => None,
        });
        let first = times.next();
        refuse_if(times.next().is_some(), || {
            FormatError::unsupported(format, "a second column as the times of the rows", "name one")
        })?;
        Ok(first)
    }
}

/// A table that is being read, from its first row to its last.
pub trait Table: Send {
    /// What is known of it.
    fn description(&self) -> &TableDescription;

    /// States what to read; before the first block.
    fn want(&mut self, wanted: &[WantedColumn]) -> Result<()>;

    /// What the format says of a column of times by itself; `None` where its name or somebody has to say what it counts.
    fn time_kind(&self, _column: usize) -> Option<TimeKind> {
        None
    }

    /// The line of the names, for messages; 1 where a format has no lines.
    fn header_line(&self) -> u64 {
        1
    }

    /// Reads the next rows into `block`, whose former contents are dropped and whose memory is used again; at most
    /// as many as its capacity. Neither row nor fault is the end of the table.
    fn read(&mut self, block: &mut Block) -> Result<()>;

    /// How far it has come and how far there is to go, in bytes of the file; 0 where the whole is not known.
    fn progress(&self) -> (u64, u64);

    /// The digest of the file once its end is read, where it is read from its first byte to its last.
    fn digest(&mut self) -> Option<Digest> {
        None
    }
}

/// Refuses columns that do not stand beside each other.
pub(crate) fn refuse_apart<'a>(format: &'static str, wanted: impl Iterator<Item = &'a Column>) -> Result<()> {
    let mut first: Option<&Column> = None;
    for column in wanted {
        let of = *first.get_or_insert(column);
        if of.group != column.group {
            let (apart, other) = if of.group == 0 { (column, of) } else { (of, column) };
            let why = apart.apart.as_deref().unwrap_or("its samples have other times");
            return Err(FormatError::unsupported(
                format,
                format!("`{}` together with `{}` ({why})", apart.name, other.name),
                "name columns that were sampled together, or this one alone with `clock = { rate = … }`",
            ));
        }
    }
    Ok(())
}

/// Which columns are under a checksum, each with the one that it has.
pub(crate) fn protection(columns: &[(String, Option<&'static str>)]) -> String {
    let sums: BTreeSet<&str> = columns.iter().filter_map(|(_, sum)| *sum).collect();
    let without: Vec<String> =
        columns.iter().filter(|(_, sum)| sum.is_none()).map(|(name, _)| format!("`{name}`")).collect();
    let sums = sums.into_iter().collect::<Vec<_>>().join(", ");
    match (sums.is_empty(), without.is_empty()) {
        (true, _) => {
            "The file has no checksum over its numbers: that one of them was damaged cannot be found."
                .to_owned()
        }
        (false, true) => format!("Every number is under a checksum ({sums}), which was compared."),
        (false, false) => format!(
            "Checksums ({sums}) were compared for all columns but {}, in which damage cannot be found.",
            limits::list(&without)
        ),
    }
}

/// Which bytes were read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Digest {
    /// SHA-256 of all, in hexadecimal.
    pub sha256: String,
    /// How many there are.
    pub bytes: u64,
}

impl Digest {
    pub(crate) fn new(hash: Sha256, bytes: u64) -> Self {
        let digits = |text: String, byte: &u8| text + &format!("{byte:02x}");
        Self { sha256: hash.finalize().iter().fold(String::new(), digits), bytes }
    }
}

/// How many bytes of a file of so many stand for the rows until one of them, where all rows are as long.
pub(crate) fn bytes_until((row, rows): (u64, u64), file_bytes: u64) -> u64 {
    let part = if rows == 0 { 0.0 } else { row as f64 / rows as f64 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a part of a length
    let bytes = (file_bytes as f64 * part) as u64;
    bytes
}

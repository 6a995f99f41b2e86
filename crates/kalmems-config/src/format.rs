//! How a file of samples is written, where it does not say so itself.

use kalmems_formats::{CsvHints, Format, Hints};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU64;

/// How a file is written, where that cannot be told from it or is told wrongly.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileFormat {
    /// The format.
    pub kind: FileKind,
    /// Where the samples are in a file of several tables: a group of HDF5 or TDMS, a matrix of MAT, an array of NPZ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// The names of all columns of the file with their units, in their order, in place of those that it has or where it has
    /// none: `["time_s", "cap_V"]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns: Option<Vec<String>>,
    /// Text: what stands between the cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub separator: Option<Separator>,
    /// Text: the decimal mark.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<DecimalMark>,
    /// Text: the line of the names, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub header_line: Option<NonZeroU64>,
    /// Text: the line of the units, where they have one of their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units_line: Option<NonZeroU64>,
    /// Text: the line of the first row, where it is not the one after the names and the units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_row_line: Option<NonZeroU64>,
}

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FileKind {
    /// Text, a row a line.
    Csv,
    /// One NumPy array.
    Npy,
    /// A zip file of NumPy arrays.
    Npz,
    /// Apache Parquet.
    Parquet,
    /// HDF5, and MAT files from version 7.3 on.
    Hdf5,
    /// MAT files of version 5 to 7.
    Mat,
    /// The files of LabVIEW in binary form.
    Tdms,
    /// Sound.
    Wav,
}

/// What stands between the cells of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Separator {
    /// A comma.
    #[serde(rename = ",")]
    Comma,
    /// A semicolon.
    #[serde(rename = ";")]
    Semicolon,
    /// A vertical bar.
    #[serde(rename = "|")]
    Bar,
    /// A tab, `"\t"`.
    #[serde(rename = "\t")]
    Tab,
    /// Blanks and tabs, as many as there are, `" "`.
    #[serde(rename = " ")]
    Blanks,
}

/// The decimal mark of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum DecimalMark {
    /// A point.
    #[serde(rename = ".")]
    Point,
    /// A comma.
    #[serde(rename = ",")]
    Comma,
}

impl FileFormat {
    /// What is told to the reader of the file.
    pub fn hints(&self) -> Hints {
        Hints {
            format: Some(match self.kind {
                FileKind::Csv => Format::Csv,
                FileKind::Npy => Format::Npy,
                FileKind::Npz => Format::Npz,
                FileKind::Parquet => Format::Parquet,
                FileKind::Hdf5 => Format::Hdf5,
                FileKind::Mat => Format::Mat,
                FileKind::Tdms => Format::Tdms,
                FileKind::Wav => Format::Wav,
            }),
            group: self.group.clone(),
            columns: self.columns.clone(),
            csv: CsvHints {
                separator: self.separator.map(|separator| match separator {
                    Separator::Comma => ',',
                    Separator::Semicolon => ';',
                    Separator::Bar => '|',
                    Separator::Tab => '\t',
                    Separator::Blanks => ' ',
                }),
                decimal: self.decimal.map(|mark| match mark {
                    DecimalMark::Point => '.',
                    DecimalMark::Comma => ',',
                }),
                header_line: self.header_line.map(NonZeroU64::get),
                units_line: self.units_line.map(NonZeroU64::get),
                first_row_line: self.first_row_line.map(NonZeroU64::get),
            },
            arrays: None,
        }
    }
}

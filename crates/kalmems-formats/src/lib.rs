//! Tables of numbers in the files that laboratories have, read block by block.
//!
//! A [`Table`] is columns of numbers with names, in a file of some format. It knows nothing of units, devices or
//! segments; what the numbers mean is the workbench's business. It is read from front to back in blocks, so that
//! memory is bounded by a block and not by the file. What is no number is told cell by cell and never replaced.

// What several formats share is of no use to each of them alone.
#![cfg_attr(
    not(all(
        feature = "hdf5",
        feature = "mat",
        feature = "npy",
        feature = "parquet",
        feature = "tdms",
        feature = "wav"
    )),
    allow(dead_code, unused_imports, unused_variables)
)]

mod arrays;
mod block;
mod clock;
mod csv;
mod cursor;
mod decimal;
mod element;
mod error;
#[cfg(feature = "hdf5")]
mod hdf5;
mod lanes;
mod length;
mod limits;
#[cfg(feature = "mat")]
mod mat;
mod name;
#[cfg(feature = "npy")]
mod npy;
mod open;
mod panics;
#[cfg(feature = "parquet")]
mod parquet;
mod records;
mod scaling;
mod sentinels;
mod source;
mod stated_clock;
mod stream;
mod table;
mod table_parts;
#[cfg(feature = "tdms")]
mod tdms;
mod time;
mod unit_spellings;
#[cfg(feature = "wav")]
mod wav;

pub use arrays::{Array, ArrayType, Arrays};
pub use block::{Block, CellFault, CellFinding, Labels};
pub use csv::{CellReader, CsvHints, is_value, may_be_grouped, open_csv, read_csv};
pub use decimal::Shift;
pub use error::FormatError;
pub(crate) use error::{Result, refuse_if};
pub use length::has_more_rows;
pub use name::example_names;
pub use open::{Format, Hints, open, open_reader};
pub use panics::panic_is_caught;
pub use source::ReadSeek;
pub use table::{Column, Digest, OmittedPart, Table, TableDescription, TableEvidence, WantedColumn};
pub use time::{Instant, LABVIEW_ZERO_S, NoInstant, SPREADSHEET_ZERO_S, TimeKind, TimeReader, TimeUnit};
pub use unit_spellings::unit_ending;

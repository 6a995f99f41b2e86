//! Tables of numbers in the files that laboratories have, read block by block.
//!
//! A [`Table`] is columns of numbers with names, in a file of some format. It knows nothing of units, devices or
//! segments; what the numbers mean is the workbench's business. It is read from front to back in blocks, so that
//! memory is bounded by a block and not by the file. What is no number is told cell by cell and never replaced.

mod block;
mod csv;
mod decimal;
mod error;
mod open;
mod source;
mod table;

pub use block::{Block, CellFault, Fault, Labels};
pub use csv::{CsvHints, open_csv, read_csv};
pub use decimal::Shift;
pub use error::FormatError;
pub use open::{Hints, open};
pub use source::ReadSeek;
pub use table::{Column, Description, Digest, Table, Wanted};

//! Tables of numbers in the files that laboratories have, read block by block.
//!
//! A [`Table`] is columns of numbers with names, in a file of some format. It knows nothing of units, devices or
//! segments; what the numbers mean is the workbench's business. It is read from front to back in blocks, so that
//! memory is bounded by a block and not by the file. What is no number is told cell by cell and never replaced.

mod block;
mod csv;
mod decimal;
mod error;
mod limits;
mod name;
mod open;
mod source;
mod table;

pub use block::{Block, CellFault, Fault, Labels};
pub use csv::open_csv;
pub use error::FormatError;
pub use open::{Format, Hints, open, open_reader};
pub use source::ReadSeek;
pub use table::{Column, Description, Table, Wanted};

//! What the targets do, with a bounded memory: of a format all columns are read, a bounded number of blocks; of a
//! description all is made that needs no recording.

pub mod description;
mod limited;
pub mod table;

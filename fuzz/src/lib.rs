//! What the targets do, with a bounded memory: of a format all columns are read, a bounded number of blocks; of a
//! description all is made that needs no recording, and of equations all that is made of a device.

pub mod description;
pub mod equations;
mod limited;
pub mod table;

//! The bytes of a file, wherever they are.

use std::io::{Read, Seek};

/// What a table can be read from: a file, or bytes in memory.
pub trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

//! Where samples come from, as the user names it.

#[cfg(not(target_family = "wasm"))]
use super::wires;
use kalmems::stream::Connection;
use std::fs::File;
use std::io::{self, Read};

/// Standard input, a file, a named pipe, or a connection.
pub fn open(from: &str, baud: Option<u32>) -> io::Result<Box<dyn Connection>> {
    if let Some(wire) = wire(from, baud)? {
        return Ok(wire);
    }
    Ok(if from == "-" { Box::new(Standard) } else { Box::new(Path(from.to_owned())) })
}

#[cfg(not(target_family = "wasm"))]
fn wire(from: &str, baud: Option<u32>) -> io::Result<Option<Box<dyn Connection>>> {
    wires::open(from, baud)
}

/// There are none in a browser.
#[cfg(target_family = "wasm")]
fn wire(from: &str, baud: Option<u32>) -> io::Result<Option<Box<dyn Connection>>> {
    if baud.is_some() || from.contains("://") {
        let why = "a browser has no connections and no serial devices here: give a file";
        return Err(io::Error::new(io::ErrorKind::Unsupported, why));
    }
    Ok(None)
}

struct Standard;

impl Connection for Standard {
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
        Ok(Some(Box::new(io::stdin())))
    }

    fn is_live(&self) -> bool {
        true
    }
}

/// A file or a named pipe.
struct Path(String);

impl Connection for Path {
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
        Ok(Some(Box::new(File::open(&self.0)?)))
    }

    /// What lies in a file was taken before.
    fn is_live(&self) -> bool {
        !std::path::Path::new(&self.0).is_file()
    }
}

//! Records in stretches of a file, as they are or packed.

use crate::FormatError;
use crate::records::RecordLane;
use crate::source::SharedFile;
use std::sync::Arc;

/// Records one after the other, unpacked.
pub(crate) struct UnpackedRecords {
    pub(crate) source: Arc<SharedFile>,
    pub(crate) format: &'static str,
    pub(crate) offset: u64,
    pub(crate) record: usize,
}

impl RecordLane for UnpackedRecords {
    fn record(&self) -> usize {
        self.record
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.resize(rows * self.record, 0);
        self.source.read_exact(self.format, self.offset, out)?;
        self.offset += out.len() as u64;
        Ok(())
    }
}

/// Texts that are in memory.
#[cfg(any(feature = "mat", feature = "hdf5"))]
pub(crate) struct TextLane {
    pub(crate) texts: Vec<Vec<u8>>,
    pub(crate) next: usize,
}

#[cfg(any(feature = "mat", feature = "hdf5"))]
impl RecordLane for TextLane {
    fn record(&self) -> usize {
        0
    }

    fn read(&mut self, _rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        Ok(())
    }

    fn texts(&mut self, rows: usize, out: &mut Vec<Vec<u8>>) -> Result<(), FormatError> {
        out.clear();
        out.extend(self.texts.iter().skip(self.next).take(rows).cloned());
        self.next += rows;
        Ok(())
    }
}

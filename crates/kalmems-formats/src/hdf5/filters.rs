//! What packs the chunks of an HDF5 dataset (HDF5 File Format Specification, version 3), undone.

use super::file::MetadataCursor;
use crate::{Result, refuse_if};
use flate2::{Decompress, FlushDecompress, Status};

/// Filters of a dataset.
const FILTERS: u8 = 32;

/// A filter of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DatasetFilter {
    Deflate,
    /// The first bytes of all elements, then the second ones, and so on.
    Shuffle,
    Fletcher32,
    /// LibLZF, which h5py brings.
    Lzf,
}

impl DatasetFilter {
    /// Which checksum it brings.
    pub(super) const fn protection(self) -> Option<&'static str> {
        match self {
            Self::Deflate => Some("Adler-32"),
            Self::Fletcher32 => Some("Fletcher-32"),
            Self::Shuffle | Self::Lzf => None,
        }
    }

    pub(super) fn of(id: u16) -> Option<Self> {
        match id {
            1 => Some(Self::Deflate),
            2 => Some(Self::Shuffle),
            3 => Some(Self::Fletcher32),
            32_000 => Some(Self::Lzf),
            _ => None,
        }
    }
}

/// What the registered filters that are not read are called.
pub(super) fn name(id: u16) -> String {
    let name = match id {
        4 => "szip",
        5 => "nbit",
        6 => "scale-offset",
        307 => "bzip2",
        32_001 => "Blosc",
        32_004 => "LZ4",
        32_008 => "bitshuffle",
        32_013 => "ZFP",
        32_015 => "Zstandard",
        32_026 => "Blosc2",
        _ => return format!("the filter {id}"),
    };
    name.to_owned()
}

/// The identifiers of the filters of a dataset, in the order in which they were applied.
pub(super) fn read(cursor: &mut MetadataCursor<'_>) -> Result<Vec<u16>> {
    let (version, count) = (cursor.u8()?, cursor.u8()?);
    refuse_if(!(1..=2).contains(&version) || count > FILTERS, || {
        cursor.damaged(format!("version {version} of {count} filters"), "version 1 or 2 of at most 32")
    })?;
    if version == 1 {
        cursor.skip(6)?;
    }
    let mut filters = Vec::new();
    for _ in 0..count {
        let id = cursor.u16()?;
        let name = if version == 1 || id >= 256 { usize::from(cursor.u16()?) } else { 0 };
        let values = usize::from(cursor.skip(2)?.u16()?);
        cursor.skip(if version == 1 { name.next_multiple_of(8) } else { name })?;
        // Of the first version their number is even.
        cursor.skip(4 * if version == 1 { values.next_multiple_of(2) } else { values })?;
        filters.push(id);
    }
    Ok(filters)
}

/// Undoes the filters of a chunk, the last first, but for those in `mask`. `bytes` is the length of the chunk, and
/// nothing grows beyond it by more than a checksum.
pub(super) fn undo(
    filters: &[DatasetFilter],
    mask: u32,
    element: usize,
    bytes: usize,
    mut chunk: Vec<u8>,
) -> Result<Vec<u8>, String> {
    for (place, filter) in filters.iter().enumerate().rev() {
        if u32::try_from(place).is_ok_and(|place| mask.checked_shr(place).unwrap_or(0) & 1 != 0) {
            continue;
        }
        chunk = match filter {
            DatasetFilter::Deflate => inflate(&chunk, bytes + 4)?,
            DatasetFilter::Lzf => lzf(&chunk, bytes + 4)?,
            DatasetFilter::Shuffle => unshuffle(&chunk, element),
            DatasetFilter::Fletcher32 => checked(chunk)?,
        };
    }
    if chunk.len() == bytes {
        return Ok(chunk);
    }
    Err(format!("{} bytes instead of {bytes}", chunk.len()))
}

fn inflate(packed: &[u8], limit: usize) -> Result<Vec<u8>, String> {
    let mut unpacked = vec![0; limit];
    let mut engine = Decompress::new(true);
    let status =
        engine.decompress(packed, &mut unpacked, FlushDecompress::Finish).map_err(|e| e.to_string())?;
    refuse_if(status != Status::StreamEnd, || "packed bytes that unpack to more, or do not end".to_owned())?;
    let left = packed.len() as u64 - engine.total_in();
    refuse_if(left > 0, || format!("{left} bytes after what is packed"))?;
    unpacked.truncate(usize::try_from(engine.total_out()).unwrap_or(limit));
    Ok(unpacked)
}

fn unshuffle(shuffled: &[u8], element: usize) -> Vec<u8> {
    let count = shuffled.len() / element.max(1);
    if element < 2 {
        return shuffled.to_vec();
    }
    let mut bytes = vec![0; shuffled.len()];
    for place in 0..element {
        let column = &shuffled[place * count..(place + 1) * count];
        for (cell, byte) in bytes.iter_mut().skip(place).step_by(element).zip(column) {
            *cell = *byte;
        }
    }
    // What does not fill an element is left where it is.
    let whole = count * element;
    bytes[whole..].copy_from_slice(&shuffled[whole..]);
    bytes
}

/// J. G. Fletcher's checksum (IEEE Trans. Commun. 30 (1982) 247) over words of 16 bits, the high byte first.
fn checked(mut chunk: Vec<u8>) -> Result<Vec<u8>, String> {
    let Some(end) = chunk.len().checked_sub(4) else { return Err("no checksum".to_owned()) };
    let stored = u32::from_le_bytes([chunk[end], chunk[end + 1], chunk[end + 2], chunk[end + 3]]);
    chunk.truncate(end);
    let (mut first, mut second) = (0_u32, 0_u32);
    // As many words as sums of 32 bits hold.
    for words in chunk.chunks(2 * 360) {
        for word in words.chunks(2) {
            first += u32::from(word[0]) << 8 | word.get(1).map_or(0, |low| u32::from(*low));
            second += first;
        }
        first = (first & 0xffff) + (first >> 16);
        second = (second & 0xffff) + (second >> 16);
    }
    first = (first & 0xffff) + (first >> 16);
    second = (second & 0xffff) + (second >> 16);
    let sum = second << 16 | first;
    if sum == stored { Ok(chunk) } else { Err(format!("a checksum of {sum:08x}, and {stored:08x} stored")) }
}

fn lzf(packed: &[u8], limit: usize) -> Result<Vec<u8>, String> {
    let mut unpacked: Vec<u8> = Vec::new();
    let mut bytes = packed.iter().copied();
    let ended = || "packed bytes that end too early".to_owned();
    while let Some(control) = bytes.next() {
        let control = usize::from(control);
        if control < 32 {
            for _ in 0..=control {
                unpacked.push(bytes.next().ok_or_else(ended)?);
            }
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(bytes.next().ok_or_else(ended)?);
            }
            let back = ((control & 31) << 8) + usize::from(bytes.next().ok_or_else(ended)?) + 1;
            let start =
                unpacked.len().checked_sub(back).ok_or("packed bytes that refer to before their begin")?;
            // What is copied may be what was just written.
            for place in start..start + length + 2 {
                unpacked.push(unpacked[place]);
            }
        }
        refuse_if(unpacked.len() > limit, || "packed bytes that unpack to more".to_owned())?;
    }
    Ok(unpacked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_put_together_again() {
        assert_eq!(unshuffle(&[1, 4, 2, 5, 3, 6, 7], 3), [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(undo(&[DatasetFilter::Shuffle], 1, 2, 4, vec![1, 2, 3, 4]), Ok(vec![1, 2, 3, 4]));
    }

    #[test]
    fn bombs_stop_at_the_length_of_a_chunk() {
        let mut packer = flate2::Compress::new(flate2::Compression::best(), true);
        let mut packed = Vec::with_capacity(1 << 20);
        packer.compress_vec(&vec![0; 8 << 20], &mut packed, flate2::FlushCompress::Finish).unwrap();
        assert!(packed.len() < 16 << 10);
        assert!(undo(&[DatasetFilter::Deflate], 0, 8, 4096, packed).is_err());
        // A literal, and copies of 264 bytes of it.
        let mut packed = vec![0, 7];
        packed.extend([0xe0, 255, 0].repeat(1000));
        assert!(undo(&[DatasetFilter::Lzf], 0, 8, 4096, packed).is_err());
        assert!(lzf(&[0x20, 0], 8).is_err());
    }
}

//! The directory of a zip file (PKWARE's APPNOTE 6.3), as far as NumPy writes it.

use crate::FormatError;
use crate::limits;
use crate::source::SharedFile;
use crate::stream::{Compression, FileStretch};
use std::sync::Arc;

const FORMAT: &str = "NPZ";
/// The last record with the longest comment, and what long files put before it.
const TAIL: u64 = 22 + 65_535 + 20;

/// A file in the zip file.
pub(super) struct ZipMember {
    pub(super) name: String,
    unpacked: u64,
    packed: u64,
    method: u16,
    encrypted: bool,
    crc: u32,
    /// Its own header.
    header: u64,
}

/// Reads the directory.
pub(super) fn members(source: &SharedFile) -> Result<Vec<ZipMember>, FormatError> {
    let (entries, offset, size) = directory(source)?;
    limits::at_most(FORMAT, "the number of members", entries, limits::COLUMNS as u64)?;
    limits::at_most(FORMAT, "the length of the directory", size, limits::HEADER_BYTES)?;
    #[allow(clippy::cast_possible_truncation)] // bounded by the line above
    let bytes = source.bytes(FORMAT, offset, size as usize)?;
    let mut members: Vec<ZipMember> = Vec::new();
    let mut at = 0;
    for _ in 0..entries {
        let place = offset + at as u64;
        let fixed = bytes.get(at..at + 46).filter(|fixed| fixed.starts_with(b"PK\x01\x02"));
        let fixed = fixed.ok_or_else(|| damaged(place, "no entry of the directory", "one more"))?;
        let (name, extra) = (usize::from(u16_at(fixed, 28)), usize::from(u16_at(fixed, 30)));
        let comment = usize::from(u16_at(fixed, 32));
        let end = at + 46 + name + extra + comment;
        let (Some(name_bytes), Some(extra_bytes), true) = (
            bytes.get(at + 46..at + 46 + name),
            bytes.get(at + 46 + name..at + 46 + name + extra),
            end <= bytes.len(),
        ) else {
            return Err(damaged(place, "an entry beyond the directory", "an entry that ends in it"));
        };
        if name > limits::TEXT_BYTES {
            return Err(damaged(place, "a name of more than 4096 bytes", "a shorter one"));
        }
        let mut member = ZipMember {
            name: String::from_utf8_lossy(name_bytes).into_owned(),
            unpacked: u64::from(u32_at(fixed, 24)),
            packed: u64::from(u32_at(fixed, 20)),
            method: u16_at(fixed, 10),
            encrypted: u16_at(fixed, 8) & 1 != 0,
            crc: u32_at(fixed, 16),
            header: u64::from(u32_at(fixed, 42)),
        };
        member.widen(extra_bytes, place)?;
        members.push(member);
        at = end;
    }
    refuse_overlaps(source, &members, offset)?;
    Ok(members)
}

impl ZipMember {
    /// Takes the lengths of 64 bits where those of 32 are not enough.
    fn widen(&mut self, mut extra: &[u8], place: u64) -> Result<(), FormatError> {
        let elsewhere = u64::from(u32::MAX);
        while extra.len() >= 4 {
            let (id, length) = (u16_at(extra, 0), usize::from(u16_at(extra, 2)));
            let Some(mut body) = extra.get(4..4 + length) else { break };
            if id == 1 {
                for long in [&mut self.unpacked, &mut self.packed, &mut self.header] {
                    if *long == elsewhere {
                        if body.len() < 8 {
                            return Err(damaged(place, "a long length that is missing", "8 bytes for each"));
                        }
                        *long = u64_at(body, 0);
                        body = &body[8..];
                    }
                }
            }
            extra = &extra[4 + length..];
        }
        Ok(())
    }

    /// Where its bytes are.
    pub(super) fn stretch(&self, source: Arc<SharedFile>) -> Result<FileStretch, FormatError> {
        let unsupported = |what: &str| {
            FormatError::unsupported(
                FORMAT,
                format!("`{}`, which is {what},", self.name),
                "write the file with numpy.savez or numpy.savez_compressed",
            )
        };
        if self.encrypted {
            return Err(unsupported("encrypted"));
        }
        let packing = match self.method {
            0 => Compression::Stored,
            8 => Compression::Deflate,
            other => return Err(unsupported(&format!("packed by method {other}"))),
        };
        let header = source.bytes(FORMAT, self.header, 30)?;
        if !header.starts_with(b"PK\x03\x04") {
            return Err(damaged(self.header, "no member", "a header of one"));
        }
        // The directory and the member's own header both have its name and its method.
        let own_name = source.bytes(FORMAT, self.header + 30, usize::from(u16_at(&header, 26)))?;
        if String::from_utf8_lossy(&own_name) != self.name || u16_at(&header, 8) != self.method {
            let found =
                format!("a header of `{}`, packed by method {}", own_name.escape_ascii(), u16_at(&header, 8));
            let expected =
                format!("that of `{}`, packed by method {}, as the directory says", self.name, self.method);
            return Err(damaged(self.header, &found, &expected));
        }
        let start = self.header + 30 + own_name.len() as u64 + u64::from(u16_at(&header, 28));
        let end = source.within(FORMAT, start, self.packed)?;
        if packing == Compression::Stored && self.packed != self.unpacked {
            return Err(damaged(self.header, "unpacked bytes of another length", "the same"));
        }
        limits::plausible_unpacked(FORMAT, &format!("`{}`", self.name), self.unpacked, self.packed)?;
        let name = format!("`{}`", self.name);
        let (unpacked, crc) = (self.unpacked, Some(self.crc));
        let verified = Arc::default();
        Ok(FileStretch { source, format: FORMAT, name, packing, start, end, unpacked, crc, verified })
    }
}

/// Members that share bytes unpack to more than the file could hold.
fn refuse_overlaps(source: &SharedFile, members: &[ZipMember], directory: u64) -> Result<(), FormatError> {
    let mut places: Vec<(u64, u64)> = Vec::new();
    for member in members {
        // A header of 30 bytes and its name are before the packed bytes.
        let length = (30 + member.name.len() as u64).saturating_add(member.packed);
        places.push((member.header, source.within(FORMAT, member.header, length).unwrap_or(u64::MAX)));
    }
    places.sort_unstable();
    let starts = places.iter().skip(1).map(|(start, _)| *start).chain([directory]);
    for ((start, end), next) in places.iter().zip(starts) {
        if *end > next {
            return Err(damaged(
                *start,
                "a member that reaches into what follows",
                "members one after the other",
            ));
        }
    }
    Ok(())
}

/// How many entries the directory has, where it begins, and its bytes.
fn directory(source: &SharedFile) -> Result<(u64, u64, u64), FormatError> {
    let tail_start = source.length().saturating_sub(TAIL);
    #[allow(clippy::cast_possible_truncation)] // at most TAIL
    let tail = source.bytes(FORMAT, tail_start, (source.length() - tail_start) as usize)?;
    let found = tail
        .windows(22)
        .rposition(|record| record.starts_with(b"PK\x05\x06"))
        .filter(|place| place + 22 + usize::from(u16_at(&tail, place + 20)) == tail.len());
    let Some(place) = found else {
        return Err(damaged(source.length(), "no end of a directory", "the end of a zip file that is whole"));
    };
    let last = &tail[place..];
    let (entries, size, offset) = (u16_at(last, 10), u32_at(last, 12), u32_at(last, 16));
    if entries < u16::MAX && size < u32::MAX && offset < u32::MAX {
        return Ok((u64::from(entries), u64::from(offset), u64::from(size)));
    }
    let locator = place.checked_sub(20).map(|start| &tail[start..place]);
    let Some(locator) = locator.filter(|locator| locator.starts_with(b"PK\x06\x07")) else {
        return Ok((u64::from(entries), u64::from(offset), u64::from(size)));
    };
    let long = source.bytes(FORMAT, u64_at(locator, 8), 56)?;
    if !long.starts_with(b"PK\x06\x06") {
        return Err(damaged(u64_at(locator, 8), "no end of a long directory", "one"));
    }
    Ok((u64_at(&long, 32), u64_at(&long, 48), u64_at(&long, 40)))
}

fn u16_at(bytes: &[u8], place: usize) -> u16 {
    u16::from_le_bytes([bytes[place], bytes[place + 1]])
}

fn u32_at(bytes: &[u8], place: usize) -> u32 {
    u32::from(u16_at(bytes, place)) | u32::from(u16_at(bytes, place + 2)) << 16
}

fn u64_at(bytes: &[u8], place: usize) -> u64 {
    u64::from(u32_at(bytes, place)) | u64::from(u32_at(bytes, place + 4)) << 32
}

fn damaged(place: u64, found: &str, expected: &str) -> FormatError {
    FormatError::damaged(FORMAT, format!("byte {place}"), found, expected)
}

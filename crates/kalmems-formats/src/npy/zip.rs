//! The directory of a zip file (PKWARE's APPNOTE 6.3), as far as NumPy writes it.

use crate::FormatError;
use crate::cursor::ByteCursor;
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
    let bytes = source.bytes(FORMAT, offset, size)?;
    let mut members: Vec<ZipMember> = Vec::new();
    let mut cursor = ByteCursor::new(FORMAT, &bytes, offset);
    for _ in 0..entries {
        cursor.mark(b"PK\x01\x02")?.skip(4)?;
        let (flags, method) = (cursor.u16()?, cursor.u16()?);
        let (crc, packed, unpacked) = (cursor.skip(4)?.u32()?, cursor.u32()?, cursor.u32()?);
        let (name, extra, comment) = (cursor.u16()?, cursor.u16()?, cursor.u16()?);
        let header = cursor.skip(8)?.u32()?;
        if usize::from(name) > limits::TEXT_BYTES {
            return Err(cursor.damaged("a name of more than 4096 bytes", "a shorter one"));
        }
        let mut member = ZipMember {
            name: cursor.text(usize::from(name))?,
            unpacked: u64::from(unpacked),
            packed: u64::from(packed),
            method,
            encrypted: flags & 1 != 0,
            crc,
            header: u64::from(header),
        };
        member.widen(&mut cursor.part(usize::from(extra))?)?;
        cursor.skip(usize::from(comment))?;
        members.push(member);
    }
    refuse_overlaps(source, &members, offset)?;
    Ok(members)
}

impl ZipMember {
    /// Takes the lengths of 64 bits where those of 32 are not enough.
    fn widen(&mut self, extra: &mut ByteCursor<'_>) -> Result<(), FormatError> {
        let elsewhere = u64::from(u32::MAX);
        while extra.left() >= 4 {
            let (id, length) = (extra.u16()?, usize::from(extra.u16()?));
            let mut body = extra.part(length.min(extra.left()))?;
            let lengths = [&mut self.unpacked, &mut self.packed, &mut self.header];
            for long in lengths.into_iter().filter(|long| id == 1 && **long == elsewhere) {
                *long = body.u64()?;
            }
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
        let mut header = ByteCursor::new(FORMAT, &header, self.header);
        let method = header.mark(b"PK\x03\x04")?.skip(4)?.u16()?;
        let (name, extra) = (header.skip(16)?.u16()?, header.u16()?);
        // The directory and the member's own header both have its name and its method.
        let own_name = source.bytes(FORMAT, self.header + 30, u64::from(name))?;
        if String::from_utf8_lossy(&own_name) != self.name || method != self.method {
            let found = format!("a header of `{}`, packed by method {method}", own_name.escape_ascii());
            let expected =
                format!("that of `{}`, packed by method {}, as the directory says", self.name, self.method);
            return Err(damaged(self.header, &found, &expected));
        }
        let start = self.header + 30 + u64::from(name) + u64::from(extra);
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
    let tail = source.bytes(FORMAT, tail_start, source.length() - tail_start)?;
    let ends_there = |place: &usize| {
        let mut end = ByteCursor::new(FORMAT, &tail[*place..], 0);
        end.skip(20).and_then(ByteCursor::u16).is_ok_and(|comment| usize::from(comment) == end.left())
    };
    let found = tail.windows(22).rposition(|record| record.starts_with(b"PK\x05\x06")).filter(ends_there);
    let Some(place) = found else {
        return Err(damaged(source.length(), "no end of a directory", "the end of a zip file that is whole"));
    };
    let mut last = ByteCursor::new(FORMAT, &tail[place..], tail_start + place as u64);
    let (entries, size, offset) = (last.skip(10)?.u16()?, last.u32()?, last.u32()?);
    let short = (u64::from(entries), u64::from(offset), u64::from(size));
    if entries < u16::MAX && size < u32::MAX && offset < u32::MAX {
        return Ok(short);
    }
    let locator = place.checked_sub(20).map(|start| &tail[start..place]);
    let Some(locator) = locator.filter(|locator| locator.starts_with(b"PK\x06\x07")) else {
        return Ok(short);
    };
    let at = ByteCursor::new(FORMAT, locator, 0).skip(8)?.u64()?;
    let long = source.bytes(FORMAT, at, 56)?;
    let mut long = ByteCursor::new(FORMAT, &long, at);
    let (entries, size, offset) = (long.mark(b"PK\x06\x06")?.skip(28)?.u64()?, long.u64()?, long.u64()?);
    Ok((entries, offset, size))
}

fn damaged(place: u64, found: &str, expected: &str) -> FormatError {
    FormatError::damaged_at(FORMAT, place, found, expected)
}

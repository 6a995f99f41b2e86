//! The header of an object: its messages (HDF5 File Format Specification, section IV.A).

use super::file::{Hdf5File, LENGTH, MetadataCursor, check_sum};
use super::{FORMAT, unsupported};
use crate::{Result, limits, refuse_if};

/// Blocks that a header is continued in.
const BLOCKS: usize = 4096;

/// Bytes before the messages of a header: its mark, four times, two numbers of attributes, and its length.
const LONGEST_PREFIX: u64 = 6 + 16 + 4 + 8;

/// The kinds of messages that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub(super) enum MessageKind {
    Dataspace = 0x01,
    LinkInfo = 0x02,
    Datatype = 0x03,
    Link = 0x06,
    ExternalFiles = 0x07,
    Layout = 0x08,
    Filters = 0x0b,
    Attribute = 0x0c,
    Continuation = 0x10,
    SymbolTable = 0x11,
    AttributeInfo = 0x15,
}

/// A message.
struct HeaderMessage {
    kind: u16,
    /// It is elsewhere, and its body says where.
    shared: bool,
    place: u64,
    body: Vec<u8>,
}

/// The messages of an object.
pub(super) struct ObjectHeader {
    messages: Vec<HeaderMessage>,
}

impl ObjectHeader {
    pub(super) fn read(file: &Hdf5File, address: u64) -> Result<Self> {
        let mut header = Self { messages: Vec::new() };
        let mut blocks: Vec<(u64, u64)> = Vec::new();
        let start = file.block(address, LONGEST_PREFIX.min(file.source.length().saturating_sub(address)))?;
        let mut cursor = file.cursor(&start, address);
        let newer = start.starts_with(b"OHDR");
        let mut ordered = false;
        if newer {
            cursor.mark(b"OHDR")?;
            let (version, flags) = (cursor.u8()?, cursor.u8()?);
            refuse_if(version != 2, || {
                cursor.damaged(format!("version {version} of an object's header"), "2")
            })?;
            ordered = flags & 4 != 0;
            let width = 1 << (flags & 3);
            let prefix = if flags & 32 != 0 { 16 } else { 0 } + if flags & 16 != 0 { 4 } else { 0 };
            let bytes = cursor.skip(prefix)?.number(width)?;
            let (prefix, width) = (6 + prefix as u64, width as u64);
            let all = prefix.checked_add(width).and_then(|all| all.checked_add(bytes)?.checked_add(4));
            let all = all.ok_or_else(|| cursor.damaged(format!("a header of {bytes} bytes"), "fewer"))?;
            let block = file.block(address, all)?;
            let mut cursor = file.cursor(&block, address);
            #[allow(clippy::cast_possible_truncation)] // below 32
            cursor.skip((prefix + width) as usize)?;
            header.newer(&mut cursor, ordered, &mut blocks)?;
        } else {
            let version = cursor.u8()?;
            refuse_if(version != 1, || {
                cursor.damaged(format!("version {version} of an object's header"), "1 or 2")
            })?;
            let bytes = u64::from(cursor.skip(7)?.u32()?);
            let block = file.block(address + 16, bytes)?;
            header.older(&mut file.cursor(&block, address + 16), &mut blocks)?;
        }
        let mut next = 0;
        while let Some((place, bytes)) = blocks.get(next).copied() {
            next += 1;
            limits::at_most(FORMAT, "the number of parts of a header", next, BLOCKS)?;
            let block = file.block(place, bytes)?;
            let mut cursor = file.cursor(&block, place);
            if newer {
                cursor.mark(b"OCHK")?;
                header.newer(&mut cursor, ordered, &mut blocks)?;
            } else {
                header.older(&mut cursor, &mut blocks)?;
            }
        }
        Ok(header)
    }

    /// The messages of a block as it has been since the beginning.
    fn older(&mut self, cursor: &mut MetadataCursor<'_>, blocks: &mut Vec<(u64, u64)>) -> Result<()> {
        while cursor.left() >= 8 {
            let (kind, bytes) = (cursor.u16()?, usize::from(cursor.u16()?));
            let flags = cursor.u8()?;
            cursor.skip(3)?;
            self.add(kind, flags, &mut cursor.part(bytes)?, blocks)?;
        }
        Ok(())
    }

    /// The messages of a block that ends with a checksum.
    fn newer(
        &mut self,
        cursor: &mut MetadataCursor<'_>,
        ordered: bool,
        blocks: &mut Vec<(u64, u64)>,
    ) -> Result<()> {
        let prefix = if ordered { 6 } else { 4 };
        while cursor.left() >= prefix + 4 {
            let (kind, bytes) = (u16::from(cursor.u8()?), usize::from(cursor.u16()?));
            let flags = cursor.u8()?;
            cursor.skip(prefix - 4)?;
            self.add(kind, flags, &mut cursor.part(bytes)?, blocks)?;
        }
        // Fewer bytes than a message needs are a gap.
        let gap = cursor.left().checked_sub(4);
        check_sum(cursor.skip(gap.unwrap_or(0))?)
    }

    fn add(
        &mut self,
        kind: u16,
        flags: u8,
        body: &mut MetadataCursor<'_>,
        blocks: &mut Vec<(u64, u64)>,
    ) -> Result<()> {
        if kind == MessageKind::Continuation as u16 {
            blocks.push((body.known_address()?, body.u64()?));
            return Ok(());
        }
        let (place, shared) = (body.place(), flags & 2 != 0);
        let body = body.take(body.left())?.to_vec();
        let message = HeaderMessage { kind, shared, place, body };
        limits::push(FORMAT, "the number of messages of a header", &mut self.messages, message)
    }

    pub(super) fn has(&self, kind: MessageKind) -> bool {
        self.messages.iter().any(|message| message.kind == kind as u16)
    }

    /// Reads the first message of a kind; none where there is none.
    pub(super) fn first<T>(
        &self,
        file: &Hdf5File,
        kind: MessageKind,
        read: impl FnOnce(&mut MetadataCursor<'_>) -> Result<T>,
    ) -> Result<Option<T>> {
        let Some(message) = self.messages.iter().find(|message| message.kind == kind as u16) else {
            return Ok(None);
        };
        message.read(file, read).map(Some)
    }

    /// Reads all messages of a kind.
    pub(super) fn each(
        &self,
        file: &Hdf5File,
        kind: MessageKind,
        mut read: impl FnMut(&mut MetadataCursor<'_>) -> Result<()>,
    ) -> Result<()> {
        for message in self.messages.iter().filter(|message| message.kind == kind as u16) {
            message.read(file, &mut read)?;
        }
        Ok(())
    }
}

impl HeaderMessage {
    fn read<T>(&self, file: &Hdf5File, read: impl FnOnce(&mut MetadataCursor<'_>) -> Result<T>) -> Result<T> {
        let mut cursor = file.cursor(&self.body, self.place);
        if !self.shared {
            return read(&mut cursor);
        }
        let address = shared(&mut cursor)?;
        let header = ObjectHeader::read(file, address)?;
        let body = header.messages.iter().find(|other| other.kind == self.kind && !other.shared);
        let body = body
            .ok_or_else(|| cursor.damaged(format!("a message elsewhere, at byte {address}"), "it there"))?;
        read(&mut file.cursor(&body.body, body.place))
    }
}

/// The address of the object that holds a message.
pub(super) fn shared(cursor: &mut MetadataCursor<'_>) -> Result<u64> {
    let (version, kind) = (cursor.u8()?, cursor.u8()?);
    match (version, kind) {
        (1, _) => cursor.skip(6 + LENGTH)?.known_address(),
        (2, _) | (3, 2 | 3) => cursor.known_address(),
        (3, 1) => {
            let what = "an object whose description is in a table that objects share";
            Err(unsupported(what, "copy the file with h5repack"))
        }
        _ => Err(cursor.damaged(format!("version {version} of a message elsewhere"), "1 to 3")),
    }
}

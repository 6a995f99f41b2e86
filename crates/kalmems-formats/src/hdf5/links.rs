//! What is in a group: links to objects, to paths and into other files (HDF5 File Format Specification, sections III.B, C
//! and IV.A.2.g).

use super::file::{ADDRESS, Hdf5File, LENGTH, MetadataCursor};
use super::header::{MessageKind, ObjectHeader};
use super::heap::{self, LocalHeap};
use super::{FORMAT, tree};
use crate::{Result, limits, refuse_if};

/// The kinds of trees of links, by name and by the order in which they were made.
const BY_NAME: u8 = 5;
const BY_ORDER: u8 = 6;
/// The kind of an old tree of groups.
const GROUP: u8 = 0;

/// A name in a group.
pub(super) struct GroupLink {
    pub(super) name: String,
    pub(super) target: LinkTarget,
}

/// What a name stands for.
pub(super) enum LinkTarget {
    /// An object of this file, by the place of its header.
    Object(u64),
    /// A path in this file.
    Path(String),
    /// A path in another file.
    Elsewhere { file: String, path: String },
    /// A link of a kind that a program made for itself.
    Other,
}

/// Whether an object is a group.
pub(super) fn is_group(header: &ObjectHeader) -> bool {
    [MessageKind::SymbolTable, MessageKind::LinkInfo, MessageKind::Link]
        .into_iter()
        .any(|kind| header.has(kind))
}

/// The links of a group.
pub(super) fn links(file: &Hdf5File, header: &ObjectHeader) -> Result<Vec<GroupLink>> {
    let mut links = Vec::new();
    if let Some((nodes, names)) = header.first(file, MessageKind::SymbolTable, |cursor| {
        Ok((cursor.known_address()?, cursor.known_address()?))
    })? {
        let names = LocalHeap::read(file, names)?;
        tree::older(file, nodes, (GROUP, LENGTH, None), &mut |_, leaf| {
            entries(file, leaf, &names, &mut links)
        })?;
    }
    let mut read = |cursor: &mut MetadataCursor<'_>| push(&mut links, link(cursor)?);
    header.each(file, MessageKind::Link, &mut read)?;
    let skip = |kind| match kind {
        BY_NAME => Some(4),
        BY_ORDER => Some(8),
        _ => None,
    };
    heap::each_dense(file, header, MessageKind::LinkInfo, (8, &skip), &mut read)?;
    Ok(links)
}

fn push(links: &mut Vec<GroupLink>, link: GroupLink) -> Result<()> {
    limits::push(FORMAT, "the number of names in a group", links, link)
}

/// The entries of a leaf of an old group.
fn entries(file: &Hdf5File, place: u64, names: &LocalHeap, links: &mut Vec<GroupLink>) -> Result<()> {
    let head = file.block(place, 8)?;
    let mut cursor = file.cursor(&head, place);
    cursor.mark(b"SNOD")?;
    let count = u64::from(cursor.skip(2)?.u16()?);
    let entry = (2 * ADDRESS + 24) as u64;
    let block = file.block(place + 8, count * entry)?;
    let mut cursor = file.cursor(&block, place + 8);
    for _ in 0..count {
        let name = cursor.number(ADDRESS)?;
        let address = cursor.address()?;
        let kind = cursor.u32()?;
        let mut scratch = cursor.skip(4)?.part(16)?;
        let target = match (kind, address) {
            (2, _) => LinkTarget::Path(names.text(file, u64::from(scratch.u32()?))?),
            (_, Some(address)) => LinkTarget::Object(address),
            (_, None) => LinkTarget::Other,
        };
        push(links, GroupLink { name: names.text(file, name)?, target })?;
    }
    Ok(())
}

/// A message that is a link.
fn link(cursor: &mut MetadataCursor<'_>) -> Result<GroupLink> {
    let (version, flags) = (cursor.u8()?, cursor.u8()?);
    refuse_if(version != 1, || cursor.damaged(format!("version {version} of a link"), "1"))?;
    let kind = if flags & 8 != 0 { cursor.u8()? } else { 0 };
    if flags & 4 != 0 {
        cursor.skip(8)?;
    }
    if flags & 16 != 0 {
        cursor.skip(1)?;
    }
    let length = cursor.number(1 << (flags & 3))?;
    limits::at_most(FORMAT, "the length of a name", length, limits::TEXT_BYTES)?;
    #[allow(clippy::cast_possible_truncation)] // at most TEXT_BYTES
    let name = cursor.text(length as usize)?;
    let target = match kind {
        0 => LinkTarget::Object(cursor.known_address()?),
        1 => {
            let length = usize::from(cursor.u16()?);
            LinkTarget::Path(cursor.text(length)?)
        }
        64 => {
            // Version and flags are zero.
            cursor.skip(3)?;
            LinkTarget::Elsewhere { file: cursor.name()?, path: cursor.name()? }
        }
        _ => LinkTarget::Other,
    };
    Ok(GroupLink { name, target })
}

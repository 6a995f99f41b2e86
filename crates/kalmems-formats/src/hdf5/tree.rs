//! HDF5's B-trees, whose records are visited in their order (HDF5 File Format Specification, section III.A).

use super::file::{ADDRESS, Hdf5File, LENGTH, MetadataCursor, check_sum};
use crate::{Result, limits, refuse_if};

/// Levels of a tree.
const LEVELS: u8 = 32;

/// Visits the leaves of a tree of the first version: the key before each, and its address. `key` is the bytes of a key, and `above` the level of
/// the node that this one is in, which the first is in none.
pub(super) fn older(
    file: &Hdf5File,
    address: u64,
    (kind, key, above): (u8, usize, Option<u8>),
    visit: &mut dyn FnMut(&mut MetadataCursor<'_>, u64) -> Result<()>,
) -> Result<()> {
    let prefix = 8 + 2 * ADDRESS;
    let head = file.block(address, prefix as u64)?;
    let mut cursor = file.cursor(&head, address);
    cursor.mark(b"TREE")?;
    let (found, level) = (cursor.u8()?, cursor.u8()?);
    refuse_if(
        found != kind || level > LEVELS || above.is_some_and(|above| level.checked_add(1) != Some(above)),
        || {
            let expected = format!("kind {kind}, and each level below the one above it");
            cursor.damaged(format!("a node of kind {found} on level {level}"), &expected)
        },
    )?;
    let entries = usize::from(cursor.u16()?);
    let bytes = prefix + entries * (key + ADDRESS);
    let block = file.block(address, bytes as u64)?;
    let mut cursor = file.cursor(&block, address);
    cursor.skip(prefix)?;
    for _ in 0..entries {
        let mut before = cursor.part(key)?;
        let child = cursor.known_address()?;
        if level == 0 {
            visit(&mut before, child)?;
        } else {
            older(file, child, (kind, key, Some(level)), visit)?;
        }
    }
    Ok(())
}

/// Hears of a record of a tree of the second version, with the kind of tree.
type VisitRecord<'a> = &'a mut dyn FnMut(u8, &mut MetadataCursor<'_>) -> Result<()>;

/// Visits the records of a tree of the second version; the first argument is the kind of tree.
pub(super) fn newer(file: &Hdf5File, address: u64, visit: VisitRecord<'_>) -> Result<()> {
    let head = file.block(address, (22 + ADDRESS + LENGTH) as u64)?;
    let mut cursor = file.cursor(&head, address);
    cursor.mark(b"BTHD")?;
    let kind = cursor.skip(1)?.u8()?;
    let node_bytes = cursor.u32()?;
    let (record, depth) = (usize::from(cursor.u16()?), cursor.u16()?);
    let root = cursor.skip(2)?.address()?;
    let records = usize::from(cursor.u16()?);
    cursor.u64()?;
    check_sum(&mut cursor)?;
    let small = (node_bytes as usize) < 10 + record || record == 0 || depth > u16::from(LEVELS);
    refuse_if(small || u64::from(node_bytes) > limits::HEADER_BYTES, || {
        let nodes = format!("nodes of {node_bytes} bytes and records of {record}");
        let expected = "nodes that hold a record, and at most 32 levels";
        cursor.damaged(format!("a tree of {depth} levels with {nodes}"), expected)
    })?;
    // How many records a node of each level holds at most, which gives the width of what counts them.
    let width = |count: u64| (count.max(1).ilog2() / 8 + 1) as usize;
    let most = (node_bytes as usize - 10) / record;
    let own = width(most as u64);
    let mut levels = vec![(most as u64, 0_usize)];
    for _ in 0..depth {
        let (below, below_width) = levels.last().copied().unwrap_or_default();
        let pointer = ADDRESS + own + below_width;
        let count = (node_bytes as usize).saturating_sub(10 + pointer) / (record + pointer);
        let all = (count as u64 + 1).saturating_mul(below).saturating_add(count as u64);
        levels.push((all, width(all)));
    }
    let mut tree = BTree { file, kind, record, node_bytes, own, levels, visit };
    let Some(root) = root.filter(|_| records > 0) else { return Ok(()) };
    tree.node(root, usize::from(depth), records)
}

struct BTree<'a> {
    file: &'a Hdf5File,
    kind: u8,
    record: usize,
    node_bytes: u32,
    /// Width of the number of records of a node.
    own: usize,
    /// Records in and below a node of each level at most, and the width of their number.
    levels: Vec<(u64, usize)>,
    visit: VisitRecord<'a>,
}

impl BTree<'_> {
    fn node(&mut self, address: u64, level: usize, records: usize) -> Result<()> {
        // A leaf's pointers are none; the width of what counts all below is that of the level below.
        let below = level.checked_sub(1).and_then(|below| self.levels.get(below));
        let pointer = below.map_or(0, |(_, width)| ADDRESS + self.own + width);
        let children = if level == 0 { 0 } else { records + 1 };
        let bytes = 6 + records * self.record + children * pointer + 4;
        let block = self.file.block(address, (bytes as u64).min(u64::from(self.node_bytes)))?;
        let mut cursor = self.file.cursor(&block, address);
        cursor.mark(if level == 0 { b"BTLF" } else { b"BTIN" })?;
        let kind = cursor.skip(1)?.u8()?;
        refuse_if(kind != self.kind, || {
            cursor.damaged(format!("a node of kind {kind}"), &format!("{}", self.kind))
        })?;
        let mut own = cursor.part(records * self.record)?;
        let mut pointers = cursor.part(children * pointer)?;
        check_sum(&mut cursor)?;
        for number in 0..records.max(children) {
            if number < children {
                let child = pointers.known_address()?;
                let count = usize::try_from(pointers.number(self.own)?).unwrap_or(usize::MAX);
                pointers.skip(pointer - ADDRESS - self.own)?;
                limits::at_most(super::FORMAT, "the records of a node", count, u64::from(self.node_bytes))?;
                self.node(child, level - 1, count)?;
            }
            if number < records {
                (self.visit)(self.kind, &mut own.part(self.record)?)?;
            }
        }
        Ok(())
    }
}

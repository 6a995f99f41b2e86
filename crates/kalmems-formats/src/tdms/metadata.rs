//! What the segments of a TDMS file say of its objects (National Instruments, TDMS File Format Internal Structure).

use super::scales::{Properties, Property};
use crate::FormatError;
use crate::clock::ClockRun;
use crate::cursor::ByteCursor;
use crate::element::{Element, ElementKind};
use crate::limits;
use crate::records::StoredCell;
use crate::source::SharedFile;
use crate::time::{TimeCode, TimeForm};
use crate::{Result, TimeKind, TimeUnit, refuse_if};
use std::collections::HashMap;

pub(super) const FORMAT: &str = "TDMS";
/// Bytes before a segment's metadata.
const LEAD_IN: u64 = 28;
/// Versions of the format.
const VERSIONS: [u32; 2] = [4712, 4713];
/// Segments of a file; each is a few numbers in memory.
const SEGMENTS: u64 = 1 << 20;
/// Channels of all layouts together.
const PARTS: u64 = 1 << 20;
/// Properties, names and values of a file.
const METADATA_BYTES: u64 = 4 * limits::HEADER_BYTES;

/// What National Instruments' driver writes by itself.
const DAQMX: &str = "a file of raw values that DAQmx has logged";
const DAQMX_REMEDY: &str = "read it in LabVIEW, DIAdem or with npTDMS and write the scaled channels, or log with the \
                            scaled values in the first place";

/// The objects of a file and where their values are.
#[derive(Default)]
pub(super) struct TdmsFile {
    pub(super) channels: Vec<TdmsChannel>,
    pub(super) segments: Vec<RawSegment>,
    pub(super) layouts: Vec<ChunkLayout>,
    /// Bytes at the end that belong to no whole row, of a recording that was not ended.
    pub(super) left_over: u64,
    pub(super) unfinished: bool,
    /// The properties of the groups, by their names, and of the file.
    pub(super) groups: HashMap<String, Properties>,
    pub(super) root: Properties,
    numbers: HashMap<String, usize>,
    parts: u64,
    /// What a chunk holds differs from the last layout.
    changed: bool,
}

/// A channel.
#[derive(Default)]
pub(super) struct TdmsChannel {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) kind: Option<TdmsValue>,
    pub(super) rows: u64,
    pub(super) properties: Properties,
    /// What is stated of its times, from which of its rows on.
    pub(super) clocks: Vec<ClockRun>,
    /// What the last segment said of its values in one chunk.
    index: Option<RawDataIndex>,
    /// Whether it is in the list of objects of the last segment.
    active: bool,
}

/// What a channel's values are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TdmsValue {
    Stored(StoredCell),
    Text {
        big_endian: bool,
    },
    /// Anything else of a known length.
    Other {
        bytes: usize,
        what: &'static str,
    },
}

impl TdmsValue {
    fn bytes(self) -> u64 {
        match self {
            Self::Stored(cell) => cell.bytes() as u64,
            Self::Other { bytes, .. } => bytes as u64,
            Self::Text { .. } => 0,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct RawDataIndex {
    value: TdmsValue,
    rows: u64,
    /// All values together.
    bytes: u64,
}

/// A stretch of raw data: chunks of one layout, one after the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawSegment {
    pub(super) offset: u64,
    pub(super) chunks: u64,
    /// Rows that are whole in the chunk that the end of the file cuts.
    pub(super) cut_rows: u64,
    pub(super) layout: usize,
}

/// Where the values are in a chunk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChunkLayout {
    pub(super) chunk_bytes: u64,
    pub(super) interleaved: bool,
    pub(super) parts: Vec<ChunkPart>,
}

/// A channel's values in a chunk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChunkPart {
    pub(super) channel: usize,
    pub(super) offset: u64,
    pub(super) rows: u64,
    /// From one value to the next; all bytes for texts.
    pub(super) stride: u64,
    pub(super) bytes: u64,
}

/// The bits of a segment's table of contents.
mod toc {
    pub(super) const METADATA: u32 = 1 << 1;
    pub(super) const NEW_OBJECTS: u32 = 1 << 2;
    pub(super) const RAW_DATA: u32 = 1 << 3;
    pub(super) const INTERLEAVED: u32 = 1 << 5;
    pub(super) const BIG_ENDIAN: u32 = 1 << 6;
    pub(super) const DAQMX: u32 = 1 << 7;
    pub(super) const ALL: u32 = METADATA | NEW_OBJECTS | RAW_DATA | INTERLEAVED | BIG_ENDIAN | DAQMX;
}

impl TdmsFile {
    pub(super) fn read(source: &SharedFile) -> Result<Self> {
        let mut file = Self::default();
        let mut active: Vec<usize> = Vec::new();
        let mut budget = METADATA_BYTES;
        let mut at = 0;
        while at < source.length() {
            limits::at_most(FORMAT, "the number of segments", file.segments.len(), SEGMENTS)?;
            at = file.segment(source, at, &mut active, &mut budget)?;
        }
        Ok(file)
    }

    /// Reads a segment; gives where the next begins.
    fn segment(
        &mut self,
        source: &SharedFile,
        at: u64,
        active: &mut Vec<usize>,
        budget: &mut u64,
    ) -> Result<u64> {
        let lead = source.bytes(FORMAT, at, 28)?;
        let mut lead = ByteCursor::new(FORMAT, &lead, at);
        let contents = lead.mark(b"TDSm")?.u32()?;
        let big_endian = contents & toc::BIG_ENDIAN != 0;
        let mut lead = lead.with(0, big_endian);
        let version = lead.u32()?;
        refuse_if(contents & !toc::ALL != 0 || !VERSIONS.contains(&version), || {
            let found = format!("a segment of version {version} with the contents {contents:#x}");
            damaged(at, found, "version 4712 or 4713, and contents of known kinds")
        })?;
        let (next, raw) = (lead.u64()?, lead.u64()?);
        let start = at + LEAD_IN;
        let unfinished = next == u64::MAX;
        let end = if unfinished { source.length() } else { source.within(FORMAT, start, next)? };
        let raw_start = start.checked_add(raw).filter(|raw_start| *raw_start <= end).ok_or_else(|| {
            damaged(at, format!("raw data {raw} bytes into the segment"), "a place within the segment")
        })?;
        if unfinished {
            self.unfinished = true;
        }
        if contents & toc::METADATA != 0 {
            limits::at_most(FORMAT, "the length of the metadata", raw, *budget)?;
            *budget -= raw;
            let bytes = source.bytes(FORMAT, start, raw)?;
            let mut reader = ByteCursor::new(FORMAT, &bytes, start).with(0, big_endian);
            self.objects(&mut reader, active, contents & toc::NEW_OBJECTS != 0)?;
        }
        if contents & toc::RAW_DATA == 0 || raw_start == end {
            return Ok(end);
        }
        refuse_if(contents & toc::DAQMX != 0, || unsupported(DAQMX, DAQMX_REMEDY))?;
        let interleaved = contents & toc::INTERLEAVED != 0;
        let layout = self.layout(at, active, interleaved)?;
        self.add(at, raw_start, end, layout, unfinished)?;
        Ok(end)
    }

    /// Reads the list of objects.
    fn objects(&mut self, reader: &mut ByteCursor<'_>, active: &mut Vec<usize>, all_new: bool) -> Result<()> {
        if all_new {
            active.drain(..).for_each(|number| self.channels[number].active = false);
        }
        self.changed |= all_new;
        for _ in 0..reader.u32()? {
            let path = text(reader)?;
            let names = names(&path).ok_or_else(|| {
                let found = format!("the path `{}`", path.chars().take(64).collect::<String>());
                reader.damaged(found, "such as /'group'/'channel'")
            })?;
            let (channel, of_group) = match names {
                (Some(group), Some(name)) => (Some(self.channel(path, group, name)?), None),
                (group, _) => (None, group),
            };
            let header = reader.u32()?;
            let index = match (header, channel) {
                (u32::MAX, _) => None,
                (0, Some(channel)) => Some(self.channels[channel].index.ok_or_else(|| {
                    let found = "the same values as before, where there were none".to_owned();
                    reader.damaged(found, "what they are")
                })?),
                (0x1269 | 0x126a | 0x1369 | 0x6912_0000 | 0x6a12_0000 | 0x6913_0000, _) => {
                    return Err(unsupported(DAQMX, DAQMX_REMEDY));
                }
                (_, Some(_)) => Some(index(reader)?),
                (_, None) => {
                    return Err(reader.damaged("values of a group".to_owned(), "values of channels alone"));
                }
            };
            if let (Some(index), Some(number)) = (index, channel) {
                let channel = &mut self.channels[number];
                match channel.kind {
                    Some(kind) if kind != index.value => {
                        let what = format!("the channel `{}`, whose type changes,", channel.name);
                        return Err(unsupported(&what, "write it with one type"));
                    }
                    _ => channel.kind = Some(index.value),
                }
                self.changed |= channel.index != Some(index);
                channel.index = Some(index);
                if !channel.active {
                    channel.active = true;
                    active.push(number);
                    self.changed = true;
                }
            }
            for _ in 0..reader.u32()? {
                let name = text(reader)?;
                let value = property(reader)?;
                let properties = match (channel, &of_group) {
                    (Some(number), _) => &mut self.channels[number].properties,
                    (None, Some(group)) => {
                        let count = self.groups.len() as u64;
                        limits::at_most(FORMAT, "the number of groups", count, limits::COLUMNS)?;
                        self.groups.entry(group.clone()).or_default()
                    }
                    (None, None) => &mut self.root,
                };
                properties.learn(&name, value);
            }
        }
        Ok(())
    }

    fn channel(&mut self, path: String, group: String, name: String) -> Result<usize> {
        if let Some(number) = self.numbers.get(&path) {
            return Ok(*number);
        }
        let number = self.channels.len();
        let channel = TdmsChannel { group, name, ..TdmsChannel::default() };
        limits::push(FORMAT, "the number of channels", &mut self.channels, channel)?;
        self.numbers.insert(path, number);
        Ok(number)
    }

    /// What a chunk holds; the last one again where nothing changed.
    fn layout(&mut self, at: u64, active: &[usize], interleaved: bool) -> Result<usize> {
        let last = self.layouts.last().filter(|last| !self.changed && last.interleaved == interleaved);
        if last.is_some() {
            return Ok(self.layouts.len() - 1);
        }
        let overflow = || damaged(at, "chunks of more than 2⁶⁴ bytes".to_owned(), "fewer values");
        let mut parts = Vec::with_capacity(active.len());
        let mut offset = 0_u64;
        let indices = active.iter().filter_map(|channel| Some((*channel, self.channels[*channel].index?)));
        for (channel, index) in indices {
            let value = index.value.bytes();
            let part = ChunkPart { channel, offset, rows: index.rows, stride: value, bytes: index.bytes };
            refuse_if(interleaved && matches!(index.value, TdmsValue::Text { .. }), || {
                damaged(at, "interleaved texts".to_owned(), "texts one after the other")
            })?;
            parts.push(part);
            offset =
                offset.checked_add(if interleaved { value } else { index.bytes }).ok_or_else(overflow)?;
        }
        let mut chunk_bytes = offset;
        if interleaved {
            let rows = parts.first().map_or(0, |part| part.rows);
            refuse_if(parts.iter().any(|part| part.rows != rows), || {
                damaged(at, "interleaved channels of several lengths".to_owned(), "one length")
            })?;
            limits::at_most(FORMAT, "the bytes of a row", offset, limits::ROW_BYTES)?;
            for part in &mut parts {
                part.stride = offset;
            }
            chunk_bytes = offset.checked_mul(rows).ok_or_else(overflow)?;
        }
        let layout = ChunkLayout { chunk_bytes, interleaved, parts };
        self.changed = false;
        if self.layouts.last() != Some(&layout) {
            self.parts += layout.parts.len() as u64 + 1;
            limits::at_most(FORMAT, "how often channels change, times their number,", self.parts, PARTS)?;
            self.layouts.push(layout);
        }
        Ok(self.layouts.len() - 1)
    }

    /// Adds a segment's raw data.
    fn add(&mut self, at: u64, start: u64, end: u64, layout: usize, unfinished: bool) -> Result<()> {
        let ChunkLayout { chunk_bytes, interleaved, ref parts } = self.layouts[layout];
        let bytes = end - start;
        refuse_if(chunk_bytes == 0, || {
            damaged(at, format!("{bytes} bytes of values of no channel"), "channels with values")
        })?;
        let (chunks, rest) = (bytes / chunk_bytes, bytes % chunk_bytes);
        let mut cut_rows = 0;
        if rest != 0 {
            refuse_if(!unfinished, || {
                let expected = format!("a multiple of {chunk_bytes}, the bytes of a chunk");
                damaged(at, format!("{bytes} bytes of values"), &expected)
            })?;
            let whole = |part: &ChunkPart| match (interleaved, part.stride) {
                (true, stride) => rest / stride.max(1),
                // Texts are whole when the chunk is.
                (false, 0) => 0,
                (false, stride) => (rest.saturating_sub(part.offset) / stride).min(part.rows),
            };
            cut_rows = parts.iter().map(whole).min().unwrap_or(0);
            self.left_over = rest;
        }
        for part in parts {
            let rows = part.rows.checked_mul(chunks).and_then(|rows| rows.checked_add(cut_rows));
            let channel = &mut self.channels[part.channel];
            if part.rows > 0 && (channel.clocks.is_empty() || channel.properties.take_clock_change()) {
                let clock = channel.properties.clock();
                if channel.clocks.last().is_none_or(|last| last.clock != clock) {
                    channel.clocks.push(ClockRun { row: channel.rows, clock });
                }
            }
            channel.rows = rows
                .and_then(|rows| channel.rows.checked_add(rows))
                .ok_or_else(|| damaged(at, "more than 2⁶⁴ values".to_owned(), "fewer"))?;
        }
        self.segments.push(RawSegment { offset: start, chunks, cut_rows, layout });
        Ok(())
    }
}

/// A text behind its length.
fn text(reader: &mut ByteCursor<'_>) -> Result<String> {
    let length = reader.u32()? as usize;
    reader.text(length)
}

/// What values are, by their code.
fn value(reader: &mut ByteCursor<'_>) -> Result<TdmsValue> {
    let code = reader.u32()?;
    let number = |kind, bytes| {
        TdmsValue::Stored(StoredCell::Number(Element { kind, bytes, big_endian: reader.big_endian }))
    };
    Ok(match code {
        1 => number(ElementKind::Signed, 1),
        2 => number(ElementKind::Signed, 2),
        3 => number(ElementKind::Signed, 4),
        4 => number(ElementKind::Signed, 8),
        // 0 and 1.
        5 | 0x21 => number(ElementKind::Unsigned, 1),
        6 => number(ElementKind::Unsigned, 2),
        7 => number(ElementKind::Unsigned, 4),
        8 => number(ElementKind::Unsigned, 8),
        9 | 0x19 => number(ElementKind::Float, 4),
        10 | 0x1a => number(ElementKind::Float, 8),
        0x20 => TdmsValue::Text { big_endian: reader.big_endian },
        0x44 => {
            let form = TimeForm::Labview { big_endian: reader.big_endian };
            let code = TimeCode { form, unit: TimeUnit::SECOND, kind: TimeKind::Calendar };
            TdmsValue::Stored(StoredCell::Time(code))
        }
        0x0008_000c => TdmsValue::Other { bytes: 8, what: "complex numbers" },
        0x0010_000d => TdmsValue::Other { bytes: 16, what: "complex numbers" },
        _ => {
            return Err(reader.damaged(format!("values of type {code:#x}"), "a type of a known length"));
        }
    })
}

/// What a segment says of the values of a channel.
fn index(reader: &mut ByteCursor<'_>) -> Result<RawDataIndex> {
    let value = value(reader)?;
    let axes = reader.u32()?;
    refuse_if(axes != 1, || reader.damaged(format!("values along {axes} axes"), "1"))?;
    let rows = reader.u64()?;
    let bytes = match value {
        TdmsValue::Text { .. } => reader.u64()?,
        _ => rows
            .checked_mul(value.bytes())
            .ok_or_else(|| reader.damaged(format!("{rows} values"), "fewer"))?,
    };
    refuse_if(
        matches!(value, TdmsValue::Text { .. }) && rows.checked_mul(4).is_none_or(|places| places > bytes),
        || reader.damaged(format!("{rows} texts in {bytes} bytes"), "four bytes for each, and the texts"),
    )?;
    Ok(RawDataIndex { value, rows, bytes })
}

/// A property's value behind its code.
fn property(reader: &mut ByteCursor<'_>) -> Result<Property> {
    let value = value(reader)?;
    Ok(match value {
        TdmsValue::Text { .. } => Property::Text(text(reader)?),
        TdmsValue::Stored(StoredCell::Number(element)) => {
            Property::Number(element.exact(reader.take(element.bytes)?).rounded())
        }
        TdmsValue::Stored(cell) => {
            let time = crate::time::labview(reader.take(cell.bytes())?, reader.big_endian);
            time.map_or(Property::Other, Property::Time)
        }
        TdmsValue::Other { bytes, .. } => {
            reader.take(bytes)?;
            Property::Other
        }
    })
}

/// Group and channel of a path such as `/'group'/'channel'`; a quote within a name stands twice.
#[allow(clippy::type_complexity)] // named where it is used
fn names(path: &str) -> Option<(Option<String>, Option<String>)> {
    let mut names = Vec::new();
    let mut rest = path;
    while !rest.is_empty() && rest != "/" {
        rest = rest.strip_prefix("/'")?;
        let mut name = String::new();
        loop {
            let quote = rest.find('\'')?;
            name.push_str(&rest[..quote]);
            rest = &rest[quote + 1..];
            match rest.strip_prefix('\'') {
                Some(after) => {
                    name.push('\'');
                    rest = after;
                }
                None => break,
            }
        }
        names.push(name);
        if names.len() > 2 {
            return None;
        }
    }
    let mut names = names.into_iter();
    Some((names.next(), names.next()))
}

pub(super) fn damaged(place: u64, found: String, expected: &str) -> FormatError {
    FormatError::damaged_at(FORMAT, place, found, expected)
}

pub(super) fn unsupported(what: &str, remedy: &str) -> FormatError {
    FormatError::unsupported(FORMAT, what, remedy)
}

#[cfg(test)]
mod tests {
    use super::names;

    #[test]
    fn paths_of_objects() {
        let some = |name: &str| Some(name.to_owned());
        assert_eq!(names("/"), Some((None, None)));
        assert_eq!(names("/'rig'"), Some((some("rig"), None)));
        assert_eq!(names("/'rig'/'cap''s / 2'"), Some((some("rig"), some("cap's / 2"))));
        for path in ["rig", "/rig", "/'rig", "/'a'/'b'/'c'", "/'a''"] {
            assert_eq!(names(path), None, "{path}");
        }
    }
}

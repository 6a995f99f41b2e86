//! TDMS, as LabVIEW and FlexLogger write it: one group's channels as columns.

mod metadata;
mod scales;

use crate::clock::{ClockRun, ClockedChannels};
use crate::name::with_unit;
use crate::records::{CellKind, RecordLane};
use crate::scaling::{self, Scaling};
use crate::source::SharedFile;
use crate::table_parts::{TableParts, only};
use crate::{Column, FormatError, Hints, Result, Table, limits};
use metadata::{ChunkPart, FORMAT, TdmsFile, TdmsValue, damaged, unsupported};
use std::sync::Arc;

pub(crate) fn open(source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    let file = TdmsFile::read(&source)?;
    let group = group(&file, hints)?;
    let file_bytes = source.length();
    let (source, file) = (Arc::new(source), Arc::new(file));
    let mut table = TableParts::new(FORMAT);
    table.recognised = format!("the channels of the group `{group}`, a column each");
    let (mut clocks, mut scaled) = (Vec::new(), String::new());
    for (number, channel) in file.channels.iter().enumerate().filter(|(_, channel)| channel.group == group) {
        let lane = table.lanes.len();
        let (cells, record) = match channel.kind {
            Some(TdmsValue::Stored(cell)) => (CellKind::Stored { lane, offset: 0, cell }, cell.bytes()),
            Some(TdmsValue::Text { .. }) => (CellKind::Texts { lane }, 0),
            Some(TdmsValue::Other { what, .. }) => {
                table.leave_out(&channel.name, what);
                continue;
            }
            None => {
                table.leave_out(&channel.name, "without values");
                continue;
            }
        };
        let objects = [Some(&channel.properties), file.groups.get(&group), Some(&file.root)];
        let steps = match scales::steps(objects) {
            Ok(steps) => steps,
            Err(what) => {
                table.leave_out(&channel.name, format!("{what}: write its scaled values"));
                continue;
            }
        };
        limits::plausible_rows(FORMAT, channel.rows, file_bytes)?;
        let name = with_unit(&channel.name, channel.properties.unit());
        if !steps.is_empty() {
            scaled.push_str(&format!("; `{name}` = {} of the stored x", scaling::text(&steps)));
        }
        clocks.push(match &channel.clocks[..] {
            _ if !cells.is_numbers() => Vec::new(),
            // What is stated behind the values is of all of them.
            [only] if only.clock.step.is_none() => {
                vec![ClockRun { row: 0, clock: channel.properties.clock() }]
            }
            runs => runs.to_vec(),
        });
        let column = Column::new(&name).at(format!("{} of {group}", channel.name));
        let (source, file) = (Arc::clone(&source), Arc::clone(&file));
        table.add(column, cells, channel.rows, Box::new(ChannelLane::new(source, file, number, record)));
        let scaling = Scaling { missing: Vec::new(), steps };
        table.fields.last_mut().into_iter().for_each(|field| field.scaling = scaling.clone());
    }
    let stated_by = "wf_start_time, wf_start_offset, wf_increment";
    let TableParts { fields, lanes, .. } = &mut table;
    let said = ClockedChannels { fields, lanes, clocks, stated_by }.settle();
    table.recognised.push_str(&said);
    table.recognised.push_str(&scaled);
    if file.unfinished {
        table.recognised.push_str(&format!(
            "; the recording was not ended: {} bytes of its last chunk were looked at for whole rows",
            file.left_over
        ));
    }
    table.table(file_bytes, &format!("the group `{group}`"), "write the name of another in `group`")
}

/// The group that is meant.
fn group(file: &TdmsFile, hints: &Hints) -> Result<String> {
    let mut groups: Vec<&str> = Vec::new();
    for channel in file.channels.iter().filter(|channel| channel.kind.is_some()) {
        if groups.last() != Some(&channel.group.as_str()) && groups.len() < limits::COLUMNS {
            groups.push(&channel.group);
        }
    }
    groups.sort_unstable();
    groups.dedup();
    match &hints.group {
        Some(wanted) if groups.contains(&wanted.as_str()) => Ok(wanted.clone()),
        Some(wanted) => {
            let list = limits::list(&groups.iter().map(|group| format!("`{group}`")).collect::<Vec<_>>());
            let what = format!("the group `{wanted}`, which is not in the file,");
            Err(unsupported(&what, &format!("write one of {list}")))
        }
        None => {
            let places = groups.into_iter().map(|group| (group.to_owned(), ())).collect();
            only(FORMAT, places)?
                .map_or(Err(unsupported("a file without channels", "record some")), |(name, ())| Ok(name))
        }
    }
}

/// The values of a channel, from all segments.
struct ChannelLane {
    source: Arc<SharedFile>,
    file: Arc<TdmsFile>,
    channel: usize,
    record: usize,
    /// Where the next value is.
    segment: usize,
    chunk: u64,
    row: u64,
    /// Where its part is in the layout that was last.
    place: Option<(usize, Option<usize>)>,
    /// The texts of the chunk, the last first.
    texts: Vec<Vec<u8>>,
    scratch: Vec<u8>,
}

/// Values that stand together in the file.
struct ValueRun<'a> {
    part: &'a ChunkPart,
    /// Where the chunk begins.
    chunk: u64,
    interleaved: bool,
    rows: u64,
}

impl ChannelLane {
    /// At the first value.
    fn new(source: Arc<SharedFile>, file: Arc<TdmsFile>, channel: usize, record: usize) -> Self {
        let (segment, chunk, row) = (0, 0, 0);
        let (place, texts, scratch) = (None, Vec::new(), Vec::new());
        Self { source, file, channel, record, segment, chunk, row, place, texts, scratch }
    }

    /// The rest of the chunk with the next value.
    fn run<'a>(&mut self, file: &'a TdmsFile) -> Option<ValueRun<'a>> {
        loop {
            let segment = file.segments.get(self.segment)?;
            let layout = &file.layouts[segment.layout];
            if self.place.is_none_or(|(layout, _)| layout != segment.layout) {
                let place = layout.parts.iter().position(|part| part.channel == self.channel);
                self.place = Some((segment.layout, place));
            }
            let part = self.place.and_then(|(_, place)| layout.parts.get(place?));
            let Some(part) = part.filter(|_| self.chunk <= segment.chunks) else {
                (self.segment, self.chunk, self.row) = (self.segment + 1, 0, 0);
                continue;
            };
            let rows = if self.chunk < segment.chunks { part.rows } else { segment.cut_rows };
            if self.row >= rows {
                // Chunks without values of this channel are passed over together.
                self.chunk = if part.rows == 0 { segment.chunks + 1 } else { self.chunk + 1 };
                self.row = 0;
                continue;
            }
            return Some(ValueRun {
                part,
                chunk: segment.offset + self.chunk * layout.chunk_bytes,
                interleaved: layout.interleaved,
                rows: rows - self.row,
            });
        }
    }

    fn ended(&self) -> FormatError {
        damaged(self.source.length(), "the end of the values".to_owned(), "more of them")
    }
}

impl RecordLane for ChannelLane {
    fn record(&self) -> usize {
        self.record
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()> {
        let file = Arc::clone(&self.file);
        out.clear();
        let mut missing = rows;
        while missing > 0 {
            let run = self.run(&file).ok_or_else(|| self.ended())?;
            let mut count = usize::try_from(run.rows).unwrap_or(usize::MAX).min(missing);
            let start = run.chunk + run.part.offset + self.row * run.part.stride;
            if run.interleaved {
                #[allow(clippy::cast_possible_truncation)] // at most ROW_BYTES
                let stride = run.part.stride as usize;
                // A stretch of all channels.
                count = count.min((limits::BLOCK_BYTES / stride).max(1));
                self.scratch.resize((count - 1) * stride + self.record, 0);
                self.source.read_exact(FORMAT, start, &mut self.scratch)?;
                for record in self.scratch.chunks(stride) {
                    out.extend_from_slice(&record[..self.record]);
                }
            } else {
                let filled = out.len();
                out.resize(filled + count * self.record, 0);
                self.source.read_exact(FORMAT, start, &mut out[filled..])?;
            }
            self.row += count as u64;
            missing -= count;
        }
        Ok(())
    }

    fn texts(&mut self, rows: usize, out: &mut Vec<Vec<u8>>) -> Result<()> {
        let file = Arc::clone(&self.file);
        out.clear();
        while out.len() < rows {
            if self.texts.is_empty() {
                let run = self.run(&file).ok_or_else(|| self.ended())?;
                let (start, count) = (run.chunk + run.part.offset, run.part.rows);
                limits::at_most(FORMAT, "the texts of a chunk", run.part.bytes, limits::HEADER_BYTES)?;
                let bytes = self.source.bytes(FORMAT, start, run.part.bytes)?;
                let big_endian =
                    file.channels[self.channel].kind == Some(TdmsValue::Text { big_endian: true });
                self.texts = split_texts(start, &bytes, count, big_endian)?;
                self.texts.reverse();
                self.row = count;
            }
            out.extend(self.texts.pop());
        }
        Ok(())
    }
}

/// The texts of a chunk: where each ends, and then all of them.
fn split_texts(place: u64, bytes: &[u8], count: u64, big_endian: bool) -> Result<Vec<Vec<u8>>> {
    // `RawDataIndex` has compared them.
    let (ends, letters) = bytes.split_at(usize::try_from(count * 4).unwrap_or(bytes.len()).min(bytes.len()));
    let mut texts = Vec::new();
    let mut start = 0;
    for end in ends.chunks_exact(4) {
        let end = [end[0], end[1], end[2], end[3]];
        let end = if big_endian { u32::from_be_bytes(end) } else { u32::from_le_bytes(end) } as usize;
        let text = letters.get(start..end).ok_or_else(|| {
            let found = format!("a text from {start} to {end} of {} bytes", letters.len());
            damaged(place, found, "one within them")
        })?;
        texts.push(text.to_vec());
        start = end;
    }
    Ok(texts)
}

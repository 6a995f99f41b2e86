//! Sound: RIFF/WAVE of 1991, RF64 of 2006 (EBU Tech 3306) and BW64 of 2015 (ITU-R BS.2088).

use crate::clock::{RegularTimes, SampleStep};
use crate::cursor::ByteCursor;
use crate::element::{Element, ElementKind};
use crate::records::{CellKind, RecordField, StoredCell};
use crate::source::SharedFile;
use crate::stream::{FileStretch, StreamLane};
use crate::table_parts::TableParts;
use crate::{Column, FormatError, Hints, Result, Table, limits, refuse_if};
use std::sync::Arc;

const FORMAT: &str = "WAV";
/// Chunks that are looked at. A file has about ten.
const CHUNKS: usize = 4096;
/// A length of 32 bits that says that it is elsewhere.
const ELSEWHERE: u32 = u32::MAX;

pub(crate) fn open(source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    let source = Arc::new(source);
    let sound = SampleFormat::read(&source)?;
    let channels = sound.channels;
    let own = (1..=channels).map(|channel| format!("channel{channel}_1")).collect();
    let what = format!("a recording of {channels} channels");
    let mut table = TableParts::new(FORMAT);
    let names = table.names(hints, Some(own), channels as u64, &what)?;
    let record = channels * sound.element.bytes;
    let rows = sound.bytes / record as u64;
    let step = SampleStep::Rate(f64::from(sound.rate));
    // Samples since midnight, as a broadcast has them.
    let start_s = sound.since_midnight as f64 / f64::from(sound.rate);
    let clock = vec![RegularTimes { row: 0, start_s, step }];
    table.fields.push(RecordField::new(Column::new("time_s"), CellKind::Clock(clock), rows));
    let file = FileStretch::stored(Arc::clone(&source), FORMAT, "the file");
    let lane = StreamLane::new(file, sound.offset, record);
    table.add_rows(Box::new(lane), rows, StoredCell::Number(sound.element), &names);
    let scale =
        if sound.element.kind == ElementKind::Float { "as they are" } else { "in parts of full scale" };
    let start = match sound.since_midnight {
        0 => String::new(),
        _ => format!("{start_s} s (the time of day in its bext chunk) + "),
    };
    table.recognised = format!(
        "{channels} channels of {} in {} bits, {scale}; time_s = {start}k/({} Hz) for row k from 0 on, which is not in the \
         file",
        if sound.element.kind == ElementKind::Float { "floating-point numbers" } else { "integers" },
        sound.element.bytes * 8,
        sound.rate,
    );
    table.table(source.length(), "a file", "record some channels")
}

/// What is known of the samples.
struct SampleFormat {
    channels: usize,
    rate: u32,
    element: Element,
    offset: u64,
    bytes: u64,
    /// Samples from midnight to the first one, where a bext chunk says it.
    since_midnight: u64,
}

impl SampleFormat {
    fn read(source: &SharedFile) -> Result<Self> {
        let head = source.bytes(FORMAT, 0, 12)?;
        let long = head.starts_with(b"RF64") || head.starts_with(b"BW64");
        let whole = ByteCursor::new(FORMAT, &head, 0).skip(4)?.u32()?;
        // Of one that was not ended the length is open, and of a longer one it is elsewhere.
        if !matches!(whole, 0 | ELSEWHERE) {
            refuse_other_length(source, u64::from(whole))?;
        }
        let mut place = 12;
        let (mut shape, mut long_data, mut since_midnight) = (None, None, 0);
        for _ in 0..CHUNKS {
            if source.length() - place < 8 {
                break;
            }
            let chunk = source.bytes(FORMAT, place, 8)?;
            let mut chunk = ByteCursor::new(FORMAT, &chunk, place);
            let (start, kind, short) = (place + 8, chunk.take(4)?, chunk.u32()?);
            let mut length = u64::from(short);
            match kind {
                b"ds64" if long => {
                    refuse_if(length < 24, || damaged(place, "a ds64 chunk that is short", "24 bytes"))?;
                    let sizes = source.bytes(FORMAT, start, 24)?;
                    let mut sizes = ByteCursor::new(FORMAT, &sizes, start);
                    refuse_other_length(source, sizes.u64()?)?;
                    long_data = Some(sizes.u64()?);
                }
                // EBU Tech 3285: texts of 256, 32, 32, 10 and 8 bytes stand before the samples since midnight.
                b"bext" if length >= 346 => {
                    let count = source.bytes(FORMAT, start + 338, 8)?;
                    since_midnight = ByteCursor::new(FORMAT, &count, start).u64()?;
                }
                b"fmt " => shape = Some(shape_of(source, place, length)?),
                b"data" => {
                    if long && short == ELSEWHERE {
                        let found = "data whose length is in no ds64 chunk";
                        length = long_data.ok_or_else(|| damaged(place, found, "a ds64 chunk before"))?;
                    }
                    let early = || damaged(place, "data before a fmt chunk", "the fmt chunk first");
                    let (channels, rate, element) = shape.ok_or_else(early)?;
                    let there = source.length() - start;
                    refuse_if(length > there || (length == 0 && there > 0), || {
                        let claim = format!("a claim of {length} bytes of samples");
                        let found = format!("{claim}, and {there} to the end of the file");
                        damaged(place, found, "a recording that was ended properly")
                    })?;
                    let record = (channels * element.bytes) as u64;
                    refuse_if(length % record != 0, || {
                        let expected =
                            format!("a multiple of {record}, the bytes of a sample of all channels");
                        damaged(place, format!("{length} bytes of samples"), &expected)
                    })?;
                    let (offset, bytes) = (start, length);
                    return Ok(Self { channels, rate, element, offset, bytes, since_midnight });
                }
                _ => {}
            }
            // Chunks begin at even places.
            place = match start.checked_add(length).and_then(|end| end.checked_add(length % 2)) {
                Some(next) if next <= source.length() => next,
                _ => break,
            };
        }
        Err(damaged(place, "no data chunk", "one with samples"))
    }
}

/// Refuses a file that is shorter than the length that it states, which is that of all behind the first eight bytes.
fn refuse_other_length(source: &SharedFile, stated: u64) -> Result<()> {
    let there = source.length().saturating_sub(8);
    // A byte may be left out that would make the length even.
    if stated <= there.saturating_add(1) {
        return Ok(());
    }
    let found = format!("a length of {stated} bytes, and {there} to the end of the file");
    Err(damaged(4, found, "a file that is whole"))
}

/// Channels, rate and kind of number, from the fmt chunk.
fn shape_of(source: &SharedFile, place: u64, length: u64) -> Result<(usize, u32, Element)> {
    refuse_if(!(16..=1024).contains(&length), || {
        damaged(place, format!("a fmt chunk of {length} bytes"), "16, 18 or 40")
    })?;
    let chunk = source.bytes(FORMAT, place + 8, length)?;
    let mut chunk = ByteCursor::new(FORMAT, &chunk, place + 8);
    let mut code = chunk.u16()?;
    let (channels, rate, byte_rate) = (usize::from(chunk.u16()?), chunk.u32()?, chunk.u32()?);
    let (frame, bits) = (usize::from(chunk.u16()?), chunk.u16()?);
    if code == 0xfffe {
        let valid = chunk.skip(2)?.u16()?;
        code = chunk.skip(4)?.u16()?;
        refuse_if(
            chunk.take(14)? != b"\x00\x00\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71"
                || (valid != bits && valid != 0),
            || {
                let what = format!("a kind of sample of its own, {valid} of {bits} bits,");
                let remedy = "convert it to PCM or floating-point numbers with all bits in use";
                FormatError::unsupported(FORMAT, what, remedy)
            },
        )?;
    }
    let element = match (code, bits) {
        (1, 8) => Element::little(ElementKind::PcmByte, 1),
        (1, 16 | 24 | 32) => Element::little(ElementKind::Pcm, usize::from(bits / 8)),
        (3, 32 | 64) => Element::little(ElementKind::Float, usize::from(bits / 8)),
        _ => {
            let remedy = "convert it to PCM of 8, 16, 24 or 32 bits or to floating-point numbers";
            return Err(FormatError::unsupported(FORMAT, format!("code {code} with {bits} bits"), remedy));
        }
    };
    refuse_if(channels == 0 || rate == 0 || frame != channels * element.bytes, || {
        let found = format!("{channels} channels of {bits} bits at {rate} Hz in {frame} bytes a sample");
        damaged(place, found, "at least one channel, a rate above 0, and bytes that agree")
    })?;
    refuse_if(u64::from(byte_rate) != u64::from(rate) * frame as u64, || {
        let found = format!("{byte_rate} bytes a second, and {rate} samples of {frame} bytes");
        damaged(place, found, "a rate that agrees with the bytes a second")
    })?;
    limits::at_most(FORMAT, "the bytes of a sample of all channels", frame, limits::ROW_BYTES)?;
    Ok((channels, rate, element))
}

fn damaged(place: u64, found: impl Into<String>, expected: &str) -> FormatError {
    FormatError::damaged_at(FORMAT, place, found, expected)
}

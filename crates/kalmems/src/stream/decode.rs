//! Samples from bytes, as text or as frames.

use crate::config::{FieldType, FrameCheck, FrameField, StreamFormat};
use kalmems_formats::{CellFinding, CellReader, Shift, TimeReader};
use std::ops::Range;

/// One sample as it came.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamSample {
    /// Its number, where the frames count.
    pub sequence: Option<u64>,
    /// Its numbers, in the order of the columns; NaN where there is none.
    pub numbers: Vec<f64>,
}

/// What was in the bytes beside samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Lines that are no samples, but for a header and comments.
    pub lines: u64,
    /// Bytes between frames that belong to none.
    pub bytes: u64,
    /// Frames whose checksum is another one.
    pub frames: u64,
    /// Lines and frames that were cut off: a line without its end cannot be told from a shorter one.
    pub cut_off: u64,
}

/// What a sender ends its samples with that have an end: a line of text, behind lines and behind frames alike.
pub const END_MARK: &[u8] = b"# end\n";

/// The longest line that is looked at; a longer one is damaged.
const LONGEST: usize = 1 << 16;

/// Vectors that are kept to be used again.
const SPARE: usize = 1 << 13;

/// Takes bytes as they come and gives the samples in them.
pub struct Decoder {
    format: DecoderFormat,
    /// What is not decoded yet.
    rest: Vec<u8>,
    damage: Damage,
    /// The place of the times among the numbers, and what reads them.
    times: Option<(usize, TimeReader)>,
    /// Whether the sender has said that no more samples come.
    is_ended: bool,
    /// Vectors of samples that were taken, to be used again.
    spare: Vec<Vec<f64>>,
}

enum DecoderFormat {
    /// Lines with numbers separated by commas, so many of them.
    Text { columns: Vec<String>, cells: CellReader, powers: Vec<i32>, in_a_long_line: bool },
    Frames {
        sync: Vec<u8>,
        parts: Vec<FramePart>,
        shifts: Vec<Shift>,
        crc: Option<FrameCheck>,
        length: usize,
    },
}

/// A number in a frame.
struct FramePart {
    kind: FieldType,
    /// Where its bytes stand.
    at: Range<usize>,
    /// Whether it counts the frames.
    is_sequence: bool,
}

impl FramePart {
    /// The numbers of a frame, behind what it begins with; and where they end.
    fn all(sync: usize, fields: &[FrameField]) -> (Vec<Self>, usize) {
        let mut end = sync;
        let part = |field: &FrameField| {
            let at = end..end + field.kind.bytes();
            end = at.end;
            Self { kind: field.kind, at, is_sequence: field.is_sequence() }
        };
        (fields.iter().map(part).collect(), end)
    }
}

impl Decoder {
    /// For the format of an experiment file. The numbers of each column are multiplied by ten to its power, rounded once.
    pub fn new(format: &StreamFormat, powers: &[i32]) -> Self {
        let format = match format {
            StreamFormat::Text { columns } => DecoderFormat::Text {
                columns: columns.clone(),
                cells: CellReader::default(),
                powers: powers.to_vec(),
                in_a_long_line: false,
            },
            StreamFormat::Frames { sync, fields, crc } => {
                let (parts, end) = FramePart::all(sync.bytes().len(), fields);
                DecoderFormat::Frames {
                    sync: sync.bytes().to_vec(),
                    parts,
                    shifts: powers.iter().map(|power| Shift::new(*power)).collect(),
                    crc: *crc,
                    length: end + crc.map_or(0, FrameCheck::bytes),
                }
            }
        };
        let (rest, spare, damage) = (Vec::new(), Vec::new(), Damage::default());
        Self { format, rest, damage, times: None, is_ended: false, spare }
    }

    /// Reads the numbers at this place as times.
    #[must_use]
    pub fn with_times(self, place: usize, times: TimeReader) -> Self {
        Self { times: Some((place, times)), ..self }
    }

    /// What reads the times, where there are any.
    pub fn times(&self) -> Option<&TimeReader> {
        self.times.as_ref().map(|(_, times)| times)
    }

    /// What was in the bytes beside samples.
    pub const fn damage(&self) -> Damage {
        self.damage
    }

    /// Whether the sender has said that no more samples come.
    pub const fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// Gives the vector of a sample back, for its memory to be used again.
    pub fn reuse(&mut self, numbers: Vec<f64>) {
        // Rows that stand for missing samples come here as well, and no sample asks for so many.
        if self.spare.len() < SPARE {
            self.spare.push(numbers);
        }
    }

    /// Takes bytes; each sample that they complete goes to `each`.
    pub fn take(&mut self, bytes: &[u8], each: &mut impl FnMut(StreamSample)) {
        if self.is_ended {
            return;
        }
        self.rest.extend_from_slice(bytes);
        let (times, spare) = (&mut self.times, &mut self.spare);
        let done = match &mut self.format {
            DecoderFormat::Text { columns, cells, powers, in_a_long_line } => {
                let mut numbers = |line: &[u8]| numbers(line, cells, powers, (times, spare));
                let kept = (in_a_long_line, &mut self.is_ended);
                lines(&self.rest, columns, kept, &mut self.damage, &mut numbers, each)
            }
            DecoderFormat::Frames { sync, parts, shifts, crc, length } => {
                let kept = FrameNumbers { shifts, times, is_ended: &mut self.is_ended, spare };
                frames(&self.rest, (sync, parts, *crc, *length), kept, &mut self.damage, each)
            }
        };
        self.rest.drain(..done);
        if self.is_ended {
            self.rest.clear();
        }
    }

    /// The end of the input, or a break in it: a line or a frame that is not whole is no sample.
    pub fn cut_off(&mut self) {
        let rest = std::mem::take(&mut self.rest);
        match &mut self.format {
            DecoderFormat::Text { columns, in_a_long_line, .. } => {
                let line = rest.trim_ascii();
                let is_nothing = line.is_empty() || line.starts_with(b"#") || is_header(line, columns);
                // Of a line that is too long the beginning was counted.
                if !std::mem::take(in_a_long_line) && !is_nothing {
                    self.damage.cut_off += 1;
                }
            }
            DecoderFormat::Frames { sync, .. } => {
                let begun = rest.starts_with(&sync[..sync.len().min(rest.len())]) && !rest.is_empty();
                self.damage.cut_off += u64::from(begun);
                self.damage.bytes += if begun { 0 } else { rest.len() as u64 };
            }
        }
    }
}

/// The samples of whole lines; how many bytes they take up.
fn lines(
    bytes: &[u8],
    columns: &[String],
    (in_a_long_line, is_ended): (&mut bool, &mut bool),
    damage: &mut Damage,
    numbers: &mut impl FnMut(&[u8]) -> Option<Vec<f64>>,
    each: &mut impl FnMut(StreamSample),
) -> usize {
    let mut from = 0;
    while let Some(end) = bytes[from..].iter().position(|byte| *byte == b'\n') {
        let line = bytes[from..from + end].trim_ascii();
        from += end + 1;
        if std::mem::take(in_a_long_line) {
            continue;
        }
        if line == END_MARK.trim_ascii() {
            *is_ended = true;
            return from;
        }
        if line.is_empty() || line.starts_with(b"#") || is_header(line, columns) {
            continue;
        }
        match numbers(line) {
            Some(numbers) => each(StreamSample { sequence: None, numbers }),
            None => damage.lines += 1,
        }
    }
    if bytes.len() - from > LONGEST {
        damage.lines += u64::from(!*in_a_long_line);
        *in_a_long_line = true;
        return bytes.len();
    }
    from
}

/// Whether a line is the names of the columns.
fn is_header(line: &[u8], columns: &[String]) -> bool {
    let mut names = line.split(|byte| *byte == b',').map(<[u8]>::trim_ascii);
    columns.iter().all(|column| names.next() == Some(column.as_bytes())) && names.next().is_none()
}

/// As many numbers as there are powers, an empty cell being none; `None` where there are fewer or more, or something else.
fn numbers(
    line: &[u8],
    cells: &mut CellReader,
    powers: &[i32],
    (times, spare): (&mut Option<(usize, TimeReader)>, &mut Vec<Vec<f64>>),
) -> Option<Vec<f64>> {
    // A line that is no sample says nothing of where the times count from.
    if line.split(|byte| *byte == b',').count() != powers.len() {
        return None;
    }
    let mut texts = line.split(|byte| *byte == b',');
    let mut number = |(place, power): (usize, &i32)| {
        let text = texts.next()?;
        let read = match times {
            Some((of_time, times)) if *of_time == place => times.cell(text, b'.'),
            _ => cells.read(text, b'.', *power),
        };
        match read {
            Ok(number) => Some(number),
            Err(
                CellFinding::Missing
                | CellFinding::Nan(_)
                | CellFinding::Overload(_)
                | CellFinding::Infinite(_),
            ) => Some(f64::NAN),
            Err(_) => None,
        }
    };
    let mut numbers = spare.pop().unwrap_or_default();
    numbers.clear();
    for power in powers.iter().enumerate() {
        let Some(number) = number(power) else {
            spare.push(numbers);
            return None;
        };
        numbers.push(number);
    }
    Some(numbers)
}

/// What makes numbers of a frame's fields, and is kept from frame to frame.
struct FrameNumbers<'a> {
    shifts: &'a mut [Shift],
    times: &'a mut Option<(usize, TimeReader)>,
    is_ended: &'a mut bool,
    /// Vectors of samples that were taken.
    spare: &'a mut Vec<Vec<f64>>,
}

/// The samples of whole frames; how many bytes they take up.
fn frames(
    bytes: &[u8],
    (sync, parts, crc, length): (&[u8], &[FramePart], Option<FrameCheck>, usize),
    FrameNumbers { shifts, times, is_ended, spare }: FrameNumbers,
    damage: &mut Damage,
    each: &mut impl FnMut(StreamSample),
) -> usize {
    let mut from = 0;
    loop {
        let rest = bytes.get(from..).unwrap_or_default();
        // The first byte tells most frames from the mark, without a call.
        let ends = rest.first() == END_MARK.first() && rest.starts_with(END_MARK);
        let is_one = |frame: &&[u8]| frame.starts_with(sync) && !ends;
        let Some(frame) = rest.get(..length).filter(is_one) else {
            // The mark of the end is waited for, though it is shorter than a frame.
            if !may_become(rest, sync) && !may_become(rest, END_MARK) {
                damage.bytes += 1;
                from += 1;
                continue;
            }
            *is_ended = ends;
            return from;
        };
        if crc.is_some_and(|crc| !is_intact(&frame[sync.len()..], crc)) {
            // Where no frame follows, these bytes were none.
            let next = &rest[length..];
            if next.is_empty() {
                return from;
            }
            let is_frame = may_become(next, sync) || may_become(next, END_MARK);
            damage.frames += u64::from(is_frame);
            damage.bytes += u64::from(!is_frame);
            from += if is_frame { length } else { 1 };
            continue;
        }
        let mut sample = StreamSample { sequence: None, numbers: spare.pop().unwrap_or_default() };
        sample.numbers.clear();
        let mut shifts = shifts.iter_mut();
        for FramePart { kind, at, is_sequence } in parts {
            let raw = &frame[at.clone()];
            if *is_sequence {
                sample.sequence =
                    Some(raw.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)));
            } else {
                let (number, shift) = (kind.number(raw), shifts.next());
                let number = match times {
                    Some((place, times)) if *place == sample.numbers.len() => match kind {
                        FieldType::F32 | FieldType::F64 => times.float(number),
                        kind => kind.integer(raw).map_or(f64::NAN, |integer| times.integer(integer)),
                    },
                    _ => shift.map_or(number, |shift| shift.float(number)),
                };
                sample.numbers.push(number);
            }
        }
        each(sample);
        from += length;
    }
}

/// Whether bytes begin with a mark, as far as they have come.
fn may_become(bytes: &[u8], mark: &[u8]) -> bool {
    bytes.iter().zip(mark).all(|(byte, own)| byte == own)
}

/// Whether what stands between the beginning and the end of a frame has the checksum behind it.
fn is_intact(checked: &[u8], crc: FrameCheck) -> bool {
    let (content, stated) = checked.split_at(checked.len() - crc.bytes());
    let stated = stated.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte));
    stated
        == match crc {
            FrameCheck::Crc16 => u32::from(crc16(content)),
            FrameCheck::Crc32 => crc32fast::hash(content),
        }
}

/// CRC-16/IBM-3740.
fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |sum, byte| {
        (0..8).fold(sum ^ (u16::from(*byte) << 8), |sum: u16, _| (sum << 1) ^ (0x1021 * (sum >> 15)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values that catalogues of checksums give.
    #[test]
    fn checksums_are_those_of_the_catalogue() {
        assert_eq!(crc16(b"123456789"), 0x29b1);
        assert!(is_intact(b"123456789\x26\x39\xf4\xcb", FrameCheck::Crc32));
    }

    #[test]
    fn any_flipped_bit_of_a_frame_with_a_checksum_is_counted_and_costs_this_frame_alone() {
        let fields = ["u16 sequence", "f64 time_s"].map(|f| FrameField::try_from(f.to_owned()).unwrap());
        let sync = crate::config::Sync::try_from("a55a".to_owned()).unwrap();
        for crc in [FrameCheck::Crc16, FrameCheck::Crc32] {
            let format = StreamFormat::Frames { sync: sync.clone(), fields: fields.to_vec(), crc: Some(crc) };
            let frame = |k: u16| {
                let content = [&k.to_le_bytes()[..], &f64::from(k).to_le_bytes()].concat();
                let check = match crc {
                    FrameCheck::Crc16 => crc16(&content).to_le_bytes().to_vec(),
                    FrameCheck::Crc32 => crc32fast::hash(&content).to_le_bytes().to_vec(),
                };
                [&[0xa5, 0x5a], &content[..], &check].concat()
            };
            let whole: Vec<u8> = (1..=4).flat_map(frame).chain(END_MARK.iter().copied()).collect();
            let length = frame(1).len();
            assert_eq!(decoded(&format, &whole, 7).0.len(), 4);
            for bit in 0..8 * length {
                for flipped in [1, 3] {
                    let mut bytes = whole.clone();
                    bytes[flipped * length + bit / 8] ^= 1 << (bit % 8);
                    let (samples, damage) = decoded(&format, &bytes, 7);
                    let found: Vec<u64> = samples.iter().filter_map(|s| s.sequence).collect();
                    let lost = u64::try_from(flipped).unwrap() + 1;
                    assert_eq!(found, (1..=4).filter(|k| *k != lost).collect::<Vec<u64>>(), "{bit}");
                    // What a frame begins with is not under the checksum.
                    let outside = if bit < 16 { length as u64 } else { 0 };
                    let expected =
                        Damage { frames: u64::from(bit >= 16), bytes: outside, ..Damage::default() };
                    assert_eq!(damage, expected, "{bit}");
                }
            }
        }
    }

    fn decoded(format: &StreamFormat, bytes: &[u8], piece: usize) -> (Vec<StreamSample>, Damage) {
        let mut decoder = Decoder::new(format, &[0, -3]);
        let mut samples = Vec::new();
        for piece in bytes.chunks(piece) {
            decoder.take(piece, &mut |sample| samples.push(sample));
        }
        decoder.cut_off();
        (samples, decoder.damage())
    }

    #[test]
    fn lines_come_in_any_pieces() {
        let format = StreamFormat::Text { columns: vec!["time_s".to_owned(), "cap_mV".to_owned()] };
        let text =
            b"# a comment\ntime_s,cap_mV\n0,1.5\r\n\n1e-6, 2.5\nnonsense\n1,2,3\n2e-6,\n3e-6,5.71\n4e-6,1";
        for piece in [1, 2, 7, 1000] {
            let (samples, damage) = decoded(&format, text, piece);
            let numbers: Vec<f64> = samples.iter().flat_map(|s| s.numbers.clone()).collect();
            assert_eq!(numbers.len(), 8);
            assert_eq!(numbers[..5], [0.0, 1.5e-3, 1e-6, 2.5e-3, 2e-6]);
            assert!(numbers[5].is_nan() && numbers[7] == 5.71e-3);
            assert_eq!(damage, Damage { lines: 2, cut_off: 1, ..Damage::default() });
        }
        // A line without end takes no memory without end, and what follows is read.
        let mut long = vec![b'1'; 3 * LONGEST];
        long.extend_from_slice(b"\n4,5\n");
        let (samples, damage) = decoded(&format, &long, 999);
        assert!(samples.len() == 1 && damage.lines == 1, "{} {damage:?}", samples.len());
    }

    #[test]
    fn an_unfinished_frame_is_no_sample_and_is_counted() {
        let format = StreamFormat::Text { columns: vec!["time_s".to_owned(), "cap_mV".to_owned()] };
        for (end, cut_off) in
            [("", 0), ("1", 1), ("2,1.0288", 1), (" ", 0), ("# a com", 0), ("time_s,cap_mV", 0)]
        {
            let (samples, damage) = decoded(&format, format!("1,2\n{end}").as_bytes(), 1000);
            assert_eq!((samples.len(), damage), (1, Damage { cut_off, ..Damage::default() }), "{end}");
        }
        // What comes after a break begins a line.
        let mut decoder = Decoder::new(&format, &[0, 0]);
        let mut samples = Vec::new();
        decoder.take(b"1,2\n2,3.5", &mut |sample| samples.push(sample));
        decoder.cut_off();
        decoder.take(b"7,8\n", &mut |sample| samples.push(sample));
        let numbers: Vec<Vec<f64>> = samples.into_iter().map(|sample| sample.numbers).collect();
        assert_eq!((numbers, decoder.damage().cut_off), (vec![vec![1.0, 2.0], vec![7.0, 8.0]], 1));
    }

    #[test]
    fn frames_are_found_behind_whatever_stands_before_them() {
        let fields =
            ["u16 sequence", "f64 time_s", "f32 cap_mV"].map(|f| FrameField::try_from(f.to_owned()).unwrap());
        let sync = crate::config::Sync::try_from("a55a".to_owned()).unwrap();
        let format = StreamFormat::Frames { sync, fields: fields.to_vec(), crc: None };
        let frame = |k: u16| {
            let mut bytes = vec![0xa5, 0x5a];
            bytes.extend_from_slice(&k.to_le_bytes());
            bytes.extend_from_slice(&(f64::from(k) * 1e-6).to_le_bytes());
            bytes.extend_from_slice(&(f32::from(k) + 0.5).to_le_bytes());
            bytes
        };
        let bytes = [&b"noise\xa5"[..], &frame(1), &frame(2), b"?", &frame(65535), &frame(3)[..9]].concat();
        for piece in [1, 5, 1000] {
            let (samples, damage) = decoded(&format, &bytes, piece);
            let found: Vec<u64> = samples.iter().filter_map(|s| s.sequence).collect();
            assert_eq!(found, [1, 2, 65535]);
            assert_eq!(samples[1].numbers, [2e-6, 2.5e-3]);
            assert_eq!(damage, Damage { bytes: 7, cut_off: 1, ..Damage::default() });
        }
        // What follows the end mark is no part of the stream.
        for (format, sample) in [
            (&format, frame(1)),
            (&StreamFormat::Text { columns: format.columns().clone() }, b"1,2\n".to_vec()),
        ] {
            let bytes = [&sample[..], END_MARK, &sample, b"?"].concat();
            for piece in [1, 5, 1000] {
                let (samples, damage) = decoded(format, &bytes, piece);
                assert_eq!((samples.len(), damage), (1, Damage::default()));
            }
        }
        assert_eq!(format.columns(), ["time_s", "cap_mV"]);
        assert_eq!(format.sequence_bits(), Some(16));
    }
}

//! LabVIEW measurement files (`.lvm`): a header on the file, and for each record one on its channels, and rows.

use super::super::head::TextHead;
use super::waveforms::WaveformColumns;
use super::{DialectSearch, TextBeginning, distinct};
use crate::clock::{RegularTimes, SampleStep};
use crate::csv::dialect::{ColumnOrigin, NamedColumns, RecognizedText, RecordShape};
use crate::time::{IsoTime, parse_iso};
use crate::{FormatError, Result, refuse_if};

/// What ends either header.
const END: &[u8] = b"***End_of_Header***";

/// As many lines a header on channels has at most.
const LINES: usize = 64;

/// The times of the channels.
#[derive(Clone, Copy, Debug, PartialEq)]
enum LabviewTimes {
    /// In the first cell.
    One,
    /// In a cell before each channel.
    Each,
    /// Counted from `X0` in steps of `Delta_X`.
    Counted,
}

/// How a file writes its headers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::csv) struct Heading {
    separator: u8,
    times: LabviewTimes,
}

/// What a header on channels says.
pub(in crate::csv) struct LabviewChannels {
    /// The line of their names in the head; the rows follow.
    names: usize,
    /// How many cells a row has, but for one of remarks at its end.
    cells: usize,
    columns: NamedColumns,
    own_times: Vec<(usize, usize)>,
}

pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    text.head.line(0).starts_with(b"LabVIEW Measurement").then(|| found(text.head))
}

/// The dialect that the header on the file and the first on channels say.
fn found(head: &TextHead) -> Result<RecognizedText> {
    let ends: Vec<usize> = (0..head.len()).filter(|index| head.line(*index).starts_with(END)).collect();
    let [first, second, others @ ..] = ends.as_slice() else {
        let expected = "`***End_of_Header***` twice, once for the file and once for the channels";
        return Err(damaged("no end", expected));
    };
    // The separator is said by a word that stands behind it.
    let comma = (0..*first).any(|index| head.line(index).starts_with(b"Separator,"));
    let separator =
        if comma || head.line(1).contains(&b',') && !head.line(1).contains(&b'\t') { b',' } else { b'\t' };
    let value = |key: &str| {
        head.values(key, separator).and_then(|values| values.into_iter().next()).unwrap_or_default()
    };
    let heading = Heading {
        separator,
        times: match value("X_Columns").as_str() {
            "No" => LabviewTimes::Counted,
            "Multi" => LabviewTimes::Each,
            _ => LabviewTimes::One,
        },
    };
    let several = value("Multi_Headings") == "Yes" || !others.is_empty();
    let mut channels = heading.channels(head, *first + 1, *second)?;
    if several {
        channels.refuse_later()?;
        channels.columns.push(("segment".to_owned(), ColumnOrigin::Record));
    }
    Ok(RecognizedText {
        instrument: Some("LabVIEW"),
        separator,
        // The first versions do not say it.
        point: match value("Decimal_Separator").as_str() {
            "," if separator != b',' => Some(b','),
            "." => Some(b'.'),
            _ => None,
        },
        header_line: head.number(channels.names),
        first_row: channels.names + 1,
        cells: channels.cells,
        trailing: true,
        remarks: true,
        columns: channels.columns,
        own_times: channels.own_times,
        units: "units in the header".to_owned(),
        records: if several { RecordShape::Headed(heading) } else { RecordShape::One },
        ..RecognizedText::default()
    })
}

impl Heading {
    /// Whether a line begins another header on channels.
    pub(in crate::csv) fn begins(first_cell: &[u8]) -> bool {
        let words: [&[u8]; 5] = [b"Channels", b"Notes", b"Special", b"Test_", b"UUT_"];
        words.iter().any(|word| first_cell.starts_with(word))
    }

    /// What the header on channels at the beginning of `text` says of them; `None` where more text is needed.
    pub(in crate::csv) fn next(self, text: &[u8], line: u64, ended: bool) -> Result<Option<LabviewChannels>> {
        let head = TextHead::new(text, line, LINES);
        match (0..head.len()).find(|index| head.line(*index).starts_with(END)) {
            Some(end) if end + 1 < head.len() => self.channels(&head, 0, end).map(Some),
            None if head.len() < LINES && !ended => Ok(None),
            Some(_) if !ended => Ok(None),
            _ => {
                let found = format!("a header in line {line} without an end");
                Err(damaged(&found, "`***End_of_Header***` and names"))
            }
        }
    }

    /// The channels of a header between two lines, and their names behind it.
    fn channels(self, head: &TextHead, begin: usize, end: usize) -> Result<LabviewChannels> {
        let names = head.cells(end + 1, self.separator);
        let comment = usize::from(names.last().is_some_and(|name| name == "Comment"));
        let count = names.len() - comment;
        let of = |key: &str| {
            let first =
                |index: &usize| head.cells(*index, self.separator).first().is_some_and(|cell| cell == key);
            (begin..end).find(first).map(|line| head.cells(line, self.separator)).unwrap_or_default()
        };
        let (units, starts, steps, dimensions) =
            (of("Y_Unit_Label"), of("X0"), of("Delta_X"), of("X_Dimension"));
        let number = |text: &String| fast_float2::parse::<f64, _>(text.replace(',', ".")).ok();
        let seconds = dimensions.get(1).is_none_or(|dimension| dimension == "Time").then_some("s");
        let channels: Vec<usize> = match self.times {
            LabviewTimes::Each => (1..count).step_by(2).collect(),
            LabviewTimes::One | LabviewTimes::Counted => (1..count).collect(),
        };
        let name = |index: &usize| names.get(*index).cloned().unwrap_or_default();
        let channel_names = distinct(channels.iter().map(name));
        let mut clocks = Vec::new();
        if self.times == LabviewTimes::Counted {
            let value = |cells: &[String], index: usize, what: &str| {
                let number = cells.get(index).and_then(number);
                number.ok_or_else(|| damaged(&format!("no `{what}`"), "a number for each channel"))
            };
            // The instants from which the starts of the channels count.
            let (dates, times) = (of("Date"), of("Time"));
            let instant = |index: usize| {
                let text = format!("{} {}", dates.get(index)?, times.get(index)?.replace(',', "."));
                parse_iso(text.as_bytes()).map(IsoTime::instant)
            };
            let earliest = channels.iter().filter_map(|index| instant(*index)).min();
            for index in &channels {
                let since = instant(*index).zip(earliest).map_or(0.0, |(time, first)| time.since(first));
                let start_s = value(&starts, *index, "X0")? + since;
                let step = SampleStep::Interval(value(&steps, *index, "Delta_X")?);
                clocks.push(RegularTimes { row: 0, start_s, step });
            }
        }
        let times = match self.times {
            LabviewTimes::Each => channels.iter().map(|index| index - 1).collect(),
            LabviewTimes::One => vec![0],
            LabviewTimes::Counted => Vec::new(),
        };
        let unit = |index: usize| units.get(*channels.get(index)?).cloned();
        let (names, cells, time_unit) = (&channel_names, channels.clone(), |_| seconds.map(str::to_owned));
        let waveforms = WaveformColumns { names, cells, times, clocks, time_unit: &time_unit, unit: &unit };
        let own_times = waveforms.own_times();
        let columns = waveforms.columns().map_err(|why| {
            let what = format!("channels with times of their own and no column for them ({why})");
            let remedy =
                "write those with the same times in a file of their own, or a column of times for each";
            FormatError::unsupported("LabVIEW measurement", what, remedy)
        })?;
        Ok(LabviewChannels { names: end + 1, cells: count, columns, own_times })
    }
}

impl LabviewChannels {
    /// Refuses channels that begin at different times, in a file of several records.
    fn refuse_later(&self) -> Result<()> {
        let is_later = |(_, origin): &&(String, ColumnOrigin)| matches!(origin, ColumnOrigin::Later { .. });
        let Some((name, _)) = self.columns.iter().find(is_later) else { return Ok(()) };
        let what = format!("a file of several records in which `{name}` begins later than other channels");
        Err(FormatError::unsupported("LabVIEW measurement", what, "write each record to a file of its own"))
    }

    /// Where the values come from, where the channels are those before; how many bytes and lines the header takes.
    pub(in crate::csv) fn continue_with(
        self,
        before: &[super::super::DialectColumn],
        text: &[u8],
    ) -> Result<(Vec<ColumnOrigin>, usize, u64)> {
        let same = self.columns.iter().zip(before).all(|((name, _), column)| *name == column.column.name);
        self.refuse_later()?;
        // The last column is the number of the record.
        refuse_if(!same || self.columns.len() + 1 != before.len(), || {
            let what = "a file of records with different channels";
            FormatError::unsupported("LabVIEW measurement", what, "write each in a file of its own")
        })?;
        let bytes = memchr::memchr_iter(b'\n', text).nth(self.names).map_or(text.len(), |end| end + 1);
        Ok((self.columns.into_iter().map(|(_, origin)| origin).collect(), bytes, self.names as u64 + 1))
    }
}

fn damaged(found: &str, expected: &str) -> FormatError {
    FormatError::damaged("LabVIEW measurement", "header", found, expected)
}

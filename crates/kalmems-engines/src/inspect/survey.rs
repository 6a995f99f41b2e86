//! Which column is the time and which tells records apart, and the reasons in words.

use super::quantity::quantity;
use super::{StatedFile, StatedTime, UnitlessTime};
use crate::recording::ReadError;
use crate::recording::blocks::Blocks;
use crate::recording::clock_unit::ClockUnit;
use crate::recording::counter::CounterTimes;
use crate::recording::label::SegmentLabel;
use crate::recording::read::ReadProgress;
use crate::recording::scale::ColumnScale;
use crate::units::ColumnHeader;
use kalmems_formats::{
    Block, CellFinding, Column, Table, TableEvidence, TimeKind, WantedColumn, may_be_grouped,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A label stays the same for at least this many rows on average: so many where nothing but its runs says that it is one, and so many
/// where the time starts again with each.
const LONG_RUN: usize = 10;
const SHORT_RUN: usize = 4;

/// A column that changes more often than this tells no records apart.
const MOST_RECORDS: usize = 10_000;

/// What was recognised.
#[derive(Default)]
pub(super) struct ColumnSurvey {
    pub(super) time: Option<String>,
    /// A column that may be the time, whose name has no unit; only where no column is the time.
    pub(super) unitless_time: Option<UnitlessTime>,
    pub(super) segment: Option<String>,
    /// Columns that are left out: they hold text and do not tell records apart, or have another number of rows.
    pub(super) text: Vec<String>,
    pub(super) sentences: Vec<String>,
    /// The column that says which of several sources each row is of, and their names, where they take turns.
    pub(super) mixed: Option<(String, String)>,
    /// Whether a column holds numbers, as every file does that is known by its format to be a table.
    pub(super) holds_numbers: bool,
}

/// Reads a table once and keeps nothing but counts.
pub(super) fn survey(
    table: Box<dyn Table>,
    path: &Path,
    stated: &StatedFile,
    progress: ReadProgress,
) -> Result<ColumnSurvey, ReadError> {
    let all = || table.description().columns.iter().map(|column| column.name.as_str());
    let names: Vec<ColumnHeader> = all().map(|name| ColumnHeader::parse_among(name, all())).collect();
    if names.is_empty() {
        return Ok(ColumnSurvey::default());
    }
    let (columns, evidence) = (&table.description().columns, table.description().evidence);
    let main = main_length(columns);
    let (texts, numbers): (Vec<usize>, Vec<usize>) = (0..names.len())
        .filter(|column| columns[*column].rows.is_none_or(|rows| Some(rows) == main))
        .filter(|column| columns[*column].apart.is_none())
        .partition(|column| columns[*column].text);
    let time = match &stated.time {
        _ if stated.rate_hz.is_some() => None,
        Some(stated) => Time::stated(&names, stated),
        None => Time::of(&names, |column| table.time_kind(column)),
    }
    .filter(|time| numbers.contains(&time.column));
    let others =
        names.iter().enumerate().filter(|(column, _)| !texts.contains(column) && !numbers.contains(column));
    let why = |column: &Column| match (&column.apart, column.rows) {
        (Some(why), _) => format!(" is left out, as {why}"),
        (None, Some(rows)) => {
            format!(" has {rows} rows and is left out, as most columns have another number of rows")
        }
        (None, None) => " is left out, as most columns have another number of rows".to_owned(),
    };
    let others: Vec<(String, String)> =
        others.map(|(column, name)| (name.column.clone(), why(&columns[column]))).collect();
    let protection = table.description().protection.clone();
    let wanted = numbers.iter().map(|column| match time {
        Some(Time { column: clock, unit, .. }) if clock == *column => {
            WantedColumn::Time { column: *column, unit: unit.unit, origin: None }
        }
        _ => WantedColumn::Number { column: *column, power: 0 },
    });
    let mut wanted: Vec<WantedColumn> = wanted.collect();
    wanted.extend(texts.iter().map(|column| WantedColumn::Label { column: *column }));
    let mut blocks = Blocks::start(table, path, &wanted)?;
    let rate_hz = stated.rate_hz;
    let mut scan = SurveyScan { numbers, texts, rate_hz, ..SurveyScan::new(names, time) };
    while let Some(block) = blocks.next(progress)? {
        scan.take(&block);
        blocks.reuse(block);
        blocks.report(progress)?;
    }
    let holds_numbers =
        matches!(evidence, TableEvidence::Format | TableEvidence::Arrays) || scan.has_numbers_below(evidence);
    let mut survey = ColumnSurvey { holds_numbers, ..scan.conclude() };
    for (name, why) in others {
        survey.sentences.push(format!("`{name}`{why}."));
        survey.text.push(name);
    }
    if !protection.is_empty() {
        survey.sentences.push(protection);
    }
    Ok(survey)
}

/// The number of rows that most columns have, the larger where two are as frequent, of a file whose columns differ in it.
fn main_length(columns: &[Column]) -> Option<u64> {
    let mut counts = BTreeMap::<u64, usize>::new();
    for rows in columns.iter().filter(|column| column.apart.is_none()).filter_map(|column| column.rows) {
        *counts.entry(rows).or_default() += 1;
    }
    counts.into_iter().max_by_key(|(rows, count)| (*count, *rows)).map(|(rows, _)| rows)
}

/// What is counted of a column.
#[derive(Default)]
struct ColumnCounts {
    name: String,
    has_unit: bool,
    numbers: usize,
    texts: usize,
    /// Rows without anything that could be a label.
    empty: usize,
    previous: Option<SegmentLabel>,
    changes: usize,
    /// Changes where the time goes on, and new starts of the time where nothing changes.
    unmatched: usize,
    seen: BTreeSet<SegmentLabel>,
    returns: bool,
    /// The first, second and last number, and how many are no larger than the one before.
    first: Option<f64>,
    second: Option<f64>,
    last: f64,
    falls: usize,
    /// Whether each number is the one before or the next whole one.
    counts: bool,
}

#[derive(Default)]
struct SurveyScan {
    columns: Vec<ColumnCounts>,
    /// Which columns the numbers of a block are, and which the labels.
    numbers: Vec<usize>,
    texts: Vec<usize>,
    time: Option<Time>,
    rate_hz: Option<f64>,
    counter: Option<CounterTimes>,
    previous_time: f64,
    restarts: usize,
    rows: usize,
    /// Whether the time starts again at each row of a block.
    restarted: Vec<bool>,
}

impl SurveyScan {
    fn new(names: Vec<ColumnHeader>, time: Option<Time>) -> Self {
        Self {
            time,
            columns: names
                .into_iter()
                .map(|h| ColumnCounts {
                    has_unit: h.unit.is_some(),
                    name: h.column,
                    counts: true,
                    ..ColumnCounts::default()
                })
                .collect(),
            previous_time: f64::NEG_INFINITY,
            ..Self::default()
        }
    }

    fn take(&mut self, block: &Block) {
        self.restarted.clear();
        self.restarted.resize(block.rows, false);
        let slot = self.time.and_then(|time| self.numbers.iter().position(|column| *column == time.column));
        let times = slot.and_then(|slot| block.numbers.get(slot)).map_or(&[][..], Vec::as_slice);
        let mut times = times.to_vec();
        if let Some(time) = self.time {
            let counter = self.counter.get_or_insert_with(|| CounterTimes::new(time.unit.unit));
            counter.unwrap(&mut times, block.origin);
        }
        for (restarted, time) in self.restarted.iter_mut().zip(&times).filter(|(_, time)| !time.is_nan()) {
            *restarted = *time <= self.previous_time;
            self.previous_time = *time;
            self.restarts += usize::from(*restarted);
        }
        for (index, numbers) in self.numbers.iter().zip(&block.numbers) {
            let Some(column) = self.columns.get_mut(*index) else { continue };
            let mut faults = block.faults.iter().filter(|fault| fault.column == Some(*index)).peekable();
            for (row, (number, restarted)) in numbers.iter().zip(&self.restarted).enumerate() {
                let fault = faults.next_if(|fault| fault.row == row).map(|fault| &fault.fault);
                column.take_number(*number, fault, *restarted);
            }
        }
        for (index, labels) in self.texts.iter().zip(&block.labels) {
            let Some(column) = self.columns.get_mut(*index) else { continue };
            let mut runs = labels.iter().peekable();
            let mut label = SegmentLabel::Text(Vec::new());
            for (row, restarted) in self.restarted.iter().enumerate() {
                if let Some((_, text)) = runs.next_if(|(start, _)| *start == row) {
                    label = SegmentLabel::Text(text.clone());
                }
                column.texts += 1;
                column.take(&label, *restarted);
            }
        }
        self.rows += block.rows;
    }

    /// Whether a text has a column of numbers below a name. A number is no name, but where rows of the text show that a program
    /// has numbered its columns.
    fn has_numbers_below(&self, evidence: TableEvidence) -> bool {
        let is_name =
            |name: &str| evidence == TableEvidence::Rows || fast_float2::parse::<f64, _>(name).is_err();
        self.columns.iter().any(|column| column.numbers > 0 && !column.is_text() && is_name(&column.name))
    }

    fn conclude(self) -> ColumnSurvey {
        let time = self.time.map(|time| time.column);
        let name = |index: usize| self.columns.get(index).map(|column| column.name.clone());
        let mut survey = ColumnSurvey { time: time.and_then(name), ..ColumnSurvey::default() };
        let untimed = time.is_none() && self.rate_hz.is_none();
        survey.unitless_time = if untimed { self.unitless_time() } else { None };
        survey.sentences.push(match (&survey.time, self.time) {
            (Some(name), Some(time)) => format!("`{name}` is the time, as {}.", time.reason),
            _ if self.rate_hz.is_some() => {
                let rate = quantity(self.rate_hz.unwrap_or(f64::NAN), "Hz");
                format!("A row is a sample, and the samples follow each other at {rate}, as stated.")
            }
            _ if survey.unitless_time.is_some() => {
                let seems = survey.unitless_time.as_ref().map(UnitlessTime::sentence).unwrap_or_default();
                format!("{seems} Until its unit is stated, a row is a sample, and frequencies are in cycles per sample.")
            }
            _ => "No column is the time, as no name begins with `time` and ends with a unit of time: a row is a \
                     sample, and frequencies are in cycles per sample."
                .to_owned(),
        });
        let segment = self.segment_column(time);
        survey.segment = segment.and_then(|(index, _)| name(index));
        survey.sentences.push(match (&survey.segment, segment) {
            (Some(name), Some((index, reason))) => {
                let records = self.columns.get(index).map_or(0, |column| column.changes) + 1;
                let records =
                    if records == 1 { "one record".to_owned() } else { format!("{records} records") };
                format!("`{name}` is the label of {records}, as it {reason}.")
            }
            _ if self.restarts > 0 => {
                let rows =
                    if self.restarts == 1 { "one row".to_owned() } else { format!("{} rows", self.restarts) };
                format!("The time does not increase at {rows}, and no column changes exactly there.")
            }
            _ => "No column tells records apart: the file is one record.".to_owned(),
        });
        for (index, column) in self.columns.iter().enumerate() {
            if column.is_text() && Some(index) != time && Some(&column.name) != survey.segment.as_ref() {
                let cells = match column.empty {
                    0 => String::new(),
                    empty if empty == self.rows => " with nothing in any row".to_owned(),
                    empty => format!(" with nothing in {empty} of {} rows", self.rows),
                };
                survey.sentences.push(format!("`{}` is text{cells} and is left out.", column.name));
                if column.takes_turns() {
                    survey.mixed = Some(column.mixed_words());
                }
                survey.text.push(column.name.clone());
            }
        }
        survey
    }

    /// The column that may be the time, were there a unit: it is called so, or it is the first column, each of its numbers is larger
    /// than the one before, and it is no count of rows.
    fn unitless_time(&self) -> Option<UnitlessTime> {
        let of = |column: &ColumnCounts| {
            let (first, second) = (column.first?, column.second?);
            let seems = !column.has_unit && column.numbers == self.rows && second > first;
            let step = match (self.rows.checked_sub(1), column.falls > 0) {
                (Some(steps), false) => (column.last - first) / steps as f64,
                _ => second - first,
            };
            seems.then(|| UnitlessTime { column: column.name.clone(), first, last: column.last, step })
        };
        let named = || self.columns.iter().filter(|column| is_named_time(&column.name)).find_map(of);
        let first = || {
            let first = self.columns.first().filter(|first| first.falls == 0 && self.columns.len() > 1)?;
            of(first).filter(|time| (time.step - time.step.round()).abs() > 1e-6 * time.step)
        };
        named().or_else(first)
    }

    /// The column that tells records apart, and why it is taken for that.
    fn segment_column(&self, time: Option<usize>) -> Option<(usize, &'static str)> {
        let candidates = || {
            let all = self.columns.iter().enumerate();
            all.filter(|(index, column)| {
                // A record without a label is none: such a column would make the file unusable.
                let labelled = column.empty == 0;
                Some(*index) != time && labelled && !column.returns && column.changes <= MOST_RECORDS
            })
        };
        let stays = |column: &ColumnCounts, run: usize| {
            column.changes.saturating_add(1).saturating_mul(run) <= self.rows
        };
        let long = |column: &ColumnCounts| stays(column, LONG_RUN);
        let matching = |text: bool| {
            candidates()
                .find(|(_, c)| {
                    self.restarts > 0 && c.unmatched == 0 && c.is_text() == text && stays(c, SHORT_RUN)
                })
                .map(|(index, _)| (index, "changes exactly where the time starts again"))
        };
        matching(true)
            .or_else(|| matching(false))
            .or_else(|| {
                let (index, _) = candidates().find(|(_, c)| c.is_text() && long(c))?;
                Some((index, "is text that stays the same over long runs of rows"))
            })
            .or_else(|| {
                let number = |c: &ColumnCounts| {
                    let counts = !c.is_text() && !c.has_unit && c.changes > 0 && long(c);
                    counts && (c.counts_records() || c.is_named_record())
                };
                let (index, _) = candidates().find(|(_, c)| time.is_none() && number(c))?;
                Some((index, "counts records: it has no unit and stays the same over long runs of rows"))
            })
    }
}

impl ColumnCounts {
    fn take_number(&mut self, number: f64, fault: Option<&CellFinding>, restarted: bool) {
        let label = match fault {
            None => {
                self.numbers += 1;
                self.falls += usize::from(self.first.is_some() && number <= self.last);
                self.counts &= number.fract() == 0.0
                    && (self.first.is_none() || number == self.last || number == self.last + 1.0);
                match self.first {
                    None => self.first = Some(number),
                    Some(_) => _ = self.second.get_or_insert(number),
                }
                self.last = number;
                SegmentLabel::of_number(number)
            }
            Some(CellFinding::Text(text)) => {
                // A number that can be read in two ways is refused, and not passed over as text.
                if may_be_grouped(text) {
                    self.numbers += 1;
                } else {
                    self.texts += 1;
                }
                SegmentLabel::Text(text.clone().into_bytes())
            }
            Some(CellFinding::Nan(text) | CellFinding::Infinite(text) | CellFinding::Overload(text)) => {
                self.numbers += 1;
                SegmentLabel::Text(text.clone().into_bytes())
            }
            Some(_) => SegmentLabel::Text(Vec::new()),
        };
        self.take(&label, restarted);
    }

    fn take(&mut self, label: &SegmentLabel, restarted: bool) {
        self.empty += usize::from(matches!(label, SegmentLabel::Text(text) if text.trim_ascii().is_empty()));
        let first = self.previous.is_none();
        let other = self.previous.as_ref() != Some(label);
        let changed = !first && other;
        self.changes += usize::from(changed);
        if other {
            if self.changes <= MOST_RECORDS {
                self.returns |= !self.seen.insert(label.clone());
            }
            self.previous = Some(label.clone());
        }
        self.unmatched += usize::from(changed != restarted);
    }

    /// Whether its numbers count from 0 or 1 on; those of a slow channel begin anywhere and go up and down.
    fn counts_records(&self) -> bool {
        self.counts && self.first.is_some_and(|first| first == 0.0 || first == 1.0)
    }

    /// Whether its name says that it tells records apart.
    fn is_named_record(&self) -> bool {
        let name = self.name.to_lowercase();
        let mut words = name.split(|letter: char| !letter.is_alphabetic());
        words.any(|word| RECORD_WORDS.contains(&word.trim_end_matches('s')))
    }

    /// Whether it names the source of each row, of which a few take turns.
    fn takes_turns(&self) -> bool {
        let name = self.name.to_lowercase();
        let mut words = name.split(|letter: char| !letter.is_alphabetic());
        let is_source = words.any(|word| SOURCE_WORDS.contains(&word.trim_end_matches('s')));
        is_source && self.returns && self.empty == 0 && (2..=MOST_SOURCES).contains(&self.seen.len())
    }

    /// Its name, and those of the sources.
    fn mixed_words(&self) -> (String, String) {
        let label = |label: &SegmentLabel| match label {
            SegmentLabel::Number(bits) => f64::from_bits(*bits).to_string(),
            SegmentLabel::Text(text) => String::from_utf8_lossy(text).into_owned(),
        };
        let names: Vec<String> = self.seen.iter().map(|seen| format!("`{}`", label(seen))).collect();
        (self.name.clone(), format!("rows of {} take turns", names.join(", ")))
    }

    /// A few words among numbers are mistakes, which the diagnosis names.
    const fn is_text(&self) -> bool {
        self.texts > self.numbers
    }
}

/// Words of the name of a column that tells records apart.
const RECORD_WORDS: [&str; 12] = [
    "record", "segment", "run", "trial", "chunk", "shot", "sweep", "frame", "burst", "cycle", "label", "part",
];

/// Words of the name of a column that says which source a row is of, and how many sources there may be.
const SOURCE_WORDS: [&str; 10] =
    ["sensor", "source", "channel", "device", "signal", "stream", "topic", "instrument", "probe", "type"];
const MOST_SOURCES: usize = 16;

/// First words of the name of a column that is the time, beside `time` itself.
const TIME_WORDS: [&str; 9] = ["t", "zeit", "temps", "tiempo", "tempo", "tijd", "sec", "seconds", "clock"];

/// Whether the name of a column begins with a word for the time.
fn is_named_time(column: &str) -> bool {
    let name = column.to_lowercase();
    let first = name.split(|letter: char| !letter.is_alphanumeric()).next().unwrap_or_default();
    first.starts_with("time") || TIME_WORDS.contains(&first)
}

/// The column that is the time.
#[derive(Clone, Copy)]
struct Time {
    column: usize,
    unit: ClockUnit,
    /// Why it is taken for that.
    reason: &'static str,
}

impl Time {
    fn stated(names: &[ColumnHeader], stated: &StatedTime) -> Option<Self> {
        let column = names.iter().position(|header| header.column == stated.column)?;
        let header = ColumnHeader { unit: Some(stated.unit), ..names.get(column)?.clone() };
        let unit = ClockUnit::of(&header, ColumnScale::of(header.unit), None)?;
        Some(Self { column, unit, reason: "it was stated" })
    }

    fn of(names: &[ColumnHeader], kind: impl Fn(usize) -> Option<TimeKind>) -> Option<Self> {
        let clocks = || {
            let all = names.iter().enumerate();
            all.filter_map(|(column, header)| {
                let scale = ColumnScale::of(header.unit);
                Some((column, header, ClockUnit::of(header, scale, kind(column))?))
            })
        };
        let by_name = clocks().find(|(_, header, _)| header.column.to_lowercase().starts_with("time"));
        if let Some((column, _, unit)) = by_name {
            let reason = match kind(column) {
                Some(_) => "its name begins with it and its cells are dates or times",
                None => "its name begins with it and ends with a unit of time",
            };
            return Some(Self { column, unit, reason });
        }
        let calendar = clocks().find(|(_, _, unit)| unit.calendar);
        let word = || clocks().find(|(_, header, _)| is_named_time(&header.column));
        // A column alone is what was recorded, such as the phase of a clock.
        let first = || clocks().find(|(column, ..)| *column == 0 && names.len() > 1);
        let (found, reason) = match (calendar, word()) {
            (Some(found), _) => (found, "it is the first whose cells are instants of the calendar"),
            (None, Some(found)) => (found, "its name says it and ends with a unit of time"),
            (None, None) => (first()?, "it is the first column and its name ends with a unit of time"),
        };
        let (column, _, unit) = found;
        Some(Self { column, unit, reason })
    }
}

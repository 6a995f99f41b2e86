//! Which column is the time and which tells records apart, and the reasons in words.

use crate::recording::ReadError;
use crate::recording::blocks::Blocks;
use crate::recording::label::Label;
use crate::recording::read::Progress;
use crate::recording::scale::Scale;
use crate::units::{Header, kind};
use kalmems_formats::{Block, Fault, Table, Wanted};
use std::collections::BTreeSet;
use std::path::Path;

/// A label stays the same for at least this many rows on average.
const LONG_RUN: usize = 10;

/// A column that changes more often than this tells no records apart.
const MOST_RECORDS: usize = 10_000;

/// What was recognised.
#[derive(Default)]
pub(super) struct Survey {
    pub(super) time: Option<String>,
    pub(super) segment: Option<String>,
    /// Columns that are left out: they hold text and do not tell records apart, or are of another length than the others.
    pub(super) left_out: Vec<String>,
    pub(super) sentences: Vec<String>,
}

/// Reads a table once and keeps nothing but counts.
pub(super) fn survey(
    mut table: Box<dyn Table>,
    path: &Path,
    progress: Progress,
) -> Result<Survey, ReadError> {
    let names: Vec<Header> = table.description().columns.iter().map(|c| Header::parse(&c.name)).collect();
    if names.is_empty() {
        return Ok(Survey::default());
    }
    let time = names.iter().position(is_time);
    let power = |column: usize| {
        let unit = names.get(column).filter(|_| time == Some(column)).and_then(|header| header.unit);
        Scale::of(unit).power()
    };
    let numbers: Vec<Wanted> =
        (0..names.len()).map(|column| Wanted::Number { column, power: power(column) }).collect();
    let wanted = readable(table.as_mut(), &numbers, time);
    let mut scan = Scan::new(names, time, &wanted);
    let mut blocks = Blocks::start(table, path, &wanted)?;
    while let Some(block) = blocks.next(progress)? {
        scan.take(&block);
        blocks.reuse(block);
        blocks.report(progress)?;
    }
    Ok(scan.conclude())
}

/// How the columns can be read together: as numbers, which a text can be in text alone; as labels where the format says that
/// they are text; and not at all where they are not as long as the time, or as the first column without it.
fn readable(table: &mut dyn Table, numbers: &[Wanted], time: Option<usize>) -> Vec<Wanted> {
    if table.want(numbers).is_ok() {
        return numbers.to_vec();
    }
    let mut alone = |wanted: &Wanted| {
        let (Wanted::Number { column, .. } | Wanted::Label { column }) = *wanted;
        [*wanted, Wanted::Label { column }].into_iter().find(|one| table.want(&[*one]).is_ok())
    };
    let each: Vec<Wanted> = numbers.iter().filter_map(&mut alone).collect();
    if table.want(&each).is_ok() {
        return each;
    }
    let is_time = |wanted: &&Wanted| matches!(wanted, Wanted::Number { column, .. } if Some(*column) == time);
    let Some(first) = each.iter().find(is_time).or(each.first()).copied() else { return each };
    each.into_iter().filter(|one| *one == first || table.want(&[first, *one]).is_ok()).collect()
}

/// Where the cells of a column are in a block.
#[derive(Clone, Copy)]
enum Slot {
    Numbers(usize),
    Labels(usize),
    /// It is not as long as the others.
    LeftOut,
}

/// What is counted of a column.
#[derive(Default)]
struct Counts {
    name: String,
    has_unit: bool,
    numbers: usize,
    texts: usize,
    previous: Option<Label>,
    changes: usize,
    /// Changes where the time goes on, and new starts of the time where nothing changes.
    unmatched: usize,
    seen: BTreeSet<Label>,
    returns: bool,
}

struct Scan {
    columns: Vec<Counts>,
    slots: Vec<Slot>,
    time: Option<usize>,
    previous_time: f64,
    restarts: usize,
    rows: usize,
    /// Whether the time starts again at each row of a block.
    restarted: Vec<bool>,
}

impl Scan {
    fn new(names: Vec<Header>, time: Option<usize>, wanted: &[Wanted]) -> Self {
        let mut slots = vec![Slot::LeftOut; names.len()];
        let (mut numbers, mut labels) = (0, 0);
        for wanted in wanted {
            let (column, slot, next) = match *wanted {
                Wanted::Number { column, .. } => (column, Slot::Numbers(numbers), &mut numbers),
                Wanted::Label { column } => (column, Slot::Labels(labels), &mut labels),
            };
            *next += 1;
            if let Some(own) = slots.get_mut(column) {
                *own = slot;
            }
        }
        Self {
            time,
            slots,
            columns: names
                .into_iter()
                .map(|h| Counts { has_unit: h.unit.is_some(), name: h.column, ..Counts::default() })
                .collect(),
            previous_time: f64::NEG_INFINITY,
            restarts: 0,
            rows: 0,
            restarted: Vec::new(),
        }
    }

    fn take(&mut self, block: &Block) {
        self.restarted.clear();
        self.restarted.resize(block.rows, false);
        let numbers = |slot: Option<&Slot>| match slot {
            Some(Slot::Numbers(slot)) => block.numbers.get(*slot).map_or(&[][..], Vec::as_slice),
            _ => &[],
        };
        let times = self.time.map_or(&[][..], |time| numbers(self.slots.get(time)));
        for (restarted, time) in self.restarted.iter_mut().zip(times).filter(|(_, time)| !time.is_nan()) {
            *restarted = *time <= self.previous_time;
            self.previous_time = *time;
            self.restarts += usize::from(*restarted);
        }
        for (index, (column, slot)) in self.columns.iter_mut().zip(&self.slots).enumerate() {
            if let Slot::Labels(slot) = slot {
                let runs = block.labels.get(*slot).map_or(&[][..], Vec::as_slice);
                for (k, (start, label)) in runs.iter().enumerate() {
                    let end = runs.get(k + 1).map_or(block.rows, |(next, _)| *next);
                    column.take_run(label, self.restarted.get(*start..end).unwrap_or_default());
                }
                continue;
            }
            let mut faults = block.faults.iter().filter(|fault| fault.column == Some(index)).peekable();
            for (row, (number, restarted)) in numbers(Some(slot)).iter().zip(&self.restarted).enumerate() {
                let fault = faults.next_if(|fault| fault.row == row).map(|fault| &fault.fault);
                column.take(*number, fault, *restarted);
            }
        }
        self.rows += block.rows;
    }

    fn conclude(self) -> Survey {
        let time = self.time;
        let name = |index: usize| self.columns.get(index).map(|column| column.name.clone());
        let mut survey = Survey { time: time.and_then(name), ..Survey::default() };
        survey.sentences.push(match &survey.time {
            Some(name) => format!("`{name}` is the time, as its name begins with it and ends with a unit of time."),
            None => "No column is the time, as no name begins with `time` and ends with a unit of time: a row is a \
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
        for (column, slot) in self.columns.iter().zip(&self.slots) {
            if matches!(slot, Slot::LeftOut) {
                let name = &column.name;
                survey.sentences.push(format!("`{name}` is not as long as the others and is left out."));
                survey.left_out.push(name.clone());
            }
        }
        for (index, column) in self.columns.iter().enumerate() {
            if column.is_text() && Some(index) != time && Some(&column.name) != survey.segment.as_ref() {
                survey.sentences.push(format!("`{}` is text and is left out.", column.name));
                survey.left_out.push(column.name.clone());
            }
        }
        survey
    }

    /// The column that tells records apart, and why it is taken for that.
    fn segment_column(&self, time: Option<usize>) -> Option<(usize, &'static str)> {
        let candidates = || {
            let all = self.columns.iter().enumerate();
            all.filter(|(index, column)| {
                Some(*index) != time
                    && column.previous.is_some()
                    && !column.returns
                    && column.changes <= MOST_RECORDS
            })
        };
        let long = |column: &Counts| column.changes.saturating_add(1).saturating_mul(LONG_RUN) <= self.rows;
        let matching = |text: bool| {
            candidates()
                .find(|(_, c)| self.restarts > 0 && c.unmatched == 0 && c.is_text() == text)
                .map(|(index, _)| (index, "changes exactly where the time starts again"))
        };
        matching(true)
            .or_else(|| matching(false))
            .or_else(|| {
                let (index, _) = candidates().find(|(_, c)| c.is_text() && long(c))?;
                Some((index, "is text that stays the same over long runs of rows"))
            })
            .or_else(|| {
                let number = |c: &Counts| !c.is_text() && !c.has_unit && c.changes > 0 && long(c);
                let (index, _) = candidates().find(|(_, c)| time.is_none() && number(c))?;
                Some((index, "has no unit and stays the same over long runs of rows"))
            })
    }
}

impl Counts {
    fn take(&mut self, number: f64, fault: Option<&Fault>, restarted: bool) {
        let label = match fault {
            None => {
                self.numbers += 1;
                Label::of_number(number)
            }
            Some(Fault::Text(text)) => {
                self.texts += 1;
                Label::Text(text.clone().into_bytes())
            }
            Some(Fault::Nan(text) | Fault::Infinite(text)) => {
                self.numbers += 1;
                Label::Text(text.clone().into_bytes())
            }
            Some(_) => Label::Text(Vec::new()),
        };
        self.enter(label, restarted);
    }

    /// Takes rows with one text.
    fn take_run(&mut self, text: &[u8], restarted: &[bool]) {
        let Some((first, rest)) = restarted.split_first() else { return };
        self.texts += restarted.len();
        self.enter(Label::Text(text.to_vec()), *first);
        self.unmatched += rest.iter().filter(|restarted| **restarted).count();
    }

    fn enter(&mut self, label: Label, restarted: bool) {
        let first = self.previous.is_none();
        let other = self.previous.as_ref() != Some(&label);
        let changed = !first && other;
        self.changes += usize::from(changed);
        if other {
            if self.changes <= MOST_RECORDS {
                self.returns |= !self.seen.insert(label.clone());
            }
            self.previous = Some(label);
        }
        self.unmatched += usize::from(changed != restarted);
    }

    /// A few words among numbers are mistakes, which the diagnosis names.
    const fn is_text(&self) -> bool {
        self.texts > self.numbers
    }
}

fn is_time(header: &Header) -> bool {
    header.unit.is_some_and(|unit| kind::TIME.accepts(unit.dimension()))
        && header.column.to_lowercase().starts_with("time")
}

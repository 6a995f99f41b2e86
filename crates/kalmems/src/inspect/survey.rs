//! Which column is the time and which tells records apart, and the reasons in words.

use crate::recording::ReadError;
use crate::recording::cell::{Cell, Scale};
use crate::recording::label::Label;
use crate::recording::read::Progress;
use crate::recording::rows::{Row, Rows};
use crate::units::{Header, kind};
use std::collections::BTreeSet;
use std::path::Path;

/// A label stays the same for at least this many rows on average.
const LONG_RUN: usize = 10;

/// A column that changes more often than this tells no records apart.
const MOST_RECORDS: usize = 10_000;

/// How many rows are read between two reports of progress.
const ROWS_PER_REPORT: usize = 1 << 16;

/// What was recognised.
#[derive(Default)]
pub(super) struct Survey {
    pub(super) time: Option<String>,
    pub(super) segment: Option<String>,
    /// Columns that hold text and do not tell records apart.
    pub(super) text: Vec<String>,
    pub(super) sentences: Vec<String>,
}

/// Reads the file once and keeps nothing but counts.
pub(super) fn survey(path: &Path, progress: Progress) -> Result<Survey, ReadError> {
    let file = || path.display().to_string();
    let failed = |source| ReadError::Io { file: file(), source };
    let mut rows = Rows::open(path).map_err(failed)?;
    let Some(mut scan) = rows.next().map_err(failed)?.map(|header| Scan::new(&header)) else {
        return Ok(Survey::default());
    };
    while let Some(row) = rows.next().map_err(failed)? {
        if row.cells.len() == scan.columns.len() {
            scan.take(&row);
        }
        if scan.rows.is_multiple_of(ROWS_PER_REPORT) {
            let (done, total) = rows.progress();
            if progress(done, total).is_break() {
                return Err(ReadError::Interrupted { file: file() });
            }
        }
    }
    Ok(scan.conclude())
}

/// What is counted of a column.
#[derive(Default)]
struct Counts {
    name: String,
    has_unit: bool,
    numbers: usize,
    texts: usize,
    previous: Vec<u8>,
    changes: usize,
    /// Changes where the time goes on, and new starts of the time where nothing changes.
    unmatched: usize,
    seen: BTreeSet<Label>,
    returns: bool,
}

struct Scan {
    columns: Vec<Counts>,
    time: Option<(usize, Scale)>,
    previous_time: f64,
    restarts: usize,
    rows: usize,
    scratch: Vec<u8>,
}

impl Scan {
    fn new(header: &Row) -> Self {
        let names: Vec<Header> =
            header.cells.iter().map(|cell| Header::parse(&String::from_utf8_lossy(cell))).collect();
        let time = names.iter().position(is_time);
        Self {
            time: time.and_then(|i| Some((i, Scale::of(names.get(i)?.unit)))),
            columns: names
                .into_iter()
                .map(|h| Counts { has_unit: h.unit.is_some(), name: h.column, ..Counts::default() })
                .collect(),
            previous_time: f64::NEG_INFINITY,
            restarts: 0,
            rows: 0,
            scratch: Vec::new(),
        }
    }

    fn take(&mut self, row: &Row) {
        let mut restarted = false;
        if let Some((index, scale)) = self.time
            && let Cell::Number(time) =
                Cell::read(row.cells.get(index).unwrap_or_default(), scale, &mut self.scratch)
        {
            restarted = time <= self.previous_time;
            self.previous_time = time;
        }
        self.restarts += usize::from(restarted);
        for (column, cell) in self.columns.iter_mut().zip(row.cells) {
            column.take(cell.trim_ascii(), self.rows == 0, restarted, &mut self.scratch);
        }
        self.rows += 1;
    }

    fn conclude(self) -> Survey {
        let time = self.time.map(|(index, _)| index);
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
        for (index, column) in self.columns.iter().enumerate() {
            if column.is_text() && Some(index) != time && Some(&column.name) != survey.segment.as_ref() {
                survey.sentences.push(format!("`{}` is text and is left out.", column.name));
                survey.text.push(column.name.clone());
            }
        }
        survey
    }

    /// The column that tells records apart, and why it is taken for that.
    fn segment_column(&self, time: Option<usize>) -> Option<(usize, &'static str)> {
        let candidates = || {
            let all = self.columns.iter().enumerate();
            all.filter(|(index, column)| {
                Some(*index) != time && !column.returns && column.changes <= MOST_RECORDS
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
    fn take(&mut self, cell: &[u8], first: bool, restarted: bool, scratch: &mut Vec<u8>) {
        match Cell::read(cell, Scale::One, scratch) {
            Cell::Text => self.texts += 1,
            Cell::Missing => {}
            Cell::Number(_) | Cell::Nan | Cell::Infinite => self.numbers += 1,
        }
        let mut changed = false;
        if first || cell != self.previous {
            let label = Label::of(cell);
            changed = !first && label != Label::of(&self.previous);
            cell.clone_into(&mut self.previous);
            self.changes += usize::from(changed);
            if (first || changed) && self.changes <= MOST_RECORDS {
                self.returns |= !self.seen.insert(label);
            }
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

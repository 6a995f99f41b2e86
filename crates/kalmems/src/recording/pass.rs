//! One pass over the rows: numbers into columns, rows into segments, and what is wrong into findings.

use super::cell::{Cell, Scale};
use super::findings::{Findings, Place};
use super::label::Label;
use super::plan::{Plan, Target};
use super::rows::Row;
use super::segment::{Lines, Segment, TimeBase, Times};
use super::{Clock, Column, FindingKind as Kind, Recording, Source, rails, time};
use std::collections::BTreeMap;
use std::ops::Range;

/// A segment that is being read.
struct Draft {
    start: usize,
    times: Vec<f64>,
}

pub(super) struct Pass {
    plan: Plan,
    findings: Findings,
    lines: Lines,
    drafts: Vec<Draft>,
    labels: Vec<String>,
    /// The present label as it stands in the file, and the line where each label began.
    label: Vec<u8>,
    begun: BTreeMap<Label, usize>,
    scratch: Vec<u8>,
}

impl Pass {
    pub(super) fn new(plan: Plan, findings: Findings) -> Self {
        Self {
            plan,
            findings,
            lines: Lines::default(),
            drafts: Vec::new(),
            labels: Vec::new(),
            label: Vec::new(),
            begun: BTreeMap::new(),
            scratch: Vec::new(),
        }
    }

    pub(super) fn take(&mut self, row: &Row) {
        let place = Place { column: None, segment: None, line: row.line };
        if row.blank_lines > 0 {
            let first = row.line.saturating_sub(row.blank_lines);
            if self.plan.names.len() == 1 {
                // In a file with one column a blank line is a row with an empty cell.
                for line in first..row.line {
                    self.take_cells(|_| &[], line);
                }
            } else {
                self.findings.add_many(
                    Kind::BlankLine,
                    Place { line: first, ..place },
                    row.blank_lines,
                    || "nothing between the rows".to_owned(),
                );
            }
        }
        if row.cells.len() == self.plan.names.len() {
            self.take_cells(|index| row.cells.get(index).unwrap_or_default(), row.line);
        } else {
            let (found, expected) = (row.cells.len(), self.plan.names.len());
            self.findings.add(Kind::WrongColumnCount, place, || {
                format!("{} where the header has {expected}", plural(found, "cell"))
            });
        }
    }

    fn take_cells<'a>(&mut self, cell: impl Fn(usize) -> &'a [u8], line: usize) {
        self.enter_segment(self.plan.segment_column.map(&cell), line);
        let segment = self.drafts.len().checked_sub(1);
        if let (Some(clock), Some(draft)) = (&self.plan.clock, self.drafts.last_mut()) {
            let text = cell(clock.index);
            let time = Cell::read(text, clock.scale, &mut self.scratch);
            draft.times.push(if let Cell::Number(time) = time { time } else { f64::NAN });
            if !matches!(time, Cell::Number(_)) {
                let place = Place { column: Some(clock.index), segment, line };
                self.findings.add(Kind::NoTime, place, || match time {
                    Cell::Missing => "the cell is empty".to_owned(),
                    _ => format!("`{}` is no time", excerpt(text)),
                });
            }
        }
        for target in &mut self.plan.targets {
            let text = cell(target.index);
            let (kind, detail): (_, fn(&[u8]) -> String) =
                match Cell::read(text, target.scale, &mut self.scratch) {
                    Cell::Number(value) => {
                        target.values.push(value);
                        continue;
                    }
                    Cell::Missing => (Kind::Missing, |_| "the cell is empty".to_owned()),
                    Cell::Nan => {
                        (Kind::Nan, |text| format!("`{}` is no number by its own word", excerpt(text)))
                    }
                    Cell::Infinite => (Kind::Infinite, |text| format!("`{}` is not finite", excerpt(text))),
                    Cell::Text => (Kind::NonNumeric, |text| format!("`{}` is no number", excerpt(text))),
                };
            target.values.push(f64::NAN);
            self.findings.add(kind, Place { column: Some(target.index), segment, line }, || detail(text));
        }
        self.lines.push(line);
    }

    /// A row of numbers that never was text. A number that its column's text would change goes through the text.
    pub(super) fn take_numbers(&mut self, cells: &[f64], line: usize) {
        let as_it_is = |target: &Target| {
            target.scale == Scale::One && cells.get(target.index).is_some_and(|x| x.is_finite())
        };
        if !self.plan.clock.iter().chain(&self.plan.targets).all(as_it_is) {
            let texts: Vec<String> = cells.iter().map(f64::to_string).collect();
            return self.take_cells(|index| texts.get(index).map_or(&[], |text| text.as_bytes()), line);
        }
        self.enter_segment(None, line);
        if let (Some(clock), Some(draft)) = (&self.plan.clock, self.drafts.last_mut()) {
            draft.times.push(cells.get(clock.index).copied().unwrap_or(f64::NAN));
        }
        for target in &mut self.plan.targets {
            target.values.push(cells.get(target.index).copied().unwrap_or(f64::NAN));
        }
        self.lines.push(line);
    }

    /// Begins a segment where the label is another one.
    fn enter_segment(&mut self, label: Option<&[u8]>, line: usize) {
        let label = label.unwrap_or_default().trim_ascii();
        let place = Place { column: self.plan.segment_column, segment: None, line };
        let unlabelled = self.plan.segment_column.is_some() && label.is_empty();
        if unlabelled {
            self.findings.add(Kind::NoLabel, place, || "the cell is empty".to_owned());
        }
        // A row without label stays with those before it, as it must be somewhere; the recording is not used.
        if !self.drafts.is_empty() && (unlabelled || label == self.label) {
            return;
        }
        let key = Label::of(label);
        let same = !self.drafts.is_empty() && key == Label::of(&self.label);
        label.clone_into(&mut self.label);
        if same {
            return;
        }
        let segment = Some(self.drafts.len());
        self.drafts.push(Draft { start: self.lines.rows(), times: Vec::new() });
        self.labels.push(String::from_utf8_lossy(label).into_owned());
        if let Some(begun) = self.begun.get(&key) {
            self.findings.add(Kind::SegmentReturns, Place { segment, ..place }, || {
                format!("the segment of line {begun} comes again")
            });
        } else {
            self.begun.insert(key, line);
        }
    }

    pub(super) fn finish(mut self, source: Source, clock: &Clock) -> Recording {
        if self.drafts.is_empty() {
            let place = Place { column: None, segment: None, line: self.plan.line };
            self.findings.add(Kind::HeaderOnly, place, || "there are names and no row of numbers".to_owned());
        }
        let ends: Vec<usize> =
            self.drafts.iter().skip(1).map(|d| d.start).chain([self.lines.rows()]).collect();
        let ranges: Vec<Range<usize>> =
            self.drafts.iter().zip(ends).map(|(draft, end)| draft.start..end).collect();
        let time_column = self.plan.clock.as_ref().map(|clock| clock.index);
        let mut segments = Vec::with_capacity(ranges.len());
        for (index, draft) in self.drafts.into_iter().enumerate() {
            let Some(range) = ranges.get(index).cloned() else { continue };
            let place = |i: usize| Place {
                column: time_column,
                segment: Some(index),
                line: self.lines.of(range.start + i),
            };
            let time = match *clock {
                Clock::Rate { rate_hz, start_s } => TimeBase {
                    times: Times::Rate { rate_hz, start_s, first: 0, len: range.len() },
                    interval_s: Some(rate_hz.recip()),
                    uniform: true,
                },
                Clock::Column(_) => {
                    let (interval_s, uniform) = time::check(&draft.times, place, &mut self.findings);
                    TimeBase { times: Times::Column(draft.times), interval_s, uniform }
                }
            };
            segments.push(Segment {
                label: self.labels.get(index).cloned().unwrap_or_default(),
                rows: range,
                time,
            });
        }
        for target in &self.plan.targets {
            // The labels of the segments are constant in each by their nature.
            if self.plan.segment_column != Some(target.index) {
                rails::check(&target.values, target.index, &ranges, &self.lines, &mut self.findings);
            }
        }
        Recording {
            source,
            columns: self
                .plan
                .targets
                .into_iter()
                .map(|t| Column { header: t.header, values: t.values })
                .collect(),
            diagnosis: self.findings.into_list(&self.plan.names, &self.labels),
            segments,
            rows: self.lines.rows(),
        }
    }
}

/// A cell in a message, shortened.
fn excerpt(cell: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text = String::from_utf8_lossy(cell.trim_ascii());
    let mut short: String =
        text.chars().take(LONGEST).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}

fn plural(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

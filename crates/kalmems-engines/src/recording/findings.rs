//! Collects findings in bounded memory: one entry per kind, column and segment.

use super::{Finding, FindingKind, Purpose, Severity};
use std::collections::BTreeMap;

/// Kind, the column's position in the header, the segment's position.
type FindingKey = (FindingKind, Option<usize>, Option<usize>);

/// Where something is found.
#[derive(Clone, Copy, Debug)]
pub(super) struct FindingPlace {
    pub(super) column: Option<usize>,
    pub(super) segment: Option<usize>,
    pub(super) line: usize,
}

struct FindingCount {
    first_line: usize,
    count: usize,
    detail: String,
}

#[derive(Default)]
pub(super) struct Findings {
    entries: BTreeMap<FindingKey, FindingCount>,
    /// Those about columns that the header does not have.
    absent: Vec<Finding>,
    /// Whether they are of arrays, which have samples and no lines.
    in_arrays: bool,
}

impl Findings {
    /// They are of arrays.
    pub(super) fn of_arrays() -> Self {
        Self { in_arrays: true, ..Self::default() }
    }

    /// Counts one; `detail` is asked for at the first only.
    pub(super) fn add(&mut self, kind: FindingKind, place: FindingPlace, detail: impl FnOnce() -> String) {
        self.add_many(kind, place, 1, detail);
    }

    /// Counts several of the same kind, the first of them at `place`.
    pub(super) fn add_many(
        &mut self,
        kind: FindingKind,
        place: FindingPlace,
        count: usize,
        detail: impl FnOnce() -> String,
    ) {
        if count == 0 {
            return;
        }
        self.entries
            .entry((kind, place.column, place.segment))
            .and_modify(|entry| entry.count += count)
            .or_insert_with(|| FindingCount { first_line: place.line, count, detail: detail() });
    }

    /// Makes all of one kind another kind, with the first of them told in other words.
    pub(super) fn raise(&mut self, of: FindingKind, kind: FindingKind, words: impl Fn(&str) -> String) {
        let found: Vec<FindingKey> = self.entries.keys().filter(|(own, ..)| *own == of).copied().collect();
        for key in found {
            if let Some(entry) = self.entries.remove(&key) {
                let entry = FindingCount { detail: words(&entry.detail), ..entry };
                self.entries.insert((kind, key.1, key.2), entry);
            }
        }
    }

    pub(super) fn add_absent(&mut self, column: &str, line: usize, detail: String) {
        self.absent.push(Finding {
            kind: FindingKind::NoSuchColumn,
            column: Some(column.to_owned()),
            segment: None,
            first_row: line,
            count: 1,
            detail,
            purpose: Purpose::default(),
            in_arrays: self.in_arrays,
        });
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty() && self.absent.is_empty()
    }

    /// Whether one of them makes the recording unusable.
    pub(super) fn is_fatal(&self) -> bool {
        let fatal = |(kind, ..): &FindingKey| kind.severity() == Severity::Fatal;
        !self.absent.is_empty() || self.entries.keys().any(fatal)
    }

    /// All of them, the fatal ones first, then in the order of their lines.
    pub(super) fn list(&self, header: &[String], labels: &[String]) -> Vec<Finding> {
        let mut list = self.absent.clone();
        // Without segments in the file the only one has no name worth saying.
        let label = |segment: usize| labels.get(segment).filter(|label| !label.is_empty()).cloned();
        list.extend(self.entries.iter().map(|(&(kind, column, segment), entry)| Finding {
            kind,
            column: column.and_then(|c| header.get(c).cloned()),
            segment: segment.and_then(label),
            first_row: entry.first_line,
            count: entry.count,
            detail: entry.detail.clone(),
            purpose: Purpose::default(),
            in_arrays: self.in_arrays,
        }));
        list.sort_by_key(|finding| (finding.severity(), finding.first_row));
        list
    }
}

/// A value in a message: seven digits, and an exponent only where zeros would be hard to count.
pub(super) fn short(value: f64) -> String {
    let value = format!("{value:.6e}").parse().unwrap_or(value);
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}

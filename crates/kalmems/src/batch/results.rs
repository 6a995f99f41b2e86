//! The results of a batch, written as one.

use super::input::{distinct, file_name};
use super::journal::BatchPiece;
use super::signals::{BatchSignal, signal_of, signals};
use super::{BatchContent, BatchError, BatchRecording};
use crate::results::{Notice, Output};
use crate::rows;
use crate::table::{TidyRow, TidyTable, number, union};
use crate::topics::{explained, link};
use kalmems_figures::{self as figures, ColumnHead, NoticeSeverity, Page, PagePart, PageSection};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::PathBuf;

/// Columns that come before the figures.
const BEFORE: [&str; 6] = ["recording", "same_as", "error", "trajectories", "file", "sha256"];

/// Figures that the summary has, with all that end with `rmse` and a unit.
const SUMMARY: [&str; 14] = [
    "segment",
    "segment.stretch.number",
    "estimator_name",
    "grade",
    "verdict",
    "segment.arbitrary_signs",
    "segment.arbitrary_half_turns",
    "segment.arbitrary_turns",
    "consistency.mean_nis",
    "segment.motion_hz",
    "segment.duration_s",
    "counts.samples",
    "counts.without_signal",
    "findings",
];

/// Failures that are listed one by one outside of the tables.
const LISTED: usize = 10;

/// Rows of the table on a page.
const ROWS: usize = 1000;

/// What a batch came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BatchSummary {
    /// The experiment's name.
    pub experiment: String,
    /// How many recordings there are.
    pub recordings: usize,
    /// Recordings with the content of an earlier one, with which they share their estimate, and its name.
    pub same_as: BTreeMap<String, String>,
    /// Recordings that could not be estimated, and why.
    pub failures: BTreeMap<String, String>,
    /// Recordings in which the trusted filter is doubtful or worse.
    pub doubtful: Vec<String>,
    /// Mean NIS of each signal of the trusted filters; empty if one signal corrects them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_signal: Vec<BatchSignal>,
    /// The table of `summary.csv`, as far as a screen has it.
    #[serde(skip)]
    table: figures::TextTable,
}

impl BatchSummary {
    /// How many recordings have an estimate.
    pub fn estimated(&self) -> usize {
        self.recordings - self.failures.len()
    }

    /// What a reader must know before trusting the figures.
    pub fn notices(&self) -> Vec<Notice> {
        let warn = |text| Notice::new(NoticeSeverity::Warning, text);
        let mut notices: Vec<Notice> = self
            .failures
            .iter()
            .take(LISTED)
            .map(|(name, why)| warn(format!("`{name}` could not be estimated: {why}")))
            .collect();
        if let Some(more) = self.failures.len().checked_sub(LISTED + 1) {
            notices.push(warn(format!("{} more could not be estimated; `summary.csv` says why", more + 1)));
        }
        if !self.doubtful.is_empty() {
            let names: Vec<String> = self.doubtful.iter().map(|name| format!("`{name}`")).collect();
            let (of, to_do) = (in_words(&names), link("overconfident"));
            notices.push(warn(format!("the verdict is doubtful or worse for {of}{to_do}")));
        }
        if !self.same_as.is_empty() {
            let each: Vec<String> =
                self.same_as.iter().map(|(name, first)| format!("`{name}` is `{first}`")).collect();
            let each = in_words(&each);
            notices.push(Notice::new(
                NoticeSeverity::Note,
                format!("estimated once, as the content is the same: {each}"),
            ));
        }
        notices
    }

    fn in_short(&self) -> String {
        let (all, same, failed) = (self.recordings, self.same_as.len(), self.failures.len());
        let plural = if all == 1 { "" } else { "s" };
        format!(
            "{all} recording{plural}: {} estimated, {same} with the content of another, {failed} failed",
            all - same - failed
                + self.same_as.keys().filter(|name| self.failures.contains_key(*name)).count()
        )
    }
}

/// The first of several names, and how many more there are.
fn in_words(names: &[String]) -> String {
    let listed = names.iter().take(LISTED).cloned().collect::<Vec<String>>().join(", ");
    match names.len().checked_sub(LISTED) {
        Some(more) if more > 0 => format!("{listed} and {more} more"),
        _ => listed,
    }
}

impl fmt::Display for BatchSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.table.rows.len() <= 50 {
            writeln!(f, "{}", self.table.to_text())?;
        }
        f.write_str(&self.in_short())
    }
}

/// What is known of a recording.
pub(super) struct BatchRow<'a> {
    pub(super) recording: &'a BatchRecording,
    pub(super) sha256: &'a str,
    /// The earlier one with the same content.
    pub(super) same_as: Option<&'a BatchRecording>,
    pub(super) came: RecordingEstimate<'a>,
}

/// What came of a recording.
pub(super) enum RecordingEstimate<'a> {
    Made(&'a BatchPiece),
    /// Nothing, for this reason.
    Failed(&'a str),
}

impl BatchRow<'_> {
    fn piece(&self) -> Option<&BatchPiece> {
        match self.came {
            RecordingEstimate::Made(piece) => Some(piece),
            RecordingEstimate::Failed(_) => None,
        }
    }
}

/// The signals of the trusted filters of a recording.
fn signals_of(row: &BatchRow) -> Vec<BatchSignal> {
    let own = row.piece().map_or(&[][..], |piece| piece.rows.as_slice());
    own.iter().flat_map(|own| signals(&row.recording.name, own)).collect()
}

/// Writes all results of a batch; `place_of` says where the file of a recording's trajectories is.
pub(super) fn write_results(
    (experiment, text): (&str, &str),
    rows: &[BatchRow],
    output: &Output,
    place_of: &dyn Fn(&BatchPiece) -> Option<PathBuf>,
) -> Result<BatchSummary, BatchError> {
    let files = trajectories(rows);
    for (row, name) in rows.iter().zip(&files) {
        let (Some(piece), None) = (row.piece(), row.same_as) else { continue };
        let file = place_of(piece).ok_or_else(|| {
            let source = io::Error::other("its trajectories were removed meanwhile");
            output.error(name, source)
        })?;
        output.adopt(name, &file, &piece.trajectories)?;
    }
    let results = table(rows, &files);
    let short = summary_of(&results);
    for (name, table) in [("summary", &short), ("results", &results)] {
        output.write(&format!("{name}.csv"), |w| table.write_csv(w))?;
        output.write(&format!("{name}.parquet"), |w| table.write_parquet(w))?;
    }
    output.write("experiment.toml", |w| w.write_all(text.as_bytes()))?;
    let of = |row: &BatchRow| row.recording.name.clone();
    let summary = BatchSummary {
        experiment: experiment.to_owned(),
        recordings: rows.len(),
        same_as: rows.iter().filter_map(|row| Some((of(row), row.same_as?.name.clone()))).collect(),
        failures: rows
            .iter()
            .filter_map(|row| match row.came {
                RecordingEstimate::Failed(why) => Some((of(row), why.to_owned())),
                RecordingEstimate::Made(_) => None,
            })
            .collect(),
        doubtful: rows.iter().filter(|row| row.piece().is_some_and(|piece| piece.doubtful)).map(of).collect(),
        by_signal: rows.iter().flat_map(signals_of).collect(),
        table: shown(&short),
    };
    let page = explained(page(&summary, text)).to_html()?;
    output.write("report.html", |w| w.write_all(page.as_bytes()))?;
    output.write_run(&format!("{experiment}: {} recordings", rows.len()), || {
        Ok(BatchRecord {
            recordings: rows.len(),
            failed: summary.failures.len(),
            input: rows.iter().map(|row| (row.recording.name.as_str(), row.sha256)).collect(),
        })
    })?;
    Ok(summary)
}

/// The file of each recording's trajectories; that of the first where several have one content.
fn trajectories(rows: &[BatchRow]) -> Vec<String> {
    let named = |row: &BatchRow| file_name(&row.same_as.unwrap_or(row.recording).name);
    let own: Vec<(usize, String)> = rows
        .iter()
        .enumerate()
        .filter(|(_, row)| row.same_as.is_none())
        .map(|(k, row)| (k, named(row)))
        .collect();
    let names = distinct(own.iter().map(|(_, name)| name.clone()).collect());
    let by_recording: BTreeMap<&str, String> = own
        .iter()
        .zip(names)
        .filter_map(|((k, _), name)| {
            Some((rows.get(*k)?.recording.name.as_str(), format!("trajectories/{name}.parquet")))
        })
        .collect();
    let of = |row: &BatchRow| by_recording.get(row.same_as.unwrap_or(row.recording).name.as_str()).cloned();
    rows.iter().map(|row| of(row).unwrap_or_default()).collect()
}

/// All figures of all filters: a row for each recording, segment and filter, and one for a recording without an estimate.
fn table(rows: &[BatchRow], files: &[String]) -> TidyTable {
    let figures = union(
        rows.iter().filter_map(BatchRow::piece).flat_map(|piece| &piece.rows).map(|row| row.keys().collect()),
    );
    let mut lines = Vec::new();
    for (place, (row, file)) in (0_u64..).zip(rows.iter().zip(files)) {
        let path = match &row.recording.content {
            BatchContent::File(path) => path.display().to_string(),
            BatchContent::Arrays(_) => String::new(),
        };
        let (error, file) = match row.came {
            RecordingEstimate::Failed(why) => (why, ""),
            RecordingEstimate::Made(_) => ("", file.as_str()),
        };
        let same_as = row.same_as.map_or("", |first| first.name.as_str());
        let before = [&row.recording.name, same_as, error, file, &path, row.sha256].map(str::to_owned);
        let nothing = rows::ResultRow::new();
        let own = row.piece().map_or(std::slice::from_ref(&nothing), |piece| piece.rows.as_slice());
        for own in own {
            let figures =
                figures.iter().map(|name| own.get(name).and_then(|v| v.as_str()).unwrap_or_default());
            let cells = before.iter().cloned().chain(figures.map(str::to_owned)).collect();
            lines.push(TidyRow { run: place, cells });
        }
    }
    let before = BEFORE.map(str::to_owned);
    let words = before
        .iter()
        .cloned()
        .chain(["segment", "trusted"].map(str::to_owned))
        .chain(
            SUMMARY
                .iter()
                .filter(|name| name.starts_with("segment.arbitrary_"))
                .map(|name| (*name).to_owned()),
        )
        .collect();
    let columns = before.into_iter().chain(figures).collect();
    TidyTable { columns, words, rows: lines, before: BEFORE.len() }
}

/// A row for each recording, or for each of its segments, with the filter that is to be trusted.
fn summary_of(results: &TidyTable) -> TidyTable {
    let is_error = |name: &str| name.rsplit('.').next().is_some_and(|last| last.starts_with("rmse_"));
    let wanted = |name: &&str| SUMMARY.contains(name) || is_error(name) || signal_of(name).is_some();
    let figures = results.columns.iter().skip(BEFORE.len()).map(String::as_str).filter(wanted);
    let ordered = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<String>>();
    let figures: Vec<&str> = figures.collect();
    let (first, last) = BEFORE.split_at(2);
    let in_order = SUMMARY.iter().copied().filter(|name| figures.contains(name));
    let signals = figures.iter().copied().filter(|name| signal_of(name).is_some());
    let errors = figures.iter().copied().filter(|name| is_error(name));
    let columns: Vec<&str> = (first.iter().copied().chain(in_order).chain(signals).chain(errors))
        .chain(last.iter().copied())
        .collect();
    let places: Vec<usize> = columns.iter().filter_map(|name| results.column(name)).collect();
    let trusted = results.column("trusted");
    let segment = results.column("segment");
    let stretch = results.column("segment.stretch.number");
    let of = |line: &TidyRow, place: Option<usize>| {
        place.and_then(|place| line.cells.get(place)).cloned().unwrap_or_default()
    };
    let mut rows: Vec<TidyRow> = Vec::new();
    let mut last: Option<(u64, String, String)> = None;
    for line in &results.rows {
        // The first of a segment, and in its place the one that is to be trusted.
        let key = (line.run, of(line, segment), of(line, stretch));
        let is_next = last.as_ref() != Some(&key);
        if is_next || of(line, trusted) == "yes" {
            let cells =
                places.iter().map(|place| line.cells.get(*place).cloned().unwrap_or_default()).collect();
            let line = TidyRow { run: line.run, cells };
            match rows.last_mut() {
                Some(present) if !is_next => *present = line,
                _ => rows.push(line),
            }
        }
        last = Some(key);
    }
    let mut columns = ordered(&columns);
    for name in &mut columns {
        if name == "estimator_name" {
            "filter".clone_into(name);
        }
    }
    let mut words = results.words.clone();
    words.push("filter".to_owned());
    TidyTable { columns, words, rows, before: 2 }
}

/// The summary for a screen.
fn shown(summary: &TidyTable) -> figures::TextTable {
    let is_shown = |name: &str| {
        let angle_or_value =
            name.rsplit('.').next().is_some_and(|last| last.starts_with("rmse_")) && !name.contains(".parts");
        let shown = [
            "recording",
            "segment",
            "filter",
            "grade",
            "segment.arbitrary_signs",
            "segment.arbitrary_half_turns",
            "segment.arbitrary_turns",
            "consistency.mean_nis",
            "segment.motion_hz",
        ];
        shown.contains(&name) || angle_or_value || signal_of(name).is_some()
    };
    let has_any = |place: usize| summary.rows.iter().any(|line| !line.cells[place].is_empty());
    let places: Vec<usize> = (0..summary.columns.len())
        .filter(|place| is_shown(&summary.columns[*place]) && has_any(*place))
        .collect();
    let column = |place: &usize| {
        if let Some(signal) = signal_of(&summary.columns[*place]) {
            return ColumnHead::number(format!("mean NIS of {signal}"), "");
        }
        let label = match summary.columns[*place].as_str() {
            "consistency.mean_nis" => "mean NIS",
            "segment.motion_hz" => return ColumnHead::number("motion", "Hz"),
            "grade" => "verdict",
            "segment.arbitrary_signs" => "arbitrary sign of",
            "segment.arbitrary_half_turns" => "arbitrary half turn of",
            "segment.arbitrary_turns" => "arbitrary turn of",
            name => name,
        };
        if summary.is_number(*place) { ColumnHead::number(label, "") } else { ColumnHead::text(label) }
    };
    let mut table = figures::TextTable::new("", places.iter().map(column));
    let error = summary.column("error");
    for line in summary.rows.iter().take(ROWS) {
        let has_failed = error.is_some_and(|error| !line.cells[error].is_empty());
        table.push(places.iter().map(|place| {
            let cell = &line.cells[*place];
            match summary.columns[*place].as_str() {
                "grade" if has_failed => "could not be estimated".to_owned(),
                "grade" => cell.replace('_', " "),
                _ if summary.is_number(*place) => number(cell).map_or_else(String::new, figures::significant),
                _ => cell.clone(),
            }
        }));
    }
    table
}

fn page(summary: &BatchSummary, text: &str) -> Page {
    let mut result = PageSection::new("Verdict").part(PagePart::Verdict);
    for notice in summary.notices() {
        result = result.notice(notice.severity, notice.text);
    }
    let result = result.paragraph(summary.in_short()).table(summary.table.clone());
    let beside = "All figures of all filters are in `results.csv`, one row for each recording in `summary.csv`, and the trajectories of each recording in `trajectories`.";
    let how =
        PageSection::made("batch", env!("CARGO_PKG_VERSION"), beside).preformatted("The experiment", text);
    Page::new(&summary.experiment, "Recordings by one experiment").with(result).with(how)
}

#[derive(Serialize)]
struct BatchRecord<'a> {
    recordings: usize,
    failed: usize,
    /// SHA-256 of each recording, by its name.
    input: BTreeMap<&'a str, &'a str>,
}

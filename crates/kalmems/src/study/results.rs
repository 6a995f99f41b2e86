//! The results of a whole study, written as one.

use super::calibration::{self, StudyCalibrationSummary};
use super::journal::{FinishedRuns, JournalHeader};
use super::pictures::{self, pictures};
use super::runs::StudyRuns;
use super::table::table;
use super::{Shard, StudyError, StudyPlan, spread};
use crate::journal::{self, JournalError};
use crate::results::write_figure;
use crate::results::{Notice, Output};
use crate::rigs::Workbench;
use kalmems_figures::{Figure, NoticeSeverity, Page, PagePart, PageSection};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// What a study came to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The study's name.
    pub study: String,
    /// Where the quantity of its first picture is smallest and largest, in one sentence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer: Option<String>,
    /// Points of its grid.
    pub points: u64,
    /// Runs: each point once for each repeat.
    pub runs: u64,
    /// Rows of the table.
    pub rows: usize,
    /// Runs that failed, by what they say; the first of each, and how many.
    pub failures: BTreeMap<String, Failures>,
    /// Runs in which a filter lost lock or failed, or that failed as a whole.
    pub without_estimate: u64,
    /// What is wrong with pictures that are not there.
    pub notes: Vec<String>,
    /// Of a calibration, what its runs say of the verdict and of the claims.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<StudyCalibrationSummary>,
    /// The pictures of the report.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

/// Runs that failed for the same reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Failures {
    /// How many.
    pub runs: u64,
    /// The first of them.
    pub first: u64,
}

impl Summary {
    /// What a reader must know before trusting the figures.
    pub fn notices(&self) -> Vec<Notice> {
        let failures = self.failures.iter().map(|(why, failures)| {
            let text = format!("{} runs failed, the first is run {}: {why}", failures.runs, failures.first);
            Notice::new(NoticeSeverity::Warning, text)
        });
        let Self { without_estimate, runs, .. } = self;
        let lost = (*without_estimate > self.failed()).then(|| {
            let text = format!(
                "{without_estimate} of {runs} runs have no estimate: a filter lost lock, or the run failed. The figures mark them"
            );
            Notice::new(NoticeSeverity::Warning, text)
        });
        failures
            .chain(lost)
            .chain(self.notes.iter().map(|note| Notice::new(NoticeSeverity::Note, note.clone())))
            .collect()
    }

    /// How many runs there were.
    fn in_short(&self) -> String {
        let Self { runs, points, rows, without_estimate, .. } = self;
        let lost = if *without_estimate > self.failed() {
            format!(", {without_estimate} without an estimate")
        } else {
            String::new()
        };
        format!("{runs} runs of {points} points, {rows} rows, {} failed{lost}", self.failed())
    }

    /// How many runs failed.
    pub fn failed(&self) -> u64 {
        self.failures.values().map(|failures| failures.runs).sum()
    }
}

impl Summary {
    /// For a terminal of so many columns.
    pub fn to_text_within(&self, columns: usize) -> String {
        let mut text = self.answer.as_ref().map_or_else(String::new, |answer| format!("{answer}\n"));
        text += &self.in_short();
        for table in self.calibration.iter().flat_map(calibration::page_tables) {
            text += &format!("\n\n{}", table.to_text_within(columns).trim_end());
        }
        text
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.to_text_within(usize::MAX))
    }
}

impl StudyPlan {
    /// The plan of a study, from one of its journals.
    pub fn from_journal(workbench: &Workbench, path: &Path) -> Result<Self, StudyError> {
        let (header, _) = journal::load::<JournalHeader>(path)?;
        Self::parse(workbench, (&header.study, &header.experiment), header.calibration)
    }

    /// What tells the results of this study from others.
    pub(super) fn input_id(&self, digest: &str) -> String {
        format!("{}: {} {}", self.name(), self.command(), digest.get(..12).unwrap_or(digest))
    }

    /// Writes into a result what came of a study whose journals are whole: `results.csv` with all figures of all runs,
    /// `summary.csv` with median and range of those that are drawn, `report.html` with its `figures/`, the study and its experiment, and
    /// `run.toml`. The same runs give the same bytes, in whatever order and on whatever machines they were made.
    ///
    /// Of a calibration also `calibration.csv` and `calibration.json`, and pictures of the ranks.
    ///
    /// With the feature `parquet-results` also `results.parquet`.
    pub fn write_results(&self, journals: &[PathBuf], output: &Output) -> Result<Summary, StudyError> {
        let (header, runs) = joined(journals)?;
        let input_id = self.input_id(&header.digest);
        let table = table(self, &runs);
        output.write("results.csv", |w| table.write_csv(w))?;
        #[cfg(feature = "parquet-results")]
        output.write("results.parquet", |w| table.write_parquet(w))?;
        let drawn = self.description.figure.iter().filter_map(|picture| table.column(&picture.metric));
        let drawn: Vec<usize> = drawn.filter(|column| table.is_number(*column)).collect();
        if !drawn.is_empty() {
            output.write("summary.csv", |w| spread::write_csv(self, &table, &drawn, w))?;
        }
        let runs_of_page = StudyRuns::of(self, &table);
        let (mut figures, notes) = pictures(&runs_of_page);
        let calibration = self.calibration.as_ref().map(|_| self.calibrated(&runs));
        if let Some(summary) = &calibration {
            figures.extend(calibration::figures(summary));
            let long = calibration::long_table(summary);
            output.write("calibration.csv", |w| long.write_csv(w))?;
            #[cfg(feature = "parquet-results")]
            output.write("calibration.parquet", |w| long.write_parquet(w))?;
            output.write("calibration.json", |w| {
                serde_json::to_writer_pretty(&mut *w, summary).map_err(io::Error::other)?;
                w.write_all(b"\n")
            })?;
        }
        for figure in &figures {
            write_figure(output, figure)?;
        }
        output.write("study.toml", |w| w.write_all(self.source.text.as_bytes()))?;
        output.write("experiment.toml", |w| w.write_all(self.experiment.text.as_bytes()))?;
        let mut failures: BTreeMap<String, Failures> = BTreeMap::new();
        for finished in runs.values() {
            if let Some(error) = &finished.error {
                let entry = failures.entry(error.clone());
                entry.or_insert(Failures { runs: 0, first: finished.run }).runs += 1;
            }
        }
        let summary = Summary {
            study: self.name().to_owned(),
            answer: pictures::answer(&runs_of_page),
            points: self.points(),
            runs: self.runs(),
            rows: table.rows.len(),
            failures,
            without_estimate: runs_of_page.lost() as u64,
            notes,
            calibration,
            figures,
        };
        let page = self.page(&summary, &header, runs_of_page.section()).to_html()?;
        output.write("report.html", |w| w.write_all(page.as_bytes()))?;
        output.write_run(&input_id, || {
            Ok(StudyRecord {
                digest: &header.digest,
                points: summary.points,
                runs: summary.runs,
                failed: summary.failed(),
                seed: self.description.seed,
            })
        })?;
        Ok(summary)
    }

    /// What the runs of a calibration say together.
    fn calibrated(&self, runs: &FinishedRuns) -> StudyCalibrationSummary {
        StudyCalibrationSummary::of(runs.iter().map(|(index, finished)| {
            let settings = self.run(*index).settings;
            let grid = self.grid().filter(|(_, axis)| axis.points() > 1);
            let settings = grid
                .filter_map(|(place, axis)| Some(format!("{} {}", axis.name, settings.get(place)?.text())));
            (settings.collect::<Vec<_>>().join(", "), finished.judged.as_slice())
        }))
    }

    fn page(&self, summary: &Summary, header: &JournalHeader, runs: PageSection) -> Page {
        let result = PageSection::new("Verdict").part(PagePart::Verdict);
        let mut result = summary.answer.iter().fold(result, PageSection::paragraph);
        for notice in summary.notices() {
            result = result.notice(notice.severity, notice.text);
        }
        let result = result.paragraph(summary.in_short());
        let tables = summary.calibration.iter().flat_map(calibration::page_tables);
        let result = tables.fold(result, PageSection::table);
        let pictures = summary.figures.iter().cloned().fold(PageSection::new("Figures"), PageSection::figure);
        let how = PageSection::made(
            self.command(),
            &header.version,
            "All figures of all runs are in `results.csv`.",
        )
        .preformatted("The study", &self.source.text)
        .preformatted("The experiment", &self.experiment.text);
        let subtitle = self.description.description.clone().unwrap_or_default();
        Page::new(self.name(), subtitle)
            .with(result)
            .with(pictures)
            .with(runs.part(PagePart::Evidence))
            .with(how)
    }
}

#[derive(Serialize)]
struct StudyRecord<'a> {
    digest: &'a str,
    points: u64,
    runs: u64,
    failed: u64,
    seed: u64,
}

/// All runs of a study from its journals, each of them once.
fn joined(journals: &[PathBuf]) -> Result<(JournalHeader, FinishedRuns), StudyError> {
    let mut whole: Option<(JournalHeader, FinishedRuns)> = None;
    let mut holders: BTreeMap<u64, usize> = BTreeMap::new();
    let mut shards = Vec::new();
    for (i, path) in journals.iter().enumerate() {
        let (header, runs) = journal::load::<JournalHeader>(path)?;
        shards.push(header.shard.parse::<Shard>()?);
        let (first, joined) = whole.get_or_insert_with(|| (header.clone(), FinishedRuns::new()));
        if let Some(why) = first.is_of_another_study(&header) {
            return Err(StudyError::Different { first: journals[0].clone(), second: path.clone(), why });
        }
        for (run, finished) in runs {
            // A part that was made twice, since somebody was taken for dead, says the same.
            if joined.get(&run) == Some(&finished) {
                continue;
            }
            if let Some(holder) = holders.insert(run, i) {
                let (first, second) = (journals[holder].clone(), path.clone());
                return Err(StudyError::Overlap { index: run, first, second });
            }
            joined.insert(run, finished);
        }
    }
    let no_journal = || {
        let why = "none was named".to_owned();
        StudyError::from(JournalError::NoJournal { path: PathBuf::new(), work: "study", why })
    };
    let (header, runs) = whole.ok_or_else(no_journal)?;
    let missing = header.runs - runs.len() as u64;
    if let Some(first) = (0..header.runs).find(|run| !runs.contains_key(run)) {
        let holder = shards.iter().find(|shard| shard.has(first));
        let remedy = match (holder, shards.first()) {
            (Some(shard), _) => format!("let shard {shard} come to its end, by the command that began it"),
            (None, Some(any)) => {
                format!("name the journal of shard {}/{} as well", first % any.of() + 1, any.of())
            }
            (None, None) => String::new(),
        };
        return Err(StudyError::Gap { missing, total: header.runs, first, remedy });
    }
    Ok((header, runs))
}

//! The runs of a study as its report has them: what each was made with, which have no estimate, and where a figure leads to.

use super::StudyPlan;
use super::axis::{AxisValue, plain_number};
use super::pictures::name;
use super::spread::{RowGroup, groups};
use crate::evaluate::Grade;
use crate::results::{Verdict, severity_of};
use crate::table::TidyTable;
use crate::units::Value;
use kalmems_figures::{ColumnHead, NoticeSeverity, PageSection, SeriesLink, TextTable};
use serde::de::value::Error as NotKnown;
use serde::de::{Deserialize, IntoDeserializer};
use std::collections::{BTreeMap, BTreeSet};

/// The most runs that a page lists.
const MOST: usize = 1000;

/// The runs of a study with the rows that they came to.
pub(super) struct StudyRuns<'a> {
    pub(super) plan: &'a StudyPlan,
    pub(super) table: &'a TidyTable,
    /// The estimators of its rows, and that of each row.
    pub(super) groups: Vec<RowGroup>,
    pub(super) of_rows: Vec<Option<usize>>,
    runs: BTreeMap<u64, RunAnswers>,
    listed: BTreeSet<u64>,
}

/// What came of a run.
#[derive(Default)]
struct RunAnswers {
    /// Why it has no rows.
    error: Option<String>,
    /// By estimator.
    verdicts: BTreeMap<usize, RowVerdict>,
}

struct RowVerdict {
    verdict: Option<Verdict>,
    grade: Option<Grade>,
}

impl RowVerdict {
    fn has_estimate(&self) -> bool {
        self.verdict.is_none_or(Verdict::is_of_an_estimate)
    }

    fn words(&self) -> String {
        match (self.grade, self.verdict) {
            (Some(grade), Some(verdict)) if !self.has_estimate() => {
                format!("{grade} ({})", verdict.words().to_lowercase())
            }
            (Some(grade), _) => grade.to_string(),
            (None, Some(verdict)) => verdict.words().to_lowercase(),
            (None, None) => String::new(),
        }
    }

    fn severity(&self) -> NoticeSeverity {
        if self.has_estimate() {
            self.grade.map_or(NoticeSeverity::Note, severity_of)
        } else {
            NoticeSeverity::Failure
        }
    }
}

impl RunAnswers {
    /// Whether an estimator has no estimate.
    fn is_lost(&self, group: usize) -> bool {
        self.error.is_some() || self.verdicts.get(&group).is_some_and(|row| !row.has_estimate())
    }

    fn has_lost(&self) -> bool {
        self.error.is_some() || self.verdicts.values().any(|row| !row.has_estimate())
    }
}

impl<'a> StudyRuns<'a> {
    pub(super) fn of(plan: &'a StudyPlan, table: &'a TidyTable) -> Self {
        let (groups, of_rows) = groups(table);
        let cell = |row: usize, column: Option<usize>| {
            column.map_or("", |column| table.rows[row].cells[column].as_str())
        };
        let [error, verdict, grade] = ["error", "verdict", "grade"].map(|name| table.column(name));
        let mut runs: BTreeMap<u64, RunAnswers> = BTreeMap::new();
        for (row, (line, group)) in table.rows.iter().zip(&of_rows).enumerate() {
            let answers = runs.entry(line.run).or_default();
            let why = cell(row, error);
            answers.error = (!why.is_empty()).then(|| why.to_owned());
            if let Some(group) = group {
                let of_row =
                    RowVerdict { verdict: known(cell(row, verdict)), grade: known(cell(row, grade)) };
                answers.verdicts.insert(*group, of_row);
            }
        }
        let lost = runs.iter().filter(|(_, answers)| answers.has_lost()).map(|(run, _)| *run);
        let firsts = runs.keys().copied().filter(|run| run % plan.description.repeats == 0);
        let mut listed = BTreeSet::new();
        for run in lost.chain(firsts).chain(runs.keys().copied()) {
            if listed.len() == MOST {
                break;
            }
            listed.insert(run);
        }
        Self { plan, table, groups, of_rows, runs, listed }
    }

    /// How many have no estimate of one estimator or more.
    pub(super) fn lost(&self) -> usize {
        self.runs.values().filter(|answers| answers.has_lost()).count()
    }

    /// How many runs of a point have no estimate of an estimator.
    pub(super) fn lost_at(&self, point: u64, group: usize) -> usize {
        self.at(point).filter(|(_, answers)| answers.is_lost(group)).count()
    }

    /// Whether a run has no estimate of an estimator.
    pub(super) fn is_lost(&self, run: u64, group: usize) -> bool {
        self.runs.get(&run).is_some_and(|answers| answers.is_lost(group))
    }

    /// Whether a point has anything to say of an estimator.
    pub(super) fn has(&self, point: u64, group: usize) -> bool {
        self.at(point).any(|(_, answers)| answers.error.is_some() || answers.verdicts.contains_key(&group))
    }

    fn at(&self, point: u64) -> impl Iterator<Item = (u64, &RunAnswers)> {
        let repeats = self.plan.description.repeats;
        self.runs.range(point * repeats..(point + 1) * repeats).map(|(run, answers)| (*run, answers))
    }

    /// Where a point of a figure leads to: to the first of its runs without an estimate, or to the first; and what is there, with the value
    /// that is drawn. `None` where the page does not list it.
    pub(super) fn link_to_point(
        &self,
        (point, group): (u64, usize),
        at: [f64; 2],
        value: &str,
    ) -> Option<SeriesLink> {
        let lost = self.at(point).find(|(_, answers)| answers.is_lost(group));
        let (run, _) = lost.or_else(|| self.at(point).next())?;
        let (count, of) = (self.lost_at(point, group), self.at(point).count());
        let lost = if count > 0 { format!("; {count} of {of} without an estimate") } else { String::new() };
        self.link(run, at, &format!("{value}{lost}"))
    }

    /// Where the point of one run leads to.
    pub(super) fn link(&self, run: u64, at: [f64; 2], value: &str) -> Option<SeriesLink> {
        let settings = self.plan.run(run).settings;
        let settings = self.plan.axes.iter().zip(&settings);
        let settings: Vec<String> = settings
            .map(|(axis, setting)| format!("{} {}", axis.name.replace('_', " "), written(setting)))
            .collect();
        self.listed.contains(&run).then(|| SeriesLink {
            at,
            text: format!("{}: {value} (run {run})", settings.join(", ")),
            anchor: anchor(run),
        })
    }

    /// The runs with their settings, as many as a page lists.
    pub(super) fn section(&self) -> PageSection {
        let Self { plan, runs, listed, .. } = self;
        let mut how = "Each run is the experiment below with the study's `[truth]`, these values".to_owned();
        how += if plan.simulated { " and this `seed` in `[simulate]`." } else { "." };
        if listed.len() < runs.len() {
            how += &format!(
                " {} of {} runs are listed: those without an estimate, then the first of each point; all are in `results.csv`.",
                listed.len(),
                runs.len()
            );
        }
        PageSection::new("Runs").paragraph(how).table(self.listing())
    }

    fn listing(&self) -> TextTable {
        let axes = self.plan.axes.iter().map(|axis| {
            let label = axis.name.replace('_', " ");
            let number = |unit: &str| ColumnHead::number(label.clone(), unit);
            if axis.is_of_numbers() { number(&axis.unit) } else { ColumnHead::text(label.clone()) }
        });
        let first = [ColumnHead::number("run", ""), ColumnHead::text("grade")];
        let last = ["repeat", "seed"].map(|name| ColumnHead::number(name, ""));
        let last = last.into_iter().take(if self.plan.simulated { 2 } else { 1 });
        let mut table = TextTable::new("", first.into_iter().chain(axes).chain(last));
        let (mut severities, mut anchors) = (Vec::new(), Vec::new());
        for run in &self.listed {
            let made = self.plan.run(*run);
            let (words, severity) = self.outcome(*run);
            let settings = made
                .settings
                .iter()
                .map(|setting| setting.number.map_or_else(|| setting.text(), plain_number));
            let cells = [run.to_string(), words].into_iter().chain(settings);
            table.rows.push(
                cells
                    .chain([made.repeat.to_string(), made.seed.to_string()])
                    .take(table.columns.len())
                    .collect(),
            );
            severities.push(severity);
            anchors.push(anchor(*run));
        }
        table.with_verdicts("grade", severities).with_anchors(anchors)
    }

    /// What came of a run, in words, and how serious the worst of it is.
    fn outcome(&self, run: u64) -> (String, NoticeSeverity) {
        let Some(answers) = self.runs.get(&run) else { return (String::new(), NoticeSeverity::Note) };
        if let Some(error) = &answers.error {
            return (format!("failed: {error}"), NoticeSeverity::Failure);
        }
        let words = |(group, row): (&usize, &RowVerdict)| match answers.verdicts.len() {
            1 => row.words(),
            _ => format!("{}: {}", name(&self.groups, &self.groups[*group]), row.words()),
        };
        let words: Vec<String> = answers.verdicts.iter().map(words).collect();
        let worst = answers.verdicts.values().map(RowVerdict::severity).max();
        (words.join("; "), worst.unwrap_or(NoticeSeverity::Note))
    }
}

/// What a run is called on the page.
fn anchor(run: u64) -> String {
    format!("run-{run}")
}

/// A word of the results as what it stands for.
fn known<T: for<'de> Deserialize<'de>>(cell: &str) -> Option<T> {
    T::deserialize(IntoDeserializer::<NotKnown>::into_deserializer(cell)).ok()
}

/// A value as written, with the unit as the axes of pictures have it.
pub(super) fn written(setting: &AxisValue) -> String {
    let text = setting.text();
    match Value::parse(&text) {
        Ok(value) => {
            format!("{} {}", value.parts().0, kalmems_figures::unit_sign(value.parts().1)).trim().to_owned()
        }
        Err(_) => text,
    }
}

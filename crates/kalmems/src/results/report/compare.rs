//! Results of several estimates as one page: what each answers, how far the answers are apart, and both as pictures.

use super::compared_run::{AnswerDifference, ComparedRun, ComparedSegment, entries, shown, text};
use crate::inspect::quantity;
use crate::results::summary::significant_value;
use crate::topics::{explained, link};
use kalmems_figures::{
    Axis, ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, ReportError, Series,
    SeriesRole, TextTable,
};
use serde_json::Value;
use std::path::PathBuf;

/// Runs that overlap in a picture; more would have colours in common.
const MOST: usize = 9;

/// Segments that have pictures.
const PICTURED: usize = 4;

/// Why results cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A folder is no result of an estimate.
    #[error(
        "`{}` cannot be compared: {why}; expected the folder of a result of `kalmems estimate`, which holds `metrics.json` and \
         `trajectory_….csv`",
        path.display()
    )]
    Run {
        /// The folder, or the file in it.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// The page cannot be made.
    #[error(transparent)]
    Report(#[from] ReportError),
}

/// Several results of `kalmems estimate` next to one another.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// What each run answers, and how far each answer is from that of the first run; a sentence each.
    pub answer: Vec<String>,
    /// The page's text, which needs nothing else.
    pub html: String,
}

/// Compares the results of `kalmems estimate` in these folders.
pub fn compare(folders: &[PathBuf]) -> Result<Comparison, CompareError> {
    let mut runs = Vec::new();
    for (place, folder) in folders.iter().enumerate() {
        let mut run = ComparedRun::read(folder)?;
        // Names that are the same differ by their place.
        let same = |other: &PathBuf| other.file_name() == folder.file_name();
        if folders.iter().filter(|other| same(other)).count() > 1 {
            run.name = format!("{} ({})", run.name, place + 1);
        }
        runs.push(run);
    }
    let (table, severities) = verdicts(&runs);
    let mut pictured: Vec<&str> = Vec::new();
    for segment in runs.iter().take(MOST).flat_map(|run| &run.segments) {
        if !pictured.contains(&segment.prefix.as_str()) {
            pictured.push(&segment.prefix);
        }
    }
    let left_out = pictured.len().saturating_sub(PICTURED);
    pictured.truncate(PICTURED);
    let mut answer: Vec<String> = runs.iter().flat_map(ComparedRun::answers).collect();
    let mut motion = PageSection::new("Motion");
    for prefix in pictured {
        let of_segment = differences(&runs, prefix)?;
        answer.extend(of_segment.iter().filter_map(|(place, other)| apart(&runs, prefix, *place, other)));
        motion = motion.figure(overlay(&runs, prefix));
        let figure = differences_figure(&runs, prefix, &of_segment);
        motion = figure.into_iter().fold(motion, PageSection::figure);
    }
    let all_pass = severities.iter().all(|severity| *severity == NoticeSeverity::Ok);
    let verdict = PageSection::new("Answers and verdicts").part(PagePart::Verdict);
    let mut verdict = answer.iter().fold(verdict, PageSection::paragraph);
    verdict = verdict.table(table.with_verdicts("verdict", severities));
    if !all_pass {
        let to_do = format!("What to do about a filter that does not pass{}.", link("overconfident"));
        verdict = verdict.paragraph(to_do);
    }
    if runs.len() > MOST || left_out > 0 {
        let text = format!(
            "The pictures show the first {MOST} runs and the first {PICTURED} segments; compare fewer runs to see the others."
        );
        verdict = verdict.notice(NoticeSeverity::Warning, text);
    }
    let made = PageSection::made(
        "compare",
        env!("CARGO_PKG_VERSION"),
        "The numbers are those of the results, which are named above.",
    );
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    let mut page = Page::new("Runs compared", names.join(", ")).with(verdict);
    if !motion.blocks.is_empty() {
        page = page.with(motion);
    }
    Ok(Comparison { answer, html: explained(page.with(made)).to_html()? })
}

/// How far each run's answer for a segment is from that of the first run, with the place of the run.
fn differences(runs: &[ComparedRun], prefix: &str) -> Result<Vec<(usize, AnswerDifference)>, CompareError> {
    let Some(base) = runs.first().and_then(|run| run.segment(prefix)) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for (place, run) in runs.iter().enumerate().take(MOST).skip(1) {
        let Some(own) = run.segment(prefix) else { continue };
        let wrong = |why| CompareError::Run { path: PathBuf::from(&run.name), why };
        found.push((place, own.minus(base).map_err(wrong)?));
    }
    Ok(found)
}

/// How far a run's answer is from that of the first run, as a sentence.
fn apart(runs: &[ComparedRun], prefix: &str, place: usize, found: &AnswerDifference) -> Option<String> {
    let (name, unit, _) = shown(found.states.first()?);
    let of = prefix.trim_end_matches('_');
    let of = if of.is_empty() { String::new() } else { format!("{of}, ") };
    let rms = found.rms.is_finite().then(|| quantity(significant_value(found.rms), unit));
    let rms = rms
        .map_or_else(|| "no time in common".to_owned(), |rms| format!("{rms} rms after the settling time"));
    Some(format!("{} minus {}: {of}{name}: {rms}", runs.get(place)?.name, runs.first()?.name))
}

/// Each filter of each run with its verdict and its metrics.
fn verdicts(runs: &[ComparedRun]) -> (TextTable, Vec<NoticeSeverity>) {
    let columns = [
        ColumnHead::text("run"),
        ColumnHead::text("recording"),
        ColumnHead::text("filter"),
        ColumnHead::text("verdict"),
        ColumnHead::number("angle RMSE", "deg"),
        ColumnHead::number("mean NIS", ""),
        ColumnHead::number("log-likelihood", ""),
    ];
    let mut table = TextTable::new("", columns);
    let mut severities = Vec::new();
    for run in runs {
        for recording in entries(&run.metrics, "recordings") {
            for segment in entries(recording, "segments") {
                let place = [text(recording, "name"), text(segment, "label")].join(" ");
                for filter in entries(segment, "estimators") {
                    let number = |path: &str, digits: usize| {
                        let found = filter.pointer(path).and_then(Value::as_f64);
                        found.map_or_else(|| "–".to_owned(), |value| format!("{value:.digits$}"))
                    };
                    let grade = text(filter, "grade");
                    let verdict = if grade.is_empty() { text(filter, "verdict") } else { grade };
                    severities.push(match verdict {
                        "passes" => NoticeSeverity::Ok,
                        "doubtful" => NoticeSeverity::Warning,
                        "failed" | "no_estimate" | "astray" => NoticeSeverity::Failure,
                        _ => NoticeSeverity::Note,
                    });
                    table.push([
                        run.name.clone(),
                        place.trim().to_owned(),
                        text(filter, "name").to_owned(),
                        verdict.replace('_', " "),
                        number("/errors/angle/rmse_deg", 4),
                        number("/consistency/mean_nis", 3),
                        number("/consistency/log_likelihood", 1),
                    ]);
                }
            }
        }
    }
    (table, severities)
}

/// The panels of a figure over time, each with the states of this column.
fn over_time<'a>(
    figure: Figure,
    states: impl Iterator<Item = &'a String>,
    of: impl Fn(&str) -> Vec<Series>,
) -> Figure {
    states.enumerate().fold(figure, |figure, (number, state)| {
        let (label, unit, _) = shown(state);
        let panel = Panel::new(Axis::new("time", "s"), Axis::new(label, unit));
        let panel = of(state).into_iter().fold(panel, Panel::with);
        figure.with(if number > 0 { panel.sharing_x() } else { panel })
    })
}

/// The states of a segment in all runs, a colour for each run.
fn overlay(runs: &[ComparedRun], prefix: &str) -> Figure {
    let own: Vec<(usize, &ComparedRun, &ComparedSegment)> = (runs.iter().enumerate().take(MOST))
        .filter_map(|(place, run)| Some((place, run, run.segment(prefix)?)))
        .collect();
    let mut states: Vec<&String> = Vec::new();
    for state in own.iter().flat_map(|(.., segment)| &segment.states) {
        if !states.contains(&state) {
            states.push(state);
        }
    }
    let series = |state: &str| {
        let of_run = |(place, run, one): &(usize, &ComparedRun, &ComparedSegment)| {
            let column = 3 * one.states.iter().position(|own| own == state)?;
            let name = format!("{}: {}", run.name, one.filter.replace('_', " "));
            let band = Series::of_track("", SeriesRole::Other, &one.track, [column + 1, column + 2]);
            let line = Series::of_track(name, SeriesRole::Other, &one.track, [column, column]);
            let band = one.claims.then(|| band.of_colour(*place));
            Some(band.into_iter().chain([line.of_colour(*place)]))
        };
        own.iter().filter_map(of_run).flatten().collect()
    };
    let caption = "The states by the filter of each run that answers, a colour for each run, with three standard deviations on each side where \
                   it claims some.";
    let figure = Figure::new(format!("{prefix}compared"), titled("States", prefix), caption);
    over_time(figure, states.into_iter(), series)
}

/// What each run's answer has more than that of the first run; `None` if there is nothing to subtract.
fn differences_figure(
    runs: &[ComparedRun],
    prefix: &str,
    found: &[(usize, AnswerDifference)],
) -> Option<Figure> {
    let first = &runs.first()?.name;
    let (_, any) = found.first()?;
    let series = |state: &str| {
        let of_run = |(place, one): &(usize, AnswerDifference)| {
            let column = one.states.iter().position(|own| own == state)?;
            let name = format!("{} minus {first}", runs.get(*place)?.name);
            Some(Series::of_track(name, SeriesRole::Other, &one.track, [column, column]).of_colour(*place))
        };
        found.iter().filter_map(of_run).collect()
    };
    let caption = format!(
        "What each run has more than {first} at the same time, in the colour of the run; between its samples {first} goes along straight lines."
    );
    let figure = Figure::new(format!("{prefix}differences"), titled("Differences", prefix), caption);
    Some(over_time(figure, any.states.iter(), series))
}

/// The title of a picture of a segment.
fn titled(what: &str, prefix: &str) -> String {
    let of = prefix.trim_end_matches('_');
    if of.is_empty() { what.to_owned() } else { format!("{what}: {of}") }
}

//! Results of several estimates, laid over one another as a page.

use crate::topics::{explained, link};
use kalmems_figures::{
    Axis, ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, ReportError, Series,
    SeriesRole, TextTable, Track,
};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Trajectories that are laid over one another; of more a picture tells nothing.
const MOST: usize = 12;

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

/// What is taken from a result.
struct ComparedRun {
    name: String,
    metrics: Value,
    /// The trajectories by the name of their file without its ending.
    trajectories: BTreeMap<String, ComparedTrajectory>,
}

/// The states of a trajectory over time.
struct ComparedTrajectory {
    /// The names of the columns of the states, with their units.
    states: Vec<String>,
    /// Each state, in the order of these names, with three standard deviations about it.
    track: Track,
    claims: bool,
}

/// Several results of `kalmems estimate`, laid over one another: the page's text, which needs nothing else.
pub fn compare_page(folders: &[PathBuf]) -> Result<String, CompareError> {
    let mut runs = Vec::new();
    for (place, folder) in folders.iter().enumerate() {
        let mut run = ComparedRun::read(folder)?;
        // Names that are the same are told apart by their place.
        let same = |other: &PathBuf| other.file_name() == folder.file_name();
        if folders.iter().filter(|other| same(other)).count() > 1 {
            run.name = format!("{} ({})", run.name, place + 1);
        }
        runs.push(run);
    }
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    let (table, severities) = verdicts(&runs);
    let (figures, left_out) = overlays(&runs);
    let all_pass = severities.iter().all(|severity| *severity == NoticeSeverity::Ok);
    let mut verdict = PageSection::new("Verdicts")
        .part(PagePart::Verdict)
        .table(table.with_verdicts("verdict", severities));
    if !all_pass {
        let to_do = format!("What to do about a filter that does not pass{}.", link("overconfident"));
        verdict = verdict.paragraph(to_do);
    }
    if left_out > 0 {
        let text =
            format!("The figures show {MOST} trajectories; {left_out} more are left out: name fewer runs.");
        verdict = verdict.notice(NoticeSeverity::Warning, text);
    }
    let answer = figures.into_iter().fold(PageSection::new("Motion"), PageSection::figure);
    let made = PageSection::made(
        "compare",
        env!("CARGO_PKG_VERSION"),
        "The numbers are those of the results, which are named above.",
    );
    let page = Page::new("Runs compared", names.join(", ")).with(verdict).with(answer).with(made);
    Ok(explained(page).to_html()?)
}

impl ComparedRun {
    fn read(folder: &Path) -> Result<Self, CompareError> {
        let wrong = |path: &Path, why: &dyn std::fmt::Display| CompareError::Run {
            path: path.to_owned(),
            why: why.to_string(),
        };
        let file = folder.join("metrics.json");
        let text = fs::read(&file).map_err(|e| wrong(&file, &e))?;
        let metrics: Value = serde_json::from_slice(&text).map_err(|e| wrong(&file, &e))?;
        if !metrics.get("recordings").is_some_and(Value::is_array) {
            return Err(wrong(&file, &"it names no recordings"));
        }
        let mut trajectories = BTreeMap::new();
        for entry in fs::read_dir(folder).map_err(|e| wrong(folder, &e))? {
            let path = entry.map_err(|e| wrong(folder, &e))?.path();
            let name = path.file_stem().and_then(std::ffi::OsStr::to_str).unwrap_or_default().to_owned();
            if name.contains("trajectory_") && path.extension().is_some_and(|ending| ending == "csv") {
                let read = ComparedTrajectory::read(&path).map_err(|why| wrong(&path, &why))?;
                trajectories.insert(name, read);
            }
        }
        let name = folder
            .file_name()
            .map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, metrics, trajectories })
    }
}

impl ComparedTrajectory {
    fn read(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|e| e.to_string())?;
        let mut rows = csv::Reader::from_reader(BufReader::new(file));
        let heads: Vec<String> =
            rows.headers().map_err(|e| e.to_string())?.iter().map(str::to_owned).collect();
        if heads.first().map(String::as_str) != Some("time_s") {
            return Err(format!(
                "its first column is `{}`; expected `time_s`",
                heads.first().map_or("", String::as_str)
            ));
        }
        let end = heads.iter().position(|head| head.starts_with("innovation_")).unwrap_or(heads.len());
        // Each state has its standard deviation behind it, or none has.
        let claims = heads.get(2).is_some_and(|head| head.contains("_sd_"));
        let states: Vec<usize> = (1..end).step_by(if claims { 2 } else { 1 }).collect();
        let mut track = Track::new(3 * states.len());
        let mut values = vec![f64::NAN; 3 * states.len()];
        for row in rows.records() {
            let row = row.map_err(|e| e.to_string())?;
            let number =
                |place: usize| row.get(place).and_then(|cell| cell.parse::<f64>().ok()).unwrap_or(f64::NAN);
            for (place, column) in states.iter().enumerate() {
                let factor = shown(&heads[*column]).2;
                let (mean, sd) =
                    (factor * number(*column), if claims { factor * number(column + 1) } else { f64::NAN });
                values[3 * place..3 * place + 3].copy_from_slice(&[mean, mean - 3.0 * sd, mean + 3.0 * sd]);
            }
            track.push(number(0), &values);
        }
        Ok(Self { states: states.into_iter().map(|column| heads[column].clone()).collect(), track, claims })
    }
}

/// A column as people read it: its name, its unit, and how many of that one of the column's unit is.
fn shown(column: &str) -> (String, &str, f64) {
    let units = ["_rad_per_s2", "_rad_per_s", "_m_per_s2", "_m_per_s"];
    let at = units.iter().find_map(|unit| column.strip_suffix(unit)).map(str::len);
    let at = at.or_else(|| column.rfind('_')).unwrap_or(column.len());
    let (name, unit) = (column[..at].replace('_', " "), column.get(at + 1..).unwrap_or("1"));
    match unit {
        "rad" => (name, "deg", 1_f64.to_degrees()),
        "rad_per_s" => (name, "rad/s", 1.0),
        "m_per_s" => (name, "m/s", 1.0),
        "m_per_s2" => (name, "m/s^2", 1.0),
        unit => (name, unit, 1.0),
    }
}

/// Each filter of each run with its verdict and its figures.
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
    let list =
        |value: &Value, key: &str| value.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
    let text =
        |value: &Value, key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default().to_owned();
    for run in runs {
        for recording in list(&run.metrics, "recordings") {
            for segment in list(&recording, "segments") {
                let place = [text(&recording, "name"), text(&segment, "label")].join(" ");
                for filter in list(&segment, "estimators") {
                    let number = |path: &str, digits: usize| {
                        let found = filter.pointer(path).and_then(Value::as_f64);
                        found.map_or_else(|| "–".to_owned(), |value| format!("{value:.digits$}"))
                    };
                    let grade = text(&filter, "grade");
                    let verdict = if grade.is_empty() { text(&filter, "verdict") } else { grade };
                    severities.push(match verdict.as_str() {
                        "passes" => NoticeSeverity::Ok,
                        "doubtful" => NoticeSeverity::Warning,
                        "failed" | "no_estimate" | "astray" => NoticeSeverity::Failure,
                        _ => NoticeSeverity::Note,
                    });
                    table.push([
                        run.name.clone(),
                        place.trim().to_owned(),
                        text(&filter, "name"),
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

/// A figure for each state that a trajectory has, all runs in it; and how many trajectories are not shown.
fn overlays(runs: &[ComparedRun]) -> (Vec<Figure>, usize) {
    let all: Vec<(String, &ComparedTrajectory)> = (runs.iter())
        .flat_map(|run| {
            let named = run.trajectories.iter();
            named.map(move |(name, one)| {
                (format!("{}: {}", run.name, name.replace("trajectory_", "").replace('_', " ")), one)
            })
        })
        .collect();
    let shown_ones = &all[..all.len().min(MOST)];
    let mut states: Vec<&String> = Vec::new();
    for state in shown_ones.iter().flat_map(|(_, one)| &one.states) {
        if !states.contains(&state) {
            states.push(state);
        }
    }
    let panels = states.into_iter().enumerate().map(|(number, state)| {
        let (label, unit, _) = shown(state);
        let mut panel = Panel::new(Axis::new("time", "s"), Axis::new(label, unit));
        for (name, one) in shown_ones {
            let Some(place) = one.states.iter().position(|own| own == state) else { continue };
            let place = 3 * place;
            if one.claims {
                panel =
                    panel.with(Series::of_track("", SeriesRole::Other, &one.track, [place + 1, place + 2]));
            }
            panel =
                panel.with(Series::of_track(name.as_str(), SeriesRole::Other, &one.track, [place, place]));
        }
        if number > 0 { panel.sharing_x() } else { panel }
    });
    let caption = "The states of all runs over one another, with three standard deviations on each side where a filter claims some.";
    let figure = panels.fold(Figure::new("compared", "States", caption), Figure::with);
    (if figure.panels.is_empty() { Vec::new() } else { vec![figure] }, all.len() - shown_ones.len())
}

//! Results that are compared: what is read of each, and how far the answers of two are apart.

use super::compare::CompareError;
use super::names::of_parts;
use crate::evaluate::Grade;
use crate::results::metrics::is_tie;
use kalmems_figures::Track;
use serde_json::Value;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// What is taken from a result.
pub(super) struct ComparedRun {
    pub(super) name: String,
    pub(super) metrics: Value,
    /// The trajectory of the answering filter, for each segment that has one.
    pub(super) segments: Vec<ComparedSegment>,
}

/// The trajectory that answers for a segment.
pub(super) struct ComparedSegment {
    /// What the names of its files begin with, which runs with the same recordings have in common.
    pub(super) prefix: String,
    /// The key of the filter.
    pub(super) filter: String,
    path: PathBuf,
    /// The names of the columns of the states, with their units.
    pub(super) states: Vec<String>,
    /// Each state, in the order of these names, with three standard deviations about it.
    pub(super) track: Track,
    pub(super) claims: bool,
    /// From this time on it counts, in s.
    settled_s: f64,
}

/// How far a run's answer is from that of another one.
pub(super) struct AnswerDifference {
    /// The columns of the states that both have.
    pub(super) states: Vec<String>,
    /// The difference of each, in the units in which they are shown.
    pub(super) track: Track,
    /// The root mean square of the first after both have settled; not a number if they have no time in common.
    pub(super) rms: f64,
}

pub(super) fn entries<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

pub(super) fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value.get(key).and_then(Value::as_str).unwrap_or_default()
}

impl ComparedRun {
    pub(super) fn read(folder: &Path) -> Result<Self, CompareError> {
        let wrong = |path: &Path, why: &dyn std::fmt::Display| CompareError::Run {
            path: path.to_owned(),
            why: why.to_string(),
        };
        let file = folder.join("metrics.json");
        let read = fs::read(&file).map_err(|e| wrong(&file, &e))?;
        let metrics: Value = serde_json::from_slice(&read).map_err(|e| wrong(&file, &e))?;
        if !metrics.get("recordings").is_some_and(Value::is_array) {
            return Err(wrong(&file, &"it names no recordings"));
        }
        let recordings = entries(&metrics, "recordings");
        let mut segments = Vec::new();
        for recording in recordings {
            let own = entries(recording, "segments");
            for segment in own {
                let Some(filter) = answering(segment) else { continue };
                let label = text(segment, "label");
                let stretch = segment.pointer("/stretch/number").and_then(Value::as_u64).unwrap_or(1);
                let stretch = usize::try_from(stretch).unwrap_or(1);
                // A long recording of one segment has its label in the names.
                let prefixes = [own.len() > 1 && !label.is_empty(), !label.is_empty()].map(|is_labelled| {
                    let parts = [(recordings.len() > 1, text(recording, "name")), (is_labelled, label)];
                    of_parts(parts, stretch)
                });
                let path = |prefix: &String| folder.join(format!("{prefix}trajectory_{filter}.csv"));
                let Some(prefix) = prefixes.into_iter().find(|prefix| path(prefix).is_file()) else {
                    continue;
                };
                let path = path(&prefix);
                let skip_s = segment.get("skip_s").and_then(Value::as_f64).unwrap_or(0.0);
                let found = ComparedSegment::read((prefix, filter), path.clone(), skip_s);
                segments.push(found.map_err(|why| wrong(&path, &why))?);
            }
        }
        let name = folder
            .file_name()
            .map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into_owned());
        Ok(Self { name, metrics, segments })
    }

    /// The sentences with which the run answers, each with the run's name.
    pub(super) fn answers(&self) -> impl Iterator<Item = String> + '_ {
        let said = entries(&self.metrics, "answer").iter().filter_map(Value::as_str);
        said.map(|answer| format!("{}: {answer}", self.name))
    }

    pub(super) fn segment(&self, prefix: &str) -> Option<&ComparedSegment> {
        self.segments.iter().find(|segment| segment.prefix == prefix)
    }
}

/// The key of the filter that answers for a segment: of the best grade, then the likeliest unless it is tied, then with the fewest parameters as states.
fn answering(segment: &Value) -> Option<String> {
    let is_tied = segment.pointer("/likeliest/ahead").and_then(Value::as_f64).is_some_and(is_tie);
    let likeliest = segment.pointer("/likeliest/key").and_then(Value::as_str).filter(|_| !is_tied);
    let judged = entries(segment, "estimators").iter().filter_map(|filter| {
        let grade: Grade = serde_json::from_value(filter.get("grade")?.clone()).ok()?;
        let key = text(filter, "key");
        Some(((grade, likeliest != Some(key), entries(filter, "parameters").len()), key))
    });
    judged.min_by_key(|(order, _)| *order).map(|(_, key)| key.to_owned())
}

impl ComparedSegment {
    fn read((prefix, filter): (String, String), path: PathBuf, skip_s: f64) -> Result<Self, String> {
        let mut rows = TrajectoryRows::open(&path)?;
        let mut track = Track::new(3 * rows.columns.len());
        let mut values = vec![f64::NAN; 3 * rows.columns.len()];
        let mut start_s = None;
        while let Some((time_s, states)) = rows.next()? {
            start_s = start_s.or(Some(time_s));
            for (own, [mean, sd]) in values.chunks_exact_mut(3).zip(states) {
                own.copy_from_slice(&[*mean, mean - 3.0 * sd, mean + 3.0 * sd]);
            }
            track.push(time_s, &values);
        }
        let settled_s = start_s.unwrap_or(0.0) + skip_s;
        Ok(Self { prefix, filter, path, states: rows.states, track, claims: rows.claims, settled_s })
    }

    /// How far this answer is from that of another run, at its own times, between which the other goes along straight lines.
    pub(super) fn minus(&self, other: &Self) -> Result<AnswerDifference, String> {
        let (mut own, mut others) = (TrajectoryRows::open(&self.path)?, TrajectoryRows::open(&other.path)?);
        let place = |(place, state): (usize, &String)| {
            Some((place, other.states.iter().position(|known| known == state)?))
        };
        let pairs: Vec<(usize, usize)> = self.states.iter().enumerate().filter_map(place).collect();
        let states = pairs.iter().filter_map(|(place, _)| self.states.get(*place).cloned()).collect();
        let mut track = Track::new(pairs.len());
        let (mut squares, mut count) = (0.0, 0.0);
        let (mut before, mut after): (Option<(f64, Vec<f64>)>, _) = (None, others.means()?);
        while let Some((time_s, means)) = own.means()? {
            while after.as_ref().is_some_and(|(after_s, _)| *after_s < time_s) {
                before = after;
                after = others.means()?;
            }
            let at = |there: usize| {
                let (after_s, values) = after.as_ref()?;
                let value = *values.get(there)?;
                let Some((before_s, earlier)) = &before else { return (*after_s == time_s).then_some(value) };
                let share = (time_s - before_s) / (after_s - before_s);
                Some(earlier.get(there)? + share * (value - earlier.get(there)?))
            };
            let apart = |(here, there): &(usize, usize)| {
                means.get(*here).zip(at(*there)).map_or(f64::NAN, |(own, other)| own - other)
            };
            let differences: Vec<f64> = pairs.iter().map(apart).collect();
            track.push(time_s, &differences);
            let first = differences.first().copied().unwrap_or(f64::NAN);
            if first.is_finite() && time_s >= self.settled_s.max(other.settled_s) {
                squares += first * first;
                count += 1.0;
            }
        }
        Ok(AnswerDifference { states, track, rms: f64::sqrt(squares / count) })
    }
}

/// The time of a row in s, and each state with its standard deviation.
type TrajectoryRow<'a> = (f64, &'a [[f64; 2]]);

/// The rows of a trajectory, one after the other.
struct TrajectoryRows {
    rows: csv::Reader<BufReader<File>>,
    row: csv::StringRecord,
    /// The names of the columns of the states.
    states: Vec<String>,
    /// The place of each state's column, and how many of the unit that is shown one of its unit is.
    columns: Vec<(usize, f64)>,
    claims: bool,
    values: Vec<[f64; 2]>,
}

impl TrajectoryRows {
    fn open(path: &Path) -> Result<Self, String> {
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
        // Each state has its standard deviation after it, or none has.
        let claims = heads.get(2).is_some_and(|head| head.contains("_sd_"));
        let columns: Vec<usize> = (1..end).step_by(if claims { 2 } else { 1 }).collect();
        let states: Vec<String> = columns.iter().map(|column| heads[*column].clone()).collect();
        let columns =
            columns.into_iter().zip(&states).map(|(column, state)| (column, shown(state).2)).collect();
        Ok(Self { rows, row: csv::StringRecord::new(), states, columns, claims, values: Vec::new() })
    }

    /// The time of the next row, and each state with its standard deviation; not a number if there is none.
    fn next(&mut self) -> Result<Option<TrajectoryRow<'_>>, String> {
        if !self.rows.read_record(&mut self.row).map_err(|e| e.to_string())? {
            return Ok(None);
        }
        let number =
            |place: usize| self.row.get(place).and_then(|cell| cell.parse::<f64>().ok()).unwrap_or(f64::NAN);
        self.values.clear();
        self.values.extend(self.columns.iter().map(|(column, factor)| {
            [factor * number(*column), if self.claims { factor * number(column + 1) } else { f64::NAN }]
        }));
        Ok(Some((number(0), &self.values)))
    }

    /// The time and the states of the next row that has a time.
    fn means(&mut self) -> Result<Option<(f64, Vec<f64>)>, String> {
        while let Some((time_s, states)) = self.next()? {
            if time_s.is_finite() {
                return Ok(Some((time_s, states.iter().map(|[mean, _]| *mean).collect())));
            }
        }
        Ok(None)
    }
}

/// A column as people read it: its name, its unit, and how many of that one of the column's unit is.
pub(super) fn shown(column: &str) -> (String, &str, f64) {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn written(folder: &Path, name: &str, rows: &[(f64, f64)]) -> ComparedSegment {
        let path = folder.join(name);
        let rows = rows.iter().map(|(time_s, angle)| format!("{time_s},{angle},0.1\n"));
        fs::write(&path, format!("time_s,angle_rad,angle_sd_rad\n{}", rows.collect::<String>())).unwrap();
        ComparedSegment::read((String::new(), "ekf".to_owned()), path, 1.0).unwrap()
    }

    #[test]
    fn a_difference_is_taken_at_the_same_time_after_both_have_settled() {
        let folder = tempfile::tempdir().unwrap();
        let one = written(folder.path(), "one.csv", &[(0.0, 9.0), (1.0, 1.0), (2.0, 2.0), (4.0, 5.0)]);
        let other = written(folder.path(), "other.csv", &[(0.0, 0.0), (0.5, 0.5), (3.0, 3.0)]);
        // Less what 1 s and 2 s have by the straight line through 0.5 s and 3 s: 0, 0; at 4 s the other has ended.
        let same = one.minus(&other).unwrap();
        assert!(same.rms.abs() < 1e-12 && same.states == ["angle_rad"], "{}", same.rms);
        let shifted = written(folder.path(), "shifted.csv", &[(0.0, 0.0), (0.5, 0.4), (3.0, 2.9)]);
        let apart = one.minus(&shifted).unwrap();
        assert!((apart.rms - 0.1_f64.to_degrees()).abs() < 1e-9, "{}", apart.rms);
        let later = written(folder.path(), "later.csv", &[(7.0, 0.0), (9.0, 0.5)]);
        assert!(one.minus(&later).unwrap().rms.is_nan());
    }

    #[test]
    fn the_filter_of_the_best_grade_answers_then_the_likeliest() {
        let of = |likeliest: &str, grades: [&str; 2]| {
            let filter =
                |key: &str, grade: &str| serde_json::json!({ "key": key, "grade": grade, "parameters": [] });
            let filters = [filter("a", grades[0]), filter("b", grades[1])];
            answering(&serde_json::json!({ "likeliest": { "key": likeliest }, "estimators": filters }))
                .unwrap()
        };
        assert_eq!(of("a", ["doubtful", "passes"]), "b");
        assert_eq!(of("b", ["passes", "passes"]), "b");
        assert_eq!(of("", ["passes", "passes"]), "a");
        let tied = serde_json::json!({ "key": "b", "ahead": 0.1 });
        let filters =
            serde_json::json!([{ "key": "a", "grade": "passes" }, { "key": "b", "grade": "passes" }]);
        let segment = serde_json::json!({ "likeliest": tied, "estimators": filters });
        assert_eq!(answering(&segment).unwrap(), "a");
    }
}

//! The figures of one run as rows: one for each segment and estimator.

use crate::results::Metrics;
use serde_json::{Map, Value};

/// Columns by name, in their order, with their text: numbers as short as they read back as the same bits. Text, because
/// that is what no reading and writing changes.
pub(crate) type ResultRow = Map<String, Value>;

/// What begins the names of the lists of states of which the signals do not tell one branch from the other.
const ARBITRARY: &str = "arbitrary_";

/// The list of the figures of each signal of a filter that several correct.
pub(crate) const BY_SIGNAL: &str = "by_signal";

/// All rows of a run, from what `metrics.json` of an estimate would hold. A figure that there is not has no column; of
/// a list, the row has the length; of names, these; of signals, the figures of each.
pub(crate) fn rows(metrics: &Metrics) -> Vec<ResultRow> {
    rows_of(&serde_json::to_value(metrics).unwrap_or_default())
}

fn rows_of(metrics: &Value) -> Vec<ResultRow> {
    let mut rows = Vec::new();
    for recording in list(metrics, "recordings") {
        for segment in list(recording, "segments") {
            let mut common = ResultRow::new();
            common.insert("recording".to_owned(), text(recording.get("name")));
            common.insert("segment".to_owned(), text(segment.get("label")));
            for (name, value) in segment.as_object().into_iter().flatten() {
                if name.starts_with(ARBITRARY) {
                    let named = |one: &Value| match one {
                        Value::Array(turned) => {
                            let names: Vec<&str> = turned.iter().filter_map(Value::as_str).collect();
                            names.join("+")
                        }
                        one => one.as_str().unwrap_or_default().to_owned(),
                    };
                    let states: Vec<String> = list(segment, name).iter().map(named).collect();
                    common.insert(format!("segment.{name}"), Value::String(states.join(" ")));
                } else if name != "estimators" && name != "label" {
                    flatten(&format!("segment.{name}"), value, &mut common);
                }
            }
            for estimator in list(segment, "estimators") {
                let mut row = common.clone();
                row.insert("estimator".to_owned(), text(estimator.get("key")));
                row.insert("estimator_name".to_owned(), text(estimator.get("name")));
                for (name, value) in estimator.as_object().into_iter().flatten() {
                    if name != "key" && name != "name" {
                        flatten(name, value, &mut row);
                    }
                }
                rows.push(row);
            }
        }
    }
    rows
}

fn list<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

fn text(value: Option<&Value>) -> Value {
    match value {
        None | Some(Value::Null) => Value::String(String::new()),
        Some(Value::String(text)) => Value::String(text.clone()),
        Some(other) => Value::String(other.to_string()),
    }
}

fn flatten(name: &str, value: &Value, row: &mut ResultRow) {
    match value {
        Value::Null => {}
        Value::Object(inner) => {
            for (below, value) in inner {
                flatten(&format!("{name}.{below}"), value, row);
            }
        }
        Value::Array(items) if name == BY_SIGNAL => {
            for item in items {
                let signal = item.get("signal").and_then(Value::as_str).unwrap_or_default();
                for (below, value) in
                    item.as_object().into_iter().flatten().filter(|(key, _)| *key != "signal")
                {
                    flatten(&format!("{name}.{signal}.{below}"), value, row);
                }
            }
        }
        Value::Array(items) => {
            row.insert(name.to_owned(), Value::String(items.len().to_string()));
        }
        value => {
            row.insert(name.to_owned(), text(Some(value)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_row_names_the_states_whose_sign_is_arbitrary_and_the_signals() {
        let segment = json!({ "label": "a", "arbitrary_signs": ["theta", "phi"], "arbitrary_half_turns": ["turn"],
            "arbitrary_turns": [["x", "y"], ["phi"]], "remarks": ["one"],
            "estimators": [{ "key": "ekf", "name": "EKF", "counts": { "samples": 3 },
                "by_signal": [{ "signal": "near", "mean_nis": 1.5 }, { "signal": "far", "mean_nis": 0.5 }] }] });
        let found = rows_of(&json!({ "recordings": [{ "name": "test", "segments": [segment] }] }));
        let of = |name: &str| found[0][name].as_str().unwrap().to_owned();
        assert_eq!(
            [
                "segment.arbitrary_signs",
                "segment.arbitrary_half_turns",
                "segment.arbitrary_turns",
                "segment.remarks",
                "counts.samples",
                "by_signal.near.mean_nis",
                "by_signal.far.mean_nis"
            ]
            .map(of),
            ["theta phi", "turn", "x+y phi", "1", "3", "1.5", "0.5"]
        );
    }
}

//! The source as a unit of FMI 3.0 for co-simulation, to be compiled by those who import it.

use super::ProjectTexts;
use std::fmt::Write as _;

/// What a number of a step's arguments ends with if it is of an input, and its value between the input before and now.
const POINTS: [(&str, &str); 3] = [
    ("_start", "unit->before[@]"),
    ("_middle", "0.5F * (unit->before[@] + unit->now[@])"),
    ("_end", "unit->now[@]"),
];

/// Adds the files of the unit, with the filter in its sources.
pub(super) fn add(files: &mut Vec<(String, String)>, texts: &ProjectTexts) {
    let of_filter = ["c", "h"].map(|ending| format!("{}.{ending}", texts.name));
    let sources: Vec<(String, String)> = of_filter
        .iter()
        .filter_map(|name| {
            let (_, text) = files.iter().find(|(place, _)| *place == format!("src/{name}"))?;
            Some((format!("fmu/sources/{name}"), text.clone()))
        })
        .collect();
    files.extend(sources);
    let (inputs, given) = inputs_of(&texts.columns);
    let has_variances =
        files.iter().any(|(_, text)| text.contains(&format!("float {}_variance(", texts.name)));
    let (variables, structure) = variables(texts, &inputs, has_variances);
    let variances = if has_variances {
        "\n        } else if (at < FIRST_STATUS) {\n            values[k] = (double)@name@_variance(&unit->filter, at - FIRST_VARIANCE);"
    } else {
        ""
    };
    for (place, text) in [
        ("fmu/modelDescription.xml", include_str!("modelDescription.xml")),
        ("fmu/sources/buildDescription.xml", include_str!("buildDescription.xml")),
        ("fmu/sources/fmi3.c", include_str!("fmi3.c")),
    ] {
        let text = text
            .replace("@variances@", variances)
            .replace("@variables@", &variables)
            .replace("@structure@", &structure)
            .replace("@given@", &given)
            .replace("@inputs@", &format!("{}U", inputs.len()))
            .replace("@states@", &format!("{}U", texts.states.len()));
        files.push((place.to_owned(), texts.filled(&text)));
    }
}

/// The inputs and measurements, each once, and the arguments of a step made of them.
fn inputs_of(columns: &[String]) -> (Vec<String>, String) {
    let (mut inputs, mut given): (Vec<String>, String) = (Vec::new(), String::new());
    for column in columns {
        let mut points = POINTS.iter().filter(|_| column.starts_with("u_"));
        let found = points.find_map(|(end, value)| Some((column.strip_suffix(end)?, *value)));
        let (name, value) = found.unwrap_or((column, "unit->now[@]"));
        let place = inputs.iter().position(|known| known == name).unwrap_or(inputs.len());
        if place == inputs.len() {
            inputs.push(name.to_owned());
        }
        let _ = write!(given, ", {}", value.replace('@', &place.to_string()));
    }
    (inputs, given)
}

/// The variables of a unit behind the time, and which of them are outputs.
fn variables(texts: &ProjectTexts, inputs: &[String], has_variances: bool) -> (String, String) {
    let (mut variables, mut outputs) = (String::new(), Vec::new());
    for (k, name) in inputs.iter().enumerate() {
        let _ = writeln!(
            variables,
            "    <Float64 name=\"{name}\" valueReference=\"{}\" causality=\"input\" variability=\"continuous\" start=\"0\"/>",
            k + 1
        );
    }
    let mut output = |kind: &str, name: &str, reference: usize| {
        let _ = writeln!(
            variables,
            "    <{kind} name=\"{name}\" valueReference=\"{reference}\" causality=\"output\" variability=\"discrete\"/>"
        );
        outputs.push(reference);
    };
    let (first, count) = (inputs.len() + 1, texts.states.len());
    for (k, name) in texts.states.iter().enumerate() {
        output("Float64", name, first + k);
    }
    for (k, name) in texts.states.iter().enumerate().filter(|_| has_variances) {
        output("Float64", &format!("{name}_variance"), first + count + k);
    }
    let measured = texts.columns.iter().filter_map(|column| column.strip_prefix("y_"));
    for (k, name) in measured.enumerate() {
        output("Int32", &format!("{name}_status"), first + 2 * count + k);
    }
    let mut structure = String::new();
    for kind in ["Output", "InitialUnknown"] {
        for reference in &outputs {
            let _ = writeln!(structure, "    <{kind} valueReference=\"{reference}\"/>");
        }
    }
    (variables, structure)
}

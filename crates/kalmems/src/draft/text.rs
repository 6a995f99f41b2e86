//! The text of an experiment file with a recording in the place of a template's simulation.

use super::{Assigned, DraftRequest, SortedRecording};
use crate::config::FROM_RECORDING;
use crate::inspect::{Inspection, quantity};
use std::fmt::Write as _;
use std::path::Path;

/// The part of a record that a filter has to settle, where the template's time would take more.
const SETTLING: f64 = 0.2;

/// The longest name of an experiment.
const LONGEST_NAME: usize = 64;

/// What a recording seems to hold, in sentences.
pub(super) fn recognised(inspection: &Inspection) -> Vec<String> {
    let mut sentences = inspection.recognised.clone();
    if let Some(longest) = inspection.longest_segment()
        && let (Some(rate), Some(duration)) = (longest.rate_hz, longest.duration_s)
        && inspection.time.is_some()
    {
        let of = if inspection.segments.len() > 1 { "The longest of its records has" } else { "It has" };
        let (rate, duration) = (quantity(rate, "Hz"), quantity(duration, "s"));
        sentences.push(format!("{of} {} samples at {rate}, {duration}.", longest.rows));
    }
    for channel in &inspection.channels {
        if let Some(character) = inspection.character(channel) {
            let says = character.sentence(&channel.si_unit, inspection.frequency_unit);
            sentences.push(format!("`{}`: {says}.", channel.column));
        }
    }
    sentences
}

/// The file.
pub(super) fn written(sorted: &SortedRecording, wanted: &DraftRequest, recognised: &[String]) -> String {
    let template = sorted.template.text;
    let (device, rest) = template.split_once("\n[simulate]\n").unwrap_or((template, ""));
    let estimate = rest.split_once("\n[estimate]\n").map_or("", |(_, estimate)| estimate);
    let name = name(wanted.recording);
    let device = of_recording(device);
    let mut text = String::new();
    let file = wanted.recording.file_name().map_or_else(|| "it".into(), |name| name.to_string_lossy());
    let _ = writeln!(text, "# From {file}, which holds:");
    for sentence in recognised {
        let _ = writeln!(text, "#   {sentence}");
    }
    let _ = writeln!(text, "#");
    for step in steps(&device) {
        let _ = writeln!(text, "# {step}");
    }
    let _ = writeln!(text, "\nname = {}", quoted(&name));
    let _ = writeln!(text, "{device}");
    recordings(&mut text, sorted, wanted);
    let _ = write!(text, "[estimate]\n{}", settling(estimate, sorted));
    text
}

/// The table in which a template names the numbers that a recording tells.
const IDENTIFY: &str = "\n[identify]\n";

/// What to do with the file, in order.
fn steps(device: &str) -> Vec<&'static str> {
    let mut steps = vec![
        "1. Replace the numbers of the published device by those of yours. `must be known` marks numbers that no recording tells.",
    ];
    if device.contains(IDENTIFY) {
        steps.push("2. `kalmems identify` with this file finds the numbers that `[identify]` names, and writes an experiment with them.");
        steps.push(
            "3. `kalmems estimate` with that experiment estimates the motion, and says whether to trust it.",
        );
    } else {
        steps
            .push("2. `kalmems estimate` with this file estimates the motion, and says whether to trust it.");
    }
    steps
}

/// The name of an experiment with this recording: results have it as the name of their folder.
fn name(recording: &Path) -> String {
    let stem = recording.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    let plain = stem.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' });
    let name: String = plain.take(LONGEST_NAME).collect();
    if name.is_empty() { "recording".to_owned() } else { name }
}

/// The device's tables without the name and the description of a published one, and with noises of its readout that are found from the
/// recording.
fn of_recording(device: &str) -> String {
    let (mut text, mut table) = (String::new(), "");
    for line in
        device.lines().skip_while(|line| line.starts_with("name =") || line.starts_with("description ="))
    {
        if line.starts_with('[') {
            table = line;
        }
        let is_noise = match line.split_once(" =").map(|(key, _)| key) {
            Some("noise_variance" | "noise_density") => {
                table.contains("readout") || table.contains("electrodes")
            }
            Some("signal") => table == "[device.equations.noise]",
            _ => false,
        };
        let key = line.split_once(" =").map_or(line, |(key, _)| key);
        let _ = if is_noise {
            writeln!(text, "{key} = \"{FROM_RECORDING}\" # or a number, where it is known")
        } else {
            writeln!(text, "{line}")
        };
    }
    text
}

fn recordings(text: &mut String, sorted: &SortedRecording, wanted: &DraftRequest) {
    let further = wanted.further.iter().map(|(role, path)| (role.key(), path.as_path()));
    for (place, (role, path)) in std::iter::once(("test", wanted.recording)).chain(further).enumerate() {
        let _ = writeln!(text, "[[recording]]\nrole = \"{role}\"");
        // Several recordings are told apart by their names.
        if !wanted.further.is_empty() {
            let _ = writeln!(text, "name = \"{role}-{}\"", place + 1);
        }
        let _ = writeln!(text, "file = {}", quoted(&from_folder(path, wanted.folder)));
        if let Some(column) = &sorted.inspection.segment_column {
            let _ = writeln!(text, "segments = {{ column = {} }}", quoted(column));
        }
        let clock = match (&sorted.inspection.time, wanted.rate) {
            (Some(column), None) => format!("column = {}", quoted(column)),
            (Some(column), Some(rate)) => format!("column = {}, rate = {}", quoted(column), quoted(rate)),
            (None, rate) => format!("rate = {}", quoted(rate.unwrap_or_default())),
        };
        let _ = writeln!(text, "clock = {{ {clock} }}");
        let _ = writeln!(text, "channels = {{ {} }}", channels(&sorted.assigned, false));
        let references = channels(&sorted.assigned, true);
        if !references.is_empty() {
            let _ = writeln!(
                text,
                "# Read by the evaluation alone.\nreference = {{ channels = {{ {references} }} }}"
            );
        }
        text.push('\n');
    }
}

fn channels(assigned: &[Assigned], references: bool) -> String {
    let of = assigned.iter().filter(|one| one.is_reference == references);
    let entry = |one: &Assigned| match one.unit {
        None => format!("{} = {}", one.meaning, quoted(&one.column)),
        Some(unit) => {
            format!("{} = {{ column = {}, unit = {} }}", one.meaning, quoted(&one.column), quoted(unit))
        }
    };
    of.map(entry).collect::<Vec<_>>().join(", ")
}

/// The table of the estimate, with a settling time that leaves most of a short recording.
fn settling(estimate: &str, sorted: &SortedRecording) -> String {
    let duration = sorted.inspection.longest_segment().and_then(|segment| segment.duration_s);
    let mut text = String::new();
    for line in estimate.lines() {
        let stated = line.strip_prefix("skip = \"").and_then(|rest| rest.split_once('"'));
        let seconds =
            stated.and_then(|(value, _)| crate::units::Value::parse(value).ok()).map(|value| value.si());
        match (seconds, duration.map(|duration| SETTLING * duration)) {
            (Some(stated), Some(most)) if stated > most => {
                let _ = writeln!(
                    text,
                    "skip = \"{}\" # the time that the filter takes to settle; it is not judged",
                    quantity(most, "s")
                );
            }
            _ => {
                let _ = writeln!(text, "{line}");
            }
        }
    }
    text
}

/// A path as it is found from a folder.
fn from_folder(path: &Path, folder: &Path) -> String {
    let (absolute, folder) = (path.canonicalize(), folder.canonicalize());
    match (absolute, folder) {
        (Ok(path), Ok(folder)) => path.strip_prefix(&folder).unwrap_or(&path).display().to_string(),
        _ => path.display().to_string(),
    }
}

/// A string as TOML has it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

//! The text of an experiment file with recordings in the place of a template's simulation.

use super::{
    Assigned, DraftError, DraftRequest, ReadoutNoise, RecordingKind, SortedRecording, SortedRecordings,
    numbers,
};
use crate::config::{FROM_RECORDING, RecordingRole};
use crate::inspect::quantity;
use crate::recording::Hints;
use crate::rigs::Template;
use std::fmt::Write as _;
use std::path::Path;

/// The part of a record that a filter has to settle, where the template's time would take more.
const SETTLING: f64 = 0.2;

/// The longest name of an experiment.
const LONGEST_NAME: usize = 64;

/// What the recordings seem to hold, in sentences; of several each under the name of its file.
pub(super) fn recognised(sorted: &SortedRecordings) -> Vec<String> {
    let several = sorted.recordings.len() > 1;
    let of = |recording: &SortedRecording| {
        let mut sentences = recording.examined.recognised(&recording.assigned, &recording.kind_sentence);
        if several {
            sentences.insert(
                0,
                format!("{}, with the role `{}`:", recording.examined.name(), recording.role.key()),
            );
        }
        if let Some(why) = unused(recording, &sorted.template) {
            sentences.push(why);
        }
        sentences
    };
    sorted.recordings.iter().flat_map(of).collect()
}

/// Why a recording is not used, where it lacks a channel without which its role is of no use.
fn unused(recording: &SortedRecording, template: &Template) -> Option<String> {
    let moves = matches!(recording.role, RecordingRole::RingDown);
    let is_there = |meaning: &str| recording.assigned.iter().any(|one| one.meaning == meaning);
    let lacking = template.channels.iter().find(|one| moves && one.needed && !is_there(one.meaning))?;
    let (meaning, what) = (lacking.meaning, lacking.what);
    Some(format!(
        "It is not used, as it has no column for `{meaning}`, {what}, which this device needs: add one, of zeros where there was none."
    ))
}

/// The file.
pub(super) fn written(
    sorted: &SortedRecordings,
    wanted: &DraftRequest,
    recognised: &[String],
    noise: ReadoutNoise,
) -> Result<String, DraftError> {
    let template = sorted.template.text;
    let (device, rest) = template.split_once("\n[simulate]\n").unwrap_or((template, ""));
    let estimate = rest.split_once("\n[estimate]\n").map_or("", |(_, estimate)| estimate);
    let Some(first) = sorted.recordings.first() else { return Ok(template.to_owned()) };
    let name = name(&first.examined.path);
    let device = numbers::with(&of_recording(device, noise), wanted.numbers)?;
    let mut text = String::new();
    let files: Vec<String> = sorted.recordings.iter().map(|one| one.examined.name()).collect();
    let holds = if files.len() == 1 { "holds" } else { "hold" };
    let _ = writeln!(text, "# From {}, which {holds}:", files.join(", "));
    for sentence in recognised {
        let _ = writeln!(text, "#   {sentence}");
    }
    let _ = writeln!(text, "#");
    for step in steps(&device, sorted) {
        let _ = writeln!(text, "# {step}");
    }
    let _ = writeln!(text, "\nname = {}", quoted(&name));
    let _ = writeln!(text, "{device}");
    recordings(&mut text, sorted, wanted);
    let _ = write!(text, "[estimate]\n{}", settling(estimate, first));
    Ok(text)
}

/// The table in which a template names the numbers that a recording tells.
const IDENTIFY: &str = "\n[identify]\n";

/// What to do with the file, in order, and which recording to take next.
fn steps(device: &str, sorted: &SortedRecordings) -> Vec<String> {
    let mut steps = vec![
        "1. Replace the numbers of the published device by those of yours. `must be known` marks numbers that no recording shows.".to_owned(),
    ];
    if device.contains(IDENTIFY) {
        steps.push("2. `kalmems identify` with this file finds the numbers that `[identify]` names, and writes an experiment with them.".to_owned());
        steps.push(
            "3. `kalmems estimate` with that experiment estimates the motion, and reports whether to trust it."
                .to_owned(),
        );
    } else {
        steps.push(
            "2. `kalmems estimate` with this file estimates the motion, and reports whether to trust it."
                .to_owned(),
        );
    }
    let then = [
        "Where the verdict is `doubtful` or worse, `kalmems diagnose` with that experiment looks for the cause. It prints what to write: another value of a number, or the number as a state of the filter; `--write` writes an experiment with that value.".to_owned(),
        next_recording(sorted),
    ];
    for step in then {
        steps.push(format!("{}. {step}", steps.len() + 1));
    }
    steps
}

/// Which recording to take next, and why.
fn next_recording(sorted: &SortedRecordings) -> String {
    let has = |kind: RecordingKind| sorted.recordings.iter().any(|one| one.kind == kind);
    let identifies = sorted.template.text.contains(IDENTIFY);
    let is_driven = sorted.template.channels.iter().any(|one| one.meaning == "drive");
    if has(RecordingKind::Still) && sorted.recordings.len() == 1 {
        return "Record the moving device next: this recording shows the noise of the readout and no motion."
            .to_owned();
    }
    if identifies && is_driven && !has(RecordingKind::RingDown) {
        return "Record a free decay next, with the drive switched off: it shows damping and resonance without the drive.".to_owned();
    }
    if identifies && is_driven && !(has(RecordingKind::Steady) || has(RecordingKind::Sweep)) {
        return "Record the driven device next: a decay shows nothing of how the drive acts.".to_owned();
    }
    let references: Vec<String> =
        sorted.template.references.iter().map(|one| format!("`{}` ({})", one.meaning, one.what)).collect();
    if references.is_empty()
        || sorted.recordings.iter().any(|one| one.assigned.iter().any(|one| one.is_reference))
    {
        return "Record the device at rest next: what its signal shows then is the noise of the readout alone.".to_owned();
    }
    let references = references.join(" or ");
    format!(
        "Record a reference next, {references}: it alone shows an error of the numbers marked `must be known`."
    )
}

/// The name of an experiment with this recording: results have it as the name of their folder.
fn name(recording: &Path) -> String {
    let stem = recording.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
    let plain = stem.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' });
    let name: String = plain.take(LONGEST_NAME).collect();
    if name.is_empty() { "recording".to_owned() } else { name }
}

/// The device's tables without the name and the description of a published one, and with noises of its readout that are found from the
/// recording, or are left as they are.
fn of_recording(device: &str, noise: ReadoutNoise) -> String {
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
        let _ = if is_noise && noise == ReadoutNoise::FromRecording {
            writeln!(text, "{key} = \"{FROM_RECORDING}\" # or a number, where it is known")
        } else {
            writeln!(text, "{line}")
        };
    }
    text
}

fn recordings(text: &mut String, sorted: &SortedRecordings, wanted: &DraftRequest) {
    for (place, recording) in sorted.recordings.iter().enumerate() {
        let table = recording_table(recording, wanted, (sorted.recordings.len() > 1).then_some(place + 1));
        match unused(recording, &sorted.template) {
            None => text.push_str(&table),
            Some(why) => {
                let _ = writeln!(text, "# {why}");
                table.lines().for_each(|line| _ = writeln!(text, "# {line}"));
            }
        }
        text.push('\n');
    }
}

/// The table of a recording, with a name where there are several.
fn recording_table(recording: &SortedRecording, wanted: &DraftRequest, place: Option<usize>) -> String {
    let (role, inspection) = (recording.role.key(), &recording.examined.inspection);
    let mut text = format!("[[recording]]\nrole = \"{role}\"\n");
    if let Some(place) = place {
        let _ = writeln!(text, "name = \"{role}-{place}\"");
    }
    let _ = writeln!(text, "file = {}", quoted(&from_folder(&recording.examined.path, wanted.folder)));
    if let Some(format) = format_table(&recording.examined.stated.hints, &inspection.source.format) {
        let _ = writeln!(text, "format = {format}");
    }
    if let Some(column) = &inspection.segment_column {
        let _ = writeln!(text, "segments = {{ column = {} }}", quoted(column));
    }
    let mut clock = Vec::new();
    if let Some(column) = &inspection.time {
        clock.push(format!("column = {}", quoted(column)));
    }
    if let Some(stated) = &recording.examined.stated.time {
        clock.push(format!("unit = {}", quoted(&stated.unit_text)));
    }
    if let Some(rate) = wanted.rate {
        clock.push(format!("rate = {}", quoted(rate)));
    }
    let _ = writeln!(text, "clock = {{ {} }}", clock.join(", "));
    let _ = writeln!(text, "channels = {{ {} }}", channels(&recording.assigned, false));
    let references = channels(&recording.assigned, true);
    if !references.is_empty() {
        let _ = writeln!(
            text,
            "# Read by the evaluation alone.\nreference = {{ channels = {{ {references} }} }}"
        );
    }
    text
}

/// How a file is written, as an inline table, where somebody stated something of it; `recognised` begins with its format.
fn format_table(hints: &Hints, recognised: &str) -> Option<String> {
    if *hints == Hints::default() {
        return None;
    }
    let word = recognised.split([' ', ':']).next().unwrap_or_default().to_lowercase();
    let kind = hints.format.map_or(word, |format| format.name().to_owned());
    let mut keys = vec![format!("kind = {}", quoted(&kind))];
    keys.extend(hints.group.as_ref().map(|group| format!("group = {}", quoted(group))));
    keys.extend(hints.columns.as_ref().map(|names| {
        let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
        format!("columns = [{}]", names.join(", "))
    }));
    let csv = &hints.csv;
    for (key, mark) in [("separator", csv.separator), ("decimal", csv.decimal)] {
        keys.extend(mark.map(|mark| format!("{key} = {}", quoted(&mark.to_string()))));
    }
    for (key, line) in [
        ("header_line", csv.header_line),
        ("units_line", csv.units_line),
        ("first_row_line", csv.first_row_line),
    ] {
        keys.extend(line.map(|line| format!("{key} = {line}")));
    }
    Some(format!("{{ {} }}", keys.join(", ")))
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
fn settling(estimate: &str, first: &SortedRecording) -> String {
    let duration = first.examined.inspection.longest_segment().and_then(|segment| segment.duration_s);
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

//! Which device was recorded, where no option says it.

use super::{ask, wrong};
use crate::args::NewArguments;
use crate::tell::{line, tell};
use crate::{CommandEnding, print_json};
use kalmems::draft::{DeviceFit, ExaminedRecording, RecordingDescription, fitting};
use kalmems::rigs::Workbench;
use serde_json::json;
use std::fmt::Display;
use std::path::Path;

/// Describes the recordings and the devices that have such channels, and asks for the device where somebody is there to answer. `None` where
/// it is not known; what to add was printed then.
pub fn find(
    workbench: &Workbench,
    arguments: &NewArguments,
    examined: &[ExaminedRecording],
) -> Result<Option<String>, CommandEnding> {
    let Some(first) = examined.first() else { return Ok(None) };
    let described: Vec<RecordingDescription> = examined.iter().map(|one| one.describe(workbench)).collect();
    let fits = fitting(workbench, first).map_err(wrong)?;
    if arguments.json {
        print_json(&json!({ "recordings": described, "devices": fits, "questions": [question(&fits)] }))?;
    } else {
        describe(&described);
    }
    if ask::is_answered() && !arguments.json {
        return ask::device(&fits);
    }
    if !arguments.json {
        advise(arguments, &fits);
    }
    let names: Vec<&str> = fits.iter().filter(|fit| fit.is_possible()).map(|fit| fit.name).collect();
    let such_as = match names.as_slice() {
        [] => "; no known device has such channels, and `kalmems new --list` describes them".to_owned(),
        [first, ..] => format!(
            ", such as `--device {first}`; the columns of the recording may be the channels of {}",
            list(&names)
        ),
    };
    line(format_args!("error: the device is not known: add `--device NAME`{such_as}"));
    Ok(None)
}

/// As the questions for columns are, for a program that asks in its own way and comes again with `--device`.
fn question(fits: &[DeviceFit]) -> serde_json::Value {
    let names: Vec<&str> = fits.iter().filter(|fit| fit.is_possible()).map(|fit| fit.name).collect();
    json!({ "meaning": "device", "what": "the device that was recorded", "candidates": names })
}

/// What the recordings seem to hold.
fn describe(described: &[RecordingDescription]) {
    for recording in described {
        tell!("{}", recording.file.display());
        for sentence in &recording.recognised {
            tell!("  {sentence}");
        }
    }
}

/// Which devices have such channels, and what to write for each.
fn advise(arguments: &NewArguments, fits: &[DeviceFit]) {
    let (possible, others): (Vec<_>, Vec<_>) = fits.iter().partition(|fit| fit.is_possible());
    if !possible.is_empty() {
        tell!(
            "\nDevices whose channels the recording may have, each with the command that writes its experiment file:"
        );
    }
    for fit in possible {
        tell!("\n  {}: {}", fit.name, fit.description);
        for one in &fit.assigned {
            tell!("    `{}` is the column `{}`, {}", one.meaning, one.column, one.why);
        }
        for one in &fit.questions {
            tell!("    `{}`, {}, may be {}", one.meaning, one.what, list(&one.candidates));
        }
        if !fit.left_over.is_empty() {
            tell!("    not used: {}", list(&fit.left_over));
        }
        tell!("    {}", command(arguments, fit));
    }
    if !others.is_empty() {
        tell!("\nDevices for which a channel is missing:");
    }
    for fit in others {
        tell!("  {}: {}", fit.name, fit.missing.join(", "));
    }
    tell!("\nWhat each device is: kalmems new --list");
}

fn list(names: &[impl Display]) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}

/// The command that writes the experiment file for a device. Where several columns may be a channel they are taken in the order of the file.
fn command(arguments: &NewArguments, fit: &DeviceFit) -> String {
    let mut words = vec!["kalmems".to_owned(), "new".to_owned()];
    words.extend(arguments.recordings.iter().map(|path| shell_word(&path.display().to_string())));
    words.extend(["--device".to_owned(), fit.name.to_owned()]);
    let mut pair = |option: &str, a: &str, b: &str| {
        words.extend([option.to_owned(), shell_word(&format!("{a}={b}"))]);
    };
    for (channel, column) in &arguments.channels {
        pair("--channel", channel, column);
    }
    let mut taken: Vec<&String> = arguments.channels.iter().map(|(_, column)| column).collect();
    for question in &fit.questions {
        if arguments.channels.iter().any(|(channel, _)| channel == question.meaning) {
            continue;
        }
        if let Some(column) = question.candidates.iter().find(|column| !taken.contains(column)) {
            taken.push(column);
            pair("--channel", question.meaning, column);
        }
    }
    for (role, file) in &arguments.further {
        pair("--further", role, file);
    }
    if let Some((column, unit)) = &arguments.time {
        pair("--time", column, unit);
    }
    if let Some(rate) = &arguments.rate {
        words.extend(["--rate".to_owned(), shell_word(rate)]);
    }
    let target = arguments.write.clone().unwrap_or_else(|| {
        let first = arguments.recordings.first().map_or(Path::new("experiment"), |path| path);
        Path::new(first.file_stem().unwrap_or_default()).with_extension("toml")
    });
    words.extend(["--write".to_owned(), shell_word(&target.display().to_string())]);
    words.join(" ")
}

/// A word as a shell takes it.
fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-./=:,+%@".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

//! `kalmems new`.

mod ask;
mod device;
mod recordings;

use crate::args::NewArguments;
use crate::target::write_file;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json};
use kalmems::draft::{self, Draft, DraftError, DraftRequest, listed, of_device};
use kalmems::rigs::Workbench;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

pub fn run(workbench: &Workbench, arguments: &NewArguments) -> Result<(), CommandEnding> {
    if arguments.recordings.is_empty() {
        let Some(device) = &arguments.device else { return list(workbench, arguments.json) };
        let text =
            draft::with_numbers(workbench, &of_device(workbench, device).map_err(wrong)?, &arguments.values);
        let draft = Draft { text: text.map_err(wrong)?, recognised: Vec::new(), assigned: Vec::new() };
        return put(arguments, &draft, "simulate");
    }
    let mut rate = arguments.rate.clone();
    let examined = recordings::examine(arguments, &mut rate)?;
    let device = match &arguments.device {
        Some(device) => device.clone(),
        None => match device::find(workbench, arguments, &examined)? {
            Some(device) => device,
            None => return Err(CommandEnding::Told(2)),
        },
    };
    let here = Path::new("").to_owned();
    let folder = arguments.write.as_ref().and_then(|path| path.parent()).map_or(here, Path::to_owned);
    let folder = if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder };
    let wanted = DraftRequest {
        device: &device,
        recordings: &examined,
        channels: &arguments.channels,
        numbers: &arguments.values,
        rate: rate.as_deref(),
        folder: &folder,
    };
    let mut sorted = draft::sort(workbench, &wanted).map_err(wrong)?;
    let mut answers = arguments.channels.clone();
    while let Some(answer) = ask::column(&sorted.questions)? {
        answers.push(answer);
        sorted =
            draft::sort(workbench, &DraftRequest { channels: &answers, ..wanted.clone() }).map_err(wrong)?;
    }
    if arguments.json && !sorted.questions.is_empty() {
        // For a program that asks in its own way and comes again with `--channel`.
        print_json(&json!({ "questions": sorted.questions, "channels": sorted.assigned() }))?;
    }
    let wanted = DraftRequest { channels: &answers, ..wanted };
    let mut draft = draft::write(workbench, sorted.clone(), &wanted).map_err(wrong)?;
    for sentence in &draft.recognised {
        tell!("{sentence}");
    }
    let mut numbers = arguments.values.clone();
    ask::numbers(workbench, &device, &mut numbers, |numbers| {
        draft = draft::write(workbench, sorted.clone(), &DraftRequest { numbers, ..wanted.clone() })?;
        Ok(())
    })?;
    put(arguments, &draft, "estimate")
}

#[allow(clippy::needless_pass_by_value)] // It stands in `map_err`.
fn wrong(e: DraftError) -> CommandEnding {
    CommandEnding::Wrong(e.to_string())
}

/// All devices, with a sketch of the signal of each.
fn list(workbench: &Workbench, json: bool) -> Result<(), CommandEnding> {
    let devices = listed(workbench).map_err(wrong)?;
    if json {
        return print_json(&devices);
    }
    let mut text = String::new();
    for device in devices {
        let _ = writeln!(text, "{}: {}", device.name, device.description);
        for line in &device.sketch {
            let _ = writeln!(text, "    {line}");
        }
    }
    print(&text)
}

/// Writes the file, or prints it, and says what to do with it.
fn put(arguments: &NewArguments, draft: &Draft, next: &str) -> Result<(), CommandEnding> {
    if let Some(path) = &arguments.write {
        write_file(path, &draft.text, arguments.force)?;
    }
    let command = arguments.write.as_ref().map(|path| format!("kalmems {next} {}", path.display()));
    if arguments.json {
        return print_json(&json!({
            "file": arguments.write,
            "experiment": draft.text,
            "recognised": draft.recognised,
            "channels": draft.assigned,
            "next": command,
        }));
    }
    match (&arguments.write, command) {
        (Some(path), Some(command)) => {
            tell!("the experiment: {}; {next} it with: {command}", path.display());
            if next == "estimate" && draft.text.contains("\n[identify]\n") {
                tell!(
                    "numbers that are not known well are identified with: kalmems identify {}",
                    path.display()
                );
            }
        }
        _ => print(&draft.text)?,
    }
    Ok(())
}

//! `kalmems new`.

use crate::args::NewArguments;
use crate::progress::ProgressDisplay;
use crate::target::write_file;
use crate::tell::{line, tell};
use crate::{CommandEnding, print, print_json};
use kalmems::config::RecordingRole;
use kalmems::draft::{self, Draft, DraftError, DraftRequest, Question, SortedRecording, listed, of_device};
use kalmems::progress::ReaderProgress;
use kalmems::recording::ReadError;
use kalmems::rigs::Workbench;
use serde_json::json;
use std::fmt::Write as _;
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

pub fn run(workbench: &Workbench, arguments: &NewArguments) -> Result<(), CommandEnding> {
    let Some(device) = &arguments.device else { return list(workbench, arguments.json) };
    let Some(recording) = &arguments.recording else {
        let text = of_device(workbench, device).map_err(|e| wrong(&e))?;
        return put(arguments, &Draft { text, recognised: Vec::new(), assigned: Vec::new() }, "simulate");
    };
    let further = further(&arguments.further)?;
    let here = Path::new("").to_owned();
    let folder = arguments.write.as_ref().and_then(|path| path.parent()).map_or(here, Path::to_owned);
    let folder = if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder };
    let wanted = DraftRequest {
        device,
        recording,
        further: &further,
        channels: &arguments.channels,
        rate: arguments.rate.as_deref(),
        folder: &folder,
    };
    let mut sorted = sort(workbench, &wanted)?;
    let mut answers = arguments.channels.clone();
    while let Some(answer) = ask(&sorted.questions)? {
        answers.push(answer);
        sorted = sort(workbench, &DraftRequest { channels: &answers, ..wanted.clone() })?;
    }
    if arguments.json && !sorted.questions.is_empty() {
        // For a program that asks in its own way and comes again with `--channel`.
        print_json(&json!({ "questions": sorted.questions, "channels": sorted.assigned }))?;
    }
    let draft = draft::write(sorted, &wanted).map_err(|e| wrong(&e))?;
    for sentence in &draft.recognised {
        tell!("{sentence}");
    }
    for one in &draft.assigned {
        tell!("`{}` is the column `{}`, {}", one.meaning, one.column, one.why);
    }
    put(arguments, &draft, "estimate")
}

fn wrong(e: &dyn std::fmt::Display) -> CommandEnding {
    CommandEnding::Wrong(e.to_string())
}

/// All devices, with a sketch of the signal of each.
fn list(workbench: &Workbench, json: bool) -> Result<(), CommandEnding> {
    let devices = listed(workbench).map_err(|e| wrong(&e))?;
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

fn further(stated: &[(String, String)]) -> Result<Vec<(RecordingRole, PathBuf)>, CommandEnding> {
    let one = |(role, file): &(String, String)| {
        let role = RecordingRole::ALL.into_iter().find(|known| known.key() == role).ok_or_else(|| {
            let known: Vec<String> =
                RecordingRole::ALL.iter().map(|role| format!("`{}`", role.key())).collect();
            CommandEnding::Wrong(format!(
                "`--further`: found the role `{role}`; expected one of {}",
                known.join(", ")
            ))
        })?;
        Ok((role, PathBuf::from(file)))
    };
    stated.iter().map(one).collect()
}

fn sort(workbench: &Workbench, wanted: &DraftRequest) -> Result<SortedRecording, CommandEnding> {
    let bar = ProgressDisplay::default();
    let mut reading = ReaderProgress::new(&bar, "reading");
    draft::sort(workbench, wanted, &mut |done, total| reading.hear(done, total)).map_err(|e| match e {
        DraftError::Read(ReadError::Interrupted { .. }) => CommandEnding::Interrupted,
        e => wrong(&e),
    })
}

/// Asks the first question, where somebody is there to answer it; a channel and its column.
fn ask(questions: &[Question]) -> Result<Option<(String, String)>, CommandEnding> {
    let Some(question) = questions.first().filter(|question| !question.candidates.is_empty()) else {
        return Ok(None);
    };
    let (input, output) = (std::io::stdin(), std::io::stderr());
    if !(input.is_terminal() && output.is_terminal()) {
        return Ok(None);
    }
    line(format_args!("Which column is `{}`, {}?", question.meaning, question.what));
    for (index, column) in question.candidates.iter().enumerate() {
        line(format_args!("  {}: {column}", index + 1));
    }
    let failed = |e: std::io::Error| CommandEnding::Wrong(format!("no answer: {e}"));
    loop {
        let mut to = output.lock();
        write!(to, "its number or name: ").and_then(|()| to.flush()).map_err(failed)?;
        let mut answer = String::new();
        if input.lock().read_line(&mut answer).map_err(failed)? == 0 {
            return Ok(None);
        }
        let answer = answer.trim();
        let by_number = answer.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let by_number = by_number.and_then(|index| question.candidates.get(index));
        if let Some(column) =
            by_number.or_else(|| question.candidates.iter().find(|column| *column == answer))
        {
            return Ok(Some((question.meaning.to_owned(), column.clone())));
        }
    }
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

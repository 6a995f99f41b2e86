//! `kalmems batch`.

use crate::args::BatchArguments;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json, target};
use kalmems::batch::{Batch, BatchError, BatchOptions, BatchRecording};
use kalmems::rigs::Workbench;
use std::path::PathBuf;

/// Some recordings could not be estimated, and the results have all others.
const SOME_FAILED: u8 = 5;

pub fn run(workbench: &Workbench, arguments: &BatchArguments) -> Result<(), CommandEnding> {
    let batch = Batch::load(workbench, &arguments.experiment, arguments.of.as_deref()).map_err(ending)?;
    let batch = match &arguments.reference {
        Some(files) => batch.with_references(files),
        None => batch,
    };
    if batch.leaves_reference_out() {
        tell!(
            "note: the reference of the experiment is in a file of its own and is left out; name one for each recording with --reference"
        );
    }
    let recordings =
        BatchRecording::of_files(arguments.recordings.iter().map(String::as_str)).map_err(ending)?;
    let usual = || PathBuf::from("out").join("batches").join(batch.name());
    let out = arguments.out.clone().unwrap_or_else(usual);
    let options = BatchOptions { threads: arguments.threads, force: arguments.force };
    let bar = ProgressDisplay::default();
    let outcome = batch.run(&recordings, &out, options, &bar).map_err(ending)?;
    drop(bar);
    target::tell_of(&outcome.committed);
    let journal = outcome.journal.display();
    if outcome.torn {
        tell!("note: the last line of {journal} was half written; its recording was estimated again");
    }
    if outcome.before > 0 {
        tell!("note: {} recordings were finished by {journal} already", outcome.before);
    }
    let summary = &outcome.summary;
    if arguments.json {
        print_json(summary)?;
    } else {
        let mut text = format!("{summary}\n");
        for notice in summary.notices() {
            text += &format!("\n{notice}\n");
        }
        print(&text)?;
    }
    tell!("results in {}; open {}", out.display(), out.join("report.html").display());
    if summary.estimated() == 0 {
        return Err(CommandEnding::Wrong("no recording could be estimated".to_owned()));
    }
    if arguments.strict && !summary.doubtful.is_empty() {
        let doubtful = summary.doubtful.join(", ");
        return Err(CommandEnding::NotConsistent(format!(
            "the verdict is `doubtful` or worse for: {doubtful}"
        )));
    }
    if summary.failures.is_empty() { Ok(()) } else { Err(CommandEnding::Told(SOME_FAILED)) }
}

#[allow(clippy::needless_pass_by_value)] // as `map_err` has it
fn ending(error: BatchError) -> CommandEnding {
    match error {
        BatchError::Interrupted { .. } => CommandEnding::Paused(error.to_string()),
        error => CommandEnding::Wrong(error.to_string()),
    }
}

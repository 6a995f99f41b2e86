//! `kalmems compare`.

use crate::args::CompareArguments;
use crate::target::write_page;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json};
use kalmems::results::compare;
use serde_json::json;

pub fn run(arguments: &CompareArguments) -> Result<(), CommandEnding> {
    let found = compare(&arguments.runs).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    if let Some(folder) = arguments.report.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| CommandEnding::Wrong(format!("cannot make the folder {}: {e}", folder.display())))?;
    }
    write_page(&arguments.report, &found.html, arguments.force)?;
    if arguments.json {
        print_json(&json!({ "answer": found.answer, "report": arguments.report, "runs": arguments.runs }))?;
    } else {
        print(&(found.answer.join("\n") + "\n"))?;
    }
    tell!("{} runs compared in {}", arguments.runs.len(), arguments.report.display());
    Ok(())
}

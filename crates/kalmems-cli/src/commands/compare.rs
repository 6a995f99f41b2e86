//! `kalmems compare`.

use crate::args::CompareArguments;
use crate::target::write_page;
use crate::tell::tell;
use crate::{CommandEnding, print_json};
use kalmems::results::compare_page;
use serde_json::json;

pub fn run(arguments: &CompareArguments) -> Result<(), CommandEnding> {
    let html = compare_page(&arguments.runs).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    if let Some(folder) = arguments.report.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| CommandEnding::Wrong(format!("cannot make the folder {}: {e}", folder.display())))?;
    }
    write_page(&arguments.report, &html, arguments.force)?;
    if arguments.json {
        print_json(&json!({ "report": arguments.report, "runs": arguments.runs }))?;
    }
    tell!("{} runs compared in {}", arguments.runs.len(), arguments.report.display());
    Ok(())
}

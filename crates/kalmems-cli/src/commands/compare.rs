//! `kalmems compare`.

use crate::Ending;
use crate::args::CompareArguments;
use crate::target::write_page;
use crate::tell::tell;
use kalmems::results::compare_page;

pub fn run(arguments: &CompareArguments) -> Result<(), Ending> {
    let html = compare_page(&arguments.runs).map_err(|e| Ending::Wrong(e.to_string()))?;
    if let Some(folder) = arguments.report.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| Ending::Wrong(format!("cannot make the folder {}: {e}", folder.display())))?;
    }
    write_page(&arguments.report, &html, arguments.force)?;
    tell!("{} runs compared in {}", arguments.runs.len(), arguments.report.display());
    Ok(())
}

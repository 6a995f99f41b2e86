//! `kalmems expand`.

use crate::args::ExpandArguments;
use crate::target::BesideExperiment;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json};
use kalmems::expand::expand;
use kalmems::rigs::Workbench;
use serde_json::json;

pub fn run(workbench: &Workbench, arguments: &ExpandArguments) -> Result<(), CommandEnding> {
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let beside = BesideExperiment::of(arguments.write.as_deref(), &arguments.experiment, arguments.force)?;
    let experiment = workbench.load(&arguments.experiment).map_err(|e| wrong(&e))?;
    let expanded = expand(workbench, &experiment).map_err(|e| wrong(&e))?;
    if let Some(beside) = &beside {
        beside.write(&expanded.text)?;
    }
    if arguments.json {
        let file = beside.map(|beside| beside.path().to_owned());
        return print_json(&json!({ "file": file, "experiment": expanded.text, "notes": expanded.notes }));
    }
    let Some(beside) = beside else { return print(&expanded.text) };
    tell!("the experiment with its device as equations: {}", beside.path().display());
    for note in &expanded.notes {
        tell!("{note}");
    }
    Ok(())
}

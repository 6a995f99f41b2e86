//! `kalmems diagnose`.

use crate::args::DiagnoseArguments;
use crate::experiment::load;
use crate::progress::ProgressDisplay;
use crate::target::{BesideExperiment, write_page};
use crate::tell::tell;
use crate::{CommandEnding, print_result};
use kalmems::diagnose::{DiagnosisEffort, DiagnosisFinding, diagnose_with, pasted};
use kalmems::results::diagnosis_page;
use kalmems::rigs::Workbench;
use std::path::Path;

pub fn run(workbench: &Workbench, arguments: &DiagnoseArguments) -> Result<(), CommandEnding> {
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let (experiment, noise) = load(workbench, &arguments.experiment)?;
    for noise in noise {
        tell!("{noise}");
    }
    let beside = BesideExperiment::of(arguments.write.as_deref(), &arguments.experiment, arguments.force)?;
    let bar = ProgressDisplay::default();
    let effort = if arguments.thorough { DiagnosisEffort::Thorough } else { DiagnosisEffort::Usual };
    let found = diagnose_with(workbench, &experiment, (arguments.filter.as_deref(), effort), &bar)
        .map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })?;
    drop(bar);
    print_result(arguments.json, &found, || found.to_text())?;
    if found.finding == DiagnosisFinding::Interrupted {
        return Err(CommandEnding::Interrupted);
    }
    if let Some(path) = &arguments.report {
        write_page(path, &diagnosis_page(&found).map_err(|e| wrong(&e))?, arguments.force)?;
        tell!("the report: {}", path.display());
    }
    let Some(beside) = beside else { return Ok(()) };
    let named = arguments.cause.as_deref();
    let cause = found.chosen(named);
    if cause.is_none() && (named.is_some() || found.is_ambiguous()) {
        let names = found.causes.iter().enumerate();
        let names: Vec<String> =
            names.map(|(place, cause)| format!("{}: {}", place + 1, cause.name)).collect();
        let why = named.map_or_else(
            || format!("{} Another one than the true one makes the estimate worse", found.ambiguity()),
            |named| format!("no cause is called `{named}`"),
        );
        return Err(CommandEnding::Wrong(format!(
            "nothing is written: {why}; name the one to write by its place or its name, such as `--cause 1` ({})",
            names.join("; ")
        )));
    }
    let text = cause.filter(|cause| !cause.edits.is_empty());
    let Some(text) = text.and_then(|cause| pasted(&experiment, cause)) else {
        tell!("nothing is written: no cause was found that an experiment file can state");
        return Ok(());
    };
    beside.write(&text)?;
    let (path, name) = (beside.path(), beside.path().file_stem().unwrap_or_default());
    tell!("the experiment with the cause corrected: {}", path.display());
    tell!(
        "estimate it with: kalmems estimate {} --out {}",
        path.display(),
        Path::new("out").join(name).display()
    );
    Ok(())
}

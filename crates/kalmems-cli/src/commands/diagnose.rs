//! `kalmems diagnose`.

use crate::args::DiagnoseArguments;
use crate::experiment::load;
use crate::progress::ProgressDisplay;
use crate::target::{BesideExperiment, write_page};
use crate::tell::tell;
use crate::{CommandEnding, print_result};
use kalmems::diagnose::{diagnose, pasted};
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
    let found = diagnose(workbench, &experiment, arguments.filter.as_deref(), &bar)
        .map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })?;
    drop(bar);
    print_result(arguments.json, &found, || found.to_text())?;
    if let Some(path) = &arguments.report {
        write_page(path, &diagnosis_page(&found).map_err(|e| wrong(&e))?, arguments.force)?;
        tell!("the report: {}", path.display());
    }
    let Some(beside) = beside else { return Ok(()) };
    let cause = match (arguments.cause, found.causes.as_slice()) {
        (Some(place), causes) => {
            let chosen = place.get().checked_sub(1).and_then(|place| causes.get(place));
            Some(chosen.ok_or_else(|| {
                CommandEnding::Wrong(format!("`--cause {place}`: {} causes were found", causes.len()))
            })?)
        }
        (None, causes) if !found.is_ambiguous() => causes.iter().find(|cause| cause.withheld.is_none()),
        (None, causes) => {
            let names =
                causes.iter().enumerate().map(|(place, cause)| format!("{}: {}", place + 1, cause.name));
            return Err(CommandEnding::Wrong(format!(
                "nothing is written: the recording does not tell these {} causes apart, which give different answers, and another one than the true one makes the estimate \
                 worse; name the one to write by its place, such as `--cause 1` ({})",
                causes.len(),
                names.collect::<Vec<_>>().join("; ")
            )));
        }
    };
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

//! `kalmems identify`.

use crate::args::IdentifyArguments;
use crate::experiment::load;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print_result, target, terminal};
use kalmems::config::Experiment;
use kalmems::diagnose::{identify, with_found_numbers, with_noise, with_noises};
use kalmems::results::{IdentificationSummary, ResultWriteError, RunInfo, Work, write_identification};
use kalmems::rigs::Workbench;
use std::time::{Instant, SystemTime};

pub fn run(workbench: &Workbench, arguments: &IdentifyArguments) -> Result<(), CommandEnding> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let (experiment, noise) = load(workbench, &arguments.experiment)?;
    let work = Work::of_file("identify", &arguments.experiment, experiment.files());
    let output = arguments.folder.begin(&["identified", &experiment.name.to_string()], work)?;
    let bar = ProgressDisplay::default();
    let identified = |experiment: &Experiment| {
        identify(workbench, experiment, &bar)
            .map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })
    };
    let mut found = identified(&experiment)?;
    let by_likelihood = experiment.identify.as_ref().is_some_and(|identify| !identify.parameters.is_empty());
    let mut noise = noise;
    if by_likelihood && !noise.is_empty() {
        let again =
            with_found_numbers(workbench, &experiment, &found.experiment, &noise).map_err(|e| wrong(&e))?;
        let again = with_noise(workbench, &again, &bar);
        let (_, better) =
            again.map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })?;
        // What is found is held against the numbers of the file, with the noise that the numbers that were found leave.
        let told = with_noises(workbench, &experiment, &better).map_err(|e| wrong(&e))?;
        found = identified(&told)?;
        noise = better;
    }
    drop(bar);
    for noise in noise {
        tell!("{noise}");
    }
    let info = RunInfo { started, took: clock.elapsed() };
    let stop = &crate::interrupt::requested;
    write_identification(&found, &output, info, stop).map_err(|e| match e {
        ResultWriteError::Interrupted => CommandEnding::Interrupted,
        e => wrong(&e),
    })?;
    let out = target::finish(output)?;

    let summary = IdentificationSummary::of(&found);
    print_result(arguments.json, &summary, || summary.to_text_within(terminal::columns()))?;
    let (folder, file) = (out.display(), out.join("experiment.toml"));
    tell!("results in {folder}; open {}", out.join("report.html").display());
    tell!("estimate with these values by: kalmems estimate {} --out {folder}_estimate", file.display());
    Ok(())
}

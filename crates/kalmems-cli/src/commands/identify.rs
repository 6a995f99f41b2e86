//! `kalmems identify`.

use crate::args::IdentifyArguments;
use crate::experiment::load;
use crate::progress::Bar;
use crate::tell::tell;
use crate::{Ending, print, print_json, target};
use kalmems::diagnose::identify;
use kalmems::results::{IdentificationSummary, RunInfo, Work, WriteError, write_identification};
use kalmems::rigs::Workbench;
use std::time::{Instant, SystemTime};

pub fn run(workbench: &Workbench, arguments: &IdentifyArguments) -> Result<(), Ending> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| Ending::Wrong(e.to_string());
    let (experiment, noise) = load(workbench, &arguments.experiment)?;
    for noise in noise {
        tell!("{noise}");
    }
    let work = Work::of_file("identify", &arguments.experiment, experiment.files()).forced(arguments.force);
    let output = target::begin(arguments.out.as_ref(), &["identified", &experiment.name.to_string()], &work)?;
    let bar = Bar::default();
    let found = identify(workbench, &experiment, &bar)
        .map_err(|e| if e.is_interruption() { Ending::Interrupted } else { wrong(&e) })?;
    drop(bar);
    let info = RunInfo { started, took: clock.elapsed() };
    let stop = &crate::interrupt::requested;
    write_identification(&found, &output, info, stop).map_err(|e| match e {
        WriteError::Interrupted => Ending::Interrupted,
        e => wrong(&e),
    })?;
    let out = target::finish(output)?;

    let summary = IdentificationSummary::of(&found);
    if arguments.json {
        print_json(&summary)?;
    } else {
        print(&summary.to_text())?;
    }
    tell!(
        "results in {}; the experiment with these values: {}",
        out.display(),
        out.join("experiment.toml").display()
    );
    Ok(())
}

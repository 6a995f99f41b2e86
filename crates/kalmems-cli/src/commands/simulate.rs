//! `kalmems simulate`.

use crate::args::SimulateArguments;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json, target};
use kalmems::config::RecordingRole;
use kalmems::figures::with_short_numbers;
use kalmems::inspect::quantity;
use kalmems::results::{RunInfo, SimulationWriteError, Work, write_simulation};
use kalmems::rigs::Workbench;
use kalmems::simulate::SimulateError;
use kalmems::units::ColumnHeader;
use std::time::{Instant, SystemTime};

pub fn run(workbench: &Workbench, arguments: &SimulateArguments) -> Result<(), CommandEnding> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let mut experiment = workbench.load(&arguments.experiment).map_err(|e| wrong(&e))?;
    if let (Some(simulate), Some(seed)) = (&mut experiment.simulate, arguments.seed) {
        simulate.seed = seed.into();
    }
    let rig = workbench.rig(&experiment).map_err(|e| wrong(&e))?;
    let simulation = rig.simulate(&experiment).map_err(|e| wrong(&e))?;
    let work = Work::of_file("simulate", &arguments.experiment, experiment.files());
    let output = arguments.folder.begin(&["simulated", &experiment.name.to_string()], work)?;
    let bar = ProgressDisplay::default();
    let info = || RunInfo { started, took: clock.elapsed() };
    let summary =
        write_simulation(&experiment, rig, &*simulation, &output, info, &bar).map_err(|e| match e {
            SimulationWriteError::Simulate(SimulateError::Interrupted) => CommandEnding::Interrupted,
            e => wrong(&e),
        })?;
    drop(bar);
    let out = target::finish(output)?;

    if arguments.json {
        print_json(&summary)?;
    } else {
        let outlook = summary.outlook.as_ref().map_or_else(String::new, |outlook| format!("{outlook}\n"));
        let column = simulation.truth().first().map_or("deflection", |channel| channel.column);
        let unit = ColumnHeader::parse(column).unit_text;
        let name = column.strip_suffix(&unit).map_or(column, |name| name.trim_end_matches('_'));
        let unit = unit.replace("_per_", "/").replace('_', " ");
        let largest = format!("largest {name} {}", quantity(summary.largest, &unit));
        let text = format!("{outlook}{} samples, {largest}, seed {}\n", summary.samples, summary.seed);
        print(&with_short_numbers(&text))?;
        let integration = summary.integration_sentence();
        for line in integration.iter().chain(&summary.told) {
            print(&with_short_numbers(&format!("{line}\n")))?;
        }
    }
    let (next, command, file) = match simulation.role() {
        RecordingRole::RingDown => ("identify from it", "identify", "experiment.toml"),
        _ if experiment.estimate.is_some() => ("estimate it", "estimate", "experiment.toml"),
        // Of an experiment without filters.
        _ => ("look at it", "inspect", "recording.csv"),
    };
    tell!("recording in {}; {next} with: kalmems {command} {}", out.display(), out.join(file).display());
    Ok(())
}

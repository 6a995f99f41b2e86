//! `kalmems simulate`.

use crate::args::SimulateArguments;
use crate::progress::Bar;
use crate::{Ending, print};
use kalmems::config::{Experiment, Role};
use kalmems::results::{RunInfo, SimulationWriteError, write_simulation};
use kalmems::rigs;
use kalmems::simulate::SimulateError;
use std::path::PathBuf;
use std::time::{Instant, SystemTime};

pub fn run(arguments: &SimulateArguments) -> Result<(), Ending> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| Ending::Wrong(e.to_string());
    let mut experiment = Experiment::load(&arguments.experiment).map_err(|e| wrong(&e))?;
    if let (Some(simulate), Some(seed)) = (&mut experiment.simulate, arguments.seed) {
        simulate.seed = seed.into();
    }
    let rig = rigs::of(&experiment).map_err(|e| wrong(&e))?;
    let simulation = rig.simulate(&experiment).map_err(|e| wrong(&e))?;
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => PathBuf::from("out").join("simulated").join(experiment.name.to_string()),
    };
    let bar = Bar::default();
    let info = || RunInfo { started, took: clock.elapsed() };
    let summary = write_simulation(&experiment, &*simulation, &out, arguments.force, info, &bar).map_err(
        |e| match e {
            SimulationWriteError::Simulate(SimulateError::Interrupted) => Ending::Interrupted,
            e => wrong(&e),
        },
    )?;
    drop(bar);

    if arguments.json {
        let json = serde_json::to_string_pretty(&summary).map_err(|e| wrong(&e))?;
        print(&(json + "\n"))?;
    } else {
        let outlook = summary.outlook.map_or_else(String::new, |outlook| format!("{outlook}\n"));
        let name = simulation.truth().first().map_or("deflection", |channel| channel.column);
        print(&format!(
            "{outlook}{} samples, largest {name} {:.4}, seed {}\n",
            summary.samples, summary.largest, summary.seed
        ))?;
        for line in &summary.told {
            print(&format!("{line}\n"))?;
        }
    }
    let experiment = out.join("experiment.toml");
    let (next, command) = match simulation.role() {
        Role::RingDown => ("identify from it", "identify"),
        _ => ("estimate it", "estimate"),
    };
    eprintln!("recording in {}; {next} with: kalmems {command} {}", out.display(), experiment.display());
    Ok(())
}

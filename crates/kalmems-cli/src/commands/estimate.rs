//! `kalmems estimate`.

use crate::args::EstimateArguments;
use crate::experiment::load;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json, target, terminal};
use kalmems::config::Experiment;
use kalmems::diagnose::FoundNoise;
use kalmems::results::{
    Estimated, LongEstimate, Metrics, Output, ResultWriteError, RunInfo, Work, WriteOptions, is_unexplained,
    notices_in_short, number_check, summary_text,
};
use kalmems::rigs::Workbench;
use kalmems::workflow::{self, PartsError, WorkflowError};
use std::time::{Instant, SystemTime};

pub fn run(workbench: &Workbench, arguments: &EstimateArguments) -> Result<(), CommandEnding> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let (experiment, noise) = load(workbench, &arguments.experiment)?;
    let work = Work::of_file("estimate", &arguments.experiment, experiment.files());
    let output = arguments.folder.begin(&[&experiment.name.to_string()], work)?;
    let metrics = if workflow::is_long(workbench, &experiment).map_err(|e| wrong(&e))? {
        in_parts((workbench, &experiment, noise), arguments, &output, (started, clock))?
    } else {
        at_once((workbench, &experiment, noise), arguments, &output, (started, clock))?
    };
    let out = target::finish(output)?;

    if arguments.json {
        print_json(&metrics)?;
    } else {
        let mut text = summary_text(&metrics, true, terminal::columns());
        for notice in notices_in_short(&metrics) {
            text += &format!("\n{notice}\n");
        }
        print(&text)?;
    }
    tell!("results in {}; open {}", out.display(), out.join("report.html").display());
    tell!("what the verdicts mean: kalmems help verdict");
    if is_unexplained(&metrics) {
        tell!("look for the cause with: kalmems diagnose {}", arguments.experiment.display());
    }

    if !metrics.estimators().any(|estimator| estimator.verdict.is_of_an_estimate()) {
        let why = "no filter gave an estimate of the motion: each stopped or lost the signal; the report and `metrics.json` state the times";
        return Err(CommandEnding::Wrong(why.to_owned()));
    }
    let failed: Vec<&str> = metrics.estimators().filter(|e| !e.passes()).map(|e| e.name.as_str()).collect();
    if arguments.strict && !failed.is_empty() {
        let failed = failed.join(", ");
        return Err(CommandEnding::NotConsistent(format!(
            "the verdict is `doubtful` or worse for: {failed}"
        )));
    }
    Ok(())
}

/// Of recordings that are held in memory.
fn at_once(
    (workbench, experiment, noise): (&Workbench, &Experiment, Vec<FoundNoise>),
    arguments: &EstimateArguments,
    output: &Output,
    (started, clock): (SystemTime, Instant),
) -> Result<Metrics, CommandEnding> {
    let bar = ProgressDisplay::default();
    let estimated = Estimated::of(workbench, experiment, noise, &bar).map_err(|e| of_work(&e))?;
    drop(bar);
    let info = RunInfo { started, took: clock.elapsed() };
    let wanted = WriteOptions { trajectories: !arguments.no_trajectories };
    estimated.write(output, wanted, info, &crate::interrupt::requested).map_err(of_writing)?;
    Ok(estimated.metrics)
}

/// Of recordings of any length.
fn in_parts(
    (workbench, experiment, noise): (&Workbench, &Experiment, Vec<FoundNoise>),
    arguments: &EstimateArguments,
    output: &Output,
    (started, clock): (SystemTime, Instant),
) -> Result<Metrics, CommandEnding> {
    let wanted = WriteOptions { trajectories: !arguments.no_trajectories };
    let rig = workbench.rig(experiment).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    let mut results = LongEstimate::begin(rig, experiment, output, wanted, &crate::interrupt::requested);
    let bar = ProgressDisplay::default();
    let whole = workflow::estimate_in_parts(workbench, experiment, &bar, &mut |part| results.part(&part));
    let whole = whole.map_err(|e| match e {
        PartsError::Work(error) => of_work(&error),
        PartsError::Taken(error) => of_writing(error),
    })?;
    let numbers =
        number_check(workbench, experiment, &results.without_findings(), &bar).map_err(|e| of_work(&e))?;
    drop(bar);
    results.finish(&whole, (numbers, noise), RunInfo { started, took: clock.elapsed() }).map_err(of_writing)
}

fn of_work(error: &WorkflowError) -> CommandEnding {
    if error.is_interruption() { CommandEnding::Interrupted } else { CommandEnding::Wrong(error.to_string()) }
}

fn of_writing(error: ResultWriteError) -> CommandEnding {
    match error {
        ResultWriteError::Interrupted => CommandEnding::Interrupted,
        error => CommandEnding::Wrong(error.to_string()),
    }
}

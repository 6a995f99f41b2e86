//! `kalmems estimate`.

use crate::args::EstimateArguments;
use crate::progress::Bar;
use crate::{Ending, print};
use kalmems::config::Experiment;
use kalmems::results::{Metrics, RunInfo, WriteError, notices, summary_table, write_estimate};
use kalmems::workflow;
use std::path::PathBuf;
use std::time::{Instant, SystemTime};

pub fn run(arguments: &EstimateArguments) -> Result<(), Ending> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| Ending::Wrong(e.to_string());
    let experiment = Experiment::load(&arguments.experiment).map_err(|e| wrong(&e))?;
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => PathBuf::from("out").join(experiment.name.to_string()),
    };
    let bar = Bar::default();
    let outcome = workflow::estimate(&experiment, &bar)
        .map_err(|e| if e.is_interruption() { Ending::Interrupted } else { wrong(&e) })?;
    drop(bar);
    let metrics = Metrics::of(&outcome);
    let info = RunInfo { started, took: clock.elapsed() };
    let stop = &crate::interrupt::requested;
    write_estimate(&outcome, &metrics, &out, arguments.force, info, stop).map_err(|e| match e {
        WriteError::Interrupted => Ending::Interrupted,
        e => wrong(&e),
    })?;

    if arguments.json {
        let json = serde_json::to_string_pretty(&metrics).map_err(|e| wrong(&e))?;
        print(&(json + "\n"))?;
    } else {
        let mut text = summary_table(&metrics, true).to_text();
        for notice in notices(&metrics) {
            text += &format!("\n{notice}\n");
        }
        print(&text)?;
    }
    eprintln!("results in {}; open {}", out.display(), out.join("report.html").display());

    let failed: Vec<&str> =
        metrics.estimators().filter(|e| !e.verdict.passes()).map(|e| e.name.as_str()).collect();
    if arguments.strict && !failed.is_empty() {
        let failed = failed.join(", ");
        return Err(Ending::NotConsistent(format!("failed the consistency test: {failed}")));
    }
    Ok(())
}

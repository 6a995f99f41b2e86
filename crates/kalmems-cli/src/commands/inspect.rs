//! `kalmems inspect`.

use super::stated::{rate_hz, stated_time, unread};
use crate::args::InspectArguments;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print_result, target};
use kalmems::diagnose::step_cost;
use kalmems::inspect::{StatedFile, inspect_stated};
use kalmems::progress::ReaderProgress;
use kalmems::recording::ReadError;
use kalmems::results::{AnsweredOutlook, RunInfo, Work, draw_outlook, write_outlook};
use kalmems::rigs::{Workbench, sampling};
use std::fmt::Display;
use std::time::{Instant, SystemTime};

pub fn run(workbench: &Workbench, arguments: &InspectArguments) -> Result<(), CommandEnding> {
    if arguments.input.extension().is_some_and(|ending| ending == "toml") {
        device(workbench, arguments)
    } else {
        recording(arguments)
    }
}

fn wrong(e: &dyn Display) -> CommandEnding {
    CommandEnding::Wrong(e.to_string())
}

/// What an experiment's device will do under its drive.
fn device(workbench: &Workbench, arguments: &InspectArguments) -> Result<(), CommandEnding> {
    if arguments.report.is_some() {
        let why = "`--report` is for a recording; of an experiment file the report is in the folder that `--out` names";
        return Err(CommandEnding::Wrong(why.to_owned()));
    }
    let (started, clock) = (SystemTime::now(), Instant::now());
    let experiment = workbench.load(&arguments.input).map_err(|e| wrong(&e))?;
    let rig = workbench.rig(&experiment).map_err(|e| wrong(&e))?;
    let mut outlook = rig.outlook(&experiment).map_err(|e| wrong(&e))?;
    outlook.topics.extend(sampling(rig, &experiment));
    let bar = ProgressDisplay::default();
    outlook.topics.extend(step_cost(workbench, &experiment, &bar));
    drop(bar);
    if let Some(path) = &arguments.svg {
        draw_outlook(&outlook, path, arguments.force).map_err(|e| wrong(&e))?;
    }
    if let Some(out) = &arguments.out {
        let info = RunInfo { started, took: clock.elapsed() };
        let work = Work::of_file("inspect", &arguments.input, experiment.files()).forced(arguments.force);
        let output = target::begin(Some(out), &[], &work)?;
        write_outlook(&outlook, &experiment, &output, info).map_err(|e| wrong(&e))?;
        target::finish(output)?;
        tell!("text, data and pictures in {}", out.display());
    }
    let answered = AnsweredOutlook::of(&outlook);
    print_result(arguments.json, &answered, || answered.to_text())
}

/// What a recording holds.
fn recording(arguments: &InspectArguments) -> Result<(), CommandEnding> {
    if arguments.out.is_some() {
        let why = "`--out` is for an experiment file; of a recording one picture is drawn, with `--svg`, and a page written, with `--report`";
        return Err(CommandEnding::Wrong(why.to_owned()));
    }
    let stated = StatedFile {
        hints: arguments.file.hints(),
        time: stated_time(arguments.time.as_ref())?,
        rate_hz: rate_hz(arguments.rate.as_deref())?,
    };
    let bar = ProgressDisplay::default();
    let mut reading = ReaderProgress::new(&bar, "reading");
    let inspection = inspect_stated(&arguments.input, &stated, &mut |done, total| reading.hear(done, total))
        .map_err(|e| match e {
            ReadError::Interrupted { .. } => CommandEnding::Interrupted,
            e => unread(&e),
        })?;
    drop(bar);
    if let Some(path) = &arguments.svg {
        kalmems::results::draw_inspection(&inspection, path, arguments.force).map_err(|e| wrong(&e))?;
    }
    if let Some(path) = &arguments.report {
        let html = kalmems::results::inspection_page(&inspection).map_err(|e| wrong(&e))?;
        target::write_page(path, &html, arguments.force)?;
    }
    print_result(arguments.json, &inspection, || inspection.to_text())?;
    if inspection.is_usable() {
        return Ok(());
    }
    let file = arguments.input.display();
    Err(CommandEnding::Wrong(format!(
        "`{file}` cannot be used as a recording as it is; the findings above say why"
    )))
}

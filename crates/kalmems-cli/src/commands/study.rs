//! `kalmems study` and `kalmems merge`.

use crate::args::{MergeArguments, StudyArguments};
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json, target, terminal};
use kalmems::results::Output;
use kalmems::rigs::Workbench;
use kalmems::study::{Shard, StudyError, StudyOptions, StudyPlan};
use std::path::PathBuf;

pub fn run(workbench: &Workbench, arguments: &StudyArguments) -> Result<(), CommandEnding> {
    let plan = if arguments.calibration {
        StudyPlan::calibration(workbench, &arguments.study, arguments.runs)
    } else {
        StudyPlan::load(workbench, &arguments.study)
    };
    let plan = plan.map_err(ending)?;
    let out = folder(&plan, arguments.out.as_ref());
    let work = plan.work().forced(arguments.force);
    // The journal of a shard stands beside the folder, which no shard writes.
    let whole = arguments.shard.is_whole();
    let output = whole.then(|| target::begin(Some(&out), &[], &work)).transpose()?;
    let options = StudyOptions { shard: arguments.shard, threads: arguments.threads, force: arguments.force };
    let bar = ProgressDisplay::default();
    let progressed = plan.run_all(&out, options, &bar).map_err(ending)?;
    drop(bar);
    let journal = progressed.journal.display();
    if progressed.torn {
        tell!("note: the last line of {journal} was half written; its run was made again");
    }
    if progressed.before > 0 {
        tell!("note: {} of {} runs were in {journal} already", progressed.before, progressed.runs);
    }
    let Some(output) = output else {
        let journals: Vec<String> = all_shards(arguments.shard)
            .map(|shard| plan.journal(&out, shard).display().to_string())
            .collect();
        let all = journals.join(" ");
        tell!(
            "shard {} is in {journal}; when all are finished, join them with: kalmems merge {all}",
            arguments.shard
        );
        return Ok(());
    };
    report(&plan, &[progressed.journal], output, arguments.json)
}

pub fn merge(workbench: &Workbench, arguments: &MergeArguments) -> Result<(), CommandEnding> {
    let Some(first) = arguments.journals.first() else { return Ok(()) };
    let plan = StudyPlan::from_journal(workbench, first).map_err(ending)?;
    let out = folder(&plan, arguments.out.as_ref());
    let work = plan.work().forced(arguments.force);
    report(&plan, &arguments.journals, target::begin(Some(&out), &[], &work)?, arguments.json)
}

/// All shards of a study of which this is one.
fn all_shards(one: Shard) -> impl Iterator<Item = Shard> {
    let text = one.to_string();
    let count = text.split_once('/').and_then(|(_, count)| count.parse::<u32>().ok()).unwrap_or(1);
    (1..=count).filter_map(move |number| format!("{number}/{count}").parse().ok())
}

fn folder(plan: &StudyPlan, out: Option<&PathBuf>) -> PathBuf {
    let kind = if plan.is_calibration() { "calibrations" } else { "studies" };
    out.map_or_else(|| PathBuf::from("out").join(kind).join(plan.name()), Clone::clone)
}

#[allow(clippy::needless_pass_by_value)] // as `map_err` has it
fn ending(error: StudyError) -> CommandEnding {
    match error {
        StudyError::Interrupted { .. } => CommandEnding::Paused(error.to_string()),
        error => CommandEnding::Wrong(error.to_string()),
    }
}

fn report(plan: &StudyPlan, journals: &[PathBuf], output: Output, json: bool) -> Result<(), CommandEnding> {
    let summary = plan.write_results(journals, &output).map_err(ending)?;
    let out = target::finish(output)?;
    if json {
        print_json(&summary)?;
    } else {
        let mut text = summary.to_text_within(terminal::columns()) + "\n";
        for notice in summary.notices() {
            text += &format!("\n{notice}\n");
        }
        print(&text)?;
    }
    tell!("results in {}", out.display());
    Ok(())
}

//! `kalmems study` and `kalmems merge`.

use crate::args::{MergeArguments, StudyArguments};
use crate::progress::Bar;
use crate::{Ending, print};
use kalmems::study::{Options, Plan, StudyError};
use std::path::{Path, PathBuf};

pub fn run(arguments: &StudyArguments) -> Result<(), Ending> {
    let plan = Plan::load(&arguments.study).map_err(ending)?;
    let out = folder(&plan, arguments.out.as_ref());
    let options = Options { shard: arguments.shard, threads: arguments.threads, force: arguments.force };
    let bar = Bar::of_large_units();
    let progressed = plan.run_all(&out, options, &bar).map_err(ending)?;
    drop(bar);
    let journal = progressed.journal.display();
    if progressed.torn {
        eprintln!("note: the last line of {journal} was half written; its run was made again");
    }
    if progressed.before > 0 {
        eprintln!("note: {} of {} runs were in {journal} already", progressed.before, progressed.runs);
    }
    if !arguments.shard.is_whole() {
        eprintln!("shard {} is in {journal}; join all with: kalmems merge", arguments.shard);
        return Ok(());
    }
    report(&plan, &[progressed.journal], &out, arguments.force, arguments.json)
}

pub fn merge(arguments: &MergeArguments) -> Result<(), Ending> {
    let Some(first) = arguments.journals.first() else { return Ok(()) };
    let plan = Plan::from_journal(first).map_err(ending)?;
    let out = folder(&plan, arguments.out.as_ref());
    report(&plan, &arguments.journals, &out, arguments.force, arguments.json)
}

fn folder(plan: &Plan, out: Option<&PathBuf>) -> PathBuf {
    out.map_or_else(|| PathBuf::from("out").join("studies").join(plan.name()), Clone::clone)
}

#[allow(clippy::needless_pass_by_value)] // as `map_err` has it
fn ending(error: StudyError) -> Ending {
    match error {
        StudyError::Interrupted { .. } => Ending::Paused(error.to_string()),
        error => Ending::Wrong(error.to_string()),
    }
}

fn report(plan: &Plan, journals: &[PathBuf], out: &Path, force: bool, json: bool) -> Result<(), Ending> {
    let summary = plan.write_results(journals, out, force).map_err(ending)?;
    if json {
        let json = serde_json::to_string_pretty(&summary).map_err(|e| Ending::Wrong(e.to_string()))?;
        print(&(json + "\n"))?;
    } else {
        let mut text = format!("{summary}\n");
        for notice in summary.notices() {
            text += &format!("\n{notice}\n");
        }
        print(&text)?;
    }
    eprintln!("results in {}", out.display());
    Ok(())
}

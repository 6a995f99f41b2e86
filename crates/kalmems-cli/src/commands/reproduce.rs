//! `kalmems reproduce`.

use crate::args::ReproduceArguments;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print, print_json, target, terminal};
use kalmems::results::{RunInfo, Work};
use kalmems_papers::program::{
    Effort, ReproduceError, ReproductionSettings, checks_table, reproduce, summary_table, write_reproduction,
};
use std::time::{Instant, SystemTime};

pub fn run(arguments: &ReproduceArguments) -> Result<(), CommandEnding> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let (name, program) =
        *kalmems_papers::ALL.iter().find(|(name, _)| *name == arguments.rig).ok_or_else(|| {
            let known: Vec<&str> = kalmems_papers::ALL.iter().map(|(name, _)| *name).collect();
            CommandEnding::Wrong(format!(
                "nothing is published of a rig `{}`; there is: {}",
                arguments.rig,
                known.join(", ")
            ))
        })?;
    let ending = |e: ReproduceError| match e {
        ReproduceError::Interrupted => CommandEnding::Interrupted,
        e => CommandEnding::Wrong(e.to_string()),
    };
    let settings = ReproductionSettings {
        only: arguments.only.clone(),
        effort: if arguments.full { Effort::Full } else { Effort::Quick },
        seed: arguments.seed.into(),
        threads: arguments
            .threads
            .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, Into::into)),
    };
    let work = Work::named("reproduce", name);
    let output = arguments.folder.begin(&["reproduce", name], work)?;
    let bar = ProgressDisplay::default();
    let reproduction = reproduce(name, program, settings, &bar).map_err(ending)?;
    drop(bar);
    let info = RunInfo { started, took: clock.elapsed() };
    write_reproduction(&reproduction, &output, info, &crate::interrupt::requested).map_err(ending)?;
    let out = target::finish(output)?;

    if arguments.json {
        print_json(&reproduction)?;
    } else {
        let mut text = String::new();
        for item in &reproduction.items {
            text += &format!("{}: {}\n", item.head.source(), item.head.title);
            text += &format!("{}; {}\n", item.verdict().words(), item.why());
            text += &checks_table(item).to_text_within(terminal::columns());
            for table in &item.tables {
                text += &format!("\n{}", table.to_text_within(terminal::columns()));
            }
            text += "\n";
        }
        print(&(text + &summary_table(&reproduction, false).to_text_within(terminal::columns())))?;
    }
    tell!("results in {}; open {}", out.display(), out.join("report.html").display());
    Ok(())
}

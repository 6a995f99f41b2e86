//! `kalmems spectrum`.

use crate::args::SpectrumArguments;
use crate::progress::ProgressDisplay;
use crate::tell::tell;
use crate::{CommandEnding, print_result, target};
use kalmems::applications::ApplicationFile;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::applications::spectrum::measure;
use kalmems::applications::spectrum::{SpectrumMetrics, write_spectrum};
use kalmems::results::{RunInfo, Work};
use kalmems::rigs::Workbench;
use std::time::{Instant, SystemTime};

pub fn run(workbench: &Workbench, arguments: &SpectrumArguments) -> Result<(), CommandEnding> {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let file = SpectrumFile::load(&arguments.spectrum).map_err(|e| wrong(&e))?;
    let work = Work::of_file("spectrum", &arguments.spectrum, file.files());
    let output = arguments.folder.begin(&["spectrum", &file.name.to_string()], work)?;
    let bar = ProgressDisplay::default();
    let outcome = measure(workbench, &file, &bar)
        .map_err(|e| if e.is_interruption() { CommandEnding::Interrupted } else { wrong(&e) })?;
    drop(bar);
    let metrics = SpectrumMetrics::of(&outcome);
    let info = RunInfo { started, took: clock.elapsed() };
    write_spectrum(&outcome, &metrics, &output, info).map_err(|e| wrong(&e))?;
    let out = target::finish(output)?;
    print_result(arguments.json, &metrics, || metrics.to_text())?;
    let picture = out.join("figures").join("spectrum.svg");
    tell!("results in {}; look at {}", out.display(), picture.display());
    Ok(())
}

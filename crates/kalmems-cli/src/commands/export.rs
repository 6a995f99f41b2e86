//! `kalmems export`.

use super::source_cost;
#[cfg(not(target_family = "wasm"))]
use super::source_trial::tried;
use crate::args::{ExportArguments, ExportDigits, Language};
use crate::tell::tell;
use crate::{CommandEnding, print, print_json, target};
use kalmems::config::{FilterTable, Method};
use kalmems::export::{ExportRequest, SourceDigits, SourceLanguage, write_export};
use kalmems::inspect::quantity;
use kalmems::results::Work;
use kalmems::rigs::Workbench;
use kalmems::source::source;
use kalmems::units::{Value, kind};
use serde::Serialize;
use serde_json::json;
use std::path::PathBuf;

pub fn run(workbench: &Workbench, arguments: &ExportArguments) -> Result<(), CommandEnding> {
    let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(e.to_string());
    let experiment = workbench.load(&arguments.experiment).map_err(|e| wrong(&e))?;
    let filters = experiment.estimate.as_ref().map_or(&[][..], |estimate| &estimate.filters[..]);
    let is_accurate = |filter: &&FilterTable| filter.method != Method::EulerEkf;
    let first = || filters.iter().find(is_accurate).or(filters.first()).map(|filter| filter.name.to_string());
    let request = ExportRequest {
        target: match arguments.target {
            Language::C => SourceLanguage::C,
            Language::Rust => SourceLanguage::Rust,
        },
        filter: arguments.filter.clone().or_else(first).unwrap_or_default(),
        interval_s: arguments.rate.as_deref().map(interval_s).transpose()?,
        update_every: arguments.update_every,
        samples: arguments.samples,
        adjustable: arguments.adjustable.clone(),
        digits: match arguments.digits {
            None => SourceDigits::AsNeeded,
            Some(ExportDigits::Single) => SourceDigits::Single,
            Some(ExportDigits::Double) => SourceDigits::Double,
        },
        verify: arguments.verify,
        notes: Vec::new(),
    };
    let exported = source(workbench, &experiment, &request).map_err(|e| wrong(&e))?;
    let cost = source_cost::said(&exported, arguments)?;
    let tried = if arguments.verify { Some(tried(&exported, request.target)?) } else { None };
    let exported = if arguments.project {
        exported.into_project(request.target).map_err(|e| wrong(&e))?
    } else {
        exported
    };
    let work = Work::of_file("export", &arguments.experiment, experiment.files());
    let output = arguments.folder.begin(&["exported", &experiment.name.to_string()], work)?;
    write_export(&exported, &output).map_err(|e| wrong(&e))?;
    let out = target::finish(output)?;
    let files: Vec<PathBuf> = exported.files.iter().map(|(name, _)| out.join(name)).collect();
    if arguments.json {
        return print_json(&json!({
            "filter": exported.filter,
            "interval_s": exported.interval_s,
            "files": files,
            "verified": tried,
            "cost": exported.cost,
            "instructions": exported.cost.zip(arguments.cpu).map(|(cost, cpu)| source_cost::instructions(&cost, cpu)),
        }));
    }
    for file in files {
        print(&format!("{}\n", file.display()))?;
    }
    tell!("the filter `{}`, one step each {}", exported.filter, quantity(exported.interval_s, "s"));
    for words in &cost {
        tell!("{words}");
    }
    if let Some(tried) = &tried {
        tell!("{}", tried.in_words());
    }
    let others: Vec<String> = filters
        .iter()
        .map(|one| one.name.to_string())
        .filter(|name| *name != exported.filter)
        .map(|name| format!("`{name}`"))
        .collect();
    if arguments.filter.is_none() && !others.is_empty() {
        tell!("other filters of the file, for `--filter`: {}", others.join(", "));
    }
    Ok(())
}

/// What running the source showed.
#[derive(Serialize)]
pub struct TriedSource {
    /// What compiled it.
    pub compiler: &'static str,
    /// How many samples it was run over.
    pub samples: usize,
    /// How far it was from the estimate at most, by the standard deviation that the filter claims.
    pub apart: f64,
    /// Of which state.
    pub state: String,
}

impl TriedSource {
    /// In a sentence.
    pub fn in_words(&self) -> String {
        let Self { compiler, samples, apart, state } = self;
        format!(
            "verified: compiled by `{compiler}` and run over {samples} samples of the recording, it is at most {apart:.1e} of the claimed standard \
             deviation from the estimate, of `{state}`"
        )
    }
}

/// Nothing compiles where there are no processes.
#[cfg(target_family = "wasm")]
fn tried(_: &kalmems::export::Exported, _: SourceLanguage) -> Result<TriedSource, CommandEnding> {
    Err(CommandEnding::Wrong("--verify: nothing is compiled in a browser; leave it out".to_owned()))
}

/// One over a rate.
fn interval_s(rate: &str) -> Result<f64, CommandEnding> {
    let wrong = |why: &dyn std::fmt::Display| CommandEnding::Wrong(format!("--rate: {why}"));
    let value = Value::parse(rate).map_err(|e| wrong(&e))?;
    let rate_hz = value.of_kind(&kind::FREQUENCY).map_err(|e| wrong(&e))?;
    let interval_s = rate_hz.recip();
    if rate_hz > 0.0 && interval_s.is_finite() {
        Ok(interval_s)
    } else {
        Err(wrong(&format!("found `{rate}`; write a rate above 0, such as `1 MHz`")))
    }
}

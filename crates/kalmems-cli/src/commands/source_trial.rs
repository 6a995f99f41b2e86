//! An exported source, compiled here and run over the recording.

use super::export::TriedSource;
use crate::CommandEnding;
use kalmems::export::{Exported, SourceLanguage, SourceTrial};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::Path;
use std::process::Command;

/// How far the source may be from the estimate, by the standard deviation that the filter claims.
const APART: f64 = 0.02;
/// How far a number of 32 bits, in which a source says its states, may be from one of 64, relative to it.
const ROUNDING: f64 = 1e-7;

/// Compiles the source and runs it over the samples that come with it.
///
/// # Errors
///
/// No compiler, a source that does not compile, and one that is not the filter of the estimate.
pub fn tried(exported: &Exported, target: SourceLanguage) -> Result<TriedSource, CommandEnding> {
    let wrong = |why: String| CommandEnding::Wrong(format!("--verify: {why}"));
    let Some(trial) = &exported.trial else {
        return Err(wrong("no samples came with the source".to_owned()));
    };
    let folder = tempfile::tempdir().map_err(|e| wrong(format!("no temporary folder: {e}")))?;
    let at = |name: &str| folder.path().join(name);
    let write = |name: &str, content: &str| {
        fs::write(at(name), content).map_err(|e| wrong(format!("cannot write {}: {e}", at(name).display())))
    };
    for (name, content) in &exported.files {
        write(name, content)?;
    }
    let mut text = String::new();
    for numbers in &trial.given {
        for number in numbers {
            let _ = write!(text, "{number:e} ");
        }
        text.push('\n');
    }
    write("samples", &text)?;
    let compiler = compiled(exported, target, folder.path())?;
    let samples = File::open(at("samples")).map_err(|e| wrong(e.to_string()))?;
    let ran = Command::new(at("program"))
        .stdin(samples)
        .output()
        .map_err(|e| wrong(format!("it does not run: {e}")))?;
    if !ran.status.success() {
        return Err(wrong(format!("it ended with {}: {}", ran.status, String::from_utf8_lossy(&ran.stderr))));
    }
    let said = String::from_utf8_lossy(&ran.stdout);
    let said: Vec<Vec<f64>> = said
        .lines()
        .map(|line| line.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN)).collect())
        .collect();
    let found = compared(trial, &said, compiler).map_err(wrong)?;
    if found.apart <= APART {
        return Ok(found);
    }
    Err(wrong(format!(
        "it is {:.2} of the claimed standard deviation of `{}` from the estimate, and {APART} is the most that passes",
        found.apart, found.state
    )))
}

/// What compiled it.
fn compiled(
    exported: &Exported,
    target: SourceLanguage,
    folder: &Path,
) -> Result<&'static str, CommandEnding> {
    let wrong = |why: String| CommandEnding::Wrong(format!("--verify: {why}"));
    let (compilers, arguments): (&[&str], Vec<String>) = match target {
        SourceLanguage::C => {
            let is_source = |name: &&String| Path::new(name).extension().is_some_and(|ending| ending == "c");
            let sources = exported.files.iter().map(|(name, _)| name).filter(is_source).cloned();
            let flags = ["-std=c99", "-O2", "-o", "program"].map(str::to_owned);
            (&["cc", "gcc", "clang"], flags.into_iter().chain(sources).collect())
        }
        SourceLanguage::Rust => (
            &["rustc"],
            ["--edition=2021", "-Copt-level=2", "-o", "program", "main.rs"].map(str::to_owned).to_vec(),
        ),
    };
    for compiler in compilers {
        let Ok(ran) = Command::new(compiler).args(&arguments).current_dir(folder).output() else { continue };
        if ran.status.success() {
            return Ok(compiler);
        }
        return Err(wrong(format!("`{compiler}` refuses it: {}", String::from_utf8_lossy(&ran.stderr))));
    }
    Err(wrong(format!("none of {} is installed; install one, or leave `--verify` out", compilers.join(", "))))
}

/// The farthest that a state was from the estimate, by what is claimed of it.
fn compared(trial: &SourceTrial, said: &[Vec<f64>], compiler: &'static str) -> Result<TriedSource, String> {
    if said.len() != trial.expected.len() {
        return Err(format!("it answered {} of {} samples", said.len(), trial.expected.len()));
    }
    let mut found = TriedSource { compiler, samples: said.len(), apart: 0.0, state: String::new() };
    for (said, (expected, deviations)) in said.iter().zip(&trial.expected) {
        for (k, ((said, expected), sd)) in said.iter().zip(expected).zip(deviations).enumerate() {
            let difference = said - expected;
            let difference = match trial.periods.get(k).copied().flatten() {
                Some(period) => difference - period * (difference / period).round(),
                None => difference,
            };
            let apart = (difference.abs() - ROUNDING * expected.abs()).max(0.0) / sd;
            if *sd > 0.0 && (apart.is_nan() || difference.is_nan() || apart >= found.apart) {
                found.apart = if difference.is_nan() { f64::INFINITY } else { apart };
                found.state = trial.states.get(k).cloned().unwrap_or_default();
            }
        }
    }
    Ok(found)
}

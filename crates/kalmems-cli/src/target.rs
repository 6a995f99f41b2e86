//! Where a result is put: its folder, from before the work begins until it is there, and a file beside an experiment.

use crate::CommandEnding;
use crate::tell::tell;
use kalmems::results::{EarlierResult, Output, Work, create_file};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Prepares the folder that was asked for, or else the one with these steps below `out`. What may not be replaced is
/// refused here, before any time is spent.
pub fn begin(out: Option<&PathBuf>, usual: &[&str], work: &Work) -> Result<Output, CommandEnding> {
    let usual = || std::iter::once("out").chain(usual.iter().copied()).collect();
    let out = out.cloned().unwrap_or_else(usual);
    Output::begin(&out, work).map_err(|e| CommandEnding::Wrong(e.to_string()))
}

/// Puts the complete result in its place, and says where the earlier one is, if that is kept; the folder.
pub fn finish(output: Output) -> Result<PathBuf, CommandEnding> {
    let out = output.target().to_owned();
    let committed = output.commit().map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    tell_of(&committed);
    Ok(out)
}

/// Says where the earlier result is, if that is kept.
pub fn tell_of(committed: &EarlierResult) {
    if let Some(earlier) = &committed.earlier {
        tell!("the earlier result, which differs from this one, is kept in {}", earlier.display());
    }
}

/// Writes a page that is a result of its own.
pub fn write_page(path: &Path, html: &str, force: bool) -> Result<(), CommandEnding> {
    kalmems::results::write_page(path, html, force).map_err(|e| CommandEnding::Wrong(e.to_string()))
}

/// A file in the folder of an experiment, from which the experiment's paths count.
pub struct BesideExperiment<'a> {
    path: &'a Path,
    force: bool,
}

impl<'a> BesideExperiment<'a> {
    /// Where the experiment is to be written, if it is. What stands there is refused before any time is spent.
    pub fn of(path: Option<&'a Path>, experiment: &Path, force: bool) -> Result<Option<Self>, CommandEnding> {
        let Some(path) = path else { return Ok(None) };
        if path.parent().unwrap_or(path) != experiment.parent().unwrap_or(path) {
            let why = "`--write` expects a file in the folder of the experiment, from which its paths count"
                .to_owned();
            return Err(CommandEnding::Wrong(why));
        }
        refuse_existing(path, force)?;
        Ok(Some(Self { path, force }))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.path
    }

    /// Writes it whole.
    pub fn write(&self, text: &str) -> Result<(), CommandEnding> {
        put(self.path, text, self.force)
    }
}

/// Writes a file whole. One that stands there is refused, or put aside as `FILE.previous` where that is wanted.
pub fn write_file(path: &Path, text: &str, force: bool) -> Result<(), CommandEnding> {
    refuse_existing(path, force)?;
    put(path, text, force)
}

fn refuse_existing(path: &Path, force: bool) -> Result<(), CommandEnding> {
    if path.exists() && !force {
        let why = format!(
            "`{}` exists already; give another path, or `--force`, which keeps the present file as `{}.previous`",
            path.display(),
            path.display()
        );
        return Err(CommandEnding::Wrong(why));
    }
    Ok(())
}

fn put(path: &Path, text: &str, force: bool) -> Result<(), CommandEnding> {
    let mut file = create_file(path, |_| false, force).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    let failed = |e: std::io::Error| CommandEnding::Wrong(format!("cannot write {}: {e}", path.display()));
    file.write_all(text.as_bytes()).map_err(failed)
}

//! The folder of a result, from before the work begins until the result is there.

use crate::Ending;
use crate::tell::tell;
use kalmems::results::{Committed, Output, Work};
use std::path::PathBuf;

/// Prepares the folder that was asked for, or else the one with these steps below `out`. What may not be replaced is
/// refused here, before any time is spent.
pub fn begin(out: Option<&PathBuf>, usual: &[&str], work: &Work) -> Result<Output, Ending> {
    let usual = || std::iter::once("out").chain(usual.iter().copied()).collect();
    let out = out.cloned().unwrap_or_else(usual);
    Output::begin(&out, work).map_err(|e| Ending::Wrong(e.to_string()))
}

/// Puts the complete result in its place, and says where the earlier one is, if that is kept; the folder.
pub fn finish(output: Output) -> Result<PathBuf, Ending> {
    let out = output.target().to_owned();
    let Committed { earlier } = output.commit().map_err(|e| Ending::Wrong(e.to_string()))?;
    if let Some(earlier) = earlier {
        tell!("the earlier result, which differs from this one, is kept in {}", earlier.display());
    }
    Ok(out)
}

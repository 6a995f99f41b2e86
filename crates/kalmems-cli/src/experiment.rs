//! An experiment file, with the noises that it leaves to its recording.

use crate::CommandEnding;
use crate::progress::ProgressDisplay;
use kalmems::config::Experiment;
use kalmems::diagnose::{FoundNoise, load_with_noise};
use kalmems::rigs::Workbench;
use std::path::Path;

/// Reads an experiment file, and finds what noises it leaves to its recording.
pub fn load(workbench: &Workbench, path: &Path) -> Result<(Experiment, Vec<FoundNoise>), CommandEnding> {
    let bar = ProgressDisplay::default();
    load_with_noise(workbench, path, &bar).map_err(|e| {
        if e.is_interruption() { CommandEnding::Interrupted } else { CommandEnding::Wrong(e.to_string()) }
    })
}

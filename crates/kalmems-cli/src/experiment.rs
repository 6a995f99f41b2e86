//! An experiment file, with the noises that it leaves to its recording.

use crate::Ending;
use crate::progress::Bar;
use kalmems::config::Experiment;
use kalmems::diagnose::{FoundNoise, load_with_noise};
use kalmems::rigs::Workbench;
use std::path::Path;

/// Reads an experiment file, and finds what noises it leaves to its recording.
pub fn load(workbench: &Workbench, path: &Path) -> Result<(Experiment, Vec<FoundNoise>), Ending> {
    let bar = Bar::default();
    load_with_noise(workbench, path, &bar)
        .map_err(|e| if e.is_interruption() { Ending::Interrupted } else { Ending::Wrong(e.to_string()) })
}

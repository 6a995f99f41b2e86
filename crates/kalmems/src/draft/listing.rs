//! The devices that have a template, with what their signal looks like.

use super::DraftError;
use crate::inspect::sketch;
use crate::progress::Silent;
use crate::rigs::{Rig, Template, Workbench};
use crate::simulate::{ComputedRecording, SimulateError};
use serde::Serialize;
use std::path::Path;

/// A device that has a template.
#[derive(Clone, Debug, Serialize)]
pub struct ListedDevice {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub description: String,
    /// The end of its signal as the template simulates it, for a terminal.
    pub sketch: Vec<String>,
}

/// Samples of the signal that a sketch shows.
const SHOWN: usize = 400;
/// Characters of a sketch, in width and height.
const SIZE: (usize, usize) = (60, 3);

/// The devices of a workbench that have a template.
///
/// # Errors
/// Those of the simulation of a template.
pub fn listed(workbench: &Workbench) -> Result<Vec<ListedDevice>, DraftError> {
    let templates = workbench.rigs().filter_map(|rig| Some((rig, rig.template()?)));
    templates.map(|(rig, template)| one(workbench, rig, &template).map_err(DraftError::Simulation)).collect()
}

fn one(workbench: &Workbench, rig: &dyn Rig, template: &Template) -> Result<ListedDevice, SimulateError> {
    let experiment = workbench.parse(template.text, Path::new("template.toml"))?;
    let mut simulated = ComputedRecording::of(&*rig.simulate(&experiment)?, &Silent)?;
    let mut signal = Vec::new();
    let of = template.channels.iter().find(|channel| channel.meaning.starts_with("signal"));
    // Looked at, and left as it is.
    simulated.change_recorded(of.map_or("signal", |channel| channel.meaning), |values, _| {
        signal = values[values.len().saturating_sub(SHOWN)..].to_vec();
    });
    Ok(ListedDevice {
        name: rig.name(),
        description: experiment.description.unwrap_or_default(),
        sketch: sketch(&signal, SIZE.0, SIZE.1),
    })
}

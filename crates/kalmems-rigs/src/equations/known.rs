//! Filters that are given states as inputs, for comparison: what an instrument that is to measure them does not have.

use super::interpolation::Interpolation;
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{ConfigError, ConfigFault, Experiment, FilterTable, Key};
use kalmems_equations::{Device, EquationError};
use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

/// The states that a filter is given, by their places, in the order of the device.
pub fn known_states(
    (experiment, at, filter): (&Experiment, &Key, &FilterTable),
    device: &Device,
) -> Result<Vec<usize>, ConfigError> {
    let states = device.states().iter().take(device.own_states());
    let (key, names) = filter.known_states();
    let place = |name: &str| {
        device.state(name).filter(|place| *place < device.own_states()).ok_or_else(|| {
            let known = states.clone().map(|named| &*named.name);
            experiment.error(at.clone().child(key), ConfigFault::unknown_word(name, known))
        })
    };
    let places: BTreeSet<usize> = names.map(place).collect::<Result<_, _>>()?;
    Ok(places.into_iter().collect())
}

/// The states that filters of an experiment are given, by their places.
pub fn known_of_all(experiment: &Experiment, device: &Device) -> Result<Vec<usize>, ConfigError> {
    let mut all = BTreeSet::new();
    for (index, filter) in experiment.estimate.iter().flat_map(|estimate| &estimate.filters).enumerate() {
        let at = Key::from("estimate").child("filter").index(index);
        all.extend(known_states((experiment, &at, filter), device)?);
    }
    Ok(all.into_iter().collect())
}

/// A device some of whose states are inputs.
pub struct KnownDevice {
    /// The states, by their places in the device as it is.
    pub known: Vec<usize>,
    /// Its table and the device itself.
    pub table: Arc<EquationsTable>,
    /// The device.
    pub own: Arc<OwnDevice>,
}

impl KnownDevice {
    /// Of a device with its table.
    pub fn of(
        experiment: &Experiment,
        (table, device): (&EquationsTable, &Device),
        known: Vec<usize>,
    ) -> Result<Self, ConfigError> {
        let dropped = unused(device, &known).map_err(|error| super::refused(experiment, &error))?;
        let name = |place: &usize| device.states().get(*place).map(|named| &*named.name);
        let names: Vec<&str> = known.iter().filter_map(name).collect();
        let gone: Vec<&str> = known.iter().chain(&dropped).filter_map(name).collect();
        let mut other = table.clone();
        other.read = OnceLock::new();
        other.states.retain(|name| !gone.contains(&name));
        other.derivative.retain(|name| !gone.contains(&name));
        other.noise.retain(|name| !gone.contains(&name));
        other.usual.retain(|name, _| !gone.contains(&name.as_str()));
        other.answer.take_if(|name| gone.contains(&name.as_str()));
        let inputs: Vec<String> = table.inputs.iter().map(|(name, _)| name.to_owned()).collect();
        for name in names {
            let unit = table.states.get(name).cloned().unwrap_or_default();
            other.inputs.push(name, unit);
            // The mean of both ends of an interval acts in it.
            other.interpolation.set(&inputs, name, Interpolation::Mean);
        }
        let own = OwnDevice::of_table(experiment, &other)?;
        Ok(Self { known, table: Arc::new(other), own: Arc::new(own) })
    }
}

/// The states that act on the measurements through known ones alone, and are of no use where these are inputs.
fn unused(device: &Device, known: &[usize]) -> Result<Vec<usize>, EquationError> {
    let (before, now) = (seen(device, &[])?, seen(device, known)?);
    Ok(before.difference(&now).copied().filter(|state| !known.contains(state)).collect())
}

/// The states on which the measurements depend, now or by their rates, where some are inputs.
fn seen(device: &Device, known: &[usize]) -> Result<BTreeSet<usize>, EquationError> {
    let motion = device.motion(&[])?;
    let mut found = Vec::new();
    for measure in 0..device.measures().len() {
        found.extend(device.readout(measure, &[])?.sparsity());
    }
    let mut seen = BTreeSet::new();
    while let Some(state) = found.pop() {
        if !known.contains(&state) && seen.insert(state) {
            found.extend(motion.sparsity().filter(|(row, _)| *row == state).map(|(_, column)| column));
        }
    }
    Ok(seen)
}

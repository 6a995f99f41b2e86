//! What an experiment says of a sine beside its filters: how long a cycle takes, and which noises they know.

use super::names;
use super::own_device::stated_starts;
use super::table::EquationsTable;
use crate::StateDensity;
use crate::config::{CYCLES as GAP_CYCLES, Experiment};
use kalmems_equations::Device;

/// About how long a cycle of a sine takes in s, as far as the file says it: by where a filter starts. Where all is left to the signal, the settling
/// time stands for as many cycles as a gap may last that is predicted over.
pub fn cycle_s(experiment: &Experiment) -> Option<f64> {
    let (table, device) = EquationsTable::of(experiment).ok()?;
    let frequency = device.state(&table.sine.as_ref()?.frequency)?;
    let stated = stated_starts(experiment, &device).get(frequency).copied().flatten();
    let skip_s = experiment.estimate.as_ref()?.skip.si();
    let settling_s = if skip_s > 0.0 { skip_s } else { 1.0 };
    Some(stated.filter(|hz| *hz > 0.0).map_or(settling_s / GAP_CYCLES, f64::recip))
}

/// The densities of process noise that filters know. Of a sine, and of a device whose own table has names for them, those that some table of the file names,
/// and where one leaves all to the recording those with such a name, or of the sine's frequency, its rest, and the rate of its amplitude or else the amplitude.
pub fn densities(experiment: &Experiment, table: &EquationsTable, device: &Device) -> Vec<StateDensity> {
    let all = names::state_densities(table, device);
    if table.sine.is_none() && table.noise_keys.is_empty() {
        return all;
    }
    let tables: Vec<_> = experiment
        .estimate
        .iter()
        .flat_map(|estimate| {
            estimate.filters.iter().map(|filter| &filter.process_noise).chain([&estimate.process_noise])
        })
        .filter(|table| !table.is_empty())
        .collect();
    let of_sine = table.sine.iter().flat_map(|sine| {
        [&sine.frequency, &sine.offset, sine.amplitude_rate.as_ref().unwrap_or(&sine.amplitude)]
    });
    let of_device = table.noise_keys.iter().map(|(key, _)| *key);
    let wanders: Vec<&str> = of_sine.map(String::as_str).chain(of_device).collect();
    let is_open = tables.iter().any(|table| table.is_left_open());
    let is_known =
        |name: &str| tables.iter().any(|table| table.names(name)) || is_open && wanders.contains(&name);
    all.into_iter().filter(|density| is_known(density.entry.name)).collect()
}

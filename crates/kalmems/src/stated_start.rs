//! What filters take from the device's table of the numbers that are states, written out: for documents of which the uncertainties are taken away.

use crate::config::{ConfigError, Experiment};
use crate::estimate::DeviceParameter;
use toml::{Table, Value};

/// The tables of the states of all filters of an experiment's document, by their names.
fn states(document: &mut Table) -> impl Iterator<Item = (&str, &mut Table)> {
    let filters = document.get_mut("estimate").and_then(|estimate| estimate.get_mut("filter"));
    let filters = filters.and_then(Value::as_array_mut).into_iter().flatten();
    let tables = filters.filter_map(|filter| filter.get_mut("states")?.as_table_mut());
    tables.flatten().filter_map(|(name, state)| Some((name.as_str(), state.as_table_mut()?)))
}

/// Whether a filter of an experiment's document leaves to the device's table how well a state is known at first.
pub fn leaves_start_sd_out(document: &mut Table) -> bool {
    states(document).any(|(_, state)| !state.contains_key("start_sd"))
}

/// Writes `start_sd` where a filter leaves it out, by what the experiment of this document states of its device.
///
/// # Errors
/// More uncertain numbers than an experiment may have.
pub fn write_start_sds(
    document: &mut Table,
    experiment: &Experiment,
    parameters: &[DeviceParameter],
) -> Result<(), ConfigError> {
    for (name, state) in states(document).filter(|(_, state)| !state.contains_key("start_sd")) {
        let Some(parameter) = parameters.iter().find(|parameter| parameter.name == name) else { continue };
        let Some(sd) = parameter.stated_sd(experiment)? else { continue };
        let unit = if parameter.is_factor() { "" } else { parameter.unit };
        let value = Value::String(format!("{sd:e} {unit}").trim_end().to_owned());
        state.insert("start_sd".to_owned(), value);
    }
    Ok(())
}

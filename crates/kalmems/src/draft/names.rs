//! The names that an experiment with a device may use.

use super::{DraftError, template};
use crate::config::{Experiment, FilterStart, Values};
use crate::rigs::{TemplateChannel, Workbench};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// The names that an experiment with a device may use: its channels, states, parameters and methods.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceNames {
    /// The device, by the name of its rig.
    pub device: &'static str,
    /// The table of the experiment file that describes it, such as `device.shared_scanner`.
    pub table: String,
    /// What the device is, in one line.
    pub description: String,
    /// The channels of a recording, for the key `channels` of a `[[recording]]`.
    pub channels: Vec<NamedChannel>,
    /// The channels of a reference, for the key `channels` of `reference`.
    pub references: Vec<NamedChannel>,
    /// The states, for `start` and `start_sd` of a filter and `start` of `[simulate]`.
    pub states: Vec<NamedValue>,
    /// The states that have process noise, for `[estimate.process_noise]`.
    pub process_noise: Vec<NamedValue>,
    /// The parameters that a filter can estimate, for `states` of a filter.
    pub parameters: Vec<NamedParameter>,
    /// The methods of a filter that the device takes.
    pub methods: Vec<DescribedName>,
    /// The methods that the device refuses, with the physical reason.
    pub refused_methods: Vec<DescribedName>,
}

/// A channel of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct NamedChannel {
    /// Its name in the experiment file.
    pub name: &'static str,
    /// Its unit in SI.
    pub unit: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Whether an estimate needs it.
    pub needed: bool,
}

/// A name whose value has a unit.
#[derive(Clone, Debug, Serialize)]
pub struct NamedValue {
    /// The name.
    pub name: String,
    /// A value that the device's template has for it.
    pub example: String,
}

/// A parameter that can be a state.
#[derive(Clone, Debug, Serialize)]
pub struct NamedParameter {
    /// The name.
    pub name: &'static str,
    /// The unit of its deviation: 1 of a factor, which is relative to the value in the device's table.
    pub unit: &'static str,
    /// The key in the device's table that it scales or is added to, where it is one.
    pub key: Option<&'static str>,
}

/// A name and a sentence about it.
#[derive(Clone, Debug, Serialize)]
pub struct DescribedName {
    /// The name.
    pub name: String,
    /// What it is, or why it is refused.
    pub what: String,
}

/// The names that an experiment with this device may use.
///
/// # Errors
/// A device without a template, and a template that is no experiment.
pub fn names_of(workbench: &Workbench, device: &str) -> Result<DeviceNames, DraftError> {
    let (rig, template) = template(workbench, device)?;
    let experiment = workbench.parse(template.text, Path::new("template.toml"));
    let experiment = experiment.map_err(|error| DraftError::Simulation(error.into()))?;
    let channel = |channel: &TemplateChannel| NamedChannel {
        name: channel.meaning,
        unit: channel.unit,
        what: channel.what,
        needed: channel.needed,
    };
    let refused = rig.uses(&experiment).no_methods;
    let is_refused = |name: &str| refused.iter().any(|(method, _)| method.word() == name);
    let parameters = rig.parameters(&experiment).iter().map(|parameter| NamedParameter {
        name: parameter.name,
        unit: parameter.unit,
        key: parameter.written.first().filter(|(_, power)| *power == 1).map(|(key, _)| *key),
    });
    let refused_methods = refused
        .iter()
        .map(|(method, why)| DescribedName { name: method.word().to_owned(), what: (*why).to_owned() });
    Ok(DeviceNames {
        device: rig.name(),
        table: format!("device.{}", rig.device().name),
        states: states(&experiment),
        process_noise: experiment
            .estimate
            .as_ref()
            .map_or_else(Vec::new, |e| values(e.process_noise.stated())),
        description: experiment.description.unwrap_or_default(),
        channels: template.channels.iter().map(channel).collect(),
        references: template.references.iter().map(channel).collect(),
        parameters: parameters.collect(),
        methods: methods(workbench).into_iter().filter(|method| !is_refused(&method.name)).collect(),
        refused_methods: refused_methods.collect(),
    })
}

/// The schema of experiment files, in which the table of each device says which names an experiment with it may use.
pub fn schema_with_names(workbench: &Workbench) -> serde_json::Value {
    let mut schema = workbench.schema();
    for rig in workbench.rigs().filter(|rig| rig.template().is_some()) {
        let Ok(names) = names_of(workbench, rig.name()) else { continue };
        let devices =
            schema.pointer_mut("/properties/device/oneOf").and_then(|devices| devices.as_array_mut());
        let is_own = |one: &&mut serde_json::Value| one["properties"].get(rig.device().name).is_some();
        let own = devices.into_iter().flatten().find(is_own);
        let Some(table) = own.and_then(serde_json::Value::as_object_mut) else { continue };
        let words = |key: &str| table.get(key).and_then(|text| text.as_str()).unwrap_or_default().to_owned();
        let known = words("description");
        let joint = if known.is_empty() { "" } else { "\n\n" };
        table.insert("description".to_owned(), format!("{known}{joint}{}", names.in_short()).into());
    }
    schema
}

/// The states, in the order in which they are first named.
fn states(experiment: &Experiment) -> Vec<NamedValue> {
    let mut found: Vec<NamedValue> = Vec::new();
    let mut add = |more: &Values| {
        for value in values(more) {
            if found.iter().all(|known| known.name != value.name) {
                found.push(value);
            }
        }
    };
    for filter in experiment.estimate.iter().flat_map(|estimate| &estimate.filters) {
        if let Some(FilterStart::Values(start)) = &filter.start {
            add(start);
        }
    }
    if let Some(simulate) = &experiment.simulate {
        add(&simulate.start);
    }
    for filter in experiment.estimate.iter().flat_map(|estimate| &estimate.filters) {
        add(&filter.start_sd);
    }
    found
}

fn values(values: &Values) -> Vec<NamedValue> {
    let one = |(name, value): (&String, &crate::config::AnyValue)| NamedValue {
        name: name.clone(),
        example: value.value().text().to_owned(),
    };
    values.iter().map(one).collect()
}

/// All methods of filters with their sentences, as the schema of experiment files has them.
fn methods(workbench: &Workbench) -> Vec<DescribedName> {
    let schema = workbench.schema();
    let known = schema.pointer("/$defs/Method/oneOf").and_then(|known| known.as_array());
    let text = |of: &serde_json::Value, key: &str| of[key].as_str().unwrap_or_default().replace('\n', " ");
    let one = |method: &serde_json::Value| DescribedName {
        name: text(method, "const"),
        what: text(method, "description"),
    };
    known.into_iter().flatten().map(one).collect()
}

impl DeviceNames {
    /// All names, without what they mean.
    fn in_short(&self) -> String {
        let list =
            |names: Vec<&str>| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        let mut text = String::new();
        for (what, names) in [
            ("Channels", self.channels.iter().map(|one| one.name).collect::<Vec<_>>()),
            ("References", self.references.iter().map(|one| one.name).collect()),
            ("States", self.states.iter().map(|one| &*one.name).collect()),
            ("Parameters that can be states", self.parameters.iter().map(|one| one.name).collect()),
            ("Methods", self.methods.iter().map(|one| &*one.name).collect()),
        ] {
            if !names.is_empty() {
                text += &format!("{what} of `{}`: {}. ", self.device, list(names));
            }
        }
        text.trim_end().to_owned()
    }
}

impl fmt::Display for DeviceNames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { device, table, description, .. } = self;
        writeln!(f, "{device}: {description}")?;
        writeln!(f, "An experiment file describes it in `[{table}]`.")?;
        writeln!(f, "`kalmems new --device {device}` prints an experiment file with comments.")?;
        section(f, "Channels, for `channels` of a `[[recording]]`", &channel_rows(&self.channels))?;
        let title =
            "References, for `reference.channels` of a `[[recording]]`; only the evaluation reads them";
        section(f, title, &channel_rows(&self.references))?;
        let rows = |values: &[NamedValue]| {
            values.iter().map(|one| (one.name.clone(), format!("such as \"{}\"", one.example))).collect()
        };
        let title = "States, for `start` and `start_sd` of a filter and for `start` of `[simulate]`";
        section(f, title, &rows(&self.states))?;
        section(f, "Process noise, for `[estimate.process_noise]`", &rows(&self.process_noise))?;
        if !self.methods.is_empty() {
            let what = "A noise of the readout that is \"from_recording\" is found from the recording";
            writeln!(f, "\n{what} (`kalmems help noise`).")?;
        }
        let parameters = self.parameters.iter().map(|one| {
            let what = match (one.unit, one.key) {
                ("1", Some(key)) => format!("relative to `{key}` of the device's table"),
                ("1", None) => "a factor, relative to the device's table".to_owned(),
                (unit, Some(key)) => format!("in {unit}, added to `{key}` of the device's table"),
                (unit, None) => format!("in {unit}"),
            };
            (one.name.to_owned(), what)
        });
        section(f, "Parameters that a filter can estimate, for `states` of a filter", &parameters.collect())?;
        let described =
            |names: &[DescribedName]| names.iter().map(|one| (one.name.clone(), one.what.clone())).collect();
        section(f, "Methods, for `method` of a filter", &described(&self.methods))?;
        section(f, "Methods that this device refuses", &described(&self.refused_methods))
    }
}

fn channel_rows(channels: &[NamedChannel]) -> Vec<(String, String)> {
    let one = |one: &NamedChannel| {
        let optional = if one.needed { "" } else { "; optional" };
        (one.name.to_owned(), format!("{}, in {}{optional}", one.what, one.unit))
    };
    channels.iter().map(one).collect()
}

/// A title with a line for each row, or nothing where there is no row.
fn section(f: &mut fmt::Formatter<'_>, title: &str, rows: &Vec<(String, String)>) -> fmt::Result {
    if rows.is_empty() {
        return Ok(());
    }
    let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or_default();
    writeln!(f, "\n{title}")?;
    for (name, what) in rows {
        writeln!(f, "  {name:width$}  {what}")?;
    }
    Ok(())
}

//! What a filter holds as uncertain of its device, and a truth that is drawn from it.

use super::super::seed::Draw;
use crate::config::{CORRELATION, ConfigFault, Key, KeyStep, get, put};
use crate::estimate::DeviceParameter;
use crate::units::Value;
use std::borrow::Cow;
use toml::{Table, Value as Toml};

/// A parameter with its prior: normal about what the device's table says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ParameterPrior {
    parameter: usize,
    sd: f64,
}

/// A deviation that was drawn: of a parameter that is a factor relative to what the filter is told, else in SI.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct DrawnDeviation {
    /// The parameter, or the number by its key below the device's table.
    pub(in super::super) name: Cow<'static, str>,
    /// By how much the truth deviates from what the filter is told.
    pub(in super::super) deviation: f64,
}

/// What cannot be drawn: the key in the experiment, and why.
pub(super) type PriorRefusal = (Key, ConfigFault);

fn filters(document: &Table) -> &[Toml] {
    let filters = document.get("estimate").and_then(|estimate| estimate.get("filter"));
    filters.and_then(Toml::as_array).map_or(&[], Vec::as_slice)
}

/// The priors of the filter at this place, in the order of the rig's parameters.
pub(super) fn priors(
    document: &Table,
    parameters: &[DeviceParameter],
    filter: usize,
) -> Result<Vec<ParameterPrior>, PriorRefusal> {
    let states = filters(document).get(filter).and_then(|filter| filter.get("states"));
    let Some(states) = states.and_then(Toml::as_table) else { return Ok(Vec::new()) };
    let at = |name: &str| Key::from("estimate.filter").index(filter).child("states").child(name);
    let mut priors = Vec::new();
    for (name, state) in states {
        let place = parameters.iter().position(|parameter| parameter.name == name);
        let written = place.is_some_and(|place| !parameters[place].written.is_empty());
        let Some(place) = place.filter(|_| written) else {
            let why = format!(
                "the device says of no key of its table that it stands for `{name}`, so that no other {name} can be simulated; \
                 leave the state out, or calibrate another filter"
            );
            return Err((at(name), ConfigFault::Value { why }));
        };
        // The reader of experiments has found a value there.
        let sd = state.get("start_sd").and_then(number_of).unwrap_or(0.0);
        priors.push(ParameterPrior { parameter: place, sd });
    }
    priors.sort_by_key(|prior| prior.parameter);
    Ok(priors)
}

/// The filters, by their places, in groups of the same priors.
pub(super) fn groups(
    document: &Table,
    parameters: &[DeviceParameter],
) -> Result<Vec<Vec<usize>>, PriorRefusal> {
    let mut groups: Vec<(Vec<ParameterPrior>, Vec<usize>)> = Vec::new();
    for filter in 0..filters(document).len() {
        let priors = priors(document, parameters, filter)?;
        match groups.iter_mut().find(|(of, _)| *of == priors) {
            Some((_, places)) => places.push(filter),
            None => groups.push((priors, vec![filter])),
        }
    }
    Ok(groups.into_iter().map(|(_, places)| places).collect())
}

/// Leaves only these filters in an experiment.
pub(super) fn only(document: &mut Table, places: &[usize]) {
    let filters = document.get_mut("estimate").and_then(|estimate| estimate.get_mut("filter"));
    if let Some(filters) = filters.and_then(Toml::as_array_mut) {
        let mut place = 0..;
        filters.retain(|_| place.next().is_some_and(|place| places.contains(&place)));
    }
}

impl ParameterPrior {
    /// The keys of the device's table that stand for the parameter.
    pub(super) fn keys(self, document: &Table, parameters: &[DeviceParameter]) -> Vec<Key> {
        let written = parameters.get(self.parameter).map_or(&[][..], |parameter| parameter.written);
        written.iter().flat_map(|(key, _)| expanded(document, key)).collect()
    }

    /// Draws the parameter of one run and puts it into the truth: about what the filters are told.
    pub(super) fn draw(
        self,
        (truth, told): (&mut Table, &Table),
        parameters: &[DeviceParameter],
        (seed, run): (u64, u64),
    ) -> Result<Option<DrawnDeviation>, PriorRefusal> {
        let Some(parameter) = parameters.get(self.parameter) else { return Ok(None) };
        let deviation = self.sd * Draw::of_prior(seed, run, self.parameter).normal();
        for (place, (written, power)) in parameter.written.iter().enumerate() {
            let keys = expanded(told, written);
            for key in &keys {
                let value = match (get(told, key), parameter.is_factor()) {
                    (Some(value), true) => scaled(value, raised(1.0 + deviation, *power)),
                    (value, false) => added(value, deviation, parameter.unit),
                    (None, true) if place > 0 => continue,
                    (None, true) => None,
                };
                let Some(value) = value else {
                    let name = parameter.name;
                    let why = format!(
                        "the filter's state `{name}` is drawn as a part of this, and the device's table has no number here; write it out"
                    );
                    return Err((key.clone(), ConfigFault::Value { why }));
                };
                put(truth, key, value).map_err(|fault| (key.clone(), fault))?;
            }
        }
        Ok(Some(DrawnDeviation { name: parameter.name.into(), deviation }))
    }
}

/// A key below the device's table, with `*` for every entry of a table.
fn expanded(document: &Table, written: &str) -> Vec<Key> {
    let mut tables = document.get("device").and_then(Toml::as_table).into_iter().flatten();
    let Some((device, table)) = tables.find(|(name, _)| *name != CORRELATION) else { return Vec::new() };
    let Some(below) = Key::parse(written) else { return Vec::new() };
    let mut found = vec![(Key::from("device").child(device), Some(table))];
    for step in below.steps() {
        found = found
            .into_iter()
            .flat_map(|(key, value)| -> Vec<(Key, Option<&Toml>)> {
                match step {
                    KeyStep::Name(name) if name == "*" => value
                        .and_then(Toml::as_table)
                        .into_iter()
                        .flatten()
                        .map(|(name, value)| (key.clone().child(name), Some(value)))
                        .collect(),
                    KeyStep::Name(name) => vec![(key.child(name), value.and_then(|v| v.get(name.as_str())))],
                    KeyStep::Index(index) => vec![(key.index(*index), value.and_then(|v| v.get(*index)))],
                }
            })
            .collect();
    }
    found.into_iter().map(|(key, _)| key).collect()
}

/// A number in SI.
#[allow(clippy::cast_precision_loss)] // no count of samples stands here
fn number_of(value: &Toml) -> Option<f64> {
    match value {
        Toml::String(text) => Value::parse(text).ok().map(|value| value.si()),
        Toml::Float(number) => Some(*number),
        Toml::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

/// A factor to a power, by multiplications alone: the same on every machine.
fn raised(factor: f64, power: i32) -> f64 {
    let product = (0..power.unsigned_abs()).fold(1.0, |product, _| product * factor);
    if power < 0 { 1.0 / product } else { product }
}

/// A value times a factor, in its own unit.
fn scaled(value: &Toml, factor: f64) -> Option<Toml> {
    let Toml::String(text) = value else { return Some(Toml::Float(number_of(value)? * factor)) };
    let value = Value::parse(text).ok()?;
    let (number, unit) = value.parts();
    let number = number.parse::<f64>().ok()? * factor;
    Some(Toml::String(format!("{number:?} {unit}").trim_end().to_owned()))
}

/// A value and what is added to it, both in a unit of the SI; what is not there is 0.
fn added(value: Option<&Toml>, more: f64, unit: &str) -> Option<Toml> {
    let before = match value {
        Some(value) => number_of(value)?,
        None => 0.0,
    };
    Some(Toml::String(format!("{:?} {unit}", before + more)))
}

#[cfg(test)]
mod tests {
    use super::*;

    static PARAMETERS: [DeviceParameter; 4] = [
        DeviceParameter::factor("stiffness").written(&[("resonator.stiffness", 1)]),
        DeviceParameter::volts("offset").written(&[("readout.offset", 1)]),
        DeviceParameter::factor("gap").written(&[("electrodes.*.gap", 1)]),
        DeviceParameter::factor("drive_gain")
            .written(&[("resonator.stiffness", -2), ("carrier.amplitude", -1)]),
    ];

    fn document(states: &[&str]) -> Table {
        let filters: Vec<String> =
            states.iter().map(|states| format!("[[estimate.filter]]\nstates = {states}\n")).collect();
        let filters = filters.concat();
        format!(
            "[device.own]\nresonator = {{ stiffness = \"2.0 N m\" }}\nreadout = {{}}\n\
             electrodes = {{ a = {{ gap = \"10.0 um\" }}, b = {{ gap = \"20.0 um\" }} }}\n{filters}"
        )
        .parse()
        .unwrap()
    }

    /// What a prior makes of the truth, and the deviation.
    fn drawn(states: &str) -> (Table, f64) {
        let told = document(&[states]);
        let mut truth = told.clone();
        let [prior] = priors(&told, &PARAMETERS, 0).unwrap()[..] else { panic!("{states}") };
        let drawn = prior.draw((&mut truth, &told), &PARAMETERS, (1, 2)).unwrap().unwrap();
        (truth, drawn.deviation)
    }

    fn text(document: &Table, key: &str) -> String {
        get(document, &Key::parse(key).unwrap()).unwrap().as_str().unwrap().to_owned()
    }

    #[test]
    fn filters_of_the_same_priors_are_a_group() {
        let document = document(&[
            "{}",
            "{ stiffness = { start_sd = \"1 %\" } }",
            "{ stiffness = { start_sd = \"2 %\" } }",
            "{ stiffness = { start_sd = 0.01, drift = \"1e-7 1/s\" } }",
            "{}",
        ]);
        assert_eq!(groups(&document, &PARAMETERS).unwrap(), [vec![0, 4], vec![1, 3], vec![2]]);
        let mut some = document;
        only(&mut some, &[1, 4]);
        assert_eq!(filters(&some).len(), 2);
        assert!(filters(&some)[1]["states"].as_table().unwrap().is_empty());
    }

    #[test]
    fn a_factor_scales_its_keys_and_an_offset_is_added() {
        let (truth, deviation) = drawn("{ stiffness = { start_sd = \"1 %\" } }");
        assert!(deviation != 0.0 && deviation.abs() < 0.05);
        assert_eq!(
            text(&truth, "device.own.resonator.stiffness"),
            format!("{:?} N m", 2.0 * (1.0 + deviation))
        );
        let (truth, deviation) = drawn("{ offset = { start_sd = \"10 mV\" } }");
        assert!(deviation != 0.0 && deviation.abs() < 0.05);
        assert_eq!(text(&truth, "device.own.readout.offset"), format!("{deviation:?} V"));
        let (truth, deviation) = drawn("{ gap = { start_sd = \"1 %\" } }");
        assert_eq!(text(&truth, "device.own.electrodes.a.gap"), format!("{:?} um", 10.0 * (1.0 + deviation)));
        assert_eq!(text(&truth, "device.own.electrodes.b.gap"), format!("{:?} um", 20.0 * (1.0 + deviation)));
        // What acts by the square of a voltage; the carrier is not in the table.
        let (truth, deviation) = drawn("{ drive_gain = { start_sd = \"1 %\" } }");
        let square = (1.0 + deviation) * (1.0 + deviation);
        assert_eq!(text(&truth, "device.own.resonator.stiffness"), format!("{:?} N m", 2.0 * (1.0 / square)));
        assert!(get(&truth, &Key::from("device.own.carrier")).is_none());
    }

    #[test]
    fn a_parameter_without_a_key_is_refused_by_its_name() {
        let document = document(&["{ colour = { start_sd = \"1 %\" } }"]);
        let (key, fault) = groups(&document, &PARAMETERS).unwrap_err();
        assert_eq!(key.to_string(), "estimate.filter[0].states.colour");
        assert!(fault.to_string().contains("stands for `colour`"), "{fault}");
    }
}

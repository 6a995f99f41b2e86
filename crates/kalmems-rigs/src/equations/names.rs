//! The names of a device's own, as estimates, references and tables have them.

use super::table::EquationsTable;
use crate::StateDensity;
use crate::config::{ConfigError, ConfigFault, ExpectedEntry, Experiment, Key, Sign, Values};
use crate::estimate::{DeviceParameter, StateName};
use crate::evaluate::ValueState;
use crate::simulate::SimulatedColumn;
use crate::units::{Interner, Kind, name};
use kalmems_equations::{Device, Named, vector_elements};

/// The kind of a name's unit.
pub fn kind_of(named: &Named) -> &'static Kind {
    Kind::of_unit(named.unit, &named.unit_text)
}

/// The states, as a trajectory has them.
pub fn states(device: &Device) -> Vec<StateName> {
    as_in_a_trajectory(device.states())
}

/// What follows from the states, as a trajectory has it.
pub fn quantities(device: &Device) -> Vec<StateName> {
    as_in_a_trajectory(device.quantities())
}

fn as_in_a_trajectory(all: &[Named]) -> Vec<StateName> {
    all.iter().map(|named| (name(&named.name), kind_of(named).ending(), kind_of(named))).collect()
}

/// The states, as tables of values name them.
pub fn entries(device: &Device) -> Vec<ExpectedEntry> {
    let of = |named: &Named| ExpectedEntry { name: name(&named.name), kind: kind_of(named), sign: Sign::Any };
    device.states().iter().map(of).collect()
}

/// Their standard deviations, as tables of values name them.
pub fn deviations(device: &Device) -> Vec<ExpectedEntry> {
    let of = |entry: ExpectedEntry| ExpectedEntry {
        kind: entry.kind.deviation(),
        sign: Sign::NotNegative,
        ..entry
    };
    entries(device).into_iter().map(of).collect()
}

/// The densities of the noises of the rates of all states, in the order of the table.
pub fn densities(table: &EquationsTable, device: &Device) -> Vec<ExpectedEntry> {
    let called = |named: &Named| {
        let other = table.noise_keys.iter().find(|(_, state)| *state == &*named.name);
        other.map_or_else(|| name(&named.name), |(key, _)| *key)
    };
    let of = |named: &Named| ExpectedEntry {
        name: called(named),
        kind: kind_of(named).drift(),
        sign: Sign::NotNegative,
    };
    device.states().iter().map(of).collect()
}

/// The same with what wanders by them.
pub fn state_densities(table: &EquationsTable, device: &Device) -> Vec<StateDensity> {
    let of = |(named, entry): (&Named, ExpectedEntry)| {
        let wanders = name(&format!("`{}`", named.name));
        StateDensity { entry, wanders, unit: name(&kind_of(named).dimension.to_string()) }
    };
    device.states().iter().zip(densities(table, device)).map(of).collect()
}

/// Columns of a recording, one for each name: `x_m`.
pub fn channels(all: &[Named]) -> Vec<SimulatedColumn> {
    let of = |named: &Named| SimulatedColumn {
        meaning: name(&named.name),
        column: name(&format!("{}_{}", named.name, kind_of(named).ending())),
    };
    all.iter().map(of).collect()
}

/// The column of a recording that says how long before its row an event was: `crossing_ago_s`.
pub fn event_channel(named: &Named) -> SimulatedColumn {
    SimulatedColumn { meaning: name(&named.name), column: name(&format!("{}_ago_s", named.name)) }
}

/// What a reference may know: every state that is stated and every lag, but those that come round, of which a reference would have to know
/// the turns, and the quantities that follow from them.
pub fn values(table: &EquationsTable, device: &Device) -> &'static [ValueState] {
    static KNOWN: Interner<[ValueState]> = Interner::new();
    let (own, followers) = device.states().split_at(device.own_states());
    let lags = followers.iter().filter(|named| table.lag.get(&named.name).is_some());
    let states: Vec<&Named> = own.iter().chain(lags).collect();
    let sine = table.sine.as_ref();
    let rate_of = |named: &Named| {
        if let Some(sine) = sine.filter(|sine| *sine.of == *named.name) {
            return sine.rate.as_deref().map(name);
        }
        let text = table.derivative.get(&named.name)?.trim();
        states.iter().find(|state| *state.name == *text).map(|state| name(&state.name))
    };
    let of =
        |named: &&Named| ValueState { name: name(&named.name), kind: kind_of(named), rate: rate_of(named) };
    let comes_round = |named: &&&Named| table.cyclic.get(&named.name).is_some();
    let quantities: Vec<&Named> = device.quantities().iter().collect();
    let states = states.iter().filter(|named| !comes_round(named));
    // Of a sine the quantity is what the device is for.
    let mut values: Vec<ValueState> = match sine {
        Some(_) => quantities.iter().chain(states).map(of).collect(),
        None => states.chain(&quantities).map(of).collect(),
    };
    values.sort_by_key(|value| table.answer.as_deref() != Some(value.name));
    KNOWN.get(&values, || values.clone().into())
}

/// The parameters that a filter may hold as uncertain. Each is a factor on what the table says; `added` are those whose
/// deviation is in their own unit.
pub fn parameters((table, device): (&EquationsTable, &Device), added: &[bool]) -> &'static [DeviceParameter] {
    static KNOWN: Interner<[DeviceParameter]> = Interner::new();
    static WRITTEN: Interner<[(&'static str, i32)]> = Interner::new();
    let one = |(place, parameter): (usize, &kalmems_equations::Parameter)| {
        let own = name(&parameter.named.name);
        let keys = written(table, own);
        let written = WRITTEN.get(&keys, || keys.clone().into());
        let all = if added.get(place).copied().unwrap_or(false) {
            let kind = kind_of(&parameter.named);
            DeviceParameter { kind, unit: kind.ending(), drift: kind.drift(), ..DeviceParameter::factor(own) }
        } else {
            DeviceParameter::factor(own)
        };
        all.written(written)
    };
    let all: Vec<DeviceParameter> = device.parameters().iter().enumerate().map(one).collect();
    KNOWN.get(&all, || all.clone().into())
}

/// Where a parameter stands below the device's table, with the power of it there.
pub fn written(table: &EquationsTable, parameter: &'static str) -> Vec<(&'static str, i32)> {
    let own = || vec![(name(&format!("parameters.{parameter}")), 1)];
    table.keys.map_or_else(own, |keys| keys(parameter))
}

/// The values of a table, of which each may be left out. A key may be that of a vector, `x[1..6]`, all of whose elements have the value then.
pub(super) fn some(
    experiment: &Experiment,
    at: &Key,
    values: &Values,
    entries: &[ExpectedEntry],
) -> Result<Vec<Option<f64>>, ConfigError> {
    let mut all = vec![None; entries.len()];
    for (key, value) in values {
        let at = || at.clone().child(key);
        let refuse = |why| experiment.error(at(), ConfigFault::Value { why });
        for element in vector_elements(key).map_err(refuse)? {
            let Some(place) = entries.iter().position(|entry| entry.name == element.name) else {
                let known = entries.iter().map(|entry| entry.name);
                return Err(experiment.error(at(), ConfigFault::unknown_key(&element.name, known)));
            };
            let read = experiment.value(at(), value, entries[place].kind, entries[place].sign)?;
            if all[place].replace(read).is_some() {
                return Err(refuse(format!("`{}` has a value already", element.name)));
            }
        }
    }
    Ok(all)
}

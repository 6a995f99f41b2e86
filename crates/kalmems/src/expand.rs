//! An experiment with its device written out as equations, to be changed by the reader.

use crate::config::{ConfigError, ConfigFault, Experiment, Key, RecordingRole};
use crate::rigs::{Expansion, Workbench};
use crate::stated_start::write_start_sds;
use std::collections::BTreeSet;
use toml::{Table, Value};

/// An experiment whose device is `[device.equations]`.
#[derive(Clone, Debug)]
pub struct Expanded {
    /// The file, with comments on what is not as it was.
    pub text: String,
    /// What the experiment had and the equations have not, in sentences.
    pub notes: Vec<String>,
}

/// Keys of an estimate that are about a device's own ways, and those that are about angles.
const OF_ESTIMATE: [&str; 1] = ["crossings"];
const OF_ANGLES: [&str; 3] = ["first_peak", "first_peak_y", "parts"];
/// Those of a filter whose meaning the equations have in themselves or as events.
const OF_FILTER: [&str; 2] = ["demodulator", "threshold"];
/// Those that make another filter of it, which equations do not have.
const OTHER_FILTER: [&str; 1] = ["variant"];
/// The state of a readout's low-passes, which follow the others where they are lags.
const LAGS: &str = "demodulator";
/// Those of both that are written as events, where the device has them.
const AS_EVENTS: [&str; 2] = ["crossings", "threshold"];
/// Tables that go with a device's own identification or streams; a stream of angles has equations too.
const OF_DEVICE: [&str; 2] = ["identify", "stream"];

/// Writes an experiment with its rig's device as equations: its recordings and filters go with it as far as equations have what they
/// ask for.
///
/// # Errors
///
/// A device that is not written as equations, and an experiment that is none any more with them.
pub fn expand(workbench: &Workbench, experiment: &Experiment) -> Result<Expanded, ConfigError> {
    let rig = workbench.rig(experiment)?;
    let expansion = rig.expanded(experiment)?;
    // What its rig estimates is to be estimated here; of an experiment without filters that is nothing.
    let wanted = rig.wanted(experiment).unwrap_or_default();
    let unwritten = |why: String| experiment.error(Key::default(), ConfigFault::Value { why });
    let text = experiment.to_toml().map_err(|e| unwritten(e.to_string()))?;
    let mut document: Table = text.parse().map_err(|e: toml::de::Error| unwritten(e.to_string()))?;
    let mut notes = expansion.notes.clone();
    document.remove("device");
    let has_angles = part_of(&expansion, "angles").is_some();
    for name in OF_DEVICE.into_iter().filter(|name| *name != "stream" || !has_angles) {
        if document.remove(name).is_some() {
            notes.push(format!(
                "The table `[{name}]` was left out: it is about the device's own channels and parameters."
            ));
        }
    }
    recordings(&mut document, &wanted, part_of(&expansion, "feedthrough").is_some());
    let training = experiment.identify.iter().flat_map(|identify| &identify.training);
    let training: Vec<String> = training.map(|label| format!("`{label}`")).collect();
    if !training.is_empty() {
        notes.push(format!(
            "Its rig leaves the records {} to the identification; here they are estimated like the others.",
            training.join(", ")
        ));
    }
    references(&mut document, &expansion, &mut notes);
    // The table of the equations states no uncertainty that a state could start with.
    write_start_sds(&mut document, experiment, rig.parameters(experiment))?;
    estimate(&mut document, &expansion, &mut notes);
    let (mut document, left_out) = keep_filters_that_run(workbench, experiment, &document, &expansion);
    notes.extend(left_out);
    if let Some(why) = refused_simulation(workbench, experiment, &document, &expansion) {
        notes.push(format!(
            "Equations cannot be simulated by the table `[simulate]` as it stood ({why}): it is without an input here; write \
             `[simulate.drive.inputs]`."
        ));
        leave_alone(&mut document, &expansion);
    }
    Ok(Expanded { text: written(&document, &expansion, &notes), notes })
}

/// The file: what is said first, the device as its rig wrote it, and the rest.
fn written(document: &Table, expansion: &Expansion, notes: &[String]) -> String {
    let says: String = notes.iter().flat_map(|note| ["# ", note, "\n"]).collect();
    let (mut head, mut rest) = (document.clone(), document.clone());
    head.retain(|_, value| !matches!(value, Value::Table(_) | Value::Array(_)));
    rest.retain(|_, value| matches!(value, Value::Table(_) | Value::Array(_)));
    // Tables of texts, numbers and lists can be written.
    let of = |table: &Table| toml::to_string(table).unwrap_or_default();
    format!("{says}{}{}\n{}", of(&head), expansion.text, of(&rest))
}

/// Leaves the recordings that are estimated, whatever the rig took them for, and those with the bias off that tell what is taken off their signals.
fn recordings(document: &mut Table, wanted: &[usize], has_feedthrough: bool) {
    let Some(Value::Array(recordings)) = document.get_mut("recording") else { return };
    let keeps = |recording: &Value| {
        let role = recording.get("role").and_then(Value::as_str);
        let of_bias = [RecordingRole::BiasOn, RecordingRole::BiasOff];
        let mut of_bias = of_bias.into_iter().filter(|_| has_feedthrough);
        of_bias.find(|known| role == Some(known.key()))
    };
    let mut place = 0..;
    recordings.retain(|recording| {
        let is_wanted = place.next().is_some_and(|place| wanted.contains(&place));
        is_wanted || keeps(recording) == Some(RecordingRole::BiasOff)
    });
    let others = recordings.iter_mut().filter(|recording| keeps(recording).is_none());
    for recording in others.filter_map(Value::as_table_mut) {
        recording.insert("role".to_owned(), Value::String(RecordingRole::Test.key().to_owned()));
    }
}

/// Leaves what references know of the states and the quantities that the equations have.
fn references(document: &mut Table, expansion: &Expansion, notes: &mut Vec<String>) {
    let answers = ["states", "quantities"].map(|table| part_of(expansion, table));
    let is_answer = |name: &str| answers.iter().flatten().any(|table| table.contains_key(name));
    let Some(Value::Array(recordings)) = document.get_mut("recording") else { return };
    let mut left_out = BTreeSet::new();
    for recording in recordings.iter_mut().filter_map(Value::as_table_mut) {
        let channels = recording.get_mut("reference").and_then(|reference| reference.get_mut("channels"));
        let Some(channels) = channels.and_then(Value::as_table_mut) else { continue };
        left_out.extend(channels.keys().filter(|name| !is_answer(name)).cloned());
        channels.retain(|name, _| is_answer(name));
        if channels.is_empty() {
            recording.remove("reference");
        }
    }
    for name in left_out {
        notes.push(format!(
            "References of `{name}` were left out: the equations have no state and no quantity of that name."
        ));
    }
}

/// A table of the device's equations.
fn part_of(expansion: &Expansion, table: &str) -> Option<Table> {
    let device: Table = expansion.text.parse().ok()?;
    device.get("device")?.get("equations")?.get(table)?.as_table().cloned()
}

fn estimate(document: &mut Table, expansion: &Expansion, notes: &mut Vec<String>) {
    let Some(Value::Table(estimate)) = document.get_mut("estimate") else { return };
    let has_angles = part_of(expansion, "angles").is_some();
    let of_angles = OF_ANGLES.into_iter().filter(|_| !has_angles);
    let left_out = OF_ESTIMATE.into_iter().chain(of_angles);
    let mut removed: Vec<&str> = left_out.filter(|key| estimate.remove(*key).is_some()).collect();
    rename_noise(estimate, expansion);
    let mut own_sd = false;
    if let Some(Value::Array(filters)) = estimate.get_mut("filter") {
        let mut index = 0..;
        filters.retain_mut(|filter| {
            let (Some(index), Some(filter)) = (index.next(), filter.as_table_mut()) else { return false };
            if let Some(key) = OTHER_FILTER.into_iter().find(|key| is_other(filter, key)) {
                let name = filter.get("name").and_then(Value::as_str).unwrap_or_default();
                notes.push(format!("The filter `{name}` was left out: equations have none with `{key}`."));
                return false;
            }
            removed.extend(OF_FILTER.into_iter().filter(|key| filter.remove(*key).is_some()));
            own_sd |= expand_filter(filter, index, expansion);
            true
        });
    }
    if !expansion.events.is_empty() {
        estimate.insert("events".to_owned(), Value::Table(expansion.events.clone()));
        removed.retain(|key| !AS_EVENTS.contains(key));
    }
    if own_sd {
        notes.push(
            "A start from the signal says itself how good it is: `start_sd` was left out with `start = \"from_signal\"`.".to_owned(),
        );
    }
    removed.sort_unstable();
    removed.dedup();
    if !removed.is_empty() {
        let keys: Vec<String> = removed.iter().map(|key| format!("`{key}`")).collect();
        notes.push(format!("Equations know nothing of {}: left out.", keys.join(", ")));
    }
}

/// Whether a key makes another filter of one; a variant that takes all of the signal does not.
fn is_other(filter: &mut Table, key: &str) -> bool {
    match filter.get(key).cloned() {
        Some(Value::String(word)) if word == "full" => filter.remove(key).is_none(),
        Some(Value::Boolean(false)) | None => false,
        Some(_) => true,
    }
}

/// One filter as one of equations; whether a `start_sd` was left out that its rig has for a start from the signal.
fn expand_filter(filter: &mut Table, index: usize, expansion: &Expansion) -> bool {
    rename_noise(filter, expansion);
    rename_channels(filter, expansion);
    for key in ["start", "start_sd"] {
        if let Some(Value::Table(states)) = filter.get_mut(key) {
            states.remove(LAGS);
        }
    }
    if let Some(events) = expansion.filter_events.get(index).filter(|events| !events.is_empty()) {
        filter.insert("events".to_owned(), Value::Table(events.clone()));
    }
    if !filter.get("start").is_none_or(Value::is_str) {
        return false;
    }
    // There it would say how far from rest the device is, and not how well its rig finds the start, unless the equations say that.
    let oscillation = part_of(expansion, "oscillation");
    let says = oscillation.and_then(|table| table.get("starts").and_then(Value::as_bool));
    says != Some(true) && filter.remove("start_sd").is_some()
}

fn rename_noise(table: &mut Table, expansion: &Expansion) {
    let Some(Value::Table(noise)) = table.get_mut("process_noise") else { return };
    for (old, new) in &expansion.noise {
        if let Some(density) = noise.remove(*old) {
            noise.insert((*new).to_owned(), density);
        }
    }
}

fn rename_channels(filter: &mut Table, expansion: &Expansion) {
    let Some(Value::Array(channels)) = filter.get_mut("channels") else { return };
    for channel in channels {
        let renamed = expansion.channels.iter().find(|(old, _)| channel.as_str() == Some(old));
        if let Some((_, new)) = renamed {
            *channel = Value::String(new.clone());
        }
    }
}

/// Why the equations cannot be simulated as the document says, where they cannot.
fn refused_simulation(
    workbench: &Workbench,
    experiment: &Experiment,
    document: &Table,
    expansion: &Expansion,
) -> Option<String> {
    document.get("simulate")?;
    let parsed = workbench.parse(&written(document, expansion, &[]), experiment.path());
    let simulated = parsed.and_then(|parsed| Ok((workbench.rig(&parsed)?, parsed)));
    let fault = match simulated {
        Ok((rig, parsed)) => rig.simulate(&parsed).err()?.to_string(),
        Err(error) => error.to_string(),
    };
    // The line is one of a file that nobody has seen.
    let (_, why) = fault.split_once(": ")?;
    Some(why.replace('\n', " "))
}

/// What of a simulation is of any device.
const OF_ANY_SIMULATION: [&str; 6] =
    ["duration", "sampling_rate", "integration_rate", "start", "seed", "noise"];

/// Leaves of the simulation what any device has, from where its states start, without an input.
fn leave_alone(document: &mut Table, expansion: &Expansion) {
    let [states, inputs] = ["states", "inputs"].map(|table| part_of(expansion, table).unwrap_or_default());
    let Some(Value::Table(simulate)) = document.get_mut("simulate") else { return };
    simulate.retain(|key, _| OF_ANY_SIMULATION.contains(&key));
    if let Some(Value::Table(start)) = simulate.get_mut("start") {
        start.retain(|state, _| states.contains_key(state));
    }
    let none: Table = inputs.keys().map(|input| (input.clone(), Value::from("none"))).collect();
    let drive: Table = [("inputs".to_owned(), Value::Table(none))].into_iter().collect();
    simulate.insert("drive".to_owned(), Value::Table(drive));
}

/// The document without the filters that equations refuse, and why they were left out.
fn keep_filters_that_run(
    workbench: &Workbench,
    experiment: &Experiment,
    document: &Table,
    expansion: &Expansion,
) -> (Table, Vec<String>) {
    let filters =
        || document.get("estimate").and_then(|estimate| estimate.get("filter")).and_then(Value::as_array);
    let Some(filters) = filters().cloned() else { return (document.clone(), Vec::new()) };
    let with = |filters: Vec<Value>| {
        let mut document = document.clone();
        if let Some(Value::Table(estimate)) = document.get_mut("estimate") {
            estimate.insert("filter".to_owned(), Value::Array(filters));
        }
        document
    };
    let (mut kept, mut left_out) = (Vec::new(), Vec::new());
    for filter in filters {
        let name = filter.get("name").and_then(Value::as_str).unwrap_or_default().to_owned();
        let text = written(&with(vec![filter.clone()]), expansion, &[]);
        let runs = workbench.parse(&text, experiment.path()).and_then(|parsed| {
            let rig = workbench.rig(&parsed)?;
            match rig.wanted(&parsed) {
                // An experiment that is simulated first has no recording yet; all else is looked at before that.
                Err(error) if parsed.recordings.is_empty() && error.place.key == Key::from("recording") => {
                    Ok(())
                }
                wanted => wanted.map(|_| ()),
            }
        });
        match runs {
            Ok(()) => kept.push(filter),
            Err(error) => {
                let why = error.fault.to_string().replace('\n', " ");
                left_out
                    .push(format!("The filter `{name}` was left out: `{}`: {why}.", error.place.key.last()));
            }
        }
    }
    if !kept.is_empty() {
        return (with(kept), left_out);
    }
    // An estimate without filters is none; the device is what is asked for.
    let mut without = document.clone();
    without.remove("estimate");
    left_out.push("The table `[estimate]` was left out: none of its filters is left.".to_owned());
    (without, left_out)
}

//! What can be said of a device of one's own before anything is recorded.

use super::names;
use super::own_device::OwnDevice;
use super::short;
use super::sine::SineTable;
use super::table::{EquationsTable, refused};
use crate::config::{ConfigError, Experiment, FilterStart};
use crate::inspect::quantity;
use crate::outlook::{Fact, Outlook, OutlookTopic};
use kalmems_equations::{Mode, Named, vector_elements};
use std::f64::consts::TAU;

/// The outlook of an experiment.
pub fn outlook(experiment: &Experiment) -> Result<Outlook, ConfigError> {
    let own = OwnDevice::of(experiment)?;
    let mut topics = vec![equations(&own)];
    topics.extend(energy(experiment, &own)?);
    let table = experiment.device_in_terms_of::<EquationsTable>()?;
    if let Some(sine) = &table.sine {
        let SineTable { of, offset, amplitude, frequency, phase, .. } = sine;
        let text = format!(
            "`{of}` moves as a sine of the amplitude `{amplitude}` about `{offset}`, whose frequency is `{frequency}` and whose phase is `{phase}`: the signal tells \
             them."
        );
        topics.push(OutlookTopic { title: "Motion", facts: vec![fact("sine", Vec::new(), text)] });
        return Ok(Outlook::of(experiment, "equations", topics));
    }
    topics.push(free_motion(&own));
    topics.push(measurements(experiment, &own)?);
    Ok(Outlook::of(experiment, "equations", topics))
}

fn fact(name: &'static str, values: Vec<f64>, text: String) -> Fact {
    Fact { name, values, text }
}

/// A value in three digits.
fn three_digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// A value with its unit in SI.
fn in_si(value: f64, named: &Named) -> String {
    quantity(three_digits(value), &crate::units::si_text(&named.unit_text))
}

fn equations(own: &OwnDevice) -> OutlookTopic {
    let device = &own.device;
    let mut facts: Vec<Fact> =
        device.typeset().into_iter().map(|line| fact("equation", Vec::new(), line)).collect();
    let notices = device.notices().iter();
    facts.extend(notices.map(|notice| fact("notice", Vec::new(), format!("Look at {notice}"))));
    OutlookTopic { title: "Equations", facts }
}

/// Whether the equations keep the energy that the table states.
fn energy(experiment: &Experiment, own: &OwnDevice) -> Result<Option<OutlookTopic>, ConfigError> {
    let sizes = sizes(experiment, own)?;
    let inputs = vec![1.0; own.device.inputs().len()];
    let found = own.device.check_energy(&sizes, &inputs).map_err(|error| refused(experiment, &error))?;
    Ok(found.map(|check| OutlookTopic {
        title: "Energy",
        facts: vec![fact("energy_imbalance", vec![check.imbalance], check.to_string())],
    }))
}

/// How large the states become, by what the experiment says of their start; 0 where it says nothing.
fn sizes(experiment: &Experiment, own: &OwnDevice) -> Result<Vec<f64>, ConfigError> {
    let device = &own.device;
    let entries = names::entries(device);
    let mut sizes = vec![0.0_f64; entries.len()];
    let simulated = experiment.simulate.iter().map(|simulate| &simulate.start);
    let filters = || experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let started = filters().filter_map(|filter| match &filter.start {
        Some(FilterStart::Values(values)) => Some(values),
        _ => None,
    });
    for values in simulated.chain(started).chain(filters().map(|filter| &filter.start_sd)) {
        for (key, value) in values {
            // What a key cannot stand for is refused where the values are read.
            for element in vector_elements(key).unwrap_or_default() {
                if let Some(place) = entries.iter().position(|entry| entry.name == element.name) {
                    sizes[place] = sizes[place].max(value.value().si().abs());
                }
            }
        }
    }
    // The rate of a state is as large as a free motion of that size makes it.
    let table = experiment.device_in_terms_of::<EquationsTable>()?;
    let rate = own.natural_hz().map_or(1.0, |hz| TAU * hz);
    for value in names::values(&table, device) {
        let place = |name: &str| device.state(name);
        let Some((of, its_rate)) = place(value.name).zip(value.rate.and_then(place)) else { continue };
        match (sizes[of] > 0.0, sizes[its_rate] > 0.0) {
            (true, false) => sizes[its_rate] = sizes[of] * rate,
            (false, true) => sizes[of] = sizes[its_rate] / rate,
            _ => {}
        }
    }
    Ok(sizes)
}

fn free_motion(own: &OwnDevice) -> OutlookTopic {
    let device = &own.device;
    let mut facts = Vec::new();
    if own.rests {
        let each = device.states().iter().zip(&own.rest);
        let each: Vec<String> =
            each.map(|(named, at)| format!("{} = {}", named.name, in_si(*at, named))).collect();
        let text = format!("Without an input it rests at {}.", each.join(", "));
        facts.push(fact("rest", own.rest.clone(), text));
    } else {
        let text = "No state was found in which all rates vanish without an input.".to_owned();
        facts.push(fact("rest", Vec::new(), text));
    }
    let grows = |mode: &Mode| mode.growth > 1e-9 * mode.rate.abs().max(mode.growth.abs());
    for mode in own.modes.iter().filter(|mode| mode.rate >= 0.0) {
        facts.push(if mode.oscillates() {
            let (hz, ratio) = (mode.frequency_hz(), mode.damping_ratio());
            let text = if grows(mode) {
                format!(
                    "A small motion at {} grows by itself: the rest is not stable (damping ratio {}).",
                    quantity(hz, "Hz"),
                    short(ratio)
                )
            } else {
                format!(
                    "A small motion oscillates at {} with a damping ratio of {} (quality factor {}).",
                    quantity(hz, "Hz"),
                    short(ratio),
                    short(0.5 / ratio)
                )
            };
            fact("mode_hz_and_damping_ratio", vec![hz, ratio], text)
        } else if mode.growth == 0.0 {
            let text = "One state, or a sum of states, stays where it is put.".to_owned();
            fact("mode_per_s", vec![0.0], text)
        } else {
            let time_s = mode.growth.abs().recip();
            let what = if grows(mode) { "grows" } else { "decays" };
            let text = format!(
                "A small deviation {what} with a time constant of {}.",
                quantity(three_digits(time_s), "s")
            );
            fact("mode_per_s", vec![mode.growth], text)
        });
    }
    OutlookTopic { title: "Free motion", facts }
}

/// What is measured at rest, and how it depends on the states there.
fn measurements(experiment: &Experiment, own: &OwnDevice) -> Result<OutlookTopic, ConfigError> {
    let device = &own.device;
    let wrong = |error| refused(experiment, &error);
    let inputs = vec![0.0; device.inputs().len()];
    let mut facts = Vec::new();
    for (place, named) in device.measures().iter().enumerate() {
        let readout = device.readout(place, &[]).map_err(wrong)?;
        let mut slopes = vec![0.0; device.states().len()];
        let mut work = readout.work(&own.values);
        let value = readout.linearize(&mut work, &own.rest, &inputs, &mut slopes);
        let seen: Vec<String> = device
            .states()
            .iter()
            .zip(&slopes)
            .filter(|(_, slope)| **slope != 0.0)
            .map(|(state, slope)| {
                format!("{} per {} of {}", short(*slope), state.unit.dimension(), state.name)
            })
            .collect();
        let depends = if seen.is_empty() {
            "to first order it depends on no state there, so that small motions are not seen".to_owned()
        } else {
            format!("it changes by {}", seen.join(" and by "))
        };
        let text = format!("At rest `{}` is {}; {depends}.", named.name, in_si(value, named));
        facts.push(fact("measurement_at_rest", std::iter::once(value).chain(slopes).collect(), text));
    }
    Ok(OutlookTopic { title: "Measurements", facts })
}

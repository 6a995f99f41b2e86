//! The piston mirror before its electrode as differential equations: a phasor whose amplitude, frequency and rest position drift.

use super::PistonMirrorRig;
use super::data::PistonSegment;
use super::settings::{MotionKnowledge, PistonFilterSettings, PistonHardware, PistonSettings};
use super::start::batch_start;
use crate::config::{ConfigError, Experiment, FilterTable, Method};
use crate::recording::SampledRecording;
use crate::units::kind;
use crate::{Expansion, Rig};
use toml::{Table, Value};

/// How far the values that the rig finds may be off in a search of the equations, as a part of the amplitude and of the frequency.
const AMPLITUDE_OFF: f64 = 0.1;
const FREQUENCY_OFF: f64 = 0.01;

/// Of each filter, `start_about` and `start_sd`.
type FilterStarts = Vec<Option<[Table; 2]>>;

/// About where each filter that starts from the signal starts, by the first samples of the first recording that is estimated; whether one
/// of them holds the rest position.
fn filter_starts(experiment: &Experiment, hardware: &PistonHardware) -> Result<(FilterStarts, bool), String> {
    let filters = || experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let wanted = |filter: &&FilterTable| {
        filter.starts_from_signal() && !matches!(filter.method, Method::DirectInversion | Method::LockIn)
    };
    if !filters().any(|filter| wanted(&filter)) {
        return Ok((Vec::new(), false));
    }
    let settings = PistonSettings::of(experiment).map_err(|e| e.to_string())?;
    let [amplitude, frequency, offset] = match experiment.recordings[..] {
        [] => simulated_start(experiment).ok_or("it has no recording yet")?,
        [..] => recorded_start(experiment, hardware)?,
    };
    let table = |entries: &[(&str, f64, &str)]| -> Table {
        let of = |(name, value, unit): &(&str, f64, &str)| {
            ((*name).to_owned(), Value::from(format!("{value:?} {unit}")))
        };
        entries.iter().map(of).collect()
    };
    let about =
        table(&[("amplitude", amplitude, "m"), ("frequency", frequency, "Hz"), ("offset", offset, "m")]);
    let one = |(filter, settings): (&FilterTable, &PistonFilterSettings)| {
        if !wanted(&filter) {
            return None;
        }
        // A filter of three states has no rate of the amplitude.
        let is_steady = matches!(settings.motion, MotionKnowledge::Steady { .. });
        let sd = table(&[
            ("amplitude", AMPLITUDE_OFF * amplitude, "m"),
            ("frequency", FREQUENCY_OFF * frequency, "Hz"),
            ("offset", AMPLITUDE_OFF * amplitude, "m"),
            ("amplitude_rate", if is_steady { 0.0 } else { amplitude }, "m/s"),
        ]);
        Some([about.clone(), sd])
    };
    let is_steady = |filter: &PistonFilterSettings| matches!(filter.motion, MotionKnowledge::Steady { .. });
    Ok((filters().zip(&settings.filters).map(one).collect(), settings.filters.iter().any(is_steady)))
}

/// Amplitude, frequency and rest position in SI of a motion that is simulated, where the experiment states them.
fn simulated_start(experiment: &Experiment) -> Option<[f64; 3]> {
    let start = &experiment.simulate.as_ref()?.start;
    let of = |name: &str| start.get(name).map(|value| value.value().si());
    Some([of("amplitude")?, of("frequency")?, of("offset")?])
}

/// The same by the first samples of the first recording that is estimated; why they do not tell it.
fn recorded_start(experiment: &Experiment, hardware: &PistonHardware) -> Result<[f64; 3], String> {
    let index = PistonMirrorRig.wanted(experiment).map_err(|e| e.to_string())?.first().copied().unwrap_or(0);
    let layout = PistonMirrorRig.layout(experiment, index).map_err(|e| e.to_string())?;
    let described = experiment.recording(index).map_err(|e| e.to_string())?;
    let recording =
        SampledRecording::read(&experiment.resolve(&described.file), &layout).map_err(|e| e.to_string())?;
    let none = || "it has no samples".to_owned();
    let segment = recording.segments().first().ok_or_else(none)?;
    let column = described.channels.column("signal").ok_or_else(none)?;
    let signal = recording.column_of(column, &kind::CAPACITANCE).map_err(|e| e.to_string())?.of(segment);
    let (time_s, interval_s) = (segment.time.to_vec(), segment.time.interval_s().ok_or_else(none)?);
    let noise_variance = hardware.noise_variance(interval_s);
    let data = PistonSegment { time_s: &time_s, signal, interval_s, noise_variance, motion_hz: None };
    let [amplitude, frequency, _, offset, _] =
        batch_start(&hardware.plates, &data).map_err(|why| why.to_string())?.mean;
    Ok([amplitude, frequency, offset])
}

/// The motion, of which no number of the experiment is a part.
const MOTION: &str = r#"
[device.equations.let]
distance = "offset + amplitude*cos(phase)"
near = "reference_distance/distance"

[device.equations.derivative]
amplitude = "amplitude_rate"
frequency = "0"
phase = "2*pi*frequency"
offset = "0"
amplitude_rate = "0"
"#;

/// What the motion shows besides the signal, where it comes round, and the noise.
const QUANTITIES: &str = r#"
[device.equations.quantities]
position = "distance in m"
velocity = "amplitude_rate*cos(phase) - 2*pi*frequency*amplitude*sin(phase) in m/s"

[device.equations.cyclic]
phase = "2*pi"

[device.equations.noise]
signal = "noise_density^2"
"#;

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = PistonHardware::of(experiment)?;
    let mut all = Expansion {
        noise: ["amplitude", "frequency", "phase", "offset", "amplitude_rate"]
            .map(|name| (name, name))
            .to_vec(),
        ..Expansion::default()
    };
    let states = [
        ("amplitude", "m"),
        ("frequency", "Hz"),
        ("phase", "rad"),
        ("offset", "m"),
        ("amplitude_rate", "m/s"),
    ];
    all.table("states", &states);
    let plates = &hardware.plates;
    // The highest power that there is: a series that goes on with zeros is the same.
    let powers = plates.coefficients.iter().rposition(|c| *c != 0.0).map_or(1, |last| last + 1);
    let names: Vec<String> = (0..powers).map(|k| format!("coefficient_{k}")).collect();
    let mut numbers = vec![("reference_distance", plates.reference_distance, "m")];
    numbers.extend(names.iter().zip(&plates.coefficients).map(|(name, c)| (name.as_str(), *c, "F")));
    numbers.push(("noise_density", hardware.noise_density, "F/sqrt(Hz)"));
    all.numbers("parameters", &numbers);
    all.text.push_str(MOTION);
    let terms = names.iter().enumerate().map(|(k, name)| match k {
        0 => name.clone(),
        1 => format!("{name}*near"),
        k => format!("{name}*near^{k}"),
    });
    let seen = format!("{} in F", terms.collect::<Vec<_>>().join(" + "));
    all.table("measure", &[("signal", seen.as_str())]);
    all.text.push_str(QUANTITIES);
    match filter_starts(experiment, &hardware) {
        Ok((starts, holds_rest)) => {
            all.filter_starts = starts;
            if holds_rest {
                all.notes.push(
                    "A filter of three states holds the rest position that the first samples show; here that is a state without noise."
                        .to_owned(),
                );
            }
        }
        Err(why) => all.notes.push(format!(
            "The search for a start needs to know about where amplitude, frequency and rest position are, and the recording does not tell its \
             rig ({why}): write `start_about` and `start_sd` into each filter that starts from the signal."
        )),
    }
    if hardware.bandwidth_hz.is_some() {
        all.notes.push("The noise beyond half the sampling rate, which a `bandwidth` folds into the samples, is not added.".to_owned());
    }
    if hardware.mechanics.is_some() {
        all.notes.push("The mirror's mechanics and drive (`mirror`) are not part of the equations, as no filter has them.".to_owned());
    }
    Ok(all)
}

//! An offset, a scale and a line between the sensor and the recording as states of a filter.

use crate::devices::{Device, Setting};
use crate::outliers::signals::{Of, Outcome, noise, signals};
use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise};
use std::f64::consts::TAU;

/// A device, its filter's further settings, and the unit of its signal.
type Shown = (&'static str, &'static [(&'static str, &'static str)], &'static str);

const DEVICES: [Shown; 4] = [
    ("shared scanner", &[], "V"),
    ("threshold scanner", &[], "V"),
    ("accelerometer", &[], "V"),
    ("micro-stage", &[("estimate.filter.0.channels", "[\"1A\"]")], "V"),
];

/// Its frequency in Hz, and amplitude, phase and the offset beside it in standard deviations of the noise.
const LINE: [f64; 4] = [700.0, 30.0, 0.4, 10.0];

/// The recording with a line and an offset, and their sizes in the signal's unit.
fn spoilt(experiment: &Experiment, simulated: &ComputedRecording) -> (ComputedRecording, f64) {
    let (mut spoilt, mut sd) = (simulated.clone(), 0.0);
    let [hz, amplitude, phase, offset] = LINE;
    assert!(spoilt.change_recorded(&signals(experiment)[0], |values, times| {
        sd = noise(values);
        for (y, time) in values.iter_mut().zip(times) {
            *y += sd * (amplitude * (TAU * hz * time + phase).cos() + offset);
        }
    }));
    (spoilt, sd)
}

fn first_trajectory(experiment: &Experiment, simulated: &ComputedRecording) -> Trajectory {
    let rig = published().rig(experiment).unwrap();
    let recording = simulated.recorded(&rig.layout(experiment, 0).unwrap()).unwrap();
    rig.estimate(experiment, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories.swap_remove(0)
}

/// With a line and an offset as states the filter of each of these devices says what it says of the recording without them, and what they are.
#[test]
fn a_line_and_an_offset_are_found_as_states_of_four_devices() {
    for (name, settings, unit) in DEVICES {
        // Crossings are sought in the signal as it is recorded.
        let recorded = |settings: &[Setting]| {
            Device::named(name).recorded_without(settings, &["estimate.filter.0.threshold"], 660)
        };
        let settings: Vec<Setting> =
            settings.iter().map(|(key, value)| (*key, (*value).to_owned())).collect();
        let (experiment, simulated) = recorded(&settings);
        let clean = Outcome::of(&experiment, &simulated);
        let (spoilt, sd) = spoilt(&experiment, &simulated);
        let without = Outcome::of(&experiment, &spoilt);
        let readout = format!(
            "{{ offset = {{ start_sd = \"{:e} {unit}\" }}, lines = [{{ frequency = \"{} Hz\", start_sd = \"{:e} {unit}\" }}] }}",
            30.0 * sd,
            LINE[0],
            50.0 * sd
        );
        let mut told = settings.clone();
        told.push(("estimate.filter.0.readout", readout));
        let (experiment, _) = recorded(&told);
        let with = Outcome::of(&experiment, &spoilt);
        println!(
            "{name}: {:.3e} clean, {:.3e} without, {:.3e} with, {}",
            clean.error(),
            without.error(),
            with.error(),
            with.refused
        );
        let found = first_trajectory(&experiment, &spoilt);
        let [_, amplitude, phase, offset] = LINE;
        let truth = [
            ("line_cosine", amplitude * phase.cos()),
            ("line_sine", -amplitude * phase.sin()),
            ("readout_offset", offset),
        ];
        for (state, truth) in truth {
            let state = found.state(state).unwrap();
            let (mean, of_mean) = (state.mean.last().unwrap() / sd, state.sd.last().unwrap() / sd);
            println!("    {}: {mean:.3} ± {of_mean:.3} of {truth:.3}", state.name);
            assert!(
                (mean - truth).abs() < 4.0 * of_mean,
                "{name}, {}: {mean} ± {of_mean} of {truth}",
                state.name
            );
        }
        assert!(with.passes(), "{name}: {:?}", with.first().map(|first| first.grade));
        assert!(!without.passes(), "{name} passes with a line");
    }
}

/// A scale is a gain where the gain scales all of the signal. With parameters as states the motion is stepped by Runge and Kutta's method and without
/// exactly, so that the two are alike and not the same.
#[test]
fn a_scale_of_the_readout_is_the_deviation_of_the_gain() {
    let of = Of::Published("micro-stage");
    let one = ("estimate.filter.0.channels", "[\"1A\"]".to_owned());
    let scale = ("estimate.filter.0.readout", "{ scale = { start_sd = \"1 %\" } }".to_owned());
    let gain = ("estimate.filter.0.states", "{ gain = { start_sd = \"1 %\" } }".to_owned());
    let found = [scale, gain].map(|setting| {
        let (experiment, simulated) = of.recorded(&[one.clone(), setting], 661);
        first_trajectory(&experiment, &simulated)
    });
    let [scale, gain] = &found;
    for (a, b) in [("angle", "angle"), ("rate", "rate"), ("readout_scale", "gain")] {
        let (a, b) = (scale.state(a).unwrap(), gain.state(b).unwrap());
        let last = |values: &[f64]| *values.last().unwrap();
        println!(
            "{}: {:e} and {:e}, {:e} and {:e}",
            a.name,
            last(&a.mean),
            last(&b.mean),
            last(&a.sd),
            last(&b.sd)
        );
        assert!((last(&a.sd) / last(&b.sd) - 1.0).abs() < 1e-3, "{}", a.name);
        assert!((last(&a.mean) - last(&b.mean)).abs() < 0.02 * last(&b.sd), "{}", a.name);
    }
}

/// How large the part of the drive that reaches the signal is, in standard deviations of the noise.
const FEEDTHROUGH: f64 = 30.0;

/// With the feedthrough as a state a filter says how much of the drive there is in the signal, and passes; without it, it does not.
#[test]
fn the_feedthrough_of_the_drive_is_found_as_a_state_of_three_devices() {
    for (name, settings, _) in DEVICES.into_iter().filter(|(name, ..)| *name != "accelerometer") {
        let recorded = |settings: &[Setting]| {
            Device::named(name).recorded_without(settings, &["estimate.filter.0.threshold"], 662)
        };
        let settings: Vec<Setting> =
            settings.iter().map(|(key, value)| (*key, (*value).to_owned())).collect();
        let (experiment, mut spoilt) = recorded(&settings);
        let mut drive = Vec::new();
        assert!(spoilt.clone().change_recorded("drive", |volts, _| drive = volts.to_vec()));
        let largest = drive.iter().fold(0.0_f64, |largest, volts| largest.max(volts.abs()));
        let mut truth = f64::NAN;
        assert!(spoilt.change_recorded(&signals(&experiment)[0], |values, _| {
            truth = FEEDTHROUGH * noise(values) / largest;
            values.iter_mut().zip(&drive).for_each(|(y, volts)| *y += truth * volts);
        }));
        let without = Outcome::of(&experiment, &spoilt);
        let mut told = settings.clone();
        told.push((
            "estimate.filter.0.readout",
            format!("{{ feedthrough = {{ start_sd = \"{:e}\" }} }}", 3.0 * truth),
        ));
        let (experiment, _) = recorded(&told);
        let with = Outcome::of(&experiment, &spoilt);
        let found = first_trajectory(&experiment, &spoilt);
        let state = found.state("readout_feedthrough").unwrap();
        let (mean, sd) = (state.mean.last().unwrap(), state.sd.last().unwrap());
        println!(
            "{name}: {mean:e} ± {sd:e} of {truth:e}; error {:.3e} without, {:.3e} with, {}",
            without.error(),
            with.error(),
            with.refused
        );
        assert!((mean - truth).abs() < 4.0 * sd && *sd < 0.1 * truth, "{name}: {mean} ± {sd} of {truth}");
        assert!(with.passes(), "{name}: {:?}", with.first().map(|first| first.grade));
        assert!(!without.passes(), "{name} passes with a feedthrough");
    }
}

/// A device without a drive in V has nothing that could reach its signal so.
#[test]
fn a_feedthrough_of_a_device_without_a_drive_is_refused() {
    let of = Of::Published("piston mirror");
    let feedthrough = ("estimate.filter.0.readout", "{ feedthrough = { start_sd = \"1e-2\" } }".to_owned());
    let (experiment, simulated) = of.recorded(&[feedthrough], 663);
    let refused = Outcome::of(&experiment, &simulated).refused;
    assert!(refused.contains("`readout.feedthrough`") && refused.contains("no recorded drive"), "{refused}");
}

/// The standard deviation of coloured noise in that of the white noise of a sample, and its correlation time in sampling intervals.
const COLOURED: [f64; 2] = [3.0, 40.0];

/// With coloured noise as a state a filter follows it, claims what its errors are, and passes; a filter that knows white noise alone does not.
#[test]
fn coloured_noise_is_followed_as_a_state_of_four_devices() {
    for (name, settings, unit) in DEVICES {
        let recorded = |settings: &[Setting]| {
            Device::named(name).recorded_without(settings, &["estimate.filter.0.threshold"], 664)
        };
        let settings: Vec<Setting> =
            settings.iter().map(|(key, value)| (*key, (*value).to_owned())).collect();
        let (experiment, mut spoilt) = recorded(&settings);
        let (mut truth, mut sizes) = (Vec::new(), (0.0, 0.0));
        assert!(spoilt.change_recorded(&signals(&experiment)[0], |values, times| {
            let [size, samples] = COLOURED;
            let interval_s = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
            let (sd, decay) = (size * noise(values), (-1.0 / samples).exp());
            sizes = (sd, samples * interval_s);
            let mut chance = WhiteNoise::new(664, 3);
            let mut now = sd * chance.sample();
            for y in values {
                *y += now;
                truth.push(now);
                now = decay * now + sd * (1.0 - decay * decay).sqrt() * chance.sample();
            }
        }));
        let without = Outcome::of(&experiment, &spoilt);
        let (sd, time_s) = sizes;
        let mut told = settings.clone();
        let readout = format!("{{ coloured_noise = {{ sd = \"{sd:e} {unit}\", time = \"{time_s:e} s\" }} }}");
        told.push(("estimate.filter.0.readout", readout));
        let (experiment, _) = recorded(&told);
        let with = Outcome::of(&experiment, &spoilt);
        let found = first_trajectory(&experiment, &spoilt);
        let state = found.state("coloured_noise").unwrap();
        let skip = state.mean.len() / 4;
        let truth = &truth[truth.len() - state.mean.len()..];
        let squares =
            state.mean.iter().zip(truth).zip(&state.sd).map(|((mean, x), sd)| ((mean - x) / sd).powi(2));
        let count = (state.mean.len() - skip) as f64;
        let square = squares.skip(skip).sum::<f64>() / count;
        println!(
            "{name}: mean square of error over claim {square:.3} of {count}; error {:.3e} without, {:.3e} with, {}",
            without.error(),
            with.error(),
            with.refused
        );
        // Errors are correlated over a correlation time at most: chi-square of as many degrees, 5 standard deviations.
        let off = 5.0 * (4.0 * COLOURED[1] / count).sqrt();
        assert!((square - 1.0).abs() < off, "{name}: {square}, {off}");
        assert!(with.passes(), "{name}: {:?}", with.first().map(|first| first.grade));
        assert!(!without.passes(), "{name} passes with coloured noise");
        assert!(with.error() < without.error(), "{name}");
    }
}

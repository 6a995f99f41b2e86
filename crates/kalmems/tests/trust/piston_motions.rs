//! Motions of the piston mirror that are not the sine of its model.

use crate::devices::{Setting, put};
use crate::losses::longer;
use crate::outliers::signals::Of;
use kalmems::config::Experiment;
use kalmems::estimate::{LockEvent, Trajectory};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise, described};
use std::f64::consts::TAU;
use std::path::Path;

/// The piston mirror by its example, moving by this amplitude in m and phase in rad about a rest position of 1 mm, at each time in s.
pub fn piston(seed: u64, motion: impl Fn(f64) -> [f64; 2]) -> (Experiment, ComputedRecording) {
    piston_at(&[], seed, |time_s| {
        let [amplitude, phase] = motion(time_s);
        1e-3 + amplitude * phase.cos()
    })
}

/// The same at these distances in m, and with these settings.
pub fn piston_at(
    settings: &[Setting],
    seed: u64,
    distance: impl Fn(f64) -> f64,
) -> (Experiment, ComputedRecording) {
    const FARADS: f64 = 109.3e-15;
    const SD: f64 = 15.1e-18;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/piston_mirror/simulation.toml");
    let mut document: toml::Value =
        std::fs::read_to_string(&path).unwrap().parse::<toml::Table>().unwrap().into();
    for (key, value) in longer(Of::Published("piston mirror")).iter().chain(settings) {
        put(&mut document, key, Some(value));
    }
    let experiment = published().parse(&toml::to_string(&document).unwrap(), &path).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let mut simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let mut chance = WhiteNoise::new(seed, 79);
    assert!(simulated.change_recorded("signal", |values, times| {
        for (value, time_s) in values.iter_mut().zip(times) {
            *value = FARADS * 1e-3 / distance(*time_s) + SD * chance.sample();
        }
    }));
    (described(&experiment, &*simulation), simulated)
}

/// The first filter of a recording, and the root mean square of how far its position is from a motion about 1 mm, in m, from a time in s on.
pub fn followed(
    (experiment, simulated): &(Experiment, ComputedRecording),
    from_s: f64,
    motion: impl Fn(f64) -> [f64; 2],
) -> (Trajectory, f64) {
    let rig = published().rig(experiment).unwrap();
    let recording = simulated.recorded(&rig.layout(experiment, 0).unwrap()).unwrap();
    let mut found = rig.estimate(experiment, 0, &recording, &Silent).unwrap_or_else(|why| panic!("{why}"));
    let trajectory = found.swap_remove(0).trajectories.swap_remove(0);
    let position = &trajectory.state("position").unwrap().mean;
    let late = trajectory.time_s.iter().zip(position).filter(|(time_s, _)| **time_s >= from_s);
    let squares = late.map(|(time_s, position)| {
        let [amplitude, phase] = motion(*time_s);
        (position - 1e-3 - amplitude * phase.cos()).powi(2)
    });
    let squares: Vec<f64> = squares.collect();
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    (trajectory, rms)
}

/// A second harmonic of 1 % and a third of 0.5 % of the stroke, as states: without them the motion is refused, with them its position is as good as
/// that of a sine but for what four more states cost, and within its claim.
#[test]
fn harmonics_of_the_piston_mirror_are_states() {
    let states =
        ["second_harmonic_cosine", "second_harmonic_sine", "third_harmonic_cosine", "third_harmonic_sine"];
    let each: Vec<String> =
        states.iter().map(|name| format!("{name} = {{ start_sd = \"10 um\" }}")).collect();
    let with: Vec<Setting> = vec![("estimate.filter.0.states", format!("{{ {} }}", each.join(", ")))];
    let (amplitudes, skip_s) = ([4e-6, -3e-6, 2e-6, 1.5e-6], 0.4);
    let at = |time_s: f64| {
        let phase = TAU * 500.0 * time_s + 0.7;
        let [a, b, c, d] = amplitudes;
        1e-3 + 5e-4 * phase.cos()
            + a * (2.0 * phase).cos()
            + b * (2.0 * phase).sin()
            + c * (3.0 * phase).cos()
            + d * (3.0 * phase).sin()
    };
    let of = |settings: &[Setting]| {
        let (experiment, simulated) = piston_at(settings, 3, at);
        let rig = published().rig(&experiment).unwrap();
        let recording = simulated.recorded(&rig.layout(&experiment, 0).unwrap()).unwrap();
        let found = rig.estimate(&experiment, 0, &recording, &Silent);
        found.map(|mut found| found.swap_remove(0).trajectories.swap_remove(0))
    };
    let why = of(&[]).unwrap_err().to_string();
    assert!(why.contains("times the stated noise in its first samples"), "{why}");
    let found = of(&with).unwrap();
    let from = found.time_s.partition_point(|time_s| *time_s < skip_s);
    let position = found.state("position").unwrap();
    let z: Vec<f64> = (from..found.time_s.len())
        .map(|k| (position.mean[k] - at(found.time_s[k])) / position.sd[k])
        .collect();
    let size = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    let consistency = found.consistency(from..found.time_s.len()).unwrap();
    println!("errors of {size:.2} claimed deviations, of {:.2e} m; {consistency:?}", position.sd[z.len()]);
    // Errors follow each other: few of them are independent.
    assert!(size < 2.0 && consistency.holds() && found.lock.held(), "{size} {consistency:?}");
    for (name, truth) in states.iter().zip(amplitudes) {
        let state = found.state(name).unwrap();
        let (mean, sd) = (state.mean.last().unwrap(), state.sd.last().unwrap());
        assert!((mean - truth).abs() < 4.0 * sd && *sd < 2e-8, "{name}: {mean:e} ± {sd:e}, {truth:e}");
    }
}

/// Amplitude in m and phase in rad of a motion at a time in s.
type Motion = Box<dyn Fn(f64) -> [f64; 2]>;

/// Motions whose amplitude or frequency changes, each with its name.
fn changing() -> [(&'static str, Motion); 5] {
    const INTERVAL_S: f64 = 5e-5;
    let steady = |time_s: f64| TAU * 500.0 * time_s + 0.7;
    // A random walk of the frequency by 0.03 Hz in a second, root mean square.
    let mut chance = WhiteNoise::new(7, 81);
    let (mut phase, mut hz) = (0.7, 500.0);
    let walk: Vec<f64> = (0..30_000)
        .map(|_| {
            hz += 0.03 * INTERVAL_S.sqrt() * chance.sample();
            phase += TAU * hz * INTERVAL_S;
            phase
        })
        .collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample
    let wandering = move |time_s: f64| walk[(time_s / INTERVAL_S).round() as usize];
    [
        ("steady", Box::new(move |t| [5e-4, steady(t)])),
        ("ring-up", Box::new(move |t| [5e-4 * (1.0 - 0.9 * (-t / 0.4).exp()), steady(t)])),
        ("ring-down", Box::new(move |t| [5e-4 * (-(t - 0.5).max(0.0) / 2.0).exp(), steady(t)])),
        ("step of the frequency by 0.1 %", Box::new(move |t| [5e-4, steady(t + 1e-3 * (t - 0.8).max(0.0))])),
        ("wander of the frequency", Box::new(move |t| [5e-4, wandering(t)])),
    ]
}

/// With a process noise for motions that change the filter follows one that rings up, rings down or wanders within its claim; with that of the example, which is
/// for a steady motion, an estimate that is wrong is refused, lost or its innovations are not those of a right filter.
#[test]
fn a_motion_whose_amplitude_or_frequency_changes_is_followed() {
    const FOR_CHANGES: &str =
        "{ frequency = \"1e-3 Hz^2/s\", offset = \"1e-19 m^2/s\", amplitude_rate = \"1e-5 m^2/s^3\" }";
    const START: &str = "{ amplitude = \"50 um\", frequency = \"500 Hz\", phase = \"0.7 rad\", offset = \"1 mm\", amplitude_rate = \"1.1 mm/s\" }";
    const START_SD: &str = "{ amplitude = \"1 um\", frequency = \"0.1 Hz\", phase = \"10 mrad\", offset = \"1 um\", amplitude_rate = \"0.1 mm/s\" }";
    let for_changes = [("estimate.filter.0.process_noise", FOR_CHANGES.to_owned())];
    let with_start = [
        for_changes[0].clone(),
        ("estimate.filter.0.start", START.to_owned()),
        ("estimate.filter.0.start_sd", START_SD.to_owned()),
    ];
    for (name, motion) in changing() {
        // A start from the signal is for a motion whose amplitude is nearly that of its first cycles for as long as these last.
        let changing = if name == "ring-up" { &with_start[..] } else { &for_changes[..] };
        for (noise, settings) in [("steady", &[][..]), ("changing", changing)] {
            let (experiment, simulated) = piston_at(settings, 5, |time_s| {
                let [amplitude, phase] = motion(time_s);
                1e-3 + amplitude * phase.cos()
            });
            let rig = published().rig(&experiment).unwrap();
            let recording = simulated.recorded(&rig.layout(&experiment, 0).unwrap()).unwrap();
            let trajectory = match rig.estimate(&experiment, 0, &recording, &Silent) {
                Ok(mut found) => found.swap_remove(0).trajectories.swap_remove(0),
                Err(why) => {
                    println!("| {name} | {noise} | refused: {why} |");
                    assert_eq!(noise, "steady", "{name}: {why}");
                    continue;
                }
            };
            let from = trajectory.time_s.partition_point(|time_s| *time_s < 0.25);
            let samples = from..trajectory.time_s.len();
            let position = trajectory.state("position").unwrap();
            let error = |k: usize| {
                let [amplitude, phase] = motion(trajectory.time_s[k]);
                position.mean[k] - 1e-3 - amplitude * phase.cos()
            };
            let within = samples.clone().filter(|k| error(*k).abs() <= 3.0 * position.sd[*k]).count();
            let within = within as f64 / samples.len() as f64;
            let square = samples.clone().map(|k| error(k).powi(2)).sum::<f64>() / samples.len() as f64;
            let consistency = trajectory.consistency(samples);
            // More process noise than there is makes the innovations smaller than claimed.
            let is_trusted =
                trajectory.lock.held() && consistency.is_some_and(|found| found.mean_nis < found.upper);
            println!(
                "| {name} | {noise} | {:.1} nm | {:.1} % | {:.3} | {} |",
                1e9 * square.sqrt(),
                100.0 * within,
                consistency.map_or(f64::NAN, |found| found.mean_nis),
                if trajectory.lock.held() { "held" } else { "lost" }
            );
            assert!(within >= 0.99 || !is_trusted, "{name}, {noise}: {within} {consistency:?}");
            // A step is no wander: it is a loss of the signal, with the time at which it was.
            let stepped = trajectory.lock.events.iter().find_map(|event| match event {
                LockEvent::Lost { time_s, .. } => Some(*time_s),
                _ => None,
            });
            let is_named =
                name.starts_with("step") && stepped.is_some_and(|time_s| (0.79..0.81).contains(&time_s));
            assert!(
                noise == "steady" || is_trusted || is_named,
                "{name}: {consistency:?} {:?}",
                trajectory.lock
            );
        }
    }
}

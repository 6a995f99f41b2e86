//! Smoothed answers of many simulated runs: never worse than the filter's beyond chance, and covered as they claim.

use crate::devices::{Device, Setting};
use kalmems::config::Experiment;
use kalmems::estimate::{Trajectory, TrajectoryKind};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise, described};
use kalmems::workflow::estimate_computed;
use std::path::Path;

/// A device of equations, with its simulation but for duration and seed, and whether the motion has noise.
struct Text {
    name: &'static str,
    /// Up to the tables of the simulation, with `DENSITY` in place of the noise of the motion.
    equations: &'static str,
    density: &'static str,
    rate_hz: f64,
    duration_s: f64,
    /// Its frequency; a constant one without.
    drive: Option<&'static str>,
    start: &'static [StartState],
}

/// Where a filter starts: name, value, unit and standard deviation of a state.
type StartState = (&'static str, f64, &'static str, f64);

const LAGS: &str = r#"
states = { T = "K", x = "m" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
derivative = { T = "(gain*drive - T)/tau", x = "(slope*T - x)/tau_x" }
measure = { signal = "sensitivity*x in V" }
noise = { signal = "1e-6[V^2]"DENSITY }
parameters = { gain = "1 K/V", tau = "8 ms", tau_x = "5 ms", slope = "1 um/K", sensitivity = "1 V/um" }
"#;

const RESONATOR: &str = r#"
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
derivative = { x = "v", v = "force*drive - (2*pi*f0)^2*x - 2*pi*f0/Q*v - cubic*x^3" }
measure = { signal = "gain*x in V" }
noise = { signal = "1e-4[V^2]"DENSITY }
parameters = { f0 = "1 kHz", Q = "6", force = "20 m/(s^2 V)", cubic = "2e18 1/(m^2 s^2)", gain = "1 V/um" }
"#;

/// An angle on a rest that two thermal masses move.
const THERMAL: &str = r#"
states = { angle = "rad", rate = "rad/s", T = "K", F = "K" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
let = { power = "drive^2/(500[ohm] + 1.5[ohm/K]*T)", to_frame = "1e-4[W/K]*(T - F)", rest = "2e-3[rad/K]*(T - 0.2*F)" }
measure = { signal = "sensitivity*(1 - 2e-3[1/K]*F)*angle + 3e-3[V/K]*F + 0.04[V] in V" }
noise = { signal = "2.5e-7[V^2]"DENSITY }
[device.equations.derivative]
angle = "rate"
rate = "(-b*rate - 3.09e-8[N m]*(angle - rest))/J"
T = "(power - to_frame)/8e-7[J/K]"
F = "(to_frame - 2e-3[W/K]*F)/6e-4[J/K]"
[device.equations.parameters]
J = "3.4e-15 kg m^2"
b = "2.7e-13 N m s"
sensitivity = "2.5 V/rad"
"#;

const SINE: &str = "{ sine = { offset = \"1 V\", amplitude = \"0.5 V\", frequency = \"FREQUENCY\" } }";
const CONSTANT: &str = "{ constant = { value = \"1 V\" } }";

impl Text {
    /// The true motion begins at random, as the filter's start claims.
    fn experiment(&self, seed: u64) -> Experiment {
        let mut chance = WhiteNoise::new(seed, 9);
        let mut start_where = |sds: f64| {
            let each = self.start.iter().map(|(name, value, unit, sd)| {
                let away = if sds > 0.0 { sds * sd * chance.sample() } else { 0.0 };
                format!("{name} = \"{:e} {unit}\"", value + away)
            });
            format!("{{ {} }}", each.collect::<Vec<_>>().join(", "))
        };
        let (real, told) = (start_where(1.0), start_where(0.0));
        let sds = self.start.iter().map(|(name, _, unit, sd)| format!("{name} = \"{sd:e} {unit}\""));
        let sds = format!("{{ {} }}", sds.collect::<Vec<_>>().join(", "));
        let drive = self.drive.map_or_else(|| CONSTANT.to_owned(), |hz| SINE.replace("FREQUENCY", hz));
        let between = if self.drive.is_some() { "sine" } else { "hold" };
        let equations = self.equations.replace("DENSITY", self.density).replace("BETWEEN", between);
        let text = format!(
            "name = \"{}\"\n[device.equations]{equations}\n[simulate]\nduration = \"{} s\"\nsampling_rate = \"{} Hz\"\nintegration_rate = \"{} Hz\"\n\
             seed = {seed}\nstart = {real}\ndrive = {{ inputs = {{ drive = {drive} }} }}\n[estimate]\nskip = \"0 s\"\ncheck_numbers = false\n\
             [[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nsmooth = true\nsmooth_lag = \"{} s\"\nstart = {told}\nstart_sd = {sds}\n",
            self.name,
            self.duration_s,
            self.rate_hz,
            32.0 * self.rate_hz,
            20.0 / self.rate_hz,
        );
        parsed(&text)
    }
}

fn parsed(text: &str) -> Experiment {
    let parsed = published().parse(text, Path::new("nowhere/experiment.toml"));
    parsed.unwrap_or_else(|why| panic!("{why}\n{text}"))
}

const LAG_START: &[StartState] = &[("T", 0.0, "K", 0.05), ("x", 0.0, "m", 5e-8)];
const SWING: &[StartState] = &[("x", 1e-6, "m", 1e-7), ("v", 0.0, "m/s", 1e-3)];

const WARM: &[StartState] =
    &[("angle", 0.1, "rad", 1e-3), ("rate", 0.0, "rad/s", 1.0), ("T", 50.0, "K", 0.1), ("F", 3.0, "K", 0.1)];

/// Without noise of the motion and with it, over ten time constants and over thousands. Where neither the motion has noise nor the step is exact, an
/// error of the step outlasts all claims: such devices run for ten time constants. What is known to the arithmetic has a constant drive.
const TEXTS: [Text; 8] = [
    Text { name: "lags_short", density: "", duration_s: 0.1, ..LAG_CASE },
    Text { name: "lags_long", density: "", duration_s: 80.0, drive: None, ..LAG_CASE },
    Text { name: "noisy_lags_short", duration_s: 0.1, ..LAG_CASE },
    Text { name: "noisy_lags_long", duration_s: 80.0, ..LAG_CASE },
    Text {
        name: "thermal",
        equations: THERMAL,
        density: "",
        rate_hz: 1e4,
        duration_s: 1.0,
        drive: Some("10 Hz"),
        start: WARM,
    },
    Text { name: "resonator_short", density: "", duration_s: 0.02, ..RESONATOR_CASE },
    Text { name: "noisy_resonator", duration_s: 2.0, ..RESONATOR_CASE },
    Text { name: "noisy_resonator_long", duration_s: 6.0, ..RESONATOR_CASE },
];

const LAG_CASE: Text = Text {
    name: "",
    equations: LAGS,
    density: ", T = \"1e-4[K^2/s]\"",
    rate_hz: 2e3,
    duration_s: 1.0,
    drive: Some("30 Hz"),
    start: LAG_START,
};

const RESONATOR_CASE: Text = Text {
    name: "",
    equations: RESONATOR,
    density: ", v = \"1e-6[m^2/s^3]\"",
    rate_hz: 2e4,
    duration_s: 1.0,
    drive: Some("950 Hz"),
    start: SWING,
};

/// The part of a value, in standard deviations, below which a claim is that of the arithmetic.
const ARITHMETIC: f64 = 1e-11;

/// What a filter and its smoothers say of one sample of each state, in standard deviations that they claim, and the error of the filter and of
/// the smoother in those of the filter.
struct Sampled {
    smoothed: Vec<f64>,
    pairs: Vec<[f64; 2]>,
}

fn sampled(experiment: &Experiment, all: &ComputedRecording, seed: u64) -> Sampled {
    let outcome = estimate_computed(published(), experiment, all, &Silent).unwrap();
    let trajectories = &outcome.recordings[0].segments[0].estimate.trajectories;
    let [filter, smoothers @ ..] = &trajectories[..] else { panic!("no filter") };
    let truth = all.true_columns();
    let (mut found, rows) = (Sampled { smoothed: Vec::new(), pairs: Vec::new() }, filter.time_s.len());
    // Another place in each run, behind the start.
    let place = rows / 20 + (usize::try_from(seed).unwrap() * 7919) % (rows * 9 / 10);
    // Another filter of the experiment is no smoother.
    for smoother in smoothers.iter().filter(|one| one.kind == TrajectoryKind::Smoothed) {
        assert!(smoother.failure.is_none(), "{}: {:?}", experiment.name, smoother.failure);
        for (state, filtered) in smoother.states.iter().zip(&filter.states) {
            let column = format!("{}_{}", state.name, state.unit);
            let Some((_, values)) = truth.iter().find(|(name, _)| *name == column) else { continue };
            let of = |trajectory: &Trajectory, value: f64| {
                let at = trajectory.time_s[place];
                let row = truth[0].1.iter().position(|t| (t - at).abs() < 1e-9).unwrap();
                value - values[row]
            };
            let (error, before) = (of(smoother, state.mean[place]), of(filter, filtered.mean[place]));
            if state.sd[place].is_finite() && filtered.sd[place] > 0.0 {
                // What is claimed as well as the arithmetic knows it tells nothing of chance.
                if state.sd[place] > ARITHMETIC * state.mean[place].abs() {
                    found.smoothed.push(error / state.sd[place]);
                }
                found.pairs.push([before / filtered.sd[place], error / filtered.sd[place]]);
            }
        }
    }
    found
}

/// An experiment and its simulated recording, by a seed.
type RecordedBySeed = Box<dyn Fn(u64) -> (Experiment, ComputedRecording)>;

/// The cases of all devices, each as its experiment and its simulated recording by a seed.
fn cases() -> Vec<(&'static str, RecordedBySeed)> {
    let mut all: Vec<(&'static str, RecordedBySeed)> = Vec::new();
    for text in &TEXTS {
        all.push((
            text.name,
            Box::new(move |seed| {
                let experiment = text.experiment(seed);
                let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
                let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
                (described(&experiment, simulation.as_ref()), all)
            }),
        ));
    }
    // Of the published devices the process noise is that of their motion: none, but of the accelerometer. The filter of the micro-stage
    // takes the mean of the drive at both ends of an interval, which makes a sine smaller by 5e-5.
    for (name, silent) in [
        ("shared scanner", Some("estimate.process_noise.angular_acceleration")),
        ("micro-stage", Some("estimate.process_noise.angular_acceleration")),
        ("threshold scanner", Some("estimate.process_noise.angular_acceleration")),
        ("accelerometer", None),
    ] {
        all.push((
            name,
            Box::new(move |seed| {
                let mut settings: Vec<Setting> = vec![
                    ("estimate.filter.0.smooth", "true".to_owned()),
                    ("estimate.check_numbers", "false".to_owned()),
                ];
                settings.extend(silent.map(|key| (key, "\"0 rad^2/s^3\"".to_owned())));
                Device::named(name).recorded(&settings, &settings, seed)
            }),
        ));
    }
    all
}

/// Mean and its standard deviation.
fn mean_of(numbers: &[f64]) -> (f64, f64) {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    (mean, (numbers.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / n / n).sqrt())
}

/// Runs each case with so many seeds, and holds the smoothed answers against the filters' and against their claims.
fn hold(seeds: std::ops::Range<u64>) {
    let (mut within, mut of_all, mut gains) = (0, 0, Vec::new());
    for (name, recorded) in cases() {
        let (mut inside, mut count, mut pairs_of_case, mut squares) = (0, 0, 0, [0.0; 2]);
        let before_case = gains.len();
        for seed in seeds.clone() {
            let (experiment, all) = recorded(seed);
            let Sampled { smoothed, pairs } = sampled(&experiment, &all, seed);
            inside += smoothed.iter().filter(|z| z.abs() < 1.96).count();
            count += smoothed.len();
            for [before, after] in pairs {
                pairs_of_case += 1;
                gains.push(after * after - before * before);
                (squares[0], squares[1]) = (squares[0] + before * before, squares[1] + after * after);
            }
        }
        println!(
            "{name}: {inside} of {count} within 95 %, mean squares {:.3} filtered and {:.3} smoothed",
            squares[0] / f64::from(pairs_of_case),
            squares[1] / f64::from(pairs_of_case)
        );
        (within, of_all) = (within + inside, of_all + count);
        if count == 0 {
            continue;
        }
        // States of a run err together: no more is known than of so many runs.
        let runs = seeds.clone().count() as f64;
        let covered_of_case = inside as f64 / count as f64;
        assert!(covered_of_case > 0.95 - 4.0 * (0.95 * 0.05 / runs).sqrt(), "{name}: {covered_of_case}");
        let (mean, deviation) = mean_of(&gains[before_case..]);
        let deviation = deviation * (f64::from(pairs_of_case) / runs).sqrt();
        assert!(mean < 4.0 * deviation, "{name}: {mean} ± {deviation}");
    }
    let (mean, deviation) = mean_of(&gains);
    println!(
        "{within} of {of_all} within 95 %; square of smoothed minus filtered {mean:.3} ± {deviation:.3}"
    );
    let covered = within as f64 / of_all as f64;
    assert!((0.91..0.99).contains(&covered), "{within} of {of_all}");
    assert!(mean < 3.0 * deviation, "{mean} ± {deviation}");
}

#[test]
#[ignore = "slow: ten minutes"]
fn slow_smoothed_answers_are_no_worse_than_the_filters_and_covered_as_claimed() {
    hold(300..317);
}

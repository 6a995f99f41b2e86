//! Spring, damping, mass and noise of the accelerometer, with dithers of three and of sixteen tones and without any.

use super::chance::Chance;
use super::harm::{Harm, error, ratio};
use super::rows::Rows;
use kalmems::config::Experiment;
use kalmems::diagnose::identify;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// k, b, m and R: Zhang 2010, Table I, and the variance of its readout.
const TRUTH: [f64; 4] = [3.0, 7e-4, 3.8e-9, 4.88e-9];
const NAMES: [&str; 4] = ["k", "b", "m", "R"];
const GRAVITY: f64 = 9.80665;
const RATE_HZ: f64 = 100e3;
/// Steps of the integrator to a sample.
const STEPS: u32 = 8;

struct Recording {
    /// Time, feedback and output.
    recorded: Vec<[f64; 3]>,
    acceleration: Vec<f64>,
}

/// Displacement and rate under the acceleration and a held feedback: both plates' pull in full.
fn derivative([x, v]: [f64; 2], acceleration: f64, feedback: f64) -> [f64; 2] {
    let [k, b, m, _] = TRUTH;
    let (gap, pull) = (2.3e-6, 0.5 * 4.0 * 8.854_187_812_8e-12 * 1.86e-6);
    let (carrier, bias) = (0.18, 0.173);
    let near = (carrier + (bias - feedback) * (bias - feedback)) / ((gap - x) * (gap - x));
    let far = (carrier + (bias + feedback) * (bias + feedback)) / ((gap + x) * (gap + x));
    [v, acceleration + (pull * (near - far) - b * v - k * x) / m]
}

/// ä = −ω²·a − 2ζω·ȧ + w: of a variance of σ² where w has the density 4ζω³σ² (two-sided).
struct Wandering {
    rate: f64,
    ratio: f64,
}

impl Wandering {
    /// Without w, exactly, for ζ = 1/√2.
    fn step(&self, [a, jerk]: [f64; 2], h: f64) -> [f64; 2] {
        let decay = self.ratio * self.rate;
        let (sine, cosine) = (decay * h).sin_cos();
        let swing = (jerk + decay * a) / decay;
        let e = (-decay * h).exp();
        let there = e * (a * cosine + swing * sine);
        [there, e * decay * (swing * cosine - a * sine) - decay * there]
    }

    /// What w makes of ȧ in h, over σ.
    fn push(&self, h: f64) -> f64 {
        (4.0 * self.ratio * self.rate.powi(3) * h).sqrt()
    }
}

/// A closed loop with an acceleration of 0.1 g by chance below 50 Hz, and these tones on the feedback, in Hz, of 4 mV in all.
fn recording(seed: u64, tones: &[f64], samples: usize) -> Recording {
    let mut chance = Chance::new(seed);
    let (interval, h) = (1.0 / RATE_HZ, 1.0 / RATE_HZ / f64::from(STEPS));
    let phases: Vec<f64> = tones.iter().map(|_| TAU * chance.uniform()).collect();
    let size = 4e-3 * (2.0 / tones.len().max(1) as f64).sqrt();
    let law = Wandering { rate: TAU * 50.0, ratio: std::f64::consts::FRAC_1_SQRT_2 };
    let rms = 0.1 * GRAVITY;
    let push = rms * law.push(h);
    let (mut a, mut jerk) = (rms * chance.normal(), rms * law.rate * chance.normal());
    let brownian = (2.0 * 1.380_649e-23 * 300.0 * TRUTH[1] * h).sqrt() / TRUTH[2];
    let (mut x, mut total, mut last) = ([0.0, 0.0], 0.0, 0.0);
    let sensitivity = 2.0 * 4.0 * 8.854_187_812_8e-12 * 1.86e-6 * 0.6 / 20e-12;
    let mut all = Recording { recorded: Vec::new(), acceleration: Vec::new() };
    for k in 0..samples {
        let time = k as f64 * interval;
        let gap: f64 = 2.3e-6;
        let shown = sensitivity * x[0] / (gap * gap - x[0] * x[0]) + TRUTH[3].sqrt() * chance.normal();
        // K_p = 10, K_i = 1/s by trapezia.
        total += 0.5 * interval * (shown + last);
        last = shown;
        let dither: f64 =
            tones.iter().zip(&phases).map(|(hz, phase)| size * (TAU * hz * time + phase).sin()).sum();
        let feedback = 10.0 * shown + total + dither;
        all.recorded.push([time, feedback, shown]);
        all.acceleration.push(a);
        for _ in 0..STEPS {
            let next = law.step([a, jerk], h);
            let middle = law.step([a, jerk], 0.5 * h)[0];
            let slope = |x: [f64; 2], a: f64| derivative(x, a, feedback);
            let on = |d: [f64; 2], by: f64| [x[0] + by * d[0], x[1] + by * d[1]];
            let d1 = slope(x, a);
            let d2 = slope(on(d1, 0.5 * h), middle);
            let d3 = slope(on(d2, 0.5 * h), middle);
            let d4 = slope(on(d3, h), next[0]);
            x = [0, 1].map(|i| x[i] + h / 6.0 * (d1[i] + 2.0 * d2[i] + 2.0 * d3[i] + d4[i]));
            [a, jerk] = [next[0], next[1] + push * chance.normal()];
            x[1] += brownian * chance.normal();
        }
    }
    all
}

const HEAD: &str = r#"
name = "accelerometer"
[device.accelerometer.plates]
area = "1.86 mm^2"
gap = "2.3 um"
relative_permittivity = 4
[device.accelerometer.readout]
carrier_amplitude = "0.6 V"
carrier_mean_square = 0.5
feedback_capacitance = "20 pF"
noise_variance = "4.88e-9 V^2"
[device.accelerometer.acceleration]
rms = "0.1 gn"
bandwidth = "50 Hz"
damping_ratio = 0.7071
[device.accelerometer.feedback]
bias = "0.173 V"
proportional_gain = 10
integral_gain = "1 1/s"
[estimate]
skip = "50 ms"
[[estimate.filter]]
name = "settled"
method = "steady_state"
start = { displacement = "0 m", velocity = "0 m/s", acceleration = "0 m/s^2", jerk = "0 m/s^3" }
start_sd = { displacement = "10 nm", velocity = "10 um/s", acceleration = "0.1 gn", jerk = "31.4 gn/s" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { feedback = "feedback_V", signal = "output_V" }
[recording.reference]
file = "truth.csv"
channels = { acceleration = "accel_m_per_s2" }
"#;

impl Recording {
    /// The experiment of a laboratory that takes spring, damping and mass for so many times what they are.
    fn told(&self, folder: &Path, factors: [f64; 3]) -> Experiment {
        let mut rows = "time_s,feedback_V,output_V\n".to_owned();
        self.recorded.iter().for_each(|[t, v, y]| writeln!(rows, "{t:.6},{v:e},{y:e}").unwrap());
        fs::write(folder.join("recording.csv"), rows).unwrap();
        let mut rows = "time_s,accel_m_per_s2\n".to_owned();
        let truth = self.recorded.iter().zip(&self.acceleration);
        truth.for_each(|([t, ..], a)| writeln!(rows, "{t:.6},{a:e}").unwrap());
        fs::write(folder.join("truth.csv"), rows).unwrap();
        let [k, b, m] = [0, 1, 2].map(|i| TRUTH[i] * factors[i]);
        let mass = format!(
            "[device.accelerometer.proof_mass]\nmass = \"{m} kg\"\nspring = \"{k} N/m\"\ndamping = \"{b} N s/m\"\n\
             temperature = \"300 K\"\n"
        );
        published().parse(&format!("{HEAD}{mass}"), &folder.join("experiment.toml")).unwrap()
    }
}

/// So many tones from 200 Hz to 40 kHz, evenly by their logarithms.
fn tones(count: u32) -> Vec<f64> {
    (0..count).map(|i| 200.0 * 200_f64.powf(f64::from(i) / f64::from(count - 1))).collect()
}

/// The numbers of so many recordings with these tones, told up to 30 % wrong; error of the acceleration after over that before.
fn identified(runs: u64, count: u32, seed: u64, rows: &mut Rows) -> Vec<f64> {
    let tones = if count == 0 { Vec::new() } else { tones(count) };
    rows.of_recordings(seed..seed + runs, |seed, folder, rows| {
        let mut chance = Chance::new(!seed);
        let factors = [0; 3].map(|_| chance.between(-0.3, 0.3_f64).exp());
        let told = recording(seed, &tones, 40_000).told(folder, factors);
        let before = error(&told, "acceleration");
        let found = identify(published(), &told, &Silent).unwrap_or_else(|e| panic!("{seed}: {e}"));
        for (place, (name, truth)) in NAMES.into_iter().zip(TRUTH).enumerate() {
            rows.push(&format!("{count} tones, {name}"), truth, &found.parameters[place]);
        }
        ratio(error(&found.experiment, "acceleration"), before)
    })
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_few_accelerometers() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    for count in [0, 3, 16] {
        let ratios = identified(2, count, 77, &mut rows);
        harm.take(&format!("{count} tones"), ratios);
    }
    harm.judge();
    rows.judge();
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_accelerometers() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    for (count, seed) in [(0, 1000), (3, 2000), (16, 3000)] {
        let ratios = identified(100, count, seed, &mut rows);
        harm.take(&format!("{count} tones"), ratios);
    }
    harm.judge();
    rows.judge();
}

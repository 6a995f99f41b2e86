//! The piston mirror's noise and the densities of its walks, by the likelihood of innovations.

use super::chance::Chance;
use super::harm::{Harm, error, ratio};
use super::rows::Rows;
use kalmems::config::Experiment;
use kalmems::diagnose::likeliest;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Noise in F/√Hz, and the densities of frequency in Hz²/s, offset in m²/s and amplitude rate in m²/s³.
const TRUTH: [f64; 4] = [0.151e-18, 1e-6, 1e-16, 1e-14];
const NAMES: [&str; 4] = [
    "readout.noise_density",
    "process_noise.frequency",
    "process_noise.offset",
    "process_noise.amplitude_rate",
];
const RATE_HZ: f64 = 20e3;

/// A mirror at 1 mm that swings by half of it at 500 Hz, each of whose numbers walks.
fn write(chance: &mut Chance, samples: usize, folder: &Path) {
    let h = 1.0 / RATE_HZ;
    let [noise, frequency_walk, offset_walk, rate_walk] = TRUTH;
    let (mut amplitude, mut rate, mut hz, mut rest) = (0.5e-3, 0.0, 500.0, 1e-3);
    let mut phase = TAU * chance.uniform();
    let (mut rows, mut shown) = ("time_s,cap_F\n".to_owned(), "time_s,position_m\n".to_owned());
    for k in 0..samples {
        let distance = rest + amplitude * f64::cos(phase);
        // One-sided white noise of density n²: a sample has the variance n²·f/2.
        let capacitance = 109.3e-15 * 1e-3 / distance + noise * (0.5 * RATE_HZ).sqrt() * chance.normal();
        writeln!(rows, "{:.6},{capacitance:.12e}", k as f64 * h).unwrap();
        writeln!(shown, "{:.6},{distance:.12e}", k as f64 * h).unwrap();
        phase += TAU * hz * h;
        amplitude += rate * h;
        hz += (frequency_walk * h).sqrt() * chance.normal();
        rest += (offset_walk * h).sqrt() * chance.normal();
        rate += (rate_walk * h).sqrt() * chance.normal();
    }
    fs::write(folder.join("recording.csv"), rows).unwrap();
    fs::write(folder.join("reference.csv"), shown).unwrap();
}

fn told(folder: &Path, factors: [f64; 4]) -> Experiment {
    let [noise, frequency, offset, rate] = [0, 1, 2, 3].map(|i| TRUTH[i] * factors[i]);
    let named: Vec<String> = NAMES.iter().map(|name| format!("\"{name}\"")).collect();
    let text = format!(
        r#"
name = "piston"
[device.piston_mirror.capacitance]
reference_distance = "1 mm"
coefficients = ["0 F", "109.3 fF"]
[device.piston_mirror.readout]
noise_density = "{noise:e} F/sqrt(Hz)"
[identify]
parameters = [{}]
[[recording]]
role = "test"
file = "recording.csv"
clock = {{ column = "time_s" }}
channels = {{ signal = "cap_F" }}
[recording.reference]
file = "reference.csv"
channels = {{ position = "position_m" }}
[estimate]
skip = "0.1 s"
[estimate.process_noise]
frequency = "{frequency:e} Hz^2/s"
offset = "{offset:e} m^2/s"
amplitude_rate = "{rate:e} m^2/s^3"
[[estimate.filter]]
name = "Five states"
method = "ekf"
start = "from_signal"
"#,
        named.join(", ")
    );
    published().parse(&text, &folder.join("experiment.toml")).unwrap()
}

fn identified(words: &str, runs: u64, samples: usize, most_wrong: f64, rows: &mut Rows) -> Vec<f64> {
    rows.of_recordings(0..runs, |seed, folder, rows| {
        let mut chance = Chance::new(15_000 + seed);
        write(&mut chance, samples, folder);
        let told = told(folder, [0; 4].map(|_| chance.between(-most_wrong, most_wrong).exp()));
        let before = error(&told, "position");
        let found = likeliest(published(), &told, &Silent).unwrap_or_else(|e| panic!("{seed}: {e}"));
        for (found, (name, truth)) in found.parameters.iter().zip(NAMES.into_iter().zip(TRUTH)) {
            rows.push(&format!("{words}, {name}"), truth, found);
        }
        ratio(error(&found.experiment, "position"), before)
    })
}

#[test]
fn a_few_piston_mirrors() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    harm.take("piston", identified("piston", 1, 20_000, 1.0, &mut rows));
    harm.judge();
    rows.judge();
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_piston_mirrors() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    harm.take("piston", identified("piston", 100, 30_000, 1.0, &mut rows));
    let mut unjudged = Rows::default();
    harm.take("piston, short, told right", identified("short", 60, 4_000, 0.0, &mut unjudged));
    harm.judge();
    rows.judge();
}

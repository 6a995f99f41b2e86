//! The piston mirror's noise, the densities of its walks and the offset of its readout, by the likelihood of innovations; and the gain of the
//! readout, by a line of a laser.

use super::chance::Chance;
use super::harm::{Harm, error, ratio};
use super::rows::Rows;
use kalmems::applications::ApplicationFile;
use kalmems::applications::spectrum::{SpectrumFile, measure};
use kalmems::config::Experiment;
use kalmems::diagnose::likeliest;
use kalmems::identify::Identified;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::workflow;
use std::f64::consts::{PI, TAU};
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

/// What becomes of the plate's capacitance, 109.3 fF at 1 mm: it is amplified, and one that does not move is added, in F.
#[derive(Clone, Copy)]
struct Readout {
    gain: f64,
    stray: f64,
}

const PLAIN: Readout = Readout { gain: 1.0, stray: 0.0 };

/// A motion by its amplitude, rate of the amplitude, frequency, rest position and phase at each sample of the readout, in SI.
struct Motion(Vec<[f64; 5]>);

impl Motion {
    fn position(&self, time: f64) -> f64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample's place
        let place = ((time * RATE_HZ) as usize).min(self.0.len() - 1);
        let [amplitude, rate, hz, rest, phase] = self.0[place];
        let h = time - place as f64 / RATE_HZ;
        rest + (amplitude + rate * h) * f64::cos(phase + TAU * hz * h)
    }
}

/// A mirror at 1 mm that swings by half of it at 500 Hz, each of whose numbers walks.
fn write(chance: &mut Chance, readout: Readout, samples: usize, folder: &Path) -> Motion {
    let h = 1.0 / RATE_HZ;
    let [noise, frequency_walk, offset_walk, rate_walk] = TRUTH;
    let (mut amplitude, mut rate, mut hz, mut rest) = (0.5e-3, 0.0, 500.0, 1e-3);
    let mut phase = TAU * chance.uniform();
    let (mut rows, mut shown) = ("time_s,cap_F\n".to_owned(), "time_s,position_m\n".to_owned());
    let mut motion = Motion(Vec::new());
    for k in 0..samples {
        motion.0.push([amplitude, rate, hz, rest, phase]);
        let distance = rest + amplitude * f64::cos(phase);
        let plate = readout.gain * 109.3e-15 * 1e-3 / distance + readout.stray;
        // One-sided white noise of density n²: a sample has the variance n²·f/2.
        let capacitance = plate + noise * (0.5 * RATE_HZ).sqrt() * chance.normal();
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
    motion
}

/// The experiment of a laboratory that takes noise and densities for so many times what they are, and what the readout adds for so much.
fn told(folder: &Path, factors: [f64; 4], stray: f64, sought: &[&str]) -> Experiment {
    let [noise, frequency, offset, rate] = [0, 1, 2, 3].map(|i| TRUTH[i] * factors[i]);
    let named: Vec<String> = sought.iter().map(|name| format!("\"{name}\"")).collect();
    let text = format!(
        r#"
name = "piston"
[device.piston_mirror.capacitance]
reference_distance = "1 mm"
coefficients = ["{stray:e} F", "109.3 fF"]
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
        write(&mut chance, PLAIN, samples, folder);
        let factors = [0; 4].map(|_| chance.between(-most_wrong, most_wrong).exp());
        let told = told(folder, factors, 0.0, &NAMES);
        let before = error(&told, "position");
        let found = likeliest(published(), &told, &Silent).unwrap_or_else(|e| panic!("{seed}: {e}"));
        for (found, (name, truth)) in found.parameters.iter().zip(NAMES.into_iter().zip(TRUTH)) {
            rows.push(&format!("{words}, {name}"), truth, found);
        }
        ratio(error(&found.experiment, "position"), before)
    })
}

/// What the readout adds, told up to 5 % wrong; error of the position after over that before. A plate's capacitance falls as 1/d: what does
/// not is the offset, whatever the distance and the amplitude are.
fn offsets(runs: u64, rows: &mut Rows) -> Vec<f64> {
    const STRAY: f64 = 5e-15;
    rows.of_recordings(0..runs, |seed, folder, rows| {
        let mut chance = Chance::new(19_000 + seed);
        write(&mut chance, Readout { stray: STRAY, ..PLAIN }, 8_000, folder);
        let stray = STRAY * chance.between(-0.05, 0.05_f64).exp();
        let told = told(folder, [1.0; 4], stray, &["capacitance.coefficients[0]"]);
        let before = error(&told, "position");
        let found = likeliest(published(), &told, &Silent).unwrap_or_else(|e| panic!("{seed}: {e}"));
        rows.push("piston, offset", STRAY, &found.parameters[0]);
        ratio(error(&found.experiment, "position"), before)
    })
}

/// Five times 4 ms of a detector at 2 MHz behind a laser at 2000 per cm and a band at 1600 per cm; light and detector are in step with the readout.
fn interferograms(chance: &mut Chance, motion: &Motion, file: &Path) {
    let mut rows = "time_s,detector\n".to_owned();
    for burst in 0..5_u32 {
        for k in 0..8_000_u32 {
            let time = 0.15 + 0.039 * f64::from(burst) + f64::from(k) / 2e6;
            let path = 2.0 * (motion.position(time) - 1e-3);
            let band = 5.0 * (-(PI * 3e3 * path).powi(2)).exp() * (TAU * 160e3 * path).cos();
            let light = (TAU * 200e3 * path).cos() + band + 0.05 * chance.normal();
            writeln!(rows, "{time:.7},{light:.6}").unwrap();
        }
    }
    fs::write(file, rows).unwrap();
}

/// The gain, taken for 1 where it is up to 0.3 % more or less, by the laser's line along the estimated positions: true distances are so many
/// times those that a filter finds.
fn gains(runs: u64, rows: &mut Rows) {
    rows.of_recordings(0..runs, |seed, folder, rows| {
        let mut chance = Chance::new(21_000 + seed);
        let gain = chance.between(-3e-3, 3e-3_f64).exp();
        let motion = write(&mut chance, Readout { gain, ..PLAIN }, 8_000, folder);
        interferograms(&mut chance, &motion, &folder.join("interferograms.csv"));
        let told = told(folder, [1.0; 4], 0.0, &[]);
        let outcome =
            workflow::estimate(published(), &told, &Silent).unwrap_or_else(|e| panic!("{seed}: {e}"));
        let estimate = &outcome.recordings[0].segments[0].estimate.trajectories[0];
        let position = &estimate.state("position").unwrap().mean;
        let mut text = "time_s,position_m\n".to_owned();
        for (time, position) in estimate.time_s.iter().zip(position) {
            writeln!(text, "{time:.6},{position:.12e}").unwrap();
        }
        fs::write(folder.join("estimate.csv"), text).unwrap();
        let amplitude = estimate.state("amplitude").unwrap();
        let scale_sd = amplitude.sd.last().unwrap() / amplitude.mean.last().unwrap();
        let spectrum = format!(
            r#"
name = "laser"
[interferogram]
file = "interferograms.csv"
columns = ["detector"]
clock = {{ column = "time_s" }}
[path.trajectory]
file = "estimate.csv"
clock = {{ column = "time_s" }}
column = "position_m"
[transform]
apodisation = "norton_beer_medium"
phase = "none"
largest_path_difference = "0.95 mm"
band = {{ from = "1540 1/cm", to = "2030 1/cm" }}
zero_filling = 32
[[line]]
wavenumber = "2000 1/cm"
within = "12 1/cm"
known = "2000 1/cm"
[errors]
scale_sd = {scale_sd:e}
"#
        );
        let file = SpectrumFile::parse(&spectrum, &folder.join("laser.toml")).unwrap();
        let found = measure(published(), &file, &Silent).unwrap_or_else(|e| panic!("{seed}: {e}"));
        let found = found.recalibration.unwrap();
        let sd = found.scale_sd.unwrap();
        let scale = Identified {
            name: "gain".to_owned(),
            stated: None,
            value: found.scale,
            standard_error: sd,
            interval: [found.scale - 1.96 * sd, found.scale + 1.96 * sd],
            unit: "",
            recording: "laser".to_owned(),
        };
        rows.push("piston, gain by a laser", gain, &scale);
    });
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_few_piston_mirrors() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    harm.take("piston", identified("piston", 1, 20_000, 1.0, &mut rows));
    harm.take("piston, offset", offsets(2, &mut rows));
    gains(2, &mut rows);
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
    harm.take("piston, offset", offsets(100, &mut rows));
    gains(100, &mut rows);
    harm.judge();
    rows.judge();
}

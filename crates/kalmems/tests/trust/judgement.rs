//! What filters, smoothers, diagnoses and identifications say of the same recording, of a device with one state whose recordings are simulated here.

mod advice;
mod choice;
mod effort;
mod hidden;
mod smoothing;
mod units;

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics, SegmentMetrics};
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;
use tempfile::TempDir;

/// A voltage that follows its drive through a pole, and wanders.
const LAG: &str = r#"
name = "lag"
[device.equations]
states = { x = "V" }
inputs = { drive = "V" }
interpolation = "hold"
derivative = { x = "(k*drive - x)/tau" }
measure = { y = "c*x in V" }
noise = { y = "n", x = "q" }
parameters = { tau = "1 ms", k = "1", c = "1", n = "1e-4 V^2", q = "1e-2 V^2/s" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { drive = "drive_V", y = "y_V" }
reference = { file = "reference.csv", channels = { x = "x_V" } }
[estimate]
skip = "5 ms"
"#;

const EKF: &str = "[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = { x = \"0 V\" }\nstart_sd = { x = \"0.3 V\" }\n";

const INTERVAL_S: f64 = 1e-5;
const TAU_S: f64 = 1e-3;

/// How the device moves and is read: the density of its wandering in V²/s, and the noise of a sample in its standard deviations of 10 mV, from a source of
/// normal numbers.
struct Lag<'a> {
    samples: u32,
    density: f64,
    noise: &'a mut dyn FnMut(&mut WhiteNoise) -> f64,
}

impl Lag<'_> {
    /// Writes recording and reference, by the exact step of a drive that is held.
    fn record(&mut self, folder: &Path, seed: u64) {
        let mut chance = WhiteNoise::new(seed, 8);
        let decay = (-INTERVAL_S / TAU_S).exp();
        let wanders = (0.5 * self.density * TAU_S * (1.0 - decay * decay)).sqrt();
        let mut x = 0.3 * chance.sample();
        let (mut recording, mut reference) = ("time_s,drive_V,y_V\n".to_owned(), "time_s,x_V\n".to_owned());
        for k in 0..self.samples {
            let time_s = f64::from(k) * INTERVAL_S;
            let drive = 1.0 + (TAU * 300.0 * time_s).sin();
            let y = x + 1e-2 * (self.noise)(&mut chance);
            writeln!(recording, "{time_s:e},{drive:e},{y:e}").unwrap();
            writeln!(reference, "{time_s:e},{x:e}").unwrap();
            x = decay * x + (1.0 - decay) * drive + wanders * chance.sample();
        }
        std::fs::write(folder.join("recording.csv"), recording).unwrap();
        std::fs::write(folder.join("reference.csv"), reference).unwrap();
    }
}

/// A recording of white noise whose device wanders as its text says.
fn usual(samples: u32, seed: u64) -> TempDir {
    recorded(Lag { samples, density: 1e-2, noise: &mut WhiteNoise::sample }, seed)
}

fn recorded(mut lag: Lag, seed: u64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    lag.record(folder.path(), seed);
    folder
}

fn parsed(text: &str, folder: &TempDir) -> Experiment {
    published().parse(text, &folder.path().join("experiment.toml")).unwrap_or_else(|why| panic!("{why}"))
}

fn segment(text: &str, folder: &TempDir) -> SegmentMetrics {
    let outcome = workflow::estimate(published(), &parsed(text, folder), &Silent).unwrap();
    Metrics::of(&outcome).recordings.swap_remove(0).segments.swap_remove(0)
}

fn filters(text: &str, folder: &TempDir) -> Vec<EstimatorMetrics> {
    segment(text, folder).estimators
}

//! Resonance, damping and comb of the threshold-sensing scanner from free decays with a reference, and what is said without one.

use super::chance::Chance;
use super::harm::{Harm, error, named, ratio};
use super::rows::Rows;
use kalmems::config::Experiment;
use kalmems::diagnose::identify;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// f_n, ζ, N_g, N_θ, θ_th: the device of Chen et al. 2019.
const TRUTH: [f64; 5] = [624.6, 0.0066, 2.82e-3, 76.0, 3.7e-3];
const NAMES: [&str; 5] =
    ["natural frequency", "damping ratio", "comb gain", "comb steepness", "threshold angle"];
const NOISE_V: f64 = 0.0435;
const RATE_HZ: f64 = 250e3;

/// Where it starts, nearly, of a decay in closed form: θ(t) = e^{−ζωt}·(c·cos ω_d·t + s·sin ω_d·t), read by comb and detector.
fn decay(chance: &mut Chance, (amplitude, samples, noise): (f64, usize, f64), folder: &Path) -> [f64; 2] {
    let [hz, ratio, gain, steepness, threshold] = TRUTH;
    let natural = TAU * hz;
    let damped = natural * (1.0 - ratio * ratio).sqrt();
    let phase = TAU * chance.uniform();
    let motion = |time: f64| {
        let shrunk = amplitude * (-ratio * natural * time).exp();
        let (sine, cosine) = (damped * time + phase).sin_cos();
        [shrunk * sine, shrunk * (damped * cosine - ratio * natural * sine)]
    };
    let offset = chance.between(-5e-3, 5e-3);
    let mut rows = "time_s,drive_V,cap_V,psd_V\n".to_owned();
    for k in 0..samples {
        let time = k as f64 / RATE_HZ;
        let [angle, rate] = motion(time);
        let curve = 1.0 / (1.0 + (-steepness * (angle - threshold)).exp()) - 0.5;
        let signal = gain * curve * rate + offset + noise * chance.normal();
        let position = 0.0327 / 0.5e-3 * motion(time - 0.114e-3)[0].tan() + 5e-3 * chance.normal();
        writeln!(rows, "{time:.7},0,{signal:e},{position:e}").unwrap();
    }
    fs::write(folder.join("decay.csv"), rows).unwrap();
    // As well as a laboratory knows the start.
    let [angle, rate] = motion(0.0);
    [angle + 5e-3 * chance.normal(), rate + 20.0 * chance.normal()]
}

/// What stands beside the signal for a laboratory that has a position detector and set the start, and for one that has neither.
fn beside(start: Option<[f64; 2]>) -> [String; 2] {
    let Some([angle, rate]) = start else {
        return [String::new(), "start = \"from_signal\"".to_owned()];
    };
    let start = format!(
        "start = {{ angle = \"{angle:e} rad\", rate = \"{rate} rad/s\" }}\nstart_sd = {{ angle = \"5 mrad\", rate = \"20 rad/s\" }}"
    );
    ["[recording.reference]\nchannels = { position = \"psd_V\" }\ndelay = \"0.114 ms\"\n".to_owned(), start]
}

fn told(folder: &Path, factors: [f64; 5], start: Option<[f64; 2]>, noise_v: f64) -> Experiment {
    let [hz, ratio, gain, steepness, threshold] = std::array::from_fn(|i| TRUTH[i] * factors[i]);
    let [reference, start] = beside(start);
    let text = format!(
        r#"
name = "threshold"
[device.threshold_scanner.resonator]
natural_frequency = "{hz} Hz"
damping_ratio = {ratio}
[device.threshold_scanner.comb]
threshold_angle = "{threshold:e} rad"
gain = "{gain:e} V s/rad"
steepness = "{steepness} 1/rad"
[device.threshold_scanner.readout]
feedback_resistance = "10 Mohm"
bias = "10 V"
offset = "0 V"
feedthrough_capacitance = "0 F"
noise_variance = "{:e} V^2"
[device.threshold_scanner.position_detector]
gain = "0.5 mm/V"
distance = "32.7 mm"
noise_variance = "2.5e-5 V^2"
[[recording]]
role = "ring_down"
file = "decay.csv"
clock = {{ column = "time_s" }}
channels = {{ drive = "drive_V", signal = "cap_V" }}
{reference}[estimate]
skip = "3 ms"
[estimate.process_noise]
angular_acceleration = "1 rad^2/s^3"
[[estimate.filter]]
name = "EKF"
method = "ekf"
{start}
"#,
        noise_v * noise_v
    );
    published().parse(&text, &folder.join("experiment.toml")).unwrap()
}

/// Error of the angle after over that before.
fn identified(
    words: &str,
    runs: u64,
    record: (f64, usize, f64),
    most_wrong: f64,
    rows: &mut Rows,
) -> Vec<f64> {
    rows.of_recordings(0..runs, |seed, folder, rows| {
        let mut chance = Chance::new(11_000 + seed);
        let start = decay(&mut chance, record, folder);
        let limits = [0.01_f64.min(most_wrong), most_wrong, most_wrong, most_wrong, most_wrong];
        let factors = limits.map(|limit| chance.between(-limit, limit).exp());
        let told = told(folder, factors, Some(start), record.2);
        let before = error(&told, "angle");
        let found = match identify(published(), &told, &Silent) {
            Ok(found) => found,
            Err(refused) => {
                println!("{words}, seed {seed}: refused: {refused}");
                return 1.0;
            }
        };
        for (name, truth) in NAMES.into_iter().zip(TRUTH) {
            rows.push(&format!("{words}, {name}"), truth, named(&found, name));
        }
        ratio(error(&found.experiment, "angle"), before)
    })
}

/// The same without a reference, where resonance and damping ratio are sought.
fn told_without_reference(folder: &Path, factors: [f64; 5]) -> Experiment {
    let told = told(folder, factors, None, NOISE_V);
    let parameters =
        "[identify]\nparameters = [\"resonator.natural_frequency\", \"resonator.damping_ratio\"]\n";
    published().parse(&format!("{}{parameters}", told.text()), &folder.join("experiment.toml")).unwrap()
}

/// Resonance and damping ratio from the signal alone. The comb is told on a scale of the angle that is up to 30 % wrong: the threshold larger by
/// a factor, gain and steepness smaller by it, which gives the same signal.
fn without_reference(runs: u64, rows: &mut Rows) {
    let refused = rows.of_recordings(0..runs, |seed, folder, rows| {
        let mut chance = Chance::new(13_000 + seed);
        decay(&mut chance, LONG, folder);
        let [hz, ratio, scale] = [0.01, 0.3, 0.3].map(|limit: f64| chance.between(-limit, limit).exp());
        let told = told_without_reference(folder, [hz, ratio, 1.0 / scale, 1.0 / scale, scale]);
        let found = match identify(published(), &told, &Silent) {
            Ok(found) => found,
            Err(refused) => {
                println!("without a reference, seed {seed}: refused: {refused}");
                return true;
            }
        };
        for not in &found.undetermined {
            println!("without a reference, seed {seed}, told {hz:.4} {ratio:.3}: {}: {}", not.what, not.why);
        }
        for (found, (name, truth)) in found.parameters.iter().zip(NAMES.into_iter().zip(TRUTH)) {
            rows.push(&format!("threshold without a reference, {name}"), truth, found);
        }
        !found.undetermined.is_empty()
    });
    let refused = refused.into_iter().filter(|refused| *refused).count();
    println!("threshold without a reference: {refused} of {runs} not written");
}

/// Frequency 0.5 % too high and damping 10 % too large: the start takes another number of samples with another frequency, and the search went no
/// further than to where it takes six more.
#[test]
fn a_search_goes_on_where_a_start_takes_other_samples() {
    let folder = tempfile::tempdir().unwrap();
    decay(&mut Chance::new(13_000), LONG, folder.path());
    let told = told_without_reference(folder.path(), [1.005, 1.1, 1.0, 1.0, 1.0]);
    let found = identify(published(), &told, &Silent).unwrap();
    assert!(found.undetermined.is_empty(), "{:?} {:?}", found.undetermined, found.warnings);
    for (parameter, truth) in found.parameters.iter().zip(TRUTH) {
        let off = (parameter.value - truth) / parameter.standard_error;
        println!("{}: {} ± {:.1e}, off {off:.2}", parameter.name, parameter.value, parameter.standard_error);
        assert!(off.abs() < 4.0 && parameter.standard_error < 0.02 * truth, "{parameter:?}");
    }
}

/// With a gain that is 20 % wrong no resonance explains the signal: nothing is written, and no interval is printed.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_what_the_innovations_contradict_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    decay(&mut Chance::new(2), LONG, folder.path());
    let told = told_without_reference(folder.path(), [1.001, 1.05, 1.2, 1.0, 1.0]);
    let found = identify(published(), &told, &Silent).unwrap();
    assert_eq!(found.experiment.text(), told.text());
    assert_eq!(found.undetermined.len(), 2, "{:?}", found.undetermined);
    for (not, parameter) in found.undetermined.iter().zip(&found.parameters) {
        assert!(not.why.contains("the innovations contradict"), "{not:?}");
        assert!(parameter.standard_error.is_infinite(), "{parameter:?}");
    }
    assert!(
        found.warnings.iter().any(|warning| warning.contains("another number is wrong")),
        "{:?}",
        found.warnings
    );
}

/// What is known up to the scale alone is said where a reference is missing.
#[test]
fn a_decay_without_a_reference_is_refused_with_what_it_determines() {
    let folder = tempfile::tempdir().unwrap();
    decay(&mut Chance::new(1), LONG, folder.path());
    let told = told(folder.path(), [1.0; 5], None, NOISE_V);
    let why = identify(published(), &told, &Silent).unwrap_err().to_string();
    for part in ["scale of the angle", "gain and steepness smaller", "resonator.natural_frequency"] {
        assert!(why.contains(part), "{why}");
    }
}

const LONG: (f64, usize, f64) = (0.15, 6000, NOISE_V);
/// A small motion behind much noise.
const POOR: (f64, usize, f64) = (0.06, 5000, 3.0 * NOISE_V);

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_few_threshold_scanners() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    let ratios = identified("threshold", 2, LONG, 0.3, &mut rows);
    harm.take("threshold", ratios);
    without_reference(2, &mut rows);
    harm.judge();
    rows.judge();
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_threshold_scanners() {
    let (mut rows, mut harm) = (Rows::default(), Harm::default());
    let ratios = identified("threshold", 100, LONG, 0.3, &mut rows);
    harm.take("threshold", ratios);
    let mut unjudged = Rows::default();
    harm.take("threshold, little told, right", identified("poor", 60, POOR, 0.0, &mut unjudged));
    harm.take("threshold, little told, wrong", identified("poor", 60, POOR, 0.3, &mut unjudged));
    harm.judge();
    rows.judge();
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_threshold_scanners_without_a_reference() {
    let mut rows = Rows::default();
    without_reference(100, &mut rows);
    rows.judge();
}

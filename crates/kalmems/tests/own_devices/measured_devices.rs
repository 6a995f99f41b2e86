//! Devices that others measured, described as equations and identified from their recordings alone, beside what an independent
//! least-squares fit of the same samples finds.
//!
//! The swinging-gate seismometer: six free decays of its position sensor, 10 samples per second (caspar/PhysicsLab, MIT licence).
//! The Silverbox: an electronic Duffing oscillator (Wigren and Schoukens, 2013; biaslab/nsi-silverbox, MIT licence).

use kalmems::diagnose::likeliest;
use kalmems::identify::Identification;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use std::path::{Path, PathBuf};

pub fn data(file: &str) -> String {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names a folder");
    std::fs::read_to_string(PathBuf::from(folder).join("real").join(file)).unwrap()
}

fn identified(text: &str, folder: &Path) -> Identification {
    let experiment = published().parse(text, &folder.join("experiment.toml")).unwrap();
    likeliest(published(), &experiment, &Silent).unwrap()
}

/// Value and standard error of a parameter.
fn of(found: &Identification, name: &str) -> (f64, f64) {
    let name = format!("parameters.{name}");
    let found = found.parameters.iter().find(|parameter| parameter.name == name).unwrap();
    (found.value, found.standard_error)
}

pub const SEISMOMETER: &str = r#"
name = "seismometer"
[device.equations.states]
x = "V"
v = "V/s"
[device.equations.parameters]
rate = "0.7 rad/s"
damping = 0.1
offset = "1 mV"
noise = "1e-4 V^2"
[device.equations.derivative]
x = "v"
v = "-rate^2*x - 2*damping*rate*v"
[device.equations.measure]
out = "x + offset in V"
[device.equations.noise]
out = "noise"
[[recording]]
role = "ring_down"
file = "decay.csv"
clock = { column = "time_s" }
channels = { out = "voltage_V" }
[identify]
parameters = ["rate", "damping", "offset", "noise"]
[estimate]
skip = "0 s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
# Least squares take all samples.
gate = false
start = { x = "0 V", v = "0 V/s" }
start_sd = { x = "20 V", v = "20 V/s" }
"#;

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn free_decays_of_a_seismometer_give_what_least_squares_gives() {
    let expected: serde_json::Value =
        serde_json::from_str(&data("seismometer_free_decay/expected.json")).unwrap();
    for (name, case) in expected["cases"].as_object().unwrap() {
        let number = |key: &str| case[key].as_f64().unwrap();
        let rows = data(&format!("seismometer_free_decay/{name}"));
        let in_window = |row: &&str| {
            let time: f64 = row.split(',').next().unwrap().parse().unwrap();
            (number("t_start_s") - 1e-9..=number("t_end_s") + 1e-9).contains(&time)
        };
        let kept: Vec<&str> = rows.lines().skip(1).filter(in_window).collect();
        let folder = tempfile::tempdir().unwrap();
        let csv = format!("time_s,voltage_V\n{}\n", kept.join("\n"));
        std::fs::write(folder.path().join("decay.csv"), csv).unwrap();
        let found = identified(SEISMOMETER, folder.path());
        let (rate, damping) = (of(&found, "rate").0, of(&found, "damping").0);
        let own_rate = number("f0_hz") * std::f64::consts::TAU;
        let off = [
            (rate - own_rate) / (number("fd_sd_hz") * std::f64::consts::TAU),
            (damping - number("zeta")) / (number("alpha_sd") / own_rate),
        ];
        println!(
            "{name}: {rate:.5} rad/s, {damping:.5}; off by {:.3} and {:.3} of their standard errors",
            off[0], off[1]
        );
        // Without noise of the ground the likelihood of innovations is the sum of squares; what is left is the prior of the start.
        assert!(off.iter().all(|off| off.abs() < 0.1), "{name}: {off:?}");
        // Their residuals are those of the filter.
        let (noise, _) = of(&found, "noise");
        assert!((noise.sqrt() / number("rms_residual") - 1.0).abs() < 0.03, "{name}: {noise}");
        if name == "blow_1.csv" {
            // Its authors chose the numbers of a decaying sine by eye, and wrote a period of 14.25 s and a quality factor of 9 into the figure
            // of this recording (14_Seismometer/img/blowfit.png).
            let (period_s, quality) = (std::f64::consts::TAU / rate, 0.5 / damping);
            println!("period {period_s:.2} s and quality factor {quality:.2}, by its authors 14.25 s and 9");
            assert!((period_s / 14.25 - 1.0).abs() < 0.1 && (quality / 9.0 - 1.0).abs() < 0.3);
        }
        // The ground moves too, which the innovations show in every one of them.
        assert!(!found.warnings.is_empty(), "{name}");
    }
}

pub const SILVERBOX: &str = r#"
name = "silverbox"
[device.equations.states]
y = "V"
v = "V/s"
[device.equations.inputs]
u = "V"
[device.equations.parameters]
w2 = "1.7e5 1/s^2"
damping = "50 1/s"
a3 = "5e5 1/(V^2 s^2)"
g = "1.7e5 1/s^2"
u0 = "8 mV"
y0 = "3 mV"
q = "1e-4 V^2/s^3" # nearly none: the motion is the model's own, as in the fit it is compared with
[device.equations.derivative]
y = "v"
v = "g*(u - u0) - damping*v - w2*y - a3*y^3"
[device.equations.measure]
out = "y + y0 in V"
[device.equations.noise]
out = "1e-8[V^2]"
v = "q"
[[recording]]
role = "training"
file = "train.csv"
clock = { rate = "610.3515625 Hz" }
channels = { u = "u_V", out = "y_V" }
[identify]
parameters = ["w2", "damping", "a3", "g", "u0", "y0"]
# The device is no Duffing oscillator to a ten-thousandth.
despite_innovations = true
[estimate]
skip = "0.2 s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { y = "0 V", v = "0 V/s" }
start_sd = { y = "0.1 V", v = "40 V/s" }
"#;

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn long_the_silverbox_is_identified_from_its_text() {
    let expected: serde_json::Value = serde_json::from_str(&data("silverbox/expected.json")).unwrap();
    let own = &expected["duffing_greybox_fit"]["parameters"];
    let rows = data("silverbox/snls80mv.csv");
    let kept: Vec<&str> = rows.lines().skip(1 + 40_500).take(57_868 - 40_500).collect();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("train.csv"), format!("u_V,y_V\n{}\n", kept.join("\n"))).unwrap();
    let found = identified(SILVERBOX, folder.path());
    // Their input is band-limited between samples, ours a cubic, which at nine samples per cycle of the resonance is half a per cent too
    // small: the gain makes up for that.
    let mut off: Vec<&str> = Vec::new();
    for (name, theirs, close) in
        [("w2", "w2", 5e-4), ("damping", "d", 2e-3), ("a3", "a3", 2e-3), ("g", "g", 0.01)]
    {
        let (value, sd) = of(&found, name);
        let theirs = own[theirs].as_f64().unwrap();
        println!("{name}: {value:.5e} ± {sd:.1e}, theirs {theirs:.5e}");
        off.extend(((value / theirs - 1.0).abs() >= close).then_some(name));
    }
    assert!(off.is_empty(), "{off:?}");
    // What is left is told: the standard errors do not have it.
    assert!(!found.warnings.is_empty());
    let rms = simulated_rms(&found, folder.path());
    println!("simulated over samples 101 to 40 100, which were not fitted: {:.3} mV rms", 1e3 * rms);
    // Those who published the recording report 0.639 mV of a polynomial NARMAX model of third order over these samples
    // (experiments/experiment-NARMAXpol3.ipynb), the independent fit of this equation 0.388 mV.
    assert!(rms < 0.639e-3, "{rms:e}");
}

/// The root mean square of what the identified equations leave of the samples that were not fitted, without any correction by them.
fn simulated_rms(found: &Identification, folder: &Path) -> f64 {
    let rows = data("silverbox/snls80mv.csv");
    let kept: Vec<&str> = rows.lines().skip(1 + 100).take(40_000).collect();
    std::fs::write(folder.join("train.csv"), format!("u_V,y_V\n{}\n", kept.join("\n"))).unwrap();
    let mut document: toml::Table = found.experiment.to_toml().unwrap().parse().unwrap();
    let filter = document["estimate"]["filter"][0].as_table_mut().unwrap();
    filter.insert("method".into(), "model".into());
    filter.remove("start_sd");
    let text = toml::to_string(&document).unwrap();
    let experiment = published().parse(&text, &folder.join("experiment.toml")).unwrap();
    let rig = published().rig(&experiment).unwrap();
    let file = experiment.resolve(&experiment.recording(0).unwrap().file);
    let recording = SampledRecording::read(&file, &rig.layout(&experiment, 0).unwrap()).unwrap();
    let estimates = rig.estimate(&experiment, 0, &recording, &Silent).unwrap();
    let trajectory = &estimates[0].trajectories[0];
    let (offset, _) = of(found, "y0");
    let left = trajectory.signal.iter().zip(&trajectory.state("y").unwrap().mean);
    let square = left.map(|(seen, y)| (seen - y - offset).powi(2)).sum::<f64>();
    (square / trajectory.signal.len() as f64).sqrt()
}

//! Quantities that follow from parameters alone: a filter that holds a parameter as a state says them with their deviation, and a reference may know them.

use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::workflow::estimate;
use std::fmt::Write as _;
use std::fs;

/// A lag of 5 ms under a square wave, whose time constant the experiment states 4 % too large.
const LAG: &str = r#"
name = "lag"
[device.equations]
states = { x = "V" }
inputs = { u = "V" }
interpolation = "hold"
parameters = { tau = "5.2 ms" }
derivative = { x = "(u - x)/tau" }
measure = { signal = "x in V" }
quantities = { corner = "1/(2*pi*tau) in Hz" }
noise = { signal = "1e-4[V^2]", x = "1e-8[V^2/s]" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { u = "u_V", signal = "signal_V" }
reference = { file = "reference.csv", channels = { corner = "corner_Hz" } }
[estimate]
skip = "0.2 s"
[[estimate.filter]]
name = "As a state"
method = "ekf"
start = { x = "0 V" }
start_sd = { x = "0.1 V" }
states = { tau = { start_sd = "5 %" } }
[[estimate.filter]]
name = "As stated"
method = "ekf"
start = { x = "0 V" }
start_sd = { x = "0.1 V" }
"#;

const TAU_S: f64 = 5e-3;

#[test]
fn a_quantity_of_parameters_is_estimated_with_them_and_held_against_a_reference() {
    let folder = tempfile::tempdir().unwrap();
    let (interval, mut x, mut state) = (1e-3, 0.0_f64, 11_u64);
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let corner = 1.0 / (std::f64::consts::TAU * TAU_S);
    let (mut recording, mut reference) =
        ("time_s,u_V,signal_V\n".to_owned(), "time_s,corner_Hz\n".to_owned());
    for k in 0..4000 {
        let u = if (k / 20) % 2 == 0 { 1.0 } else { -1.0 };
        // The sum of twelve uniform numbers has the variance 1.
        let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let _ = writeln!(recording, "{:.3},{u},{:e}", f64::from(k) * interval, x + 1e-2 * noise);
        let _ = writeln!(reference, "{:.3},{corner:e}", f64::from(k) * interval);
        x = u + (x - u) * (-interval / TAU_S).exp();
    }
    fs::write(folder.path().join("recording.csv"), recording).unwrap();
    fs::write(folder.path().join("reference.csv"), reference).unwrap();
    let experiment = published().parse(LAG, &folder.path().join("lag.toml")).unwrap();
    let metrics = Metrics::of(&estimate(published(), &experiment, &Silent).unwrap());
    let [as_state, as_stated] = ["as_a_state", "as_stated"].map(|key| {
        let one = metrics.estimators().find(|one| one.key == key).unwrap();
        one.values["corner"].clone()
    });
    println!("{as_state:?}\n{as_stated:?}");
    // 31.83 Hz: found to a part in a thousand, and within three of its claimed deviations.
    let claim = as_state.claim.unwrap();
    assert!(as_state.rmse < 0.1 && claim.mean_square < 9.0, "{as_state:?}");
    // As it is stated it is 4 % off, and nothing is claimed of a number that is not estimated.
    assert!(
        (as_stated.rmse - corner * (1.0 - 1.0 / 1.04)).abs() < 1e-6 && as_stated.claim.is_none(),
        "{as_stated:?}"
    );
}

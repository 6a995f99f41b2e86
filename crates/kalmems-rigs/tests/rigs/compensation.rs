//! Columns that are compensated over the temperature, in an estimate.

use super::methods::estimate;
use kalmems_rigs::published;
use std::fmt::Write as _;
use std::fs;

const TURNING: &str = r#"
name = "turning"
[device.equations.states]
theta = "rad"
omega = "rad/s"
[device.equations.parameters]
w = "40 rad/s"
[device.equations.derivative]
theta = "omega"
omega = "-w^2*theta"
[device.equations.measure]
gyro = "omega in rad/s"
[device.equations.noise]
gyro = "1e-6[rad^2/s^2]"
[estimate]
skip = "8 ms"
[[estimate.filter]]
name = "ekf"
method = "ekf"
start = { theta = "0 rad", omega = "0 rad/s" }
start_sd = { theta = "0.1 rad", omega = "4 rad/s" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
"#;

const COMPENSATED: &str = r#"
[recording.channels.gyro]
column = "shown_rad_per_s"
[recording.channels.gyro.compensation]
file = "temperature.json"
temperature = { column = "unit", unit = "K", offset = "273.15 K" }
bias = "bias"
scale_factor = "scale"
cross_axis = { other_rad_per_s = "cross" }
"#;

/// A bias that bends, a scale factor and a cross-axis sensitivity, as a calibration writes them.
const CURVES: &str = r#"[
{ "name": "bias", "unit": "rad/s", "range_k": [290.0, 320.0], "pieces": [
  { "reference_k": 290.0, "coefficients": [0.05, 2e-3, 1e-4] }, { "reference_k": 305.0, "coefficients": [0.1025, -3e-3] }] },
{ "name": "scale", "unit": "1", "range_k": [290.0, 320.0], "pieces": [{ "reference_k": 300.0, "coefficients": [1.02, -4e-4] }] },
{ "name": "cross", "unit": "1", "range_k": [290.0, 320.0], "pieces": [{ "reference_k": 300.0, "coefficients": [0.03, 1e-4] }] }
]"#;

/// The estimate from the compensated column is that from the true rate, as a whole and in parts; from what the gyroscope shows it is another one.
#[test]
fn an_estimate_takes_the_compensated_column() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = "time_s,unit,true_rad_per_s,other_rad_per_s,shown_rad_per_s\n".to_owned();
    for k in 0..12_000 {
        let time = 1e-3 * f64::from(k);
        let off = 24.0 * f64::from(k) / 12_000.0;
        let kelvin = 293.15 + off;
        let noise = 1e-3 * (f64::from(k * 7919 % 1009) / 504.0 - 1.0);
        let (rate, other) = (2.0 * (40.0 * time).cos() + noise, (7.0 * time).sin());
        let bias = if kelvin < 305.0 {
            0.05 + 2e-3 * (kelvin - 290.0) + 1e-4 * (kelvin - 290.0).powi(2)
        } else {
            0.1025 - 3e-3 * (kelvin - 305.0)
        };
        let (scale, cross) = (1.02 - 4e-4 * (kelvin - 300.0), 0.03 + 1e-4 * (kelvin - 300.0));
        let shown = scale * rate + bias + cross * other;
        writeln!(rows, "{time:.4},{:.13},{rate:.13},{other:.13},{shown:.13}", 20.0 + off).unwrap();
    }
    fs::write(folder.path().join("recording.csv"), rows).unwrap();
    fs::write(folder.path().join("temperature.json"), CURVES).unwrap();
    let plain = |column: &str| format!("[recording.channels]\ngyro = \"{column}\"\n");
    let each = [plain("true_rad_per_s"), COMPENSATED.to_owned(), plain("shown_rad_per_s")].map(|channels| {
        let text = format!("{TURNING}{channels}");
        let experiment = published().parse(&text, &folder.path().join("experiment.toml")).unwrap();
        let found = estimate(&experiment).unwrap();
        found.trajectories[0].states[1].mean.clone()
    });
    let [truth, compensated, shown] = each;
    let apart = |other: &[f64]| truth.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart(&compensated) < 1e-9, "{}", apart(&compensated));
    assert!(apart(&shown) > 1e-2, "{}", apart(&shown));
}

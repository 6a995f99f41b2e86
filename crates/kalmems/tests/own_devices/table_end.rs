//! A motion that leaves the points of a table says so, simulated and estimated.

use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::estimate_computed;
use std::path::Path;

/// A mass on a spring before an electrode whose capacitance is a table of ±2 µm.
const TABLE: &str = r#"
name = "plate"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { force = "N" }
[device.equations.tables]
C = { x = [-2.0, -1.0, 0.0, 1.0, 2.0], y = [9.0, 9.4, 10.0, 10.8, 11.8], x_unit = "um", y_unit = "fF"OUTSIDE }
[device.equations.parameters]
m = "1e-9 kg"
k = "0.0394784176 N/m" # 1 kHz
b = "6.2832e-8 N s/m"
[device.equations.derivative]
x = "v"
v = "(force - b*v - k*x)/m"
[device.equations.measure]
signal = "C(x) in fF"
[device.equations.noise]
signal = "1e-34[F^2]"
[simulate]
duration = "20 ms"
sampling_rate = "100 kHz"
integration_rate = "100 kHz"
start = { x = "0 m", v = "0 m/s" }
seed = 1
[simulate.drive.inputs.force.sine]
amplitude = "AMPLITUDE"
frequency = "1 kHz"
[estimate]
skip = "2 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "0 m", v = "0 m/s" }
start_sd = { x = "0.1 um", v = "1 mm/s" }
"#;

/// At resonance the motion grows by 50 nN·t/(2·m·ω), to 2 µm within two thirds of a period.
fn experiment(outside: &str) -> Experiment {
    let text = TABLE.replace("AMPLITUDE", "50 nN").replace("OUTSIDE", outside);
    published().parse(&text, Path::new("nowhere/experiment.toml")).unwrap()
}

#[test]
fn a_simulation_that_leaves_a_table_names_it_and_not_the_rate_of_integration() {
    let experiment = experiment("");
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let refused = ComputedRecording::of(simulation.as_ref(), &Silent).err().unwrap().to_string();
    assert!(
        refused.contains("it leaves the table `C`") && refused.contains("`outside = \"linear\"`"),
        "{refused}"
    );
    assert!(!refused.contains("integration_rate"), "{refused}");
}

#[test]
fn a_filter_that_leaves_a_table_is_said_to() {
    let (extended, ended) = (experiment(", outside = \"linear\""), experiment(""));
    let simulation = published().rig(&extended).unwrap().simulate(&extended).unwrap();
    let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    let outcome =
        estimate_computed(published(), &described(&ended, simulation.as_ref()), &all, &Silent).unwrap();
    let estimate = &outcome.recordings[0].segments[0].estimate;
    let text = format!("{:?} {:?}", estimate.remarks, estimate.trajectories[0].failure);
    assert!(estimate.remarks.iter().any(|remark| remark.contains("it leaves the table `C`")), "{text}");
}

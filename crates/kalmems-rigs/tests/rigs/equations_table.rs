//! The table of a device of one's own, as an experiment file has it.

use kalmems_engines::config::Experiment;
use kalmems_rigs::equations::EquationsTable;
use kalmems_rigs::published;
use std::path::Path;

fn loaded(text: &str) -> Result<Experiment, String> {
    published().parse(text, Path::new("own.toml")).map_err(|error| error.to_string())
}

const DEVICE: &str = r#"
name = "own"
[device.equations.states]
x = "m"
a = "m/s"
[device.equations.parameters]
w = "2e4 rad/s"
gain = "2 V/um"
[device.equations.derivative]
x = "a"
a = "-w^2*x"
[device.equations.measure]
signal = "gain*x in V"
[simulate]
duration = "1 ms"
sampling_rate = "100 kHz"
integration_rate = "1 MHz"
start = { x = "1 um", a = "0 m/s" }
[simulate.drive.constant]
voltage = "0 V"
"#;

#[test]
fn the_order_of_the_file_is_kept_and_comes_back() {
    let experiment = loaded(DEVICE).unwrap();
    let order = |experiment: &Experiment| -> Vec<String> {
        let table = experiment.device::<EquationsTable>().unwrap();
        table.states.iter().map(|(name, _)| name.to_owned()).collect()
    };
    assert_eq!(order(&experiment), ["x", "a"]);
    let written = experiment.to_toml().unwrap();
    assert_eq!(order(&loaded(&written).unwrap()), ["x", "a"], "{written}");
}

#[test]
fn a_mistake_in_the_equations_is_reported_with_its_line_and_a_mark() {
    let wrong = DEVICE.replace("\"-w^2*x\"", "\"-w^2*y\"");
    insta::assert_snapshot!(loaded(&wrong).unwrap_err());
    let wrong = DEVICE.replace("gain*x in V", "gain*a in V");
    insta::assert_snapshot!(loaded(&wrong).unwrap_err());
}

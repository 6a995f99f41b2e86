//! Devices of one's own in a loop: the law of the controller stands in the equations, and an input follows it from sample to sample.

use kalmems::config::Experiment;
use kalmems::evaluate::Grade;
use kalmems::expand::expand;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, Simulation, described};
use kalmems::workflow::estimate_computed;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;
use toml::{Table, Value};

/// A resonator whose amplitude is held: a demodulator of two lags turns with the drive, and a controller of proportion and integral
/// commands the amplitude of the drive.
const REGULATED: &str = r#"
name = "regulated"
[device.equations]
states = { x = "m", v = "m/s", turn = "rad", along = "m", across = "m", summed = "V" }
inputs = { level = "V" }
interpolation = "hold"
cyclic = { turn = "2*pi" }
[device.equations.let]
size = "sqrt(along^2 + across^2 + 1e-20[m^2])"
missing = "wanted - size"
[device.equations.derivative]
x = "v"
v = "(force*level*cos(turn) - b*v - k*x)/m"
turn = "2*pi*frequency"
along = "(2*x*cos(turn) - along)/detector"
across = "(2*x*sin(turn) - across)/detector"
summed = "gain*missing/reset"
[device.equations.measure]
signal = "sensitivity*x in V"
command = "gain*missing + summed in V"
[device.equations.noise]
v = "8.0906e-21[J]*b/m^2"
signal = "1e-8[V^2]"
command = "1e-12[V^2]"
[device.equations.parameters]
m = "1e-9 kg"
k = "3.95 N/m"
b = "2.5e-7 N s/m"
force = "1e-8 N/V"
frequency = "10 kHz"
detector = "2 ms"
wanted = "2 um"
gain = "0.8 V/um"
reset = "8 ms"
sensitivity = "0.2 V/um"
[simulate]
duration = "300 ms"
sampling_rate = "200 kHz"
integration_rate = "4 MHz"
start = { x = "0 m", v = "0 m/s", turn = "0 rad", along = "0 m", across = "0 m", summed = "0 V" }
seed = 5
[simulate.drive.inputs.level.feedback]
of = "command"
[estimate]
skip = "5 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
channels = ["signal"]
start = { x = "0 m", v = "0 m/s", turn = "0 rad", along = "0 m", across = "0 m", summed = "0 V" }
start_sd = { x = "1 nm", v = "60 um/s", turn = "1e-6 rad", along = "1 nm", across = "1 nm", summed = "1 mV" }
"#;

fn parsed(text: &str) -> Experiment {
    published().parse(text, Path::new("nowhere/loop.toml")).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Each column of what is simulated, recorded and true, by its name.
fn columns(simulation: &dyn Simulation) -> impl Fn(&str) -> Vec<f64> + use<> {
    let channels = simulation.recorded().iter().chain(simulation.truth());
    let names: Vec<&'static str> = channels.map(|channel| channel.column).collect();
    let mut rows = Vec::new();
    simulation
        .run(&mut |sample| {
            rows.push([sample.recorded, sample.truth].concat());
            ControlFlow::Continue(())
        })
        .unwrap();
    move |name| {
        let place = names.iter().position(|known| *known == name);
        let place = place.unwrap_or_else(|| panic!("no {name} among {names:?}"));
        rows.iter().map(|row: &Vec<f64>| row[place]).collect()
    }
}

/// In closed form the amplitude is the wanted one whatever the stiffness is, under the voltage a·|k − mω² + iωb|/force. What the
/// demodulator lets through of the double frequency, 0.4 % of its output, the loop mixes with the drive: that is 0.1 % of the voltage.
#[test]
fn a_regulator_in_the_equations_holds_an_amplitude_whatever_the_stiffness() {
    for stiffness in [3.95, 3.93] {
        let text = REGULATED.replace("3.95 N/m", &format!("{stiffness} N/m"));
        let experiment = parsed(&text.replace("seed = 5", "seed = 5\nnoise = false"));
        let rig = published().rig(&experiment).unwrap();
        let simulation = rig.simulate(&experiment).unwrap();
        let column = columns(&*simulation);
        let (x, level) = (column("x_m"), column("level_V"));
        // The last 20 ms, 200 cycles of 20 samples.
        let last = |values: &[f64]| values[values.len() - 4000..].to_vec();
        let (x, level) = (last(&x), last(&level));
        let amplitude = (2.0 * x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
        let mean = level.iter().sum::<f64>() / level.len() as f64;
        let omega = TAU * 10e3;
        let expected = 2e-6 * (stiffness - 1e-9 * omega * omega).hypot(2.5e-7 * omega) / 1e-8;
        println!("{stiffness} N/m: {amplitude:e} m under {mean} V, {expected} V in closed form");
        assert!((amplitude / 2e-6 - 1.0).abs() < 2e-3, "{amplitude:e}");
        assert!((mean / expected - 1.0).abs() < 5e-3, "{mean} {expected}");
    }
}

#[test]
fn a_device_in_its_loop_is_estimated_from_what_the_loop_applied() {
    let experiment = parsed(REGULATED);
    let rig = published().rig(&experiment).unwrap();
    let simulation = rig.simulate(&experiment).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let told = described(&experiment, &*simulation);
    let outcome = estimate_computed(published(), &told, &simulated, &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    let filter = metrics.estimators().next().unwrap();
    println!("{:?} {:e}", filter.grade, filter.values["x"].rmse);
    assert_eq!(filter.grade, Some(Grade::Passes));
    // The noise of a sample is 0.5 nm.
    assert!(filter.values["x"].rmse < 0.5e-9);
}

/// The accelerometer's loop of one bit as its rig runs it, and as its equations do with the law of the comparator: both hold the mass as
/// well, and the means of both their bits are the acceleration in units of the full scale. Without noise: the lead of the rig is a
/// difference of two samples, each with its own, that of the equations a derivative.
#[test]
fn a_loop_of_one_bit_in_the_equations_measures_as_that_of_the_rig() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/accelerometer/one_bit.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let steady = "[simulate.drive.acceleration]\namplitude = \"1 gn\"\nfrequency = \"100 Hz\"\n";
    let text = text.replace("duration = \"0.2 s\"", "duration = \"40 ms\"\nnoise = false");
    let text = text.replace("[simulate.drive.acceleration]\n", steady);
    let experiment = published().parse(&text, &file).unwrap();
    let by_rig = columns(&*published().rig(&experiment).unwrap().simulate(&experiment).unwrap());

    let expanded = expand(published(), &experiment).unwrap();
    let mut document: Table = expanded.text.parse().unwrap();
    let equations = document["device"]["equations"].as_table_mut().unwrap();
    let signal = equations["measure"]["signal"].as_str().unwrap().replace(" in V", "");
    let entry = |table: &mut Table, name: &str, key: &str, value: String| {
        table[name].as_table_mut().unwrap().insert(key.into(), Value::String(value));
    };
    // The comparator's law: ten times the output with a lead of 5.6 µs, of which a difference of two samples is the derivative.
    entry(equations, "let", "output", signal);
    entry(equations, "measure", "command", "10*(output + 5.6e-6[s]*ddt(output)) in V".into());
    // The acceleration is that which drives the rig.
    equations["states"].as_table_mut().unwrap().retain(|name, _| name != "acceleration" && name != "jerk");
    equations["derivative"]
        .as_table_mut()
        .unwrap()
        .retain(|name, _| name != "acceleration" && name != "jerk");
    equations["noise"].as_table_mut().unwrap().remove("jerk");
    equations.retain(|name, _| name != "answer" && name != "usual");
    entry(equations, "inputs", "acceleration", "m/s^2".into());
    equations.insert("interpolation".into(), Value::Table("feedback = \"hold\"".parse().unwrap()));
    document.remove("estimate");
    let simulate = document["simulate"].as_table_mut().unwrap();
    simulate.insert(
        "drive".into(),
        Value::Table(
            "[inputs.feedback.feedback]\nof = \"command\"\none_bit = \"86.5 mV\"\n\
             [inputs.acceleration.sine]\namplitude = \"1 gn\"\nfrequency = \"100 Hz\"\n"
                .parse()
                .unwrap(),
        ),
    );
    let own = parsed(&toml::to_string(&document).unwrap());
    let by_text = columns(&*published().rig(&own).unwrap().simulate(&own).unwrap());

    // A full scale of 10 g: what the mean over a window of 0.5 ms of the bits is short of the acceleration.
    let short = |bits: &[f64]| {
        let windows = bits.chunks_exact(500).enumerate().skip(10);
        let each = windows.map(|(k, bits)| {
            let mean = bits.iter().sum::<f64>() / 500.0 / 86.5e-3;
            let time_s = (k as f64 + 0.5) * 500e-6;
            10.0 * mean - (TAU * 100.0 * time_s).sin()
        });
        let each: Vec<f64> = each.collect();
        (each.iter().map(|x| x * x).sum::<f64>() / each.len() as f64).sqrt()
    };
    let rms = |values: &[f64]| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
    let bits = [by_rig("feedback_V"), by_text("feedback_V")];
    assert!(bits.iter().flatten().skip(1).all(|volts| (volts.abs() - 86.5e-3).abs() < 1e-12));
    let [rig, text] = [by_rig("displacement_m"), by_text("displacement_m")].map(|x| rms(&x[5000..]));
    let [rig_short, text_short] = [short(&bits[0]), short(&bits[1])];
    println!(
        "mass {rig:e} and {text:e} m rms; acceleration short by {rig_short} and {text_short} g rms of 0.7 g rms"
    );
    assert!((text / rig - 1.0).abs() < 0.2, "{text:e} {rig:e}");
    assert!(rig_short < 0.1 && text_short < 0.1 && (text_short / rig_short - 1.0).abs() < 0.5);
}

#[test]
fn a_loop_of_what_is_not_there_or_of_another_unit_is_refused() {
    for (of, expected) in [("comand", "did you mean `command`?"), ("signal", "")] {
        let experiment = parsed(&REGULATED.replace("of = \"command\"", &format!("of = \"{of}\"")));
        let refused = published().rig(&experiment).unwrap().simulate(&experiment);
        match refused {
            Err(why) => assert!(why.to_string().contains(expected) && !expected.is_empty(), "{why}"),
            Ok(_) => assert!(expected.is_empty(), "{of}"),
        }
    }
    let text = REGULATED
        .replace("command = \"gain*missing + summed in V\"", "command = \"missing in m\"")
        .replace("command = \"1e-12[V^2]\"", "command = \"1e-24[m^2]\"");
    let experiment = parsed(&text);
    let refused = published().rig(&experiment).unwrap().simulate(&experiment).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("in the unit of the input"), "{refused}");
}

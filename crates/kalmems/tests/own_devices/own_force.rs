//! A force on a mass that is a state, or is given: what filters know before, take as an input and find of the noise, and gains for all times.

use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::workflow::{Outcome, estimate};
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::Path;

/// A mass on a spring under a force that varies like noise through one pole; its displacement is read as a voltage.
const SENSOR: &str = r#"
name = "force_sensor"
[device.equations]
answer = "force"
states = { x = "m", v = "m/s", force = "N" }
inputs = { push = "N" }
interpolation = "hold"
usual = { force = "1e-6 N" }
[device.equations.parameters]
mass = "1e-6 kg"
damping = "1e-3 N s/m"
spring = "10 N/m"
rate = "300 1/s"
size = "1e-6 N"
gain = "1e6 V/m"
[device.equations.derivative]
x = "v"
v = "(force + push - damping*v - spring*x)/mass"
force = "-rate*force"
[device.equations.measure]
signal = "gain*x in V"
[device.equations.noise]
force = "2*rate*size^2"
signal = "1e-4[V^2]"
"#;

const SIMULATED: &str = r#"
[simulate]
duration = "200 ms"
sampling_rate = "50 kHz"
integration_rate = "200 kHz"
start = { x = "0 m", v = "0 m/s", force = "0 N" }
seed = 3
[simulate.drive.inputs.push.steps]
first = "0.2 uN"
step = [{ at = "50 ms", value = "-0.3 uN" }]
"#;

const STATED: &str = "start = { x = \"0 m\", v = \"0 m/s\", force = \"0 N\" }\n\
                      start_sd = { x = \"1 nm\", v = \"1 um/s\", force = \"1e-6 N\" }\n";
const GIVEN: &str = "start = { x = \"0 m\", v = \"0 m/s\" }\nstart_sd = { x = \"1 nm\", v = \"1 um/s\" }\n";

fn filter(name: &str, method: &str, more: &str) -> String {
    format!("[[estimate.filter]]\nname = \"{name}\"\nmethod = \"{method}\"\n{more}\n")
}

/// The sensor with a recording of all that is true, and these filters.
fn text(folder: &Path, filters: &str, channels: &str) -> String {
    let simulated =
        published().parse(&format!("{SENSOR}{SIMULATED}"), &folder.join("simulation.toml")).unwrap();
    let simulation = published().rig(&simulated).unwrap().simulate(&simulated).unwrap();
    let names = simulation.recorded().iter().chain(simulation.truth()).map(|column| column.column);
    let mut csv = format!("time_s,{}\n", names.collect::<Vec<_>>().join(","));
    simulation
        .run(&mut |sample| {
            write!(csv, "{}", sample.time_s).unwrap();
            sample.recorded.iter().chain(sample.truth).for_each(|value| write!(csv, ",{value}").unwrap());
            csv.push('\n');
            ControlFlow::Continue(())
        })
        .unwrap();
    std::fs::write(folder.join("recording.csv"), csv).unwrap();
    format!(
        "{SENSOR}\n[[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = {{ column = \"time_s\" }}\n\
         channels = {{ push = \"push_N\", signal = \"signal_V\"{channels} }}\n[recording.reference]\nfile = \"recording.csv\"\n\
         channels = {{ force = \"force_N\", x = \"x_m\" }}\n[estimate]\nskip = \"20 ms\"\n{filters}"
    )
}

fn parsed(folder: &Path, text: &str) -> Experiment {
    published().parse(text, &folder.join("experiment.toml")).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn run(folder: &Path, text: &str) -> Outcome {
    estimate(published(), &parsed(folder, text), &Silent).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(folder: &Path, text: &str) -> String {
    match published().parse(text, &folder.join("experiment.toml")) {
        Err(error) => error.to_string(),
        Ok(experiment) => estimate(published(), &experiment, &Silent).unwrap_err().to_string(),
    }
}

fn trajectories(outcome: &Outcome) -> &[Trajectory] {
    &outcome.recordings[0].segments[0].estimate.trajectories
}

/// A filter that is given the force has no state of it, knows the displacement better, and says so in its name.
#[test]
fn a_state_that_a_filter_is_given_is_its_input() {
    let folder = tempfile::tempdir().unwrap();
    let given = format!("{GIVEN}known = [\"force\"]\n");
    let filters = filter("honest", "ekf", STATED) + &filter("told", "ekf", &given);
    let with_force = text(folder.path(), &filters, ", force = \"force_N\"");
    let outcome = run(folder.path(), &with_force);
    let metrics = Metrics::of(&outcome);
    let of = |key: &str| metrics.estimators().find(|estimator| estimator.key == key).unwrap();
    let error = |key: &str| of(key).values["x"].rmse;
    // What the mean of both ends leaves of a force that varies like noise is not told.
    assert!(error("told") < 0.5 * error("honest"), "{} {}", error("told"), error("honest"));
    assert_eq!(of("told").name, "told, force known");
    let names: Vec<&str> = trajectories(&outcome)[1].states.iter().map(|state| state.name).collect();
    assert_eq!(names, ["x", "v"]);
    // What the device is for comes first, and is what both are judged by where both have it.
    assert_eq!(outcome.recordings[0].values[0].name, "force");
    assert!(of("honest").values["force"].rmse < 0.5e-6);

    let blind =
        with_force.replace(", force = \"force_N\" }\n[recording.reference]", " }\n[recording.reference]");
    let why = refused(folder.path(), &blind);
    assert!(why.contains("channels.force") && why.contains("name the column"), "{why}");
    let why = refused(folder.path(), &with_force.replace("known = [\"force\"]", "known = [\"forse\"]"));
    assert!(why.contains("known") && why.contains("`force`"), "{why}");
    let why = refused(folder.path(), &with_force.replace("answer = \"force\"", "answer = \"forse\""));
    assert!(why.contains("answer") && why.contains("`force`"), "{why}");
}

/// How large a state usually is counts where the filter says nothing of it, as if the filter had said it.
#[test]
fn a_start_from_the_signal_knows_how_large_a_state_usually_is() {
    let folder = tempfile::tempdir().unwrap();
    let filters = filter("usual", "ekf", "")
        + &filter("said", "ekf", "start_sd = { force = \"1e-6 N\" }\n")
        + &filter("other", "ekf", "start_sd = { force = \"1e-8 N\" }\n");
    let outcome = run(folder.path(), &text(folder.path(), &filters, ""));
    let [usual, said, other] =
        [0, 1, 2].map(|place| &trajectories(&outcome)[place].state("force").unwrap().sd);
    assert_eq!(usual, said);
    assert!(usual[100] != other[100], "{}", usual[100]);
}

/// A filter that is told four times the variance of a sample finds it within what it states: of n samples of equal weight R·√(2/n).
#[test]
fn the_variance_of_a_sample_is_found_while_filtering() {
    let folder = tempfile::tempdir().unwrap();
    let filters = filter("found", "ekf", &format!("{STATED}noise_memory = \"20 ms\"\n"));
    let outcome = run(folder.path(), &text(folder.path(), &filters, "").replace("1e-4[V^2]", "4e-4[V^2]"));
    let noise = trajectories(&outcome)[0].state("noise_variance").unwrap();
    for k in (4000..10_000).step_by(2000) {
        let (found, sd) = (noise.mean[k], noise.sd[k]);
        assert!((found - 1e-4).abs() < 4.0 * sd, "{k}: {found} {sd}");
        assert!((sd / found - (2.0_f64 / 1999.0).sqrt()).abs() < 1e-3, "{sd}");
    }
    let why = refused(
        folder.path(),
        &text(folder.path(), &filters, "")
            .replace("gain*x in V", "x in m")
            .replace("1e-4[V^2]", "1e-16[m^2]"),
    );
    assert!(why.contains("noise_memory") && why.contains("one signal in V"), "{why}");
}

/// Each sample by itself tells the displacement, and the force that holds the mass there: the spring's less what is pushed until then.
#[test]
fn a_sample_by_itself_tells_what_holds_the_measured_state() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = run(folder.path(), &text(folder.path(), &filter("alone", "direct_inversion", ""), ""));
    let found = &trajectories(&outcome)[0];
    let csv = std::fs::read_to_string(folder.path().join("recording.csv")).unwrap();
    let place = |name: &str| csv.lines().next().unwrap().split(',').position(|own| own == name).unwrap();
    let column = |name: &str| -> Vec<f64> {
        csv.lines().skip(1).map(|line| line.split(',').nth(place(name)).unwrap().parse().unwrap()).collect()
    };
    let (signal, push) = (column("signal_V"), column("push_N"));
    let force = found.state("force").unwrap();
    for k in [1, 2500, 5000] {
        let wanted = 10.0 * signal[k] / 1e6 - push[k - 1];
        assert!((force.mean[k] - wanted).abs() < 1e-12 * 1e-6, "{k}: {} {wanted}", force.mean[k]);
        assert!((force.sd[k] - 10.0 * 1e-2 / 1e6).abs() < 1e-9 * force.sd[k], "{}", force.sd[k]);
    }
}

/// A value that follows nothing, and one that decays with 5000/s, read together; without noise.
fn decaying(folder: &Path, filters: &str) -> Outcome {
    let samples = 4000;
    let mut csv = "time_s,y_V\n".to_owned();
    for k in 0..samples {
        let time_s = f64::from(k) * 1e-5;
        writeln!(csv, "{time_s},{}", 1.0 + (-5000.0 * time_s).exp()).unwrap();
    }
    std::fs::write(folder.join("decaying.csv"), csv).unwrap();
    let text = format!(
        "name = \"decay\"\n[device.equations]\nstates = {{ slow = \"V\", fast = \"V\" }}\n\
         derivative = {{ slow = \"0[V/s]\", fast = \"-5000[1/s]*fast\" }}\nmeasure = {{ y = \"slow + fast in V\" }}\n\
         noise = {{ y = \"1e-6[V^2]\", slow = \"1e-6[V^2/s]\", fast = \"1e-6[V^2/s]\" }}\n[[recording]]\nrole = \"test\"\n\
         file = \"decaying.csv\"\nclock = {{ column = \"time_s\" }}\nchannels = {{ y = \"y_V\" }}\n[estimate]\nskip = \"0 s\"\n{filters}"
    );
    run(folder, &text)
}

const OFF: &str =
    "start = { slow = \"1.5 V\", fast = \"0.8 V\" }\nstart_sd = { slow = \"1 V\", fast = \"1 V\" }\n";

/// The error of an observer decays with the corner that is stated, and with what of the device decays faster as it does by itself: what a gain could
/// do is slow it.
#[test]
fn an_observer_leaves_what_decays_faster() {
    let folder = tempfile::tempdir().unwrap();
    let filters =
        filter("placed", "luenberger", &format!("observer_bandwidth = \"100 Hz\"\ngate = false\n{OFF}"));
    let outcome = decaying(folder.path(), &filters);
    let slow = &trajectories(&outcome)[0].state("slow").unwrap().mean;
    let error = |k: usize| (slow[k] - 1.0).abs();
    let rate = (error(300) / error(900)).ln() / 6e-3;
    assert!((rate / (200.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{rate}");
}

/// Of a value that walks at random the gain of the continuous filter is √(q/(R·h)), and each sample adds h times that.
#[test]
fn the_gain_of_the_continuous_filter_is_that_of_its_equation() {
    let folder = tempfile::tempdir().unwrap();
    let (q, variance, interval_s) = (1e-2, 1e-4, 1e-3);
    let mut csv = "time_s,y_V\n".to_owned();
    let sample = |k: i32| (0.7 * f64::from(k)).sin();
    for k in 0..200 {
        writeln!(csv, "{},{}", f64::from(k) * interval_s, sample(k)).unwrap();
    }
    std::fs::write(folder.path().join("walk.csv"), csv).unwrap();
    let text = format!(
        "name = \"walk\"\n[device.equations]\nstates = {{ x = \"V\" }}\nderivative = {{ x = \"0[V/s]\" }}\nmeasure = {{ y = \"x in V\" }}\n\
         noise = {{ y = \"{variance}[V^2]\", x = \"{q}[V^2/s]\" }}\n[[recording]]\nrole = \"test\"\nfile = \"walk.csv\"\n\
         clock = {{ column = \"time_s\" }}\nchannels = {{ y = \"y_V\" }}\n[estimate]\nskip = \"0 s\"\n{}",
        filter("bucy", "kalman_bucy", "gate = false\nstart = { x = \"0 V\" }\nstart_sd = { x = \"1 V\" }\n")
    );
    let outcome = run(folder.path(), &text);
    let found = &trajectories(&outcome)[0].state("x").unwrap().mean;
    let gain = (q / (variance * interval_s)).sqrt() * interval_s;
    let mut wanted = 0.0;
    for (k, found) in found.iter().enumerate() {
        wanted += gain * (sample(i32::try_from(k).unwrap()) - wanted);
        assert!((found - wanted).abs() < 1e-9, "{k}: {found} {wanted}");
    }
}

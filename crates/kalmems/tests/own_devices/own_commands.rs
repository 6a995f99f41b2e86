//! What every rig has, for a device that is described by its equations: a study, a diagnosis, the state that each sample means.

use kalmems::config::Experiment;
use kalmems::diagnose::{DiagnosisFinding, diagnose_recording};
use kalmems::progress::Silent;
use kalmems::results::Output;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::study::{StudyOptions, StudyPlan};
use kalmems::workflow::{Outcome, estimate_computed};
use std::num::NonZero;
use std::path::Path;

/// The comb resonator of the example, simulated for a short time, with one filter.
fn comb() -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/simulation.toml");
    let text = std::fs::read_to_string(file).unwrap();
    let text = text.replace("duration = \"40 ms\"", "duration = \"16 ms\"");
    let text = text.replace("sampling_rate = \"500 kHz\"", "sampling_rate = \"250 kHz\"");
    text.replace("skip = \"10 ms\"", "skip = \"2 ms\"")
        .split("\n[[estimate.filter]]\nname = \"EKF with spring\"")
        .next()
        .unwrap()
        .to_owned()
}

fn parse(text: &str) -> Result<Experiment, String> {
    published().parse(text, Path::new("nowhere/experiment.toml")).map_err(|error| error.to_string())
}

/// A simulated recording and the experiment that describes it.
fn simulated(text: &str) -> (Experiment, ComputedRecording) {
    let experiment = parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    (described(&experiment, simulation.as_ref()), all)
}

#[test]
fn a_study_varies_a_parameter_of_the_filter_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("simulation.toml"), comb()).unwrap();
    let study = "name = \"spring\"\nexperiment = \"simulation.toml\"\nrepeats = 1\nseed = 3\n\
        [truth]\n\"device.equations.parameters.k\" = \"4.7374 N/m\"\n\
        [[vary]]\nkey = \"device.equations.parameters.k\"\napplies_to = \"told\"\n\
        grid = { from = \"4.7374 N/m\", to = \"4.76 N/m\", points = 2 }\n";
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    let plan = StudyPlan::load(published(), &folder.path().join("study.toml")).unwrap();
    let out = folder.path().join("out");
    let options = StudyOptions { shard: "1/1".parse().unwrap(), threads: NonZero::new(1), force: false };
    let journal = plan.run_all(&out, options, &Silent).unwrap().journal;
    let output = Output::begin(&out, &plan.work()).unwrap();
    let summary = plan.write_results(&[journal], &output).unwrap();
    output.commit().unwrap();
    assert_eq!((summary.points, summary.runs, summary.rows, summary.failures.len()), (2, 2, 2, 0));
    let table = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
    let table = table.into_iter().find(|path| path.extension().is_some_and(|end| end == "csv")).unwrap();
    let table = std::fs::read_to_string(table).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let column =
        rows[0].iter().position(|name| *name == "values.x.rmse").unwrap_or_else(|| panic!("{table}"));
    let error = |row: usize| rows[row][column].parse::<f64>().unwrap();
    // Half a per cent of stiffness, at resonance.
    assert!(error(2) > 10.0 * error(1), "{} {}", error(1), error(2));
}

#[test]
fn a_diagnosis_names_the_parameter_that_is_wrong() {
    let (right, simulated) = simulated(&comb());
    let told = right.to_toml().unwrap().replace("k = \"4.7374 N/m\"", "k = \"4.76 N/m\"");
    let told = parse(&told).unwrap();
    let recording = simulated.recorded(&published().rig(&told).unwrap().layout(&told, 0).unwrap()).unwrap();
    let diagnosis = diagnose_recording(published(), &told, None, recording, &Silent).unwrap();
    let causes: Vec<(&str, usize)> =
        diagnosis.causes.iter().map(|cause| (cause.name.as_str(), cause.edits.len())).collect();
    assert!(diagnosis.finding == DiagnosisFinding::Explained, "{causes:?} {:?}", diagnosis.tests);
    let edited = diagnosis.causes.iter().flat_map(|cause| &cause.edits);
    assert!(edited.map(|edit| format!("{edit:?}")).any(|edit| edit.contains("parameters.k")), "{causes:?}");
}

/// A stage on a spring whose displacement is read through a curve of the third order.
const STAGE: &str = r#"
name = "stage"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { force = "N" }
parameters = { m = "1 g", k = "40 N/m", b = "0.02 N s/m", sensitivity = "0.1 V/um", third = "2e-4 1/um^2" }
derivative = { x = "v", v = "(force - b*v - k*x)/m" }
measure = { signal = "sensitivity*x*(1 + third*x^2) in V", square = "sensitivity*x^2/1[um] in V" }
noise = { signal = "1e-6[V^2]", square = "1e-6[V^2]" }
[simulate]
duration = "0.4 s"
sampling_rate = "10 kHz"
integration_rate = "100 kHz"
seed = 5
start = { x = "0 m", v = "0 m/s" }
[simulate.drive.inputs.force.sine]
amplitude = "1 mN"
frequency = "25 Hz"
[estimate]
skip = "10 ms"
[[estimate.filter]]
name = "each sample"
method = "direct_inversion"
channels = ["signal"]
"#;

/// The real root of x + t·x³ = y (Cardano).
fn cardano(t: f64, y: f64) -> f64 {
    let (p, q) = (1.0 / (3.0 * t), y / (2.0 * t));
    let root = (q * q + p * p * p).sqrt();
    (q + root).cbrt() + (q - root).cbrt()
}

#[test]
fn each_measurement_corrects_its_own_state() {
    let (experiment, all) = simulated(STAGE);
    let outcome: Outcome = estimate_computed(published(), &experiment, &all, &Silent).unwrap();
    let segment = &outcome.recordings[0].segments[0];
    let trajectory = &segment.estimate.trajectories[0];
    assert_eq!(trajectory.states.len(), 1);
    let x = trajectory.state("x").unwrap();
    for (k, signal) in trajectory.signal.iter().enumerate() {
        let um = cardano(2e-4, signal / 0.1);
        assert!((x.mean[k] * 1e6 - um).abs() < 1e-6, "{k}: {} {um}", x.mean[k]);
        let sd_um = 1e-3 / (0.1 * (1.0 + 3.0 * 2e-4 * um * um));
        assert!((x.sd[k] * 1e6 / sd_um - 1.0).abs() < 1e-6, "{k}: {} {sd_um}", x.sd[k]);
    }
    let errors = &segment.values[0]["x"];
    assert!(errors.within_three_sigma.unwrap() > 0.99 && errors.rmse < 1.1e-8, "{errors:?}");
}

#[test]
fn a_measurement_that_does_not_tell_one_state_is_not_inverted() {
    let refused = |was: &str, is: &str| {
        assert!(STAGE.contains(was));
        let experiment = parse(&STAGE.replace(was, is)).unwrap();
        let experiment = described(
            &experiment,
            published().rig(&experiment).unwrap().simulate(&experiment).unwrap().as_ref(),
        );
        published().rig(&experiment).unwrap().wanted(&experiment).unwrap_err().to_string()
    };
    let two_values = refused("channels = [\"signal\"]", "channels = [\"square\"]");
    assert!(two_values.contains("at rest its measurement does not change with x"), "{two_values}");
    let of_two = refused("(1 + third*x^2) in V", "(1 + v/1[m/s]) in V");
    assert!(of_two.contains("its measurement is one of x and v"), "{of_two}");
    let which = refused("channels = [\"signal\"]\n", "");
    assert!(which.contains("an inversion is that of one measurement"), "{which}");
}

#[test]
fn a_filter_of_equations_is_smoothed_with_a_lag_and_over_all_samples() {
    let text = comb() + "smooth = true\nsmooth_lag = \"60 us\"\n";
    let mut squares = [0.0; 3];
    for seed in 1..=6 {
        let (experiment, all) = simulated(&text.replace("seed = 1", &format!("seed = {seed}")));
        let outcome = estimate_computed(published(), &experiment, &all, &Silent).unwrap();
        let segment = &outcome.recordings[0].segments[0];
        let rmse = |end: &str| {
            let place = segment.estimate.trajectories.iter().position(|found| found.key == end).unwrap();
            let errors = &segment.values[place]["x"];
            assert!(errors.within_three_sigma.unwrap() > 0.98, "{end}: {errors:?}");
            errors.rmse
        };
        let found = ["ekf", "ekf_lagged", "ekf_smoothed"].map(rmse);
        squares.iter_mut().zip(found).for_each(|(sum, rmse)| *sum += rmse * rmse);
    }
    let [filtered, lagged, whole] = squares;
    // Where a filter remembers far longer than the lag, the lag takes a part of the way from the filter to the whole recording.
    assert!(whole < lagged && lagged < filtered, "{filtered:e} {lagged:e} {whole:e}");
}

#[test]
fn an_outlook_predicts_the_motion_and_names_undetermined_numbers() {
    // Without a drive nothing tells how strongly it would pull.
    let text = comb()
        .replace(
            "[simulate.drive.sine]\noffset = \"10 V\"\namplitude = \"2 V\"\nfrequency = \"10.02 kHz\"\n",
            "[simulate.drive.constant]\nvoltage = \"0 V\"\n",
        )
        .replace("start = { x = \"0 m\", v = \"0 m/s\" }\n\n", "start = { x = \"1 um\", v = \"0 m/s\" }\n\n")
        + "states = { k = { start_sd = \"1 %\" }, force = { start_sd = \"3 %\" } }\n";
    let experiment = parse(&text).unwrap();
    let outlook = published().rig(&experiment).unwrap().outlook(&experiment).unwrap();
    let said = |title: &str| {
        let topic = outlook.topics.iter().find(|topic| topic.title == title).unwrap();
        topic.facts.iter().map(|fact| fact.text.clone()).collect::<Vec<_>>().join("\n")
    };
    assert!(said("Equations").contains("dx/dt = v"), "{}", said("Equations"));
    // sqrt(k/m)/2π and b/2·sqrt(k·m): 10 kHz, and half of one part in 250.
    let motion = said("Free motion");
    assert!(motion.contains("oscillates at 10 kHz") && motion.contains("quality factor 250"), "{motion}");
    let told = said("What the signal determines");
    assert!(told.contains("k to ") && told.contains("does not tell force (± 3.00 %)"), "{told}");
}

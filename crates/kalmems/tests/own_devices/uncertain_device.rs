//! What is uncertain of a device: how it is written, in parts and in a stream, and against a filter that is told the truth.

use crate::events::recorded;
use crate::parts::{goes_on_after_a_kill, same_bits_in_a_stream, same_bits_in_parts};
use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::{Outcome, WorkflowError, estimate_computed};
use std::path::{Path, PathBuf};

/// Finds a number within this part of what was expected.
fn assert_near(found: f64, expected: f64, part: f64) {
    assert!((found - expected).abs() <= part * expected.abs(), "{found} is not {expected}");
}

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file)
}

fn replaced(text: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text.to_owned(), |text, (before, after)| {
        assert!(text.contains(before), "{before}");
        text.replace(before, after)
    })
}

/// The shipped recording of the scanner, of which stiffness and width are stated with an uncertainty; `more` at the end.
fn scanner(more: &str) -> Result<Experiment, String> {
    scanner_with("1.1033e-4 N m ± 0.3 %", "0.2 rad ± 1 %", more)
}

fn scanner_with(stiffness: &str, width: &str, more: &str) -> Result<Experiment, String> {
    let path = example("shared_scanner/experiment.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = replaced(&text, &[("1.1033e-4 N m", stiffness), ("\"0.2 rad\"", &format!("\"{width}\""))]);
    published().parse(&format!("{text}\n{more}"), &path).map_err(|why| why.to_string())
}

#[test]
fn an_uncertainty_is_written_in_several_ways_that_are_the_same() {
    let of = |text: &str| {
        let path = example("shared_scanner/experiment.toml");
        let file = std::fs::read_to_string(&path).unwrap();
        let text = file.replace("\"1.1033e-4 N m\"", text);
        let experiment = published().parse(&text, &path).unwrap();
        let [number] = &experiment.uncertain().unwrap()[..] else { panic!("{text}") };
        assert_eq!(number.name, "resonator.stiffness");
        (number.value.si(), number.sd)
    };
    let (value, sd) = of("\"1.1033e-4 N m ± 1 %\"");
    assert_eq!(value, 1.1033e-4);
    assert_near(sd, 1.1033e-6, 1e-15);
    for other in [
        "\"1.1033e-4 N m +/- 1 %\"",
        "\"1.1033e-4 N m ± 1.1033e-6 N m\"",
        "\"1.1033e-4 N m ± 1.1033 uN m\"",
        "\"1.1033e-4 ± 1.1033e-6 N m\"",
        "{ value = \"1.1033e-4 N m\", sd = \"1 %\" }",
        "{ value = \"1.1033e-4 N m\", sd = \"1.1033e-6 N m\" }",
    ] {
        let (again, spread) = of(other);
        assert_eq!(again, value, "{other}");
        assert_near(spread, sd, 1e-15);
    }
}

#[test]
fn correlations_make_directions_whose_covariance_is_what_is_stated() {
    let more = "[device.correlation]\n\"resonator.stiffness\" = { \"comb.angular_width\" = -0.8 }\n";
    let experiment = scanner(more).unwrap();
    let directions = experiment.directions().unwrap();
    assert_eq!(directions.len(), 2);
    let step = |direction: usize, name: &str| {
        let found = directions[direction].steps.iter().find(|(number, _)| number.name == name);
        found.map_or(0.0, |(_, step)| *step)
    };
    let names = ["resonator.stiffness", "comb.angular_width"];
    let stated = [0.003 * 1.1033e-4, 0.01 * 0.2];
    for (i, j, correlation) in [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -0.8)] {
        let covariance: f64 = (0..2).map(|d| step(d, names[i]) * step(d, names[j])).sum();
        assert_near(covariance, correlation * stated[i] * stated[j], 1e-12);
    }
}

#[test]
fn what_is_wrong_of_an_uncertainty_is_said_with_its_place() {
    for (stiffness, more, expected) in [
        ("1.1033e-4 N m ± 0.3 V", "", "the uncertainty has the dimension"),
        ("1.1033e-4 N m ± -0.3 %", "", "a number of 0 or more"),
        ("1.1033e-4 N m ± 3e-7", "", "the uncertainty has no unit; write `± 3e-7 N m`"),
        (
            "1.1033e-4 N m ± 0.3 %",
            "[device.correlation]\n\"resonator.stifness\" = { \"comb.angular_width\" = 0.5 }\n",
            "resonator.stiffness",
        ),
        (
            "1.1033e-4 N m ± 0.3 %",
            "[device.correlation]\n\"resonator.stiffness\" = { \"comb.angular_width\" = 1.5 }\n",
            "a correlation lies between -1 and 1; found 1.5",
        ),
        (
            "1.1033e-4 N m ± 0.3 %",
            "[device.correlation]\n\"resonator.stiffness\" = { \"comb.angular_width\" = 0.5 }\n\
             \"comb.angular_width\" = { \"resonator.stiffness\" = 0.5 }\n",
            "each pair stands once",
        ),
        (
            // A device of negative stiffness is none.
            "1.1033e-4 N m ± 0.3 %",
            "[device.correlation]\n\"resonator.stiffness\" = { \"resonator.inertia\" = 0.5 }\n",
            "resonator.inertia",
        ),
    ] {
        let wrong = scanner_with(stiffness, "0.2 rad ± 1 %", more).unwrap_err();
        assert!(wrong.contains(expected), "{stiffness} {more}: {wrong}");
    }
    // Nothing takes an uncertainty of what is not the device into account.
    let path = example("shared_scanner/experiment.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = replaced(&text, &[("skip = \"8 ms\"", "skip = \"8 ms ± 1 ms\"")]);
    let wrong = published().parse(&text, &path).unwrap_err().to_string();
    assert!(wrong.contains("estimate.skip") && wrong.contains("write `8 ms`"), "{wrong}");
}

#[test]
fn correlations_that_no_errors_have_are_refused() {
    let path = example("shared_scanner/experiment.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = replaced(
        &text,
        &[
            ("1.1033e-4 N m", "1.1033e-4 N m ± 0.3 %"),
            ("\"0.2 rad\"", "\"0.2 rad ± 1 %\""),
            ("1.15e-14 kg m^2", "1.15e-14 kg m^2 ± 1 %"),
        ],
    );
    let text = format!(
        "{text}\n[device.correlation]\n\"resonator.stiffness\" = {{ \"comb.angular_width\" = 0.9, \"resonator.inertia\" = 0.9 }}\n\
         \"comb.angular_width\" = {{ \"resonator.inertia\" = -0.9 }}\n"
    );
    let wrong = published().parse(&text, &path).unwrap_err().to_string();
    assert!(wrong.contains("device.correlation") && wrong.contains("negative eigenvalue"), "{wrong}");
}

#[test]
fn an_estimate_with_uncertain_numbers_is_the_same_in_parts_and_in_a_stream() {
    let more = "[device.correlation]\n\"resonator.stiffness\" = { \"comb.angular_width\" = -0.8 }\n";
    let experiment = scanner(more).unwrap();
    let recording = recorded(&experiment);
    same_bits_in_parts(&experiment, &recording, &[1_000, 9_001]);
}

/// A scanner that comes in over a stream, with an uncertain stiffness.
const STREAMED: &str = "[stream]\nrate = \"1 MHz\"\n[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]\n\
                        [device.correlation]\n\"resonator.stiffness\" = { \"comb.angular_width\" = 0.5 }\n";

#[test]
fn a_stream_considers_what_is_uncertain_and_goes_on_after_a_kill() {
    let experiment = scanner(STREAMED).unwrap();
    let recording = recorded(&experiment);
    let bytes = std::fs::read(experiment.resolve(&experiment.recording(0).unwrap().file)).unwrap();
    same_bits_in_a_stream(&experiment, &recording, (&bytes, 5_000));
    goes_on_after_a_kill(&experiment, &bytes, 0.6, 0.0);
}

/// A simulation of a device's example, told otherwise than it is.
fn told(text: &str, truth: &[(&str, &str)], path: &Path) -> (Outcome, Metrics) {
    let outcome = estimated(text, truth, path).unwrap();
    let metrics = Metrics::of(&outcome);
    (outcome, metrics)
}

fn estimated(text: &str, truth: &[(&str, &str)], path: &Path) -> Result<Outcome, WorkflowError> {
    let parse = |text: &str| published().parse(text, path).unwrap_or_else(|e| panic!("{e}"));
    let truth = parse(&replaced(text, truth));
    let simulation = published().rig(&truth).unwrap().simulate(&truth).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let told = described(&parse(text), &*simulation);
    estimate_computed(published(), &told, &simulated, &Silent)
}

/// The second way: where one number is wrong by one standard deviation, the error that is contributed is that of the filter that is told
/// so, less that of one that is told right, and the whole claim is the root of the sum of both squares.
#[test]
fn the_claim_is_the_filters_own_and_what_the_numbers_add() {
    for method in ["ekf", "square_root_ekf", "ukf"] {
        the_claim_of(method);
    }
}

fn the_claim_of(method: &str) {
    let path = example("shared_scanner/simulation.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = replaced(&text, &[("method = \"ekf\"", &format!("method = \"{method}\""))]);
    let short = replaced(
        &text,
        &[("duration = \"60 ms\"", "duration = \"20 ms\""), ("skip = \"45 ms\"", "skip = \"8 ms\"")],
    );
    let stated = replaced(&short, &[("\"1.10e-4 N m\"", "\"1.10e-4 N m ± 0.01 %\"")]);
    let more = replaced(&short, &[("\"1.10e-4 N m\"", "\"1.100110e-4 N m\"")]);
    let right = [("1.10e-4 N m ± 0.01 %", "1.10e-4 N m")];
    let as_it_is = [("1.100110e-4 N m", "1.10e-4 N m")];
    let (considered, _) = told(&stated, &right, &path);
    let (exact, _) = told(&short, &[], &path);
    let (beside, _) = told(&more, &as_it_is, &path);
    let of = |outcome: &Outcome| outcome.recordings[0].segments[0].estimate.trajectories[0].clone();
    let [considered, exact, beside] = [of(&considered), of(&exact), of(&beside)];
    assert_eq!(considered.considered.len(), 1);
    let mut largest: f64 = 0.0;
    for (place, state) in considered.states.iter().enumerate() {
        let (own, other) = (&exact.states[place], &beside.states[place]);
        assert_eq!(state.mean, own.mean);
        if state.name == "phase" {
            continue;
        }
        for k in 0..state.sd.len() {
            // 1.1e-4·(1 + 1e-4) and 1.100110e-4 are the same but for rounding.
            let moved = other.mean[k] - own.mean[k];
            let whole = own.sd[k].hypot(moved);
            assert_near(state.sd[k], whole, 1e-6);
            if state.name == "angle" {
                largest = largest.max(moved.abs() / own.sd[k]);
            }
        }
    }
    // What is claimed is not the filter's own alone.
    assert!(largest > 0.5 || method == "ukf", "{method}: {largest}");
}

/// A number that the table states with its uncertainty and that is a state starts with it, also where a second number is considered; beside
/// the same file with the standard deviation written out.
#[test]
fn a_state_without_a_start_sd_starts_with_what_the_table_states() {
    let path = example("shared_scanner/simulation.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let with = |stiffness: &str, state: &str| {
        let changes = [
            ("1.10e-4 N m", stiffness),
            ("\"0.2 rad\"", "\"0.2 rad ± 0.1 %\""),
            ("duration = \"60 ms\"", "duration = \"5 ms\""),
            ("skip = \"45 ms\"", "skip = \"1 ms\""),
        ];
        replaced(&text, &changes) + &format!("states = {{ stiffness = {state} }}\n")
    };
    let trajectory = |state: &str| {
        let (outcome, _) = told(&with("1.10e-4 N m ± 0.3 %", state), &[], &path);
        outcome.recordings[0].segments[0].estimate.trajectories[0].clone()
    };
    let [of_table, of_filter] = [trajectory("{}"), trajectory("{ start_sd = 0.003 }")];
    assert_near(of_table.parameters[0].sd, 0.003, 1e-12);
    // The width is considered beside, and the stiffness is not.
    assert_eq!(of_table.considered.len(), 1);
    for (own, other) in of_table.states.iter().zip(&of_filter.states) {
        for ((a, b), (of, with)) in own.mean.iter().zip(&other.mean).zip(own.sd.iter().zip(&other.sd)) {
            assert!(
                (a - b).abs() <= 1e-6 * with && (of - with).abs() <= 1e-6 * with,
                "{}: {a} {b}",
                own.name
            );
        }
    }
    let refused = estimated(&with("1.10e-4 N m", "{}"), &[], &path).unwrap_err().to_string();
    for part in ["states.stiffness.start_sd", "start_sd = \"1 %\"", "resonator.stiffness", "± 1 %"] {
        assert!(refused.contains(part), "{part}: {refused}");
    }
}

/// The devices that are drawn from their table: coverage and NEES are held in the suite of the verdict; here one that is off.
#[test]
fn a_device_off_its_stated_numbers_is_covered_and_the_budget_names_the_number() {
    let path = example("shared_scanner/simulation.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    // From its motion on.
    let text = replaced(
        &text,
        &[
            ("duration = \"60 ms\"", "duration = \"20 ms\""),
            ("skip = \"45 ms\"", "skip = \"8 ms\""),
            (
                "angle = \"1e-4 rad\", rate = \"0 rad/s\" } # from",
                "angle = \"0.117 rad\", rate = \"12.8e3 rad/s\" } # from",
            ),
            ("start = { angle = \"1e-4 rad\", rate = \"0 rad/s\" }\n", "start = \"from_signal\"\n"),
            (
                "start_sd = { angle = \"1e-3 rad\", rate = \"100 rad/s\" }",
                "start_sd = { angle = \"0.15 rad\", rate = \"15e3 rad/s\" }",
            ),
        ],
    );
    let stated = replaced(&text, &[("angular_width = \"0.2 rad\"", "angular_width = \"0.2 rad ± 1 %\"")]);
    // One and a half standard deviations off.
    let truth = [("0.2 rad ± 1 %", "0.203 rad")];
    let (_, with) = told(&stated, &truth, &path);
    let (_, without) =
        told(&text, &[("angular_width = \"0.2 rad\"", "angular_width = \"0.203 rad\"")], &path);
    let inside = |metrics: &Metrics| {
        let estimator = metrics.estimators().find(|estimator| estimator.key == "ekf").unwrap();
        estimator.errors.as_ref().unwrap().angle.within_three_sigma.unwrap()
    };
    assert!(inside(&without) < 0.7, "{}", inside(&without));
    // A normal distribution at half of the way to 3 sd; where the angle goes through the place at which the width does nothing, what is
    // of second order is left.
    assert!(inside(&with) > 0.977, "{}", inside(&with));
    // What stands without an uncertainty is listed.
    let exact = |name: &str| with.held_as_exact.iter().any(|held| held == name);
    assert!(exact("resonator.stiffness") && !exact("comb.angular_width"), "{:?}", with.held_as_exact);
    let estimator = with.estimators().find(|estimator| estimator.key == "ekf").unwrap();
    let budget = estimator.uncertainty_budget.iter().find(|budget| budget.state == "angle").unwrap();
    assert_eq!(budget.device[0].name, "comb.angular_width");
    let whole = budget.noise.hypot(budget.device[0].sd);
    assert_near(budget.sd, whole, 1e-9);
}

/// What `identify` says of a number stands behind it in the experiment, and how two hang together beside the table.
#[test]
fn what_is_identified_is_written_with_its_uncertainty_and_correlations() {
    let path = example("micro_stage/as_published.toml");
    let experiment = published().load(&path).unwrap();
    let found = published().rig(&experiment).unwrap().identify(&experiment, &Silent).unwrap();
    // As it is written to a file and read again.
    let again = published().parse(&found.experiment.to_toml().unwrap(), &path).unwrap();
    let numbers = again.uncertain().unwrap();
    assert_eq!(numbers.len(), 11, "{numbers:?}");
    for (name, said) in [
        ("electrodes.1A.gap", "gap D_n of 1A"),
        ("electrodes.2B.gain", "gain eta of 2B"),
        ("resonator.natural_frequency", "natural frequency"),
    ] {
        let number = numbers.iter().find(|number| number.name == name).unwrap();
        let said = found.parameters.iter().find(|one| one.name.contains(said)).unwrap();
        assert_near(number.value.si(), said.value, 1e-12);
        // With three digits.
        assert_near(number.sd, said.standard_error, 5e-3);
    }
    let directions = again.directions().unwrap();
    assert_eq!(directions.len(), 11);
    for pair in &found.worst_pairs {
        let [gap, gain] = &pair.names;
        let Some(electrode) = gap.strip_prefix("gap of ") else { continue };
        assert_eq!(gain, &format!("gain of {electrode}"));
        let step = |name: &str| -> Vec<f64> {
            let own = |steps: &[(kalmems::config::UncertainNumber, f64)]| {
                steps.iter().find(|(number, _)| number.name == name).map_or(0.0, |(_, step)| *step)
            };
            directions.iter().map(|direction| own(&direction.steps)).collect()
        };
        let [a, b] = ["gap", "gain"].map(|own| step(&format!("electrodes.{electrode}.{own}")));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let correlation = dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt();
        // What is near 1 is written so that its distance from 1 is right to a hundredth.
        assert_near(1.0 - correlation.abs(), 1.0 - pair.correlation.abs(), 0.011);
    }
}

//! Own devices whose signals do not tell a sign, or half a turn of a phase: simulated, and started on the other branch or from the signal.

use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, notices, summary_text};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::estimate_computed;
use std::path::Path;

/// The estimate of a simulated recording, with its references.
fn estimated(text: &str) -> Metrics {
    let parsed = published().parse(text, Path::new("nowhere/hidden.toml"));
    let experiment = parsed.unwrap_or_else(|error| panic!("{error}\n{text}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let outcome = estimate_computed(published(), &described(&experiment, &*simulation), &simulated, &Silent);
    Metrics::of(&outcome.unwrap_or_else(|error| panic!("{error}\n{text}")))
}

/// The only filter passes, and its errors of these states are as large as it claims: their mean square is that of a claim within a factor of 4.
fn assert_right(metrics: &Metrics, states: &[&str]) {
    let filter = metrics.estimators().next().unwrap();
    for state in states {
        let errors = &filter.values[state];
        println!("{state}: {:.3e} rms, {:?}", errors.rmse, errors.claim.map(|claim| claim.mean_square));
        assert!(errors.claim.is_some_and(|claim| claim.mean_square < 4.0), "{state}: {errors:?}");
    }
    let all: Vec<String> = notices(metrics).iter().map(ToString::to_string).collect();
    assert!(matches!(filter.grade, Some(Grade::Passes | Grade::PassesWithRemarks)), "{all:#?}");
}

fn said(metrics: &Metrics) -> String {
    let notices = notices(metrics).iter().map(|notice| notice.to_string() + "\n").collect::<String>();
    summary_text(metrics, false, 200) + &notices
}

/// An amplitude that decays, and the phase of its oscillation.
const PHASOR: &str = r#"
name = "phasor"
[device.equations]
states = { size = "m", phi = "rad" }
derivative = { size = "-size/tau", phi = "2*pi*f" }
quantities = { place = "size*cos(phi) in um", along = "cos(phi) in 1" }
measure = { signal = "gain*size*cos(phi) in V" }
cyclic = { phi = "2*pi" }
noise = { phi = "1e-6[rad^2/s]", signal = "1e-6[V^2]" }
parameters = { tau = "2 s", f = "97 Hz", gain = "1 V/um" }
[simulate]
duration = "0.5 s"
sampling_rate = "5 kHz"
integration_rate = "5 kHz"
seed = 3
drive = { prescribed = {} }
start = { size = "1 um", phi = "1 rad" }
[estimate]
skip = "50 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
"#;

#[test]
fn the_sign_of_an_amplitude_with_half_a_turn_of_its_phase_is_arbitrary() {
    // −A cos(φ + π): 1 rad and half a turn are 4.14 rad.
    let other = estimated(
        &(PHASOR.to_owned()
            + "start = { size = \"-1 um\", phi = \"4.1 rad\" }\nstart_sd = { size = \"0.05 um\", phi = \"0.1 rad\" }\n"),
    );
    assert_right(&other, &["size", "place", "along"]);
    let segment = &other.recordings[0].segments[0];
    assert_eq!((&segment.arbitrary.signs[..], segment.arbitrary.half_turns.len()), (&["size"][..], 0));
    let text = said(&other);
    assert!(text.contains("the signal is the same for the other sign of `size`"), "{text}");
    assert!(text.contains("; arbitrary: the sign of `size`"), "{text}");
    assert!(text.contains("size: ") && text.contains("its sign is arbitrary"), "{text}");
}

#[test]
fn half_a_turn_of_a_phase_of_which_the_signal_has_the_double_is_arbitrary() {
    let text = PHASOR.replace("gain*size*cos(phi)", "gain*size*cos(2*phi)");
    // A half turn changes the sign of what is along the axis as well.
    let other = estimated(
        &(text
            + "start = { size = \"1 um\", phi = \"4.1 rad\" }\nstart_sd = { size = \"0.05 um\", phi = \"0.1 rad\" }\n"),
    );
    assert_right(&other, &["size", "place", "along"]);
    let segment = &other.recordings[0].segments[0];
    assert_eq!((segment.arbitrary.signs.len(), &segment.arbitrary.half_turns[..]), (0, &["phi"][..]));
    let text = said(&other);
    assert!(text.contains("the signal is the same for half a turn more of `phi`"), "{text}");
    assert!(text.contains("; arbitrary: half a turn of `phi`"), "{text}");
    assert!(text.contains("those of the branch that is nearer to the reference"), "{text}");
}

/// A free decay that is seen squared, without a table `angles`.
const SQUARED: &str = r#"
name = "squared"
[device.equations]
states = { x = "um", v = "um/s" }
derivative = { x = "v", v = "-v*w/Q - w^2*x" }
measure = { signal = "gain*x^2 in V" }
noise = { v = "1e4[um^2/s^3]", signal = "1e-6[V^2]" }
parameters = { w = "6283 rad/s", Q = "400", gain = "1 V/um^2" }
[simulate]
duration = "40 ms"
sampling_rate = "50 kHz"
integration_rate = "200 kHz"
seed = 3
drive = { prescribed = {} }
start = { x = "-0.8 um", v = "900 um/s" }
[estimate]
skip = "5 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = "from_signal"
"#;

#[test]
fn a_filter_starts_from_a_signal_that_hides_the_sign() {
    let found = estimated(SQUARED);
    assert_right(&found, &["x", "v"]);
    assert_eq!(found.recordings[0].segments[0].arbitrary.signs, ["x"]);
    let text = said(&found);
    assert!(
        text.contains("; arbitrary: the sign of `x`") && text.contains("its sign is arbitrary"),
        "{text}"
    );
    // A state whose sign the signal does tell has no other start.
    let with_offset = SQUARED
        .replace("v = \"um/s\" }", "v = \"um/s\", level = \"V\" }")
        .replace("v = \"-v*w/Q - w^2*x\" }", "v = \"-v*w/Q - w^2*x\", level = \"0\" }")
        .replace("gain*x^2 in V", "gain*x^2 + level in V")
        .replace("v = \"900 um/s\" }", "v = \"900 um/s\", level = \"0.1 V\" }");
    assert_right(&estimated(&with_offset), &["x", "v", "level"]);
}

/// A mass on the same spring along both axes, of whose displacement the signal has the distance alone: decaying, on an ellipse.
const PLANE: &str = r#"
name = "plane"
[device.equations]
states = { x = "um", y = "um", u = "um/s", v = "um/s" }
derivative = { x = "u", y = "v", u = "-w/Q*u - w^2*x", v = "-w/Q*v - w^2*y" }
measure = { signal = "gain*(x^2 + y^2) in V" }
noise = { u = "1e-3[um^2/s^3]", v = "1e-3[um^2/s^3]", signal = "1e-6[V^2]" }
parameters = { w = "6283 rad/s", Q = "400", gain = "1 V/um^2" }
[simulate]
duration = "40 ms"
sampling_rate = "50 kHz"
integration_rate = "200 kHz"
seed = 3
drive = { prescribed = {} }
start = { x = "0.8 um", y = "0.2 um", u = "-1000 um/s", v = "2500 um/s" }
[estimate]
skip = "5 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start_sd = { x = "0.01 um", y = "0.01 um", u = "60 um/s", v = "60 um/s" }
"#;

#[test]
fn a_turn_that_the_signal_hides_is_taken_off_before_errors_are_judged() {
    // The true start turned by 1.1 rad, and its mirror image along the first axis.
    for start in [
        "start = { x = \"0.188 um\", y = \"0.802 um\", u = \"-2660 um/s\", v = \"250 um/s\" }\n",
        "start = { x = \"-0.188 um\", y = \"0.802 um\", u = \"2660 um/s\", v = \"250 um/s\" }\n",
    ] {
        let found = estimated(&(PLANE.to_owned() + start));
        assert_right(&found, &["x", "y", "u", "v"]);
        assert_eq!(found.recordings[0].segments[0].arbitrary.turns, [["x", "y", "u", "v"]]);
        let text = said(&found);
        assert!(text.contains("any common turn of `x` and `y` and `u` and `v`"), "{text}");
        assert!(text.contains("a turn of `x` and `y` and `u` and `v`"), "{text}");
    }
    // Another spring along the second axis tells the direction: this start is wrong.
    let text = PLANE.replace("v = \"-w/Q*v - w^2*y\"", "v = \"-w/Q*v - 1.02*w^2*y\"");
    let start = "start = { x = \"0.188 um\", y = \"0.802 um\", u = \"-2660 um/s\", v = \"250 um/s\" }\n";
    let wrong = estimated(&(text + start));
    assert!(wrong.recordings[0].segments[0].arbitrary.turns.is_empty());
    assert!(wrong.estimators().all(|filter| filter.grade >= Some(Grade::Doubtful)));
}

/// The only filter passes, and its errors of these states and quantities are no larger than one in 10⁴ runs has them.
fn assert_plausible(metrics: &Metrics, names: &[&str]) {
    let filter = metrics.estimators().next().unwrap();
    assert!(matches!(filter.grade, Some(Grade::Passes | Grade::PassesWithRemarks)), "{}", said(metrics));
    for name in names {
        let claim = filter.values[name].claim.unwrap();
        println!(
            "{name}: {:.3} of {:.1} errors, p {:.1e}",
            claim.mean_square, claim.independent, claim.p_value
        );
        assert!(claim.p_value > 1e-4, "{name}: {:.3}", claim.mean_square);
    }
}

#[test]
fn a_filter_starts_from_a_signal_that_hides_a_turn() {
    // What no turn changes is claimed whatever the turn is.
    let quantities =
        "quantities = { square = \"x^2 + y^2 in um^2\", moment = \"x*v - y*u in um^2/s\" }\nmeasure";
    let device = PLANE.split("start_sd = {").next().unwrap().replace("measure", quantities);
    let stated = "start = { x = \"0.8 um\", y = \"0.2 um\", u = \"-1000 um/s\", v = \"2500 um/s\" }";
    assert!(device.contains(stated));
    let other = "start = { x = \"-0.3 um\", y = \"0.7 um\", u = \"3000 um/s\", v = \"2500 um/s\" }";
    for (start, seed) in [(stated, 3), (stated, 4), (other, 5), (other, 6)] {
        let text = device.replace(stated, start).replace("seed = 3", &format!("seed = {seed}"));
        let found = estimated(&(text + "start = \"from_signal\"\n"));
        assert_plausible(&found, &["square", "moment"]);
        assert_eq!(found.recordings[0].segments[0].arbitrary.turns, [["x", "y", "u", "v"]]);
        let filter = found.estimators().next().unwrap();
        // After the turn, to 0.2 % of the motion.
        for (state, size) in [("x", 1e-6), ("y", 1e-6), ("u", 6e-3), ("v", 6e-3)] {
            assert!(filter.values[state].rmse < 2e-3 * size, "{state}: {:e}", filter.values[state].rmse);
        }
    }
}

#[test]
fn phases_of_which_the_signal_has_the_difference_start_from_the_signal_as_well() {
    let text = PHASOR
        .replace("phi = \"rad\" }", "phi = \"rad\", psi = \"rad\" }")
        .replace("phi = \"2*pi*f\" }", "phi = \"2*pi*f\", psi = \"2*pi*20[Hz]\" }")
        .replace("cos(phi)", "cos(phi - psi)")
        .replace("cyclic = { phi = \"2*pi\" }", "cyclic = { phi = \"2*pi\", psi = \"2*pi\" }")
        .replace("phi = \"1 rad\" }", "phi = \"1 rad\", psi = \"2 rad\" }");
    for seed in 3..6 {
        let text = text.replace("seed = 3", &format!("seed = {seed}"));
        let found = estimated(&(text + "start = \"from_signal\"\n"));
        assert_plausible(&found, &["size", "place", "along"]);
        assert_eq!(found.recordings[0].segments[0].arbitrary.turns, [["phi", "psi"]]);
    }
}

//! States that are angles of a swing by their table: amplitude, phase and peaks are told of them as of a published device.

use kalmems::config::Experiment;
use kalmems::evaluate::MotionErrors;
use kalmems::expand::expand;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::workflow::estimate;
use std::path::PathBuf;

fn example() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/true_stiffness.toml")
}

fn parsed(text: &str) -> Experiment {
    published().parse(text, &example()).unwrap_or_else(|error| panic!("{error}"))
}

fn errors(experiment: &Experiment) -> Vec<(String, MotionErrors)> {
    let outcome = estimate(published(), experiment, &Silent).unwrap_or_else(|error| panic!("{error}"));
    let segment = &outcome.recordings[0].segments[0];
    let of = |(errors, trajectory): (&Option<MotionErrors>, &kalmems::estimate::Trajectory)| {
        (trajectory.name.clone(), errors.clone().unwrap())
    };
    segment.errors.iter().zip(&segment.estimate.trajectories).map(of).collect()
}

/// The scanner with three parts, and the same written out as equations.
fn both() -> (Experiment, String) {
    let stated = std::fs::read_to_string(example()).unwrap();
    let own = parsed(&stated.replace("[estimate]\n", "[estimate]\nparts = 3\n"));
    let equations = expand(published(), &own).unwrap().text;
    assert!(
        equations.contains(ANGLES) && equations.contains("first_peak") && equations.contains("parts = 3")
    );
    (own, equations)
}

/// The table of its angle.
const ANGLES: &str = "[device.equations.angles]\nangle = \"rate\"\n";

fn with_angles(line: &str) -> String {
    format!("[device.equations.angles]\n{line}\n")
}

#[test]
fn an_angle_of_equations_is_judged_as_that_of_a_published_device() {
    let (own, equations) = both();
    let (own, equations) = (errors(&own), errors(&parsed(&equations)));
    assert!(own.len() >= 3);
    for ((name, own), (other, equations)) in own.iter().zip(&equations) {
        assert_eq!(name, other);
        let numbers = |errors: &MotionErrors| {
            let parts = errors.parts.iter().map(|part| Some(part.rmse_deg));
            [
                Some(errors.angle.rmse_deg),
                errors.peak_phase_rmse_deg,
                errors.phase_shift_estimate_deg,
                errors.cycle_phase_rmse_deg,
                errors.amplitude_rmse_deg,
            ]
            .into_iter()
            .chain(parts)
            .collect::<Vec<_>>()
        };
        let (own, equations) = (numbers(own), numbers(equations));
        assert_eq!(own.len(), 8);
        for (own, equations) in own.into_iter().zip(equations) {
            let (own, equations) = (own.unwrap(), equations.unwrap());
            assert!((own - equations).abs() < 1e-6 * own.abs(), "{name}: {own} {equations}");
        }
    }
}

#[test]
fn what_is_no_angle_is_refused_by_name() {
    let (_, equations) = both();
    let refused = |from: &str, to: &str| {
        let text = equations.replace(from, to);
        assert_ne!(text, equations);
        match published().parse(&text, &example()) {
            Err(error) => error.to_string(),
            Ok(experiment) => estimate(published(), &experiment, &Silent).unwrap_err().to_string(),
        }
    };
    let other_rate = refused(ANGLES, &with_angles("angle = \"speed\""));
    assert!(
        other_rate.contains("the rate of `angle` is `rate`") && other_rate.contains("`speed`"),
        "{other_rate}"
    );
    let no_state = refused(ANGLES, &with_angles("tilt = \"rate\""));
    assert!(no_state.contains("tilt"), "{no_state}");
    let no_angle = refused(ANGLES, &with_angles("rate = \"angle\""));
    assert!(no_angle.contains("expected an angle"), "{no_angle}");
    // Without an angle there is nothing whose errors has parts.
    let without = equations.replace(ANGLES, "");
    let refused = |left_out: &str| {
        let text = without.replace(left_out, "");
        match published().parse(&text, &example()) {
            Err(error) => error.to_string(),
            Ok(experiment) => estimate(published(), &experiment, &Silent).unwrap_err().to_string(),
        }
    };
    let of_parts = refused("first_peak = \"positive\"\n");
    assert!(of_parts.contains("no angle whose error has parts"), "{of_parts}");
    let of_sign = refused("parts = 3\n");
    assert!(of_sign.contains("it is the sign of an angle"), "{of_sign}");
}

/// The sign is in none of the signals, so that the answers of both signs are the same but for that, and one of them is the recording's.
#[test]
fn a_sign_that_no_signal_tells_is_stated_of_equations_as_of_a_published_device() {
    let (own, equations) = both();
    let quantities =
        "[device.equations.quantities]\ndoubled = \"2*angle in rad\"\nseen = \"gain*capacitance in V\"\n\n";
    let equations = equations.replace(ANGLES, &format!("{quantities}{ANGLES}"));
    let run = |experiment: &Experiment| {
        let mut outcome =
            estimate(published(), experiment, &Silent).unwrap_or_else(|error| panic!("{error}"));
        outcome.recordings.remove(0).segments.remove(0)
    };
    let own = run(&own);
    let up = run(&parsed(&equations));
    let down = run(&parsed(&equations.replace("first_peak = \"positive\"", "first_peak = \"negative\"")));
    let unstated = run(&parsed(&equations.replace("first_peak = \"positive\"\n", "")));
    assert!(
        up.estimate.sign_is_hidden
            && up.estimate.trajectories.iter().any(|one| one.states[0].mean.len() > 1000)
    );
    for (place, one) in up.estimate.trajectories.iter().enumerate() {
        let [own, down, unstated] =
            [&own, &down, &unstated].map(|segment| &segment.estimate.trajectories[place]);
        assert!(one.hidden_signs.is_empty() && !unstated.hidden_signs.is_empty());
        assert_eq!((one.mirrored, down.mirrored), (own.mirrored, !own.mirrored), "{}", one.name);
        let mean =
            |of: &kalmems::estimate::Trajectory, name: &str| of.state(name).map(|state| state.mean.clone());
        for name in ["angle", "rate", "doubled"] {
            let (Some(up), Some(down)) = (mean(one, name), mean(down, name)) else { continue };
            assert!(up.iter().zip(&down).all(|(up, down)| *up == -down), "{} {name}", one.name);
        }
        assert_eq!(mean(one, "seen"), mean(down, "seen"));
        let (Some(angle), Some(published)) = (mean(one, "angle"), mean(own, "angle")) else { continue };
        let largest = published.iter().fold(0.0_f64, |largest, angle| largest.max(angle.abs()));
        assert!(angle.iter().zip(&published).all(|(a, b)| (a - b).abs() < 1e-6 * largest), "{}", one.name);
    }
    // The recording's own reference tells which of both it was.
    let rmse =
        |segment: &kalmems::workflow::SegmentOutcome| segment.errors[0].clone().unwrap().angle.rmse_deg;
    assert!(rmse(&up) < 0.1 * rmse(&down), "{} {}", rmse(&up), rmse(&down));
    let neither = equations.replace("2*angle in rad", "2*angle + 1[mrad] in rad");
    let refused = estimate(published(), &parsed(&neither), &Silent).unwrap_err().to_string();
    assert!(refused.contains("the quantity `doubled` is another one"), "{refused}");
}

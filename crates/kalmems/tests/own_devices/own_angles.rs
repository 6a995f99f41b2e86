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

/// The scanner with three parts, and the same written out as equations with a table of its angle.
fn both() -> (Experiment, String) {
    let stated = std::fs::read_to_string(example()).unwrap();
    let own = parsed(&stated.replace("[estimate]\n", "[estimate]\nparts = 3\n"));
    let equations = expand(published(), &own).unwrap().text;
    let equations = equations
        .replace("[estimate]\n", "[device.equations.angles]\nangle = \"rate\"\n\n[estimate]\nparts = 3\n");
    (own, equations)
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
    let other_rate = refused("angle = \"rate\"\n\n[estimate]", "angle = \"speed\"\n\n[estimate]");
    assert!(
        other_rate.contains("the rate of `angle` is `rate`") && other_rate.contains("`speed`"),
        "{other_rate}"
    );
    let no_state = refused("angle = \"rate\"\n\n[estimate]", "tilt = \"rate\"\n\n[estimate]");
    assert!(no_state.contains("tilt"), "{no_state}");
    let no_angle = refused("angle = \"rate\"\n\n[estimate]", "rate = \"angle\"\n\n[estimate]");
    assert!(no_angle.contains("expected an angle"), "{no_angle}");
    // Without an angle there is nothing whose errors could be told in parts.
    let without = refused("[device.equations.angles]\nangle = \"rate\"\n", "");
    assert!(without.contains("no angle whose error could be told in parts"), "{without}");
}

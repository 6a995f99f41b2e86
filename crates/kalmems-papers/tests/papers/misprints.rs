//! The misprints of the shared-electrode scanner's paper, each by itself: what the printed filters do, and how the printed lines
//! of the circuit compare with the right ones.

use kalmems::circuit::{AmplitudeDetector, Circuit, Excitation, HighPass, SineMotion};
use kalmems::estimate::{EstimateError, Trajectory};
use kalmems::evaluate::evaluate_angles;
use kalmems::progress::{Interruption, Silent};
use kalmems::results::{EstimatorMetrics, Metrics, Verdict};
use kalmems::rigs::equations::estimate_with;
use kalmems::rigs::published;
use kalmems::workflow::{self, Outcome};
use kalmems_core::{Covariance, Filter, SigmaPoints, Ukf};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::circuit::{SquareLaw, Transimpedance};
use kalmems_papers::{Misprint, MisprintedUkf, printed_lines};
use std::path::Path;

const UKF: &str = "name = \"ukf\"\nmethod = \"ukf\"\nstart = { angle = \"0.05 rad\", rate = \"0 rad/s\" }\n\
                   start_sd = { angle = \"0.15 rad\", rate = \"15e3 rad/s\" }\n";

/// The example with the right stiffness and this filter instead of its own, estimated.
fn outcome(filter: &str) -> Outcome {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
    let path = folder.join("true_stiffness.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let head = &text[..text.find("[[estimate.filter]]").unwrap()];
    let experiment = published().parse(&format!("{head}[[estimate.filter]]\n{filter}"), &path).unwrap();
    workflow::estimate(published(), &experiment, &Silent).unwrap_or_else(|e| panic!("{e}"))
}

/// What a filter of our own gives in the place of the one of the experiment.
fn with_own<F: Filter<f64, 2> + Clone + Send + 'static>(
    outcome: &Outcome,
    own: impl FnOnce([f64; 2], Covariance<f64, 2>, SigmaPoints<f64>) -> F + 'static,
) -> Result<Vec<Trajectory>, EstimateError> {
    let recording = &outcome.recordings[0].recording;
    let found = estimate_with(&outcome.experiment, 0, recording, own, &Silent)?;
    Ok(found.into_iter().next().unwrap().trajectories)
}

/// The figures of the filter with a misprint, evaluated as the rig evaluates its own.
fn printed(outcome: &Outcome, misprint: Misprint) -> EstimatorMetrics {
    let trajectories = with_own(outcome, move |mean, covariance, points| {
        MisprintedUkf::new(mean, covariance, points, misprint)
    });
    let mut outcome = outcome.clone();
    let recording = &mut outcome.recordings[0];
    let segment = &mut recording.segments[0];
    segment.estimate.trajectories = trajectories.unwrap();
    let references = recording.reference.as_ref().unwrap().angles_of(&segment.estimate.segment).unwrap();
    segment.errors = evaluate_angles(&segment.estimate, &references, 1, &Interruption::never());
    let found = Metrics::of(&outcome).estimators().next().unwrap().clone();
    let errors = found.errors.as_ref().map(|e| (e.angle.rmse_deg, e.peak_phase_rmse_deg));
    println!("{misprint:?}: {:?} {errors:?} {:?}", found.verdict, found.failure);
    found
}

#[test]
fn each_misprint_ruins_the_filter() {
    let outcome = outcome(UKF);
    let angle = |found: &EstimatorMetrics| found.errors.as_ref().map(|errors| errors.angle.rmse_deg);
    assert!(angle(Metrics::of(&outcome).estimators().next().unwrap()).unwrap() < 0.02);
    // The means of points whose weights add up to one half go to 0: what is left is the motion itself, 8.92°/√2.
    let weights = printed(&outcome, Misprint::Weights);
    assert!((angle(&weights).unwrap() - 8.92 / 2_f64.sqrt()).abs() < 0.1);
    // An independent filter with the same misprint reached 3.9°.
    let covariance = printed(&outcome, Misprint::Covariance);
    assert!((angle(&covariance).unwrap() - 3.9).abs() < 0.1);
    // R, in V², added to a cross covariance in rad·V: after that P − K·S·Kᵀ is no covariance.
    let cross = printed(&outcome, Misprint::CrossCovariance);
    assert_eq!(cross.verdict, Verdict::Failed);
    assert!(cross.failure.as_ref().unwrap().contains("not positive definite"));
}

/// The rig's UKF as a filter of the caller's own gives the trajectory that the rig gives, to the last bit.
#[test]
fn a_filter_of_ones_own_is_followed_as_those_of_the_rig() {
    let outcome = outcome(&format!("{UKF}smooth = true\n"));
    let rig = &outcome.recordings[0].segments[0].estimate.trajectories;
    let own = with_own(&outcome, Ukf::new).unwrap();
    assert_eq!((rig.len(), own.len()), (2, 2));
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    for (rig, own) in rig.iter().zip(&own) {
        assert_eq!((&rig.key, &rig.name, rig.mirrored), (&own.key, &own.name, own.mirrored));
        assert_eq!(rig.counts, own.counts);
        assert!(bits(&rig.nis) == bits(&own.nis) && bits(&rig.innovation) == bits(&own.innovation));
        for (rig, own) in rig.states.iter().zip(&own.states) {
            assert!(bits(&rig.mean) == bits(&own.mean) && bits(&rig.sd) == bits(&own.sd), "{}", rig.name);
        }
    }
}

#[test]
fn a_table_with_other_states_is_refused_for_a_filter_of_ones_own() {
    for (filter, found) in [
        (format!("{UKF}states = {{ stiffness = {{ start_sd = \"1 %\" }} }}\n"), "has 3 states"),
        (
            "name = \"alone\"\nmethod = \"model\"\nstart = { angle = \"0.05 rad\", rate = \"0 rad/s\" }\n"
                .to_owned(),
            "without a process",
        ),
    ] {
        let result = with_own(&outcome(&filter), Ukf::new);
        let message = result.unwrap_err().to_string();
        assert!(message.contains(found), "{message}");
    }
}

/// Chen et al., shared electrodes, 2020, Table II.
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };

/// Table I; parasitic capacitance and detector are not published.
fn circuit(order: usize) -> Circuit {
    Circuit {
        transimpedance: Transimpedance { feedback_resistance: 17.86e3, parasitic_capacitance: 5e-12 },
        amplifier_bandwidth_hz: None,
        high_pass: HighPass::new(order, 482e3).unwrap(),
        detector: AmplitudeDetector::SquareLaw(SquareLaw { linear: 1.0, square: 0.5 }),
        low_pass_hz: [40.8e3, 41.1e3],
        noise_density: 0.0,
    }
}

/// The paper's drive. The carrier has 1308 cycles in 41 of the motion.
const EXCITATION: Excitation = Excitation {
    offset: 0.0,
    amplitude: 30.0,
    drive_hz: 31_350.0,
    carrier: 6.0,
    carrier_hz: 1308.0 * 0.5 * 31_350.0 / 41.0,
};

fn motion(degrees: f64) -> SineMotion {
    SineMotion { amplitude_rad: degrees.to_radians(), phase_rad: 0.7 }
}

fn assert_close(ours: f64, expected: f64, relative: f64, what: &str) {
    assert!((ours / expected - 1.0).abs() < relative, "{what}: {ours:e}, expected {expected:e}");
}

/// What is misprinted, and what is not.
#[test]
fn the_printed_formulas_err_where_they_are_known_to() {
    let high_pass = HighPass::new(1, 1.0).unwrap();
    let lines = printed_lines(&Circuit { high_pass, ..circuit(1) }, &EXCITATION, &COMB, &motion(8.0));
    let ratio = |stage: &str, label: (i32, i32)| {
        let line = lines.iter().find(|line| line.stage == stage && line.label == label).unwrap();
        line.printed / line.quadratic
    };
    let r = EXCITATION.drive_hz / EXCITATION.carrier_hz;
    // (31) lost a half, and (29) has the other sign.
    assert_close(ratio("V_o1", (1, 1)), (1.0 - 0.5 * r) / (0.5 + 0.5 * r), 1e-6, "upper");
    assert_close(ratio("V_o1", (1, -1)), (1.0 + 0.5 * r) / (0.5 - 0.5 * r), 1e-6, "lower");
    assert_close(ratio("V_o1", (1, 0)), 1.0, 1e-9, "carrier");
    // (30) lost R_f and more: half of the second harmonic is missing, and a derivative has got a constant part.
    assert_close(ratio("V_o1", (0, 2)), 0.5, 1e-3, "second harmonic");
    assert!(ratio("V_o1", (0, 1)) < 0.3);
    let constant = lines.iter().find(|line| line.label == (0, 0)).unwrap();
    assert!(constant.printed.abs() > 1e-3 && constant.quadratic == 0.0);
    // (37) has its line at f_dr right, but for what comes of the drive.
    let quiet = printed_lines(&circuit(4), &EXCITATION, &COMB, &motion(2.0));
    let line = quiet.iter().find(|line| line.stage == "y_cap" && line.label == (0, 1)).unwrap();
    assert_close(line.printed, line.quadratic, 0.02, "y_cap");
}

//! Each check of a certificate can pass and can fail.

use super::{certificate, example, positions, rates, refusals, sine, temperature, turns};
use kalmems_applications::calibration::{Calibration, Certificate, CheckKind};

/// Whether the check of this kind passes; all of them if there are several.
fn passes(kind: CheckKind, found: &Calibration) -> bool {
    let checks = Certificate::of(found).validity;
    let own: Vec<bool> = checks.iter().filter(|check| check.kind == kind).map(|check| check.passes).collect();
    assert!(!own.is_empty(), "{kind:?} is not on the certificate: {checks:?}");
    own.into_iter().all(|passes| passes)
}

/// A record for which the check fails, and one without that fault. Every kind of check needs its pair here.
fn with_and_without_fault(kind: CheckKind) -> [Calibration; 2] {
    match kind {
        CheckKind::RecordScatter => {
            [refusals::by_frequency(""), refusals::by_frequency("reproducibility = \"0.01 %\"")]
        }
        CheckKind::OneScaleFactor => [refusals::with_turned_axis(), refusals::upright()],
        CheckKind::SineMotion => [0.03, 0.0].map(refusals::with_harmonic),
        // Half a unit of the second digit is then 0.6 % of a normal uncertainty of 89 ppm, and the ends of 20 000 trials are known to about 3 % of it.
        CheckKind::EnoughTrials => {
            let normal =
                [["170 ppm", "10 ppm"], ["100 ppm", "40 ppm"], ["30 ppm", "85 ppm"], ["200000", "20000"]];
            [example::gyroscope(&normal), example::gyroscope(&[])]
        }
        CheckKind::References => [1.01, 1.0].map(refusals::by_two_references),
        CheckKind::SquareReference => [0.02, 0.0].map(refusals::shaken_and_in_positions),
        CheckKind::BiasUnderVibration => [0.01, 0.0].map(refusals::shaken_and_at_rest),
        CheckKind::StillAtRest => [2e-3, 0.0].map(certificate::vibrating),
        CheckKind::Gravity => [positions::moved_in_a_position(), positions::usual("")],
        CheckKind::AxesOfPositions => [positions::usual(", scale = -1"), positions::usual("")],
        CheckKind::RateSteps => [rates::with_a_disturbed_step(0.05), rates::with_a_disturbed_step(0.0)],
        CheckKind::SettledRates => [rates::slow(""), rates::slow("settling = \"0.9 s\"\n")],
        CheckKind::AxisOfTable => [rates::about("x"), rates::about("z")],
        CheckKind::StatedTurns => [turns::ending_at(-0.98), turns::ending_at(-1.0)],
        CheckKind::WholeTurns => [turns::all_of(1.4), turns::all_of(1.0)],
        CheckKind::AxisOfTurns => [turns::of_two_degrees("x"), turns::of_two_degrees("z")],
        CheckKind::FollowedReference => [-1.013, 1.013].map(sine::with_scale),
        CheckKind::ReferenceHarmonics => [0.1, 0.0].map(sine::with_distortion),
        CheckKind::StillCycle => [5e-3, 0.0].map(temperature::shaken_cycle),
    }
}

#[test]
fn each_check_of_a_certificate_fails_for_a_fault_and_passes_without_it() {
    for kind in CheckKind::ALL {
        let [fault, none] = with_and_without_fault(*kind);
        assert!(!passes(*kind, &fault), "{kind:?} passes with its fault");
        assert!(passes(*kind, &none), "{kind:?} fails without its fault");
        assert!(!Certificate::of(&fault).valid, "{kind:?}");
    }
}

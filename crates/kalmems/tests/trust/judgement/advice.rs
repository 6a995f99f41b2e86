//! Advice of diagnoses and identifications, and that it agrees with the grade of the estimate.

use super::choice::disturbed;
use super::{EKF, LAG, Lag, filters, parsed, recorded, usual};
use kalmems::diagnose::{Diagnosis, DiagnosisFinding, diagnose, identify};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use tempfile::TempDir;

pub(super) fn diagnosed(text: &str, folder: &TempDir) -> Diagnosis {
    diagnose(published(), &parsed(text, folder), None, &Silent).unwrap()
}

/// What `estimate` grades as doubtful, `diagnose` does not call right: a noise that is told a thousand times too large, which no test of innovations
/// minds, and a gate that leaves out more samples than are disturbances.
#[test]
fn what_an_estimate_doubts_a_diagnosis_does_not_pass() {
    let right = format!("{LAG}{EKF}");
    let folder = usual(4000, 41);
    assert!(filters(&right, &folder)[0].passes());
    assert_eq!(diagnosed(&right, &folder).finding, DiagnosisFinding::NothingToChange);
    let noisy = right.replace("n = \"1e-4 V^2\"", "n = \"1e-1 V^2\"");
    assert!(!filters(&noisy, &folder)[0].passes());
    let found = diagnosed(&noisy, &folder);
    assert_ne!(found.finding, DiagnosisFinding::NothingToChange);
    assert!(found.tests.iter().any(|text| text.contains("times as large as they are")), "{:?}", found.tests);
    // One sample in twelve is a disturbance, which the gate leaves out.
    let folder = recorded(Lag { samples: 4000, density: 1e-2, noise: &mut disturbed(0.08) }, 46);
    assert!(!filters(&right, &folder)[0].passes());
    let found = diagnosed(&right, &folder);
    assert_ne!(found.finding, DiagnosisFinding::NothingToChange);
    assert!(!found.tests.is_empty());
}

/// A swing of a spring that hardens, at ten samples a cycle: ẍ = −ω²·(x + x³/2), by steps of Runge and Kutta's method that are a twentieth of the interval.
fn hard_spring() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (mut chance, mut state) = (WhiteNoise::new(45, 2), [1.0, 0.0]);
    let (interval_s, steps) = (1.0 / 10e3, 20);
    let mut recording = "time_s,y_V\n".to_owned();
    let rate = |[x, v]: [f64; 2]| [v, -(TAU * 1e3_f64).powi(2) * (x + 0.5 * x * x * x)];
    for k in 0..3000 {
        writeln!(recording, "{:e},{:e}", f64::from(k) * interval_s, state[0] + 1e-3 * chance.sample())
            .unwrap();
        for _ in 0..steps {
            let h = interval_s / f64::from(steps);
            let from = |by: f64, slope: [f64; 2]| [state[0] + by * slope[0], state[1] + by * slope[1]];
            let a = rate(state);
            let b = rate(from(0.5 * h, a));
            let c = rate(from(0.5 * h, b));
            let d = rate(from(h, c));
            state = std::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        }
    }
    std::fs::write(folder.path().join("recording.csv"), recording).unwrap();
    folder
}

/// Steps that are too long are the filter's own fault, of which no number of the experiment is the cause.
#[test]
fn steps_that_are_too_long_are_named_and_no_number_is_blamed() {
    let text = |steps: &str| {
        format!(
            "name = \"hard\"\n[device.equations]\nstates = {{ x = \"V\", v = \"V/s\" }}\n\
             derivative = {{ x = \"v\", v = \"-w^2*(x + b*x^3)\" }}\nmeasure = {{ y = \"x in V\" }}\n\
             noise = {{ y = \"1e-6[V^2]\", v = \"1e-2[V^2/s^3]\" }}\nparameters = {{ w = \"6283.185307 rad/s\", b = \"0.5 1/V^2\" }}\n\
             [[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = {{ column = \"time_s\" }}\nchannels = {{ y = \"y_V\" }}\n\
             [estimate]\nskip = \"20 ms\"\n[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = {{ x = \"1 V\", v = \"0 V/s\" }}\n\
             start_sd = {{ x = \"1 mV\", v = \"10 V/s\" }}\n{steps}"
        )
    };
    let folder = hard_spring();
    let (planned, one) = (text(""), text("steps = 1\n"));
    assert!(filters(&planned, &folder)[0].passes());
    assert_eq!(diagnosed(&planned, &folder).finding, DiagnosisFinding::NothingToChange);
    let estimated = filters(&one, &folder).swap_remove(0);
    assert!(!estimated.passes());
    let found = diagnosed(&one, &folder);
    assert!(found.finding == DiagnosisFinding::Steps && found.causes.is_empty(), "{}", found.to_text());
    assert!(found.to_text().contains("`steps = "), "{}", found.to_text());
}

/// A gain of the readout that is 3 % off is explained as well by a gain of the drive, and by a column of the drive that is scaled: with those the
/// state would be 3 % off, which a reference shows.
#[test]
fn lines_with_which_the_answer_is_farther_from_the_reference_are_withheld() {
    let mut noise = WhiteNoise::sample;
    // A state that hardly wanders is known by its drive.
    let folder = recorded(Lag { samples: 4000, density: 1e-5, noise: &mut noise }, 43);
    let text = format!("{LAG}{EKF}").replace("c = \"1\"", "c = \"1.03\"").replace("1e-2 V^2/s", "1e-5 V^2/s");
    let found = diagnosed(&text, &folder);
    assert_eq!(found.finding, DiagnosisFinding::Explained, "{:?}", found.tests);
    let cause = |name: &str| {
        found
            .causes
            .iter()
            .find(|cause| cause.name == name)
            .unwrap_or_else(|| panic!("no {name}: {}", found.to_text()))
    };
    let [right, wrong] = ["parameters.c", "parameters.k"].map(cause);
    assert!(right.withheld.is_none() && !right.edits.is_empty(), "{}", found.to_text());
    assert!(wrong.withheld.is_some() && wrong.edits.is_empty(), "{}", found.to_text());
    assert!(found.to_text().contains("the error against the reference would be"), "{}", found.to_text());
}

/// A density that the recording does not show does not keep the numbers that it determines from being found, and is itself no value.
#[test]
fn what_is_not_determined_is_held_and_the_others_are_found() {
    let mut noise = WhiteNoise::sample;
    let folder = recorded(Lag { samples: 6000, density: 0.0, noise: &mut noise }, 44);
    let text = format!("{LAG}{EKF}\n[identify]\nparameters = [\"tau\", \"n\", \"q\"]\n")
        .replace("tau = \"1 ms\"", "tau = \"1.02 ms\"")
        .replace("n = \"1e-4 V^2\"", "n = \"3e-4 V^2\"")
        .replace("1e-2 V^2/s", "1e-6 V^2/s");
    let found = identify(published(), &parsed(&text, &folder), &Silent).unwrap();
    let of = |name: &str| found.parameters.iter().find(|one| one.name.ends_with(name)).unwrap();
    let why: Vec<&str> = found.undetermined.iter().map(|one| one.what.as_str()).collect();
    assert_eq!(why, ["parameters.q"], "{:?}", found.undetermined);
    assert!(of("q").value.is_nan(), "{:?}", of("q"));
    for (name, value) in [("tau", 1e-3), ("n", 1e-4)] {
        let one = of(name);
        assert!((one.value - value).abs() < 4.0 * one.standard_error, "{one:?}");
        assert!(one.standard_error < 0.05 * value, "{one:?}");
    }
}

/// A number that the signal shows by the cosine of its tenfold alone: 0.1 and 2π/10 − 0.1 are the same to the recording.
#[test]
fn a_number_with_a_second_maximum_has_no_value() {
    let folder = usual(3000, 47);
    let text = format!("{LAG}{EKF}\n[identify]\nparameters = [\"a\", \"tau\"]\n")
        .replace("c*x in V", "c*x*cos(10*a)/0.5403023058681398 in V")
        .replace("c = \"1\"", "c = \"1\", a = \"0.11\"");
    let found = identify(published(), &parsed(&text, &folder), &Silent).unwrap();
    let of = |name: &str| found.parameters.iter().find(|one| one.name.ends_with(name)).unwrap();
    let why = found
        .undetermined
        .iter()
        .find(|one| one.what == "parameters.a")
        .unwrap_or_else(|| panic!("{found:?}"));
    assert!(why.why.contains("another value of it is nearly as likely"), "{why:?}");
    assert!(of("a").value.is_nan() && of("tau").value.is_finite(), "{found:?}");
}

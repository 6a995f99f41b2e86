//! Coloured noise in a signal: it is named with its size as a state of the filter, and only where it is.

use super::faults::{CORRELATED, Does, Fault, coloured};
use kalmems::diagnose::DiagnosisFinding;
use kalmems::units::Value;

/// How large it is, in standard deviations of the white noise.
const SIZE: f64 = 3.0;

const fn noisy(device: &'static str) -> Fault {
    Fault { device, does: Does::Records("signal", coloured), is_named: "coloured noise", sizes: [0.1, 100.0] }
}

/// A shared scanner's signal has white noise of (13.9 mV)² and an interval of 1 µs.
#[test]
fn coloured_noise_is_named_with_its_size() {
    let fault = noisy("shared scanner");
    let faulty = fault.of_size(SIZE, 311);
    let found = faulty.diagnosis();
    let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    println!("{:?} {names:?}", found.finding);
    assert_eq!(found.finding, DiagnosisFinding::Explained, "{names:?}");
    let cause = &found.causes[0];
    assert!(cause.name.starts_with(fault.is_named) && cause.passes, "{names:?}");
    let [edit] = cause.edits.as_slice() else { panic!("{:?}", cause.edits) };
    assert_eq!((edit.key.as_str(), &edit.from), ("estimate.filter[0].readout.coloured_noise", &None));
    let table: toml::Table = format!("x = {}", edit.to).parse().unwrap();
    let number = |key: &str| Value::parse(table["x"][key].as_str().unwrap()).unwrap().si();
    let (sd, time_s) = (number("sd"), number("time"));
    let truth = (SIZE * 1.92e-4_f64.sqrt(), CORRELATED * 1e-6);
    println!("{sd:.3e} V, {time_s:.3e} s of {truth:?}");
    assert!(
        (sd / truth.0 - 1.0).abs() < 0.1 && (time_s / truth.1 - 1.0).abs() < 0.2,
        "{sd} {time_s} {truth:?}"
    );
    // What it says is what the filter needs.
    let with = faulty.error_with(&found, &cause.name).unwrap();
    let clean = fault.right_error(0.0, 311).unwrap();
    println!("error {with:.3e} with it, {clean:.3e} without the noise");
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_wrong_stiffness_is_not_called_coloured_noise() {
    let key = "device.shared_scanner.resonator.stiffness";
    let fault = Fault {
        device: "shared scanner",
        does: Does::Told(key, 1.10e-4, "N m"),
        is_named: "resonator.stiffness",
        sizes: [1e-5, 0.5],
    };
    let found = fault.of_size(2e-4, 312).diagnosis();
    let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    println!("{:?} {names:?}", found.finding);
    assert!(names.iter().all(|name| !name.starts_with("coloured noise")), "{names:?}");
}

//! Faults that the program does not know: it says so, and names nothing in their place.

use super::faults::{Does, Fault, compressed, drifting, noisier, stepping, stuck, wandering};
use crate::devices::DEVICES;
use crate::side_by_side::side_by_side;
use kalmems::diagnose::DiagnosisFinding;

/// What is wrong, by a name, the function that does it, and the sizes from the first to the largest.
type Unknown = (&'static str, fn(&mut [f64], &[f64], f64, u64), [f64; 2]);

/// Written down before any of them was diagnosed.
const UNKNOWN: [Unknown; 6] = [
    ("a gain that drifts", drifting, [1e-3, 1.0]),
    ("an offset that wanders", wandering, [0.5, 1e3]),
    ("an offset that steps", stepping, [0.1, 100.0]),
    ("noise that grows", noisier, [0.1, 10.0]),
    ("an amplifier that compresses", compressed, [1e-4, 0.5]),
    ("a converter that sticks", stuck, [4.0, 1e3]),
];

/// Fresh recordings of each kind of fault of each device.
const SEEDS: [u64; 2] = [301, 302];

#[test]
#[ignore = "a quarter of an hour on two processors, beside other work, in a release build"]
fn slow_faults_that_are_not_known_get_no_wrong_name() {
    // The stage has several signals, and the axes of a scanner with two cost ten times as much as one.
    let devices = DEVICES.iter().filter(|device| !["micro-stage", "two axes"].contains(&device.name));
    let kinds: Vec<(&str, &Unknown)> =
        devices.flat_map(|device| UNKNOWN.iter().map(|unknown| (device.name, unknown))).collect();
    let findings = side_by_side(&kinds, |(device, (what, change, sizes))| {
        let fault = Fault { device, does: Does::Records("signal", *change), is_named: "", sizes: *sizes };
        let Some(size) = fault.visible_size() else {
            println!("{device:18} {what:30} is not seen in the innovations");
            return Vec::new();
        };
        let diagnosed = SEEDS.map(|seed| {
            let found = fault.of_size(2.0 * size, seed).diagnosis();
            let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
            println!("{device:18} {what:30} {size:9.2e}: {:?} {}", found.finding, names.join(", "));
            found.finding
        });
        diagnosed.to_vec()
    });
    let findings = findings.concat();
    let honest = findings.iter().filter(|finding| **finding == DiagnosisFinding::NoneOfThese).count();
    println!("{honest} of {} without a wrong name", findings.len());
    assert!(honest as f64 >= 0.8 * findings.len() as f64);
}

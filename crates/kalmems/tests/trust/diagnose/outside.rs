//! Faults that the program does not know: it says so, and names nothing in their place.

use super::faults::{Does, Fault, compressed, drifting, noisier, stepping, stuck, wandering};
use crate::devices::DEVICES;
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

#[test]
#[ignore = "15 minutes in a release build"]
fn slow_faults_that_are_not_known_get_no_wrong_name() {
    let (mut honest, mut all) = (0_u32, 0_u32);
    for (what, change, sizes) in UNKNOWN {
        // The stage has several signals, and the axes of a scanner with two cost ten times as much as one.
        for device in DEVICES.iter().filter(|device| !["micro-stage", "two axes"].contains(&device.name)) {
            let fault =
                Fault { device: device.name, does: Does::Records("signal", change), is_named: "", sizes };
            let Some(size) = fault.visible_size() else {
                println!("{:18} {what:30} is not seen in the innovations", device.name);
                continue;
            };
            for seed in [301, 302] {
                let found = fault.of_size(2.0 * size, seed).diagnosis();
                let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
                println!(
                    "{:18} {what:30} {size:9.2e}: {:?} {}",
                    device.name,
                    found.finding,
                    names.join(", ")
                );
                honest += u32::from(found.finding == DiagnosisFinding::NoneOfThese);
                all += 1;
            }
        }
    }
    println!("{honest} of {all} without a wrong name");
    assert!(f64::from(honest) >= 0.8 * f64::from(all));
}

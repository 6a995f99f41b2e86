//! Mistaken units and signs, which a diagnosis names.

use super::advice::diagnosed;
use super::{EKF, LAG, filters, usual};
use kalmems::diagnose::DiagnosisFinding;

/// What is written wrong in the file, what stands there, and a word of the cause that has to be first or among those that the recording cannot
/// tell apart.
const SLIPS: [(&str, &str, &str); 8] = [
    ("c = \"1\"", "c = \"1e-3\"", "parameters.c"),
    ("c = \"1\"", "c = \"1000\"", "parameters.c"),
    ("c = \"1\"", "c = \"-1\"", "parameters.c"),
    ("k = \"1\"", "k = \"-1\"", "parameters.k"),
    ("k = \"1\"", "k = \"1e-3\"", "parameters.k"),
    ("k = \"1\"", "k = \"57.29578\"", "parameters.k"),
    ("tau = \"1 ms\"", "tau = \"1 us\"", "parameters.tau"),
    ("tau = \"1 ms\"", "tau = \"6.283185 ms\"", "parameters.tau"),
];

#[test]
fn mistaken_units_and_signs_are_named() {
    let mut named = 0;
    for (place, (right, wrong, name)) in SLIPS.iter().enumerate() {
        let folder = usual(3000, 60 + place as u64);
        let text = format!("{LAG}{EKF}").replace(right, wrong);
        assert!(!filters(&text, &folder)[0].passes(), "{wrong}");
        let found = diagnosed(&text, &folder);
        let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
        let is_named =
            found.finding == DiagnosisFinding::Explained && names.iter().any(|own| own.starts_with(name));
        println!("{wrong}: {is_named} {names:?}");
        named += usize::from(is_named);
    }
    assert!(named == SLIPS.len(), "{named} of {}", SLIPS.len());
}

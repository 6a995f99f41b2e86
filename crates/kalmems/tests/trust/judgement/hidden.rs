//! Combinations of numbers that no innovation shows.

use super::advice::diagnosed;
use super::{EKF, LAG, Lag, recorded};
use kalmems::simulate::WhiteNoise;

/// A gain of the readout that is 1 % too large and one of the drive that is 1 % too small are the same to the signal, and move the state by 1 %; either of
/// them alone is seen.
#[test]
fn gains_that_make_up_for_each_other_are_named_together_with_what_they_do() {
    let folder = recorded(Lag { samples: 4000, density: 1e-5, noise: &mut WhiteNoise::sample }, 71);
    let text = format!("{LAG}{EKF}").replace("1e-2 V^2/s", "1e-5 V^2/s");
    let found = diagnosed(&text, &folder);
    // A scale of the drive's column is the same as the gain of the drive.
    let of = |note: &&kalmems::diagnose::ScaleNote| {
        let names = [&note.parameter].into_iter().chain(note.with.iter().map(|(name, _)| name));
        let names: Vec<&str> = names.map(String::as_str).collect();
        names.len() == 2 && names.contains(&"parameters.c")
    };
    let note = found.notes.iter().find(of).unwrap_or_else(|| panic!("{}", found.to_text()));
    let [(_, times)] = &note.with[..] else { panic!("{note:?}") };
    assert!((times + 1.0).abs() < 0.05, "{note:?}");
    assert!((note.change.scale.abs() / note.by - 1.0).abs() < 0.05, "{note:?}");
}

//! Densities of process noise that are left to the recording, of every device whose filters have one.

mod laboratory;

use crate::side_by_side::side_by_side;
use kalmems::diagnose::{FoundNoise, load_with_noise};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::units::Value;
use laboratory::{EQUATIONS, Laboratory, PISTON, SCANNER, STAGE, THRESHOLD, TWO_AXES};

const LABORATORIES: [&Laboratory; 6] = [&SCANNER, &TWO_AXES, &THRESHOLD, &STAGE, &EQUATIONS, &PISTON];

/// What is found, and the mean square of the noise that was drawn for each signal over its variance.
struct Found {
    noises: Vec<FoundNoise>,
    drawn: Vec<f64>,
}

/// The recording of a laboratory, or that of a device without process noise, whose density no recording shows.
fn found(laboratory: &Laboratory, seed: u64, is_noisy: bool) -> Found {
    let folder = tempfile::tempdir().unwrap();
    let drawn = laboratory.write(seed, is_noisy, folder.path());
    let path = folder.path().join("experiment.toml");
    let (experiment, found) = load_with_noise(published(), &path, &Silent)
        .unwrap_or_else(|e| panic!("{}, seed {seed}: {e}", laboratory.name));
    let text = experiment.to_toml().unwrap();
    assert!(!text.contains("from_recording"), "{}: {text}", laboratory.name);
    assert_eq!(found.len(), laboratory.densities.len() + laboratory.noises.len(), "{found:?}");
    Found { noises: found, drawn }
}

/// A number with its unit in SI; of equations the square of what stands in the brackets.
fn number(written: &str) -> f64 {
    let Some(square) = written.strip_prefix('(').and_then(|rest| rest.strip_suffix(")^2")) else {
        return Value::parse(written).unwrap().si();
    };
    Value::parse(&square.replace(['[', ']'], "")).unwrap().si().powi(2)
}

/// What was found of one noise: the logarithm of its ratio to the truth, half the width of its interval in standard deviations, and whether the
/// interval holds the truth.
#[derive(Clone, Copy)]
struct Told {
    off: f64,
    claimed: f64,
    holds: bool,
    /// Whether the recording shows it.
    is_shown: bool,
    /// Of the noise of a signal whether the mean square of what was drawn is within 1.96 standard deviations of its variance, √(2/n).
    is_drawn_within: bool,
}

/// The noises of a laboratory, each by its key, with what every recording told of it.
fn told(laboratory: &'static Laboratory, seeds: &[u64]) -> Vec<(String, Vec<Told>)> {
    let densities = laboratory.densities.iter().map(|(key, truth, _)| (*key, *truth));
    let noises = laboratory.noises.iter().map(|(key, sd)| (*key, (laboratory.noise)(sd * sd)));
    let truths: Vec<(&str, f64)> = densities.chain(noises).collect();
    let all = side_by_side(seeds, |seed| found(laboratory, *seed, true));
    let of = |(key, truth): (&str, f64)| {
        let place = laboratory.noises.iter().position(|(own, _)| *own == key);
        let one = |Found { noises, drawn }: &Found| {
            let noise = noises
                .iter()
                .find(|noise| noise.key.ends_with(key.rsplit_once('.').unwrap().1) && same(&noise.key, key));
            let noise = noise.unwrap_or_else(|| panic!("{key}: {noises:?}"));
            let ratio = number(&noise.written) / truth;
            let [low, high] = noise.interval.map(|factor| factor * ratio);
            Told {
                off: ratio.ln(),
                claimed: (noise.interval[1] / noise.interval[0]).ln() / (2.0 * 1.96),
                holds: (low..=high).contains(&1.0),
                is_shown: noise.interval[0] > 0.0,
                is_drawn_within: place.is_none_or(|place| {
                    (drawn[place] - 1.0).abs() <= 1.96 * (2.0 / f64::from(laboratory.samples)).sqrt()
                }),
            }
        };
        (key.to_owned(), all.iter().map(one).collect())
    };
    truths.into_iter().map(of).collect()
}

/// Whether a key is that of the table of all filters, or of the same name in a filter's own.
fn same(found: &str, key: &str) -> bool {
    found == key || (found.starts_with("estimate.filter") && key.starts_with("estimate.process_noise"))
}

#[test]
fn densities_are_found_from_the_recording_with_the_noise_of_the_readout() {
    for laboratory in LABORATORIES {
        for (key, told) in told(laboratory, &[1]) {
            for one in told {
                assert!(one.is_shown, "{}, {key}", laboratory.name);
                assert!(
                    one.off.abs() < 4.0 * one.claimed,
                    "{}, {key}: {} {}",
                    laboratory.name,
                    one.off,
                    one.claimed
                );
            }
        }
    }
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_density_that_the_recording_does_not_show_gets_its_upper_limit() {
    for laboratory in [&SCANNER, &STAGE, &PISTON] {
        for noise in found(laboratory, 3, false).noises {
            if noise.meaning.is_none() {
                continue;
            }
            let truth = laboratory.densities.iter().find(|(key, ..)| same(&noise.key, key)).unwrap().1;
            assert!(noise.interval[0] == 0.0 && (noise.interval[1] - 1.0).abs() < 1e-12, "{noise}");
            assert!(noise.to_string().contains("do not show that it is more than 0"), "{noise}");
            assert!(number(&noise.written) < truth, "{noise}");
        }
    }
}

/// Of how many of two hundred recordings, or of as many as `KALMEMS_SEEDS` says, the interval holds each noise; beside it of how many the noise that was
/// drawn has its variance within the 95 % of an ideal estimate, which is what an interval of this number of samples can hold at best.
fn intervals_hold(laboratory: &'static Laboratory) {
    let count = std::env::var("KALMEMS_SEEDS").ok().and_then(|count| count.parse::<u64>().ok());
    let seeds: Vec<u64> = (3001..=3000 + count.unwrap_or(200)).collect();
    let mut rows: Vec<(String, usize, usize, bool)> = Vec::new();
    for (key, told) in told(laboratory, &seeds) {
        let held = told.iter().filter(|one| one.holds).count();
        let drawn = told.iter().filter(|one| one.is_drawn_within).count();
        // Of a density that is not shown there is a limit alone.
        let shown: Vec<&Told> = told.iter().filter(|one| one.is_shown).collect();
        let mean =
            |of: &dyn Fn(&Told) -> f64| shown.iter().map(|one| of(one)).sum::<f64>() / shown.len() as f64;
        let off = mean(&|one| one.off);
        let spread = mean(&|one| (one.off - off).powi(2)).sqrt();
        let claimed = mean(&|one| one.claimed);
        println!(
            "| {} | {key} | {held} of {} | {drawn} | {} | {:+.1} % | {:.2} % | {:.2} % |",
            laboratory.name,
            told.len(),
            shown.len(),
            100.0 * off,
            100.0 * spread,
            100.0 * claimed
        );
        rows.push((key, held, told.len(), claimed < 1.3 * spread));
    }
    for (key, held, count, is_not_too_wide) in rows {
        // 86 of 100 or fewer happen once in 7000 times where 95 do.
        assert!(100 * held >= 86 * count, "{}, {key}: {held} of {count}", laboratory.name);
        assert!(is_not_too_wide, "{}, {key}", laboratory.name);
    }
}

#[test]
#[ignore = "some minutes in a release build"]
fn slow_densities_of_the_shared_scanner() {
    intervals_hold(&SCANNER);
}

#[test]
#[ignore = "some minutes in a release build"]
fn slow_densities_of_two_axes() {
    intervals_hold(&TWO_AXES);
}

#[test]
#[ignore = "some minutes in a release build"]
fn slow_density_of_the_threshold_scanner() {
    intervals_hold(&THRESHOLD);
}

#[test]
#[ignore = "some minutes in a release build"]
fn slow_density_of_the_micro_stage() {
    intervals_hold(&STAGE);
}

#[test]
#[ignore = "some minutes in a release build"]
fn slow_density_of_equations() {
    intervals_hold(&EQUATIONS);
}

#[test]
#[ignore = "some minutes in a release build"]
fn slow_densities_of_the_piston_mirror() {
    intervals_hold(&PISTON);
}

#[test]
fn what_cannot_be_found_is_refused_where_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("experiment.toml");
    // Who reads no recording.
    let stated =
        |text: &str| text.replace("noise_variance = \"from_recording\"", "noise_variance = \"1.92e-4 V^2\"");
    std::fs::write(&path, stated(SCANNER.told)).unwrap();
    let experiment = published().load(&path).unwrap();
    let refused = published().rig(&experiment).unwrap().wanted(&experiment).unwrap_err().to_string();
    assert!(refused.contains("estimate.process_noise.angular_acceleration"), "{refused}");
    assert!(refused.contains("`from_recording` is a density that `kalmems estimate`"), "{refused}");
    // A density that the device does not have.
    let unknown = SCANNER.told.replace("angular_acceleration = \"from", "acceleration = \"from");
    std::fs::write(&path, &unknown).unwrap();
    let refused = load_with_noise(published(), &path, &Silent).unwrap_err().to_string();
    assert!(refused.contains("process_noise.acceleration"), "{refused}");
    // A filter without innovations that tell it.
    SCANNER.write(1, true, folder.path());
    let deaf = stated(SCANNER.told).replace("method = \"ekf\"", "method = \"steady_state\"");
    std::fs::write(&path, &deaf).unwrap();
    let refused = load_with_noise(published(), &path, &Silent).unwrap_err().to_string();
    assert!(refused.contains("add one with `method = \"ekf\"`"), "{refused}");
}

//! Turns by a known angle with rests between them.

use super::coverage::assert_95_of_100;
use super::simulated::Noise;
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, CalibrationError, Certificate, GyroscopeCalibration, calibrate,
};
use kalmems_engines::progress::Silent;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;

const FILE: &str = "name = \"turns\"\n[sensor]\nrate = \"100 Hz\"\n\
    channels = { x = \"gx_rad_per_s\", y = \"gy_rad_per_s\", z = \"gz_rad_per_s\" }\n\
    [[turns]]\nname = \"z\"\nfile = \"turns.csv\"\naxis = \"z\"\nangle = \"360 deg\"\n";
const STATED: &str = "angle_uncertainty = \"0.05 deg\"\nalignment = \"2 mrad\"\n";

/// Of a turn to the positive side, the scale factor, that to the other side, and what the other axes show.
const SLOPES: [f64; 2] = [1.014, 1.011];
const OTHERS: [f64; 2] = [0.006, -0.004];
const BIAS: f64 = 4e-3;
const NOISE: f64 = 2e-3;
/// The rate of the Earth's rotation in rad/s.
const EARTH: f64 = 7.292e-5;
/// How far a turn ends from its angle, in rad.
const STOP: f64 = 1.5e-3;
const REST: usize = 250;
const TURN: usize = 300;

/// A record of turns, each so many times the whole one.
fn write(path: &std::path::Path, turns: &[f64], seed: u64) {
    let mut noise = Noise::new(seed);
    let mut text = "gx_rad_per_s,gy_rad_per_s,gz_rad_per_s\n".to_owned();
    // The Earth turns about a direction that is as likely as any other one.
    let along: f64 = 2.0 * noise.uniform() - 1.0;
    let across = EARTH * (1.0 - along * along).sqrt();
    let mut turned = TAU * noise.uniform();
    let mut row = |rate: f64, noise: &mut Noise, k: usize| {
        let slope = SLOPES[usize::from(rate < 0.0)];
        turned += 0.01 * rate;
        let of_earth = [across * turned.cos(), -across * turned.sin(), EARTH * along];
        // The bias drifts as a unit that warms up.
        let bias = BIAS + 1e-7 * k as f64;
        let mut axes = of_earth.into_iter().zip([OTHERS[0] * rate, OTHERS[1] * rate, slope * rate]);
        let [x, y, z] = std::array::from_fn(|_| {
            let (earth, rate) = axes.next().unwrap();
            rate + earth + bias + NOISE * noise.normal()
        });
        writeln!(text, "{x:.8},{y:.8},{z:.8}").unwrap();
    };
    let mut k = 0;
    for turn in turns.iter().copied().chain([0.0]) {
        for _ in 0..REST {
            row(0.0, &mut noise, k);
            k += 1;
        }
        if turn != 0.0 {
            let angle = TAU * turn + STOP * noise.normal();
            // Σ sin² over the turn is half of its samples.
            let size = angle / (0.5 * TURN as f64 * 0.01);
            for place in 0..TURN {
                row(size * (PI * place as f64 / TURN as f64).sin().powi(2), &mut noise, k);
                k += 1;
            }
        }
    }
    fs::write(path, text).unwrap();
}

fn calibrated(turns: &[f64], seed: u64, text: &str) -> Result<Calibration, CalibrationError> {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("turns.csv"), turns, seed);
    calibrate(&GyroscopeCalibration::parse(text, &folder.path().join("turns.toml")).unwrap(), &Silent)
}

const TO_AND_FRO: [f64; 10] = [1.0, -1.0, 1.0, -1.0, 2.0, -2.0, 1.0, -1.0, 1.0, -1.0];
const TO_ONE_SIDE: [f64; 8] = [1.0; 8];

/// How often each number is in its interval.
fn held(turns: &[f64], seeds: std::ops::Range<u64>) -> BTreeMap<&'static str, usize> {
    let both = turns.iter().any(|turn| *turn < 0.0);
    let mean = if both { 0.5 * (SLOPES[0] + SLOPES[1]) } else { SLOPES[0] };
    let mut truth = vec![("scale_factor_z", mean)];
    truth.extend([("cross_axis_sensitivity_xz", OTHERS[0]), ("cross_axis_sensitivity_yz", OTHERS[1])]);
    if both {
        truth.push(("asymmetry_z", (SLOPES[0] - SLOPES[1]) / mean));
    }
    let mut held: BTreeMap<&str, usize> = truth.iter().map(|(name, _)| (*name, 0)).collect();
    for seed in seeds {
        let found = calibrated(turns, seed, FILE).unwrap();
        for (name, value) in &truth {
            let estimate = found.records[0].estimate(name).unwrap_or_else(|| panic!("{name}"));
            let [low, high] = estimate.interval;
            assert!(low < estimate.value && estimate.value < high, "{name} {estimate:?}");
            // In whole turns to and fro the Earth's part is the same both ways and cancels, which the interval of the other axes does not know.
            let is_by_record = both && name.starts_with("cross");
            let half = if is_by_record { estimate.expanded_by_records } else { estimate.expanded() };
            *held.get_mut(name).unwrap() += usize::from((estimate.value - value).abs() <= half);
        }
    }
    held
}

#[test]
fn turns_give_scale_factor_asymmetry_and_cross_axis_sensitivity() {
    for turns in [&TO_AND_FRO[..], &TO_ONE_SIDE] {
        let held = held(turns, 0..8);
        // Four or fewer of eight come once in 2700 times for one number.
        assert!(held.values().all(|held| *held >= 5), "{held:?}");
    }
}

#[test]
#[ignore = "800 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_turns_hold_95_of_100() {
    for turns in [&TO_AND_FRO[..], &TO_ONE_SIDE] {
        let name = format!("{} turns, the second by {}", turns.len(), turns[1]);
        assert_95_of_100(&name, held(turns, 1000..1400), 400);
    }
}

#[test]
fn the_angle_and_the_alignment_are_in_the_budget_and_asked_for() {
    let [without, with] =
        [FILE, &format!("{FILE}{STATED}")].map(|text| calibrated(&TO_AND_FRO, 3, text).unwrap());
    let of = |found: &Calibration, name: &str| *found.records[0].estimate(name).unwrap();
    let scale = of(&with, "scale_factor_z");
    let angle = scale.value * 0.05 / 360.0;
    assert!((scale.uncertainty / scale.by_records.hypot(angle) - 1.0).abs() < 1e-3, "{scale:?}");
    assert!(of(&with, "cross_axis_sensitivity_xz").uncertainty > 2e-3);
    let missing = Certificate::of(&without).not_stated.join("\n");
    assert!(missing.contains("angle_uncertainty") && missing.contains("alignment of the turns"), "{missing}");
    assert!(with.records[0].not_observed.join("\n").contains("the sign of the scale factor"));
}

/// Turns to and fro, of which the fourth one is this part of the angle.
pub fn ending_at(part: f64) -> Calibration {
    let mut turns = TO_AND_FRO;
    turns[3] = part;
    calibrated(&turns, 3, FILE).unwrap()
}

/// Turns to and fro, each this part of the stated angle.
pub fn all_of(part: f64) -> Calibration {
    calibrated(&TO_AND_FRO.map(|turn| part * turn.signum()), 3, FILE).unwrap()
}

/// Many turns about z, whose record states this axis and an angle of which each is a multiple.
pub fn of_two_degrees(axis: &str) -> Calibration {
    let text = FILE.replace("axis = \"z\"", &format!("axis = \"{axis}\"")).replace("360 deg", "2 deg");
    calibrated(&[1.0, -1.0, 40.0, -40.0, 60.0, -60.0], 3, &text).unwrap()
}

#[test]
fn a_turn_that_ends_elsewhere_another_axis_and_too_few_turns_are_named() {
    let found = ending_at(-0.98);
    assert!(found.records[0].warnings.join("\n").contains("turn 4 at"), "{:?}", found.records[0].warnings);
    let other = of_two_degrees("x");
    let failed: Vec<String> = Certificate::of(&other)
        .validity
        .into_iter()
        .filter(|check| !check.passes)
        .map(|check| check.what)
        .collect();
    assert!(failed.join("; ").contains("about the stated axis"), "{failed:?}");
    let few = calibrated(&[1.0, -1.0], 3, FILE).unwrap_err().to_string();
    assert!(few.contains("found 2 turns") && few.contains("at least 4"), "{few}");
}

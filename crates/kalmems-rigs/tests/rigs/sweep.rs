//! Intervals of the micro-stage's resonance by a stepped sweep.

use kalmems_engines::simulate::WhiteNoise;
use kalmems_rigs::micro_stage::identification::{StageSweepPoint, fit_sweep};
use std::f64::consts::TAU;

const SWEEPS: u64 = 400;

/// Sweeps with noise of the size of a vibrometer's, which shows the motion 6.87 µs late: how often the intervals hold f_n, ζ and b_c by the response and by
/// the circle.
#[test]
fn intervals_of_a_noisy_sweep_hold_what_it_was_made_of() {
    let (f_n, zeta, gain, delay) = (1714.4, 0.005, 3770.0, 6.87e-6);
    let natural = TAU * f_n;
    let deviation = 2e-4;
    let mut held = [0; 6];
    for seed in 0..SWEEPS {
        let mut noise = WhiteNoise::new(50_000 + seed, 12);
        let points: Vec<StageSweepPoint> = (0..9)
            .map(|k| {
                let f = 1711.0 + f64::from(k);
                let w = TAU * f;
                let (a, b) = (natural * natural - w * w, 2.0 * zeta * natural * w);
                let size = gain * w / (a * a + b * b);
                let ([re, im], (sine, cosine)) = ([size * b, size * a], (-w * delay).sin_cos());
                let [re, im] = [re * cosine - im * sine, re * sine + im * cosine]
                    .map(|part| part + deviation * noise.sample());
                StageSweepPoint { frequency_hz: f, re, im, deviation }
            })
            .collect();
        let found = fit_sweep(&points).unwrap();
        let numbers = [
            (found.natural_frequency_hz(), f_n),
            (found.damping_ratio(), zeta),
            (found.drive_gain(), gain),
            (found.circle_frequency_hz(), f_n),
            (found.circle_damping_ratio(), zeta),
            (found.circle_drive_gain(), gain),
        ];
        for (held, (number, truth)) in held.iter_mut().zip(numbers) {
            // Student's t for twelve degrees of freedom: 18 residuals less 6 parameters.
            *held += u64::from((number.value - truth).abs() < 2.179 * number.deviation);
        }
    }
    println!("f_n, damping and drive gain, by the response and by the circle: {held:?} of {SWEEPS}");
    // Fewer than 366 or more than 392 of 400 come once in 1000 times each.
    assert!(held.iter().all(|held| (366..=392).contains(held)), "{held:?}");
    let part = held.iter().sum::<u64>() as f64 / (6 * SWEEPS) as f64;
    assert!((0.94..=0.97).contains(&part), "{part}");
}

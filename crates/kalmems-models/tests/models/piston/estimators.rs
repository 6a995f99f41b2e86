//! Filter and phase-locked loop against the posterior bound.

use super::motion::{Case, Errors, PLATE, ends, pooled};
use kalmems_core::{FixedGain, Ldl};
use kalmems_models::readout::PhasorDetector;
use std::f64::consts::TAU;

const CASE: Case =
    Case { noise_af: 0.151, rate_hz: 20e3, duration_s: 1.0, from_s: 0.4, drift: 0.2, walks: true, seed: 1 };

fn runs(case: Case, seeds: u64) -> Vec<Errors> {
    (1..=seeds).map(|seed| Case { seed, ..case }.run()).collect()
}

/// On motions that walk as the filter thinks, about a drift of 20 % per minute: the mean square of 12 records of 0.6 s,
/// each some 10 independent errors long, is known to some 15 %, its root to 8 %.
#[test]
fn the_filter_attains_the_posterior_bound_and_the_loop_nearly() {
    let all = runs(CASE, 12);
    let (filter, lock, bound) =
        (pooled(&all, |e| e.filter), pooled(&all, |e| e.lock), pooled(&all, |e| e.bound));
    let (claim, lock_claim) = (pooled(&all, |e| e.claim), pooled(&all, |e| e.lock_claim));
    println!("filter {filter:.3e}, loop {lock:.3e}, bound {bound:.3e}, claims {claim:.3e} {lock_claim:.3e}");
    println!("filter/bound {:.3}, loop/filter {:.3}", filter / bound, lock / filter);
    assert!((0.8..1.2).contains(&(filter / bound)));
    assert!((claim / bound - 1.0).abs() < 0.01);
    // Settled from the start, the loop claims no more than the filter that settles, and keeps what it claims. From one
    // start with one covariance, loop and filter say the same but for what the mean over a cycle leaves out.
    let apart = pooled(&all, |e| e.apart);
    println!("loop/claim {:.3}, loop and filter {:.3} of that apart", lock / lock_claim, apart / lock_claim);
    assert!((0.85..1.15).contains(&(lock / lock_claim)) && lock_claim < claim);
    assert!(apart < 0.05 * lock_claim);
}

/// 20 seeds at 194 kHz with both noise densities, and their spread.
#[test]
#[ignore = "40 records of 3 s at 194 kHz"]
fn slow_the_filter_attains_the_posterior_bound_at_194_khz() {
    for noise_af in [0.151, 0.393] {
        let case = Case { noise_af, rate_hz: 194e3, duration_s: 3.0, from_s: 0.5, ..CASE };
        let all = runs(case, 20);
        let (filter, lock, bound) =
            (pooled(&all, |e| e.filter), pooled(&all, |e| e.lock), pooled(&all, |e| e.bound));
        let [low, high] = ends(&all, |e| e.filter);
        println!(
            "{noise_af} aF/√Hz: bound {:.2} nm, filter {:.2} nm ({:.2} to {:.2}), ratio {:.3}; loop {:.2} nm, ratio {:.3}",
            bound * 1e9,
            filter * 1e9,
            low * 1e9,
            high * 1e9,
            filter / bound,
            lock * 1e9,
            lock / bound
        );
        assert!((0.9..1.1).contains(&(filter / bound)) && lock / bound < 1.15);
    }
}

/// A static system with white noise alone, a filter that is told so: its error after 0.2 s has the covariance of the bound.
/// The mean of eᵀP⁻¹e/5 over 60 seeds is known to ±0.08.
#[test]
fn in_a_static_system_the_filter_attains_the_bound() {
    let case = Case { drift: 0.0, walks: false, duration_s: 0.2, from_s: 0.1, ..CASE };
    let all = runs(case, 60);
    let nees = |e: &Errors| {
        let ldl = Ldl::of(&e.last_bound.unwrap());
        e.last.iter().zip(ldl.solve(&e.last)).map(|(a, b)| a * b).sum::<f64>() / 5.0
    };
    let mean = all.iter().map(nees).sum::<f64>() / 60.0;
    let ratio = pooled(&all, |e| e.filter) / pooled(&all, |e| e.bound);
    println!("mean of the error's square over the bound's {mean:.3}, position {ratio:.3}");
    assert!((mean - 1.0).abs() < 0.25, "{mean}");
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

/// The filter with the same densities at four rates: the same error within a quarter.
#[test]
#[ignore = "10 records of 1.5 s at up to 1.4 MHz"]
fn slow_the_error_does_not_depend_on_the_sampling_rate() {
    let at = |rate_hz: f64| {
        let case = Case { rate_hz, duration_s: 1.5, walks: false, ..CASE };
        let all = runs(case, 10);
        println!("{rate_hz} Hz: {:.2} nm {:?}", pooled(&all, |e| e.filter) * 1e9, ends(&all, |e| e.filter));
        pooled(&all, |e| e.filter)
    };
    let first = at(20e3);
    for rate_hz in [60e3, 194e3, 1.4e6] {
        assert!((at(rate_hz) / first - 1.0).abs() < 0.25);
    }
}

/// Phase and frequency stand apart from the rest, and are the second-order loop in which a Kalman–Bucy filter of a phase
/// with a random walk of its rate settles: ω_n = (q/r)^{1/4}, damping 1/√2, so that the loop corrects the phase by
/// √2·ω_n and its rate by ω_n² per second of the phase's error.
#[test]
fn the_loop_has_the_natural_rate_and_the_damping_of_the_closed_form() {
    let detector = PhasorDetector { series: PLATE };
    let case = CASE;
    let x = [0.5e-3, 500.0, 0.7, 1e-3, 0.0];
    let point = detector.operating_point(&case.process(), &x, case.variance());
    let lock = FixedGain::<f64, 5, 3>::steady_state(x, &point).unwrap();
    let interval = 1.0 / case.rate_hz;
    // The mean of (C′·A·sin φ)² by another sum.
    let points = 1000;
    let square = |k: u32| {
        let (s, c) = (TAU * f64::from(k) / f64::from(points)).sin_cos();
        (109.3e-18 / (1e-3 + 0.5e-3 * c).powi(2) * 0.5e-3 * s).powi(2)
    };
    let detected = (0..points).map(square).sum::<f64>() / f64::from(points);
    let noise_of_phase = case.variance() * interval / detected;
    let walk_of_rate = TAU * TAU * 1e-8;
    let natural = (walk_of_rate / noise_of_phase).powf(0.25);
    let proportional = lock.gain().0[2][1] * detected / interval;
    let integral = TAU * lock.gain().0[1][1] * detected / interval;
    println!("natural rate {natural:.3} rad/s, {:.3} Hz", natural / TAU);
    assert!((proportional / (2_f64.sqrt() * natural) - 1.0).abs() < 1e-3, "{proportional} {natural}");
    assert!((integral / natural.powi(2) - 1.0).abs() < 2e-3, "{integral} {natural}");
    // The mixers keep them apart from amplitude and rest position.
    for (i, j) in [(0, 1), (3, 1), (4, 1), (1, 0), (2, 0), (1, 2), (2, 2)] {
        let scale = lock.gain().0[i].iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        assert!(lock.gain().0[i][j].abs() < 1e-6 * scale.max(f64::MIN_POSITIVE) || i == 0, "{i} {j}");
    }
}

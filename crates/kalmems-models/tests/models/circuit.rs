//! Stages of the circuit against closed forms and against integration in steps too small to err.

use kalmems_models::circuit::{
    Cascade, DiodeEnvelope, SampledCascade, SampledDiode, SampledSection, Section, Transimpedance,
};
use proptest::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

fn modulus((re, im): (f64, f64)) -> f64 {
    re.hypot(im)
}

proptest! {
    /// |H|² = 1/(1 + (ω_c/ω)²ⁿ), whatever the order.
    #[test]
    fn the_high_pass_is_butterworths(order in 1..=8_usize, ratio in 0.02..50.0_f64) {
        let cascade = Cascade::high_pass(order, 3e6).unwrap();
        let square = modulus(cascade.response(3e6 * ratio)).powi(2);
        let expected = 1.0 / (1.0 + ratio.powi(-2 * i32::try_from(order).unwrap()));
        prop_assert!((square / expected - 1.0).abs() < 1e-9, "{square} {expected}");
    }

    /// A sine at 50 samples per cycle comes out as the response says.
    #[test]
    fn a_sampled_filter_has_the_response_of_the_continuous_one(order in 1..=8_usize, ratio in 0.5..2.0_f64) {
        let (rate, interval) = (TAU * 5e5, 1.0 / (50.0 * 5e5));
        let cascade = Cascade::high_pass(order, rate * ratio).unwrap();
        let mut sampled = SampledCascade::new(&cascade, interval);
        let (mut c, mut s) = (0.0, 0.0);
        for k in 0..3000 {
            let angle = rate * interval * f64::from(k);
            let y = sampled.step(angle.cos());
            if k >= 2500 {
                c += y * angle.cos() / 250.0;
                s += y * angle.sin() / 250.0;
            }
        }
        let (re, im) = cascade.response(rate);
        prop_assert!((c - re).hypot(s + im) < 1e-3, "{c} {re}, {s} {im}");
    }
}

#[test]
fn no_order_beyond_what_there_is() {
    assert!(Cascade::high_pass(0, 1.0).is_none() && Cascade::high_pass(9, 1.0).is_none());
    assert!((modulus(Section::low_pass(2.0).response(2.0)) - FRAC_1_SQRT_2).abs() < 1e-15);
    assert!((modulus(Section::high_pass(2.0).response(2.0)) - FRAC_1_SQRT_2).abs() < 1e-15);
}

/// Published poles, 40.8 and 41.1 kHz, at 31.35 kHz: 0.63 and 75°, or 6.6 µs.
#[test]
fn the_published_poles_cost_three_eighths_and_six_microseconds() {
    let (re, im) = Cascade::two_poles([40.8e3, 41.1e3].map(|hz| TAU * hz)).response(TAU * 31.35e3);
    let lag = -im.atan2(re);
    assert!((re.hypot(im) - 0.630).abs() < 1e-3 && (lag.to_degrees() - 74.9).abs() < 0.1);
    assert!((lag / (TAU * 31.35e3) - 6.63e-6).abs() < 0.02e-6);
}

/// The charge of a capacitance that swings under a voltage that swings, differenced in a step too small to err.
#[test]
fn the_current_is_the_derivative_of_the_charge() {
    let stage = Transimpedance { feedback_resistance: 17.86e3, parasitic_capacitance: 5e-12 };
    let (w, v) = (TAU * 31e3, TAU * 500e3);
    let capacitance = |t: f64| 14e-12 + 1e-12 * (w * t).cos();
    let voltage = |t: f64| 90.0 + 6.0 * (v * t).sin();
    let charge = |t: f64| (capacitance(t) + 5e-12) * voltage(t);
    for i in 0..100 {
        let (t, h) = (0.33e-6 * f64::from(i), 1e-10);
        let differenced = 17.86e3 * (charge(t + h) - charge(t - h)) / (2.0 * h);
        let rates = (-1e-12 * w * (w * t).sin(), 6.0 * v * (v * t).cos());
        let ours = stage.voltage(capacitance(t), rates.0, voltage(t), rates.1);
        assert!((ours - differenced).abs() < 1e-5, "{t}: {ours} {differenced}");
    }
}

/// At 50 samples per cycle of the carrier against Euler's method in steps a thousand times smaller.
#[test]
fn the_diode_follows_its_equation() {
    let diode = DiodeEnvelope {
        forward_drop: 0.2,
        series_resistance: 100.0,
        load_resistance: 10e3,
        load_capacitance: 390e-12,
    };
    let (carrier_hz, fine) = (500e3, 1000);
    let interval = 1.0 / (50.0 * carrier_hz);
    let input = |t: f64| (4.0 + (TAU * 31e3 * t).cos()) * (TAU * carrier_hz * t).sin();
    let mut sampled = SampledDiode::new(diode, interval);
    let (mut exact, mut worst, mut t) = (0.0, 0.0_f64, 0.0);
    for k in 0..4000_u32 {
        for _ in 0..fine {
            let h = interval / f64::from(fine);
            let middle = exact + 0.5 * h * diode.rate(input(t), exact);
            exact += h * diode.rate(input(t + 0.5 * h), middle);
            t += h;
        }
        worst = worst.max((sampled.step(input(interval * f64::from(k + 1))) - exact).abs());
    }
    println!("diode: worst {worst:.5} V of {exact:.3} V");
    assert!(worst < 0.02, "{worst}");
    assert!(exact > 2.0);
}

/// White noise of a density S behind a pole at f has the variance S·f·π/2.
#[test]
fn noise_of_a_density_is_that_behind_a_pole() {
    let (pole_hz, rate_hz, count) = (40e3, 25e6, 400_000);
    let mut filter = SampledSection::new(&Section::low_pass(TAU * pole_hz), 1.0 / rate_hz);
    // An even distribution of variance S·rate/2 with S = 1.
    let side = (3.0_f64 * 0.5 * rate_hz).sqrt();
    let (mut state, mut sum) = (7_u64, 0.0);
    for _ in 0..count {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let uniform = (state >> 11) as f64 / (1_u64 << 53) as f64;
        sum += filter.step(side * (2.0 * uniform - 1.0)).powi(2);
    }
    // 4000 time constants: 3 % is one standard deviation.
    let ratio = sum / f64::from(count) / (0.5 * PI * pole_hz);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

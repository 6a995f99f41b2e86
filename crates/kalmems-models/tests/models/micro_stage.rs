//! The micro-stage's laws against finite differences, closed forms, quadrature and integration.

use approx::assert_relative_eq;
use kalmems_core::Over;
use kalmems_core::{Delayed, Dynamics, Measurement, Nodes, NoiseDensity, Process, Rk4};
use kalmems_models::capacitance::{SlidingPlate, StageLayout, TiltingPlate};
use kalmems_models::dynamics::{MirrorResonator, PiezoStage, TiltAndPiston};
use kalmems_models::readout::{DifferentialCurrent, EdgeVibrometer, PlateCurrent, PlateCurrents};
use proptest::prelude::*;
use std::f64::consts::TAU;

const GAP: f64 = 19.2e-6;
const AIR: f64 = 8.8542e-12;
const GAIN: f64 = -2.40752e7;
const STAGE: PiezoStage<f64> = PiezoStage {
    resonator: MirrorResonator { natural_rate: TAU * 1714.5, damping_ratio: 0.005 },
    drive_gain: 3782.5,
};
const PISTON: PiezoStage<f64> = PiezoStage {
    resonator: MirrorResonator { natural_rate: TAU * 1002.0, damping_ratio: 0.01 },
    drive_gain: 0.05,
};

fn channels() -> [PlateCurrent<f64>; 4] {
    StageLayout::PUBLISHED.plates(GAP, AIR).map(|plate| PlateCurrent { plate, gain: GAIN })
}

/// Equation 31 as it stands, for the integrator.
#[derive(Clone, Copy)]
struct Continuous(PiezoStage<f64>);

impl Dynamics<f64, 2> for Continuous {
    type Input = f64;
    fn derivative<S: Over<f64>>(&self, x: &[S; 2], drive: &f64) -> [S; 2] {
        let PiezoStage { resonator, drive_gain } = self.0;
        let pull = S::lift(drive * drive_gain);
        let rate = S::lift(resonator.natural_rate);
        [x[1], pull - x[0] * rate.sq() - x[1] * (2.0 * resonator.damping_ratio * resonator.natural_rate)]
    }
}

#[test]
fn the_exact_step_is_what_the_equation_integrates_to() {
    // 1.6 µs with a held drive, against sixteen Runge–Kutta steps.
    let (interval, drive) = (1.6e-6, 1.3);
    let exact = STAGE.exact(interval, 0.0).step(&[1e-3, -15.0], &[drive]);
    let fine = Rk4::new(Continuous(STAGE), interval / 16.0, &NoiseDensity::none(), (&[0.0; 2], &0.0));
    let mut state = [1e-3, -15.0];
    for _ in 0..16 {
        state = fine.step(&state, &Nodes { start: drive, middle: drive, end: drive });
    }
    assert_relative_eq!(exact[0], state[0], max_relative = 1e-13);
    assert_relative_eq!(exact[1], state[1], max_relative = 1e-13);
    // The input's integral in closed form: B = b·[(1 − A11)/ω_n², A12].
    let process = STAGE.exact(interval, 0.0);
    let a = process.transition;
    let natural = STAGE.resonator.natural_rate;
    assert_relative_eq!(
        process.input[(0, 0)],
        STAGE.drive_gain * (1.0 - a[(0, 0)]) / natural.powi(2),
        max_relative = 1e-9
    );
    assert_relative_eq!(process.input[(1, 0)], STAGE.drive_gain * a[(0, 1)], max_relative = 1e-12);
}

/// A sampled sine as the mean of both ends gives the steady motion of the frequency response, without a phase error of
/// first order; the later sample alone is ω·T/2 ahead, 8.5 mrad.
#[test]
fn a_sampled_sine_drives_the_stage_as_its_frequency_response() {
    let (interval, rate) = (1.6e-6, TAU * 1700.0);
    let process = STAGE.exact(interval, 0.0);
    let (re, im) = STAGE.response(rate);
    let drive = |k: f64| (rate * interval * k).cos();
    // θ = Re(G·e^{jωt}).
    let steady = |k: f64| {
        let (s, c) = (rate * interval * k).sin_cos();
        [re * c - im * s, -rate * (re * s + im * c)]
    };
    let late = |input: &dyn Fn(f64) -> f64| {
        let mut state = steady(0.0);
        let (mut sine, mut cosine, mut count) = (0.0, 0.0, 0);
        for k in 1..400_000 {
            let k = f64::from(k);
            state = process.step(&state, &[input(k)]);
            if k > 300_000.0 {
                let (s, c) = (rate * interval * k).sin_cos();
                (sine, cosine, count) = (sine + state[0] * s, cosine + state[0] * c, count + 1);
            }
        }
        let _ = count;
        let phase = (-sine).atan2(cosine) - im.atan2(re);
        phase - TAU * (phase / TAU).round()
    };
    let mean = late(&|k| 0.5 * (drive(k) + drive(k - 1.0)));
    let after = late(&|k| drive(k));
    assert!(mean.abs() < 1e-4, "{mean}");
    assert!((after - 0.5 * rate * interval).abs() < 1e-4, "{after}");
}

#[test]
fn tilt_and_piston_do_not_know_each_other() {
    let both = TiltAndPiston { tilt: STAGE, piston: PISTON }.exact(1.6e-6);
    let state = both.step(&[1e-3, 5.0, 20e-9, 1e-4], &[0.7]);
    let tilt = STAGE.exact(1.6e-6, 0.0).step(&[1e-3, 5.0], &[0.7]);
    let piston = PISTON.exact(1.6e-6, 0.0).step(&[20e-9, 1e-4], &[0.7]);
    for (found, expected) in state.iter().zip(tilt.iter().chain(&piston)) {
        assert_relative_eq!(*found, *expected, max_relative = 1e-12);
    }
}

/// The published edges, mirror images of each other.
#[test]
fn the_layout_is_that_of_the_tables() {
    let edges =
        StageLayout::PUBLISHED.plates(GAP, AIR).map(|p| [p.w1, p.w2, p.w3, p.w4].map(|w| (w * 1e6).round()));
    assert_eq!(edges[0], [-1390.0, -990.0, -200.0, 200.0]);
    assert_eq!(edges[1], [475.0, 795.0, -200.0, 200.0]);
    assert_eq!(edges[2], [990.0, 1390.0, -200.0, 200.0]);
    assert_eq!(edges[3], [-795.0, -475.0, -200.0, 200.0]);
    // dC/dθ has the sign of the side that the plate is on.
    for (channel, sign) in channels().iter().zip([-1.0, 1.0, 1.0, -1.0]) {
        assert!(channel.plate.slope(0.0) * sign > 0.0);
    }
}

/// Where the difference of an outer and an inner stator changes sign, by bisection; equal plates balance at rest.
#[test]
fn the_threshold_angle_is_where_the_pair_balances() {
    let [a1, b1, a2, _] = StageLayout::PUBLISHED.plates(GAP, AIR);
    let difference = |angle: f64| a1.capacitance(angle) - b1.capacitance(angle);
    let (mut low, mut high) = (0.0, 5e-3);
    assert!(difference(low) > 0.0 && difference(high) < 0.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if difference(middle) > 0.0 { low = middle } else { high = middle }
    }
    assert_relative_eq!(a1.balance(&b1).unwrap(), low, max_relative = 1e-11);
    assert!(a1.balance(&a2).unwrap().abs() < 1e-12);
    // A plate that is everywhere larger never balances.
    let twice = TiltingPlate { permittivity: 2.0 * a1.permittivity, ..a1 };
    assert_eq!(a1.balance(&twice), None);
}

proptest! {
    /// y = η·dC/dt along any motion, by differences of C; the Jacobian by differences of y.
    #[test]
    fn a_channel_is_the_rate_of_its_capacitance(
        angle in -4e-3..4e-3_f64,
        rate in -40.0..40.0_f64,
        rise in -50e-9..50e-9_f64,
        rise_rate in -1e-3..1e-3_f64,
        off in [-1e-3..1e-3_f64, -20.0..20.0_f64],
    ) {
        let h = 1e-8;
        for channel in channels() {
            let plate = channel.plate;
            let scale = GAIN.abs() * plate.slope(angle).abs() * 40.0;
            let by_time = |c: &dyn Fn(f64) -> f64| GAIN * (c(h) - c(-h)) / (2.0 * h);
            let tilted = by_time(&|t| plate.capacitance(angle + rate * t));
            let ([volts], jacobian) = channel.linearize(&[angle, rate]);
            prop_assert!((volts - tilted).abs() < 1e-6 * scale, "{volts} {tilted}");
            let risen = by_time(&|t| {
                TiltingPlate { gap: plate.gap - rise - rise_rate * t, ..plate }.capacitance(angle + rate * t)
            });
            let found = channel.voltage_while_rising(angle, rate, rise, rise_rate);
            prop_assert!((found - risen).abs() < 1e-6 * scale.max(found.abs()), "{found} {risen}");
            let both = by_time(&|t| plate.capacitance_of_both(off[0] + off[1] * t, angle + rate * t));
            let found = channel.voltage_of_both([off[0], angle], [off[1], rate]);
            prop_assert!((found - both).abs() < 1e-5 * scale, "{found} {both}");
            let step = [1e-8, 1e-4];
            for i in 0..2 {
                let at = |sign: f64| {
                    let mut x = [angle, rate];
                    x[i] += sign * step[i];
                    channel.voltage(x[0], x[1])
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * step[i]);
                prop_assert!((jacobian[(0, i)] - difference).abs() < 1e-6 * scale / step[i] * 1e-4);
            }
        }
    }
}

#[test]
fn several_channels_are_each_of_them() {
    let channels = channels();
    let x = [1.7e-3, -22.0];
    let (y, jacobian) = PlateCurrents { channels }.linearize(&x);
    let predicted: [f64; 4] = PlateCurrents { channels }.predict(&x);
    for (i, channel) in channels.iter().enumerate() {
        let ([volts], row) = channel.linearize(&x);
        assert_eq!((y[i], jacobian.0[i]), (volts, row.0[0]));
        assert_relative_eq!(predicted[i], volts, max_relative = 1e-14);
    }
    // Opposite outer stators: the even part of the curve, which both have, cancels at rest, and the odd doubles.
    let pair = DifferentialCurrent { positive: channels[2], negative: channels[0] };
    let [of_pair]: [f64; 1] = pair.predict(&[0.0, 20.0]);
    assert_relative_eq!(of_pair, 2.0 * channels[2].voltage(0.0, 20.0), max_relative = 1e-12);
    // What couples into both alike is gone; gaps that differ leave a little.
    let [a, b]: [f64; 2] = [1e-3, -1e-3].map(|angle| pair.predict(&[angle, 20.0])[0]);
    assert_relative_eq!(a, b, max_relative = 1e-12);
}

#[test]
fn a_sliding_plate_is_an_area_over_a_distance() {
    let plate = SlidingPlate { overlap: 50e-6, length: 1e-3, gap: 19e-6, permittivity: AIR };
    assert_relative_eq!(plate.capacitance(2e-6), AIR * 52e-6 * 1e-3 / 19e-6, max_relative = 1e-14);
    assert_relative_eq!(
        plate.difference(2e-6),
        plate.capacitance(2e-6) - plate.capacitance(-2e-6),
        max_relative = 1e-10
    );
}

/// A vibrometer that is late shows what the steady motion was.
#[test]
fn a_late_vibrometer_shows_the_past() {
    let vibrometer = EdgeVibrometer { gain: 50.0, lever_arm: 1.5e-3, bias: 0.0123 };
    let (rate, delay) = (TAU * 1714.5, 6.9e-6);
    let free = MirrorResonator { natural_rate: rate, damping_ratio: 0.0 };
    let late = Delayed { measurement: vibrometer, back: free.exact(-delay, 0.0).transition };
    let at = |t: f64| [1e-3 * (rate * t).sin(), 1e-3 * rate * (rate * t).cos()];
    let [volts] = late.predict(&at(2e-4));
    assert_relative_eq!(volts, 50.0 * 1.5e-3 * at(2e-4 - delay)[1] + 0.0123, max_relative = 1e-10);
    assert_relative_eq!(vibrometer.voltage(0.0, 1e-6), 50e-6 + 0.0123, max_relative = 1e-14);
}

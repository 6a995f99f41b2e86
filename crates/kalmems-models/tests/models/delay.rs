//! A readout that is late by a constant time, against the motion as it was.

use kalmems_core::{Dynamics, Mat, Measurement, Nodes, NoiseDensity, Process, Rk4, jacobian};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{DriveGain, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::{AngleBefore, DelayedComb, DemodulatedComb, LowPassedComb};
use std::f64::consts::TAU;

const RESONATOR: TorsionalResonator<f64> =
    TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const SCANNER: ParametricScanner<f64> =
    ParametricScanner { resonator: RESONATOR, comb: COMB, carrier_mean_square: 18.0 };
const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: 0.6181e12, offset: -2.7807 };
const START: f64 = 0.155;
/// Steps per µs of the finely integrated motion.
const FINE: usize = 20;

fn volts(time_s: f64) -> f64 {
    90.0 + 90.0 * (TAU * 31_350.0 * time_s).sin()
}

/// The states of a device under the drive, 20 a microsecond.
fn history<D: Dynamics<f64, N, Input = f64> + Copy, const N: usize>(
    dynamics: D,
    start: [f64; N],
    steps: usize,
) -> Vec<[f64; N]> {
    let interval = 1e-6 / FINE as f64;
    let step = Rk4::new(dynamics, interval, &NoiseDensity::none(), (&[0.0; N], &0.0));
    let mut states = vec![start];
    for k in 0..steps {
        let at = |share: f64| volts((k as f64 + share) * interval);
        let nodes = Nodes { start: at(0.0), middle: at(0.5), end: at(1.0) };
        states.push(step.step(&states[k], &nodes));
    }
    states
}

/// How far the angle of a while ago is missed at most over twenty cycles, in parts of the amplitude: from the
/// law of motion with the drive, and from the resonator alone.
fn missed(fine_steps_ago: usize) -> [f64; 2] {
    let delay = 1e-6 * fine_steps_ago as f64 / FINE as f64;
    let states = history(SCANNER, [START, 0.0], 1280 * FINE);
    let before = AngleBefore::of(delay, &RESONATOR);
    let alone = DelayedComb::of(&READOUT, delay, &RESONATOR);
    let (mut worst, mut largest) = ([0.0_f64; 2], 0.0_f64);
    for k in fine_steps_ago..states.len() {
        let ([angle, rate], truth) = (states[k], states[k - fine_steps_ago][0]);
        let drive = volts(k as f64 * 1e-6 / FINE as f64);
        let with_drive = before.angle(angle, rate, SCANNER.acceleration(angle, rate, drive));
        let without = alone.by_angle * angle + alone.by_rate * rate;
        worst[0] = worst[0].max((with_drive - truth).abs());
        worst[1] = worst[1].max((without - truth).abs());
        largest = largest.max(truth.abs());
    }
    worst.map(|w| w / largest)
}

#[test]
fn the_angle_of_a_while_ago() {
    let [with_drive, without] = missed(23);
    println!("1.15 µs: {with_drive:.1e} of the amplitude with the drive, {without:.1e} without");
    assert!(with_drive < 3e-5 && without < 3e-4, "{with_drive:e}, {without:e}");
    // Left alone it would be 0.11; a straight line back is off by (ωτ)²/2.
    assert!(with_drive < without / 5.0);
    let [with_drive, without] = missed(80);
    println!("4 µs: {with_drive:.1e} of the amplitude with the drive, {without:.1e} without");
    assert!(with_drive < 2e-3 && without < 4e-3, "{with_drive:e}, {without:e}");
}

/// A delay before the stages is the same as one behind them.
#[test]
fn a_delay_commutes_with_the_stages() {
    let at_once = LowPassedComb {
        device: DriveGain { scanner: SCANNER, drive_gain: 1.0 },
        before: AngleBefore::none(),
        gain: READOUT.gain,
        offset: READOUT.offset,
        poles: [TAU * 40.8e3, TAU * 41.1e3],
    };
    let ago = 23;
    let late =
        LowPassedComb { before: AngleBefore::of(1e-6 * ago as f64 / FINE as f64, &RESONATOR), ..at_once };
    let settled = at_once.voltage(START);
    let [prompt, late] = [at_once, late].map(|m| history(m, [START, 0.0, settled, settled], 1280 * FINE));
    // The starts are forgotten within 30 time constants of the stages.
    let settled = 120 * FINE;
    let (mut worst, mut unshifted) = (0.0_f64, 0.0_f64);
    for k in settled..late.len() {
        worst = worst.max((late[k][3] - prompt[k - ago][3]).abs());
        unshifted = unshifted.max((late[k][3] - prompt[k][3]).abs());
    }
    println!("{worst:.1e} V off where the delay makes {unshifted:.3} V");
    assert!(worst < 5e-4 * unshifted, "{worst:e} of {unshifted:e}");
}

#[test]
fn the_jacobian_by_hand_is_the_dual_one() {
    let late = DelayedComb::of(&READOUT, 1.16e-6, &RESONATOR);
    for x in [[0.0, 0.0, 1.0], [0.15, -3e3, 0.0], [-0.07, 1.2e4, 2.0]] {
        let (y, by_hand) = late.linearize(&x);
        let (z, by_dual): ([f64; 1], Mat<f64, 1, 3>) = jacobian(&x, |x| late.predict(x));
        assert_eq!(y, z);
        for j in 0..3 {
            let scale = by_dual[(0, j)].abs();
            assert!((by_hand[(0, j)] - by_dual[(0, j)]).abs() <= 1e-13 * scale, "{j}");
        }
    }
    // Without a delay it is the readout it is made of, to the bit.
    let prompt = DelayedComb::of(&READOUT, 0.0, &RESONATOR);
    for x in [[0.0, 0.0], [0.15, -3e3], [-0.07, 1.2e4]] {
        assert_eq!(prompt.linearize(&x), READOUT.linearize(&x));
    }
}

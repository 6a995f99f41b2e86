//! The threshold-sensing scanner's laws against quadrature, finite differences and closed forms.

use approx::assert_relative_eq;
use kalmems_core::augmentation::{AddedState, Augmented, AugmentedMeasurement, Drift};
use kalmems_core::{Dual, Mat, Measurement, Nodes, NoiseDensity, Process, Rk4, jacobian};
use kalmems_models::capacitance::{CombCurve, CombFingers, CurveShape};
use kalmems_models::dynamics::{CombDrivenMirror, MirrorResonator};
use kalmems_models::readout::{CurrentReadout, Feedthrough};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// R_s·V_bias in Ω·V.
const TRANSIMPEDANCE: f64 = 1e8;
const LOGISTIC: CombCurve<f64> =
    CombCurve { centre: 0.0037, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic };
const GAUSSIAN: CombCurve<f64> = CombCurve { steepness: 12.0, shape: CurveShape::Gaussian, ..LOGISTIC };
const FINGERS: CombFingers<f64> =
    CombFingers { pairs: 120.0, gap: 5e-6, height: 30e-6, inner: 250e-6, outer: 400e-6, permittivity: 1.0 };
const MIRROR: MirrorResonator<f64> = MirrorResonator { natural_rate: TAU * 624.6, damping_ratio: 0.0066 };

/// Simpson's rule.
fn integral(f: impl Fn(f64) -> f64, from: f64, to: f64, halves: u32) -> f64 {
    let h = (to - from) / f64::from(2 * halves);
    let at = |k: u32| f(from + h * f64::from(k));
    (0..halves).map(|k| at(2 * k) + 4.0 * at(2 * k + 1) + at(2 * k + 2)).sum::<f64>() * h / 3.0
}

proptest! {
    #[test]
    fn gain_slope_and_capacitance_are_one_curve(angle in -0.3..0.3_f64) {
        for curve in [LOGISTIC, GAUSSIAN] {
            // Equation 74 as it stands, and the slope of a Gaussian.
            let u = curve.steepness * (angle - curve.centre);
            let printed = match curve.shape {
                CurveShape::Logistic => 1.0 / (1.0 + (-u).exp()) - 0.5,
                CurveShape::Gaussian => u * (-u * u).exp(),
            };
            let h = curve.sensitivity(angle);
            prop_assert!((h - curve.gain * printed).abs() < 1e-15 * curve.gain);
            // y = −R_s·V_bias·dC/dt.
            let slope = curve.slope(angle, TRANSIMPEDANCE);
            prop_assert!((h + TRANSIMPEDANCE * slope).abs() < 1e-15 * curve.gain);
            // C by quadrature of that slope, and back by dual numbers.
            let scale = curve.gain / TRANSIMPEDANCE;
            let summed = integral(|x| curve.slope(x, TRANSIMPEDANCE), curve.centre, angle, 2000);
            let change = curve.capacitance_change(angle, TRANSIMPEDANCE);
            prop_assert!((change - summed).abs() < 1e-10 * scale, "{change} {summed}");
            let dual = curve.capacitance_change(Dual::<f64, 1>::variable(angle, 0), TRANSIMPEDANCE);
            prop_assert!((dual.gradient()[0] - slope).abs() < 1e-13 * scale);
            prop_assert!(change <= 0.0);
            let steep = curve.sensitivity(Dual::<f64, 1>::variable(angle, 0)).gradient()[0];
            let step = 1e-6;
            let difference = (curve.sensitivity(angle + step) - curve.sensitivity(angle - step)) / (2.0 * step);
            prop_assert!((steep - difference).abs() < 1e-6 * curve.gain * curve.steepness);
            prop_assert!(steep <= curve.steepest() * (1.0 + 1e-12));
        }
    }

    /// The area by a sum over the fingers' length, and the slope by differences.
    #[test]
    fn fingers_lose_the_area_that_they_turn_out_of(angle in -0.3..0.3_f64) {
        let area = integral(
            |r| (FINGERS.height - r * angle.tan().abs()).max(0.0), FINGERS.inner, FINGERS.outer, 4000,
        );
        let summed = 8.854_187_812_8e-12 * FINGERS.pairs / FINGERS.gap * area;
        let capacitance = FINGERS.capacitance(angle);
        let at_rest = FINGERS.capacitance(0.0);
        prop_assert!((capacitance - summed).abs() < 1e-6 * at_rest, "{capacitance} {summed}");
        let step = 1e-6;
        prop_assume!(angle.abs() > step);
        let difference = (FINGERS.capacitance(angle + step) - FINGERS.capacitance(angle - step)) / (2.0 * step);
        // The slope itself has a kink where the outermost ends leave each other.
        let bend = at_rest / (FINGERS.height / FINGERS.outer).powi(2) * step;
        prop_assert!((FINGERS.slope(angle) - difference).abs() < 10.0 * bend);
        let dual = FINGERS.capacitance(Dual::<f64, 1>::variable(angle, 0)).gradient()[0];
        prop_assert!((FINGERS.slope(angle) - dual).abs() < 1e-9 * at_rest);
    }

    #[test]
    fn the_readout_and_its_feedthrough_by_every_state(
        angle in -0.2..0.2_f64, rate in -600.0..600.0_f64, gain in -1.0..1.0_f64, offset in -1.0..1.0_f64,
        feed in -1.0..1.0_f64,
    ) {
        let constant = Drift::RandomWalk { density: 0.0 };
        let added = [0.05 * LOGISTIC.gain, 1e-3, 0.02e-12].map(|scale| AddedState { scale, drift: constant });
        let enters = [Some("comb.gain"), Some("offset"), None];
        let readout = CurrentReadout { comb: LOGISTIC, offset: 0.01 };
        let tracked = AugmentedMeasurement::<_, _, 2, 3>::new(readout, &added, enters).unwrap();
        let current_gain = 1e7 * 2.3e5;
        let seen = Feedthrough {
            readout: &tracked, current_gain, capacitance: 0.2e-12, state: Some((4, added[2].scale)),
        };
        let x = [angle, rate, gain, offset, feed];
        let u = 76.0 * (angle - 0.0037);
        let by_hand = 2.82e-3 * (1.0 + 0.05 * gain) * (1.0 / (1.0 + (-u).exp()) - 0.5) * rate
            + 0.01 + 1e-3 * offset - current_gain * (0.2e-12 + 0.02e-12 * feed);
        let ([y], h) = seen.linearize(&x);
        prop_assert!((y - by_hand).abs() < 1e-12);
        let ([z], dual): ([f64; 1], Mat<f64, 1, 5>) = jacobian(&x, |x| seen.predict(x));
        prop_assert!((y - z).abs() < 1e-15);
        for j in 0..5 {
            prop_assert!((h[(0, j)] - dual[(0, j)]).abs() < 1e-12);
        }
        prop_assert_eq!(h[(0, 3)], 1e-3);
    }
}

#[test]
fn a_curve_stays_finite_where_its_exponential_would_not() {
    for angle in [-1e9, -40.0, 40.0, 1e9] {
        let dual = Dual::<f64, 1>::variable(angle, 0);
        for curve in [LOGISTIC, GAUSSIAN] {
            let h = curve.sensitivity(dual);
            assert!(h.value().is_finite() && h.gradient()[0] == 0.0, "{h:?}");
        }
        assert_eq!(LOGISTIC.sensitivity(angle).abs(), 0.5 * LOGISTIC.gain);
    }
    assert_eq!(
        LOGISTIC.sensitivity(Dual::<f64, 1>::variable(LOGISTIC.centre, 0)).gradient(),
        [LOGISTIC.steepest()]
    );
}

/// Far from the jump fingers are a logistic comb of the gain that their geometry says, until they begin to leave.
#[test]
fn the_gain_of_fingers_is_the_jump_of_their_slope() {
    let gain = FINGERS.gain(TRANSIMPEDANCE);
    let jump = -TRANSIMPEDANCE * (FINGERS.slope(1e-9) - FINGERS.slope(-1e-9));
    assert_relative_eq!(jump, gain, max_relative = 1e-9);
    let comb = CombCurve { centre: 0.0, gain, steepness: 400.0, shape: CurveShape::Logistic };
    assert_relative_eq!(comb.slope(0.05, TRANSIMPEDANCE), FINGERS.slope(0.05), max_relative = 5e-3);
    // Beyond tan θ = t/r₁ they are not opposite anywhere.
    let gone = (FINGERS.height / FINGERS.inner).atan() + 1e-6;
    assert_eq!((FINGERS.capacitance(gone), FINGERS.slope(gone)), (0.0, 0.0));
    assert_eq!(FINGERS.slope(0.0), 0.0);
}

/// θ = A·e^{−ζω_n·t}·cos(…): the exact step keeps it to rounding, RK4 to 1e-9, and Euler's step does not.
#[test]
fn the_exact_step_decays_as_the_closed_form() {
    let (h, steps) = (2e-6, 40_000);
    let exact = MIRROR.exact(h, 1e3);
    let driven = CombDrivenMirror { resonator: MIRROR, comb: LOGISTIC, drive_gain: 30.0 };
    let stepped = Rk4::new(driven, h, &NoiseDensity::none().on::<1>(1e3), (&[0.0; 2], &0.0));
    let (mut x, mut z, mut euler) = ([0.15, 0.0], [0.15, 0.0], [0.15, 0.0]);
    for _ in 0..steps {
        x = exact.step(&x, &[0.0]);
        z = stepped.step(&z, &Nodes::held(0.0));
        let a = MIRROR.acceleration(euler[0], euler[1], 0.0);
        euler = [euler[0] + h * euler[1], euler[1] + h * a];
    }
    let (t, decay) = (h * f64::from(steps), MIRROR.natural_rate * MIRROR.damping_ratio);
    let omega = (MIRROR.natural_rate.powi(2) - decay * decay).sqrt();
    let truth = 0.15 * (-decay * t).exp() * ((omega * t).cos() + decay / omega * (omega * t).sin());
    assert_relative_eq!(x[0], truth, epsilon = 1e-13);
    assert_relative_eq!(z[0], truth, epsilon = 1e-10);
    let amplitude = |x: [f64; 2]| x[0].hypot(x[1] / MIRROR.natural_rate);
    let damping = -(amplitude(euler) / 0.15).ln() / (MIRROR.natural_rate * t);
    assert_relative_eq!(damping, 0.0027, epsilon = 5e-5);
    // Van Loan over an interval short against the motion: q·[[T³/3, T²/2], [T²/2, T]].
    for noise in [exact.noise.covariance(), stepped.noise().covariance()] {
        assert_relative_eq!(noise.get(0, 0), 1e3 * h.powi(3) / 3.0, max_relative = 1e-3);
        assert_relative_eq!(noise.get(1, 0), 1e3 * h.powi(2) / 2.0, max_relative = 1e-3);
        assert_relative_eq!(noise.get(1, 1), 1e3 * h, max_relative = 1e-3);
    }
}

/// Under a held voltage the comb is a spring: ½θ̇² + ½ω_n²θ² + K_d·V²·∫s dθ stays, with the integral that the
/// capacitance is made of.
#[test]
fn the_torque_is_the_slope_of_the_combs_energy() {
    for curve in [LOGISTIC, GAUSSIAN] {
        let resonator = MirrorResonator { damping_ratio: 0.0, ..MIRROR };
        let driven = CombDrivenMirror { resonator, comb: curve, drive_gain: 30.0 };
        let process = Rk4::new(driven, 2e-6, &NoiseDensity::none(), (&[0.0; 2], &0.0));
        let unit = CombCurve { gain: 1.0, ..curve };
        let energy = |x: [f64; 2]| {
            let comb = -30.0 * 3600.0 * unit.capacitance_change(x[0], 1.0);
            0.5 * x[1].powi(2) + 0.5 * (resonator.natural_rate * x[0]).powi(2) + comb
        };
        let mut x = [0.1, 30.0];
        let start = energy(x);
        for _ in 0..20_000 {
            x = process.step(&x, &Nodes::held(60.0));
            assert_relative_eq!(energy(x), start, max_relative = 1e-8);
        }
    }
}

/// The natural frequency as a state: the step's derivative by it against differences of the closed form.
#[test]
fn the_natural_frequency_can_be_a_state() {
    let constant = Drift::RandomWalk { density: 0.0 };
    let added = [AddedState { scale: 0.01 * MIRROR.natural_rate, drift: constant }];
    let driven = CombDrivenMirror { resonator: MIRROR, comb: LOGISTIC, drive_gain: 0.0 };
    let step = Rk4::new(driven, 1e-4, &NoiseDensity::none(), (&[0.0; 2], &0.0));
    let process = Augmented::<_, _, 2, 1, 3>::new(step, &added, [Some("resonator.natural_rate")]).unwrap();
    let (moved, f) = process.linearize(&[0.1, 50.0, 0.5], &Nodes::held(0.0));
    let exact = |state: f64| {
        let natural_rate = MIRROR.natural_rate * (1.0 + 0.01 * state);
        MirrorResonator { natural_rate, ..MIRROR }.exact(1e-4, 0.0).step(&[0.1, 50.0], &[0.0])
    };
    for i in 0..2 {
        let size = [0.1, 400.0][i];
        assert_relative_eq!(moved[i], exact(0.5)[i], epsilon = 2e-4 * size);
        let difference = (exact(0.501)[i] - exact(0.499)[i]) / 0.002;
        assert_relative_eq!(f[(i, 2)], difference, epsilon = 1e-4 * size);
    }
}

//! Each law against its derivative by dual numbers, by finite differences, and against closed forms.

use approx::assert_relative_eq;
use kalmems_core::{
    Covariance, Dual, Dynamics, Euler, Mat, Measurement, Nodes, NoiseDensity, Process, Rk4, Scaled, Scales,
    jacobian,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{Duffing, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use proptest::prelude::*;

const RESONATOR: TorsionalResonator<f64> =
    TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const SCANNER: ParametricScanner<f64> =
    ParametricScanner { resonator: RESONATOR, comb: COMB, carrier_mean_square: 18.0 };
/// About the circuit of the Silverbox benchmark, in V.
const DUFFING: Duffing<f64> = Duffing { damping: 41.9, stiffness: 1.8426e5, cubic: 7.278e5, gain: 1.86e5 };
const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };

proptest! {
    #[test]
    fn capacitance_and_its_derivatives(angle in -0.6..0.6_f64) {
        let dual = Dual::<f64, 1>::variable(angle, 0);
        let h = 1e-5;
        let third = |f: &dyn Fn(f64) -> f64| (f(angle + h) - f(angle - h)) / (2.0 * h);
        let scale = COMB.nominal / COMB.angular_width;
        let slope = COMB.slope(angle);
        prop_assert!((COMB.capacitance(dual).gradient()[0] - slope).abs() <= 1e-14 * scale);
        prop_assert!((third(&|x| COMB.capacitance(x)) - slope).abs() <= 1e-7 * scale);
        let curvature = COMB.curvature(angle);
        let scale = scale / COMB.angular_width;
        prop_assert!((COMB.slope(dual).gradient()[0] - curvature).abs() <= 1e-14 * scale);
        prop_assert!((third(&|x| COMB.slope(x)) - curvature).abs() <= 1e-7 * scale);
    }

    #[test]
    fn the_readout_jacobian_by_hand_is_the_dual_one(angle in -0.6..0.6_f64, rate in -2e4..2e4_f64) {
        let x = [angle, rate];
        let (y, by_hand) = READOUT.linearize(&x);
        let (z, by_dual): ([f64; 1], Mat<f64, 1, 2>) = jacobian(&x, |x| READOUT.predict(x));
        prop_assert_eq!(y, z);
        prop_assert!((by_hand[(0, 0)] - by_dual[(0, 0)]).abs() <= 1e-13 * by_dual[(0, 0)].abs().max(1.0));
        prop_assert_eq!(by_hand[(0, 1)], 0.0);
    }

    #[test]
    fn a_step_of_the_scanner_and_its_jacobian(
        angle in -0.3..0.3_f64, rate in -2e4..2e4_f64, voltage in 0.0..180.0_f64,
    ) {
        let process = Rk4::new(SCANNER, 1e-6, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
        let drive = Nodes { start: voltage, middle: voltage * 0.99, end: voltage * 0.97 };
        let x = [angle, rate];
        let (there, f) = process.linearize(&x, &drive);
        // Steps of each state that leave the differences well above rounding.
        let steps = [1e-5, 1.0];
        for j in 0..2 {
            let (mut up, mut down) = (x, x);
            up[j] += steps[j];
            down[j] -= steps[j];
            let (up, down) = (process.step(&up, &drive), process.step(&down, &drive));
            for i in 0..2 {
                let difference = (up[i] - down[i]) / (2.0 * steps[j]);
                let scale = [1.0, 1e5][i] / [1.0, 1e5][j];
                prop_assert!((difference - f[(i, j)]).abs() <= 1e-7 * scale, "{} {}: {} {}", i, j, difference, f[(i, j)]);
            }
        }
        // θ → −θ is an exact symmetry.
        prop_assert_eq!(process.step(&[-angle, -rate], &drive), there.map(|x| -x));
    }
}

/// The free oscillation's amplitude after `duration`, against what the damping leaves of it.
fn growth_rate(step: impl Fn(&[f64; 2]) -> [f64; 2], interval: f64, steps: u32) -> f64 {
    let mut x = [0.15, 0.0];
    let start = RESONATOR.energy(x[0], x[1]);
    for _ in 0..steps {
        x = step(&x);
    }
    (RESONATOR.energy(x[0], x[1]) / start).ln() / 2.0 / (interval * f64::from(steps))
}

/// Amplitudes grow or decay as e^{rate·t}; what the damping says is −b/2J.
#[test]
fn explicit_euler_gains_the_energy_that_exact_methods_keep() {
    let truth = -RESONATOR.damping / (2.0 * RESONATOR.inertia);
    let free = ParametricScanner { comb: GaussianComb { nominal: 0.0, ..COMB }, ..SCANNER };
    let omega = RESONATOR.natural_rate();
    for (rate_hz, sign) in [(1_000_000, 1.0), (10_000_000, 1.0), (18_500_000, 0.0), (40_000_000, -1.0)] {
        let h = 1.0 / f64::from(rate_hz);
        let steps = rate_hz / 1000;
        let euler = Euler::new(free, h, Covariance::zero());
        let exact = RESONATOR.exact(h, 0.0);
        let rk4 = Rk4::new(free, h, &NoiseDensity::none(), (&[0.0; 2], &0.0));
        let gained = growth_rate(|x| euler.step(x, &0.0), h, steps);
        // ω²·T/2 − b/2J, to first order in T.
        let predicted = omega * omega * h / 2.0 + truth;
        assert!(
            (gained - predicted).abs() < 0.01 * omega * omega * h / 2.0,
            "{rate_hz}: {gained} {predicted}"
        );
        assert!(gained.abs() < 5.0 || gained.signum() == sign, "{rate_hz}: {gained}");
        // The energy of a damped oscillation ripples within a cycle by about ζ; over 1 ms that is 4/s.
        assert_relative_eq!(growth_rate(|x| exact.step(x, &[0.0]), h, steps), truth, epsilon = 5.0);
        assert_relative_eq!(growth_rate(|x| rk4.step(x, &Nodes::held(0.0)), h, steps), truth, epsilon = 5.0);
    }
}

#[test]
fn without_damping_the_exact_step_keeps_energy_to_rounding() {
    let ideal = TorsionalResonator { damping: 0.0, ..RESONATOR };
    let exact = ideal.exact(1e-6, 0.0);
    let mut x = [0.15, 0.0];
    let start = ideal.energy(x[0], x[1]);
    for _ in 0..1_000_000 {
        x = exact.step(&x, &[0.0]);
    }
    assert_relative_eq!(ideal.energy(x[0], x[1]), start, max_relative = 1e-9);
}

#[test]
fn the_scanner_at_rest_stays_and_softens() {
    assert_eq!(SCANNER.derivative(&[0.0, 0.0], &90.0), [0.0, 0.0]);
    // The torque acts as a stiffness C₀/θ₀²·(V² + V_c²/2) for small angles.
    let x = [1e-6, 0.0];
    let stiffness = -SCANNER.derivative(&x, &90.0)[1] / x[0] * RESONATOR.inertia;
    let expected =
        RESONATOR.stiffness + COMB.nominal / COMB.angular_width.powi(2) * (90.0_f64.powi(2) + 18.0);
    assert_relative_eq!(stiffness, expected, max_relative = 1e-9);
}

/// In its natural scales a free swing is a circle.
#[test]
fn the_scanner_in_its_natural_scales() {
    let free = ParametricScanner {
        resonator: TorsionalResonator { damping: 0.0, ..RESONATOR },
        comb: GaussianComb { nominal: 0.0, ..COMB },
        ..SCANNER
    };
    let omega = RESONATOR.natural_rate();
    assert_eq!(free.natural_scales(), [0.2, 0.2 * omega]);
    let scaled = Scaled::new(free, Scales::new(free.natural_scales()).unwrap());
    let [angle, rate] = scaled.derivative(&[0.3, 0.5], &0.0);
    assert_relative_eq!(angle, 0.5 * omega, max_relative = 1e-14);
    assert_relative_eq!(rate, -0.3 * omega, max_relative = 1e-14);
}

/// The drive between two samples matters more to a resonator than the order of the integrator.
#[test]
fn a_held_drive_has_a_larger_error_than_a_large_step() {
    let drive = |t: f64| 90.0 + 90.0 * (std::f64::consts::TAU * 31_350.0 * t).sin();
    let noise = NoiseDensity::none();
    // 2 ms from a settled state; the phase of the motion as the angle of the scaled state.
    let run = |steps_per_us: u32, nodes: &dyn Fn(f64, f64) -> Nodes<f64>| {
        let h = 1e-6 / f64::from(steps_per_us);
        let process = Rk4::new(SCANNER, h, &noise, (&[0.0, 0.0], &0.0));
        let mut x = [0.15, 0.0];
        for k in 0..2000 * steps_per_us {
            x = process.step(&x, &nodes(f64::from(k) * h, h));
        }
        (x[0] * RESONATOR.natural_rate()).atan2(x[1]).to_degrees()
    };
    let known = |t: f64, h: f64| Nodes { start: drive(t), middle: drive(t + h / 2.0), end: drive(t + h) };
    let cubic = |t: f64, h: f64| {
        let [a, b, c, d] = [-1.0, 0.0, 1.0, 2.0].map(|k| drive(t + k * h));
        Nodes { start: b, middle: (9.0 * (b + c) - a - d) / 16.0, end: c }
    };
    let held = |t: f64, _: f64| Nodes::held(drive(t));
    let truth = run(100, &known);
    let error = |nodes: &dyn Fn(f64, f64) -> Nodes<f64>| {
        let difference = run(1, nodes) - truth;
        (difference - 360.0 * (difference / 360.0).round()).abs()
    };
    let (known, cubic, held) = (error(&known), error(&cubic), error(&held));
    assert!(known < 0.01, "RK4 at 1 MHz: {known}°");
    assert!(cubic < 0.01, "with a cubic between the samples: {cubic}°");
    assert!((1.5..2.5).contains(&held), "held: {held}°, where the docs say about 2°");
}

/// The Jacobian of Duffing's equation by hand: ∂ẍ/∂x = −(ω₀² + 3·a₃·x²), ∂ẍ/∂ẋ = −d.
#[test]
fn the_duffing_jacobian_is_the_one_by_hand() {
    for (x, v) in [(0.0, 0.0), (0.3, 40.0), (-0.25, 12.0)] {
        let a = DUFFING.jacobian(&[x, v], &0.1);
        assert_relative_eq!(a[(1, 0)], -(1.8426e5 + 3.0 * 7.278e5 * x * x), max_relative = 1e-14);
        assert_eq!((a[(0, 0)], a[(0, 1)], a[(1, 1)]), (0.0, 1.0, -41.9));
        // x → −x together with u → −u is an exact symmetry.
        let mirrored = DUFFING.derivative(&[-x, -v], &-0.1);
        assert_eq!(mirrored, DUFFING.derivative(&[x, v], &0.1).map(|d| -d));
    }
}

/// The rate of a free, undamped oscillation from rest at this amplitude, and the largest relative change of its
/// energy, over 20 half cycles of about 500 steps; no rate where it does not swing.
fn free_duffing(spring: &Duffing<f64>, amplitude: f64) -> (f64, f64) {
    let h = 1e-3 * std::f64::consts::TAU / spring.stiffness.sqrt();
    let process = Rk4::new(*spring, h, &NoiseDensity::none(), (&[0.0; 2], &0.0));
    let mut x = [amplitude, 0.0];
    let energy = spring.energy(amplitude, 0.0);
    let (mut turns, mut change) = (0, 0.0_f64);
    for step in 0..40_000 {
        let next = process.step(&x, &Nodes::held(0.0));
        change = change.max((spring.energy(next[0], next[1]) / energy - 1.0).abs());
        // The velocity leaves zero at the start and passes through it twice per cycle.
        if step > 0 && (x[1] > 0.0) != (next[1] > 0.0) {
            turns += 1;
            if turns == 20 {
                let duration = (f64::from(step) + x[1] / (x[1] - next[1])) * h;
                return (f64::from(turns) * std::f64::consts::PI / duration, change);
            }
        }
        x = next;
    }
    (f64::NAN, change)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    /// The exact rate is the arithmetic–geometric mean of √(ω₀² + a₃·A²) and √(ω₀² + ½·a₃·A²), from the period as a
    /// complete elliptic integral; ω₀² + ¾·a₃·A² is its square to first order in a₃·A²/ω₀².
    #[test]
    fn the_free_duffing_oscillator_keeps_its_energy_and_follows_its_backbone(
        bend in -0.6..2.0_f64, amplitude in 0.05..0.5_f64,
    ) {
        let cubic = bend * DUFFING.stiffness / amplitude.powi(2);
        let spring = Duffing { damping: 0.0, cubic, ..DUFFING };
        let (rate, change) = free_duffing(&spring, amplitude);
        let (mut a, mut g) = ((1.0 + bend).sqrt(), (1.0 + bend / 2.0).sqrt());
        for _ in 0..6 {
            (a, g) = (a.midpoint(g), (a * g).sqrt());
        }
        let omega = DUFFING.stiffness.sqrt();
        // RK4 loses (ω·h)⁶/72 of the energy per step at worst, with ω·h up to 0.011 here.
        prop_assert!(change < 1e-9, "{change}");
        prop_assert!((rate / (a * omega) - 1.0).abs() < 1e-6, "{rate} {}", a * omega);
        // The two differ by 3/256 of the square of `bend` to leading order, by three times that at −0.6.
        let first_order = (1.0 + 0.75 * bend).sqrt() * omega;
        prop_assert!((rate / first_order - 1.0).abs() < 0.05 * bend.powi(2) + 1e-6, "{rate} {first_order}");
    }
}

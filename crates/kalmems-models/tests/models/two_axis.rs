//! Two axes on one electrode: against each axis alone, against derivatives by differences, and energy.

use kalmems_core::{
    Dynamics, Mat, Measurement, Nodes, NoiseDensity, ParametricDynamics, Process, Rk4, jacobian,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator, TwoAxisScanner};
use kalmems_models::readout::{DemodulatedComb, TwoAxisComb};
use proptest::prelude::*;

/// Chen et al., shared electrodes, 2020, Table II.
const X: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
    carrier_mean_square: 18.0,
};
/// An assumed gimbal of 6.5 kHz.
const Y: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 6.0e-14, damping: 1.3e-11, stiffness: 1.0e-4 },
    comb: GaussianComb { nominal: 4.0e-12, angular_width: 0.15, bias: 5.0e-12 },
    carrier_mean_square: 18.0,
};
const APART: TwoAxisScanner<f64> = TwoAxisScanner { x: X, y: Y, gimbal_inertia: 0.0 };
/// A thin flat mirror: ΔJ = J_x.
const GIMBAL: TwoAxisScanner<f64> = TwoAxisScanner { gimbal_inertia: 1.15e-14, ..APART };
const READOUT: TwoAxisComb<f64> = TwoAxisComb { x: X.comb, y: Y.comb, gain: -0.3574e12, offset: 6.3945 };

fn rk4<D: Dynamics<f64, N, Input = f64>, const N: usize>(dynamics: D) -> Rk4<D, f64, N> {
    Rk4::new(dynamics, 1e-6, &NoiseDensity::none(), (&[0.0; N], &0.0))
}

proptest! {
    #[test]
    fn a_step_and_its_jacobian(
        angles in [-0.3..0.3_f64, -0.2..0.2_f64], rates in [-2e4..2e4_f64, -9e3..9e3_f64], voltage in 0.0..240.0_f64,
    ) {
        let process = rk4(GIMBAL);
        let drive = Nodes { start: voltage, middle: voltage * 0.99, end: voltage * 0.97 };
        let x = [angles[0], rates[0], angles[1], rates[1]];
        let (there, f) = process.linearize(&x, &drive);
        let sizes = [1.0, 1e5, 1.0, 4e4];
        for j in 0..4 {
            let (mut up, mut down) = (x, x);
            up[j] += 1e-5 * sizes[j];
            down[j] -= 1e-5 * sizes[j];
            let (up, down) = (process.step(&up, &drive), process.step(&down, &drive));
            for i in 0..4 {
                let difference = (up[i] - down[i]) / (2e-5 * sizes[j]);
                prop_assert!((difference - f[(i, j)]).abs() <= 1e-7 * sizes[i] / sizes[j], "{} {}", i, j);
            }
        }
        // Either axis may be mirrored by itself.
        for signs in [[-1.0, -1.0, 1.0, 1.0], [1.0, 1.0, -1.0, -1.0]] {
            let mirrored: [f64; 4] = std::array::from_fn(|i| signs[i] * x[i]);
            let expected: [f64; 4] = std::array::from_fn(|i| signs[i] * there[i]);
            prop_assert_eq!(process.step(&mirrored, &drive), expected);
            prop_assert_eq!(READOUT.predict(&mirrored), READOUT.predict(&x));
        }
    }

    /// Without the gimbal's inertia the two axes are two scanners, to the last bit.
    #[test]
    fn without_inertia_in_between_each_axis_is_a_scanner_alone(
        angles in [-0.3..0.3_f64, -0.2..0.2_f64], rates in [-2e4..2e4_f64, -9e3..9e3_f64], voltage in 0.0..240.0_f64,
    ) {
        let drive = Nodes { start: voltage, middle: voltage * 0.99, end: voltage * 0.97 };
        let both = rk4(APART).step(&[angles[0], rates[0], angles[1], rates[1]], &drive);
        let x = rk4(X).step(&[angles[0], rates[0]], &drive);
        let y = rk4(Y).step(&[angles[1], rates[1]], &drive);
        prop_assert_eq!(both, [x[0], x[1], y[0], y[1]]);
    }

    #[test]
    fn the_readout_and_its_jacobian(angles in [-0.3..0.3_f64, -0.2..0.2_f64]) {
        let x = [angles[0], 3.0, angles[1], -4.0];
        let (y, by_hand) = READOUT.linearize(&x);
        let (z, by_dual): ([f64; 1], Mat<f64, 1, 4>) = jacobian(&x, |x| READOUT.predict(x));
        prop_assert_eq!(y, z);
        for j in 0..4 {
            prop_assert!((by_hand[(0, j)] - by_dual[(0, j)]).abs() <= 1e-13 * by_dual[(0, j)].abs().max(1.0));
            let (mut up, mut down) = (x, x);
            up[j] += 1e-6;
            down[j] -= 1e-6;
            let [up] = READOUT.predict(&up);
            let [down] = READOUT.predict(&down);
            prop_assert!(((up - down) / 2e-6 - by_hand[(0, j)]).abs() < 1e-7);
        }
        // With the second axis at rest it is the readout of one comb whose bias holds the other's capacitance.
        let bias = X.comb.bias + Y.comb.capacitance(0.0);
        let alone = DemodulatedComb { comb: GaussianComb { bias, ..X.comb }, gain: READOUT.gain, offset: READOUT.offset };
        let [one] = alone.predict(&[angles[0], 3.0]);
        let [two] = READOUT.predict(&[angles[0], 3.0, 0.0, 0.0]);
        prop_assert!((one - two).abs() < 1e-13);
    }
}

/// Without damping, drive and carrier the energy of the gimbal stays, and goes from one axis to the other.
#[test]
fn a_free_gimbal_keeps_its_energy() {
    let free = |axis: ParametricScanner<f64>| ParametricScanner {
        resonator: TorsionalResonator { damping: 0.0, ..axis.resonator },
        carrier_mean_square: 0.0,
        ..axis
    };
    let gimbal = TwoAxisScanner { x: free(X), y: free(Y), gimbal_inertia: 1.15e-14 };
    let process = Rk4::new(gimbal, 5e-8, &NoiseDensity::none(), (&[0.0; 4], &0.0));
    let mut state = [0.15, 0.0, 0.1, 2000.0];
    let start = gimbal.energy(&state);
    let of_x = |state: &[f64; 4]| gimbal.x.resonator.energy(state[0], state[1]);
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for _ in 0..100_000 {
        state = process.step(&state, &Nodes::held(0.0));
        least = least.min(of_x(&state));
        most = most.max(of_x(&state));
    }
    let kept = gimbal.energy(&state) / start;
    println!("energy kept to {:e}; that of x alone varies by {:.1e}", kept - 1.0, most / least - 1.0);
    assert!((kept - 1.0).abs() < 1e-9, "{kept}");
    assert!(most / least > 1.0 + 1e-4, "the axes do exchange energy: {most} {least}");
}

/// The derivative by a parameter is that of the law with the parameter changed.
#[test]
fn its_parameters_may_be_states() {
    use kalmems_core::{Dual, Parameters};
    let x = [0.12, 3000.0, 0.07, -2500.0];
    let index = TwoAxisScanner::<f64>::index_of("gimbal_inertia").unwrap();
    let varied = GIMBAL
        .map(|i, value| if i == index { Dual::<f64, 1>::variable(value, 0) } else { Dual::constant(value) });
    let by_dual = TwoAxisScanner::derivative_of(&varied, &x.map(Dual::constant), &100.0);
    let at = |inertia: f64| TwoAxisScanner { gimbal_inertia: inertia, ..GIMBAL }.derivative(&x, &100.0);
    let (up, down) = (at(1.25e-14), at(1.05e-14));
    for axis in [1, 3] {
        let difference = (up[axis] - down[axis]) / 2e-15;
        let ours = by_dual[axis].gradient()[0];
        assert!((difference / ours - 1.0).abs() < 1e-3, "{axis}: {difference} {ours}");
    }
}

//! The accelerometer's laws against published figures, closed forms and other methods.

use kalmems_core::riccati::continuous_lyapunov;
use kalmems_core::{
    Dynamics, HeldEtdrk4, Mat, Measurement, Nodes, NoiseDensity, Observability, Process, Rk4, jacobian,
};
use kalmems_models::capacitance::{DifferentialPlates, FixedPlate};
use kalmems_models::constants::{STANDARD_GRAVITY, VACUUM_PERMITTIVITY};
use kalmems_models::dynamics::{Accelerometer, GaussMarkov, ProofMass, SensedAcceleration};
use kalmems_models::noise::{Mosfet, brownian_force_density};
use kalmems_models::readout::{ChargeAmplifier, DifferentialReadout};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Zhang 2010, Table I.
const MASS: ProofMass<f64> = ProofMass { mass: 3.8e-9, damping: 7e-4, squeezed: 0.0, spring: 3.0 };

fn plates(relative_permittivity: f64) -> DifferentialPlates<f64> {
    DifferentialPlates {
        area: 1200e-6 * 1550e-6,
        gap: 2.3e-6,
        permittivity: relative_permittivity * VACUUM_PERMITTIVITY,
    }
}

/// Relative alone: many numbers here are smaller than what other comparisons take for nothing.
#[track_caller]
fn assert_close(ours: f64, theirs: f64, tolerance: f64) {
    assert!((ours / theirs - 1.0).abs() <= tolerance, "{ours} {theirs}");
}

/// Under a sine of 0.6 V, without a bias.
fn device(relative_permittivity: f64) -> Accelerometer<f64> {
    Accelerometer { mass: MASS, plates: plates(relative_permittivity), carrier_mean_square: 0.18, bias: 0.0 }
}

fn readout(relative_permittivity: f64) -> DifferentialReadout<f64> {
    DifferentialReadout {
        plates: plates(relative_permittivity),
        carrier_amplitude: 0.6,
        feedback_capacitance: 20e-12,
    }
}

/// Zhang 2010, equations 5-4 and 5-5. The damping ratio is 3.28: over-damped, whatever the text says.
#[test]
fn the_mass_alone_has_the_published_eigenvalues_and_is_observable() {
    let [(slow, no), (fast, swing)] = MASS.eigenvalues(MASS.spring);
    assert!((slow + 4390.4).abs() < 0.05 && (fast + 179_820.0).abs() < 5.0, "{slow} {fast}");
    assert_eq!((no, swing), (0.0, 0.0));
    assert_close(MASS.damping_ratio(MASS.spring), 3.28, 1e-3);
    // A pair that swings, against its polynomial.
    let light = ProofMass { damping: 1e-5, ..MASS };
    let [(re, im), _] = light.eigenvalues(MASS.spring);
    assert_close(2.0 * re, -1e-5 / 3.8e-9, 1e-12);
    assert_close(re * re + im * im, 3.0 / 3.8e-9, 1e-12);
    // The transition over 10 µs has e^λh as its eigenvalues: their sum and product.
    let linear = Accelerometer { carrier_mean_square: 0.0, ..device(4.0) };
    let h = 1e-5;
    let step = HeldEtdrk4::new(linear, h, &NoiseDensity::none(), (&[0.0; 2], &[0.0; 2]));
    let (_, f) = step.linearize(&[0.0; 2], &[0.0; 2]);
    assert_close(f[(0, 0)] + f[(1, 1)], (slow * h).exp() + (fast * h).exp(), 1e-9);
    assert_close(f[(0, 0)] * f[(1, 1)] - f[(0, 1)] * f[(1, 0)], ((slow + fast) * h).exp(), 1e-9);

    let h: Mat<f64, 1, 2> = readout(4.0).linearize(&[0.0, 0.0]).1;
    let mut seen = Observability::new([1e-10, 1e-6]);
    for _ in 0..2 {
        seen.observe(&h, &kalmems_core::Covariance::from_variances([1e-9]));
        seen.advance(&f);
    }
    assert_eq!(seen.rank(1e-12), 2);
}

#[test]
fn springs_gains_biases_and_the_brownian_floor_are_those_of_the_table() {
    for (permittivity, spring, sensitivity, bias) in
        [(4.0, 1.949, 7.47e5, 0.173), (1.0, 0.487, 1.87e5, 0.346)]
    {
        let device = device(permittivity);
        assert_close(device.electrostatic_spring(0.0), spring, 1e-3);
        assert_close(readout(permittivity).sensitivity(), sensitivity, 2e-3);
        let bias_found = device.bias_for(10.0 * STANDARD_GRAVITY);
        assert_close(bias_found, bias, 2e-3);
        // With that bias v_F = V_B/2 holds 10 g at rest, and k_el is that of 2-16 with the halves where they belong.
        let held = Accelerometer { bias: bias_found, ..device };
        let feedback = bias_found / 2.0;
        let force = held.electrostatic_force(0.0, feedback);
        assert_close(force, -MASS.mass * 10.0 * STANDARD_GRAVITY, 1e-12);
        assert_close(force, -held.feedback_gain() * feedback, 1e-12);
        let bracket = 0.6 * 0.6 / 2.0 + bias_found.powi(2) + feedback.powi(2);
        let plates = held.plates;
        assert_close(
            held.electrostatic_spring(feedback),
            2.0 * plates.permittivity * plates.area * bracket / plates.gap.powi(3),
            1e-12,
        );
    }
    let floor = brownian_force_density(MASS.damping, 300.0).sqrt() / MASS.mass / STANDARD_GRAVITY;
    assert_close(floor, 91.4e-6, 1e-3);
    // Open loop: 698 Hz without the softening, 241 Hz with it.
    let corner = |spring| -MASS.eigenvalues(spring)[0].0 / TAU;
    assert_close(corner(3.0), 698.0, 2e-3);
    assert_close(corner(device(4.0).softened_spring(0.0)), 241.0, 5e-3);
}

/// At 12 g with ε_r = 4 and at 68 g with 1, where the thesis says 5 g; and the net force is at its largest there.
#[test]
fn the_plates_pull_in_where_no_acceleration_is_held_any_more() {
    for (permittivity, pulled_in_at) in [(4.0, 12.0), (1.0, 68.0)] {
        let device = device(permittivity);
        let found = device.static_pull_in(0.0).unwrap();
        assert_close(found.acceleration / STANDARD_GRAVITY, pulled_in_at, 0.02);
        let net = |x: f64| MASS.spring * x - device.electrostatic_force(x, 0.0);
        let most = net(found.displacement);
        for step in [1e-9, 1e-8, 1e-7] {
            assert!(net(found.displacement - step) < most && net(found.displacement + step) < most);
        }
    }
    // A bias and a feedback pull to one side: the first plate is nearer when the feedback pushes towards it.
    let biased = Accelerometer { bias: 0.1, ..device(4.0) };
    let [at, towards, away] = [0.0, -0.05, 0.05].map(|v| biased.static_pull_in(v).unwrap().acceleration);
    assert!(towards < at && at < away, "{towards} {at} {away}");
    // Of a spring that the carrier alone takes.
    assert_eq!(Accelerometer { carrier_mean_square: 0.3, ..device(4.0) }.static_pull_in(0.0), None);
}

/// Integrated: just below the static pull-in the mass finds its rest, just above it is on the plate.
#[test]
fn a_mass_beyond_the_pull_in_ends_on_the_plate() {
    let device = device(4.0);
    let held = device.static_pull_in(0.0).unwrap();
    let end = |share: f64| {
        let process = Rk4::new(device, 2e-6, &NoiseDensity::none(), (&[0.0; 2], &[0.0; 2]));
        let mut x = [0.0, 0.0];
        // Slowly, so that nothing overshoots, then long enough to leave even where the net force is small.
        for k in 0..400_000 {
            let ramp = f64::min(1.0, f64::from(k) / 100_000.0);
            x = process.step(&x, &Nodes::held([share * ramp * held.acceleration, 0.0]));
            if let Some(plate) = device.plates.touched(x[0], 0.9) {
                return Err(plate);
            }
        }
        Ok(x)
    };
    let [x, v] = end(0.99).unwrap();
    assert!(x < held.displacement && v.abs() < 1e-12, "{x} {v}");
    assert_eq!(end(1.01), Err(FixedPlate::First));
    assert_eq!(end(-1.01), Err(FixedPlate::Second));
}

proptest! {
    /// The force is half the slope of the capacitances times V², by dual numbers; and so is the slope of the force.
    #[test]
    fn force_and_capacitance_are_of_one_energy(share in -0.7..0.7_f64, v1 in 0.1..1.0_f64, v2 in 0.1..1.0_f64) {
        let plates = plates(4.0);
        let x = share * plates.gap;
        let squares = [v1 * v1, v2 * v2];
        let (_, slopes): (_, Mat<f64, 2, 1>) = jacobian(&[x], |[x]| plates.capacitances(*x));
        let energy = 0.5 * (slopes[(0, 0)] * squares[0] + slopes[(1, 0)] * squares[1]);
        let scale = plates.force(0.9 * plates.gap, squares).abs();
        prop_assert!((plates.force(x, squares) - energy).abs() < 1e-13 * scale);
        let (_, slope): (_, Mat<f64, 1, 1>) = jacobian(&[x], |[x]| [plates.force(*x, squares)]);
        prop_assert!((plates.force_slope(x, squares) / slope[(0, 0)] - 1.0).abs() < 1e-12);
        let [first, second] = plates.capacitances(x);
        prop_assert!((plates.difference(x) - (first - second)).abs() < 1e-13 * (first + second));
        // What is read: S·x/(1 − (x/d₀)²).
        let read = readout(4.0);
        let y = read.voltage(x);
        prop_assert!((y - read.sensitivity() * x / (1.0 - share * share)).abs() < 1e-12 * y.abs());
        let by_hand: ([f64; 1], Mat<f64, 1, 2>) = read.linearize(&[x, 3.0]);
        let by_dual: ([f64; 1], Mat<f64, 1, 2>) = jacobian(&[x, 3.0], |x| read.predict(x));
        prop_assert_eq!(by_hand.0, by_dual.0);
        prop_assert!((by_hand.1[(0, 0)] / by_dual.1[(0, 0)] - 1.0).abs() < 1e-12);
    }
}

/// The carrier in full, averaged over its period by the trapezoidal rule, is what the averaged law has.
#[test]
fn the_averaged_force_is_the_average_of_the_force_under_the_carrier() {
    let device = Accelerometer { bias: 0.1, ..device(4.0) };
    let (x, feedback) = (4e-7, 0.03);
    let mean = (0..64)
        .map(|k| {
            let carrier = 0.6 * (TAU * f64::from(k) / 64.0).sin();
            let [v1, v2] = [carrier - 0.1 + feedback, -carrier + 0.1 + feedback];
            device.plates.force(x, [v1 * v1, v2 * v2]) / 64.0
        })
        .sum::<f64>();
    assert_close(device.electrostatic_force(x, feedback), mean, 1e-12);
}

/// Both laws: linear, and the film, which is even, grows by 6·(x/d₀)² at first, and does not vanish at rest.
#[test]
fn the_film_damps_more_near_a_plate() {
    let film = ProofMass { squeezed: 1.0, ..MASS };
    for share in [0.0, 0.01, 0.3, -0.3] {
        assert_eq!(MASS.damping_at(share), MASS.damping);
    }
    assert_eq!(film.damping_at(0.0), MASS.damping);
    assert_close(film.damping_at(0.01) / MASS.damping - 1.0, 6e-4, 1e-3);
    assert_close(film.damping_at(0.3), film.damping_at(-0.3), 1e-14);
    assert_close(film.damping_at(0.5) / MASS.damping, 4.0 + 0.5 / 3.375, 1e-14);
    let half = ProofMass { squeezed: 0.5, ..MASS };
    assert_close(half.damping_at(0.5), 0.5 * (MASS.damping + film.damping_at(0.5)), 1e-14);
}

/// Equation 2-5 as printed, in complex arithmetic, against the factors; and each approximation in its limit.
#[test]
fn the_charge_amplifier_is_the_printed_circuit() {
    let amplifier = ChargeAmplifier {
        leak_resistance: 1e6,
        feedback_resistance: 1e5,
        coupling_capacitance: 500e-12,
        feedback_capacitance: 20e-12,
    };
    let (rate, x) = (TAU * 1e6, 3e-8);
    let [c1, c2] = plates(4.0).capacitances(x);
    let multiply = |(a, b): (f64, f64), (c, d): (f64, f64)| (a * c - b * d, a * d + b * c);
    let divide = |n: (f64, f64), (c, d): (f64, f64)| {
        let (re, im) = multiply(n, (c, -d));
        (re / (c * c + d * d), im / (c * c + d * d))
    };
    let first = divide((0.0, -rate * 500e-12 * 1e5), (1.0, rate * 20e-12 * 1e5));
    let second = divide((0.0, rate * (c1 - c2)), (1e-6, rate * (c1 + c2 + 500e-12)));
    let printed = multiply(first, second);
    let ours = amplifier.response(rate, c1 + c2);
    assert_close(ours.0 * (c1 - c2), printed.0, 1e-12);
    assert_close(ours.1 * (c1 - c2), printed.1, 1e-12);

    // Each factor differs from 1 by what its approximation leaves out.
    let (re, im) = amplifier.feedback_factor(rate);
    assert_close(im / re, 1.0 / (rate * 20e-12 * 1e5), 1e-12);
    assert_close(1.0 / amplifier.coupling_factor(c1 + c2) - 1.0, (c1 + c2) / 500e-12, 1e-9);
    let perfect = ChargeAmplifier {
        leak_resistance: 1e15,
        feedback_resistance: 1e15,
        coupling_capacitance: 1.0,
        feedback_capacitance: 20e-12,
    };
    let (re, im) = perfect.response(rate, c1 + c2);
    assert_close(re, perfect.ideal(), 1e-9);
    assert!((im / re).abs() < 1e-8);
}

/// By hand for round numbers, and which of the three leads where: flicker, then thermal noise.
#[test]
fn the_transistor_has_the_densities_of_its_equations() {
    let stage = Mosfet {
        thermal_coefficient: 1.0,
        mobility: 0.5,
        oxide_capacitance: 1e-2,
        width: 4.0,
        length: 1.0,
        drain_current: 1.0,
        flicker_coefficient: 8e-4,
        leakage_current: 2.0,
        gate_node_capacitance: 1.0 / TAU,
    };
    assert_close(stage.transconductance(), 0.2, 1e-14);
    assert_close(stage.thermal(100.0), 4.0 * 1.380_649e-23 * 100.0 / 0.2, 1e-14);
    assert_close(stage.flicker(10.0), 0.2, 1e-14);
    assert_close(stage.leakage(10.0), 4.0 * 1.602_176_634e-19 / 100.0, 1e-14);
    // Equation 3-8 is 3-5 over g_m².
    let current = stage.flicker_coefficient * stage.drain_current
        / (stage.oxide_capacitance * stage.length.powi(2) * 10.0);
    assert_close(stage.flicker(10.0), current / stage.transconductance().powi(2), 1e-14);
    let assumed = Mosfet::ASSUMED;
    assert!(assumed.flicker(1e3) > assumed.thermal(300.0) && assumed.flicker(1e7) < assumed.thermal(300.0));
}

/// Its variance by Lyapunov's equation, and by its spectrum summed over frequency.
#[test]
fn the_acceleration_has_the_stated_size_and_bandwidth() {
    for damping_ratio in [0.2, 0.7, 2.0] {
        let prior = GaussMarkov { rms: 9.8, rate: 314.0, damping_ratio };
        let a = Mat([[0.0, 1.0], [-314.0 * 314.0, -2.0 * damping_ratio * 314.0]]);
        let p = continuous_lyapunov(&a, &NoiseDensity::none().on::<1>(prior.density())).unwrap();
        assert_close(p.standard_deviation(0), 9.8, 1e-10);
        assert_close(p.standard_deviation(1), 9.8 * 314.0, 1e-10);
        let width = 0.1;
        let total: f64 =
            (0..1_000_000).map(|k| prior.spectrum(TAU * (f64::from(k) + 0.5) * width) * width).sum();
        assert_close(total, 9.8 * 9.8, 1e-6);
    }
}

/// The acceleration moves the mass as a known one does, the feedback too, and the noise comes in where it should.
#[test]
fn a_sensed_acceleration_is_the_known_one_as_a_state() {
    let device = Accelerometer { bias: 0.17, ..device(4.0) };
    let prior = GaussMarkov { rms: STANDARD_GRAVITY, rate: 314.0, damping_ratio: 0.7 };
    let sensed = SensedAcceleration { device, prior };
    let [velocity, pushed, slope, _] = sensed.derivative(&[2e-8, 1e-4, 3.0, 7.0], &0.02);
    assert_eq!([velocity, pushed], device.derivative(&[2e-8, 1e-4], &[3.0, 0.02]));
    assert_eq!(slope, 7.0);
    let force = brownian_force_density(MASS.damping, 300.0) / 2.0;
    let noise = sensed.noise(force);
    assert_close(noise.get(1, 1), 2.0 * 1.380_649e-23 * 300.0 * 7e-4 / 3.8e-9 / 3.8e-9, 1e-12);
    assert_eq!((noise.get(0, 0), noise.get(2, 2), noise.get(3, 3)), (0.0, 0.0, prior.density()));
}

//! The piston mirror's laws against complex arithmetic, closed forms and the paper's numbers.

mod estimators;
mod motion;

use kalmems_core::{Mat, Measurement, NoiseDensity, Process, jacobian};
use kalmems_models::capacitance::DistanceSeries;
use kalmems_models::dynamics::{DriftingPhasor, SteadyPhasor};
use kalmems_models::readout::{CarrierDivider, DriftingPhasorCapacitance, SteadyPhasorCapacitance};
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// Faller and Zangl, 2017: 50 Ω, 100 pF, 20 MHz, 1 V.
const PAPER: CarrierDivider<f64> = CarrierDivider {
    excitation: 1.0,
    carrier_rate: TAU * 20e6,
    shunt_conductance: 1.0 / 50.0,
    parallel_capacitance: 100e-12,
    input_conductance: 0.0,
    blocking_capacitance: 1e-9,
};
/// The same into an input of 50 Ω through a capacitor that is felt.
const LOADED: CarrierDivider<f64> =
    CarrierDivider { input_conductance: 1.0 / 50.0, blocking_capacitance: 300e-12, ..PAPER };
const BASE: f64 = 109.3e-15;
const PLATE: DistanceSeries<f64, 2> = DistanceSeries { reference_distance: 1e-3, coefficients: [0.0, BASE] };
const FRINGING: DistanceSeries<f64, 4> =
    DistanceSeries { reference_distance: 1e-3, coefficients: [4e-15, 95e-15, 12e-15, -1.5e-15] };

/// A complex number, for the circuit's own equations.
#[derive(Clone, Copy)]
struct Complex(f64, f64);

impl Complex {
    fn plus(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
    fn inverse(self) -> Self {
        let square = self.0 * self.0 + self.1 * self.1;
        Self(self.0 / square, -self.1 / square)
    }
    fn size(self) -> f64 {
        self.0.hypot(self.1)
    }
}

/// The voltage at the amplifier by Kirchhoff's laws: impedances in series and in parallel.
fn by_impedances(divider: &CarrierDivider<f64>, capacitance: f64) -> f64 {
    let capacitor = |c: f64| Complex(0.0, -1.0 / (divider.carrier_rate * c));
    let mut admittance =
        Complex(divider.shunt_conductance, divider.carrier_rate * divider.parallel_capacitance);
    let mut passed = 1.0;
    if divider.input_conductance > 0.0 {
        let input = 1.0 / divider.input_conductance;
        let branch = Complex(input, 0.0).plus(capacitor(divider.blocking_capacitance));
        admittance = admittance.plus(branch.inverse());
        passed = input / branch.size();
    }
    let node = admittance.inverse();
    divider.excitation * node.size() / node.plus(capacitor(capacitance)).size() * passed
}

#[test]
fn the_divider_is_kirchhoffs_and_its_inverse_exact() {
    for divider in [PAPER, LOADED] {
        for femtofarad in [1.0, 72.9, 109.3, 218.6, 1e4, 1e6] {
            let c = femtofarad * 1e-15;
            let volts = divider.voltage(c);
            assert!((volts / by_impedances(&divider, c) - 1.0).abs() < 1e-13, "{femtofarad} fF");
            assert!((divider.capacitance(volts) / c - 1.0).abs() < 1e-12, "{femtofarad} fF");
            let h = 1e-4 * c;
            let difference = (divider.voltage(c + h) - divider.voltage(c - h)) / (2.0 * h);
            assert!((divider.slope(c) / difference - 1.0).abs() < 1e-7, "{femtofarad} fF");
        }
    }
    // Beyond what any capacitance could give.
    assert!(PAPER.capacitance(1.01) < 0.0 || PAPER.capacitance(1.01).is_nan());
}

/// 5.3 GV/F and 0.393 aF/√Hz for 1 V rms, 0.556 aF/√Hz for 1 V peak: what the paper's own components give with its
/// equation 8 put right. Its printed 0.151 aF/√Hz does not follow from them.
#[test]
fn the_noise_follows_from_the_components() {
    let slope = PAPER.slope(BASE);
    assert!((slope / 5.32e9 - 1.0).abs() < 2e-3, "{slope}");
    let noise = PAPER.capacitance_noise(2.09e-9, BASE);
    assert!((noise - 0.393e-18).abs() < 0.0005e-18, "{noise}");
    let peak = CarrierDivider { excitation: 0.5_f64.sqrt(), ..PAPER };
    let noise = peak.capacitance_noise(2.09e-9, BASE);
    assert!((noise - 0.556e-18).abs() < 0.0005e-18, "{noise}");
}

/// What inverting a straight line in place of the divider does to the position: tens of nanometres and more.
#[test]
fn a_straight_line_for_the_divider_is_tens_of_nanometres_wrong() {
    let largest = (0..=1000).map(|i| {
        let distance = 0.5e-3 + 1e-6 * f64::from(i);
        let volts = PAPER.voltage(PLATE.capacitance(distance));
        let straight = BASE + (volts - PAPER.voltage(BASE)) / PAPER.slope(BASE);
        (BASE * 1e-3 / straight - distance).abs()
    });
    let largest = largest.fold(0.0, f64::max);
    assert!((50e-9..200e-9).contains(&largest), "{largest}");
}

#[test]
fn a_calibrated_series_goes_through_the_measured_point() {
    let made = FRINGING.through(0.8e-3, 150e-15);
    assert!((made.capacitance(0.8e-3) / 150e-15 - 1.0).abs() < 1e-14);
    let gain = (made.capacitance(0.6e-3) - 4e-15) / (FRINGING.capacitance(0.6e-3) - 4e-15);
    assert!((gain / ((150e-15 - 4e-15) / (FRINGING.capacitance(0.8e-3) - 4e-15)) - 1.0).abs() < 1e-13);
}

proptest! {
    #[test]
    fn the_series_is_its_sum_and_its_slope_the_derivative(distance in 0.4e-3..1.6e-3_f64) {
        let u = 1e-3 / distance;
        let sum = 4e-15 + 95e-15 * u + 12e-15 * u.powi(2) - 1.5e-15 * u.powi(3);
        prop_assert!((FRINGING.capacitance(distance) / sum - 1.0).abs() < 1e-13);
        let slope = -u / distance * (95e-15 + 24e-15 * u - 4.5e-15 * u * u);
        prop_assert!((FRINGING.slope(distance) / slope - 1.0).abs() < 1e-13);
    }

    #[test]
    fn jacobians_by_hand_are_the_dual_ones(
        amplitude in 0.1e-3..0.5e-3_f64, phase in -PI..PI, rest in 0.9e-3..1.1e-3_f64, turns in 0..2_i32,
    ) {
        let x = [amplitude, 500.0, phase, rest, 1.7e-6];
        let drifting = DriftingPhasorCapacitance { series: FRINGING };
        let (y, by_hand) = drifting.linearize(&x);
        let (z, by_dual): ([f64; 1], Mat<f64, 1, 5>) = jacobian(&x, |x| drifting.predict(x));
        prop_assert!((y[0] / z[0] - 1.0).abs() < 1e-14);
        for j in 0..5 {
            let scale = [1e-10, 1.0, 1e-13, 1e-10, 1.0][j];
            prop_assert!((by_hand[(0, j)] - by_dual[(0, j)]).abs() <= 1e-12 * scale, "{}", j);
        }
        let steady = SteadyPhasorCapacitance { series: FRINGING, rest_distance: rest };
        let (known, by_hand) = steady.linearize(&[x[0], x[1], x[2]]);
        prop_assert!((known[0] / y[0] - 1.0).abs() < 1e-14);
        prop_assert!((by_hand[(0, 0)] - by_dual[(0, 0)]).abs() <= 1e-22);
        prop_assert!((by_hand[(0, 2)] - by_dual[(0, 2)]).abs() <= 1e-25);

        let turns = f64::from(turns);
        let process = DriftingPhasor::new(5e-5, &NoiseDensity::none());
        let (there, by_hand) = process.linearize(&x, &turns);
        let (dual, by_dual): ([f64; 5], Mat<f64, 5, 5>) = jacobian(&x, |x| process.step(x, &turns));
        prop_assert_eq!(there, dual);
        prop_assert_eq!(by_hand, by_dual);
        // The steady one is its upper part where the amplitude does not drift.
        let steady = SteadyPhasor::new(5e-5, &NoiseDensity::none());
        prop_assert_eq!(steady.step(&[x[0], x[1], x[2]], &turns)[2], there[2]);
    }
}

/// Random walks of the frequency and of the amplitude's rate over one interval, in closed form: of a random walk's
/// integral, q·h³/3 and q·h²/2.
#[test]
fn the_noise_of_a_step_is_that_of_integrated_walks() {
    let (h, frequency, rate, rest) = (5e-5, 1e-8, 1e-14, 1e-19);
    let density = NoiseDensity::none().on::<1>(frequency).on::<3>(rest).on::<4>(rate);
    let process = DriftingPhasor::new(h, &density);
    let q = process.noise().covariance();
    let near =
        |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    near(q.get(1, 1), frequency * h);
    near(q.get(2, 1), TAU * frequency * h * h / 2.0);
    near(q.get(2, 2), TAU * TAU * frequency * h.powi(3) / 3.0);
    near(q.get(0, 0), rate * h.powi(3) / 3.0);
    near(q.get(4, 0), rate * h * h / 2.0);
    near(q.get(4, 4), rate * h);
    near(q.get(3, 3), rest * h);
    for (i, j) in [(1, 0), (2, 0), (3, 0), (3, 1), (4, 1), (4, 2), (4, 3)] {
        assert_eq!(q.get(i, j), 0.0);
    }
    let steady = SteadyPhasor::new(h, &NoiseDensity::none().on::<0>(3e-19).on::<1>(frequency));
    near(steady.noise().covariance().get(0, 0), 3e-19 * h);
    near(steady.noise().covariance().get(2, 2), TAU * TAU * frequency * h.powi(3) / 3.0);
}

/// A phase that grows without end loses its digits: 500 Hz for 200 s in `f32`, with turns taken off and without.
#[test]
fn turns_taken_off_keep_the_digits() {
    let process = SteadyPhasor::<f32>::new(5e-4, &NoiseDensity::none());
    let (mut wrapped, mut growing) = ([5e-4_f32, 500.0, 0.25], [5e-4_f32, 500.0, 0.25]);
    for _ in 0..400_000 {
        let turns = if wrapped[2] > std::f32::consts::PI { 1.0 } else { 0.0 };
        wrapped = process.step(&wrapped, &turns);
        growing = process.step(&growing, &0.0);
    }
    // Four hundred thousand quarter turns are a whole number of turns.
    let error = |phase: f32| {
        let off = f64::from(phase) - 0.25;
        (off - TAU * (off / TAU).round()).abs()
    };
    assert!(wrapped[2].abs() < 8.0);
    assert!(error(wrapped[2]) < 0.05, "{}", error(wrapped[2]));
    assert!(error(growing[2]) > 0.1, "{}", error(growing[2]));
}

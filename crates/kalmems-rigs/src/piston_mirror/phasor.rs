//! The models of the motion: what a filter knows of a phasor.

use super::plates::{COEFFICIENTS, Plates};
use crate::estimate::{DerivedQuantities, MOST_STATES, StateName, deviation};
use crate::units::kind;
use kalmems_core::Portable;
use kalmems_core::{Measurement, NoiseDensity, Process};
use kalmems_models::dynamics::{DriftingPhasor, SteadyPhasor};
use kalmems_models::readout::{
    AmplifiedPhasorCapacitance, DriftingPhasorCapacitance, SteadyPhasorCapacitance,
};
use std::f64::consts::TAU;

/// The states [A, f, φ, d₀, Ȧ] as files name them; a filter of three has the first three.
pub const STATES: [StateName; 5] = [
    ("amplitude", "m", &kind::LENGTH),
    ("frequency", "Hz", &kind::FREQUENCY),
    ("phase", "rad", &kind::ANGLE),
    ("offset", "m", &kind::LENGTH),
    ("amplitude_rate", "m_per_s", &kind::VELOCITY),
];

/// What follows from them.
const DERIVED: [StateName; 2] = [("position", "m", &kind::LENGTH), ("velocity", "m_per_s", &kind::VELOCITY)];

/// A model of the motion with `N` states.
pub trait Phasor<const N: usize> {
    /// One step; its input is the turns that are taken off the phase.
    type Process: Process<f64, N, Input = f64>;
    /// What is measured.
    type Readout: Measurement<f64, N, 1>;

    /// The step over an interval in s.
    fn over(&self, interval_s: f64) -> Self::Process;

    /// What is measured.
    fn readout(&self) -> &Self::Readout;

    /// Position and velocity, from the states.
    fn derived(&self) -> DerivedQuantities;
}

/// [A, f, φ] about a known rest position.
pub struct FixedRestPhasor {
    /// The densities of A, f and φ in m²/s, Hz²/s and rad²/s.
    pub density: NoiseDensity<f64, 3>,
    /// C(d₀ + A·cos φ).
    pub readout: SteadyPhasorCapacitance<f64, COEFFICIENTS>,
}

/// [A, f, φ, d₀, Ȧ].
pub struct Drifting {
    /// The densities of each in its unit² per second.
    pub density: NoiseDensity<f64, 5>,
    /// C(d₀ + A·cos φ).
    pub readout: DriftingPhasorCapacitance<f64, COEFFICIENTS>,
}

impl FixedRestPhasor {
    /// With noise on the amplitude and the frequency.
    pub fn new(series: Plates, rest_distance: f64, [amplitude, frequency]: [f64; 2]) -> Self {
        Self {
            density: NoiseDensity::none().on::<0>(amplitude).on::<1>(frequency),
            readout: SteadyPhasorCapacitance { series, rest_distance },
        }
    }
}

impl Drifting {
    /// With noise on the frequency, the rest position and the amplitude's rate.
    pub fn new(series: Plates, [frequency, offset, amplitude_rate]: [f64; 3]) -> Self {
        Self {
            density: NoiseDensity::none().on::<1>(frequency).on::<3>(offset).on::<4>(amplitude_rate),
            readout: DriftingPhasorCapacitance { series },
        }
    }
}

impl Drifting {
    /// What is measured, where gain and stray capacitance are not what the device table says.
    pub fn amplified(&self) -> AmplifiedPhasorCapacitance<f64, COEFFICIENTS> {
        AmplifiedPhasorCapacitance { series: self.readout.series, gain: 1.0, stray: 0.0, harmonics: [0.0; 4] }
    }
}

impl Phasor<3> for FixedRestPhasor {
    type Process = SteadyPhasor<f64>;
    type Readout = SteadyPhasorCapacitance<f64, COEFFICIENTS>;

    fn over(&self, interval_s: f64) -> Self::Process {
        SteadyPhasor::new(interval_s, &self.density)
    }

    fn readout(&self) -> &Self::Readout {
        &self.readout
    }

    fn derived(&self) -> DerivedQuantities {
        let rest = self.readout.rest_distance;
        DerivedQuantities::pair(DERIVED, move |x, p| {
            let (values, gradients) = position_and_velocity(&[x[0], x[1], x[2], rest, 0.0]);
            let sd = gradients.map(|gradient| deviation(&gradient[..3], p));
            [(values[0], sd[0]), (values[1], sd[1])]
        })
    }
}

impl Phasor<5> for Drifting {
    type Process = DriftingPhasor<f64>;
    type Readout = DriftingPhasorCapacitance<f64, COEFFICIENTS>;

    fn over(&self, interval_s: f64) -> Self::Process {
        DriftingPhasor::new(interval_s, &self.density)
    }

    fn readout(&self) -> &Self::Readout {
        &self.readout
    }

    fn derived(&self) -> DerivedQuantities {
        DerivedQuantities::pair(DERIVED, |x, p| {
            let (values, gradients) = position_and_velocity(&[x[0], x[1], x[2], x[3], x[4]]);
            let sd = gradients.map(|gradient| deviation(&gradient, p));
            [(values[0], sd[0]), (values[1], sd[1])]
        })
    }
}

/// d = d₀ + A·cos φ in m and ḋ = Ȧ·cos φ − 2π·f·A·sin φ in m/s, and their derivatives by [A, f, φ, d₀, Ȧ].
pub fn position_and_velocity(&[a, f, phase, rest, drift]: &[f64; 5]) -> ([f64; 2], [[f64; 5]; 2]) {
    let (s, c) = phase.portable_sin_cos();
    let rate = TAU * f;
    let values = [rest + a * c, drift * c - rate * a * s];
    let gradients =
        [[c, 0.0, -a * s, 1.0, 0.0], [-rate * s, -TAU * a * s, -drift * s - rate * a * c, 0.0, c]];
    (values, gradients)
}

/// The same of a motion with harmonics, whose amplitudes are states at these places in the order of [`HARMONICS`](super::settings::HARMONICS), where they
/// are; the derivatives are by all states.
fn with_harmonics(x: &[f64], places: &[Option<usize>; 4]) -> ([f64; 2], [[f64; MOST_STATES]; 2]) {
    let of_sine: [f64; 5] = std::array::from_fn(|i| x.get(i).copied().unwrap_or(0.0));
    let (mut values, of_five) = position_and_velocity(&of_sine);
    let mut gradients: [[f64; MOST_STATES]; 2] =
        of_five.map(|five| std::array::from_fn(|i| five.get(i).copied().unwrap_or(0.0)));
    let ([_, f, phase, ..], rate) = (of_sine, TAU * of_sine[1]);
    for (which, place) in places.iter().enumerate() {
        let Some((place, amplitude)) = place.and_then(|place| Some((place, *x.get(place)?))) else {
            continue;
        };
        let order = if which < 2 { 2.0 } else { 3.0 };
        let (s, c) = (order * phase).portable_sin_cos();
        // The shape by the phase, its derivative, and the derivative of that.
        let (shape, slope) = if which % 2 == 0 { (c, -order * s) } else { (s, order * c) };
        let curvature = -order * order * shape;
        values[0] += amplitude * shape;
        values[1] += rate * amplitude * slope;
        gradients[0][2] += amplitude * slope;
        gradients[0][place] += shape;
        gradients[1][1] += TAU * amplitude * slope;
        gradients[1][2] += rate * amplitude * curvature;
        gradients[1][place] += TAU * f * slope;
    }
    (values, gradients)
}

/// Position and velocity of such a motion.
pub fn derived_with_harmonics(places: [Option<usize>; 4]) -> DerivedQuantities {
    DerivedQuantities::pair(DERIVED, move |x, p| {
        let (values, gradients) = with_harmonics(x, &places);
        let sd = gradients.map(|gradient| deviation(gradient.get(..x.len()).unwrap_or(&[]), p));
        [(values[0], sd[0]), (values[1], sd[1])]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_harmonics_are_differences() {
        let x = [5e-4, 500.0, 0.7, 1e-3, 2e-6, 3e-6, -4e-6, 5e-6, 1e-6];
        let places = [Some(5), Some(6), Some(7), Some(8)];
        let (_, gradients) = with_harmonics(&x, &places);
        for (j, h) in [1e-8, 1e-3, 1e-5, 1e-8, 1e-8, 1e-8, 1e-8, 1e-8, 1e-8].into_iter().enumerate() {
            let (mut up, mut down) = (x, x);
            up[j] += h;
            down[j] -= h;
            let (up, down) = (with_harmonics(&up, &places).0, with_harmonics(&down, &places).0);
            for i in 0..2 {
                let difference = (up[i] - down[i]) / (2.0 * h);
                assert!((gradients[i][j] - difference).abs() <= 1e-6 * difference.abs() + 1e-8, "{i} {j}");
            }
        }
        // The velocity is the derivative along the motion.
        let h = 1e-8;
        let mut later = x;
        (later[0], later[2]) = (x[0] + h * x[4], x[2] + TAU * x[1] * h);
        let ([now, velocity], _) = with_harmonics(&x, &places);
        let ([then, _], _) = with_harmonics(&later, &places);
        assert!(((then - now) / h / velocity - 1.0).abs() < 1e-4);
    }

    #[test]
    fn derivatives_are_differences() {
        let x = [5e-4, 500.0, 0.7, 1e-3, 2e-6];
        let (_, gradients) = position_and_velocity(&x);
        for (j, h) in [1e-8, 1e-3, 1e-5, 1e-8, 1e-8].into_iter().enumerate() {
            let (mut up, mut down) = (x, x);
            up[j] += h;
            down[j] -= h;
            let (up, down) = (position_and_velocity(&up).0, position_and_velocity(&down).0);
            for i in 0..2 {
                let difference = (up[i] - down[i]) / (2.0 * h);
                assert!((gradients[i][j] - difference).abs() <= 1e-6 * difference.abs() + 1e-9, "{i} {j}");
            }
        }
        // The velocity is the derivative along the motion.
        let h = 1e-8;
        let later = [x[0] + h * x[4], x[1], x[2] + TAU * x[1] * h, x[3], x[4]];
        let ([now, velocity], _) = position_and_velocity(&x);
        let ([then, _], _) = position_and_velocity(&later);
        assert!(((then - now) / h / velocity - 1.0).abs() < 1e-4);
    }
}

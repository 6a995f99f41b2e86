//! Which lines each stage of the circuit has, under a steady drive and motion.

use super::{AmplitudeDetector, Circuit, CircuitSpectrum, Complex, Excitation, SineMotion, comb_harmonics};
use crate::signal::PortableComplex;
use kalmems_models::capacitance::GaussianComb;
use std::f64::consts::FRAC_PI_2;

/// Harmonics of the capacitance that are carried along. At an amplitude of twice the comb's width the last is 1e-9 of
/// the first.
const HARMONICS: usize = 16;

/// The lines of V_o1, V_o2, V_o3 and y_cap.
///
/// The charge is the product of voltage and capacitance, a convolution of their lines; the amplifier takes its
/// derivative, filters multiply each line by their response, a square-law detector convolves once more with itself, a
/// synchronous one with the reference. Nothing is neglected and no order is left out, unlike in Chen et al., shared
/// electrodes, 2020, equations 28 to 37.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    /// V_o1, behind the amplifier.
    pub amplified: CircuitSpectrum,
    /// V_o2, behind the high-pass.
    pub passed: CircuitSpectrum,
    /// V_o3, behind the detector; `None` behind a diode, which has no lines in closed form.
    pub detected: Option<CircuitSpectrum>,
    /// y_cap, behind both low-pass stages.
    pub output: Option<CircuitSpectrum>,
}

impl Bands {
    /// The lines for a comb that swings as a sine.
    pub fn of(
        circuit: &Circuit,
        excitation: &Excitation,
        comb: &GaussianComb<f64>,
        motion: &SineMotion,
    ) -> Self {
        let harmonics = comb_harmonics::<HARMONICS>(comb, motion.amplitude_rad);
        Self::of_harmonics(circuit, excitation, &harmonics, motion.phase_rad)
    }

    /// The lines for a capacitance Σ c_n·cos(n·(ω_dr·t + 2φ)), c_n in F: of any shape that is even in the angle.
    pub fn of_harmonics(
        circuit: &Circuit,
        excitation: &Excitation,
        capacitance: &[f64],
        motion_phase_rad: f64,
    ) -> Self {
        let none = CircuitSpectrum::new(excitation.drive_hz, excitation.carrier_hz);
        let mut comb = none.clone().with((0, 0), circuit.transimpedance.parasitic_capacitance, 0.0);
        for (n, value) in (0_i32..).zip(capacitance) {
            comb = comb.with((0, n), *value, 2.0 * f64::from(n) * motion_phase_rad);
        }
        let voltage = (none.clone())
            .with((0, 0), excitation.offset, 0.0)
            .with((0, 1), excitation.amplitude, -FRAC_PI_2)
            .with((1, 0), excitation.carrier, -FRAC_PI_2);
        let amplified = (comb.times(&voltage).differentiated())
            .scaled(circuit.transimpedance.feedback_resistance)
            .filtered(|hz| circuit.amplifier_response(hz));
        let passed = amplified.filtered(|hz| circuit.high_pass.response(hz));
        let detected = match &circuit.detector {
            AmplitudeDetector::Diode(_) => None,
            AmplitudeDetector::SquareLaw(law) => {
                Some(passed.times(&passed).scaled(law.square).plus(&passed.scaled(law.linear)))
            }
            AmplitudeDetector::Synchronous(law) => {
                let phase = circuit.front_response(excitation.carrier_hz).portable_arg() + law.phase;
                Some(passed.times(&none.with((1, 0), 2.0, phase)))
            }
        };
        let output = detected.as_ref().map(|lines| lines.filtered(|hz| circuit.low_pass_response(hz)));
        Self { amplified, passed, detected, output }
    }

    /// The coefficients of e^{jn·ω_dr·t} of the output, n = 0 to N − 1, where it has lines in closed form.
    pub(super) fn output_harmonics<const N: usize>(&self) -> Option<[Complex<f64>; N]> {
        let output = self.output.as_ref()?;
        let mut harmonics = [Complex::default(); N];
        for (n, slot) in (0_i32..).zip(&mut harmonics) {
            *slot = output.coefficient(0, n);
        }
        Some(harmonics)
    }
}

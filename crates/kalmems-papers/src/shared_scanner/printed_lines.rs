//! The published lines beside the right ones.

use crate::circuit::{AmplitudeDetector, Bands, Circuit, CircuitSpectrum, Excitation, SineMotion};
use crate::signal::PortableComplex;
use kalmems_models::capacitance::GaussianComb;
use std::f64::consts::TAU;

/// One line of one stage, thrice. Amplitudes in V, of the constant part with its sign.
#[derive(Clone, Debug, PartialEq)]
pub struct PrintedLine {
    /// `V_o1`, `V_o3` or `y_cap`.
    pub stage: &'static str,
    /// The equations of the paper that it is put together from.
    pub equations: &'static str,
    /// Times the carrier's frequency and times the drive's.
    pub label: (i32, i32),
    /// The line in words, such as `2·f_c − f_dr`.
    pub name: String,
    /// As printed.
    pub printed: f64,
    /// With the paper's capacitance, quadratic in the angle, and nothing else neglected: what differs is an error or a
    /// neglect.
    pub quadratic: f64,
    /// With the Gaussian capacitance.
    pub exact: f64,
}

/// The paper's formulas (Chen et al., shared electrodes, 2020, equations 28 to 37) beside [`Bands`], for its drive, a
/// pure sine: an offset is left out. Empty for a detector that does not square.
///
/// Its a_s, b_s, a_o3 and b_o3 are as it defines them, a_HPF and a_LPF the gains of our filters at the carrier and at
/// the drive.
pub fn printed_lines(
    circuit: &Circuit,
    excitation: &Excitation,
    comb: &GaussianComb<f64>,
    motion: &SineMotion,
) -> Vec<PrintedLine> {
    let AmplitudeDetector::SquareLaw(law) = circuit.detector else { return Vec::new() };
    let pure = Excitation { offset: 0.0, ..*excitation };
    let curvature = -comb.nominal / comb.angular_width.powi(2);
    let swing = 0.5 * curvature * motion.amplitude_rad.powi(2);
    let (a_s, b_s) = (-swing, swing + comb.nominal + comb.bias);
    let exact = Bands::of(circuit, &pure, comb, motion);
    let quadratic = Bands::of_harmonics(circuit, &pure, &[b_s, a_s], motion.phase_rad);

    let (w_dr, w_c) = (TAU * pure.drive_hz, TAU * pure.carrier_hz);
    let (v_dr, v_c) = (pure.amplitude, pure.carrier);
    let (r, c_p) = (circuit.transimpedance.feedback_resistance, circuit.transimpedance.parasitic_capacitance);
    let none = || CircuitSpectrum::new(pure.drive_hz, pure.carrier_hz);
    let phase = 2.0 * motion.phase_rad;

    let first = none()
        .with((0, 0), 0.5 * a_s * v_dr * w_dr * (1.0 - r) * phase.cos(), 0.0)
        .with((0, 1), b_s + w_dr * v_dr * r * c_p, 0.0)
        .with((0, 2), 0.5 * a_s * v_dr * w_dr * (r + 1.0), phase)
        .with((1, -1), a_s * r * v_c * (0.5 * w_dr + w_c), -phase)
        .with((1, 0), w_c * v_c * r * (b_s + c_p), 0.0)
        .with((1, 1), a_s * r * v_c * (w_c - 0.5 * w_dr), phase);

    let a_hpf = circuit.high_pass.response(pure.carrier_hz).portable_norm();
    let a_o3 = a_hpf * law.linear * w_c * v_c * r;
    let b_o3 = law.square * (a_hpf * w_c * v_c * r).powi(2);
    let mean = b_o3 * (0.25 * a_s * a_s + 0.5 * b_s * b_s + 0.5 * c_p * c_p + b_s * c_p);
    let swing = a_s * b_o3 * (b_s + c_p);
    let beside_carrier = a_s * (0.5 * a_o3 + b_o3 * b_s + b_o3 * c_p);
    let mut third = none()
        .with((0, 0), mean, 0.0)
        .with((0, 1), swing, phase)
        .with((0, 2), 0.25 * b_o3 * a_s * a_s, 2.0 * phase)
        .with((1, 0), a_o3 * (b_s + c_p), 0.0)
        .with((2, 0), mean, 0.0);
    for side in [-1, 1] {
        let turned = f64::from(side) * phase;
        third = (third.with((1, side), beside_carrier, turned))
            .with((2, side), a_s * b_o3 * b_s, turned)
            .with((2, 2 * side), 0.125 * b_o3 * a_s * a_s, 2.0 * turned);
    }

    let a_lpf = circuit.low_pass_response(pure.drive_hz).portable_norm();
    let last = none().with((0, 0), a_lpf * mean, 0.0).with((0, 1), a_lpf * swing, phase);

    let empty = none();
    let stages = [
        ("V_o1", "28 to 33", &first, &quadratic.amplified, &exact.amplified),
        ("V_o3", "36", &third, detected(&quadratic, &empty), detected(&exact, &empty)),
        ("y_cap", "37", &last, output(&quadratic, &empty), output(&exact, &empty)),
    ];
    let mut lines = Vec::new();
    for (stage, equations, printed, quadratic, exact) in stages {
        for line in printed.lines() {
            let of = |spectrum: &CircuitSpectrum| spectrum.amplitude(line.carrier, line.drive);
            lines.push(PrintedLine {
                stage,
                equations,
                label: (line.carrier, line.drive),
                name: line.to_string(),
                printed: of(printed),
                quadratic: of(quadratic),
                exact: of(exact),
            });
        }
    }
    lines
}

fn detected<'a>(bands: &'a Bands, empty: &'a CircuitSpectrum) -> &'a CircuitSpectrum {
    bands.detected.as_ref().unwrap_or(empty)
}

fn output<'a>(bands: &'a Bands, empty: &'a CircuitSpectrum) -> &'a CircuitSpectrum {
    bands.output.as_ref().unwrap_or(empty)
}

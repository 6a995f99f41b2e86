//! What of the circuit a filter needs to know.

use super::chain::measured_harmonics;
use super::excitation::turned;
use super::{Bands, Circuit, Complex, Excitation, SineMotion, comb_harmonics};
use crate::signal::PortableComplex;
use kalmems_models::capacitance::GaussianComb;
use std::f64::consts::PI;
use std::fmt;

/// Harmonics of the drive that are compared, the constant part among them.
pub(super) const HARMONICS: usize = 6;

/// One of the models, fitted to the circuit's output over a cycle of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedModel {
    /// a in V/F.
    pub gain: f64,
    /// b in V.
    pub offset: f64,
    /// The root mean square of what is left, relative to that of the output's moving part.
    pub residual: f64,
    /// How far the output's line at f_dr lags the model's, in degrees of the motion's cycle: half of those of the line.
    pub lag_deg: f64,
}

/// The circuit under one excitation and motion as y = a·C + b, with and without the poles of its low-pass stages.
///
/// The output's lines at the multiples of f_dr are fitted by those of the capacitance, which are exact; lines of the
/// carrier that the low-pass stages leave are no part of it. Gain and offset belong to the motion: a detector that
/// squares has a gain in proportion to C + C_p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReducedCircuit {
    /// y = a·C + b (Chen et al., shared electrodes, 2020, equation 25).
    pub affine: FittedModel,
    /// The same of C a time ago.
    pub delayed: FittedModel,
    /// That time in s.
    pub delay_s: f64,
    /// The same of C behind the poles of the two low-pass stages.
    pub with_poles: FittedModel,
    /// These poles.
    pub poles_hz: [f64; 2],
    /// The same with a delay besides: that of the high-pass, whose phase is not straight about a carrier that lies near
    /// its cut-off.
    pub with_poles_and_delay: FittedModel,
    /// That delay in s.
    pub front_delay_s: f64,
    /// What of the drive comes through at f_dr without any motion, in V.
    pub feedthrough: f64,
}

impl ReducedCircuit {
    /// Reduces a circuit: by its lines, or behind a diode by a run over 64 cycles of the motion.
    pub fn of(
        circuit: &Circuit,
        excitation: &Excitation,
        comb: &GaussianComb<f64>,
        motion: &SineMotion,
    ) -> Self {
        let y = output_harmonics(circuit, excitation, comb, motion);
        let still = SineMotion { amplitude_rad: 0.0, ..*motion };
        let still = output_harmonics(circuit, excitation, comb, &still);
        let cosines = comb_harmonics::<HARMONICS>(comb, motion.amplitude_rad);
        let mut c = [Complex::default(); HARMONICS];
        for (n, (slot, cosine)) in c.iter_mut().zip(cosines).enumerate() {
            let (s, cos) = turned(n as f64 * motion.phase_rad / PI);
            *slot = Complex::new(cos, s) * if n == 0 { cosine } else { 0.5 * cosine };
        }
        let fitted = |response: &dyn Fn(f64) -> Complex<f64>| {
            let mut seen = c;
            for (n, value) in seen.iter_mut().enumerate() {
                *value *= response(n as f64 * excitation.drive_hz);
            }
            fit(&y, &seen)
        };
        let turned_by = |hz: f64, delay_s: f64| {
            let (sine, cosine) = turned(-hz * delay_s);
            Complex::new(cosine, sine)
        };
        let delayed = |delay_s: f64| fitted(&|hz| turned_by(hz, delay_s));
        let both = |delay_s: f64| fitted(&|hz| circuit.low_pass_response(hz) * turned_by(hz, delay_s));
        let period_s = 1.0 / excitation.drive_hz;
        let delay_s = least(|delay_s| delayed(delay_s).residual, period_s);
        let front_delay_s = least(|delay_s| both(delay_s).residual, period_s);
        Self {
            affine: fitted(&|_| Complex::new(1.0, 0.0)),
            delayed: delayed(delay_s),
            delay_s,
            with_poles: fitted(&|hz| circuit.low_pass_response(hz)),
            poles_hz: circuit.low_pass_hz,
            with_poles_and_delay: both(front_delay_s),
            front_delay_s,
            feedthrough: 2.0 * still[1].portable_norm(),
        }
    }
}

/// The coefficients of e^{jn·ω_dr·t} of the output, the constant part first: by its lines, or behind a diode by a run.
pub(super) fn output_harmonics(
    circuit: &Circuit,
    excitation: &Excitation,
    comb: &GaussianComb<f64>,
    motion: &SineMotion,
) -> [Complex<f64>; HARMONICS] {
    Bands::of(circuit, excitation, comb, motion).output_harmonics().unwrap_or_else(|| {
        let slowest_hz = circuit.low_pass_hz.into_iter().fold(f64::INFINITY, f64::min);
        // The detector's own discharge may be slower than the poles; 64 cycles are longer than any that is of use.
        let settle_s = 10.0 / slowest_hz + 128.0 / excitation.drive_hz;
        measured_harmonics(circuit, excitation, (comb, motion), (settle_s, 64))
    })
}

/// The least squares of y by a·c + b over a cycle.
fn fit(y: &[Complex<f64>; HARMONICS], c: &[Complex<f64>; HARMONICS]) -> FittedModel {
    let moving = || y.iter().zip(c).skip(1);
    let total: f64 = moving().map(|(y, _)| y.norm_sqr()).sum();
    let gain = moving().map(|(y, c)| (y * c.conj()).re).sum::<f64>()
        / moving().map(|(_, c)| c.norm_sqr()).sum::<f64>();
    let left: f64 = moving().map(|(y, c)| (y - c * gain).norm_sqr()).sum();
    let turn = (c[1] * gain / y[1]).portable_arg().to_degrees();
    FittedModel {
        gain,
        offset: (y[0] - c[0] * gain).re,
        residual: (left / total).sqrt(),
        lag_deg: 0.5 * turn,
    }
}

/// Where a function of a delay is least, from a tenth of a period early to half of one late: a grid, then golden
/// sections.
///
/// Half a period away the sign of the gain takes the place of the delay; the shorter one is meant.
fn least(f: impl Fn(f64) -> f64, period: f64) -> f64 {
    const GRID: u32 = 200;
    let (mut best, mut at) = (f64::INFINITY, 0.0);
    for i in 0..GRID {
        let delay = period * (0.6 * f64::from(i) / f64::from(GRID) - 0.1);
        let value = f(delay);
        if value < best {
            (best, at) = (value, delay);
        }
    }
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let half = 0.6 * period / f64::from(GRID);
    let (mut low, mut high) = (at - half, at + half);
    for _ in 0..40 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if f(a) < f(b) {
            high = b;
        } else {
            low = a;
        }
    }
    f64::midpoint(low, high)
}

impl fmt::Display for ReducedCircuit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FittedModel { gain, offset, residual, .. } = self.with_poles_and_delay;
        let [first, second] = self.poles_hz;
        write!(
            f,
            "y = {:.4} V/pF · C {} {:.4} V after poles at {:.1} and {:.1} kHz and a delay of {:.2} µs, to {:.2} %",
            gain * 1e-12,
            if offset < 0.0 { '−' } else { '+' },
            offset.abs(),
            first / 1e3,
            second / 1e3,
            self.front_delay_s * 1e6,
            residual * 100.0
        )
    }
}

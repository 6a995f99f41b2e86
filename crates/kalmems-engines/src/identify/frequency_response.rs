//! A resonance in a measured frequency response.

use crate::fit::{ByDual, DerivedNumber, Fit, FitError, FitSettings, ResidualLaw, fit};
use kalmems_core::Portable;
use kalmems_core::{Over, Scalar};
use std::f64::consts::TAU;

/// One point of a frequency response, output over input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponsePoint {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// The real part.
    pub re: f64,
    /// The imaginary part.
    pub im: f64,
    /// The standard deviation of either part; 1 for all where it is not known.
    pub deviation: f64,
}

/// What else a response holds beside its resonance and a delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResponseModel {
    /// Nothing.
    SingleMode,
    /// The compliance of modes above the measured band and the inertia of those below: r + m·(f_s/f)², with f_s the
    /// middle of the band.
    WithResidualModes,
}

/// G(f) = [g/(1 + 2ζs + s²) + r + m·(f_s/f)²]·e^{−2πjfτ} with s = jf/f₀.
#[derive(Clone, Debug, PartialEq)]
pub struct ResonantResponse {
    /// [g, f₀ in Hz, ζ, τ in s, r, m] with their covariance.
    pub fit: Fit<6>,
}

impl ResonantResponse {
    /// g: the static response of the mode.
    pub fn gain(&self) -> DerivedNumber {
        self.fit.derived(|p| p[0])
    }
    /// f₀ in Hz.
    pub fn natural_frequency_hz(&self) -> DerivedNumber {
        self.fit.derived(|p| p[1])
    }
    /// ζ.
    pub fn damping_ratio(&self) -> DerivedNumber {
        self.fit.derived(|p| p[2])
    }
    /// Q = 1/(2ζ).
    pub fn quality(&self) -> DerivedNumber {
        self.fit.derived(|p| p[2].twice().recip())
    }
    /// τ in s; positive where the output is late.
    pub fn delay_s(&self) -> DerivedNumber {
        self.fit.derived(|p| p[3])
    }
}

/// The resonance that fits best, by least squares on both parts of every point.
///
/// It starts at the largest magnitude, with the damping from the width of the peak at 1/√2 of it.
pub fn fit_response(points: &[ResponsePoint], model: ResponseModel) -> Result<ResonantResponse, FitError> {
    let start = start(points).ok_or(FitError::TooFew { residuals: 2 * points.len(), parameters: 6 })?;
    let residual_modes = model == ResponseModel::WithResidualModes;
    let middle_hz =
        (points[0].frequency_hz * points[points.len() - 1].frequency_hz).abs().sqrt().max(f64::MIN_POSITIVE);
    let settings = FitSettings {
        free: [true, true, true, true, residual_modes, residual_modes],
        ..FitSettings::from_start(start)
    };
    fit(&ByDual(ResponseResiduals { points, middle_hz }), &settings).map(|fit| ResonantResponse { fit })
}

fn start(points: &[ResponsePoint]) -> Option<[f64; 6]> {
    let magnitude = |p: &ResponsePoint| p.re.portable_hypot(p.im);
    let finite = || points.iter().filter(|p| magnitude(p).is_finite());
    if finite().count() < 4 {
        return None;
    }
    let peak = finite().max_by(|a, b| magnitude(a).total_cmp(&magnitude(b)))?;
    let wide = finite().filter(|p| magnitude(p) > magnitude(peak) / std::f64::consts::SQRT_2);
    let (low, high) = wide
        .fold((f64::INFINITY, 0.0_f64), |(low, high), p| (low.min(p.frequency_hz), high.max(p.frequency_hz)));
    let damping = ((high - low) / (2.0 * peak.frequency_hz)).clamp(1e-6, 1.0);
    // At resonance G = g/(2jζ).
    let gain = 2.0 * damping * magnitude(peak);
    Some([gain * if peak.im > 0.0 { -1.0 } else { 1.0 }, peak.frequency_hz, damping, 0.0, 0.0, 0.0])
}

struct ResponseResiduals<'a> {
    points: &'a [ResponsePoint],
    middle_hz: f64,
}

impl ResidualLaw<6> for ResponseResiduals<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 6], each: &mut impl FnMut(S)) {
        let [gain, natural, damping, delay, compliance, inertia] = *p;
        for point in self.points {
            let s = S::lift(point.frequency_hz) / natural;
            let (a, b) = (S::of(1.0) - s.sq(), (damping * s).twice());
            let scale = gain / (a.sq() + b.sq());
            let others = compliance + inertia * (self.middle_hz / point.frequency_hz).powi(2);
            let (re, im) = (scale * a + others, -(scale * b));
            let turn = delay * (-TAU * point.frequency_hz);
            let (c, s) = (turn.cos(), turn.sin());
            let weight = 1.0 / point.deviation;
            each((re * c - im * s - point.re) * weight);
            each((re * s + im * c - point.im) * weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn measured(residual: [f64; 2]) -> Vec<ResponsePoint> {
        (1..200)
            .map(|i| {
                let f = 10.0 * f64::from(i);
                let s = f / 810.0;
                let (a, b) = (1.0 - s * s, 0.06 * s);
                let scale = -2.5 / (a * a + b * b);
                let middle = (10.0_f64 * 1990.0).sqrt();
                let others = residual[0] + residual[1] * (middle / f).powi(2);
                let (re, im) = (scale * a + others, -scale * b);
                let (s, c) = (-TAU * f * 1e-4).sin_cos();
                ResponsePoint { frequency_hz: f, re: re * c - im * s, im: re * s + im * c, deviation: 1.0 }
            })
            .collect()
    }

    #[test]
    fn a_made_response_is_found() {
        for (residual, model) in
            [([0.0, 0.0], ResponseModel::SingleMode), ([0.3, -0.02], ResponseModel::WithResidualModes)]
        {
            let found = fit_response(&measured(residual), model).unwrap();
            assert_relative_eq!(found.gain().value, -2.5, max_relative = 1e-8);
            assert_relative_eq!(found.natural_frequency_hz().value, 810.0, max_relative = 1e-9);
            assert_relative_eq!(found.damping_ratio().value, 0.03, max_relative = 1e-8);
            assert_relative_eq!(found.delay_s().value, 1e-4, max_relative = 1e-8);
            assert_relative_eq!(found.fit.parameters[5], residual[1], epsilon = 1e-9);
        }
    }

    #[test]
    fn too_few_points_are_refused() {
        assert!(fit_response(&measured([0.0; 2])[..3], ResponseModel::SingleMode).is_err());
        assert!(fit_response(&[], ResponseModel::SingleMode).is_err());
    }
}

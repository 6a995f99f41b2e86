//! A free decay as a damped sine.

use crate::fit::{ByDual, DerivedNumber, Fit, FitError, FitSettings, ResidualLaw, fit};
use crate::signal::{NormalEquations, largest_line};
use kalmems_core::Portable;
use kalmems_core::{Dual, Over, Scalar};
use std::f64::consts::TAU;

/// y(t) = c + e^{−α·(t − t₀)}·(a·cos ω_d(t − t₀) + b·sin ω_d(t − t₀)).
///
/// What a linear resonator with viscous damping does when it is left alone; a capacitive sensor shows it as such
/// where the motion is small.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeDecay {
    /// t₀ in s: the first sample.
    pub start_s: f64,
    /// [c, a, b, α in 1/s, ω_d in rad/s] with their covariance.
    pub fit: Fit<5>,
}

type DecayDual = Dual<f64, 5>;

impl FreeDecay {
    /// α in 1/s.
    pub fn decay_rate(&self) -> DerivedNumber {
        self.fit.derived(|p| p[3])
    }

    /// The frequency that is seen, ω_d/2π in Hz.
    pub fn damped_frequency_hz(&self) -> DerivedNumber {
        self.fit.derived(|p| p[4] * (1.0 / TAU))
    }

    /// The natural frequency √(ω_d² + α²)/2π in Hz.
    pub fn natural_frequency_hz(&self) -> DerivedNumber {
        self.fit.derived(|p| Self::natural_rate(p) * (1.0 / TAU))
    }

    /// The damping ratio α/ω₀.
    pub fn damping_ratio(&self) -> DerivedNumber {
        self.fit.derived(|p| p[3] / Self::natural_rate(p))
    }

    /// The quality factor ω₀/(2α).
    pub fn quality(&self) -> DerivedNumber {
        self.fit.derived(|p| Self::natural_rate(p) / p[3].twice())
    }

    /// The amplitude at t₀, in the unit of y.
    pub fn amplitude(&self) -> DerivedNumber {
        self.fit.derived(|p| (p[1].sq() + p[2].sq()).sqrt())
    }

    fn natural_rate(p: &[DecayDual; 5]) -> DecayDual {
        (p[3].sq() + p[4].sq()).sqrt()
    }
}

/// Samples that the search for a start looks at.
const SEARCH: usize = 2048;

/// The damped sine that fits best, by least squares over the finite samples.
///
/// The start is the best of a grid of frequencies around the largest line of the spectrum and of decay rates from
/// a tenth to thirty times the inverse of the record's length, the three linear parameters being solved for each.
/// The standard deviations hold for white noise; coloured noise makes them too small.
pub fn fit_free_decay(time_s: &[f64], y: &[f64]) -> Result<FreeDecay, FitError> {
    let n = time_s.len().min(y.len());
    let (time_s, y) = (&time_s[..n], &y[..n]);
    let too_few = || FitError::TooFew { residuals: n, parameters: 5 };
    let (first, last) = (time_s.first().ok_or_else(too_few)?, time_s.last().ok_or_else(too_few)?);
    let law = DampedSine { time_s, y, start_s: *first };
    let start = law.search(last - first).ok_or_else(too_few)?;
    let fit = fit(&ByDual(law), &FitSettings::from_start(start))?;
    Ok(FreeDecay { start_s: *first, fit })
}

struct DampedSine<'a> {
    time_s: &'a [f64],
    y: &'a [f64],
    start_s: f64,
}

impl DampedSine<'_> {
    /// The best of the grid.
    fn search(&self, span: f64) -> Option<[f64; 5]> {
        let interval = span / (self.time_s.len() - 1) as f64;
        let line = TAU * largest_line(self.y)? / interval;
        let width = TAU / span;
        let mut best = (f64::INFINITY, [0.0; 5]);
        for i in -8..=8 {
            let rate = line + 0.25 * width * f64::from(i);
            for j in 0..=12 {
                let decay = 0.1 / span * 300_f64.portable_powf(f64::from(j) / 12.0);
                if let Some((cost, [c, a, b])) = self.linear(rate, decay)
                    && cost < best.0
                {
                    best = (cost, [c, a, b, decay, rate]);
                }
            }
        }
        best.0.is_finite().then_some(best.1)
    }

    /// Sum of squares and [c, a, b] for one frequency and decay rate, over some of the samples.
    fn linear(&self, rate: f64, decay: f64) -> Option<(f64, [f64; 3])> {
        let stride = self.y.len().div_ceil(SEARCH);
        let samples = || self.time_s.iter().zip(self.y).step_by(stride).filter(|(_, y)| y.is_finite());
        let basis = |t: f64| {
            let (s, c) = (rate * (t - self.start_s)).portable_sin_cos();
            let envelope = (-decay * (t - self.start_s)).portable_exp();
            [1.0, envelope * c, envelope * s]
        };
        let mut normal = NormalEquations::new();
        samples().for_each(|(t, y)| normal.add(&basis(*t), *y));
        let (p, is_positive) = normal.solve();
        let cost = samples()
            .map(|(t, y)| (y - basis(*t).iter().zip(&p).map(|(b, p)| b * p).sum::<f64>()).powi(2))
            .sum::<f64>();
        (is_positive && cost.is_finite()).then_some((cost, p))
    }
}

impl ResidualLaw<5> for DampedSine<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 5], each: &mut impl FnMut(S)) {
        for (t, y) in self.time_s.iter().zip(self.y).filter(|(_, y)| y.is_finite()) {
            let t = t - self.start_s;
            let angle = p[4] * t;
            let swing = p[1] * angle.cos() + p[2] * angle.sin();
            each(p[0] + (-p[3] * t).exp() * swing - *y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn finds_a_decay_of_any_quality() {
        for quality in [3.0, 30.0, 3000.0] {
            let rate = TAU * 1000.0;
            let decay = rate / (2.0 * quality);
            let damped = (rate * rate - decay * decay).sqrt();
            let time: Vec<f64> = (0..8000).map(|i| 0.2 + f64::from(i) * 1e-5).collect();
            let y: Vec<f64> = time
                .iter()
                .map(|t| 0.4 + 2.0 * (-decay * (t - 0.2)).exp() * (damped * (t - 0.2) + 0.7).cos())
                .collect();
            let found = fit_free_decay(&time, &y).unwrap();
            assert_relative_eq!(found.natural_frequency_hz().value, 1000.0, max_relative = 1e-9);
            assert_relative_eq!(found.quality().value, quality, max_relative = 1e-8);
            assert_relative_eq!(found.amplitude().value, 2.0, max_relative = 1e-8);
        }
    }

    #[test]
    fn nothing_has_no_decay() {
        assert!(fit_free_decay(&[], &[]).is_err());
        assert!(fit_free_decay(&[0.0; 100], &[0.0; 100]).is_err());
        assert!(fit_free_decay(&[0.0; 100], &[f64::NAN; 100]).is_err());
    }
}

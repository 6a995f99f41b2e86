//! Sections one after the other.

use super::{SampledSection, Section};
use kalmems_core::Scalar;

/// Up to four sections in a row: a filter of up to eight poles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cascade<P> {
    sections: [Option<Section<P>>; 4],
}

impl<P: Scalar> Cascade<P> {
    /// The highest order.
    pub const HIGHEST_ORDER: usize = 8;

    /// Butterworth's high-pass: |H|² = 1/(1 + (ω_c/ω)²ⁿ) for the order n and the cut-off ω_c in rad/s, 1 far above it.
    ///
    /// Its poles lie evenly on a circle: pairs of the qualities 1/(2·sin((2k − 1)·π/2n)), and one real one where n is
    /// odd (S. Butterworth, Experimental Wireless 7, 536, 1930). `None` for an order of 0 or above
    /// [`HIGHEST_ORDER`](Self::HIGHEST_ORDER).
    ///
    /// ```
    /// use kalmems_models::circuit::Cascade;
    /// let (re, im) = Cascade::high_pass(3, 5.0_f64).unwrap().response(2.5);
    /// assert!((re * re + im * im - 1.0 / 65.0).abs() < 1e-15);
    /// ```
    pub fn high_pass(order: usize, cutoff: P) -> Option<Self> {
        if order == 0 || order > Self::HIGHEST_ORDER {
            return None;
        }
        let mut sections = [None; 4];
        for (k, section) in sections.iter_mut().enumerate().take(order.div_ceil(2)) {
            let angle = P::of((2 * k + 1) as f64 * core::f64::consts::FRAC_PI_2 / order as f64);
            *section = Some(if 2 * k + 1 == order {
                Section::high_pass(cutoff)
            } else {
                Section::high_pass_pair(cutoff, angle.sin().twice().recip())
            });
        }
        Some(Self { sections })
    }

    /// Two first-order low-pass stages with poles in rad/s.
    pub fn two_poles(poles: [P; 2]) -> Self {
        Self { sections: [Some(Section::low_pass(poles[0])), Some(Section::low_pass(poles[1])), None, None] }
    }

    /// The real and imaginary part of the response at a rate in rad/s.
    pub fn response(&self, rate: P) -> (P, P) {
        let mut total = (P::of(1.0), P::of(0.0));
        for section in self.sections.iter().flatten() {
            let (re, im) = section.response(rate);
            total = (total.0 * re - total.1 * im, total.0 * im + total.1 * re);
        }
        total
    }
}

/// A [`Cascade`], step by step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledCascade<P> {
    sections: [Option<SampledSection<P>>; 4],
}

impl<P: Scalar> SampledCascade<P> {
    /// At rest with an input of 0.
    pub fn new(cascade: &Cascade<P>, interval: P) -> Self {
        let mut sections = [None; 4];
        for (sampled, section) in sections.iter_mut().zip(&cascade.sections) {
            if let Some(section) = section {
                *sampled = Some(SampledSection::new(section, interval));
            }
        }
        Self { sections }
    }

    /// One interval on, to where the input is `u`; the output there.
    pub fn step(&mut self, u: P) -> P {
        let mut value = u;
        for section in self.sections.iter_mut().flatten() {
            value = section.step(value);
        }
        value
    }
}

//! A converter from volts to steps.

use crate::config::Adc;

/// A converter of equidistant levels, in V or whatever is measured, which clips what lies beyond them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converter {
    low: f64,
    high: f64,
    steps: f64,
}

impl Converter {
    /// As the experiment file describes it.
    pub fn of(adc: &Adc) -> Self {
        Self::new(adc.bits, [adc.low.si(), adc.high.si()])
    }

    /// Of `bits` bits between two levels, the lower one first.
    pub fn new(bits: u32, [low, high]: [f64; 2]) -> Self {
        Self { low, high, steps: ((1_u64 << bits.min(32)) - 1) as f64 }
    }

    /// The nearest level.
    #[must_use]
    pub fn round(self, volts: f64) -> f64 {
        let step = (self.high - self.low) / self.steps;
        self.low + step * ((volts - self.low) / step).round().clamp(0.0, self.steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_converter_rounds_to_its_levels_and_clips() {
        let converter = Converter { low: -1.0, high: 2.0, steps: 3.0 };
        let rounded = [-5.0, -1.4, -0.6, -0.4, 0.9, 1.6, 9.0].map(|volts| converter.round(volts));
        assert_eq!(rounded, [-1.0, -1.0, -1.0, 0.0, 1.0, 2.0, 2.0]);
    }
}

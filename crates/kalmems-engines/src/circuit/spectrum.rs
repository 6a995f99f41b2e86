//! Signals that are sums of lines at n·f_dr + m·f_c.

use crate::signal::PortableComplex;
use kalmems_core::Portable;
pub use realfft::num_complex::Complex;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt;

/// Lines this far below the largest are dropped after a product: far below what is asked for, so that their number
/// stays small.
const LEAST: f64 = 1e-9;

/// A real signal of lines at whole combinations of the drive's and the carrier's frequency.
///
/// Held as the coefficients of e^{j(m·ω_c + n·ω_dr)·t}, which come in conjugate pairs; a product of two signals is the
/// convolution of their coefficients.
#[derive(Clone, Debug, PartialEq)]
pub struct CircuitSpectrum {
    drive_hz: f64,
    carrier_hz: f64,
    /// By m and n.
    coefficients: BTreeMap<(i32, i32), Complex<f64>>,
}

/// One line: amplitude·cos(2π·f·t + phase).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircuitLine {
    /// m: how many times the carrier's frequency.
    pub carrier: i32,
    /// n: how many times the drive's frequency.
    pub drive: i32,
    /// f = m·f_c + n·f_dr, not below 0.
    pub frequency_hz: f64,
    /// Not below 0, in V for a voltage; of the constant part its modulus.
    pub amplitude: f64,
    /// Between −π and π.
    pub phase_rad: f64,
}

impl fmt::Display for CircuitLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&name_of(self.carrier, self.drive))
    }
}

/// The line at m·f_c + n·f_dr in words, such as `2·f_c − f_dr`.
fn name_of(carrier: i32, drive: i32) -> String {
    let times = |count: i32, name: &str| match count {
        1 => name.to_owned(),
        _ => format!("{count}·{name}"),
    };
    match (carrier, drive) {
        (0, 0) => "0".to_owned(),
        (m, 0) => times(m, "f_c"),
        (0, n) => times(n, "f_dr"),
        (m, n) => {
            let sign = if n < 0 { '−' } else { '+' };
            format!("{} {sign} {}", times(m, "f_c"), times(n.abs(), "f_dr"))
        }
    }
}

impl CircuitSpectrum {
    /// Nothing, with the frequencies that lines will be made of.
    pub fn new(drive_hz: f64, carrier_hz: f64) -> Self {
        Self { drive_hz, carrier_hz, coefficients: BTreeMap::new() }
    }

    /// Adds amplitude·cos((m·ω_c + n·ω_dr)·t + phase).
    #[must_use]
    pub fn with(mut self, (carrier, drive): (i32, i32), amplitude: f64, phase_rad: f64) -> Self {
        let half = Complex::portable_polar(0.5 * amplitude, phase_rad);
        *self.coefficients.entry((carrier, drive)).or_default() += half;
        *self.coefficients.entry((-carrier, -drive)).or_default() += half.conj();
        self
    }

    /// The frequency of m·f_c + n·f_dr.
    fn frequency_hz(&self, (carrier, drive): (i32, i32)) -> f64 {
        f64::from(carrier) * self.carrier_hz + f64::from(drive) * self.drive_hz
    }

    /// The coefficient of e^{j(m·ω_c + n·ω_dr)·t}.
    pub fn coefficient(&self, carrier: i32, drive: i32) -> Complex<f64> {
        self.coefficients.get(&(carrier, drive)).copied().unwrap_or_default()
    }

    /// Through a filter: each coefficient times the response at its frequency, which for one below 0 is the conjugate of
    /// that above.
    #[must_use]
    pub fn filtered(&self, response: impl Fn(f64) -> Complex<f64>) -> Self {
        let mut filtered = self.clone();
        for (label, value) in &mut filtered.coefficients {
            let frequency = self.frequency_hz(*label);
            *value *= if frequency < 0.0 { response(-frequency).conj() } else { response(frequency) };
        }
        filtered
    }

    /// The derivative by time.
    #[must_use]
    pub fn differentiated(&self) -> Self {
        self.filtered(|hz| Complex::new(0.0, TAU * hz))
    }

    /// Times a number.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        self.filtered(|_| Complex::new(factor, 0.0))
    }

    /// The sum of two signals.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        for (label, value) in &other.coefficients {
            *self.coefficients.entry(*label).or_default() += value;
        }
        self
    }

    /// The product of two signals.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        let mut product = Self::new(self.drive_hz, self.carrier_hz);
        for (&(m, n), a) in &self.coefficients {
            for (&(k, l), b) in &other.coefficients {
                *product.coefficients.entry((m + k, n + l)).or_default() += a * b;
            }
        }
        let largest = product.coefficients.values().map(|c| c.portable_norm()).fold(0.0, f64::max);
        product.coefficients.retain(|_, value| value.portable_norm() > LEAST * largest);
        product
    }

    /// All lines, from the lowest frequency on.
    pub fn lines(&self) -> Vec<CircuitLine> {
        let mut lines: Vec<CircuitLine> = (self.coefficients.iter())
            .filter_map(|(&(carrier, drive), value)| {
                let frequency_hz = self.frequency_hz((carrier, drive));
                let constant = (carrier, drive) == (0, 0);
                (constant || frequency_hz > 0.0).then(|| CircuitLine {
                    carrier,
                    drive,
                    frequency_hz,
                    amplitude: if constant { 1.0 } else { 2.0 } * value.portable_norm(),
                    phase_rad: value.portable_arg(),
                })
            })
            .collect();
        lines.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        lines
    }

    /// The lines that are at most this many decibels below the largest, from the lowest frequency on.
    pub fn lines_above(&self, decibels_down: f64) -> Vec<CircuitLine> {
        let mut lines = self.lines();
        let largest = lines.iter().map(|line| line.amplitude).fold(0.0, f64::max);
        let least = largest * 10_f64.portable_powf(-decibels_down / 20.0);
        lines.retain(|line| line.amplitude >= least && line.amplitude > 0.0);
        lines
    }

    /// The amplitude of one line; of the constant part its value with its sign.
    pub fn amplitude(&self, carrier: i32, drive: i32) -> f64 {
        let value = self.coefficient(carrier, drive);
        if (carrier, drive) == (0, 0) { value.re } else { 2.0 * value.portable_norm() }
    }
}

//! The response of a sensor to a sweep or to noise, band by band, with a reference that is sampled with it.

use crate::signal::{PortableComplex, fourier_transform};
use realfft::num_complex::Complex64;

/// The ratio of the ends of a band, a sixth of an octave, and the lines that a band has at least.
const BAND: f64 = 1.122_462;
const FEWEST_LINES: usize = 12;
/// Bands in which the reference has less than this part of the power of the strongest one, or that leave a larger part unknown, are left out.
const WEAKEST: f64 = 1e-5;
const UNKNOWN: f64 = 0.03;

/// The response in one band.
pub(super) struct BandResponse {
    /// The mean frequency by the power of the reference, in Hz.
    pub frequency_hz: f64,
    pub ratio: Complex64,
    /// The standard deviation of the amplitude as a part of it, and of the phase in rad.
    pub deviation: f64,
    pub freedom: f64,
    power: f64,
}

/// The bands of a record that begins and ends at rest, from low to high.
pub(super) fn bands(reference: &[f64], shown: &[f64], interval_s: f64) -> Vec<BandResponse> {
    if reference.len() < FEWEST_LINES {
        return Vec::new();
    }
    let lines_of = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        fourier_transform(&mut values.iter().map(|value| value - mean).collect::<Vec<_>>())
    };
    let (x, y) = (lines_of(reference), lines_of(shown));
    let resolution = (reference.len() as f64 * interval_s).recip();
    let mut found: Vec<BandResponse> = Vec::new();
    let mut from = FEWEST_LINES;
    loop {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of lines
        let to = ((from as f64 * BAND).ceil() as usize).max(from + FEWEST_LINES);
        let (Some(x), Some(y)) = (x.get(from..to), y.get(from..to)) else { break };
        found.push(band(from, x, y, resolution));
        from = to;
    }
    let strongest = found.iter().map(|band| band.power).fold(0.0, f64::max);
    found.retain(|band| band.power > WEAKEST * strongest && band.deviation < UNKNOWN);
    found
}

/// In a band the response is a parabola over the frequency, fitted to the lines of the whole record, whose noise is independent; what it leaves
/// is the noise.
fn band(first: usize, x: &[Complex64], y: &[Complex64], resolution: f64) -> BandResponse {
    let weighted = |of: &dyn Fn(f64) -> f64| {
        x.iter().enumerate().map(|(k, x)| of((first + k) as f64) * x.norm_sqr()).sum::<f64>()
    };
    let all = weighted(&|_| 1.0);
    let middle = weighted(&|line| line) / all;
    let square = weighted(&|line| (line - middle).powi(2));
    let [level, tilt] = [square / all, weighted(&|line| (line - middle).powi(3)) / square];
    // Three polynomials that are orthogonal with these weights.
    let polynomials: [&dyn Fn(f64) -> f64; 3] =
        [&|_| 1.0, &|line| line - middle, &|line| (line - middle).powi(2) - tilt * (line - middle) - level];
    let squares = polynomials.map(|of| weighted(&|line| of(line).powi(2)));
    let each = || x.iter().zip(y).enumerate().map(|(k, (x, y))| ((first + k) as f64, x, y));
    let coefficients: [Complex64; 3] = std::array::from_fn(|term| {
        each().map(|(line, x, y)| x.conj() * y * polynomials[term](line)).sum::<Complex64>() / squares[term]
    });
    let model =
        |line: f64| (0..3).map(|term| coefficients[term] * polynomials[term](line)).sum::<Complex64>();
    let left: f64 = each().map(|(line, x, y)| (y - model(line) * x).norm_sqr()).sum();
    let freedom = 2.0 * (x.len() - polynomials.len()) as f64;
    // Half of the variance is along the response, and half across.
    let share: f64 = (0..3).map(|term| polynomials[term](middle).powi(2) / squares[term]).sum();
    let ratio = model(middle);
    BandResponse {
        frequency_hz: middle * resolution,
        ratio,
        deviation: (left / freedom * share).sqrt() / ratio.portable_norm(),
        freedom,
        power: all / x.len() as f64,
    }
}

//! The spectrum of a record at rest: its density, and the lines that stand out of the noise.

use super::motion::FALSE_ALARMS;
use crate::inspect::spectrum_magnitudes;
use kalmems_core::Portable;

/// The ratio of the middle of a band of the spectrum to its ends, the first bin that is looked at, and samples of one transform at most.
const BAND: f64 = 1.25;
const FIRST_BIN: usize = 33;
pub(super) const LONGEST: usize = 1 << 20;
/// What noise may exceed its expectation by in power, as it is not flat within a band.
const SLOPE: f64 = 4.0;
/// Bins to either side that belong to one line, and lines at most.
const LINE: usize = 4;
const MOST_LINES: usize = 8;
/// The ratio of the ends of a band of the density: four to a factor of two in frequency.
const DENSITY_BAND: f64 = 1.189_207;

/// A line that stands out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RestLine {
    /// In cycles per sample.
    pub frequency: f64,
    /// In the unit of the samples.
    pub amplitude: f64,
}

/// The transform of a stretch of samples.
pub(super) struct RestSpectrum {
    /// The magnitudes of the windowed transform.
    bins: Vec<f64>,
    /// The amplitude of a sine by its magnitude.
    amplitude_of: f64,
    samples: usize,
    variance: f64,
}

impl RestSpectrum {
    /// Of equidistant samples, the first 2²⁰ of more; `None` of too few.
    pub fn of(values: &[f64]) -> Option<Self> {
        let values = &values[..values.len().min(LONGEST)];
        let (bins, amplitude_of) = spectrum_magnitudes(values)?;
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        Some(Self { bins, amplitude_of, samples: values.len(), variance })
    }

    /// The lines that stand out of the median of the bins from 1/1.25 to 1.25 of their frequency, the strongest first: their power is four times what
    /// noise reaches once in 1000 records.
    pub fn lines(&self) -> Vec<RestLine> {
        let bins = &self.bins;
        let last = bins.len().saturating_sub(3);
        let power = SLOPE * (bins.len() as f64 / FALSE_ALARMS).portable_ln() / std::f64::consts::LN_2;
        let mut found: Vec<(usize, f64)> = Vec::new();
        let mut from = FIRST_BIN;
        while from < last {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of bins
            let to = ((from as f64 * BAND * BAND) as usize).min(last);
            let Some(band) = bins.get(from..to) else { break };
            let mut sorted = band.to_vec();
            let middle = sorted.len() / 2;
            let floor = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
            let out = band.iter().enumerate().filter(|(_, bin)| **bin > floor * power.sqrt());
            found.extend(out.map(|(i, bin)| (from + i, *bin)));
            from = to.max(from + 1);
        }
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut lines: Vec<(usize, f64)> = Vec::new();
        for (bin, magnitude) in found {
            if lines.iter().all(|(other, _)| other.abs_diff(bin) > LINE) && lines.len() < MOST_LINES {
                lines.push((bin, magnitude));
            }
        }
        let of = |(bin, magnitude): (usize, f64)| RestLine {
            frequency: bin as f64 / self.samples as f64,
            amplitude: self.amplitude_of * magnitude,
        };
        lines.into_iter().map(of).collect()
    }

    /// The density on either side of the frequency 0 (IEEE Std 952), averaged over bands: frequency in Hz, and the square of the samples' unit per Hz.
    /// Its integral is the variance of the samples.
    pub fn density(&self, interval_s: f64) -> Vec<[f64; 2]> {
        let resolution = (interval_s * self.samples as f64).recip();
        let squares = || self.bins.iter().skip(1).map(|bin| bin * bin);
        let scale = self.variance / (2.0 * resolution * squares().sum::<f64>());
        if !scale.is_finite() {
            return Vec::new();
        }
        let mut density = Vec::new();
        // The window spreads what is below over the first bins.
        let mut from = LINE;
        while from < self.bins.len() {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of bins
            let to = (from as f64 * DENSITY_BAND).ceil() as usize;
            let Some(band) = self.bins.get(from..to.min(self.bins.len())) else { break };
            let mean = band.iter().map(|bin| bin * bin).sum::<f64>() / band.len() as f64;
            let middle = from as f64 + 0.5 * (band.len() as f64 - 1.0);
            density.push([middle * resolution, scale * mean]);
            from = to;
        }
        density
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    /// White noise of standard deviation s has the density s²·τ₀ at all frequencies.
    #[test]
    fn the_density_of_white_noise_is_its_variance_times_the_interval() {
        let mut noise = WhiteNoise::new(4, 0);
        let values: Vec<f64> = (0..65_536).map(|_| 3.0 * noise.sample()).collect();
        let density = RestSpectrum::of(&values).unwrap().density(0.01);
        for [frequency, density] in density.iter().filter(|[frequency, _]| *frequency > 10.0) {
            assert!((density / 0.09 - 1.0).abs() < 0.15, "{frequency} Hz: {density}");
        }
        assert!(density.len() > 30, "{}", density.len());
    }
}

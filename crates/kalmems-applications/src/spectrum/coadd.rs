//! The mean of scans, what noise it has, and how well its lines are known.

use super::grid::WavenumberGrid;
use super::line::{SpectralPeak, line_near};
use serde::Serialize;

/// Parts that are left out in turn.
const PARTS: usize = 12;

/// Spectra of several scans of one light.
#[derive(Clone, Debug)]
pub struct Scans {
    /// Their wavenumbers.
    pub grid: WavenumberGrid,
    /// One spectrum for each.
    pub spectra: Vec<Vec<f64>>,
    /// Whether the mirror went forward in each.
    pub forward: Vec<bool>,
}

/// The noise of the mean of so many scans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoaddedNoise {
    /// How many.
    pub scans: usize,
    /// The root mean square over all wavenumbers, in the unit of the spectrum.
    pub noise: f64,
}

/// A line, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredLine {
    /// Where and how high.
    pub line: SpectralPeak,
    /// The standard errors of both; unknown of a single scan.
    pub standard_error: Option<SpectralPeak>,
}

impl Scans {
    /// The mean of all but the scans of one part: every `PARTS`-th, beginning with this one.
    fn mean_without(&self, part: Option<usize>) -> Vec<f64> {
        let parts = self.parts();
        let used = || {
            let with_index = self.spectra.iter().enumerate();
            with_index.filter(|(index, _)| part.is_none_or(|part| index % parts != part)).map(|(_, s)| s)
        };
        let count = used().count().max(1) as f64;
        let mut mean = vec![0.0; self.grid.points];
        for spectrum in used() {
            for (mean, value) in mean.iter_mut().zip(spectrum) {
                *mean += value / count;
            }
        }
        mean
    }

    fn parts(&self) -> usize {
        self.spectra.len().clamp(1, PARTS)
    }

    /// The mean of all.
    pub fn mean(&self) -> Vec<f64> {
        self.mean_without(None)
    }

    /// The standard error of the mean at each wavenumber, from how the scans differ; `None` of a single one.
    pub fn standard_error(&self) -> Option<Vec<f64>> {
        let n = self.spectra.len();
        if n < 2 {
            return None;
        }
        let mean = self.mean();
        let mut squares = vec![0.0; self.grid.points];
        for spectrum in &self.spectra {
            for ((sum, value), mean) in squares.iter_mut().zip(spectrum).zip(&mean) {
                *sum += (value - mean).powi(2);
            }
        }
        Some(squares.iter().map(|sum| (sum / (n * (n - 1)) as f64).sqrt()).collect())
    }

    /// The noise of the mean of the first scans, for more and more of them.
    ///
    /// Half of the scans are taken with the other sign, of each direction of the mirror as many as with its own: the light
    /// is gone, and what forward and backward scans differ by with it. The noise is what is left.
    pub fn noise(&self) -> Vec<CoaddedNoise> {
        let mut found: Vec<CoaddedNoise> = Vec::new();
        let mut first = 2;
        loop {
            let first_scans = first.min(self.spectra.len());
            if let Some(noise) = self.noise_of(first_scans)
                && found.last().is_none_or(|last| last.scans < noise.scans)
            {
                found.push(noise);
            }
            if first >= self.spectra.len() {
                return found;
            }
            first *= 2;
        }
    }

    fn noise_of(&self, first: usize) -> Option<CoaddedNoise> {
        let mut sum = vec![0.0; self.grid.points];
        let mut scans = 0;
        for direction in [true, false] {
            let of_it: Vec<&Vec<f64>> = (self.spectra.iter().zip(&self.forward).take(first))
                .filter(|(_, forward)| **forward == direction)
                .map(|(spectrum, _)| spectrum)
                .collect();
            for pair in of_it.chunks_exact(2) {
                scans += 2;
                for ((sum, plus), minus) in sum.iter_mut().zip(pair[0]).zip(pair[1]) {
                    *sum += plus - minus;
                }
            }
        }
        let square: f64 = sum.iter().map(|value| value * value).sum();
        let rms = (square / sum.len().max(1) as f64).sqrt();
        (scans > 0).then(|| CoaddedNoise { scans, noise: rms / scans as f64 })
    }

    /// A line of the mean near a wavenumber in 1/m, or a dip where `sign` is −1, with standard errors from leaving out one part of
    /// the scans after the other (the jackknife). `None` where there is none.
    pub fn line(&self, near_per_m: f64, within_per_m: f64, sign: f64) -> Option<MeasuredLine> {
        let wavenumbers = self.grid.wavenumbers();
        let find = |mean: Vec<f64>| {
            let turned: Vec<f64> = mean.iter().map(|value| sign * value).collect();
            let line = line_near(&wavenumbers, &turned, near_per_m, within_per_m)?;
            Some(SpectralPeak { height: sign * line.height, ..line })
        };
        let line = find(self.mean())?;
        let parts = self.parts();
        let found: Vec<SpectralPeak> = if parts < 2 {
            Vec::new()
        } else {
            (0..parts).filter_map(|part| find(self.mean_without(Some(part)))).collect()
        };
        // Where a part decides whether there is a line at all, nothing is known about its error.
        let known = found.len() == parts && parts > 1;
        let standard_error = known.then(|| {
            let error = |of: fn(&SpectralPeak) -> f64| {
                let n = parts as f64;
                let mean = found.iter().map(of).sum::<f64>() / n;
                let square: f64 = found.iter().map(|line| (of(line) - mean).powi(2)).sum();
                (square * (n - 1.0) / n).sqrt()
            };
            SpectralPeak {
                wavenumber_per_m: error(|line| line.wavenumber_per_m),
                height: error(|line| line.height),
            }
        });
        Some(MeasuredLine { line, standard_error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    /// A Gaussian line in white noise: noise falls as 1/√N, and the jackknife knows the spread of line positions over
    /// thirty repetitions.
    #[test]
    fn noise_falls_with_the_root_of_the_scans_and_errors_are_known() {
        let grid = WavenumberGrid { first_per_m: 0.0, step_per_m: 1.0, points: 400 };
        let mut noise = WhiteNoise::new(5, 0);
        let mut one = |count: usize| {
            let spectra = (0..count).map(|_| {
                let clean = |nu: f64| (-((nu - 200.3) / 9.0).powi(2)).exp();
                // As smooth as a spectrum filled up with zeros.
                let white: Vec<f64> = (0..500).map(|_| noise.sample()).collect();
                let smooth = |k: usize| {
                    (0..60).map(|j| white[k + j] * (-((j as f64 - 30.0) / 8.0).powi(2)).exp()).sum::<f64>()
                };
                (0..400).map(|k| clean(grid.wavenumber(k)) + 0.01 * smooth(k)).collect()
            });
            let spectra = spectra.collect();
            Scans { grid, spectra, forward: (0..count).map(|k| k % 2 == 0).collect() }
        };
        let table = one(256).noise();
        assert_eq!(table.iter().map(|n| n.scans).collect::<Vec<_>>(), [4, 8, 16, 32, 64, 128, 256]);
        for entry in &table {
            // 0.01·√Σ e^{−2·(j/8)²}.
            let expected =
                0.01 * (8.0 * (std::f64::consts::PI / 2.0).sqrt()).sqrt() / (entry.scans as f64).sqrt();
            assert!((entry.noise / expected - 1.0).abs() < 0.25, "{entry:?} {expected}");
        }
        let lines: Vec<MeasuredLine> = (0..30).map(|_| one(24).line(200.0, 10.0, 1.0).unwrap()).collect();
        let square = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>() / 30.0;
        let spread = square(&mut lines.iter().map(|l| l.line.wavenumber_per_m - 200.3)).sqrt();
        let told = square(&mut lines.iter().map(|l| l.standard_error.unwrap().wavenumber_per_m)).sqrt();
        assert!((0.65..1.5).contains(&(told / spread)), "{told} {spread}");
        assert!(one(1).line(200.0, 10.0, 1.0).unwrap().standard_error.is_none() && one(1).noise().is_empty());
        assert!(one(2).standard_error().is_some() && one(1).standard_error().is_none());
    }
}

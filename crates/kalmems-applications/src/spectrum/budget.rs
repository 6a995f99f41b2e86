//! What errors of the position do to a spectrum.

use super::coadd::MeasuredLine;
use super::line::SpectralPeak;
use super::process::ProcessedScans;
use crate::config::Quantity;
use crate::spectrum::file::PathErrors;
use kalmems_core::Portable;
use kalmems_core::Scalar;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// One reason why a line is not where, or not as high as, it should be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineErrorContribution {
    /// What it is.
    pub of: Reason,
    /// By how much the line is shifted for certain, in 1/m.
    pub shift_per_m: f64,
    /// The standard deviation of what it may be shifted by, in 1/m.
    pub sd_per_m: f64,
    /// What is left of the line's height, at one standard deviation.
    pub height: f64,
}

/// Why a line is shifted or lowered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The scans differ: noise of the detector and of the positions, as measured.
    Scatter,
    /// Errors of positions that are independent from sample to sample lower lines and add noise.
    Position,
    /// All path differences are too long by one share.
    Scale,
    /// The position is that of another moment. The error of the path is the speed times it: opposite in forward and backward
    /// scans, and even in the path within each, so that lines lose height and stay in place.
    Delay,
    /// The same, growing with the time from the start. Within a scan it grows as the path does: a scale as well.
    ClockSkew,
    /// Light that fills a cone goes α²/4 of the path less on the mean.
    Divergence,
}

impl Reason {
    /// For a table.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Scatter => "scatter of the scans",
            Self::Position => "position, sample by sample",
            Self::Scale => "scale of positions",
            Self::Delay => "delay of the detector",
            Self::ClockSkew => "clock skew",
            Self::Divergence => "divergence of the beam",
        }
    }
}

/// The contributions to the error of a line's wavenumber that something is known about.
pub fn budget(
    errors: Option<&PathErrors>,
    processed: &ProcessedScans,
    line: Option<MeasuredLine>,
) -> Vec<LineErrorContribution> {
    let Some(MeasuredLine { line, standard_error }) = line else { return Vec::new() };
    let nu = line.wavenumber_per_m;
    let entry =
        |of, shift_per_m, sd_per_m, height| LineErrorContribution { of, shift_per_m, sd_per_m, height };
    let mut found = Vec::new();
    if let Some(error) = standard_error {
        found.push(entry(Reason::Scatter, 0.0, error.wavenumber_per_m, 1.0));
    }
    let Some(errors) = errors else { return found };
    if let Some(sd) = &errors.position_sd {
        let of_mirror = sd.si() * processed.path_per_position / 2.0;
        found.push(entry(Reason::Position, 0.0, 0.0, line_height(nu, of_mirror)));
    }
    if let Some(sd) = &errors.scale_sd {
        found.push(entry(Reason::Scale, 0.0, line_shift(nu, sd.si()).abs(), 1.0));
    }
    if let Some(sd) = &errors.delay_sd {
        found.push(entry(Reason::Delay, 0.0, 0.0, height_by_time_errors(processed, nu, |_| sd.si())));
    }
    if let Some(skew) = &errors.clock_skew {
        let height = height_by_time_errors(processed, nu, |time_s| skew.si() * time_s);
        found.push(entry(Reason::ClockSkew, 0.0, line_shift(nu, skew.si()).abs(), height));
    }
    if let Some(angle) = errors.half_angle.as_ref().map(Quantity::si) {
        // From the axis to the edge of the cone a path differs by x·α²/2; its mean over the cone has a sinc for contrast.
        let contrast = PI * nu * processed.largest_m * angle.powi(2) / 2.0;
        let height = if contrast == 0.0 { 1.0 } else { Scalar::sin(contrast) / contrast };
        found.push(entry(Reason::Divergence, -nu * angle.powi(2) / 4.0, 0.0, height));
    }
    found
}

/// Wavenumbers at which what is left of a line is computed from all samples; between them it varies slowly.
const NODES: usize = 33;

/// What the stated errors of the path may be wrong by at each wavenumber of a spectrum, in its unit: the root of the sum of the squares of all
/// [contributions](LineErrorContribution), each as the shift of a line there times the slope of the spectrum and as what is lost of its height. `None`
/// where no error is stated.
///
/// It is the same in all scans, and no number of scans makes it smaller.
pub fn systematic_error(
    errors: Option<&PathErrors>,
    processed: &ProcessedScans,
    spectrum: &[f64],
) -> Option<Vec<f64>> {
    let errors = errors?;
    let grid = processed.scans.grid;
    let last = grid.points.checked_sub(1)?;
    let nodes: Vec<Vec<[f64; 2]>> = (0..NODES)
        .map(|node| {
            let place = last as f64 * node as f64 / (NODES - 1) as f64;
            let line =
                SpectralPeak { wavenumber_per_m: grid.first_per_m + grid.step_per_m * place, height: 1.0 };
            let contributions =
                budget(Some(errors), processed, Some(MeasuredLine { line, standard_error: None }));
            contributions
                .iter()
                .map(|one| [one.shift_per_m.portable_hypot(one.sd_per_m), 1.0 - one.height])
                .collect()
        })
        .collect();
    let at = |index: usize| -> f64 {
        let slope = match (index.checked_sub(1), spectrum.get(index + 1)) {
            (Some(before), Some(after)) => (after - spectrum[before]) / (2.0 * grid.step_per_m),
            _ => 0.0,
        };
        let place = (NODES - 1) as f64 * index as f64 / last.max(1) as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a node
        let node = (place as usize).min(NODES - 2);
        let part = place - node as f64;
        let square = nodes[node].iter().zip(&nodes[node + 1]).map(|(a, b)| {
            let [shift, loss] = [0, 1].map(|i| a[i] + part * (b[i] - a[i]));
            (shift * slope).powi(2) + (loss * spectrum[index]).powi(2)
        });
        square.sum::<f64>().sqrt()
    };
    Some((0..spectrum.len()).map(at).collect())
}

/// What is left of a line's height where each sample's position is that of another moment: |Σ w·e^{i·2π·ν·v·δt}|/Σ w over the
/// samples, with their speeds v of the path and their weights.
fn height_by_time_errors(
    processed: &ProcessedScans,
    wavenumber_per_m: f64,
    error_s: impl Fn(f64) -> f64,
) -> f64 {
    let (mut cosine, mut sine, mut total) = (0.0, 0.0, 0.0);
    for sample in &processed.samples {
        let angle = TAU * wavenumber_per_m * sample.speed_m_per_s * error_s(sample.time_s);
        cosine += sample.weight * Scalar::cos(angle);
        sine += sample.weight * Scalar::sin(angle);
        total += sample.weight;
    }
    if total > 0.0 { cosine.portable_hypot(sine) / total } else { 1.0 }
}

/// The largest wavenumber in 1/m that a detector sampled at a rate in Hz can see while the mirror moves at a speed in
/// m/s: the path changes by twice that, and a wavenumber ν makes ν times that speed in Hz.
///
/// ```
/// use kalmems_applications::spectrum::detector_limit;
/// // 0.5 mm at 500 Hz, sampled at 194 kHz: 309 per cm.
/// let speed = 2.0 * std::f64::consts::PI * 500.0 * 0.5e-3;
/// assert!((detector_limit(194e3, speed) / 100.0 - 309.0).abs() < 0.5);
/// ```
pub fn detector_limit(sampling_rate_hz: f64, mirror_speed_m_per_s: f64) -> f64 {
    sampling_rate_hz / (4.0 * mirror_speed_m_per_s)
}

/// What is left of a line's height at a wavenumber in 1/m when the mirror's position has white errors of a standard
/// deviation in m: exp(−(4π·ν·σ)²/2).
pub fn line_height(wavenumber_per_m: f64, position_sd_m: f64) -> f64 {
    (-0.5 * (4.0 * PI * wavenumber_per_m * position_sd_m).powi(2)).portable_exp()
}

/// How far a line at a wavenumber in 1/m is shifted, in 1/m, when the amplitude of the motion is taken δA too large
/// relative to it: every path difference is too long by that share, and the wavenumber too small.
pub fn line_shift(wavenumber_per_m: f64, relative_amplitude_error: f64) -> f64 {
    -wavenumber_per_m * relative_amplitude_error
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use crate::spectrum::{Apodisation, Scans, WavenumberGrid, line_near, path_weights, spectrum_at};
    use std::f64::consts::TAU;

    /// Against spectra that are computed with such errors.
    #[test]
    fn heights_and_shifts_are_those_of_computed_spectra() {
        let (largest, line, n) = (1e-3, 200e3, 20_000_i32);
        let x: Vec<f64> = (-n..=n).map(|k| largest * f64::from(k) / f64::from(n)).collect();
        let y: Vec<f64> = x.iter().map(|x| (TAU * line * x).cos()).collect();
        let settings = (Apodisation::Triangular, largest);
        let grid: Vec<f64> = (0..201).map(|i| line - 500.0 + 5.0 * f64::from(i)).collect();
        let found = |positions: &[f64]| {
            let weights = path_weights(&x);
            let values: Vec<f64> =
                grid.iter().map(|nu| spectrum_at(*nu, positions, (&y, &weights), settings).re).collect();
            line_near(&grid, &values, line, 400.0).unwrap()
        };
        let ideal = found(&x);
        let mut noise = WhiteNoise::new(3, 0);
        let sd = 150e-9;
        let shaken: Vec<f64> = x.iter().map(|x| x + 2.0 * sd * noise.sample()).collect();
        let left = found(&shaken).height / ideal.height;
        assert!((left - line_height(line, sd)).abs() < 0.01, "{left} {}", line_height(line, sd));
        let longer: Vec<f64> = x.iter().map(|x| x * (1.0 + 5e-4)).collect();
        let shift = found(&longer).wavenumber_per_m - ideal.wavenumber_per_m;
        assert!((shift - line_shift(line, 5e-4)).abs() < 0.2, "{shift}");
    }

    /// Of a band with a dip, against spectra along paths that are too long by a share and along paths that are shaken.
    #[test]
    fn the_error_at_each_wavenumber_is_that_of_computed_spectra() {
        let (largest, n) = (0.4e-3, 4_000_i32);
        let lights: Vec<f64> = (0..600).map(|i| 150e3 + 160.0 * f64::from(i)).collect();
        let light = |nu: f64| {
            let band = (-((nu - 200e3) / 15e3).powi(2)).exp();
            band * (1.0 - 0.5 * (-((nu - 205e3) / 3e3).powi(2)).exp())
        };
        let x: Vec<f64> = (-n..=n).map(|k| largest * f64::from(k) / f64::from(n)).collect();
        let y: Vec<f64> =
            x.iter().map(|x| lights.iter().map(|nu| light(*nu) * (TAU * nu * x).cos()).sum()).collect();
        let settings = (Apodisation::NortonBeerMedium, largest);
        let grid = WavenumberGrid { first_per_m: 160e3, step_per_m: 400.0, points: 200 };
        let weights = path_weights(&x);
        let along = |path: &[f64]| -> Vec<f64> {
            grid.wavenumbers().iter().map(|nu| spectrum_at(*nu, path, (&y, &weights), settings).re).collect()
        };
        let ideal = along(&x);
        let processed = ProcessedScans {
            scans: Scans { grid, spectra: vec![ideal.clone()], forward: vec![true] },
            counts: None,
            zero_m: None,
            misregistration_m: Vec::new(),
            phases: Vec::new(),
            inverted: false,
            path_per_position: 2.0,
            largest_m: largest,
            limit_per_m: 0.0,
            interferogram: Vec::new(),
            samples: Vec::new(),
        };
        let claimed = |errors: &str| {
            let errors: PathErrors = toml::from_str(errors).unwrap();
            systematic_error(Some(&errors), &processed, &ideal).unwrap()
        };
        let rms = |values: &mut dyn Iterator<Item = f64>| (values.map(|v| v * v).sum::<f64>() / 200.0).sqrt();
        let of = |found: &[f64]| rms(&mut found.iter().zip(&ideal).map(|(a, b)| a - b));
        // A share of the path: the shift of each wavenumber.
        let longer: Vec<f64> = x.iter().map(|x| x * (1.0 + 2e-4)).collect();
        let (seen, told) = (of(&along(&longer)), rms(&mut claimed("scale_sd = \"0.02 %\"").into_iter()));
        assert!((told / seen - 1.0).abs() < 0.05, "{told} {seen}");
        // White errors of the mirror's position, the mean of many: what is lost of the height.
        let mut noise = WhiteNoise::new(9, 0);
        let mut mean = vec![0.0; 200];
        for _ in 0..60 {
            let shaken: Vec<f64> = x.iter().map(|x| x + 2.0 * 150e-9 * noise.sample()).collect();
            mean.iter_mut().zip(along(&shaken)).for_each(|(sum, value)| *sum += value / 60.0);
        }
        let (seen, told) = (of(&mean), rms(&mut claimed("position_sd = \"150 nm\"").into_iter()));
        assert!((told / seen - 1.0).abs() < 0.1, "{told} {seen}");
        assert!(systematic_error(None, &processed, &ideal).is_none());
    }
}

//! The spectrum of an interferogram with samples at equal path differences.

use super::Apodisation;
use crate::signal::{PortableComplex, fourier_transform};
use realfft::num_complex::Complex64;

/// A spectrum at equal steps of the wavenumber, from 0 on.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// The step in 1/m.
    pub step_per_m: f64,
    /// Σ y·w·e^{−i·2π·ν·x}·Δx in the interferogram's unit times m: twice that is the density of what a double-sided
    /// interferogram was made of.
    pub values: Vec<Complex64>,
}

/// Why there is none.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TransformError {
    /// The interferogram does not hold its zero path difference.
    #[error(
        "the zero path difference is at sample {zero_path}, and there are {samples}; give the index of one of them, from 0"
    )]
    NoZeroPath {
        /// The index that was given.
        zero_path: usize,
        /// How many samples there are.
        samples: usize,
    },
    /// A sample within the wanted path differences is missing.
    #[error(
        "sample {sample} is not a finite number; a gap cannot be transformed: cut the interferogram before it"
    )]
    Missing {
        /// The sample.
        sample: usize,
    },
    /// The step or the largest path difference is no positive number.
    #[error(
        "found a step of {step_m} m and a largest path difference of {largest_m} m; both must be above 0"
    )]
    NoLength {
        /// The step.
        step_m: f64,
        /// The largest path difference.
        largest_m: f64,
    },
    /// The transform has fewer points than samples would go into it.
    #[error("{used} samples do not fit into a transform of {points} points; give at least {used}")]
    TooFewPoints {
        /// Samples within the largest path difference.
        used: usize,
        /// The points.
        points: usize,
    },
}

impl Spectrum {
    /// Wavenumber in 1/m of an entry.
    pub fn wavenumber(&self, index: usize) -> f64 {
        self.step_per_m * index as f64
    }

    /// The magnitudes, which need no phase: the power spectrum's root.
    pub fn magnitudes(&self) -> Vec<f64> {
        self.values.iter().map(|value| value.portable_norm()).collect()
    }
}

/// Transforms the samples up to the path difference `largest_m` on both sides of the zero path, less their mean,
/// weighted and filled up with zeros to `points`.
pub fn transform(
    interferogram: &[f64],
    zero_path: usize,
    step_m: f64,
    (apodisation, largest_m): (Apodisation, f64),
    points: usize,
) -> Result<Spectrum, TransformError> {
    let reach = reach(interferogram, zero_path, step_m, largest_m)?;
    let (before, after) = (reach.min(zero_path), reach.min(interferogram.len() - 1 - zero_path));
    let weight = |offset: f64| apodisation.weight(offset * step_m / largest_m);
    weighted_transform(interferogram, zero_path, step_m, (before, after), points, weight)
}

/// How many samples the largest path difference is, checked.
pub(super) fn reach(
    interferogram: &[f64],
    zero_path: usize,
    step_m: f64,
    largest_m: f64,
) -> Result<usize, TransformError> {
    if zero_path >= interferogram.len() {
        return Err(TransformError::NoZeroPath { zero_path, samples: interferogram.len() });
    }
    let usable = |length: f64| length > 0.0 && length.is_finite();
    if !(usable(step_m) && usable(largest_m)) {
        return Err(TransformError::NoLength { step_m, largest_m });
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive; beyond the end is the end
    let reach = (largest_m / step_m * (1.0 + 1e-12)).floor() as usize;
    Ok(reach)
}

/// Transforms `before` samples in front of the zero path and `after` behind it, each times the weight of its place in
/// samples from there, the zero path at the phase 0.
pub(super) fn weighted_transform(
    interferogram: &[f64],
    zero_path: usize,
    step_m: f64,
    (before, after): (usize, usize),
    points: usize,
    weight: impl Fn(f64) -> f64,
) -> Result<Spectrum, TransformError> {
    let first = zero_path - before;
    let used = &interferogram[first..=zero_path + after];
    if let Some(missing) = used.iter().position(|y| !y.is_finite()) {
        return Err(TransformError::Missing { sample: first + missing });
    }
    if used.len() > points {
        return Err(TransformError::TooFewPoints { used: used.len(), points });
    }
    let mean = used.iter().sum::<f64>() / used.len() as f64;
    let mut input = vec![0.0; points];
    for offset in 0..=after {
        input[offset] = (interferogram[zero_path + offset] - mean) * weight(offset as f64);
    }
    for offset in 1..=before {
        input[points - offset] = (interferogram[zero_path - offset] - mean) * weight(-(offset as f64));
    }
    let mut values = fourier_transform(&mut input);
    for value in &mut values {
        *value *= step_m;
    }
    Ok(Spectrum { step_per_m: (points as f64 * step_m).recip(), values })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A line on a whole number of cycles: with a boxcar L·sinc on it, and the dip between two lines 1/L apart.
    #[test]
    fn a_line_has_the_shape_of_its_weight() {
        let (step, half) = (1e-6, 1000_usize);
        let largest = step * half as f64;
        let line = 200e3;
        let y: Vec<f64> =
            (0..=2 * half).map(|k| (2.0 * PI * line * step * (k as f64 - half as f64)).cos()).collect();
        let points = 1 << 16;
        let found = transform(&y, half, step, (Apodisation::Triangular, largest), points).unwrap();
        assert_eq!(found.values.len(), points / 2 + 1);
        for index in [12_000, 13_000, 13_107, 13_150, 13_200] {
            let off = (found.wavenumber(index) - line) * largest;
            let expected =
                largest / 2.0 * if off == 0.0 { 1.0 } else { ((PI * off).sin() / (PI * off)).powi(2) };
            assert!((found.values[index].re - expected).abs() < 2e-3 * largest, "{index}");
            assert!(found.values[index].im.abs() < 1e-12 * largest);
        }
        let error = |y: &[f64], zero, largest, points| {
            transform(y, zero, step, (Apodisation::Boxcar, largest), points).unwrap_err()
        };
        assert!(matches!(error(&y, 9999, largest, points), TransformError::NoZeroPath { .. }));
        assert!(matches!(error(&y, half, -1.0, points), TransformError::NoLength { .. }));
        assert!(matches!(error(&y, half, largest, 64), TransformError::TooFewPoints { used: 2001, .. }));
        let mut broken = y.clone();
        broken[7] = f64::NAN;
        assert_eq!(error(&broken, half, largest, points), TransformError::Missing { sample: 7 });
    }
}

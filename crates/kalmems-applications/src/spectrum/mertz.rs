//! Phase correction of an interferogram that is longer on one side.

use super::transform::{reach, weighted_transform};
use super::{Apodisation, Spectrum, TransformError};
use crate::signal::PortableComplex;
use realfft::num_complex::Complex64;

/// Why there is no corrected spectrum.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MertzError {
    /// It cannot be transformed at all.
    #[error(transparent)]
    Transform(#[from] TransformError),
    /// There are too few samples on the short side to know the phase.
    #[error(
        "the short side of the interferogram has {found} samples; expected at least {MINIMUM}, or the phase is unknown"
    )]
    ShortSide {
        /// Samples on it.
        found: usize,
    },
}

/// The fewest samples on the short side.
const MINIMUM: usize = 16;

/// The spectrum of an interferogram whose short side lies in front of the zero path, and what tells its phase.
#[derive(Clone, Debug)]
pub struct OneSided {
    /// The spectrum with its phase. It is of the size of those of [`transform`](super::transform) on a double-sided interferogram.
    pub fine: Spectrum,
    /// The spectrum of the double-sided part about the zero path, at the same wavenumbers, with less resolution.
    pub coarse: Vec<Complex64>,
}

/// The spectrum of an interferogram whose short side lies in front of the zero path, with the double-sided part from which its phase is
/// taken (Mertz, Infrared Physics 7, 17, 1967).
///
/// In the double-sided part, which is there twice, the weight is a ramp from 0 to 1, so that both sides together count once.
pub fn one_sided(
    interferogram: &[f64],
    zero_path: usize,
    step_m: f64,
    (apodisation, largest_m): (Apodisation, f64),
    points: usize,
) -> Result<OneSided, MertzError> {
    let reach = reach(interferogram, zero_path, step_m, largest_m)?;
    let after = reach.min(interferogram.len() - 1 - zero_path);
    let short = zero_path.min(after);
    if short < MINIMUM {
        return Err(MertzError::ShortSide { found: short });
    }
    let narrow = |place: f64| Apodisation::BlackmanHarris3.weight(place / short as f64);
    let coarse = weighted_transform(interferogram, zero_path, step_m, (short, short), points, narrow)?;
    let centre = centre(interferogram, zero_path, short, narrow);
    let reach = short as f64 - centre.abs();
    let fine = weighted_transform(interferogram, zero_path, step_m, (short, after), points, |place| {
        let ramp = (1.0 + (place - centre) / reach).clamp(0.0, 2.0);
        ramp * apodisation.weight((place - centre) * step_m / largest_m)
    })?;
    Ok(OneSided { fine, coarse: coarse.values })
}

/// The real spectrum of values with a phase that is told by others: Re S·C*/|C|.
///
/// The phase must vary slowly with the wavenumber, as it is seen with less resolution. Where C is that of S itself, or has its noise, noise is
/// turned towards positive values, by a share that falls with the resolution of C: the phase of several scans is to be taken from their mean.
pub fn without_phase(fine: &[Complex64], coarse: &[Complex64]) -> Vec<f64> {
    let one = |(fine, coarse): (&Complex64, &Complex64)| {
        let size = coarse.portable_norm();
        // Where there is no light there is no phase, and nothing to correct.
        if size > 0.0 { (fine * coarse.conj()).re / size } else { fine.re }
    };
    fine.iter().zip(coarse).map(one).collect()
}

/// The real spectrum of a single interferogram whose short side lies in front of the zero path, its phase removed by its own double-sided
/// part: [`one_sided`] and [`without_phase`].
pub fn mertz(
    interferogram: &[f64],
    zero_path: usize,
    step_m: f64,
    end: (Apodisation, f64),
    points: usize,
) -> Result<(Spectrum, Vec<f64>), MertzError> {
    let OneSided { fine, coarse } = one_sided(interferogram, zero_path, step_m, end, points)?;
    let corrected = without_phase(&fine.values, &coarse);
    Ok((fine, corrected))
}

/// Where the light is about the zero path, in samples from there: the mean of the places by the squared signal, which is
/// the mean group delay of its spectrum. The ramp has its 1 there; one sample off would be its slope off in height.
fn centre(interferogram: &[f64], zero_path: usize, short: usize, weight: impl Fn(f64) -> f64) -> f64 {
    let part = &interferogram[zero_path - short..=zero_path + short];
    let mean = part.iter().sum::<f64>() / part.len() as f64;
    let (mut moment, mut total) = (0.0, 0.0);
    for (k, y) in part.iter().enumerate() {
        let place = k as f64 - short as f64;
        let square = ((y - mean) * weight(place)).powi(2);
        moment += place * square;
        total += square;
    }
    if total > 0.0 { moment / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{transform, zero_path};
    use std::f64::consts::PI;

    /// A band with a line in it, seen through a beam splitter whose phase depends on the wavenumber; one side
    /// eight times as long as the other.
    #[test]
    fn a_dispersive_one_sided_interferogram_gives_the_spectrum_of_a_symmetric_one() {
        let (step, long, short) = (3e-6, 4000_usize, 500_usize);
        let largest = step * long as f64;
        // Wavenumbers of 300 to 1300 per cm, so dense that their beat comes back at 30 mm, beyond the 12 mm used.
        let grid: Vec<f64> = (0..3000).map(|i| 30e3 + 1e5 * f64::from(i) / 3000.0).collect();
        let light = |nu: f64| {
            let band = (-((nu - 80e3) / 18e3).powi(2)).exp();
            band * (1.0 - 0.4 * (-((nu - 90e3) / 0.4e3).powi(2)).exp())
        };
        let phase = |nu: f64| 0.4 + 1.1 * ((nu - 80e3) / 5e4) - 0.6 * ((nu - 80e3) / 5e4).powi(2);
        let make = |dispersive: bool, before: usize| -> Vec<f64> {
            let each = |k: i64| -> f64 {
                let x = step * k as f64;
                let angle = |nu: f64| 2.0 * PI * nu * x + if dispersive { phase(nu) } else { 0.0 };
                grid.iter().map(|nu| light(*nu) * angle(*nu).cos()).sum::<f64>() + 7.0
            };
            (-i64::try_from(before).unwrap()..=i64::try_from(long).unwrap()).map(each).collect()
        };
        let settings = (Apodisation::NortonBeerMedium, largest);
        let points = 16_384;
        let ideal = transform(&make(false, long), long, step, settings, points).unwrap();
        let dispersive = make(true, short);
        let centre = zero_path(&dispersive).unwrap();
        let (_, found) = mertz(&dispersive, centre, step, settings, points).unwrap();
        let peak = ideal.values.iter().map(|v| v.re).fold(0.0, f64::max);
        let mut worst = 0.0_f64;
        for (index, (ideal, found)) in ideal.values.iter().zip(&found).enumerate() {
            let nu = index as f64 / (points as f64 * step);
            if (45e3..115e3).contains(&nu) {
                worst = worst.max((ideal.re - found).abs() / peak);
            }
        }
        assert!(worst < 1e-3, "{worst}");
        let too_short = mertz(&make(true, 10), 10, step, settings, points);
        assert_eq!(too_short.unwrap_err(), MertzError::ShortSide { found: 10 });
    }
}

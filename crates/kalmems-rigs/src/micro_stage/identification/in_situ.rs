//! Gaps by trusted gains, or gains by trusted gaps, without a vibrometer; and what the errors of the trusted numbers make of them.

use super::gaps::alone;
use super::waveform::{ELECTRODES, ElectrodeUnknowns, UNKNOWNS, WaveRecord, Waveforms, unknown, weighted};
use crate::config::{Direction, TrustedNumber};
use crate::fit::{DerivedNumber, Fit, FitError};
use kalmems_models::capacitance::TiltingPlate;

/// Gaps or gains without a vibrometer.
#[derive(Clone, Debug)]
pub struct InSitu {
    /// Gap in m and gain in V·Ω of each electrode; what was trusted has no standard error.
    pub electrodes: Vec<[DerivedNumber; 2]>,
    /// The covariance of the errors of what was found, by electrodes: the motion, which they share, is found with them.
    pub covariance: Vec<Vec<f64>>,
    /// The amplitude of the angle in rad in each record.
    pub amplitudes: Vec<DerivedNumber>,
}

/// The gaps where the gains are trusted, or the gains where the gaps are, from the signals alone: after a change of
/// temperature, say, that moved the plates and not the amplifiers.
///
/// Each record is fitted with the size of its own motion; the electrodes share it. The results are their means, weighted.
pub fn in_situ(
    plates: &[TiltingPlate<f64>],
    gains: &[f64],
    noise: &[f64],
    records: &[WaveRecord],
    trusted: TrustedNumber,
    feedthrough: bool,
) -> Result<InSitu, FitError> {
    let is_gain = trusted == TrustedNumber::Gain;
    let mut fits = Vec::new();
    let mut amplitudes = Vec::new();
    for record in records {
        let one = [record.clone()];
        let waveforms = Waveforms {
            unknowns: if is_gain { ElectrodeUnknowns::Gaps } else { ElectrodeUnknowns::Gains },
            ..alone(plates, gains, noise, &one, feedthrough)
        };
        let fit = waveforms.fit()?;
        amplitudes.push(fit.derived(|p| p[unknown::SCALE] * record.angle.amplitude));
        fits.push(fit);
    }
    let index = |i: usize| if is_gain { unknown::gap(i) } else { unknown::gain(i) };
    let count = plates.len().min(ELECTRODES);
    let electrodes = (0..count).map(|i| {
        let index = index(i);
        let each: Vec<DerivedNumber> = fits.iter().map(|fit| fit.parameter(index)).collect();
        let found = weighted(&each).unwrap_or(DerivedNumber { value: f64::NAN, deviation: f64::INFINITY });
        let known = |value: f64| DerivedNumber { value, deviation: 0.0 };
        if is_gain { [found, known(gains[i])] } else { [known(plates[i].gap), found] }
    });
    // Weighted means of numbers that hang together within each record.
    let weight = |fit: &Fit<UNKNOWNS>, i: usize| fit.parameter(index(i)).deviation.powi(-2);
    let sum = |i: usize| fits.iter().map(|fit| weight(fit, i)).sum::<f64>();
    let between = |i: usize, j: usize| {
        let of =
            |fit: &Fit<UNKNOWNS>| weight(fit, i) * weight(fit, j) * fit.covariance.get(index(i), index(j));
        fits.iter().map(of).sum::<f64>() / (sum(i) * sum(j))
    };
    let covariance = (0..count).map(|i| (0..count).map(|j| between(i, j)).collect()).collect();
    Ok(InSitu { electrodes: electrodes.collect(), covariance, amplitudes })
}

/// What is known where gaps or gains are found in place.
pub struct InSituKnowledge<'a> {
    /// The variances of the electrodes' samples in V².
    pub noise: &'a [f64],
    /// The records.
    pub records: &'a [WaveRecord],
    /// Which number of each electrode is trusted.
    pub trusted: TrustedNumber,
    /// Whether feedthrough is found from the harmonics.
    pub feedthrough: bool,
}

impl InSituKnowledge<'_> {
    fn found(&self, plates: &[TiltingPlate<f64>], gains: &[f64]) -> Result<InSitu, FitError> {
        in_situ(plates, gains, self.noise, self.records, self.trusted, self.feedthrough)
    }

    /// What was found, with the covariance of the errors of gap and gain of each electrode, in this order: those of noise, and those that
    /// the stated errors of the trusted numbers make, which move what is found by differences along each of their directions.
    pub fn with_stated_errors(
        &self,
        (plates, gains): (&[TiltingPlate<f64>], &[f64]),
        (names, directions): (&[&str], &[Direction]),
    ) -> Result<(InSitu, Vec<Vec<f64>>), FitError> {
        let found = self.found(plates, gains)?;
        let (trusted, unknown, number) = match self.trusted {
            TrustedNumber::Gap => (0, 1, "gap"),
            TrustedNumber::Gain => (1, 0, "gain"),
        };
        let count = 2 * found.electrodes.len();
        let mut covariance = vec![vec![0.0; count]; count];
        for (i, row) in found.covariance.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                covariance[2 * i + unknown][2 * j + unknown] = *value;
            }
        }
        for direction in directions {
            let (mut plates, mut gains, mut moved) = (plates.to_vec(), gains.to_vec(), vec![0.0; count]);
            for (place, name) in names.iter().enumerate().take(found.electrodes.len()) {
                let key = format!("electrodes.{name}.{number}");
                let Some((_, step)) = direction.steps.iter().find(|(of, _)| of.name == key) else { continue };
                match self.trusted {
                    TrustedNumber::Gap => plates[place].gap += step,
                    TrustedNumber::Gain => gains[place] += step,
                }
                moved[2 * place + trusted] = *step;
            }
            if moved.iter().all(|step| *step == 0.0) {
                continue;
            }
            let other = self.found(&plates, &gains)?;
            for (place, (own, other)) in found.electrodes.iter().zip(&other.electrodes).enumerate() {
                moved[2 * place + unknown] = other[unknown].value - own[unknown].value;
            }
            for (row, by) in covariance.iter_mut().zip(&moved) {
                row.iter_mut().zip(&moved).for_each(|(entry, other)| *entry += by * other);
            }
        }
        Ok((found, covariance))
    }
}

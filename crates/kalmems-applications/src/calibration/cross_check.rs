//! The uncertainties of a calibration by trials: each draws all inputs, fits K again, and applies what is common to it.

use super::calibrate::DirectionEffects;
use super::error::CalibrationError;
use super::file::MonteCarlo;
use super::inputs::{CommonInputs, FittedNumber, PROBABILITY};
use super::matrix::{CalibrationMatrix, RatePair};
use super::outcome::{CrossCheck, UncertainEstimate};
use super::tone::AXES;
use crate::metrology::{
    Combined, Distribution, Input, PropagationComparison, chi_by_freedom, compared, correlated_normals,
    propagated, shared_error,
};
use crate::progress::Progress;
use crate::recording::ReadError;
use crate::simulate::WhiteNoise;
use realfft::num_complex::Complex64;

/// A number for each entry of K that is known.
type MatrixOf<T> = [[Option<T>; 3]; 3];

/// The inputs of one condition by one reference.
pub(super) struct Trials<'a> {
    pub pairs: &'a [RatePair],
    pub moved: &'a DirectionEffects,
    pub axes_of_reference: [bool; 3],
    pub inputs: &'a CommonInputs,
}

impl Trials<'_> {
    /// Draws until the intervals are accurate, and sets them beside those of the estimates.
    pub fn cross_check(
        &self,
        settings: &MonteCarlo,
        main: usize,
        (fitted, entries): (&MatrixOf<FittedNumber>, &MatrixOf<UncertainEstimate>),
        progress: &dyn Progress,
    ) -> Result<CrossCheck, CalibrationError> {
        let mut known: Vec<(usize, usize, UncertainEstimate)> = Vec::new();
        for (i, row) in entries.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                known.extend(entry.map(|entry| (i, j, entry)));
            }
        }
        let trial = |noise: &mut WhiteNoise| {
            let matrix = self.trial(main, fitted, noise)?;
            Some(known.iter().map(|(i, j, _)| matrix[*i][*j]).collect())
        };
        progress.begin("trials", settings.trials as u64);
        let mut heard = |done: usize| progress.reached(done as u64);
        let found =
            propagated((known.len(), settings.trials, PROBABILITY), settings.seed, &trial, &mut heard);
        let Some(found) = found else {
            return Err(match progress.reached(0) {
                std::ops::ControlFlow::Break(()) => {
                    CalibrationError::Read(ReadError::Interrupted { file: "the trials".into() })
                }
                std::ops::ControlFlow::Continue(()) => CalibrationError::Trials,
            });
        };
        let mut scale_factor = None;
        let (mut others, mut disagreements) = (Vec::new(), Vec::new());
        for ((i, j, entry), found) in known.iter().zip(found) {
            let combined = Combined::of(entry.uncertainty, entry.degrees_of_freedom, PROBABILITY);
            let comparison = compared(entry.value, &combined, found);
            let name = format!("k_{}{}", AXES[*i], AXES[*j]);
            let fitted = fitted[*i][*j].as_ref();
            disagreements.extend(self.disagreement(&name, (fitted, entry), &comparison));
            if (*i, *j) == (main, main) {
                scale_factor = Some(comparison);
            } else {
                others.push((name, comparison));
            }
        }
        let scale_factor = scale_factor.ok_or(CalibrationError::Trials)?;
        Ok(CrossCheck { scale_factor, entries: others, disagreements })
    }

    /// Where both intervals part, and the input whose distribution is the likely reason.
    fn disagreement(
        &self,
        name: &str,
        (fitted, entry): (Option<&FittedNumber>, &UncertainEstimate),
        found: &PropagationComparison,
    ) -> Option<String> {
        if found.agrees {
            return None;
        }
        let (common, _) = self.inputs.common();
        let is_normal =
            |input: &&Input| input.distribution == Distribution::Normal && input.degrees_of_freedom > 1e6;
        let others = common.iter().chain(self.inputs.alignment()).filter(|input| !is_normal(input));
        let size = |input: &Input| (input.contribution() * entry.value).abs().max(input.standard_uncertainty);
        let reason = match others.max_by(|a, b| size(a).total_cmp(&size(b))) {
            Some(input) if input.distribution == Distribution::Normal => {
                format!("`{}` has {:.1} degrees of freedom", input.name, input.degrees_of_freedom)
            }
            Some(input) => format!(
                "`{}` is {}, and no sum of many makes it normal",
                input.name,
                input.distribution.name()
            ),
            None => match fitted.and_then(|fitted| self.inputs.repeatability(fitted)) {
                Some(known) => {
                    format!("the repeatability of the records has {:.1} degrees of freedom", known.freedom)
                }
                None => "the model is not linear over them".to_owned(),
            },
        };
        let [low, high] = found.propagated.interval;
        Some(format!(
            "{name}: trials (JCGM 101) put 95 % between {low:.7} and {high:.7}, the expanded uncertainty between {:.7} and {:.7}: they differ by \
             {:.1e} and {:.1e}, where {:.1e} are tolerated; {reason}; the trials' interval is stated",
            entry.interval[0], entry.interval[1], found.differences[0], found.differences[1], found.tolerance
        ))
    }

    /// K of one trial; `None` where it cannot be fitted.
    fn trial(
        &self,
        main: usize,
        fitted: &[[Option<FittedNumber>; 3]; 3],
        noise: &mut WhiteNoise,
    ) -> Option<[[f64; 3]; 3]> {
        // What an entry scatters from record to record has the noise in it.
        let scattered: [[Option<f64>; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let known = self.inputs.repeatability(fitted[i][j].as_ref()?)?;
                Some(known.uncertainty * noise.sample() / chi_by_freedom(known.freedom, noise))
            })
        });
        let mut pairs = self.pairs.to_vec();
        for pair in &mut pairs {
            let mut noisy = |phasor: Complex64, size: f64| {
                phasor + Complex64::new(size * noise.sample(), size * noise.sample())
            };
            for axis in 0..3 {
                pair.reference[axis] = noisy(pair.reference[axis], pair.reference_deviation[axis]);
                let deviation = pair.shown_deviation[axis];
                pair.shown[axis] = pair.shown[axis].map(|shown| noisy(shown, deviation));
            }
        }
        let mut moved_pairs = self.pairs.to_vec();
        for (_, by) in self.moved {
            let size = noise.sample();
            for (pair, by) in pairs.iter_mut().chain(&mut moved_pairs).zip(by.iter().cycle()) {
                for (reference, by) in pair.reference.iter_mut().zip(by) {
                    *reference += by * size;
                }
            }
        }
        // Each fit takes most of a trial, and is made where an entry comes from it.
        let known = || {
            fitted.as_flattened().iter().zip(scattered.as_flattened()).filter(|(found, _)| found.is_some())
        };
        let fit = |pairs: &[RatePair], is_wanted: bool| -> Option<[[f64; 3]; 3]> {
            if !is_wanted {
                return Some([[0.0; 3]; 3]);
            }
            Some(CalibrationMatrix::fit(pairs, self.axes_of_reference).ok()?.mixed(main))
        };
        let noisy = fit(&pairs, known().any(|(_, scattered)| scattered.is_none()))?;
        let exact = fit(&moved_pairs, known().any(|(_, scattered)| scattered.is_some()))?;
        let matrix: [[f64; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| scattered[i][j].map_or(noisy[i][j], |error| exact[i][j] + error))
        });
        let (common, correlations) = self.inputs.common();
        let normal = correlated_normals(correlations, common.len(), noise);
        let mut scale = 1.0;
        for (input, normal) in common.iter().zip(normal) {
            // The device's numbers have moved the phasors.
            if input.unit == "1" {
                let factor = 1.0 + shared_error(input, normal, noise);
                scale *= if input.sensitivity > 0.0 { factor } else { factor.recip() };
            }
        }
        Some(self.turned(matrix.map(|row| row.map(|entry| scale * entry)), noise))
    }

    /// K with the axes of the reference tilted: to first order towards the others, and by 1/cos of the tilt along itself.
    fn turned(&self, matrix: [[f64; 3]; 3], noise: &mut WhiteNoise) -> [[f64; 3]; 3] {
        let Some(alignment) = self.inputs.alignment() else { return matrix };
        let mut tilt = [[0.0; 3]; 3];
        for (j, column) in tilt.iter_mut().enumerate() {
            for (_, angle) in column.iter_mut().enumerate().filter(|(m, _)| *m != j) {
                let normal = noise.sample();
                *angle = shared_error(alignment, normal, noise);
            }
        }
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let square: f64 = tilt[j].iter().map(|angle| angle * angle).sum();
                let others: f64 = (0..3).map(|m| matrix[i][m] * tilt[j][m]).sum();
                matrix[i][j] * (1.0 + 0.5 * square) + others
            })
        })
    }
}

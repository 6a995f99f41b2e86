//! From the files to the scale factors.

use super::centre::{Centre, ShakenRecord};
use super::checks::{CertificateCheck, CheckKind};
use super::comparison::compared_references;
use super::cross_check::Trials;
use super::error::CalibrationError;
use super::files::{InputFiles, ReferenceQuantity, ReferenceRecord, UnitRecord};
use super::inputs::{CommonInputs, FittedNumber, PROBABILITY, RecordNoise};
use super::matrix::{CalibrationMatrix, LeaveOneOut, MOST_LEFT, RatePair};
use super::one_factor::{self, Contradiction};
use super::outcome::{
    CalibratedGyroscope, Calibration, Centred, InPlane, RecordFigures, ScaleFactorAtFrequency,
    ScaleFactorChange, UncertainEstimate,
};
use super::over_temperature;
use super::parts_of_vibration::parts_of_condition;
use super::peaks::{HALF_WINDOW, PeakToPeak};
use super::positions_record;
use super::quantities::{QuantityUnit, RecordOutcome};
use super::rates_record;
use super::rest::{AxisAtRest, InertialSensor};
use super::rest_record::{self, MeasuredRest};
use super::sine_record;
use super::temperature_record;
use super::tone::{AXES, VibrationTone};
use super::turns_record;
use crate::calibration::file::{Condition, GyroscopeCalibration, MotionReference};
use crate::config::Key;
use crate::fit::FitError;
use crate::metrology::{Combined, coverage_factor};
use crate::named_files::NamedFiles;
use crate::progress::Progress;
use crate::recording::{OF_RECORD, Purpose};
use crate::signal::PortableComplex;
use kalmems_core::Portable;
use kalmems_figures::Figure;
use realfft::num_complex::Complex64;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Calibrates gyroscopes and accelerometers as their file says.
pub fn calibrate(
    file: &GyroscopeCalibration,
    progress: &dyn Progress,
) -> Result<Calibration, CalibrationError> {
    calibrate_with_parts(file, progress, &mut Vec::new())
}

/// The same, with a picture of the still and the moving parts of each record before anything is computed from them: they are there if it is refused too.
pub fn calibrate_with_parts(
    file: &GyroscopeCalibration,
    progress: &dyn Progress,
    parts: &mut Vec<Figure>,
) -> Result<Calibration, CalibrationError> {
    let named = NamedFiles::new("calibration file", Purpose::Calibration, progress);
    let mut files = InputFiles { file, named, origins: BTreeMap::new(), parts };
    let (mut results, mut condition_parts) = (Vec::new(), Vec::new());
    for (index, condition) in file.conditions.iter().enumerate() {
        let records = files.unit(index, condition)?;
        let shown = parts_of_condition(condition.name.as_str(), &records);
        files.parts.push(shown.clone());
        condition_parts.push(shown);
        let full_scale = file.gyroscope.full_scale.as_ref().map(crate::config::Quantity::si);
        let tones: Vec<VibrationTone> = records
            .iter()
            .map(|record| {
                let place = || format!("{}, record `{}`", record.place, record.name);
                let tone = record.rates.tone(full_scale);
                tone.map_err(|fault| CalibrationError::Tone { place: place(), fault })
            })
            .collect::<Result<_, _>>()?;
        let names: Vec<&str> = records.iter().map(|record| record.name.as_str()).collect();
        for (number, reference) in condition.references.iter().enumerate() {
            let key = Key::from("condition").index(index).child("reference").index(number);
            let known = files.reference(&key, reference, &names)?;
            let against = ReferenceCalibration {
                file,
                condition,
                reference,
                records: &records,
                tones: &tones,
                progress,
            };
            results.push(against.calibrate(&known)?);
        }
    }
    let MeasuredRest { axes: rest, motions, remarks, parts: rest_parts } = rest_record::measure(&mut files)?;
    let mut records = positions_record::measure(&mut files)?;
    if let Some(positions) = records.first_mut() {
        compare_angles(&mut results, positions);
    }
    records.extend(over_temperature::of_positions(file, &records)?);
    let rates = rates_record::measure(&mut files)?;
    let over_temperature = over_temperature::of_rates(file, &rates)?;
    records.extend(rates);
    records.extend(over_temperature);
    records.extend(turns_record::measure(&mut files)?);
    records.extend(sine_record::measure(&mut files)?);
    records.extend(temperature_record::measure(&mut files)?);
    for record in &mut records {
        record.push_sensitivities(&file.gyroscope);
    }
    let under_vibration = results
        .iter()
        .filter_map(|found| RecordOutcome::sensitivities_under_vibration(found, &file.gyroscope));
    records.splice(..0, under_vibration);
    let NamedFiles { sources, findings, .. } = files.named;
    let findings = findings.into_iter().map(|(file, finding)| format!("{file}: {finding}"));
    let comparisons = compared_references(&results);
    for comparison in comparisons.iter().filter(|comparison| comparison.contradict) {
        let named = |result: &&mut CalibratedGyroscope| {
            result.condition == comparison.condition && comparison.references.contains(&result.reference)
        };
        results.iter_mut().filter(named).for_each(|result| result.warnings.push(comparison.to_string()));
    }
    let contradictions =
        comparisons.iter().filter(|comparison| comparison.contradict).map(ToString::to_string);
    let moving = motions.iter().cloned();
    let bias_checks = bias_checks(&results, &rest);
    let differing = bias_checks.iter().filter(|check| !check.passes).map(|check| {
        let CertificateCheck { what, found, .. } = check;
        format!("not so: {what} ({found})")
    });
    let findings = contradictions.chain(moving).chain(differing).chain(findings).chain(remarks).collect();
    let changes = changes(&results);
    Ok(Calibration {
        file: file.clone(),
        changes,
        comparisons,
        results,
        rest,
        bias_checks,
        rest_motions: motions,
        rest_parts,
        condition_parts,
        records,
        sources,
        findings,
    })
}

/// The probability beyond which two biases of one axis are not of one unit in one state.
const DIFFERENT: f64 = 0.999;

/// The difference of two numbers, and what it hardly exceeds if both are of one unit.
fn difference(one: &UncertainEstimate, other: &UncertainEstimate) -> [f64; 2] {
    let limits =
        [one, other].map(|found| coverage_factor(DIFFERENT, found.degrees_of_freedom) * found.uncertainty);
    [one.value - other.value, limits[0].portable_hypot(limits[1])]
}

/// The pairs of axes in the order of their angles.
const PAIRS: [[&str; 2]; 3] = [["x", "y"], ["x", "z"], ["y", "z"]];

/// Holds the angles between the gyroscopes' axes by a reference against those by positions, which know nothing of the reference: where they differ, the
/// axes of the reference are not square.
fn compare_angles(results: &mut [CalibratedGyroscope], positions: &mut RecordOutcome) {
    for result in results {
        let in_plane = result.in_plane.map(|found| vec![(found.axes, found.non_orthogonality)]);
        let angles = match result.alignment {
            Some([_, angles, _]) => PAIRS.into_iter().zip(angles).collect(),
            None => in_plane.unwrap_or_default(),
        };
        for ([a, b], angle) in angles {
            let name =
                format!("gyroscope_non_orthogonality_{}", if a < b { [a, b] } else { [b, a] }.concat());
            let Some(by_positions) = positions.estimate(&name) else { continue };
            let [difference, limit] = difference(&angle, by_positions);
            let place = format!(
                "condition `{}`, reference `{}`, gyroscopes of {a} and {b}",
                result.condition, result.reference
            );
            let found =
                format!("{:+.3} mrad apart, and both are known to {:.3} mrad", 1e3 * difference, 1e3 * limit);
            if difference.abs() > limit {
                result.warnings.push(format!(
                    "the angle between the axes {a} and {b} is not that by the positions ({found}): the axes of the reference are not square; correct its \
                     mounting, or state the angle as `uncertainty.alignment`"
                ));
            }
            positions.check(CheckKind::SquareReference, &place, difference.abs() <= limit, found);
        }
    }
}

/// Whether the bias of each axis under vibration is that at rest.
fn bias_checks(results: &[CalibratedGyroscope], rest: &[AxisAtRest]) -> Vec<CertificateCheck> {
    let QuantityUnit { factor, shown, .. } = QuantityUnit::rate();
    let of_result = |result: &CalibratedGyroscope| -> Vec<CertificateCheck> {
        let gyroscopes = rest.iter().filter(|rest| rest.sensor == InertialSensor::Gyroscope);
        let each = gyroscopes.filter_map(|rest| {
            let place = AXES.iter().position(|axis| *axis == rest.axis)?;
            let [difference, limit] =
                difference(&result.bias[place]?, &rest.bias_estimate()).map(|size| factor * size);
            let apart = format!("{difference:+.1} {shown} apart, and both are known to {limit:.1} {shown}");
            let passes = difference.abs() <= limit;
            let why = "a vibration that is rectified, another temperature or a bias that wanders; neither is the bias of the other state";
            let found = if passes { apart } else { format!("{apart}: {why}") };
            let place = format!("condition `{}`, axis {}", result.condition, rest.axis);
            Some(CertificateCheck::new(CheckKind::BiasUnderVibration, &place, passes, found))
        });
        each.collect()
    };
    // References of one condition share the gyroscope's records.
    let mut checks: Vec<CertificateCheck> = results.iter().flat_map(of_result).collect();
    checks.dedup();
    checks
}

/// One condition against one reference.
struct ReferenceCalibration<'a> {
    file: &'a GyroscopeCalibration,
    condition: &'a Condition,
    reference: &'a MotionReference,
    records: &'a [UnitRecord],
    tones: &'a [VibrationTone],
    progress: &'a dyn Progress,
}

/// Of the sine with four parameters and its two harmonics.
const PARAMETERS: usize = 8;

/// Said of cross-axis terms without it.
const ALIGNMENT_NOT_STATED: &str = "the alignment of the reference's axes is not stated (`uncertainty.alignment`, an angle): an axis that is \
    off by 1 mrad moves a cross-axis term by 0.001, so that their intervals are those of the records alone and no expanded uncertainties";

impl ReferenceCalibration<'_> {
    #[allow(clippy::too_many_lines)] // the steps of a calibration in their order
    fn calibrate(&self, known: &[ReferenceRecord]) -> Result<CalibratedGyroscope, CalibrationError> {
        let tones = self.tones_of(known)?;
        let axes_of_reference =
            std::array::from_fn(|axis| self.reference.channels.column(AXES[axis]).is_some());
        let pairs: Vec<RatePair> = tones
            .iter()
            .zip(known)
            .zip(self.tones)
            .map(|((tone, known), shown)| pair(tone, known, shown))
            .collect();
        let strength = |axis: usize| pairs.iter().map(|p| p.reference[axis].norm_sqr()).sum::<f64>();
        let common =
            (0..3).filter(|axis| axes_of_reference[*axis] && pairs.iter().all(|p| p.shown[*axis].is_some()));
        let Some(main) = common.max_by(|a, b| strength(*a).total_cmp(&strength(*b))) else {
            return Err(self.no_common_axis(axes_of_reference));
        };
        let failed = |fault| CalibrationError::Fit {
            condition: self.condition.name.to_string(),
            reference: self.reference.name.to_string(),
            fault,
        };
        let matrix = CalibrationMatrix::fit(&pairs, axes_of_reference).map_err(failed)?;
        let others = LeaveOneOut::of(&pairs, axes_of_reference);
        let number =
            |found: (f64, f64), columns: &[usize], of: &dyn Fn(&CalibrationMatrix) -> Option<f64>| {
                let repeatability = others.repeatability(columns.iter().copied(), of);
                FittedNumber { value: found.0, noise: found.1, repeatability }
            };
        let entry = |i: usize, j: usize| {
            Some(number(matrix.entry(i, j)?, &[j], &|matrix| Some(matrix.entry(i, j)?.0)))
        };
        let Some(fitted) = entry(main, main) else {
            return Err(self.no_common_axis(axes_of_reference));
        };
        let scale = fitted.value;
        let moved = moved_pairs(&tones, (known, self.tones));
        let of_device = moved_by_device(&moved, &pairs, axes_of_reference, (main, scale)).map_err(failed)?;
        let samples = |lengths: &mut dyn Iterator<Item = usize>| -> f64 {
            lengths.map(|samples| samples.saturating_sub(PARAMETERS) as f64).sum::<f64>().max(1.0)
        };
        let records = RecordNoise {
            shown_part: matrix.shown_part,
            residuals: [
                samples(&mut self.records.iter().map(|record| record.rates.time_s.len())),
                samples(&mut known.iter().map(|record| record.signals.time_s.len())),
            ],
            wander: tones.iter().chain(self.tones).map(|tone| tone.wander_loss).fold(0.0, f64::max),
            are_repeated: fitted.repeatability.is_some(),
        };
        let inputs = CommonInputs::of(records, &of_device, &self.reference.uncertainty);
        // By how much an entry changes with a tilt of the column's axis towards the others.
        let mixed = matrix.mixed(main);
        let by_tilt = |i: usize, j: usize| {
            let others = (0..3).filter(|m| *m != j).map(|m| mixed[i][m].powi(2));
            others.sum::<f64>().sqrt()
        };
        let budget = inputs.budget(&fitted, by_tilt(main, main), true);
        let fitted_entries: [[Option<FittedNumber>; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        let mut entries: [[Option<UncertainEstimate>; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                fitted_entries[i][j].map(|found| inputs.estimate(&found, by_tilt(i, j), true))
            })
        });
        let cross_check = match &self.file.monte_carlo {
            Some(settings) => {
                let trials = Trials { pairs: &pairs, moved: &moved, axes_of_reference, inputs: &inputs };
                let check = trials.cross_check(settings, main, (&fitted_entries, &entries), self.progress)?;
                check.state_intervals(main, &mut entries);
                Some(check)
            }
            None => None,
        };
        let of_angle = |found: (f64, f64),
                        by_tilt: f64,
                        columns: &[usize],
                        of: &dyn Fn(&CalibrationMatrix) -> Option<f64>| {
            inputs.estimate(&number(found, columns, of), by_tilt, false)
        };
        let contradiction = one_factor::contradiction(&pairs, &tones, main, &matrix);
        let turns = matrix.turn_rad.clone();
        let mut calibrated = CalibratedGyroscope {
            condition: self.condition.name.to_string(),
            temperature_k: self.condition.temperature.as_ref().map(crate::config::Quantity::si),
            reference: self.reference.name.to_string(),
            main,
            scale_factor: entries[main][main]
                .unwrap_or_else(|| inputs.estimate(&fitted, by_tilt(main, main), true)),
            withheld: contradiction.as_ref().map(ToString::to_string),
            by_frequency: Vec::new(),
            matrix: entries,
            bias: std::array::from_fn(|axis| self.bias(axis)),
            budget: inputs.contributions(&budget, scale),
            cross_check,
            records: self.figures(&tones, &pairs, main, &matrix),
            chi_square: matrix.chi_square,
            freedom: matrix.freedom,
            peak_to_peak: self.peak_to_peak(known, &tones, main),
            excitation: matrix.excitation.clone(),
            alignment: matrix.alignment().map(|found| {
                // Non-orthogonality is a difference of two tilts, a turn of the case their mean: each of two axes.
                let tilted = [0.0, std::f64::consts::SQRT_2, std::f64::consts::FRAC_1_SQRT_2];
                std::array::from_fn(|kind| {
                    std::array::from_fn(|axis| {
                        let again = |matrix: &CalibrationMatrix| Some(matrix.alignment()?[kind][axis].0);
                        let number = number(found[kind][axis], &[0, 1, 2], &again);
                        inputs.estimate(&number, tilted[kind], kind == 0)
                    })
                })
            }),
            in_plane: None,
            centre: None,
            not_observed: not_observed(&matrix, axes_of_reference, &pairs),
            warnings: Vec::new(),
        };
        if calibrated.alignment.is_none() {
            let plane = [[0, 1], [1, 2], [0, 2]]
                .into_iter()
                .find_map(|axes| Some((axes, matrix.alignment_in_plane(axes)?)));
            calibrated.in_plane = plane.map(|(axes, found)| {
                let angle = |place: usize, by_tilt: f64| {
                    let again = |matrix: &CalibrationMatrix| Some(matrix.alignment_in_plane(axes)?[place].0);
                    of_angle(found[place], by_tilt, &axes, &again)
                };
                InPlane {
                    axes: axes.map(|axis| AXES[axis]),
                    non_orthogonality: angle(0, std::f64::consts::SQRT_2),
                    turn: angle(1, 1.0),
                }
            });
        }
        if let Some(Contradiction::Frequencies { groups, .. }) = &contradiction {
            let mut is_described = true;
            for group in groups {
                let chosen: Vec<RatePair> = group.iter().map(|place| pairs[*place]).collect();
                let matrix = CalibrationMatrix::fit(&chosen, axes_of_reference).map_err(failed)?;
                let Some((value, noise)) = matrix.entry(main, main) else { continue };
                let repeatability = LeaveOneOut::of(&chosen, axes_of_reference)
                    .repeatability([main], |matrix| Some(matrix.entry(main, main)?.0));
                let found = FittedNumber { value, noise, repeatability };
                is_described &= matrix.left <= MOST_LEFT;
                calibrated.by_frequency.push(ScaleFactorAtFrequency {
                    frequency_hz: group.iter().map(|place| tones[*place].frequency_hz).sum::<f64>()
                        / group.len() as f64,
                    records: group.len(),
                    has_scatter: inputs.has_reproducibility() || repeatability.is_some(),
                    scale_factor: inputs.estimate(&found, by_tilt(main, main), true),
                });
            }
            // Records of one frequency that contradict each other are no case of a scale factor by frequency.
            if !is_described {
                calibrated.by_frequency.clear();
            }
        }
        if self.file.gyroscope.accelerometers.is_some() {
            calibrated.centre = Some(self.centre(&tones, &pairs, &turns).map_err(failed)?);
            let arm = calibrated.centre.iter().flat_map(|centre| centre.arm.iter().zip(AXES));
            let lost: Vec<&str> = arm.filter(|(found, _)| found.is_none()).map(|(_, axis)| axis).collect();
            if !lost.is_empty() {
                calibrated.not_observed.push(format!(
                    "the centre of rotation along {}: turning about an axis says nothing of where along it",
                    lost.join(" and ")
                ));
            }
        }
        calibrated.warnings = self.warnings(&calibrated, &tones, matrix.probability());
        let has_cross_terms = calibrated.cross_terms().next().is_some();
        if has_cross_terms && !inputs.has_alignment() {
            calibrated.warnings.push(ALIGNMENT_NOT_STATED.to_owned());
        }
        if let Some(check) = &calibrated.cross_check {
            calibrated.warnings.extend(check.disagreements.iter().cloned());
        }
        Ok(calibrated)
    }

    /// The reference's vibrations, of the gyroscope's frequency.
    fn tones_of(&self, known: &[ReferenceRecord]) -> Result<Vec<VibrationTone>, CalibrationError> {
        let tones: Vec<VibrationTone> = known
            .iter()
            .zip(self.records)
            .map(|(known, record)| {
                let place = || format!("{}, record `{}`", known.place, record.name);
                let tone = known.signals.tone(None);
                tone.map_err(|fault| CalibrationError::Tone { place: place(), fault })
            })
            .collect::<Result<_, _>>()?;
        for (tone, record) in tones.iter().zip(self.records.iter().zip(self.tones)) {
            self.check_frequencies(tone, record.1, &record.0.name)?;
        }
        Ok(tones)
    }

    fn check_frequencies(
        &self,
        tone: &VibrationTone,
        shown: &VibrationTone,
        record: &str,
    ) -> Result<(), CalibrationError> {
        let rate_hz = self.file.gyroscope.rate.si();
        let tolerance = self.file.gyroscope.clock_tolerance.as_ref().map_or(0.0, crate::config::Quantity::si);
        if tone.frequency_hz > 0.5 * rate_hz * (1.0 - tolerance) {
            let frequency_hz = tone.frequency_hz;
            return Err(CalibrationError::Aliased { record: record.to_owned(), frequency_hz, rate_hz });
        }
        let off = shown.frequency_hz / tone.frequency_hz - 1.0;
        if off.abs() > tolerance {
            return Err(CalibrationError::Frequencies {
                record: record.to_owned(),
                reference: self.reference.name.to_string(),
                shown_hz: shown.frequency_hz,
                reference_hz: tone.frequency_hz,
                off: 100.0 * off,
                tolerance: 100.0 * tolerance,
            });
        }
        Ok(())
    }

    fn no_common_axis(&self, axes_of_reference: [bool; 3]) -> CalibrationError {
        let list = |has: &dyn Fn(usize) -> bool| {
            let names: Vec<&str> = (0..3).filter(|axis| has(*axis)).map(|axis| AXES[axis]).collect();
            names.join(", ")
        };
        CalibrationError::NoCommonAxis {
            condition: self.condition.name.to_string(),
            reference: self.reference.name.to_string(),
            shown: list(&|axis| {
                self.file.gyroscope.channels.as_ref().is_some_and(|c| c.column(AXES[axis]).is_some())
            }),
            known: list(&|axis| axes_of_reference[axis]),
        }
    }

    /// The mean of the offsets: a vibration has no mean rate.
    fn bias(&self, axis: usize) -> Option<UncertainEstimate> {
        let offsets: Vec<(f64, f64)> = self
            .tones
            .iter()
            .map(|tone| tone.axes[axis].map(|found| (found.offset, found.offset_deviation)))
            .collect::<Option<_>>()?;
        let count = offsets.len() as f64;
        let value = offsets.iter().map(|(offset, _)| offset).sum::<f64>() / count;
        let (uncertainty, freedom) = if offsets.len() > 1 {
            let square: f64 = offsets.iter().map(|(offset, _)| (offset - value).powi(2)).sum();
            ((square / (count * (count - 1.0))).sqrt(), count - 1.0)
        } else {
            (offsets.first()?.1, f64::INFINITY)
        };
        let combined = Combined::of(uncertainty, freedom, PROBABILITY);
        Some(UncertainEstimate::of(value, combined, combined))
    }

    fn figures(
        &self,
        tones: &[VibrationTone],
        pairs: &[RatePair],
        main: usize,
        matrix: &CalibrationMatrix,
    ) -> Vec<RecordFigures> {
        let rate_hz = self.file.gyroscope.rate.si();
        let records = self.records.iter().zip(self.tones).zip(tones.iter().zip(pairs));
        let figures = records.enumerate().filter_map(|(place, ((record, shown), (tone, pair)))| {
            let (reference, amplitude) =
                (pair.reference[main].portable_norm(), pair.shown[main]?.portable_norm());
            let scale_factor = amplitude / reference;
            let relative = (pair.reference_deviation[main] / reference)
                .portable_hypot(pair.shown_deviation[main] / amplitude);
            let sample_rate_hz = rate_hz * tone.frequency_hz / shown.frequency_hz;
            let of_clock = (tone.frequency_deviation_hz / tone.frequency_hz)
                .portable_hypot(shown.frequency_deviation_hz / shown.frequency_hz);
            Some(RecordFigures {
                record: record.name.clone(),
                frequency_hz: tone.frequency_hz,
                sample_rate_hz,
                sample_rate_deviation_hz: sample_rate_hz * of_clock,
                periods: [tone.periods, shown.periods],
                reference,
                shown: amplitude,
                scale_factor,
                deviation: scale_factor * relative,
                residual: matrix.residual(pairs, place, main),
                distortion: [tone.axes[main]?.distortion, shown.axes[main]?.distortion],
            })
        });
        figures.collect()
    }

    fn peak_to_peak(
        &self,
        known: &[ReferenceRecord],
        tones: &[VibrationTone],
        main: usize,
    ) -> Option<PeakToPeak> {
        let pairs: Option<Vec<(f64, f64)>> = known
            .iter()
            .zip(tones)
            .zip(self.records.iter().zip(self.tones))
            .map(|((known, tone), (record, shown))| {
                let times = &known.signals.time_s;
                let interval = (times.last()? - times.first()?) / (times.len() - 1) as f64;
                let half = HALF_WINDOW * interval * tone.frequency_hz;
                let at = |signals: &super::tone::AxisSignals, tone: &VibrationTone| {
                    let phase = tone.axes[main]?.phasor.portable_arg();
                    signals.crest_to_trough(main, tone.frequency_hz, phase, half)
                };
                if known.shows[main] == ReferenceQuantity::Angle || half > 0.1 {
                    return None;
                }
                Some((at(&known.signals, tone)?, at(&record.rates, shown)?))
            })
            .collect();
        PeakToPeak::of(&pairs?)
    }

    fn centre(
        &self,
        tones: &[VibrationTone],
        pairs: &[RatePair],
        turns: &[f64],
    ) -> Result<Centred, FitError> {
        let mut shaken = Vec::new();
        for ((record, shown), (tone, (pair, turn))) in
            self.records.iter().zip(self.tones).zip(tones.iter().zip(pairs.iter().zip(turns)))
        {
            let turn = Complex64::portable_polar(1.0, *turn);
            let found = record.forces.components(shown.frequency_hz);
            shaken.push(ShakenRecord {
                frequency_hz: tone.frequency_hz,
                rate: pair.reference.map(|rate| rate * turn),
                force: found.map(|found| found.map(|c| c.phasor)),
                deviation: found.map(|found| found.map_or(0.0, |c| c.deviation)),
                reaction: found.map(|found| found.map_or(0.0, |c| c.offset)),
            });
        }
        let centre = Centre::fit(&shaken)?;
        let arm = std::array::from_fn(|axis| {
            let (value, uncertainty) = centre.coordinate(axis)?;
            let combined = Combined::of(uncertainty, f64::INFINITY, PROBABILITY);
            Some(UncertainEstimate::of(value, combined, combined))
        });
        Ok(Centred { arm, chi_square: centre.chi_square, freedom: centre.freedom })
    }

    fn warnings(
        &self,
        found: &CalibratedGyroscope,
        tones: &[VibrationTone],
        probability: f64,
    ) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(why) = &found.withheld {
            warnings.push(why.clone());
            let alone = found.by_frequency.iter().filter(|at| !at.has_scatter).count();
            if alone > 0 {
                warnings.push(format!(
                    "the intervals of {alone} of {} frequencies lack what changes from record to record: repeat their records, or state \
                     `uncertainty.reproducibility`",
                    found.by_frequency.len()
                ));
            }
        } else if probability < 0.01 {
            warnings.push(format!(
                "the records scatter by more than the noise within them explains (χ² {:.1} at {} degrees of freedom); the interval has what they \
                 scatter. One sine per record, or one scale factor for all amplitudes, is not the whole truth",
                found.chi_square, found.freedom
            ));
        }
        if tones.iter().chain(self.tones).any(|tone| tone.axes[tone.main].is_some_and(|c| !c.white)) {
            warnings.push(
                "what the sines leave is not white: its density beside the line counts as noise, which holds for noise and not \
                 for errors that repeat with each period"
                    .to_owned(),
            );
        }
        let rates: Vec<(f64, f64)> =
            found.records.iter().map(|r| (r.sample_rate_hz, r.sample_rate_deviation_hz)).collect();
        let ends = rates.iter().fold(None::<[(f64, f64); 2]>, |ends, rate| {
            let [low, high] = ends.unwrap_or([*rate; 2]);
            Some([if rate.0 < low.0 { *rate } else { low }, if rate.0 > high.0 { *rate } else { high }])
        });
        if let Some([low, high]) =
            ends.filter(|[low, high]| high.0 - low.0 > 5.0 * high.1.portable_hypot(low.1))
        {
            warnings.push(format!(
                "the gyroscope's clock changes between records, from {:.3} to {:.3} samples per second: amplitudes do not hang \
                 on it, but let the unit warm up where its clock matters",
                low.0, high.0
            ));
        }
        warnings
    }
}

/// Of each direction in which the device behind an estimated motion is uncertain its name, and by how much one standard deviation of it
/// moves the reference's phasors of each record.
pub(super) type DirectionEffects = Vec<(String, Vec<[Complex64; 3]>)>;

fn moved_pairs(
    tones: &[VibrationTone],
    (known, shown): (&[ReferenceRecord], &[VibrationTone]),
) -> DirectionEffects {
    let Some(first) = known.first() else { return Vec::new() };
    let of = |source: &String| -> Vec<[Complex64; 3]> {
        let records = tones.iter().zip(known).zip(shown).map(|((tone, known), shown)| {
            let mut moved_tone = tone.clone();
            if let Some((_, moved)) = known.moved.iter().find(|(own, _)| own == source) {
                for (axis, moved) in moved_tone.axes.iter_mut().zip(moved.components(tone.frequency_hz)) {
                    if let (Some(axis), Some(moved)) = (axis, moved) {
                        axis.phasor += moved.phasor;
                    }
                }
            }
            let [before, after] = [tone, &moved_tone].map(|tone| pair(tone, known, shown).reference);
            std::array::from_fn(|axis| after[axis] - before[axis])
        });
        records.collect()
    };
    let common = first.moved.iter().filter(|(source, _)| !source.starts_with(OF_RECORD));
    common.map(|(source, _)| (source.clone(), of(source))).collect()
}

/// By what part the scale factor moves with one standard deviation of each of the uncertain numbers of the device behind an estimated
/// motion. Such an error is common to all records, and none of it averages out.
fn moved_by_device(
    moved: &DirectionEffects,
    pairs: &[RatePair],
    axes_of_reference: [bool; 3],
    (main, scale): (usize, f64),
) -> Result<Vec<(String, f64)>, FitError> {
    let mut contributions: Vec<(String, f64)> = Vec::with_capacity(moved.len());
    for (source, by) in moved {
        let mut pairs = pairs.to_vec();
        for (pair, by) in pairs.iter_mut().zip(by) {
            pair.reference = std::array::from_fn(|axis| pair.reference[axis] + by[axis]);
        }
        let matrix = CalibrationMatrix::fit(&pairs, axes_of_reference)?;
        let Some((there, _)) = matrix.entry(main, main) else { continue };
        let part = there / scale - 1.0;
        // Numbers whose errors hang together have several independent directions, with a number behind the name of the first.
        let is_first = |other: &&mut (String, f64)| {
            let number = source.strip_prefix(&other.0).and_then(|rest| rest.strip_prefix('_'));
            number.is_some_and(|number| number.parse::<usize>().is_ok())
        };
        match contributions.iter_mut().find(is_first) {
            Some(group) => group.1 = group.1.portable_hypot(part),
            None => contributions.push((source.clone(), part)),
        }
    }
    Ok(contributions)
}

/// Phasors of rates, in rad/s. What moves the motion of this record alone is noise of its phasor.
fn pair(tone: &VibrationTone, known: &ReferenceRecord, shown: &VibrationTone) -> RatePair {
    let of_angle = Complex64::i() * (TAU * tone.frequency_hz);
    let mut pair = RatePair {
        reference: [Complex64::new(0.0, 0.0); 3],
        reference_deviation: [0.0; 3],
        shown: shown.axes.map(|found| found.map(|c| c.phasor)),
        shown_deviation: shown.axes.map(|found| found.map_or(0.0, |c| c.deviation)),
    };
    for (axis, found) in tone.axes.iter().enumerate() {
        let Some(found) = found else { continue };
        let factor = match known.shows[axis] {
            ReferenceQuantity::Rate => Complex64::new(1.0, 0.0),
            ReferenceQuantity::Angle => of_angle,
        };
        pair.reference[axis] = found.phasor * factor;
        pair.reference_deviation[axis] = found.deviation * factor.portable_norm();
    }
    for (_, moved) in known.moved.iter().filter(|(source, _)| source.starts_with(OF_RECORD)) {
        for (axis, found) in moved.components(tone.frequency_hz).into_iter().enumerate() {
            let Some(found) = found else { continue };
            let factor =
                if known.shows[axis] == ReferenceQuantity::Angle { of_angle.portable_norm() } else { 1.0 };
            // One of two components, each of which it moves by as much.
            let part = found.phasor.portable_norm() * factor * std::f64::consts::FRAC_1_SQRT_2;
            pair.reference_deviation[axis] = pair.reference_deviation[axis].portable_hypot(part);
        }
    }
    pair
}

fn not_observed(matrix: &CalibrationMatrix, axes_of_reference: [bool; 3], pairs: &[RatePair]) -> Vec<String> {
    let mut said = Vec::new();
    let rows: Vec<usize> = (0..3).filter(|i| pairs.iter().all(|pair| pair.shown[*i].is_some())).collect();
    for column in 0..3 {
        let name = AXES[column];
        if rows.iter().all(|row| matrix.entry(*row, column).is_some()) {
            continue;
        }
        let entries: Vec<String> = rows.iter().map(|row| format!("k_{}{name}", AXES[*row])).collect();
        let why = if axes_of_reference[column] {
            let strength = pairs.iter().map(|p| p.reference[column].portable_norm()).fold(0.0, f64::max);
            format!("the records hardly turn about {name} ({strength:.1e} rad/s)")
        } else {
            format!("the reference shows no {name}: turning about {name} is taken as none")
        };
        said.push(format!("{}: {why}", entries.join(", ")));
    }
    let signs: Vec<String> = rows
        .iter()
        .filter(|row| matrix.entry(**row, **row).is_some())
        .map(|row| format!("k_{0}{0}", AXES[*row]))
        .collect();
    if !signs.is_empty() {
        said.push(format!(
            "the sign of {}: each instrument has its own clock, so that an axis that is mounted upside down shows the same; the diagonal is taken as positive",
            signs.join(", ")
        ));
    }
    let whole = (0..9).all(|k| matrix.entry(k / 3, k % 3).is_some());
    if !whole && rows.len() > 1 {
        said.push(
            "non-orthogonality apart from mounting needs all nine entries: in a matrix with an unknown column a tilt of a \
             sensitive axis and a tilt of the case are one"
                .to_owned(),
        );
    }
    said
}

/// Between the first condition and each later one, by the references that both have.
fn changes(results: &[CalibratedGyroscope]) -> Vec<ScaleFactorChange> {
    let mut changes = Vec::new();
    let Some(first) = results.first().map(|r| r.condition.clone()) else { return changes };
    for later in results.iter().filter(|r| r.condition != first) {
        let before = results
            .iter()
            .find(|r| r.condition == first && r.reference == later.reference && r.main == later.main);
        let Some(before) = before else { continue };
        let (old, new) = (before.scale_factor, later.scale_factor);
        let ppm = 1e6 * (new.value / old.value - 1.0);
        let warmer = later.temperature_k.zip(before.temperature_k).map(|(b, a)| b - a);
        changes.push(ScaleFactorChange {
            reference: later.reference.clone(),
            from: first.clone(),
            to: later.condition.clone(),
            ppm,
            deviation_ppm: 1e6 * (old.by_records / old.value).portable_hypot(new.by_records / new.value),
            ppm_per_k: warmer.filter(|k| *k != 0.0).map(|k| ppm / k),
        });
    }
    changes
}

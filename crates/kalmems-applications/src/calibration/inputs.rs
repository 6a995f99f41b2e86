//! The inputs of a scale factor and of each entry of K, for a budget.

use super::file::StatedUncertainty;
use super::matrix::Repeatability;
use super::outcome::{UncertainEstimate, UncertaintyContribution};
use crate::metrology::{Budget, Combined, Distribution, Evaluation, Input};

/// The probability with which intervals hold a value.
pub const PROBABILITY: f64 = 0.95;

/// How noise is known.
pub const FROM_NOISE: &str = "measured, residuals";
/// How what the device behind an estimated motion adds is known.
pub const FROM_DEVICE: &str = "of the device of the estimate";
/// How scatter is known.
pub const FROM_SCATTER: &str = "measured, between records";
const FROM_WANDER: &str = "measured, within records";
const STATED: &str = "stated";
const NOT_STATED: &str = "not stated: not in the interval";

/// The names in a budget that others look for.
pub const OF_GYROSCOPE: &str = "noise of the gyroscope";
pub const OF_REFERENCE: &str = "noise of the reference";
pub const OF_REPEATABILITY: &str = "repeatability of the records, their noise included";
/// What a single record does not tell.
pub const OF_REPRODUCIBILITY: &str = "reproducibility from record to record";
pub const OF_ALIGNMENT: &str = "alignment of the axes";
const OF_ALIGNMENT_SQUARED: &str = "alignment of the axes, second order";

/// A number that was fitted to the records, with what they tell of it.
#[derive(Clone, Copy, Debug)]
pub struct FittedNumber {
    pub value: f64,
    /// Its standard deviation by the noise within the records.
    pub noise: f64,
    /// What it scatters from record to record; `None` of too few records.
    pub repeatability: Option<Repeatability>,
}

/// What the records say of their noise.
#[derive(Clone, Copy, Debug)]
pub struct RecordNoise {
    /// What part of the variance by noise is the gyroscope's.
    pub shown_part: f64,
    /// Samples less parameters of the fitted sines, of gyroscope and reference.
    pub residuals: [f64; 2],
    /// The part of an amplitude that the wandering of a clock may take.
    pub wander: f64,
    /// Whether what the scale factor scatters from record to record is known.
    pub are_repeated: bool,
}

/// The inputs that all entries of K have in common, relative to it, and what their records say.
#[derive(Clone, Debug)]
pub struct CommonInputs {
    records: RecordNoise,
    /// Relative: value 0, and a sensitivity of ±1.
    common: Vec<Input>,
    correlations: Vec<(usize, usize, f64)>,
    /// Those that nobody stated.
    missing: Vec<&'static str>,
    /// The alignment, where it is stated.
    alignment: Option<Input>,
}

impl CommonInputs {
    /// From what the records, the device behind an estimated motion and the operator say. `of_device` is by how much, relative to the scale
    /// factor, one standard deviation of each of the device's numbers moves it.
    pub fn of(records: RecordNoise, of_device: &[(String, f64)], stated: &StatedUncertainty) -> Self {
        let mut common = vec![Input {
            name: "wander of the clocks".to_owned(),
            unit: "1",
            value: 0.0,
            standard_uncertainty: records.wander,
            distribution: Distribution::Normal,
            degrees_of_freedom: f64::INFINITY,
            evaluation: Evaluation::A,
            source: FROM_WANDER.to_owned(),
            sensitivity: 1.0,
        }];
        common.extend(of_device.iter().map(|(name, moved)| Input {
            name: name.clone(),
            unit: "standard deviations",
            value: 0.0,
            standard_uncertainty: 1.0,
            distribution: Distribution::Normal,
            degrees_of_freedom: f64::INFINITY,
            evaluation: Evaluation::B,
            source: FROM_DEVICE.to_owned(),
            sensitivity: *moved,
        }));
        let mut missing = Vec::new();
        let mut places = Vec::new();
        for (key, name, stated) in stated.contributions() {
            let Some(stated) = stated else {
                // The numbers of the model speak for it, and records for what they scatter.
                let is_known = match key {
                    "model" => !of_device.is_empty(),
                    "reproducibility" => records.are_repeated,
                    _ => false,
                };
                if !is_known {
                    missing.push(name);
                }
                continue;
            };
            // What is too large of the reference's rate makes K too small; the last three are errors of the unit's rate.
            let is_of_unit = matches!(key, "temperature" | "off_axis" | "reproducibility");
            let sensitivity = if is_of_unit { 1.0 } else { -1.0 };
            places.push((key, common.len()));
            common.push(Input {
                name: name.to_owned(),
                unit: "1",
                value: 0.0,
                standard_uncertainty: stated.standard(),
                distribution: stated.distribution(),
                degrees_of_freedom: stated.degrees_of_freedom(),
                evaluation: Evaluation::B,
                source: stated.source().unwrap_or(STATED).to_owned(),
                sensitivity,
            });
        }
        let place = |name: &str| places.iter().find(|(own, _)| *own == name).map(|(_, place)| *place);
        let correlations =
            stated.correlation.pairs().filter_map(|(a, b, r)| Some((place(a)?, place(b)?, r))).collect();
        let alignment = stated.alignment.as_ref().map(|stated| Input {
            name: OF_ALIGNMENT.to_owned(),
            unit: "rad",
            value: 0.0,
            standard_uncertainty: stated.standard(),
            distribution: stated.distribution(),
            degrees_of_freedom: stated.degrees_of_freedom(),
            evaluation: Evaluation::B,
            source: stated.source().unwrap_or(STATED).to_owned(),
            sensitivity: 0.0,
        });
        Self { records, common, correlations, missing, alignment }
    }

    /// Whether the alignment of the reference's axes is stated.
    pub const fn has_alignment(&self) -> bool {
        self.alignment.is_some()
    }

    /// Whether it is stated what changes from record to record.
    pub fn has_reproducibility(&self) -> bool {
        self.common.iter().any(|input| input.name == OF_REPRODUCIBILITY)
    }

    /// What enters for what a number scatters: nothing where its reproducibility is stated instead.
    pub fn repeatability(&self, found: &FittedNumber) -> Option<Repeatability> {
        found.repeatability.filter(|_| !self.has_reproducibility())
    }

    /// The relative inputs that all entries share, and their correlations.
    pub fn common(&self) -> (&[Input], &[(usize, usize, f64)]) {
        (&self.common, &self.correlations)
    }

    /// The alignment, where it is stated.
    pub const fn alignment(&self) -> Option<&Input> {
        self.alignment.as_ref()
    }

    /// The budget of a number that changes by `by_alignment` with a radian of misalignment, and is in proportion to the common inputs where
    /// `is_scale`. The correlated inputs come first, so that the correlations' places hold.
    pub fn budget(&self, found: &FittedNumber, by_alignment: f64, is_scale: bool) -> Budget {
        let FittedNumber { value, noise, .. } = *found;
        let mut budget = Budget::default();
        if is_scale {
            let scaled = self
                .common
                .iter()
                .map(|input| Input { sensitivity: value * input.sensitivity, ..input.clone() });
            budget.inputs.extend(scaled);
            budget.correlations.clone_from(&self.correlations);
        }
        let RecordNoise { shown_part, residuals, .. } = self.records;
        let of_records = |name: &str, part: f64, degrees_of_freedom: f64, source: &str| Input {
            name: name.to_owned(),
            unit: "1",
            value: 0.0,
            standard_uncertainty: part,
            distribution: Distribution::Normal,
            degrees_of_freedom,
            evaluation: Evaluation::A,
            source: source.to_owned(),
            sensitivity: 1.0,
        };
        if let Some(known) = self.repeatability(found) {
            // The noise within the records is part of what they scatter.
            let Repeatability { uncertainty, freedom } = known;
            budget.inputs.push(of_records(OF_REPEATABILITY, uncertainty, freedom, FROM_SCATTER));
        } else {
            let of_gyroscope = noise * shown_part.sqrt();
            budget.inputs.push(of_records(OF_GYROSCOPE, of_gyroscope, residuals[0], FROM_NOISE));
            let of_reference = noise * (1.0 - shown_part).max(0.0).sqrt();
            budget.inputs.push(of_records(OF_REFERENCE, of_reference, residuals[1], FROM_NOISE));
        }
        if let Some(alignment) = &self.alignment {
            let u = alignment.standard_uncertainty;
            if by_alignment != 0.0 {
                budget.inputs.push(Input { sensitivity: by_alignment, ..alignment.clone() });
            }
            if is_scale {
                // 1/cos of a tilt in two directions: of mean u² and deviation u², none of which is corrected for.
                budget.inputs.push(Input {
                    name: OF_ALIGNMENT_SQUARED.to_owned(),
                    unit: "1",
                    standard_uncertainty: std::f64::consts::SQRT_2 * u * u,
                    distribution: Distribution::Normal,
                    sensitivity: value,
                    ..alignment.clone()
                });
            }
        }
        budget
    }

    /// A number with its uncertainty by the records and by all that its budget knows.
    pub fn estimate(&self, found: &FittedNumber, by_alignment: f64, is_scale: bool) -> UncertainEstimate {
        let budget = self.budget(found, by_alignment, is_scale);
        let by_records = match self.repeatability(found) {
            Some(known) => Combined::of(known.uncertainty, known.freedom, PROBABILITY),
            None => Combined::of(found.noise, f64::INFINITY, PROBABILITY),
        };
        UncertainEstimate::of(found.value, by_records, budget.combined(PROBABILITY))
    }

    /// The table of a scale factor's budget, in ppm of it, with what nobody stated.
    pub fn contributions(&self, budget: &Budget, value: f64) -> Vec<UncertaintyContribution> {
        // What the records tell comes first.
        let origin = |input: &Input| match input.name.as_str() {
            OF_GYROSCOPE | OF_REFERENCE => FROM_NOISE,
            OF_REPEATABILITY => FROM_SCATTER,
            _ if input.source == FROM_WANDER => FROM_WANDER,
            _ if input.source == FROM_DEVICE => FROM_DEVICE,
            _ => STATED,
        };
        let order = |input: &Input| {
            [FROM_NOISE, FROM_SCATTER, FROM_WANDER, FROM_DEVICE, STATED]
                .iter()
                .position(|own| *own == origin(input))
        };
        let mut inputs: Vec<&Input> = budget.inputs.iter().collect();
        inputs.sort_by_key(|input| order(input));
        let known = inputs.into_iter().map(|input| UncertaintyContribution {
            source: input.name.clone(),
            ppm: Some(1e6 * (input.contribution() / value).abs()),
            origin: origin(input),
            input: Some(input.clone()),
        });
        let missing = self.missing.iter().map(|name| UncertaintyContribution {
            source: (*name).to_owned(),
            ppm: None,
            origin: NOT_STATED,
            input: None,
        });
        known.chain(missing).collect()
    }
}

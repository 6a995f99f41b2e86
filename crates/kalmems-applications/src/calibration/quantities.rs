//! What a record of a unit determines, in the shape that tables, JSON and the certificate share.

use super::checks::{CertificateCheck, CheckKind};
use super::file::InertialUnit;
use super::outcome::{CalibratedGyroscope, UncertainEstimate};
use super::tone::AXES;
use crate::config::kinds::KindOf;
use crate::config::{Channels, TemperatureCurve};
use crate::metrology::{Budget, Distribution, Evaluation, Input, StandardUncertainty};
use kalmems_figures::{Figure, TextTable};
use serde::{Serialize, Serializer};

/// Standard gravity in m/s².
pub(super) const STANDARD_GRAVITY: f64 = 9.806_65;
/// The unit of a number, and how tables show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuantityUnit {
    /// The unit in SI.
    pub unit: &'static str,
    /// What the number is multiplied by in tables.
    pub factor: f64,
    /// The unit of the product.
    pub shown: &'static str,
    /// Beyond this standard uncertainty by the record, in SI, the record does not determine the number.
    pub unknown: f64,
}

impl QuantityUnit {
    /// A ratio, shown as a plain number.
    pub const RATIO: Self = Self { unit: "1", factor: 1.0, shown: "", unknown: 0.1 };
    /// A small angle.
    pub const ANGLE: Self = Self { unit: "rad", factor: 1e3, shown: "mrad", unknown: 0.1 };
    /// The bias of an accelerometer.
    pub const FORCE: Self =
        Self { unit: "m/s^2", factor: 1e3 / STANDARD_GRAVITY, shown: "mgn", unknown: 0.1 * STANDARD_GRAVITY };

    /// Another unit, in which no size is too large.
    pub const fn other(unit: &'static str, factor: f64, shown: &'static str) -> Self {
        Self { unit, factor, shown, unknown: f64::MAX }
    }

    /// What a gyroscope shows of the specific force.
    pub fn force_sensitivity() -> Self {
        Self::other("rad*s/m", 3600.0_f64.to_degrees() * STANDARD_GRAVITY, "deg/h/gn")
    }

    /// The bias of a gyroscope.
    pub fn rate() -> Self {
        Self::other("rad/s", 3600.0_f64.to_degrees(), "deg/h")
    }
}

/// A number that a record determines.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibratedQuantity {
    /// Its name, unique in the record, such as `accelerometer_scale_factor_x`.
    pub name: String,
    /// The unit of the estimate.
    #[serde(serialize_with = "in_si")]
    pub unit: QuantityUnit,
    /// The number with its uncertainty.
    #[serde(flatten)]
    pub estimate: UncertainEstimate,
    /// What its uncertainty is made of.
    pub budget: Vec<Input>,
}

fn in_si<S: Serializer>(unit: &QuantityUnit, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(unit.unit)
}

/// The covariance matrix of numbers of a record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct QuantityCovariance {
    /// The names of the numbers, in the order of the rows and columns.
    pub parameters: Vec<String>,
    /// The matrix row by row; an entry has the unit of its row times that of its column.
    pub matrix: Vec<Vec<f64>>,
}

/// A record of a unit with what was found in it.
#[derive(Clone, Debug, Serialize)]
pub struct RecordOutcome {
    /// Which table of the calibration file asked for it: `positions`, `rates`, `temperature`.
    pub kind: &'static str,
    /// A heading.
    #[serde(skip)]
    pub title: String,
    /// How the numbers were found, for the certificate.
    #[serde(skip)]
    pub method: String,
    /// The numbers.
    pub quantities: Vec<CalibratedQuantity>,
    /// The covariances of numbers that have inputs in common.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covariance: Option<QuantityCovariance>,
    /// Curves over the temperature.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub compensation: Vec<TemperatureCurve>,
    /// The parts of the record, row by row.
    #[serde(skip)]
    pub tables: Vec<TextTable>,
    /// Its pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// Whether what was assumed holds.
    #[serde(skip)]
    pub checks: Vec<CertificateCheck>,
    /// What is not determined, and why.
    pub not_observed: Vec<String>,
    /// What a reader must know.
    pub warnings: Vec<String>,
    /// The keys that a certificate needs and the file does not state.
    #[serde(skip)]
    pub not_stated: Vec<String>,
}

impl RecordOutcome {
    /// The estimate with this name.
    pub fn estimate(&self, name: &str) -> Option<&UncertainEstimate> {
        self.quantities.iter().find(|quantity| quantity.name == name).map(|quantity| &quantity.estimate)
    }
}

impl RecordOutcome {
    /// A record of this kind, in which nothing was found yet.
    pub(super) fn new(kind: &'static str, title: impl Into<String>, method: impl Into<String>) -> Self {
        Self {
            kind,
            title: title.into(),
            method: method.into(),
            quantities: Vec::new(),
            covariance: None,
            compensation: Vec::new(),
            tables: Vec::new(),
            figures: Vec::new(),
            checks: Vec::new(),
            not_observed: Vec::new(),
            warnings: Vec::new(),
            not_stated: Vec::new(),
        }
    }

    /// Adds the scale factors of sensors that give codes of a converter as codes by the unit: the stated sensitivity times the scale factor.
    pub(super) fn push_sensitivities(&mut self, unit: &InertialUnit) {
        let each = [
            (unit.channels.as_ref(), QuantityUnit::other("LSB/(rad/s)", 1.0_f64.to_radians(), "LSB/(deg/s)")),
            (unit.accelerometers.as_ref(), QuantityUnit::other("LSB/(m/s^2)", STANDARD_GRAVITY, "LSB/gn")),
        ];
        let mut found = Vec::new();
        for (place, (channels, unit)) in each.into_iter().enumerate() {
            let choices = channels.into_iter().flat_map(Channels::choices);
            for (axis, choice) in choices.filter(|(_, choice)| choice.sensitivity().is_some()) {
                let scale = choice.reading().and_then(|reading| reading.scale.as_ref());
                let Some(by) = scale.map(|scale| scale.si().recip()) else { continue };
                let is_of = |name: &str| {
                    let (sensor, rest) = name.split_once("scale_factor_").unwrap_or((name, ""));
                    let is_force = sensor == "accelerometer_";
                    let is_axis =
                        rest == axis || rest.strip_prefix(axis).is_some_and(|rest| rest.starts_with("_at_"));
                    is_axis && is_force == (place == 1)
                };
                for own in self.quantities.iter().filter(|own| is_of(&own.name)) {
                    let mut budget = own.budget.clone();
                    for input in &mut budget {
                        input.sensitivity *= by;
                    }
                    let name = own.name.replace("scale_factor", "sensitivity");
                    found.push(CalibratedQuantity { name, unit, estimate: own.estimate.times(by), budget });
                }
            }
        }
        self.quantities.extend(found);
    }

    /// The scale factors under vibration in codes by the unit; none of a sensor whose sensitivity is not stated.
    pub(super) fn sensitivities_under_vibration(
        result: &CalibratedGyroscope,
        unit: &InertialUnit,
    ) -> Option<Self> {
        let title = format!("Sensitivity: {}, {}", result.condition, result.reference);
        let mut outcome =
            Self::new("condition", title, "Sensitivities are the stated ones times the scale factors.");
        let name = format!("scale_factor_{}", AXES[result.main]);
        let whole = result.withheld.is_none().then(|| (name.clone(), result.scale_factor));
        let at = result.by_frequency.iter();
        let each = at.map(|at| (format!("{name}_at_{:.2}_hz", at.frequency_hz), at.scale_factor));
        for (name, estimate) in whole.into_iter().chain(each) {
            let inputs = result.budget.iter().filter_map(|part| part.input.clone());
            let budget = if name.contains("_at_") { Vec::new() } else { inputs.collect() };
            outcome.quantities.push(CalibratedQuantity { name, unit: QuantityUnit::RATIO, estimate, budget });
        }
        let factors = outcome.quantities.len();
        outcome.push_sensitivities(unit);
        outcome.quantities.drain(..factors);
        (!outcome.quantities.is_empty()).then_some(outcome)
    }

    /// Adds a check of what was assumed.
    pub(super) fn check(&mut self, kind: CheckKind, place: &str, passes: bool, found: impl Into<String>) {
        self.checks.push(CertificateCheck::new(kind, place, passes, found));
    }

    /// Adds a number; one that the record does not determine is named instead.
    pub(super) fn push_known(
        &mut self,
        name: impl Into<String>,
        unit: QuantityUnit,
        value: f64,
        budget: Vec<Input>,
    ) {
        let name = name.into();
        let size = budget.first().map_or(f64::INFINITY, |input| input.standard_uncertainty);
        if value.is_finite() && size <= unit.unknown {
            let estimate = estimate(value, &budget);
            self.quantities.push(CalibratedQuantity { name, unit, estimate, budget });
        } else {
            self.not_observed.push(format!(
                "{}: the record does not determine it (standard uncertainty {size:.1e} {})",
                name.replace('_', " "),
                unit.unit
            ));
        }
    }
}

/// An input whose value is 0, by its size in the unit of the result.
pub(super) fn contribution(
    name: &str,
    standard_uncertainty: f64,
    degrees_of_freedom: f64,
    evaluation: Evaluation,
) -> Input {
    Input {
        name: name.to_owned(),
        unit: "",
        value: 0.0,
        standard_uncertainty,
        distribution: Distribution::Normal,
        degrees_of_freedom,
        evaluation,
        source: String::new(),
        sensitivity: 1.0,
    }
}

/// The inputs of a number that has the scatter of the residuals only.
pub(super) fn by_scatter(deviation: f64, freedom: usize) -> Vec<Input> {
    vec![contribution("scatter of the residuals", deviation, freedom as f64, Evaluation::A)]
}

/// A stated uncertainty by its size in the unit of the result.
pub(super) fn stated_contribution<K: KindOf>(
    name: &str,
    stated: &StandardUncertainty<K>,
    sensitivity: f64,
) -> Input {
    Input {
        distribution: stated.distribution(),
        source: stated.source().unwrap_or_default().to_owned(),
        ..contribution(
            name,
            (stated.standard() * sensitivity).abs(),
            stated.degrees_of_freedom(),
            Evaluation::B,
        )
    }
}

/// A number with its inputs, which are independent; the first one is what the record itself tells (type A).
pub(super) fn estimate(value: f64, inputs: &[Input]) -> UncertainEstimate {
    let of = |inputs: &[Input]| {
        let budget = Budget { inputs: inputs.to_vec(), correlations: Vec::new() };
        budget.combined(super::inputs::PROBABILITY)
    };
    UncertainEstimate::of(value, of(inputs.get(..1).unwrap_or_default()), of(inputs))
}

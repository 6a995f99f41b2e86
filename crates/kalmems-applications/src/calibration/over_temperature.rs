//! Numbers of several records, each at a temperature, as curves over the temperature: at rising and at falling temperature apart where the file says how each
//! temperature was reached.

use super::error::CalibrationError;
use super::inputs::PROBABILITY;
use super::quantities::{CalibratedQuantity, RecordOutcome, by_scatter};
use super::temperature_curve::{AtTemperature, CurveBasis, FittedCurve};
use super::tone::AXES;
use crate::calibration::file::{CurveChoice, GyroscopeCalibration, TemperatureDirection};
use crate::config::Quantity;
use crate::fit::FitError;
use crate::metrology::{Evaluation, Input, coverage_factor};

/// A record at a temperature.
struct RecordAtTemperature<'a> {
    temperature_k: f64,
    direction: Option<TemperatureDirection>,
    found: &'a RecordOutcome,
}

/// What the records of one axis or unit have in common.
struct RecordsAtTemperatures<'a> {
    place: String,
    records: Vec<RecordAtTemperature<'a>>,
    choice: CurveChoice,
}

/// A number over the temperature: its values and the curves that are fitted to them.
struct NumberOverTemperature<'a> {
    number: &'a CalibratedQuantity,
    values: Vec<(AtTemperature, Option<TemperatureDirection>)>,
    range_k: [f64; 2],
    basis: CurveBasis,
    /// The temperature in K at which the hysteresis is stated.
    reference_k: f64,
}

/// What of a record on a rate table becomes a curve.
const OF_TABLE: [&str; 3] = ["scale_factor_", "bias_", "cross_axis_sensitivity_"];
/// What of a record of positions does; of the gyroscopes if no record on a rate table has a temperature.
const OF_FORCES: [&str; 3] =
    ["accelerometer_scale_factor_", "accelerometer_non_orthogonality_", "accelerometer_bias_"];
const OF_TURNED: [&str; 2] = ["gyroscope_scale_factor_", "gyroscope_non_orthogonality_"];

/// Scale factors, biases and cross-axis sensitivities of the records on a rate table at several temperatures.
pub(super) fn of_rates(
    file: &GyroscopeCalibration,
    rates: &[RecordOutcome],
) -> Result<Option<RecordOutcome>, CalibrationError> {
    let mut outcome = RecordOutcome::new("rates_over_temperature", "Rates over the temperature", METHOD);
    for (index, axis) in AXES.into_iter().enumerate() {
        let of_axis = file.rates.iter().zip(rates).filter(|(record, _)| record.axis.index() == index);
        let records = of_axis.filter_map(|(record, found)| {
            let temperature_k = record.temperature.as_ref()?.si();
            Some(RecordAtTemperature { temperature_k, direction: record.temperature_direction, found })
        });
        let records = RecordsAtTemperatures {
            place: format!("the rates of {axis}"),
            records: records.collect(),
            choice: file.rates_over_temperature.clone().unwrap_or_default(),
        };
        // A cycle at rest tells the bias at more temperatures.
        let export = |name: &str| {
            let has_better = name.starts_with("bias_") && file.temperature.is_some();
            (!has_better).then(|| format!("gyroscope_{name}"))
        };
        records.add_to(&mut outcome, &OF_TABLE, export)?;
    }
    Ok(if_any(outcome))
}

/// Scale factors, angles and biases of the records of positions at several temperatures.
pub(super) fn of_positions(
    file: &GyroscopeCalibration,
    positions: &[RecordOutcome],
) -> Result<Option<RecordOutcome>, CalibrationError> {
    let mut outcome =
        RecordOutcome::new("positions_over_temperature", "Positions over the temperature", METHOD);
    let records = file.all_positions().zip(positions).filter_map(|(record, found)| {
        let temperature_k = record.temperature.as_ref()?.si();
        Some(RecordAtTemperature { temperature_k, direction: record.temperature_direction, found })
    });
    let records = RecordsAtTemperatures {
        place: "the positions".to_owned(),
        records: records.collect(),
        choice: file.positions_over_temperature.clone().unwrap_or_default(),
    };
    let mut kinds = OF_FORCES.to_vec();
    if file.rates.iter().all(|record| record.temperature.is_none()) {
        kinds.extend(OF_TURNED);
    }
    records.add_to(&mut outcome, &kinds, |name| Some(name.to_owned()))?;
    Ok(if_any(outcome))
}

fn if_any(outcome: RecordOutcome) -> Option<RecordOutcome> {
    let is_empty = outcome.quantities.is_empty() && outcome.not_observed.is_empty();
    (!is_empty).then_some(outcome)
}

const METHOD: &str = "Numbers of records at several temperatures are fitted by a straight line over the temperature, from five records on by a parabola, or as \
    the file states it, apart for temperatures that were reached from below and from above if the file states that; the scatter of the residuals is the \
    type A evaluation.";

impl RecordsAtTemperatures<'_> {
    /// Adds the curves of all numbers whose name begins with one of these, and exports them under the name that is given.
    fn add_to(
        &self,
        outcome: &mut RecordOutcome,
        kinds: &[&str],
        export: impl Fn(&str) -> Option<String>,
    ) -> Result<(), CalibrationError> {
        let of_first = self.records.first().map_or(&[][..], |first| &first.found.quantities);
        for number in of_first.iter().filter(|own| kinds.iter().any(|kind| own.name.starts_with(kind))) {
            let number = self.number(number);
            number.add_to(outcome, &self.place, export(&number.number.name))?;
        }
        Ok(())
    }

    fn number<'a>(&self, number: &'a CalibratedQuantity) -> NumberOverTemperature<'a> {
        let values = self.records.iter().filter_map(|record| {
            let value = record.found.estimate(&number.name)?.value;
            Some((AtTemperature { temperature_k: record.temperature_k, value }, record.direction))
        });
        let values: Vec<_> = values.collect();
        let range_k = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (own, _)| {
            [low.min(own.temperature_k), high.max(own.temperature_k)]
        });
        let basis = self.choice.basis(range_k, if values.len() < 5 { 1 } else { 2 });
        let reference_k = self.choice.reference_k(range_k);
        NumberOverTemperature { number, values, range_k, basis, reference_k }
    }
}

impl NumberOverTemperature<'_> {
    fn add_to(
        &self,
        outcome: &mut RecordOutcome,
        place: &str,
        export: Option<String>,
    ) -> Result<(), CalibrationError> {
        let place = || place.to_owned();
        let failed = |fault: FitError| CalibrationError::RecordFit { place: place(), fault };
        let Some(both) = self.fitted(None).transpose().map_err(failed)? else {
            if self.values.len() > 1 {
                outcome.not_observed.push(self.too_few("", self.values.len()));
            }
            return Ok(());
        };
        let name = &self.number.name;
        let has_directions = self.values.iter().any(|(_, direction)| direction.is_some());
        let mut legs = Vec::new();
        for direction in
            [TemperatureDirection::Up, TemperatureDirection::Down].into_iter().filter(|_| has_directions)
        {
            if let Some(found) = self.fitted(Some(direction)).transpose().map_err(failed)? {
                legs.push((direction, found));
            } else {
                let count = self.values.iter().filter(|(_, own)| *own == Some(direction)).count();
                outcome.not_observed.push(self.too_few(&format!(" that goes {}", direction.name()), count));
            }
        }
        if legs.is_empty() {
            self.add_parameters(outcome, name, &both);
        }
        for (direction, found) in &legs {
            self.add_parameters(outcome, &format!("{name}_{}", direction.name()), found);
        }
        if let [(_, up), (_, down)] = &legs[..] {
            let ((above, of_up), (below, of_down)) =
                (up.value(self.reference_k), down.value(self.reference_k));
            let mut inputs = by_scatter(of_up, up.freedom);
            inputs.extend(by_scatter(of_down, down.freedom));
            outcome.push_known(format!("{name}_hysteresis"), self.number.unit, above - below, inputs);
        }
        if let Some(export) = export {
            let ways =
                legs.iter().map(|(direction, found)| (format!("{export}_{}", direction.name()), found));
            let curves = std::iter::once((export.clone(), &both)).chain(ways);
            let unit = self.number.unit.unit;
            let stated = self.stated_square();
            outcome
                .compensation
                .extend(curves.map(|(name, found)| found.curve(name, unit, self.range_k, stated)));
        }
        Ok(())
    }

    /// The curve through the values, or those of one direction; none if they are too few.
    fn fitted(&self, direction: Option<TemperatureDirection>) -> Option<Result<FittedCurve<'_>, FitError>> {
        let chosen = self.values.iter().filter(|(_, own)| direction.is_none() || *own == direction);
        let values: Vec<AtTemperature> = chosen.map(|(value, _)| *value).collect();
        let is_known = values.len() > self.basis.count() && self.range_k[1] > self.range_k[0];
        is_known.then(|| FittedCurve::of(&self.basis, &values))
    }

    fn too_few(&self, which: &str, found: usize) -> String {
        format!(
            "{} over the temperature{which}: there are {found} records, and the curve takes {}",
            self.number.name.replace('_', " "),
            self.basis.count() + 1
        )
    }

    /// What is stated of the instruments is common to all records, and no scatter of theirs.
    fn stated(&self) -> impl Iterator<Item = &Input> {
        self.number.budget.iter().filter(|input| input.evaluation == Evaluation::B)
    }

    /// The square of the expanded uncertainty of that.
    fn stated_square(&self) -> f64 {
        let square: f64 =
            self.stated().map(|input| (input.sensitivity * input.standard_uncertainty).powi(2)).sum();
        square * coverage_factor(PROBABILITY, f64::INFINITY).powi(2)
    }

    fn add_parameters(&self, outcome: &mut RecordOutcome, name: &str, found: &FittedCurve<'_>) {
        for place in 0..self.basis.count() {
            let parameter = found.fit.parameter(place);
            let mut inputs = by_scatter(parameter.deviation, found.freedom);
            inputs.extend(self.stated().filter(|_| self.basis.is_shifted(place)).cloned());
            outcome.push_known(
                format!("{name}_{}", self.basis.ending(place)),
                self.basis.unit(self.number.unit, place),
                parameter.value,
                inputs,
            );
        }
    }
}

impl CurveChoice {
    /// The temperature from which a polynomial counts, and at which the hysteresis is stated.
    pub(super) fn reference_k(&self, [low, high]: [f64; 2]) -> f64 {
        self.reference.as_ref().map_or(low.midpoint(high), Quantity::si)
    }

    pub(super) fn basis(&self, range: [f64; 2], usual_order: usize) -> CurveBasis {
        match self.knots {
            Some(knots) => CurveBasis::spline(range, usize::from(knots)),
            None => CurveBasis::Polynomial {
                reference_k: self.reference_k(range),
                order: self.order.map_or(usual_order, usize::from),
            },
        }
    }
}

//! Bias at rest over a cycle of temperature, and scale factors at several temperatures, as polynomials.

use super::error::CalibrationError;
use super::files::InputFiles;
use super::linear_model::LinearModel;
use super::quantities::{
    CalibratedQuantity, QuantityUnit, RecordOutcome, STANDARD_GRAVITY, TemperaturePolynomial, by_scatter,
};
use super::rest::InertialSensor;
use super::tone::AXES;
use super::unit_record::UnitSamples;
use crate::calibration::file::GyroscopeCalibration;
use crate::config::{Key, Quantity};
use crate::fit::{Fit, FitError};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// Coefficients of a polynomial of the highest order.
const COEFFICIENTS: usize = 5;
/// The order if nothing is stated.
const ORDER: usize = 2;
/// Blocks of a record whose means are fitted, and samples that each has at least.
const BLOCKS: usize = 120;
const SHORTEST_BLOCK: usize = 8;
/// Blocks that a part of the cycle takes for each coefficient.
const BLOCKS_PER_COEFFICIENT: usize = 4;
/// The part of the range by which the temperature turns before its direction does.
const TURN: f64 = 0.02;
/// Temperatures of the table.
const ROWS: usize = 5;

/// The mean of a block.
#[derive(Clone, Copy)]
struct TemperatureBlock {
    /// In K.
    temperature: f64,
    value: f64,
}

/// A direction of the temperature.
#[derive(Clone, Copy, PartialEq, Eq)]
enum TemperatureDirection {
    Up,
    Down,
}

impl TemperatureDirection {
    const fn name(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Down => "down",
        }
    }
}

/// The outcome of the record at rest during a cycle of temperature, if the file names one.
pub(super) fn measure(files: &mut InputFiles) -> Result<Option<RecordOutcome>, CalibrationError> {
    let file = files.file;
    let Some(record) = &file.temperature else { return Ok(None) };
    let samples = record.of_unit(&file.gyroscope).read(files, Key::from("temperature").child("file"))?;
    let mut outcome = RecordOutcome::new("temperature", "Temperature", METHOD);
    outcome.warnings.clone_from(&samples.remarks);
    let order = record.order.map_or(ORDER, usize::from);
    let (low, high) = samples
        .further()
        .iter()
        .filter(|t| t.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)));
    let reference = record.reference.as_ref().map_or(0.5 * (low + high), Quantity::si);
    for (sensor, all) in
        [(InertialSensor::Gyroscope, samples.rates()), (InertialSensor::Accelerometer, samples.forces())]
    {
        for (axis, values) in AXES.into_iter().zip(all) {
            let Some(values) = values else { continue };
            let cycle =
                TemperatureCycle { samples: &samples, sensor, axis, reference, range: [low, high], order };
            cycle.measure(&mut outcome, values)?;
        }
    }
    if samples.forces().iter().any(Option::is_some) {
        outcome.not_observed.push(
            "bias and scale factor of an accelerometer apart: what it shows at rest has gravity times its scale factor in it, in one position".to_owned(),
        );
    }
    Ok(Some(outcome))
}

const METHOD: &str = "Temperature: means of equal parts of a record at rest are fitted by a polynomial of the temperature, apart for rising and for falling \
    temperature. The scatter of the residuals is the type A evaluation; if neighbouring residuals are correlated, the variance is larger by (1 + r)/(1 − r) and \
    the degrees of freedom are fewer by as much.";

/// A channel over a cycle of temperature.
struct TemperatureCycle<'a> {
    samples: &'a UnitSamples,
    sensor: InertialSensor,
    axis: &'static str,
    reference: f64,
    range: [f64; 2],
    order: usize,
}

/// A polynomial with the inflation of its standard deviations and its effective degrees of freedom.
struct FittedPolynomial {
    fit: Fit<COEFFICIENTS>,
    inflation: f64,
    freedom: usize,
}

impl FittedPolynomial {
    /// Of blocks in their order in time.
    fn of(blocks: &[TemperatureBlock], reference: f64, order: usize) -> Result<Self, FitError> {
        let terms: Vec<[f64; COEFFICIENTS]> =
            blocks.iter().map(|block| powers(block.temperature - reference)).collect();
        let values: Vec<f64> = blocks.iter().map(|block| block.value).collect();
        let fit = LinearModel { terms: &terms, values: &values }
            .fit(std::array::from_fn(|coefficient| coefficient <= order))?;
        let residual = |k: usize| values[k] - at(&fit.parameters, blocks[k].temperature - reference);
        let products: f64 = (1..values.len()).map(|k| residual(k) * residual(k - 1)).sum();
        let correlation = (products / fit.sum_of_squares.max(f64::MIN_POSITIVE)).clamp(0.0, 0.9);
        let inflation = (1.0 + correlation) / (1.0 - correlation);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of blocks
        let freedom = ((fit.degrees_of_freedom as f64 / inflation) as usize).max(1);
        Ok(Self { fit, inflation: inflation.sqrt(), freedom })
    }

    /// The value at a temperature from the reference, and its standard deviation.
    fn value(&self, off: f64) -> (f64, f64) {
        let row = powers(off);
        let variance: f64 = (0..COEFFICIENTS)
            .map(|i| (0..COEFFICIENTS).map(|j| row[i] * self.fit.covariance.get(i, j) * row[j]).sum::<f64>())
            .sum();
        (at(&self.fit.parameters, off), self.inflation * variance.max(0.0).sqrt())
    }
}

/// The unit of a coefficient of this power of the temperature.
fn per_kelvin(of: QuantityUnit, power: usize) -> QuantityUnit {
    let (units, factor, shown) = match of.unit {
        "rad/s" => (
            ["rad/s", "rad/s/K", "rad/s/K^2", "rad/s/K^3", "rad/s/K^4"],
            of.factor,
            ["deg/h", "deg/h/K", "deg/h/K^2", "deg/h/K^3", "deg/h/K^4"],
        ),
        "m/s^2" => (
            ["m/s^2", "m/s^2/K", "m/s^2/K^2", "m/s^2/K^3", "m/s^2/K^4"],
            of.factor,
            ["ugn", "ugn/K", "ugn/K^2", "ugn/K^3", "ugn/K^4"],
        ),
        _ => {
            (["1", "1/K", "1/K^2", "1/K^3", "1/K^4"], 1e6, ["ppm", "ppm/K", "ppm/K^2", "ppm/K^3", "ppm/K^4"])
        }
    };
    let power = power.min(COEFFICIENTS - 1);
    if power == 0 { of } else { QuantityUnit::other(units[power], factor, shown[power]) }
}

fn powers(off: f64) -> [f64; COEFFICIENTS] {
    let mut power = 1.0;
    std::array::from_fn(|_| {
        let now = power;
        power *= off;
        now
    })
}

fn at(coefficients: &[f64; COEFFICIENTS], off: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * off + coefficient)
}

impl TemperatureCycle<'_> {
    fn name(&self) -> String {
        match self.sensor {
            InertialSensor::Gyroscope => format!("gyroscope_bias_{}", self.axis),
            InertialSensor::Accelerometer => format!("accelerometer_at_rest_{}", self.axis),
        }
    }

    /// The unit of a coefficient.
    fn unit(&self, power: usize) -> QuantityUnit {
        per_kelvin(
            match self.sensor {
                InertialSensor::Gyroscope => QuantityUnit::rate(),
                InertialSensor::Accelerometer => QuantityUnit::other("m/s^2", 1e6 / STANDARD_GRAVITY, "ugn"),
            },
            power,
        )
    }

    /// The means of blocks with the direction of the temperature in each.
    fn blocks(&self, values: &[f64]) -> Vec<(TemperatureBlock, TemperatureDirection)> {
        let rows: usize = self.samples.time.rows.iter().map(ExactSizeIterator::len).sum();
        let length = (rows / BLOCKS).max(SHORTEST_BLOCK);
        let mut blocks: Vec<TemperatureBlock> = Vec::new();
        for stretch in &self.samples.time.rows {
            let part = |all: &[f64], from: usize| {
                let part = all.get(from..from + length).unwrap_or_default();
                part.iter().sum::<f64>() / part.len() as f64
            };
            let starts = (stretch.start..=stretch.end.saturating_sub(length)).step_by(length);
            for start in starts.filter(|start| start + length <= stretch.end) {
                let block = TemperatureBlock {
                    temperature: part(self.samples.further(), start),
                    value: part(values, start),
                };
                if block.temperature.is_finite() && block.value.is_finite() {
                    blocks.push(block);
                }
            }
        }
        directions(&blocks, TURN * (self.range[1] - self.range[0]))
    }

    fn measure(&self, outcome: &mut RecordOutcome, values: &[f64]) -> Result<(), CalibrationError> {
        let place = || format!("{}, {}", self.samples.place, self.name().replace('_', " "));
        let failed = |fault: FitError| CalibrationError::RecordFit { place: place(), fault };
        let all = self.blocks(values);
        let fewest = BLOCKS_PER_COEFFICIENT * (self.order + 1);
        let fitted =
            |direction: Option<TemperatureDirection>| -> Result<Option<FittedPolynomial>, CalibrationError> {
                let blocks: Vec<TemperatureBlock> = all
                    .iter()
                    .filter(|(_, own)| direction.is_none_or(|direction| *own == direction))
                    .map(|(block, _)| *block)
                    .collect();
                if blocks.len() < fewest {
                    return Ok(None);
                }
                FittedPolynomial::of(&blocks, self.reference, self.order).map(Some).map_err(failed)
            };
        let Some(both) = fitted(None)? else {
            return Err(CalibrationError::Rest { place: place(), samples: values.len() });
        };
        let ways = [TemperatureDirection::Up, TemperatureDirection::Down]
            .map(|direction| (direction, fitted(Some(direction))));
        let mut legs = Vec::new();
        for (direction, found) in ways {
            match found? {
                Some(found) => legs.push((direction, found)),
                None => outcome.not_observed.push(format!(
                    "{} at a temperature that goes {}: fewer than {fewest} parts of the record do",
                    self.name().replace('_', " "),
                    direction.name()
                )),
            }
        }
        for (direction, found) in &legs {
            for power in 0..=self.order {
                let coefficient = found.fit.parameter(power);
                let inputs = by_scatter(found.inflation * coefficient.deviation, found.freedom);
                let name = format!("{}_{}_{power}", self.name(), direction.name());
                outcome.push_known(name, self.unit(power), coefficient.value, inputs);
            }
        }
        if let [(_, up), (_, down)] = &legs[..] {
            let ((above, of_up), (below, of_down)) = (up.value(0.0), down.value(0.0));
            let mut inputs = by_scatter(of_up, up.freedom);
            inputs.extend(by_scatter(of_down, down.freedom));
            let name = format!("{}_hysteresis", self.name());
            outcome.push_known(name, self.unit(0), above - below, inputs);
        }
        outcome.compensation.push(TemperaturePolynomial {
            name: self.name(),
            unit: self.unit(0).unit,
            reference_k: self.reference,
            range_k: self.range,
            coefficients: both.fit.parameters[..=self.order].to_vec(),
        });
        outcome.tables.push(self.table(&legs));
        outcome.figures.push(self.figure(&all, &legs));
        Ok(())
    }

    fn table(&self, legs: &[(TemperatureDirection, FittedPolynomial)]) -> TextTable {
        let QuantityUnit { factor, shown, .. } = self.unit(0);
        let heads = legs.iter().flat_map(|(direction, _)| {
            [
                ColumnHead::number(direction.name(), shown),
                ColumnHead::number(format!("standard uncertainty, {}", direction.name()), shown),
            ]
        });
        let columns = std::iter::once(ColumnHead::number("temperature", "K")).chain(heads);
        let caption = format!("{} over the temperature", self.name().replace('_', " "));
        let mut table = TextTable::new(caption, columns);
        for row in 0..ROWS {
            let part = row as f64 / (ROWS - 1) as f64;
            let temperature = self.range[0] + part * (self.range[1] - self.range[0]);
            let cells = legs.iter().flat_map(|(_, found)| {
                let (value, deviation) = found.value(temperature - self.reference);
                [format!("{:+.3}", factor * value), format!("{:.3}", factor * deviation)]
            });
            table.push(std::iter::once(format!("{temperature:.2}")).chain(cells));
        }
        table
    }

    fn figure(
        &self,
        all: &[(TemperatureBlock, TemperatureDirection)],
        legs: &[(TemperatureDirection, FittedPolynomial)],
    ) -> Figure {
        let QuantityUnit { factor, shown, .. } = self.unit(0);
        let mut panel =
            Panel::new(Axis::new("temperature", "K"), Axis::new(self.name().replace('_', " "), shown));
        for (direction, found) in legs {
            let points: Vec<(f64, f64)> = all
                .iter()
                .filter(|(_, own)| own == direction)
                .map(|(block, _)| (block.temperature, factor * block.value))
                .collect();
            let role = if *direction == TemperatureDirection::Up {
                SeriesRole::Measured
            } else {
                SeriesRole::Reference
            };
            panel = panel.with(Series::points(format!("means, {}", direction.name()), role, points));
            let line: Vec<(f64, f64)> = (0..=50)
                .map(|k| self.range[0] + f64::from(k) / 50.0 * (self.range[1] - self.range[0]))
                .map(|temperature| (temperature, factor * found.value(temperature - self.reference).0))
                .collect();
            let role =
                if *direction == TemperatureDirection::Up { SeriesRole::Estimate } else { SeriesRole::Model };
            panel = panel.with(Series::line(format!("polynomial, {}", direction.name()), role, line));
        }
        Figure::new(
            format!("temperature-{}", self.name().replace('_', "-")),
            format!("{} over the temperature", self.name().replace('_', " ")),
            "Means of equal parts of the record at rising and at falling temperature, and the polynomials that were fitted to both.",
        )
        .with(panel)
    }
}

/// The direction of the temperature in each block: it turns where the temperature has come back by so much from its last extreme.
fn directions(blocks: &[TemperatureBlock], turn: f64) -> Vec<(TemperatureBlock, TemperatureDirection)> {
    let mut found: Vec<(TemperatureBlock, TemperatureDirection)> = Vec::with_capacity(blocks.len());
    let mut extreme = 0;
    let mut now: Option<TemperatureDirection> = None;
    for (place, block) in blocks.iter().enumerate() {
        let beyond = block.temperature - blocks[extreme].temperature;
        let (keeps, turned) = match now {
            Some(TemperatureDirection::Up) => {
                (beyond >= 0.0, (beyond < -turn).then_some(TemperatureDirection::Down))
            }
            Some(TemperatureDirection::Down) => {
                (beyond <= 0.0, (beyond > turn).then_some(TemperatureDirection::Up))
            }
            None if beyond > turn => (true, Some(TemperatureDirection::Up)),
            None if beyond < -turn => (true, Some(TemperatureDirection::Down)),
            None => (false, None),
        };
        if let Some(turned) = turned {
            // What came since the extreme went the new way already.
            found.iter_mut().skip(extreme).for_each(|(_, own)| *own = turned);
            now = Some(turned);
        }
        if keeps || turned.is_some() {
            extreme = place;
        }
        found.push((*block, now.unwrap_or(TemperatureDirection::Up)));
    }
    found
}

/// What of a record on a rate table becomes a polynomial of the temperature.
const OVER_TEMPERATURE: [&str; 3] = ["scale_factor_", "bias_", "cross_axis_sensitivity_"];

/// Scale factors, biases and cross-axis sensitivities of the records on a rate table at several temperatures: for each axis with three or more a
/// polynomial of the temperature.
pub(super) fn of_rates(
    file: &GyroscopeCalibration,
    rates: &[RecordOutcome],
) -> Result<Option<RecordOutcome>, CalibrationError> {
    let mut outcome = RecordOutcome::new("rates_over_temperature", "Rates over the temperature", OF_RATES);
    for (index, axis) in AXES.into_iter().enumerate() {
        let of_axis: Vec<(f64, &RecordOutcome)> = (file.rates.iter().zip(rates))
            .filter(|(record, _)| record.axis.index() == index)
            .filter_map(|(record, found)| Some((record.temperature.as_ref()?.si(), found)))
            .collect();
        let of_first = of_axis.first().map_or(&[][..], |(_, first)| &first.quantities);
        for CalibratedQuantity { name, unit, .. } in
            of_first.iter().filter(|own| OVER_TEMPERATURE.iter().any(|kind| own.name.starts_with(kind)))
        {
            let found = |(temperature, record): &(f64, &RecordOutcome)| {
                let value = record.estimate(name)?.value;
                Some(TemperatureBlock { temperature: *temperature, value })
            };
            let blocks: Vec<TemperatureBlock> = of_axis.iter().filter_map(found).collect();
            let temperatures = || blocks.iter().map(|block| block.temperature);
            let range_k = [
                temperatures().fold(f64::INFINITY, f64::min),
                temperatures().fold(f64::NEG_INFINITY, f64::max),
            ];
            if blocks.len() < 3 || range_k[1] - range_k[0] <= 0.0 {
                continue;
            }
            let reference_k = range_k[0].midpoint(range_k[1]);
            let order = if blocks.len() < 5 { 1 } else { 2 };
            let place = || format!("the rates of {axis}");
            let failed = |fault: FitError| CalibrationError::RecordFit { place: place(), fault };
            let terms: Vec<[f64; COEFFICIENTS]> =
                blocks.iter().map(|block| powers(block.temperature - reference_k)).collect();
            let values: Vec<f64> = blocks.iter().map(|block| block.value).collect();
            let fit = LinearModel { terms: &terms, values: &values }
                .fit(std::array::from_fn(|coefficient| coefficient <= order))
                .map_err(failed)?;
            for power in 0..=order {
                let coefficient = fit.parameter(power);
                let inputs = by_scatter(coefficient.deviation, fit.degrees_of_freedom);
                outcome.push_known(
                    format!("{name}_{power}"),
                    per_kelvin(*unit, power),
                    coefficient.value,
                    inputs,
                );
            }
            // A cycle at rest tells the bias at more temperatures.
            if name.starts_with("bias_") && file.temperature.is_some() {
                continue;
            }
            outcome.compensation.push(TemperaturePolynomial {
                name: format!("gyroscope_{name}"),
                unit: unit.unit,
                reference_k,
                range_k,
                coefficients: fit.parameters[..=order].to_vec(),
            });
        }
    }
    Ok((!outcome.quantities.is_empty()).then_some(outcome))
}

const OF_RATES: &str = "Scale factors, biases and cross-axis sensitivities of records at several temperatures are fitted by a straight line over the \
    temperature, from five records on by a parabola; the scatter of the residuals is the type A evaluation.";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_direction_turns_at_the_extremes_and_not_at_the_noise() {
        let temperature = |k: usize| {
            let noise = 0.05 * ((k * 7919 % 13) as f64 / 13.0 - 0.5);
            let cycle = if k < 40 { k as f64 } else { 80.0 - k as f64 };
            300.0 + 0.5 * cycle + noise
        };
        let blocks: Vec<TemperatureBlock> =
            (0..80).map(|k| TemperatureBlock { temperature: temperature(k), value: 0.0 }).collect();
        let found = directions(&blocks, 0.4);
        assert!(found[..40].iter().all(|(_, direction)| *direction == TemperatureDirection::Up));
        assert!(found[42..].iter().all(|(_, direction)| *direction == TemperatureDirection::Down));
    }
}

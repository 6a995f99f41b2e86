//! Bias at rest over a cycle of temperature as polynomials or splines.

use super::checks::CheckKind;
use super::error::CalibrationError;
use super::files::InputFiles;
use super::inputs::PROBABILITY;
use super::motion::{RestMotion, RestPieces};
use super::quantities::{QuantityUnit, RecordOutcome, STANDARD_GRAVITY, by_scatter};
use super::rest::InertialSensor;
use super::rest_record::{describe, figure_of_pieces};
use super::rest_samples::RestSamples;
use super::rest_spectrum::RestSpectrum;
use super::temperature_curve::{AtTemperature, CurveBasis, FittedCurve};
use super::tone::AXES;
use super::unit_record::UnitSamples;
use crate::calibration::file::TemperatureDirection;
use crate::config::Key;
use crate::fit::FitError;
use crate::metrology::coverage_factor;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};

/// The order of a polynomial if nothing is stated.
const ORDER: usize = 2;
/// Blocks of a record whose means are fitted, and samples that each has at least.
const BLOCKS: usize = 120;
const SHORTEST_BLOCK: usize = 8;
/// Blocks that a part of the cycle takes for each coefficient.
const BLOCKS_PER_COEFFICIENT: usize = 4;
/// The part of the range by which the temperature turns before its direction does.
const TURN: f64 = 0.02;
/// The outcome of the record at rest during a cycle of temperature, if the file names one.
pub(super) fn measure(files: &mut InputFiles) -> Result<Option<RecordOutcome>, CalibrationError> {
    let file = files.file;
    let Some(record) = &file.temperature else { return Ok(None) };
    let samples = record.of_unit(&file.gyroscope).read(files, Key::from("temperature").child("file"))?;
    let mut outcome = RecordOutcome::new("temperature", "Temperature", METHOD);
    outcome.warnings.clone_from(&samples.remarks);
    look_for_motion(&mut outcome, files, &samples);
    let choice = record.curve();
    let (low, high) = samples
        .further()
        .iter()
        .filter(|t| t.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(*t), high.max(*t)));
    let basis = choice.basis([low, high], ORDER);
    let reference_k = choice.reference_k([low, high]);
    for (sensor, all) in
        [(InertialSensor::Gyroscope, samples.rates()), (InertialSensor::Accelerometer, samples.forces())]
    {
        for (axis, values) in AXES.into_iter().zip(all) {
            let Some(values) = values else { continue };
            let cycle = TemperatureCycle {
                samples: &samples,
                sensor,
                axis,
                reference_k,
                range: [low, high],
                basis: &basis,
            };
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

/// The still and the moving parts of each channel in a figure, and whether there are any of the latter.
fn look_for_motion(outcome: &mut RecordOutcome, files: &mut InputFiles, samples: &UnitSamples) {
    let mut channels: Vec<(InertialSensor, &'static str, RestSamples)> = Vec::new();
    for (sensor, all) in
        [(InertialSensor::Gyroscope, samples.rates()), (InertialSensor::Accelerometer, samples.forces())]
    {
        for (axis, values) in AXES.into_iter().zip(all) {
            let Some(values) = values else { continue };
            let mut found = RestSamples::default();
            for rows in &samples.time.rows {
                found.take(values.get(rows.clone()).unwrap_or_default(), |row| {
                    samples.time_s(rows.start + row)
                });
                found.end_record();
            }
            channels.push((sensor, axis, found));
        }
    }
    let each = channels.iter().map(|(sensor, axis, found)| (*sensor, *axis, found));
    let figure = figure_of_pieces("temperature-parts", format!("At rest: {}", samples.place), each);
    files.parts.push(figure.clone());
    outcome.figures.push(figure);
    let motions = channels.iter().flat_map(|(sensor, axis, found)| {
        let motions = RestPieces::of(found).motions_but_drift(RestSpectrum::of(found.longest()).as_ref());
        let words = move |motion: &RestMotion| describe(motion, samples.time.interval_s, sensor.unit());
        motions.iter().map(|motion| format!("{}: {}", sensor.axis(axis), words(motion))).collect::<Vec<_>>()
    });
    let motions: Vec<String> = motions.collect();
    let found = if motions.is_empty() {
        "no motion and no line of the spectrum".to_owned()
    } else {
        motions.join(" ")
    };
    outcome.check(CheckKind::StillCycle, "temperature", motions.is_empty(), found);
    outcome.warnings.extend(motions);
}

const METHOD: &str = "Temperature: means of equal parts of a record at rest are fitted by a polynomial of the temperature or a natural cubic spline, apart for rising and for \
    falling temperature. The scatter of the residuals is the type A evaluation; if neighbouring residuals are correlated, the variance is larger by (1 + r)/(1 − r) and \
    the degrees of freedom are fewer by as much.";

/// A channel over a cycle of temperature.
struct TemperatureCycle<'a> {
    samples: &'a UnitSamples,
    sensor: InertialSensor,
    axis: &'static str,
    reference_k: f64,
    range: [f64; 2],
    basis: &'a CurveBasis,
}

impl TemperatureCycle<'_> {
    fn name(&self) -> String {
        match self.sensor {
            InertialSensor::Gyroscope => format!("gyroscope_bias_{}", self.axis),
            InertialSensor::Accelerometer => format!("accelerometer_at_rest_{}", self.axis),
        }
    }

    fn unit(&self) -> QuantityUnit {
        match self.sensor {
            InertialSensor::Gyroscope => QuantityUnit::rate(),
            InertialSensor::Accelerometer => QuantityUnit::other("m/s^2", 1e6 / STANDARD_GRAVITY, "ugn"),
        }
    }

    /// The means of blocks with the direction of the temperature in each.
    fn blocks(&self, values: &[f64]) -> Vec<(AtTemperature, TemperatureDirection)> {
        let rows: usize = self.samples.time.rows.iter().map(ExactSizeIterator::len).sum();
        let length = (rows / BLOCKS).max(SHORTEST_BLOCK);
        let mut blocks: Vec<AtTemperature> = Vec::new();
        for stretch in &self.samples.time.rows {
            let part = |all: &[f64], from: usize| {
                let part = all.get(from..from + length).unwrap_or_default();
                part.iter().sum::<f64>() / part.len() as f64
            };
            let starts = (stretch.start..=stretch.end.saturating_sub(length)).step_by(length);
            for start in starts.filter(|start| start + length <= stretch.end) {
                let block = AtTemperature {
                    temperature_k: part(self.samples.further(), start),
                    value: part(values, start),
                };
                if block.temperature_k.is_finite() && block.value.is_finite() {
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
        let fewest = BLOCKS_PER_COEFFICIENT * self.basis.count();
        let fitted =
            |direction: Option<TemperatureDirection>| -> Result<Option<FittedCurve<'_>>, CalibrationError> {
                let blocks: Vec<AtTemperature> = all
                    .iter()
                    .filter(|(_, own)| direction.is_none_or(|direction| *own == direction))
                    .map(|(block, _)| *block)
                    .collect();
                if blocks.len() < fewest {
                    return Ok(None);
                }
                FittedCurve::in_time(self.basis, &blocks).map(Some).map_err(failed)
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
            for place in 0..self.basis.count() {
                let parameter = found.fit.parameter(place);
                let inputs = by_scatter(found.inflation * parameter.deviation, found.freedom);
                let name = format!("{}_{}_{}", self.name(), direction.name(), self.basis.ending(place));
                outcome.push_known(name, self.basis.unit(self.unit(), place), parameter.value, inputs);
            }
        }
        if let [(_, up), (_, down)] = &legs[..] {
            let ((above, of_up), (below, of_down)) =
                (up.value(self.reference_k), down.value(self.reference_k));
            let mut inputs = by_scatter(of_up, up.freedom);
            inputs.extend(by_scatter(of_down, down.freedom));
            let name = format!("{}_hysteresis", self.name());
            outcome.push_known(name, self.unit(), above - below, inputs);
        }
        let ways =
            legs.iter().map(|(direction, found)| (format!("{}_{}", self.name(), direction.name()), found));
        let curves = std::iter::once((self.name(), &both)).chain(ways);
        let curves = curves.map(|(name, found)| found.curve(name, self.unit().unit, self.range, 0.0));
        outcome.compensation.extend(curves);
        outcome.tables.push(self.table(&legs));
        outcome.figures.push(self.figure(&all, &legs));
        Ok(())
    }

    fn table(&self, legs: &[(TemperatureDirection, FittedCurve<'_>)]) -> TextTable {
        let QuantityUnit { factor, shown, .. } = self.unit();
        let heads = legs.iter().flat_map(|(direction, _)| {
            [
                ColumnHead::number(direction.name(), shown),
                ColumnHead::number(format!("U (95 %), {}", direction.name()), shown),
            ]
        });
        let columns = std::iter::once(ColumnHead::number("temperature", "K")).chain(heads);
        let caption = format!("{} over the temperature", self.name().replace('_', " "));
        let mut table = TextTable::new(caption, columns);
        for temperature in self.basis.temperatures(self.range) {
            let cells = legs.iter().flat_map(|(_, found)| {
                let (value, expanded) = expanded_at(found, temperature);
                [format!("{:+.3}", factor * value), format!("{:.3}", factor * expanded)]
            });
            table.push(std::iter::once(format!("{temperature:.2}")).chain(cells));
        }
        table
    }

    fn figure(
        &self,
        all: &[(AtTemperature, TemperatureDirection)],
        legs: &[(TemperatureDirection, FittedCurve<'_>)],
    ) -> Figure {
        let QuantityUnit { factor, shown, .. } = self.unit();
        let mut panel =
            Panel::new(Axis::new("temperature", "K"), Axis::new(self.name().replace('_', " "), shown));
        for (direction, found) in legs {
            let points: Vec<(f64, f64)> = all
                .iter()
                .filter(|(_, own)| own == direction)
                .map(|(block, _)| (block.temperature_k, factor * block.value))
                .collect();
            let role = if *direction == TemperatureDirection::Up {
                SeriesRole::Measured
            } else {
                SeriesRole::Reference
            };
            panel = panel.with(Series::points(format!("means, {}", direction.name()), role, points));
            let at = |k: u8| self.range[0] + f64::from(k) / 50.0 * (self.range[1] - self.range[0]);
            let each = (0..=50).map(|k| (at(k), expanded_at(found, at(k))));
            let curve: Vec<(f64, [f64; 2])> = each
                .map(|(kelvin, (value, expanded))| (kelvin, [factor * value, factor * expanded]))
                .collect();
            let role =
                if *direction == TemperatureDirection::Up { SeriesRole::Estimate } else { SeriesRole::Model };
            let band = curve.iter().map(|(kelvin, [value, half])| (*kelvin, value - half, value + half));
            panel = panel.with(Series::band("", role, band.collect::<Vec<_>>()));
            let line: Vec<(f64, f64)> = curve.iter().map(|(kelvin, [value, _])| (*kelvin, *value)).collect();
            panel = panel.with(Series::line(format!("curve, {}", direction.name()), role, line));
        }
        Figure::new(
            format!("temperature-{}", self.name().replace('_', "-")),
            format!("{} over the temperature", self.name().replace('_', " ")),
            "Means of equal parts of the record at rising and at falling temperature, and the curves that were fitted to both, with 95 %.",
        )
        .with(panel)
    }
}

/// The value of a curve at a temperature, and its expanded uncertainty.
fn expanded_at(found: &FittedCurve<'_>, temperature_k: f64) -> (f64, f64) {
    let (value, deviation) = found.value(temperature_k);
    (value, coverage_factor(PROBABILITY, found.freedom as f64) * deviation)
}

/// The direction of the temperature in each block: it turns where the temperature has come back by so much from its last extreme.
fn directions(blocks: &[AtTemperature], turn: f64) -> Vec<(AtTemperature, TemperatureDirection)> {
    let mut found: Vec<(AtTemperature, TemperatureDirection)> = Vec::with_capacity(blocks.len());
    let mut extreme = 0;
    let mut now: Option<TemperatureDirection> = None;
    for (place, block) in blocks.iter().enumerate() {
        let beyond = block.temperature_k - blocks[extreme].temperature_k;
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
        let blocks: Vec<AtTemperature> =
            (0..80).map(|k| AtTemperature { temperature_k: temperature(k), value: 0.0 }).collect();
        let found = directions(&blocks, 0.4);
        assert!(found[..40].iter().all(|(_, direction)| *direction == TemperatureDirection::Up));
        assert!(found[42..].iter().all(|(_, direction)| *direction == TemperatureDirection::Down));
    }
}

//! Records on a rate table that turns at one constant rate after the other: scale factor, its changes with the rate, bias, cross-axis sensitivity
//! and hysteresis (IEEE Std 952 and 1431).

use super::checks::CheckKind;
use super::earth::{EARTH_RATE, earth_of_unknown_direction};
use super::error::CalibrationError;
use super::files::InputFiles;
use super::linear_model::{LinearModel, residuals_left, standing_out};
use super::quantities::{QuantityUnit, RecordOutcome, STANDARD_GRAVITY, by_scatter, stated_contribution};
use super::tone::AXES;
use super::unit_record::UnitSamples;
use crate::calibration::file::{Mounting, RatesRecord};
use crate::config::Quantity;
use crate::fit::{DerivedNumber, Fit, FitError};
use crate::metrology::{Input, coverage_factor};
use kalmems_core::{Dual, Portable, Scalar};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use std::ops::Range;

/// Bias, slope, magnitude, square and cube of the rate over the largest one, and whether it was reached from below or above.
const TERMS: usize = 6;
const BIAS: usize = 0;
const SLOPE: usize = 1;
const SQUARE: usize = 3;
const CUBE: usize = 4;
const DIRECTION: usize = 5;

/// Steps and different rates that the fit takes at least.
const FEWEST_STEPS: usize = 10;
const FEWEST_RATES: usize = 6;
/// Rates that differ by less than this part of the largest one are the same.
const SAME: f64 = 1e-3;
/// Parts of a step whose first and last are compared.
const QUARTERS: usize = 4;
/// How often noise alone is called a gyroscope that has not settled.
const FALSE_ALARMS: f64 = 1e-3;
/// The shortest step in s if nothing is stated.
const SHORTEST_S: f64 = 1.0;

/// A part of the record with a constant rate.
struct Step {
    rows: Range<usize>,
    /// The rate in rad/s, with the Earth's where that is known.
    table: f64,
    /// What the gyroscopes show in rad/s.
    shown: [Option<f64>; 3],
    /// 1 if the rate before was lower, −1 if it was higher, 0 of the first step of a stretch.
    direction: f64,
    /// The rate less that before in rad/s, 0 of the first.
    change: f64,
}

/// The steps of a record with the terms of the fit.
struct Steps {
    each: Vec<Step>,
    /// The largest magnitude in rad/s.
    largest: f64,
    terms: Vec<[f64; TERMS]>,
}

/// A number with its derivatives by the terms.
type TermDual = Dual<f64, TERMS>;
/// A number that follows from the terms of the fit.
type TermFunction<'a> = &'a dyn Fn(&[TermDual; TERMS]) -> TermDual;

/// The outcome of each record on a rate table.
pub(super) fn measure(files: &mut InputFiles) -> Result<Vec<RecordOutcome>, CalibrationError> {
    let file = files.file;
    let found = files.each("rates", &file.rates, RatesRecord::of_unit, measure_one)?;
    let (mut outcomes, biases): (Vec<RecordOutcome>, Vec<RecordBiases>) = found.into_iter().unzip();
    let mountings = by_mountings(&file.rates, &biases);
    match outcomes.last_mut() {
        Some(_) if !mountings.quantities.is_empty() => outcomes.push(mountings),
        // Positions determine it as well.
        Some(last) if file.positions.is_none() => last.not_observed.extend(mountings.not_observed),
        _ => {}
    }
    Ok(outcomes)
}

fn measure_one(
    record: &RatesRecord,
    samples: &UnitSamples,
    shown: &mut Vec<Figure>,
) -> Result<(RecordOutcome, RecordBiases), CalibrationError> {
    let shortest_s = record.shortest.as_ref().map_or(SHORTEST_S, Quantity::si);
    let earth = record.latitude.as_ref().map(|latitude| EARTH_RATE * latitude.si().portable_sin());
    let settling_s = record.settling.as_ref().map_or(0.0, Quantity::si);
    let steps = Steps::of(samples, [shortest_s, settling_s], earth.unwrap_or(0.0), sign(record));
    shown.push(steps.parts(samples, record));
    let rates = steps.different_rates();
    if steps.each.len() < FEWEST_STEPS || rates < FEWEST_RATES || !steps.has_both_signs() {
        return Err(CalibrationError::Steps {
            place: samples.place.clone(),
            found: steps.each.len(),
            rates,
            expected: FEWEST_STEPS,
            expected_rates: FEWEST_RATES,
            shortest_s,
        });
    }
    let mut outcome = RecordOutcome::new("rates", format!("Rates: {}", record.name), METHOD);
    outcome.warnings.clone_from(&samples.remarks);
    if record.table_uncertainty.is_none() {
        outcome.not_stated.push(format!("table_uncertainty of the rates `{}`", record.name));
    }
    let main = record.axis.index();
    let mut biases = [None; 3];
    for (axis, name) in AXES.into_iter().enumerate() {
        let Some(values) = steps.each.iter().map(|step| step.shown[axis]).collect::<Option<Vec<f64>>>()
        else {
            continue;
        };
        let failed = |fault: FitError| CalibrationError::RecordFit { place: samples.place.clone(), fault };
        let model = LinearModel { terms: &steps.terms, values: &values };
        let mut found = model.fit([true; TERMS]).map_err(failed)?;
        let knows_direction = found.covariance.get(DIRECTION, DIRECTION).is_finite();
        if !knows_direction {
            found = model.fit(std::array::from_fn(|term| term != DIRECTION)).map_err(failed)?;
        }
        biases[axis] = Some((found.parameter(BIAS), found.degrees_of_freedom));
        if axis == main {
            steps.of_main(&mut outcome, record, &found, earth.is_some());
            if knows_direction {
                let hysteresis = found.derived(|p| p[DIRECTION] * TermDual::constant(2.0));
                let inputs = by_scatter(hysteresis.deviation, found.degrees_of_freedom);
                outcome.push_known(
                    format!("hysteresis_{name}"),
                    QuantityUnit::rate(),
                    hysteresis.value,
                    inputs,
                );
            } else {
                outcome.not_observed.push(
                    "hysteresis: the rates are not reached from below and from above; turn through them upwards and downwards".to_owned(),
                );
            }
            steps.judge(&mut outcome, record, samples, &model, &found);
            outcome.tables.push(steps.table(samples, &values, &found, record));
            outcome.figures.push(steps.figure(samples, &values, &found, record));
        } else {
            let slope = found.derived(|p| steps.line(p, |_| true));
            let mut inputs = by_scatter(slope.deviation, found.degrees_of_freedom);
            match &record.alignment {
                Some(alignment) => inputs.push(stated_contribution("alignment", alignment, 1.0)),
                None => outcome.not_stated.push(format!("alignment of the rates `{}`", record.name)),
            }
            let name = format!("cross_axis_sensitivity_{name}{}", AXES[main]);
            outcome.push_known(name, QuantityUnit::RATIO, slope.value, inputs);
        }
    }
    Ok((outcome, biases))
}

/// The biases in one record, axis by axis, with degrees of freedom.
type RecordBiases = [Option<(DerivedNumber, usize)>; 3];

/// The rate about the unit's axis by that of the table.
fn sign(record: &RatesRecord) -> f64 {
    if record.mounting == Some(Mounting::Down) { -1.0 } else { 1.0 }
}

/// The sensitivities to the specific force: half the difference of the biases with an axis up and down, by gravity; and which mounting is missing.
fn by_mountings(records: &[RatesRecord], biases: &[RecordBiases]) -> RecordOutcome {
    let mut outcome = RecordOutcome::new("mountings", "Mountings on the table", OF_MOUNTINGS);
    for (main, along) in AXES.into_iter().enumerate() {
        let of = |mounting: Option<Mounting>| {
            let each = records.iter().zip(biases).filter(move |(own, _)| own.axis.index() == main);
            each.filter(move |(own, _)| mounting.is_none() || own.mounting == mounting)
        };
        let [up, down] = [Mounting::Up, Mounting::Down].map(|mounting| of(Some(mounting)).next());
        let missing = match (up, down) {
            (None, None) if of(None).next().is_none() => continue,
            (None, None) => {
                "state where the axis points as `mounting`, and add a record with the opposite one"
            }
            (Some(_), None) => "add a record with the axis downwards, `mounting = \"down\"`",
            (None, Some(_)) => "add a record with the axis upwards, `mounting = \"up\"`",
            (Some(_), Some(_)) => "take both mountings at one temperature",
        };
        let pairs =
            of(Some(Mounting::Up)).flat_map(|up| of(Some(Mounting::Down)).map(move |down| (up, down)));
        let kelvin = |own: &RatesRecord| own.temperature.as_ref().map(Quantity::si);
        let mut pairs = pairs.filter(|((up, _), (down, _))| kelvin(up) == kelvin(down));
        let Some(((up, above), (down, below))) = pairs.next() else {
            outcome.not_observed.push(format!(
                "the gyroscopes' sensitivity to the specific force along {along}, by records of the rate table: {missing}"
            ));
            continue;
        };
        let half = 0.5 / STANDARD_GRAVITY;
        for (axis, name) in AXES.into_iter().enumerate() {
            let [Some((above, freedom)), Some((below, of_below))] = [above[axis], below[axis]] else {
                continue;
            };
            let mut inputs = by_scatter(half * above.deviation, freedom);
            inputs.extend(by_scatter(half * below.deviation, of_below));
            if axis == main && (up.latitude.is_none() || down.latitude.is_none()) {
                inputs.push(earth_of_unknown_direction(STANDARD_GRAVITY.recip()));
            }
            let value = half * (above.value - below.value);
            let unit = QuantityUnit::force_sensitivity();
            outcome.push_known(format!("gyroscope_force_sensitivity_{name}{along}"), unit, value, inputs);
        }
    }
    outcome
}

const OF_MOUNTINGS: &str = "Mountings: the sensitivity of a gyroscope to the specific force is half the difference of its biases in two records with the axis of \
    the table up and down, by standard gravity.";

const METHOD: &str = "Rates: the table turns at constant rates; the parts in which it accelerates are left out. The means at the rates are fitted by a bias, \
    a straight line, a line that differs for both signs, a square and a cube of the rate, and a difference between rates that are reached from below and from \
    above (IEEE Std 1431). The scale factor is the slope of the straight line through the fit at these rates. The scatter of the residuals is the type A \
    evaluation.";

impl Steps {
    fn of(samples: &UnitSamples, [shortest_s, settling_s]: [f64; 2], earth: f64, sign: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of two positive times
        let settling = (settling_s / samples.time.interval_s).ceil() as usize;
        let mut each: Vec<Step> = Vec::new();
        let rates = samples.rates();
        let all = rates.into_iter().flatten().chain([samples.further()]);
        let columns: Vec<(&[f64], bool)> = all.map(|values| (values, false)).collect();
        for parts in samples.still_parts(shortest_s, &columns) {
            let mut before: Option<f64> = None;
            for rows in parts {
                let rows = rows.start + settling..rows.end;
                if rows.len() < QUARTERS {
                    continue;
                }
                let mean = |values: &[f64]| {
                    let values = values.get(rows.clone()).unwrap_or_default();
                    values.iter().sum::<f64>() / values.len() as f64
                };
                let table = sign * (mean(samples.further()) + earth);
                let shown = std::array::from_fn(|axis| rates[axis].map(mean));
                let direction = before.map_or(0.0, |before| if table > before { 1.0 } else { -1.0 });
                let change = before.map_or(0.0, |before| table - before);
                before = Some(table);
                each.push(Step { rows, table, shown, direction, change });
            }
        }
        let largest = each.iter().map(|step| step.table.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let terms = each.iter().map(|step| {
            let rate = step.table / largest;
            [1.0, rate, rate.abs(), rate * rate, rate.powi(3), step.direction]
        });
        Self { terms: terms.collect(), each, largest }
    }

    fn different_rates(&self) -> usize {
        let mut rates: Vec<f64> = self.each.iter().map(|step| step.table / self.largest).collect();
        rates.sort_by(f64::total_cmp);
        usize::from(!rates.is_empty()) + rates.windows(2).filter(|pair| pair[1] - pair[0] > SAME).count()
    }

    fn has_both_signs(&self) -> bool {
        let part =
            |sign: f64| self.each.iter().filter(|step| sign * step.table > SAME * self.largest).count();
        part(1.0) >= 2 && part(-1.0) >= 2
    }

    /// The slope of the straight line through the fit at some of the rates, without dimension.
    fn line(&self, p: &[TermDual; TERMS], is_of: impl Fn(f64) -> bool) -> TermDual {
        let chosen: Vec<&[f64; TERMS]> = self.terms.iter().filter(|terms| is_of(terms[SLOPE])).collect();
        let mean = chosen.iter().map(|terms| terms[SLOPE]).sum::<f64>() / chosen.len().max(1) as f64;
        let square: f64 = chosen.iter().map(|terms| (terms[SLOPE] - mean).powi(2)).sum();
        let mut slope = TermDual::constant(0.0);
        for (term, parameter) in p.iter().enumerate().filter(|(term, _)| *term != DIRECTION) {
            let along: f64 = chosen.iter().map(|terms| (terms[SLOPE] - mean) * terms[term]).sum();
            slope = slope + *parameter * TermDual::constant(along / square);
        }
        slope * TermDual::constant(self.largest.recip())
    }

    /// The numbers of the axis that lies along that of the table.
    fn of_main(
        &self,
        outcome: &mut RecordOutcome,
        record: &RatesRecord,
        found: &Fit<TERMS>,
        is_earth_known: bool,
    ) {
        let axis = AXES[record.axis.index()];
        let degree = 1.0_f64.to_radians();
        let scale = |p: &[TermDual; TERMS]| self.line(p, |_| true);
        let by_rate = |p: &[TermDual; TERMS], power: i32, term: usize| {
            p[term] * TermDual::constant(self.largest.powi(-power)) * scale(p).recip()
        };
        let asymmetry = |p: &[TermDual; TERMS]| {
            (self.line(p, |rate| rate > SAME) - self.line(p, |rate| rate < -SAME)) * scale(p).recip()
        };
        let numbers: [(&str, QuantityUnit, TermFunction<'_>); 5] = [
            ("scale_factor", QuantityUnit::RATIO, &scale),
            ("asymmetry", QuantityUnit { factor: 1e6, shown: "ppm", ..QuantityUnit::RATIO }, &asymmetry),
            ("second_order", QuantityUnit::other("s/rad", 1e6 * degree, "ppm/(deg/s)"), &|p| {
                by_rate(p, 2, SQUARE)
            }),
            ("third_order", QuantityUnit::other("s^2/rad^2", 1e6 * degree * degree, "ppm/(deg/s)^2"), &|p| {
                by_rate(p, 3, CUBE)
            }),
            ("bias", QuantityUnit::rate(), &|p| p[BIAS]),
        ];
        for (name, unit, of) in numbers {
            let number = found.derived(of);
            let mut inputs: Vec<Input> = by_scatter(number.deviation, found.degrees_of_freedom);
            if name == "scale_factor" {
                if let Some(stated) = &record.table_uncertainty {
                    inputs.push(stated_contribution("rate of the table", stated, number.value));
                }
                if let Some(alignment) = &record.alignment {
                    // 1 − cos of the angle.
                    let part = 0.5 * alignment.standard() * number.value;
                    inputs.push(stated_contribution("alignment, second order", alignment, part));
                }
            }
            if name == "bias" && !is_earth_known {
                inputs.push(earth_of_unknown_direction(1.0));
            }
            outcome.push_known(format!("{name}_{axis}"), unit, number.value, inputs);
        }
    }

    fn judge(
        &self,
        outcome: &mut RecordOutcome,
        record: &RatesRecord,
        samples: &UnitSamples,
        model: &LinearModel<TERMS>,
        found: &Fit<TERMS>,
    ) {
        let far = standing_out(model, found);
        for (place, size) in &far {
            let step = &self.each[*place];
            outcome.warnings.push(format!(
                "rates `{}`: the step at {:.2} s ({:+.4} deg/s) lies {size:.1} times what the others make likely from the fit: a disturbance, or a rate \
                 beyond the range of the gyroscope",
                record.name,
                samples.time_s(step.rows.start),
                step.table.to_degrees()
            ));
        }
        let place = format!("rates `{}`", record.name);
        outcome.check(CheckKind::RateSteps, &place, far.is_empty(), residuals_left(found, "rad/s"));
        if let Some([share, deviation, freedom]) = self.lag(samples.rates()[record.axis.index()]) {
            let passes = share.abs() <= coverage_factor(1.0 - FALSE_ALARMS, freedom) * deviation;
            let found = format!(
                "from the first to the last quarter of the steps the rate changes by {:+.1} ± {:.1} ppm of the step before",
                1e6 * share,
                1e6 * deviation
            );
            outcome.check(CheckKind::SettledRates, &place, passes, found.clone());
            if !passes {
                outcome.warnings.push(format!(
                    "rates `{}`: {found}: it still follows the rate before, which looks like hysteresis; state `settling`, a few of its time constants",
                    record.name
                ));
            }
        }
        let scale = found.derived(|p| self.line(p, |_| true)).value;
        outcome.check(CheckKind::AxisOfTable, &place, scale > 0.5, format!("scale factor {scale:+.4}"));
        if scale <= 0.5 {
            outcome.warnings.push(format!(
                "rates `{}`: the gyroscope of {} shows {scale:+.3} of the rate of the table: its sign is turned, or another axis lies along that of the table; \
                 correct `axis`, or `scale` of its column",
                record.name,
                AXES[record.axis.index()]
            ));
        }
    }

    /// By what part of the change of the rate the mean of the last quarter of a step exceeds that of the first, its standard deviation, and the degrees of
    /// freedom of that.
    fn lag(&self, values: Option<&[f64]>) -> Option<[f64; 3]> {
        let mean = |rows: Range<usize>| -> Option<f64> {
            let values = values?.get(rows)?;
            Some(values.iter().sum::<f64>() / values.len() as f64)
        };
        let points = self.each.iter().filter(|step| step.change != 0.0).filter_map(|step| {
            let Range { start, end } = step.rows;
            let quarter = (end - start) / QUARTERS;
            Some((step.change, mean(end - quarter..end)? - mean(start..start + quarter)?))
        });
        let points: Vec<(f64, f64)> = points.collect();
        let square: f64 = points.iter().map(|(change, _)| change * change).sum();
        let share = points.iter().map(|(change, more)| change * more).sum::<f64>() / square;
        let left: f64 = points.iter().map(|(change, more)| (more - share * change).powi(2)).sum();
        let freedom = points.len().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
        Some([share, (left / freedom / square).sqrt(), freedom])
    }

    /// What each step shows beyond the straight line through all of them, in rad/s.
    fn beyond_the_line(&self, values: &[f64], found: &Fit<TERMS>) -> Vec<f64> {
        let slope = found.derived(|p| self.line(p, |_| true)).value;
        let count = values.len().max(1) as f64;
        let mean = |of: &dyn Fn(usize) -> f64| (0..values.len()).map(of).sum::<f64>() / count;
        let level = mean(&|k| values[k] - slope * self.each[k].table);
        values.iter().zip(&self.each).map(|(value, step)| value - slope * step.table - level).collect()
    }

    fn table(
        &self,
        samples: &UnitSamples,
        values: &[f64],
        found: &Fit<TERMS>,
        record: &RatesRecord,
    ) -> TextTable {
        let columns = [
            ColumnHead::number("step", ""),
            ColumnHead::number("from", "s"),
            ColumnHead::number("to", "s"),
            ColumnHead::text("reached from"),
            ColumnHead::number("rate", "deg/s"),
            ColumnHead::number("shown", "deg/s"),
            ColumnHead::number("beyond the straight line", "ppm of the largest rate"),
        ];
        let mut table = TextTable::new(format!("Steps of the rate table: {}", record.name), columns);
        let beyond = self.beyond_the_line(values, found);
        for (place, (step, (value, beyond))) in self.each.iter().zip(values.iter().zip(beyond)).enumerate() {
            let time = |row: usize| format!("{:.2}", samples.time_s(row));
            let from = match step.direction {
                up if up > 0.0 => "below",
                down if down < 0.0 => "above",
                _ => "–",
            };
            table.push([
                (place + 1).to_string(),
                time(step.rows.start),
                time(step.rows.end.saturating_sub(1)),
                from.to_owned(),
                format!("{:+.4}", step.table.to_degrees()),
                format!("{:+.4}", value.to_degrees()),
                format!("{:+.1}", 1e6 * beyond / self.largest),
            ]);
        }
        table
    }

    /// What was taken as constant.
    fn parts(&self, samples: &UnitSamples, record: &RatesRecord) -> Figure {
        let above = samples.panel_of_parts(
            Axis::new("rate of the table", "deg/s"),
            [("table", samples.further().iter().map(|rate| rate.to_degrees()).collect())],
            "taken as constant",
            self.each.iter().map(|step| (step.rows.clone(), sign(record) * step.table.to_degrees())),
        );
        Figure::new(
            format!("rates-{}", record.name),
            format!("Rates: {}", record.name),
            "The rate of the table with the parts that were taken as constant, and by how much the gyroscope differs at each of them from a straight line.",
        )
        .with(above)
    }

    /// The parts above what the steps show beyond the line.
    fn figure(
        &self,
        samples: &UnitSamples,
        values: &[f64],
        found: &Fit<TERMS>,
        record: &RatesRecord,
    ) -> Figure {
        let beyond = self.beyond_the_line(values, found);
        let mut below = Panel::new(
            Axis::new("rate of the table", "deg/s"),
            Axis::new("beyond the line", "ppm of the largest rate"),
        );
        for (label, sign, role) in [
            ("reached from below", 1.0, SeriesRole::Estimate),
            ("reached from above", -1.0, SeriesRole::Reference),
            ("first step", 0.0, SeriesRole::Measured),
        ] {
            let points: Vec<(f64, f64)> = self
                .each
                .iter()
                .zip(&beyond)
                .filter(|(step, _)| step.direction == sign)
                .map(|(step, beyond)| (step.table.to_degrees(), 1e6 * beyond / self.largest))
                .collect();
            below = below.with(Series::points(label, role, points));
        }
        self.parts(samples, record).with(below)
    }
}

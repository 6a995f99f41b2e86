//! Records in which the unit is turned by a known angle about one axis, and rests between the turns: the scale factor by the integrated rate.

use super::checks::CheckKind;
use super::earth::earth_of_unknown_direction;
use super::error::CalibrationError;
use super::files::InputFiles;
use super::linear_model::{LinearModel, residuals_left, standing_out};
use super::quantities::{QuantityUnit, RecordOutcome, by_scatter, contribution, stated_contribution};
use super::tone::AXES;
use super::unit_record::UnitSamples;
use crate::calibration::file::TurnsRecord;
use crate::config::Quantity;
use crate::fit::{Fit, FitError};
use crate::metrology::{Evaluation, Input};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use std::ops::Range;

/// The angle, and its magnitude.
const TERMS: usize = 2;
const SLOPE: usize = 0;
const MAGNITUDE: usize = 1;
/// Turns that the fit takes at least, and turns to either side that tell the scale factors of both signs apart.
const FEWEST_TURNS: usize = 4;
const FEWEST_OF_SIGN: usize = 2;
/// How far the number of whole angles may be from an integer: a scale factor that is off by a twentieth leaves five angles at once apart.
const WHOLE: f64 = 0.25;
/// The shortest rest in s if nothing is stated.
const SHORTEST_S: f64 = 1.0;

/// A turn between two rests.
struct Turn {
    rows: Range<usize>,
    /// How many times the stated angle, with the sign of what the gyroscope shows.
    times: f64,
    /// The integral of what each gyroscope shows beyond its bias in rad.
    angle: [Option<f64>; 3],
    /// The standard deviations of these integrals in rad by white noise: what the means of both rests leave, and all.
    by_rests: [[f64; 2]; 3],
    by_noise: [f64; 3],
    duration_s: f64,
}

struct Turns {
    each: Vec<Turn>,
    rests: Vec<Range<usize>>,
    main: usize,
}

/// The outcome of each record of turns.
pub(super) fn measure(files: &mut InputFiles) -> Result<Vec<RecordOutcome>, CalibrationError> {
    let file = files.file;
    files.each("turns", &file.turns, TurnsRecord::of_unit, measure_one)
}

fn measure_one(
    record: &TurnsRecord,
    samples: &UnitSamples,
    shown: &mut Vec<Figure>,
) -> Result<RecordOutcome, CalibrationError> {
    let shortest_s = record.shortest.as_ref().map_or(SHORTEST_S, Quantity::si);
    let turns = Turns::of(samples, record, shortest_s);
    shown.push(turns.parts(record, samples));
    if turns.each.len() < FEWEST_TURNS {
        return Err(CalibrationError::Turns {
            place: samples.place.clone(),
            found: turns.each.len(),
            expected: FEWEST_TURNS,
            shortest_s,
        });
    }
    let mut outcome = RecordOutcome::new("turns", format!("Turns: {}", record.name), METHOD);
    outcome.warnings.clone_from(&samples.remarks);
    let not_stated = |key: &str| format!("{key} of the turns `{}`", record.name);
    if record.angle_uncertainty.is_none() {
        outcome.not_stated.push(not_stated("angle_uncertainty"));
    }
    let angle = record.angle.si();
    let terms: Vec<[f64; TERMS]> =
        turns.each.iter().map(|turn| [turn.times * angle, turn.times.abs() * angle]).collect();
    let of_sign = |sign: f64| turns.each.iter().filter(|turn| sign * turn.times > 0.0).count();
    let has_both = of_sign(1.0) >= FEWEST_OF_SIGN && of_sign(-1.0) >= FEWEST_OF_SIGN;
    for (axis, name) in AXES.into_iter().enumerate() {
        let values = turns.each.iter().map(|turn| turn.angle[axis]).collect::<Option<Vec<f64>>>();
        let Some(values) = values else { continue };
        let failed = |fault: FitError| CalibrationError::RecordFit { place: samples.place.clone(), fault };
        let model = LinearModel { terms: &terms, values: &values };
        let found = model.fit([true, has_both]).map_err(failed)?;
        let slope = found.parameter(SLOPE);
        let mut inputs =
            turns.by_turns(axis, (slope.deviation, found.degrees_of_freedom), |turn| turn.times * angle);
        if axis == turns.main {
            if let Some(stated) = &record.angle_uncertainty {
                inputs.push(stated_contribution("angle", stated, slope.value / angle));
            }
            if let Some(alignment) = &record.alignment {
                // 1 − cos of the angle.
                let part = 0.5 * alignment.standard() * slope.value;
                inputs.push(stated_contribution("alignment, second order", alignment, part));
            }
            outcome.push_known(format!("scale_factor_{name}"), QuantityUnit::RATIO, slope.value, inputs);
            if has_both {
                let part = 2.0 / slope.value;
                let magnitude = found.parameter(MAGNITUDE);
                let mut inputs =
                    turns.by_turns(axis, (magnitude.deviation, found.degrees_of_freedom), |turn| {
                        turn.times.abs() * angle
                    });
                for input in &mut inputs {
                    input.standard_uncertainty *= part.abs();
                }
                let unit = QuantityUnit { factor: 1e6, shown: "ppm", ..QuantityUnit::RATIO };
                outcome.push_known(format!("asymmetry_{name}"), unit, part * magnitude.value, inputs);
            } else {
                outcome.not_observed.push(format!(
                    "asymmetry of {name}: there are fewer than {FEWEST_OF_SIGN} turns to either side"
                ));
            }
            turns.judge(&mut outcome, record, samples, &model, &found);
            outcome.tables.push(turns.table(record, samples, &values, &found));
            outcome.figures.push(turns.figure(record, samples, &values, &found));
        } else {
            match &record.alignment {
                Some(alignment) => inputs.push(stated_contribution("alignment", alignment, 1.0)),
                None => outcome.not_stated.push(not_stated("alignment")),
            }
            let longest =
                turns.each.iter().map(|turn| turn.duration_s / turn.times.abs()).fold(0.0, f64::max);
            inputs.push(earth_of_unknown_direction(longest / angle));
            let name = format!("cross_axis_sensitivity_{name}{}", AXES[turns.main]);
            outcome.push_known(name, QuantityUnit::RATIO, slope.value, inputs);
        }
    }
    outcome.not_observed.push(format!(
        "the sign of the scale factor of {}: the file does not say to which side each turn goes",
        AXES[turns.main]
    ));
    Ok(outcome)
}

const METHOD: &str = "Turns: between two rests the unit is turned about one axis by a multiple of a known angle. The rate beyond the bias, which goes straight \
    from the mean of one rest to that of the next, is integrated over each turn; the scale factor is the slope of the integrals over the angles, apart for \
    both directions where there are two turns of each. The scatter of the residuals is the type A evaluation.";

impl Turns {
    fn of(samples: &UnitSamples, record: &TurnsRecord, shortest_s: f64) -> Self {
        let rates = samples.rates();
        let mut found = Self { each: Vec::new(), rests: Vec::new(), main: record.axis.index() };
        let columns: Vec<(&[f64], bool)> = rates.into_iter().flatten().map(|values| (values, true)).collect();
        for rests in samples.still_parts(shortest_s, &columns) {
            for pair in rests.windows(2) {
                let rows = pair[0].end..pair[1].start;
                let moments = |axis: usize, rest: &Range<usize>| {
                    let values = rates[axis]?.get(rest.clone())?;
                    let mean = values.iter().sum::<f64>() / values.len() as f64;
                    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
                    Some((mean, square / values.len() as f64, values.len() as f64))
                };
                let duration_s = rows.len() as f64 * samples.time.interval_s;
                let angle = std::array::from_fn(|axis| {
                    let bias = moments(axis, &pair[0])?.0.midpoint(moments(axis, &pair[1])?.0);
                    let sum: f64 = rates[axis]?.get(rows.clone())?.iter().sum();
                    Some(sum * samples.time.interval_s - bias * duration_s)
                });
                let by_rests: [[f64; 2]; 3] = std::array::from_fn(|axis| {
                    let of = |rest| moments(axis, rest).map_or(0.0, |(_, variance, count)| variance / count);
                    [&pair[0], &pair[1]].map(|rest| 0.5 * duration_s * of(rest).sqrt())
                });
                let by_noise = std::array::from_fn(|axis| {
                    let each = [&pair[0], &pair[1]]
                        .map(|rest| moments(axis, rest).map_or(0.0, |(_, variance, _)| variance));
                    let [before, after] = by_rests[axis];
                    let sum = rows.len() as f64 * samples.time.interval_s.powi(2) * each[0].midpoint(each[1]);
                    (sum + before * before + after * after).sqrt()
                });
                let Some(turned) = angle[found.main].filter(|turned| turned.is_finite()) else { continue };
                let times = (turned / record.angle.si()).round();
                if times != 0.0 {
                    found.each.push(Turn { rows, times, angle, by_rests, by_noise, duration_s });
                }
            }
            found.rests.extend(rests);
        }
        found
    }

    /// The inputs of a parameter that counts this term of each turn, from its standard deviation by the scatter and the degrees of freedom. The mean of a rest
    /// is in the turns before and after it: their errors by white noise add up in turns to one side, and cancel in part in turns to and fro.
    fn by_turns(
        &self,
        axis: usize,
        (deviation, freedom): (f64, usize),
        term: impl Fn(&Turn) -> f64,
    ) -> Vec<Input> {
        let shared =
            self.each.windows(2).filter(|pair| self.rests.contains(&(pair[0].rows.end..pair[1].rows.start)));
        let products = shared.map(|pair| {
            term(&pair[0]) * term(&pair[1]) * pair[0].by_rests[axis][1] * pair[1].by_rests[axis][0]
        });
        let squares: f64 = self.each.iter().map(|turn| term(turn).powi(2)).sum();
        let covariance = 2.0 * products.sum::<f64>() / squares.powi(2);
        if covariance > 0.0 {
            let mut inputs = by_scatter(deviation, freedom);
            inputs.push(contribution("bias at rest", covariance.sqrt(), f64::INFINITY, Evaluation::A));
            return inputs;
        }
        let noise = self.each.iter().map(|turn| (term(turn) * turn.by_noise[axis]).powi(2));
        // A scatter that is less than the noise has the same part of it in common.
        let all = deviation.powi(2).max(noise.sum::<f64>() / squares.powi(2)).max(f64::MIN_POSITIVE);
        by_scatter(deviation * (1.0 + covariance / all).max(0.0).sqrt(), freedom)
    }

    fn judge(
        &self,
        outcome: &mut RecordOutcome,
        record: &TurnsRecord,
        samples: &UnitSamples,
        model: &LinearModel<TERMS>,
        found: &Fit<TERMS>,
    ) {
        let (axis, angle) = (AXES[self.main], record.angle.si());
        let far = standing_out(model, found);
        for (place, size) in &far {
            outcome.warnings.push(format!(
                "turns `{}`: turn {} at {:.2} s is {size:.1} times as far from the others as their scatter makes likely: it ended at another angle, or the \
                 rate was beyond the range",
                record.name,
                place + 1,
                samples.time_s(self.each[*place].rows.start)
            ));
        }
        let place = format!("turns `{}`", record.name);
        outcome.check(CheckKind::StatedTurns, &place, far.is_empty(), residuals_left(found, "rad"));
        let part = |turn: &Turn| turn.angle[self.main].unwrap_or(0.0) / angle;
        let whole = self.each.iter().map(|turn| (part(turn) - turn.times).abs()).fold(0.0, f64::max);
        outcome.check(
            CheckKind::WholeTurns,
            &place,
            whole <= WHOLE,
            format!("{whole:.3} of the angle off at most"),
        );
        let sum =
            |axis: usize| self.each.iter().filter_map(|turn| turn.angle[axis]).map(f64::abs).sum::<f64>();
        let others: Vec<&str> =
            (0..3).filter(|other| sum(*other) > sum(self.main)).map(|other| AXES[other]).collect();
        outcome.check(
            CheckKind::AxisOfTurns,
            &place,
            others.is_empty(),
            if others.is_empty() {
                format!("about {axis}")
            } else {
                format!("more about {}", others.join(", "))
            },
        );
        if whole > WHOLE || !others.is_empty() {
            outcome.warnings.push(format!(
                "turns `{}`: the gyroscope of {axis} does not show multiples of {}: correct `axis`, `angle` or the unit of its column",
                record.name,
                record.angle.text()
            ));
        }
    }

    /// What each turn differs from the fit, as a part of its angle.
    fn residuals(&self, record: &TurnsRecord, values: &[f64], found: &Fit<TERMS>) -> Vec<f64> {
        let [slope, magnitude] = found.parameters;
        let each = self.each.iter().zip(values).map(|(turn, value)| {
            let angle = turn.times * record.angle.si();
            (value - slope * angle - magnitude * angle.abs()) / angle.abs()
        });
        each.collect()
    }

    fn table(
        &self,
        record: &TurnsRecord,
        samples: &UnitSamples,
        values: &[f64],
        found: &Fit<TERMS>,
    ) -> TextTable {
        let columns = [
            ColumnHead::number("turn", ""),
            ColumnHead::number("from", "s"),
            ColumnHead::number("to", "s"),
            ColumnHead::number("times the angle", ""),
            ColumnHead::number("integral", "deg"),
            ColumnHead::number("residual", "ppm"),
        ];
        let mut table = TextTable::new(format!("Turns: {}", record.name), columns);
        let residuals = self.residuals(record, values, found);
        for (place, (turn, (value, residual))) in
            self.each.iter().zip(values.iter().zip(residuals)).enumerate()
        {
            let time = |row: usize| format!("{:.2}", samples.time_s(row));
            table.push([
                (place + 1).to_string(),
                time(turn.rows.start),
                time(turn.rows.end),
                format!("{:+.0}", turn.times),
                format!("{:+.4}", value.to_degrees()),
                format!("{:+.1}", 1e6 * residual),
            ]);
        }
        table
    }

    /// What was taken as still.
    fn parts(&self, record: &TurnsRecord, samples: &UnitSamples) -> Figure {
        let rate =
            samples.rates()[self.main].unwrap_or_default().iter().map(|rate| rate.to_degrees()).collect();
        let above = samples.panel_of_parts(
            Axis::new("rate", "deg/s"),
            [(AXES[self.main], rate)],
            "taken as still",
            self.rests.iter().map(|rows| (rows.clone(), 0.0)),
        );
        Figure::new(
            format!("turns-{}", record.name),
            format!("Turns: {}", record.name),
            "The rate with the parts that were taken as still, and by how much the integral over each turn differs from the fit.",
        )
        .with(above)
    }

    /// The parts above the residuals.
    fn figure(
        &self,
        record: &TurnsRecord,
        samples: &UnitSamples,
        values: &[f64],
        found: &Fit<TERMS>,
    ) -> Figure {
        let residuals = self.residuals(record, values, found).into_iter().zip(&self.each);
        let points: Vec<(f64, f64)> =
            residuals.map(|(residual, turn)| (samples.time_s(turn.rows.start), 1e6 * residual)).collect();
        let below = Panel::new(Axis::new("time", "s"), Axis::new("residual", "ppm of the angle"))
            .with(Series::points("each turn", SeriesRole::Estimate, points));
        self.parts(record, samples).with(below)
    }
}

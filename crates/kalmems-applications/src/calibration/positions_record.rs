//! The record of positions of a calibration file: still parts and motions found, both sensors calibrated, and what can be said of the fit.

use super::checks::CheckKind;
use super::earth::{EARTH_RATE, earth_of_unknown_direction};
use super::error::CalibrationError;
use super::files::InputFiles;
use super::positions::{
    Dual9, FEWEST_MOTIONS, FEWEST_POSITIONS, GyroscopeFit, MotionBetween, Position, accelerometer_matrix,
    alignment_numbers, fit_accelerometers, fit_gyroscopes, force, force_sensitivity, gravity_residuals,
    gyroscope_matrix, next_position, positions_standing_out,
};
use super::positions_covariance::{PAIRS, covariance_of_positions};
use super::quantities::{
    QuantityUnit, RecordOutcome, STANDARD_GRAVITY, by_scatter, contribution, stated_contribution,
};
use super::tone::AXES;
use super::tumble::tumble;
use super::unit_record::UnitSamples;
use crate::calibration::file::PositionsRecord;
use crate::config::{Key, Quantity};
use crate::fit::{Fit, FitError};
use crate::metrology::Evaluation;
use kalmems_core::Portable;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use std::ops::Range;

/// The shortest position in s if nothing is stated.
const SHORTEST_S: f64 = 1.0;
/// A scale factor along the own axis below this part of the matrix's row is that of an axis that is exchanged or turned round.
const OWN_AXIS: f64 = 0.5;

/// The still parts of a record with their means.
struct FoundPositions {
    rows: Vec<Range<usize>>,
    positions: Vec<Position>,
    motions: Vec<MotionBetween>,
    /// The root mean square over the positions of the standard deviation of a mean by white noise, of the force's components in m/s².
    noise: f64,
}

/// The outcomes of the records of positions in the order of the file.
pub(super) fn measure(files: &mut InputFiles) -> Result<Vec<RecordOutcome>, CalibrationError> {
    let file = files.file;
    file.all_positions().enumerate().map(|(number, record)| measure_one(files, record, number)).collect()
}

/// What ends the identifier and the title of each record but the first.
fn ending(number: usize) -> String {
    if number == 0 { String::new() } else { format!("-{}", number + 1) }
}

fn measure_one(
    files: &mut InputFiles,
    record: &PositionsRecord,
    number: usize,
) -> Result<RecordOutcome, CalibrationError> {
    let file = files.file;
    let key = match number.checked_sub(1) {
        None => Key::from("positions"),
        Some(index) => Key::from("further_positions").index(index),
    };
    let samples = record.of_unit(&file.gyroscope).read(files, key.child("file"))?;
    let shortest_s = record.shortest.as_ref().map_or(SHORTEST_S, Quantity::si);
    let found = FoundPositions::of(&samples, shortest_s);
    let mut parts = parts(&samples, &found, record.gravity.si());
    parts.id += &ending(number);
    files.parts.push(parts.clone());
    if found.positions.len() < FEWEST_POSITIONS {
        return Err(CalibrationError::Positions {
            place: samples.place,
            found: found.positions.len(),
            expected: FEWEST_POSITIONS,
            shortest_s,
        });
    }
    let failed = |fault: FitError| CalibrationError::RecordFit { place: samples.place.clone(), fault };
    let gravity = record.gravity.si();
    let accelerometers = fit_accelerometers(&found.positions, gravity).map_err(failed)?;
    let has_gyroscopes = file.gyroscope.channels.is_some();
    let gyroscopes = if has_gyroscopes && found.motions.len() >= FEWEST_MOTIONS {
        Some(fit_gyroscopes(&found.positions, &found.motions, &accelerometers).map_err(failed)?)
    } else {
        None
    };
    let title = format!("Positions{}", ending(number).replace('-', " "));
    let mut outcome = RecordOutcome::new("positions", title, method(has_gyroscopes));
    outcome.tables.push(positions_table(&samples, &found, &accelerometers, gravity));
    outcome.figures.push(figure(parts, &samples, &found, &accelerometers, gravity));
    outcome.warnings.clone_from(&samples.remarks);
    if record.gravity_uncertainty.is_none() {
        outcome.not_stated.push("positions.gravity_uncertainty".to_owned());
    }
    of_accelerometers(&mut outcome, record, &found.positions, &accelerometers);
    if !record.attitudes.is_empty() {
        tumble(&mut outcome, &samples.place, &found.positions, &record.attitudes, gravity)?;
    }
    judge_accelerometers(&mut outcome, &samples, &found, &accelerometers, gravity);
    let mut rests = None;
    if let Some(gyroscopes) = &gyroscopes {
        of_gyroscopes(&mut outcome, gyroscopes, accelerometers.degrees_of_freedom);
        let earth = record.latitude.as_ref().map(|latitude| EARTH_RATE * latitude.si().portable_sin());
        let each =
            force_sensitivity(&found.positions, &accelerometers, earth.unwrap_or(0.0)).map_err(failed)?;
        of_rest_means(&mut outcome, &each, earth.is_some());
        rests = Some(each);
    } else if has_gyroscopes {
        outcome.not_observed.push(format!(
            "the gyroscopes: there are {} motions between two positions without a gap, and their nine numbers take {FEWEST_MOTIONS}",
            found.motions.len()
        ));
    }
    let covariance =
        covariance_of_positions(&outcome.quantities, &accelerometers, gyroscopes.as_ref(), rests.as_ref());
    outcome.covariance = Some(covariance);
    outcome.not_observed.push(
        "the orientation of the accelerometers in their case, which takes surfaces of the case as a reference; all angles are from the first \
         accelerometer's axis and the plane of the first two"
            .to_owned(),
    );
    Ok(outcome)
}

impl FoundPositions {
    fn of(samples: &UnitSamples, shortest_s: f64) -> Self {
        let (all_rates, all_forces) = (samples.rates(), samples.forces());
        let axes = |all: &[Option<&[f64]>; 3], row: usize| -> [f64; 3] {
            std::array::from_fn(|axis| all[axis].and_then(|values| values.get(row)).copied().unwrap_or(0.0))
        };
        let mut found = Self { rows: Vec::new(), positions: Vec::new(), motions: Vec::new(), noise: 0.0 };
        let mut variances = Vec::new();
        let columns: Vec<(&[f64], bool)> = [(&all_rates, true), (&all_forces, false)]
            .into_iter()
            .flat_map(|(all, is_rate)| all.iter().flatten().map(move |values| (*values, is_rate)))
            .collect();
        for parts in samples.still_parts(shortest_s, &columns) {
            let mut before: Option<usize> = None;
            for rows in parts {
                let count = rows.len() as f64;
                let mean = |all: &[Option<&[f64]>; 3]| -> [f64; 3] {
                    let mut sum = [0.0; 3];
                    for row in rows.clone() {
                        sum.iter_mut().zip(axes(all, row)).for_each(|(sum, value)| *sum += value);
                    }
                    sum.map(|sum| sum / count)
                };
                let position = Position { force: mean(&all_forces), rate: mean(&all_rates) };
                for row in rows.clone() {
                    let value = axes(&all_forces, row);
                    let square: f64 =
                        value.iter().zip(position.force).map(|(v, mean)| (v - mean).powi(2)).sum();
                    variances.push(square / 3.0 / count);
                }
                let place = found.positions.len();
                if let Some(earlier) = before.filter(|_| all_rates.iter().all(Option::is_some)) {
                    let between = found.rows[earlier].end.saturating_sub(1)..rows.start + 1;
                    found.motions.push(MotionBetween {
                        positions: [earlier, place],
                        rates: between.map(|row| axes(&all_rates, row)).collect(),
                        interval_s: samples.time.interval_s,
                    });
                }
                found.positions.push(position);
                found.rows.push(rows);
                before = Some(place);
            }
        }
        // Motions with missing samples turn by nobody knows what.
        found.motions.retain(|motion| motion.rates.iter().flatten().all(|rate| rate.is_finite()));
        found.noise = (variances.iter().sum::<f64>() / variances.len().max(1) as f64).sqrt();
        found
    }
}

fn method(has_gyroscopes: bool) -> String {
    let mut method = "Positions: scale factors, non-orthogonality and biases of the accelerometers are those for which the specific force has the \
        magnitude of gravity in every position at rest (multi-position calibration, IEEE Std 1293)."
        .to_owned();
    if has_gyroscopes {
        method += " The matrix of the gyroscopes is the one that turns the direction of gravity of each position into that of the next (Tedaldi, \
            Pretto and Menegatti, 2014); their biases and sensitivities to the specific force follow from the means at rest.";
    }
    method + " The scatter of the residuals is the type A evaluation of both fits."
}

fn of_accelerometers(
    outcome: &mut RecordOutcome,
    record: &PositionsRecord,
    positions: &[Position],
    found: &Fit<9>,
) {
    let gravity = record.gravity.si();
    let number = |of: &dyn Fn(&[Dual9; 9]) -> Dual9| found.derived(of);
    for (kind, names) in [AXES, PAIRS].into_iter().enumerate() {
        for (place, name) in names.into_iter().enumerate() {
            let derived = number(&|p| alignment_numbers(&accelerometer_matrix(p))[kind][place]);
            let mut inputs = by_scatter(derived.deviation, found.degrees_of_freedom);
            let (what, unit) =
                [("scale_factor", QuantityUnit::RATIO), ("non_orthogonality", QuantityUnit::ANGLE)][kind];
            if let Some(stated) = record.gravity_uncertainty.as_ref().filter(|_| kind == 0) {
                inputs.push(stated_contribution("gravity", stated, derived.value / gravity));
            }
            outcome.push_known(format!("accelerometer_{what}_{name}"), unit, derived.value, inputs);
        }
    }
    for (axis, name) in AXES.into_iter().enumerate() {
        let bias = found.parameter(6 + axis);
        let inputs = by_scatter(bias.deviation, found.degrees_of_freedom);
        outcome.push_known(format!("accelerometer_bias_{name}"), QuantityUnit::FORCE, bias.value, inputs);
    }
    let improved = next_position(positions, found, gravity).filter(|next| next.remaining < 1.0);
    if let Some(next) = improved {
        let [x, y, z] = next.direction;
        outcome.not_observed.push(format!(
            "a further position with the specific force (upwards) along ({x:+.2}, {y:+.2}, {z:+.2}) of the accelerometers' axes would reduce the standard \
             uncertainties most, on the average to {:.0} % of those here",
            100.0 * next.remaining
        ));
    }
}

fn judge_accelerometers(
    outcome: &mut RecordOutcome,
    samples: &UnitSamples,
    found: &FoundPositions,
    fit: &Fit<9>,
    gravity: f64,
) {
    let residuals = gravity_residuals(&found.positions, fit, gravity);
    let standing_out = positions_standing_out(&found.positions, fit, gravity);
    for (place, size) in &standing_out {
        outcome.warnings.push(format!(
            "position {} at {:.2} s differs by {:+.2e} m/s² from gravity, {:.1} times what the others make likely: the unit may have moved in it",
            place + 1,
            samples.time_s(found.rows[*place].start),
            residuals[*place],
            size
        ));
    }
    outcome.check(
        CheckKind::Gravity,
        "positions",
        standing_out.is_empty(),
        format!(
            "residuals of {:.2e} m/s² at {} degrees of freedom; white noise alone would leave {:.2e} m/s²",
            fit.residual_deviation(),
            fit.degrees_of_freedom,
            found.noise
        ),
    );
}

fn of_gyroscopes(outcome: &mut RecordOutcome, found: &GyroscopeFit, freedom_of_accelerometers: usize) {
    let matrix = gyroscope_matrix(&Dual9::variables(&found.fit.parameters));
    let own = |axis: usize| {
        let row = matrix[axis].map(Dual9::value);
        row[axis] / row.iter().map(|part| part * part).sum::<f64>().sqrt()
    };
    let exchanged: Vec<&str> = (0..3).filter(|axis| own(*axis) < OWN_AXIS).map(|axis| AXES[axis]).collect();
    let is_square = exchanged.is_empty();
    outcome.check(
        CheckKind::AxesOfPositions,
        "positions",
        is_square,
        if is_square {
            format!("residuals of {:.2e} rad in the direction of gravity", found.fit.residual_deviation())
        } else {
            let rows = matrix.map(|row| row.map(|entry| format!("{:+.2}", entry.value())).join(" "));
            format!(
                "the matrix of the gyroscopes is ({}): an axis is exchanged or has the other sign",
                rows.join("; ")
            )
        },
    );
    if !is_square {
        outcome.warnings.push(format!(
            "the gyroscope of {} turns about another axis than the accelerometers say, or with the other sign: exchange the columns or correct their \
             `scale` in the calibration file. No scale factor of the gyroscopes is stated.",
            exchanged.join(" and ")
        ));
        return;
    }
    let kinds = [
        ("scale_factor", AXES, QuantityUnit::RATIO),
        ("non_orthogonality", PAIRS, QuantityUnit::ANGLE),
        ("mounting", AXES, QuantityUnit::ANGLE),
    ];
    for (kind, (what, names, unit)) in kinds.into_iter().enumerate() {
        for (place, name) in names.into_iter().enumerate() {
            let (value, [by_motions, by_accelerometers]) =
                found.derived(|p| alignment_numbers(&gyroscope_matrix(p))[kind][place]);
            let mut inputs = by_scatter(by_motions, found.fit.degrees_of_freedom);
            let freedom = freedom_of_accelerometers as f64;
            inputs.push(contribution(
                "accelerometers' calibration",
                by_accelerometers,
                freedom,
                Evaluation::A,
            ));
            outcome.push_known(format!("gyroscope_{what}_{name}"), unit, value, inputs);
        }
    }
}

/// Biases and sensitivities to the specific force.
fn of_rest_means(outcome: &mut RecordOutcome, each: &[Fit<4>; 3], is_earth_known: bool) {
    let sensitivity = QuantityUnit::force_sensitivity();
    for (fit, axis) in each.iter().zip(AXES) {
        let bias = fit.parameter(0);
        let inputs_of = |deviation: f64| by_scatter(deviation, fit.degrees_of_freedom);
        outcome.push_known(
            format!("gyroscope_bias_{axis}"),
            QuantityUnit::rate(),
            bias.value,
            inputs_of(bias.deviation),
        );
        for (place, along) in AXES.into_iter().enumerate() {
            let found = fit.parameter(1 + place);
            let mut inputs = inputs_of(found.deviation);
            if !is_earth_known && axis == along {
                inputs.push(earth_of_unknown_direction(STANDARD_GRAVITY.recip()));
            }
            let name = format!("gyroscope_force_sensitivity_{axis}{along}");
            outcome.push_known(name, sensitivity, found.value, inputs);
        }
    }
}

fn positions_table(samples: &UnitSamples, found: &FoundPositions, fit: &Fit<9>, gravity: f64) -> TextTable {
    let columns = [
        ColumnHead::number("position", ""),
        ColumnHead::number("from", "s"),
        ColumnHead::number("to", "s"),
        ColumnHead::number("upwards along x", ""),
        ColumnHead::number("y", ""),
        ColumnHead::number("z", ""),
        ColumnHead::number("residual", "mm/s^2"),
    ];
    let mut table =
        TextTable::new("Positions at rest, and how the specific force differs from gravity in each", columns);
    let residuals = gravity_residuals(&found.positions, fit, gravity);
    for (place, ((rows, position), residual)) in
        found.rows.iter().zip(&found.positions).zip(residuals).enumerate()
    {
        let up = force(&fit.parameters, position.force).map(|part| format!("{:+.3}", part / gravity));
        let [x, y, z] = up;
        let time = |row: usize| format!("{:.2}", samples.time_s(row));
        table.push([
            (place + 1).to_string(),
            time(rows.start),
            time(rows.end.saturating_sub(1)),
            x,
            y,
            z,
            format!("{:+.3}", 1e3 * residual),
        ]);
    }
    table
}

/// What was taken as still.
fn parts(samples: &UnitSamples, found: &FoundPositions, gravity: f64) -> Figure {
    let forces = AXES.into_iter().zip(samples.forces());
    let panel = samples.panel_of_parts(
        Axis::new("specific force", "m/s^2"),
        forces.filter_map(|(axis, values)| Some((axis, values?.to_vec()))),
        "taken as still",
        found.rows.iter().map(|rows| (rows.clone(), -1.2 * gravity)),
    );
    Figure::new(
        "positions",
        "Positions",
        "The accelerometers with the parts that were taken as still (lines below them), and by how much the magnitude of the specific force differs \
         from gravity in each of these positions.",
    )
    .with(panel)
}

/// The parts above the residuals.
fn figure(
    parts: Figure,
    samples: &UnitSamples,
    found: &FoundPositions,
    fit: &Fit<9>,
    gravity: f64,
) -> Figure {
    let residuals: Vec<(f64, f64)> = gravity_residuals(&found.positions, fit, gravity)
        .into_iter()
        .zip(&found.rows)
        .map(|(residual, rows)| (samples.time_s(rows.start), 1e3 * residual))
        .collect();
    let scatter = 2e3 * fit.residual_deviation();
    let below = Panel::new(Axis::new("time", "s"), Axis::new("residual", "mm/s^2"))
        .with(Series::points("each position", SeriesRole::Estimate, residuals))
        .with(Series::level("two standard deviations", SeriesRole::Bound, scatter))
        .with(Series::level("", SeriesRole::Bound, -scatter));
    parts.with(below)
}

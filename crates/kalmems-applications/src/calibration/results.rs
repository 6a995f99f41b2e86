//! The files of a gyroscope's calibration.

use super::certificate::{Certificate, certificate_page};
use super::comparison::ReferenceComparison;
use super::compensation_sources::{header, rust_module};
use super::noise_yaml::noise_yaml;
use crate::WriteError;
use crate::calibration::{
    AXES, AxisAtRest, CalibratedGyroscope, Calibration, CalibrationError, GyroscopeCalibration,
    InertialSensor, NoiseFit, QuantityUnit, RecordOutcome, ScaleFactorChange, UncertainEstimate,
};
use crate::config::TemperatureCurve;
use crate::recording::RecordingSource;
use crate::signal::Confident;
use kalmems_core::Portable;
use kalmems_engines::topics::{explained, link, warning_line};
use kalmems_figures::{
    Axis, ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, Series, SeriesRole,
    TextTable, guarded, significant,
};
use kalmems_store::{Output, OutputError, RunInfo, RunTiming};
use serde::Serialize;
use std::io::{self, Write};

/// What was found, as `calibration.json` has it.
#[derive(Clone, Debug, Serialize)]
pub struct CalibrationSummary<'a> {
    /// The calibration's name.
    pub name: String,
    /// What was asked for, as the certificate has it: a sentence for each of the first results.
    pub answer: Vec<String>,
    /// Each condition with each reference.
    pub results: &'a [CalibratedGyroscope],
    /// Changes between conditions.
    pub changes: &'a [ScaleFactorChange],
    /// Whether references of one condition agree.
    pub comparisons: &'a [ReferenceComparison],
    /// The record at rest, axis by axis.
    pub rest: Vec<RestSummary<'a>>,
    /// Records of other kinds, such as that of positions.
    pub unit_records: &'a [RecordOutcome],
    /// What was found in the files and does not keep them from being used.
    pub findings: &'a [String],
    /// Those of them that say that the record at rest moves.
    #[serde(skip)]
    pub rest_motions: &'a [String],
}

/// One axis at rest with its deviations.
#[derive(Clone, Debug, Serialize)]
pub struct RestSummary<'a> {
    /// Bias and noise.
    #[serde(flatten)]
    pub rest: &'a AxisAtRest,
    /// Averaging time in s, Allan's deviation in rad/s, its interval of 95 %, the degrees of freedom, and the power of
    /// the frequency in the noise.
    pub allan: Vec<DeviationRow>,
    /// The same of the modified deviation.
    pub modified: Vec<DeviationRow>,
    /// The same of Hadamard's overlapping deviation.
    pub hadamard: Vec<DeviationRow>,
    /// The same of the total deviation.
    pub total: Vec<DeviationRow>,
    /// The density of the noise on either side of the frequency 0: frequency in Hz, and (rad/s)²/Hz.
    pub density: &'a [[f64; 2]],
}

/// Averaging time in s, deviation, its interval of 95 %, the degrees of freedom, and the power of the frequency in the noise.
type DeviationRow = (f64, f64, [f64; 2], f64, i32);

fn rows(deviations: &[Confident]) -> Vec<DeviationRow> {
    let row = |d: &Confident| (d.averaged.time_s, d.averaged.deviation, d.interval, d.freedom, d.exponent);
    deviations.iter().map(row).collect()
}

impl<'a> CalibrationSummary<'a> {
    /// The numbers of a calibration.
    pub fn of(found: &'a Calibration) -> Self {
        let rest = found.rest.iter().map(|rest| {
            let [(_, modified), (_, hadamard), (_, total)] = &rest.relatives;
            RestSummary {
                rest,
                allan: rows(&rest.deviations),
                modified: rows(modified),
                hadamard: rows(hadamard),
                total: rows(total),
                density: &rest.density,
            }
        });
        Self {
            name: found.file.name.to_string(),
            answer: Certificate::of(found).answer,
            results: &found.results,
            changes: &found.changes,
            comparisons: &found.comparisons,
            rest: rest.collect(),
            unit_records: &found.records,
            findings: &found.findings,
            rest_motions: &found.rest_motions,
        }
    }

    /// For a terminal.
    pub fn to_text(&self) -> String {
        self.to_text_within(usize::MAX)
    }

    /// For a terminal of so many columns.
    pub fn to_text_within(&self, columns: usize) -> String {
        let not_observed = |line: &String| format!("not observed: {line}\n");
        let text_of = |table: TextTable| table.to_text_within(columns);
        let mut parts: Vec<String> = Vec::new();
        if !self.answer.is_empty() {
            parts.push(self.answer.join("\n") + "\n");
        }
        if !self.results.is_empty() {
            parts.push(scale_factors(self.results).to_text_within(columns));
        }
        for result in self.results {
            parts.extend(tables_of(result).map(text_of));
            parts.extend(sentences(result).into_iter().map(|line| line + "\n"));
            parts.extend(result.not_observed.iter().map(not_observed));
            parts.extend(warning_lines(&result.warnings));
        }
        parts.extend(together(self.comparisons, self.changes).map(text_of));
        let rests: Vec<&AxisAtRest> = self.rest.iter().map(|rest| rest.rest).collect();
        parts.extend(at_rest(&rests).map(text_of));
        for record in self.unit_records {
            parts.push(quantities(record).to_text_within(columns));
            parts.extend(record.tables.iter().map(|table| table.to_text_within(columns)));
            parts.extend(record.not_observed.iter().map(not_observed));
            parts.extend(warning_lines(&record.warnings));
        }
        let findings = self.findings.iter().map(|finding| {
            let is_motion = self.rest_motions.contains(finding);
            format!("{}: {finding}\n", if is_motion { "WARNING" } else { "note" })
        });
        parts.extend(findings);
        parts.join("\n")
    }
}

/// Warnings for a terminal; the page has them in full.
fn warning_lines(warnings: &[String]) -> impl Iterator<Item = String> + '_ {
    warnings.iter().map(|warning| warning_line(warning, "applications") + "\n")
}

/// The budget of a result, and what else it has in tables.
fn tables_of(result: &CalibratedGyroscope) -> impl Iterator<Item = TextTable> {
    std::iter::once(budget(result))
        .chain([by_frequency(result), matrix(result), trials(result)].into_iter().flatten())
}

/// What is said of several results together.
fn together(found: &[ReferenceComparison], changed: &[ScaleFactorChange]) -> impl Iterator<Item = TextTable> {
    let tables =
        [(!found.is_empty()).then(|| comparisons(found)), (!changed.is_empty()).then(|| changes(changed))];
    tables.into_iter().flatten()
}

/// A line for each condition and reference.
pub(super) fn scale_factors(results: &[CalibratedGyroscope]) -> TextTable {
    let QuantityUnit { factor, shown, .. } = QuantityUnit::rate();
    let columns = [
        ColumnHead::text("condition"),
        ColumnHead::text("reference"),
        ColumnHead::text("axis"),
        ColumnHead::number("scale factor", ""),
        ColumnHead::number("U (95 %)", "ppm"),
        ColumnHead::number("k", ""),
        ColumnHead::number("ν", ""),
        ColumnHead::number("U by the records alone", "ppm"),
        ColumnHead::number("crest to trough", ""),
        ColumnHead::number("with intercept", ""),
        ColumnHead::number("bias", shown),
        ColumnHead::number("±", shown),
    ];
    let mut table = TextTable::new("Scale factors, gyroscope by reference", columns).with_expendable(&[
        "with intercept",
        "crest to trough",
        "U by the records alone",
    ]);
    for result in results {
        if result.withheld.is_some() {
            let mut row = vec![
                result.condition.clone(),
                result.reference.clone(),
                AXES[result.main].to_owned(),
                "withheld".to_owned(),
            ];
            row.resize(12, "–".to_owned());
            table.push(row);
            continue;
        }
        let found = &result.scale_factor;
        let UncertainEstimate { value, expanded_by_records, interval, .. } = *found;
        let in_ppm = |size: f64| format!("{:.1}", 1e6 * size / value.abs());
        let peaks = result.peak_to_peak;
        let or_dash = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| format!("{v:.6}"));
        let bias = result.bias[result.main].map(|bias| {
            with_uncertainty(factor * bias.value, 0.5 * factor * (bias.interval[1] - bias.interval[0]))
        });
        let [bias, expanded_bias] = bias.unwrap_or_else(|| ["–", "–"].map(str::to_owned));
        table.push([
            result.condition.clone(),
            result.reference.clone(),
            AXES[result.main].to_owned(),
            format!("{value:.6}"),
            in_ppm(0.5 * (interval[1] - interval[0])),
            format!("{:.2}", found.coverage_factor),
            freedom(found.degrees_of_freedom),
            in_ppm(expanded_by_records),
            or_dash(peaks.map(|p| p.through_origin)),
            or_dash(peaks.and_then(|p| p.slope)),
            bias,
            expanded_bias,
        ]);
    }
    table
}

/// The scale factor at each frequency, where one for all is excluded.
pub(super) fn by_frequency(result: &CalibratedGyroscope) -> Option<TextTable> {
    let columns = [
        ColumnHead::number("frequency", "Hz"),
        ColumnHead::number("records", ""),
        ColumnHead::number("scale factor", ""),
        ColumnHead::number("U (95 %)", ""),
        ColumnHead::number("k", ""),
        ColumnHead::number("ν", ""),
    ];
    let caption = format!("Scale factor by frequency: {}, {}", result.condition, result.reference);
    let mut table = TextTable::new(caption, columns);
    for at in &result.by_frequency {
        let found = &at.scale_factor;
        let [value, expanded] = with_uncertainty(found.value, found.expanded());
        table.push([
            format!("{:.2}", at.frequency_hz),
            at.records.to_string(),
            value,
            expanded,
            format!("{:.2}", found.coverage_factor),
            freedom(found.degrees_of_freedom),
        ]);
    }
    (!result.by_frequency.is_empty()).then_some(table)
}

/// What an uncertainty is made of.
pub(super) fn budget(result: &CalibratedGyroscope) -> TextTable {
    let columns = [
        ColumnHead::text("source"),
        ColumnHead::text("type"),
        ColumnHead::text("distribution"),
        ColumnHead::text("degrees of freedom"),
        ColumnHead::number("standard uncertainty", "ppm"),
        ColumnHead::text("known from"),
    ];
    let caption = format!("Uncertainty of the scale factor: {}, {}", result.condition, result.reference);
    let mut table = TextTable::new(caption, columns);
    for part in &result.budget {
        let ppm = part.ppm.map_or_else(|| "?".to_owned(), |ppm| format!("{ppm:.2}"));
        let [kind, distribution, freedom, source] = part.input.as_ref().map_or_else(
            || ["", "", "", ""].map(str::to_owned),
            |input| {
                let freedom = freedom(input.degrees_of_freedom);
                [
                    format!("{:?}", input.evaluation),
                    input.distribution.name().to_owned(),
                    freedom,
                    input.source.clone(),
                ]
            },
        );
        let known = if source.is_empty() || source == part.origin {
            part.origin.to_owned()
        } else {
            format!("{}: {source}", part.origin)
        };
        table.push([short(&part.source), kind, distribution, freedom, ppm, known]);
    }
    let found = &result.scale_factor;
    let in_ppm = |size: f64| format!("{:.2}", 1e6 * size / found.value.abs());
    let dash = String::new;
    table.push([
        "combined standard uncertainty".to_owned(),
        dash(),
        dash(),
        freedom(found.degrees_of_freedom),
        in_ppm(found.uncertainty),
        "root of the sum of squares, effective degrees of freedom".to_owned(),
    ]);
    table.push([
        "expanded uncertainty".to_owned(),
        dash(),
        dash(),
        dash(),
        in_ppm(found.expanded()),
        format!("coverage factor {:.3}, for 95 %", found.coverage_factor),
    ]);
    table
}

/// The name of an input in tables and pictures: of numbers that hang together the first, and how many more.
fn short(name: &str) -> String {
    let parts: Vec<&str> = name.split("_with_").collect();
    match parts.as_slice() {
        [first, _, _, ..] => format!("{first} and {} more of the device", parts.len() - 1),
        _ => name.to_owned(),
    }
}

/// Degrees of freedom in a table.
fn freedom(number: f64) -> String {
    if number.is_finite() && number < 1e6 { format!("{number:.1}") } else { "∞".to_owned() }
}

/// A coverage factor with the effective degrees of freedom that it is for, as JCGM 100 (7.2.3, G.6.4) asks for beside an expanded uncertainty.
fn coverage(factor: f64, degrees_of_freedom: f64) -> String {
    format!("{factor:.2} ({})", freedom(degrees_of_freedom))
}

/// Why the interval of a whole is narrower than that of a part of it, where it is.
fn narrower_than_its_part(found: &UncertainEstimate) -> Option<String> {
    (found.expanded() < found.expanded_by_records).then(|| {
        let in_ppm = |size: f64| format!("{:.1} ppm", 1e6 * size / found.value.abs());
        format!(
            "the interval of the whole (± {}) is narrower than that of the records alone (± {}), although its standard uncertainty is larger ({} \
             against {}): with what is stated besides there are {} effective degrees of freedom, and with the records alone {}, so that \
             the coverage factors are {:.2} and {:.2} (JCGM 100, G.6.4)",
            in_ppm(found.expanded()),
            in_ppm(found.expanded_by_records),
            in_ppm(found.uncertainty),
            in_ppm(found.by_records),
            freedom(found.degrees_of_freedom),
            freedom(found.degrees_of_freedom_by_records),
            found.coverage_factor,
            found.coverage_factor_by_records
        )
    })
}

/// The intervals by trials beside the expanded uncertainties.
fn trials(result: &CalibratedGyroscope) -> Option<TextTable> {
    let check = result.cross_check.as_ref()?;
    let columns = [
        ColumnHead::text("entry"),
        ColumnHead::number("trials", ""),
        ColumnHead::number("mean", ""),
        ColumnHead::number("standard deviation", ""),
        ColumnHead::number("95 % from", ""),
        ColumnHead::number("to", ""),
        ColumnHead::number("lower end, expanded less trials", ""),
        ColumnHead::number("upper end", ""),
        ColumnHead::number("tolerance", ""),
        ColumnHead::text("agrees"),
    ];
    let caption = format!("By trials (JCGM 101): {}, {}", result.condition, result.reference);
    let mut table = TextTable::new(caption, columns);
    let axis = AXES[result.main];
    let own = (format!("k_{axis}{axis}"), &check.scale_factor);
    let others = check.entries.iter().map(|(name, comparison)| (name.clone(), comparison));
    for (name, comparison) in std::iter::once(own).chain(others) {
        let found = &comparison.propagated;
        table.push([
            name,
            found.trials.to_string(),
            format!("{:.7}", found.value),
            format!("{:.2e}", found.standard_uncertainty),
            format!("{:.7}", found.interval[0]),
            format!("{:.7}", found.interval[1]),
            format!("{:+.1e}", comparison.differences[0]),
            format!("{:+.1e}", comparison.differences[1]),
            format!("{:.1e}", comparison.tolerance),
            if comparison.agrees { "yes" } else { "no" }.to_owned(),
        ]);
    }
    Some(table)
}

/// Pairs of references.
pub(super) fn comparisons(comparisons: &[ReferenceComparison]) -> TextTable {
    let columns = [
        ColumnHead::text("condition"),
        ColumnHead::text("axis"),
        ColumnHead::text("references"),
        ColumnHead::number("difference", "ppm"),
        ColumnHead::number("its standard uncertainty", "ppm"),
        ColumnHead::number("normalised error", ""),
        ColumnHead::text("verdict"),
    ];
    let mut table = TextTable::new("Whether the references agree", columns);
    for found in comparisons {
        let [first, second] = &found.references;
        table.push([
            found.condition.clone(),
            AXES[found.axis].to_owned(),
            format!("{second} less {first}"),
            format!("{:+.1}", found.difference_ppm),
            format!("{:.1}", found.uncertainty_ppm),
            format!("{:+.2}", found.normalised_error),
            if found.contradict { "contradict each other" } else { "agree" }.to_owned(),
        ]);
    }
    table
}

/// K, where there is more than one entry.
pub(super) fn matrix(result: &CalibratedGyroscope) -> Option<TextTable> {
    let known = result.matrix.iter().flatten().flatten().count();
    if known < 2 {
        return None;
    }
    let columns = [
        ColumnHead::text("entry"),
        ColumnHead::number("value", ""),
        ColumnHead::number("± 95 %", ""),
        ColumnHead::number("95 % interval from", ""),
        ColumnHead::number("to", ""),
    ];
    let caption = format!("K, row: gyroscope, column: rotation: {}, {}", result.condition, result.reference);
    let mut table = TextTable::new(caption, columns);
    for (i, row) in result.matrix.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let Some(entry) = entry else { continue };
            let [low, high] = entry.interval;
            table.push([
                format!("k_{}{}", AXES[i], AXES[j]),
                format!("{:.6}", entry.value),
                format!("{:.6}", 0.5 * (high - low)),
                format!("{low:.6}"),
                format!("{high:.6}"),
            ]);
        }
    }
    Some(table)
}

fn in_mrad(angle: &UncertainEstimate) -> String {
    let half = 0.5 * (angle.interval[1] - angle.interval[0]);
    format!("{:.4} ± {:.4} mrad", 1e3 * angle.value, 1e3 * half)
}

/// What else there is, in sentences: of the interval, and of the axes.
fn sentences(result: &CalibratedGyroscope) -> Vec<String> {
    let mut lines: Vec<String> = narrower_than_its_part(&result.scale_factor).into_iter().collect();
    if result.matrix.iter().flatten().flatten().count() > 1 {
        let parts = result
            .excitation
            .iter()
            .map(|(size, [x, y, z])| format!("{size:.3e} rad/s along ({x:+.2}, {y:+.2}, {z:+.2})"));
        lines.push(format!("singular values of the rotation: {}", parts.collect::<Vec<_>>().join("; ")));
    }
    if let Some([_, angles, mounting]) = &result.alignment {
        let named = |names: [&str; 3], of: &[UncertainEstimate; 3]| {
            let parts = names.iter().zip(of).map(|(name, angle)| format!("{name} {}", in_mrad(angle)));
            parts.collect::<Vec<_>>().join(", ")
        };
        lines.push(format!("non-orthogonality of the axes: {}", named(["xy", "xz", "yz"], angles)));
        lines.push(format!("mounting, turned about: {}", named(["x", "y", "z"], mounting)));
    }
    if let Some(plane) = &result.in_plane {
        let [a, b] = plane.axes;
        lines.push(format!(
            "to first order: axes {a} and {b} are closer than square by {}; the case is turned by {} from {a} to {b}",
            in_mrad(&plane.non_orthogonality),
            in_mrad(&plane.turn)
        ));
    }
    if let Some(centre) = &result.centre {
        let known = centre.arm.iter().zip(AXES).filter_map(|(arm, axis)| {
            let arm = (*arm)?;
            let half = 0.5 * (arm.interval[1] - arm.interval[0]);
            Some(format!("{axis} {:.2} ± {:.2} µm", 1e6 * arm.value, 1e6 * half))
        });
        lines.push(format!(
            "accelerometers from the centre of rotation: {} (χ² {:.1} at {} degrees of freedom)",
            known.collect::<Vec<_>>().join(", "),
            centre.chi_square,
            centre.freedom
        ));
    }
    lines
}

fn changes(changes: &[ScaleFactorChange]) -> TextTable {
    let columns = [
        ColumnHead::text("reference"),
        ColumnHead::text("from"),
        ColumnHead::text("to"),
        ColumnHead::number("change", "ppm"),
        ColumnHead::number("standard uncertainty", "ppm"),
        ColumnHead::number("per kelvin", "ppm/K"),
    ];
    let mut table = TextTable::new("How the scale factor changes", columns);
    for change in changes {
        table.push([
            change.reference.clone(),
            change.from.clone(),
            change.to.clone(),
            format!("{:+.1}", change.ppm),
            format!("{:.1}", change.deviation_ppm),
            change.ppm_per_k.map_or_else(|| "–".to_owned(), |k| format!("{k:+.2}")),
        ]);
    }
    table
}

/// The numbers of a record of another kind.
pub(super) fn quantities(record: &RecordOutcome) -> TextTable {
    let columns = [
        ColumnHead::text("quantity"),
        ColumnHead::number("value", ""),
        ColumnHead::number("U (95 %)", ""),
        ColumnHead::text("unit"),
        ColumnHead::number("k", ""),
        ColumnHead::number("ν", ""),
    ];
    let caption = format!("{}: results with expanded uncertainties of 95 %", record.title);
    let mut table = TextTable::new(caption, columns);
    for quantity in &record.quantities {
        let QuantityUnit { factor, shown, .. } = quantity.unit;
        let found = &quantity.estimate;
        let [value, expanded] = with_uncertainty(factor * found.value, factor * found.expanded());
        table.push([
            quantity.name.replace('_', " "),
            value,
            expanded,
            shown.to_owned(),
            format!("{:.2}", found.coverage_factor),
            freedom(found.degrees_of_freedom),
        ]);
    }
    table
}

/// The mean of each axis, and the noise that was fitted; none of no axis.
pub(super) fn at_rest(rests: &[&AxisAtRest]) -> impl Iterator<Item = TextTable> {
    let columns = [
        ColumnHead::text("axis"),
        ColumnHead::number("static bias", ""),
        ColumnHead::number("U", ""),
        ColumnHead::number("k", ""),
        ColumnHead::number("ν", ""),
        ColumnHead::number("rms noise", ""),
        ColumnHead::text("unit"),
    ];
    let mut biases = TextTable::new(
        "Bias at rest, with its expanded uncertainty of 95 %; of an accelerometer it has gravity in it",
        columns,
    );
    let columns = [
        ColumnHead::text("axis"),
        ColumnHead::text("noise"),
        ColumnHead::number("value", ""),
        ColumnHead::number("95 % from", ""),
        ColumnHead::number("to", ""),
        ColumnHead::text("unit"),
    ];
    let mut noises =
        TextTable::new("Noise at rest, fitted to Allan's variances, and an even change of the bias", columns);
    for rest in rests {
        let estimate = rest.bias_estimate();
        let (factor, unit) = match rest.sensor {
            InertialSensor::Gyroscope => rest.sensor.shown(),
            InertialSensor::Accelerometer => (1e3, "mm/s^2"),
        };
        let [value, expanded] = with_uncertainty(factor * estimate.value, factor * estimate.expanded());
        let axis = rest.sensor.axis(rest.axis);
        biases.push([
            axis.clone(),
            value,
            expanded,
            format!("{:.2}", estimate.coverage_factor),
            freedom(estimate.degrees_of_freedom),
            significant(factor * rest.noise),
            unit.to_owned(),
        ]);
        for term in rest.noise_terms() {
            let (factor, unit) = term.shown;
            let Some([low, high]) = term.interval.map(|ends| ends.map(|end| end * factor)) else { continue };
            let number = |number: f64| if number == 0.0 { "0".to_owned() } else { three_digits(number) };
            let value =
                term.value.map_or_else(|| format!("< {}", number(high)), |value| number(value * factor));
            noises.push([
                axis.clone(),
                term.name.to_owned(),
                value,
                number(low),
                number(high),
                unit.to_owned(),
            ]);
        }
    }
    [biases, noises].into_iter().take(if rests.is_empty() { 0 } else { 2 })
}

/// With three significant digits.
fn three_digits(number: f64) -> String {
    let place = 2.0 - number.abs().portable_log10().floor();
    if !(0.0..9.0).contains(&place) {
        return format!("{number:.2e}");
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 8
    let digits = place as usize;
    format!("{number:.digits$}")
}

/// A number with an expanded uncertainty, which has two significant digits, and the number the same last place (JCGM 100, 7.2.6).
pub(super) fn with_uncertainty(value: f64, expanded: f64) -> [String; 2] {
    if !(expanded.abs() > 0.0 && expanded.is_finite()) {
        return [format!("{value:.6}"), format!("{expanded:.6}")];
    }
    let mut place = expanded.abs().portable_log10().floor() - 1.0;
    // 0.0996 becomes 0.10.
    if (expanded.abs() / 10.0_f64.portable_powf(place)).round() >= 100.0 {
        place += 1.0;
    }
    let unit = 10.0_f64.portable_powf(place.max(0.0));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and 12
    let digits = (-place).clamp(0.0, 12.0) as usize;
    let rounded = |number: f64| if unit > 1.0 { (number / unit).round() * unit } else { number };
    [value, expanded].map(|number| format!("{:.digits$}", rounded(number)))
}

/// The pictures of a calibration.
pub fn calibration_figures(found: &Calibration) -> Vec<Figure> {
    let mut figures: Vec<Figure> =
        found.results.iter().filter(|r| r.records.len() > 1).map(of_records).collect();
    figures.extend(found.results.iter().map(of_budget));
    figures.extend(found.condition_parts.iter().chain(&found.rest_parts).cloned());
    for sensor in [InertialSensor::Gyroscope, InertialSensor::Accelerometer] {
        let rests: Vec<&AxisAtRest> = found.rest.iter().filter(|rest| rest.sensor == sensor).collect();
        if !rests.is_empty() {
            figures.push(of_rest(&rests, sensor));
            figures.push(of_density(&rests, sensor));
        }
    }
    figures.extend(found.records.iter().flat_map(|record| record.figures.iter().cloned()));
    figures
}

/// The identifier of the figure of a sensor at rest, and the stem of its table.
const fn allan_id(sensor: InertialSensor) -> &'static str {
    match sensor {
        InertialSensor::Gyroscope => "allan",
        InertialSensor::Accelerometer => "allan-accelerometers",
    }
}

/// The share of the largest rate about the main axis below which a record tells nothing of its scale factor.
const FAINT: f64 = 0.1;

/// The residual of each record.
fn of_records(result: &CalibratedGyroscope) -> Figure {
    let value = result.scale_factor.value;
    // A record with little rotation about the main axis tells nothing of its scale factor, and its bar would set the scale.
    let most = result.records.iter().map(|r| r.reference).fold(0.0, f64::max);
    let of_axis = result.records.iter().filter(|r| r.reference > FAINT * most);
    let residuals: Vec<(f64, f64, f64)> = of_axis
        .filter_map(|r| Some((r.reference, 1e6 * r.residual?, 1.96e6 * r.deviation / value.abs())))
        .collect();
    let half = 1e6 * result.scale_factor.expanded_by_records / value.abs();
    let found = &result.scale_factor;
    let of_fit = format!(
        "95 % of the fit, by the records alone: k (ν) = {}",
        coverage(found.coverage_factor_by_records, found.degrees_of_freedom_by_records)
    );
    let mut records = Panel::new(
        Axis::new("rate amplitude by the reference", "rad/s"),
        Axis::new("residual of the record", "ppm"),
    );
    for (k, (x, residual, bar)) in residuals.iter().enumerate() {
        let label = if k == 0 { "95 % by its noise" } else { "" };
        let bar = [(*x, residual - bar), (*x, residual + bar)];
        records = records.with(Series::line(label, SeriesRole::Measured, bar));
    }
    let points: Vec<(f64, f64)> = residuals.iter().map(|(x, residual, _)| (*x, *residual)).collect();
    records = records
        .with(Series::points("each record", SeriesRole::Estimate, points))
        .with(Series::level(of_fit, SeriesRole::Bound, half))
        .with(Series::level("", SeriesRole::Bound, -half));
    Figure::new(
        format!("records-{}-{}", result.condition, result.reference),
        format!("Condition {}, reference {}", result.condition, result.reference),
        "What each record shows beyond the fit to all, with all that is fitted between the axes, over what the fitted scale factor makes \
         of its rate. Records further apart than their bars say that the fit is not the whole truth. Those with less than a tenth of \
         the largest rate about this axis are left out.",
    )
    .with(records)
}

/// Half the height of a bar, of rows that are 1 apart.
const HALF_BAR: f64 = 0.3;

/// What each input adds to the uncertainty of a scale factor, and all together.
fn of_budget(result: &CalibratedGyroscope) -> Figure {
    let mut parts: Vec<(&str, f64)> =
        result.budget.iter().filter_map(|part| Some((part.source.as_str(), part.ppm?))).collect();
    let all = 1e6 * result.scale_factor.uncertainty / result.scale_factor.value.abs();
    parts.retain(|(_, ppm)| *ppm > 1e-3 * all);
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let rows: Vec<(&str, f64)> = std::iter::once(("combined", all)).chain(parts).collect();
    let names = rows.iter().map(|(name, ppm)| format!("{}: {ppm:.1}", short(name)));
    // Negative correlations leave less of all together than of one.
    let widest = rows.iter().map(|(_, ppm)| *ppm).fold(0.0, f64::max);
    let mut panel = Panel::new(
        Axis::new("standard uncertainty", "ppm").between(0.0, 1.05 * widest),
        Axis::of_names(names),
    );
    for (place, (_, ppm)) in rows.iter().enumerate() {
        let (low, high) = (-(place as f64) - HALF_BAR, -(place as f64) + HALF_BAR);
        let role = if place == 0 { SeriesRole::Estimate } else { SeriesRole::Model };
        panel = panel.with(Series::band("", role, [(0.0, low, high), (*ppm, low, high)]));
    }
    Figure::new(
        format!("budget-{}-{}", result.condition, result.reference),
        format!("Budget of the scale factor: condition {}, reference {}", result.condition, result.reference),
        "Standard uncertainties of the scale factor in ppm by what they come from, largest first below all together. What nobody stated is \
         not in it, and what is below a thousandth of all is left out.",
    )
    .with(panel)
}

/// From a third of the lowest deviation to three times the highest: the upper end of the interval at the longest time, of two or three
/// differences, would else set the scale.
fn deviation_axis(rest: &AxisAtRest) -> Axis {
    let (factor, unit) = rest.sensor.shown();
    let deviations = || rest.deviations.iter().map(|d| d.averaged.deviation * factor);
    let [low, high] = [deviations().fold(f64::INFINITY, f64::min), deviations().fold(0.0, f64::max)];
    let axis = Axis::new(format!("deviation of {}", rest.axis), unit).log();
    if low > 0.0 && high.is_finite() { axis.between(low / 3.0, 3.0 * high) } else { axis }
}

/// Allan's deviation of each axis.
fn of_rest(rests: &[&AxisAtRest], sensor: InertialSensor) -> Figure {
    let figure = Figure::new(
        allan_id(sensor),
        "At rest",
        "Allan's deviation, overlapping, with the interval that holds the true one 95 times in 100, and the noise that was fitted to it: \
         quantisation, white noise after a low pass, flicker and a random walk. N, B and K are its random walk of the angle or velocity, its bias \
         instability, and its random walk of the rate or acceleration; \"<\" is the upper end of an interval from 0 on.",
    );
    let (factor, _) = sensor.shown();
    let shown = |size: f64| factor * size;
    rests.iter().fold(figure, |figure, rest| {
        let known = || rest.deviations.iter().filter(|d| d.interval[1].is_finite());
        let mut panel = Panel::new(Axis::new("averaging time", "s").log(), deviation_axis(rest))
            .with(Series::band(
                "95 %",
                SeriesRole::Estimate,
                known()
                    .map(|d| (d.averaged.time_s, shown(d.interval[0]), shown(d.interval[1])))
                    .collect::<Vec<_>>(),
            ))
            .with(Series::line(
                "Allan's deviation",
                SeriesRole::Estimate,
                known().map(|d| (d.averaged.time_s, shown(d.averaged.deviation))).collect::<Vec<_>>(),
            ));
        if let Some(fit) = &rest.noise_fit {
            let holds = || known().filter(|d| d.averaged.time_s >= fit.from_s).map(|d| d.averaged.time_s);
            let line = holds().map(|time_s| (time_s, shown(fit.deviation(time_s))));
            panel = panel.with(Series::line("fitted noise", SeriesRole::Model, line.collect::<Vec<_>>()));
            if let Some(walk) = rest.angle_random_walk {
                let line = holds().map(|time_s| (time_s, shown(walk / time_s.sqrt())));
                panel = panel.with(Series::line(
                    rest.noise_terms()[0].name,
                    SeriesRole::Bound,
                    line.collect::<Vec<_>>(),
                ));
            }
            let times: Vec<f64> = holds().collect();
            panel = panel.with(Series::written(
                "",
                SeriesRole::Model,
                written_terms(rest, fit, &times)
                    .map(|(time_s, text)| (time_s, shown(fit.deviation(time_s)), text)),
            ));
        }
        if let Some([bias, _]) = rest.bias_instability {
            let floor = shown(bias * super::noise_model::FLOOR.sqrt());
            panel = panel.with(Series::level("floor of the bias instability", SeriesRole::Bound, floor));
        }
        figure.with(panel)
    })
}

/// Random walk N, bias instability B and rate random walk K with their values, each at the averaging time at which it has its largest share of
/// the fitted variance; of one whose interval begins at 0 the upper end.
fn written_terms<'a>(
    rest: &AxisAtRest,
    fit: &'a NoiseFit,
    times_s: &'a [f64],
) -> impl Iterator<Item = (f64, String)> + 'a {
    /// The power of the averaging time with which the deviation of each goes.
    const POWERS: [(&str, f64); 3] = [("N", -0.5), ("B", 0.0), ("K", 0.5)];
    let terms = rest.noise_terms();
    POWERS.into_iter().zip(terms).filter_map(move |((symbol, power), term)| {
        let (factor, unit) = term.shown;
        let text = match (term.value, term.interval) {
            (Some(value), _) => format!("{symbol} = {} {unit}", three_digits(factor * value)),
            (None, Some([_, high])) => format!("{symbol} < {} {unit}", three_digits(factor * high)),
            (None, None) => return None,
        };
        let share = |time_s: f64| time_s.portable_powf(power) / fit.deviation(time_s);
        let times = times_s.iter().copied();
        Some((times.max_by(|a, b| share(*a).total_cmp(&share(*b)))?, text))
    })
}

/// The density of each axis with the fitted noise and the lines that stand out.
fn of_density(rests: &[&AxisAtRest], sensor: InertialSensor) -> Figure {
    let (id, unit) = match sensor {
        InertialSensor::Gyroscope => ("density", "rad/s/Hz^(1/2)"),
        InertialSensor::Accelerometer => ("density-accelerometers", "m/s^2/Hz^(1/2)"),
    };
    let figure = Figure::new(
        id,
        "Density of the noise at rest",
        "The root of the density on either side of the frequency 0, averaged over bands; what white noise, flicker and a random walk as fitted to Allan's \
         variances have, and the lines that stand out of the noise, with the amplitude over the root of the resolution.",
    );
    rests.iter().fold(figure, |figure, rest| {
        let measured: Vec<(f64, f64)> = rest.density.iter().map(|[f, s]| (*f, s.sqrt())).collect();
        let mut panel = Panel::new(
            Axis::new("frequency", "Hz").log(),
            Axis::new(format!("root density of {}", rest.axis), unit).log(),
        )
        .with(Series::line("measured", SeriesRole::Measured, measured));
        if let Some(fit) = &rest.noise_fit {
            let of = |f: f64| {
                let turn = std::f64::consts::TAU * f;
                let white = fit.angle_random_walk.0.powi(2) / (1.0 + (turn * fit.time_constant_s).powi(2));
                let (flicker, walk) =
                    (fit.bias_instability.0.powi(2) / turn, (fit.rate_random_walk.0 / turn).powi(2));
                (white + flicker + walk).sqrt()
            };
            let fitted: Vec<(f64, f64)> = rest.density.iter().map(|[f, _]| (*f, of(*f))).collect();
            panel = panel.with(Series::line("fitted noise", SeriesRole::Model, fitted));
        }
        for (label, role, lines) in [
            ("lines", SeriesRole::Estimate, &rest.lines),
            ("subtracted lines", SeriesRole::Reference, &rest.subtracted),
        ] {
            let points = lines.iter().map(|[f, amplitude]| (*f, 0.5 * amplitude * rest.duration_s.sqrt()));
            if !lines.is_empty() {
                panel = panel.with(Series::points(label, role, points.collect::<Vec<_>>()));
            }
        }
        figure.with(panel)
    })
}

/// Writes a calibration into a result: `calibration.json`, `calibration.csv` (a line for each entry of K and each bias),
/// `records.csv`, `allan.csv` where there is a record at rest, `imu.yaml` where it is asked for, `temperature.json`, `temperature.h` and `temperature.rs` where there are curves over the temperature, `certificate.json` and `certificate.html`, `report.html`, its pictures in
/// `figures/`, `run.toml`.
pub fn write_calibration(found: &Calibration, output: &Output, info: RunInfo) -> Result<(), WriteError> {
    let input_id = input_id(found);
    let summary = CalibrationSummary::of(found);
    output.write("calibration.json", |w| {
        serde_json::to_writer_pretty(&mut *w, &summary)?;
        writeln!(w)
    })?;
    output.write("calibration.csv", |w| entries(found, w))?;
    if !found.results.is_empty() {
        output.write("records.csv", |w| records(&found.results, w))?;
    }
    for sensor in [InertialSensor::Gyroscope, InertialSensor::Accelerometer] {
        let rests: Vec<&AxisAtRest> = found.rest.iter().filter(|rest| rest.sensor == sensor).collect();
        if !rests.is_empty() {
            output.write(&format!("{}.csv", allan_id(sensor)), |w| allan(&rests, sensor, w))?;
        }
    }
    let wants_yaml = found.file.rest.as_ref().is_some_and(|rest| rest.noise_yaml);
    let yaml = noise_yaml(&found.rest, found.file.gyroscope.rate.si());
    if let Some(yaml) = yaml.filter(|_| wants_yaml) {
        output.write("imu.yaml", |w| w.write_all(yaml.as_bytes()))?;
    }
    let compensation: Vec<&TemperatureCurve> =
        found.records.iter().flat_map(|record| &record.compensation).collect();
    if !compensation.is_empty() {
        output.write("temperature.json", |w| {
            serde_json::to_writer_pretty(&mut *w, &compensation)?;
            writeln!(w)
        })?;
        output.write("temperature.h", |w| w.write_all(header(&compensation).as_bytes()))?;
        output.write("temperature.rs", |w| w.write_all(rust_module(&compensation).as_bytes()))?;
    }
    let figures = calibration_figures(found);
    let html = explained(page(found, &figures)).to_html()?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    let certificate = Certificate::of(found);
    output.write("certificate.json", |w| {
        serde_json::to_writer_pretty(&mut *w, &certificate)?;
        writeln!(w)
    })?;
    let html = explained(certificate_page(&certificate, found, &figures)).to_html()?;
    output.write("certificate.html", |w| w.write_all(html.as_bytes()))?;
    write_figures(&figures, output)?;
    output.write_run(&input_id, || {
        Ok(CalibrationRecord {
            timing: info.timing(),
            input: &found.sources,
            calibration: toml::Value::try_from(&found.file).map_err(io::Error::other)?,
        })
    })?;
    Ok(())
}

/// Writes what was found of the parts of the records of a calibration that was refused: `report.html` and the pictures.
pub fn write_refused_calibration(
    file: &GyroscopeCalibration,
    why: &CalibrationError,
    parts: &[Figure],
    output: &Output,
) -> Result<(), WriteError> {
    let section = PageSection::new("Refused").notice(NoticeSeverity::Warning, why.to_string());
    let subtitle =
        "The calibration was refused. The pictures show the parts of the records as they were found.";
    let page = Page::new(file.name.to_string(), subtitle)
        .with(parts.iter().cloned().fold(section, PageSection::figure));
    let html = page.to_html()?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    Ok(write_figures(parts, output)?)
}

fn write_figures(figures: &[Figure], output: &Output) -> Result<(), OutputError> {
    figures
        .iter()
        .try_for_each(|figure| figure.files(|name, content| output.write(name, |w| w.write_all(content))))
}

fn entries(found: &Calibration, w: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(w);
    table.write_record([
        "condition",
        "reference",
        "quantity",
        "unit",
        "value",
        "by_records",
        "uncertainty",
        "low",
        "high",
    ])?;
    let mut put = |words: [&str; 4], entry: &UncertainEstimate| {
        let UncertainEstimate { value, by_records, uncertainty, interval: [low, high], .. } = *entry;
        table.write_record(row(&words, &[value, by_records, uncertainty, low, high]))
    };
    for result in &found.results {
        let names = (0..9).map(|k| format!("k_{}{}", AXES[k / 3], AXES[k % 3]));
        let entries = names.zip(result.matrix.iter().flatten()).map(|(name, entry)| (name, "1", entry));
        let biases =
            AXES.iter().zip(&result.bias).map(|(axis, bias)| (format!("bias_{axis}"), "rad/s", bias));
        for (name, unit, entry) in entries.chain(biases) {
            let Some(entry) = entry else { continue };
            put([&result.condition, &result.reference, &name, unit], entry)?;
        }
    }
    for record in &found.records {
        for quantity in &record.quantities {
            put([record.kind, "", &quantity.name, quantity.unit.unit], &quantity.estimate)?;
        }
    }
    table.flush()
}

/// The cells of words, which may be anybody's, and of numbers.
fn row(words: &[&str], numbers: &[f64]) -> Vec<String> {
    let words = words.iter().map(|word| guarded(word).into_owned());
    words.chain(numbers.iter().map(|number| format!("{number:e}"))).collect()
}

fn records(results: &[CalibratedGyroscope], w: &mut dyn Write) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(w);
    table.write_record([
        "condition",
        "reference",
        "record",
        "axis",
        "frequency_Hz",
        "sample_rate_Hz",
        "reference_rad_per_s",
        "gyroscope_rad_per_s",
        "scale_factor_1",
        "scale_factor_sd_1",
        "residual_1",
    ])?;
    for result in results {
        for r in &result.records {
            let residual = r.residual.unwrap_or(f64::NAN);
            let numbers = [
                r.frequency_hz,
                r.sample_rate_hz,
                r.reference,
                r.shown,
                r.scale_factor,
                r.deviation,
                residual,
            ];
            let words: [&str; 4] = [&result.condition, &result.reference, &r.record, AXES[result.main]];
            table.write_record(row(&words, &numbers))?;
        }
    }
    table.flush()
}

fn allan(rests: &[&AxisAtRest], sensor: InertialSensor, w: &mut dyn Write) -> io::Result<()> {
    let unit = match sensor {
        InertialSensor::Gyroscope => "rad_per_s",
        InertialSensor::Accelerometer => "m_per_s2",
    };
    writeln!(w, "axis,time_s,deviation_{unit},low_{unit},high_{unit},freedom_1,exponent_1")?;
    for rest in rests {
        for d in &rest.deviations {
            let ([low, high], a) = (d.interval, d.averaged);
            writeln!(
                w,
                "{},{:e},{:e},{low:e},{high:e},{:e},{}",
                rest.axis, a.time_s, a.deviation, d.freedom, d.exponent
            )?;
        }
    }
    Ok(())
}

/// A section with notes, which a print shows as well.
fn noted(section: PageSection, lines: impl IntoIterator<Item = String>) -> PageSection {
    section.findings(NoticeSeverity::Note, lines.into_iter().collect())
}

fn page(found: &Calibration, figures: &[Figure]) -> Page {
    let subtitle = found.file.description.clone().unwrap_or_default();
    let mut page = Page::new(found.file.name.to_string(), subtitle);
    let link = link("applications");
    let of_results = found.results.iter().flat_map(|result| {
        let place = format!("{}, {}", result.condition, result.reference);
        result.warnings.iter().map(move |warning| format!("{place}: {warning}"))
    });
    let of_records = found
        .records
        .iter()
        .flat_map(|record| record.warnings.iter().map(move |warning| format!("{}: {warning}", record.title)));
    let warnings = of_results.chain(of_records).map(|text| text + &link).collect();
    let section = PageSection::new("Verdict").part(PagePart::Verdict);
    let section = Certificate::of(found).answer.iter().fold(section, PageSection::paragraph);
    let section = section.findings(NoticeSeverity::Warning, warnings);
    if found.results.is_empty() && !section.blocks.is_empty() {
        page = page.with(section);
    } else if !found.results.is_empty() {
        let section = section.table(scale_factors(&found.results)).paragraph(
            "Both instruments are fitted by sines of free frequency: each has its own clock. The interval has all that the \
             budget knows of; what nobody stated is not in it. Crest to trough is the published method, samples about the \
             turning points averaged; with an intercept, as printed, its errors are three to four times larger.",
        );
        let tables = together(&found.comparisons, &found.changes);
        page = page.with(tables.fold(section, PageSection::table));
    }
    let with_not_observed = |section: PageSection, lines: &[String]| {
        noted(section, lines.iter().map(|line| format!("Not observed: {line}")))
    };
    let with_figures = |section: PageSection, is_of: &dyn Fn(&str) -> bool| {
        figures.iter().filter(|figure| is_of(&figure.id)).cloned().fold(section, PageSection::figure)
    };
    for (place, result) in found.results.iter().enumerate() {
        let section =
            PageSection::new(format!("Condition {}, reference {}", result.condition, result.reference))
                .part(PagePart::Evidence);
        let section = tables_of(result).fold(section, PageSection::table);
        let section = sentences(result).into_iter().fold(section, PageSection::paragraph);
        let ids =
            ["budget", "records"].map(|kind| format!("{kind}-{}-{}", result.condition, result.reference));
        let section = with_not_observed(section, &result.not_observed);
        // The records are those of all references of the condition.
        let is_first = found.results.iter().take(place).all(|other| other.condition != result.condition);
        let parts = is_first.then(|| format!("parts-{}", result.condition));
        page = page.with(with_figures(section, &|id| ids.iter().chain(&parts).any(|own| own == id)));
    }
    if !found.rest.is_empty() {
        let rests: Vec<&AxisAtRest> = found.rest.iter().collect();
        let section = at_rest(&rests).fold(PageSection::new("At rest"), PageSection::table);
        page = page.with(with_figures(section, &|id| id.starts_with("allan")));
        let is_beneath = |id: &str| ["rest", "density"].iter().any(|kind| id.starts_with(kind));
        let further = PageSection::new("The record at rest, and the density of its noise").folded(true);
        page = page.with(with_figures(further, &is_beneath));
    }
    for record in &found.records {
        let section =
            PageSection::new(record.title.clone()).part(PagePart::Evidence).table(quantities(record));
        let section = record.tables.iter().cloned().fold(section, PageSection::table);
        let section = with_not_observed(section, &record.not_observed);
        page = page.with(record.figures.iter().cloned().fold(section, PageSection::figure));
    }
    if !found.findings.is_empty() {
        let section = PageSection::new("In the files").part(PagePart::Made);
        page = page.with(noted(section, found.findings.clone()));
    }
    let file = toml::Value::try_from(&found.file).and_then(|file| toml::to_string(&file));
    let file = file.unwrap_or_else(|e| format!("cannot be written: {e}"));
    let beside = "The numbers are in `calibration.json`; dates and durations are in `run.toml`.";
    let made = PageSection::made("calibrate gyro", env!("CARGO_PKG_VERSION"), beside);
    page.with(made.preformatted("The calibration file as it was understood", file))
}

/// What tells one input from another: the name and the bytes of the files.
fn input_id(found: &Calibration) -> String {
    let files =
        found.sources.iter().map(|s| format!("{} {}", s.file, s.sha256.get(..12).unwrap_or(&s.sha256)));
    format!("{}: calibration of a gyroscope, {}", found.file.name, files.collect::<Vec<_>>().join(", "))
}

#[derive(Serialize)]
struct CalibrationRecord<'a> {
    timing: RunTiming,
    input: &'a [RecordingSource],
    calibration: toml::Value,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrology::Combined;

    /// A condition may be called so, and a record has the name of its file.
    #[test]
    fn words_that_a_spreadsheet_would_compute_are_text_in_every_table() {
        assert_eq!(row(&["-1", "-monday", "=1+1"], &[-0.5]), ["-1", "'-monday", "'=1+1", "-5e-1"]);
    }

    /// The two-sided quantiles of the t distribution for 95 %, JCGM 100, table G.2: 3.18 with 3 degrees of freedom, 2.57 with 5.
    fn combined(ppm: f64, degrees_of_freedom: f64, coverage_factor: f64) -> Combined {
        let standard_uncertainty = 1e-6 * ppm;
        Combined {
            standard_uncertainty,
            degrees_of_freedom,
            probability: 0.95,
            coverage_factor,
            expanded_uncertainty: coverage_factor * standard_uncertainty,
        }
    }

    #[test]
    fn an_expanded_uncertainty_has_two_digits_and_its_value_the_same_place() {
        for (value, expanded, shown) in [
            (1.013_689, 0.000_144_3, ["1.01369", "0.00014"]),
            (2.0, 0.0996, ["2.00", "0.10"]),
            (1_234_567.0, 12_345.0, ["1235000", "12000"]),
            (-37.26, 12.4, ["-37", "12"]),
            (5.5, 0.0, ["5.500000", "0.000000"]),
        ] {
            assert_eq!(with_uncertainty(value, expanded), shown);
        }
    }

    #[test]
    fn a_whole_that_is_narrower_than_its_part_says_why() {
        let (records, all) = (combined(78.0, 3.0, 3.18), combined(88.0, 5.0, 2.57));
        let found = UncertainEstimate::of(1.0, records, all);
        let said = narrower_than_its_part(&found).unwrap();
        for part in ["± 226.2 ppm", "± 248.0 ppm", "88.0 ppm against 78.0 ppm", "5.0", "3.0", "2.57 and 3.18"]
        {
            assert!(said.contains(part), "{part}: {said}");
        }
        assert_eq!(
            coverage(found.coverage_factor_by_records, found.degrees_of_freedom_by_records),
            "3.18 (3.0)"
        );
        // With as many degrees of freedom the whole is wider, and nothing needs a word.
        let found = UncertainEstimate::of(1.0, combined(78.0, 5.0, 2.57), all);
        assert_eq!(narrower_than_its_part(&found), None);
        assert_eq!(coverage(1.96, f64::INFINITY), "1.96 (∞)");
    }
}

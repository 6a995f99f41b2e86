//! What a calibration certificate states (ISO/IEC 17025, 7.8), as data and as a page.
//!
//! What the operator did not state is listed as not stated: nothing on a certificate is made up.

use super::checks::{CertificateCheck, CheckKind};
use super::comparison::ReferenceComparison;
use super::inputs::{OF_REPEATABILITY, OF_REPRODUCIBILITY};
use super::outcome::{CalibratedGyroscope, Calibration, CrossCheck, UncertainEstimate};
use super::quantities::{CalibratedQuantity, QuantityUnit, RecordOutcome};
use super::rest::{BiasMethod, InertialSensor};
use super::results::{at_rest, budget, comparisons, matrix, with_uncertainty};
use super::tone::AXES;
use crate::calibration::file::CertificateDetails;
use crate::metrology::{Input, coverage_probability};
use crate::recording::RecordingSource;
use kalmems_engines::topics::link;
use kalmems_figures::{ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, TextTable};
use serde::Serialize;

/// The version of the JSON.
const SCHEMA_VERSION: u32 = 1;

/// A certificate.
#[derive(Clone, Debug, Serialize)]
pub struct Certificate<'a> {
    /// Of its keys and their meaning.
    pub schema_version: u32,
    /// The calibration's name.
    pub name: &'a str,
    /// What was asked for, a sentence for each of the first results with its expanded uncertainty.
    pub answer: Vec<String>,
    /// What the operator states, key by key; `null` where that is not stated.
    pub stated: Vec<(&'static str, Option<&'a str>)>,
    /// How it was calibrated.
    pub method: String,
    /// The results.
    pub results: Vec<CertifiedResult<'a>>,
    /// The bias at rest of each axis, in rad/s.
    pub bias: Vec<CertifiedBias>,
    /// The numbers of records of other kinds, such as that of positions.
    pub quantities: Vec<CertifiedQuantity<'a>>,
    /// Whether the references agree.
    pub comparisons: &'a [ReferenceComparison],
    /// Whether the model holds for the records, check by check.
    pub validity: Vec<CertificateCheck>,
    /// Whether all checks pass and nothing is left to be stated: a certificate of which that is not so is a draft.
    pub valid: bool,
    /// What is not stated and belongs on a certificate.
    pub not_stated: Vec<String>,
    /// The files with their SHA-256.
    pub files: &'a [RecordingSource],
    /// What computed it.
    pub software: String,
}

/// A scale factor with its expanded uncertainty, and what belongs to it.
#[derive(Clone, Debug, Serialize)]
pub struct CertifiedResult<'a> {
    /// The condition.
    pub condition: &'a str,
    /// Its temperature in K.
    pub temperature_k: Option<f64>,
    /// The reference.
    pub reference: &'a str,
    /// What that is, as the operator states it.
    pub instrument: Option<&'a str>,
    /// Its traceability, as the operator states it.
    pub traceability: Option<&'a str>,
    /// The axis.
    pub axis: &'static str,
    /// The scale factor; none where the records exclude one for all of them.
    pub scale_factor: Option<CertifiedValue>,
    /// That at each frequency, where they differ.
    pub by_frequency: Vec<CertifiedFrequency>,
    /// Entries of K beside it, by name; of one beside the diagonal only where the alignment of the reference's axes is stated.
    pub entries: Vec<(String, CertifiedValue)>,
    /// Entries of K that have no expanded uncertainty, as the alignment is not stated.
    pub not_certified: Vec<String>,
    /// The frequencies of the records in Hz, lowest and highest.
    pub frequency_hz: [f64; 2],
    /// The amplitudes of the rate in rad/s, lowest and highest.
    pub rate_rad_per_s: [f64; 2],
    /// The inputs.
    pub budget: Vec<&'a Input>,
    /// What nobody stated, by name: in no uncertainty.
    pub not_in_budget: Vec<&'a str>,
    /// The same by trials, where these were asked for.
    pub cross_check: Option<&'a CrossCheck>,
}

/// A scale factor at one frequency.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CertifiedFrequency {
    /// In Hz.
    pub frequency_hz: f64,
    /// The scale factor.
    #[serde(flatten)]
    pub scale_factor: CertifiedValue,
}

/// A number as a certificate has it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CertifiedValue {
    /// The number.
    pub value: f64,
    /// Its standard uncertainty.
    pub standard_uncertainty: f64,
    /// Its effective degrees of freedom; `null` where infinite.
    pub degrees_of_freedom: Option<f64>,
    /// k.
    pub coverage_factor: f64,
    /// U.
    pub expanded_uncertainty: f64,
    /// With which the interval holds the value.
    pub coverage_probability: f64,
}

/// The bias at rest.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CertifiedBias {
    /// The axis.
    pub axis: &'static str,
    /// In rad/s.
    #[serde(flatten)]
    pub bias: CertifiedValue,
}

/// A number of a record of another kind.
#[derive(Clone, Debug, Serialize)]
pub struct CertifiedQuantity<'a> {
    /// The record, such as `Positions` or `Rates: z`.
    pub record: &'a str,
    /// Its name, unique in the record.
    pub name: &'a str,
    /// The unit.
    pub unit: &'a str,
    /// The number.
    #[serde(flatten)]
    pub value: CertifiedValue,
    /// How a table shows it.
    #[serde(skip)]
    shown: QuantityUnit,
}

impl CertifiedValue {
    /// With the coverage factor for 95 %, or with one that the operator wants.
    fn of(found: &UncertainEstimate, details: &CertificateDetails) -> Self {
        let wanted = details.coverage_factor.map(f64::from);
        let coverage_factor = wanted.unwrap_or(found.coverage_factor);
        let expanded_uncertainty = coverage_factor * found.uncertainty;
        Self {
            value: found.value,
            standard_uncertainty: found.uncertainty,
            degrees_of_freedom: found.degrees_of_freedom.is_finite().then_some(found.degrees_of_freedom),
            coverage_factor,
            expanded_uncertainty,
            coverage_probability: wanted.map_or(super::inputs::PROBABILITY, |factor| {
                coverage_probability(factor, found.degrees_of_freedom)
            }),
        }
    }

    /// The value and U as they are reported, with two digits of U, in another unit.
    fn reported(&self, factor: f64) -> [String; 2] {
        with_uncertainty(factor * self.value, factor * self.expanded_uncertainty)
    }

    /// The value with U in another unit, and the probability with which the interval holds the value.
    fn in_words(&self, factor: f64, unit: &str) -> String {
        let [value, expanded] = self.reported(factor);
        let space = if unit.is_empty() { "" } else { " " };
        format!("{value} ± {expanded}{space}{unit} ({:.0} %)", 100.0 * self.coverage_probability)
    }

    /// Degrees of freedom as they are reported.
    fn reported_freedom(&self) -> String {
        self.degrees_of_freedom.filter(|nu| *nu < 1e6).map_or_else(|| "∞".to_owned(), |nu| format!("{nu:.0}"))
    }
}

impl<'a> Certificate<'a> {
    /// From a calibration.
    pub fn of(found: &'a Calibration) -> Self {
        let details = &found.file.certificate;
        let stated = details.entries().to_vec();
        let mut not_stated: Vec<String> = stated
            .iter()
            .filter(|(_, text)| text.is_none())
            .map(|(key, _)| format!("certificate.{key}"))
            .collect();
        let results: Vec<CertifiedResult> =
            found.results.iter().map(|result| certified(found, result)).collect();
        for result in &results {
            let place = |what: &str| {
                format!("{what} of reference `{}` in condition `{}`", result.reference, result.condition)
            };
            if result.instrument.is_none() {
                not_stated.push(place("instrument"));
            }
            if result.traceability.is_none() {
                not_stated.push(place("traceability"));
            }
            if !result.not_in_budget.is_empty() {
                not_stated.push(place(&format!("uncertainty by {}", result.not_in_budget.join(", "))));
            }
            if !result.not_certified.is_empty() {
                not_stated.push(place("uncertainty.alignment"));
            }
        }
        not_stated.extend(found.records.iter().flat_map(|record| record.not_stated.iter().cloned()));
        // The mean of an accelerometer at rest has gravity in it and is no bias.
        let gyroscopes = found.rest.iter().filter(|rest| rest.sensor == InertialSensor::Gyroscope);
        let bias = gyroscopes.map(|rest| CertifiedBias {
            axis: rest.axis,
            bias: CertifiedValue::of(&rest.bias_estimate(), details),
        });
        let bias: Vec<CertifiedBias> = bias.collect();
        let of_record = |record: &'a RecordOutcome| {
            record.quantities.iter().map(move |quantity| certified_quantity(record, quantity, details))
        };
        let quantities: Vec<CertifiedQuantity> = found.records.iter().flat_map(of_record).collect();
        let validity = validity(found);
        Self {
            schema_version: SCHEMA_VERSION,
            name: found.file.name.as_str(),
            answer: answer(&results, &quantities, &bias),
            stated,
            method: method(found),
            results,
            bias,
            quantities,
            comparisons: &found.comparisons,
            valid: validity.iter().all(|check| check.passes) && not_stated.is_empty(),
            validity,
            not_stated,
            files: &found.sources,
            software: format!("kalmems {}", env!("CARGO_PKG_VERSION")),
        }
    }
}

/// Results that a calibration names before its tables.
const ANSWERED: usize = 4;

/// What was asked for, a sentence each: scale factors, then the quantities of the records, then the biases at rest; of many the first.
fn answer(
    results: &[CertifiedResult],
    quantities: &[CertifiedQuantity],
    bias: &[CertifiedBias],
) -> Vec<String> {
    let scales = results.iter().map(|result| {
        let place =
            format!("scale factor {}, magnitude, {}, {}", result.axis, result.condition, result.reference);
        let found = result.scale_factor.map(|value| value.in_words(1.0, ""));
        format!("{place}: {}", found.as_deref().unwrap_or("withheld"))
    });
    let others = quantities.iter().map(|one| {
        let QuantityUnit { factor, shown, .. } = one.shown;
        format!("{}: {}", one.name.replace('_', " "), one.value.in_words(factor, shown))
    });
    let QuantityUnit { factor, shown, .. } = QuantityUnit::rate();
    let rests =
        bias.iter().map(|one| format!("bias at rest {}: {}", one.axis, one.bias.in_words(factor, shown)));
    let mut all: Vec<String> = scales.chain(others).chain(rests).collect();
    if let Some(more) = all.len().checked_sub(ANSWERED).filter(|more| *more > 0) {
        all.truncate(ANSWERED);
        all.push(format!("{more} further results are in the tables"));
    }
    all
}

fn certified_quantity<'a>(
    record: &'a RecordOutcome,
    quantity: &'a CalibratedQuantity,
    details: &CertificateDetails,
) -> CertifiedQuantity<'a> {
    CertifiedQuantity {
        record: &record.title,
        name: &quantity.name,
        unit: quantity.unit.unit,
        value: CertifiedValue::of(&quantity.estimate, details),
        shown: quantity.unit,
    }
}

fn certified<'a>(found: &'a Calibration, result: &'a CalibratedGyroscope) -> CertifiedResult<'a> {
    let details = &found.file.certificate;
    let conditions =
        found.file.conditions.iter().filter(|condition| condition.name.as_str() == result.condition);
    let mut references = conditions.flat_map(|condition| &condition.references);
    let reference = references.find(|reference| reference.name.as_str() == result.reference);
    let has_alignment = reference.is_some_and(|reference| reference.uncertainty.alignment.is_some());
    let name = |i: usize, j: usize| format!("k_{}{}", AXES[i], AXES[j]);
    let (mut entries, mut not_certified) = (Vec::new(), Vec::new());
    for (i, row) in result.matrix.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let Some(entry) = entry.filter(|_| result.withheld.is_none()) else { continue };
            if i != j && !has_alignment {
                not_certified.push(name(i, j));
            } else if (i, j) != (result.main, result.main) {
                entries.push((name(i, j), CertifiedValue::of(&entry, details)));
            }
        }
    }
    let ends = |of: &dyn Fn(&super::outcome::RecordFigures) -> f64| {
        let values = result.records.iter().map(of);
        values
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
    };
    CertifiedResult {
        condition: &result.condition,
        temperature_k: result.temperature_k,
        reference: &result.reference,
        instrument: reference.and_then(|reference| reference.instrument.as_deref()),
        traceability: reference.and_then(|reference| reference.traceability.as_deref()),
        axis: AXES[result.main],
        scale_factor: result.withheld.is_none().then(|| CertifiedValue::of(&result.scale_factor, details)),
        by_frequency: result
            .by_frequency
            .iter()
            .map(|at| CertifiedFrequency {
                frequency_hz: at.frequency_hz,
                scale_factor: CertifiedValue::of(&at.scale_factor, details),
            })
            .collect(),
        entries,
        not_certified,
        frequency_hz: ends(&|record| record.frequency_hz),
        rate_rad_per_s: ends(&|record| record.reference),
        budget: result.budget.iter().filter_map(|part| part.input.as_ref()).collect(),
        not_in_budget: result.budget.iter().filter(|p| p.ppm.is_none()).map(|p| p.source.as_str()).collect(),
        cross_check: result.cross_check.as_ref(),
    }
}

fn method(found: &Calibration) -> String {
    let mut method = String::new();
    if !found.results.is_empty() {
        method += "Gyroscope and reference move together in a sinusoidal vibration. Both records are fitted by sines of free frequency (IEEE \
                   Std 1057), each on its own clock; K of G = exp(jφ)·K·Ω is fitted to the phasors of all records by weighted least squares, \
                   with a free phase φ for each. Uncertainties are combined as in JCGM 100:2008, with effective degrees of freedom by Welch \
                   and Satterthwaite.";
    }
    if found.results.iter().any(|result| result.cross_check.is_some()) {
        method += " They are checked by propagation of distributions as in JCGM 101:2008.";
    }
    let has = |name: &str| {
        let mut inputs =
            found.results.iter().flat_map(|result| &result.budget).filter_map(|part| part.input.as_ref());
        inputs.any(|input| input.name == name)
    };
    if has(OF_REPEATABILITY) {
        method += " What the records scatter enters as a type A evaluation, by leaving out one record after the other.";
    }
    if has(OF_REPRODUCIBILITY) {
        method += " What the scale factor changes from record to record is the stated reproducibility.";
    }
    let differs = |check: &CrossCheck| !check.disagreements.is_empty();
    if found.results.iter().filter_map(|result| result.cross_check.as_ref()).any(differs) {
        method += " Where both disagree, the interval of the trials is stated, as JCGM 101 asks for.";
    }
    if !found.results.is_empty() {
        method += " The sign of a scale factor is not determined.";
    }
    let by = |method| {
        found.rest.iter().any(|rest| rest.sensor == InertialSensor::Gyroscope && rest.bias_method == method)
    };
    if by(BiasMethod::NoiseFit) {
        method += " The bias is the mean of a record at rest; its standard uncertainty is Allan's deviation at the length of the record by the noise \
                   that was fitted to Allan's variances, with the degrees of freedom that the fit gives that variance, at least those at an eighth of the record.";
    }
    if by(BiasMethod::MeansOfRecords) {
        method += " The bias is the mean of the means of several records at rest; its standard uncertainty is that by their scatter (Type A).";
    }
    if by(BiasMethod::MeansOfPieces) {
        method += " The bias is the mean of a record at rest whose noise could not be fitted; its uncertainty is that of the means of eight pieces, \
                   which is right for noise that is white beyond an eighth of the record.";
    }
    if found.rest.iter().any(|rest| !rest.subtracted.is_empty()) {
        method += " Lines of the spectrum of the record at rest were fitted by sines, part by part, and subtracted.";
    }
    for record in &found.records {
        method += &format!(" {}", record.method);
    }
    method.trim_start().to_owned()
}

/// Whether what was assumed holds.
fn validity(found: &Calibration) -> Vec<CertificateCheck> {
    let mut checks = Vec::new();
    for result in &found.results {
        let place = format!("condition `{}`, reference `{}`", result.condition, result.reference);
        let known = [OF_REPEATABILITY, OF_REPRODUCIBILITY];
        let names =
            || result.budget.iter().filter_map(|part| part.input.as_ref()).map(|input| input.name.as_str());
        // Records of several frequencies do not repeat each other where each frequency has its own factor.
        let alone: Vec<String> = result
            .by_frequency
            .iter()
            .filter(|at| !at.has_scatter)
            .map(|at| format!("{:.2} Hz", at.frequency_hz))
            .collect();
        let scatter = names().find(|name| known.contains(name)).filter(|_| alone.is_empty());
        let mut check = |kind, passes, found: String| {
            checks.push(CertificateCheck::new(kind, &place, passes, found));
        };
        let of_scatter = scatter.map_or_else(
            || {
                let place =
                    if alone.is_empty() { String::new() } else { format!(" at {}", alone.join(", ")) };
                format!("neither several records tell it nor `uncertainty.reproducibility` states it{place}")
            },
            ToOwned::to_owned,
        );
        check(CheckKind::RecordScatter, scatter.is_some(), of_scatter);
        let is_described = result.withheld.is_none() || !result.by_frequency.is_empty();
        let of_factor = result.withheld.clone().unwrap_or_else(|| {
            format!(
                "χ² {:.1} at {} degrees of freedom by the noise within the records",
                result.chi_square, result.freedom
            )
        });
        check(CheckKind::OneScaleFactor, is_described, of_factor);
        let worst = result.records.iter().flat_map(|record| record.distortion).fold(0.0, f64::max);
        let of_sine = format!("harmonics of at most {worst:.1e} of the amplitude");
        check(CheckKind::SineMotion, worst < LARGEST_DISTORTION, of_sine);
        if let Some(trials) = &result.cross_check {
            let all =
                std::iter::once(&trials.scale_factor).chain(trials.entries.iter().map(|(_, found)| found));
            let worst = all.max_by(|a, b| (a.accuracy / a.tolerance).total_cmp(&(b.accuracy / b.tolerance)));
            let are_enough = worst.is_some_and(|worst| worst.accuracy <= worst.tolerance);
            let of_trials = if trials.disagreements.is_empty() {
                format!("{} trials agree", trials.scale_factor.propagated.trials)
            } else {
                trials.disagreements.join("; ")
            };
            check(CheckKind::EnoughTrials, are_enough, of_trials);
        }
    }
    if !found.rest.is_empty() {
        let is_still = found.rest_motions.is_empty();
        let of_rest = if is_still {
            "no part of the record and no line of its spectrum stands out; mean and noise do not change"
                .to_owned()
        } else {
            found.rest_motions.join("; ")
        };
        checks.push(CertificateCheck::new(CheckKind::StillAtRest, "", is_still, of_rest));
    }
    checks.extend(found.bias_checks.iter().cloned());
    checks.extend(found.records.iter().flat_map(|record| record.checks.iter().cloned()));
    checks.extend(found.comparisons.iter().map(|comparison| {
        let [first, second] = &comparison.references;
        let place = format!("condition `{}`, references `{first}` and `{second}`", comparison.condition);
        let apart = format!(
            "{:+.1} ppm with a standard uncertainty of {:.1} ppm, normalised error {:+.2}",
            comparison.difference_ppm, comparison.uncertainty_ppm, comparison.normalised_error
        );
        CertificateCheck::new(CheckKind::References, &place, !comparison.contradict, apart)
    }));
    checks
}

/// Harmonics beyond this part of the amplitude are no sine's.
const LARGEST_DISTORTION: f64 = 0.01;

/// The page of a certificate.
pub fn certificate_page(certificate: &Certificate, found: &Calibration, figures: &[Figure]) -> Page {
    let title = match certificate.stated.iter().find(|(key, _)| *key == "number") {
        Some((_, Some(number))) => format!("Calibration certificate {number}"),
        _ => "Calibration certificate".to_owned(),
    };
    let mut page = Page::new(title, found.file.description.clone().unwrap_or_default());
    page = page.with(answer_section(certificate));
    let entries = certificate.stated.iter().filter(|(key, _)| *key != "number");
    let entries =
        entries.map(|(key, text)| (heading(key).to_owned(), text.unwrap_or("not stated").to_owned()));
    page = page.with(PageSection::new("Item, customer and laboratory").key_values(entries));
    let words = uncertainty_words(&found.file.certificate);
    if !certificate.results.is_empty() {
        page = page.with(
            PageSection::new("Results of measurement")
                .table(result_table(certificate))
                .paragraph(words.clone()),
        );
        page = page.with(
            PageSection::new("Reference standards and traceability").table(references_table(certificate)),
        );
    }
    if !certificate.bias.is_empty() || !certificate.quantities.is_empty() {
        page = page.with(
            PageSection::new("Results of measurement: bias and numbers of the unit")
                .table(quantities_table(certificate))
                .paragraph(words),
        );
    }
    if !found.rest.is_empty() {
        let rests: Vec<_> = found.rest.iter().collect();
        page = page.with(at_rest(&rests).fold(PageSection::new("At rest"), PageSection::table));
    }
    page = page.with(PageSection::new("Method").paragraph(certificate.method.clone()));
    for result in &found.results {
        let mut section = PageSection::new(format!(
            "Budget: condition {}, reference {}",
            result.condition, result.reference
        ))
        .table(budget(result));
        let id = format!("budget-{}-{}", result.condition, result.reference);
        for figure in figures.iter().filter(|figure| figure.id == id) {
            section = section.figure(figure.clone());
        }
        if let Some(table) = matrix(result) {
            section = section.table(table);
        }
        page = page.with(section);
    }
    page = page.with(checks_section(certificate, found));
    if !certificate.not_stated.is_empty() {
        page = page.with(PageSection::new("Not stated").list(certificate.not_stated.clone()));
    }
    page = page.with(PageSection::new("Records").table(files_table(certificate)).paragraph(format!(
        "Computed by {}. The same files give the same certificate to the last byte.",
        certificate.software
    )));
    page.with(PageSection::new("Statements and authorisation").paragraph(STATEMENT).key_values([
        ("Authorised by (name, function)", ""),
        ("Signature", ""),
        ("Date", ""),
    ]))
}

/// The results in sentences, and why they are not to be issued as a certificate, if they are not.
fn answer_section(certificate: &Certificate) -> PageSection {
    let failed = certificate.validity.iter().filter(|check| !check.passes);
    let failed = failed.map(|check| {
        let explained = link("applications");
        format!("Not to be issued. This check fails: {}: {}{explained}", check.what, check.found)
    });
    let missing = certificate.not_stated.join(", ");
    let draft = (!missing.is_empty()).then(|| format!("A draft, not a certificate. Not stated: {missing}"));
    let section = PageSection::new("Answer").part(PagePart::Verdict);
    let section = certificate.answer.iter().fold(section, PageSection::paragraph);
    section
        .findings(NoticeSeverity::Failure, failed.collect())
        .findings(NoticeSeverity::Warning, draft.into_iter().collect())
}

/// The checks of a calibration, and the numbers that its records do not show.
fn checks_section(certificate: &Certificate, found: &Calibration) -> PageSection {
    let mut valid = PageSection::new("Checks of the model of measurement");
    if !certificate.comparisons.is_empty() {
        valid = valid.table(comparisons(certificate.comparisons));
    }
    let said = |passes: bool| {
        let (word, link) =
            if passes { ("", String::new()) } else { ("this check fails: ", link("applications")) };
        let own = certificate.validity.iter().filter(move |check| check.passes == passes);
        own.map(|check| format!("{word}{}: {}{link}", check.what, check.found)).collect::<Vec<String>>()
    };
    valid = valid.findings(NoticeSeverity::Failure, said(false)).findings(NoticeSeverity::Ok, said(true));
    let of_results = found.results.iter().flat_map(|result| &result.not_observed);
    let not_observed = of_results.chain(found.records.iter().flat_map(|record| &record.not_observed));
    let lines =
        not_observed.map(|line| format!("Not observed: {line}")).chain(found.findings.iter().cloned());
    valid.findings(NoticeSeverity::Note, lines.collect())
}

/// ISO/IEC 17025, 7.8.2.1.
const STATEMENT: &str = "The results relate only to the item that was calibrated, in the state and under the conditions that are stated here, at the time of the \
    calibration. This certificate may be reproduced in full only, unless the laboratory approves otherwise in writing. Without a signature it is not issued. \
    End of the certificate.";

/// How an expanded uncertainty was formed (JCGM 100, 7.2.3).
fn uncertainty_words(details: &CertificateDetails) -> String {
    let how = match details.coverage_factor {
        Some(factor) => format!(
            "multiplied by the coverage factor k = {factor}; the coverage probability follows from k and the effective degrees of freedom ν"
        ),
        None => format!(
            "multiplied by the coverage factor k of the t distribution with the effective degrees of freedom ν, for a coverage probability of {:.0} %",
            100.0 * super::inputs::PROBABILITY
        ),
    };
    format!(
        "The reported expanded uncertainty of measurement U is the standard uncertainty of measurement {how}. It was evaluated as in JCGM 100:2008 and is \
         rounded to two digits, the value to the same place."
    )
}

/// An entry of the certificate by its key in the calibration file.
fn heading(key: &str) -> &str {
    match key {
        "item" => "Item: maker, type, serial number",
        "customer" => "Customer",
        "laboratory" => "Laboratory, place of the calibration",
        "operator" => "Calibrated by",
        "received" => "Date of receipt",
        "date" => "Date of calibration",
        "issued" => "Date of issue",
        "as_found" => "As found: results before any adjustment",
        "as_left" => "As left: results after the adjustment",
        "conditions" => "Ambient conditions",
        "traceability" => "Metrological traceability",
        other => other,
    }
}

/// Biases at rest, and the numbers of records of other kinds.
fn quantities_table(certificate: &Certificate) -> TextTable {
    let columns = [
        ColumnHead::text("record"),
        ColumnHead::text("quantity"),
        ColumnHead::number("value", ""),
        ColumnHead::number("U", ""),
        ColumnHead::text("unit"),
        ColumnHead::number("k", ""),
        ColumnHead::number("ν", ""),
        ColumnHead::number("coverage probability", "%"),
    ];
    let mut table = TextTable::new("Results with expanded uncertainties", columns);
    let biases = certificate
        .bias
        .iter()
        .map(|bias| ("At rest", format!("gyroscope bias {}", bias.axis), QuantityUnit::rate(), bias.bias));
    let others = certificate
        .quantities
        .iter()
        .map(|quantity| (quantity.record, quantity.name.replace('_', " "), quantity.shown, quantity.value));
    for (record, name, unit, value) in biases.chain(others) {
        let [number, expanded] = value.reported(unit.factor);
        table.push([
            record.to_owned(),
            name,
            number,
            expanded,
            unit.shown.to_owned(),
            format!("{:.2}", value.coverage_factor),
            value.reported_freedom(),
            format!("{:.1}", 100.0 * value.coverage_probability),
        ]);
    }
    table
}

fn result_table(certificate: &Certificate) -> TextTable {
    let columns = [
        ColumnHead::text("condition"),
        ColumnHead::text("reference"),
        ColumnHead::text("quantity"),
        ColumnHead::number("value", ""),
        ColumnHead::number("expanded uncertainty", ""),
        ColumnHead::number("coverage factor", ""),
        ColumnHead::text("degrees of freedom"),
        ColumnHead::text("frequency"),
        ColumnHead::text("rate"),
    ];
    let mut table = TextTable::new("Scale factor and cross-axis terms, dimensionless", columns);
    for result in &certificate.results {
        let own = result
            .scale_factor
            .iter()
            .map(|value| (format!("scale factor {}, magnitude", result.axis), value));
        let each = result.by_frequency.iter().map(|at| {
            (
                format!("scale factor {}, magnitude, at {:.1} Hz", result.axis, at.frequency_hz),
                &at.scale_factor,
            )
        });
        let others = result.entries.iter().map(|(name, value)| (name.clone(), value));
        let [low, high] = result.frequency_hz;
        let [slow, fast] = result.rate_rad_per_s;
        for (name, value) in own.chain(each).chain(others) {
            let [number, expanded] = value.reported(1.0);
            table.push([
                result.condition.to_owned(),
                result.reference.to_owned(),
                name,
                number,
                expanded,
                format!("{:.2}", value.coverage_factor),
                value.reported_freedom(),
                range([format!("{low:.1}"), format!("{high:.1}")], "Hz"),
                range([format!("{slow:.2}"), format!("{fast:.2}")], "rad/s"),
            ]);
        }
    }
    table
}

/// From one number to another, which may be the same.
fn range([low, high]: [String; 2], unit: &str) -> String {
    if low == high { format!("{low} {unit}") } else { format!("{low} to {high} {unit}") }
}

fn references_table(certificate: &Certificate) -> TextTable {
    let columns = [
        ColumnHead::text("condition"),
        ColumnHead::text("temperature"),
        ColumnHead::text("reference"),
        ColumnHead::text("instrument"),
        ColumnHead::text("traceability, as the operator states it"),
    ];
    let mut table = TextTable::new("References", columns);
    for result in &certificate.results {
        let or = |text: Option<&str>| text.unwrap_or("not stated").to_owned();
        table.push([
            result.condition.to_owned(),
            result.temperature_k.map_or_else(|| "not stated".to_owned(), |k| format!("{k:.2} K")),
            result.reference.to_owned(),
            or(result.instrument),
            or(result.traceability),
        ]);
    }
    table
}

fn files_table(certificate: &Certificate) -> TextTable {
    let mut table = TextTable::new("Files", [ColumnHead::text("file"), ColumnHead::text("SHA-256")]);
    for source in certificate.files {
        table.push([source.file.clone(), source.sha256.clone()]);
    }
    table
}

//! The files of an identification.

use super::figure_files::write_figure;
use crate::identify::{Correlated, Identification, Identified, Undetermined};
use crate::inspect::{fitting_unit, quantity};
use crate::recording::RecordingSource;
use crate::results::{Output, ResultWriteError, way_from};
use crate::results::{RunInfo, RunTiming};
use crate::topics::{explained, link, topic, warning_line};
use kalmems_core::Portable;
use kalmems_figures::{
    ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, ReportError, TextTable, significant,
};
use serde::Serialize;
use std::io;

/// What was identified, as `identification.json` has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentificationSummary<'a> {
    /// The experiment's name.
    pub experiment: String,
    /// The rig's name.
    pub rig: &'a str,
    /// What was found, a sentence for each of the first numbers.
    pub answer: Vec<String>,
    /// What was found.
    pub parameters: &'a [Identified],
    /// What was not, and why.
    pub undetermined: &'a [Undetermined],
    /// The pair of each fit whose errors hang together most.
    pub worst_pairs: &'a [Correlated],
    /// What a reader must know before trusting a value.
    pub warnings: &'a [String],
    /// What else was seen.
    pub notes: &'a [String],
}

impl<'a> IdentificationSummary<'a> {
    /// The numbers of an identification.
    pub fn of(found: &'a Identification) -> Self {
        Self {
            experiment: found.experiment.name.to_string(),
            rig: found.rig,
            answer: answer(&found.parameters),
            parameters: &found.parameters,
            undetermined: &found.undetermined,
            worst_pairs: &found.worst_pairs,
            warnings: &found.warnings,
            notes: &found.notes,
        }
    }

    /// The parameters, each with its standard error.
    fn table(&self) -> TextTable {
        let heads = ["parameter", "value", "standard error", "95 % interval", "from"];
        let mut table = TextTable::new("", heads.map(ColumnHead::text));
        for p in self.parameters {
            let dash = || "–".to_owned();
            if !p.standard_error.is_finite() {
                let is_none = self.undetermined.iter().any(|one| one.what == p.name);
                let value = if is_none { "not determined".to_owned() } else { without_error(p) };
                table.push([p.name.clone(), value, dash(), dash(), p.recording.clone()]);
                continue;
            }
            let [value, error, low, high] = in_one_unit(p);
            table.push([p.name.clone(), value, error, format!("{low} … {high}"), p.recording.clone()]);
        }
        table
    }

    /// A table of the parameters, and below it what else there is to say.
    pub fn to_text(&self) -> String {
        self.to_text_within(usize::MAX)
    }

    /// A table of the parameters in lines of at most so many characters, and below it what else there is to say.
    pub fn to_text_within(&self, columns: usize) -> String {
        let mut text = self.answer.join("\n");
        if !text.is_empty() {
            text += "\n\n";
        }
        text += &self.table().to_text_within(columns);
        for pair in self.worst_pairs {
            let [a, b] = &pair.names;
            text +=
                &format!("\n{}: most correlated: {a} and {b}, {:+.3}\n", pair.recording, pair.correlation);
        }
        for warning in self.warnings {
            text += &format!("\n{}\n", warning_line(warning, "identified"));
        }
        for one in self.undetermined {
            text += &format!("\nnot determined: {}: {}\n", one.what, one.why);
        }
        for note in self.notes {
            text += &format!("\nnote: {note}\n");
        }
        if let Some(topic) =
            topic("identified").filter(|_| !(self.warnings.is_empty() && self.undetermined.is_empty()))
        {
            text += &format!("\nwhat these mean: {}\n", topic.command());
        }
        text
    }
}

/// Pictures of fits that a page shows at once; the others are folded away.
const PICTURES: usize = 3;

/// The report of an identification: the page's text, which needs nothing else.
pub fn identification_page(found: &Identification) -> Result<String, ReportError> {
    let summary = IdentificationSummary::of(found);
    let verdict = PageSection::new("Verdict").part(PagePart::Verdict);
    let mut verdict = summary.answer.iter().fold(verdict, PageSection::paragraph);
    for warning in summary.warnings {
        verdict = verdict.notice(NoticeSeverity::Warning, format!("{warning}{}", link("identified")));
    }
    for one in summary.undetermined {
        verdict = verdict.notice(
            NoticeSeverity::Warning,
            format!("Not determined: {}: {}{}", one.what, one.why, link("identified")),
        );
    }
    if summary.warnings.is_empty() && summary.undetermined.is_empty() {
        let text = format!(
            "All {} parameters that the recordings were asked for are determined.",
            summary.parameters.len()
        );
        verdict = verdict.notice(NoticeSeverity::Ok, text);
    }
    let mut pairs = TextTable::new(
        "The pair of each fit whose errors are correlated most",
        [
            ColumnHead::text("recording"),
            ColumnHead::text("parameters"),
            ColumnHead::number("correlation", ""),
        ],
    );
    for pair in summary.worst_pairs {
        let [a, b] = &pair.names;
        pairs.push([pair.recording.clone(), format!("{a} and {b}"), format!("{:+.3}", pair.correlation)]);
    }
    let title = if found.figures.is_empty() { "Correlations" } else { "Fits, residuals and profiles" };
    let mut evidence = PageSection::new(title).part(PagePart::Evidence);
    if !pairs.rows.is_empty() {
        evidence = evidence.table(pairs);
    }
    let (first, further) = found.figures.split_at(found.figures.len().min(PICTURES));
    let with_figures =
        |section: PageSection, figures: &[Figure]| figures.iter().cloned().fold(section, PageSection::figure);
    let evidence = with_figures(evidence, first);
    let further = (!further.is_empty()).then(|| {
        let section = PageSection::new("Further fits").part(PagePart::Evidence).folded(true);
        with_figures(section, further)
    });
    let toml = found.experiment.to_toml().unwrap_or_else(|e| format!("cannot be written: {e}"));
    let made = PageSection::made(
        "identify",
        env!("CARGO_PKG_VERSION"),
        "The numbers are in `identification.json`, the experiment with the values that were found in `experiment.toml`, dates and \
         durations in `run.toml`.",
    );
    let made = made.preformatted("The experiment with the values that were found", toml);
    let subtitle = found.experiment.description.clone().unwrap_or_default();
    let page = Page::new(format!("{}: parameters from recordings", found.experiment.name), subtitle)
        .with(verdict.notes(summary.notes.to_vec()))
        .with(PageSection::new("Parameters").table(summary.table()))
        .with(evidence);
    explained(further.into_iter().fold(page, Page::with).with(made)).to_html()
}

/// Numbers that an identification names before its table.
const ANSWERED: usize = 4;

/// What was found, a sentence for each of the first numbers that are determined.
fn answer(parameters: &[Identified]) -> Vec<String> {
    let determined = || parameters.iter().filter(|p| p.standard_error.is_finite());
    let mut all: Vec<String> = determined().take(ANSWERED).map(sentence).collect();
    if let Some(more) = determined().count().checked_sub(ANSWERED).filter(|more| *more > 0) {
        all.push(format!("{more} further parameters are in the table"));
    }
    all
}

/// The value that is stated, the one that was found, and how many standard errors lie between them.
fn sentence(p: &Identified) -> String {
    let [value, error, ..] = in_one_unit(p);
    let Some(stated) = p.stated else { return format!("{}: {value} ± {error}", p.name) };
    let [was, ..] = in_one_unit(&Identified { value: stated, ..p.clone() });
    let apart = significant((p.value - stated).abs() / p.standard_error);
    format!("{}: {was} stated, {value} ± {error} found, {apart} standard errors apart", p.name)
}

/// Value, standard error and both ends of the interval in the unit that fits the value, with the digits that the standard error leaves sense in.
fn in_one_unit(p: &Identified) -> [String; 4] {
    let largest = p.interval.iter().chain([&p.value]).map(|value| value.abs()).fold(0.0, f64::max);
    let (unit, factor) = fitting_unit(largest, p.unit);
    let behind = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let (scaled, error) = (largest * factor, p.standard_error * factor);
    let exponent = |number: f64| {
        format!("{number:e}").split_once('e').and_then(|(_, exponent)| exponent.parse::<i32>().ok())
    };
    let digits = exponent(p.value).zip(exponent(p.standard_error)).map(|(value, error)| value - error + 1);
    let digits = digits.and_then(|digits| usize::try_from(digits.clamp(1, 12)).ok()).unwrap_or(3);
    let number = |value: f64| {
        // Two digits of the error, without an exponent where that can be read.
        let places = exponent(error).map(|exponent| 1 - exponent).filter(|places| (-3..=12).contains(places));
        if let Some(places) = places.filter(|_| READABLE.contains(&scaled)) {
            let places = usize::try_from(places).unwrap_or(0);
            format!("{:.places$}", value * factor)
        } else {
            format!("{:.digits$e}", value * factor)
        }
    };
    let short = format!("{:.1e}", p.standard_error).parse().unwrap_or(p.standard_error);
    [
        format!("{}{behind}", number(p.value)),
        quantity(short, p.unit),
        number(p.interval[0]),
        format!("{}{behind}", number(p.interval[1])),
    ]
}

/// The value of a parameter of which no uncertainty is known, in six digits.
fn without_error(p: &Identified) -> String {
    let [value, ..] = in_one_unit(&Identified {
        standard_error: 1e-4 * p.value.abs(),
        interval: [p.value; 2],
        ..p.clone()
    });
    value
}

/// Numbers between these are read without an exponent.
const READABLE: std::ops::Range<f64> = 1e-3..1e6;

/// Decimals behind the first digit of a value that its standard error leaves sense in: two digits of the error.
fn decimals(value: f64, error: f64) -> usize {
    let digits = (value.abs() / error).portable_log10().floor() + 2.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to a small positive number
    let digits = if digits.is_finite() { digits.clamp(1.0, 12.0) as usize } else { 3 };
    digits
}

/// Writes an identification into a result: `report.html`; `identification.json`; `experiment.toml`, the experiment with the values that
/// were found in their places; the pictures in `figures/`; `run.toml`. Where `stop` says so in between, the work ends.
pub fn write_identification(
    found: &Identification,
    output: &Output,
    info: RunInfo,
    stop: &dyn Fn() -> bool,
) -> Result<(), ResultWriteError> {
    let input_id = input_id(found);
    output.write("identification.json", |w| {
        serde_json::to_writer_pretty(&mut *w, &IdentificationSummary::of(found))?;
        writeln!(w)
    })?;
    let experiment = found.experiment.with_files(&|file| {
        let there = found.experiment.resolve(file);
        way_from(output.target(), &there).unwrap_or(there)
    });
    let toml = experiment.to_toml().map_err(io::Error::other);
    output.write("experiment.toml", |w| {
        w.write_all(origin(found).as_bytes())?;
        w.write_all(toml?.as_bytes())
    })?;
    let html = identification_page(found)?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    for figure in &found.figures {
        write_figure(output, figure)?;
        if stop() {
            return Err(ResultWriteError::Interrupted);
        }
    }
    output.write_run(&input_id, || {
        Ok(IdentificationRunRecord {
            timing: info.timing(),
            input: found.materials.iter().flat_map(|material| &material.sources).collect(),
            experiment: found.experiment.to_table().map_err(io::Error::other)?,
        })
    })?;
    Ok(())
}

/// Where the numbers of the experiment come from, as comments of its file.
fn origin(found: &Identification) -> String {
    let mut text = format!("# Identified by kalmems {} from these recordings:\n", env!("CARGO_PKG_VERSION"));
    for material in &found.materials {
        for RecordingSource { file, sha256, .. } in &material.sources {
            text += &format!("#   {}: {file}, SHA-256 {sha256}\n", material.name);
        }
    }
    text += "# Each number with its standard error, and the recording that tells it:\n";
    for p in found.parameters.iter().filter(|p| p.standard_error.is_finite()) {
        let digits = decimals(p.value, p.standard_error);
        let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
        let (value, error) = (format!("{:.digits$e}", p.value), format!("{:.1e}", p.standard_error));
        text += &format!("#   {}: {value} ± {error}{unit}, from {}\n", p.name, p.recording);
    }
    if !found.undetermined.is_empty() {
        let names: Vec<&str> = found.undetermined.iter().map(|one| one.what.as_str()).collect();
        text +=
            &format!("# Not determined, and kept as stated where it has a place: {}.\n", names.join("; "));
    }
    text + "\n"
}

/// What tells one input from another: the experiment's name and the bytes of its recordings.
fn input_id(found: &Identification) -> String {
    let sources = found.materials.iter().flat_map(|material| &material.sources);
    let files = sources.map(|s| format!("{} {}", s.file, s.sha256.get(..12).unwrap_or(&s.sha256)));
    format!("{}: identification, {}", found.experiment.name, files.collect::<Vec<_>>().join(", "))
}

#[derive(Serialize)]
struct IdentificationRunRecord<'a> {
    timing: RunTiming,
    input: Vec<&'a RecordingSource>,
    experiment: toml::Table,
}

#[cfg(test)]
mod tests {
    use super::{decimals, in_one_unit};
    use crate::identify::Identified;

    #[test]
    fn a_number_is_written_in_the_unit_that_fits_it_with_two_digits_of_its_error() {
        let found = |value: f64, error: f64, unit: &'static str| Identified {
            name: String::new(),
            stated: None,
            value,
            standard_error: error,
            interval: [value - 2.0 * error, value + 2.0 * error],
            unit,
            recording: String::new(),
        };
        for (found, expected) in [
            (found(1714.36991, 6.3e-4, "Hz"), ["1.71436991 kHz", "630 µHz", "1.71436865", "1.71437117 kHz"]),
            (found(1.653e-11, 1.2e-12, "V^2"), ["1.65e-11 V^2", "1.2e-12 V^2", "1.41e-11", "1.89e-11 V^2"]),
            (found(0.005_070_167, 2e-7, ""), ["0.00507017", "2e-7", "0.00506977", "0.00507057"]),
            (found(-2.4279e7, 2.8e4, "V ohm"), ["-24.279 MV ohm", "28 kV ohm", "-24.335", "-24.223 MV ohm"]),
        ] {
            assert_eq!(in_one_unit(&found), expected);
        }
    }

    #[test]
    fn digits_follow_the_error() {
        assert_eq!(decimals(1.1e-4, 6.6e-11), 8);
        assert_eq!(decimals(0.2, 0.01), 3);
        assert_eq!(decimals(1.0, f64::INFINITY), 3);
        assert_eq!(decimals(1.0, 0.0), 3);
    }
}

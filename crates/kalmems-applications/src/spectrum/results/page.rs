//! The report of a spectrum as a page.

use super::{LineMetrics, SpectrumMetrics};
use crate::spectrum::SpectrumOutcome;
use kalmems_engines::topics::{explained, link};
use kalmems_figures::{
    ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, ReportError, TextTable,
};

/// The page's text, which needs nothing else.
pub fn spectrum_page(
    outcome: &SpectrumOutcome,
    metrics: &SpectrumMetrics,
    figures: &[Figure],
) -> Result<String, ReportError> {
    let mut verdict = PageSection::new("Verdict").part(PagePart::Verdict);
    if metrics.band_beyond_limit {
        let text = format!(
            "The samples are too far apart for wavenumbers above {:.1} 1/cm, which appear at lower ones{}.",
            metrics.limit_per_cm,
            link("applications")
        );
        verdict = verdict.notice(NoticeSeverity::Warning, text);
    }
    for line in &metrics.lines {
        verdict = verdict.notice(severity(line), sentence(line));
    }
    if let Some(reference) = &metrics.reference {
        let text = format!(
            "Against the reference at {} wavenumbers the spectrum is off by {:.2} % of its peak, rms.",
            reference.points,
            100.0 * reference.rms_over_peak
        );
        verdict = verdict.notice(NoticeSeverity::Note, text);
    }
    if verdict.blocks.is_empty() {
        let text = format!("The mean of {} scans, {} of them forward.", metrics.scans, metrics.forward_scans);
        verdict = verdict.notice(NoticeSeverity::Note, text);
    }
    let (answer, evidence): (Vec<&Figure>, Vec<&Figure>) =
        figures.iter().partition(|figure| figure.id == "spectrum");
    let section = |section: PageSection, figures: Vec<&Figure>| {
        figures.into_iter().cloned().fold(section, PageSection::figure)
    };
    let file = toml::to_string(&outcome.file).unwrap_or_else(|e| format!("cannot be written: {e}"));
    let mut page = Page::new(format!("{}: spectrum along a position", metrics.name), "")
        .with(verdict.notes(metrics.findings.clone()))
        .with(section(PageSection::new("Spectrum"), answer))
        .with(section(PageSection::new("What it rests on").part(PagePart::Evidence), evidence));
    if let Some(table) = budgets(metrics) {
        page = page.with(PageSection::new("Uncertainty of the lines").part(PagePart::Budget).table(table));
    }
    let beside = "The spectrum is in `spectrum.csv` and, as JCAMP-DX, in `spectrum.jdx`; the numbers are in `metrics.json`.";
    let made = PageSection::made("spectrum", env!("CARGO_PKG_VERSION"), beside);
    let made = made
        .preformatted("All figures", metrics.to_text())
        .preformatted("The file as it was understood", file);
    explained(page.with(made)).to_html()
}

/// A line that is not there is no result, and one within its noise is none either.
fn severity(line: &LineMetrics) -> NoticeSeverity {
    match (line.found_per_cm, line.snr) {
        (None, _) => NoticeSeverity::Failure,
        (Some(_), Some(snr)) if snr < 3.0 => NoticeSeverity::Warning,
        _ => NoticeSeverity::Ok,
    }
}

fn sentence(line: &LineMetrics) -> String {
    let Some(found) = line.found_per_cm else {
        return format!("Near {} 1/cm there is no line{}.", line.asked_per_cm, link("applications"));
    };
    let sd =
        if line.total_sd_per_cm > 0.0 { format!(" ± {:.4}", line.total_sd_per_cm) } else { String::new() };
    let known = line
        .from_known_per_cm
        .map_or_else(String::new, |off| format!(", {off:+.4} 1/cm from where it is known to be"));
    format!("The line that was looked for near {} 1/cm is at {found:.4}{sd} 1/cm{known}.", line.asked_per_cm)
}

/// What the position and the height of each line are due to.
fn budgets(metrics: &SpectrumMetrics) -> Option<TextTable> {
    let columns = [
        ColumnHead::text("line"),
        ColumnHead::text("due to"),
        ColumnHead::number("shift, not corrected", "1/cm"),
        ColumnHead::number("sd", "1/cm"),
        ColumnHead::number("leaves of the height", ""),
    ];
    let mut table = TextTable::new("", columns);
    for line in &metrics.lines {
        let name = line.found_per_cm.map_or_else(String::new, |found| format!("{found:.4} 1/cm"));
        for entry in &line.budget {
            // What does not shift it at all is no number with an exponent.
            let text = |value: f64| if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") };
            let numbers = [entry.shift_per_cm, entry.sd_per_cm].map(text);
            let [shift, sd] = numbers;
            table.push([name.clone(), entry.of.clone(), shift, sd, format!("{:.4}", entry.height)]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

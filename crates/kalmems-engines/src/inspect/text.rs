//! An inspection as text for a terminal.

use super::plot::plot;
use super::quantity::quantity;
use super::{InspectedChannel, Inspection, WINDOW};
use crate::recording::Severity;
use std::fmt::Write as _;
use std::ops::Range;

/// Segments that are listed; the others are counted.
const LISTED: usize = 20;

/// The width of everything but the sentences, and the height of a plot, in characters.
const WIDTH: usize = 72;
const HEIGHT: usize = 8;

/// The width of the labels beside a plot.
const LABEL: usize = 14;

// Writing to a string cannot fail, so the results of `write!` are passed over here.
pub(super) fn render(inspection: &Inspection) -> String {
    let mut text = String::new();
    let source = &inspection.source;
    let _ = writeln!(text, "{}", answer(inspection));
    let _ = writeln!(text, "{}: {} rows, {} bytes", source.file, inspection.rows, source.bytes);
    let _ = writeln!(text, "SHA-256 {}", source.sha256);
    for sentence in &inspection.recognised {
        let _ = writeln!(text, "{sentence}");
    }
    segments(&mut text, inspection);
    channels(&mut text, inspection);
    lines(&mut text, inspection);
    diagnosis(&mut text, inspection);
    plots(&mut text, inspection);
    text
}

/// Lines of a spectrum that the answer names.
const NAMED: usize = 3;

/// Whether the file can be used, and what it holds, in one sentence.
fn answer(inspection: &Inspection) -> String {
    let file = &inspection.source.file;
    if !inspection.is_usable() {
        let fatal = inspection.diagnosis.iter().find(|finding| finding.severity() != Severity::Note);
        let why = fatal.map_or_else(String::new, |finding| format!(": {finding}"));
        return format!("{file} cannot be used as a recording{why}");
    }
    let mut text = format!("{file} can be used: {} rows", inspection.rows);
    if let [segment] = inspection.segments.as_slice()
        && let (Some(rate), true) = (segment.rate_hz, segment.uniform)
    {
        text += &format!(" at {}", quantity(rate, "Hz"));
    }
    let largest = |channel: &InspectedChannel| {
        let lines = channel.spectrum.as_ref()?.lines.iter();
        let line = lines.max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))?;
        Some(format!("`{}` at {}", channel.column, quantity(line.frequency, inspection.frequency_unit)))
    };
    let lines: Vec<String> = inspection.channels.iter().filter_map(largest).take(NAMED).collect();
    if !lines.is_empty() {
        text += &format!("; strongest lines: {}", lines.join(", "));
    }
    match inspection.diagnosis.len() {
        0 => text,
        1 => text + "; one remark below",
        several => format!("{text}; {several} remarks below"),
    }
}

fn segments(text: &mut String, inspection: &Inspection) {
    let mut rows = vec![["segment", "rows", "start", "duration", "rate"].map(str::to_owned).to_vec()];
    let optional = |value: Option<f64>, unit| value.map_or_else(|| "-".to_owned(), |v| quantity(v, unit));
    for segment in inspection.segments.iter().take(LISTED) {
        rows.push(vec![
            match (segment.label.as_str(), segment.stretch) {
                ("", None) => "-".to_owned(),
                ("", Some(stretch)) => format!("stretch {stretch}"),
                (label, None) => label.to_owned(),
                (label, Some(stretch)) => format!("{label}, stretch {stretch}"),
            },
            segment.rows.to_string(),
            optional(segment.start_s, "s"),
            optional(segment.duration_s, "s"),
            match (segment.rate_hz, segment.uniform) {
                (Some(rate), false) => format!("{}, not uniform", quantity(rate, "Hz")),
                (rate, _) => optional(rate, "Hz"),
            },
        ]);
    }
    table(text, &rows, 1);
    if let Some(more) = inspection.segments.len().checked_sub(LISTED).filter(|more| *more > 0) {
        let _ = writeln!(text, "  and {more} more");
    }
}

fn channels(text: &mut String, inspection: &Inspection) {
    let head = ["channel", "unit", "values", "missing", "minimum", "maximum", "mean", "deviation"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for channel in &inspection.channels {
        let of = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| quantity(v, &channel.si_unit));
        let figures = &channel.statistics;
        rows.push(vec![
            channel.column.clone(),
            if channel.unit.is_empty() { "-".to_owned() } else { channel.unit.clone() },
            figures.count.to_string(),
            figures.missing.to_string(),
            of(figures.minimum),
            of(figures.maximum),
            of(figures.mean),
            of(figures.standard_deviation),
        ]);
    }
    table(text, &rows, 2);
}

fn lines(text: &mut String, inspection: &Inspection) {
    let mut rows = vec![["line", "frequency", "amplitude"].map(str::to_owned).to_vec()];
    let mut reasons = Vec::new();
    let mut resolution = None;
    for channel in &inspection.channels {
        let Some(spectrum) = &channel.spectrum else {
            let reason = channel.no_spectrum.as_deref().unwrap_or_default();
            reasons.push(format!("`{}` has no spectrum: {reason}.", channel.column));
            continue;
        };
        resolution = Some(spectrum.resolution);
        if spectrum.lines.is_empty() {
            reasons.push(format!("`{}` has no line 20 dB above its floor.", channel.column));
        }
        for line in &spectrum.lines {
            rows.push(vec![
                channel.column.clone(),
                quantity(line.frequency, inspection.frequency_unit),
                quantity(line.amplitude, &channel.si_unit),
            ]);
        }
    }
    if rows.len() > 1 {
        table(text, &rows, 1);
    } else {
        text.push('\n');
    }
    if let Some(resolution) = resolution {
        let resolution = quantity(resolution, inspection.frequency_unit);
        let _ = writeln!(text, "Window: {WINDOW}; one bin is {resolution}.");
    }
    for reason in reasons {
        let _ = writeln!(text, "{reason}");
    }
}

fn diagnosis(text: &mut String, inspection: &Inspection) {
    let fatal = !inspection.is_usable();
    let _ = match (fatal, inspection.diagnosis.is_empty()) {
        (true, _) => writeln!(text, "\nThe file cannot be used as a recording like this:"),
        (false, false) => writeln!(text, "\nFound and kept as it is:"),
        (false, true) => match inspection.checked.split_last() {
            Some((last, checked)) if !checked.is_empty() => {
                writeln!(text, "\nNothing is {} or {last}.", checked.join(", "))
            }
            Some((only, _)) => writeln!(text, "\nNothing is {only}."),
            None => writeln!(text, "\nNothing was checked."),
        },
    };
    for finding in &inspection.diagnosis {
        let note = if fatal && finding.severity() == Severity::Note { "note: " } else { "" };
        let _ = writeln!(text, "  {note}{finding}");
    }
    if !inspection.unchecked.is_empty() {
        let _ = writeln!(text, "Not checked: {}.", inspection.unchecked.join("; "));
    }
}

/// The whole of the longest segment, lower where a close-up of its cycles follows.
fn plots(text: &mut String, inspection: &Inspection) {
    let Some(segment) = inspection.longest_segment() else { return };
    let whole = 0..segment.rows;
    let close_up = inspection.close_up();
    for channel in &inspection.channels {
        let of = if segment.label.is_empty() { String::new() } else { format!(" of `{}`", segment.label) };
        let title = format!("{}{of}", channel.column);
        let height = if close_up.is_some() { HEIGHT / 2 } else { HEIGHT };
        one_plot(text, inspection, channel, (&whole, height), &title);
        if let Some(rows) = &close_up {
            one_plot(text, inspection, channel, (rows, HEIGHT), &format!("{title}, its last cycles"));
        }
    }
}

fn one_plot(
    text: &mut String,
    inspection: &Inspection,
    channel: &InspectedChannel,
    (rows, height): (&Range<usize>, usize),
    title: &str,
) {
    let width = WIDTH - LABEL - 1;
    let Some(envelope) = inspection.envelope(&channel.column, rows.clone(), 2 * width) else { return };
    let low = envelope.points.iter().map(|point| point.minimum).reduce(f64::min);
    let high = envelope.points.iter().map(|point| point.maximum).reduce(f64::max);
    let (Some(low), Some(high)) = (low, high) else { return };
    let (low_label, high_label) = (quantity(low, &channel.si_unit), quantity(high, &channel.si_unit));
    if low >= high {
        let _ = writeln!(text, "\n{title} is always {low_label}.");
        return;
    }
    let _ = writeln!(text, "\n{title}");
    for (row, line) in plot(&envelope, rows.len(), width, height).iter().enumerate() {
        let label = match row {
            0 => high_label.as_str(),
            r if r + 1 == height => low_label.as_str(),
            _ => "",
        };
        let _ = writeln!(text, "{label:>LABEL$} {line}");
    }
    let (start, end) = time_labels(inspection, rows);
    let space = width.saturating_sub(start.chars().count());
    let _ = writeln!(text, "{:LABEL$} {start}{end:>space$}", "");
}

/// Where a plot of some rows of the longest segment begins and ends.
fn time_labels(inspection: &Inspection, rows: &Range<usize>) -> (String, String) {
    let last = rows.end.saturating_sub(1);
    if inspection.is_timed() {
        (quantity(inspection.time_of(rows.start), "s"), quantity(inspection.time_of(last), "s"))
    } else {
        (format!("sample {}", rows.start), format!("sample {last}"))
    }
}

/// Aligned columns, the first `left` of them at their left edge.
fn table(text: &mut String, rows: &[Vec<String>], left: usize) {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().filter_map(|r| r.get(column)).map(|c| c.chars().count()).max();
    let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
    text.push('\n');
    for row in rows {
        let cells: Vec<String> = row
            .iter()
            .zip(&widths)
            .enumerate()
            .map(
                |(i, (cell, width))| {
                    if i < left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                },
            )
            .collect();
        let _ = writeln!(text, "{}", cells.join("  ").trim_end());
    }
}

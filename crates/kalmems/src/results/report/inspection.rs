//! The picture of an inspection.

use crate::inspect::{self, InspectedChannel, Inspection};
use crate::results::{OutputError, write_picture};
use crate::topics::{explained, link};
use kalmems_figures::{
    Axis, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, ReportError, Series, SeriesRole, Track,
};
use std::ops::Range;
use std::path::Path;

/// Columns of the picture, each drawn from its smallest to its largest sample.
const COLUMNS: usize = 800;

/// Every channel of the longest segment as a figure, and its last cycles where they could not be told apart.
pub fn inspection_figure(inspection: &Inspection) -> Figure {
    let mut figure = Figure::new("inspection", inspection.source.file.clone(), "");
    let Some(segment) = inspection.longest_segment() else { return figure };
    let whole = 0..segment.rows;
    for (rows, what) in [(Some(whole), ""), (inspection.close_up(), "the last cycles")] {
        let Some(rows) = rows else { continue };
        let mut first = true;
        for channel in &inspection.channels {
            let Some(series) = inspection.series(&channel.column, rows.clone(), COLUMNS) else {
                continue;
            };
            let panel = panel(channel, &series, inspection.time.is_some(), if first { what } else { "" });
            figure = figure.with(if first { panel } else { panel.sharing_x() });
            first = false;
        }
    }
    figure
}

fn panel(channel: &InspectedChannel, series: &inspect::ChannelSeries, timed: bool, label: &str) -> Panel {
    // Down and up within each column, so that neighbouring columns join.
    let points = series.start.iter().zip(&series.minimum).zip(&series.maximum).enumerate();
    let points: Vec<(f64, f64)> = points
        .flat_map(
            |(i, ((t, low), high))| {
                if i % 2 == 0 { [(*t, *low), (*t, *high)] } else { [(*t, *high), (*t, *low)] }
            },
        )
        .collect();
    let (time, unit) = if timed { ("time", "s") } else { ("sample", "1") };
    Panel::new(Axis::new(time, unit), Axis::new(channel.column.clone(), channel.si_unit.clone()))
        .with(Series::line(label, SeriesRole::Measured, points))
}

/// Groups of samples of a channel on a page.
const GROUPS: usize = 16_384;

/// Every channel over these rows of the longest segment, with identifier, title and caption.
fn channels_figure(
    inspection: &Inspection,
    rows: Range<usize>,
    (id, title, caption): (&str, &str, &str),
) -> Figure {
    let (time, unit) = if inspection.time.is_some() { ("time", "s") } else { ("sample", "1") };
    let panels = inspection.channels.iter().filter_map(|channel| {
        let series = inspection.series(&channel.column, rows.clone(), GROUPS)?;
        let groups = series.start.iter().zip(series.minimum.iter().zip(&series.maximum));
        let groups = groups.map(|(t, (low, high))| (*t, *low, *high));
        let track = Track::of_groups(rows.len().div_ceil(series.start.len().max(1)), groups);
        let axis = Axis::new(channel.column.clone(), channel.si_unit.clone());
        Some(Panel::new(Axis::new(time, unit), axis).with(Series::of_track(
            "",
            SeriesRole::Measured,
            &track,
            [0, 0],
        )))
    });
    panels.fold(Figure::new(id, title, caption), |figure, panel| {
        let is_first = figure.panels.is_empty();
        figure.with(if is_first { panel } else { panel.sharing_x() })
    })
}

/// What a recording holds as a page: its text, which needs nothing else.
pub fn inspection_page(inspection: &Inspection) -> Result<String, ReportError> {
    let text = inspection.to_text();
    let verdict = PageSection::new("What was found").part(PagePart::Verdict);
    let verdict = text.lines().next().into_iter().fold(verdict, PageSection::paragraph);
    let verdict = if inspection.is_usable() {
        verdict.notice(NoticeSeverity::Ok, "The recording can be used as it is.")
    } else {
        verdict.notice(
            NoticeSeverity::Failure,
            format!("It cannot be used as a recording as it is; the diagnosis says why{}.", link("findings")),
        )
    };
    let mut page = Page::new(format!("{}: what it holds", inspection.source.file), "")
        .with(verdict.preformatted("The diagnosis", text.as_str()));
    // A view of one of the pictures is none of the other.
    let channels = |title: &str, rows: Range<usize>, (id, caption): (&str, &str)| {
        let figure = channels_figure(inspection, rows, (id, title, caption));
        PageSection::new(title).of_time(title).figure(figure)
    };
    if let Some(rows) = inspection.close_up() {
        let caption = "The last cycles of every channel, which cannot be seen in the whole record.";
        page = page.with(channels("The last cycles", rows, ("last-cycles", caption)));
    }
    if let Some(segment) = inspection.longest_segment() {
        let caption = "Every channel of the longest segment.";
        page = page.with(channels("The whole record", 0..segment.rows, ("channels", caption)));
    }
    let made = PageSection::made("inspect", env!("CARGO_PKG_VERSION"), "");
    explained(page.with(made)).to_html()
}

/// Draws every channel of the longest segment to an SVG file; see [`write_picture`].
pub fn draw_inspection(inspection: &Inspection, path: &Path, force: bool) -> Result<(), OutputError> {
    draw(inspection_figure(inspection), path, force)
}

/// Writes a figure to a file; its other sheets, where there are several, to files with `_2`, `_3` and so on in their names.
pub(super) fn draw(figure: Figure, path: &Path, force: bool) -> Result<(), OutputError> {
    for (page, number) in figure.pages().into_iter().zip(1..) {
        let mut name = path.file_stem().unwrap_or_default().to_owned();
        let ending = path.extension().map_or_else(|| "svg".into(), std::ffi::OsStr::to_owned);
        name.push(format!("_{number}."));
        name.push(ending);
        let path = if number == 1 { path.to_owned() } else { path.with_file_name(name) };
        write_picture(&path, &page.to_svg(), force)?;
    }
    Ok(())
}

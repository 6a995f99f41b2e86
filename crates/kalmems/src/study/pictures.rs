//! The pictures of a study: a figure of the results against what varies.

use super::StudyPlan;
use super::axis::AxisValues;
use super::description::{AppliesTo, Spacing, StudyPicture};
use super::map::{self, StudyMap};
use super::runs::{StudyRuns, written};
use super::spread::{EstimatorSpread, RowGroup, spreads};
use crate::config::get;
use crate::table::{TidyTable, number};
use crate::units::ColumnHeader;
use kalmems_core::Portable;
use kalmems_figures::{self, AxisScale, Figure, Panel, Series, SeriesLink, SeriesRole, Shape, significant};
use std::collections::BTreeMap;

/// The most series that a picture can tell apart.
const MOST: usize = 8;

/// The pictures that the study file asks for, and what is wrong with those that are not there.
pub(super) fn pictures(runs: &StudyRuns) -> (Vec<Figure>, Vec<String>) {
    let (mut figures, mut notes) = (Vec::new(), Vec::new());
    for (i, picture) in runs.plan.description.figure.iter().enumerate() {
        match one(runs, picture, i) {
            Ok(figure) => figures.push(figure),
            Err(why) => notes.push(format!("figure[{i}]: {why}")),
        }
    }
    (figures, notes)
}

fn one(runs: &StudyRuns, picture: &StudyPicture, index: usize) -> Result<Figure, String> {
    let StudyRuns { plan, table, .. } = runs;
    let column = figure_column(table, &picture.metric)?;
    let place_of = |name: &str| plan.axes.iter().position(|axis| axis.name == name);
    let place = picture.against.as_deref().map_or(Some(0), place_of);
    let Some(place) = place.filter(|place| *place < plan.axes.len()) else {
        return Err("there is nothing to draw it against".to_owned());
    };
    let value = value_axis(picture);
    let label = value.label.clone();
    let over = picture.over.as_deref().and_then(place_of);
    let panels = match over {
        Some(over) => {
            map::panels(runs, column, &StudyMap { places: [place, over], value, level: picture.level })?
        }
        None => vec![lines(runs, column, place, value)?],
    };
    if panels.is_empty() {
        return Err(format!("no run has a number for `{}`", picture.metric));
    }
    let file: String =
        picture.metric.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let words = |place: usize| plan.axes[place].name.replace('_', " ");
    let over_words = over.map_or_else(String::new, |over| format!(" and {}", words(over)));
    let title = format!("{label} against {}{over_words}", words(place));
    let figure = Figure::new(format!("{}_{file}", index + 1), title, caption(runs, place, over));
    Ok(panels.into_iter().fold(figure, Figure::with))
}

/// The quantity of a picture.
fn value_axis(picture: &StudyPicture) -> kalmems_figures::Axis {
    let header = ColumnHeader::parse(&picture.metric);
    let label = picture.label.clone().unwrap_or_else(|| {
        let name = picture.metric.strip_suffix(&format!("_{}", header.unit_text)).unwrap_or(&picture.metric);
        let words: Vec<&str> = name.split(['.', '_']).filter(|word| *word != "errors").collect();
        words.join(" ")
    });
    let value = kalmems_figures::Axis::new(label, header.unit_text);
    if picture.scale == Spacing::Log { value.log() } else { value }
}

/// The points at which the quantity of the first picture is smallest and largest, in one sentence; `None` without a picture or a number.
pub(super) fn answer(runs: &StudyRuns) -> Option<String> {
    let StudyRuns { plan, table, groups, of_rows, .. } = runs;
    let picture = plan.description.figure.first()?;
    let column = figure_column(table, &picture.metric).ok()?;
    let value = value_axis(picture);
    let all = spreads(plan, table, (of_rows, column));
    let by_median = |a: &&EstimatorSpread, b: &&EstimatorSpread| a.median.total_cmp(&b.median);
    let ends = [all.iter().min_by(by_median)?, all.iter().max_by(by_median)?];
    let [least, most] = ends.map(|end| {
        let run = plan.run(end.point * plan.description.repeats);
        let settings = plan.grid().filter_map(|(place, axis)| {
            Some(format!("{} {}", axis.name.replace('_', " "), written(run.settings.get(place)?)))
        });
        let place = std::iter::once(name(groups, &groups[end.group])).chain(settings);
        format!("{} ({})", value_in_words(&value, end.median), place.collect::<Vec<_>>().join(", "))
    });
    let of = if plan.description.repeats > 1 { "medians of the repeats" } else { "all points" };
    Some(format!("{of}: from {least} to {most}"))
}

/// Lines over one axis, or points where its values are drawn by chance.
fn lines(runs: &StudyRuns, column: usize, place: usize, y: kalmems_figures::Axis) -> Result<Panel, String> {
    let mut curves = StudyCurves { runs, y: &y, series: Vec::new(), crosses: Vec::new() };
    match runs.plan.axes[place].values {
        AxisValues::Listed(_) => curves.over_grid(column, place)?,
        AxisValues::Drawn(_) => curves.over_draws(column, place),
    }
    let mut series = curves.series_and_crosses();
    if series.is_empty() {
        return Err(format!("no run has a number for `{}`", runs.table.columns[column]));
    }
    let [low, high] = ends(&series, y.scale);
    series.extend(true_value(runs.plan, place, [low, high]));
    Ok(series.into_iter().fold(Panel::new(axis(runs.plan, place), y), Panel::with))
}

/// The lowest and the highest value of series.
fn ends(series: &[Series], scale: AxisScale) -> [f64; 2] {
    let values = series.iter().flat_map(|one| match one.shape() {
        Shape::Line(lines) => lines.concat(),
        Shape::Points(points) => points.clone(),
        Shape::Band(bands) => bands.iter().flatten().flat_map(|p| [[p[0], p[1]], [p[0], p[2]]]).collect(),
        Shape::Level(_) | Shape::Map(_) => Vec::new(),
    });
    let values = values.map(|p| p[1]).filter(|value| *value > 0.0 || scale == AxisScale::Linear);
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// The true value of a device's parameter for which the filters assume others, as an upright line between these heights.
pub(super) fn true_value(plan: &StudyPlan, place: usize, [low, high]: [f64; 2]) -> Option<Series> {
    let axis = plan.axes.get(place).filter(|axis| axis.applies_to == AppliesTo::Told)?;
    let stated = plan.truth.iter().find(|(key, _)| *key == axis.key).map(|(_, value)| value);
    let is_of_device = plan.simulated && axis.key.to_string().starts_with("device.");
    let value = stated.or_else(|| get(&plan.document, &axis.key).filter(|_| is_of_device))?;
    let at = axis.number_of(value)?;
    Some(Series::line("true value", SeriesRole::Bound, [(at, low), (at, high)]))
}

/// What varies, along an axis of a picture.
pub(super) fn axis(plan: &StudyPlan, place: usize) -> kalmems_figures::Axis {
    let varied = &plan.axes[place];
    let axis = kalmems_figures::Axis::new(varied.name.replace('_', " "), varied.unit.clone());
    let grid = plan.description.vary.get(place).and_then(|vary| vary.grid.as_ref());
    if grid.is_some_and(|grid| grid.spacing == Spacing::Log) { axis.log() } else { axis }
}

fn figure_column(table: &TidyTable, name: &str) -> Result<usize, String> {
    let numbers = || (table.before..table.columns.len()).filter(|column| table.is_number(*column));
    if let Some(column) = numbers().find(|column| table.columns[*column] == name) {
        return Ok(column);
    }
    let known: Vec<&str> = numbers().map(|column| table.columns[column].as_str()).collect();
    let fault = crate::config::ConfigFault::unknown_word(name, known);
    Err(format!("{fault}; the runs need not be made again for a figure"))
}

fn caption(runs: &StudyRuns, place: usize, over: Option<usize>) -> String {
    let repeats = runs.plan.description.repeats;
    let mut caption = if matches!(runs.plan.axes[place].values, AxisValues::Drawn(_)) {
        "One point for each run.".to_owned()
    } else if repeats > 1 && over.is_some() {
        format!("Colours: medians of {repeats} runs with noise of their own.")
    } else if repeats > 1 {
        format!(
            "Lines: medians of {repeats} runs with noise of their own; bands: from the lowest to the highest of them."
        )
    } else {
        "One run for each point.".to_owned()
    };
    let lost = runs.lost();
    let (place, alone) = if over.is_some() { ("cell", "on grey") } else { ("point", "at the top") };
    if lost > 0 {
        caption +=
            &format!(" Crosses: {lost} runs lost lock or failed; {alone} where no run has an estimate.");
    }
    caption + &format!(" A click on a {place} leads to its run.")
}

/// How far above the values crosses without one lie, in parts of the values' span.
const ABOVE: f64 = 0.1;

/// What the crosses of a picture stand for.
pub(super) const LOST: &str = "lost lock or failed";

/// A point of the grid, with x, median, lowest and highest of its runs.
type GridPoint = (u64, [f64; 4]);

/// The lines or points of a picture, and where runs have no estimate.
struct StudyCurves<'a> {
    runs: &'a StudyRuns<'a>,
    y: &'a kalmems_figures::Axis,
    series: Vec<Series>,
    /// Where each lies, without a value of its own where there is none, and where it leads to.
    crosses: Vec<(f64, Option<f64>, Option<SeriesLink>)>,
}

impl StudyCurves<'_> {
    /// The median over the repeats with its band, one line for each estimator and value of the other axes.
    fn over_grid(&mut self, column: usize, place: usize) -> Result<(), String> {
        let StudyRuns { plan, table, groups, of_rows, .. } = self.runs;
        let others: Vec<usize> = plan.grid().map(|(i, _)| i).filter(|i| *i != place).collect();
        // By group, then by the values of the other axes: point, x, median, lowest and highest.
        let mut lines: BTreeMap<(usize, Vec<usize>), Vec<GridPoint>> = BTreeMap::new();
        let mut known = BTreeMap::new();
        for spread in spreads(plan, table, (of_rows, column)) {
            known.insert((spread.point, spread.group), [spread.median, spread.lowest, spread.highest]);
        }
        for point in 0..plan.points() {
            let run = plan.run(point * plan.description.repeats);
            let position =
                |i: &usize| plan.axes[*i].listed().iter().position(|s| *s == run.settings[*i]).unwrap_or(0);
            // A word has a place instead of a number.
            let x = run.settings[place].number.unwrap_or(position(&place) as f64);
            for group in 0..groups.len() {
                let median = known.get(&(point, group)).map(|[median, ..]| *median);
                if self.runs.lost_at(point, group) > 0 {
                    self.cross((point, group), x, median);
                }
                if let Some([median, lowest, highest]) = known.get(&(point, group)) {
                    let key = (group, others.iter().map(position).collect());
                    lines.entry(key).or_default().push((point, [x, *median, *lowest, *highest]));
                }
            }
        }
        if lines.len() > MOST {
            return Err(format!(
                "{} lines are more than the {MOST} that a picture can tell apart; the figures are in results.csv",
                lines.len()
            ));
        }
        for ((group, positions), mut points) in lines {
            points.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
            let mut label = name(groups, &groups[group]);
            for (other, position) in others.iter().zip(positions) {
                let axis = &plan.axes[*other];
                label += &format!(", {} {}", axis.name.replace('_', " "), written(&axis.listed()[position]));
            }
            let links = points.iter().filter_map(|(point, [x, median, ..])| {
                self.runs.link_to_point((*point, group), [*x, *median], &self.value(*median))
            });
            let links = links.collect();
            let line = Series::line(label, SeriesRole::Other, points.iter().map(|(_, p)| (p[0], p[1])));
            self.series.push(line.leading_to(links));
            if plan.description.repeats > 1 {
                let band = points.iter().map(|(_, p)| (p[0], p[2], p[3]));
                self.series.push(Series::band("", SeriesRole::Other, band));
            }
        }
        Ok(())
    }

    /// A point for each run.
    fn over_draws(&mut self, column: usize, place: usize) {
        let StudyRuns { plan, table, groups, of_rows, .. } = self.runs;
        let mut points: BTreeMap<usize, Vec<(u64, f64, f64)>> = BTreeMap::new();
        for (line, group) in table.rows.iter().zip(of_rows) {
            let Some(x) = plan.run(line.run).settings[place].number else { continue };
            let y = number(&line.cells[column]);
            if group.is_none_or(|group| self.runs.is_lost(line.run, group)) {
                let link = self.runs.link(line.run, [x, y.unwrap_or(f64::NAN)], LOST);
                self.crosses.push((x, y, link));
            }
            if let (Some(group), Some(y)) = (*group, y) {
                points.entry(group).or_default().push((line.run, x, y));
            }
        }
        for (group, mut points) in points {
            points.sort_by(|a, b| a.1.total_cmp(&b.1));
            let links =
                points.iter().filter_map(|(run, x, y)| self.runs.link(*run, [*x, *y], &self.value(*y)));
            let links = links.collect();
            let label = name(groups, &groups[group]);
            let series = Series::points(label, SeriesRole::Other, points.iter().map(|(_, x, y)| (*x, *y)));
            self.series.push(series.leading_to(links));
        }
    }

    fn cross(&mut self, point: (u64, usize), x: f64, median: Option<f64>) {
        let value = median.map_or_else(|| "no estimate".to_owned(), |median| self.value(median));
        let link = self.runs.link_to_point(point, [x, median.unwrap_or(f64::NAN)], &value);
        self.crosses.push((x, median, link));
    }

    fn value(&self, value: f64) -> String {
        value_in_words(self.y, value)
    }

    /// The crosses lie above all lines and points; those without a value above all values.
    fn series_and_crosses(self) -> Vec<Series> {
        let Self { mut series, crosses, y, .. } = self;
        if series.is_empty() || crosses.is_empty() {
            return series;
        }
        let [low, high] = ends(&series, y.scale);
        // Above all values, so that it is not taken for one of them.
        let top = match y.scale {
            AxisScale::Linear => high + ABOVE * (high - low),
            AxisScale::Log => high * (ABOVE * (high / low).portable_ln()).portable_exp(),
        };
        let links = crosses.iter().filter_map(|(x, y, link)| {
            link.clone().map(|link| SeriesLink { at: [*x, y.unwrap_or(top)], ..link })
        });
        let points = crosses.iter().map(|(x, y, _)| (*x, y.unwrap_or(top)));
        series.push(Series::points(LOST, SeriesRole::Failure, points).leading_to(links.collect()));
        series
    }
}

/// A value of a picture with its name and unit, for the reader who points at it.
pub(super) fn value_in_words(axis: &kalmems_figures::Axis, value: f64) -> String {
    let unit = kalmems_figures::unit_sign(&axis.unit);
    format!("{} {} {unit}", axis.label, significant(value)).trim_end().to_owned()
}

/// The estimator's name, with recording and segment where there are several, and its key where others share the name.
pub(super) fn name(groups: &[RowGroup], group: &RowGroup) -> String {
    let mut parts = Vec::new();
    if groups.iter().any(|other| other.recording != group.recording) {
        parts.push(group.recording.as_str());
    }
    if groups.iter().any(|other| other.segment != group.segment) {
        parts.push(group.segment.as_str());
    }
    let shared = groups.iter().any(|other| other.name == group.name && other.estimator != group.estimator);
    parts.push(if shared || group.name.is_empty() { &group.estimator } else { &group.name });
    parts.join(", ")
}

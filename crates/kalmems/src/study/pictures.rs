//! The pictures of a study: a figure of the results against what varies.

use super::StudyPlan;
use super::axis::{AxisValue, AxisValues};
use super::description::{Spacing, StudyPicture};
use super::map::{self, StudyMap};
use super::spread::{RowGroup, groups, spreads};
use crate::table::{TidyTable, number};
use crate::units::{ColumnHeader, Value};
use kalmems_figures::{self, Figure, Panel, Series, SeriesRole};
use std::collections::BTreeMap;

/// The most series that a picture can tell apart.
const MOST: usize = 8;

/// The pictures that the study file asks for, and what is wrong with those that are not there.
pub(super) fn pictures(plan: &StudyPlan, table: &TidyTable) -> (Vec<Figure>, Vec<String>) {
    let (mut figures, mut notes) = (Vec::new(), Vec::new());
    for (i, picture) in plan.description.figure.iter().enumerate() {
        match one(plan, table, picture, i) {
            Ok(figure) => figures.push(figure),
            Err(why) => notes.push(format!("figure[{i}]: {why}")),
        }
    }
    (figures, notes)
}

fn one(plan: &StudyPlan, table: &TidyTable, picture: &StudyPicture, index: usize) -> Result<Figure, String> {
    let column = figure_column(table, &picture.metric)?;
    let place_of = |name: &str| plan.axes.iter().position(|axis| axis.name == name);
    let place = picture.against.as_deref().map_or(Some(0), place_of);
    let Some(place) = place.filter(|place| *place < plan.axes.len()) else {
        return Err("there is nothing to draw it against".to_owned());
    };
    let header = ColumnHeader::parse(&picture.metric);
    let label = picture.label.clone().unwrap_or_else(|| {
        let name = picture.metric.strip_suffix(&format!("_{}", header.unit_text)).unwrap_or(&picture.metric);
        let words: Vec<&str> = name.split(['.', '_']).filter(|word| *word != "errors").collect();
        words.join(" ")
    });
    let mut value = kalmems_figures::Axis::new(&label, header.unit_text);
    if picture.scale == Spacing::Log {
        value = value.log();
    }
    let over = picture.over.as_deref().and_then(place_of);
    let panels = match over {
        Some(over) => map::panels(
            plan,
            table,
            column,
            &StudyMap { places: [place, over], value, level: picture.level },
        )?,
        None => vec![lines(plan, table, column, place, value)?],
    };
    if panels.is_empty() {
        return Err(format!("no run has a number for `{}`", picture.metric));
    }
    let file: String =
        picture.metric.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let words = |place: usize| plan.axes[place].name.replace('_', " ");
    let over_words = over.map_or_else(String::new, |over| format!(" and {}", words(over)));
    let title = format!("{label} against {}{over_words}", words(place));
    let figure = Figure::new(format!("{}_{file}", index + 1), title, caption(plan, table, place, over));
    Ok(panels.into_iter().fold(figure, Figure::with))
}

/// Lines over one axis, or points where its values are drawn by chance.
fn lines(
    plan: &StudyPlan,
    table: &TidyTable,
    column: usize,
    place: usize,
    y: kalmems_figures::Axis,
) -> Result<Panel, String> {
    let series = match plan.axes[place].values {
        AxisValues::Listed(_) => over_grid(plan, table, column, place)?,
        AxisValues::Drawn(_) => over_draws(plan, table, column, place),
    };
    if series.is_empty() {
        return Err(format!("no run has a number for `{}`", table.columns[column]));
    }
    Ok(series.into_iter().fold(Panel::new(axis(plan, place), y), Panel::with))
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

fn caption(plan: &StudyPlan, table: &TidyTable, place: usize, over: Option<usize>) -> String {
    let repeats = plan.description.repeats;
    let mut caption = if matches!(plan.axes[place].values, AxisValues::Drawn(_)) {
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
    if let Some(column) = table.column("error") {
        let failed = table.rows.iter().filter(|line| !line.cells[column].is_empty()).count();
        if failed > 0 {
            caption += &format!(" {failed} runs failed and are not shown.");
        }
    }
    caption
}

/// The median over the repeats with its band, one line for each estimator and value of the other axes.
fn over_grid(
    plan: &StudyPlan,
    table: &TidyTable,
    column: usize,
    place: usize,
) -> Result<Vec<Series>, String> {
    let (groups, _) = groups(table);
    let others: Vec<usize> = plan.grid().map(|(i, _)| i).filter(|i| *i != place).collect();
    // By group, then by the point of the first value of this axis: x, median, lowest and highest.
    let mut lines: BTreeMap<(usize, Vec<usize>), Vec<[f64; 4]>> = BTreeMap::new();
    for spread in spreads(plan, table, column) {
        let run = plan.run(spread.point * plan.description.repeats);
        let position =
            |i: &usize| plan.axes[*i].listed().iter().position(|s| *s == run.settings[*i]).unwrap_or(0);
        let key = (spread.group, others.iter().map(position).collect());
        // A word has a place instead of a number.
        let x = run.settings[place].number.unwrap_or(position(&place) as f64);
        lines.entry(key).or_default().push([x, spread.median, spread.lowest, spread.highest]);
    }
    if lines.len() > MOST {
        return Err(format!(
            "{} lines are more than the {MOST} that a picture can tell apart; the figures are in results.csv",
            lines.len()
        ));
    }
    let mut series = Vec::new();
    for ((group, positions), mut points) in lines {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut label = name(&groups, &groups[group]);
        for (other, position) in others.iter().zip(positions) {
            let axis = &plan.axes[*other];
            label += &format!(", {} {}", axis.name.replace('_', " "), value(&axis.listed()[position]));
        }
        series.push(Series::line(label, SeriesRole::Other, points.iter().map(|p| (p[0], p[1]))));
        if plan.description.repeats > 1 {
            series.push(Series::band("", SeriesRole::Other, points.iter().map(|p| (p[0], p[2], p[3]))));
        }
    }
    Ok(series)
}

/// As written, with the unit as the axes have it.
fn value(setting: &AxisValue) -> String {
    let text = setting.text();
    match Value::parse(&text) {
        Ok(value) => {
            format!("{} {}", value.parts().0, kalmems_figures::unit_sign(value.parts().1)).trim().to_owned()
        }
        Err(_) => text,
    }
}

/// A point for each run.
fn over_draws(plan: &StudyPlan, table: &TidyTable, column: usize, place: usize) -> Vec<Series> {
    let (groups, of_rows) = groups(table);
    let mut points: BTreeMap<usize, Vec<(f64, f64)>> = BTreeMap::new();
    for (line, group) in table.rows.iter().zip(of_rows) {
        let x = plan.run(line.run).settings[place].number;
        if let (Some(group), Some(x), Some(y)) = (group, x, number(&line.cells[column])) {
            points.entry(group).or_default().push((x, y));
        }
    }
    let series = points.into_iter().map(|(group, mut points)| {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Series::points(name(&groups, &groups[group]), SeriesRole::Other, points)
    });
    series.collect()
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

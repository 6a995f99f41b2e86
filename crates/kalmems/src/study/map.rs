//! A figure of the results over two things that vary, in colours.

use super::axis::StudyAxis;
use super::pictures::{LOST, axis, name, true_value, value_in_words};
use super::runs::StudyRuns;
use super::spread::spreads;
use kalmems_core::Portable;
use kalmems_figures::{self, AxisScale, MapGrid, Panel, Series, SeriesLink, SeriesRole};
use std::collections::BTreeMap;

/// What a map shows.
pub(super) struct StudyMap {
    /// The places of what varies to the right and upwards.
    pub(super) places: [usize; 2],
    /// What is shown in colours.
    pub(super) value: kalmems_figures::Axis,
    /// Where the colours part.
    pub(super) level: Option<f64>,
}

/// A panel with the medians for each estimator and segment, and crosses where runs have no estimate.
pub(super) fn panels(runs: &StudyRuns, column: usize, map: &StudyMap) -> Result<Vec<Panel>, String> {
    let StudyRuns { plan, table, groups, of_rows, .. } = runs;
    let [across, upwards] = map.places;
    if across == upwards {
        return Err("`against` and `over` are the same; a map needs two that vary".to_owned());
    }
    if let Some((_, other)) =
        plan.grid().find(|(place, axis)| !map.places.contains(place) && axis.points() > 1)
    {
        return Err(format!("`{}` varies as well; a map shows two that do", other.name));
    }
    let (x, y) = (numbers(&plan.axes[across])?, numbers(&plan.axes[upwards])?);
    let mut known = BTreeMap::new();
    for spread in spreads(plan, table, (of_rows, column)) {
        known.insert((spread.point, spread.group), spread.median);
    }
    let mut maps: BTreeMap<usize, GroupMap> = BTreeMap::new();
    for point in 0..plan.points() {
        let settings = plan.run(point * plan.description.repeats).settings;
        let column = x.iter().position(|value| settings[across].number == Some(*value));
        let row = y.iter().position(|value| settings[upwards].number == Some(*value));
        let Some((column, row)) = column.zip(row) else { continue };
        let at = [x[column], y[row]];
        for group in (0..groups.len()).filter(|group| runs.has(point, *group)) {
            let of_group = maps.entry(group).or_insert_with(|| GroupMap::new(x.len(), y.len()));
            let median = known.get(&(point, group));
            if let Some(median) = median {
                of_group.values[row][column] = shown(*median, map.value.scale);
            }
            let value =
                median.map_or_else(|| "no estimate".to_owned(), |median| value_in_words(&map.value, *median));
            of_group.links.extend(runs.link_to_point((point, group), at, &value));
            if runs.lost_at(point, group) > 0 {
                of_group.lost.push((at[0], at[1]));
            }
        }
    }
    let colours = &map.value;
    maps.retain(|_, of_group| of_group.values.iter().flatten().any(|value| value.is_finite()));
    let panels = maps.into_iter().map(|(group, GroupMap { values, links, lost })| {
        let lowest = values.iter().flatten().copied().fold(f64::NAN, f64::min);
        let level = map.level.map_or(lowest, |level| shown(level, map.value.scale));
        let who = name(groups, &groups[group]);
        let label = map.level.map_or_else(String::new, |level| format!("{} is {level}", map.value.label));
        let grid = MapGrid { x: x.clone(), y: y.clone(), values, colours: colours.clone(), level };
        let mut right = axis(plan, across);
        if groups.len() > 1 {
            right.label = format!("{}, {who}", right.label);
        }
        let panel = Panel::new(right, axis(plan, upwards)).with(Series::map(label, grid).leading_to(links));
        let upright = [y.first(), y.last()].map(|end| end.copied().unwrap_or(f64::NAN));
        let panel = true_value(plan, across, upright).into_iter().fold(panel, Panel::with);
        if lost.is_empty() { panel } else { panel.with(Series::points(LOST, SeriesRole::Failure, lost)) }
    });
    Ok(panels.collect())
}

/// The map of one estimator and segment.
struct GroupMap {
    /// The medians, row by row.
    values: Vec<Vec<f64>>,
    /// Where its cells lead to.
    links: Vec<SeriesLink>,
    /// The cells of which runs have no estimate.
    lost: Vec<(f64, f64)>,
}

impl GroupMap {
    fn new(columns: usize, rows: usize) -> Self {
        Self { values: vec![vec![f64::NAN; columns]; rows], links: Vec::new(), lost: Vec::new() }
    }
}

/// As the colours have it; what has no logarithm leaves its cell empty.
fn shown(value: f64, scale: AxisScale) -> f64 {
    match scale {
        AxisScale::Linear => value,
        AxisScale::Log => value.portable_log10(),
    }
}

/// The values that a key takes, rising.
fn numbers(axis: &StudyAxis) -> Result<Vec<f64>, String> {
    let mut numbers = Vec::new();
    for setting in axis.listed() {
        let Some(number) = setting.number else {
            return Err(format!("`{}` has words for values; a map needs numbers", axis.name));
        };
        numbers.push(number);
    }
    if numbers.len() < 2 {
        return Err(format!("`{}` has no two values side by side; a map needs them", axis.name));
    }
    numbers.sort_by(f64::total_cmp);
    Ok(numbers)
}

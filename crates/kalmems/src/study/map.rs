//! A figure of the results over two things that vary, in colours.

use super::StudyPlan;
use super::axis::StudyAxis;
use super::pictures::{axis, name};
use super::spread::{groups, spreads};
use crate::table::TidyTable;
use kalmems_core::Portable;
use kalmems_figures::{self, AxisScale, MapGrid, Panel, Series};
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

/// A panel with the medians for each estimator and segment.
pub(super) fn panels(
    plan: &StudyPlan,
    table: &TidyTable,
    column: usize,
    map: &StudyMap,
) -> Result<Vec<Panel>, String> {
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
    let (groups, _) = groups(table);
    let mut medians: BTreeMap<usize, Vec<Vec<f64>>> = BTreeMap::new();
    for spread in spreads(plan, table, column) {
        let settings = plan.run(spread.point * plan.description.repeats).settings;
        let column = x.iter().position(|value| settings[across].number == Some(*value));
        let row = y.iter().position(|value| settings[upwards].number == Some(*value));
        if let (Some(column), Some(row)) = (column, row) {
            let values =
                medians.entry(spread.group).or_insert_with(|| vec![vec![f64::NAN; x.len()]; y.len()]);
            values[row][column] = shown(spread.median, map.value.scale);
        }
    }
    let mut colours = map.value.clone();
    if colours.scale == AxisScale::Log {
        let unit = kalmems_figures::unit_sign(&colours.unit);
        let unit = if unit.is_empty() { String::new() } else { format!(" / {unit}") };
        colours = kalmems_figures::Axis::new(format!("log10({}{unit})", colours.label), "");
    }
    let panels = medians.into_iter().map(|(group, values)| {
        let lowest = values.iter().flatten().copied().fold(f64::NAN, f64::min);
        let level = map.level.map_or(lowest, |level| shown(level, map.value.scale));
        let who = name(&groups, &groups[group]);
        let label = map.level.map_or_else(String::new, |level| format!("{} is {level}", map.value.label));
        let grid = MapGrid { x: x.clone(), y: y.clone(), values, colours: colours.clone(), level };
        let mut right = axis(plan, across);
        if groups.len() > 1 {
            right.label = format!("{}, {who}", right.label);
        }
        Panel::new(right, axis(plan, upwards)).with(Series::map(label, grid))
    });
    Ok(panels.collect())
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

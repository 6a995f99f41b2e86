//! A figure of the results over the repeats of each point.

use super::StudyPlan;
use crate::table::{TidyTable, number};
use kalmems_figures::guarded;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// What an estimator reached at one point of the grid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EstimatorSpread {
    /// The point.
    pub(super) point: u64,
    /// Its place among the estimators and segments, in the order of the table.
    pub(super) group: usize,
    /// How many repeats have the figure.
    pub(super) count: usize,
    pub(super) median: f64,
    pub(super) lowest: f64,
    pub(super) highest: f64,
}

/// Recording, segment and estimator of a row: key and name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RowGroup {
    pub(super) recording: String,
    pub(super) segment: String,
    pub(super) estimator: String,
    pub(super) name: String,
}

/// The groups of a table, in its order, and the group of each of its rows; `None` for a run without figures.
pub(super) fn groups(table: &TidyTable) -> (Vec<RowGroup>, Vec<Option<usize>>) {
    let places = ["recording", "segment", "estimator", "estimator_name"].map(|name| table.column(name));
    let mut groups: Vec<RowGroup> = Vec::new();
    let mut of_rows = Vec::with_capacity(table.rows.len());
    for line in &table.rows {
        let [recording, segment, estimator, name] =
            places.map(|place| place.and_then(|p| line.cells.get(p)).cloned().unwrap_or_default());
        if estimator.is_empty() {
            of_rows.push(None);
            continue;
        }
        let group = RowGroup { recording, segment, estimator, name };
        let place = groups.iter().position(|other| *other == group).unwrap_or_else(|| {
            groups.push(group);
            groups.len() - 1
        });
        of_rows.push(Some(place));
    }
    (groups, of_rows)
}

/// Median and range of a column, for each point and group that have it.
pub(super) fn spreads(
    plan: &StudyPlan,
    table: &TidyTable,
    (of_rows, column): (&[Option<usize>], usize),
) -> Vec<EstimatorSpread> {
    let mut values: BTreeMap<(u64, usize), Vec<f64>> = BTreeMap::new();
    for (line, group) in table.rows.iter().zip(of_rows) {
        let value = line.cells.get(column).and_then(|cell| number(cell));
        if let (Some(group), Some(value)) = (*group, value) {
            values.entry((line.run / plan.description.repeats, group)).or_default().push(value);
        }
    }
    let spreads = values.into_iter().map(|((point, group), mut values)| {
        values.sort_by(f64::total_cmp);
        let middle = values.len() / 2;
        let median =
            if values.len() % 2 == 1 { values[middle] } else { values[middle - 1].midpoint(values[middle]) };
        EstimatorSpread {
            point,
            group,
            count: values.len(),
            median,
            lowest: values[0],
            highest: values[values.len() - 1],
        }
    });
    spreads.collect()
}

/// A table of the spread of each column: one row for each point, segment, estimator and figure.
pub(super) fn write_csv(
    plan: &StudyPlan,
    table: &TidyTable,
    columns: &[usize],
    w: &mut dyn Write,
) -> io::Result<()> {
    let (groups, of_rows) = groups(table);
    let mut csv = csv::Writer::from_writer(w);
    let grid: Vec<_> = plan.grid().collect();
    let axes = grid.iter().map(|(_, axis)| axis.column.as_str());
    let names = ["recording", "segment", "estimator", "figure", "repeats", "median", "lowest", "highest"];
    csv.write_record(["point"].into_iter().chain(axes).chain(names).map(|name| guarded(name).into_owned()))?;
    for column in columns {
        for spread in spreads(plan, table, (&of_rows, *column)) {
            let run = plan.run(spread.point * plan.description.repeats);
            let group = &groups[spread.group];
            let mut cells = vec![spread.point.to_string()];
            cells.extend(grid.iter().map(|(i, _)| run.settings[*i].cell.clone()));
            cells.extend(
                [&group.recording, &group.segment, &group.estimator, &table.columns[*column]]
                    .map(Clone::clone),
            );
            cells.push(spread.count.to_string());
            cells.extend([spread.median, spread.lowest, spread.highest].map(|x| format!("{x:?}")));
            csv.write_record(cells.iter().map(|cell| guarded(cell).into_owned()))?;
        }
    }
    csv.flush()
}

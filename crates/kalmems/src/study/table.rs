//! The results of a study as one tidy table.

use super::StudyPlan;
use super::journal::FinishedRuns;
use super::rows::StudyRow;
use std::io::{self, Write};

/// One row for each run, segment and estimator; one for a run without figures.
#[derive(Clone, Debug)]
pub(super) struct StudyTable {
    pub(super) columns: Vec<String>,
    pub(super) rows: Vec<StudyTableRow>,
    /// How many columns come before the figures.
    pub(super) before: usize,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub(super) struct StudyTableRow {
    /// The run, counted from 0.
    pub(super) run: u64,
    /// One per column; empty where there is nothing.
    pub(super) cells: Vec<String>,
}

impl StudyTable {
    /// From all runs of a study, in their order.
    pub(super) fn of(plan: &StudyPlan, runs: &FinishedRuns) -> Self {
        let figures = union(runs.values().flat_map(|finished| &finished.rows));
        let mut columns: Vec<String> = ["point", "repeat", "seed"].map(str::to_owned).to_vec();
        columns.extend(plan.axes.iter().map(|axis| axis.column.clone()));
        columns.push("error".to_owned());
        let before = columns.len();
        columns.extend(figures.iter().cloned());
        let mut rows = Vec::new();
        for (index, finished) in runs {
            let run = plan.run(*index);
            let mut start = vec![run.point.to_string(), run.repeat.to_string(), run.seed.to_string()];
            start.extend(run.settings.into_iter().map(|setting| setting.cell));
            start.push(finished.error.clone().unwrap_or_default());
            let nothing = StudyRow::new();
            let lines =
                if finished.rows.is_empty() { std::slice::from_ref(&nothing) } else { &finished.rows };
            for row in lines {
                let figures =
                    figures.iter().map(|name| row.get(name).and_then(|v| v.as_str()).unwrap_or_default());
                let cells = start.iter().cloned().chain(figures.map(str::to_owned)).collect();
                rows.push(StudyTableRow { run: *index, cells });
            }
        }
        Self { columns, rows, before }
    }

    /// The place of a column.
    pub(super) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// The places of the columns of figures that are numbers.
    pub(super) fn is_number(&self, column: usize) -> bool {
        let mut cells =
            self.rows.iter().map(|line| line.cells[column].as_str()).filter(|cell| !cell.is_empty());
        cells.all(|cell| number(cell).is_some())
    }

    pub(super) fn write_csv(&self, w: &mut dyn Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(w);
        csv.write_record(&self.columns)?;
        for line in &self.rows {
            csv.write_record(&line.cells)?;
        }
        csv.flush()
    }
}

/// A cell as a number. Words such as `infinity` are none.
pub(super) fn number(cell: &str) -> Option<f64> {
    let begins = cell.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    if begins { cell.parse().ok() } else { None }
}

/// The columns of all rows; one that a row has alone stands behind that which it stands behind there.
fn union<'a>(rows: impl Iterator<Item = &'a StudyRow>) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for row in rows {
        if row.keys().eq(&columns) {
            continue;
        }
        let mut next = 0;
        for name in row.keys() {
            next = columns.iter().position(|column| column == name).unwrap_or_else(|| {
                columns.insert(next, name.clone());
                next
            }) + 1;
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(names: &str) -> StudyRow {
        names.split_whitespace().map(|name| (name.to_owned(), "1".into())).collect()
    }

    #[test]
    fn columns_keep_the_order_of_the_rows() {
        let rows = ["a d", "a b d", "a b c d e", "d"].map(row);
        assert_eq!(union(rows.iter()), ["a", "b", "c", "d", "e"]);
    }

    #[test]
    fn words_are_no_numbers() {
        assert_eq!(
            ["1e-5", "-0.5", "3", "inf", "NaN", "infinity", "", "1 V"].map(number),
            [Some(1e-5), Some(-0.5), Some(3.0), None, None, None, None, None]
        );
    }
}

//! The results of a study as one tidy table.

use super::StudyPlan;
use super::journal::FinishedRuns;
use crate::rows::ResultRow;
use crate::table::{TidyRow, TidyTable, union};

/// From all runs of a study, in their order.
pub(super) fn table(plan: &StudyPlan, runs: &FinishedRuns) -> TidyTable {
    let figures = union(runs.values().flat_map(|finished| &finished.rows).map(|row| row.keys().collect()));
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
        let nothing = ResultRow::new();
        let lines = if finished.rows.is_empty() { std::slice::from_ref(&nothing) } else { &finished.rows };
        for row in lines {
            let figures =
                figures.iter().map(|name| row.get(name).and_then(|v| v.as_str()).unwrap_or_default());
            let cells = start.iter().cloned().chain(figures.map(str::to_owned)).collect();
            rows.push(TidyRow { run: *index, cells });
        }
    }
    TidyTable { columns, words: Vec::new(), rows, before }
}

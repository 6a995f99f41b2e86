//! The files of a reproduction.

use super::page::page;
use super::{Check, Effort, ItemHead, ItemVerdict, Paper, ReproduceError, Reproduction};
use crate::simulate::WhiteNoise;
use kalmems_figures::TextTable;
use kalmems_store::{Output, RunInfo, RunTiming};
use serde::Serialize;
use std::io::{self, Write};

/// Writes report, pictures, tables and record of the run into a result.
///
/// `report.html`; `figures/` as SVG; `tables/<item>.csv` with the paper's values beside ours and
/// `tables/<item>_<n>.csv` with the others; `reproduction.json`; `run.toml`. Where `stop` says so in between, the work
/// ends.
pub fn write_reproduction(
    reproduction: &Reproduction,
    output: &Output,
    info: RunInfo,
    stop: &dyn Fn() -> bool,
) -> Result<(), ReproduceError> {
    let html = page(reproduction)?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    for item in &reproduction.items {
        let key = item.head.key;
        output.write(&format!("tables/{key}.csv"), |w| write_checks(&item.checks, w))?;
        for (table, n) in item.tables.iter().zip(2..) {
            output.write(&format!("tables/{key}_{n}.csv"), |w| write_table(table, w))?;
        }
        for figure in &item.figures {
            figure.files(|name, content| output.write(name, |w| w.write_all(content)))?;
        }
        if stop() {
            return Err(ReproduceError::Interrupted);
        }
    }
    output.write("reproduction.json", |w| {
        serde_json::to_writer_pretty(&mut *w, &Json::from(reproduction))?;
        writeln!(w)
    })?;
    Ok(output.write_run(&input_id(reproduction), || Ok(run_record(reproduction, info)))?)
}

impl Serialize for Reproduction {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Json::from(self).serialize(serializer)
    }
}

/// What tells one run from another.
fn input_id(reproduction: &Reproduction) -> String {
    let settings = &reproduction.settings;
    let effort = if settings.effort == Effort::Quick { "quick" } else { "full" };
    let only = settings.only.as_ref().map_or_else(String::new, |only| format!(", only {only}"));
    format!("{}: reproduction, {effort}, seed {}{only}", reproduction.rig, settings.seed)
}

fn write_checks(checks: &[Check], w: &mut dyn Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(w);
    let head = [
        "subject",
        "unit",
        "paper",
        "ours",
        "ours_low",
        "ours_high",
        "runs",
        "holds",
        "comparison",
        "criterion",
    ];
    csv.write_record(head)?;
    for check in checks {
        let (unit, numbers) = match check {
            Check::Value { unit, ours, .. } => {
                let spread = [ours.median, ours.low, ours.high].map(|value| format!("{value}"));
                (*unit, [spread.as_slice(), &[ours.runs.to_string()]].concat())
            }
            Check::Claim { ours, .. } => {
                ("", vec![ours.clone(), String::new(), String::new(), String::new()])
            }
        };
        let subject = match check {
            Check::Value { quantity, .. } => quantity.clone(),
            Check::Claim { statement, .. } => statement.clone(),
        };
        let row = [subject, unit.to_owned(), check.paper()].into_iter().chain(numbers);
        csv.write_record(row.chain([check.holds().to_string(), check.comparison(), check.criterion()]))?;
    }
    csv.flush()
}

fn write_table(table: &TextTable, w: &mut dyn Write) -> io::Result<()> {
    let mut csv = csv::WriterBuilder::new().flexible(true).from_writer(w);
    csv.write_record(table.columns.iter().map(kalmems_figures::ColumnHead::head))?;
    for row in &table.rows {
        csv.write_record(row)?;
    }
    csv.flush()
}

/// The whole as JSON.
#[derive(Serialize)]
struct Json<'a> {
    rig: &'static str,
    effort: Effort,
    seed: u64,
    papers: &'static [Paper],
    items: Vec<JsonItem<'a>>,
}

#[derive(Serialize)]
struct JsonItem<'a> {
    #[serde(flatten)]
    head: &'static ItemHead,
    verdict: ItemVerdict,
    why: String,
    checks: &'a [Check],
    remarks: &'a [String],
    tables: Vec<JsonTable<'a>>,
    figures: Vec<&'a str>,
}

#[derive(Serialize)]
struct JsonTable<'a> {
    caption: &'a str,
    columns: Vec<String>,
    rows: &'a [Vec<String>],
}

impl<'a> From<&'a Reproduction> for Json<'a> {
    fn from(reproduction: &'a Reproduction) -> Self {
        let items = reproduction.items.iter().map(|item| JsonItem {
            head: item.head,
            verdict: item.verdict(),
            why: item.why(),
            checks: &item.checks,
            remarks: &item.remarks,
            tables: item
                .tables
                .iter()
                .map(|table| JsonTable {
                    caption: &table.caption,
                    columns: table.columns.iter().map(kalmems_figures::ColumnHead::head).collect(),
                    rows: &table.rows,
                })
                .collect(),
            figures: item.figures.iter().map(|figure| figure.id.as_str()).collect(),
        });
        Self {
            rig: reproduction.rig,
            effort: reproduction.settings.effort,
            seed: reproduction.settings.seed,
            papers: reproduction.program.papers,
            items: items.collect(),
        }
    }
}

#[derive(Serialize)]
struct ReproductionRecord {
    effort: Effort,
    only: Option<String>,
    noise: SeedRecord,
    timing: ReproductionTiming,
}

#[derive(Serialize)]
struct SeedRecord {
    generator: &'static str,
    first_seed: u64,
}

#[derive(Serialize)]
struct ReproductionTiming {
    #[serde(flatten)]
    run: RunTiming,
    threads: usize,
}

fn run_record(reproduction: &Reproduction, info: RunInfo) -> ReproductionRecord {
    let settings = &reproduction.settings;
    ReproductionRecord {
        effort: settings.effort,
        only: settings.only.clone(),
        noise: SeedRecord { generator: WhiteNoise::NAME, first_seed: settings.seed },
        timing: ReproductionTiming { run: info.timing(), threads: settings.threads },
    }
}

//! A calibration as tables: three for people, and one with all of it for programs.

use super::{ClaimCalibration, FilterCalibration, Share, StudyCalibrationSummary, TestCount};
use crate::table::{TidyRow, TidyTable};
use kalmems_figures::{self as figures, ColumnHead};

/// The grades, from the best to the worst, with what stands above their columns.
const GRADES: [(&str, &str); 5] = [
    ("passes", "passes"),
    ("passes with remarks", "with remarks"),
    ("doubtful", "doubtful"),
    ("failed", "failed"),
    ("no estimate", "no estimate"),
];

/// A share in per cent with its interval.
fn percent(share: &Share) -> String {
    let Share { share, lower, upper, .. } = share;
    // Of a share near 100 % the digits that tell are behind the point.
    let digits = if *share > 0.98 { 2 } else { 1 };
    format!("{:.digits$} ({:.digits$} … {:.digits$})", 100.0 * share, 100.0 * lower, 100.0 * upper)
}

/// A probability with as many digits as mean something.
fn probability(p: f64) -> String {
    match p {
        p if p < 1e-99 => "< 1e-99".to_owned(),
        p if p < 1e-3 => format!("{p:.0e}"),
        p => format!("{p:.3}"),
    }
}

/// Verdicts, tests and claims.
pub(in super::super) fn page_tables(summary: &StudyCalibrationSummary) -> Vec<figures::TextTable> {
    vec![verdicts(summary), tests(summary), claims(summary)]
}

fn verdicts(summary: &StudyCalibrationSummary) -> figures::TextTable {
    let grades = GRADES.iter().map(|(_, head)| ColumnHead::number(*head, ""));
    let columns = [ColumnHead::text("filter"), ColumnHead::number("runs", "")].into_iter().chain(grades);
    let columns = columns.chain([ColumnHead::text("doubtful or worse, % (95 % interval)")]);
    let mut table = figures::TextTable::new("Verdicts", columns);
    for filter in &summary.filters {
        let given =
            |grade: &str| filter.grades.iter().find(|count| count.grade == grade).map_or(0, |c| c.runs);
        let mut cells = vec![summary.label(filter), filter.runs.to_string()];
        cells.extend(GRADES.iter().map(|(grade, _)| given(grade).to_string()));
        cells.push(percent(&filter.doubted));
        table.push(cells);
    }
    table
}

fn tests(summary: &StudyCalibrationSummary) -> figures::TextTable {
    let columns = [
        ColumnHead::text("test"),
        ColumnHead::number("made", ""),
        ColumnHead::number("fails", ""),
        ColumnHead::text("fails, % (95 % interval)"),
    ];
    let mut table = figures::TextTable::new("Tests of the verdict, over all filters", columns);
    for TestCount { test, failed, rate } in summary.tests() {
        table.push([test, format!("{:.0}", rate.of), failed.to_string(), percent(&rate)]);
    }
    table
}

fn claims(summary: &StudyCalibrationSummary) -> figures::TextTable {
    let columns = [
        ColumnHead::text("filter"),
        ColumnHead::text("quantity"),
        ColumnHead::number("independent errors", ""),
        ColumnHead::text("within 1 sd, % (68.3)"),
        ColumnHead::text("within 2 sd, % (95.4)"),
        ColumnHead::text("within 3 sd, % (99.7)"),
        ColumnHead::number("ranks", ""),
        ColumnHead::number("mean", "sd"),
        ColumnHead::number("rms", "sd"),
        ColumnHead::number("p of uniform ranks", ""),
        ColumnHead::text("finding"),
    ];
    let mut table = figures::TextTable::new("Claims, with 95 % intervals", columns);
    for filter in &summary.filters {
        for claim in &filter.claims {
            let ClaimCalibration {
                quantity, independent, coverage, ranked, mean, rms, ranks, finding, ..
            } = claim;
            let mut cells =
                vec![summary.label(filter), quantity.replace('_', " "), format!("{independent:.0}")];
            cells.extend(coverage.iter().map(|level| percent(&level.found)));
            cells.extend([ranked.to_string(), format!("{mean:+.3}"), format!("{rms:.3}")]);
            let p_value = ranks.as_ref().map_or_else(|| "–".to_owned(), |ranks| probability(ranks.p_value));
            cells.extend([p_value, finding.to_string()]);
            table.push(cells);
        }
    }
    table
}

const COLUMNS: [&str; 14] = [
    "point",
    "recording",
    "segment",
    "estimator",
    "what",
    "name",
    "level",
    "count",
    "of",
    "share",
    "lower",
    "upper",
    "claimed",
    "p_value",
];

/// All numbers, one to a row: how often each grade was given and each test failed, the coverage at each level, and the bins of
/// each histogram of ranks with the band that all of them lie in where the ranks are uniform.
pub(in super::super) fn long_table(summary: &StudyCalibrationSummary) -> TidyTable {
    let mut rows = Vec::new();
    for filter in &summary.filters {
        let mut add = |cells: [String; 10]| {
            let FilterCalibration { point, recording, segment, estimator, .. } = filter;
            let start = [point, recording, segment, estimator].map(Clone::clone);
            rows.push(TidyRow { run: 0, cells: start.into_iter().chain(cells).collect() });
        };
        let empty = String::new;
        let text = |x: f64| format!("{x:?}");
        let counted = |what: &str, name: &str, runs: u64, share: &Share| {
            let Share { share, of, lower, upper } = *share;
            let numbers = [text(of), text(share), text(lower), text(upper)];
            let [of, share, lower, upper] = numbers;
            let (what, name) = (what.to_owned(), name.replace(' ', "_"));
            [what, name, empty(), runs.to_string(), of, share, lower, upper, empty(), empty()]
        };
        for (grade, _) in GRADES {
            let runs = filter.grades.iter().find(|count| count.grade == grade).map_or(0, |count| count.runs);
            add(counted("grade", grade, runs, &Share::counted(runs, filter.runs)));
        }
        for TestCount { test, failed, rate } in &filter.tests {
            add(counted("test", test, *failed, rate));
        }
        for claim in &filter.claims {
            let name = || claim.quantity.clone();
            for (level, sds) in claim.coverage.iter().zip(super::judged::LEVELS) {
                let Share { share, of, lower, upper } = level.found;
                let within = format!("{:.0}", share * claim.errors as f64);
                let [level, of, share, lower, upper, claimed] =
                    [sds, of, share, lower, upper, level.claimed].map(text);
                let what = "coverage".to_owned();
                add([what, name(), level, within, of, share, lower, upper, claimed, empty()]);
            }
            let Some(ranks) = &claim.ranks else { continue };
            let bins = ranks.counts.len() as f64;
            let of = claim.ranked as f64;
            for (bin, count) in ranks.counts.iter().enumerate() {
                // The level of a bin is its upper end.
                let [level, all, share, lower, upper, claimed, p_value] = [
                    (bin + 1) as f64 / bins,
                    of,
                    *count as f64 / of,
                    ranks.band[0] as f64 / of,
                    ranks.band[1] as f64 / of,
                    1.0 / bins,
                    ranks.p_value,
                ]
                .map(text);
                let what = "rank".to_owned();
                add([what, name(), level, count.to_string(), all, share, lower, upper, claimed, p_value]);
            }
        }
    }
    TidyTable { columns: COLUMNS.map(str::to_owned).to_vec(), words: Vec::new(), rows, before: 4 }
}

//! Outliers by share and by size, device by device.

use super::signals::{DEVICES, IMPAIRMENTS, Impairment, Of, both};
use crate::side_by_side::side_by_side;

/// What came of a cell.
struct Cell {
    of: Of,
    impairment: Impairment,
    /// The ratio of both errors, seed by seed; infinite where there is no estimate.
    ratios: Vec<f64>,
    passed: usize,
    refused: Vec<String>,
    /// Answers that pass and are wrong.
    wrong: Vec<String>,
    rejected: f64,
}

/// By how much the error may be larger: a burst is an event within which nothing is measured.
fn allowed(impairment: Impairment) -> f64 {
    if impairment == Impairment::Burst { 2.0 } else { 1.3 }
}

impl Cell {
    fn of(of: Of, impairment: Impairment, seeds: std::ops::RangeInclusive<u64>) -> Self {
        let mut cell = Self {
            of,
            impairment,
            ratios: Vec::new(),
            passed: 0,
            refused: Vec::new(),
            wrong: Vec::new(),
            rejected: 0.0,
        };
        let count = seeds.clone().count() as f64;
        for seed in seeds {
            let [clean, spoilt] = both(of, &[], impairment, seed);
            let ratio = spoilt.error() / clean.error();
            cell.ratios.push(ratio);
            cell.passed += usize::from(spoilt.passes());
            cell.rejected += spoilt.first().map_or(0.0, |first| first.rejections.count as f64) / count;
            cell.refused.extend(spoilt.why_none());
            if spoilt.passes() && ratio > allowed(impairment) {
                cell.wrong.push(format!("seed {seed} passes with {ratio:.2} times the error"));
            }
        }
        cell.ratios.sort_by(f64::total_cmp);
        cell
    }

    fn within(&self) -> usize {
        self.ratios.iter().filter(|ratio| **ratio <= allowed(self.impairment)).count()
    }

    fn row(&self) -> String {
        let Self { of, impairment, ratios, passed, rejected, .. } = self;
        format!(
            "| {} | {} | {:.1} | {:.2} | {:.2} | {} of {} | {passed} |",
            of.name(),
            impairment.words(),
            rejected,
            ratios[ratios.len() / 2],
            ratios[ratios.len() - 1],
            self.within(),
            ratios.len()
        )
    }
}

/// All cells, on all processors, in order.
fn cells(seeds: std::ops::RangeInclusive<u64>) -> Vec<Cell> {
    let wanted: Vec<(Of, Impairment)> =
        DEVICES.iter().flat_map(|of| IMPAIRMENTS.map(|impairment| (*of, impairment))).collect();
    side_by_side(&wanted, |(of, impairment)| {
        let cell = Cell::of(*of, *impairment, seeds.clone());
        println!("{}", cell.row());
        cell
    })
}

fn judge(cells: &[Cell]) {
    println!("| device | signal | rejected | error, median | largest | within the bound | passed |");
    println!("|---|---|---|---|---|---|---|");
    for cell in cells {
        println!("{}", cell.row());
    }
    for cell in cells {
        assert!(cell.wrong.is_empty(), "{}: {:?}", cell.row(), cell.wrong);
        assert!(
            cell.within() + cell.refused.len() == cell.ratios.len(),
            "{}: {:?}",
            cell.row(),
            cell.refused
        );
    }
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_outliers_cost_little_of_any_device() {
    judge(&cells(401..=402));
}

#[test]
#[ignore = "minutes in a release build"]
fn slow_outliers_cost_little_of_any_device() {
    judge(&cells(501..=520));
}

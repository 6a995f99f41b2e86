//! Medians with bars that span all seeds.

use super::chance::Spread;
use kalmems::figures::{Panel, Series, SeriesRole};

/// Points of one colour with their bars, joined by a line or not.
pub fn with_bars(panel: Panel, label: &str, points: &[(f64, Spread)], joined: bool) -> Panel {
    let medians: Vec<(f64, f64)> = points.iter().map(|(x, spread)| (*x, spread.median)).collect();
    let mut panel = panel.with(Series::points(label, SeriesRole::Other, medians.clone()));
    for (x, spread) in points {
        panel = panel.with(Series::line("", SeriesRole::Other, [(*x, spread.least), (*x, spread.most)]));
    }
    if joined { panel.with(Series::line("", SeriesRole::Other, medians)) } else { panel }
}

//! Histograms of ranks.

use super::{ClaimCalibration, StudyCalibrationSummary, Uniformity};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};

/// A figure for each filter, with a panel for each quantity whose ranks are enough for a histogram.
pub(in super::super) fn figures(summary: &StudyCalibrationSummary) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (place, filter) in summary.filters.iter().enumerate() {
        let panels: Vec<Panel> = filter.claims.iter().filter_map(panel).collect();
        if panels.is_empty() {
            continue;
        }
        let title = format!("Ranks of the truth: {}", summary.label(filter));
        let caption = format!(
            "How many ranks Φ((truth − estimate)/sd) lie in each of equally wide bins, over {} runs. Of a claim that holds all \
             bins are in the band with 99 % probability; a hill is a filter that claims larger errors than it makes, a valley one \
             that claims smaller ones, a slope is a bias.",
            filter.runs
        );
        let id = format!("calibration_{}_{}", place + 1, filter.estimator);
        figures.push(panels.into_iter().fold(Figure::new(id, title, caption), Figure::with));
    }
    figures
}

fn panel(claim: &ClaimCalibration) -> Option<Panel> {
    let Uniformity { counts, band, .. } = claim.ranks.as_ref()?;
    let [lower, upper] = band.map(|end| end as f64);
    let most = counts.iter().map(|count| *count as f64).fold(upper, f64::max);
    let label = format!("rank of {}", claim.quantity.replace('_', " "));
    let x = Axis::new(label, "").between(0.0, 1.0);
    let y = Axis::new("count", "").between(0.0, 1.1 * most);
    let expected = claim.ranked as f64 / counts.len() as f64;
    Some(
        Panel::new(x, y)
            .with(Series::band(
                "99 % band of uniform ranks",
                SeriesRole::Bound,
                [(0.0, lower, upper), (1.0, lower, upper)],
            ))
            .with(Series::line("counted", SeriesRole::Estimate, outline(counts)))
            .with(Series::level("expected", SeriesRole::Bound, expected)),
    )
}

/// The upper edge of the bars.
fn outline(counts: &[u64]) -> Vec<(f64, f64)> {
    let bins = counts.len() as f64;
    let bar = |(bin, count): (usize, &u64)| {
        [(bin as f64 / bins, *count as f64), ((bin + 1) as f64 / bins, *count as f64)]
    };
    counts.iter().enumerate().flat_map(bar).collect()
}

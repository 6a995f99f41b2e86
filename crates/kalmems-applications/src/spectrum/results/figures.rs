//! The pictures of a spectrum.

use crate::spectrum::SpectrumOutcome;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};

/// As an axis has it.
const PER_CM: &str = "cm^-1";

/// The spectrum, the first interferogram, and the noise over the number of scans where there are enough.
pub fn spectrum_figures(outcome: &SpectrumOutcome) -> Vec<Figure> {
    let mut figures = vec![spectrum(outcome), interferogram(outcome)];
    figures.extend(noise(outcome));
    figures
}

fn wavenumber() -> Axis {
    Axis::new("wavenumber", PER_CM)
}

fn spectrum(outcome: &SpectrumOutcome) -> Figure {
    let scans = &outcome.processed.scans;
    let nu: Vec<f64> = scans.grid.wavenumbers().iter().map(|nu| nu / 100.0).collect();
    let points = |values: &[f64]| nu.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let count = scans.spectra.len();
    let label = if count == 1 { "one scan".to_owned() } else { format!("mean of {count} scans") };
    let caption = "The spectrum; below it what is uncertain of each point: the standard error by the scatter of the scans, and that by \
                   errors of the path; and the difference to the reference, where there is one.";
    let mut panel = Panel::new(wavenumber(), Axis::new("spectrum", "1"));
    if let Some(comparison) = &outcome.comparison {
        let theirs = comparison.wavenumber_per_m.iter().map(|nu| nu / 100.0);
        let theirs: Vec<(f64, f64)> = theirs.zip(comparison.theirs.iter().copied()).collect();
        panel = panel.with(Series::line("reference", SeriesRole::Reference, theirs));
    }
    panel = panel.with(Series::line(label, SeriesRole::Estimate, points(&outcome.spectrum)));
    let (mut figure, mut narrow) = (Figure::new("spectrum", "Spectrum", caption).with(panel), None);
    if let Some(comparison) = &outcome.comparison {
        let differences: Vec<(f64, f64)> = (comparison.wavenumber_per_m.iter())
            .zip(comparison.ours.iter().zip(&comparison.theirs))
            .map(|(nu, (ours, theirs))| (nu / 100.0, ours - theirs))
            .collect();
        let span = |x: &mut dyn Iterator<Item = f64>| {
            let (low, high) = x.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            high - low
        };
        let is_wide = span(&mut differences.iter().map(|(x, _)| *x)) > 0.5 * span(&mut nu.iter().copied());
        let difference = Panel::new(wavenumber(), Axis::new("minus reference", "1"));
        let difference = difference.with(Series::line("", SeriesRole::Estimate, differences));
        // What is compared in a narrow band has an axis of its own, below the others, or it could not be seen.
        if is_wide {
            figure = figure.with(difference.sharing_x());
        } else {
            narrow = Some(difference);
        }
    }
    let errors = [
        ("noise of the mean", SeriesRole::Estimate, &outcome.standard_error),
        ("errors of the path", SeriesRole::Other, &outcome.systematic_error),
    ];
    let mut panel = Panel::new(wavenumber(), Axis::new("standard error", "1"));
    let mut any = false;
    for (label, role, errors) in errors {
        if let Some(errors) = errors {
            panel = panel.with(Series::line(label, role, points(errors)));
            any = true;
        }
    }
    if any {
        figure = figure.with(panel.sharing_x());
    }
    match narrow {
        Some(difference) => figure.with(difference),
        None => figure,
    }
}

fn interferogram(outcome: &SpectrumOutcome) -> Figure {
    let panel = Panel::new(Axis::new("path difference", "m"), Axis::new("interferogram", "1"));
    let points = outcome.processed.interferogram.clone();
    Figure::new(
        "interferogram",
        "The first scan",
        "The intensity of the first scan over the path difference.",
    )
    .with(panel.with(Series::line("", SeriesRole::Measured, points)))
}

fn noise(outcome: &SpectrumOutcome) -> Option<Figure> {
    let (first, last) = (outcome.noise.first()?, outcome.noise.last()?);
    if outcome.noise.len() < 3 || first.noise <= 0.0 || last.noise <= 0.0 {
        return None;
    }
    let points: Vec<(f64, f64)> = outcome.noise.iter().map(|n| (n.scans as f64, n.noise)).collect();
    let root: Vec<(f64, f64)> = (points.iter())
        .map(|(scans, _)| (*scans, first.noise * (first.scans as f64 / scans).sqrt()))
        .collect();
    let panel = Panel::new(Axis::new("scans", "1").log(), Axis::new("noise of their mean", "1").log())
        .with(Series::line("1/√scans", SeriesRole::Bound, root))
        .with(Series::points("mean of so many scans", SeriesRole::Measured, points));
    let caption = "The noise of the mean over the number of its scans. Noise that is independent from scan to scan falls along the \
                   dashed line; noise above it is common to the scans.";
    Some(Figure::new("coadding", "Noise of the mean of scans", caption).with(panel))
}

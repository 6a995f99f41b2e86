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
    let caption = "The spectrum with two standard uncertainties on either side; below it what each point's is made of, the standard error \
                   by the scatter of the scans and that by errors of the path; the phase, where there is light; and the difference to \
                   the reference, where there is one, with two standard uncertainties.";
    let mut panel = Panel::new(wavenumber(), Axis::new("spectrum", "1"));
    let uncertainty = uncertainty(outcome);
    if let Some(sd) = &uncertainty {
        let band =
            nu.iter().zip(&outcome.spectrum).zip(sd).map(|((x, y), sd)| (*x, y - 2.0 * sd, y + 2.0 * sd));
        panel = panel.with(Series::band("±2 standard uncertainties", SeriesRole::Estimate, band));
    }
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
        let difference = match uncertainty_at(outcome, uncertainty.as_deref(), &differences) {
            Some(band) => difference.with(Series::band("±2 standard uncertainties", SeriesRole::Bound, band)),
            None => difference,
        };
        let difference = difference.with(Series::line("difference", SeriesRole::Estimate, differences));
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
    let mut panel = Panel::new(wavenumber(), Axis::new("phase", "deg"));
    for phase in &outcome.processed.phases {
        let lit = points(&phase.rad).into_iter().filter(|(_, rad)| rad.is_finite());
        let lit: Vec<(f64, f64)> = lit.map(|(nu, rad)| (nu, rad.to_degrees())).collect();
        panel = panel.with(Series::points(phase.of, SeriesRole::Other, lit));
    }
    if !outcome.processed.phases.is_empty() {
        figure = figure.with(panel.sharing_x());
    }
    match narrow {
        Some(difference) => figure.with(difference),
        None => figure,
    }
}

/// The standard uncertainty of each point, of all that is known of it.
fn uncertainty(outcome: &SpectrumOutcome) -> Option<Vec<f64>> {
    let parts = [&outcome.standard_error, &outcome.systematic_error];
    let parts: Vec<&Vec<f64>> = parts.into_iter().flatten().collect();
    let square = |place: usize| parts.iter().map(|part| part[place].powi(2)).sum::<f64>();
    (!parts.is_empty()).then(|| (0..outcome.spectrum.len()).map(|place| square(place).sqrt()).collect())
}

/// The band about 0 at the wavenumbers of differences, by the uncertainty of the nearest point.
fn uncertainty_at(
    outcome: &SpectrumOutcome,
    uncertainty: Option<&[f64]>,
    differences: &[(f64, f64)],
) -> Option<Vec<(f64, f64, f64)>> {
    let (sd, grid) = (uncertainty?, outcome.processed.scans.grid);
    let band = differences.iter().filter_map(|(nu, _)| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below 0 is the first point
        let place = ((100.0 * nu - grid.first_per_m) / grid.step_per_m).round().max(0.0) as usize;
        sd.get(place).map(|sd| (*nu, -2.0 * sd, 2.0 * sd))
    });
    Some(band.collect())
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

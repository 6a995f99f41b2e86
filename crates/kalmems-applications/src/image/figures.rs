//! The pictures of an image's evidence: how the sharpness depends on the phase, and how well a sample's place is known.

use super::claimed::PlaceUncertainty;
use super::reconstruct::{AxisOutcome, ImageOutcome};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};

/// Sharpness over the phase of each axis that was searched, and what is uncertain of a sample's place across the field.
pub fn image_figures(outcome: &ImageOutcome) -> Vec<Figure> {
    [sharpness(&outcome.axes), position(&outcome.axes)].into_iter().flatten().collect()
}

fn sharpness(axes: &[AxisOutcome]) -> Option<Figure> {
    let caption = "What the samples of a pixel differ by, root mean square over the image and over the least of its curve, for phases \
                   of the axis: the less, the sharper. Images of fewer pixels, with which the search begins, blur the minimum. The \
                   lines stand at the phase that the search began with and at the one that it found.";
    let mut figure = Figure::new("sharpness", "Sharpness against phase", caption);
    for axis in axes.iter().filter(|axis| axis.found.is_some() && !axis.tried.is_empty()) {
        let phase = Axis::new(format!("phase of {}", axis.name), "deg");
        let mut panel = Panel::new(phase, Axis::new("scatter within pixels over the least", ""));
        let mut sizes: Vec<usize> = axis.tried.iter().map(|tried| tried.pixels).collect();
        sizes.dedup();
        let mut most: f64 = 1.0;
        for (place, size) in sizes.iter().enumerate() {
            let tried =
                || axis.tried.iter().filter(|tried| tried.pixels == *size && tried.measure.is_finite());
            let least = tried().map(|tried| tried.measure).fold(f64::INFINITY, f64::min);
            let points: Vec<(f64, f64)> = tried()
                .map(|tried| (tried.phase_rad.to_degrees(), (tried.measure / least).max(0.0).sqrt()))
                .collect();
            most = points.iter().map(|(_, y)| *y).fold(most, f64::max);
            let role = if place + 1 == sizes.len() { SeriesRole::Estimate } else { SeriesRole::Other };
            panel = panel
                .with(Series::line(format!("{size} pixels"), role, points.clone()))
                .with(Series::points("", role, points));
        }
        for (label, rad, role) in
            [("before", axis.start_rad, SeriesRole::Reference), ("found", axis.phase_rad, SeriesRole::Bound)]
        {
            let x = rad.to_degrees();
            panel = panel.with(Series::line(label, role, [(x, 1.0), (x, most)]));
        }
        figure = figure.with(panel);
    }
    (!figure.panels.is_empty()).then_some(figure)
}

/// How far the places of samples are uncertain.
fn position(axes: &[AxisOutcome]) -> Option<Figure> {
    let caption = "By how many pixels the place of a sample is uncertain across the field of view, one standard deviation: by the phase \
                   that was found, by the trajectory where the image file names the column of its standard deviation, and by both; and the \
                   bound of the interpolation between samples of the trajectory.";
    let mut figure = Figure::new("position_uncertainty", "Uncertainty of a sample's place", caption);
    for axis in axes {
        let pixels_per_rad = f64::from(axis.pixels) / (2.0 * axis.half_field_rad);
        let line = |label: &str, role, of: &dyn Fn(&PlaceUncertainty) -> Option<f64>| {
            let points = axis.places.iter();
            let points =
                points.filter_map(|part| Some((part.angle_rad.to_degrees(), pixels_per_rad * of(part)?)));
            Series::line(label, role, points.collect::<Vec<_>>())
        };
        let has_phase = axis.found.is_some_and(|found| found.sd_rad.is_finite());
        let has_claim = axis.places.iter().any(|part| part.by_trajectory_rad.is_some());
        let mut panel = Panel::new(
            Axis::new(format!("angle of {}", axis.name), "deg"),
            Axis::new("uncertainty (pixels)", ""),
        );
        if has_phase {
            panel = panel.with(line("phase", SeriesRole::Estimate, &|part| Some(part.by_phase_rad)));
        }
        if has_claim {
            panel = panel.with(line("trajectory", SeriesRole::Other, &|part| part.by_trajectory_rad));
        }
        if has_phase && has_claim {
            panel = panel.with(line("both", SeriesRole::Reference, &|part| Some(part.together_rad())));
        }
        if !has_phase && !has_claim {
            continue;
        }
        let panel = panel.with(Series::level(
            "interpolation, at most",
            SeriesRole::Bound,
            axis.interpolation_error_px,
        ));
        figure = figure.with(panel);
    }
    (!figure.panels.is_empty()).then_some(figure)
}

//! What a figure does not show, in words below it: missing samples, thinned points, values off the axis.

use crate::decimate::{SMALLEST, Thinning, is_drawable};
use crate::drawing::axis::Range;
use crate::drawing::layout::{FigureLayout, PanelPlace, extent};
use crate::figure::{Axis, AxisScale, Figure, Panel, Series, Shape};
use crate::prefix::{Prefixed, prefixed};

/// One sentence for each thing.
pub(crate) fn notes(figure: &Figure, layout: &FigureLayout<'_>) -> Vec<String> {
    let mut notes = Vec::new();
    for panel in &figure.panels {
        notes.extend([&panel.x, &panel.y].into_iter().filter_map(unusable));
        notes.extend(panel.series.iter().flat_map(|s| of_series(s, panel)));
    }
    notes.extend(layout.places.iter().flat_map(off_axis));
    notes
}

fn unusable(axis: &Axis) -> Option<String> {
    let [from, to] = axis.range?;
    if Range::fixed(axis).is_some() {
        return None;
    }
    Some(format!(
        "{}: no axis can run from {from:e} to {to:e}; it shows all of the data.",
        name(&axis.label, "An axis")
    ))
}

fn of_series(series: &Series, panel: &Panel) -> Vec<String> {
    let label = name(series.label(), "A series");
    let samples = series.source_samples();
    let mut notes = Vec::new();
    if series.gaps() > 0 {
        notes.push(match series.shape() {
            Shape::Map(_) => format!("{} of {samples} cells have no value and are grey.", series.gaps()),
            _ => format!("{label}: {} of {samples} samples are missing.", series.gaps()),
        });
    }
    if panel.y.scale == AxisScale::Log && series.not_positive() > 0 {
        notes.push(format!(
            "{label}: {} of {samples} values are not positive and lie below the logarithmic axis.",
            series.not_positive()
        ));
    }
    match (series.thinning(), series.shape()) {
        (Thinning::ByColumn, Shape::Points(points)) => notes.push(format!(
            "{label}: {} of {samples} points are drawn, the first, lowest, highest and last of each column.",
            points.len()
        )),
        (Thinning::ByCount, shape) if !matches!(shape, Shape::Level(_)) => notes.push(format!(
            "{label}: {} does not increase throughout; of each group of consecutive samples the first, \
             lowest, highest and last are drawn, of {samples} in all.",
            name(&panel.x.label, "x")
        )),
        _ => {}
    }
    notes
}

/// Series that leave a fixed range. Extremes are never thinned out, so that this is exact.
fn off_axis(place: &PanelPlace<'_>) -> Vec<String> {
    let (Some(x), Some(y)) = (place.x, place.y) else { return Vec::new() };
    let mut notes = Vec::new();
    for series in &place.panel.series {
        let label = name(series.label(), "A series");
        if let Some((low, high)) = span(extent(series, place.panel).map(|p| p[0]))
            && leaves(x, low, high)
        {
            notes.push(format!(
                "{label}: {} continues outside of the axis, {}.",
                name(&place.panel.x.label, "x"),
                from_to(&place.panel.x.unit, low, high)
            ));
        }
        let shown = extent(series, place.panel).filter(|p| (0.0..=1.0).contains(&x.position(p[0])));
        let level = match series.shape() {
            Shape::Level(level) => Some(*level),
            _ => None,
        };
        // What is not positive has its own note on a logarithmic axis.
        let values = shown
            .flat_map(|p| [p[1], p[2]])
            .chain(level)
            .filter(|v| is_drawable(*v) && (y.scale == AxisScale::Linear || *v >= SMALLEST));
        if let Some((low, high)) = span(values)
            && leaves(y, low, high)
        {
            notes.push(format!(
                "{label} leaves the axis: it goes {}.",
                from_to(&place.panel.y.unit, low, high)
            ));
        }
    }
    notes
}

/// A hair of slack: ranges around the data touch their ends.
fn leaves(range: Range, low: f64, high: f64) -> bool {
    range.position(low) < -1e-9 || range.position(high) > 1.0 + 1e-9
}

fn span(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |span, v| {
        let (low, high) = span.unwrap_or((v, v));
        Some((v.min(low), v.max(high)))
    })
}

fn from_to(unit: &str, low: f64, high: f64) -> String {
    format!("from {} to {}", quantity(low, unit), quantity(high, unit))
}

/// A value with four digits and its unit.
pub(crate) fn quantity(value: f64, unit: &str) -> String {
    let mut prefix = prefixed(unit, value);
    if prefix.is_power {
        prefix = Prefixed::power(unit, value);
    }
    // Two divisions, because a power of ten beyond 308 does not exist.
    let half = prefix.exponent / 2;
    let shown = value / 10_f64.powi(half) / 10_f64.powi(prefix.exponent - half);
    let places = match shown.abs() {
        size if size < 10.0 => 3,
        size if size < 100.0 => 2,
        size if size < 1000.0 => 1,
        _ => 0,
    };
    let number = format!("{shown:.places$}").replace('-', "−");
    let number =
        if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
    format!("{number}{}{}", prefix.joint(), prefix.unit).trim_end().to_owned()
}

fn name<'a>(label: &'a str, otherwise: &'a str) -> &'a str {
    if label.trim().is_empty() { otherwise } else { label.trim() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_short() {
        for (value, unit, text) in [
            (0.0243, "s", "24.3 ms"),
            (-3.2, "V", "−3.2 V"),
            (0.0, "V", "0 V"),
            (15_703.2, "Hz", "15.7 kHz"),
            (1e-9, "V^2", "1 · 10⁻⁹ V²"),
            (0.5, "1", "0.5"),
            (1e-300, "V", "1 · 10⁻³⁰⁰ V"),
            (699.6e-12, "", "6.996 · 10⁻¹⁰"),
        ] {
            assert_eq!(quantity(value, unit), text);
        }
    }
}

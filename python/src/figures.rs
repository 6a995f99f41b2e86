//! Figures as files, and as data for a program that draws them itself.

use kalmems::figures::{Axis, AxisScale, Figure, MapGrid, Panel, Series, SeriesStyle, Shape};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde_json::{Value, json};

/// Figures as JSON: panels with axes and series, each series with the points that a picture of it shows.
pub fn as_json<'a>(figures: impl IntoIterator<Item = &'a Figure>) -> String {
    let of = |figure: &Figure| {
        let panels: Vec<Value> = figure.panels.iter().map(panel).collect();
        json!({ "id": figure.id, "title": figure.title, "caption": figure.caption, "panels": panels })
    };
    Value::Array(figures.into_iter().map(of).collect()).to_string()
}

fn panel(panel: &Panel) -> Value {
    let series: Vec<Value> = panel.series.iter().zip(panel.styles()).map(series).collect();
    json!({ "x": axis(&panel.x), "y": axis(&panel.y), "shares_x": panel.shares_x, "series": series })
}

fn axis(axis: &Axis) -> Value {
    json!({
        "label": axis.label,
        "unit": axis.unit,
        "is_logarithmic": axis.scale == AxisScale::Log,
        "range": axis.range,
    })
}

fn series((series, style): (&Series, SeriesStyle)) -> Value {
    let (kind, data) = match series.shape() {
        Shape::Line(runs) => ("line", json!(runs)),
        Shape::Points(points) => ("points", json!(points)),
        Shape::Band(runs) => ("band", json!(runs)),
        Shape::Level(y) => ("level", json!(y)),
        Shape::Map(grid) => ("map", map(grid)),
    };
    json!({
        "label": series.label(),
        "kind": kind,
        "data": data,
        "colour": style.colour,
        "width": style.width,
        "is_dashed": style.is_dashed,
        "layer": style.layer,
    })
}

/// A value that is not finite becomes `null`.
fn map(grid: &MapGrid) -> Value {
    json!({ "x": grid.x, "y": grid.y, "values": grid.values, "colours": axis(&grid.colours), "level": grid.level })
}

/// Pictures by their names, as SVG.
pub fn pictures<'py>(py: Python<'py>, figures: &[Figure]) -> PyResult<Bound<'py, PyDict>> {
    let files = PyDict::new(py);
    for figure in figures {
        figure.files(|name, content| {
            files.set_item(name.trim_start_matches("figures/"), PyBytes::new(py, content))
        })?;
    }
    Ok(files)
}

//! What an estimated motion is for: images, spectra, and the calibration of a gyroscope, each as its file describes it.

use crate::errors::{Raise, failed};
use crate::figures::pictures;
use crate::watch::done;
use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::{
    CalibrationSummary, GyroscopeCalibration, calibrate as calibrated, calibration_figures,
};
use kalmems::applications::image::{DevelopedImage, Image, ImageMetrics, reconstruct};
use kalmems::applications::spectrum::{SpectrumFile, SpectrumMetrics, measure};
use kalmems::rigs::published;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use std::path::PathBuf;

fn json(py: Python<'_>, value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| failed(py, &error))
}

/// Calibrates a gyroscope: the figures as JSON, as text, and the pictures.
#[pyfunction]
#[pyo3(signature = (path, progress: "_Progress" = None) -> "tuple[str, str, dict[str, bytes]]")]
pub fn calibrate(
    py: Python<'_>,
    path: PathBuf,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, Bound<'_, PyDict>)> {
    let file = GyroscopeCalibration::load(&path).map_err(|error| error.raise(py))?;
    let found =
        done(py, progress, move |watch| calibrated(&file, watch))?.map_err(|error| failed(py, &error))?;
    let summary = CalibrationSummary::of(&found);
    Ok((json(py, &summary)?, summary.to_text(), pictures(py, &calibration_figures(&found))?))
}

/// Grey values, row after row from the top.
type Grey<'py> = Bound<'py, PyArray2<f64>>;

/// Puts an image together: the figures as JSON, as text, and the image.
#[pyfunction]
#[pyo3(signature = (path, progress: "_Progress" = None) -> "tuple[str, str, _Numbers]")]
pub fn image(
    py: Python<'_>,
    path: PathBuf,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, Grey<'_>)> {
    let file = Image::load(&path).map_err(|error| error.raise(py))?;
    let outcome =
        done(py, progress, move |watch| reconstruct(&file, watch))?.map_err(|error| failed(py, &error))?;
    let developed = DevelopedImage::of(&outcome);
    let metrics = ImageMetrics::of(&outcome, &developed, None).map_err(|error| failed(py, &error))?;
    let [columns, rows] = developed.picture.size();
    let picture = PyArray1::from_slice(py, developed.picture.values()).reshape([rows, columns])?;
    Ok((json(py, &metrics)?, metrics.to_text(), picture))
}

/// An array of numbers.
type Numbers<'py> = Bound<'py, PyArray1<f64>>;

/// Computes a spectrum: the figures as JSON, as text, the wavenumbers in 1/m, the spectrum and its standard error.
#[pyfunction]
#[pyo3(signature = (path, progress: "_Progress" = None) -> "tuple[str, str, _Numbers, _Numbers, _Numbers | None]")]
#[allow(clippy::type_complexity)] // a tuple for one caller
pub fn spectrum(
    py: Python<'_>,
    path: PathBuf,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, Numbers<'_>, Numbers<'_>, Option<Numbers<'_>>)> {
    let file = SpectrumFile::load(&path).map_err(|error| error.raise(py))?;
    let outcome = done(py, progress, move |watch| measure(published(), &file, watch))?
        .map_err(|error| failed(py, &error))?;
    let metrics = SpectrumMetrics::of(&outcome);
    let grid = outcome.processed.scans.grid;
    let wavenumbers: Vec<f64> =
        (0..outcome.spectrum.len()).map(|k| grid.first_per_m + k as f64 * grid.step_per_m).collect();
    Ok((
        json(py, &metrics)?,
        metrics.to_text(),
        PyArray1::from_vec(py, wavenumbers),
        PyArray1::from_slice(py, &outcome.spectrum),
        outcome.standard_error.as_ref().map(|sd| PyArray1::from_slice(py, sd)),
    ))
}

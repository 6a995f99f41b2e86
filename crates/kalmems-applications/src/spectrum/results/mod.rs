//! The files of a spectrum.

mod figures;
mod jcamp;
mod metrics;
mod page;

pub use figures::spectrum_figures;
pub use jcamp::{JcampSpectrum, write_jcamp};
pub use metrics::{
    ContributionMetrics, CorrectionMetrics, LineMetrics, SpectrumMetrics, SpectrumReferenceMetrics,
};
pub use page::spectrum_page;

use crate::WriteError;
use crate::recording::RecordingSource;
use crate::spectrum::SpectrumOutcome;
use kalmems_store::{Output, RunInfo, RunTiming};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{self, Write};

/// Writes a spectrum into a result.
///
/// `report.html`, `spectrum.csv` with its standard error, `scans.csv`, `spectrum.jdx` (JCAMP-DX), `metrics.json`, pictures in `figures/`,
/// `run.toml`; `interferogram.csv` of a simulated detector.
pub fn write_spectrum(
    outcome: &SpectrumOutcome,
    metrics: &SpectrumMetrics,
    output: &Output,
    info: RunInfo,
) -> Result<(), WriteError> {
    let input_id = input_id(outcome);
    output.write("spectrum.csv", |w| spectrum_csv(outcome, w))?;
    output.write("scans.csv", |w| scans_csv(outcome, w))?;
    let grid = outcome.processed.scans.grid;
    let jcamp = JcampSpectrum {
        title: &metrics.name,
        first_per_cm: grid.first_per_m / 100.0,
        step_per_cm: grid.step_per_m / 100.0,
        resolution_per_cm: metrics::resolution_per_cm(outcome),
        values: &outcome.spectrum,
    };
    output.write("spectrum.jdx", |w| write_jcamp(&jcamp, w))?;
    output.write("metrics.json", |w| {
        serde_json::to_writer_pretty(&mut *w, metrics)?;
        writeln!(w)
    })?;
    let figures = spectrum_figures(outcome);
    let html = spectrum_page(outcome, metrics, &figures)?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    for figure in &figures {
        figure.files(|name, content| output.write(name, |w| w.write_all(content)))?;
    }
    if let Some(detector) = &outcome.simulated {
        output.write("interferogram.csv", |w| {
            writeln!(w, "time_s,detector_1")?;
            for (time, value) in detector.time_s.iter().zip(&detector.value) {
                writeln!(w, "{time},{value}")?;
            }
            Ok(())
        })?;
    }
    output.write_run(&input_id, || {
        Ok(SpectrumRunRecord {
            timing: info.timing(),
            input: &outcome.sources,
            spectrum: toml::Value::try_from(&outcome.file).map_err(io::Error::other)?,
        })
    })?;
    Ok(())
}

fn spectrum_csv(outcome: &SpectrumOutcome, w: &mut dyn Write) -> io::Result<()> {
    let columns =
        [("spectrum_sd_1", &outcome.standard_error), ("spectrum_systematic_sd_1", &outcome.systematic_error)];
    let columns: Vec<(&str, &Vec<f64>)> =
        columns.into_iter().filter_map(|(name, values)| Some((name, values.as_ref()?))).collect();
    let names: String = columns.iter().flat_map(|(name, _)| [",", name]).collect();
    writeln!(w, "wavenumber_per_m,spectrum_1{names}")?;
    let grid = outcome.processed.scans.grid;
    for (index, value) in outcome.spectrum.iter().enumerate() {
        write!(w, "{},{value:e}", grid.wavenumber(index))?;
        for (_, errors) in &columns {
            write!(w, ",{:e}", errors[index])?;
        }
        writeln!(w)?;
    }
    Ok(())
}

fn scans_csv(outcome: &SpectrumOutcome, w: &mut dyn Write) -> io::Result<()> {
    writeln!(w, "scan,forward,zero_path_m")?;
    for (index, forward) in outcome.processed.scans.forward.iter().enumerate() {
        write!(w, "{},{},", index + 1, u8::from(*forward))?;
        match outcome.processed.misregistration_m.get(index) {
            Some(shift) => writeln!(w, "{shift:e}")?,
            None => writeln!(w)?,
        }
    }
    Ok(())
}

/// What tells one input from another: the file's name and the bytes of all files that it names.
fn input_id(outcome: &SpectrumOutcome) -> String {
    let mut hash = Sha256::new();
    for source in &outcome.sources {
        hash.update(&source.sha256);
    }
    let mut digest = String::new();
    for byte in hash.finalize().iter().take(6) {
        let _ = write!(digest, "{byte:02x}");
    }
    format!("{}: spectrum of {digest}", outcome.file.name)
}

#[derive(Serialize)]
struct SpectrumRunRecord<'a> {
    timing: RunTiming,
    input: &'a [RecordingSource],
    spectrum: toml::Value,
}

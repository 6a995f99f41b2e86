//! A light seen along a sinusoid, in files of a temporary folder.

#![allow(dead_code)] // each test uses its part

use kalmems::applications::ApplicationFile;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::applications::spectrum::{SpectrumError, SpectrumOutcome, measure};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

/// One after the other, each with its name.
pub fn write_columns(path: &Path, columns: &[(&str, &Vec<f64>)]) {
    let mut text = columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(",");
    text += "\n";
    for row in 0..columns[0].1.len() {
        let cells: Vec<String> = columns.iter().map(|(_, values)| values[row].to_string()).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

/// A line at 2000 per cm and a band at 1960, 0.5 mm at 500 Hz about 1 mm.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    pub scans: u32,
    pub noise: f64,
    pub rate_hz: f64,
    /// How much later than the motion the detector is.
    pub late_s: f64,
    pub skew: f64,
    pub low_pass_hz: Option<f64>,
}

impl Default for Scene {
    fn default() -> Self {
        Self { scans: 10, noise: 0.0, rate_hz: 2e6, late_s: 0.0, skew: 0.0, low_pass_hz: None }
    }
}

impl Scene {
    /// The true position in m.
    pub fn position(t: f64) -> f64 {
        1e-3 + 0.5e-3 * (TAU * 500.0 * t + 0.7).cos()
    }

    /// The spectrum where positions are taken as true plus an error; `more` goes into `[transform]`. `#told` tells of the
    /// delay, `#power` takes magnitudes, and `#delay_sd` puts the delay into the budget.
    pub fn measure(&self, error: &dyn Fn(f64) -> f64, more: &str) -> SpectrumOutcome {
        self.try_measure(error, &|text| text.replace("#more", more)).unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn try_measure(
        &self,
        error: &dyn Fn(f64) -> f64,
        change: &dyn Fn(String) -> String,
    ) -> Result<SpectrumOutcome, SpectrumError> {
        let folder = tempfile::tempdir().unwrap();
        let Self { scans, noise, rate_hz, late_s, skew, low_pass_hz } = self;
        let rows = 40 * (scans + 3);
        let time: Vec<f64> = (0..rows).map(|k| f64::from(k) / 40e3).collect();
        let truth: Vec<f64> = time.iter().map(|t| Self::position(*t)).collect();
        let taken: Vec<f64> = time.iter().map(|t| Self::position(*t) + error(*t)).collect();
        write_columns(&folder.path().join("truth.csv"), &[("time_s", &time), ("position_m", &truth)]);
        write_columns(&folder.path().join("path.csv"), &[("time_s", &time), ("position_m", &taken)]);
        let low_pass = low_pass_hz.map_or_else(String::new, |hz| format!("low_pass = \"{hz} Hz\""));
        // From the first turning point on.
        let duration = f64::from(*scans) * 1e-3;
        let text = format!(
            r#"
name = "scene"
[light]
zero_path = "1 mm"
rate = "{rate_hz} Hz"
noise = {noise}
clock_skew = {skew:e}
start = "0.777183 ms"
bursts = {{ duration = "{duration} s", period = "1 s", count = 1 }}
sources = [
    {{ wavenumber = "2000 1/cm", height = 1 }},
    {{ wavenumber = "1960 1/cm", width = "20 1/cm", height = 2 }},
]
{low_pass}
[light.trajectory]
file = "truth.csv"
clock = {{ column = "time_s" }}
column = "position_m"
delay = "{late_s:e} s"
[path.trajectory]
file = "path.csv"
clock = {{ column = "time_s" }}
column = "position_m"
#path
[transform]
apodisation = "norton_beer_medium"
phase = "none"
largest_path_difference = "0.95 mm"
band = {{ from = "1700 1/cm", to = "2300 1/cm" }}
zero_filling = 8
#more
[[line]]
wavenumber = "2000 1/cm"
within = "4 1/cm"
#errors
"#
        );
        let mut text = change(text);
        if text.contains("#told") {
            text = text.replace("#path", &format!("delay = \"{late_s:e} s\""));
        }
        if text.contains("#power") {
            text = text.replace("phase = \"none\"", "phase = \"power\"");
        }
        if text.contains("#delay_sd") {
            text = text.replace("#errors", &format!("[errors]\ndelay_sd = \"{late_s:e} s\"\n"));
        }
        let file = SpectrumFile::parse(&text, &folder.path().join("scene.toml"))?;
        measure(published(), &file, &Silent)
    }
}

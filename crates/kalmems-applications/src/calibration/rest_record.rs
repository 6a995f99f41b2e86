//! The record at rest of a calibration file: read, divided at its gaps, and looked at for motion.

use super::error::CalibrationError;
use super::files::InputFiles;
use super::motion::{RestMotion, motions};
use super::rest::{AxisAtRest, InertialSensor, finite_runs};
use super::rest_spectrum::{RestLine, RestSpectrum};
use super::tone::AXES;
use super::unit_record::UnitSamples;
use crate::config::Key;

/// What the record at rest shows.
#[derive(Default)]
pub(super) struct MeasuredRest {
    pub axes: Vec<AxisAtRest>,
    /// Motions in it, in sentences: it is none at rest.
    pub motions: Vec<String>,
    /// What else its reader has to know, in sentences.
    pub remarks: Vec<String>,
}

pub(super) fn measure(files: &mut InputFiles) -> Result<MeasuredRest, CalibrationError> {
    let file = files.file;
    let Some(record) = &file.rest else { return Ok(MeasuredRest::default()) };
    let record = record.of_unit(&file.gyroscope);
    let mut samples = record.read(files, Key::from("rest").child("file"))?;
    let mut found = MeasuredRest { remarks: std::mem::take(&mut samples.remarks), ..MeasuredRest::default() };
    for (sensor, channels, all) in [
        (InertialSensor::Gyroscope, record.channels, samples.rates()),
        (InertialSensor::Accelerometer, record.accelerometers, samples.forces()),
    ] {
        for (axis, values) in AXES.into_iter().zip(all) {
            let Some((values, column)) = values.zip(channels.and_then(|c| c.column(axis))) else {
                continue;
            };
            let place = format!("{}, column `{column}`", samples.place);
            found.measure(&samples, (sensor, axis), values, &place)?;
        }
    }
    Ok(found)
}

impl MeasuredRest {
    fn measure(
        &mut self,
        samples: &UnitSamples,
        (sensor, axis): (InertialSensor, &'static str),
        values: &[f64],
        place: &str,
    ) -> Result<(), CalibrationError> {
        let (time, remarks) = (&samples.time, &mut self.remarks);
        let whole = time.rows.iter().map(|rows| values.get(rows.clone()).unwrap_or_default());
        let runs: Vec<&[f64]> = whole.flat_map(finite_runs).collect();
        let count = runs.iter().map(|run| run.len()).sum();
        let found = AxisAtRest::of_stretches(axis, &runs, time.interval_s);
        let found =
            found.ok_or_else(|| CalibrationError::Rest { place: place.to_owned(), samples: count })?;
        let found = AxisAtRest { sensor, ..found };
        if runs.len() > 1 {
            let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0) as f64 * time.interval_s;
            remarks.push(format!(
                "{place}: at rest it is in {} stretches, as samples or their numbers are missing between them; the longest lasts {longest:.4} s. \
                 No difference is taken across a gap, so that averaging times beyond half of that are not known.",
                runs.len()
            ));
        }
        let all_finite = values.iter().enumerate().filter(|(_, value)| value.is_finite());
        let rows: Vec<usize> = all_finite.map(|(row, _)| row).collect();
        let spectrum = runs.iter().max_by_key(|run| run.len()).and_then(|longest| RestSpectrum::of(longest));
        let lines = spectrum.iter().flat_map(RestSpectrum::lines);
        let found = AxisAtRest {
            density: spectrum.as_ref().map_or_else(Vec::new, |spectrum| spectrum.density(time.interval_s)),
            lines: lines.map(|line| [line.frequency / time.interval_s, line.amplitude]).collect(),
            ..found
        };
        for motion in motions(&runs, spectrum.as_ref()) {
            let said = describe(&motion, samples, &rows, sensor.unit());
            self.motions.push(format!("{place}: the record is called one at rest, and {said}"));
        }
        if let Some(why) = &found.not_fitted {
            remarks.push(format!("{place}: {why}."));
        }
        if let Some(fit) = found.noise_fit.filter(|fit| fit.left_out > 0) {
            remarks.push(format!(
                "{place}: the fit of the noise begins at an averaging time of {:.4} s: at shorter ones the deviations are not those of \
                 quantisation, white noise behind a low pass of first order, flicker and a random walk.",
                fit.from_s
            ));
        }
        if let Some(drift) = found.drift {
            remarks.push(format!(
                "{place}: the second half of the record lies {drift:+.3e} {} from the first, more than white noise and flicker explain: the bias drifts, \
                 as it does while a unit warms up. The fitted random walk holds for this record and not for a unit in thermal equilibrium.",
                sensor.unit()
            ));
        }
        self.axes.push(found);
        Ok(())
    }
}

fn describe(motion: &RestMotion, samples: &UnitSamples, rows: &[usize], unit: &str) -> String {
    let time = |sample: usize| {
        samples.time_s(rows.get(sample.min(rows.len().saturating_sub(1))).copied().unwrap_or(0))
    };
    match motion {
        RestMotion::Passing { samples, times } => format!(
            "between {:.6} s and {:.6} s it moves: the standard deviation there is up to {times:.1} times the usual (noise alone \
             shows that in less than one record of 1000). Leave that time out: bias, noise and deviations are not those of rest.",
            time(samples.start),
            time(samples.end.saturating_sub(1)),
        ),
        RestMotion::Line(RestLine { frequency, amplitude }) => format!(
            "a line of {amplitude:.3e} {unit} at {:.6} Hz stands out of its noise (noise alone shows one in less than one record \
             of 1000): it vibrates, or something interferes. The deviations at times about half a cycle of it are not those of \
             rest.",
            frequency / samples.time.interval_s
        ),
    }
}

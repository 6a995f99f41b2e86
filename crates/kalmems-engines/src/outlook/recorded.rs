//! What the beginning of an experiment's recording shows, where the experiment itself does not say it.

use crate::config::{Clock, Experiment, Quantity};
use crate::recording::{StretchSize, Stretches};
use crate::signal::fit_sine;
use crate::simulate::Drive;
use std::f64::consts::FRAC_PI_2;
use std::ops::ControlFlow;

/// Rows that are looked at.
const ROWS: usize = 4096;

/// Rate and drive of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recorded {
    /// Samples per second.
    pub rate_hz: Option<f64>,
    /// The drive, where it is a steady sine.
    pub drive: Option<Drive>,
    /// The file, by its name.
    pub file: String,
}

impl Recorded {
    /// Of the first recording that shows a rate; of one whose file cannot be read, the stated rate alone. Nothing is refused
    /// here: what is wrong with a recording, the command that needs it says.
    pub fn of(experiment: &Experiment) -> Self {
        Self::of_input(experiment, "drive")
    }

    /// The same, where the channel of this meaning is taken for the drive.
    pub fn of_input(experiment: &Experiment, input: &str) -> Self {
        let all = (0..experiment.recordings.len()).map(|index| Self::of_one(experiment, (index, input)));
        all.into_iter().flatten().find(|recorded| recorded.rate_hz.is_some()).unwrap_or_default()
    }

    fn of_one(experiment: &Experiment, (index, input): (usize, &str)) -> Option<Self> {
        let described = experiment.recordings.get(index)?;
        let stated = match &described.clock {
            Clock::Rate { rate, .. } => Some(rate.si()),
            Clock::Column(times) => times.rate.as_ref().map(Quantity::si),
        };
        let file = described.file.file_name()?.to_string_lossy().into_owned();
        let drive_column = described.channels.column(input);
        if stated.is_some() && drive_column.is_none() {
            return Some(Self { rate_hz: stated, drive: None, file });
        }
        let path = experiment.resolve(&described.file);
        // A pipe would be without its beginning afterwards.
        let beginning = experiment.can_be_read(&described.file).then(|| {
            let columns: Vec<&str> = drive_column.into_iter().collect();
            let around = StretchSize { rows: ROWS, first: ROWS, before: 0, after: 0 };
            let mut stretches = Stretches::open(&path, &described.layout(&columns), around).ok()?;
            stretches.next(&mut |_, _| ControlFlow::Continue(())).ok()?
        });
        let Some(stretch) = beginning.flatten() else {
            return Some(Self { rate_hz: stated, drive: None, file });
        };
        let recording = &stretch.recording;
        let segment = recording.segments().first()?;
        let interval_s = segment.time.interval_s();
        let drive = drive_column.zip(interval_s).and_then(|(column, interval_s)| {
            let values = recording.column(column).ok()?.of(segment);
            let sine = fit_sine(&segment.time.to_vec(), values, interval_s)?;
            sine.is_steady().then_some(Drive::Sine {
                offset: sine.offset,
                amplitude: sine.amplitude,
                frequency_hz: sine.frequency_hz,
                // The fit is a cosine.
                phase_rad: sine.phase_rad + FRAC_PI_2,
            })
        });
        Some(Self { rate_hz: stated.or(interval_s.map(f64::recip)), drive, file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;
    use std::fmt::Write as _;

    #[test]
    fn rate_and_drive_are_those_of_the_recording() {
        let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/shared_scanner/experiment.toml");
        let text = std::fs::read_to_string(example).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mut rows = "time_us,drive_V,cap_V\n".to_owned();
        for k in 0..20_000 {
            let volts = 30.0 + 12.5 * (TAU * 31_350.0 * f64::from(k) * 2e-6 + 0.4).sin();
            writeln!(rows, "{},{volts:.6},0.1", 2 * k).unwrap();
        }
        std::fs::write(folder.path().join("recording.csv"), rows).unwrap();
        let text = text.replace("\"time_s\"", "\"time_us\"");
        let experiment = Experiment::parse(&text, &folder.path().join("experiment.toml")).unwrap();
        let found = Recorded::of(&experiment);
        assert!((found.rate_hz.unwrap() / 500e3 - 1.0).abs() < 1e-9, "{found:?}");
        let Some(Drive::Sine { offset, amplitude, frequency_hz, phase_rad }) = found.drive else {
            panic!("{found:?}")
        };
        assert!((offset - 30.0).abs() < 1e-4 && (amplitude - 12.5).abs() < 1e-4, "{offset} {amplitude}");
        assert!((frequency_hz - 31_350.0).abs() < 1e-2, "{frequency_hz}");
        assert!(((phase_rad - 0.4) / TAU).fract().abs() < 1e-4, "{phase_rad}");
        // Without the file nothing is known.
        std::fs::remove_file(folder.path().join("recording.csv")).unwrap();
        assert_eq!(Recorded::of(&experiment).rate_hz, None);
    }
}

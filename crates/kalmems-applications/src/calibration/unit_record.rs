//! Reading a file of the unit: its channels, divided at the gaps.

use super::error::CalibrationError;
use super::files::{InputFiles, require_usable, require_within};
use super::still::{StillChannel, still_parts};
use super::stretches::{RecordStretches, stretches};
use super::tone::AXES;
use crate::calibration::file::InertialUnit;
use crate::config::{Channels, Clock, ColumnChoice, FileColumns, FileFormat, Key, Segments};
use crate::recording::{Finding, FindingKind, RecordingLayout, SampledRecording};
use crate::units::{Kind, kind};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole, pairs};
use std::ops::Range;
use std::path::Path;

/// How a file of the unit is written, and which of its columns are read.
#[derive(Clone, Debug)]
pub struct RecordOfUnit<'a> {
    /// The file as the calibration file names it.
    pub file: &'a Path,
    /// How it is written.
    pub format: Option<&'a FileFormat>,
    /// The column that divides it.
    pub segments: Option<&'a Segments>,
    /// By the nominal rate if left out.
    pub clock: Option<&'a Clock>,
    /// The gyroscopes' columns by axis.
    pub channels: Option<&'a Channels>,
    /// The accelerometers' columns by axis.
    pub accelerometers: Option<&'a Channels>,
    /// A further column with its key and kind: the rate of a table, a temperature.
    pub further: Option<(&'a str, &'a ColumnChoice, &'static Kind)>,
}

/// The samples of such a file.
pub(super) struct UnitSamples {
    /// The file, for messages.
    pub place: String,
    pub recording: SampledRecording,
    pub time: RecordTime,
    /// The columns of the gyroscopes and of the accelerometers, axis by axis, and the further one.
    rates: [Option<String>; 3],
    forces: [Option<String>; 3],
    further: Option<String>,
    /// What a reader has to know of the times, in sentences.
    pub remarks: Vec<String>,
}

impl<'a> RecordOfUnit<'a> {
    /// The columns of the file, with a clock that is the unit's own if none is stated.
    pub fn in_file(&'a self, clock: &'a Clock) -> FileColumns<'a> {
        let channels = [self.channels, self.accelerometers];
        let mut all: Vec<_> = channels.into_iter().flatten().flat_map(Channels::in_file).collect();
        all.extend(self.further.map(|(key, column, _)| (key, column, None)));
        FileColumns::new(self.format, clock, all).divided_by(self.segments)
    }

    pub(super) fn layout(&self, unit: &InertialUnit) -> RecordingLayout {
        let clock = self.clock.cloned().unwrap_or_else(|| unit.clock());
        self.in_file(&clock).layout(None)
    }

    /// Reads the file that stands at this key.
    pub(super) fn read(&self, files: &mut InputFiles, key: Key) -> Result<UnitSamples, CalibrationError> {
        let unit = &files.file.gyroscope;
        let path = files.file.resolve(self.file, "");
        let recording = files.read(key, &path, &self.layout(unit))?;
        if let Some((_, column, _)) = self.further {
            // A set value stays where it was set.
            let is_set = |finding: &Finding| {
                finding.column.as_deref() == Some(column.name())
                    && matches!(finding.kind, FindingKind::Saturation | FindingKind::Stuck)
            };
            files.named.findings.retain(|(_, finding)| !is_set(finding));
        }
        let mut remarks = Vec::new();
        let time = RecordTime::of(&recording, unit, self.clock, &mut remarks);
        let axes = |channels: Option<&Channels>, kind: &Kind| -> Result<_, CalibrationError> {
            let mut axes = [None, None, None];
            for (axis, slot) in AXES.iter().zip(&mut axes) {
                if let Some(column) = channels.and_then(|channels| channels.column(axis)) {
                    recording.column_of(column, kind)?;
                    *slot = Some(column.to_owned());
                }
            }
            Ok(axes)
        };
        let rates = axes(self.channels, &kind::ANGULAR_RATE)?;
        let further = match self.further {
            Some((_, column, kind)) => {
                recording.column_of(column.name(), kind)?;
                Some(column.name().to_owned())
            }
            None => None,
        };
        let samples = UnitSamples {
            place: path.display().to_string(),
            rates,
            forces: axes(self.accelerometers, &kind::ACCELERATION)?,
            further,
            recording,
            time,
            remarks,
        };
        let checked = samples.check(unit);
        if checked.is_err() {
            files.parts.push(samples.figure_of_refused());
        }
        checked.map(|()| samples)
    }
}

impl UnitSamples {
    /// Refuses a record in which a sensor is at the end of its range, or is another channel.
    fn check(&self, unit: &InertialUnit) -> Result<(), CalibrationError> {
        let used: Vec<&str> = self.rates.iter().chain(&self.forces).flatten().map(String::as_str).collect();
        for segment in self.recording.segments() {
            require_usable(&self.recording, segment, &used)?;
        }
        for column in self.rates.iter().flatten() {
            let values = &self.recording.column(column)?.values;
            require_within(unit, values, (&self.recording.source().file, column))?;
        }
        Ok(())
    }

    /// The sensors of a record that is refused, with the parts in which they are still for a second or longer.
    fn figure_of_refused(&self) -> Figure {
        let each = [
            (self.rates(), true, Axis::new("rate", "deg/s"), 1.0_f64.to_degrees()),
            (self.forces(), false, Axis::new("specific force", "m/s^2"), 1.0),
        ];
        let columns: Vec<(&[f64], bool)> = each
            .iter()
            .flat_map(|(all, is_rate, ..)| all.iter().flatten().map(|values| (*values, *is_rate)))
            .collect();
        let parts = self.still_parts(1.0, &columns).concat();
        let there = each.into_iter().filter(|(all, ..)| all.iter().any(Option::is_some));
        let panels = there.map(|(all, _, axis, factor)| {
            let shown = AXES.into_iter().zip(all).filter_map(|(axis, values)| {
                Some((axis, values?.iter().map(|value| factor * value).collect()))
            });
            self.panel_of_parts(axis, shown, "taken as still", parts.iter().map(|rows| (rows.clone(), 0.0)))
        });
        let caption = "The sensors of the record that was refused, with the parts that were taken as still.";
        panels.fold(Figure::new("refused", self.place.clone(), caption), Figure::with)
    }

    fn values(&self, column: Option<&String>) -> Option<&[f64]> {
        Some(&self.recording.column(column?).ok()?.values)
    }

    /// The parts of each stretch between gaps in which the columns are still for at least this long, in s. Each column with whether it is a rate, of which
    /// a constant one is no rest.
    pub fn still_parts(&self, shortest_s: f64, columns: &[(&[f64], bool)]) -> Vec<Vec<Range<usize>>> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let shortest = (shortest_s / self.time.interval_s).ceil().max(2.0) as usize;
        let of = |stretch: &Range<usize>| {
            let of_column = columns.iter().map(|(values, is_rate)| StillChannel {
                values: values.get(stretch.clone()).unwrap_or_default(),
                is_rate: *is_rate,
            });
            let parts = still_parts(&of_column.collect::<Vec<_>>(), shortest).into_iter();
            parts.map(|part| stretch.start + part.start..stretch.start + part.end).collect()
        };
        self.time.rows.iter().map(of).collect()
    }

    /// The gyroscopes' rates in rad/s of all rows, axis by axis.
    pub fn rates(&self) -> [Option<&[f64]>; 3] {
        self.rates.each_ref().map(|column| self.values(column.as_ref()))
    }

    /// The accelerometers' specific forces in m/s².
    pub fn forces(&self) -> [Option<&[f64]>; 3] {
        self.forces.each_ref().map(|column| self.values(column.as_ref()))
    }

    /// The further column in SI.
    pub fn further(&self) -> &[f64] {
        self.values(self.further.as_ref()).unwrap_or_default()
    }

    /// Columns over the time, and below them the parts that were taken of them, each at a level.
    pub fn panel_of_parts(
        &self,
        axis: Axis,
        columns: impl IntoIterator<Item = (&'static str, Vec<f64>)>,
        label: &str,
        parts: impl IntoIterator<Item = (Range<usize>, f64)>,
    ) -> Panel {
        let time: Vec<f64> = (0..self.recording.rows()).map(|row| self.time_s(row)).collect();
        let mut panel = Panel::new(Axis::new("time", "s"), axis);
        for (name, values) in columns {
            let line = pairs(&time, &values).collect::<Vec<_>>();
            panel = panel.with(Series::line(name, SeriesRole::Measured, line));
        }
        for (place, (rows, level)) in parts.into_iter().enumerate() {
            let ends = [rows.start, rows.end.saturating_sub(1)].map(|row| (self.time_s(row), level));
            panel = panel.with(Series::line(if place == 0 { label } else { "" }, SeriesRole::Estimate, ends));
        }
        panel
    }

    /// The time of a row in s.
    pub fn time_s(&self, row: usize) -> f64 {
        let segment = self.recording.segments().iter().find(|segment| segment.rows.contains(&row));
        segment.map_or(f64::NAN, |segment| segment.time.at(row - segment.rows.start))
    }
}

/// The rows between gaps in time, and the interval of their samples in s.
pub(super) struct RecordTime {
    pub rows: Vec<Range<usize>>,
    pub interval_s: f64,
}

impl RecordTime {
    fn of(
        recording: &SampledRecording,
        unit: &InertialUnit,
        clock: Option<&Clock>,
        remarks: &mut Vec<String>,
    ) -> Self {
        let place = &recording.source().file;
        let mut rows = Vec::new();
        // By the number of samples, as the interval of a longer segment is known better.
        let (mut weight, mut sum) = (0.0, 0.0);
        for segment in recording.segments() {
            let start = segment.rows.start;
            let whole = || std::iter::once(0..segment.rows.len()).collect();
            let regular = segment.time.interval_s().filter(|_| segment.time.is_uniform());
            let (found, interval_s) = match regular {
                Some(interval_s) => (whole(), interval_s),
                None => match stretches(&segment.time.to_vec()) {
                    Some(found) => {
                        remarks.extend(irregular(place, &segment.label, &found));
                        (found.rows, found.interval_s)
                    }
                    None => (whole(), f64::NAN),
                },
            };
            rows.extend(found.into_iter().map(|rows| start + rows.start..start + rows.end));
            if interval_s.is_finite() {
                weight += segment.rows.len() as f64;
                sum += segment.rows.len() as f64 * interval_s;
            }
        }
        let interval_s = match recording.segments() {
            [one] if one.time.is_uniform() => one.time.interval_s().unwrap_or(f64::NAN),
            _ => sum / weight,
        };
        remarks.extend(off_nominal(place, interval_s, unit, clock));
        Self { rows, interval_s }
    }
}

/// What a reader has to know of times that are not equidistant.
pub(super) fn irregular(place: &str, segment: &str, found: &RecordStretches) -> Vec<String> {
    let of = if segment.is_empty() { String::new() } else { format!(", segment `{segment}`") };
    let mut said = Vec::new();
    if found.burst > 1 {
        said.push(format!(
            "{place}{of}: the times come in bursts of up to {} samples, as a host gives them; the samples count as equidistant, \
             {:.6} Hz over the whole. Where the rate is known, write `clock = {{ rate = \"…\" }}`.",
            found.burst,
            found.interval_s.recip()
        ));
    }
    if let Some([gap_s, before_s]) = found.longest_gap {
        let places = match found.rows.len() - 1 {
            1 => "one place".to_owned(),
            several => format!("{several} places"),
        };
        said.push(format!(
            "{place}{of}: samples are missing in {places}; the longest gap is one of {gap_s:.6} s after {before_s} s."
        ));
    }
    said
}

/// What a column of times shows beside the nominal rate.
pub(super) fn off_nominal(
    place: &str,
    interval_s: f64,
    unit: &InertialUnit,
    clock: Option<&Clock>,
) -> Option<String> {
    let Some(Clock::Column(_)) = clock else { return None };
    let (nominal, tolerance) = (unit.rate.si(), unit.clock_tolerance.as_ref()?.si());
    let off = interval_s.recip() / nominal - 1.0;
    // The rounding of a rate that is written with few digits is none of the clock.
    let is_off = off.abs() > tolerance + 1e-6;
    is_off.then(|| {
        format!(
            "{place}: its times show {:.6} Hz, {:+.3} % off the nominal rate of `{}`, and `clock_tolerance` is {:.3} %: the rate \
             of the times is used. If the unit gave its samples at another rate here, write `clock = {{ rate = \"…\" }}`; \
             otherwise correct `rate` or the tolerance.",
            interval_s.recip(),
            100.0 * off,
            unit.rate.text(),
            100.0 * tolerance
        )
    })
}

//! The records at rest of a calibration file: read in parts, divided at their gaps, and looked at for motion.

use super::earth::set_earth;
use super::error::CalibrationError;
use super::file::{InertialUnit, RestRecord, is_per_record};
use super::files::{InputFiles, columns, require_usable_record, require_within};
use super::motion::{PieceState, RestMotion, RestPieces};
use super::rest::{AxisAtRest, InertialSensor};
use super::rest_lines::RestLines;
use super::rest_samples::RestSamples;
use super::rest_spectrum::{RestLine, RestSpectrum};
use super::stretches::{MissingBefore, StretchFinder};
use super::tone::AXES;
use super::unit_record::{RecordOfUnit, irregular, off_nominal};
use crate::config::{Clock, Key};
use crate::estimate::EstimateError;
use crate::recording::{Finding, FindingKind, Stretch, StretchSize};
use crate::units::{Kind, kind};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

/// Rows that are read at a time, and rows around them among which the earliest times of bursts are looked for.
const PART: usize = 1 << 16;
const AROUND: usize = 1 << 10;

/// What the records at rest show.
#[derive(Default)]
pub(super) struct MeasuredRest {
    pub axes: Vec<AxisAtRest>,
    /// Motions in it, in sentences: it is none at rest.
    pub motions: Vec<String>,
    /// What else its reader has to know, in sentences.
    pub remarks: Vec<String>,
    /// The still and the moving parts of each channel.
    pub parts: Option<Figure>,
}

pub(super) fn measure(files: &mut InputFiles) -> Result<MeasuredRest, CalibrationError> {
    let file = files.file;
    let Some(rest) = &file.rest else { return Ok(MeasuredRest::default()) };
    let mut reading = RestReading::of(rest, rest.of_unit(&file.gyroscope));
    let read = reading.read_all(files, rest);
    let parts = reading.figure(rest);
    // Of a file that cannot be read there is nothing to look at.
    if reading.rows > 0.0 {
        files.parts.push(parts.clone());
    }
    read?;
    if rest.subtract_lines {
        let of = |channel: &RestChannel| {
            RestSpectrum::of(channel.samples.longest()).map_or_else(Vec::new, |found| found.lines())
        };
        let lines: Vec<RestLines> =
            reading.channels.iter().map(|channel| RestLines::of(of(channel))).collect();
        if lines.iter().any(|lines| !lines.is_empty()) {
            reading = RestReading::of(rest, rest.of_unit(&file.gyroscope));
            for (channel, lines) in reading.channels.iter_mut().zip(lines) {
                channel.samples.lines = lines;
            }
            reading.read_all(files, rest)?;
        }
    }
    let interval_s = reading.interval_sum_s / reading.rows;
    let mut found = MeasuredRest { remarks: reading.remarks, parts: Some(parts), ..MeasuredRest::default() };
    // One after the other, as each holds what the spectrum is taken of.
    for channel in reading.channels {
        found.measure(channel, interval_s)?;
    }
    set_earth(&mut found.axes, rest.latitude.as_ref().map(crate::config::Quantity::si));
    Ok(found)
}

/// A channel of the unit, and what was read of it.
struct RestChannel<'a> {
    sensor: InertialSensor,
    axis: &'static str,
    column: &'a str,
    place: String,
    samples: RestSamples,
}

/// The files of records at rest while they are read.
struct RestReading<'a> {
    record: RecordOfUnit<'a>,
    channels: Vec<RestChannel<'a>>,
    /// The stretches of the present record by its times, and its name.
    finder: Option<StretchFinder>,
    labels: Vec<String>,
    /// Samples of the present record, missing ones included.
    place: f64,
    /// The interval of the samples in s, summed up over the rows, as that of a longer record is known better.
    interval_sum_s: f64,
    rows: f64,
    remarks: Vec<String>,
}

impl<'a> RestReading<'a> {
    fn of(rest: &RestRecord, record: RecordOfUnit<'a>) -> Self {
        let each = [
            (InertialSensor::Gyroscope, record.channels),
            (InertialSensor::Accelerometer, record.accelerometers),
        ];
        let channels = each.into_iter().flat_map(|(sensor, channels)| {
            let found = AXES.into_iter().filter_map(move |axis| Some((axis, channels?.column(axis)?)));
            found.map(move |(axis, column)| {
                let place = format!("{}, column `{column}`", rest.file.display());
                RestChannel { sensor, axis, column, place, samples: RestSamples::default() }
            })
        });
        Self {
            channels: channels.collect(),
            record,
            finder: None,
            labels: Vec::new(),
            place: 0.0,
            interval_sum_s: 0.0,
            rows: 0.0,
            remarks: Vec::new(),
        }
    }

    fn read_all(&mut self, files: &mut InputFiles, rest: &RestRecord) -> Result<(), CalibrationError> {
        let file = files.file;
        if !is_per_record(&rest.file) {
            return self.read(files, &file.resolve(&rest.file, ""), rest.records.as_deref());
        }
        let names = rest.records.iter().flatten();
        names.into_iter().try_for_each(|name| self.read(files, &file.resolve(&rest.file, name), None))
    }

    /// Reads a file: all its records, or those of these names.
    fn read(
        &mut self,
        files: &mut InputFiles,
        path: &Path,
        wanted: Option<&[String]>,
    ) -> Result<(), CalibrationError> {
        let unit = &files.file.gyroscope;
        let size = StretchSize { rows: PART, first: PART, before: AROUND, after: AROUND };
        let (mut failed, mut file) = (None, String::new());
        let before = (self.interval_sum_s, self.rows);
        self.labels.clear();
        let layout = self.record.layout(unit);
        let found = files.read_in_parts(Key::from("rest").child("file"), path, &layout, size, |stretch| {
            file.clone_from(&stretch.recording.source().file);
            if failed.is_none() {
                failed = self.take(unit, stretch, wanted).err();
            }
        })?;
        if let Some(error) = failed {
            return Err(error);
        }
        let is_wanted = |label: &String| wanted.is_none_or(|wanted| wanted.contains(label));
        if let Some(missing) = wanted.and_then(|all| all.iter().find(|name| !self.labels.contains(name))) {
            let (place, record) = (path.display().to_string(), missing.clone());
            return Err(CalibrationError::NoRecord { place, record, known: self.labels.clone() });
        }
        let used = [columns(self.record.channels), columns(self.record.accelerometers)].concat();
        for label in self.labels.iter().filter(|label| is_wanted(label)) {
            require_usable_record(&found, &file, label, &used)?;
            // Of noise about a mean a part beyond the range is no gap: what is left has another mean.
            let beyond = found.iter().find(|finding| {
                finding.kind == FindingKind::Overload
                    && finding.column.as_deref().is_some_and(|column| used.contains(&column))
                    && finding.segment.as_ref().is_none_or(|segment| segment == label)
            });
            if let Some(Finding { column, count, .. }) = beyond {
                let (place, column) = (file.clone(), column.clone().unwrap_or_default());
                return Err(EstimateError::Clipped { place, column, count: *count }.into());
            }
        }
        let interval_s = (self.interval_sum_s - before.0) / (self.rows - before.1);
        self.remarks.extend(off_nominal(&file, interval_s, unit, self.record.clock));
        Ok(())
    }

    fn take(
        &mut self,
        unit: &InertialUnit,
        stretch: &Stretch,
        wanted: Option<&[String]>,
    ) -> Result<(), CalibrationError> {
        let recording = &stretch.recording;
        let [segment] = recording.segments() else { return Ok(()) };
        if stretch.begins {
            self.labels.push(segment.label.clone());
        }
        if wanted.is_some_and(|wanted| !wanted.contains(&segment.label)) {
            return Ok(());
        }
        let fresh = stretch.fresh.clone();
        let mut missing = Vec::new();
        if let Some(Clock::Column(_)) = self.record.clock {
            let time_s = segment.time.to_vec();
            if stretch.begins {
                self.finder = StretchFinder::of(&time_s);
            }
            if let Some(finder) = &mut self.finder {
                missing = finder.take(&time_s, fresh.clone());
            }
        }
        let places = self.places(&fresh, &missing);
        for channel in &mut self.channels {
            let kind: &Kind = match channel.sensor {
                InertialSensor::Gyroscope => &kind::ANGULAR_RATE,
                InertialSensor::Accelerometer => &kind::ACCELERATION,
            };
            let mut values = Cow::Borrowed(recording.column_of(channel.column, kind)?.of(segment));
            if channel.sensor == InertialSensor::Gyroscope {
                require_within(unit, &values, (&recording.source().file, channel.column))?;
            }
            if !channel.samples.lines.is_empty()
                && let Some(fresh) = values.to_mut().get_mut(fresh.clone())
            {
                channel.samples.lines.subtract(&places, fresh);
            }
            let mut from = fresh.start;
            let end = MissingBefore { row: fresh.end, samples: 0 };
            for MissingBefore { row, samples } in missing.iter().copied().chain([end]) {
                let part = values.get(from..row).unwrap_or_default();
                channel.samples.take(part, |place| segment.time.at(from + place));
                if samples > 0 {
                    channel.samples.skip(samples);
                }
                from = row;
            }
            if stretch.ends {
                channel.samples.end_record();
            }
        }
        if stretch.ends {
            self.place = 0.0;
        }
        let rows = fresh.len() as f64;
        self.rows += rows;
        // By its times the interval is known at the end of the record.
        let by_rate = || segment.time.interval_s().filter(|_| self.finder.is_none());
        self.interval_sum_s += rows * by_rate().unwrap_or(0.0);
        if stretch.ends
            && let Some(finder) = self.finder.take()
        {
            let found = finder.finish();
            let rows = found.rows.iter().map(ExactSizeIterator::len).sum::<usize>();
            self.interval_sum_s += rows as f64 * found.interval_s;
            self.remarks.extend(irregular(&recording.source().file, &segment.label, &found));
        }
        Ok(())
    }
}

impl RestReading<'_> {
    /// What each piece of the channels is taken for. Of long records the pieces are all that is kept of the samples.
    fn figure(&self, rest: &RestRecord) -> Figure {
        let channels = self.channels.iter().map(|channel| (channel.sensor, channel.axis, &channel.samples));
        figure_of_pieces("rest", format!("At rest: {}", rest.file.display()), channels)
    }

    /// The places of the next rows in their record, in samples.
    fn places(&mut self, fresh: &Range<usize>, missing: &[MissingBefore]) -> Vec<f64> {
        let mut missing = missing.iter().peekable();
        let each = fresh.clone().map(|row| {
            let gap = missing.next_if(|gap| gap.row == row).map_or(0, |gap| gap.samples);
            self.place += (1 + gap) as f64;
            self.place - 1.0
        });
        each.collect()
    }
}

/// The pieces of channels at rest that are taken for still and for moving.
pub(super) fn figure_of_pieces<'a>(
    id: &str,
    title: String,
    channels: impl Iterator<Item = (InertialSensor, &'static str, &'a RestSamples)>,
) -> Figure {
    let figure = Figure::new(
        id,
        title,
        "The mean of each piece of the record with its standard deviation to either side, before anything is computed from them. A piece counts as moving if \
         its variance exceeds the median of all by more than noise explains, and is not judged if it has a gap or fewer samples than the others. Several \
         records follow one another.",
    );
    channels.fold(figure, |figure, (sensor, axis, samples)| {
        figure.with(panel_of_pieces(&sensor.axis(axis), sensor, samples))
    })
}

fn panel_of_pieces(name: &str, sensor: InertialSensor, samples: &RestSamples) -> Panel {
    let (factor, unit) = match sensor {
        InertialSensor::Gyroscope => (1.0_f64.to_degrees(), "deg/s"),
        InertialSensor::Accelerometer => (1.0, "m/s^2"),
    };
    let (mut band, mut moving, mut not_judged) = (Vec::new(), Vec::new(), Vec::new());
    // Each record has times of its own.
    let (mut shift, mut last) = (0.0, f64::NEG_INFINITY);
    for (piece, state) in RestPieces::of(samples).each {
        let [from, to] = piece.time_s;
        if from + shift < last {
            shift = last - from;
        }
        last = (to + shift).max(last);
        let (mean, half) = (factor * piece.moments.mean, factor * piece.moments.variance().sqrt());
        band.extend([from + shift, last].map(|time_s| (time_s, mean - half, mean + half)));
        match state {
            PieceState::Still => (),
            PieceState::Moving => moving.push([from + shift, last]),
            PieceState::NotJudged => not_judged.push([from + shift, last]),
        }
    }
    let low = band.iter().map(|(_, low, _)| *low).fold(f64::INFINITY, f64::min);
    let high = band.iter().map(|(_, _, high)| *high).fold(f64::NEG_INFINITY, f64::max);
    let panel = Panel::new(Axis::new("time", "s"), Axis::new(format!("output of {name}"), unit))
        .with(Series::band("mean ± standard deviation", SeriesRole::Measured, band));
    let marked = [("moving", SeriesRole::Failure, moving), ("not judged", SeriesRole::Bound, not_judged)];
    let there = marked.into_iter().filter(|(.., spans)| !spans.is_empty());
    there.fold(panel, |panel, (label, role, spans)| {
        panel.with(Series::spans(label, role, &spans, [low, high]))
    })
}

impl MeasuredRest {
    fn measure(&mut self, channel: RestChannel, interval_s: f64) -> Result<(), CalibrationError> {
        let RestChannel { sensor, axis, place, mut samples, .. } = channel;
        let spectrum = RestSpectrum::of(samples.longest());
        samples.forget_longest();
        let found = AxisAtRest::of_samples(axis, &samples, interval_s);
        let Some(found) = found else {
            return Err(CalibrationError::Rest { place, samples: samples.count() });
        };
        let remarks = &mut self.remarks;
        if found.gaps > 0 {
            let places =
                if found.gaps == 1 { "one place".to_owned() } else { format!("{} places", found.gaps) };
            remarks.push(format!(
                "{place}: samples or their numbers are missing in {places}. A mean over an averaging time counts if at most one in ten of its samples is \
                 missing; differences that reach further into a gap are left out."
            ));
        }
        let lines = spectrum.iter().flat_map(RestSpectrum::lines);
        let found = AxisAtRest {
            sensor,
            density: spectrum.as_ref().map_or_else(Vec::new, |spectrum| spectrum.density(interval_s)),
            lines: lines.map(|line| [line.frequency / interval_s, line.amplitude]).collect(),
            ..found
        };
        if let [[frequency_hz, amplitude], ..] = found.subtracted[..] {
            remarks.push(format!(
                "{place}: {} of its spectrum were fitted by sines and subtracted, the largest {:.3e} {} at {:.6} Hz.",
                match found.subtracted.len() {
                    1 => "one line".to_owned(),
                    several => format!("{several} lines"),
                },
                amplitude,
                sensor.unit(),
                frequency_hz
            ));
        }
        for motion in RestPieces::of(&samples).motions(spectrum.as_ref()) {
            let said = describe(&motion, interval_s, sensor.unit());
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
        if let (Some(drift), Some(ramp)) = (found.drift, found.rate_ramp) {
            remarks.push(format!(
                "{place}: the bias changes evenly by {ramp:+.3e} {unit}/s, and the second half of the record lies {drift:+.3e} {unit} from the first, as \
                 while a unit warms up. The noise is stated without this ramp.",
                unit = sensor.unit()
            ));
        }
        self.axes.push(found);
        Ok(())
    }
}

/// A motion of a record at rest in words.
pub(super) fn describe(motion: &RestMotion, interval_s: f64, unit: &str) -> String {
    match motion {
        RestMotion::Passing { time_s: [first, last], times } => format!(
            "between {first:.6} s and {last:.6} s it moves: the standard deviation there is up to {times:.1} times the usual (noise alone \
             shows that in less than one record of 1000). Leave that time out: bias, noise and deviations are not those of rest."
        ),
        RestMotion::Line(RestLine { frequency, amplitude }) => format!(
            "a line of {amplitude:.3e} {unit} at {:.6} Hz stands out of its noise (noise alone shows one in less than one record \
             of 1000): it vibrates, or something interferes. The deviations at times about half a cycle of it are not those of \
             rest.",
            frequency / interval_s
        ),
        RestMotion::Step { time_s, size } => format!(
            "its mean steps by {size:+.3e} {unit} at {time_s:.6} s (noise alone shows that in less than one record of 1000): the unit was moved, or its bias \
             jumped. Noise and deviations have the step in them; calibrate the parts before and after it."
        ),
        RestMotion::Changing { ratio } => format!(
            "its noise changes: the standard deviation at the end is {ratio:.2} times that at the beginning (noise alone shows that in less than one \
             record of 1000). Its numbers are a mean of different states."
        ),
        RestMotion::Unknown => "its gaps leave fewer than 16 pieces of equal length, or fewer than half of them: whether it moves is not known."
            .to_owned(),
    }
}

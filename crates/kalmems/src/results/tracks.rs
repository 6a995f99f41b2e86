//! What pages show of a segment beside its pictures: all samples of it, or the extremes of groups of them, as they pass.

use super::marks::SignalGaps;
use super::summary::shown;
use crate::estimate::{SegmentEstimate, StateSeries, Trajectory, TrajectoryKind};
use crate::evaluate::ErrorSeries;
use crate::units::kind;
use crate::workflow::{RecordingOutcome, SegmentOutcome};
use kalmems_figures::{BandCentre, SampledQuantity, SamplesPlace, Series, Track};
use std::collections::BTreeMap;

/// The channels of a track: a value, and three standard deviations below and above it.
pub(super) const VALUE: [usize; 2] = [0, 0];
/// The band about the value.
pub(super) const BAND: [usize; 2] = [1, 2];

/// Samples of one segment, in the units that people read, in memory that does not grow with it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracks {
    /// What stands before their names in the file of samples.
    prefix: String,
    by_key: BTreeMap<String, Track>,
    /// Where there are no samples.
    pub(super) gaps: SignalGaps,
}

/// What takes the samples of the tracks of a segment.
pub(super) trait SampleSink {
    /// Takes the next samples of a track: time, value, and half of the width of its band.
    fn take(&mut self, key: &str, quantity: SampledQuantity, samples: impl Iterator<Item = (f64, [f64; 2])>);
}

impl SampleSink for Tracks {
    fn take(&mut self, key: &str, quantity: SampledQuantity, samples: impl Iterator<Item = (f64, [f64; 2])>) {
        match quantity.band {
            None => self.add(key, samples.map(|(t, [value, _])| (t, [value]))),
            Some(BandCentre::Value) => {
                self.add(key, samples.map(|(t, [value, half])| (t, [value, value - half, value + half])));
            }
            Some(BandCentre::Zero) => {
                self.add(key, samples.map(|(t, [value, half])| (t, [value, -half, half])));
            }
        }
    }
}

/// Whether a part of a segment begins it, and whether it ends it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartPlace {
    pub(super) begins: bool,
    pub(super) ends: bool,
}

impl PartPlace {
    /// All of a segment.
    pub(super) const WHOLE: Self = Self { begins: true, ends: true };

    /// Whether a sample of a reference belongs to this part by its time. The rows of a reference that go with a part reach beyond it, into those
    /// that go with its neighbours.
    fn has(self, time_s: f64, [first_s, last_s]: [f64; 2], interval_s: f64) -> bool {
        // A reference may have samples between the last of one part and the first of the next.
        let end_s = last_s + interval_s * (1.0 - 1e-6);
        (self.begins || time_s >= first_s) && (self.ends || time_s < end_s || time_s <= last_s)
    }
}

/// Gives the samples of the next part of a segment, track by track.
pub(super) fn each_track(
    recording: &RecordingOutcome,
    segment: &SegmentOutcome,
    part: PartPlace,
    sink: &mut impl SampleSink,
) {
    let estimate = &segment.estimate;
    let own = &estimate.segment;
    let column = |name: &str| recording.recording.column(name).ok().map(|column| column.of(own));
    let time = || (0..own.time.len()).map(|k| own.time.at(k));
    let (unit, factor) = signal_unit(estimate);
    if let Some(input) = column(&estimate.drive_column) {
        sink.take(INPUT, single("V"), time().zip(input).map(|(t, v)| (t, alone(*v))));
    }
    let signal = column(&estimate.signal_column);
    if let Some(signal) = signal {
        sink.take(SIGNAL, single(unit), time().zip(signal).map(|(t, y)| (t, alone(y * factor))));
    }
    each_answer(estimate, recording.values.first().map(|value| value.name), signal, sink);
    let interval_s = own.time.interval_s().unwrap_or(0.0);
    let within = |time_s: f64, times: &[f64]| match (times.first(), times.last()) {
        (Some(first), Some(last)) => part.has(time_s, [*first, *last], interval_s),
        _ => false,
    };
    for (trajectory, errors) in estimate.trajectories.iter().zip(&segment.errors) {
        for errors in errors.iter().flat_map(kalmems_engines::evaluate::MotionErrors::each) {
            let shown = ("deg", 1_f64.to_degrees());
            let own = |time_s| within(time_s, &trajectory.time_s);
            each_error(&of_error(trajectory, errors.of), &errors.error, shown, own, sink);
        }
    }
    for (trajectory, values) in estimate.trajectories.iter().zip(&segment.values) {
        for (name, errors) in values {
            let own = |time_s| within(time_s, &trajectory.time_s);
            each_error(&of_error(trajectory, name), &errors.error, shown(errors.unit), own, sink);
        }
    }
    let Some(reference) = &recording.reference else { return };
    let ends_s = [own.time.start_s(), own.time.at(own.time.len().saturating_sub(1))];
    let is_own = |(time_s, _): &(f64, [f64; 2])| part.has(*time_s, ends_s, interval_s);
    for one in reference.angles_of(own).into_iter().flatten() {
        let each = one.time_s.iter().zip(&one.angle).map(|(t, a)| (*t, alone(a.to_degrees())));
        sink.take(&of_reference(one.states[0]), single("deg"), each.filter(is_own));
    }
    for one in reference.values_of(own).into_iter().flatten() {
        let estimated = estimate.trajectories.iter().find_map(|trajectory| trajectory.state(one.state.name));
        // Nothing but the estimate tells the unit in which people read it.
        let (unit, factor) = estimated.map_or(("", 1.0), |state| shown(state.unit));
        let each = one.time_s.iter().zip(&one.value).map(|(t, v)| (*t, alone(v * factor)));
        sink.take(&of_reference(one.state.name), single(unit), each.filter(is_own));
    }
}

/// Gives what the filters say of the next samples: states, innovations and predictions. These are of the signal as recorded, if it is known, so that what a
/// device subtracts from it, such as a feedthrough, is in both.
fn each_answer(
    estimate: &SegmentEstimate,
    wanted: Option<&str>,
    recorded: Option<&[f64]>,
    sink: &mut impl SampleSink,
) {
    let (signal_unit, signal_factor) = signal_unit(estimate);
    for trajectory in &estimate.trajectories {
        let times = || trajectory.time_s.iter().copied();
        for state in trajectory.states.iter().filter(|state| is_shown(trajectory, state, wanted)) {
            let (unit, factor) = state_unit(trajectory, state);
            let sds = state.sd.iter().copied().chain(std::iter::repeat(f64::NAN));
            let each = times().zip(state.mean.iter().zip(sds));
            let each = each.map(|(t, (mean, sd))| (t, [mean * factor, 3.0 * (sd * factor)]));
            let quantity = SampledQuantity { unit, band: Some(BandCentre::Value) };
            sink.take(&of_state(trajectory, state.name), quantity, each);
        }
        if trajectory.kind == TrajectoryKind::Smoothed {
            continue;
        }
        for SignalInnovations { key, unit: (unit, factor), innovation, sd, .. } in
            SignalInnovations::of(trajectory, estimate)
        {
            let each = times().zip(innovation.iter().zip(sd));
            let each = each.map(|(t, (r, sd))| (t, [r * factor, 3.0 * sd * factor]));
            sink.take(&key, SampledQuantity { unit, band: Some(BandCentre::Zero) }, each);
        }
        let recorded = recorded.filter(|recorded| recorded.len() == trajectory.innovation.len());
        let signal = recorded.unwrap_or(&trajectory.signal);
        let predicted = times().zip(signal.iter().zip(&trajectory.innovation));
        let predicted = predicted.map(|(t, (y, r))| (t, alone((y - r) * signal_factor)));
        sink.take(&of_prediction(trajectory), single(signal_unit), predicted);
    }
}

fn each_error(
    key: &str,
    errors: &ErrorSeries,
    (unit, factor): (&str, f64),
    is_own: impl Fn(f64) -> bool,
    sink: &mut impl SampleSink,
) {
    let sds = errors.sd.iter().copied().chain(std::iter::repeat(f64::NAN));
    let each = errors.time_s.iter().zip(errors.error.iter().zip(sds));
    let each = each.filter(|(t, _)| is_own(**t)).map(|(t, (e, sd))| (*t, [e * factor, 3.0 * sd * factor]));
    sink.take(key, SampledQuantity { unit, band: Some(BandCentre::Zero) }, each);
}

/// A quantity without a band.
fn single(unit: &str) -> SampledQuantity<'_> {
    SampledQuantity { unit, band: None }
}

/// A value without a band.
fn alone(value: f64) -> [f64; 2] {
    [value, f64::NAN]
}

impl Tracks {
    /// No samples yet, with what stands before the names of the tracks in the file of samples.
    pub(super) fn new(prefix: &str) -> Self {
        Self { prefix: prefix.to_owned(), ..Self::default() }
    }

    /// All of a segment that is in memory whole.
    pub(super) fn of(recording: &RecordingOutcome, segment: &SegmentOutcome, prefix: &str) -> Self {
        let mut tracks = Self::new(prefix);
        tracks.take_part(recording, segment, PartPlace::WHOLE);
        tracks
    }

    /// Takes what came of the next part of the segment.
    pub(super) fn take_part(
        &mut self,
        recording: &RecordingOutcome,
        segment: &SegmentOutcome,
        part: PartPlace,
    ) {
        let own = &segment.estimate.segment;
        if let Ok(signal) = recording.recording.column(&segment.estimate.signal_column) {
            let samples = (0..own.time.len()).map(|k| own.time.at(k)).zip(signal.of(own).iter().copied());
            self.gaps.take(samples, own.time.interval_s().unwrap_or(0.0));
        }
        each_track(recording, segment, part, self);
    }

    /// Takes what the filters say of the next samples: states, innovations and predictions.
    pub(crate) fn answers(&mut self, estimate: &SegmentEstimate, wanted: Option<&str>) {
        each_answer(estimate, wanted, None, self);
    }

    /// The track of this name.
    pub(super) fn get(&self, key: &str) -> Option<&Track> {
        self.by_key.get(key)
    }

    fn add<const N: usize>(&mut self, key: &str, samples: impl Iterator<Item = (f64, [f64; N])>) {
        if !self.by_key.contains_key(key) {
            self.by_key.insert(key.to_owned(), Track::new(N));
        }
        let Some(track) = self.by_key.get_mut(key) else { return };
        for (t, values) in samples {
            track.push(t, &values);
        }
    }

    /// A series with all that is known of it, where anything is.
    pub(super) fn whole(&self, key: &str, channels: [usize; 2], series: Series) -> Series {
        match self.by_key.get(key) {
            Some(track) => {
                let name = format!("{}{key}", self.prefix).into();
                series
                    .of_all(track, channels)
                    .with_samples_in(SamplesPlace { track: name, is_band: channels == BAND })
            }
            None => series,
        }
    }
}

pub(super) const INPUT: &str = "input";
pub(super) const SIGNAL: &str = "signal";

pub(super) fn of_state(trajectory: &Trajectory, state: &str) -> String {
    format!("{}, {state}", trajectory.key)
}

pub(super) fn of_prediction(trajectory: &Trajectory) -> String {
    format!("{}, prediction", trajectory.key)
}

pub(super) fn of_error(trajectory: &Trajectory, of: &str) -> String {
    format!("{}, error of {of}", trajectory.key)
}

pub(super) fn of_reference(state: &str) -> String {
    format!("reference, {state}")
}

/// Whether figures show a state: an angle, what the device is for, or a parameter.
pub(super) fn is_shown(trajectory: &Trajectory, state: &StateSeries, wanted: Option<&str>) -> bool {
    state.kind.name == kind::ANGLE.name
        || wanted == Some(state.name)
        || is_parameter(trajectory, state)
        || trajectory.states.first().is_some_and(|first| first.name == state.name)
}

fn is_parameter(trajectory: &Trajectory, state: &StateSeries) -> bool {
    trajectory.parameters.iter().any(|prior| prior.name == state.name)
}

/// The unit in which people read a state, and how many of it one of its SI unit is.
pub(super) fn state_unit(trajectory: &Trajectory, state: &StateSeries) -> (&'static str, f64) {
    match state.unit {
        "1" if is_parameter(trajectory, state) => ("%", 100.0),
        _ if state.kind.name == kind::ANGLE.name => ("deg", 1_f64.to_degrees()),
        unit => shown(unit),
    }
}

/// The unit in which people read the signal, and how many of it one of its SI unit is.
pub(super) fn signal_unit(estimate: &SegmentEstimate) -> (&'static str, f64) {
    shown(estimate.signal_kind.ending())
}

/// A filter's innovations of one of its signals.
pub(super) struct SignalInnovations<'a> {
    /// The signal's name, of a filter of several.
    pub(super) signal: Option<&'a str>,
    /// Its place among them.
    pub(super) place: usize,
    /// The key of their track.
    pub(super) key: String,
    /// The unit in which people read them, and how many of it one of its SI unit is.
    pub(super) unit: (&'static str, f64),
    /// The innovations in SI.
    pub(super) innovation: &'a [f64],
    /// Their standard deviations in SI.
    pub(super) sd: &'a [f64],
}

impl<'a> SignalInnovations<'a> {
    /// Those of all signals of a filter.
    pub(super) fn of(trajectory: &'a Trajectory, estimate: &SegmentEstimate) -> Vec<Self> {
        let own = trajectory.signal_name.as_ref();
        let has_several = !trajectory.further.is_empty();
        let first = Self {
            signal: own.filter(|_| has_several).map(|signal| signal.name.as_str()),
            place: 0,
            key: format!("{}, innovation", trajectory.key),
            unit: own.map_or_else(|| signal_unit(estimate), |signal| shown(signal.kind.ending())),
            innovation: &trajectory.innovation,
            sd: &trajectory.innovation_sd,
        };
        let further = trajectory.further.iter().zip(1..).map(|(signal, place)| Self {
            signal: Some(&signal.of.name),
            place,
            key: format!("{}, innovation of {}", trajectory.key, signal.of.name),
            unit: shown(signal.of.kind.ending()),
            innovation: &signal.innovation,
            sd: &signal.sd,
        });
        std::iter::once(first).chain(further).collect()
    }

    /// What an axis calls them.
    pub(super) fn label(&self) -> String {
        self.signal.map_or_else(|| "innovation".to_owned(), |signal| format!("innovation of {signal}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_of_a_reference_belongs_to_one_part_and_none_is_lost_between_two() {
        let first = PartPlace { begins: true, ends: false };
        let last = PartPlace { begins: false, ends: true };
        // The signal has samples at 0, 1, … 9 and at 10, … 19; the reference three for each, and some before and after.
        for k in -6..66 {
            let time_s = f64::from(k) / 3.0;
            let [a, b] = [first.has(time_s, [0.0, 9.0], 1.0), last.has(time_s, [10.0, 19.0], 1.0)];
            assert_eq!((a, b), (time_s < 10.0 - 1e-9, time_s >= 10.0 - 1e-9), "{time_s}");
            assert!(PartPlace::WHOLE.has(time_s, [0.0, 19.0], 1.0));
        }
    }
}

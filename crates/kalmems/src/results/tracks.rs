//! What pages show of a segment beside its pictures: all samples of it, or the extremes of groups of them, as they pass.

use super::marks::SignalGaps;
use super::summary::shown;
use crate::estimate::{SegmentEstimate, StateSeries, Trajectory, TrajectoryKind};
use crate::evaluate::ErrorSeries;
use crate::units::kind;
use crate::workflow::{RecordingOutcome, SegmentOutcome};
use kalmems_figures::{Series, Track};
use std::collections::BTreeMap;

/// The channels of a track: a value, and three standard deviations below and above it.
pub(super) const VALUE: [usize; 2] = [0, 0];
/// The band about the value.
pub(super) const BAND: [usize; 2] = [1, 2];

/// Samples of one segment, in the units that people read, in memory that does not grow with it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracks {
    tracks: BTreeMap<String, Track>,
    /// Where there are no samples.
    pub(super) gaps: SignalGaps,
}

impl Tracks {
    /// All of a segment that is in memory whole.
    pub(super) fn of(recording: &RecordingOutcome, segment: &SegmentOutcome) -> Self {
        let mut tracks = Self::default();
        tracks.take(recording, segment);
        tracks
    }

    /// Takes what came of the next part of the segment.
    pub(super) fn take(&mut self, recording: &RecordingOutcome, segment: &SegmentOutcome) {
        let estimate = &segment.estimate;
        let own = &estimate.segment;
        let column = |name: &str| recording.recording.column(name).ok().map(|column| column.of(own));
        let time = || (0..own.time.len()).map(|k| own.time.at(k));
        let (_, factor) = signal_unit(estimate);
        if let Some(input) = column(&estimate.drive_column) {
            self.add(INPUT, time().zip(input).map(|(t, v)| (t, [*v; 1])));
        }
        if let Some(signal) = column(&estimate.signal_column) {
            self.gaps.take(time().zip(signal.iter().copied()), own.time.interval_s().unwrap_or(0.0));
            self.add(SIGNAL, time().zip(signal).map(|(t, y)| (t, [y * factor; 1])));
        }
        self.answers(estimate, recording.values.first().map(|value| value.name));
        for (trajectory, errors) in estimate.trajectories.iter().zip(&segment.errors) {
            for errors in errors.iter().flat_map(kalmems_engines::evaluate::MotionErrors::each) {
                self.errors(&of_error(trajectory, errors.of), &errors.error, 1_f64.to_degrees());
            }
        }
        for (trajectory, values) in estimate.trajectories.iter().zip(&segment.values) {
            for (name, errors) in values {
                self.errors(&of_error(trajectory, name), &errors.error, shown(errors.unit).1);
            }
        }
        let Some(reference) = &recording.reference else { return };
        for one in reference.angles_of(own).into_iter().flatten() {
            let each = one.time_s.iter().zip(&one.angle);
            self.add(&of_reference(one.states[0]), each.map(|(t, a)| (*t, [a.to_degrees(); 1])));
        }
        for one in reference.values_of(own).into_iter().flatten() {
            let estimated =
                estimate.trajectories.iter().find_map(|trajectory| trajectory.state(one.state.name));
            let factor = estimated.map_or(1.0, |state| shown(state.unit).1);
            let each = one.time_s.iter().zip(&one.value);
            self.add(&of_reference(one.state.name), each.map(|(t, v)| (*t, [v * factor; 1])));
        }
    }

    /// Takes what the filters say of the next samples: states, innovations and predictions.
    pub(crate) fn answers(&mut self, estimate: &SegmentEstimate, wanted: Option<&str>) {
        let (_, factor) = signal_unit(estimate);
        for trajectory in &estimate.trajectories {
            let times = || trajectory.time_s.iter().copied();
            for state in trajectory.states.iter().filter(|state| is_shown(trajectory, state, wanted)) {
                let (_, factor) = state_unit(trajectory, state);
                let sds = state.sd.iter().copied().chain(std::iter::repeat(f64::NAN));
                let each = times().zip(state.mean.iter().zip(sds));
                let each = each.map(|(t, (mean, sd))| (t, about(mean * factor, sd * factor)));
                self.add(&of_state(trajectory, state.name), each);
            }
            if trajectory.kind == TrajectoryKind::Smoothed {
                continue;
            }
            let innovations = trajectory.innovation.iter().zip(&trajectory.innovation_sd);
            self.add(
                &of_innovation(trajectory),
                times()
                    .zip(innovations)
                    .map(|(t, (r, sd))| (t, [r * factor, -3.0 * sd * factor, 3.0 * sd * factor])),
            );
            let predicted = trajectory.signal.iter().zip(&trajectory.innovation);
            let predicted = times().zip(predicted).map(|(t, (y, r))| (t, [(y - r) * factor; 1]));
            self.add(&of_prediction(trajectory), predicted);
        }
    }

    /// The track of this name.
    pub(super) fn get(&self, key: &str) -> Option<&Track> {
        self.tracks.get(key)
    }

    fn errors(&mut self, key: &str, errors: &ErrorSeries, factor: f64) {
        let sds = errors.sd.iter().copied().chain(std::iter::repeat(f64::NAN));
        let each = errors.time_s.iter().zip(errors.error.iter().zip(sds));
        self.add(key, each.map(|(t, (e, sd))| (*t, [e * factor, -3.0 * sd * factor, 3.0 * sd * factor])));
    }

    fn add<const N: usize>(&mut self, key: &str, samples: impl Iterator<Item = (f64, [f64; N])>) {
        if !self.tracks.contains_key(key) {
            self.tracks.insert(key.to_owned(), Track::new(N));
        }
        let Some(track) = self.tracks.get_mut(key) else { return };
        for (t, values) in samples {
            track.push(t, &values);
        }
    }

    /// A series with all that is known of it, where anything is.
    pub(super) fn whole(&self, key: &str, channels: [usize; 2], series: Series) -> Series {
        match self.tracks.get(key) {
            Some(track) => series.of_all(track, channels),
            None => series,
        }
    }
}

pub(super) const INPUT: &str = "input";
pub(super) const SIGNAL: &str = "signal";

pub(super) fn of_state(trajectory: &Trajectory, state: &str) -> String {
    format!("{}, {state}", trajectory.key)
}

pub(super) fn of_innovation(trajectory: &Trajectory) -> String {
    format!("{}, innovation", trajectory.key)
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

fn about(mean: f64, sd: f64) -> [f64; 3] {
    [mean, mean - 3.0 * sd, mean + 3.0 * sd]
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
    shown(if estimate.signal_kind.name == kind::CAPACITANCE.name { "F" } else { "V" })
}

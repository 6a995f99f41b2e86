//! What is known of the motion independently.

use super::{
    Accuracy, BeamPosition, EdgeVelocity, Instruments, ReferenceChannels, ValueReference, ValueState,
};
use crate::config::{ConfigError, ConfigFault, Experiment, Key, Sign};
use crate::estimate::Trajectory;
use crate::progress::Interruption;
use crate::recording::{Instant, ReadError, RecordingLayout, Restarts, SampledRecording, Segment};
use crate::signal::{GAP, hermite, usual_interval};
use crate::units::{Kind, kind};
use std::ops::ControlFlow;

/// An angle measured, or known, independently of the signal; a position of a device that moves along a line.
#[derive(Clone, Debug)]
pub struct ReferenceMotion {
    /// The states of an estimate that it is compared with: the angle's name, and the rate's.
    pub states: [&'static str; 2],
    /// When the instrument said so, less its delay, in s.
    pub time_s: Vec<f64>,
    /// The angle in rad, or the position in m; not a number where it is missing.
    pub angle: Vec<f64>,
    /// The rate in rad/s or m/s, where the reference has one.
    pub rate: Option<Vec<f64>>,
    /// How accurate the angle is.
    pub accuracy: Accuracy,
}

/// The recording of a reference, with the columns that are meant.
#[derive(Clone, Debug)]
pub struct ReferenceRecording {
    recording: SampledRecording,
    columns: ReferenceColumns,
}

/// What the columns of a reference mean.
#[derive(Clone, Debug)]
pub(super) struct ReferenceColumns {
    angles: Vec<AngleColumns>,
    values: Vec<ValueColumn>,
    pub(super) delay_s: f64,
    delay_sd_s: f64,
    /// Whether its rows are the recording's, so that its clock goes back where the recording's does.
    same_rows: bool,
}

/// An angle, and the columns that know it.
#[derive(Clone, Debug)]
struct AngleColumns {
    states: [&'static str; 2],
    angle: String,
    rate: Option<String>,
    /// The standard deviation of the angle.
    sd: f64,
    /// What turns the column into an angle, where it holds the position of a beam.
    beam: Option<BeamPosition>,
}

/// The channel of a reference that is a beam's position.
const POSITION: &str = "position";
/// The channel of a reference that is how fast a stage's edge moves.
const EDGE: &str = "edge_velocity";
/// A quantity that is no angle, and the column that knows it.
#[derive(Clone, Debug)]
struct ValueColumn {
    state: &'static ValueState,
    column: String,
    /// The standard deviation of the quantity.
    sd: f64,
    /// What turns the column into an angular rate, where it holds the velocity of an edge.
    edge: Option<EdgeVelocity>,
}

/// Why a reference cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The file is.
    #[error(transparent)]
    Read(#[from] ReadError),
}

/// What the reference of a device with one angle may know: its angle, and its rate.
pub const ONE_ANGLE: [[&str; 2]; 1] = [["angle", "rate"]];

impl ReferenceRecording {
    /// Reads the reference of a recording, if the experiment names one: each of the angles that it may know, and its rate where
    /// the reference has one; and of the values the first, and others where it has them. Its times count from the origin of
    /// the recording's.
    pub fn read(
        experiment: &Experiment,
        (index, origin): (usize, Instant),
        known: &ReferenceChannels,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Option<Self>, ReferenceError> {
        let described = experiment.recording(index)?;
        let Some(reference) = &described.reference else { return Ok(None) };
        let file = experiment.resolve(reference.file(described));
        Self::read_by(experiment, (index, origin), known, |layout| {
            SampledRecording::read_with(&file, layout, progress)
        })
    }

    /// Refuses a reference that names what no reference of the device can know, without opening it.
    pub fn check(
        experiment: &Experiment,
        index: usize,
        known: &ReferenceChannels,
    ) -> Result<(), ReferenceError> {
        ReferenceColumns::of(experiment, index, known).map(|_| ())
    }

    /// The same, with another way to read the file.
    pub fn read_by(
        experiment: &Experiment,
        (index, origin): (usize, Instant),
        known: &ReferenceChannels,
        read: impl FnOnce(&RecordingLayout) -> Result<SampledRecording, ReadError>,
    ) -> Result<Option<Self>, ReferenceError> {
        let Some((layout, columns)) = ReferenceColumns::of(experiment, index, known)? else {
            return Ok(None);
        };
        let layout = RecordingLayout { origin: Some(origin), ..layout };
        Ok(Some(Self { recording: read(&layout)?, columns }))
    }
}

impl ReferenceColumns {
    /// Those of a recording's reference, where the experiment names one, and how its file is to be read.
    pub(super) fn of(
        experiment: &Experiment,
        index: usize,
        known: &ReferenceChannels,
    ) -> Result<Option<(RecordingLayout, Self)>, ReferenceError> {
        let described = experiment.recording(index)?;
        let Some(reference) = &described.reference else { return Ok(None) };
        let key = || Key::from("recording").index(index).child("reference").child("channels");
        let ReferenceChannels { angles, values, instruments: Instruments { beam, edge } } = *known;
        let of_beam = beam.iter().map(|_| POSITION).chain(edge.iter().map(|_| EDGE));
        let known = || {
            angles
                .iter()
                .flatten()
                .copied()
                .chain(of_beam.clone())
                .chain(values.iter().map(|value| value.name))
        };
        if let Some((other, _)) = reference.channels.iter().find(|(name, _)| !known().any(|k| k == *name)) {
            let names: Vec<String> = known().map(|name| format!("`{name}`")).collect();
            let (last, first) =
                names.split_last().map_or(("", &[][..]), |(last, first)| (last.as_str(), first));
            let names = format!("{} and {last}", first.join(", "));
            let why = format!("`{other}` is not a channel of this reference; known are {names}");
            return Err(experiment.error(key().child(other), ConfigFault::Value { why }).into());
        }
        let at = || Key::from("recording").index(index).child("reference").child("sd");
        let all = angles.iter().map(|states| states[0]).chain(values.iter().map(|value| value.name));
        if let Some(name) = reference.sd.keys().find(|name| !all.clone().any(|known| known == name.as_str()))
        {
            return Err(experiment.error(at().child(name), ConfigFault::unknown_key(name, all)).into());
        }
        let sd = |name: &str, kind: &'static Kind| match reference.sd.get(name) {
            Some(sd) => experiment.value(at().child(name), sd, kind, Sign::NotNegative),
            None => Ok(0.0),
        };
        let angles = angles.iter().map(|&states| {
            let [angle, rate] = states.map(|name| reference.channels.column(name).map(str::to_owned));
            let position = reference.channels.column(POSITION).map(str::to_owned);
            let (angle, beam) = match (angle, position) {
                (None, Some(position)) => (Some(position), beam),
                (angle, _) => (angle, None),
            };
            let angle = angle.ok_or_else(|| {
                let name = states[0];
                let remedy = format!("name its column, such as `{name} = \"{name}_rad\"`");
                experiment.error(key().child(name), ConfigFault::MissingKey { remedy })
            })?;
            Ok(AngleColumns { states, angle, rate, sd: sd(states[0], kinds(states)[0])?, beam })
        });
        let angles = angles.collect::<Result<Vec<_>, ConfigError>>()?;
        let knows = |state: &ValueState| reference.channels.column(state.name).is_some();
        // The first is what the device is for; a reference that knows another one alone judges by that.
        let by_edge = edge.is_some() && reference.channels.column(EDGE).is_some();
        let knows_another = values.iter().skip(1).any(knows) && !by_edge;
        let of_values = values.iter().enumerate().filter_map(|(i, state)| {
            let column = reference.channels.column(state.name).map(str::to_owned);
            if i > 0 || (column.is_none() && knows_another) {
                return column.map(|column| {
                    Ok(ValueColumn { state, column, sd: sd(state.name, state.kind)?, edge: None })
                });
            }
            let of_edge = edge.filter(|_| column.is_none());
            let column = column.or_else(|| of_edge.and(reference.channels.column(EDGE).map(str::to_owned)));
            let column = column.ok_or_else(|| {
                let name = state.name;
                let remedy = format!("name its column, such as `{name} = \"true_{name}\"`");
                experiment.error(key().child(name), ConfigFault::MissingKey { remedy })
            });
            let of_column =
                |column| Ok(ValueColumn { state, column, sd: sd(state.name, state.kind)?, edge: of_edge });
            Some(column.and_then(of_column))
        });
        let values = of_values.collect::<Result<Vec<_>, ConfigError>>()?;
        let of_angles = angles.iter().flat_map(|a| [Some(&a.angle), a.rate.as_ref()]).flatten();
        let columns: Vec<&str> =
            of_angles.chain(values.iter().map(|value| &value.column)).map(String::as_str).collect();
        let same_rows = reference.is_in_recording() && reference.clock(described) == &described.clock;
        let restarts = same_rows.then_some(Restarts::WHERE_THE_CLOCK_GOES_BACK);
        let layout = RecordingLayout { restarts, ..described.reference_layout(reference, &columns) };
        Ok(Some((
            layout,
            Self {
                angles,
                values,
                delay_s: reference.delay_s(),
                delay_sd_s: reference.delay_sd_s(),
                same_rows,
            },
        )))
    }

    /// How accurate a channel of this standard deviation is.
    const fn accuracy(&self, sd: f64) -> Accuracy {
        Accuracy { sd, delay_sd_s: self.delay_sd_s }
    }

    /// Whether a segment of the reference goes with one of the recording.
    pub(super) fn go_together(&self, of: &Segment, segment: &Segment) -> bool {
        let run = !self.same_rows || segment.stretch.clock_run == of.stretch.clock_run;
        segment.label == of.label && run
    }
}

impl ReferenceRecording {
    /// Rows of a reference with these columns.
    pub(super) const fn new(recording: SampledRecording, columns: ReferenceColumns) -> Self {
        Self { recording, columns }
    }

    /// The recording as read.
    pub fn recording(&self) -> &SampledRecording {
        &self.recording
    }

    /// The angles of the segment with this label, the first of several, its delay taken off its times. None where there is no
    /// such segment.
    pub fn segment(&self, label: &str) -> Result<Vec<ReferenceMotion>, ReadError> {
        self.angles(self.recording.segments().iter().find(|segment| segment.label == label))
    }

    /// The angles that belong to a segment of the recording.
    pub fn angles_of(&self, segment: &Segment) -> Result<Vec<ReferenceMotion>, ReadError> {
        self.angles(self.like(segment))
    }

    /// The segment that goes with one of the recording: of the same label and, as both go back where their clock does, of
    /// the same run of the clock.
    fn like(&self, of: &Segment) -> Option<&Segment> {
        self.recording.segments().iter().find(|segment| self.columns.go_together(of, segment))
    }

    fn angles(&self, segment: Option<&Segment>) -> Result<Vec<ReferenceMotion>, ReadError> {
        let one = |columns: &AngleColumns| {
            let [of_angle, of_rate] = kinds(columns.states);
            let of_angle = if columns.beam.is_some() { &kind::VOLTAGE } else { of_angle };
            let angle = self.recording.column_of(&columns.angle, of_angle)?;
            let rate = columns.rate.as_ref().map(|name| self.recording.column_of(name, of_rate));
            let rate = rate.transpose()?;
            Ok(segment.map(|segment| ReferenceMotion {
                states: columns.states,
                time_s: segment.time.to_vec().iter().map(|t| t - self.columns.delay_s).collect(),
                angle: match columns.beam {
                    Some(beam) => angle.of(segment).iter().map(|volts| beam.angle(*volts)).collect(),
                    None => angle.of(segment).to_vec(),
                },
                rate: rate.map(|rate| rate.of(segment).to_vec()),
                accuracy: self.columns.accuracy(columns.sd),
            }))
        };
        self.columns.angles.iter().filter_map(|columns| one(columns).transpose()).collect()
    }
}

impl ReferenceRecording {
    /// What it knows beside angles of the segment with this label, the first of several.
    pub fn values(&self, label: &str) -> Result<Vec<ValueReference>, ReadError> {
        self.values_in(self.recording.segments().iter().find(|segment| segment.label == label))
    }

    /// What it knows beside angles that goes with a segment of the recording.
    pub fn values_of(&self, segment: &Segment) -> Result<Vec<ValueReference>, ReadError> {
        self.values_in(self.like(segment))
    }

    fn values_in(&self, segment: Option<&Segment>) -> Result<Vec<ValueReference>, ReadError> {
        let Some(segment) = segment else { return Ok(Vec::new()) };
        let one = |known: &ValueColumn| {
            let time_s: Vec<f64> = segment.time.to_vec().iter().map(|t| t - self.columns.delay_s).collect();
            let kind = if known.edge.is_some() { &kind::VOLTAGE } else { known.state.kind };
            let values = self.recording.column_of(&known.column, kind)?.of(segment);
            let value = match (known.edge, segment.time.interval_s()) {
                (Some(edge), Some(interval_s)) => edge.rates(&time_s, values, interval_s),
                _ => values.to_vec(),
            };
            Ok(ValueReference {
                state: known.state,
                time_s,
                value,
                accuracy: self.columns.accuracy(known.sd),
            })
        };
        self.columns.values.iter().map(one).collect()
    }
}

/// What a motion and its rate are: those of a tilt, but for a device that moves along a line.
fn kinds(states: [&str; 2]) -> [&'static Kind; 2] {
    if states[0] == "position" {
        [&kind::LENGTH, &kind::VELOCITY]
    } else {
        [&kind::ANGLE, &kind::ANGULAR_RATE]
    }
}

impl ReferenceMotion {
    /// The estimated angle and its standard deviation at each of the reference's times.
    ///
    /// Where the reference was not sampled with the signal, the estimate between two samples is the cubic
    /// through both angles and rates; outside the recording, in its gaps, where the filter had stopped, and between
    /// the samples of an estimate without a rate, it is not a number; nor is it where the work is stopped before.
    pub fn estimate_at(&self, trajectory: &Trajectory, stop: &Interruption) -> (Vec<f64>, Vec<f64>) {
        let nothing = || (vec![f64::NAN; self.time_s.len()], Vec::new());
        let Some(angle) = trajectory.state(self.states[0]) else { return nothing() };
        let rate = trajectory.state(self.states[1]);
        let times = &trajectory.time_s;
        let usual = usual_interval(times);
        let at = |time: f64| match (place(times, usual, time), rate) {
            (TimePlace::At(k), _) => (angle.mean[k], angle.sd.get(k).copied()),
            (TimePlace::Before { next, spacing, share }, Some(rate)) => {
                let k = next - 1;
                let ends = ((angle.mean[k], rate.mean[k]), (angle.mean[next], rate.mean[next]));
                let mean = hermite(ends.0, ends.1, spacing, share);
                (mean, angle.sd.get(k).zip(angle.sd.get(next)).map(|(a, b)| a.max(*b)))
            }
            _ => (f64::NAN, None),
        };
        let (means, sds): (Vec<f64>, Vec<Option<f64>>) = self
            .time_s
            .iter()
            .enumerate()
            .map(|(k, t)| if stop.is_requested_at(k) { (f64::NAN, None) } else { at(*t) })
            .unzip();
        if angle.sd.is_empty() {
            return (means, Vec::new());
        }
        (means, sds.into_iter().map(|sd| sd.unwrap_or(f64::NAN)).collect())
    }
}

/// Where a time lies among those of an estimate.
pub(super) enum TimePlace {
    /// At a sample.
    At(usize),
    /// Before the sample `next`, so many s after the one before it, at this share of the interval between them.
    Before { next: usize, spacing: f64, share: f64 },
    /// Outside, or in a gap: interpolation over several missing samples would say nothing of what was in between.
    Nowhere,
}

/// Finds a time among `times` of this usual interval.
pub(super) fn place(times: &[f64], usual: f64, time: f64) -> TimePlace {
    let next = times.partition_point(|t| *t < time);
    // A time written with another number of digits is the same time.
    let nearest = if next > 0 && (next == times.len() || time - times[next - 1] < times[next] - time) {
        next - 1
    } else {
        next
    };
    let same = times.get(nearest).is_some_and(|t| *t == time || (t - time).abs() <= 1e-6 * usual);
    if same {
        return TimePlace::At(nearest);
    }
    let before = next.wrapping_sub(1);
    match times.get(next).zip(times.get(before)).map(|(a, b)| a - b) {
        Some(spacing) if spacing <= GAP * usual => {
            TimePlace::Before { next, spacing, share: (time - times[before]) / spacing }
        }
        _ => TimePlace::Nowhere,
    }
}

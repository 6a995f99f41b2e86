//! A recording as an identification takes it.

use super::rest_noise::STRETCH;
use super::{IdentifyError, StillNoise, StillRecord};
use crate::config::{self, ConfigFault, Experiment, Key, RecordingRole};
use crate::estimate::EstimateError;
use crate::evaluate::{ReferenceChannels, ReferenceMotion, ReferenceRecording};
use crate::progress::Progress;
use crate::recording::{Finding, RecordingSource, SampledRecording, Segment, StretchSize, Stretches};
use crate::units::Kind;

/// One channel of one recording with its times, and the reference where there is one.
#[derive(Clone, Debug)]
pub struct Material {
    /// The recording's name in the experiment, or that of its file.
    pub name: String,
    /// What it was taken for.
    pub role: RecordingRole,
    /// When, in s.
    pub time_s: Vec<f64>,
    /// The usual interval in s.
    pub interval_s: f64,
    /// The channel in SI.
    pub signal: Vec<f64>,
    /// The angle of the reference at the same times; not a number where it has none. Empty without a reference.
    pub angle: Vec<f64>,
    /// The files it comes from.
    pub sources: Vec<RecordingSource>,
    /// What was found in the recording that does not keep it from being used.
    pub diagnosis: Vec<Finding>,
}

/// Refuses a recording one of whose signals is clipped or another channel: what is fitted to it would be wrong and look sure.
pub fn require_usable_signals(
    diagnosis: &[Finding],
    name: &str,
    columns: &[&str],
) -> Result<(), IdentifyError> {
    EstimateError::of_unusable_signal(diagnosis, (name, columns), |_| true)
        .map_err(|why| IdentifyError::Unfit { recording: name.to_owned(), why: without_place(&why, name) })
}

/// The same without the place, which an error of an identification names itself.
fn without_place(why: &EstimateError, name: &str) -> String {
    let text = why.to_string();
    text.strip_prefix(name).and_then(|text| text.strip_prefix(": ")).unwrap_or(&text).to_owned()
}

impl Material {
    /// The one recording of this role; `None` where there is none. `channel` is what the rig calls the column, which
    /// must be of this kind; others that `also` names may stand beside it and are not read. `known` is what its reference may
    /// know.
    ///
    /// It must hold one record, sampled evenly: fits by shooting and spectra need that.
    pub fn of_role(
        experiment: &Experiment,
        role: RecordingRole,
        (channel, kind): (&str, &Kind),
        also: &[&str],
        known: &ReferenceChannels,
        progress: &dyn Progress,
    ) -> Result<Option<Self>, IdentifyError> {
        let Some(chosen) = RoleColumn::of_role(experiment, role, channel, also)? else { return Ok(None) };
        let RoleColumn { index, described, column } = chosen;
        let mut started = false;
        let recording = SampledRecording::read_with(
            &experiment.resolve(&described.file),
            &described.layout(&[column]),
            &mut |done, total| {
                if !started {
                    progress.begin("reading", total);
                    started = true;
                }
                progress.reached(done)
            },
        )?;
        let name = chosen.name(recording.source());
        let [segment] = recording.segments() else {
            return Err(several(&name, recording.segments().len()));
        };
        let interval_s = even_interval_s(&name, segment)?;
        let reference =
            ReferenceRecording::read(experiment, (index, recording.origin()), known, &mut |done, _| {
                progress.reached(done)
            })?;
        let mut sources = vec![recording.source().clone()];
        sources.extend(reference.iter().map(|r| r.recording().source().clone()));
        let time_s = segment.time.to_vec();
        let angle = match &reference {
            Some(reference) => angle_at(&time_s, interval_s, segment, reference)?,
            None => Vec::new(),
        };
        let signal = recording.column_of(column, kind)?.of(segment).to_vec();
        let diagnosis = recording.diagnosis().to_vec();
        require_usable_signals(&diagnosis, &name, &[column])?;
        Ok(Some(Self { name, role, time_s, interval_s, signal, angle, sources, diagnosis }))
    }

    /// The one recording of this role, of a device that does not move, and what its noise is; otherwise as
    /// [`of_role`](Self::of_role). It may be of any length: its first samples alone are kept, for a picture, and no reference
    /// is read. There is no noise where [`StillRecord::finish`] finds none.
    pub fn still_of_role(
        experiment: &Experiment,
        role: RecordingRole,
        (channel, kind): (&str, &Kind),
        also: &[&str],
        progress: &dyn Progress,
    ) -> Result<Option<(Self, Option<StillNoise>)>, IdentifyError> {
        let Some(chosen) = RoleColumn::of_role(experiment, role, channel, also)? else { return Ok(None) };
        let RoleColumn { described, column, .. } = chosen;
        let around = StretchSize { rows: STRETCH, first: STRETCH, before: 0, after: 0 };
        let path = experiment.resolve(&described.file);
        let mut stretches = Stretches::open(&path, &described.layout(&[column]), around)?;
        let mut started = false;
        let mut first: Option<(Self, StillRecord)> = None;
        let mut segments = 0;
        while let Some(stretch) = stretches.next(&mut |done, total| {
            if !started {
                progress.begin("reading", total);
                started = true;
            }
            progress.reached(done)
        })? {
            segments += usize::from(stretch.begins);
            let recording = &stretch.recording;
            let (name, signal) = (chosen.name(recording.source()), recording.column_of(column, kind)?);
            let [segment] = recording.segments() else {
                return Err(several(&name, recording.segments().len()));
            };
            let interval_s = even_interval_s(&name, segment)?;
            let (time_s, signal) = (segment.time.to_vec(), signal.of(segment));
            let (_, record) = first.get_or_insert_with(|| {
                let (time_s, signal) = (time_s.clone(), signal.to_vec());
                let (angle, sources, diagnosis) = (Vec::new(), Vec::new(), Vec::new());
                (
                    Self { name, role, time_s, interval_s, signal, angle, sources, diagnosis },
                    StillRecord::new(interval_s),
                )
            });
            record.take(&time_s, signal);
            stretches.reuse(stretch);
        }
        let (source, diagnosis) = stretches.finish();
        let Some((material, record)) = first.filter(|_| segments == 1) else {
            return Err(several(&chosen.name(&source), segments));
        };
        Ok(Some((Self { sources: vec![source], diagnosis, ..material }, record.finish())))
    }

    /// An error that names this recording.
    pub fn unfit(&self, why: String) -> IdentifyError {
        IdentifyError::Unfit { recording: self.name.clone(), why }
    }
}

/// The recording of a role and its column.
struct RoleColumn<'a> {
    index: usize,
    described: &'a config::Recording,
    column: &'a str,
}

impl<'a> RoleColumn<'a> {
    fn of_role(
        experiment: &'a Experiment,
        role: RecordingRole,
        channel: &str,
        also: &[&str],
    ) -> Result<Option<Self>, IdentifyError> {
        let mut of_role = (0..experiment.recordings.len()).filter(|i| experiment.recordings[*i].role == role);
        let Some(index) = of_role.next() else { return Ok(None) };
        let key = |index: usize| Key::from("recording").index(index);
        if let Some(second) = of_role.next() {
            let why = format!(
                "this is the second recording of its role, after `{}`; an identification takes one: give the other \
                 the role `test`, or put it into another experiment",
                key(index)
            );
            return Err(experiment.error(key(second).child("role"), ConfigFault::Value { why }).into());
        }
        let described = experiment.recording(index)?;
        let channels = key(index).child("channels");
        if let Some((found, _)) =
            described.channels.iter().find(|(name, _)| *name != channel && !also.contains(name))
        {
            let why = format!("unknown channel `{found}`; this recording needs `{channel}`");
            return Err(experiment.error(channels.child(found), ConfigFault::Value { why }).into());
        }
        let column = described.channels.column(channel).ok_or_else(|| {
            let remedy = format!("name the column, such as `{channel} = \"{channel}_V\"`");
            experiment.error(channels.child(channel), ConfigFault::MissingKey { remedy })
        })?;
        Ok(Some(Self { index, described, column }))
    }

    fn name(&self, source: &RecordingSource) -> String {
        self.described.name.as_ref().map_or_else(|| source.file.clone(), ToString::to_string)
    }
}

fn several(recording: &str, count: usize) -> IdentifyError {
    let why = format!("it holds {count} segments; expected one record");
    IdentifyError::Unfit { recording: recording.to_owned(), why }
}

fn even_interval_s(recording: &str, segment: &Segment) -> Result<f64, IdentifyError> {
    segment.time.interval_s().filter(|_| segment.time.is_uniform()).ok_or_else(|| {
        let why = "its samples are not taken at equal intervals; expected a record without gaps".to_owned();
        IdentifyError::Unfit { recording: recording.to_owned(), why }
    })
}

/// The reference at these times. Where it was sampled at others it is a cubic between its samples.
fn angle_at(
    time_s: &[f64],
    interval_s: f64,
    segment: &Segment,
    reference: &ReferenceRecording,
) -> Result<Vec<f64>, IdentifyError> {
    let Some(ReferenceMotion { time_s: times, angle, .. }) = reference.segment(&segment.label)?.pop() else {
        return Ok(vec![f64::NAN; time_s.len()]);
    };
    Ok(time_s
        .iter()
        .map(|t| {
            let to = times.partition_point(|r| *r < t - 1e-6 * interval_s);
            match times.get(to) {
                None => f64::NAN,
                Some(here) if (here - t).abs() <= 1e-6 * interval_s => angle[to],
                Some(_) if to == 0 => f64::NAN,
                // Across a gap of the reference there is nothing to say.
                Some(here) if here - times[to - 1] > 4.0 * interval_s => f64::NAN,
                Some(_) => crate::signal::cubic_between(&times, |k| angle[k], to, *t),
            }
        })
        .collect())
}

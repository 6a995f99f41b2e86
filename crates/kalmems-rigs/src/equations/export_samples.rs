//! The samples of a recording with which an exported filter is rehearsed, and the start that they tell.

use super::axes::{AxisSines, InputRows};
use super::course::{EquationSegment, SegmentChannel};
use super::event_times::{EventTimes, FoundEvents};
use super::events::EventSettings;
use super::filter_settings::EquationFilterSettings;
use super::filter_task::EquationFilterTask;
use super::interpolation::Interpolation;
use super::judged_axes::motion;
use super::model::EquationModel;
use super::own_device::OwnDevice;
use super::sampled_inputs::rates_of_inputs;
use super::settings::EquationSettings;
use super::table::refused;
use super::{EquationColumns, names};
use crate::config::{ConfigFault, Experiment};
use crate::estimate::driven::{InterpolationLag, SegmentDrive};
use crate::estimate::{
    EstimateError, FilterPast, MeanAndCovariance, MotionRate, SampleSelection, StateSeries, Trajectory,
};
use crate::export::{ExportError, ExportRequest};
use crate::recording::{SampledRecording, Segment};
use crate::units::kind;
use kalmems_equations::{EmitMeasure, TestSample};

/// What a recording tells of an exported filter.
#[derive(Default)]
pub(super) struct RecordedSamples {
    /// What is known where the source starts, of a filter that takes its start from the signal, and when that is in s.
    pub start: Option<(MeanAndCovariance, f64)>,
    /// The samples from the start on, with the states of the library's filter at each.
    pub each: Vec<TestSample>,
}

/// How long before each row the events were, in s; an event at the first row, where the filter starts, is left out.
fn events_ago(
    settings: &EquationSettings,
    columns: &EquationColumns<'_>,
    (recording, segment): (&SampledRecording, &Segment),
) -> Result<Vec<Vec<Option<f64>>>, ExportError> {
    let mut ago = Vec::new();
    for event in &settings.events {
        let column = columns.events.iter().find(|(place, _)| *place == event.event);
        let values = column.map(|(_, column)| recording.column_of(column, &kind::TIME)).transpose()?;
        let values = values.map_or(Vec::new(), |values| values.of(segment).to_vec());
        let known = |(row, ago_s): (usize, f64)| Some(ago_s).filter(|ago_s| row > 0 && ago_s.is_finite());
        ago.push(values.into_iter().enumerate().map(known).collect());
    }
    Ok(ago)
}

/// The inputs at the start, the middle and the end of the interval before a sample.
fn inputs_before(data: &EquationSegment, between: &[Interpolation], k: usize) -> [Vec<f64>; 3] {
    let nodes: Vec<_> =
        data.inputs.iter().zip(between).map(|(input, between)| between.nodes(input, k)).collect();
    [
        nodes.iter().map(|n| n.start).collect(),
        nodes.iter().map(|n| n.middle).collect(),
        // A measurement sees the input of its sample, also where a prediction holds another one.
        data.inputs.iter().map(|input| input.sample(k).0).collect(),
    ]
}

/// The first samples of the recording, so many at least and at most, with the states of the library's filter at each.
///
/// The source predicts before it corrects: it starts at the first row without a correction. If the filter takes its start from the signal, it starts at
/// the first row that corrects the filter, with what is known after that. The samples end where the library's filter is started again.
pub(super) fn recorded_samples(
    (experiment, request): (&Experiment, &ExportRequest),
    (settings, filter): (&EquationSettings, &EquationFilterSettings),
    (index, recording): &(usize, SampledRecording),
    measures: &[EmitMeasure],
    (at_least, at_most): (usize, usize),
) -> Result<RecordedSamples, ExportError> {
    let own = &*filter.own;
    let file = || recording.source().file.clone();
    let columns = EquationColumns::of(experiment, *index)?;
    let EquationColumns { inputs, measured: channels, .. } = &columns;
    let first = recording.segments().first();
    let segment = first.ok_or_else(|| ExportError::NoInterval { file: file() })?;
    let time_s = segment.time.to_vec();
    let interval_s = segment.time.interval_s().unwrap_or(f64::NAN);
    let devices = own.device.inputs().iter().map(names::kind_of);
    let mut volts: Vec<&[f64]> = Vec::new();
    for (column, kind) in inputs.iter().zip(devices) {
        volts.push(recording.column_of(column, kind)?.of(segment));
    }
    let signals = signals_of((experiment, own), measures, channels, (recording, segment))?;
    let ago = events_ago(settings, &columns, (recording, segment))?;
    let happened = |(event, rows): (&EventSettings, &Vec<Option<f64>>)| {
        let rows = rows.iter().take(at_most.saturating_add(1)).enumerate();
        let told = rows.filter_map(|(row, ago_s)| Some((row, time_s.get(row)? - (*ago_s)?))).collect();
        EventTimes { settings: *event, found: FoundEvents::Recorded(told) }
    };
    let whole = |k: &usize| {
        let finite = |values: &[f64]| values.get(*k).is_some_and(|value| value.is_finite());
        volts.iter().all(|values| finite(values))
            && signals.iter().all(|(_, signal)| *k == 0 || finite(signal))
    };
    let rows = (0..time_s.len()).take_while(whole).count();
    let measured_at = |k: usize| signals.iter().map(|(_, signal)| signal[k]).collect::<Vec<f64>>();
    let measured: Vec<Vec<f64>> = (0..rows).map(measured_at).collect();
    if rows <= at_least {
        return Err(ExportError::Samples { file: file(), asked: at_least, found: rows.saturating_sub(1) });
    }
    let (count, lag) = (at_most.min(rows.saturating_sub(1)), InterpolationLag::of(experiment));
    if count == 0 {
        return Ok(RecordedSamples::default());
    }
    let sampled = |values| SegmentDrive::new(&time_s[..rows], values, interval_s).waiting_for(lag);
    let mut drives: Vec<SegmentDrive<'_>> = volts.iter().map(|values| sampled(&values[..rows])).collect();
    let rates = rates_of_inputs(&own.device, &drives, interval_s);
    drives.extend(rates.iter().map(|values| sampled(values)));
    let start_s = time_s.first().copied().unwrap_or(0.0);
    let sines = AxisSines::first(own, InputRows { inputs: &drives, interval_s }, start_s + settings.skip_s);
    let about_hz = settings.sine.as_ref().and_then(|sine| filter.about_of(sine.frequency()));
    let stated = about_hz.map(|frequency_hz| MotionRate { frequency_hz, is_driven: false });
    let motion = stated.or_else(|| sines.as_ref().map(|sines| sines.slowest(own)));
    let motion = motion
        .unwrap_or_else(|| self::motion(own, drives.iter().find_map(SegmentDrive::first_sine), interval_s));
    let data = EquationSegment {
        place: &file(),
        start_s,
        time_s: &time_s[..=count],
        inputs: drives,
        stated_inputs: own.device.own_inputs(),
        known: Vec::new(),
        events: settings.events.iter().zip(&ago).map(happened).collect(),
        bends: Vec::new(),
        channels: channels_of(own, &signals),
        samples: SampleSelection::whole(count + 1, interval_s),
        motion,
        sines: sines.as_ref(),
    };
    let models = filter.models().map_err(|error| ExportError::from(refused(experiment, &error)))?;
    let failed =
        |why: EstimateError| ExportError::Filter { filter: filter.basics.name.clone(), why: why.to_string() };
    let mut past = FilterPast::default();
    let start = start_in(&EquationFilterTask::of(settings, filter, &models, &data), &models, &mut past);
    let start = start.map_err(failed)?;
    // The first row that is followed, and the one at which the source starts.
    let first = start.as_ref().map_or(0, |(_, row)| row + 1);
    let begins = first.saturating_sub(1);
    if start.is_some() && count < first + at_least {
        return Err(ExportError::Samples { file: file(), asked: first + at_least, found: count });
    }
    let every = request.update_every.get() as usize;
    let mut corrected = signals.clone();
    for (k, value) in corrected.iter_mut().flat_map(|(_, signal)| signal.iter_mut().enumerate()) {
        if k.checked_sub(begins + 1).is_none_or(|k| k % every != 0) {
            *value = f64::NAN;
        }
    }
    let samples = SampleSelection { fresh: first..count + 1, ends: true, interval_s };
    let behind = EquationSegment { channels: channels_of(own, &corrected), samples, ..data.clone() };
    let way = EquationFilterTask::of(settings, filter, &models, &behind);
    let found = way.follow(&mut past).map_err(failed)?;
    let Some(trajectory) = found.first() else { return Err(ExportError::NoInterval { file: file() }) };
    let again = trajectory.restarts.first().map_or(f64::INFINITY, |restart| restart.time_s);
    let count = begins + time_s[begins + 1..=count].iter().take_while(|time_s| **time_s < again).count();
    let sample = |k: usize| {
        let (expected, expected_sd) = answer_at(own, filter, trajectory, k - first);
        TestSample {
            inputs: inputs_before(&data, &own.between, k),
            measured: measured[k].clone(),
            events: filter.events.iter().map(|used| ago[used.event].get(k).copied().flatten()).collect(),
            expected,
            expected_sd,
        }
    };
    let each = (begins + 1..=count).map(sample).collect();
    Ok(RecordedSamples { start: start.map(|(known, row)| (known, time_s[row])), each })
}

/// What the recording has of each measurement.
fn signals_of(
    (experiment, own): (&Experiment, &OwnDevice),
    measures: &[EmitMeasure],
    channels: &[(usize, &str)],
    (recording, segment): (&SampledRecording, &Segment),
) -> Result<Vec<(EmitMeasure, Vec<f64>)>, ExportError> {
    let mut signals = Vec::new();
    for measure in measures {
        let column = channels.iter().find(|(place, _)| *place == measure.measure);
        let Some((place, column)) = column else {
            let why = "a measurement of the filter is no channel of the recording; leave `--samples` out"
                .to_owned();
            return Err(experiment.error("recording", ConfigFault::Value { why }).into());
        };
        let kind = names::kind_of(&own.device.measures()[*place]);
        signals.push((*measure, recording.column_of(column, kind)?.of(segment).to_vec()));
    }
    Ok(signals)
}

fn channels_of<'a>(own: &'a OwnDevice, signals: &'a [(EmitMeasure, Vec<f64>)]) -> Vec<SegmentChannel<'a>> {
    let of = |(measure, signal): &'a (EmitMeasure, Vec<f64>)| {
        SegmentChannel::of(&own.device, measure.measure, measure.variance, signal)
    };
    signals.iter().map(of).collect()
}

/// What a filter that takes its start from the signal knows behind the first row that corrects it, and that row; it goes on from there.
fn start_in(
    way: &EquationFilterTask<'_>,
    models: &[EquationModel],
    past: &mut FilterPast,
) -> Result<Option<(MeanAndCovariance, usize)>, EstimateError> {
    let Some(model) = models.first().filter(|_| way.filter.stated().is_none()) else { return Ok(None) };
    let Some(start) = way.start(model, &way.channels(), 1)? else { return Ok(None) };
    let samples = SampleSelection { fresh: 0..start.row + 1, ends: false, ..way.data.samples.clone() };
    let data = EquationSegment { samples, ..way.data.clone() };
    EquationFilterTask { data: &data, ..*way }.follow(past)?;
    Ok(past.left().map(|known| (known.clone(), start.row)))
}

/// States and values of parameters as the source has them, at a sample of a trajectory, and the standard deviations that are claimed of
/// them.
fn answer_at(
    own: &OwnDevice,
    filter: &EquationFilterSettings,
    trajectory: &Trajectory,
    k: usize,
) -> (Vec<f64>, Vec<f64>) {
    let states = own.device.states().len();
    let answer = |state: &StateSeries| (state.mean[k], state.sd.get(k).copied().unwrap_or(0.0));
    let of_states = trajectory.states.iter().take(states).map(answer);
    let tracked = trajectory.states.iter().skip(states).zip(filter.basics.parameters());
    let of_parameters = tracked.map(|(state, tracked)| {
        let stated = own.device.parameter(tracked.parameter.name).and_then(|place| own.values.get(place));
        let ((mean, sd), scale) = (answer(state), tracked.added.scale);
        (stated.copied().unwrap_or(f64::NAN) + mean * scale, sd * scale.abs())
    });
    of_states.chain(of_parameters).unzip()
}

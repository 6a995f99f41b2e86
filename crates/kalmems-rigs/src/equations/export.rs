//! A filter of a device of one's own as source code for a microcontroller.

use super::axes::{AxisSines, InputRows};
use super::course::{EquationSegment, SegmentChannel};
use super::event_times::{EventTimes, FoundEvents};
use super::events::{EventSettings, EventTimeSource, FilterEventUse};
use super::feedthrough_course::measured;
use super::filter_settings::EquationFilterSettings;
use super::filter_task::{EquationFilterTask, at_rest};
use super::interpolation::Interpolation;
use super::judged_axes::motion;
use super::model::{EquationModel, Interval};
use super::own_device::OwnDevice;
use super::sampled_inputs::rates_of_inputs;
use super::settings::EquationSettings;
use super::table::refused;
use super::{EquationColumns, names};
use crate::Rig;
use crate::config::{ConfigFault, Experiment, Key, Method, Variant};
use crate::estimate::driven::{InterpolationLag, SegmentDrive};
use crate::estimate::{
    AnyFilter, EstimateError, FALSE_REJECTIONS, FilterPast, GainOf, GateMode, MeanAndCovariance, MotionRate,
    SampleSelection, Sensor, StateSeries, Tracked, Trajectory, Transition, largest_nis, memory_samples,
};
use crate::export::{
    ExportError, ExportRequest, Exported, SourceCost, SourceDigits, SourceLanguage, SourceTrial, c_name,
    checksum, heading, place_of_filter,
};
use crate::recording::{SampledRecording, Segment};
use crate::units::{Value, kind};
use kalmems_equations::{
    EmitDigits, EmitEvent, EmitGain, EmitLanguage, EmitMeasure, EmitRequest, EmitWatch, EmittedFilter,
    FreeParameter, InputCourse, SettledGain, StateStart, StepMethod, TestSample, TestVectors,
};

/// The largest difference from what the library's filter says, relative to the largest size of each state, with which a source still
/// passes its own test: numbers of 32 bits have seven digits, and a covariance that has not settled costs some.
const TOLERANCE: f64 = 1e-2;

/// How far the source may be from the library's filter in its rehearsal, by the standard deviation that the filter claims.
const APART: f64 = 0.02;

/// How many samples of the recording a filter is rehearsed over at most, to see how many digits it needs.
const REHEARSED: usize = 30_000;

/// Standard deviations by which a state is away from 0 from which on it is counted from where it starts.
const FAR: f64 = 10.0;

/// How the source watches its innovations: by the filter's gate, and where it has none by the usual bound, beyond which it takes samples all the same.
fn watch(taking: &GateMode, interval_s: f64, every: u32) -> EmitWatch {
    // The first sample is an interval behind the start.
    let settling = ((taking.after_s * (1.0 - 1e-12) / interval_s).ceil() - 1.0) / f64::from(every);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive counts, saturating
    let count = |samples: f64| samples.max(0.0).ceil() as u32;
    EmitWatch {
        largest_nis: taking.largest_nis.unwrap_or_else(|| largest_nis(FALSE_REJECTIONS)),
        rejects: taking.largest_nis.is_some(),
        settling: count(settling),
        memory: count(memory_samples(interval_s) - 0.5),
    }
}

/// The source of a filter; see [`Rig::export`].
#[allow(clippy::too_many_lines)] // one refusal after the other, each with its reason
pub fn export(experiment: &Experiment, request: &ExportRequest) -> Result<Exported, ExportError> {
    let measured = measured(experiment).map_err(|error| match error {
        EstimateError::Config(error) => error.into(),
        EstimateError::Read(error) => error.into(),
        other => ExportError::Filter { filter: request.filter.clone(), why: other.to_string() },
    })?;
    let experiment = measured.as_ref().unwrap_or(experiment);
    let place = place_of_filter(experiment, request)?;
    let settings = EquationSettings::of(experiment)?;
    let filter = &settings.filters[place];
    let own = &filter.own;
    let refuse =
        |why: &str| Err(ExportError::Filter { filter: filter.basics.name.clone(), why: why.to_owned() });
    if filter.variant != Variant::Full {
        return refuse("its `variant` takes the signal otherwise than by its derivative; leave that out");
    }
    let method = match filter.basics.method {
        Method::Ekf | Method::SteadyState | Method::Luenberger => StepMethod::RungeKutta,
        Method::EulerEkf => StepMethod::Euler,
        _ => {
            return refuse(
                "of a device that is described by equations, the methods `ekf`, `euler_ekf`, `steady_state` and `luenberger` can be \
                 exported",
            );
        }
    };
    if !filter.basics.readout.is_empty() {
        return refuse("it has states of its readout; leave `readout` out");
    }
    if !filter.known.is_empty() {
        return refuse("it is given states that no instrument has (`known`); leave that out");
    }
    if filter.noise_memory_s.is_some() {
        return refuse(
            "it finds the variance of a sample while filtering, and the source has that as a constant; leave `noise_memory` out",
        );
    }
    if own.device.has_resets() {
        return refuse(
            "its states are set at once where an expression passes zero, which the source does not do",
        );
    }
    if !own.device.varying_noise(&[]).map_err(|error| refused(experiment, &error))?.is_empty() {
        return refuse(
            "a noise of the device depends on its states or inputs, and the source has each as a constant",
        );
    }
    let (recording, interval_s) = recorded(experiment, request)?;
    let wrong = |error| ExportError::from(refused(experiment, &error));
    let model = filter.models().map_err(wrong)?;
    let Some(model) = model.first() else { return refuse("it has no model") };
    let parts = filter.basics.steps.filter(|_| method == StepMethod::RungeKutta).unwrap_or(1);
    let each_s = interval_s / parts as f64;
    let over = Interval::of(each_s);
    let mut heading = heading(experiment, request, &filter.basics.name, interval_s);
    if !settings.signs.is_empty() {
        heading.push(
            "The signal is the same for the mirrored motion, and the source mirrors nothing: its sign is that of the start.".to_owned(),
        );
    }
    if !own.corrections.is_empty() {
        heading.push(
            "The program corrects estimates by the line that they were found to follow (`correction`); the source gives them without that.".to_owned(),
        );
    }
    let name = c_name(&experiment.name.to_string());
    let states = own.device.states().len();
    let Some(known) = filter.stated() else {
        return refuse(
            "its source has no recording to take its start from; write the values of `start` and `start_sd`",
        );
    };
    let sd = |i: usize| known.lower.get(i * (i + 1) / 2 + i).copied().unwrap_or(0.0).sqrt();
    let cyclic = own.device.periods(&own.values).map_err(wrong)?;
    let start = |i: usize| {
        let mean = known.mean.get(i).copied().unwrap_or(0.0);
        let is_far = mean.abs() > FAR * sd(i) && cyclic.iter().all(|(state, _)| *state != i);
        StateStart { mean, origin: if is_far { mean } else { 0.0 }, typical: None }
    };
    let covariance = |i: usize, j: usize| if i == j { sd(i) * sd(i) } else { 0.0 };
    let square = |of: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
        (0..states).flat_map(|i| (0..states).map(move |j| (i, j))).map(|(i, j)| of(i, j)).collect()
    };
    let mut measures = measures(experiment, (own, filter), interval_s)?;
    if let Some((index, _)) = &recording {
        ranges(experiment, *index, &mut measures)?;
    }
    let events = events(&settings, filter)?;
    let gain = match (filter.basics.gain(), measures.as_slice()) {
        (None, _) => EmitGain::Covariance,
        (Some(gain), [measure]) => settled((own, filter, model), gain, *measure, interval_s)?,
        (Some(_), _) => return refuse("its gain is that of one measurement; name it in `channels`"),
    };
    let mut unread = None;
    let recorded = match &recording {
        Some(recording) => {
            let most = if request.verify { usize::MAX } else { REHEARSED.max(request.samples) };
            let count = (request.samples, most);
            match test_samples((experiment, request), (&settings, filter), recording, &measures, count) {
                // Nothing was asked for: there is no rehearsal, which the source says.
                Err(why) if request.samples == 0 && !request.verify => {
                    unread = Some(why);
                    Vec::new()
                }
                samples => samples?,
            }
        }
        None => Vec::new(),
    };
    if request.verify && recorded.is_empty() {
        return refuse("there are no samples of a recording to verify it with; leave `--verify` out");
    }
    let rehearsal: Vec<TestSample> = recorded.iter().take(REHEARSED.max(request.samples)).cloned().collect();
    if rehearsal.is_empty() {
        heading.push(match unread {
            None => "There was no recording over which to see how far it is from the estimate.".to_owned(),
            Some(why) => format!("The recording does not tell how far it is from the estimate: {why}."),
        });
    }
    let digits = match request.digits {
        SourceDigits::Double => EmitDigits::Double,
        SourceDigits::AsNeeded if !rehearsal.is_empty() => EmitDigits::AsNeeded,
        SourceDigits::AsNeeded | SourceDigits::Single => EmitDigits::Single,
    };
    let mut vectors = rehearsal.clone();
    vectors.truncate(request.samples);
    let emitted = EmitRequest {
        heading,
        interval_s: each_s,
        parts,
        method,
        linear: if method == StepMethod::RungeKutta { model.linear_at_rest() } else { Vec::new() },
        parameters: own.values.clone(),
        adjustable: adjustable(experiment, request, own)?,
        experiment: checksum(experiment),
        states: (0..states).map(start).collect(),
        start_covariance: square(&covariance),
        process_noise: square(&|i, j| model.covariance(&over, (i, j))),
        free: filter
            .basics
            .parameters()
            .iter()
            .enumerate()
            .filter_map(|(k, tracked)| free(own, tracked, model.covariance(&over, (states + k, states + k))))
            .collect(),
        courses: own.between.iter().map(|between| course(*between)).collect(),
        update_every: request.update_every.get(),
        watch: watch(&filter.basics.taking, interval_s, request.update_every.get()),
        mirrored: !settings.signs.is_empty(),
        vectors: (!vectors.is_empty()).then_some(TestVectors { samples: vectors, tolerance: TOLERANCE }),
        rehearsal,
        measures,
        events,
        gain,
        digits,
        name,
    };
    let language = match request.target {
        SourceLanguage::C => EmitLanguage::C,
        SourceLanguage::Rust => EmitLanguage::Rust,
    };
    let files = own
        .device
        .emit(&emitted, language)
        .map_err(|why| ExportError::Filter { filter: filter.basics.name.clone(), why: why.to_string() })?;
    let states = own.device.states().iter().map(|named| named.name.to_string());
    let names: Vec<String> =
        states.chain(filter.basics.parameters().iter().map(|one| one.parameter.name.to_owned())).collect();
    if let Some((state, share)) = files.apart.filter(|(_, share)| share.is_nan() || *share > APART) {
        return Err(ExportError::Rehearsal {
            filter: filter.basics.name.clone(),
            state: names.get(state).cloned().unwrap_or_default(),
            share,
        });
    }
    let cost = cost(&files, emitted.measures.len());
    let trial = request.verify.then(|| SourceTrial {
        given: recorded.iter().map(|sample| numbers_of(sample, &files.inputs)).collect(),
        expected: recorded
            .iter()
            .map(|sample| (sample.expected.clone(), sample.expected_sd.clone()))
            .collect(),
        periods: (0..names.len())
            .map(|k| cyclic.iter().find(|(state, _)| *state == k).map(|(_, period)| *period))
            .collect(),
        states: names,
    });
    let mut exported =
        Exported::of(experiment, request, (filter.basics.name.clone(), interval_s), files.files);
    (exported.trial, exported.cost) = (trial, Some(cost));
    Ok(exported)
}

/// What a step of it takes.
fn cost(files: &EmittedFilter, measurements: usize) -> SourceCost {
    let [all, wide] = [files.operations, files.wide_operations];
    SourceCost {
        in_32_bits: std::array::from_fn(|k| all[k] - wide[k]),
        in_64_bits: wide,
        numbers: files.numbers,
        measurements,
        bytes: files.bytes,
    }
}

/// The numbers of a sample as the program of a source reads them.
fn numbers_of(sample: &TestSample, inputs: &[(usize, usize)]) -> Vec<f64> {
    let at = |(input, point): &(usize, usize)| sample.inputs.get(*point)?.get(*input).copied();
    inputs.iter().filter_map(at).chain(sample.measured.iter().copied()).collect()
}

/// How an input goes between two samples, for the source.
const fn course(between: Interpolation) -> InputCourse {
    match between {
        Interpolation::Hold => InputCourse::HeldAtStart,
        Interpolation::Mean => InputCourse::HeldAtMiddle,
        Interpolation::Quintic
        | Interpolation::Cubic
        | Interpolation::Linear
        | Interpolation::Sine
        | Interpolation::BandLimited => InputCourse::Between,
    }
}

/// The places of the parameters that the program may change.
fn adjustable(
    experiment: &Experiment,
    request: &ExportRequest,
    own: &OwnDevice,
) -> Result<Vec<usize>, ExportError> {
    let known = || own.device.parameters().iter().map(|parameter| &*parameter.named.name);
    let place = |name: &String| {
        own.device.parameter(name).ok_or_else(|| {
            experiment.error("device.equations.parameters", ConfigFault::unknown_word(name, known())).into()
        })
    };
    request.adjustable.iter().map(place).collect()
}

fn free(own: &OwnDevice, tracked: &Tracked, walk: f64) -> Option<FreeParameter> {
    let parameter = own.device.parameter(tracked.parameter.name)?;
    let scale = tracked.added.scale.abs();
    Some(FreeParameter {
        parameter,
        start: own.values.get(parameter).copied()?,
        start_sd: tracked.sd * scale,
        scale: tracked.sd * scale,
        walk: walk * scale * scale,
    })
}

/// The measurements that correct the filter, with the variance of a sample of each.
fn measures(
    experiment: &Experiment,
    (own, filter): (&OwnDevice, &EquationFilterSettings),
    interval_s: f64,
) -> Result<Vec<EmitMeasure>, ExportError> {
    let variances = own.variances(interval_s.recip());
    let all: Vec<usize> = match filter.measures.as_slice() {
        [] => (0..variances.len()).collect(),
        some => some.to_vec(),
    };
    let of = |measure: usize| {
        let noise = variances.get(measure).copied().flatten().filter(|variance| *variance > 0.0);
        // What the filter takes a sample for, where that is not the noise.
        let variance = noise.and(filter.signal_variance).or(noise);
        variance.map(|variance| EmitMeasure { measure, variance, range: None }).ok_or_else(|| {
            let name =
                own.device.measures().get(measure).map(|named| named.name.to_string()).unwrap_or_default();
            let remedy = "write the variance of a sample of it; a filter weighs the samples by it".to_owned();
            let key = Key::from("device.equations.noise").child(&name);
            experiment.error(key, ConfigFault::MissingKey { remedy }).into()
        })
    };
    all.into_iter().map(of).collect()
}

/// The ranges of the instruments whose columns are measured, where the recording states them.
fn ranges(experiment: &Experiment, index: usize, measures: &mut [EmitMeasure]) -> Result<(), ExportError> {
    let columns = EquationColumns::of(experiment, index)?;
    let layout = super::EquationsRig.layout(experiment, index)?;
    for measure in measures {
        let column = columns.measured.iter().find(|(place, _)| *place == measure.measure);
        let declared = column.and_then(|(_, name)| layout.declared.iter().find(|one| one.column == *name));
        // The range is that of values before they are compensated.
        let reading = declared.and_then(|one| one.reading.as_ref()).filter(|one| one.compensation.is_none());
        measure.range = reading.and_then(|one| one.range.as_ref()).map(|ends| ends.each_ref().map(Value::si));
    }
    Ok(())
}

/// The events that correct the filter.
fn events(
    settings: &EquationSettings,
    filter: &EquationFilterSettings,
) -> Result<Vec<EmitEvent>, ExportError> {
    let of = |used: &FilterEventUse| {
        let event = &settings.events[used.event];
        let refuse = |why: &str| {
            let why = format!("of the event `{}`, {why}", event.name);
            Err(ExportError::Filter { filter: filter.basics.name.clone(), why })
        };
        if matches!(event.source, EventTimeSource::Signal { .. }) {
            return refuse(
                "the detector is not part of the exported source; leave `signal` out of `[estimate.events]`, and the program that calls the \
                 source passes the time of the event",
            );
        }
        if used.gate_nis.is_some() {
            return refuse("the exported source uses every event and has no gate; leave `gate` out");
        }
        if used.value != 0.0 {
            return refuse(
                "the exported source takes its expression for zero; write it so, and leave `value` out",
            );
        }
        let own = (event.time_variance == 0.0).then_some(event.variance);
        match used.variance.or(own) {
            Some(variance) => Ok(EmitEvent { event: event.event, variance }),
            None => refuse(
                "the standard deviation depends on the rate of its expression in each sample; give the filter a constant one by `sd`",
            ),
        }
    };
    filter.events.iter().map(of).collect()
}

/// The constant gain of a filter, in SI.
fn settled(
    (own, filter, model): (&OwnDevice, &EquationFilterSettings, &EquationModel),
    gain: GainOf,
    EmitMeasure { measure, variance, .. }: EmitMeasure,
    interval_s: f64,
) -> Result<EmitGain, ExportError> {
    // A filter that starts from the signal was refused before.
    let known = filter.stated().unwrap_or_default();
    let made = |rest: &MeanAndCovariance, step: &dyn Transition, sensor: &dyn Sensor| {
        AnyFilter::constant_gain_of((gain, interval_s), (rest, &known), (step, sensor, variance))
    };
    let (mut gain, innovation) = at_rest(own, model, (measure, interval_s), made)
        .map_err(|why| ExportError::Filter { filter: filter.basics.name.clone(), why })?;
    let parameters = gain.iter_mut().skip(own.device.states().len());
    parameters.zip(filter.basics.parameters()).for_each(|(gain, tracked)| *gain *= tracked.added.scale);
    Ok(EmitGain::Settled(vec![SettledGain { gain, variance: innovation }]))
}

/// The first recording that is estimated with its index, where there is one, and the interval in s between samples.
fn recorded(
    experiment: &Experiment,
    request: &ExportRequest,
) -> Result<(Option<(usize, SampledRecording)>, f64), ExportError> {
    if let Some(interval_s) = request.interval_s {
        if request.samples > 0 {
            return Err(ExportError::SamplesOfAnotherRate);
        }
        return Ok((None, interval_s));
    }
    let rig = super::EquationsRig;
    let wanted = if experiment.recordings.is_empty() { Vec::new() } else { rig.wanted(experiment)? };
    let Some(index) = wanted.first().copied() else {
        let why = "there is no recording to take the sampling interval from; give `--rate`".to_owned();
        return Err(experiment.error("recording", ConfigFault::Value { why }).into());
    };
    let file = experiment.resolve(&experiment.recording(index)?.file);
    let recording = SampledRecording::read(&file, &rig.layout(experiment, index)?)?;
    let interval_s = recording.segments().first().and_then(|segment| segment.time.interval_s());
    let Some(interval_s) = interval_s else {
        return Err(ExportError::NoInterval { file: recording.source().file.clone() });
    };
    Ok((Some((index, recording)), interval_s))
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

/// The first samples of the recording, so many at least and at most, with the states that the library's filter has behind each.
///
/// Where the library's filter has lost its signal and is started again, the source is not: the samples end before that.
///
/// The source predicts before it corrects. The first row is therefore where the filter starts, without a correction, and the samples
/// are those behind it.
fn test_samples(
    (experiment, request): (&Experiment, &ExportRequest),
    (settings, filter): (&EquationSettings, &EquationFilterSettings),
    (index, recording): &(usize, SampledRecording),
    measures: &[EmitMeasure],
    (at_least, at_most): (usize, usize),
) -> Result<Vec<TestSample>, ExportError> {
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
    let mut signals: Vec<(EmitMeasure, Vec<f64>)> = Vec::new();
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
    // The first row, and those by which the source does not correct.
    let every = request.update_every.get() as usize;
    for (k, value) in signals.iter_mut().flat_map(|(_, signal)| signal.iter_mut().enumerate()) {
        if k.checked_sub(1).is_none_or(|k| k % every != 0) {
            *value = f64::NAN;
        }
    }
    if rows <= at_least {
        return Err(ExportError::Samples { file: file(), asked: at_least, found: rows.saturating_sub(1) });
    }
    let (count, lag) = (at_most.min(rows.saturating_sub(1)), InterpolationLag::of(experiment));
    if count == 0 {
        return Ok(Vec::new());
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
        channels: signals
            .iter()
            .map(|(measure, signal)| {
                SegmentChannel::of(&own.device, measure.measure, measure.variance, signal)
            })
            .collect(),
        samples: SampleSelection::whole(count + 1, interval_s),
        motion,
        sines: sines.as_ref(),
    };
    let models = filter.models().map_err(|error| ExportError::from(refused(experiment, &error)))?;
    let way = EquationFilterTask::of(settings, filter, &models, &data);
    let found = way
        .follow(&mut FilterPast::default())
        .map_err(|why| ExportError::Filter { filter: filter.basics.name.clone(), why: why.to_string() })?;
    let Some(trajectory) = found.first() else { return Err(ExportError::NoInterval { file: file() }) };
    let again = trajectory.restarts.first().map_or(f64::INFINITY, |restart| restart.time_s);
    let count = time_s[1..=count].iter().take_while(|time_s| **time_s < again).count();
    let sample = |k: usize| {
        let (expected, expected_sd) = answer_at(own, filter, trajectory, k);
        TestSample {
            inputs: inputs_before(&data, &own.between, k),
            measured: measured[k].clone(),
            events: filter.events.iter().map(|used| ago[used.event].get(k).copied().flatten()).collect(),
            expected,
            expected_sd,
        }
    };
    Ok((1..=count).map(sample).collect())
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

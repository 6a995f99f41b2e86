//! A filter of a device of one's own as source code for a microcontroller.

use super::EquationColumns;
use super::events::{EventTimeSource, FilterEventUse};
use super::export_samples::{RecordedSamples, recorded_samples};
use super::feedthrough_course::measured;
use super::filter_settings::EquationFilterSettings;
use super::filter_task::at_rest;
use super::interpolation::Interpolation;
use super::model::{EquationModel, Interval};
use super::own_device::OwnDevice;
use super::settings::EquationSettings;
use super::table::refused;
use crate::Rig;
use crate::config::{ConfigFault, Experiment, Key, Method, Variant};
use crate::estimate::{
    AnyFilter, EstimateError, FALSE_REJECTIONS, GainOf, GateMode, MeanAndCovariance, Sensor, Tracked,
    Transition, largest_nis, memory_samples,
};
use crate::export::{
    ExportError, ExportRequest, Exported, SourceCost, SourceDigits, SourceLanguage, SourceTrial, c_name,
    checksum, heading, place_of_filter,
};
use crate::recording::SampledRecording;
use crate::units::Value;
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
            match recorded_samples((experiment, request), (&settings, filter), recording, &measures, count) {
                // Nothing was asked for: there is no rehearsal, which the source says.
                Err(why) if request.samples == 0 && !request.verify => {
                    unread = Some(why);
                    RecordedSamples::default()
                }
                samples => samples?,
            }
        }
        None => RecordedSamples::default(),
    };
    let RecordedSamples { start: found, each: recorded } = recorded;
    if let Some((_, time_s)) = &found {
        heading
            .push(format!("Its start is the one that the recording tells, behind the sample at {time_s} s."));
    }
    let Some(known) = filter.stated().or(found.map(|(known, _)| known)) else {
        return refuse(
            "its source has no recording to take its start from; write the values of `start` and `start_sd`",
        );
    };
    let tracked = filter.basics.parameters();
    let size = states + tracked.len();
    let unit = |i: usize| i.checked_sub(states).map_or(1.0, |k| tracked[k].added.scale);
    let covariance = |i: usize, j: usize| {
        let (low, high) = (i.min(j), i.max(j));
        let stated = known.lower.get(high * (high + 1) / 2 + low).copied();
        let prior = || tracked.get(high.checked_sub(states)?).filter(|_| i == j).map(|one| one.sd * one.sd);
        stated.or_else(prior).unwrap_or(0.0) * unit(i) * unit(j)
    };
    let cyclic = own.device.periods(&own.values).map_err(wrong)?;
    let start = |i: usize| {
        let mean = known.mean.get(i).copied().unwrap_or(0.0);
        let is_far =
            mean.abs() > FAR * covariance(i, i).sqrt() && cyclic.iter().all(|(state, _)| *state != i);
        StateStart { mean, origin: if is_far { mean } else { 0.0 }, typical: None }
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
        start_covariance: square(size, &covariance),
        process_noise: square(states, &|i, j| model.covariance(&over, (i, j))),
        free: filter
            .basics
            .parameters()
            .iter()
            .enumerate()
            .filter_map(|(k, tracked)| {
                let mean = known.mean.get(states + k).copied().unwrap_or(0.0);
                free(own, (tracked, mean), model.covariance(&over, (states + k, states + k)))
            })
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
    let made = (filter.basics.name.clone(), interval_s);
    let mut exported = Exported::of(experiment, request, made, files.files);
    (exported.trial, exported.cost) = (trial, Some(cost));
    (exported.columns, exported.states) = (files.columns, files.states);
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

/// A parameter that is a state, with its mean by that state's unit.
fn free(own: &OwnDevice, (tracked, mean): (&Tracked, f64), walk: f64) -> Option<FreeParameter> {
    let parameter = own.device.parameter(tracked.parameter.name)?;
    let scale = tracked.added.scale.abs();
    Some(FreeParameter {
        parameter,
        start: own.values.get(parameter)? + mean * tracked.added.scale,
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
    let Some(known) = filter.stated() else {
        return Err(ExportError::Filter {
            filter: filter.basics.name.clone(),
            why: "its gain is that of a stated start; write the values of `start` and `start_sd`".to_owned(),
        });
    };
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

/// A matrix row by row.
fn square(size: usize, of: &dyn Fn(usize, usize) -> f64) -> Vec<f64> {
    (0..size).flat_map(|i| (0..size).map(move |j| (i, j))).map(|(i, j)| of(i, j)).collect()
}

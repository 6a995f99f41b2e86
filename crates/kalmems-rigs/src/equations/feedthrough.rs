//! What an input makes of signals beside the motion, as through an amplifier: the sine that the input follows, scaled and turned, is taken off before
//! filters take the signals.

use super::EquationColumns;
use super::course::SegmentChannel;
use super::followed_sine::{DriveSine, NUMBERS, leaves_at};
use super::names::kind_of;
use super::ordered::{OfElement, Ordered};
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{AnyValue, ConfigError, ConfigFault, Experiment, Key, RecordingRole, Sign};
use crate::estimate::driven::SegmentDrive;
use crate::estimate::{EstimateError, RowsAround, SignalSegment};
use crate::progress::Progress;
use crate::recording::{SampledRecording, Segment};
use crate::signal::{Sine, fit_sine, fit_sine_at};
use crate::units::{Dimension, Kind, Unit, kind};
use kalmems_core::Portable;
use kalmems_equations::{Device, VectorElement};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

/// A steady sinusoidal input that reaches the signals beside the motion. A recording with the role `bias_on` takes what it makes of them from its
/// counterpart with the role `bias_off`, record by record; another one from what is stated here. An input that leaves its sine is refused.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FeedthroughTable {
    /// The input.
    pub of: String,
    /// What of it reaches a signal, such as `signal = { gain = "3e-4", slope = "5e-8 s" }`; nothing if left out.
    #[serde(default, skip_serializing_if = "Ordered::is_empty")]
    pub signals: Ordered<SignalFeedthrough>,
}

/// What of an input reaches a signal: `gain` times the input and `slope` times its rate of change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SignalFeedthrough {
    /// Of the input.
    pub gain: AnyValue,
    /// Of its rate of change.
    pub slope: AnyValue,
}

impl OfElement for SignalFeedthrough {
    fn of_element(&self, _: &VectorElement) -> Result<Self, String> {
        Ok(self.clone())
    }
}

/// The same of a device, by places.
#[derive(Clone, Debug)]
pub struct InputFeedthrough {
    /// The input.
    pub input: usize,
    /// Of each measurement what is stated: g and g′ of g·u + g′·u̇, in SI.
    pub stated: Vec<Option<[f64; 2]>>,
    /// The state that oscillates and its rate, where the table says so.
    pub oscillates: Option<[usize; 2]>,
}

/// The kind of a quotient of a measurement and an input, times a power of the time.
pub fn quotient(above: Dimension, below: Dimension, of_time: i16) -> &'static Kind {
    let inverse = below.to_half_power(-2).unwrap_or(Dimension::NONE);
    let dimension = above.times(inverse).times(Dimension::of([0, 0, of_time, 0, 0, 0]));
    let text = dimension.to_string();
    Unit::parse(&text).map_or(&kind::RATIO, |unit| Kind::of_unit(unit, &text))
}

impl InputFeedthrough {
    /// Of an experiment's device, where its table has one.
    pub fn of(
        experiment: &Experiment,
        table: &EquationsTable,
        device: &Device,
    ) -> Result<Option<Self>, ConfigError> {
        let Some(stated) = &table.feedthrough else { return Ok(None) };
        let at = || Key::from("device.equations.feedthrough");
        let own = &device.inputs()[..device.own_inputs()];
        let Some(input) = own.iter().position(|input| *input.name == *stated.of) else {
            let known = own.iter().map(|input| &*input.name);
            return Err(experiment.error(at().child("of"), ConfigFault::unknown_word(&stated.of, known)));
        };
        let measures = device.measures();
        let mut all = vec![None; measures.len()];
        for (name, share) in stated.signals.iter() {
            let at = at().child("signals").child(name);
            let Some(place) = measures.iter().position(|measure| *measure.name == *name) else {
                let known = measures.iter().map(|measure| &*measure.name);
                return Err(experiment.error(at, ConfigFault::unknown_key(name, known)));
            };
            let dimensions = [&measures[place], &own[input]].map(|named| kind_of(named).dimension);
            let value = |key: &str, value, of_time| {
                let kind = quotient(dimensions[0], dimensions[1], of_time);
                experiment.value(at.clone().child(key), value, kind, Sign::Any)
            };
            all[place] = Some([value("gain", &share.gain, 0)?, value("slope", &share.slope, 1)?]);
        }
        Ok(Some(Self { input, stated: all, oscillates: oscillates(table, device) }))
    }

    /// Whether a signal of the device carries a share that is stated.
    pub fn is_stated(&self) -> bool {
        self.stated.iter().any(Option::is_some)
    }
}

/// The state that a table says to oscillate, and its rate.
fn oscillates(table: &EquationsTable, device: &Device) -> Option<[usize; 2]> {
    let of = table.oscillation.as_ref()?.of.first()?;
    let rate = device.state(table.derivative.get(of)?.trim())?;
    Some([device.state(of)?, rate])
}

/// A record with the bias off: its input, and the sine of the input's frequency in each signal.
#[derive(Clone, Debug)]
pub struct BiasOffRecord {
    /// The record's label.
    pub label: String,
    /// Its input.
    pub drive: Sine,
    /// What the signals hold of it, offset included.
    pub signals: Vec<Sine>,
    /// Samples that they were fitted to.
    pub samples: usize,
}

impl BiasOffRecord {
    /// From the input and the signals of a record. `None` where a signal has too few samples.
    pub fn of(label: &str, time_s: &[f64], drive: Sine, signals: &[&[f64]]) -> Option<Self> {
        let fitted = signals.iter().map(|signal| fit_sine_at(time_s, signal, drive.frequency_hz));
        Some(Self {
            label: label.to_owned(),
            drive,
            signals: fitted.collect::<Option<_>>()?,
            samples: time_s.len(),
        })
    }

    /// A signal of the record with the bias on without what the input alone makes of it.
    ///
    /// The sine of the record with the bias off is scaled and turned by the ratio of the phasors of the inputs of both
    /// records: neither their amplitudes nor their triggers need to agree. It has the input's frequency alone; the
    /// harmonics are not touched and get no noise from it. The offset is taken away too.
    pub fn cancel(&self, signal: usize, time_s: &[f64], drive: &Sine, values: &[f64]) -> Vec<f64> {
        let Some(alone) = self.signals.get(signal) else { return values.to_vec() };
        let turned = Sine {
            offset: alone.offset,
            amplitude: alone.amplitude * drive.amplitude / self.drive.amplitude,
            frequency_hz: drive.frequency_hz,
            phase_rad: alone.phase_rad + drive.phase_rad - self.drive.phase_rad,
            residual_rms: 0.0,
        };
        time_s.iter().zip(values).map(|(t, y)| y - turned.at(*t)).collect()
    }

    /// The same as g and g′ of y = g·u + g′·u̇.
    pub fn gain_and_slope(&self, signal: usize) -> Option<[f64; 2]> {
        let alone = self.signals.get(signal)?;
        let ratio = alone.amplitude / self.drive.amplitude;
        let (sine, cosine) = (alone.phase_rad - self.drive.phase_rad).portable_sin_cos();
        Some([ratio * cosine, ratio * sine / (TAU * self.drive.frequency_hz)])
    }

    /// The standard deviation of each component of what is taken away from a signal, for each unit of the input.
    pub fn sd_per_unit(&self, signal: usize) -> Option<f64> {
        Some(self.signals.get(signal)?.component_sd(self.samples) / self.drive.amplitude)
    }
}

/// A signal without g·u + g′·u̇ of an input that is this sine.
pub fn without_drive(time_s: &[f64], drive: &Sine, signal: &[f64], [gain, slope]: [f64; 2]) -> Vec<f64> {
    let rate = TAU * drive.frequency_hz;
    let part = |t: f64| {
        let (sine, cosine) = (rate * t + drive.phase_rad).portable_sin_cos();
        drive.amplitude * (gain * cosine - slope * rate * sine)
    };
    time_s.iter().zip(signal).map(|(t, y)| y - part(*t)).collect()
}

/// The largest part by which the frequencies of inputs of records that belong together may differ.
const SAME_FREQUENCY: f64 = 1e-4;

/// Why a record cannot be used with another one, whose input differs in frequency: what the input alone makes of a signal depends on it, and the motion
/// near a resonance depends on it strongly.
pub fn differs_in_frequency(drive: &Sine, (other, of_other): (&str, &Sine)) -> Option<String> {
    let frequency_hz = of_other.frequency_hz;
    ((drive.frequency_hz / frequency_hz - 1.0).abs() > SAME_FREQUENCY).then(|| {
        format!(
            "its drive has {:.2} Hz, where {other} has {frequency_hz:.2} Hz; records that are used together need one \
             frequency, or what the drive alone makes of the signal does not cancel: record them with the same \
             generator settings",
            drive.frequency_hz
        )
    })
}

/// Refuses a recording with the bias on without a counterpart with the bias off, of a device whose table says what is taken off. The place of the
/// counterpart, of a recording that needs one.
pub fn counterpart(experiment: &Experiment, index: usize) -> Result<Option<usize>, ConfigError> {
    if experiment.recording(index)?.role != RecordingRole::BiasOn {
        return Ok(None);
    }
    let (table, _) = EquationsTable::of(experiment)?;
    if table.feedthrough.is_none() {
        let why = "the role `bias_on` is for a device whose table says what reaches its signals beside the motion; write \
                   `[device.equations.feedthrough]` with the input, such as `of = \"drive\"`, or give the recording the role `test`";
        let key = Key::from("recording").index(index).child("role");
        return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
    }
    let place = experiment.recordings.iter().position(|other| other.role == RecordingRole::BiasOff);
    place.map(Some).ok_or_else(|| {
        let why = "a recording has the role `bias_on` and none has `bias_off`: what of the signals is the drive's and not \
                   the motion's is not known. Record the same drives with the sensing bias off and add them as a \
                   `[[recording]]` with `role = \"bias_off\"` and the same labels; or, where the signals state their \
                   `feedthrough`, give the recording the role `test`"
            .to_owned();
        experiment.error("recording", ConfigFault::Value { why })
    })
}

/// A recording with the bias off.
pub struct BiasOffRecording<'a> {
    name: String,
    recording: Arc<SampledRecording>,
    columns: EquationColumns<'a>,
}

impl<'a> BiasOffRecording<'a> {
    /// Reads that of an experiment, by its place.
    pub fn read(
        experiment: &'a Experiment,
        index: usize,
        progress: &dyn Progress,
    ) -> Result<Self, EstimateError> {
        let (described, columns) = (experiment.recording(index)?, EquationColumns::of(experiment, index)?);
        let layout = described.layout(&columns.all());
        let path = experiment.resolve(&described.file);
        let of = (&*path, &layout);
        let recording =
            SampledRecording::read_beside(of, experiment.beside(), &mut |done, _| progress.reached(done))?;
        let name =
            described.name.as_ref().map_or_else(|| recording.source().file.clone(), ToString::to_string);
        Ok(Self { name, recording, columns })
    }

    /// The counterpart of a record with this label, whose input is this sine.
    fn record(
        &self,
        device: &Device,
        (input, label): (usize, &str),
        (place, drive): (&str, &Sine),
    ) -> Result<BiasOffRecord, EstimateError> {
        let unfit = |place: &str, why: String| EstimateError::Unfit { place: place.to_owned(), why };
        let segments = self.recording.segments();
        let Some(segment) = segments.iter().find(|segment| segment.label == label) else {
            let known: Vec<String> = segments.iter().map(|own| format!("`{}`", own.label)).collect();
            let why = format!(
                "its counterpart with the bias off is missing: `{}` has {}; record it there under the label `{label}`",
                self.name,
                known.join(", ")
            );
            return Err(unfit(place, why));
        };
        let own_place =
            if label.is_empty() { self.name.clone() } else { format!("{}, record `{label}`", self.name) };
        self.columns.require_usable(self.recording.diagnosis(), &own_place, |own| own == label)?;
        let record = self.of_segment(device, input, (segment, &own_place))?;
        match differs_in_frequency(&record.drive, (place, drive)) {
            Some(why) => Err(unfit(&own_place, why)),
            None => Ok(record),
        }
    }

    /// One of its records.
    fn of_segment(
        &self,
        device: &Device,
        input: usize,
        (segment, own_place): (&Segment, &str),
    ) -> Result<BiasOffRecord, EstimateError> {
        let unfit = |why: String| EstimateError::Unfit { place: own_place.to_owned(), why };
        let time_s = segment.time.to_vec();
        let column = self.columns.inputs[input];
        let volts = self.recording.column_of(column, kind_of(&device.inputs()[input]))?.of(segment);
        let sine = segment.time.interval_s().and_then(|interval_s| fit_sine(&time_s, volts, interval_s));
        let sine = sine.filter(Sine::is_steady).ok_or_else(|| {
            let why = format!(
                "the drive `{column}` is not a steady sine; expected at least three cycles of one frequency"
            );
            unfit(why)
        })?;
        let signals = self.columns.measured.iter().map(|(measure, column)| {
            Ok(self.recording.column_of(column, kind_of(&device.measures()[*measure]))?.of(segment))
        });
        let signals: Vec<&[f64]> = signals.collect::<Result<_, EstimateError>>()?;
        BiasOffRecord::of(own_place, &time_s, sine, &signals).ok_or_else(|| {
            unfit("a signal has too few samples for a sine of the drive's frequency".to_owned())
        })
    }

    /// g and g′ of each measurement, the mean over its records.
    pub fn mean(&self, device: &Device, input: usize) -> Result<Vec<Option<[f64; 2]>>, EstimateError> {
        let mut sums = vec![None; device.measures().len()];
        let segments = self.recording.segments();
        for segment in segments {
            let record = self.of_segment(device, input, (segment, &self.name))?;
            for (place, (measure, _)) in self.columns.measured.iter().enumerate() {
                let known = record.gain_and_slope(place).unwrap_or([f64::NAN; 2]);
                let sum: &mut [f64; 2] = sums[*measure].get_or_insert([0.0; 2]);
                sum.iter_mut().zip(known).for_each(|(sum, one)| *sum += one / segments.len() as f64);
            }
        }
        Ok(sums)
    }

    /// The place of a measurement among its signals.
    fn place_of(&self, measure: usize) -> Option<usize> {
        self.columns.measured.iter().position(|(own, _)| *own == measure)
    }
}

/// What is taken off the signals of a part.
#[derive(Clone, Debug, Default)]
pub struct TakenOff {
    /// The sines that the input follows, each with the rows that it is for.
    pub sines: Vec<(Range<usize>, Sine)>,
    /// Of each channel, the standard deviation of each component of what was taken off, for each unit of the input; 0 of what is stated.
    pub sd: Vec<f64>,
}

/// What is kept of a segment from one part to the next.
#[derive(Debug, Default)]
pub struct FeedthroughPast {
    record: Option<BiasOffRecord>,
    sine: Option<DriveSine>,
}

impl FeedthroughPast {
    /// What another run needs to go on from here.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        self.sine.iter().flat_map(DriveSine::numbers)
    }

    /// The sines that an input follows over the rows of a part; another run has left these numbers, the last of which are of its sine. `Err` is the time
    /// in s from which on it follows none.
    fn followed(
        &mut self,
        input: &SegmentDrive<'_>,
        (segment, block): (&SignalSegment<'_>, usize),
        written: &[f64],
    ) -> Result<Vec<(Range<usize>, Sine)>, f64> {
        let (time_s, interval_s) = (segment.time_s.as_slice(), segment.interval_s);
        let volts: Vec<f64> = (0..time_s.len()).map(|k| input.sample(k).0).collect();
        let mut fresh = segment.fresh.clone();
        if segment.begins {
            *self = Self::default();
        } else if self.sine.is_none() {
            self.sine = written.last_chunk::<NUMBERS>().and_then(|numbers| DriveSine::resumed(numbers));
        }
        let sine = match &mut self.sine {
            Some(sine) => sine,
            none => {
                let head = fresh.start..fresh.end.min(fresh.start + block);
                fresh.start = head.end;
                let (time_s, volts) = (&time_s[head.clone()], &volts[head]);
                let found = DriveSine::of_head(time_s, volts, (interval_s, block)).ok_or_else(|| {
                    // Where it begins with a sine, that tells when it changes.
                    let part = time_s.len() / 4;
                    let begins = fit_sine(&time_s[..part], &volts[..part], interval_s);
                    let left_s =
                        begins.filter(Sine::is_steady).and_then(|sine| leaves_at(&sine, time_s, volts));
                    left_s.or(time_s.first().copied()).unwrap_or(f64::NAN)
                })?;
                none.insert(found)
            }
        };
        sine.take(time_s, &volts, fresh).map_err(|block_s| {
            let from = time_s.partition_point(|time_s| *time_s < block_s);
            leaves_at(&sine.sine(), &time_s[from..], &volts[from..]).unwrap_or(block_s)
        })?;
        Ok(sine.over(segment.fresh.end, time_s.len()))
    }
}

/// Rows at least, and cycles of the free motion, by which the sine of the input is told, and how it goes on.
const BLOCK: (usize, f64) = (4096, 12.0);

/// The same of a device that is sampled with this interval in s.
pub fn block_rows(natural_hz: Option<f64>, interval_s: f64) -> usize {
    let (least, cycles) = BLOCK;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
    let rows = natural_hz.map_or(0, |hz| (cycles / (hz * interval_s)).ceil() as usize);
    rows.clamp(least, RowsAround::LONGEST_HEAD)
}

/// The signals of channels without what an input made of them, and that.
pub type SignalsAlone<'a> = (Vec<Cow<'a, [f64]>>, TakenOff);

impl InputFeedthrough {
    /// The signals of a part without what the input makes of them, by the counterpart of its record where there is one; that is found as the segment
    /// begins, and kept.
    pub fn taken_off<'a>(
        &self,
        own: &OwnDevice,
        (off, kept, written): (Option<&BiasOffRecording<'_>>, &mut FeedthroughPast, &[f64]),
        (segment, input, column): (&SignalSegment<'_>, &SegmentDrive<'_>, &str),
        channels: &[SegmentChannel<'a>],
    ) -> Result<SignalsAlone<'a>, EstimateError> {
        let place = || segment.place.clone();
        let device = &own.device;
        let block = block_rows(own.natural_hz(), segment.interval_s);
        let sines = kept.followed(input, (segment, block), written);
        let sines = sines.map_err(|time_s| EstimateError::DriveChanges {
            place: place(),
            column: column.to_owned(),
            time_s,
        })?;
        let kept = &mut kept.record;
        if let (Some(off), None, Some((_, sine))) = (off, &kept, sines.last()) {
            let of = (self.input, segment.segment.label.as_str());
            *kept = Some(off.record(device, of, (&segment.place, sine))?);
        }
        let (mut signals, mut sd) = (Vec::new(), Vec::new());
        for channel in channels {
            let of_record = match (off, &*kept) {
                (Some(off), Some(record)) => {
                    let at = off.place_of(channel.measure).ok_or_else(|| EstimateError::Unfit {
                        place: place(),
                        why: format!(
                            "the recording with the bias off has no channel `{}`; name its column there too",
                            device.measures()[channel.measure].name
                        ),
                    })?;
                    Some((record, at))
                }
                _ => None,
            };
            let stated = self.stated.get(channel.measure).copied().flatten();
            sd.push(of_record.and_then(|(record, at)| record.sd_per_unit(at)).unwrap_or(0.0));
            if of_record.is_none() && stated.is_none() {
                signals.push(Cow::Borrowed(channel.signal));
                continue;
            }
            let part = |(rows, sine): &(Range<usize>, Sine)| {
                let (time_s, values) = (&segment.time_s[rows.clone()], &channel.signal[rows.clone()]);
                match (of_record, stated) {
                    (Some((record, at)), _) => record.cancel(at, time_s, sine, values),
                    (None, Some(stated)) => without_drive(time_s, sine, values, stated),
                    (None, None) => values.to_vec(),
                }
            };
            signals.push(Cow::Owned(sines.iter().flat_map(part).collect()));
        }
        Ok((signals, TakenOff { sines, sd }))
    }
}

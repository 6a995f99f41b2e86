//! The filters of one segment.

use super::EquationColumns;
use super::axes::{AxisSines, DrivenAxis, InputRows, window_s};
use super::course::{EquationCourse, EquationSegment, SegmentChannel, peak_after};
use super::event_search::EventSearches;
use super::event_times::EventTimes;
use super::events::EventSettings;
use super::feedthrough::{
    BiasOffRecording, FeedthroughPast, SignalsAlone, TakenOff, block_rows, counterpart,
};
use super::feedthrough_error::FeedthroughError;
use super::first_peak::{orient, sign_after_restart};
use super::input_part::InputPart;
use super::model::{EquationModel, Interval};
use super::names;
use super::own_filter::OwnFilter;
use super::phase_lock::{LoopOf, phase_lock};
use super::phases::PhaseCourse;
use super::range::RangeTally;
use super::settings::{EquationFilterSettings, EquationSettings, OwnDevice};
use super::sine::{QuantitySine, SCORED_CYCLES};
use super::start::{most_rows, start_of};
use super::table::refused;
use crate::Estimator;
use crate::config::{ConfigFault, Experiment, Key, Method};
use crate::crossings::RowsNeeded;
use crate::estimate::driven::{BLOCK, DrivePast, HYBRID_STEPS, InterpolationLag, SegmentDrive};
use crate::estimate::{
    AngleAxis, AnyFilter, BatchStart, Course, EstimateError, FilterPast, FilterSideOutputs,
    MeanAndCovariance, MotionRate, NoiseEstimate, Past, RecordedPassing, RowsAround, SampleSelection,
    SegmentEstimate, SegmentPart, Sensor, SideOutputs, SignalSegment, StartedCourse, Trajectory, Transition,
    answers_of_bank, begun, follow,
};
use crate::progress::{Interruption, Progress, Silent};
use crate::recording::{Finding, SampledRecording};
use crate::signal::{SLOPE_REACH, Sine};
use kalmems_core::Nodes;
use kalmems_equations::Device;
use std::f64::consts::TAU;

/// Cycles of the free motion after the settling time in which a signal that does not cross its level as it has to is told.
const STARTING_CYCLES: f64 = 4.0;

/// The rows before and behind the new ones that the rates of inputs and the polynomial through six of them ask for.
const fn rows_for_rates(lag: InterpolationLag) -> (usize, usize) {
    let (before, after) = lag.rows_around();
    (before + SLOPE_REACH, after + SLOPE_REACH)
}

/// The rates of those inputs whose rates the equations need, at each sample.
pub fn rates_of_inputs(device: &Device, inputs: &[SegmentDrive<'_>], interval_s: f64) -> Vec<Vec<f64>> {
    device
        .rated_inputs()
        .iter()
        .filter_map(|input| inputs.get(*input))
        .map(|input| input.rates(interval_s))
        .collect()
}

/// The inputs over the rows of a part.
struct SampledInputs<'a, 'b> {
    segment: &'a SignalSegment<'a>,
    samples: &'b SampleSelection,
    past: &'b mut Past,
    /// Whether it is asked how they go on.
    foresees: bool,
    progress: &'b dyn Progress,
}

impl<'a> SampledInputs<'a, '_> {
    /// One with these samples, of the column that a message names.
    fn of(
        &mut self,
        (index, column): (usize, &str),
        foresees: bool,
        drive: impl FnOnce(&mut DrivePast, &Interruption) -> SegmentDrive<'a>,
    ) -> Result<SegmentDrive<'a>, EstimateError> {
        let kept = self.past.input(index);
        kept.foresees |= foresees || self.foresees;
        let stop = Interruption::by(self.progress);
        let drive = drive(kept, &stop);
        if stop.is_requested() {
            return Err(EstimateError::Interrupted);
        }
        let Some((first_s, count)) = drive.unknown() else { return Ok(drive) };
        let (place, column) = (self.segment.place.clone(), column.to_owned());
        Err(EstimateError::DriveUnknown { place, column, count, first_s })
    }

    /// Those that the recording has.
    fn stated(
        &mut self,
        own: &OwnDevice,
        columns: &EquationColumns,
    ) -> Result<Vec<SegmentDrive<'a>>, EstimateError> {
        let mut all = Vec::new();
        for (index, (column, named)) in columns.inputs.iter().zip(own.device.inputs()).enumerate() {
            let values = self.segment.recording.column_of(column, names::kind_of(named))?;
            let foresees = own.between[index].needs_sine() || own.device.rated_inputs().contains(&index);
            let (SignalSegment { time_s, segment, .. }, samples) = (self.segment, self.samples);
            let of = (values, *segment);
            all.push(self.of((index, column), foresees, |kept, stop| {
                SegmentDrive::of_column(of, time_s, samples, kept, stop)
            })?);
        }
        Ok(all)
    }

    /// Those of states that filters are given, by their places, behind so many inputs.
    fn known(
        &mut self,
        (own, first): (&OwnDevice, usize),
        columns: &EquationColumns,
    ) -> Result<Vec<(usize, SegmentDrive<'a>)>, EstimateError> {
        let mut all = Vec::new();
        for (index, (state, column)) in columns.known.iter().enumerate() {
            let values =
                self.segment.recording.column_of(column, names::kind_of(&own.device.states()[*state]))?;
            let (SignalSegment { time_s, segment, .. }, samples) = (self.segment, self.samples);
            let drive = self.of((first + index, column), false, |kept, stop| {
                SegmentDrive::of_column((values, *segment), time_s, samples, kept, stop)
            })?;
            all.push((*state, drive));
        }
        Ok(all)
    }

    /// The rates of some behind them.
    fn add_rates(
        &mut self,
        inputs: &mut Vec<SegmentDrive<'a>>,
        (device, rates): (&Device, &'a [Vec<f64>]),
        columns: &EquationColumns,
    ) -> Result<(), EstimateError> {
        for (rates, of) in rates.iter().zip(device.rated_inputs()) {
            let column = format!("the rate of {}", columns.inputs[*of]);
            let (time_s, samples) = (&self.segment.time_s, self.samples);
            inputs.push(self.of((inputs.len(), &column), false, |kept, stop| {
                SegmentDrive::of(time_s, rates, samples, kept, stop)
            })?);
        }
        Ok(())
    }
}

/// The time in s of the first peak of each angle's drive after the settling time, in a recording's first segment.
pub fn first_drive_peaks(
    settings: &EquationSettings,
    columns: &EquationColumns,
    recording: &SampledRecording,
) -> Result<Vec<f64>, EstimateError> {
    let (own, device) = (&settings.own, &settings.own.device);
    let Some((first, (measure, column))) = recording.segments().first().zip(columns.measured.first()) else {
        return Ok(Vec::new());
    };
    let (part, mut past) = (SegmentPart::whole(recording, first), Past::default());
    let kind = names::kind_of(&device.measures()[*measure]);
    let segment = SignalSegment::of(&part, (column, kind), settings.skip_s, &mut past)?;
    let samples = segment.samples();
    let mut sampled = SampledInputs {
        segment: &segment,
        samples: &samples,
        past: &mut past,
        foresees: false,
        progress: &Silent,
    };
    let inputs = sampled.stated(own, columns)?;
    let start_s = segment.start_s + settings.skip_s;
    if own.axes.is_empty() {
        return Ok(vec![peak_after(&inputs, start_s)]);
    }
    let rows = InputRows { inputs: &inputs, interval_s: segment.interval_s };
    let sines = AxisSines::first(own, rows, start_s);
    Ok(sines.map_or_else(Vec::new, |sines| sines.sines.map(|sine| sine.peak_after(start_s)).into()))
}

/// Estimates recordings, part by part.
pub struct EquationEstimator<'a> {
    /// The experiment.
    pub experiment: &'a Experiment,
    /// What it says of the device and its filters.
    pub settings: EquationSettings,
    /// The models of each filter: one, but for a bank.
    pub models: Vec<Vec<EquationModel>>,
    /// The columns of the recording.
    pub columns: EquationColumns<'a>,
    /// What is kept from one part to the next.
    pub past: Past,
    /// The sines that drive several axes, in the segment that is being estimated.
    pub sines: Option<AxisSines>,
    /// The recording with the bias off, of one that needs it, and what is taken off the signals of the segment that is being estimated.
    pub bias_off: Option<BiasOffRecording<'a>>,
    pub taken_off: FeedthroughPast,
    /// The searches for events in the segment that is being estimated.
    pub searches: Option<EventSearches>,
    /// Why the recording is no good, where only its end has shown it.
    pub refused: Option<EstimateError>,
    /// How often its filters left the ranges of quantities.
    pub left_ranges: RangeTally,
    /// What it gives besides the estimates.
    pub side_outputs: SideOutputs,
    /// What makes the filter of the caller's own that stands in for the experiment's, if there is one.
    pub own_filter: OwnFilter,
    /// Who follows the work.
    pub progress: &'a dyn Progress,
}

impl<'a> EquationEstimator<'a> {
    /// For a recording of an experiment, by its place.
    pub fn of(
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Self, EstimateError> {
        let settings = EquationSettings::of(experiment)?;
        let models = settings.filters.iter().map(EquationFilterSettings::models);
        let models = models.collect::<Result<_, _>>().map_err(|error| refused(experiment, &error))?;
        Ok(Self {
            experiment,
            settings,
            models,
            columns: EquationColumns::of(experiment, index)?,
            past: Past::default(),
            sines: None,
            bias_off: counterpart(experiment, index)?
                .map(|off| BiasOffRecording::read(experiment, off, progress))
                .transpose()?,
            taken_off: FeedthroughPast::default(),
            searches: None,
            refused: None,
            left_ranges: RangeTally::default(),
            side_outputs: SideOutputs::default(),
            own_filter: OwnFilter::default(),
            progress,
        })
    }
}

impl Estimator for EquationEstimator<'_> {
    /// Records by which the device was identified are not estimated.
    fn wants(&self, label: &str) -> bool {
        let mut training = self.experiment.identify.iter().flat_map(|identify| &identify.training);
        self.bias_off.is_none() || !training.any(|name| name == label)
    }

    fn around(&self, interval_s: f64) -> RowsAround {
        let told_s = |hz: f64| self.settings.skip_s + STARTING_CYCLES / hz;
        let crossed = self.settings.events.iter().any(EventSettings::is_shown_by_a_signal);
        // A turning point behind the settling time tells a sign that is stated.
        let looked_at = crossed || !self.settings.signs.is_empty();
        let first_s = self.settings.own.natural_hz().filter(|_| looked_at).map_or(0.0, told_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let rows = (first_s / interval_s).ceil() as usize;
        let own = &self.settings.own;
        let filters = || self.settings.filters.iter();
        let from_signal =
            filters().filter_map(|filter| Some(most_rows((&filter.own, &filter.prior()?), interval_s)));
        let mut rows = from_signal.fold(rows, usize::max);
        if !self.settings.own.axes.is_empty() {
            // Of the last window, a lock-in says nothing before it has ended.
            let window_s = window_s(&self.settings.own);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
            let shown =
                ((first_s + window_s).max(self.settings.skip_s).max(window_s) / interval_s).ceil() as usize;
            rows = rows.max(shown);
        }
        let smooths = filters().any(|filter| filter.basics.smooth);
        let RowsNeeded { before, after } = self.settings.needed(interval_s).with_a_margin();
        let lag = self.past.lag();
        let around = self.settings.own.between.iter().map(|between| between.rows_around(lag));
        let rates = self.settings.own.device.rated_inputs().iter().map(|_| rows_for_rates(lag));
        let (before, after) = around
            .chain(rates)
            .fold((before, after), |(before, after), own| (before.max(own.0), after.max(own.1)));
        // And one before them.
        let again = filters().map(|filter| filter.later_start().rows(&filter.own, interval_s) + 1);
        let mut again = again.fold(0, usize::max);
        if self.settings.sine.is_some() {
            (rows, again) =
                (QuantitySine::head_rows(self.settings.skip_s, interval_s), QuantitySine::ROWS_BEFORE);
        }
        // What follows from an input is said of a sample once a smoother has waited for the later ones.
        let lags = filters().filter_map(|filter| filter.basics.lag_samples(interval_s));
        let lagged = if own.device.quantities_need_inputs() { lags.fold(0, usize::max) } else { 0 };
        if own.feedthrough.is_some() {
            rows = rows.max(block_rows(own.natural_hz(), interval_s));
        }
        RowsAround {
            head: rows.clamp(BLOCK, RowsAround::LONGEST_HEAD),
            before: (before + again).max(lagged),
            after,
            smooths,
        }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, past) = (&self.settings, &mut self.past);
        let device = &settings.own.device;
        let Some((first, column)) = self.columns.measured.first().copied() else {
            let why = "no channel of the recording is measured of the device".to_owned();
            return Err(self.experiment.error("recording", ConfigFault::Value { why }).into());
        };
        let kind = names::kind_of(&device.measures()[first]);
        let segment = SignalSegment::of(part, (column, kind), settings.skip_s, past)?;
        self.columns.require_usable(segment.recording.diagnosis(), &segment.place, |label| {
            label == segment.segment.label
        })?;
        if segment.begins {
            self.searches = None;
            self.left_ranges = RangeTally::default();
        }
        let samples = segment.samples();
        let mut sampled = SampledInputs {
            segment: &segment,
            samples: &samples,
            past: &mut *past,
            foresees: self.side_outputs.prediction.is_some(),
            progress: self.progress,
        };
        let mut inputs = sampled.stated(&settings.own, &self.columns)?;
        let rates = rates_of_inputs(device, &inputs, segment.interval_s);
        sampled.add_rates(&mut inputs, (device, &rates), &self.columns)?;
        let known = sampled.known((&settings.own, inputs.len()), &self.columns)?;
        self.columns.require_right(self.experiment, (device, part.begins), &segment)?;
        let variances = settings.own.variances(segment.interval_s.recip());
        let mut channels = channels((self.experiment, &settings.own), &self.columns, &variances, &segment)?;
        let kept = (self.bias_off.as_ref(), &mut self.taken_off, &*past.numbers);
        let (signals, taken_off) =
            without_feedthrough(&settings.own, kept, (&segment, &inputs, &self.columns), &channels)?;
        channels.iter_mut().zip(&signals).for_each(|(channel, signal)| channel.signal = signal);
        let start_s = segment.start_s + settings.skip_s;
        if segment.begins || self.sines.is_none() {
            let rows = InputRows { inputs: &inputs, interval_s: segment.interval_s };
            self.sines = AxisSines::first(&settings.own, rows, start_s);
        }
        let of = (settings, &self.columns, self.sines.as_ref());
        let (motion, judged) = judged_motion(of, (&segment, &channels, &inputs), past)?;
        let bends = bends(&settings.own, &channels, (&segment.time_s, &inputs));
        let mut kept = match self.searches.take() {
            Some(searches) => searches,
            None => EventSearches::of(settings, &variances, &segment, &past.numbers)?,
        };
        if let Some(why) = kept.look(settings, &self.columns, (&segment, &inputs, &bends))? {
            self.refused.get_or_insert(why);
        }
        let events = kept.times(self.experiment, settings, &self.columns, &segment)?;
        let (crossings, refused) = passings(&settings.own, &events, &segment);
        let data = EquationSegment {
            place: &segment.place,
            start_s: segment.start_s,
            time_s: &segment.time_s,
            inputs,
            stated_inputs: device.own_inputs(),
            known,
            channels,
            events,
            bends,
            samples,
            motion,
            sines: self.sines.as_ref(),
        };
        // By the first rows, so that it does not depend on what comes later.
        let rate = TAU * motion.frequency_hz;
        let known_rate = self.side_outputs.is_asked().then(|| *past.motion_rate.get_or_insert(rate));
        let phase_rate = known_rate.unwrap_or(rate);
        let axes = judged_axes(settings, (judged, motion), (&data, start_s));
        let answers = Answers {
            settings,
            models: &self.models,
            side_outputs: (&self.side_outputs, phase_rate),
            own_filter: &self.own_filter,
            taken_off: &taken_off,
            data: &data,
            axes: &axes,
            start_s,
            progress: self.progress,
        };
        let all = answers.of_filters(past)?;
        let mut remarks = sign_after_restart(part, !settings.signs.is_empty());
        remarks.extend(settings.remarks.iter().filter(|_| part.begins).cloned());
        remarks.extend(left_tables(&settings.own, &data, &all));
        self.left_ranges.add(&settings.own.ranges, &all);
        if segment.ends {
            remarks.extend(self.left_ranges.remarks(&settings.own.ranges, &all));
        }
        let drive_column = self.columns.inputs.first().copied().unwrap_or_default();
        let mut judged = axes.into_iter().map(|axis| axis.of);
        let first = judged.next().unwrap_or(AngleAxis { angle: "", motion, drive: None });
        let mut estimate = segment.estimated_under(drive_column, (first, judged.collect()), all);
        (estimate.remarks, estimate.sign_is_hidden) = (remarks, settings.own.hides_angle());
        (estimate.crossings, estimate.crossings_refused) = (crossings, refused);
        kept.pass(&segment);
        past.numbers = kept.numbers().into_iter().chain(self.taken_off.numbers()).collect();
        self.searches = Some(kept);
        Ok(estimate)
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        self.columns.require_usable(diagnosis, place, |_| true)?;
        self.refused.take().map_or(Ok(()), Err)
    }
}

/// The signals of the channels without what an input made of them, and that.
fn without_feedthrough<'a>(
    own: &OwnDevice,
    kept: (Option<&BiasOffRecording<'_>>, &mut FeedthroughPast, &[f64]),
    (segment, inputs, columns): (&SignalSegment<'_>, &[SegmentDrive<'_>], &EquationColumns<'_>),
    channels: &[SegmentChannel<'a>],
) -> Result<SignalsAlone<'a>, EstimateError> {
    let Some(feedthrough) = &own.feedthrough else { return Ok(SignalsAlone::default()) };
    let input = feedthrough.input;
    feedthrough.taken_off(own, kept, (segment, &inputs[input], columns.inputs[input]), channels)
}

/// What is said of the new rows of all events, in the order in which it becomes known, and how many passings are not told.
fn passings(
    own: &OwnDevice,
    events: &[EventTimes<'_>],
    segment: &SignalSegment<'_>,
) -> (Vec<RecordedPassing>, usize) {
    let passes_hz = own.natural_hz().map(|natural_hz| 2.0 * natural_hz);
    let said = events.iter().map(|event| event.passings(&segment.fresh, segment.ends, passes_hz));
    let (said, refused): (Vec<_>, Vec<usize>) = said.unzip();
    let mut all: Vec<_> = said.into_iter().flatten().collect();
    all.sort_by_key(|(row, _)| *row);
    (all.into_iter().map(|(_, passing)| passing).collect(), refused.into_iter().sum())
}

/// An input that bends by more than this many standard deviations of a signal within a sample has no known rate there.
const BEND: f64 = 3.0;

/// The rows at which the rate of an input is not known, and those whose rates are by such a row.
fn bends(own: &OwnDevice, channels: &[SegmentChannel<'_>], of: (&[f64], &[SegmentDrive<'_>])) -> Vec<usize> {
    if own.device.rated_inputs().is_empty() {
        return Vec::new();
    }
    let rows = channels.iter().filter_map(|channel| {
        Some(InputPart::of(own, channel.measure)?.bends(own, of, BEND * channel.variance.sqrt()))
    });
    let near = |k: usize| k.saturating_sub(SLOPE_REACH)..=k + SLOPE_REACH;
    let mut rows: Vec<usize> = rows.flatten().flat_map(near).collect();
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// The measured channels over a segment, with the variance of a sample of each.
fn channels<'a>(
    (experiment, own): (&Experiment, &'a OwnDevice),
    columns: &EquationColumns,
    variances: &[Option<f64>],
    segment: &SignalSegment<'a>,
) -> Result<Vec<SegmentChannel<'a>>, EstimateError> {
    let device = &own.device;
    let one = |(measure, column): &(usize, &str)| {
        let named = &device.measures()[*measure];
        let signal = segment.recording.column_of(column, names::kind_of(named))?.of(segment.segment);
        if let Some(variance) = variances[*measure].filter(|variance| *variance > 0.0) {
            let channel = SegmentChannel::of(device, *measure, variance, signal);
            return Ok(SegmentChannel { name: &own.signal_names[*measure], ..channel });
        }
        let key = Key::from("device.equations.noise").child(&named.name);
        let remedy = match variances[*measure] {
            Some(variance) => format!(
                "its size at rest is {variance}; expected a positive one, by which a filter weighs the samples, such as that of the readout \
                 added to it"
            ),
            None => format!(
                "write the variance of a sample of it, such as `{} = \"1e-6[{}^2]\"`; a filter weighs the samples by it",
                named.name, named.unit_text
            ),
        };
        Err(experiment.error(key, ConfigFault::MissingKey { remedy }).into())
    };
    columns.measured.iter().map(one).collect()
}

/// How fast the device moves that a steady drive moves, or none; as fast as a hundred samples where it does not oscillate. Under a drive the table
/// may say that a cycle of it takes several of the drive.
pub fn motion(own: &OwnDevice, drive: Option<&Sine>, interval_s: f64) -> MotionRate {
    let free_hz = || own.natural_hz().unwrap_or_else(|| interval_s.recip() / 100.0);
    MotionRate {
        frequency_hz: drive.map_or_else(free_hz, |sine| sine.frequency_hz / own.drive_cycles),
        is_driven: drive.is_some(),
    }
}

/// How fast it moves as the first rows of its inputs show it, and the name of what its motion is judged by.
fn judged_motion(
    (settings, columns, sines): (&EquationSettings, &EquationColumns, Option<&AxisSines>),
    (segment, channels, inputs): (&SignalSegment, &[SegmentChannel], &[SegmentDrive<'_>]),
    past: &mut Past,
) -> Result<(MotionRate, &'static str), EstimateError> {
    let own = &settings.own;
    if let Some(sine) = &settings.sine {
        return Ok((sine.motion(settings, columns, (segment, channels), past)?, sine.name(own)));
    }
    if let Some(natural_hz) = own.natural_hz().filter(|_| own.has_angle()) {
        segment.require_after_settling(SCORED_CYCLES / natural_hz)?;
    }
    let drive = inputs.iter().find_map(|input| input.first_sine().copied()).filter(|_| own.axes.is_empty());
    let driven = sines.map(|sines| sines.slowest(own));
    let motion = driven.unwrap_or_else(|| motion(own, drive.as_ref(), segment.interval_s));
    Ok((motion, own.states()[own.judged()].0))
}

/// What a motion is judged by, and the time in s behind which a turning point tells its sign.
struct JudgedAxis {
    of: AngleAxis,
    peak_s: f64,
}

/// The axes of the motion. A filter knows the first rows of a drive; its motion is judged by what the drive is throughout.
fn judged_axes(
    settings: &EquationSettings,
    (judged, first): (&'static str, MotionRate),
    (data, start_s): (&EquationSegment<'_>, f64),
) -> Vec<JudgedAxis> {
    let own = &settings.own;
    if own.axes.is_empty() {
        let drive = data.inputs.iter().find_map(|input| input.sine().copied());
        let motion = match &settings.sine {
            None => motion(own, drive.as_ref(), data.samples.interval_s),
            Some(_) => first,
        };
        let of = AngleAxis { angle: judged, motion, drive };
        return vec![JudgedAxis { of, peak_s: peak_after(&data.inputs, start_s) }];
    }
    let names = own.states();
    let rows = InputRows { inputs: &data.inputs, interval_s: data.samples.interval_s };
    let sines = data.sines.map(|first| (first, first.throughout(own, rows)));
    let axis = |(place, axis): (usize, &DrivenAxis)| {
        let of = sines.as_ref().and_then(|(first, all)| {
            Some((first.sines.get(place)?, all.sines.get(place)?, all.motions(own).get(place).copied()?))
        });
        let free = MotionRate { frequency_hz: axis.natural_hz, is_driven: false };
        JudgedAxis {
            of: AngleAxis {
                angle: names.get(axis.states[0]).map_or("", |(name, ..)| name),
                motion: of.map_or(free, |(.., motion)| motion),
                drive: of.map(|(_, all, _)| *all),
            },
            peak_s: of.map_or(start_s, |(first, ..)| first.peak_after(start_s)),
        }
    };
    own.axes.iter().enumerate().map(axis).collect()
}

/// Of each filter that stopped at one of these samples, the table that it left, where it left one.
fn left_tables(own: &OwnDevice, data: &EquationSegment, all: &[Trajectory]) -> Vec<String> {
    let of = |trajectory: &Trajectory| {
        let failure = trajectory.stops.last()?.failure;
        let stopped = trajectory.time_s.iter().position(|time_s| *time_s == failure.time_s)?;
        let last = stopped.checked_sub(1)?;
        let state: Vec<f64> =
            trajectory.states.iter().take(own.device.states().len()).map(|state| state.mean[last]).collect();
        let row = data.time_s.iter().position(|time_s| *time_s == trajectory.time_s[last])?;
        let mut inputs = Vec::new();
        data.inputs_at(row, &mut inputs);
        let step_s = failure.time_s - trajectory.time_s[last];
        let left = own.device.left_table(&own.values, (&state, &inputs), step_s).ok()??;
        Some(format!("{}: behind {} s {left}", trajectory.name, super::short(trajectory.time_s[last])))
    };
    all.iter().filter_map(of).collect()
}

/// The filters over the new samples.
struct Answers<'a> {
    settings: &'a EquationSettings,
    /// The models of each filter.
    models: &'a [Vec<EquationModel>],
    /// What is given besides the estimates, and the rate of the motion in rad/s.
    side_outputs: (&'a SideOutputs, f64),
    own_filter: &'a OwnFilter,
    /// What inputs made of the signals.
    taken_off: &'a TakenOff,
    data: &'a EquationSegment<'a>,
    /// What the answers are judged by.
    axes: &'a [JudgedAxis],
    /// The end of the settling time in s.
    start_s: f64,
    progress: &'a dyn Progress,
}

impl Answers<'_> {
    /// The trajectories of all filters, each with the stated sign of the motion and the judgement of its lock.
    fn of_filters(&self, past: &mut Past) -> Result<Vec<Trajectory>, EstimateError> {
        let Self { settings, data, start_s, .. } = *self;
        let (outputs, rate) = self.side_outputs;
        let axes: Vec<_> = self.axes.iter().map(|axis| (axis.of.angle, axis.of.motion)).collect();
        let peaks_s: Vec<f64> = self.axes.iter().map(|axis| axis.peak_s).collect();
        let mut all = Vec::new();
        for (index, filter) in settings.filters.iter().enumerate() {
            let past = past.filter(index);
            // Without a stated sign it is as the filter has it.
            let mirrored = if settings.signs.is_empty() { Some(false) } else { past.is_mirrored() };
            let models = self.models.get(index).map_or(&[][..], Vec::as_slice);
            let given = (!filter.known.is_empty()).then(|| data.giving(&filter.known));
            let data = given.as_ref().unwrap_or(data);
            let task = EquationFilterTask {
                side_outputs: outputs.of_filter(index, (rate, mirrored), start_s),
                own_filter: Some(self.own_filter),
                progress: self.progress,
                ..EquationFilterTask::of(settings, filter, models, data)
            };
            let mut found = task.follow(past)?;
            let errors = FeedthroughError::of(&filter.own, self.taken_off, (data, &task.channels()));
            for (answer, trajectory) in found.iter_mut().enumerate() {
                let past = past.answer(answer);
                orient(trajectory, (&filter.own, &settings.signs), past, &peaks_s);
                trajectory.lock = past.judge.judge(trajectory, &axes, start_s, data.samples.ends);
                if filter.basics.method != Method::Model {
                    filter.own.corrections.iter().for_each(|correction| correction.apply(trajectory));
                    if let Some(errors) = &errors {
                        errors.widen(trajectory, data.time_s);
                    }
                }
            }
            all.append(&mut found);
        }
        Ok(all)
    }
}

/// One filter over the new samples.
pub struct EquationFilterTask<'a> {
    /// The device.
    pub own: &'a OwnDevice,
    /// The sine that its motion is, where it is one.
    pub sine: Option<&'a QuantitySine>,
    /// How long it has to settle, in s.
    pub skip_s: f64,
    /// What the file says of the filter.
    pub filter: &'a EquationFilterSettings,
    /// Its models: one, but for a bank.
    pub models: &'a [EquationModel],
    /// What it gives besides its states.
    pub side_outputs: FilterSideOutputs,
    /// What makes it, if it is one of the caller's own.
    pub own_filter: Option<&'a OwnFilter>,
    /// The samples.
    pub data: &'a EquationSegment<'a>,
    /// Who follows the work.
    pub progress: &'a dyn Progress,
}

impl<'a> EquationFilterTask<'a> {
    /// A filter by itself, in silence.
    pub fn of(
        settings: &'a EquationSettings,
        filter: &'a EquationFilterSettings,
        models: &'a [EquationModel],
        data: &'a EquationSegment<'a>,
    ) -> Self {
        Self {
            own: &filter.own,
            sine: settings.sine.as_ref(),
            skip_s: settings.skip_s,
            filter,
            models,
            side_outputs: FilterSideOutputs::default(),
            own_filter: None,
            data,
            progress: &Silent,
        }
    }
}

impl EquationFilterTask<'_> {
    /// Its trajectory, and the smoothed ones that are wanted.
    pub fn follow(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let basics = &self.filter.basics;
        let states = basics.states(self.own.states());
        if let Some(inverse) = &self.filter.inverse {
            return Ok(self.inversion(inverse, self.own.states()).into_iter().collect());
        }
        if let Some(sine) = self.sine.filter(|_| basics.method == Method::LockIn) {
            return Ok(vec![self.lock_in_of_sine(sine, past)?]);
        }
        if basics.method == Method::LockIn {
            return Ok(vec![self.lock_in(past, self.own.states())?]);
        }
        if basics.method == Method::EulerEkf {
            self.require_slow()?;
        }
        let channels = self.channels();
        let steps = if basics.method == Method::HybridEkf { HYBRID_STEPS } else { 1 };
        // A filter that goes on from another run has been started there.
        let starts: Vec<Option<BatchStart>> = if past.left().is_none() {
            let of_model = |model| self.start(model, &channels, steps);
            let starts = self.models.iter().map(of_model).collect::<Result<Vec<_>, _>>()?;
            if let Some(Some(start)) = starts.first() {
                past.began_by(start, self.data.time_s);
            }
            starts
        } else {
            vec![past.start_among(self.data.time_s)]
        };
        let by_swing = if past.left().is_none() { self.start_by_swing()? } else { None };
        let known = |index: usize| {
            let from_signal = start_of(&starts, index).map(|start| start.first.clone());
            from_signal.or_else(|| by_swing.clone()).or_else(|| self.filter.stated()).unwrap_or_default()
        };
        let used = (&*channels, &*self.filter.events);
        let course_of = |(index, model), phases, noise| {
            let course = EquationCourse::new(model, (self.data, &self.own.between), used, steps)
                .answering(&self.own.device)
                .telling_phases(self.side_outputs.phase_rate(), phases)
                .taking_samples_for(self.filter.signal_variance)
                .estimating_noise(noise)
                .taking_signal(self.filter.variant);
            // The model alone is corrected by nothing, wherever it starts.
            let corrects = basics.method != Method::Model;
            let started = StartedCourse::new(course, start_of(&starts, index).filter(|_| corrects));
            started.starting_again(self.start_again(model, &channels, steps))
        };
        if basics.method == Method::Bank {
            let courses = self.models.iter().enumerate();
            let courses =
                courses.map(|model| -> Box<dyn Course + '_> { Box::new(course_of(model, None, None)) });
            let way = (courses.collect(), &self.data.samples);
            return answers_of_bank((basics, past), |index| Ok(known(index)), way, &states, self.progress);
        }
        let Some(model) = self.models.first() else { return Ok(Vec::new()) };
        let turns = self.own.swings() > 0 && basics.parameters().is_empty();
        if (self.sine.is_some() || turns) && basics.gain().is_some() && past.numbers.is_empty() {
            past.numbers = known(0).mean;
            if turns {
                past.numbers = self.operating(&past.numbers);
            }
        }
        let operating = past.numbers.clone();
        let predictor = self.side_outputs.predictor(basics, self.data.samples.interval_s, past)?;
        let (from_s, interval_s) = (self.side_outputs.from_s, self.data.samples.interval_s);
        let phases = predictor.map(|predictor| PhaseCourse::new(predictor, from_s, interval_s));
        let noise = self.noise(past);
        let mut course = course_of((0, model), phases, noise);
        let way = (&mut course as _, &self.data.samples);
        // A start from the signal has the states of the readout, as what another run left has.
        let begin =
            |left| self.begin((begun(left, start_of(&starts, 0)), known(0), operating), model, &channels);
        let mut all = follow((basics, &mut *past), begin, way, &states, self.progress)?;
        let (phases, noise) = course.into_inner().into_kept();
        (past.predictor, past.noise) = (phases.map(PhaseCourse::into_predictor), noise);
        if basics.method == Method::Model {
            all.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        if let Some(sine) = self.sine {
            sine.turn_back(self.own, &mut all);
        }
        // Of a number that is not estimated no deviation is claimed: zeros would look like a claim.
        let named = self.own.device.quantities();
        let stated: Vec<&str> =
            model.stated_quantities().filter_map(|k| Some(&*named.get(k)?.name)).collect();
        let series = all.iter_mut().flat_map(|trajectory| &mut trajectory.states);
        series.filter(|state| stated.contains(&state.name)).for_each(|state| state.sd.clear());
        Ok(all)
    }

    /// Refuses a device some of whose motion decays faster than Euler's method follows it, |1 + λ·h| < 1.
    fn require_slow(&self) -> Result<(), EstimateError> {
        let decays = self.own.modes.iter().filter(|mode| !mode.oscillates() && mode.growth < 0.0);
        let rate_hz = decays.map(|mode| -0.5 * mode.growth).fold(0.0, f64::max);
        let interval_s = self.data.samples.interval_s;
        if interval_s * rate_hz < 1.0 {
            return Ok(());
        }
        let filter = self.filter.basics.name.clone();
        Err(EstimateError::EulerUnstable { filter, interval_s, rate_hz })
    }

    /// The variance of a sample as it was estimated until here, where the filter estimates it.
    fn noise(&self, past: &mut FilterPast) -> Option<NoiseEstimate> {
        let memory_s = self.filter.noise_memory_s?;
        let channel = self.channels().first().and_then(|place| self.data.channels.get(*place))?;
        let begun = || NoiseEstimate::new(channel.variance, memory_s / self.data.samples.interval_s);
        let mut noise = past.noise.take().unwrap_or_else(begun);
        noise.going_on();
        Some(noise)
    }

    /// The channels that correct it.
    pub fn channels(&self) -> Vec<usize> {
        let wanted = &self.filter.measures;
        let all = 0..self.data.channels.len();
        if wanted.is_empty() {
            return all.collect();
        }
        let place = |measure: &usize| self.data.channels.iter().position(|c| c.measure == *measure);
        wanted.iter().filter_map(place).collect()
    }

    fn begin(
        &self,
        (left, start, operating): (Option<MeanAndCovariance>, MeanAndCovariance, Vec<f64>),
        model: &EquationModel,
        channels: &[usize],
    ) -> Result<AnyFilter, EstimateError> {
        let basics = &self.filter.basics;
        if let Some(make) = self.own_filter.and_then(OwnFilter::take) {
            return Ok(make(left.unwrap_or(start)));
        }
        let Some(gain) = basics.gain() else { return basics.begin(left, || Ok(start)) };
        let interval_s = self.data.samples.interval_s;
        let Some(channel) = channels.first().and_then(|place| self.data.channels.get(*place)) else {
            return Err(basics.no_gain(&"it has no channel"));
        };
        let known = left.unwrap_or(start);
        if let Some(sine) = self.sine {
            let of = LoopOf {
                roles: sine.roles(),
                at: operating,
                measure: channel.measure,
                interval_s,
                variance: channel.variance,
            };
            return phase_lock((self.own, model), gain, &known, &of).map_err(|why| basics.no_gain(&why));
        }
        if self.own.swings() > 0 && basics.parameters().is_empty() {
            return self.turning((gain, &known, &operating), model, channel);
        }
        let made = |rest: &MeanAndCovariance, step: &dyn Transition, sensor: &dyn Sensor| {
            let point = (step, sensor, channel.variance);
            AnyFilter::of_constant_gain((gain, interval_s), (rest, &known), point)
        };
        at_rest(self.own, model, (channel.measure, interval_s), made).map_err(|why| basics.no_gain(&why))
    }
}

/// What is made of a model at rest under no input: of where that is, of the step over an interval in s, and of a measurement.
pub fn at_rest<R>(
    own: &OwnDevice,
    model: &EquationModel,
    (measure, interval_s): (usize, f64),
    made: impl FnOnce(&MeanAndCovariance, &dyn Transition, &dyn Sensor) -> R,
) -> R {
    let rest = MeanAndCovariance::apart(own.rest.iter().map(|at| (*at, 0.0)));
    under_no_input(own, (model, &rest.mean), (measure, interval_s), |step, sensor| made(&rest, step, sensor))
}

/// What is made of a model at a state under no input: of the step over an interval in s, and of a measurement.
pub fn under_no_input<R>(
    own: &OwnDevice,
    (model, mean): (&EquationModel, &[f64]),
    (measure, interval_s): (usize, f64),
    made: impl FnOnce(&dyn Transition, &dyn Sensor) -> R,
) -> R {
    let interval = Interval::of(interval_s);
    let inputs = vec![0.0; own.device.inputs().len()];
    let step = model.under(&interval, Nodes::held(&inputs), mean);
    made(&step, &model.sensor(measure, &inputs))
}

//! The filters of one segment.

use super::EquationColumns;
use super::axes::{AxisSines, InputRows, window_s};
use super::course::{EquationSegment, SegmentChannel};
use super::event_search::EventSearches;
use super::event_times::EventTimes;
use super::events::EventSettings;
use super::feedthrough::{
    BiasOffRecording, FeedthroughPast, SignalsAlone, TakenOff, block_rows, counterpart,
};
use super::feedthrough_error::FeedthroughError;
use super::filter_settings::EquationFilterSettings;
use super::filter_task::EquationFilterTask;
use super::first_peak::{orient, sign_after_restart};
use super::input_part::InputPart;
use super::judged_axes::{JudgedAxis, judged_axes, judged_motion};
use super::model::EquationModel;
use super::names;
use super::own_device::OwnDevice;
use super::own_filter::OwnFilter;
use super::range::RangeTally;
use super::sampled_inputs::{SampledInputs, rates_of_inputs, rows_for_rates};
use super::settings::EquationSettings;
use super::sine::QuantitySine;
use super::start::most_rows;
use super::table::refused;
use crate::Estimator;
use crate::config::{ConfigFault, Experiment, Key, Method};
use crate::crossings::RowsNeeded;
use crate::estimate::driven::{BLOCK, SegmentDrive};
use crate::estimate::{
    AngleAxis, EstimateError, MotionRate, Past, RecordedPassing, RowsAround, SegmentEstimate, SegmentPart,
    SideOutputs, SignalSegment, Trajectory,
};
use crate::progress::Progress;
use crate::recording::Finding;
use crate::signal::SLOPE_REACH;
use std::f64::consts::TAU;

/// Cycles of the free motion after the settling time in which a signal that does not cross its level as it has to is told.
const STARTING_CYCLES: f64 = 4.0;

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
            // Whose sign the signal tells, that changes its branch only if the signal is lost; its phase changes while the motion settles.
            let takes_all =
                filter.measures.is_empty() || filter.measures.len() == filter.own.device.measures().len();
            let axes = self.axes.iter().map(|JudgedAxis { of: AngleAxis { angle, motion, .. }, .. }| {
                let is_driven = motion.is_driven && !(takes_all && filter.own.tells_sign(angle));
                (*angle, MotionRate { is_driven, ..*motion })
            });
            let axes: Vec<_> = axes.collect();
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

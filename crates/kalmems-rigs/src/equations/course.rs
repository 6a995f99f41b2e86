//! A device of one's own on its way through one segment.

use super::axes::AxisSines;
use super::counted_once::ClaimBefore;
use super::event_sensor::{BackwardInterval, EventSensor};
use super::event_times::{EventAcceptance, EventMeasurement, EventTimes, event_measurements};
use super::events::FilterEventUse;
use super::input_part::input_part_slopes;
use super::interpolation::Interpolation;
use super::kinks::KinkSteps;
use super::model::{EquationModel, Interval, MeasurementUnderInputs, StepRoom};
use super::names;
use super::phases::PhaseCourse;
use crate::config::Variant;
use crate::estimate::driven::SegmentDrive;
use crate::estimate::{
    Bridge, Course, DerivedQuantities, EVENTS, Filtering, MotionRate, NEVER, NoiseEstimate, SampleCounts,
    SampleSelection, Sensor, SignalName, StateName, Trajectory, by_signal_taken_for, by_signals,
};
use crate::units::Kind;
use kalmems_core::{FilterError, Innovation, Nodes};
use kalmems_equations::{Device, ResetPath};

/// A measured channel over a segment.
#[derive(Clone)]
pub struct SegmentChannel<'a> {
    /// Its name.
    pub name: &'a str,
    /// What it is.
    pub kind: &'static Kind,
    /// Its place among the device's measurements.
    pub measure: usize,
    /// The variance of a sample.
    pub variance: f64,
    /// The samples; not a number where one is missing.
    pub signal: &'a [f64],
}

impl<'a> SegmentChannel<'a> {
    /// Of a device's measurement, by its place, with the variance of a sample.
    pub fn of(device: &'a Device, measure: usize, variance: f64, signal: &'a [f64]) -> Self {
        let named = &device.measures()[measure];
        Self { name: &named.name, kind: names::kind_of(named), measure, variance, signal }
    }
}

/// What the filters see of a segment.
#[derive(Clone)]
pub struct EquationSegment<'a> {
    /// The recording and the segment, for messages.
    pub place: &'a str,
    /// When the segment began, in s.
    pub start_s: f64,
    /// When, in s.
    pub time_s: &'a [f64],
    /// The inputs, in the order of the device, and how many of them are stated; the rates of these are behind them.
    pub inputs: Vec<SegmentDrive<'a>>,
    pub stated_inputs: usize,
    /// What is recorded of states that filters are given, by their places.
    pub known: Vec<(usize, SegmentDrive<'a>)>,
    /// The measured channels that the recording has, in that order.
    pub channels: Vec<SegmentChannel<'a>>,
    /// The events whose times are looked for, in the order of the settings.
    pub events: Vec<EventTimes<'a>>,
    /// Rows at which an input bends so sharply that what its rate adds to a signal is not known.
    pub bends: Vec<usize>,
    /// Which samples are new.
    pub samples: SampleSelection,
    /// How fast the device moves; of several axes the slowest of them.
    pub motion: MotionRate,
    /// The sines that drive several axes, where there are some.
    pub sines: Option<&'a AxisSines>,
}

/// The time in s of the first peak of the first input that is a sine, from a time on; that time without a sine.
pub fn peak_after(inputs: &[SegmentDrive<'_>], from_s: f64) -> f64 {
    let sine = inputs.iter().find_map(SegmentDrive::first_sine);
    sine.map_or(from_s, |sine| sine.peak_after(from_s))
}

impl EquationSegment<'_> {
    /// The same with these states as inputs behind the stated ones.
    pub fn giving(&self, known: &[usize]) -> Self {
        let mut given = self.clone();
        let stated = self.stated_inputs;
        let of = |state: &usize| {
            self.known.iter().find(|(known, _)| known == state).map(|(_, input)| input.clone())
        };
        given.inputs.splice(stated..stated, known.iter().filter_map(of));
        given.stated_inputs += known.len();
        given
    }

    /// The inputs at a sample.
    pub fn inputs_at(&self, k: usize, to: &mut Vec<f64>) {
        to.clear();
        // A loop: for each sample, an adapter of iterators is a call.
        for input in &self.inputs {
            to.push(input.sample(k).0);
        }
    }
}

/// The way of one filter.
pub struct EquationCourse<'a> {
    model: &'a EquationModel,
    data: &'a EquationSegment<'a>,
    /// How each input goes between two samples.
    between: &'a [Interpolation],
    /// The channels that correct the filter, by their places in the segment.
    channels: &'a [usize],
    /// So many steps from sample to sample at least; how many, and each of them.
    least: usize,
    parts: (usize, Interval),
    /// What finds how many steps are needed, sample by sample, where the motion has kinks.
    kinks: Option<KinkSteps>,
    /// Innovation and standard deviation of each channel after the first, at the last sample.
    further: Vec<[f64; 2]>,
    /// The inputs at the start, in the middle and at the end of a step; kept, so that none is allocated for each.
    nodes: [Vec<f64>; 3],
    room: StepRoom,
    /// What happened, by the row at which the filter is told or judged, and the way back to it.
    told: Vec<(usize, EventMeasurement)>,
    way: BackwardInterval,
    late_s: Vec<f64>,
    /// Whether parameters are states that say what inputs add to a signal.
    has_input_part: bool,
    /// What of the signal corrects the filter.
    variant: Variant,
    log_likelihood: f64,
    /// The names of what follows from the states, and whether it follows from the inputs as well.
    quantities: Vec<StateName>,
    need_inputs: bool,
    /// The rate of the motion in rad/s by which amplitude and phase are said.
    phase_rate: Option<f64>,
    /// What predicts zero phases.
    phases: Option<PhaseCourse>,
    /// The variance of a sample of each channel, as its noise is at the mean that the sample is predicted from.
    variances: Vec<f64>,
    /// The variance that a sample of its one signal is taken for, where that is not the noise's.
    signal_variance: Option<f64>,
    /// The variance of a sample as the innovations tell it, where the filter estimates it: now, and where the way begins.
    noise: Option<NoiseEstimate>,
    first_noise: Option<NoiseEstimate>,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it.
const SAME: f64 = 1e-6;

impl<'a> EquationCourse<'a> {
    /// A way through this segment, on which a filter uses these channels and these events.
    ///
    /// It takes so many steps from sample to sample.
    pub fn new(
        model: &'a EquationModel,
        (data, between): (&'a EquationSegment<'a>, &'a [Interpolation]),
        (channels, events): (&'a [usize], &[FilterEventUse]),
        steps: usize,
    ) -> Self {
        let parts = (steps, Interval::of(data.samples.interval_s / steps as f64));
        let nodes = [const { Vec::new() }; 3];
        let told = event_measurements(&data.events, events, (data.time_s, data.samples.interval_s));
        let way = BackwardInterval::default();
        Self {
            model,
            data,
            between,
            channels,
            least: steps,
            parts,
            kinks: model.has_kinks().then(|| KinkSteps::new(data.samples.interval_s)),
            further: Vec::new(),
            nodes,
            room: StepRoom::default(),
            told,
            way,
            late_s: Vec::new(),
            has_input_part: model.moving() < model.rest().len() && !data.inputs.is_empty(),
            variant: Variant::Full,
            log_likelihood: 0.0,
            quantities: Vec::new(),
            need_inputs: false,
            phase_rate: None,
            phases: None,
            variances: Vec::new(),
            signal_variance: None,
            noise: None,
            first_noise: None,
        }
    }

    /// The same, where the quantities of a device are answers too.
    #[must_use]
    pub fn answering(self, device: &Device) -> Self {
        let (quantities, need_inputs) = (names::quantities(device), device.quantities_need_inputs());
        Self { quantities, need_inputs, ..self }
    }

    /// The same, where amplitude and phase are said by this rate of the motion in rad/s, and zero phases are predicted.
    #[must_use]
    pub fn telling_phases(self, phase_rate: Option<f64>, phases: Option<PhaseCourse>) -> Self {
        Self { phase_rate, phases, ..self }
    }

    /// What predicts zero phases, and the variance of a sample that was estimated, at the end of the way.
    pub fn into_kept(self) -> (Option<PhaseCourse>, Option<NoiseEstimate>) {
        (self.phases, self.noise)
    }

    /// The same, where the variance of a sample is estimated.
    #[must_use]
    pub fn estimating_noise(self, noise: Option<NoiseEstimate>) -> Self {
        Self { first_noise: noise.clone(), noise, ..self }
    }

    /// The same for a filter that moves points of its own from sample to sample, or for one that does not.
    #[must_use]
    pub fn moving_points(self, moves_points: bool) -> Self {
        Self { kinks: self.kinks.map(|kinks| kinks.moving_points(moves_points)), ..self }
    }

    /// The same, where a sample of its one signal is taken for this variance.
    #[must_use]
    pub fn taking_samples_for(self, signal_variance: Option<f64>) -> Self {
        Self { signal_variance, ..self }
    }

    /// The same, where the filter takes the signal so.
    #[must_use]
    pub fn taking_signal(self, variant: Variant) -> Self {
        Self { variant, ..self }
    }

    /// Corrects a filter by the events that it is told of at row `k`, and judges it by those that it could be told of.
    ///
    /// An event is the measurement g = 0, or of another value, of its expression at its own time, and the standard deviation of that time is one of g by
    /// the rate of g.
    fn tell(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let first = self.told.partition_point(|(row, _)| *row < k);
        let here = self.told.iter().skip(first).take_while(|(row, _)| *row == k);
        let (model, step_s) = (self.model, (self.model, self.data.samples.interval_s));
        for (_, told) in here {
            let [of_time, own] = told.variances;
            self.late_s.clear();
            if let Some((measure, rise)) = told.rise.filter(|_| self.has_input_part) {
                let nearest = self.data.time_s.partition_point(|t| *t < told.time_s);
                self.data.inputs_at(nearest.min(self.data.time_s.len() - 1), &mut self.nodes[0]);
                self.late_s.resize(filter.mean().len(), 0.0);
                input_part_slopes(model, measure, &self.nodes[0], &mut self.late_s);
                self.late_s.iter_mut().for_each(|slope| *slope /= -rise);
            }
            let late_s = &self.late_s;
            if let Some(judged) = told.judged {
                self.way.to((self.data.time_s, k, judged.time_s), step_s, &self.data.inputs);
                let then = EventSensor { model, event: told.event, way: &self.way, late_s };
                let variance = then.rate(filter.mean()).powi(2) * judged.time_variance + own;
                let judgement = filter.update_within(&then, judged.value, variance, NEVER)?;
                self.log_likelihood += judgement.log_likelihood();
                if matches!(told.acceptance, EventAcceptance::Judged) {
                    continue;
                }
            }
            self.way.to((self.data.time_s, k, told.time_s), step_s, &self.data.inputs);
            let then = EventSensor { model, event: told.event, way: &self.way, late_s };
            let rate = || then.rate(filter.mean());
            let variance = told.variance.unwrap_or_else(|| rate().powi(2) * of_time + own);
            let share = told.rise.and_then(|(measure, _)| self.share_of_samples(measure));
            let before = share.map(|share| (share, ClaimBefore::of(filter, &then)));
            let variance = variance * (1.0 + share.unwrap_or(0.0));
            let innovation = match told.acceptance {
                EventAcceptance::Judged => filter.update_within(&then, told.value, variance, NEVER)?,
                EventAcceptance::Within(largest_nis) => {
                    filter.update_within(&then, told.value, variance, largest_nis)?
                }
                EventAcceptance::ByGate => filter.update(EVENTS, &then, told.value, variance)?,
            };
            if let Some((share, before)) = before.filter(|_| innovation.taken) {
                before.give_back(filter, share)?;
            }
            if told.judged.is_none() {
                self.log_likelihood += innovation.log_likelihood();
            }
            if !matches!(told.acceptance, EventAcceptance::Judged) {
                counts.crossings += 1;
                counts.crossings_refused += usize::from(!innovation.taken);
            }
        }
        Ok(())
    }
}

/// A measurement with its derivative by the first state left out, as it is printed of a comb's current: by [0, h(θ), …].
struct PrintedSensor<'a>(MeasurementUnderInputs<'a>);

impl Sensor for PrintedSensor<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        self.0.read(x)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let value = self.0.linearize(x, slopes);
        slopes.iter_mut().take(1).for_each(|slope| *slope = 0.0);
        value
    }
}

/// Takes the inputs of a step from nodes of each.
pub fn set_nodes<T>(
    nodes: &mut [Vec<f64>; 3],
    inputs: impl Iterator<Item = T>,
    of: impl Fn(T) -> Nodes<f64>,
) {
    let [starts, middles, ends] = nodes;
    starts.clear();
    middles.clear();
    ends.clear();
    for Nodes { start, middle, end } in inputs.map(of) {
        starts.push(start);
        middles.push(middle);
        ends.push(end);
    }
}

impl Course for EquationCourse<'_> {
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        let first = self.channels.first().and_then(|place| self.data.channels.get(*place));
        first.map_or(&[], |channel| channel.signal)
    }

    /// The input of a device that has one.
    fn drive(&self, k: usize) -> Option<f64> {
        let stated = self.data.stated_inputs == 1;
        self.data.inputs.first().filter(|_| stated).map(|drive| drive.sample(k).0)
    }

    fn signals(&self) -> Vec<SignalName> {
        let channels = self.channels.iter().filter_map(|place| self.data.channels.get(*place));
        channels.map(|channel| SignalName { name: channel.name.to_owned(), kind: channel.kind }).collect()
    }

    fn derived(&self) -> Option<DerivedQuantities> {
        let rows = if self.need_inputs { self.data.time_s.len() } else { 0 };
        let inputs = (0..rows).flat_map(|k| self.data.inputs.iter().map(move |input| input.sample(k).0));
        let own = self.model.derived(self.quantities.clone(), inputs.collect());
        let phases = self.phase_rate.map(DerivedQuantities::amplitude_and_phase);
        match (own, phases) {
            (Some(own), Some(phases)) => Some(own.and(phases)),
            (own, phases) => own.or(phases),
        }
    }

    fn predict_phases(&mut self, filter: &dyn Filtering, k: usize) {
        if let Some(phases) = &mut self.phases {
            phases.take(filter, k, (self.model, self.data, self.between));
        }
    }

    fn further_innovations(&self) -> &[[f64; 2]] {
        &self.further
    }

    /// Σ ln p(g = 0 | what came before) over the events.
    fn conclude(&self, trajectory: &mut Trajectory) {
        trajectory.crossings_log_likelihood = self.log_likelihood;
        if let Some(noise) = &self.noise {
            trajectory.states.push(noise.series(trajectory.time_s.len()));
        }
    }

    fn pass_over(&mut self) {
        if let Some(noise) = &mut self.noise {
            noise.add(None);
        }
    }

    fn divide(&mut self, steps: usize) -> bool {
        if self.kinks.is_some() {
            return false;
        }
        let steps = steps.max(self.least);
        if steps != self.parts.0 {
            self.parts = (steps, Interval::of(self.data.samples.interval_s / steps as f64));
        }
        self.model.divides()
    }

    fn rewind(&mut self) {
        self.log_likelihood = 0.0;
        self.noise.clone_from(&self.first_noise);
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let is_from_sine = self.data.inputs.iter().any(|input| input.sample(to).1);
        counts.drive_from_sine += usize::from(is_from_sine);
        let (from_s, to_s) = (self.data.time_s[to - 1], self.data.time_s[to]);
        let (interval, usual_s) = (to_s - from_s, self.data.samples.interval_s);
        let (steps, usual) = &self.parts;
        let of_usual = (interval / usual_s - 1.0).abs() <= SAME;
        let bridge = Bridge::over(interval, usual_s);
        if let Some(kinks) = self.kinks.as_mut().filter(|_| of_usual) {
            let inputs = self.data.inputs.iter().zip(self.between.iter().copied());
            set_nodes(&mut self.nodes, inputs, |(input, between)| between.nodes(input, to));
            let [start, middle, end] = &self.nodes;
            return kinks.advance(self.model, filter, Nodes { start, middle, end }, counts);
        }
        let (intervals, steps) = if of_usual { (1, *steps) } else { (bridge.steps, *steps * bridge.steps) };
        if !of_usual {
            counts.bridged = counts.bridged.saturating_add(bridge.missing);
        }
        let other = (!of_usual).then(|| Interval::of(interval / steps as f64));
        let each = other.as_ref().unwrap_or(usual);
        // Over a gap each input follows its sine, where it has one; where it has none, the recording was refused.
        for step in 0..steps {
            let at = |step: usize| from_s + interval * step as f64 / steps as f64;
            let inputs = self.data.inputs.iter().zip(self.between.iter().copied());
            set_nodes(&mut self.nodes, inputs, |(input, between)| match input.substitute(to) {
                Some(sine) if intervals > 1 => {
                    between.between_ends(SegmentDrive::nodes_from_sine(sine, at(step), at(step + 1)))
                }
                _ if steps == 1 => between.nodes(input, to),
                _ => SegmentDrive::nodes_of_part(&between.nodes(input, to), step, steps),
            });
            let [start, middle, end] = &self.nodes;
            let nodes: Nodes<&[f64]> = Nodes { start, middle, end };
            // A state that was corrected past a reset is still to be reset.
            let sides = self.kinks.as_ref().filter(|_| step == 0).and_then(|_| filter.reset_sides());
            self.model.set_path(sides.map(|below| ResetPath::of(below).staying()));
            let under = self.model.under(each, nodes, filter.mean(), &mut self.room);
            let done = filter.predict(&under);
            self.model.set_path(None);
            done?;
        }
        if self.kinks.is_some() && filter.reset_sides().is_some() {
            filter.keep_reset_sides(Some(self.model.path_from(filter.mean(), &self.nodes[2]).below()));
        }
        Ok(())
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let innovation = self.corrected(filter, k, counts)?;
        if let Some(noise) = &mut self.noise {
            // An outlier says nothing of the noise.
            noise.add(innovation.as_ref().filter(|innovation| innovation.taken));
        }
        Ok(innovation)
    }
}

impl EquationCourse<'_> {
    /// How much of what a sample of this measurement tells the filter takes; `None` of a filter that takes none, or takes them as they are printed.
    fn share_of_samples(&self, measure: usize) -> Option<f64> {
        let mut own = self.channels.iter().filter_map(|place| self.data.channels.get(*place));
        let channel = own.find(|channel| channel.measure == measure);
        let channel = channel.filter(|_| self.variant == Variant::Full)?;
        Some(self.signal_variance.map_or(1.0, |taken| (channel.variance / taken).min(1.0)))
    }

    /// Corrects a filter by sample `k`.
    fn corrected(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        self.tell(filter, k, counts)?;
        if !self.data.bends.is_empty() && self.data.bends.binary_search(&k).is_ok() {
            counts.drive_bends += 1;
            return Ok(None);
        }
        let [inputs, ..] = &mut self.nodes;
        self.data.inputs_at(k, inputs);
        let channels = || self.channels.iter().filter_map(|place| self.data.channels.get(*place));
        let mean = filter.mean();
        self.variances.clear();
        let found = self.noise.as_ref().map(NoiseEstimate::variance);
        for channel in channels() {
            let stated = || channel.variance * self.model.noise_ratio(channel.measure, mean, inputs);
            self.variances.push(found.unwrap_or_else(stated));
        }
        if self.variant != Variant::Full {
            let Some((channel, variance)) = channels().zip(&self.variances).next() else { return Ok(None) };
            let printed = PrintedSensor(self.model.sensor(channel.measure, inputs));
            let sensor: &dyn Sensor = if self.variant == Variant::Literal { &printed } else { &printed.0 };
            let taken_for =
                (self.variant == Variant::Literal).then(|| self.signal_variance.unwrap_or(*variance));
            let y = channel.signal[k];
            return if y.is_finite() {
                by_signal_taken_for(filter, sensor, (y, *variance), taken_for).map(Some)
            } else {
                Ok(None)
            };
        }
        if self.signal_variance.is_some() {
            let Some((channel, variance)) =
                channels().zip(&self.variances).next().filter(|(channel, _)| channel.signal[k].is_finite())
            else {
                return Ok(None);
            };
            let (sensor, y) = (self.model.sensor(channel.measure, inputs), channel.signal[k]);
            return by_signal_taken_for(filter, &sensor, (y, *variance), self.signal_variance).map(Some);
        }
        let signals = channels().zip(&self.variances).map(|(channel, variance)| {
            (channel.signal[k], self.model.sensor(channel.measure, inputs), *variance)
        });
        by_signals(filter, signals, &mut self.further)
    }
}

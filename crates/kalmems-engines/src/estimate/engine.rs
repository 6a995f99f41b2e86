//! The one loop that takes a filter through a segment.

use super::any_filter::StateFilter;
use super::error_memory::ErrorMemory;
use super::gate::{Decisions, NEVER, Rejection, SampleGate};
use super::linked::LinkedFilter;
use super::loss_watch::{LossWatch, Reacquisition};
use super::phase_prediction::{PhasePredictor, StatePropagation};
use super::recovery::{FilterStop, Recovery};
use super::signal_watch::WatchedSample;
use super::step_watch::{StepCounts, StepFigure, followed_steps};
use super::trajectory::PHASE;
use super::transition::{Sensor, Transition};
use super::{
    AnyKnownStateStep, FilterFailure, FurtherSignal, KnownStateStep, Lock, MeanAndCovariance, Restart,
    SampleCounts, SignalName, StateSeries, Trajectory, TrajectoryKind,
};
use crate::progress::Pace;
use crate::progress::Progress;
use crate::units::{Kind, kind};
use kalmems_core::{Covariance, FilterError, Innovation, Mat};
use kalmems_models::control::MotionPhase;
use std::ops::{ControlFlow, Range};
use std::rc::Rc;
use std::time::Instant;

/// What a course leaves to the `course` that it holds.
macro_rules! held_course {
    () => {
        fn time_s(&self) -> &[f64] {
            self.course.time_s()
        }

        fn signal(&self) -> &[f64] {
            self.course.signal()
        }

        fn signals(&self) -> Vec<crate::estimate::SignalName> {
            self.course.signals()
        }

        fn drive(&self, k: usize) -> Option<f64> {
            self.course.drive(k)
        }

        fn derived(&self) -> Option<DerivedQuantities> {
            self.course.derived()
        }

        fn begin_again(
            &mut self,
            filter: &mut dyn Filtering,
            known: &AnyKnownStateStep,
        ) -> Result<(), FilterError> {
            self.course.begin_again(filter, known)
        }

        fn pass_over(&mut self) {
            self.course.pass_over();
        }

        fn conclude(&self, trajectory: &mut Trajectory) {
            self.course.conclude(trajectory);
        }

        fn divide(&mut self, steps: usize) -> bool {
            self.course.divide(steps)
        }

        fn rewind(&mut self) {
            self.course.rewind();
        }
    };
}

pub(super) use held_course;

/// What a filter meets on its way through one segment: how to get from one sample to the next, and what was
/// measured there.
pub trait Course {
    /// Time of each sample in s.
    fn time_s(&self) -> &[f64];

    /// The signal; not a number where it is missing.
    fn signal(&self) -> &[f64];

    /// The drive at sample `k` in V, of a device that one drive moves.
    fn drive(&self, k: usize) -> Option<f64> {
        let _ = k;
        None
    }

    /// The signals that correct a filter, of a device that can have several.
    fn signals(&self) -> Vec<SignalName> {
        Vec::new()
    }

    /// The innovation of each of these after the first one at the sample that was corrected last, and its standard deviation; not a
    /// number where the signal is missing.
    fn further_innovations(&self) -> &[[f64; 2]] {
        &[]
    }

    /// What is said of each sample beside the states, where there is something.
    fn derived(&self) -> Option<DerivedQuantities> {
        None
    }

    /// Predicts what will happen, from a filter that is corrected by sample `k`, where that is asked for.
    fn predict_phases(&mut self, filter: &dyn Filtering, k: usize) {
        let _ = (filter, k);
    }

    /// How a filter on this way is started again from the signal where it has lost it; `None` where it is not.
    fn reacquisition(&self) -> Option<Reacquisition> {
        None
    }

    /// What the rows before this one, as many as [`reacquisition`](Self::reacquisition) says, tell of the states at it, without what a filter knew
    /// before; `None` where they tell nothing that can be believed. `held` is the time in s and the state at which the signal was not lost yet.
    fn start_again(&mut self, row: usize, held: (f64, &[f64])) -> Option<MeanAndCovariance> {
        let _ = (row, held);
        None
    }

    /// Puts a filter that stopped into a known state at a row, and with it what this way holds besides.
    fn begin_again(
        &mut self,
        filter: &mut dyn Filtering,
        known: &AnyKnownStateStep,
    ) -> Result<(), FilterError> {
        filter.take_over(known)
    }

    /// Passes over a row at which the filter has stopped.
    fn pass_over(&mut self) {}

    /// Enters what is known of the whole at the end of a filter's way, where there is something.
    fn conclude(&self, trajectory: &mut Trajectory) {
        let _ = trajectory;
    }

    /// Takes so many steps from each sample to the next from here on; `false` of a course that does not, as its steps are exact or those of
    /// a published method.
    fn divide(&mut self, steps: usize) -> bool {
        let _ = steps;
        false
    }

    /// Forgets what it has summed up on its way, to be gone from the beginning.
    fn rewind(&mut self) {}

    /// Predicts from sample `to − 1` to sample `to`, and counts what was not there.
    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError>;

    /// Corrects a filter by what is known at sample `k`; `None` where there is no signal.
    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError>;
}

/// A filter of any kind and any number of states, as a course leads it.
pub trait Filtering {
    /// The mean of the state.
    fn mean(&self) -> &[f64];

    /// The lower triangle of the covariance, row by row.
    fn covariance(&self, to: &mut [f64]);

    /// Moves the state by one step.
    fn predict(&mut self, transition: &dyn Transition) -> Result<(), FilterError>;

    /// Adds the noise of this step, which leaves the state where it is, to what is claimed of it: no motion that a smoother would go back over.
    fn widen(&mut self, noise: &dyn Transition) -> Result<(), FilterError> {
        self.predict(noise)
    }

    /// On which side of each reset of the device the state has come by its motion, a bit for each; `None` for a device without resets.
    fn reset_sides(&self) -> Option<u32> {
        None
    }

    /// Keeps these sides.
    fn keep_reset_sides(&mut self, sides: Option<u32>) {
        let _ = sides;
    }

    /// Lets a smoother go no further back than here: what is known later says nothing more of the states before.
    fn part(&mut self) {}

    /// Comes to a state that is known of all that it has, whatever was before.
    fn take_over(&mut self, known: &AnyKnownStateStep) -> Result<(), FilterError> {
        self.predict(known)
    }

    /// Corrects the state with a sample `y` of this noise variance, where its NIS is not above the largest that is believed.
    fn update_within(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError>;

    /// Corrects the state with a sample `y` of this noise variance, where the filter has no gate that rejects it; the signal is 0 for
    /// the first one, and further ones from 1 on.
    fn update(
        &mut self,
        signal: usize,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let _ = signal;
        self.update_within(sensor, y, variance, f64::INFINITY)
    }

    /// How it takes its samples, of a filter that may reject some.
    fn watch(&mut self) -> Option<&mut SampleGate> {
        None
    }

    /// Takes note, at a sample whose innovation had this NIS, of how far its steps have led it astray; of a filter that follows that.
    fn take_step_error(&mut self, nis: f64) {
        let _ = nis;
    }

    /// The error of its steps since this was asked last, in standard deviations that it claims; `None` where that is not followed, or the
    /// steps are exact.
    fn step_error(&mut self) -> Option<StepFigure> {
        None
    }

    /// Lets zero phases be predicted from what it knows at this time in s, and from how its state goes on, where that is known.
    fn predict_phases(
        &self,
        predictor: &mut PhasePredictor,
        time_s: f64,
        onwards: Option<&dyn StatePropagation>,
    );
}

/// Corrects a filter by the signal at sample `k`, if there is one.
pub fn by_signal(
    filter: &mut dyn Filtering,
    y: f64,
    (sensor, variance): (&dyn Sensor, f64),
) -> Result<Option<Innovation<f64, 1>>, FilterError> {
    of_signal(filter, 0, y, (sensor, variance))
}

/// Likewise by one of several signals.
fn of_signal(
    filter: &mut dyn Filtering,
    signal: usize,
    y: f64,
    (sensor, variance): (&dyn Sensor, f64),
) -> Result<Option<Innovation<f64, 1>>, FilterError> {
    if y.is_finite() { filter.update(signal, sensor, y, variance).map(Some) } else { Ok(None) }
}

/// Corrects a filter by several signals at one sample, one after the other, each linearised where those before it have led: the
/// innovation of the first one, and of each behind it innovation and standard deviation, written to `further`, not a number where
/// the signal is missing.
///
/// Each innovation is predicted by the past and the signals before it, so that all sequences are white, and independent of one
/// another, for a filter that is right.
pub fn by_signals<S: Sensor>(
    filter: &mut dyn Filtering,
    signals: impl Iterator<Item = (f64, S, f64)>,
    further: &mut Vec<[f64; 2]>,
) -> Result<Option<Innovation<f64, 1>>, FilterError> {
    let mut first = None;
    further.clear();
    for (i, (y, sensor, variance)) in signals.enumerate() {
        let innovation = of_signal(filter, i, y, (&sensor, variance))?;
        if i == 0 {
            first = innovation;
        } else {
            let of = |found: Innovation<f64, 1>| [found.residual[0], found.covariance.standard_deviation(0)];
            further.push(innovation.map_or([f64::NAN; 2], of));
        }
    }
    Ok(first)
}

/// Corrects a filter by a signal that it takes for another variance than that of the signal's noise, or not at all; the innovation is
/// judged by the variance of the noise all the same, so that those of all filters are of the same signal.
pub fn by_signal_taken_for(
    filter: &mut dyn Filtering,
    sensor: &dyn Sensor,
    (y, variance): (f64, f64),
    taken_for: Option<f64>,
) -> Result<Innovation<f64, 1>, FilterError> {
    if taken_for == Some(variance) {
        return filter.update(0, sensor, y, variance);
    }
    let mut judgement = filter.update_within(sensor, y, variance, NEVER)?;
    if let Some(variance) = taken_for {
        judgement.taken = filter.update_within(sensor, y, variance, f64::INFINITY)?.taken;
    }
    Ok(judgement)
}

/// Quantities that follow from the states, such as a position from an amplitude and a phase.
#[derive(Clone)]
pub struct DerivedQuantities {
    names: Vec<StateName>,
    compute: Rc<Compute>,
}

/// Gives place, mean and standard deviation of each quantity, from the row of the course, the mean of the states and the entries of their
/// covariance.
pub type Compute = dyn Fn(usize, &[f64], &dyn Fn(usize, usize) -> f64, &mut dyn FnMut(usize, (f64, f64)));

impl DerivedQuantities {
    /// Quantities of these names.
    pub fn new(
        names: Vec<StateName>,
        compute: impl Fn(usize, &[f64], &dyn Fn(usize, usize) -> f64, &mut dyn FnMut(usize, (f64, f64))) + 'static,
    ) -> Self {
        Self { names, compute: Rc::new(compute) }
    }

    /// Amplitude and phase of the first two states, an angle and its rate, by this rate of the motion in rad/s.
    pub fn amplitude_and_phase(rate: f64) -> Self {
        let names = vec![("amplitude", "rad", &kind::ANGLE), (PHASE, "rad", &kind::ANGLE)];
        Self::new(names, move |_, mean, covariance, to| {
            let of_motion: [f64; 2] = std::array::from_fn(|i| mean.get(i).copied().unwrap_or(f64::NAN));
            let covariance = Covariance::from_lower(Mat::from_fn(covariance));
            let motion = MotionPhase::of(&of_motion, &covariance, rate);
            to(0, (motion.amplitude, motion.amplitude_sd));
            to(1, (motion.phase, motion.phase_sd));
        })
    }

    /// These, followed by others.
    #[must_use]
    pub fn and(self, others: Self) -> Self {
        let (count, first, second) = (self.names.len(), self.compute, others.compute);
        let names = self.names.into_iter().chain(others.names).collect();
        Self::new(names, move |row, mean, covariance, to| {
            first(row, mean, covariance, to);
            second(row, mean, covariance, &mut |place, value| to(count + place, value));
        })
    }

    /// The names of the states, and of what follows from them.
    pub(super) fn after(derived: Option<&Self>, states: &[StateName]) -> Vec<StateName> {
        states.iter().chain(derived.iter().flat_map(|derived| &derived.names)).copied().collect()
    }
}

/// The standard deviation of a quantity with this gradient by the states, √(gᵀ·P·g), from the entries of their covariance.
pub fn deviation(gradient: &[f64], p: &dyn Fn(usize, usize) -> f64) -> f64 {
    let mut variance = 0.0;
    for (i, one) in gradient.iter().enumerate() {
        for (j, other) in gradient.iter().enumerate() {
            variance += one * p(i, j) * other;
        }
    }
    variance.sqrt()
}

impl Trajectory {
    /// Takes what was entered of a sample back, at which the filter stopped.
    fn blank_sample(&mut self, k: usize) {
        let series = [&mut self.innovation, &mut self.innovation_sd, &mut self.nis, &mut self.log_likelihood];
        for series in series {
            series[k] = f64::NAN;
        }
        for signal in &mut self.further {
            signal.enter(k, [f64::NAN; 2]);
        }
        for state in &mut self.states {
            (state.mean[k], state.sd[k]) = (f64::NAN, f64::NAN);
        }
    }

    /// Enters what was rejected of sample `k`: it is no innovation of the signal.
    fn enter_rejections(&mut self, k: usize, watch: &SampleGate) {
        self.gate_turns.extend(watch.turned());
        let time_s = self.time_s[k];
        for &(signal, innovation, sd) in watch.rejected() {
            self.rejected.push(Rejection { sample: k, time_s, signal, innovation, sd });
            self.counts.rejected += 1;
            if let Some(further) = signal.checked_sub(1).and_then(|place| self.further.get_mut(place)) {
                further.enter(k, [f64::NAN; 2]);
            }
        }
    }

    /// Enters what is known of the states at sample `k`, a row of the course, and what follows from it.
    pub(super) fn keep(
        &mut self,
        derived: Option<&DerivedQuantities>,
        (k, row): (usize, usize),
        mean: &[f64],
        covariance: &dyn Fn(usize, usize) -> f64,
    ) {
        for (i, state) in self.states.iter_mut().take(mean.len()).enumerate() {
            state.mean[k] = mean[i];
            state.sd[k] = (covariance(i, i) + (ARITHMETIC * mean[i]).powi(2)).sqrt();
        }
        let Some(derived) = derived else { return };
        let states = mean.len().min(self.states.len());
        let (_, quantities) = self.states.split_at_mut(states);
        (derived.compute)(row, mean, covariance, &mut |place, (mean, sd)| {
            if let Some(state) = quantities.get_mut(place) {
                (state.mean[k], state.sd[k]) = (mean, sd);
            }
        });
    }
}

/// What a mean is known to at best, relative to itself: the rounding of a long way, 2⁻⁴⁰. Without process noise a covariance falls below it.
const ARITHMETIC: f64 = 1.0 / (1_u64 << 40) as f64;

/// Samples between two looks at the progress.
const CHUNK: usize = 65_536;

/// A state of a trajectory: its name, its SI unit as column names have it, and what it is.
pub type StateName = (&'static str, &'static str, &'static Kind);

impl Trajectory {
    /// A trajectory without a number yet, over these samples of a signal.
    pub fn blank(
        (key, name): (&str, &str),
        kind: TrajectoryKind,
        (time_s, signal, samples): (&[f64], &[f64], &Range<usize>),
        states: &[StateName],
    ) -> Self {
        let n = samples.len();
        let blank = || vec![f64::NAN; n];
        Self {
            key: key.to_owned(),
            name: name.to_owned(),
            kind,
            states: states
                .iter()
                .map(|&(name, unit, kind)| StateSeries { name, unit, kind, mean: blank(), sd: blank() })
                .collect(),
            signal: signal[samples.clone()].to_vec(),
            innovation: blank(),
            innovation_sd: blank(),
            nis: blank(),
            log_likelihood: blank(),
            crossings_log_likelihood: 0.0,
            counts: SampleCounts { samples: n, ..SampleCounts::default() },
            lock: Lock::default(),
            rejected: Vec::new(),
            gate_nis: None,
            gate_turns: Vec::new(),
            restarts: Vec::new(),
            lost_s: Vec::new(),
            signal_name: None,
            further: Vec::new(),
            steps: StepCounts::default(),
            step_errors: Vec::new(),
            error_spans: Vec::new(),
            whitens: true,
            parameters: Vec::new(),
            parameter_correlations: Vec::new(),
            considered: Vec::new(),
            hidden_signs: Vec::new(),
            hidden_turns: Vec::new(),
            periods: Vec::new(),
            own_states: states.len(),
            mirrored: false,
            stops: Vec::new(),
            failure: None,
            seconds_per_step: f64::NAN,
            time_s: time_s[samples.clone()].to_vec(),
        }
    }

    /// Puts another part behind, which follows this one.
    pub(super) fn append(&mut self, mut later: Self) {
        for (state, later) in self.states.iter_mut().zip(&mut later.states) {
            state.mean.append(&mut later.mean);
            state.sd.append(&mut later.sd);
        }
        let before = self.time_s.len();
        let rejected = later.rejected.iter().map(|one| Rejection { sample: before + one.sample, ..*one });
        self.rejected.extend(rejected);
        self.gate_turns.extend_from_slice(&later.gate_turns);
        self.restarts.append(&mut later.restarts);
        self.lost_s.append(&mut later.lost_s);
        self.step_errors.append(&mut later.step_errors);
        self.steps.append(&later.steps);
        for stop in later.stops.drain(..) {
            self.enter_stop(stop);
        }
        self.each_series(&mut later, Vec::append);
    }

    /// Takes what belongs to the first samples off, as many as are asked for.
    #[must_use]
    pub fn take_front(&mut self, count: usize) -> Self {
        let mut front = self.hollow();
        let split = |rest: &mut Vec<f64>, front: &mut Vec<f64>| {
            front.extend(rest.drain(..count.min(rest.len())));
        };
        for (rest, front) in self.states.iter_mut().zip(&mut front.states) {
            split(&mut rest.mean, &mut front.mean);
            split(&mut rest.sd, &mut front.sd);
        }
        self.each_series(&mut front, split);
        let of_front = self.rejected.partition_point(|one| one.sample < count);
        front.rejected.extend(self.rejected.drain(..of_front));
        self.rejected.iter_mut().for_each(|one| one.sample -= count);
        let last_s = front.time_s.last().copied().unwrap_or(f64::NEG_INFINITY);
        let of_front = self.gate_turns.partition_point(|turn| turn.time_s <= last_s);
        front.gate_turns.extend(self.gate_turns.drain(..of_front));
        let of_front = self.restarts.partition_point(|restart| restart.time_s <= last_s);
        front.restarts.extend(self.restarts.drain(..of_front));
        let of_front = self.step_errors.partition_point(|one| one.until_s <= last_s);
        front.step_errors.extend(self.step_errors.drain(..of_front));
        self.steps.forget_until(last_s);
        let of_front = self.lost_s.partition_point(|began_s| *began_s <= last_s);
        front.lost_s.extend(self.lost_s.drain(..of_front));
        let begun = self.stops.iter().filter(|stop| stop.failure.time_s <= last_s);
        front.stops.extend(begun);
        self.stops.retain(|stop| stop.until_s > last_s);
        front
    }

    /// The same without its series of numbers.
    pub(super) fn hollow(&self) -> Self {
        let empty = |state: &StateSeries| StateSeries { mean: Vec::new(), sd: Vec::new(), ..*state };
        Self {
            key: self.key.clone(),
            name: self.name.clone(),
            states: self.states.iter().map(empty).collect(),
            signal: Vec::new(),
            innovation: Vec::new(),
            innovation_sd: Vec::new(),
            nis: Vec::new(),
            log_likelihood: Vec::new(),
            rejected: Vec::new(),
            gate_turns: Vec::new(),
            restarts: Vec::new(),
            lost_s: Vec::new(),
            step_errors: Vec::new(),
            steps: self.steps.clone(),
            stops: Vec::new(),
            lock: self.lock.clone(),
            signal_name: self.signal_name.clone(),
            further: self.further.iter().map(FurtherSignal::hollow).collect(),
            error_spans: self.error_spans.clone(),
            parameters: self.parameters.clone(),
            parameter_correlations: self.parameter_correlations.clone(),
            considered: Vec::new(),
            hidden_signs: self.hidden_signs.clone(),
            hidden_turns: self.hidden_turns.clone(),
            periods: self.periods.clone(),
            time_s: Vec::new(),
            ..*self
        }
    }

    /// Enters a time without an estimate, which may be one that is known already, by now to its end.
    fn enter_stop(&mut self, stop: FilterStop) {
        match self.stops.last_mut().filter(|last| last.failure.time_s == stop.failure.time_s) {
            Some(last) => *last = stop,
            None => self.stops.push(stop),
        }
    }

    /// Whether the filter had stopped at this time in s.
    pub fn is_stopped_at(&self, time_s: f64) -> bool {
        self.stops.iter().any(|stop| stop.covers(time_s))
    }

    /// Does something with each series of numbers of this and another trajectory, but the states'.
    fn each_series(&mut self, other: &mut Self, mut each: impl FnMut(&mut Vec<f64>, &mut Vec<f64>)) {
        each(&mut self.time_s, &mut other.time_s);
        each(&mut self.signal, &mut other.signal);
        each(&mut self.innovation, &mut other.innovation);
        each(&mut self.innovation_sd, &mut other.innovation_sd);
        each(&mut self.nis, &mut other.nis);
        each(&mut self.log_likelihood, &mut other.log_likelihood);
        for (own, other) in self.further.iter_mut().zip(&mut other.further) {
            for (own, other) in own.series_mut().into_iter().zip(other.series_mut()) {
                each(own, other);
            }
        }
    }
}

/// A filter on its way through a segment.
pub struct FilterRun<const N: usize> {
    filter: LinkedFilter<N>,
    /// The filter at the first row of the part that was taken last, predicted and not yet corrected.
    entry: LinkedFilter<N>,
    /// The filter as it was made.
    made: Box<dyn StateFilter<N>>,
    begun: bool,
    recovery: Recovery,
    errors: ErrorMemory<N>,
    loss: LossWatch,
    /// Steps from sample to sample, and whether they become more where their error is too large.
    steps: usize,
    adapts_steps: bool,
}

impl<const N: usize> FilterRun<N> {
    /// From the segment's first sample on.
    pub(super) fn new(filter: Box<dyn StateFilter<N>>, watch: SampleGate) -> Self {
        let made = filter.copied();
        // Remembers what only a smoother needs; so that a filter is compiled once for both.
        let filter = LinkedFilter::new(filter, watch);
        let (errors, loss) = (ErrorMemory::new(), LossWatch::new(N));
        let recovery = Recovery::new(filter.gaussian().into());
        Self {
            entry: filter.clone(),
            filter,
            made,
            begun: false,
            recovery,
            errors,
            loss,
            steps: 1,
            adapts_steps: false,
        }
    }

    /// From a sample on at which a filter was left with this mean and covariance, and with these numbers of its watch for a lost signal.
    pub(super) fn resumed(
        filter: Box<dyn StateFilter<N>>,
        watch: SampleGate,
        left: &MeanAndCovariance,
        loss: &[f64],
    ) -> Result<Self, FilterError> {
        let mut followed = Self::new(filter, watch);
        followed.filter.predict(&KnownStateStep::<N>::from(left.gaussian()))?;
        followed.begun = true;
        if let Some((recovery, loss)) = loss.split_first_chunk() {
            followed.recovery.resume(*recovery);
            let (loss, sides) = loss.split_at_checked(LossWatch::count(N)).unwrap_or((loss, &[]));
            followed.loss = LossWatch::resumed(loss, N);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // such a number
            followed.filter.keep_reset_sides(sides.first().map(|sides| *sides as u32));
        }
        Ok(followed)
    }

    /// The same, with the error of its steps followed.
    #[must_use]
    pub(super) fn watching_steps(self, is_unscented: bool) -> Self {
        let entry = self.entry.watching_steps(is_unscented);
        Self { filter: self.filter.watching_steps(is_unscented), entry, ..self }
    }

    /// What the filter knows.
    pub(super) fn known(&self) -> MeanAndCovariance {
        self.filter.gaussian().into()
    }

    /// How it takes its samples, as numbers.
    pub(super) fn watch_numbers(&self) -> Vec<f64> {
        self.filter.watched().numbers()
    }

    /// What it knows of its stops, of the loss of its signal and of the sides of resets, as numbers.
    pub(super) fn loss_numbers(&self) -> Vec<f64> {
        let sides = self.filter.reset_sides().map(f64::from);
        self.recovery.numbers().into_iter().chain(self.loss.numbers()).chain(sides).collect()
    }

    /// Follows what another run of the filter rejected, or decides by itself.
    pub(super) fn follow_decisions(&mut self, decided: Option<&Decisions>) {
        self.filter.follow(decided);
    }

    /// Takes so many steps from sample to sample from here on, or more where their error is too large and that is wanted.
    pub(super) fn take_steps(&mut self, steps: usize, adapts: bool) {
        (self.steps, self.adapts_steps) = (steps, adapts);
    }

    /// Steps from sample to sample.
    pub(super) const fn steps(&self) -> usize {
        self.steps
    }

    /// The filter where it is now.
    pub(super) fn present(&self) -> &LinkedFilter<N> {
        &self.filter
    }

    /// The filter at the first row of the part that was taken last.
    pub(super) fn entry(&self) -> &LinkedFilter<N> {
        &self.entry
    }

    /// Takes the filter through the new samples of a course and records what it says. `None` where the work was stopped.
    ///
    /// A prediction or an update that is refused for another reason than a missing sample stops the filter: the trajectory
    /// says where and why, and has no numbers from there on until the filter is started again, which `stays_lost` keeps it from.
    pub(super) fn follow(
        &mut self,
        names: (&str, &str),
        course: &mut dyn Course,
        fresh: &Range<usize>,
        states: &[StateName],
        stays_lost: bool,
        progress: &dyn Progress,
    ) -> Option<Trajectory> {
        let derived = course.derived();
        let mut trajectory = Trajectory::blank(
            names,
            TrajectoryKind::Filtered,
            (course.time_s(), course.signal(), fresh),
            &DerivedQuantities::after(derived.as_ref(), states),
        );
        trajectory.own_states = states.len();
        let n = fresh.len();
        let mut signals = course.signals().into_iter();
        trajectory.signal_name = signals.next();
        trajectory.further = signals.map(|of| FurtherSignal::blank(of, n)).collect();
        let is_taken = course.divide(self.steps);
        let first_s = trajectory.time_s.first().copied().unwrap_or(f64::NAN);
        trajectory.steps.begin(first_s, self.steps, is_taken);
        progress.begin(names.1, n as u64);
        let (started, mut pace) = (Instant::now(), Pace::default());
        let again = course.reacquisition();
        for k in 0..n {
            // A step over a gap counts as the samples that it stands for.
            let steps = k.saturating_add(trajectory.counts.bridged);
            if k % CHUNK == 0 && progress.reached(k as u64) == ControlFlow::Break(())
                || pace.stops(steps, progress, k as u64)
            {
                return None;
            }
            let place = (fresh.start, k);
            if self.recovery.stopped().is_some()
                && (stays_lost || !self.start_again(course, again.as_ref(), place, &mut trajectory))
            {
                if k == 0 {
                    self.entry.clone_from(&self.filter);
                }
                course.pass_over();
                continue;
            }
            match self.step((course, derived.as_ref()), again.as_ref(), place, &mut trajectory) {
                Ok(()) => self.recovery.ran(),
                Err(why) => {
                    let failure = FilterFailure { time_s: trajectory.time_s[k], why };
                    self.stop(failure, k);
                    trajectory.blank_sample(k);
                    course.pass_over();
                }
            }
        }
        if let Some(failure) = self.recovery.stopped() {
            trajectory.enter_stop(FilterStop { failure, until_s: f64::INFINITY });
            trajectory.failure = Some(failure);
        }
        course.conclude(&mut trajectory);
        let last_s = trajectory.time_s.last().copied().unwrap_or(f64::NAN);
        trajectory.error_spans.extend(self.errors.rest(last_s));
        trajectory.seconds_per_step = started.elapsed().as_secs_f64() / n.max(1) as f64;
        if progress.reached(n as u64) == ControlFlow::Break(()) {
            return None;
        }
        Some(trajectory)
    }

    /// Stops the filter at a row, in the state that it began from, so that who looks at it finds numbers.
    fn stop(&mut self, failure: FilterFailure, k: usize) {
        self.recovery.stop(failure);
        self.loss.stop();
        self.filter.forget();
        // An unscented filter whose covariance is not definite comes to no other state, as it draws its points from that one.
        self.filter.put(self.made.copied());
        // The filter began from this state, which therefore is one.
        let _ = self.filter.take_over(&AnyKnownStateStep::from(&self.recovery.start));
        if k == 0 {
            self.entry.clone_from(&self.filter);
        }
    }

    /// Starts a filter again that has stopped, where that is due and a start is found; whether the row is to be taken.
    fn start_again(
        &mut self,
        course: &mut dyn Course,
        again: Option<&Reacquisition>,
        (first, k): (usize, usize),
        trajectory: &mut Trajectory,
    ) -> bool {
        let Some(failure) = self.recovery.stopped() else { return true };
        if !self.recovery.is_due(again.map_or(0, |again| again.rows)) {
            return false;
        }
        let (held_s, held) = self.loss.held();
        let known = match again {
            Some(_) => course.start_again(first + k, (held_s, held)),
            None => Some(self.recovery.start.clone()),
        };
        let Some(known) = known else { return false };
        self.filter.forget();
        if course.begin_again(&mut self.filter, &AnyKnownStateStep::from(&known)).is_err() {
            return false;
        }
        let (until_s, before) = (trajectory.time_s[k], held.to_vec());
        trajectory.restarts.push(Restart { time_s: until_s, known, before });
        trajectory.enter_stop(FilterStop { failure, until_s });
        self.recovery.start_again();
        // The next row is the first one again, at which nothing is predicted.
        self.begun = false;
        true
    }

    /// One sample: prediction from the last one, update if there is a signal.
    fn step(
        &mut self,
        (course, derived): (&mut dyn Course, Option<&DerivedQuantities>),
        again: Option<&Reacquisition>,
        (first, k): (usize, usize),
        trajectory: &mut Trajectory,
    ) -> Result<(), FilterError> {
        let filter = &mut self.filter;
        if self.begun {
            filter.forget();
            course.advance(filter, first + k, &mut trajectory.counts)?;
            if self.loss.take_due()
                && let (held_s, held) = self.loss.held()
                && let Some(known) = course.start_again(first + k, (held_s, held))
            {
                filter.take_over(&AnyKnownStateStep::from(&known))?;
                let (time_s, before) = (trajectory.time_s[k], held.to_vec());
                trajectory.restarts.push(Restart { time_s, known, before });
                let settles = again.is_some_and(|again| time_s < again.from_s);
                trajectory.counts.restarted += usize::from(settles);
            }
        }
        self.begun = true;
        if k == 0 {
            self.entry.clone_from(filter);
        }
        let before = self.errors.is_following().then(|| filter.gaussian().covariance);
        let for_start = trajectory.counts.for_start;
        filter.at(trajectory.time_s[k]);
        let found = course.correct(filter, first + k, &mut trajectory.counts)?;
        let density = filter.watched().log_density();
        if let Some(density) = density.or_else(|| found.as_ref().map(Innovation::log_likelihood)) {
            trajectory.log_likelihood[k] = density;
        }
        match found {
            Some(_) if filter.watched().rejects(0) => {}
            Some(innovation) => {
                trajectory.innovation[k] = innovation.residual[0];
                trajectory.innovation_sd[k] = innovation.covariance.standard_deviation(0);
                trajectory.nis[k] = innovation.nis;
                trajectory.counts.updates += usize::from(innovation.taken);
            }
            None if trajectory.counts.for_start > for_start => {}
            // Another signal has corrected it.
            None if density.is_some() => {}
            None => trajectory.counts.without_signal += 1,
        }
        if !trajectory.further.is_empty() {
            for (signal, [residual, sd]) in trajectory.further.iter_mut().zip(course.further_innovations()) {
                signal.enter(k, [*residual, *sd]);
            }
        }
        trajectory.enter_rejections(k, filter.watched());
        filter.take_step_error(trajectory.nis[k]);
        if let Some((samples, figure)) = filter.due_step_error() {
            trajectory.step_errors.push(figure.until(trajectory.time_s[k], samples));
            let steps = followed_steps(self.steps, figure);
            if self.adapts_steps && steps != self.steps && course.divide(steps) {
                self.steps = steps;
                filter.shorten_steps();
                if let Some(next_s) = trajectory.time_s.get(k + 1) {
                    trajectory.steps.change(*next_s, steps);
                }
            }
        }
        let now = filter.gaussian();
        trajectory.keep(derived, (k, first + k), &now.mean, &|i, j| now.covariance.get(i, j));
        if let Some(again) = again {
            let sample = if filter.watched().rejects(0) {
                WatchedSample::Rejected
            } else {
                WatchedSample::Taken([trajectory.signal[k], trajectory.innovation[k], trajectory.nis[k]])
            };
            let lost_s = self.loss.take(again, trajectory.time_s[k], sample, &now.mean);
            trajectory.lost_s.extend(lost_s);
        }
        let covariances = (before.as_ref(), &now.covariance);
        let span = self.errors.take(trajectory.time_s[k], filter.link().as_ref(), covariances);
        trajectory.error_spans.extend(span);
        course.predict_phases(&self.filter, first + k);
        Ok(())
    }
}

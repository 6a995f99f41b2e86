//! When a motion will next pass a phase.

use super::{Complex, StateStep};
use core::f64::consts::{FRAC_PI_2, TAU};
use core::fmt;
use kalmems_core::{Covariance, Mat, Scalar};

/// The point of the motion's cycle that a trigger waits for, with θ = A·cos β and θ̇ = −A·ω·sin β.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark<P> {
    /// θ = 0 on its way up, β = −90°.
    Rising,
    /// θ = 0 on its way down, β = 90°.
    Falling,
    /// This β in rad.
    Phase(P),
}

/// What a [`Trigger`] goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerSettings<P> {
    /// Between two samples, and the interval of the process that predicts, in s.
    pub interval: P,
    /// ω in rad/s, to a tenth: what weighs θ̇ against θ, and says when to look.
    pub rate: P,
    /// What to wait for.
    pub mark: Mark<P>,
    /// How long before the event it is told, in s: 2 samples at least, 4096 at most, be that many cycles.
    pub lead: P,
    /// The amplitude in rad from which there are events.
    pub least_amplitude: P,
}

/// A trigger that cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnusableTrigger {
    /// Interval and rate must be positive numbers, the phase finite.
    NotPositive,
    /// The lead is below 2 intervals.
    LeadTooShort,
    /// The lead is above 4096 intervals.
    LeadTooLong,
}

impl fmt::Display for UnusableTrigger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotPositive => {
                "interval, rate or least amplitude is not a positive number, or the phase none"
            }
            Self::LeadTooShort => {
                "the lead is below two intervals, so that an event could pass untold; take a longer one"
            }
            Self::LeadTooLong => "the lead is above 4096 intervals; take a shorter one",
        })
    }
}

impl core::error::Error for UnusableTrigger {}

/// When the mark will be passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkCrossing<P> {
    /// In how many seconds.
    pub after: P,
    /// The standard deviation of that, in s.
    pub sd: P,
}

/// Why no time is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoCrossing {
    /// The motion is smaller than the least amplitude, or not finite.
    TooSmall,
    /// The mark is not passed within the steps that were asked for.
    BeyondHorizon,
}

/// An event, told before it happens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerEvent<P> {
    /// At which sample it was told, counted from 0.
    pub sample: u64,
    /// When it will happen, and how sure that is.
    pub crossing: MarkCrossing<P>,
}

/// Predicts when a motion passes a mark, by the model that a filter has of it.
///
/// The event is a zero of e = cᵀx with c = [−sin β₀, −cos β₀/ω] on angle and rate, rising. The filter's process steps the
/// mean ahead under the drive that is to come until e changes its sign; where exactly is read from the cubic through
/// the four values around it, which leaves 0.02·(ω·h)⁴/ω: 25 ps at 1 MHz and 15.7 kHz. Before the first whole sample
/// there are three values alone, and 0.07·(ω·h)³/ω is left: 0.6 ns. The motion's own law carries it there, not a sine.
///
/// σ_t² = (gᵀ·P·g + q)/ė²: P is carried by the linearised steps with their process noise, g weighs the nodes before and
/// after the zero, and ė is the cubic's slope there.
///
/// The first states are the angle and its rate; of a single state, which has no phase, nothing is told.
///
/// One event is told per passage, at the first sample at which it is no farther away than the lead. What tells one passage
/// from the next is half a cycle between them, so that a lead of many cycles may have as many events on their way.
#[derive(Clone, Copy, Debug)]
pub struct Trigger<P> {
    settings: TriggerSettings<P>,
    /// c.
    weights: [P; 2],
    /// 2π/ω.
    cycle: P,
    samples: u64,
    /// In how many seconds the event is that was told last; below 0 when it has been.
    told: Option<P>,
    /// For how many seconds there is nothing to look for.
    rest: P,
    /// e at the sample before, where there was a motion.
    before: Option<P>,
    missed: u64,
}

impl<P: Scalar> Trigger<P> {
    /// Before the first sample.
    pub fn new(settings: TriggerSettings<P>) -> Result<Self, UnusableTrigger> {
        let TriggerSettings { interval, rate, mark, lead, least_amplitude } = settings;
        let (zero, positive) = (P::of(0.0), |x: P| x.gt(P::of(0.0)) && x.is_finite());
        let phase = match mark {
            Mark::Rising => P::of(-FRAC_PI_2),
            Mark::Falling => P::of(FRAC_PI_2),
            Mark::Phase(phase) => phase,
        };
        if !(positive(interval) && positive(rate) && positive(least_amplitude) && phase.is_finite()) {
            return Err(UnusableTrigger::NotPositive);
        }
        if !lead.gt(interval.twice() * P::of(0.999)) {
            return Err(UnusableTrigger::LeadTooShort);
        }
        if !lead.lt(interval * P::of(1.001 * MOST_STEPS)) {
            return Err(UnusableTrigger::LeadTooLong);
        }
        let weights = match mark {
            // Exactly the angle, whatever a cosine makes of a quarter turn.
            Mark::Rising => [P::of(1.0), zero],
            Mark::Falling => [P::of(-1.0), zero],
            Mark::Phase(_) => [-phase.sin(), -(phase.cos() / rate)],
        };
        let cycle = P::of(TAU) / rate;
        Ok(Self { settings, weights, cycle, samples: 0, told: None, rest: zero, before: None, missed: 0 })
    }

    /// Goes on where another one was left, by what its [`last_predicted`](Self::last_predicted) was at the sample before the next one.
    #[must_use]
    pub fn resumed(self, told: Option<P>) -> Self {
        Self { told, ..self }
    }

    /// What it waits for.
    pub fn mark(&self) -> Mark<P> {
        self.settings.mark
    }

    /// In how many seconds from the last sample the event is that was told last, below 0 when it has been.
    pub fn last_predicted(&self) -> Option<P> {
        self.told
    }

    /// Marks that were passed without having been told: the motion came too suddenly, or in a gap, or nothing could be said.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// One sample, an interval after the last one: the filter's mean and covariance now, and how they go on. An event is told
    /// once.
    pub fn step<M: StateStep<P, N> + ?Sized, const N: usize>(
        &mut self,
        onward: &M,
        (mean, covariance): (&[P; N], &Covariance<P, N>),
    ) -> Option<TriggerEvent<P>> {
        if !self.passes(mean, self.settings.interval) || self.rest.gt(P::of(0.0)) {
            return None;
        }
        let TriggerSettings { interval, lead, .. } = self.settings;
        let sample = self.samples - 1;
        let zero = P::of(0.0);
        // Beyond the lead it is looked by a tenth of a cycle, to know when to look again.
        let margin = larger(interval.twice(), self.cycle * P::of(0.1));
        let from = self.told.map_or(zero, |told| larger(zero, told + self.cycle.half()));
        match self.predict((onward, (mean, covariance)), from, lead + margin) {
            Ok(crossing) if !crossing.after.gt(lead) => {
                self.told = Some(crossing.after);
                self.rest = crossing.after - lead + self.cycle * P::of(0.9);
                Some(TriggerEvent { sample, crossing })
            }
            Ok(crossing) => {
                self.rest = crossing.after - lead - interval;
                None
            }
            Err(_) => {
                self.rest = margin - interval.twice();
                None
            }
        }
    }

    /// One sample so many seconds after the last one, from which nothing is predicted, such as that after a gap or one for which
    /// it is not known what drives the motion. What passes is counted; whether there is a motion.
    pub fn passes<const N: usize>(&mut self, mean: &[P; N], elapsed: P) -> bool {
        self.samples = self.samples.saturating_add(1);
        self.told = self.told.map(|told| told - elapsed);
        self.rest = self.rest - elapsed;
        if self.is_small(mean) {
            (self.told, self.before) = (None, None);
            self.rest = P::of(0.0);
            return false;
        }
        let (zero, value) = (P::of(0.0), self.value(mean));
        if let Some(before) = self.before.replace(value) {
            if elapsed.gt(self.settings.interval * P::of(1.5)) {
                self.look_back(mean, elapsed);
            } else {
                self.miss(before.lt(zero) && !value.lt(zero), zero);
            }
        }
        true
    }

    /// Counts the passages of a gap, by the rate of the motion.
    fn look_back<const N: usize>(&mut self, mean: &[P; N], elapsed: P) {
        let [angle, speed] = self.weights;
        let rate = self.settings.rate;
        let slope = (angle * rate_of(mean) - speed * rate.sq() * mean[0]) / rate;
        let turn = Complex { re: slope, im: self.value(mean) }.angle();
        let after = if turn.lt(P::of(0.0)) { turn + P::of(TAU) } else { turn };
        let mut at = -(after / rate);
        for _ in 0..MOST_PASSAGES {
            if !at.gt(-elapsed) {
                return;
            }
            self.miss(true, at);
            at = at - self.cycle;
        }
    }

    /// Counts a passage at this time from now, unless it was told.
    fn miss(&mut self, passes: bool, at: P) {
        let was_told = self.told.is_some_and(|told| !at.gt(told + self.cycle.half()));
        if passes && !was_told {
            self.missed = self.missed.saturating_add(1);
        }
    }

    /// When the mark is first passed that many seconds from now or later, at most so many seconds ahead.
    pub fn predict<M: StateStep<P, N> + ?Sized, const N: usize>(
        &self,
        (onward, (mean, covariance)): (&M, (&[P; N], &Covariance<P, N>)),
        from: P,
        horizon: P,
    ) -> Result<MarkCrossing<P>, NoCrossing> {
        if self.is_small(mean) {
            return Err(NoCrossing::TooSmall);
        }
        // The last four values of e; the zero is sought between the second and the third.
        let (zero, interval) = (P::of(0.0), self.settings.interval);
        let (mut x, mut values) = (*mean, [self.value(mean); 4]);
        let (mut step, mut ahead) = (0, zero);
        while !ahead.gt(horizon + interval.twice()) && step < u32::MAX {
            x = onward.step(&x, step);
            let next = self.value(&x);
            values = match step {
                // Where there is nothing before, a straight line leads there.
                0 => [values[3] + (values[3] - next), values[3], next, next],
                1 => [values[0], values[1], values[2], next],
                _ => [values[1], values[2], values[3], next],
            };
            let passes = step > 0 && values[1].lt(zero) && !values[2].lt(zero);
            ahead = interval * P::of(f64::from(step));
            step += 1;
            if !passes || ahead.lt(from) {
                continue;
            }
            // Between the last sample but one and the last.
            let first = step - 2;
            let (into, slope) = root(if first == 0 { bent(values) } else { values });
            let after = interval * (P::of(f64::from(first)) + into);
            let variance = self.variance(onward, (mean, covariance), (first, into));
            let sd = interval * variance.sqrt() / slope;
            if !(after.is_finite() && sd.is_finite()) {
                return Err(NoCrossing::TooSmall);
            }
            return if after.gt(horizon) {
                Err(NoCrossing::BeyondHorizon)
            } else {
                Ok(MarkCrossing { after, sd })
            };
        }
        Err(NoCrossing::BeyondHorizon)
    }

    /// e.
    fn value<const N: usize>(&self, x: &[P; N]) -> P {
        self.weights[0] * x[0] + self.weights[1] * rate_of(x)
    }

    fn is_small<const N: usize>(&self, mean: &[P; N]) -> bool {
        let square = mean[0].sq() + (rate_of(mean) / self.settings.rate).sq();
        N < 2 || !square.gt(self.settings.least_amplitude.sq())
    }

    /// The variance of e that part of the way into the step of this number.
    fn variance<M: StateStep<P, N> + ?Sized, const N: usize>(
        &self,
        onward: &M,
        (mean, covariance): (&[P; N], &Covariance<P, N>),
        (first, into): (u32, P),
    ) -> P {
        let (mut x, mut covariance) = (*mean, *covariance);
        for step in 0..first {
            let (next, transition) = onward.linearize(&x, step);
            covariance = covariance.transformed(&transition).plus(onward.noise());
            x = next;
        }
        // Between two samples e is a straight line: g = (1 − s)·c + s·Fᵀc.
        let (_, transition) = onward.linearize(&x, first);
        let mut at_start = Mat::<P, 1, N>::zero();
        for (weight, own) in at_start.0[0].iter_mut().zip(self.weights) {
            *weight = own;
        }
        let at_end = at_start.times(&transition);
        let between = at_start.scaled(P::of(1.0) - into).plus(&at_end.scaled(into));
        let carried = covariance.transformed(&between).get(0, 0);
        carried + onward.noise().transformed(&at_start.scaled(into)).get(0, 0)
    }
}

/// The rate of the motion: the second state, behind the angle. A single state has no phase and no rate.
fn rate_of<P: Scalar, const N: usize>(x: &[P; N]) -> P {
    x.get(1).copied().unwrap_or(P::of(0.0))
}

/// Steps that a lead has at most.
const MOST_STEPS: f64 = 4096.0;
/// Passages of one gap that are counted at most.
const MOST_PASSAGES: u32 = 1 << 20;

fn larger<P: Scalar>(a: P, b: P) -> P {
    if a.lt(b) { b } else { a }
}

/// The same values where the first of them was only a straight line's: the parabola through the others in its place.
fn bent<P: Scalar>([_, start, end, next]: [P; 4]) -> [P; 4] {
    let three = P::of(3.0);
    [three * start - three * end + next, start, end, next]
}

/// Where the cubic through the values at −1, 0, 1 and 2 is zero between 0 and 1, and its slope there.
fn root<P: Scalar>([before, start, end, next]: [P; 4]) -> (P, P) {
    // Coefficients of s, s² and s³ (Lagrange).
    let third = (next - before) * P::of(1.0 / 6.0) + (start - end).half();
    let second = (before + end).half() - start;
    let first = end - start - second - third;
    // From the chord's zero, which is near.
    let mut s = start / (start - end);
    for _ in 0..4 {
        let value = start + s * (first + s * (second + s * third));
        s = s - value / slope([first, second, third], s);
    }
    (s, slope([first, second, third], s))
}

/// The derivative of first·s + second·s² + third·s³.
fn slope<P: Scalar>([first, second, third]: [P; 3], s: P) -> P {
    first + s * (second.twice() + s * third * P::of(3.0))
}

//! When a motion will next pass a phase.

use super::Ahead;
use core::f64::consts::FRAC_PI_2;
use core::fmt;
use kalmems_core::{Covariance, Mat, Process, Scalar};

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
    /// Between two samples, and the interval of the process that foretells, in s.
    pub interval: P,
    /// ω in rad/s, roughly: what weighs θ̇ against θ, and says where to look.
    pub rate: P,
    /// What to wait for.
    pub mark: Mark<P>,
    /// How long before the event it is told, in s: 2 samples at least, a quarter of a cycle at most.
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
    /// The lead is above a quarter of the motion's cycle.
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
            Self::LeadTooLong => "the lead is above a quarter of the motion's cycle; take a shorter one",
        })
    }
}

impl core::error::Error for UnusableTrigger {}

/// When the mark will be passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<P> {
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
    pub crossing: Crossing<P>,
}

/// Foretells when a motion passes a mark, by the model that a filter has of it.
///
/// The event is a zero of e = cᵀx with c = [−sin β₀, −cos β₀/ω] on angle and rate, rising. The filter's process steps the
/// mean ahead under the drive that is to come until e changes its sign; where exactly is read from the cubic through
/// the four values around it, which leaves 0.02·(ω·h)⁴/ω: 25 ps at 1 MHz and 15.7 kHz. Before the first whole sample
/// there are three values alone, and 0.07·(ω·h)³/ω is left: 0.6 ns. The motion's own law carries it there, not a sine.
///
/// σ_t² = (gᵀ·P·g + q)/ė²: P is carried by the linearised steps with their process noise, g weighs the nodes before and
/// after the zero, and ė is the cubic's slope there.
///
/// One event is told per passage, when it is no farther away than the lead.
#[derive(Clone, Copy, Debug)]
pub struct Trigger<P> {
    settings: TriggerSettings<P>,
    /// c.
    weights: [P; 2],
    /// −e·ω/ė at the lead before the event, a little more: from there on it is worth looking. None where it is always.
    near: Option<P>,
    samples: u64,
    told: bool,
    missed: u64,
}

impl<P: Scalar<Mask = bool>> Trigger<P> {
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
        if !(rate * lead).lt(P::of(FRAC_PI_2 * 1.001)) {
            return Err(UnusableTrigger::LeadTooLong);
        }
        let weights = match mark {
            // Exactly the angle, whatever a cosine makes of a quarter turn.
            Mark::Rising => [P::of(1.0), zero],
            Mark::Falling => [P::of(-1.0), zero],
            Mark::Phase(_) => [-phase.sin(), -(phase.cos() / rate)],
        };
        let reach = rate * lead * P::of(MARGIN);
        let near = reach.lt(P::of(1.4)).then(|| reach.sin() / reach.cos());
        Ok(Self { settings, weights, near, samples: 0, told: true, missed: 0 })
    }

    /// What it waits for.
    pub fn mark(&self) -> Mark<P> {
        self.settings.mark
    }

    /// Marks that were passed without having been told: the motion was lost or came too suddenly.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// One sample: the filter's mean and covariance now, its process and what will drive it. An event is told once.
    pub fn step<Q: Process<P, N>, const N: usize>(
        &mut self,
        process: &Q,
        (mean, covariance): (&[P; N], &Covariance<P, N>),
        drive: &impl Ahead<Q::Input>,
    ) -> Option<TriggerEvent<P>> {
        let sample = self.samples;
        self.samples = self.samples.saturating_add(1);
        if self.is_small(mean) {
            self.told = true;
            return None;
        }
        let (zero, rate) = (P::of(0.0), self.settings.rate);
        let [angle, speed] = self.weights;
        let value = self.value(mean);
        if !value.lt(zero) {
            if !self.told {
                self.missed = self.missed.saturating_add(1);
            }
            // Passed; the next one is to come.
            self.told = true;
            return None;
        }
        let slope = angle * mean[1] - speed * rate.sq() * mean[0];
        if !slope.gt(zero) {
            // On its way down to where it turns: what was told is over.
            self.told = false;
            return None;
        }
        let far = self.near.is_some_and(|near| (-(value * rate)).gt(slope * near));
        if self.told || far {
            return None;
        }
        let crossing = self.foretell(process, (mean, covariance), drive, MOST_STEPS).ok()?;
        if crossing.after.gt(self.settings.lead) {
            return None;
        }
        self.told = true;
        Some(TriggerEvent { sample, crossing })
    }

    /// When the mark is next passed, at most so many steps of the process ahead.
    pub fn foretell<Q: Process<P, N>, const N: usize>(
        &self,
        process: &Q,
        (mean, covariance): (&[P; N], &Covariance<P, N>),
        drive: &impl Ahead<Q::Input>,
        steps: u32,
    ) -> Result<Crossing<P>, NoCrossing> {
        if self.is_small(mean) {
            return Err(NoCrossing::TooSmall);
        }
        // The last four values of e; the zero is sought between the second and the third.
        let zero = P::of(0.0);
        let (mut x, mut values) = (*mean, [self.value(mean); 4]);
        for step in 0..steps.saturating_add(2) {
            x = process.step(&x, &drive.input(step));
            let next = self.value(&x);
            values = match step {
                // Where there is nothing before, a straight line leads there.
                0 => [values[3] + (values[3] - next), values[3], next, next],
                1 => [values[0], values[1], values[2], next],
                _ => [values[1], values[2], values[3], next],
            };
            let passes = values[1].lt(zero) && !values[2].lt(zero);
            if step == 0 || !passes {
                continue;
            }
            let first = step - 1;
            let (into, slope) = root(if first == 0 { bent(values) } else { values });
            let variance = self.variance(process, (mean, covariance), drive, (first, into));
            let after = self.settings.interval * (P::of(f64::from(first)) + into);
            let sd = self.settings.interval * variance.sqrt() / slope;
            if !(after.is_finite() && sd.is_finite()) {
                return Err(NoCrossing::TooSmall);
            }
            return Ok(Crossing { after, sd });
        }
        Err(NoCrossing::BeyondHorizon)
    }

    /// e.
    fn value<const N: usize>(&self, x: &[P; N]) -> P {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        self.weights[0] * x[0] + self.weights[1] * x[1]
    }

    fn is_small<const N: usize>(&self, mean: &[P; N]) -> bool {
        let square = mean[0].sq() + (mean[1] / self.settings.rate).sq();
        !square.gt(self.settings.least_amplitude.sq())
    }

    /// The variance of e that part of the way into the step of this number.
    fn variance<Q: Process<P, N>, const N: usize>(
        &self,
        process: &Q,
        (mean, covariance): (&[P; N], &Covariance<P, N>),
        drive: &impl Ahead<Q::Input>,
        (first, into): (u32, P),
    ) -> P {
        let (mut x, mut covariance) = (*mean, *covariance);
        for step in 0..first {
            let (next, transition) = process.linearize(&x, &drive.input(step));
            covariance = covariance.transformed(&transition).plus(process.noise().covariance());
            x = next;
        }
        // Between two samples e is a straight line: g = (1 − s)·c + s·Fᵀc.
        let (_, transition) = process.linearize(&x, &drive.input(first));
        let mut at_start = Mat::<P, 1, N>::zero();
        (at_start.0[0][0], at_start.0[0][1]) = (self.weights[0], self.weights[1]);
        let at_end = at_start.times(&transition);
        let between = at_start.scaled(P::of(1.0) - into).plus(&at_end.scaled(into));
        let carried = covariance.transformed(&between).get(0, 0);
        carried + process.noise().covariance().transformed(&at_start.scaled(into)).get(0, 0)
    }
}

/// How much earlier than the lead it is looked.
const MARGIN: f64 = 1.2;
/// Steps that are looked ahead at most: a quarter of a cycle of so many samples.
const MOST_STEPS: u32 = 4096;

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

//! What happens in a trajectory that goes on.

use super::supervision::{FilterHealth, LockState};
use crate::estimate::{
    DISTURBANCE, GateTurn, LockEvent, PassedMark, PredictedPhase, RecordedPassing, StateSeries, Trajectory,
};
use crate::evaluate::{StepErrorRecord, StepErrors};
use crate::signal::hermite;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// An angle passed zero.
    ZeroPhase {
        /// The angle, by its name among the states.
        of: &'static str,
        /// When, in s: the zero of the cubic by both angles and rates.
        time_s: f64,
        /// The standard deviation of that, in s: the angle's over the rate.
        sd_s: f64,
        /// Whether it rises.
        rising: bool,
    },
    /// The signal shows that an angle was passed, whatever the filters say.
    Crossing {
        /// The angle in rad.
        threshold_rad: f64,
        /// When, in s.
        time_s: f64,
        /// The standard deviation of that, in s.
        sd_s: f64,
        /// Whether the signal shows it by its steepest slope and not by passing its offset; left out where it is not so.
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        fallback: bool,
    },
    /// The recording shows that an event of the device happened, whatever the filters say.
    DeviceEvent {
        /// The event, by its name.
        of: &'static str,
        /// When, in s.
        time_s: f64,
        /// The standard deviation of that, in s.
        sd_s: f64,
    },
    /// An angle will pass zero.
    ZeroPhaseAhead {
        /// The angle, by its name among the states.
        of: &'static str,
        /// When and how.
        #[serde(flatten)]
        predicted: PredictedPhase,
    },
    /// An angle passed zero at a rate that its standard deviation does not tell from zero: what the filter follows may be noise, and
    /// zero phases are not told.
    MotionInNoise {
        /// The angle, by its name among the states.
        of: &'static str,
        /// When, in s.
        time_s: f64,
    },
    /// They are again.
    MotionInNoiseOver {
        /// The angle, by its name among the states.
        of: &'static str,
        /// When, in s.
        time_s: f64,
    },
    /// The filter lost the signal, found it again, or changed the branch.
    Lock(LockEvent),
    /// A sample was rejected as an outlier, and corrected nothing.
    Rejected {
        /// When, in s.
        time_s: f64,
        /// The signal: 0 for the first one; left out where it is that.
        #[serde(skip_serializing_if = "is_first")]
        signal: usize,
        /// The innovation in standard deviations.
        size: f64,
    },
    /// While the filter settles, a sample is far from what was predicted. It is taken, as the filter may be what is wrong; told once until as many
    /// samples have passed as the mean NIS is watched over.
    Disturbed {
        /// When, in s.
        time_s: f64,
        /// The innovation in standard deviations.
        size: f64,
    },
    /// A filter that was disturbed while it settles did not explain the signal any more, and is started again from it.
    Restarted {
        /// The time in s of the sample that it corrected first.
        time_s: f64,
    },
    /// Too many samples were rejected: all are taken again until the filter follows them.
    GateOpens {
        /// When, in s.
        time_s: f64,
    },
    /// The filter follows them, and rejects outliers again.
    GateCloses {
        /// When, in s.
        time_s: f64,
    },
    /// The mean NIS has become larger than chance makes it in a filter that is right once in 10⁹ times.
    Alarm {
        /// When the samples that it is the mean of ended, in s.
        time_s: f64,
        /// The mean.
        mean_nis: f64,
    },
    /// It lies in its 95 % interval, or below it, again.
    AlarmOver {
        /// When the samples that it is the mean of ended, in s.
        time_s: f64,
        /// The mean.
        mean_nis: f64,
    },
    /// The filter stopped; there are no estimates until it is started again (`started_again`).
    Stopped {
        /// When, in s.
        time_s: f64,
        /// Why.
        why: String,
    },
}

impl Event {
    /// When, in s; of what is predicted, from when on it was known.
    pub fn time_s(&self) -> f64 {
        match self {
            Self::ZeroPhaseAhead { predicted, .. } => predicted.told_s,
            Self::ZeroPhase { time_s, .. }
            | Self::Crossing { time_s, .. }
            | Self::MotionInNoise { time_s, .. }
            | Self::MotionInNoiseOver { time_s, .. }
            | Self::DeviceEvent { time_s, .. }
            | Self::Rejected { time_s, .. }
            | Self::Disturbed { time_s, .. }
            | Self::Restarted { time_s }
            | Self::GateOpens { time_s }
            | Self::GateCloses { time_s }
            | Self::Alarm { time_s, .. }
            | Self::AlarmOver { time_s, .. }
            | Self::Stopped { time_s, .. } => *time_s,
            Self::Lock(event) => event.time_s(),
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_first(signal: &usize) -> bool {
    *signal == 0
}

impl From<&RecordedPassing> for Event {
    fn from(crossing: &RecordedPassing) -> Self {
        let RecordedPassing { of, time_s, sd_s, is_fallback } = *crossing;
        match of {
            PassedMark::Angle(threshold_rad) => {
                Self::Crossing { threshold_rad, time_s, sd_s, fallback: is_fallback }
            }
            PassedMark::Event(of) => Self::DeviceEvent { of, time_s, sd_s },
        }
    }
}

impl From<LockEvent> for Event {
    fn from(event: LockEvent) -> Self {
        match event {
            LockEvent::Stopped { time_s, why } => Self::Stopped { time_s, why: why.to_string() },
            event => Self::Lock(event),
        }
    }
}

/// The share of alarms in a filter that is right.
const BY_CHANCE: f64 = 1e-9;

/// A zero phase is told where the rate is at least so many of its standard deviations. The amplitude is as many of its own then, and a filter
/// that is right finds as much in noise once in 3·10⁵ times.
const DISTINCT: f64 = 5.0;

/// Watches one trajectory.
pub struct TrajectoryWatch {
    /// Of each angle.
    passages: Vec<Passages>,
    /// Zero phases that were not told since that was last asked.
    withheld: u64,
    alarm: Alarm,
    /// Samples for which no other disturbance is told.
    disturbed: usize,
    lost: bool,
    stopped: bool,
    /// Samples that were rejected since the stretch began, and whether the gate is open.
    rejected: u64,
    gate_is_open: bool,
    steps: StepErrorRecord,
}

/// Watches the zeros of an angle.
#[derive(Clone, Copy, Default)]
struct Passages {
    /// The last sample: time, angle and rate.
    last: Option<[f64; 3]>,
    /// Whether the rate was too small at the last one to tell it from noise.
    in_noise: bool,
}

/// Watches the mean NIS over so many updates.
struct Alarm {
    over: usize,
    /// Above the first it is raised, below the second it is over.
    bounds: [f64; 2],
    count: usize,
    sum: f64,
    raised: bool,
    /// The mean of the last so many.
    mean_nis: Option<f64>,
}

impl TrajectoryWatch {
    /// Over so many updates the NIS is watched.
    pub fn new(over: usize) -> Self {
        let over = over.max(1);
        let bounds = ChiSquared::new(over as f64).map_or([f64::INFINITY; 2], |chi| {
            [1.0 - BY_CHANCE, 0.975].map(|p| chi.inverse_cdf(p) / over as f64)
        });
        let alarm = Alarm { over, bounds, count: 0, sum: 0.0, raised: false, mean_nis: None };
        Self {
            passages: Vec::new(),
            withheld: 0,
            alarm,
            disturbed: 0,
            lost: false,
            stopped: false,
            rejected: 0,
            gate_is_open: false,
            steps: StepErrorRecord::default(),
        }
    }

    /// Begins anew with a stretch that does not go on from the last one. An alarm stands until it is over.
    pub fn begin(&mut self) {
        self.passages.clear();
        (self.alarm.count, self.alarm.sum, self.alarm.mean_nis) = (0, 0.0, None);
        (self.disturbed, self.lost, self.stopped) = (0, false, false);
        (self.rejected, self.gate_is_open) = (0, false);
    }

    /// How many zero phases were not told since that was last asked.
    pub fn take_withheld(&mut self) -> u64 {
        std::mem::take(&mut self.withheld)
    }

    /// What the filter's integration steps add to its errors, of all stretches; `None` if the steps are exact, or too few samples are known.
    pub fn step_errors(&self) -> Option<StepErrors> {
        self.steps.errors()
    }

    /// Whether it follows the motion, as far as its signal tells.
    pub const fn holds(&self) -> bool {
        !(self.stopped || self.lost)
    }

    /// How the filter fares.
    pub fn health(&self, key: &str) -> FilterHealth {
        let lock = match (self.stopped, self.lost) {
            (true, _) => LockState::Stopped,
            (_, true) => LockState::Lost,
            _ => LockState::Held,
        };
        FilterHealth {
            estimator: key.to_owned(),
            lock,
            mean_nis: self.alarm.mean_nis,
            alarm: self.alarm.raised,
            motion_in_noise: self.passages.iter().any(|passages| passages.in_noise),
            rejected: self.rejected,
            gate_is_open: self.gate_is_open,
            step_error: self.step_errors().map(|steps| steps.at_the_end),
            failing: Vec::new(),
        }
    }

    /// What happened in the next samples of a trajectory, in the order of time; from `from_s` on, when it has settled.
    pub fn look(&mut self, trajectory: &Trajectory, angles: &[[&'static str; 2]], from_s: f64) -> Vec<Event> {
        self.lost = trajectory.lock.lost;
        self.steps.take(trajectory, from_s);
        let of_lock = trajectory.lock.events.iter().copied();
        let mut events: Vec<Event> = of_lock.map(Event::from).collect();
        self.passages.resize(angles.len(), Passages::default());
        for ([of, rate], passages) in angles.iter().zip(&mut self.passages) {
            let (Some(angle), Some(rate)) = (trajectory.state(of), trajectory.state(rate)) else { continue };
            for (k, time_s) in trajectory.time_s.iter().enumerate() {
                let now = [*time_s, angle.mean[k], rate.mean[k]];
                let Some(before) = passages.last.replace(now) else { continue };
                if *time_s < from_s || (before[1] < 0.0) == (now[1] < 0.0) {
                    continue;
                }
                let Some((time_s, slope)) = zero(before, now) else { continue };
                let sd = |state: &StateSeries| state.sd.get(k).copied().unwrap_or(f64::NAN);
                let in_noise = slope.abs() < DISTINCT * sd(rate);
                if passages.in_noise != in_noise {
                    passages.in_noise = in_noise;
                    let over = Event::MotionInNoiseOver { of, time_s };
                    events.push(if in_noise { Event::MotionInNoise { of, time_s } } else { over });
                }
                if in_noise {
                    self.withheld += 1;
                } else {
                    let sd_s = sd(angle) / slope.abs();
                    events.push(Event::ZeroPhase { of, time_s, sd_s, rising: now[1] >= 0.0 });
                }
            }
        }
        self.rejected += trajectory.rejected.len() as u64;
        events.extend(trajectory.rejected.iter().map(|one| Event::Rejected {
            time_s: one.time_s,
            signal: one.signal,
            size: one.size(),
        }));
        for &GateTurn { time_s, opens } in &trajectory.gate_turns {
            self.gate_is_open = opens;
            events.push(if opens { Event::GateOpens { time_s } } else { Event::GateCloses { time_s } });
        }
        for (time_s, nis) in trajectory.time_s.iter().zip(&trajectory.nis) {
            if *time_s >= from_s && nis.is_finite() {
                events.extend(self.alarm.take(*time_s, *nis));
            } else if *nis > DISTURBANCE * DISTURBANCE {
                let was_told = std::mem::replace(&mut self.disturbed, self.alarm.over) > 0;
                let size = nis.sqrt().min(f64::MAX);
                events.extend((!was_told).then_some(Event::Disturbed { time_s: *time_s, size }));
            } else {
                self.disturbed = self.disturbed.saturating_sub(1);
            }
        }
        // A start after a stop, and one of a settled filter, are events of the lock.
        let is_own =
            |time_s: f64| time_s < from_s && trajectory.stops.iter().all(|stop| stop.until_s != time_s);
        let restarts = trajectory.restarts.iter().map(|restart| restart.time_s);
        events.extend(restarts.filter(|time_s| is_own(*time_s)).map(|time_s| Event::Restarted { time_s }));
        self.stopped = trajectory.failure.is_some();
        events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        events
    }
}

impl Alarm {
    fn take(&mut self, time_s: f64, nis: f64) -> Option<Event> {
        self.sum += nis;
        self.count += 1;
        if self.count < self.over {
            return None;
        }
        let mean_nis = self.sum / self.count as f64;
        self.mean_nis = Some(mean_nis);
        (self.count, self.sum) = (0, 0.0);
        let [raise, over] = self.bounds;
        if !self.raised && mean_nis > raise {
            self.raised = true;
            return Some(Event::Alarm { time_s, mean_nis });
        }
        if self.raised && mean_nis < over {
            self.raised = false;
            return Some(Event::AlarmOver { time_s, mean_nis });
        }
        None
    }
}

/// When the cubic through two samples (time, angle, rate) of different signs passes zero, and how fast.
fn zero(before: [f64; 3], now: [f64; 3]) -> Option<(f64, f64)> {
    let h = now[0] - before[0];
    let at = |share: f64| hermite((before[1], before[2]), (now[1], now[2]), h, share);
    // The angle changes its sign in between.
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..52 {
        let middle = f64::midpoint(low, high);
        if (at(middle) < 0.0) == (before[1] < 0.0) { low = middle } else { high = middle }
    }
    let slope = before[2] + (now[2] - before[2]) * low;
    (h > 0.0 && slope.is_finite()).then(|| (before[0] + low * h, slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::TrajectoryKind;
    use crate::units::kind;
    use std::f64::consts::TAU;

    #[test]
    fn zeros_and_alarms_are_reported_once_for_any_division_of_the_stream() {
        let (hz, h) = (15_675.0, 1e-6);
        let time: Vec<f64> = (0..5000).map(|k| f64::from(k) * h).collect();
        let states = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];
        let samples = (&time[..], &time[..], &(0..time.len()));
        let mut trajectory = Trajectory::blank(("", ""), TrajectoryKind::Filtered, samples, &states);
        for (k, t) in time.iter().enumerate() {
            let (s, c) = (TAU * hz * t + 0.3).sin_cos();
            trajectory.states[0].mean[k] = 0.15 * s;
            trajectory.states[1].mean[k] = 0.15 * TAU * hz * c;
            trajectory.states[0].sd[k] = 1e-4;
            trajectory.nis[k] = if (2000..3000).contains(&k) { 4.0 } else { 1.0 };
        }
        let mut whole = None;
        for length in [5000, 1, 33] {
            let (mut watch, mut rest, mut events) =
                (TrajectoryWatch::new(100), trajectory.clone(), Vec::new());
            while !rest.time_s.is_empty() {
                let part = rest.take_front(length);
                events.extend(watch.look(&part, &[["angle", "rate"]], 0.0));
            }
            events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
            let zeros: Vec<(f64, f64)> = (events.iter())
                .filter_map(|e| match e {
                    Event::ZeroPhase { time_s, sd_s, rising: true, .. } => Some((*time_s, *sd_s)),
                    _ => None,
                })
                .collect();
            assert_eq!(zeros.len(), 78);
            for (i, (time_s, sd_s)) in zeros.iter().enumerate() {
                let truth = (f64::from(u32::try_from(i).unwrap()) + 1.0 - 0.3 / TAU) / hz;
                assert!((time_s - truth).abs() < 1e-10, "{i}: {time_s} {truth}");
                assert!((sd_s * 0.15 * TAU * hz / 1e-4 - 1.0).abs() < 0.01);
            }
            let alarms: Vec<f64> = (events.iter())
                .filter(|e| matches!(e, Event::Alarm { .. } | Event::AlarmOver { .. }))
                .map(Event::time_s)
                .collect();
            assert!(
                alarms.len() == 2
                    && (alarms[0] - 2099e-6).abs() < 1e-12
                    && (alarms[1] - 3099e-6).abs() < 1e-12
            );
            assert_eq!(*whole.get_or_insert(events.clone()), events);
        }
    }

    #[test]
    fn zeros_of_a_motion_that_may_be_noise_are_counted_and_not_reported() {
        let (hz, h) = (1000.0, 1e-5);
        let time: Vec<f64> = (0..10_000).map(|k| f64::from(k) * h).collect();
        let states = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];
        let samples = (&time[..], &time[..], &(0..time.len()));
        let mut trajectory = Trajectory::blank(("", ""), TrajectoryKind::Filtered, samples, &states);
        for (k, t) in time.iter().enumerate() {
            // Ten standard deviations, then four, then ten again.
            let amplitude = if (2500..7500).contains(&k) { 4e-3 } else { 1e-2 };
            let (s, c) = (TAU * hz * t + 0.3).sin_cos();
            trajectory.states[0].mean[k] = amplitude * s;
            trajectory.states[1].mean[k] = amplitude * TAU * hz * c;
            trajectory.states[0].sd[k] = 1e-3;
            trajectory.states[1].sd[k] = 1e-3 * TAU * hz;
        }
        for length in [10_000, 1, 77] {
            let (mut watch, mut rest, mut events) =
                (TrajectoryWatch::new(100), trajectory.clone(), Vec::new());
            let mut withheld = 0;
            while !rest.time_s.is_empty() {
                events.extend(watch.look(&rest.take_front(length), &[["angle", "rate"]], 0.0));
                withheld += watch.take_withheld();
            }
            let times = |wanted: fn(&Event) -> bool| -> Vec<f64> {
                events.iter().filter(|event| wanted(event)).map(Event::time_s).collect()
            };
            let zeros = times(|event| matches!(event, Event::ZeroPhase { .. }));
            // Two hundred zeros within 0.1 s, half of them of the small motion.
            assert_eq!((zeros.len(), withheld), (100, 100));
            assert!(zeros.iter().all(|time_s| !(0.025..0.075).contains(time_s)), "{zeros:?}");
            let begins = times(|event| matches!(event, Event::MotionInNoise { .. }));
            let ends = times(|event| matches!(event, Event::MotionInNoiseOver { .. }));
            assert!(begins.len() == 1 && (begins[0] - 0.025).abs() < 1e-3, "{begins:?}");
            assert!(ends.len() == 1 && (ends[0] - 0.075).abs() < 1e-3, "{ends:?}");
        }
    }
}

//! Whether a filter explains its signal, cycle by cycle of the slowest motion, as the samples come.

/// The share of the signal that may stay unexplained.
pub(super) const UNEXPLAINED: f64 = 0.5;
/// The mean NIS of a cycle from which on the filter itself says that something is wrong.
pub(super) const ALARM: f64 = 4.0;
/// The mean NIS of a cycle, as a multiple of that of the cycles before, from which on the signal is not that of the motion that the filter follows:
/// innovations five times as large as they were, and below three times they are again. So a step of the frequency is seen long before the phase is
/// half a radian off, and a filter whose noise is stated too small by any factor loses nothing by that.
const CHANGED: f64 = 25.0;
const UNCHANGED: f64 = 9.0;
/// The share of a cycle in the mean NIS of those before.
const FORGETS: f64 = 0.125;
/// Updates without which a cycle tells nothing.
const FEWEST: f64 = 8.0;
/// The share of the signal's variance that the prediction has to explain for the signal to be found again: of noise it explains nothing, however
/// well a motion at rest agrees with it.
const SHOWN: f64 = 0.25;
/// Cycles that follow each other in which it has to be explained for that: half of them may have started the filter again, and half show it.
const REGAINED: u32 = 6;
/// The share of a cycle's samples that the gate may reject.
const REJECTED: f64 = 0.5;

/// What a filter made of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum WatchedSample {
    /// Signal, innovation and NIS; the NIS is not a number where there was no update.
    Taken([f64; 3]),
    /// The gate rejected it.
    Rejected,
}

/// What is summed over the updates of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SignalCycle {
    began_s: f64,
    count: f64,
    rejected: f64,
    /// The first sample, and the sums of how far the others are from it and of the squares of that.
    first: f64,
    sum: f64,
    squares: f64,
    /// The sums of squares of the innovations, of their steps from one to the next, and of the NIS.
    innovations: f64,
    steps: f64,
    before: f64,
    nis: f64,
}

impl SignalCycle {
    const fn from(began_s: f64) -> Self {
        Self {
            began_s,
            count: 0.0,
            rejected: 0.0,
            first: f64::NAN,
            sum: 0.0,
            squares: 0.0,
            innovations: 0.0,
            steps: 0.0,
            before: f64::NAN,
            nis: 0.0,
        }
    }

    #[inline]
    fn take(&mut self, sample: WatchedSample) {
        let WatchedSample::Taken([signal, innovation, nis]) = sample else {
            self.rejected += 1.0;
            return;
        };
        if !nis.is_finite() {
            return;
        }
        if self.count == 0.0 {
            (self.first, self.before) = (signal, innovation);
        }
        self.count += 1.0;
        let (apart, step) = (signal - self.first, innovation - self.before);
        self.before = innovation;
        self.sum += apart;
        self.squares += apart * apart;
        self.innovations += innovation * innovation;
        self.steps += step * step;
        self.nis += nis;
    }

    /// What the updates tell, where there are enough of them; `usual` is the mean NIS before.
    fn judged(&self, was_lost: bool, usual: f64) -> Option<CycleJudgement> {
        // A gate also rejects because the noise is stated too small: then what it takes is not as small as claimed either. Before the first cycle that
        // is explained nothing tells.
        let is_rejected = self.rejected >= FEWEST && self.rejected > REJECTED * (self.count + self.rejected);
        if is_rejected && usual < ALARM {
            let (is_lost, is_shown) = (true, false);
            return Some(CycleJudgement {
                is_lost,
                is_shown,
                is_rejected,
                unexplained: f64::NAN,
                nis: f64::NAN,
            });
        }
        if self.count < FEWEST {
            return None;
        }
        let level = self.sum / self.count;
        let spread = self.squares / self.count - level * level;
        // What is left of a motion goes on from one sample to the next; what does not is noise, and no motion was lost in it.
        let noise = 0.5 * self.steps / (self.count - 1.0);
        let square = self.innovations / self.count;
        let unexplained = ((square - noise).max(0.0) / spread).sqrt();
        // Once lost, it is found again only when the prediction is twice as good, so that one loss is told once.
        let share = if was_lost { UNEXPLAINED / 2.0 } else { UNEXPLAINED };
        let nis = self.nis / self.count;
        let most = if was_lost { UNCHANGED } else { CHANGED } * usual;
        let is_lost = (unexplained > share && nis > ALARM) || nis > most;
        let is_shown = !is_lost && spread - square > SHOWN * spread;
        Some(CycleJudgement { is_lost, is_shown, is_rejected: false, unexplained, nis })
    }
}

/// What a cycle tells.
#[derive(Clone, Copy, Debug)]
struct CycleJudgement {
    is_lost: bool,
    /// Whether the prediction explains a motion.
    is_shown: bool,
    /// Whether the gate rejected so many samples that they are none of the signal.
    is_rejected: bool,
    unexplained: f64,
    nis: f64,
}

/// A change of what is known of the signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SignalTurn {
    /// It is lost since a cycle that began at this time in s and was over at that.
    Lost { time_s: f64, detected_s: f64, unexplained: f64 },
    /// It is found again at this time, as the cycles show that begin at the other one.
    Regained { time_s: f64, from_s: f64 },
}

/// A cycle that is over.
#[derive(Clone, Copy, Debug)]
pub(super) struct EndedCycle {
    pub(super) told: CycleState,
    pub(super) turn: Option<SignalTurn>,
}

/// What a cycle says of the signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CycleState {
    /// Nothing: there were too few updates.
    Unknown,
    /// The prediction explains it, as far as there is a motion.
    Explained,
    /// It is lost, and the filter was corrected by what is none.
    Lost,
    /// It is lost, and the gate rejected what is none.
    Rejected,
}

/// Whether a filter explains its signal, with the cycle that has not ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SignalWatch {
    cycle: Option<SignalCycle>,
    is_lost: bool,
    /// The cycles since which the signal is explained again, and when the first of them began in s.
    shown: u32,
    shown_from_s: f64,
    /// The mean NIS of the cycles in which the signal was not lost, at least 1; `None` before the first.
    level: Option<f64>,
}

impl SignalWatch {
    /// The numbers of [`numbers`](Self::numbers).
    pub(super) const NUMBERS: usize = 14;

    pub(super) const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Cycles since which the prediction explains the signal again, while it is lost.
    pub(super) const fn shown(&self) -> u32 {
        self.shown
    }

    /// When the cycle began that has not ended, in s.
    pub(super) fn began_s(&self) -> Option<f64> {
        self.cycle.map(|cycle| cycle.began_s)
    }

    /// The filter that is watched has stopped, or is started again: what its cycles told is over.
    pub(super) fn begin_again(&mut self) {
        *self = Self::default();
    }

    /// Takes signal, innovation and NIS of a sample at this time in s: a cycle that is over with it, whose samples are those before.
    #[inline]
    pub(super) fn take(
        &mut self,
        (motion_hz, has_gate): (f64, bool),
        time_s: f64,
        values: WatchedSample,
    ) -> Option<EndedCycle> {
        let cycle = self.cycle.get_or_insert(SignalCycle::from(time_s));
        if time_s < cycle.began_s + 1.0 / motion_hz {
            cycle.take(values);
            return None;
        }
        let ended = *cycle;
        *cycle = SignalCycle::from(time_s);
        cycle.take(values);
        Some(self.end(&ended, time_s, has_gate))
    }

    /// Judges the cycle that has not ended, as no more samples come.
    pub(super) fn finish(&mut self, last_s: f64, has_gate: bool) -> Option<EndedCycle> {
        let cycle = self.cycle.take()?;
        Some(self.end(&cycle, last_s, has_gate))
    }

    /// A filter without a gate takes single samples that are none of the signal, which are no loss of it: its mean NIS alone tells nothing.
    #[inline(never)]
    fn end(&mut self, cycle: &SignalCycle, ends_s: f64, has_gate: bool) -> EndedCycle {
        let level = self.level.filter(|_| has_gate).unwrap_or(f64::INFINITY);
        let Some(found) = cycle.judged(self.is_lost, level) else {
            return EndedCycle { told: CycleState::Unknown, turn: None };
        };
        if !(found.is_lost || self.is_lost) {
            let before = self.level.unwrap_or(found.nis);
            self.level = Some((before + (found.nis - before) * FORGETS).max(1.0));
        }
        let told = match found {
            CycleJudgement { is_rejected: true, .. } => CycleState::Rejected,
            CycleJudgement { is_lost: true, .. } => CycleState::Lost,
            _ => CycleState::Explained,
        };
        if !self.is_lost {
            self.is_lost = found.is_lost;
            let lost = SignalTurn::Lost {
                time_s: cycle.began_s,
                detected_s: ends_s,
                unexplained: found.unexplained,
            };
            self.shown = 0;
            return EndedCycle { told, turn: found.is_lost.then_some(lost) };
        }
        if !found.is_shown {
            self.shown = 0;
            return EndedCycle { told, turn: None };
        }
        if self.shown == 0 {
            self.shown_from_s = cycle.began_s;
        }
        self.shown += 1;
        if self.shown < REGAINED {
            return EndedCycle { told, turn: None };
        }
        (self.is_lost, self.shown) = (false, 0);
        let turn = SignalTurn::Regained { time_s: ends_s, from_s: self.shown_from_s };
        EndedCycle { told, turn: Some(turn) }
    }

    /// As numbers, for another run to go on from.
    pub(super) fn numbers(&self) -> [f64; Self::NUMBERS] {
        let SignalCycle { began_s, count, rejected, first, sum, squares, innovations, steps, before, nis } =
            self.cycle.unwrap_or(SignalCycle::from(f64::NAN));
        let (is_lost, shown) = (f64::from(u8::from(self.is_lost)), f64::from(self.shown));
        let of_state = [is_lost, shown, self.shown_from_s];
        let ([a, b, c], level) = (of_state, self.level.unwrap_or(f64::NAN));
        [began_s, count, rejected, first, sum, squares, innovations, steps, before, nis, a, b, c, level]
    }

    /// Goes on from such numbers.
    pub(super) fn resumed(numbers: [f64; Self::NUMBERS]) -> Self {
        let [began_s, count, rejected, first, sum, squares, innovations, steps, before, nis, rest @ ..] =
            numbers;
        let [is_lost, shown, from_s, level] = rest;
        let cycle =
            SignalCycle { began_s, count, rejected, first, sum, squares, innovations, steps, before, nis };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small count
        let shown = shown as u32;
        Self {
            cycle: Some(cycle).filter(|cycle| cycle.began_s.is_finite()),
            is_lost: is_lost != 0.0,
            shown,
            shown_from_s: from_s,
            level: Some(level).filter(|level| level.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use std::f64::consts::TAU;

    const MOTION_HZ: f64 = 500.0;
    const INTERVAL_S: f64 = 5e-5;

    /// What is said of samples, each with its signal, innovation and NIS by its time in s.
    fn turns(samples: u32, of: impl Fn(f64) -> [f64; 3]) -> Vec<SignalTurn> {
        let mut watch = SignalWatch::default();
        let mut all = Vec::new();
        for k in 0..samples {
            let time_s = f64::from(k) * INTERVAL_S;
            let ended = watch.take((MOTION_HZ, true), time_s, WatchedSample::Taken(of(time_s)));
            all.extend(ended.and_then(|ended| ended.turn));
            // Another run goes on from the numbers as this one does.
            watch = SignalWatch::resumed(watch.numbers());
        }
        all
    }

    /// A filter that is right until a time and gives `then` from then on, with noise of the variance 1 and a motion of amplitude 100.
    fn loses(seed: u64, at_s: f64, told: f64, then: impl Fn(f64, f64) -> [f64; 2]) -> Vec<SignalTurn> {
        let chance = std::cell::RefCell::new(WhiteNoise::new(seed, 0));
        turns(20_000, |time_s| {
            let noise = chance.borrow_mut().sample();
            let motion = 100.0 * (TAU * MOTION_HZ * time_s).sin();
            let [signal, innovation] =
                if time_s < at_s { [motion + noise, noise] } else { then(motion, noise) };
            [signal, innovation, innovation * innovation / told]
        })
    }

    #[test]
    fn noise_behind_a_motion_is_a_loss_and_never_the_signal_again() {
        for seed in 0..20 {
            // At first the filter goes on with the motion; then it is at rest, which explains noise as well as anything.
            let lost = loses(seed, 0.1, 1.0, |motion, noise| [noise, noise - motion]);
            let [SignalTurn::Lost { time_s, detected_s, .. }] = lost[..] else { panic!("{lost:?}") };
            assert!((time_s - 0.1).abs() < 2.1e-3 && (detected_s - time_s - 2e-3).abs() < 1e-4);
            let rests = |time_s: f64| time_s > 0.15;
            let chance = std::cell::RefCell::new(WhiteNoise::new(seed, 1));
            let lost = turns(20_000, |time_s| {
                let noise = chance.borrow_mut().sample();
                let motion = 100.0 * (TAU * MOTION_HZ * time_s).sin();
                let innovation = if time_s < 0.1 || rests(time_s) { noise } else { noise - motion };
                let signal = if time_s < 0.1 { motion + noise } else { noise };
                [signal, innovation, innovation * innovation]
            });
            assert!(matches!(lost[..], [SignalTurn::Lost { .. }]), "{lost:?}");
        }
    }

    #[test]
    fn innovations_that_grow_are_a_loss_whatever_is_told_of_the_noise() {
        // Ten times the noise is a tenth of the motion.
        for told in [1e-2, 1.0] {
            let grows = loses(3, 0.2, told, |motion, noise| [motion + noise, 10.0 * noise]);
            let [SignalTurn::Lost { time_s, unexplained, .. }] = grows[..] else { panic!("{grows:?}") };
            assert!((time_s - 0.2).abs() < 2.1e-3 && unexplained < UNEXPLAINED);
            let steady = loses(4, f64::INFINITY, told, |_, _| [0.0; 2]);
            assert!(steady.is_empty(), "{steady:?}");
        }
    }

    #[test]
    fn a_cycle_whose_samples_the_gate_rejects_is_a_loss() {
        let mut watch = SignalWatch::default();
        let mut all = Vec::new();
        for k in 0..2000 {
            let time_s = f64::from(k) * INTERVAL_S;
            let motion = 100.0 * (TAU * MOTION_HZ * time_s).sin();
            let innovation = f64::from(k % 2) - 0.5;
            let taken = WatchedSample::Taken([motion, innovation, innovation * innovation]);
            let sample = if (1000..1100).contains(&k) { WatchedSample::Rejected } else { taken };
            all.extend(watch.take((MOTION_HZ, true), time_s, sample).and_then(|ended| ended.turn));
        }
        let [SignalTurn::Lost { time_s, .. }, SignalTurn::Regained { from_s, .. }] = all[..] else {
            panic!("{all:?}")
        };
        assert!((time_s - 0.05).abs() < 2.1e-3 && (from_s - 0.056).abs() < 2.1e-3, "{all:?}");
    }

    #[test]
    fn a_motion_that_is_explained_again_is_found_after_six_cycles() {
        let again_s = 0.3;
        let chance = std::cell::RefCell::new(WhiteNoise::new(5, 0));
        let found = turns(20_000, |time_s| {
            let noise = chance.borrow_mut().sample();
            let motion = 100.0 * (TAU * MOTION_HZ * time_s).sin();
            let innovation = if (0.1..again_s).contains(&time_s) { motion } else { noise };
            [motion + noise, innovation, innovation * innovation]
        });
        let [SignalTurn::Lost { .. }, SignalTurn::Regained { time_s, from_s }] = found[..] else {
            panic!("{found:?}")
        };
        assert!((from_s - again_s).abs() < 2.1e-3 && (time_s - from_s - 12e-3).abs() < 1e-4);
    }
}

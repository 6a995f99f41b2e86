//! Whether a filter explains its signal, cycle by cycle of the slowest motion, as the samples come.

/// The share of the signal that may stay unexplained.
const UNEXPLAINED: f64 = 0.5;
/// The mean NIS of a cycle from which on the filter itself says that something is wrong.
pub(super) const ALARM: f64 = 4.0;
/// Updates without which a cycle tells nothing.
const FEWEST: f64 = 8.0;
/// The share of the signal's variance that the prediction has to explain for the signal to be found again: of noise it explains nothing, however
/// well a motion at rest agrees with it.
const SHOWN: f64 = 0.25;
/// Cycles that follow each other in which it has to be explained for that.
const REGAINED: u32 = 3;

/// What is summed over the updates of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SignalCycle {
    began_s: f64,
    count: f64,
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
    fn take(&mut self, [signal, innovation, nis]: [f64; 3]) {
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

    /// What the updates tell, where there are enough of them.
    fn judged(&self, was_lost: bool) -> Option<CycleJudgement> {
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
        let is_lost = unexplained > share && self.nis / self.count > ALARM;
        Some(CycleJudgement { is_lost, is_shown: !is_lost && spread - square > SHOWN * spread, unexplained })
    }
}

/// What a cycle tells.
#[derive(Clone, Copy, Debug)]
struct CycleJudgement {
    is_lost: bool,
    /// Whether the prediction explains a motion.
    is_shown: bool,
    unexplained: f64,
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
    /// Whether the signal was lost in it; `None` where it tells nothing.
    pub(super) is_lost: Option<bool>,
    pub(super) turn: Option<SignalTurn>,
}

/// Whether a filter explains its signal, with the cycle that has not ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SignalWatch {
    cycle: Option<SignalCycle>,
    is_lost: bool,
    /// The cycles since which the signal is explained again, and when the first of them began in s.
    shown: u32,
    shown_from_s: f64,
}

impl SignalWatch {
    /// The numbers of [`numbers`](Self::numbers).
    pub(super) const NUMBERS: usize = 12;

    pub(super) const fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// When the cycle began that has not ended, in s.
    pub(super) fn began_s(&self) -> Option<f64> {
        self.cycle.map(|cycle| cycle.began_s)
    }

    /// Takes signal, innovation and NIS of a sample at this time in s: a cycle that is over with it, whose samples are those before.
    #[inline]
    pub(super) fn take(&mut self, motion_hz: f64, time_s: f64, values: [f64; 3]) -> Option<EndedCycle> {
        let cycle = self.cycle.get_or_insert(SignalCycle::from(time_s));
        if time_s < cycle.began_s + 1.0 / motion_hz {
            cycle.take(values);
            return None;
        }
        let ended = *cycle;
        *cycle = SignalCycle::from(time_s);
        cycle.take(values);
        Some(self.end(&ended, time_s))
    }

    /// Judges the cycle that has not ended, as no more samples come.
    pub(super) fn finish(&mut self, last_s: f64) -> Option<EndedCycle> {
        let cycle = self.cycle.take()?;
        Some(self.end(&cycle, last_s))
    }

    #[inline(never)]
    fn end(&mut self, cycle: &SignalCycle, ends_s: f64) -> EndedCycle {
        let Some(found) = cycle.judged(self.is_lost) else {
            return EndedCycle { is_lost: None, turn: None };
        };
        let is_lost = Some(found.is_lost);
        if !self.is_lost {
            self.is_lost = found.is_lost;
            let lost = SignalTurn::Lost {
                time_s: cycle.began_s,
                detected_s: ends_s,
                unexplained: found.unexplained,
            };
            self.shown = 0;
            return EndedCycle { is_lost, turn: found.is_lost.then_some(lost) };
        }
        if !found.is_shown {
            self.shown = 0;
            return EndedCycle { is_lost, turn: None };
        }
        if self.shown == 0 {
            self.shown_from_s = cycle.began_s;
        }
        self.shown += 1;
        if self.shown < REGAINED {
            return EndedCycle { is_lost, turn: None };
        }
        self.is_lost = false;
        let turn = SignalTurn::Regained { time_s: ends_s, from_s: self.shown_from_s };
        EndedCycle { is_lost, turn: Some(turn) }
    }

    /// As numbers, for another run to go on from.
    pub(super) fn numbers(&self) -> [f64; Self::NUMBERS] {
        let SignalCycle { began_s, count, first, sum, squares, innovations, steps, before, nis } =
            self.cycle.unwrap_or(SignalCycle::from(f64::NAN));
        let (is_lost, shown) = (f64::from(u8::from(self.is_lost)), f64::from(self.shown));
        let of_state = [is_lost, shown, self.shown_from_s];
        let [a, b, c] = of_state;
        [began_s, count, first, sum, squares, innovations, steps, before, nis, a, b, c]
    }

    /// Goes on from such numbers.
    pub(super) fn resumed(numbers: [f64; Self::NUMBERS]) -> Self {
        let [began_s, count, first, sum, squares, innovations, steps, before, nis, is_lost, shown, from_s] = numbers;
        let cycle = SignalCycle { began_s, count, first, sum, squares, innovations, steps, before, nis };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small count
        let shown = shown as u32;
        Self {
            cycle: Some(cycle).filter(|cycle| cycle.began_s.is_finite()),
            is_lost: is_lost != 0.0,
            shown,
            shown_from_s: from_s,
        }
    }
}

//! What a filter's gate rejected, and whether that is what isolated disturbances of the signal look like.

use super::innovations::{WRONG, normal_tail};
use crate::estimate::{GateTurn, SegmentEstimate, Trajectory};
use crate::inspect::quantity;
use kalmems_core::Portable;
use serde::Serialize;
use std::f64::consts::TAU;

/// Rejected samples that are listed.
const LISTED: usize = 20;

/// Stretches with an open gate that are listed.
const STRETCHES: usize = 100;

/// The share of the samples above which they are no isolated disturbances. Leaving out one sample in twenty costs a filter 2.5 % of its standard
/// deviation; of a signal with more of them than that, one cannot say that the others are the device's.
const MOST: f64 = 0.05;

/// The probability below which their number is not that of false rejections.
const REMARKED: f64 = 1e-3;

/// Fewer events say nothing of when they happen.
const FEWEST: f64 = 8.0;

/// Rejections that are closer than this part of the motion's cycle are one event.
const ONE_EVENT: f64 = 0.25;

/// Harmonics of the motion with which events may repeat.
const HARMONICS: usize = 4;

/// A sample that was rejected.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outlier {
    /// When, in s.
    pub time_s: f64,
    /// The signal, by its name, where it is not the first one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal: Option<String>,
    /// The innovation in standard deviations.
    #[serde(serialize_with = "super::three_digits")]
    pub size: f64,
}

/// A stretch in which samples beyond the gate's bound were accepted again, since there were too many.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OpenGate {
    /// When it began, in s.
    pub from_s: f64,
    /// When it ended, where it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
}

/// What a gate rejected after the settling time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Rejections {
    /// How many samples.
    pub count: usize,
    /// Their share of all.
    #[serde(serialize_with = "super::three_digits")]
    pub share: f64,
    /// The largest, in standard deviations.
    #[serde(serialize_with = "super::three_digits")]
    pub largest: f64,
    /// The first of them.
    pub first: Vec<Outlier>,
    /// How probable so many of them are of a filter that is right, and a signal without disturbances.
    #[serde(serialize_with = "super::three_digits")]
    pub p_value: f64,
    /// How probable it is that disturbances that have nothing to do with the motion happen at such parts of its cycle; `None` of fewer than eight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub p_of_cycle: Option<f64>,
    /// When the gate was open.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub open: Vec<OpenGate>,
}

/// Why rejected samples speak against the estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RejectionFault {
    /// There are too many of them.
    TooMany,
    /// They come with the motion.
    WithTheMotion,
    /// They did not end, so that the gate opened at this time in s.
    Lasted {
        /// The first time.
        from_s: f64,
    },
}

impl Rejections {
    /// Whether there is nothing to be said.
    pub fn is_empty(&self) -> bool {
        self.count == 0 && self.open.is_empty()
    }

    /// Whether there are more than a filter that is right rejects.
    pub fn is_remarkable(&self) -> bool {
        self.p_value < REMARKED
    }

    /// Why they speak against the estimate, if they do.
    pub fn faults(&self) -> impl Iterator<Item = RejectionFault> {
        let lasted = self.open.first().map(|open| RejectionFault::Lasted { from_s: open.from_s });
        let many = (self.share > MOST).then_some(RejectionFault::TooMany);
        let of_motion = self.p_of_cycle.is_some_and(|p| p < WRONG).then_some(RejectionFault::WithTheMotion);
        lasted.into_iter().chain(many).chain(of_motion)
    }

    /// The rejected samples in a sentence: how many, and where, as far as they are few.
    pub fn sentence(&self) -> String {
        let listed = self.first.iter().take(FEW).map(|outlier| {
            let of = outlier.signal.as_ref().map_or_else(String::new, |of| format!(" of {of}"));
            format!("{}{of} ({:+.1} sd)", quantity(outlier.time_s, "s"), outlier.size)
        });
        let listed = listed.collect::<Vec<_>>().join(", ");
        let more =
            if self.count > FEW { format!(" … up to {:.1} sd", self.largest) } else { String::new() };
        format!(
            "samples rejected as outliers, which did not correct the filter: {} ({}), at {listed}{more}",
            self.count,
            percent(self.share)
        )
    }
}

/// Rejected samples that a sentence lists.
const FEW: usize = 5;

/// A share in per cent with two digits.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to 9
    let decimals = (1.0 - percent.max(1e-9).portable_log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{percent:.decimals$} %")
}

impl std::fmt::Display for RejectionFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::TooMany => write!(
                f,
                "the gate rejected more than {:.0} % of the samples: so many are no isolated disturbances of the signal",
                100.0 * MOST
            ),
            Self::WithTheMotion => write!(
                f,
                "the rejected samples repeat with the motion, at the same part of its cycle: the readout differs from its model there, or an \
                 input reaches the signal"
            ),
            Self::Lasted { from_s } => write!(
                f,
                "from {} on the gate rejected too many samples in a row and opened until the filter followed them: the signal has a step or a \
                 burst, or the device has changed",
                quantity(*from_s, "s")
            ),
        }
    }
}

/// What a gate rejected, part by part.
#[derive(Clone, Debug, Default)]
pub(super) struct RejectionRecord {
    motions: Vec<RejectionCycle>,
    samples: usize,
    count: usize,
    largest: f64,
    first: Vec<Outlier>,
    /// The probability that the gate rejects a sample of a filter that is right.
    by_chance: f64,
    open: Vec<OpenGate>,
    is_open: bool,
    /// When the signal was lost, or the filter settled again: an open gate belongs to that.
    lost_spans: Vec<[f64; 2]>,
}

/// When in the cycle of a motion something happens.
#[derive(Clone, Debug)]
struct RejectionCycle {
    frequency_hz: f64,
    last_s: f64,
    events: f64,
    /// Σ cos and Σ sin of the phase, harmonic by harmonic.
    sums: [[f64; 2]; HARMONICS],
}

impl RejectionCycle {
    fn take(&mut self, time_s: f64) {
        let before_s = std::mem::replace(&mut self.last_s, time_s);
        if time_s - before_s < ONE_EVENT / self.frequency_hz {
            return;
        }
        self.events += 1.0;
        for (k, sum) in self.sums.iter_mut().enumerate() {
            let (sine, cosine) =
                (TAU * ((k + 1) as f64 * self.frequency_hz * time_s).fract()).portable_sin_cos();
            sum[0] += cosine;
            sum[1] += sine;
        }
    }

    /// How probable the most concentrated of the harmonics is of events that come at random: |Σ e^{ikφ}|²/n is exponential (Rayleigh).
    fn p_value(&self) -> Option<f64> {
        let largest = self.sums.iter().map(|[re, im]| (re * re + im * im) / self.events).fold(0.0, f64::max);
        (self.events >= FEWEST).then(|| (HARMONICS as f64 * (-largest).portable_exp()).min(1.0))
    }
}

impl RejectionRecord {
    /// Of motions with these frequencies in Hz.
    pub(super) fn new(motions_hz: impl IntoIterator<Item = f64>) -> Self {
        let cycle = |frequency_hz| RejectionCycle {
            frequency_hz,
            last_s: f64::NEG_INFINITY,
            events: 0.0,
            sums: [[0.0; 2]; HARMONICS],
        };
        let moves = |hz: &f64| hz.is_finite() && *hz > 0.0;
        Self { motions: motions_hz.into_iter().filter(moves).map(cycle).collect(), ..Self::default() }
    }

    /// Takes what was rejected of new samples; that of the settling time is not judged, and there is none.
    pub(super) fn take(&mut self, trajectory: &Trajectory, estimate: &SegmentEstimate) {
        let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
        let finite = |values: &[f64]| values[scored.clone()].iter().filter(|v| v.is_finite()).count();
        let further = trajectory.further.iter().map(|signal| finite(&signal.innovation)).sum::<usize>();
        self.samples += finite(&trajectory.innovation) + further + trajectory.rejected.len();
        self.by_chance = trajectory.gate_nis.map_or(0.0, |nis| 2.0 * normal_tail(nis.sqrt()));
        for one in &trajectory.rejected {
            self.count += 1;
            self.largest = self.largest.max(one.size().abs());
            if self.first.len() < LISTED {
                let signal = one.signal.checked_sub(1).and_then(|place| trajectory.further.get(place));
                let signal = signal.map(|signal| signal.of.name.clone());
                self.first.push(Outlier { time_s: one.time_s, signal, size: one.size() });
            }
            for cycle in &mut self.motions {
                cycle.take(one.time_s);
            }
        }
        for span in &trajectory.lock.lost_spans {
            match self.lost_spans.iter().position(|known| known[0] == span[0]) {
                Some(known) => self.lost_spans[known] = *span,
                None if self.lost_spans.len() < STRETCHES => self.lost_spans.push(*span),
                None => {}
            }
        }
        for GateTurn { time_s, opens } in &trajectory.gate_turns {
            match (opens, self.is_open) {
                (true, false) if self.open.len() < STRETCHES => {
                    self.open.push(OpenGate { from_s: *time_s, to_s: None });
                }
                (false, true) => {
                    if let Some(last) = self.open.last_mut() {
                        last.to_s.get_or_insert(*time_s);
                    }
                }
                _ => {}
            }
            self.is_open = *opens;
        }
    }

    pub(super) fn rejections(&self) -> Rejections {
        let expected = self.samples as f64 * self.by_chance;
        let looks = self.motions.len() as f64;
        let belongs_to_a_loss = |open: &&OpenGate| {
            let to_s = open.to_s.unwrap_or(f64::INFINITY);
            self.lost_spans.iter().any(|[lost_s, again_s]| open.from_s < *again_s && to_s >= *lost_s)
        };
        let open = self.open.iter().filter(|open| !belongs_to_a_loss(open)).copied();
        let of_cycle = self.motions.iter().filter_map(RejectionCycle::p_value).reduce(f64::min);
        Rejections {
            count: self.count,
            share: self.count as f64 / self.samples.max(1) as f64,
            largest: self.largest,
            first: self.first.clone(),
            p_value: at_least(self.count, expected),
            p_of_cycle: of_cycle.map(|p| (looks * p).min(1.0)),
            open: open.collect(),
        }
    }
}

/// The probability of so many or more where so many are expected on average (Poisson).
fn at_least(count: usize, expected: f64) -> f64 {
    if count == 0 {
        return 1.0;
    }
    statrs::function::gamma::checked_gamma_lr(count as f64, expected.max(f64::MIN_POSITIVE)).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_false_rejections_are_no_remark_and_three_in_a_hundred_thousand_are() {
        // Poisson with 0.01: 1 − e^{−0.01}, and 0.01³/6 to first order.
        assert!((at_least(1, 0.01) - 0.009_950_166).abs() < 1e-8);
        assert!((at_least(3, 0.01) / (1e-6 / 6.0) - 1.0).abs() < 0.01);
        assert_eq!(at_least(0, 0.01), 1.0);
    }

    #[test]
    fn events_at_one_part_of_the_cycle_are_distinguished_from_others() {
        let at = |phases: &dyn Fn(usize) -> f64| {
            let mut record = RejectionRecord::new([1000.0]);
            (0..40).for_each(|k| record.motions[0].take((k as f64 * 3.0 + phases(k)) / 1000.0));
            record.motions[0].p_value().unwrap()
        };
        // At both turning points, one after the other.
        assert!(at(&|k| 0.1 + 0.5 * (k % 2) as f64) < WRONG);
        assert!(at(&|k| (k as f64 * 0.618_033_988_75).fract()) > 0.1);
    }
}

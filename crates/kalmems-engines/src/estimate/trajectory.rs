//! What a filter says over time.

use super::gate::largest_nis;
use super::{
    Contribution, ErrorSpan, FALSE_REJECTIONS, FilterStop, GateTurn, Lock, MeanAndCovariance, Rejection,
    StepCounts, StepError, TurnedStates,
};
use crate::units::Kind;
use kalmems_core::FilterError;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::borrow::Cow;
use std::ops::Range;

/// The name of the motion's phase among the quantities that follow from the states.
pub const PHASE: &str = "phase";

/// A filter's answer over one segment of a recording, one entry per sample.
#[derive(Clone, Debug)]
pub struct Trajectory {
    /// The filter, as a key of files and tables, such as `ekf`.
    pub key: String,
    /// The filter, for people.
    pub name: String,
    /// What kind of answer it is.
    pub kind: TrajectoryKind,
    /// When, in s.
    pub time_s: Vec<f64>,
    /// The states, each with its uncertainty.
    pub states: Vec<StateSeries>,
    /// The signal that the innovations are of, in SI; not a number where it is missing.
    pub signal: Vec<f64>,
    /// y − h(x⁻): measured minus predicted, in the signal's unit; not a number where there was no update.
    pub innovation: Vec<f64>,
    /// The standard deviation that the filter gives the innovation, in the signal's unit; not a number where there was no update.
    pub innovation_sd: Vec<f64>,
    /// The normalised innovation squared; not a number where there was no update.
    pub nis: Vec<f64>,
    /// ln p(y | past) of each update; not a number where there was none.
    pub log_likelihood: Vec<f64>,
    /// Σ ln p(θ_th | what came before) over the crossings of a threshold, each at its time and by the same variance for
    /// every filter, told of them or not; 0 where there are none.
    pub crossings_log_likelihood: f64,
    /// How many updates there were, and what stood in their way.
    pub counts: SampleCounts,
    /// The samples that the filter's gate rejected, in the order of time: they have no innovation above, corrected nothing, and have in
    /// `log_likelihood` the density of what the gate takes them for.
    pub rejected: Vec<Rejection>,
    /// The largest normalised innovation squared that the filter's gate believes, where it has one.
    pub gate_nis: Option<f64>,
    /// When the gate began to accept what is beyond its bound, since too much of it was, and when it ended to.
    pub gate_turns: Vec<GateTurn>,
    /// When the filter was started again from the signal, since it had lost it.
    pub restarts: Vec<Restart>,
    /// When the first cycle of each loss of the signal began, in s, where the filter is started again from the signal.
    pub lost_s: Vec<f64>,
    /// The innovations of further signals, where the filter takes several one after the other: each is predicted by the past and the
    /// signals before it.
    pub further: Vec<FurtherSignal>,
    /// The signal that the innovations are of, of a device that can have several; of any other it is the estimate's own.
    pub signal_name: Option<SignalName>,
    /// How many steps lead from each sample to the next.
    pub steps: StepCounts,
    /// How far the steps between samples lead the filter astray, part by part of the way; none of one whose steps are exact.
    pub step_errors: Vec<StepError>,
    /// How long its errors last, by the filter's own account, part by part of the way; none of what makes no claim.
    pub error_spans: Vec<ErrorSpan>,
    /// Whether the innovations of this filter, if it is right, are white; those of one whose gain is not the optimal one are not.
    pub whitens: bool,
    /// Which of its states are parameters, and what was known of them before.
    pub parameters: Vec<TrackedPrior>,
    /// How the errors of these parameters hang together at the end, pair by pair.
    pub parameter_correlations: Vec<ParameterCorrelation>,
    /// What is uncertain of the device, or of what its record is cleaned with, and no state of this filter: it is in the standard deviations of
    /// the states, and the innovations are those of the device as it is stated, with its uncertainty.
    pub considered: Vec<Contribution>,
    /// Whether the filter followed the motion.
    pub lock: Lock,
    /// Signs that the signals do not tell, where nothing else states them: of each the states, by their places, that change it together, and those
    /// that come round and change by half a period with it.
    pub hidden_signs: Vec<Vec<usize>>,
    /// Turns of several states by one angle that the signals do not tell.
    pub hidden_turns: Vec<Vec<TurnedStates>>,
    /// The states that come round, by their places, each with its period in SI.
    pub periods: Vec<(usize, f64)>,
    /// How many of the states are the filter's own; what follows from them stands behind.
    pub own_states: usize,
    /// Whether the answer was mirrored, θ → −θ, to have the sign that the experiment states.
    pub mirrored: bool,
    /// Times without an estimate, as the filter had stopped, in order; the first may have begun before these samples, and the last may go on
    /// behind them.
    pub stops: Vec<FilterStop>,
    /// Where and why the filter stopped that has not been started again.
    pub failure: Option<FilterFailure>,
    /// How long a step took, prediction, update and recording together; a measurement, not a result.
    pub seconds_per_step: f64,
}

/// A new start of a filter that had lost its signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Restart {
    /// The sample that it corrected first, by its time in s.
    pub time_s: f64,
    /// What was known there before that.
    pub known: MeanAndCovariance,
    /// The states where the signal was not lost yet.
    pub before: Vec<f64>,
}

/// What an answer rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrajectoryKind {
    /// The model alone; it takes no notice of the signal.
    ModelAlone,
    /// The signal alone, sample by sample or cycle by cycle. It predicts nothing, so that it has no innovations.
    LockIn,
    /// Both, at each sample from what was measured until then.
    Filtered,
    /// Both, at each sample from what was measured later as well. Its innovations are those of its filter.
    Smoothed,
}

/// One state over time.
#[derive(Clone, Debug)]
pub struct StateSeries {
    /// Its name, as in an experiment file.
    pub name: &'static str,
    /// Its SI unit as column names have it.
    pub unit: &'static str,
    /// What it is.
    pub kind: &'static Kind,
    /// The mean.
    pub mean: Vec<f64>,
    /// The standard deviation; empty for a model that claims none.
    pub sd: Vec<f64>,
}

/// One of several signals that correct a filter: its name, and what it is.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalName {
    /// The name.
    pub name: String,
    /// The kind of quantity, whose SI unit its innovations have.
    pub kind: &'static Kind,
}

/// The innovations of a signal after the first one.
#[derive(Clone, Debug)]
pub struct FurtherSignal {
    /// The signal.
    pub of: SignalName,
    /// Measured minus predicted; not a number where it is missing.
    pub innovation: Vec<f64>,
    /// The standard deviation that the filter gives it; not a number where it is missing.
    pub sd: Vec<f64>,
    /// The normalised innovation squared; not a number where it is missing.
    pub nis: Vec<f64>,
}

impl FurtherSignal {
    /// Without a number yet, over so many samples.
    pub(super) fn blank(of: SignalName, samples: usize) -> Self {
        let [innovation, sd, nis] = [(); 3].map(|()| vec![f64::NAN; samples]);
        Self { of, innovation, sd, nis }
    }

    /// Enters innovation and standard deviation of sample `k`.
    pub(super) fn enter(&mut self, k: usize, [innovation, sd]: [f64; 2]) {
        (self.innovation[k], self.sd[k], self.nis[k]) = (innovation, sd, (innovation / sd).powi(2));
    }

    /// Its series.
    pub(super) fn series_mut(&mut self) -> [&mut Vec<f64>; 3] {
        [&mut self.innovation, &mut self.sd, &mut self.nis]
    }

    /// The same without numbers.
    pub(super) fn hollow(&self) -> Self {
        Self::blank(self.of.clone(), 0)
    }
}

/// What was known before of a parameter that is a state; it is 0, a deviation from what the device table says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedPrior {
    /// The state, by its name.
    pub name: &'static str,
    /// Its first standard deviation.
    pub sd: f64,
    /// The density of its drift, per s.
    pub drift: f64,
    /// Whether it is a factor, whose sign is lost below −1.
    pub is_factor: bool,
}

/// How the errors of two parameters that are states hang together, by the filter's covariance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ParameterCorrelation {
    /// The parameters, by their names.
    pub names: [&'static str; 2],
    /// From −1 to 1; where it is near an end the recording tells a combination of both alone.
    pub correlation: f64,
}

/// What happened to the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SampleCounts {
    /// Samples in the segment.
    pub samples: usize,
    /// Samples that corrected the state.
    pub updates: usize,
    /// Samples whose signal is missing or not finite: predicted, not corrected.
    pub without_signal: usize,
    /// Samples that the gate of the filter rejected as outliers, each signal counted.
    #[serde(skip_serializing_if = "is_zero")]
    pub rejected: usize,
    /// Samples that are not there although time passed: predicted in steps of the usual interval.
    pub bridged: usize,
    /// Samples whose drive is missing and was taken from the sine that the rest of the drive follows.
    pub drive_from_sine: usize,
    /// Samples at which the drive bends too sharply for what it adds to the signal to be known: not corrected either.
    #[serde(skip_serializing_if = "is_zero")]
    pub drive_bends: usize,
    /// Samples to which 64 steps through a kink of the equations, such as a contact, were still too few.
    #[serde(skip_serializing_if = "is_zero")]
    pub unresolved_kinks: usize,
    /// Samples of the beginning that told where the filter starts: not corrected by once more.
    #[serde(skip_serializing_if = "is_zero")]
    pub for_start: usize,
    /// How often the filter was started again while it settles, as a sample had disturbed it.
    #[serde(skip_serializing_if = "is_zero")]
    pub restarted: usize,
    /// Samples after the settling time at which the signal is lost or the filter settles again: no part of the figures.
    #[serde(skip_serializing_if = "is_zero")]
    pub lost: usize,
    /// Crossings of a threshold that the filter was told of.
    #[serde(skip_serializing_if = "is_zero")]
    pub crossings: usize,
    /// Those of them that were too far from what it expected, and did not correct it.
    #[serde(skip_serializing_if = "is_zero")]
    pub crossings_refused: usize,
}

impl SampleCounts {
    /// Adds those of a later part.
    pub fn add(&mut self, later: &Self) {
        self.samples += later.samples;
        self.updates += later.updates;
        self.without_signal += later.without_signal;
        self.rejected += later.rejected;
        self.bridged += later.bridged;
        self.drive_from_sine += later.drive_from_sine;
        self.drive_bends += later.drive_bends;
        self.unresolved_kinks += later.unresolved_kinks;
        self.for_start += later.for_start;
        self.restarted += later.restarted;
        self.lost += later.lost;
        self.crossings += later.crossings;
        self.crossings_refused += later.crossings_refused;
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Where and why a filter stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterFailure {
    /// The time of the sample, in s.
    pub time_s: f64,
    /// Why.
    pub why: FilterError,
}

/// The mean NIS and where it would lie for a filter that is right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NisConsistency {
    /// The mean of the normalised innovation squared; 1 on average for a scalar signal and a filter that is
    /// right.
    pub mean_nis: f64,
    /// The lower end of its 95 % interval under that hypothesis.
    pub lower: f64,
    /// The upper end.
    pub upper: f64,
    /// How many updates went into it.
    pub updates: usize,
    /// Σ ln p(y | past) over the same updates.
    pub log_likelihood: f64,
}

/// The mean NIS of one of several signals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignalConsistency {
    /// The signal.
    pub signal: String,
    /// The mean of its normalised innovation squared; 1 on average for a filter that is right.
    pub mean_nis: f64,
    /// The lower end of its 95 % interval under that hypothesis.
    pub lower: f64,
    /// The upper end.
    pub upper: f64,
    /// How many updates went into it.
    pub updates: usize,
}

impl SignalConsistency {
    /// From the sum over so many updates; `None` where there is none.
    fn of(signal: &str, sum_nis: f64, updates: usize) -> Option<Self> {
        let ([lower, upper], mean_nis) = (nis_interval(updates)?, sum_nis / updates as f64);
        Some(Self { signal: signal.to_owned(), mean_nis, lower, upper, updates })
    }

    /// Over the updates of both.
    pub fn pool(&mut self, later: &Self) {
        let sum = |c: &Self| c.mean_nis * c.updates as f64;
        let pooled = Self::of(&self.signal, sum(self) + sum(later), self.updates + later.updates);
        *self = pooled.unwrap_or_else(|| self.clone());
    }
}

/// Where the mean NIS of so many updates lies in 95 of 100 cases of a filter that is right; `None` where there is none.
fn nis_interval(updates: usize) -> Option<[f64; 2]> {
    let n = updates as f64;
    let chi = ChiSquared::new(n).ok()?;
    Some([0.025, 0.975].map(|p| chi.inverse_cdf(p) / n))
}

impl NisConsistency {
    /// From the sums over so many updates; `None` where there is none.
    pub fn of(sum_nis: f64, updates: usize, log_likelihood: f64) -> Option<Self> {
        let ([lower, upper], n) = (nis_interval(updates)?, updates as f64);
        Some(Self { mean_nis: sum_nis / n, lower, upper, updates, log_likelihood })
    }

    /// Over the updates of both.
    #[must_use]
    pub fn pooled(self, other: &Self) -> Self {
        let sum = |c: &Self| c.mean_nis * c.updates as f64;
        let likelihood = self.log_likelihood + other.log_likelihood;
        Self::of(sum(&self) + sum(other), self.updates + other.updates, likelihood).unwrap_or(self)
    }

    /// Whether the mean lies in its interval.
    pub fn holds(&self) -> bool {
        self.lower <= self.mean_nis && self.mean_nis <= self.upper
    }
}

impl Trajectory {
    /// One state by name.
    pub fn state(&self, name: &str) -> Option<&StateSeries> {
        self.states.iter().find(|state| state.name == name)
    }

    /// How long an error of a state, by its place, lasts between these times, in s, on average over the parts of the way; `None` where
    /// that is not known. What follows from the states lasts as long as the longest of them.
    pub fn error_lasts_s(&self, state: usize, from_s: f64, to_s: f64) -> Option<f64> {
        let (mut passed_s, mut independent) = (0.0, 0.0);
        for span in &self.error_spans {
            let overlap_s = span.to_s.min(to_s) - span.from_s.max(from_s);
            let longest = || span.correlation_s.iter().copied().fold(0.0, f64::max);
            let lasts_s = span.correlation_s.get(state).copied().unwrap_or_else(longest);
            if overlap_s > 0.0 && lasts_s > 0.0 {
                passed_s += overlap_s;
                independent += overlap_s / lasts_s;
            }
        }
        if independent > 0.0 {
            return Some(passed_s / independent);
        }
        // An error is followed a part of the time: where none was within, the last one before goes on.
        let before = self.error_spans.iter().filter(|span| span.to_s <= from_s);
        let last = before.max_by(|a, b| a.to_s.total_cmp(&b.to_s))?;
        let longest = last.correlation_s.iter().copied().fold(0.0, f64::max);
        Some(last.correlation_s.get(state).copied().unwrap_or(longest)).filter(|lasts_s| *lasts_s > 0.0)
    }

    /// Whether it says how uncertain it is; the model alone and the lock-in do not.
    pub fn claims(&self) -> bool {
        self.states.iter().all(|state| !state.sd.is_empty())
    }

    /// Whether there is an estimate of any state at a sample.
    pub fn has_estimate(&self, k: usize) -> bool {
        self.states.iter().any(|state| state.mean.get(k).is_some_and(|mean| mean.is_finite()))
    }

    /// Why there is no estimate at a sample, in a word, where there is none.
    pub fn reason_without_estimate(&self, k: usize) -> Option<&'static str> {
        let time_s = *self.time_s.get(k).filter(|_| !self.has_estimate(k))?;
        let has_signal = self.signal.get(k).is_some_and(|y| y.is_finite());
        Some(match (self.is_stopped_at(time_s), has_signal) {
            (true, _) => "stopped",
            (false, false) => "no_signal",
            (false, true) => "not_known",
        })
    }

    /// Has no numbers where the signal is lost and where the filter settles again.
    pub(super) fn leave_out_lost(&mut self) {
        for &[from_s, to_s] in &self.lock.lost_spans {
            let at = |time_s: f64| self.time_s.partition_point(|t| *t < time_s);
            let lost = at(from_s)..at(to_s);
            let series = self.states.iter_mut().flat_map(|state| [&mut state.mean, &mut state.sd]);
            let further = self.further.iter_mut().flat_map(FurtherSignal::series_mut);
            let own =
                [&mut self.innovation, &mut self.innovation_sd, &mut self.nis, &mut self.log_likelihood];
            for values in series.chain(further).chain(own) {
                // Of a model without a claim the deviations are not there.
                if let Some(values) = values.get_mut(lost.clone()) {
                    values.fill(f64::NAN);
                }
            }
        }
        let lock = &self.lock;
        self.rejected.retain(|one| !lock.is_lost_at(one.time_s));
    }

    /// How many of these samples are where the signal is lost or the filter settles again.
    pub fn lost_among(&self, samples: Range<usize>) -> usize {
        let at = |time_s: f64| self.time_s.partition_point(|t| *t < time_s).clamp(samples.start, samples.end);
        // Spans are in the order of time, and a filter may lose the signal while it settles.
        let (mut count, mut until) = (0, samples.start);
        for &[from_s, to_s] in &self.lock.lost_spans {
            let (from, to) = (at(from_s).max(until), at(to_s));
            count += to.saturating_sub(from);
            until = until.max(to);
        }
        count
    }

    /// Says that it is the model alone, which claims nothing.
    pub fn mark_model_alone(&mut self) {
        self.kind = TrajectoryKind::ModelAlone;
        self.remove_deviations();
    }

    /// Takes its standard deviations away: zeros would look like a claim.
    pub fn remove_deviations(&mut self) {
        self.states.iter_mut().for_each(|state| state.sd.clear());
    }

    /// The samples from `skip_s` after the first on: those that are scored.
    pub fn scored(&self, skip_s: f64) -> Range<usize> {
        self.scored_after(self.time_s.first().copied().unwrap_or(0.0), skip_s)
    }

    /// The samples from `skip_s` after this time on, both in s, of a segment that began then.
    pub fn scored_after(&self, start_s: f64, skip_s: f64) -> Range<usize> {
        // Half an ulp of a decimal time must not decide about a sample.
        let start = self.time_s.partition_point(|t| *t < start_s + skip_s * (1.0 - 1e-12));
        start..self.time_s.len()
    }

    /// The mean NIS over the updates by all signals in a range of samples, with its 95 % interval, but for those where the signal is lost: n·NIS is
    /// χ² with n degrees of freedom if innovations are white and of the stated variance. `None` where there was no update.
    pub fn consistency(&self, range: Range<usize>) -> Option<NisConsistency> {
        let likelihood = self.where_followed(&range, &self.log_likelihood);
        let sums = (0..=self.further.len()).map(|signal| self.sum_of_nis(signal, &range));
        let (updates, sum) = sums.fold((0, 0.0), |(n, s), (more, add)| (n + more, s + add));
        NisConsistency::of(sum, updates, likelihood.sum())
    }

    /// The signals that correct it, of a device that can have several.
    pub fn signals(&self) -> impl Iterator<Item = &SignalName> {
        self.signal_name.iter().chain(self.further.iter().map(|signal| &signal.of))
    }

    /// The same by each signal, the first one first; none where there is but one.
    pub fn consistency_by_signal(&self, range: &Range<usize>) -> Vec<SignalConsistency> {
        let names = self.signals().enumerate();
        let of = |(place, signal): (usize, &SignalName)| {
            let (updates, sum) = self.sum_of_nis(place, range);
            SignalConsistency::of(&signal.name, sum, updates)
        };
        if self.further.is_empty() { Vec::new() } else { names.filter_map(of).collect() }
    }

    /// How many updates by a signal, by its place, there are in a range of samples, and the sum of their NIS.
    fn sum_of_nis(&self, signal: usize, range: &Range<usize>) -> (usize, f64) {
        let add = |(n, s): (usize, f64), v: f64| (n + 1, s + v);
        let further = signal.checked_sub(1).and_then(|place| self.further.get(place));
        let nis = further.map_or(&self.nis, |further| &further.nis);
        let rejected = self.rejected_normal(signal).filter(|one| range.contains(&one.sample));
        self.where_followed(range, nis).chain(rejected.map(|one| one.size().powi(2))).fold((0, 0.0), add)
    }

    /// The samples of a signal that the gate rejected for their size and that normal noise has: beyond a bound of the gate that is nearer than the
    /// usual one. Without them the innovations would be smaller than claimed and not normal, however right the filter is.
    fn rejected_normal(&self, signal: usize) -> impl Iterator<Item = &Rejection> {
        let bound = self.gate_nis.unwrap_or(f64::INFINITY);
        let is_normal = move |one: &&Rejection| {
            let nis = one.size().powi(2);
            one.signal == signal && nis > bound && nis <= largest_nis(FALSE_REJECTIONS)
        };
        self.rejected.iter().filter(is_normal)
    }

    /// The innovations of a signal, by its place, and their standard deviations, before the gate as far as normal noise goes.
    pub fn before_the_gate(&self, signal: usize) -> [Cow<'_, [f64]>; 2] {
        let further = signal.checked_sub(1).and_then(|place| self.further.get(place));
        let own = further.map_or([&self.innovation, &self.innovation_sd], |own| [&own.innovation, &own.sd]);
        let mut all = own.map(|series| Cow::Borrowed(series.as_slice()));
        for one in self.rejected_normal(signal) {
            for (series, value) in all.iter_mut().zip([one.innovation, one.sd]) {
                if let Some(entry) = series.to_mut().get_mut(one.sample) {
                    *entry = value;
                }
            }
        }
        all
    }

    /// Those of a series that are numbers, in a range of samples, but for those where the signal is lost.
    fn where_followed(&self, range: &Range<usize>, series: &[f64]) -> impl Iterator<Item = f64> {
        let has_lost = !self.lock.lost_spans.is_empty() && self.kind != TrajectoryKind::ModelAlone;
        let samples = self.time_s.iter().zip(series).skip(range.start).take(range.len());
        let followed = samples.filter(move |(t, _)| !(has_lost && self.lock.is_lost_at(**t)));
        followed.map(|(_, value)| *value).filter(|value| value.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gate that rejects one sample in a hundred of normal noise: what it leaves has a variance of 0.93, and before the gate it is 1.
    #[test]
    fn a_near_gate_takes_nothing_off_the_mean_nis_and_hides_no_shape() {
        let bound = largest_nis(1e-2);
        let mut noise = crate::simulate::WhiteNoise::new(7, 3);
        let z: Vec<f64> = (0..20_000).map(|_| noise.sample()).collect();
        let names = [("position", "m", &crate::units::kind::LENGTH)];
        let mut trajectory =
            Trajectory::blank(("", ""), TrajectoryKind::Filtered, (&z, &z, &(0..z.len())), &names);
        trajectory.gate_nis = Some(bound);
        for (k, z) in z.iter().enumerate() {
            let is_taken = z * z <= bound;
            // One disturbance that no normal noise has.
            let innovation = if k == 77 { 40.0 } else { *z };
            if is_taken && k != 77 {
                (trajectory.innovation[k], trajectory.innovation_sd[k], trajectory.nis[k]) = (*z, 1.0, z * z);
            } else {
                trajectory.rejected.push(Rejection {
                    sample: k,
                    time_s: 0.0,
                    signal: 0,
                    innovation,
                    sd: 1.0,
                });
            }
        }
        let found = trajectory.consistency(0..z.len()).unwrap();
        assert!(found.updates == z.len() - 1 && found.holds(), "{found:?}");
        let [innovation, sd] = trajectory.before_the_gate(0);
        assert!(
            innovation[77].is_nan() && (0..z.len()).all(|k| k == 77 || innovation[k] == z[k] && sd[k] == 1.0)
        );
    }

    #[test]
    fn the_interval_of_the_mean_is_that_of_chi_squared() {
        use statrs::distribution::{ChiSquared, ContinuousCDF};
        // χ²₁₀₀ quantiles from published tables: 74.222 and 129.561.
        let chi = ChiSquared::new(100.0).unwrap();
        assert!((chi.inverse_cdf(0.025) - 74.222).abs() < 1e-3);
        assert!((chi.inverse_cdf(0.975) - 129.561).abs() < 1e-3);
        // For many degrees of freedom 1 ± 1.96·√(2/n).
        let chi = ChiSquared::new(16_001.0).unwrap();
        assert!((chi.inverse_cdf(0.975) / 16_001.0 - 1.0 - 1.96 * (2.0_f64 / 16_001.0).sqrt()).abs() < 2e-4);
    }
}

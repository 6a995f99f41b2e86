//! Zero phases that are told before they happen.

use super::transition::{Transition, TransitionProcess};
use super::{EstimateError, FilterBasics, FilterPast};
use kalmems_core::{Covariance, Mat, NumericProcess};
use kalmems_models::control::{Mark, StateStep, Trigger, TriggerSettings, UnusableTrigger};
use serde::Serialize;

/// What is wanted of samples that arrive beside their estimates.
#[derive(Clone, Debug, Default)]
pub struct SideOutputs {
    /// Whether amplitude and phase of the motion stand behind the states.
    pub phase: bool,
    /// Which zero phases are predicted, and the place of the filter that does.
    pub prediction: Option<(usize, PhasePrediction)>,
}

impl SideOutputs {
    /// Whether any of it is asked for.
    pub const fn is_asked(&self) -> bool {
        self.phase || self.prediction.is_some()
    }

    /// What the filter at this place gives of a motion with about this rate in rad/s, mirrored or not if that is known; zero phases from a time
    /// in s on.
    pub fn of_filter(
        &self,
        place: usize,
        (rate, mirrored): (f64, Option<bool>),
        from_s: f64,
    ) -> FilterSideOutputs {
        let prediction = self.prediction.filter(|(own, _)| *own == place).map(|(_, prediction)| prediction);
        FilterSideOutputs { rate, phase: self.phase, prediction, mirrored, from_s }
    }
}

/// What a filter gives besides its states, an angle and its rate first.
#[derive(Clone, Copy, Debug, Default)]
pub struct FilterSideOutputs {
    /// The rate of the motion in rad/s.
    rate: f64,
    /// Whether amplitude and phase are said.
    phase: bool,
    /// Which zero phases are predicted.
    prediction: Option<PhasePrediction>,
    /// Whether the motion is mirrored; `None` before that is known.
    mirrored: Option<bool>,
    /// From when on they are predicted, in s.
    pub from_s: f64,
}

impl FilterSideOutputs {
    /// The rate in rad/s by which amplitude and phase are said, if they are asked for.
    pub fn phase_rate(&self) -> Option<f64> {
        self.phase.then_some(self.rate)
    }

    /// What predicts zero phases on the filter's way, if it is to, with samples of this interval in s.
    pub fn predictor(
        &self,
        filter: &FilterBasics,
        interval_s: f64,
        past: &mut FilterPast,
    ) -> Result<Option<PhasePredictor>, EstimateError> {
        let Some(prediction) = self.prediction else { return Ok(None) };
        let mut predictor = if let Some(predictor) = past.predictor.take() {
            predictor
        } else {
            let told_s = past.last_predicted_s();
            PhasePredictor::new(&filter.key, prediction, (interval_s, self.rate), told_s)
                .map_err(|why| EstimateError::Ahead { filter: filter.name.clone(), why })?
        };
        predictor.set_mirrored(self.mirrored);
        Ok(Some(predictor))
    }
}

/// Which zero phases are told, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhasePrediction {
    /// How long before it happens an event is told at least, in s, from the newest sample on that its estimate needs.
    pub ahead_s: f64,
    /// How many samples behind its own an estimate needs.
    pub behind: u32,
    /// Whether rising ones are told, and falling ones.
    pub directions: [bool; 2],
    /// The amplitude in rad from which there are events.
    pub least_amplitude: f64,
}

/// A zero phase, told before it happens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedPhase {
    /// The time of the sample from which it is told, in s.
    pub told_s: f64,
    /// When it will happen, in s.
    pub time_s: f64,
    /// The standard deviation of that, in s.
    pub sd_s: f64,
    /// Whether the angle will rise.
    pub rising: bool,
}

/// How the telling went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct PhasePredictionCounts {
    /// Zero phases that were told before they happened.
    pub told: u64,
    /// Those of them that were told less long before than was asked for.
    pub late: u64,
    /// Zero phases that happened without having been told.
    pub missed: u64,
    /// Samples at which it was not known what the drive would do, so that none could be told.
    pub without_drive: u64,
}

impl PhasePredictionCounts {
    /// These and others.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self {
            told: self.told + other.told,
            late: self.late + other.late,
            missed: self.missed + other.missed,
            without_drive: self.without_drive + other.without_drive,
        }
    }
}

/// How a state goes on from now, step by step, whatever the number of states.
pub trait StatePropagation {
    /// Hands the step with this number to `with`, 0 for the one that begins now.
    fn step(&self, number: u32, with: &mut dyn FnMut(&dyn Transition));
}

/// The same for `N` states; all steps add the same noise.
pub(super) struct SizedStatePropagation<'a, const N: usize> {
    onwards: &'a dyn StatePropagation,
    noise: Covariance<f64, N>,
}

impl<'a, const N: usize> SizedStatePropagation<'a, N> {
    pub(super) fn new(onwards: &'a dyn StatePropagation) -> Self {
        let mut noise = Covariance::zero();
        onwards.step(0, &mut |step| noise = *TransitionProcess::<N>::of(step).noise_added().covariance());
        Self { onwards, noise }
    }
}

impl<const N: usize> StateStep<f64, N> for SizedStatePropagation<'_, N> {
    fn step(&self, x: &[f64; N], step: u32) -> [f64; N] {
        let mut to = [f64::NAN; N];
        self.onwards.step(step, &mut |transition| transition.advance(x, &mut to));
        to
    }

    fn linearize(&self, x: &[f64; N], step: u32) -> ([f64; N], Mat<f64, N, N>) {
        let (mut to, mut jacobian) = ([f64::NAN; N], Mat::zero());
        self.onwards.step(step, &mut |transition| {
            transition.linearize(x, &mut to, jacobian.0.as_flattened_mut());
        });
        (to, jacobian)
    }

    fn noise(&self) -> &Covariance<f64, N> {
        &self.noise
    }
}

/// Predicts the zero phases of one filter, sample by sample, each once.
#[derive(Clone, Debug)]
pub struct PhasePredictor {
    /// The key of its filter.
    key: String,
    settings: PhasePrediction,
    interval_s: f64,
    /// The rate of the motion, about, in rad/s.
    rate: f64,
    /// Of zero phases on their way up and down, as the filter has them.
    triggers: [Trigger<f64>; 2],
    told_s: [Option<f64>; 2],
    last_s: Option<f64>,
    /// The running mean square of how far the drive was from what had been foreseen, relative to its amplitude.
    strayed: f64,
    /// Which directions are to be told, as the filter has them.
    wanted: [bool; 2],
    /// Told by the filter, and not handed on yet.
    events: Vec<PredictedPhase>,
    counts: PhasePredictionCounts,
}

/// Over how many samples, about, the drive is compared with what had been foreseen.
const COMPARED: f64 = 32.0;
/// How far it may stray from that, relative to its amplitude.
const STRAYED: f64 = 0.01;

impl PhasePredictor {
    /// By the filter with this key, of a motion with about this rate in rad/s, sampled in this interval in s, where another
    /// run told zero phases until `told_s`.
    pub fn new(
        key: &str,
        settings: PhasePrediction,
        (interval_s, rate): (f64, f64),
        told_s: [Option<f64>; 2],
    ) -> Result<Self, UnusableTrigger> {
        let trigger = |mark| {
            // Told at the first sample at which an event is no farther away than the lead, it is half an interval more than
            // is asked for, so that what one more sample tells does not make it late.
            let lead = settings.ahead_s + (f64::from(settings.behind) + 1.5) * interval_s;
            let least_amplitude = settings.least_amplitude;
            Trigger::new(TriggerSettings { interval: interval_s, rate, mark, lead, least_amplitude })
        };
        Ok(Self {
            key: key.to_owned(),
            settings,
            interval_s,
            rate,
            triggers: [trigger(Mark::Rising)?, trigger(Mark::Falling)?],
            told_s,
            last_s: None,
            strayed: 0.0,
            wanted: [true; 2],
            events: Vec::new(),
            counts: PhasePredictionCounts::default(),
        })
    }

    /// The key of its filter.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The times in s of the zero phases that were told last, rising and falling as the filter has them.
    pub fn last_predicted_s(&self) -> [Option<f64>; 2] {
        self.told_s
    }

    /// Hears whether the filter's motion is mirrored, once that is known: then it need not be asked for both directions.
    pub fn set_mirrored(&mut self, mirrored: Option<bool>) {
        self.wanted = mirrored.map_or([true; 2], |mirrored| self.directions(mirrored));
    }

    /// The directions that are wanted, as the filter has them.
    fn directions(&self, mirrored: bool) -> [bool; 2] {
        let [rising, falling] = self.settings.directions;
        if mirrored { [falling, rising] } else { [rising, falling] }
    }

    /// Adds to the standard deviations of the times that are not handed on yet what is uncertain of the device: by how much each direction of that moves
    /// the phase at the sample that a time was told from, in rad. The phase at the zero is off by as much where the motion is steady.
    pub(crate) fn consider(&mut self, moves: impl Fn(f64, f64) -> Vec<f64>) {
        for event in &mut self.events {
            let moved =
                moves(event.told_s, self.rate).iter().map(|phase| (phase / self.rate).powi(2)).sum::<f64>();
            event.sd_s = (event.sd_s * event.sd_s + moved).sqrt();
        }
    }

    /// Compares the drive, in units of its amplitude, with what had been foreseen of it; whether it can be relied on.
    pub fn follows(&mut self, strayed: f64, residual: f64) -> bool {
        if strayed.is_finite() {
            self.strayed += (strayed * strayed - self.strayed) / COMPARED;
        }
        self.strayed <= STRAYED * STRAYED + residual * residual
    }

    /// Takes what a filter says of a sample, and how its state goes on, where that is known.
    pub fn take<const N: usize>(
        &mut self,
        time_s: f64,
        (mean, covariance): (&[f64; N], &Covariance<f64, N>),
        onward: Option<&dyn StateStep<f64, N>>,
    ) {
        let Self { triggers, told_s, wanted, interval_s, .. } = self;
        let elapsed = self.last_s.replace(time_s).map(|last_s| time_s - last_s);
        self.counts.without_drive += u64::from(onward.is_none());
        for (place, trigger) in triggers.iter_mut().enumerate().filter(|(place, _)| wanted[*place]) {
            if elapsed.is_none() {
                *trigger = trigger.resumed(told_s[place].map(|told_s| told_s - (time_s - *interval_s)));
            }
            let elapsed = elapsed.unwrap_or(*interval_s);
            let event = match onward {
                Some(onward) if elapsed < 1.5 * *interval_s => trigger.step(onward, (mean, covariance)),
                _ => {
                    trigger.passes(mean, elapsed);
                    None
                }
            };
            if let Some(event) = event {
                let crossing = event.crossing;
                let predicted = PredictedPhase {
                    told_s: time_s,
                    time_s: time_s + crossing.after,
                    sd_s: crossing.sd,
                    rising: place == 0,
                };
                told_s[place] = Some(predicted.time_s);
                self.events.push(predicted);
            }
        }
    }

    /// Hands on what was told since it was last asked, of a motion that is mirrored or not, and counts it.
    pub fn take_predictions(&mut self, mirrored: bool) -> Vec<PredictedPhase> {
        let [rising, falling] = self.settings.directions;
        let needed_s = self.settings.ahead_s + f64::from(self.settings.behind) * self.interval_s;
        let mut events = std::mem::take(&mut self.events);
        for event in &mut events {
            event.rising ^= mirrored;
        }
        events.retain(|event| if event.rising { rising } else { falling });
        self.counts.told += events.len() as u64;
        self.counts.late +=
            events.iter().filter(|event| event.time_s - event.told_s < needed_s).count() as u64;
        let wanted = self.directions(mirrored);
        let triggers = self.triggers.iter().zip(wanted).filter(|(_, wanted)| *wanted);
        self.counts.missed = triggers.map(|(trigger, _)| trigger.missed()).sum();
        events
    }

    /// How the telling went, as far as it was handed on.
    pub const fn counts(&self) -> PhasePredictionCounts {
        self.counts
    }
}

//! The scanner's way through one segment: the signal at each sample, and the crossings when they are told.

use super::filters::{ThresholdFilterSettings, ThresholdSettings};
use super::plant::MirrorPlant;
use crate::config::{CrossingTiming, Method, Variant};
use crate::crossings::{CrossingDelivery, CrossingReading, LevelCrossing};
use crate::estimate::driven::{DrivenCourse, DrivenSegment, HYBRID_STEPS, Plant};
use crate::estimate::{
    Course, EVENTS, Filtering, MOST_STATES, NEVER, SampleCounts, Sensor, Trajectory, Transition,
    by_signal_taken_for,
};
use crate::signal::quintic_between;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{FilterError, Innovation, Nodes};
use kalmems_models::readout::Feedthrough;

/// Model, signal and crossings of one segment.
pub struct ThresholdCourse<'a> {
    /// From sample to sample.
    motion: Box<dyn Course + 'a>,
    noise_variance: f64,
    plant: &'a MirrorPlant,
    data: &'a DrivenSegment<'a>,
    /// dV/dt at each sample in V/s; not a number where it is not known.
    drive_slope: &'a [f64],
    variant: Variant,
    /// The variance of a sample that the filter reckons with, in V².
    signal_variance: f64,
    threshold: Option<ThresholdSettings>,
    /// By the sample at which the filter is told, or could be.
    crossings: Vec<(usize, DeliveredCrossing)>,
    /// The angle that is passed, in rad, for the likelihood of the crossings.
    angle: f64,
    log_likelihood: f64,
}

/// A crossing as it is delivered to a filter.
#[derive(Clone, Copy)]
struct DeliveredCrossing {
    /// Where in time the filter takes it to lie.
    taken: CrossingReading,
    /// Where it is judged, which is the same for every filter.
    judged: CrossingReading,
}

/// The longest step back to a crossing in s: with ω_n·h below 0.15 the method of fourth order is right to 10⁻⁶ of the
/// amplitude over a quarter of a cycle.
const STEP_BACK_S: f64 = 32e-6;

/// The smallest variance of an angle at a crossing whose own follows from its time, in rad²: what the threshold itself is
/// known to, (0.01 mrad)².
pub const LEAST_VARIANCE: f64 = 1e-10;

impl<'a> ThresholdCourse<'a> {
    /// A way through these rows of a segment, of which `first` is the place of the first; `angle` is that which is passed, for
    /// the likelihood of the crossings. The motion from sample to sample is that of `moving`; back to a crossing and in the signal
    /// it is that of `plant`.
    pub fn new<P: Plant>(
        (plant, moving): (&'a MirrorPlant, &'a P),
        (noise_variance, angle): (f64, f64),
        data: &'a DrivenSegment<'a>,
        drive_slope: &'a [f64],
        filter: &ThresholdFilterSettings,
        (found, first): (&[LevelCrossing], usize),
    ) -> Result<Self, AugmentationError> {
        let told = |crossing| told(crossing, filter.threshold, data, first);
        let mut crossings: Vec<(usize, DeliveredCrossing)> = found.iter().filter_map(told).collect();
        crossings.retain(|(sample, _)| *sample < data.time_s.len());
        crossings.sort_by_key(|(sample, _)| *sample);
        let motion = DrivenCourse::new(moving, noise_variance, data)?;
        let motion = match filter.basics.method {
            Method::HybridEkf => motion.in_steps(HYBRID_STEPS)?,
            _ => motion,
        };
        Ok(Self {
            motion: Box::new(motion),
            noise_variance,
            plant,
            data,
            drive_slope,
            variant: filter.variant,
            signal_variance: filter.signal_variance,
            threshold: filter.threshold,
            crossings,
            angle,
            log_likelihood: 0.0,
        })
    }

    /// Judges a filter by the crossings that are known at a sample, and corrects it by those that it is told of.
    fn cross(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let first = self.crossings.partition_point(|(sample, _)| *sample < k);
        let last = self.crossings.partition_point(|(sample, _)| *sample <= k);
        for i in first..last {
            let DeliveredCrossing { taken, judged } = self.crossings[i].1;
            let angle = self.angle_then(judged, k)?;
            let variance = judged.angle_variance + LEAST_VARIANCE;
            let judgement = filter.update_within(&angle, self.angle, variance, NEVER)?;
            self.log_likelihood += judgement.log_likelihood();
            let Some(threshold) = &self.threshold else { continue };
            let variance = match threshold.angle_sd {
                Some(sd) => sd * sd,
                None => taken.angle_variance + LEAST_VARIANCE,
            };
            let angle = self.angle_then(taken, k)?;
            let innovation = match threshold.gate_nis {
                Some(largest_nis) => filter.update_within(&angle, threshold.angle, variance, largest_nis)?,
                None => filter.update(EVENTS, &angle, threshold.angle, variance)?,
            };
            counts.crossings += 1;
            counts.crossings_refused += usize::from(!innovation.taken);
        }
        Ok(())
    }

    /// The state that says how much more feedthrough there is than was taken off the signal before it was looked at, and
    /// by how many s one of it makes a crossing seem too late: R_s·δC_ft·dV/dt over the rise of the signal.
    fn late(&self, crossing: CrossingReading) -> Option<(usize, f64)> {
        let (state, scale) = self.plant.feedthrough_state()?;
        let times = self.data.time_s;
        let nearest = times.partition_point(|t| *t < crossing.time_s).min(times.len() - 1);
        let seconds = self.plant.feedthrough().0 * scale * self.drive_slope[nearest] / crossing.volts_per_s;
        seconds.is_finite().then_some((state, seconds))
    }

    /// The angle at a crossing, as the state at a sample says it.
    fn angle_then(&self, crossing: CrossingReading, k: usize) -> Result<AngleThen<'_>, FilterError> {
        let time_s = crossing.time_s;
        let now_s = self.data.time_s[k];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small count
        let steps = ((now_s - time_s).abs() / STEP_BACK_S).ceil().max(1.0) as usize;
        let step_s = (time_s - now_s) / steps as f64;
        // It could be made for the usual interval.
        let motion = self.plant.over(step_s).map_err(|_| FilterError::NonFiniteState)?;
        let volts = |halves: usize| {
            let at_s = now_s + 0.5 * step_s * halves as f64;
            let times = self.data.time_s;
            let to = times.partition_point(|t| *t < at_s).clamp(1, times.len() - 1);
            quintic_between(times, |i| self.data.drive.sample(i).0, to, at_s)
        };
        let nodes = (0..steps).map(|i| Nodes {
            start: volts(2 * i),
            middle: volts(2 * i + 1),
            end: volts(2 * i + 2),
        });
        Ok(AngleThen { plant: self.plant, motion, nodes: nodes.collect(), late: self.late(crossing) })
    }
}

/// The sample at which a filter is told of a crossing, or could be, and when it was; `None` before those that are there.
fn told(
    crossing: &LevelCrossing,
    threshold: Option<ThresholdSettings>,
    data: &DrivenSegment,
    first: usize,
) -> Option<(usize, DeliveredCrossing)> {
    let taken = crossing.at(threshold.map_or(CrossingTiming::default(), |threshold| threshold.timing))?;
    let judged = crossing.at(CrossingTiming::default()).or(crossing.fallback).unwrap_or(taken);
    let delivery = threshold.map_or(CrossingDelivery::default(), |threshold| threshold.delivery);
    let sample = delivery.row(taken.time_s, (crossing.known_at, first), (data.time_s, data.interval_s))?;
    Some((sample, DeliveredCrossing { taken, judged }))
}

impl Course for ThresholdCourse<'_> {
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn drive(&self, k: usize) -> Option<f64> {
        Some(self.data.drive.sample(k).0)
    }

    /// Σ ln p(θ_th | what came before) over the crossings.
    fn conclude(&self, trajectory: &mut Trajectory) {
        trajectory.crossings_log_likelihood = self.log_likelihood;
    }

    fn divide(&mut self, steps: usize) -> bool {
        self.motion.divide(steps)
    }

    fn rewind(&mut self) {
        self.log_likelihood = 0.0;
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        self.motion.advance(filter, to, counts)
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        self.cross(filter, k, counts)?;
        let y = self.data.signal[k];
        let bends = !self.drive_slope[k].is_finite();
        counts.drive_bends += usize::from(bends);
        if !y.is_finite() || bends {
            return Ok(None);
        }
        let variance = self.noise_variance;
        let (resistance, capacitance) = self.plant.feedthrough();
        let through = Feedthrough {
            readout: &(),
            current_gain: resistance * self.drive_slope[k],
            capacitance,
            state: self.plant.feedthrough_state(),
        };
        let printed = self.variant == Variant::Literal;
        let seen = WithFeedthrough { readout: &self.plant.sensor(), through, printed };
        let taken_for = (self.variant != Variant::TimingOnly).then_some(self.signal_variance);
        by_signal_taken_for(filter, &seen, (y, variance), taken_for).map(Some)
    }
}

/// A readout and what of the drive reaches it; by its derivative, or by [0, h(θ), …] as Table 4.1 of Chen, dissertation,
/// 2018, prints it.
struct WithFeedthrough<'a> {
    readout: &'a dyn Sensor,
    through: Feedthrough<'a, (), f64>,
    printed: bool,
}

impl Sensor for WithFeedthrough<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        let known = self.readout.read(x) - self.through.volts();
        self.through.deviation(x.len()).map_or(known, |(state, gain)| known - x[state] * gain)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let mut volts = self.readout.linearize(x, slopes) - self.through.volts();
        if let Some((state, gain)) = self.through.deviation(x.len()) {
            volts -= x[state] * gain;
            slopes[state] -= gain;
        }
        if self.printed {
            slopes[0] = 0.0;
        }
        volts
    }
}

/// The angle that the present state had at a crossing: the motion taken back along the drive.
///
/// For a mirror that swings freely its derivative by angle and rate is the first row of Φ(−τ).
struct AngleThen<'a> {
    plant: &'a MirrorPlant,
    /// One step back, and the drive over each.
    motion: <MirrorPlant as Plant>::Motion,
    nodes: Vec<Nodes<f64>>,
    /// The state that makes the crossing seem late, and by how many s one of it does.
    late: Option<(usize, f64)>,
}

impl AngleThen<'_> {
    /// The angle, of the state that was then.
    fn angle(&self, then: &[f64], x: &[f64]) -> f64 {
        match self.late {
            Some((state, seconds)) => then[0] - then[1] * x[state] * seconds,
            None => then[0],
        }
    }
}

impl Sensor for AngleThen<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        let (mut then, mut next) = ([0.0; MOST_STATES], [0.0; MOST_STATES]);
        let (then, next) = (&mut then[..x.len()], &mut next[..x.len()]);
        then.copy_from_slice(x);
        for nodes in &self.nodes {
            self.plant.under(&self.motion, nodes).advance(then, next);
            then.copy_from_slice(next);
        }
        self.angle(then, x)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let n = x.len();
        let (mut then, mut next, mut step) = ([0.0; MOST_STATES], [0.0; MOST_STATES], [0.0; SQUARE]);
        let (then, next, step) = (&mut then[..n], &mut next[..n], &mut step[..n * n]);
        then.copy_from_slice(x);
        // The derivatives of the state that was then by the present one, row by row.
        let mut all = [0.0; SQUARE];
        (0..n).for_each(|i| all[i * n + i] = 1.0);
        for nodes in &self.nodes {
            self.plant.under(&self.motion, nodes).linearize(then, next, step);
            then.copy_from_slice(next);
            let before = all;
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                all[i * n + j] = (0..n).map(|k| step[i * n + k] * before[k * n + j]).sum();
            }
        }
        let (angle, rate) = (&all[..n], &all[n..2 * n]);
        for (slope, (angle, rate)) in slopes.iter_mut().zip(angle.iter().zip(rate)) {
            *slope = match self.late {
                Some((state, seconds)) => angle - rate * x[state] * seconds,
                None => *angle,
            };
        }
        if let Some((state, seconds)) = self.late {
            slopes[state] -= then[1] * seconds;
        }
        self.angle(then, x)
    }
}

/// The entries of the largest matrix.
const SQUARE: usize = MOST_STATES * MOST_STATES;

//! The scanner's way through one segment: the signal at each sample, and the crossings when they are told.

use super::crossings::{Crossing, Instant};
use super::filters::{FilterSettings, ThresholdSettings};
use super::plant::MirrorPlant;
use crate::config::{Applied, Timing, Variant};
use crate::estimate::driven::{DrivenCourse, DrivenSegment, Plant};
use crate::estimate::{Counts, Course, Trajectory};
use crate::signal::cubic_between;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::update::Gate;
use kalmems_core::{Covariance, Filter, FilterError, Innovation, Mat, Measurement, Nodes, Over, Process};
use kalmems_models::readout::Feedthrough;

/// Model, signal and crossings of one segment.
pub struct ThresholdCourse<'a, const A: usize, const N: usize> {
    motion: DrivenCourse<'a, MirrorPlant<A>, N>,
    plant: &'a MirrorPlant<A>,
    data: &'a DrivenSegment<'a>,
    /// dV/dt at each sample in V/s; not a number where it is not known.
    drive_slope: &'a [f64],
    variant: Variant,
    /// The variance of a sample that the filter reckons with, in V².
    signal_variance: f64,
    threshold: Option<ThresholdSettings>,
    /// By the sample at which the filter is told, or could be.
    crossings: Vec<(usize, Told)>,
    /// The angle that is passed, in rad, for the likelihood of the crossings.
    angle: f64,
    log_likelihood: f64,
}

/// A crossing as a filter is told of it.
#[derive(Clone, Copy)]
struct Told {
    /// Where in time the filter takes it to lie.
    taken: Instant,
    /// Where it is judged, which is the same for every filter.
    judged: Instant,
}

/// The longest step back to a crossing in s: with ω_n·h below 0.15 the method of fourth order is right to 10⁻⁶ of the
/// amplitude over a quarter of a cycle.
const STEP_BACK_S: f64 = 32e-6;

/// The smallest variance of an angle at a crossing whose own follows from its time, in rad²: what the threshold itself is
/// known to, (0.01 mrad)².
pub const LEAST_VARIANCE: f64 = 1e-10;

/// A normalised innovation squared that no innovation is below.
const NEVER: f64 = -1.0;

impl<'a, const A: usize, const N: usize> ThresholdCourse<'a, A, N> {
    /// A way through this segment; `angle` is that which is passed, for the likelihood of the crossings.
    pub fn new(
        plant: &'a MirrorPlant<A>,
        (noise_variance, angle): (f64, f64),
        data: &'a DrivenSegment<'a>,
        drive_slope: &'a [f64],
        filter: &FilterSettings,
        found: &[Crossing],
    ) -> Result<Self, AugmentationError> {
        let mut crossings: Vec<(usize, Told)> =
            found.iter().filter_map(|crossing| told(crossing, filter.threshold, data)).collect();
        crossings.retain(|(sample, _)| *sample < data.time_s.len());
        crossings.sort_by_key(|(sample, _)| *sample);
        let motion = DrivenCourse::new(plant, noise_variance, data)?;
        Ok(Self {
            motion,
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
    fn cross<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        k: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        let first = self.crossings.partition_point(|(sample, _)| *sample < k);
        let last = self.crossings.partition_point(|(sample, _)| *sample <= k);
        for i in first..last {
            let Told { taken, judged } = self.crossings[i].1;
            let (process, nodes) = self.back_to(judged.time_s, k)?;
            let noise = Covariance::from_variances([judged.angle_variance + LEAST_VARIANCE]);
            let angle = AngleThen { process: &process, nodes: &nodes, late: self.late(judged) };
            let judgement = filter.update_where(&angle, &[self.angle], &noise, &Gate { nis: NEVER })?;
            self.log_likelihood += judgement.log_likelihood();
            let Some(threshold) = &self.threshold else { continue };
            let (process, nodes) = self.back_to(taken.time_s, k)?;
            let variance = match threshold.angle_sd {
                Some(sd) => sd * sd,
                None => taken.angle_variance + LEAST_VARIANCE,
            };
            let angle = AngleThen { process: &process, nodes: &nodes, late: self.late(taken) };
            let noise = Covariance::from_variances([variance]);
            let policy = Gate { nis: threshold.gate_nis };
            let innovation = filter.update_where(&angle, &[threshold.angle], &noise, &policy)?;
            counts.crossings += 1;
            counts.crossings_refused += usize::from(!innovation.taken);
        }
        Ok(())
    }

    /// The state that says how much more feedthrough there is than was taken off the signal before it was looked at, and
    /// by how many s one of it makes a crossing seem too late: R_s·δC_ft·dV/dt over the rise of the signal.
    fn late(&self, crossing: Instant) -> Option<(usize, f64)> {
        let (state, scale) = self.plant.feedthrough_state()?;
        let times = self.data.time_s;
        let nearest = times.partition_point(|t| *t < crossing.time_s).min(times.len() - 1);
        let seconds = self.plant.feedthrough().0 * scale * self.drive_slope[nearest] / crossing.volts_per_s;
        seconds.is_finite().then_some((state, seconds))
    }

    /// The steps from a sample back to a time.
    #[allow(clippy::type_complexity)] // a step, and the drive over each
    fn back_to(
        &self,
        time_s: f64,
        k: usize,
    ) -> Result<(<MirrorPlant<A> as Plant<N>>::Process, Vec<Nodes<f64>>), FilterError> {
        let now_s = self.data.time_s[k];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small count
        let steps = ((now_s - time_s).abs() / STEP_BACK_S).ceil().max(1.0) as usize;
        let step_s = (time_s - now_s) / steps as f64;
        // It could be made for the usual interval.
        let process = self.plant.over(step_s).map_err(|_| FilterError::NonFiniteState)?;
        let volts = |halves: usize| {
            let at_s = now_s + 0.5 * step_s * halves as f64;
            let times = self.data.time_s;
            let to = times.partition_point(|t| *t < at_s).clamp(1, times.len() - 1);
            cubic_between(times, |i| self.data.drive.sample(i).0, to, at_s)
        };
        let nodes = (0..steps).map(|i| Nodes {
            start: volts(2 * i),
            middle: volts(2 * i + 1),
            end: volts(2 * i + 2),
        });
        Ok((process, nodes.collect()))
    }
}

/// The sample at which a filter is told of a crossing, or could be, and when it was.
fn told(
    crossing: &Crossing,
    threshold: Option<ThresholdSettings>,
    data: &DrivenSegment,
) -> Option<(usize, Told)> {
    // A time that rounding puts behind a sample is that sample's.
    let sample_at = |time_s: f64| data.time_s.partition_point(|t| *t < time_s - 1e-6 * data.interval_s);
    let taken = crossing.at(threshold.map_or(Timing::default(), |threshold| threshold.timing))?;
    let judged = crossing.at(Timing::default()).unwrap_or(taken);
    let sample = match threshold.map(|threshold| (threshold.applied, threshold.lag_s)) {
        None | Some((Applied::Late, None)) => crossing.known_at,
        Some((Applied::Late, Some(lag_s))) => sample_at(taken.time_s + lag_s),
        Some((Applied::InPlace, _)) => sample_at(taken.time_s),
    };
    Some((sample, Told { taken, judged }))
}

impl<const A: usize, const N: usize> Course<N> for ThresholdCourse<'_, A, N> {
    type Measurement = <MirrorPlant<A> as Plant<N>>::Readout;

    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn measurement(&self) -> (&Self::Measurement, f64) {
        self.motion.measurement()
    }

    /// Σ ln p(θ_th | what came before) over the crossings.
    fn conclude(&self, trajectory: &mut Trajectory) {
        trajectory.crossings_log_likelihood = self.log_likelihood;
    }

    fn advance<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        self.motion.advance(filter, to, counts)
    }

    fn correct<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        k: usize,
        counts: &mut Counts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        self.cross(filter, k, counts)?;
        let y = self.data.signal[k];
        let bends = !self.drive_slope[k].is_finite();
        counts.drive_bends += usize::from(bends);
        if !y.is_finite() || bends {
            return Ok(None);
        }
        let (readout, variance) = self.motion.measurement();
        let (resistance, capacitance) = self.plant.feedthrough();
        let fed = Feedthrough {
            readout,
            current_gain: resistance * self.drive_slope[k],
            capacitance,
            state: self.plant.feedthrough_state(),
        };
        let seen = AsWanted { readout: fed, printed: self.variant == Variant::Literal };
        let update = |filter: &mut F, variance: f64, nis: f64| {
            filter.update_where(&seen, &[y], &Covariance::from_variances([variance]), &Gate { nis })
        };
        // What is not taken, or not taken at its worth, is predicted all the same, so that every filter's innovations are of
        // the same signal.
        if self.variant == Variant::TimingOnly {
            return update(filter, variance, NEVER).map(Some);
        }
        if self.signal_variance == variance {
            return update(filter, variance, f64::INFINITY).map(Some);
        }
        let mut judgement = update(filter, variance, NEVER)?;
        judgement.taken = update(filter, self.signal_variance, f64::INFINITY)?.taken;
        Ok(Some(judgement))
    }
}

/// A readout by its derivative, or by [0, h(θ), …] as Table 4.1 of Chen, dissertation, 2018, prints it.
struct AsWanted<H> {
    readout: H,
    printed: bool,
}

impl<H: Measurement<f64, N, 1>, const N: usize> Measurement<f64, N, 1> for AsWanted<H> {
    fn predict<S: Over<f64>>(&self, x: &[S; N]) -> [S; 1] {
        self.readout.predict(x)
    }

    #[inline(never)]
    fn linearize(&self, x: &[f64; N]) -> ([f64; 1], Mat<f64, 1, N>) {
        let (y, mut jacobian) = self.readout.linearize(x);
        if self.printed {
            jacobian.0[0][0] = 0.0;
        }
        (y, jacobian)
    }
}

/// The angle that the present state had at a crossing: the motion taken back along the drive.
///
/// For a mirror that swings freely its derivative by angle and rate is the first row of Φ(−τ).
struct AngleThen<'a, P> {
    process: &'a P,
    nodes: &'a [Nodes<f64>],
    /// The state that makes the crossing seem late, and by how many s one of it does.
    late: Option<(usize, f64)>,
}

impl<P: Process<f64, N, Input = Nodes<f64>>, const N: usize> Measurement<f64, N, 1> for AngleThen<'_, P> {
    #[inline(never)]
    fn predict<S: Over<f64>>(&self, x: &[S; N]) -> [S; 1] {
        let then = self.nodes.iter().fold(*x, |x, nodes| self.process.step(&x, nodes));
        [match self.late {
            Some((state, seconds)) => then[0] - then[1] * x[state] * seconds,
            None => then[0],
        }]
    }
}

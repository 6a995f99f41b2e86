//! The models that the filters run on: how a driven device steps over any interval, and how it is read.

use super::SegmentDrive;
use super::parameters::{ParameterIndices, ParameterStep};
use crate::estimate::{DeviceParameter, MeasurementSensor, ProcessTransition, Sensor, Tracked, Transition};
use kalmems_core::augmentation::{AugmentationError, ParametricDynamics, ParametricProcess};
use kalmems_core::{Dual, Dynamics, Etdrk4, Euler, Measurement, Nodes, NoiseDensity, Parameters, Process};

/// A device as a filter sees it.
pub trait Plant {
    /// What is made once for an interval.
    type Motion;

    /// The step over an interval. Where it can be made for one interval, it can for every other.
    fn over(&self, interval_s: f64) -> Result<Self::Motion, AugmentationError>;

    /// This step under a drive.
    fn under<'a>(&'a self, motion: &'a Self::Motion, drive: &'a Nodes<f64>) -> impl Transition + 'a;

    /// The readout.
    fn sensor(&self) -> impl Sensor + '_;

    /// Whether shorter steps are closer to the motion: not where a step is exact, or that of a published method.
    fn divides(&self) -> bool {
        true
    }
}

/// A model of `M` states without parameters as states.
pub struct PlainModel<D, H, const M: usize> {
    /// How it moves.
    pub dynamics: D,
    /// How it is read.
    pub readout: H,
    /// The noise of the motion.
    pub noise: NoiseDensity<f64, M>,
}

impl<D, H, const M: usize> Plant for PlainModel<D, H, M>
where
    D: Dynamics<f64, M, Input = f64> + Copy,
    H: Measurement<f64, M, 1>,
{
    type Motion = WholeAndHalf<D, M>;

    fn over(&self, interval_s: f64) -> Result<Self::Motion, AugmentationError> {
        Ok(WholeAndHalf::new(self.dynamics, interval_s, &self.noise))
    }

    fn under<'a>(&'a self, motion: &'a Self::Motion, drive: &'a Nodes<f64>) -> impl Transition + 'a {
        UnderDrive { motion, drive }
    }

    fn sensor(&self) -> impl Sensor + '_ {
        MeasurementSensor::<H, M>(&self.readout)
    }
}

/// One integration step; its linear part and the noise are those of the motion at rest and without a drive.
pub fn step<D: Dynamics<f64, M, Input = f64>, const M: usize>(
    dynamics: D,
    interval_s: f64,
    noise: &NoiseDensity<f64, M>,
) -> Etdrk4<D, f64, M> {
    Etdrk4::new(dynamics, interval_s, noise, (&[0.0; M], &0.0))
}

/// The step over an interval, and that over half of it.
pub struct WholeAndHalf<D, const M: usize> {
    whole: Etdrk4<D, f64, M>,
    half: Etdrk4<D, f64, M>,
}

impl<D: Dynamics<f64, M, Input = f64> + Copy, const M: usize> WholeAndHalf<D, M> {
    fn new(dynamics: D, interval_s: f64, noise: &NoiseDensity<f64, M>) -> Self {
        let whole = step(dynamics, interval_s, noise);
        Self { whole, half: step(dynamics, 0.5 * interval_s, &NoiseDensity::none()) }
    }
}

/// A step of a motion alone under a drive.
struct UnderDrive<'a, D, const M: usize> {
    motion: &'a WholeAndHalf<D, M>,
    drive: &'a Nodes<f64>,
}

impl<D: Dynamics<f64, M, Input = f64>, const M: usize> Transition for UnderDrive<'_, D, M> {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        ProcessTransition::new(&self.motion.whole, self.drive).advance(x, to);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        ProcessTransition::new(&self.motion.whole, self.drive).linearize(x, to, jacobian);
    }

    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        let [first, second] = SegmentDrive::nodes_of_halves(self.drive);
        let mut middle = [0.0; M];
        ProcessTransition::new(&self.motion.half, &first).advance(x, &mut middle);
        ProcessTransition::new(&self.motion.half, &second).advance(&middle, to);
        true
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        ProcessTransition::new(&self.motion.whole, self.drive).noise(covariance, root);
    }
}

/// A model by Euler's method, with the noise of one sample as that of the exact step: what some published filters run on.
pub struct ByEuler<D, H, const M: usize>(pub PlainModel<D, H, M>);

impl<D, H, const M: usize> Plant for ByEuler<D, H, M>
where
    D: Dynamics<f64, M, Input = f64> + Copy,
    H: Measurement<f64, M, 1>,
{
    type Motion = Euler<D, f64, M>;

    fn over(&self, interval_s: f64) -> Result<Self::Motion, AugmentationError> {
        let Self(plain) = self;
        let noise = *step(plain.dynamics, interval_s, &plain.noise).noise().covariance();
        Ok(Euler::new(plain.dynamics, interval_s, noise))
    }

    /// Of the drive it sees the start of the interval alone.
    fn under<'a>(&'a self, motion: &'a Self::Motion, drive: &'a Nodes<f64>) -> impl Transition + 'a {
        ProcessTransition::new(motion, &drive.start)
    }

    fn sensor(&self) -> impl Sensor + '_ {
        MeasurementSensor::<H, M>(&self.0.readout)
    }

    fn divides(&self) -> bool {
        false
    }
}

/// A model of `M` states with parameters as states behind them, and a readout that may depend on all of these.
pub struct WithParameters<D, R, const M: usize> {
    dynamics: D,
    readout: R,
    noise: NoiseDensity<f64, M>,
    places: ParameterIndices,
}

impl<D: Parameters<f64>, R, const M: usize> WithParameters<D, R, M> {
    /// These parameters as states of the motion; `place` says where each enters it.
    pub fn new(
        (dynamics, noise): (D, NoiseDensity<f64, M>),
        readout: R,
        tracked: &[Tracked],
        place: fn(&DeviceParameter) -> Option<&'static str>,
    ) -> Result<Self, AugmentationError> {
        Ok(Self { places: ParameterIndices::of::<D>(tracked, place)?, dynamics, readout, noise })
    }
}

/// One step of such a model: that of its motion, and of its parameters.
pub struct MotionStep<D, const M: usize> {
    process: WholeAndHalf<D, M>,
    parameters: ParameterStep,
}

impl<D, R, const M: usize> Plant for WithParameters<D, R, M>
where
    D: ParametricDynamics<f64, M, Input = f64> + Copy,
    R: Sensor,
{
    type Motion = MotionStep<D, M>;

    fn over(&self, interval_s: f64) -> Result<Self::Motion, AugmentationError> {
        let process = WholeAndHalf::new(self.dynamics, interval_s, &self.noise);
        Ok(MotionStep { process, parameters: self.places.over(interval_s) })
    }

    fn under<'a>(&'a self, motion: &'a Self::Motion, drive: &'a Nodes<f64>) -> impl Transition + 'a {
        DrivenStep { plant: self, motion, drive }
    }

    fn sensor(&self) -> impl Sensor + '_ {
        BorrowedSensor(&self.readout)
    }
}

/// A sensor that is another one's.
struct BorrowedSensor<'a, R>(&'a R);

impl<R: Sensor> Sensor for BorrowedSensor<'_, R> {
    fn read(&self, x: &[f64]) -> f64 {
        self.0.read(x)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        self.0.linearize(x, slopes)
    }
}

/// A step under a drive.
struct DrivenStep<'a, D, R, const M: usize> {
    plant: &'a WithParameters<D, R, M>,
    motion: &'a MotionStep<D, M>,
    drive: &'a Nodes<f64>,
}

impl<D, R, const M: usize> DrivenStep<'_, D, R, M>
where
    D: ParametricDynamics<f64, M, Input = f64> + Copy,
{
    /// The model with the parameters of these states.
    #[inline]
    fn model(&self, x: &[f64]) -> D::Of<f64> {
        let places = &self.plant.places;
        self.plant.dynamics.map(|parameter, nominal| places.varied(parameter, nominal, &x[M..]).2)
    }

    /// Where the states of the motion go, with the derivatives by the states from `first` on.
    #[inline(never)]
    fn columns<const W: usize>(&self, x: &[f64], first: usize, to: &mut [f64], jacobian: &mut [f64]) {
        let states = std::array::from_fn(|i| variable::<W>(first, i, x[i], 1.0));
        let model = self.plant.dynamics.map(|parameter, nominal| {
            let (i, scale, value) = self.plant.places.varied(parameter, nominal, &x[M..]);
            variable::<W>(first, M + i, value, scale)
        });
        let moved = self.motion.process.whole.step_of(&model, &states, self.drive);
        for (i, moved) in moved.into_iter().enumerate() {
            to[i] = moved.value();
            let row = &mut jacobian[i * x.len()..(i + 1) * x.len()];
            for (entry, slope) in row[first..].iter_mut().zip(moved.gradient()) {
                *entry = slope;
            }
        }
    }
}

/// The states of the motion, of all.
#[inline]
fn of_motion<const M: usize>(x: &[f64]) -> [f64; M] {
    std::array::from_fn(|i| x[i])
}

/// A number that goes with state `i` by this slope, where the derivatives are by the states from `first` on.
#[inline]
fn variable<const W: usize>(first: usize, i: usize, value: f64, slope: f64) -> Dual<f64, W> {
    Dual::new(value, std::array::from_fn(|k| if first + k == i { slope } else { 0.0 }))
}

/// Derivatives that are computed at once: by all states of a motion with two parameters, and by twice as many.
const FEW: usize = 4;
const MANY: usize = 8;

impl<D, R, const M: usize> Transition for DrivenStep<'_, D, R, M>
where
    D: ParametricDynamics<f64, M, Input = f64> + Copy,
{
    #[inline(never)]
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        let moved = self.motion.process.whole.step_of(&self.model(x), &of_motion(x), self.drive);
        to[..M].copy_from_slice(&moved);
        self.motion.parameters.advance(M, x, to);
    }

    #[inline(never)]
    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        let (model, half) = (self.model(x), &self.motion.process.half);
        let [first, second] = SegmentDrive::nodes_of_halves(self.drive);
        let middle = half.step_of(&model, &of_motion(x), &first);
        to[..M].copy_from_slice(&half.step_of(&model, &middle, &second));
        self.motion.parameters.advance(M, x, to);
        true
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        let (states, mut first) = (x.len(), 0);
        while first < states {
            if states - first <= FEW {
                self.columns::<FEW>(x, first, to, jacobian);
                first += FEW;
            } else {
                self.columns::<MANY>(x, first, to, jacobian);
                first += MANY;
            }
        }
        self.motion.parameters.advance(M, x, to);
        self.motion.parameters.linearize(M, states, jacobian);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        self.motion.parameters.noise((self.motion.process.whole.noise(), M), covariance, root);
    }

    fn moving(&self, _: usize) -> usize {
        M
    }
}

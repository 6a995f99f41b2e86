//! The models that the filters run on: how the scanner steps over any interval, and how it is read.

use super::filters::{FilterSettings, Parameter, Tracked};
use super::settings::Hardware;
use kalmems_core::augmentation::{
    AddedState, AugmentationError, Augmented, AugmentedMeasurement, Drift, ParametricDynamics,
};
use kalmems_core::{
    Dynamics, Euler, Mat, Measurement, Nodes, NoiseDensity, Over, Parameters, Process, ProcessNoise, Rk4,
};
use kalmems_models::dynamics::{DriveGain, ParametricScanner};
use kalmems_models::readout::{AngleBefore, DelayedComb, LowPassedComb};

/// A scanner of `N` states as a filter sees it.
pub trait Plant<const N: usize> {
    /// One step.
    type Process: Process<f64, N, Input = Nodes<f64>>;
    /// How the signal depends on the state.
    type Readout: Measurement<f64, N, 1>;

    /// The step over an interval. Where it can be made for one interval, it can for every other.
    fn over(&self, interval_s: f64) -> Result<Self::Process, AugmentationError>;

    /// The readout.
    fn readout(&self) -> &Self::Readout;
}

/// A model without parameters as states.
pub struct Plain<D, H, const M: usize> {
    /// How it moves.
    pub dynamics: D,
    /// How it is read.
    pub readout: H,
    /// The noise of the motion.
    pub noise: NoiseDensity<f64, M>,
}

impl<D, H, const M: usize> Plant<M> for Plain<D, H, M>
where
    D: Dynamics<f64, M, Input = f64> + Copy,
    H: Measurement<f64, M, 1>,
{
    type Process = Rk4<D, f64, M>;
    type Readout = H;

    fn over(&self, interval_s: f64) -> Result<Rk4<D, f64, M>, AugmentationError> {
        Ok(step(self.dynamics, interval_s, &self.noise))
    }

    fn readout(&self) -> &H {
        &self.readout
    }
}

/// One integration step; the noise is discretised for the motion at rest and without a drive.
fn step<D: Dynamics<f64, M, Input = f64>, const M: usize>(
    dynamics: D,
    interval_s: f64,
    noise: &NoiseDensity<f64, M>,
) -> Rk4<D, f64, M> {
    Rk4::new(dynamics, interval_s, noise, (&[0.0; M], &0.0))
}

/// The noise of one axis's angular acceleration.
fn of_acceleration<const M: usize>(density: f64) -> NoiseDensity<f64, M> {
    NoiseDensity::none().on::<1>(density)
}

/// Angle and rate, read by the affine law.
pub fn affine(
    hardware: &Hardware,
    filter: &FilterSettings,
) -> Plain<ParametricScanner<f64>, DelayedComb<f64>, 2> {
    let noise = of_acceleration(filter.acceleration_density);
    Plain { dynamics: hardware.scanner, readout: hardware.late_readout(), noise }
}

/// The scanner behind the low-pass stages with these corners in rad/s.
pub fn low_passed(hardware: &Hardware, poles: [f64; 2]) -> LowPassedComb<f64> {
    LowPassedComb {
        device: DriveGain { scanner: hardware.scanner, drive_gain: 1.0 },
        before: AngleBefore::of(hardware.delay_s, &hardware.scanner.resonator),
        gain: hardware.readout.gain,
        offset: hardware.readout.offset,
        poles,
    }
}

/// Angle, rate and the two stages.
pub fn staged(
    hardware: &Hardware,
    filter: &FilterSettings,
    poles: [f64; 2],
) -> Plain<LowPassedComb<f64>, LowPassedComb<f64>, 4> {
    let model = low_passed(hardware, poles);
    Plain { dynamics: model, readout: model, noise: of_acceleration(filter.acceleration_density) }
}

/// A model of `M` states with `A` parameters as states behind them.
pub struct WithParameters<D, H, const M: usize, const A: usize> {
    dynamics: D,
    readout: H,
    noise: NoiseDensity<f64, M>,
    added: [AddedState<f64>; A],
    enters: [Option<&'static str>; A],
}

impl<D, H, const M: usize, const A: usize, const N: usize> Plant<N> for WithParameters<D, H, M, A>
where
    D: ParametricDynamics<f64, M, Input = f64> + Copy,
    H: Measurement<f64, N, 1>,
{
    type Process = Augmented<Rk4<D, f64, M>, f64, M, A, N>;
    type Readout = H;

    fn over(&self, interval_s: f64) -> Result<Self::Process, AugmentationError> {
        let process = step(self.dynamics, interval_s, &self.noise);
        Augmented::new(process, &self.added, self.enters)
    }

    fn readout(&self) -> &H {
        &self.readout
    }
}

/// A model of `M` states, and a readout of them that knows the first `A` of these parameters too.
pub type Augmentation<D, H, const M: usize, const A: usize> =
    WithParameters<D, AugmentedMeasurement<H, f64, M, A>, M, A>;

impl<D, H: Parameters<f64>, const M: usize, const A: usize> Augmentation<D, H, M, A> {
    /// The first `A` of these parameters as states.
    pub fn of(plain: Plain<D, H, M>, tracked: &[Tracked]) -> Result<Self, AugmentationError> {
        let added = added(tracked);
        let enters = of_parameters(tracked, |parameter| parameter.in_readout);
        Ok(Self {
            dynamics: plain.dynamics,
            readout: AugmentedMeasurement::new(plain.readout, &added, enters)?,
            noise: plain.noise,
            added,
            enters: of_parameters(tracked, |parameter| parameter.in_motion),
        })
    }
}

/// Angle and rate with `A` parameters, read by the affine law.
pub fn affine_with<const A: usize>(
    hardware: &Hardware,
    filter: &FilterSettings,
) -> Result<Augmentation<DriveGain<f64>, DelayedComb<f64>, 2, A>, AugmentationError> {
    let dynamics = DriveGain { scanner: hardware.scanner, drive_gain: 1.0 };
    let noise = of_acceleration(filter.acceleration_density);
    Augmentation::of(Plain { dynamics, readout: hardware.late_readout(), noise }, &filter.basics.tracked)
}

/// Angle, rate and the two stages with `A` parameters.
pub fn staged_with<const A: usize>(
    hardware: &Hardware,
    filter: &FilterSettings,
    poles: [f64; 2],
) -> WithParameters<LowPassedComb<f64>, LowPassedComb<f64>, 4, A> {
    let model = low_passed(hardware, poles);
    WithParameters {
        dynamics: model,
        readout: model,
        noise: of_acceleration(filter.acceleration_density),
        added: added(&filter.basics.tracked),
        enters: of_parameters(&filter.basics.tracked, |parameter| parameter.in_stages),
    }
}

/// The scale and drift of each parameter.
fn added<const A: usize>(tracked: &[Tracked]) -> [AddedState<f64>; A] {
    let none = AddedState { scale: 1.0, drift: Drift::RandomWalk { density: 0.0 } };
    std::array::from_fn(|i| tracked.get(i).map_or(none, |tracked| tracked.added))
}

/// Where each parameter enters.
fn of_parameters<const A: usize>(
    tracked: &[Tracked],
    place: fn(&Parameter) -> Option<&'static str>,
) -> [Option<&'static str>; A] {
    std::array::from_fn(|i| tracked.get(i).and_then(|tracked| place(tracked.parameter)))
}

/// The scanner by Euler's method, as published, with the noise of one sample as that of the exact step.
pub struct Published {
    scanner: ParametricScanner<f64>,
    readout: DelayedComb<f64>,
    acceleration_density: f64,
}

impl Published {
    /// Angle and rate.
    pub fn new(hardware: &Hardware, filter: &FilterSettings) -> Self {
        Self {
            scanner: hardware.scanner,
            readout: hardware.late_readout(),
            acceleration_density: filter.acceleration_density,
        }
    }
}

impl Plant<2> for Published {
    type Process = FromStart;
    type Readout = DelayedComb<f64>;

    fn over(&self, interval_s: f64) -> Result<FromStart, AugmentationError> {
        let noise = of_acceleration(self.acceleration_density);
        let noise = *step(self.scanner, interval_s, &noise).noise().covariance();
        Ok(FromStart(Euler::new(self.scanner, interval_s, noise)))
    }

    fn readout(&self) -> &DelayedComb<f64> {
        &self.readout
    }
}

/// Euler's step: of the drive it sees the start of the interval alone.
pub struct FromStart(Euler<ParametricScanner<f64>, f64, 2>);

impl Process<f64, 2> for FromStart {
    type Input = Nodes<f64>;

    fn step<S: Over<f64>>(&self, x: &[S; 2], drive: &Nodes<f64>) -> [S; 2] {
        self.0.step(x, &drive.start)
    }

    fn noise(&self) -> &ProcessNoise<f64, 2> {
        self.0.noise()
    }

    fn linearize(&self, x: &[f64; 2], drive: &Nodes<f64>) -> ([f64; 2], Mat<f64, 2, 2>) {
        self.0.linearize(x, &drive.start)
    }
}

//! The models that the filters run on: how a device steps over any interval, and how it is read.

use crate::estimate::{Parameter, Tracked};
use kalmems_core::augmentation::{
    AddedState, AugmentationError, Augmented, AugmentedMeasurement, Drift, ParametricDynamics,
};
use kalmems_core::{Dynamics, Measurement, Nodes, NoiseDensity, Parameters, Process, Rk4};

/// A device of `N` states as a filter sees it.
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
pub fn step<D: Dynamics<f64, M, Input = f64>, const M: usize>(
    dynamics: D,
    interval_s: f64,
    noise: &NoiseDensity<f64, M>,
) -> Rk4<D, f64, M> {
    Rk4::new(dynamics, interval_s, noise, (&[0.0; M], &0.0))
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

impl<D, H, const M: usize, const A: usize> WithParameters<D, H, M, A> {
    /// The first `A` of these parameters as states of a readout that knows them; `place` says where each enters the motion.
    pub fn new(
        plain: Plain<D, H, M>,
        tracked: &[Tracked],
        place: fn(&Parameter) -> Option<&'static str>,
    ) -> Self {
        Self {
            dynamics: plain.dynamics,
            readout: plain.readout,
            noise: plain.noise,
            added: added(tracked),
            enters: of_parameters(tracked, place),
        }
    }
}

impl<D, H: Parameters<f64>, const M: usize, const A: usize> Augmentation<D, H, M, A> {
    /// The first `A` of these parameters as states.
    pub fn of(plain: Plain<D, H, M>, tracked: &[Tracked]) -> Result<Self, AugmentationError> {
        let enters = of_parameters(tracked, |parameter| parameter.in_readout);
        let Plain { dynamics, readout, noise } = plain;
        let readout = AugmentedMeasurement::new(readout, &added(tracked), enters)?;
        Ok(Self::new(Plain { dynamics, readout, noise }, tracked, |parameter| parameter.in_motion))
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

//! The models that the filters run on: how the stage steps over any interval, and how an electrode reads it.

use super::course::StageChannel;
use super::filters::StageFilterSettings;
use crate::estimate::driven::{ParametricReadout, PlainModel, Plant, WithParameters};
use crate::estimate::{MeasurementSensor, ProcessTransition, Sensor, Tracked, Transition};
use kalmems_core::augmentation::{AddedState, AugmentationError};
use kalmems_core::{LinearProcess, Nodes, NoiseDensity};
use kalmems_models::dynamics::PiezoStage;
use kalmems_models::readout::PlateCurrent;
use std::array;

/// The stage, read by one electrode.
pub type StagePlant = PlainModel<PiezoStage<f64>, PlateCurrent<f64>, 2>;

/// The stage under white angular acceleration, read by one channel.
pub fn stage(dynamics: PiezoStage<f64>, filter: &StageFilterSettings, channel: &StageChannel) -> StagePlant {
    PlainModel { dynamics, readout: channel.current, noise: NoiseDensity::none().on::<1>(filter.density) }
}

/// The stage by its exact step, under a drive that is held at what it is in the middle of the interval.
pub struct ExactStageStep(pub StagePlant);

impl Plant for ExactStageStep {
    type Motion = LinearProcess<f64, 2, 1>;

    fn over(&self, interval_s: f64) -> Result<Self::Motion, AugmentationError> {
        Ok(self.0.dynamics.exact(interval_s, self.0.noise.get(1, 1)))
    }

    fn under<'a>(&'a self, motion: &'a Self::Motion, drive: &'a Nodes<f64>) -> impl Transition + 'a {
        ProcessTransition::new(motion, array::from_ref(&drive.middle))
    }

    fn sensor(&self) -> impl Sensor + '_ {
        MeasurementSensor::<_, 2>(&self.0.readout)
    }

    fn divides(&self) -> bool {
        false
    }
}

/// The stage with parameters as states.
pub fn with_parameters(
    stage: &StagePlant,
    tracked: &[Tracked],
) -> Result<WithParameters<PiezoStage<f64>, ParametricReadout<PlateCurrent<f64>, 2>, 2>, AugmentationError> {
    let tracked = of_channel(stage, tracked);
    let readout = ParametricReadout::new(stage.readout, &tracked, |parameter| parameter.in_readout)?;
    WithParameters::new((stage.dynamics, stage.noise), readout, &tracked, |parameter| parameter.in_motion)
}

/// The parameters with the scales of this channel: gaps and gains of all electrodes are off by the same ratio, as by a
/// temperature or a bias voltage that all have in common.
pub fn of_channel(stage: &StagePlant, tracked: &[Tracked]) -> Vec<Tracked> {
    let scaled = |tracked: &Tracked| {
        let scale = tracked.parameter.scale(&stage.dynamics, &stage.readout);
        Tracked { added: AddedState { scale, ..tracked.added }, ..*tracked }
    };
    tracked.iter().map(scaled).collect()
}

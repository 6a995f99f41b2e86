//! The model that the filters run on.

use super::filters::{FEEDTHROUGH, ThresholdFilterSettings};
use super::hardware::ThresholdHardware;
use crate::estimate::driven::{
    ByEuler, ParametricReadout, PlainModel, Plant, WithParameters, combinations, shifted,
};
use crate::estimate::{DeviceParameter, Sensor, Tracked, Transition};
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Nodes, NoiseDensity};
use kalmems_models::dynamics::CombDrivenMirror;
use kalmems_models::readout::CurrentReadout;

/// Angle and rate.
pub type Mirror = PlainModel<CombDrivenMirror<f64>, CurrentReadout<f64>, 2>;

/// Angle and rate with parameters as states behind them.
type MirrorWithParameters =
    WithParameters<CombDrivenMirror<f64>, ParametricReadout<CurrentReadout<f64>, 2>, 2>;

/// The noise of the angular acceleration.
fn noise(filter: &ThresholdFilterSettings) -> NoiseDensity<f64, 2> {
    NoiseDensity::none().on::<1>(filter.acceleration_density)
}

/// The mirror alone, by Euler's method.
pub fn by_euler(
    hardware: &ThresholdHardware,
    filter: &ThresholdFilterSettings,
) -> ByEuler<CombDrivenMirror<f64>, CurrentReadout<f64>, 2> {
    ByEuler(PlainModel { dynamics: hardware.mirror, readout: hardware.readout, noise: noise(filter) })
}

/// The mirror, and what its drive adds to the signal.
pub struct MirrorPlant {
    mirror: MirrorWithParameters,
    /// R_s in Ω and C_ft in F.
    feedthrough: (f64, f64),
    /// The state that is the deviation of C_ft, and its scale in F.
    feedthrough_state: Option<(usize, f64)>,
}

impl MirrorPlant {
    /// The device as a filter sees it.
    pub fn new(
        hardware: &ThresholdHardware,
        filter: &ThresholdFilterSettings,
    ) -> Result<Self, AugmentationError> {
        Self::with(hardware, filter, filter.basics.parameters())
    }

    /// The device with each of the parameters of a bank as stated, and off by its deviation to both sides.
    pub fn side_by_side(
        hardware: &ThresholdHardware,
        filter: &ThresholdFilterSettings,
    ) -> Result<Vec<Self>, AugmentationError> {
        let tracked = filter.basics.tracked.as_slice();
        let one = |shifts: Vec<f64>| {
            let by = (tracked, &shifts[..]);
            let through = |parameter: &DeviceParameter| (parameter.name == FEEDTHROUGH).then_some("");
            let varied = ThresholdHardware {
                mirror: shifted(&hardware.mirror, by, |parameter| parameter.in_motion),
                readout: shifted(&hardware.readout, by, |parameter| parameter.in_readout),
                feedthrough: shifted(&hardware.feedthrough, by, through),
                ..*hardware
            };
            Self::with(&varied, filter, &[])
        };
        combinations(tracked).into_iter().map(one).collect()
    }

    fn with(
        hardware: &ThresholdHardware,
        filter: &ThresholdFilterSettings,
        tracked: &[Tracked],
    ) -> Result<Self, AugmentationError> {
        let readout = ParametricReadout::new(hardware.readout, tracked, |parameter| parameter.in_readout)?;
        let motion = (hardware.mirror, noise(filter));
        let feedthrough = tracked.iter().position(|tracked| tracked.parameter.name == FEEDTHROUGH);
        Ok(Self {
            mirror: MirrorWithParameters::new(motion, readout, tracked, |parameter| parameter.in_motion)?,
            feedthrough: (hardware.feedback_resistance, hardware.feedthrough),
            feedthrough_state: feedthrough.map(|i| (2 + i, tracked[i].added.scale)),
        })
    }

    /// R_s in Ω and C_ft in F.
    pub fn feedthrough(&self) -> (f64, f64) {
        self.feedthrough
    }

    /// The state that is the deviation of C_ft, and its scale in F.
    pub fn feedthrough_state(&self) -> Option<(usize, f64)> {
        self.feedthrough_state
    }
}

impl Plant for MirrorPlant {
    type Motion = <MirrorWithParameters as Plant>::Motion;

    /// The step of a motion that is resolved; below 0 it leads back.
    fn over(&self, interval_s: f64) -> Result<Self::Motion, AugmentationError> {
        self.mirror.over(interval_s)
    }

    fn under<'a>(&'a self, motion: &'a Self::Motion, drive: &'a Nodes<f64>) -> impl Transition + 'a {
        self.mirror.under(motion, drive)
    }

    fn sensor(&self) -> impl Sensor + '_ {
        self.mirror.sensor()
    }
}

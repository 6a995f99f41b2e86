//! The model that the filters run on.

use super::filters::{FEEDTHROUGH, FilterSettings};
use super::hardware::Hardware;
use crate::estimate::driven::{Augmentation, Plain, Plant};
use kalmems_core::NoiseDensity;
use kalmems_core::augmentation::AugmentationError;
use kalmems_models::dynamics::CombDrivenMirror;
use kalmems_models::readout::CurrentReadout;

/// Angle and rate with `A` parameters as states behind them.
type Mirror<const A: usize> = Augmentation<CombDrivenMirror<f64>, CurrentReadout<f64>, 2, A>;

/// The mirror, and what its drive adds to the signal.
pub struct MirrorPlant<const A: usize> {
    mirror: Mirror<A>,
    /// R_s in Ω and C_ft in F.
    feedthrough: (f64, f64),
    /// The state that is the deviation of C_ft, and its scale in F.
    feedthrough_state: Option<(usize, f64)>,
}

impl<const A: usize> MirrorPlant<A> {
    /// The device as a filter sees it.
    pub fn new(hardware: &Hardware, filter: &FilterSettings) -> Result<Self, AugmentationError> {
        let tracked = &filter.basics.tracked;
        let noise = NoiseDensity::none().on::<1>(filter.acceleration_density);
        let plain = Plain { dynamics: hardware.mirror, readout: hardware.readout, noise };
        let feedthrough = tracked.iter().position(|tracked| tracked.parameter.name == FEEDTHROUGH);
        Ok(Self {
            mirror: Mirror::of(plain, tracked)?,
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

impl<const A: usize, const N: usize> Plant<N> for MirrorPlant<A> {
    type Process = <Mirror<A> as Plant<N>>::Process;
    type Readout = <Mirror<A> as Plant<N>>::Readout;

    /// The step of a motion that is resolved; below 0 it leads back.
    fn over(&self, interval_s: f64) -> Result<Self::Process, AugmentationError> {
        Plant::<N>::over(&self.mirror, interval_s)
    }

    fn readout(&self) -> &Self::Readout {
        Plant::<N>::readout(&self.mirror)
    }
}

//! The model that the filters run on.

use super::filters::{FEEDTHROUGH, FilterSettings, Parameter};
use super::hardware::Hardware;
use crate::rigs::shared_scanner::plant::Plant;
use kalmems_core::augmentation::{AddedState, AugmentationError, Augmented, AugmentedMeasurement, Drift};
use kalmems_core::{NoiseDensity, Rk4};
use kalmems_models::dynamics::CombDrivenMirror;
use kalmems_models::readout::CurrentReadout;

/// Angle and rate with `A` parameters as states behind them.
pub struct MirrorPlant<const A: usize> {
    mirror: CombDrivenMirror<f64>,
    readout: AugmentedMeasurement<CurrentReadout<f64>, f64, 2, A>,
    acceleration_density: f64,
    added: [AddedState<f64>; A],
    enters: [Option<&'static str>; A],
    /// R_s in Ω and C_ft in F.
    feedthrough: (f64, f64),
    /// The state that is the deviation of C_ft, and its scale in F.
    feedthrough_state: Option<(usize, f64)>,
}

impl<const A: usize> MirrorPlant<A> {
    /// The device as a filter sees it.
    pub fn new(hardware: &Hardware, filter: &FilterSettings) -> Result<Self, AugmentationError> {
        let none = AddedState { scale: 1.0, drift: Drift::RandomWalk { density: 0.0 } };
        let added = std::array::from_fn(|i| filter.tracked.get(i).map_or(none, |tracked| tracked.added));
        let place = |place: fn(&Parameter) -> Option<&'static str>| {
            std::array::from_fn(|i| filter.tracked.get(i).and_then(|tracked| place(tracked.parameter)))
        };
        let feedthrough = filter.tracked.iter().position(|tracked| tracked.parameter.name == FEEDTHROUGH);
        Ok(Self {
            mirror: hardware.mirror,
            readout: AugmentedMeasurement::new(
                hardware.readout,
                &added,
                place(|parameter| parameter.in_readout),
            )?,
            acceleration_density: filter.acceleration_density,
            added,
            enters: place(|parameter| parameter.in_motion),
            feedthrough: (hardware.feedback_resistance, hardware.feedthrough),
            feedthrough_state: feedthrough.map(|i| (2 + i, filter.tracked[i].added.scale)),
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
    type Process = Augmented<Rk4<CombDrivenMirror<f64>, f64, 2>, f64, 2, A, N>;
    type Readout = AugmentedMeasurement<CurrentReadout<f64>, f64, 2, A>;

    /// The step of a motion that is resolved; below 0 it leads back.
    fn over(&self, interval_s: f64) -> Result<Self::Process, AugmentationError> {
        let noise = NoiseDensity::none().on::<1>(self.acceleration_density);
        let process = Rk4::new(self.mirror, interval_s, &noise, (&[0.0; 2], &0.0));
        Augmented::new(process, &self.added, self.enters)
    }

    fn readout(&self) -> &Self::Readout {
        &self.readout
    }
}

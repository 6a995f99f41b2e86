//! The models that the filters run on: how the scanner steps over any interval, and how it is read.

use super::filters::FilterSettings;
use super::settings::Hardware;
use crate::estimate::driven::{OfMotion, ParametricReadout, Plain, Plant, WithParameters, step};
use crate::estimate::{Reading, Sensor, Step, Transition};
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Euler, Mat, Nodes, NoiseDensity, Over, Process, ProcessNoise};
use kalmems_models::dynamics::{DriveGain, ParametricScanner};
use kalmems_models::readout::{AngleBefore, DelayedComb, LowPassedComb};

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

/// The scanner with the factor of its drive as a parameter, and the noise of its motion.
pub fn drive_gain(hardware: &Hardware, filter: &FilterSettings) -> (DriveGain<f64>, NoiseDensity<f64, 2>) {
    let dynamics = DriveGain { scanner: hardware.scanner, drive_gain: 1.0 };
    (dynamics, of_acceleration(filter.acceleration_density))
}

/// Angle and rate with parameters, read by the affine law.
pub fn affine_with(
    hardware: &Hardware,
    filter: &FilterSettings,
) -> Result<WithParameters<DriveGain<f64>, ParametricReadout<DelayedComb<f64>, 2>, 2>, AugmentationError> {
    let tracked = &filter.basics.tracked;
    let readout = ParametricReadout::new(hardware.late_readout(), tracked, |parameter| parameter.in_readout)?;
    WithParameters::new(drive_gain(hardware, filter), readout, tracked, |parameter| parameter.in_motion)
}

/// Angle, rate and the two stages with parameters.
pub fn staged_with(
    hardware: &Hardware,
    filter: &FilterSettings,
    poles: [f64; 2],
) -> Result<WithParameters<LowPassedComb<f64>, OfMotion<LowPassedComb<f64>, 4>, 4>, AugmentationError> {
    let model = low_passed(hardware, poles);
    let tracked = &filter.basics.tracked;
    let noise = of_acceleration(filter.acceleration_density);
    WithParameters::new((model, noise), OfMotion(model), tracked, |parameter| parameter.in_whole)
}

/// The scanner by Euler's method, with the noise of one sample as that of the exact step.
pub struct ByEuler {
    scanner: ParametricScanner<f64>,
    readout: DelayedComb<f64>,
    acceleration_density: f64,
}

impl ByEuler {
    /// Angle and rate.
    pub fn new(hardware: &Hardware, filter: &FilterSettings) -> Self {
        Self {
            scanner: hardware.scanner,
            readout: hardware.late_readout(),
            acceleration_density: filter.acceleration_density,
        }
    }
}

impl Plant for ByEuler {
    type Motion = FromStart;

    fn over(&self, interval_s: f64) -> Result<FromStart, AugmentationError> {
        let noise = of_acceleration(self.acceleration_density);
        let noise = *step(self.scanner, interval_s, &noise).noise().covariance();
        Ok(FromStart(Euler::new(self.scanner, interval_s, noise)))
    }

    fn under<'a>(&'a self, motion: &'a FromStart, drive: &'a Nodes<f64>) -> impl Transition + 'a {
        Step::new(motion, drive)
    }

    fn sensor(&self) -> impl Sensor + '_ {
        Reading::<_, 2>(&self.readout)
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

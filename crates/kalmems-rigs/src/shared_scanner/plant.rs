//! The models that the filters run on: how the scanner steps over any interval, and how it is read.

use super::filters::ScannerFilterSettings;
use super::settings::ScannerHardware;
use crate::estimate::DeviceParameter;
use crate::estimate::driven::{OfMotion, ParametricReadout, PlainModel, WithParameters, side_by_side};
use kalmems_core::NoiseDensity;
use kalmems_core::augmentation::AugmentationError;
use kalmems_models::dynamics::{DriveGain, ParametricScanner};
use kalmems_models::readout::{AngleBefore, DelayedComb, LowPassedComb};

/// The noise of one axis's angular acceleration.
fn of_acceleration<const M: usize>(density: f64) -> NoiseDensity<f64, M> {
    NoiseDensity::none().on::<1>(density)
}

/// Angle and rate, read by the affine law.
pub fn affine(
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
) -> PlainModel<ParametricScanner<f64>, DelayedComb<f64>, 2> {
    let noise = of_acceleration(filter.acceleration_density);
    PlainModel { dynamics: hardware.scanner, readout: hardware.late_readout(), noise }
}

/// The scanner behind the low-pass stages with these corners in rad/s.
pub fn low_passed(hardware: &ScannerHardware, poles: [f64; 2]) -> LowPassedComb<f64> {
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
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
    poles: [f64; 2],
) -> PlainModel<LowPassedComb<f64>, LowPassedComb<f64>, 4> {
    let model = low_passed(hardware, poles);
    PlainModel { dynamics: model, readout: model, noise: of_acceleration(filter.acceleration_density) }
}

/// The scanner with the factor of its drive as a parameter, and the noise of its motion.
pub fn drive_gain(
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
) -> (DriveGain<f64>, NoiseDensity<f64, 2>) {
    let dynamics = DriveGain { scanner: hardware.scanner, drive_gain: 1.0 };
    (dynamics, of_acceleration(filter.acceleration_density))
}

/// Angle and rate with parameters, read by the affine law.
pub fn affine_with(
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
) -> Result<WithParameters<DriveGain<f64>, ParametricReadout<DelayedComb<f64>, 2>, 2>, AugmentationError> {
    let tracked = &filter.basics.tracked;
    let readout = ParametricReadout::new(hardware.late_readout(), tracked, |parameter| parameter.in_readout)?;
    WithParameters::new(drive_gain(hardware, filter), readout, tracked, |parameter| parameter.in_motion)
}

/// Angle and rate for each of several models, read by the affine law.
pub fn affine_models(
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
) -> Vec<PlainModel<DriveGain<f64>, DelayedComb<f64>, 2>> {
    let (dynamics, noise) = drive_gain(hardware, filter);
    let plain = PlainModel { dynamics, readout: hardware.late_readout(), noise };
    side_by_side(
        &plain,
        &filter.basics.tracked,
        [|parameter| parameter.in_motion, |parameter| parameter.in_readout],
    )
}

/// Angle, rate and the two stages for each of several models.
pub fn staged_models(
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
    poles: [f64; 2],
) -> Vec<PlainModel<LowPassedComb<f64>, LowPassedComb<f64>, 4>> {
    let whole = |parameter: &DeviceParameter| parameter.in_whole;
    side_by_side(&staged(hardware, filter, poles), &filter.basics.tracked, [whole, whole])
}

/// Angle, rate and the two stages with parameters.
pub fn staged_with(
    hardware: &ScannerHardware,
    filter: &ScannerFilterSettings,
    poles: [f64; 2],
) -> Result<WithParameters<LowPassedComb<f64>, OfMotion<LowPassedComb<f64>, 4>, 4>, AugmentationError> {
    let model = low_passed(hardware, poles);
    let tracked = &filter.basics.tracked;
    let noise = of_acceleration(filter.acceleration_density);
    WithParameters::new((model, noise), OfMotion(model), tracked, |parameter| parameter.in_whole)
}

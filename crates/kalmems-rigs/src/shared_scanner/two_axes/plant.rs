//! The models that the filters of two axes run on.

use super::filters::TwoAxisFilterSettings;
use super::hardware::TwoAxisHardware;
use crate::estimate::driven::{ParametricReadout, PlainModel, WithParameters, side_by_side};
use kalmems_core::NoiseDensity;
use kalmems_core::augmentation::AugmentationError;
use kalmems_models::dynamics::{TwoAxisDriveGain, TwoAxisScanner};
use kalmems_models::readout::TwoAxisComb;

/// Both axes, read by the affine law.
pub fn both(
    hardware: &TwoAxisHardware,
    filter: &TwoAxisFilterSettings,
) -> PlainModel<TwoAxisScanner<f64>, TwoAxisComb<f64>, 4> {
    let [of_x, of_y] = filter.acceleration_density;
    let noise = NoiseDensity::none().on::<1>(of_x).on::<3>(of_y);
    PlainModel { dynamics: hardware.scanner, readout: hardware.readout, noise }
}

/// Both axes for each of several models, read by the affine law.
pub fn both_models(
    hardware: &TwoAxisHardware,
    filter: &TwoAxisFilterSettings,
) -> Vec<PlainModel<TwoAxisDriveGain<f64>, TwoAxisComb<f64>, 4>> {
    let PlainModel { dynamics: scanner, readout, noise } = both(hardware, filter);
    let plain = PlainModel { dynamics: TwoAxisDriveGain { scanner, drive_gain: 1.0 }, readout, noise };
    side_by_side(
        &plain,
        &filter.basics.tracked,
        [|parameter| parameter.in_motion, |parameter| parameter.in_readout],
    )
}

/// Both axes with parameters, read by the affine law.
pub fn both_with(
    hardware: &TwoAxisHardware,
    filter: &TwoAxisFilterSettings,
) -> Result<WithParameters<TwoAxisDriveGain<f64>, ParametricReadout<TwoAxisComb<f64>, 4>, 4>, AugmentationError>
{
    let (PlainModel { dynamics: scanner, readout, noise }, tracked) =
        (both(hardware, filter), &filter.basics.tracked);
    let dynamics = TwoAxisDriveGain { scanner, drive_gain: 1.0 };
    let readout = ParametricReadout::new(readout, tracked, |parameter| parameter.in_readout)?;
    WithParameters::new((dynamics, noise), readout, tracked, |parameter| parameter.in_motion)
}

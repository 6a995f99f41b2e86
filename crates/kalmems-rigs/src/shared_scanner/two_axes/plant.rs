//! The models that the filters of two axes run on.

use super::filters::FilterSettings;
use super::hardware::Hardware;
use crate::estimate::driven::{ParametricReadout, Plain, WithParameters};
use kalmems_core::NoiseDensity;
use kalmems_core::augmentation::AugmentationError;
use kalmems_models::dynamics::{TwoAxisDriveGain, TwoAxisScanner};
use kalmems_models::readout::TwoAxisComb;

/// Both axes, read by the affine law.
pub fn both(hardware: &Hardware, filter: &FilterSettings) -> Plain<TwoAxisScanner<f64>, TwoAxisComb<f64>, 4> {
    let [of_x, of_y] = filter.acceleration_density;
    let noise = NoiseDensity::none().on::<1>(of_x).on::<3>(of_y);
    Plain { dynamics: hardware.scanner, readout: hardware.readout, noise }
}

/// Both axes with parameters, read by the affine law.
pub fn both_with(
    hardware: &Hardware,
    filter: &FilterSettings,
) -> Result<WithParameters<TwoAxisDriveGain<f64>, ParametricReadout<TwoAxisComb<f64>, 4>, 4>, AugmentationError>
{
    let (Plain { dynamics: scanner, readout, noise }, tracked) =
        (both(hardware, filter), &filter.basics.tracked);
    let dynamics = TwoAxisDriveGain { scanner, drive_gain: 1.0 };
    let readout = ParametricReadout::new(readout, tracked, |parameter| parameter.in_readout)?;
    WithParameters::new((dynamics, noise), readout, tracked, |parameter| parameter.in_motion)
}

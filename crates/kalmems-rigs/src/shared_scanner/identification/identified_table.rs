//! What was identified, put into the device's table.

use super::{
    RingDownFit, SteadyStateFit,
    unknown::{DAMPING, NOMINAL, STIFFNESS, WIDTH},
};
use crate::config::Experiment;
use crate::fit::DerivedNumber;
use crate::identify::{Entries, IdentifyError};
use crate::shared_scanner::device::SharedScanner;
use kalmems_core::{Covariance, Mat};
use kalmems_models::capacitance::GaussianComb;

/// Keys below the device's table.
const RESONATOR_STIFFNESS: &str = "resonator.stiffness";
const RESONATOR_DAMPING: &str = "resonator.damping";
const COMB_NOMINAL: &str = "comb.nominal_capacitance";
const COMB_WIDTH: &str = "comb.angular_width";
const READOUT_GAIN: &str = "readout.gain";
const READOUT_OFFSET: &str = "readout.offset";
pub const NOISE_VARIANCE: &str = "readout.noise_variance";

/// A parameter known worse than this, relative to itself, is not put into the experiment.
pub const WORTH_SETTING: f64 = 0.1;

/// Whether a parameter of a ring-down is known well enough to be used.
pub fn is_known(fitted: &RingDownFit, index: usize) -> bool {
    let parameter = fitted.fit.parameter(index);
    parameter.deviation < WORTH_SETTING * parameter.value.abs() && !fitted.fit.at_bound[index]
}

pub fn knows_comb(fitted: &RingDownFit) -> bool {
    is_known(fitted, NOMINAL) && is_known(fitted, WIDTH)
}

/// Puts the ring-down's values into the experiment: the comb as it is to be used from here on, and how well C₀ and θ₀
/// of it are known.
pub fn apply_ring_down(
    experiment: &Experiment,
    device: &mut SharedScanner,
    (entries, fitted): (&mut Entries, &RingDownFit),
    before: GaussianComb<f64>,
) -> Result<(GaussianComb<f64>, Covariance<f64, 2>), IdentifyError> {
    let p = &fitted.fit.parameters;
    let c = &fitted.fit.covariance;
    if is_known(fitted, STIFFNESS) {
        let place = (RESONATOR_STIFFNESS, &mut device.resonator.stiffness);
        entries.set(experiment, place, fitted.fit.parameter(STIFFNESS), "N m")?;
    }
    if is_known(fitted, DAMPING) {
        let place = (RESONATOR_DAMPING, &mut device.resonator.damping);
        entries.set(experiment, place, fitted.fit.parameter(DAMPING), "N m s")?;
    }
    if knows_comb(fitted) {
        let place = (COMB_NOMINAL, &mut device.comb.nominal_capacitance);
        entries.set(experiment, place, fitted.fit.parameter(NOMINAL), "F")?;
        let place = (COMB_WIDTH, &mut device.comb.angular_width);
        entries.set(experiment, place, fitted.fit.parameter(WIDTH), "rad")?;
    }
    let (names, places): (Vec<&str>, Vec<usize>) = RING_DOWN.into_iter().unzip();
    entries.correlate_all(&names, &|i, j| c.get(places[i], places[j]));
    if !knows_comb(fitted) {
        return Ok((before, Covariance::zero()));
    }
    let covariance = Covariance::from_lower(Mat([
        [c.get(NOMINAL, NOMINAL), 0.0],
        [c.get(WIDTH, NOMINAL), c.get(WIDTH, WIDTH)],
    ]));
    Ok((GaussianComb { nominal: p[NOMINAL], angular_width: p[WIDTH], bias: before.bias }, covariance))
}

/// What a ring-down tells of the device, by the keys below its table, in the order of the fit.
const RING_DOWN: [(&str, usize); 4] = [
    (RESONATOR_STIFFNESS, STIFFNESS),
    (RESONATOR_DAMPING, DAMPING),
    (COMB_NOMINAL, NOMINAL),
    (COMB_WIDTH, WIDTH),
];

/// Puts the gain and the offset of the circuit into the experiment: their errors have those of the comb in them. So does the
/// comb's width, where the steady state tells it.
pub fn apply_steady_state(
    experiment: &Experiment,
    device: &mut SharedScanner,
    entries: &mut Entries,
    (fitted, ring_down, width): (&SteadyStateFit, Option<&RingDownFit>, Option<DerivedNumber>),
) -> Result<(), IdentifyError> {
    if let Some(width) = width {
        entries.set(experiment, (COMB_WIDTH, &mut device.comb.angular_width), width, "rad")?;
    }
    entries.set(experiment, (READOUT_GAIN, &mut device.readout.gain), fitted.gain, "V/F")?;
    entries.set(experiment, (READOUT_OFFSET, &mut device.readout.offset), fitted.offset, "V")?;
    let [by_gain, by_offset] = fitted.by_comb;
    let of_comb = |i: usize, j: usize| match (ring_down, width) {
        (Some(found), _) => found.fit.covariance.get(i, j),
        (None, Some(width)) if i == WIDTH && j == WIDTH => width.deviation * width.deviation,
        _ => 0.0,
    };
    // How the error of a sum over C₀ and θ₀ hangs together with that of a number of the ring-down.
    let with = |by: [f64; 2], other: usize| by[0] * of_comb(NOMINAL, other) + by[1] * of_comb(WIDTH, other);
    let both = fitted.affine.covariance.get(0, 1)
        + by_gain[0] * with(by_offset, NOMINAL)
        + by_gain[1] * with(by_offset, WIDTH);
    let [gain_sd, offset_sd] = [fitted.gain.deviation, fitted.offset.deviation];
    entries.correlate(READOUT_GAIN, READOUT_OFFSET, both / (gain_sd * offset_sd));
    for (name, other) in RING_DOWN {
        let sd = of_comb(other, other).sqrt();
        entries.correlate(READOUT_GAIN, name, with(by_gain, other) / (gain_sd * sd));
        entries.correlate(READOUT_OFFSET, name, with(by_offset, other) / (offset_sd * sd));
    }
    Ok(())
}

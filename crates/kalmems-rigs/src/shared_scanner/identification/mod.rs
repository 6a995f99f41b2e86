//! The scanner's parameters from its recordings.
//!
//! | role | channels | what it says |
//! |---|---|---|
//! | `ring_down` | `current_signal`: V_o1, the transimpedance stage's output in V, from the switch to the bias on | k, b, C₀, θ₀ |
//! | `steady_state` | `signal`: the demodulated signal in V; `drive` may stand beside it | gain and offset, poles |
//! | `zero_drive` | `signal`, without motion; `drive` may stand beside it | the noise's variance |
//!
//! A reference with the channel `angle` is used where a recording has one; the steady state needs it.

mod amplitude;
mod figures;
mod ring_down;
mod settings;
mod steady_state;
mod words;

pub use amplitude::gain_ambiguity;
pub use ring_down::{RingDown, RingDownError, RingDownFit, fit_ring_down, integrated_capacitance, unknown};
pub use settings::RingDownSettings;
pub use steady_state::{PolesFit, SteadyState, SteadyStateFit, fit_steady_state};

use super::settings::Hardware;
use crate::config::kinds::KindOf;
use crate::config::{Experiment, Fault, Quantity, Role, SignOf};
use crate::evaluate::{Instruments, ReferenceChannels};
use crate::identify::{Identification, IdentifyError, Material};
use crate::progress::Progress;
use crate::shared_scanner::device::SharedScanner;
use crate::units::kind;
use kalmems_core::{Covariance, Mat};
use kalmems_models::capacitance::GaussianComb;
use unknown::{DAMPING, NOMINAL, STIFFNESS, WIDTH};

/// Identifies what the recordings' roles allow.
pub fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
    let hardware = Hardware::of(experiment)?;
    let reference = ReferenceChannels::one_angle(Instruments::default());
    let channel = |role, name, also: &[&str]| {
        Material::of_role(experiment, role, (name, &kind::VOLTAGE), also, &reference, progress)
    };
    let mut found = Identification {
        rig: "shared_scanner",
        parameters: Vec::new(),
        undetermined: Vec::new(),
        worst_pairs: Vec::new(),
        warnings: Vec::new(),
        notes: Vec::new(),
        figures: Vec::new(),
        experiment: experiment.clone(),
        materials: Vec::new(),
    };
    let decay = channel(Role::RingDown, "current_signal", &[])?;
    let steady = channel(Role::SteadyState, "signal", &["drive"])?;
    let still = Material::still_of_role(
        experiment,
        Role::ZeroDrive,
        ("signal", &kind::VOLTAGE),
        &["drive"],
        progress,
    )?;
    if decay.is_none() && steady.is_none() && still.is_none() {
        let why = "no recording has the role `ring_down`, `steady_state` or `zero_drive`; parameters are identified \
                   from those";
        return Err(experiment.error("recording", Fault::Value { why: why.to_owned() }).into());
    }
    let mut device = (*experiment.device::<SharedScanner>()?).clone();

    let mut comb = (hardware.scanner.comb, Covariance::zero());
    match decay {
        Some(material) => {
            let settings = RingDownSettings::of(experiment)?;
            let record = RingDown {
                interval_s: material.interval_s,
                signal: &material.signal,
                angle: &material.angle,
                scanner: hardware.scanner,
                bias: settings.bias,
                gain: settings.feedback_resistance * settings.bias,
            };
            let fitted = fit_ring_down(&record).map_err(|error| match error {
                RingDownError::Fit(source) => IdentifyError::Fit { recording: material.name.clone(), source },
                RingDownError::Shooting(error) => error.into(),
                error => material.unfit(error.to_string()),
            })?;
            words::ring_down(&mut found, &material, &record, &fitted);
            figures::ring_down(&mut found, &material, &record, &fitted);
            comb = apply_ring_down(experiment, &mut device, &fitted, comb.0)?;
            found.materials.push(material);
        }
        None => words::no_ring_down(&mut found),
    }
    stop(progress)?;
    match steady {
        Some(material) if material.angle.iter().any(|a| a.is_finite()) => {
            let angle = steady_state::before(&material.time_s, &material.angle, hardware.delay_s);
            let record = SteadyState {
                time_s: &material.time_s,
                interval_s: material.interval_s,
                signal: &material.signal,
                angle: &angle,
                comb: comb.0,
                comb_covariance: comb.1,
            };
            let fitted = fit_steady_state(&record)
                .ok_or_else(|| {
                    material.unfit("the reference shows no motion to fit the signal to".to_owned())
                })?
                .map_err(|source| IdentifyError::Fit { recording: material.name.clone(), source })?;
            words::steady_state(&mut found, &material, &record, &fitted);
            figures::steady_state(&mut found, &material, &record, &fitted);
            set(experiment, &mut device.readout.gain, fitted.gain.value, "V/F")?;
            set(experiment, &mut device.readout.offset, fitted.offset.value, "V")?;
            found.materials.push(material);
        }
        other => words::no_reference(&mut found, other.as_ref(), comb.0.angular_width),
    }
    stop(progress)?;
    match still {
        Some((material, fitted)) => {
            let fitted = fitted.ok_or_else(|| {
                let why = "fewer than 32 samples, or none that varies; there is no noise to see";
                material.unfit(why.to_owned())
            })?;
            words::still(&mut found, &material, &fitted);
            figures::still(&mut found, &material, &fitted);
            set(experiment, &mut device.readout.noise_variance, fitted.variance, "V^2")?;
            found.materials.push(material);
        }
        None => words::no_still(&mut found),
    }
    for material in &found.materials {
        found.notes.extend(material.diagnosis.iter().map(|finding| format!("{}: {finding}", material.name)));
    }
    found.experiment.set_device(device);
    Ok(found)
}

fn stop(progress: &dyn Progress) -> Result<(), IdentifyError> {
    if progress.reached(0).is_break() { Err(IdentifyError::Interrupted) } else { Ok(()) }
}

/// Puts an identified value into the experiment.
fn set<K: KindOf, S: SignOf>(
    experiment: &Experiment,
    place: &mut Quantity<K, S>,
    value: f64,
    unit: &str,
) -> Result<(), IdentifyError> {
    *place = Quantity::of(value, unit)
        .map_err(|why| experiment.error("device.shared_scanner", Fault::Value { why }))?;
    Ok(())
}

/// A parameter known worse than this, relative to itself, is not put into the experiment.
const WORTH_SETTING: f64 = 0.1;

/// Whether a parameter of a ring-down is known well enough to be used.
fn is_known(fitted: &RingDownFit, index: usize) -> bool {
    let parameter = fitted.fit.parameter(index);
    parameter.deviation < WORTH_SETTING * parameter.value.abs() && !fitted.fit.at_bound[index]
}

/// Puts the ring-down's values into the experiment: the comb as it is to be used from here on, and how well C₀ and θ₀
/// of it are known.
fn apply_ring_down(
    experiment: &Experiment,
    device: &mut SharedScanner,
    fitted: &RingDownFit,
    before: GaussianComb<f64>,
) -> Result<(GaussianComb<f64>, Covariance<f64, 2>), IdentifyError> {
    let p = &fitted.fit.parameters;
    if is_known(fitted, STIFFNESS) {
        set(experiment, &mut device.resonator.stiffness, p[STIFFNESS], "N m")?;
    }
    if is_known(fitted, DAMPING) {
        set(experiment, &mut device.resonator.damping, p[DAMPING], "N m s")?;
    }
    if !(is_known(fitted, NOMINAL) && is_known(fitted, WIDTH)) {
        return Ok((before, Covariance::zero()));
    }
    set(experiment, &mut device.comb.nominal_capacitance, p[NOMINAL], "F")?;
    set(experiment, &mut device.comb.angular_width, p[WIDTH], "rad")?;
    let c = &fitted.fit.covariance;
    let covariance = Covariance::from_lower(Mat([
        [c.get(NOMINAL, NOMINAL), 0.0],
        [c.get(WIDTH, NOMINAL), c.get(WIDTH, WIDTH)],
    ]));
    Ok((GaussianComb { nominal: p[NOMINAL], angular_width: p[WIDTH], bias: before.bias }, covariance))
}

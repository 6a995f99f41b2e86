//! The scanner's parameters from its recordings.
//!
//! | role | channels | what it says |
//! |---|---|---|
//! | `ring_down` | `current_signal`: V_o1, the transimpedance stage's output in V, from the switch to the bias on; `bias`, the voltage on the electrodes, may stand beside it | k, b, C₀, θ₀ |
//! | `steady_state` | `signal`: the demodulated signal in V; `drive` may stand beside it | gain and offset, poles; θ₀ where no ring-down tells it |
//! | `zero_drive` | `signal`, without motion; `drive` may stand beside it | the noise's variance |
//!
//! A reference with the channel `angle` is used where a recording has one; the steady state needs it.

mod amplitude;
mod figures;
mod identified_table;
mod messages;
mod ring_down;
mod settings;
mod steady_state;

pub use amplitude::gain_ambiguity;
pub use ring_down::{RingDown, RingDownError, RingDownFit, fit_ring_down, integrated_capacitance, unknown};
pub use settings::RingDownSettings;
pub use steady_state::{PolesFit, SteadyState, SteadyStateFit, fit_steady_state, fit_width};

use super::settings::ScannerHardware;
use crate::config::{ConfigFault, Experiment, RecordingRole};
use crate::evaluate::{Instruments, ReferenceChannels};
use crate::identify::{Entries, Identification, IdentifyError, Material, exact};
use crate::progress::Progress;
use crate::shared_scanner::device::SharedScanner;
use crate::units::kind;
use identified_table::{NOISE_VARIANCE, WORTH_SETTING, apply_ring_down, apply_steady_state, knows_comb};
use kalmems_core::{Covariance, Mat};
use kalmems_figures::number;

/// Identifies what the recordings' roles allow.
#[allow(clippy::too_many_lines)] // one role of recordings after the other
pub fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
    let hardware = ScannerHardware::of(experiment)?;
    let reference = ReferenceChannels::one_angle(Instruments::default());
    let channel = |role, name, also: &[&str]| {
        Material::of_role(experiment, role, (name, &kind::VOLTAGE), also, &reference, progress)
    };
    let mut found = Identification::begun("shared_scanner", experiment);
    let decay = channel(RecordingRole::RingDown, CURRENT, &[RECORDED_BIAS])?;
    let steady = channel(RecordingRole::SteadyState, "signal", &["drive"])?;
    let still = Material::still_of_role(
        experiment,
        RecordingRole::ZeroDrive,
        ("signal", &kind::VOLTAGE),
        &["drive"],
        progress,
    )?;
    if decay.is_none() && steady.is_none() && still.is_none() {
        let why = "no recording has the role `ring_down`, `steady_state` or `zero_drive`; parameters are identified \
                   from those, or from any moving recording where `[identify]` names them, such as `parameters = [\"resonator.stiffness\"]`";
        return Err(experiment.error("recording", ConfigFault::Value { why: why.to_owned() }).into());
    }
    let mut device = (*experiment.device::<SharedScanner>()?).clone();

    let mut entries = Entries::default();
    let mut ring_down = None;
    let mut comb = (hardware.scanner.comb, Covariance::zero());
    match decay {
        Some(material) => {
            let mut settings = RingDownSettings::of(experiment)?;
            if let Some(bias) = recorded_bias(experiment, progress)? {
                messages::recorded_bias(&mut found, &material, (settings.bias, bias));
                settings.bias = bias;
            }
            let record = ring_down_of(&hardware, &material, &settings);
            let fitted = decay_of(&record, &material, progress)?;
            messages::ring_down(&mut found, &material, &record, &fitted);
            figures::ring_down(&mut found, &material, &record, &fitted);
            comb = apply_ring_down(experiment, &mut device, (&mut entries, &fitted), comb.0)?;
            ring_down = Some(fitted);
            found.materials.push(material);
        }
        None => messages::no_recording(&mut found, messages::RING_DOWN),
    }
    stop(progress)?;
    match steady {
        Some(material) if material.angle.iter().any(|a| a.is_finite()) => {
            let angle = steady_state::before(&material.time_s, &material.angle, hardware.delay_s);
            let mut record = SteadyState {
                time_s: &material.time_s,
                interval_s: material.interval_s,
                signal: &material.signal,
                angle: &angle,
                comb: comb.0,
                comb_covariance: comb.1,
            };
            let fit = |record: &SteadyState| {
                let found = fit_steady_state(record, progress).ok_or_else(|| {
                    material.unfit("the reference shows no motion to fit the signal to".to_owned())
                })?;
                found.map_err(|source| IdentifyError::Fit { recording: material.name.clone(), source })
            };
            let mut fitted = fit(&record)?;
            let used = ring_down.as_ref().filter(|found| knows_comb(found));
            // A lag of the demodulator makes a loop of the line, which another width would make narrower as well.
            let width = if used.is_none() && fitted.poles.is_none() { fit_width(&record) } else { None };
            let width = width.filter(|width| width.deviation < WORTH_SETTING * width.value);
            if let Some(width) = width {
                record.comb.angular_width = width.value;
                let variance = width.deviation * width.deviation;
                record.comb_covariance = Covariance::from_lower(Mat([[0.0, 0.0], [0.0, variance]]));
                fitted = fit(&record)?;
            }
            messages::steady_state(&mut found, &material, &record, &fitted);
            messages::steady_state_width(&mut found, &material, width);
            figures::steady_state(&mut found, &material, &record, &fitted);
            apply_steady_state(experiment, &mut device, &mut entries, (&fitted, used, width))?;
            found.materials.push(material);
        }
        other => messages::no_reference(&mut found, other.as_ref(), comb.0.angular_width),
    }
    stop(progress)?;
    match still {
        Some((material, fitted)) => {
            let fitted = fitted.ok_or_else(|| {
                let why = "fewer than 32 samples, or none that varies; there is no noise to see";
                material.unfit(why.to_owned())
            })?;
            messages::still(&mut found, &material, &fitted);
            figures::still(&mut found, &material, &fitted);
            let place = (NOISE_VARIANCE, &mut device.readout.noise_variance);
            entries.set(experiment, place, exact(fitted.variance), "V^2")?;
            found.materials.push(material);
        }
        None => messages::no_recording(&mut found, messages::STILL),
    }
    for material in &found.materials {
        found.notes.extend(material.diagnosis.iter().map(|finding| format!("{}: {finding}", material.name)));
    }
    found.experiment.set_device(device);
    entries.write(&mut found.experiment);
    Ok(found)
}

/// The channels of a ring-down: the transimpedance stage's output, and the voltage on the electrodes where that was recorded.
const CURRENT: &str = "current_signal";
const RECORDED_BIAS: &str = "bias";

/// The mean of the bias voltage, where the ring-down has a channel of it.
fn recorded_bias(experiment: &Experiment, progress: &dyn Progress) -> Result<Option<f64>, IdentifyError> {
    let mut of_role =
        experiment.recordings.iter().filter(|recording| recording.role == RecordingRole::RingDown);
    if of_role.next().is_none_or(|recording| recording.channels.column(RECORDED_BIAS).is_none()) {
        return Ok(None);
    }
    let known = ReferenceChannels::one_angle(Instruments::default());
    let column = (RECORDED_BIAS, &kind::VOLTAGE);
    let Some(material) =
        Material::of_role(experiment, RecordingRole::RingDown, column, &[CURRENT], &known, progress)?
    else {
        return Ok(None);
    };
    let finite = || material.signal.iter().filter(|volts| volts.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    if mean == 0.0 || !mean.is_finite() {
        return Err(material.unfit(
            "its channel `bias` shows no voltage; name the column of the voltage on the electrodes"
                .to_owned(),
        ));
    }
    Ok(Some(mean))
}

fn stop(progress: &dyn Progress) -> Result<(), IdentifyError> {
    if progress.reached(0).is_break() { Err(IdentifyError::Interrupted) } else { Ok(()) }
}

fn ring_down_of<'a>(
    hardware: &ScannerHardware,
    material: &'a Material,
    settings: &RingDownSettings,
) -> RingDown<'a> {
    RingDown {
        interval_s: material.interval_s,
        signal: &material.signal,
        angle: &material.angle,
        scanner: hardware.scanner,
        bias: settings.bias,
        gain: settings.feedback_resistance * settings.bias,
    }
}

/// A fit is clearly better than another whose residuals are so many times as large.
const CLEARLY: f64 = 1.5;

/// The fit of a ring-down. Where it leaves residuals that are not white, a signal of the other sign is tried as well.
fn decay_of(
    record: &RingDown,
    material: &Material,
    progress: &dyn Progress,
) -> Result<RingDownFit, IdentifyError> {
    let found = fit_ring_down(record, progress);
    if !found.as_ref().is_ok_and(|fit| fit.whiteness[0].is_white())
        && let Ok(turned) = fit_ring_down(&RingDown { gain: -record.gain, ..*record }, progress)
        && found.as_ref().map_or(f64::INFINITY, |fit| fit.deviations[0]) > CLEARLY * turned.deviations[0]
    {
        return Err(material.unfit(format!(
            "its signal has the opposite sign of V_o1 = R_f·V·dC/dt with the stated resistance and bias: an amplifier that inverts has a \
             negative resistance; write `feedback_resistance = \"{} ohm\"`",
            number(-record.gain / record.bias)
        )));
    }
    found.map_err(|error| match error {
        RingDownError::Fit(source) => IdentifyError::Fit { recording: material.name.clone(), source },
        RingDownError::Shooting(error) => error.into(),
        error => material.unfit(error.to_string()),
    })
}

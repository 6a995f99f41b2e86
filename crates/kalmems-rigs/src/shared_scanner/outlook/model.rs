//! Which measurement model a filter needs for the circuit that the file describes.

use super::super::circuit::{SensingCircuit, density_asked, not_reduced};
use super::super::settings::{ScannerHardware, state_at};
use crate::circuit::{Adequacy, CircuitKnowledge, Cost};
use crate::config::{ConfigError, Experiment};
use crate::outlook::OutlookTopic;
use crate::shared_scanner::device::SharedScanner;
use crate::simulate::Drive;

/// What the circuit is to a filter, and what each simpler model costs in phase; `None` where the file
/// describes no circuit.
pub fn of_the_circuit(
    experiment: &Experiment,
    hardware: &ScannerHardware,
    drive: Option<&Drive>,
) -> Result<Option<OutlookTopic>, ConfigError> {
    if experiment.device::<SharedScanner>()?.circuit.is_none() {
        return Ok(None);
    }
    let topic = OutlookTopic::new("What a filter has to know of the circuit");
    let (Some(simulate), Some(drive)) = (&experiment.simulate, drive) else {
        let why = "that is computed for the drive and the start of a simulation; add the table `[simulate]`";
        return Ok(Some(topic.with("circuit", [], sentence(&not_reduced(&why)))));
    };
    let start = state_at(experiment, "simulate.start", &simulate.start)?;
    let density = density_asked(experiment)?;
    let adequacy = match SensingCircuit::of(experiment, simulate, drive) {
        Ok(circuit) => circuit.adequacy(hardware, (drive, start), density).map_err(|why| not_reduced(&why)),
        Err(why) => Err(not_reduced(&why)),
    };
    Ok(Some(match adequacy {
        Ok(adequacy) => facts(topic, hardware, &adequacy),
        Err(why) => topic.with("circuit", [], sentence(&why)),
    }))
}

/// The statement as facts, each with its numbers.
fn facts(topic: OutlookTopic, hardware: &ScannerHardware, adequacy: &Adequacy) -> OutlookTopic {
    let Adequacy { amplitude_deg, motion_hz, reduced, setting, .. } = adequacy;
    let model = reduced.with_poles_and_delay;
    let [first, second] = reduced.poles_hz;
    let lag_deg = reduced.affine.lag_deg;
    let of_poles_deg = lag_deg - reduced.with_poles.lag_deg;
    let mut topic = topic
        .with(
            "model_v_per_f_v_hz_hz_s_residual",
            [model.gain, model.offset, first, second, reduced.front_delay_s, model.residual],
            format!("At {amplitude_deg:.2}° and {:.3} kHz the circuit is {reduced}.", motion_hz / 1e3),
        )
        .with(
            "lag_and_share_of_poles_deg",
            [lag_deg, of_poles_deg],
            format!("Its signal is {lag_deg:.1}° of the motion late, of which the poles explain {of_poles_deg:.1}°."),
        );
    for (known, name, words) in [
        (CircuitKnowledge::Affine, "cost_of_affine_deg", "y = a·C + b alone"),
        (CircuitKnowledge::Poles, "cost_of_poles_deg", "the poles as states"),
        (CircuitKnowledge::PolesAndDelay, "cost_of_poles_and_delay_deg", "the poles as states and the delay"),
    ] {
        let cost @ Cost { phase_deg, amplitude_deg, angle_rmse_deg } = *adequacy.cost(known);
        let verdict = if adequacy.is_adequate(known) { "adequate" } else { "not adequate" };
        topic = topic.with(
            name,
            [phase_deg, amplitude_deg, angle_rmse_deg],
            format!(
                "A filter of q = {:.0e} rad²/s³ with {words} is wrong by {cost}: {verdict}.",
                setting.acceleration_density
            ),
        );
    }
    let delay_us = reduced.front_delay_s * 1e6;
    let poles = format!(
        "`poles = [\"{:.1} kHz\", \"{:.1} kHz\"]` in the readout and `demodulator = true` in the filter",
        first / 1e3,
        second / 1e3
    );
    let stated = match hardware.delay_s {
        0.0 => "states no delay".to_owned(),
        delay_s => format!("says {:.2} µs", delay_s * 1e6),
    };
    let permitted = setting.permitted_phase_deg;
    let needed = match adequacy.needed() {
        Some(CircuitKnowledge::Affine) => format!("y = a·C + b will do ({permitted}° permitted)."),
        Some(CircuitKnowledge::Poles) => format!("The poles are needed ({permitted}° permitted): {poles}."),
        Some(CircuitKnowledge::PolesAndDelay) => format!(
            "Poles and delay are needed ({permitted}° permitted): {poles}, and `delay = \"{delay_us:.2} us\"` (the file {stated})."
        ),
        None => format!("None of these will do ({permitted}° permitted); another detector or high-pass may."),
    };
    topic.with("permitted_phase_deg", [permitted], needed)
}

/// With a capital and a full stop.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().chain(letters).chain(['.']).collect())
}

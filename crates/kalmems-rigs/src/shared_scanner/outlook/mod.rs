//! What can be said of a scanner and its drive before anything is recorded.

mod driven;
mod model;
mod observability;

use super::regulation::expected_drive;
use super::settings::ScannerHardware;
use crate::config::Experiment;
use crate::outlook::{AmplitudeDeviations, Outlook, OutlookTopic, Recorded};
use crate::simulate::{Drive, SimulateError};
use driven::Driven;
pub use observability::CycleBound;
use std::f64::consts::TAU;

/// Device, drive and what the signal will tell, before what the equations say.
pub fn outlook(experiment: &Experiment, of_equations: Outlook) -> Result<Outlook, SimulateError> {
    let hardware = ScannerHardware::of(experiment)?;
    let stated =
        experiment.simulate.as_ref().map(|simulate| expected_drive(experiment, simulate)).transpose()?;
    // What the simulation says counts; a recording shows its own.
    let recorded = if experiment.simulate.is_none() { Recorded::of(experiment) } else { Recorded::default() };
    let simulated_hz = experiment.simulate.as_ref().map(|simulate| simulate.sampling_rate.si());
    let drive = stated.or(recorded.drive);
    let mut topics = vec![device(&hardware)];
    if let Some(Drive::Sine { offset, amplitude, frequency_hz, .. }) = &drive
        && experiment.simulate.is_none()
    {
        topics.push(OutlookTopic::new("Recorded drive").with(
            "recorded_drive_v_v_hz",
            [*offset, *amplitude, *frequency_hz],
            format!(
                "The beginning of `{}` shows a drive of {offset:.4} V with a sine of {amplitude:.4} V at {:.4} kHz.",
                recorded.file,
                frequency_hz / 1e3
            ),
        ));
    }
    let driven = drive.as_ref().map(|drive| Driven::of(&hardware, drive));
    match &driven {
        Some(driven) => topics.extend(driven.topics.iter().cloned()),
        None => topics.push(OutlookTopic::new("Drive").with(
            "drive",
            [],
            "Neither the experiment nor the beginning of a recording shows a steady drive: add the table `[simulate]` with one, \
             such as `[simulate.drive.sine]`.",
        )),
    }
    let (rate, is_given) = simulated_hz.or(recorded.rate_hz).map_or((1e6, false), |rate| (rate, true));
    let own = driven.as_ref().and_then(|driven| driven.amplitude);
    topics.push(signal(&hardware, own, drive.as_ref(), rate, is_given));
    topics.extend(model::of_the_circuit(experiment, &hardware, drive.as_ref())?);
    topics.extend(of_equations.topics);
    let amplitudes = (4..=80).map(|k| (0.25 * f64::from(k)).to_radians());
    Ok(Outlook {
        information: amplitudes
            .map(|amplitude| {
                let bound =
                    CycleBound::of(&hardware.readout, hardware.noise_variance, amplitude, 1e-3 * rate);
                let CycleBound { phase_sd, amplitude_sd, amplitude_sd_free, .. } = bound;
                AmplitudeDeviations { amplitude, phase_sd, amplitude_sd, amplitude_sd_free }
            })
            .collect(),
        response: driven.as_ref().and_then(|driven| driven.response.clone()),
        start: driven.and_then(|driven| driven.start),
        ..Outlook::of(experiment, of_equations.device, topics)
    })
}

fn device(hardware: &ScannerHardware) -> OutlookTopic {
    let (scanner, resonator) = (&hardware.scanner, &hardware.scanner.resonator);
    let rate = resonator.natural_rate();
    let per_square_volt = -0.5 * scanner.comb.curvature_at_rest();
    let quality = resonator.inertia * rate / resonator.damping;
    let decay_s = 2.0 * resonator.inertia / resonator.damping;
    let shift = rate / TAU * 0.5 * per_square_volt / resonator.stiffness;
    let topic = OutlookTopic::new("Device")
        .with(
            "mechanical_resonance_hz",
            [rate / TAU],
            format!("Resonance without any voltage {:.3} kHz.", rate / TAU / 1e3),
        )
        .with(
            "quality_and_decay_s",
            [quality, decay_s],
            format!("Q {quality:.1}; left alone, a motion falls to 1/e in {:.3} ms.", 1e3 * decay_s),
        )
        .with(
            "electrostatic_stiffness_n_m_per_v2",
            [per_square_volt],
            format!(
                "At rest the electrodes add {per_square_volt:.3e} N·m/rad per V² of mean square: {:.2} Hz per 1000 V². \
                 They pull less the farther the mirror tilts, so that the resonance falls with the amplitude.",
                1e3 * shift
            ),
        );
    let carrier = scanner.carrier_mean_square;
    topic.with(
        "resonance_with_carrier_hz",
        [rate / TAU + shift * carrier],
        format!(
            "The carrier's mean square of {carrier:.3} V² raises the resonance by {:.3} Hz.",
            shift * carrier
        ),
    )
}

fn signal(
    hardware: &ScannerHardware,
    own: Option<f64>,
    drive: Option<&Drive>,
    rate: f64,
    is_given: bool,
) -> OutlookTopic {
    let resonance = hardware.scanner.resonator.natural_rate() / TAU;
    let motion_hz = drive.and_then(Drive::period_s).map_or(resonance, |period| {
        // A drive near the resonance moves it at its own frequency, one at twice the resonance at half of it.
        let ratio = (2.0 * resonance * period).round().max(1.0);
        0.5 * ratio / period
    });
    let of = if is_given { "" } else { " (taken for this; neither the file nor a recording says a rate)" };
    let mut topic = OutlookTopic::new("What the signal determines").with(
        "sign",
        [],
        "The sign of the motion is not observable at any amplitude: with θ also −θ moves the device and reads the same. \
         It is calibrated: `estimate.first_peak`.",
    );
    topic = topic.with(
        "basis",
        [rate, motion_hz],
        format!(
            "Least standard deviations from the signal alone at {:.3} MHz{of} with {:.1} mV of noise per sample, for a \
             steady motion of {:.3} kHz, without any knowledge of the model:",
            rate / 1e6,
            1e3 * hardware.noise_variance.sqrt(),
            motion_hz / 1e3
        ),
    );
    let bound = |amplitude: f64, samples: f64| {
        CycleBound::of(&hardware.readout, hardware.noise_variance, amplitude, samples)
    };
    for amplitude in own.into_iter().chain([6.0, 9.0, 15.0].map(f64::to_radians)) {
        let (cycle, ms) = (bound(amplitude, rate / motion_hz), bound(amplitude, 1e-3 * rate));
        let degrees = [
            amplitude,
            cycle.phase_sd,
            ms.phase_sd,
            cycle.amplitude_sd,
            ms.amplitude_sd,
            ms.amplitude_sd_free,
        ]
        .map(f64::to_degrees);
        let [at, phase_cycle, phase_ms, amplitude_cycle, amplitude_ms, free_ms] = degrees;
        let (cost, worth) = (ms.cost_of_freeing(), ms.worthwhile_gain_error());
        topic = topic.with(
            "bounds_deg",
            [at, phase_cycle, phase_ms, amplitude_cycle, amplitude_ms, free_ms, cost, worth],
            format!(
                "at {at:.1}°: phase {phase_cycle:.3}° per cycle, {phase_ms:.3}° per ms; amplitude {amplitude_cycle:.4}° \
                 per cycle, {amplitude_ms:.4}° per ms, and {cost:.1} times that, {free_ms:.4}°, with gain and offset \
                 estimated too, which pays where the gain is wrong by more than {:.2} %",
                100.0 * worth
            ),
        );
    }
    topic.with(
        "degeneracy",
        [],
        "Gain, offset and amplitude are nearly one: a small motion reads as a·C₀·(A/θ₀)²·cos²ωt. Free gain and offset only \
         where the motion is large or the recording long enough for the price above; hold them otherwise.",
    )
    .with(
        "bias_capacitance",
        [],
        "The bias capacitance C_b and the offset enter the signal as one number, a·C_b + b: the signal does not determine either alone.",
    )
}

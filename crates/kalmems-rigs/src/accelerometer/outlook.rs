//! What can be said of an accelerometer before anything is recorded.

use super::run::ControllerTiming;
use super::settings::AccelerometerHardware;
use super::simulation::{acting, closed_loop};
use super::varied_instrument::settled_acceleration_sd;
use crate::accelerometer::device::AccelerometerTable;
use crate::config::{Experiment, Quantity};
use crate::inspect::quantity;
use crate::outlook::{AtFrequency, Outlook, OutlookTopic, Recorded};
use crate::simulate::SimulateError;
use kalmems_core::Portable;
use kalmems_models::constants::STANDARD_GRAVITY;
use kalmems_models::control::{Comparator, PiController, RebalanceLoop};
use kalmems_models::noise::Mosfet;
use std::f64::consts::{PI, TAU};

/// The frequency of the carrier where the experiment does not state it: ASSUMED, that of Zhang 2010, Table I.
const ASSUMED_CARRIER_HZ: f64 = 1e6;
/// Where the noise at the input is given, in Hz: well below every corner.
const LOW_HZ: f64 = 10.0;
/// In the unit in which such noise is read.
const MICRO_G: f64 = 1e-6 * STANDARD_GRAVITY;
const MILLI_G: f64 = 1e-3 * STANDARD_GRAVITY;

/// Device, loop, noise and bounds, and what the equations say.
pub fn outlook(experiment: &Experiment, of_equations: Outlook) -> Result<Outlook, SimulateError> {
    let hardware = AccelerometerHardware::of(experiment)?;
    let rate_hz = sampling_rate(experiment);
    let described = closed_loop(experiment, rate_hz.map_or(0.0, f64::recip))?;
    let mut topics = vec![device(&hardware)];
    let (closed, largest_feedback) = match acting(experiment)? {
        // One bit closes no linear loop: what is linear about it is the device, always under the same v_F².
        ControllerTiming::OneBit(comparator) => {
            topics.push(of_one_bit(&described, comparator, rate_hz));
            let mut alone = without(&described);
            alone.device.carrier_mean_square += comparator.level * comparator.level;
            (alone, comparator.level)
        }
        ControllerTiming::Continuously => {
            topics.push(of_loop(&described, None));
            (described, described.device.bias)
        }
        ControllerTiming::Sampled => {
            if hardware.has_feedback {
                topics.push(of_loop(&described, rate_hz));
            }
            (described, described.device.bias)
        }
    };
    topics.push(noise(experiment, &hardware, &closed, rate_hz));
    if let Some(rate_hz) = rate_hz {
        topics.push(bounds(&hardware, &closed, (rate_hz, largest_feedback)));
    }
    let frequencies = over_frequency(&hardware, &closed, rate_hz);
    topics.extend(of_equations.topics);
    Ok(Outlook { topics, frequencies, ..of_equations })
}

/// The same device with nothing fed back.
fn without(closed: &RebalanceLoop<f64>) -> RebalanceLoop<f64> {
    RebalanceLoop { controller: PiController { proportional: 0.0, integral: 0.0 }, ..*closed }
}

/// Frequencies per decade of a picture.
const PER_DECADE: i32 = 40;

/// From 1 Hz to half the sampling rate, or to 1 MHz.
fn over_frequency(
    hardware: &AccelerometerHardware,
    closed: &RebalanceLoop<f64>,
    rate_hz: Option<f64>,
) -> Vec<AtFrequency> {
    let highest = rate_hz.map_or(1e6, |rate| 0.5 * rate);
    let brownian = (2.0 * hardware.sensed.device.mass.acceleration_density(hardware.force_density)).sqrt();
    let open = without(closed);
    // To 1 GHz at most.
    (0..=9 * PER_DECADE)
        .map(|k| 10_f64.portable_powf(f64::from(k) / f64::from(PER_DECADE)))
        .take_while(|hz| *hz <= highest)
        .map(|frequency_hz| {
            let rate = TAU * frequency_hz;
            AtFrequency {
                frequency_hz,
                response: closed.response(rate).size(),
                phase: closed.phase(rate),
                open_response: open.response(rate).size(),
                open_phase: open.phase(rate),
                loop_gain: closed.open_loop(rate).size(),
                sensitivity: closed.sensitivity(rate).size(),
                brownian,
                readout: rate_hz
                    .map(|hz| (2.0 * hardware.noise_variance / hz).sqrt() * closed.input_referred(rate)),
            }
        })
        .collect()
}

/// That of the simulation, or of the first recording that has one.
fn sampling_rate(experiment: &Experiment) -> Option<f64> {
    let simulated = experiment.simulate.as_ref().map(|simulate| simulate.sampling_rate.si());
    simulated.or_else(|| Recorded::of(experiment).rate_hz)
}

fn device(hardware: &AccelerometerHardware) -> OutlookTopic {
    let device = &hardware.sensed.device;
    let (mass, taken) = (&device.mass, device.electrostatic_spring(0.0));
    let [slow, fast] = mass.eigenvalues(mass.spring);
    let left = device.softened_spring(0.0);
    let open = RebalanceLoop {
        device: *device,
        readout: hardware.readout,
        controller: PiController { proportional: 0.0, integral: 0.0 },
        delay: 0.0,
    };
    let sensitivity = hardware.readout.sensitivity();
    let topic = OutlookTopic::new("Device")
        .with(
            "eigenvalues_rad_per_s",
            [slow.0, slow.1, fast.0, fast.1],
            format!(
                "The mass on its spring alone has the eigenvalues {:.1}{:+.1}j and {:.1}{:+.1}j rad/s: damping ratio {:.2}.",
                slow.0,
                slow.1,
                fast.0,
                fast.1,
                mass.damping_ratio(mass.spring)
            ),
        )
        .with(
            "electrostatic_spring_n_per_m",
            [taken, left],
            format!("Carrier and bias take {taken:.4} N/m from the spring and leave {left:.4} N/m."),
        )
        .with(
            "readout_v_per_m",
            [sensitivity, hardware.readout.plates.at_rest()],
            format!(
                "The readout gives {sensitivity:.4e} V/m; each capacitor is {:.2} pF at rest.",
                1e12 * hardware.readout.plates.at_rest()
            ),
        );
    let topic = match open.bandwidth(TAU * 1e-2, TAU * 1e7) {
        // What has no rest follows nothing.
        _ if left <= 0.0 => topic,
        Some(rate) => topic.with(
            "open_loop_bandwidth_hz",
            [rate / TAU],
            format!(
                "Without a loop it follows an acceleration up to {} (-3 dB).",
                quantity(rate / TAU, "Hz")
            ),
        ),
        None => topic,
    };
    match device.static_pull_in(0.0) {
        Some(held) => topic.with(
            "static_pull_in_gn",
            [held.acceleration / STANDARD_GRAVITY, held.displacement],
            format!(
                "Without a loop a constant acceleration of {:.1} g pulls the mass in, from {:.0} nm on.",
                held.acceleration / STANDARD_GRAVITY,
                1e9 * held.displacement
            ),
        ),
        None => topic.with(
            "static_pull_in_gn",
            [0.0],
            format!(
                "The plates pull with {taken:.4} N/m and the spring holds with {:.4} N/m: without a loop the mass lies on a plate.",
                mass.spring
            ),
        ),
    }
}

/// What a loop of one bit can say.
fn of_one_bit(closed: &RebalanceLoop<f64>, comparator: Comparator, rate_hz: Option<f64>) -> OutlookTopic {
    let mass = &closed.device.mass;
    let full_scale = closed.device.feedback_gain() * comparator.level / mass.mass;
    let [_, fast] = mass.eigenvalues(closed.device.softened_spring(comparator.level));
    let decay_s = fast.0.abs().recip();
    let topic = OutlookTopic::new("Loop of one bit")
        .with(
            "full_scale_gn",
            [full_scale / STANDARD_GRAVITY],
            format!(
                "Its bits hold up to {:.1} g; their mean is the acceleration.",
                full_scale / STANDARD_GRAVITY
            ),
        )
        .with(
            "lead_s",
            [comparator.lead_s, decay_s],
            format!(
                "The comparator looks {:.1} µs ahead; the faster motion of the mass decays in {:.1} µs.",
                1e6 * comparator.lead_s,
                1e6 * decay_s
            ),
        );
    match rate_hz {
        // A bit more or less.
        Some(rate_hz) => topic.with(
            "one_bit_in_1_ms_gn",
            [2.0 * full_scale / (1e-3 * rate_hz) / STANDARD_GRAVITY],
            format!(
                "In 1 ms one bit more or less is {:.2} mg.",
                2.0 * full_scale / (1e-3 * rate_hz) / MILLI_G
            ),
        ),
        None => topic,
    }
}

fn of_loop(closed: &RebalanceLoop<f64>, rate_hz: Option<f64>) -> OutlookTopic {
    let highest = rate_hz.map_or(TAU * 1e7, |rate| PI * rate);
    // Near half the sampling rate a hold is more than a delay: all of it is of the sampled loop.
    let margins = match rate_hz {
        Some(rate) => closed.sampled_margins(TAU * 1e-2, rate.recip()),
        None => closed.margins(TAU * 1e-2, highest),
    };
    let largest = closed.device.feedback_gain() * closed.device.bias / closed.device.mass.mass;
    let topic = OutlookTopic::new("Loop").with(
        "feedback_gain_n_per_v",
        [closed.device.feedback_gain(), largest / STANDARD_GRAVITY],
        format!(
            "One volt of feedback pushes with {:.3e} N; as much as the bias holds {:.1} g.",
            closed.device.feedback_gain(),
            largest / STANDARD_GRAVITY
        ),
    );
    let stable = rate_hz.map(|rate| closed.is_stable(1.0 / rate));
    let topic = match stable {
        Some(true) => topic.with("is_stable", [1.0], "Sampled at this rate it is stable."),
        Some(false) => topic.with("is_stable", [0.0], "Sampled at this rate it is UNSTABLE."),
        None => topic.with(
            "is_stable",
            [],
            "Neither the file nor a recording states a sampling rate; what follows is for a continuous loop.",
        ),
    };
    if stable == Some(false) {
        return topic.with(
            "gain_margin_db",
            [],
            "It has neither a bandwidth nor margins: what disturbs it grows until the mass lies on a plate. Lower the controller's gains, or \
             sample faster.",
        );
    }
    let topic = match closed.bandwidth(TAU, highest) {
        Some(rate) => topic.with(
            "closed_loop_bandwidth_hz",
            [rate / TAU],
            format!("It follows an acceleration up to {} (-3 dB).", quantity(rate / TAU, "Hz")),
        ),
        None => topic.with(
            "closed_loop_bandwidth_hz",
            [],
            "It follows an acceleration up to half the sampling rate.",
        ),
    };
    let corner = closed.controller.integral / closed.controller.proportional;
    let topic = topic.with(
        "controller_corner_rad_per_s",
        [corner],
        format!("The controller integrates below {corner:.3} rad/s; what is faster meets its proportional part alone."),
    );
    let topic = match (margins.crossover, margins.phase) {
        (Some(crossover), Some(phase)) => topic.with(
            "phase_margin_deg",
            [phase.to_degrees(), crossover / TAU],
            format!(
                "The loop gain is 1 at {}, where the phase margin is {:.1}°.",
                quantity(crossover / TAU, "Hz"),
                phase.to_degrees()
            ),
        ),
        _ => topic.with(
            "phase_margin_deg",
            [],
            "The loop gain does not come down to 1 within the band, or is below 1.",
        ),
    };
    let topic = match margins.gain {
        Some(gain) => topic.with(
            "gain_margin_db",
            [20.0 * gain.portable_log10()],
            format!("The gain margin is {:.1} dB.", 20.0 * gain.portable_log10()),
        ),
        None => topic.with(
            "gain_margin_db",
            [],
            "There is no gain margin: no gain makes it unstable, or it is so already.",
        ),
    };
    topic.with(
        "peak_sensitivity",
        [margins.peak_sensitivity],
        format!("At worst it amplifies a disturbance {:.2} times.", margins.peak_sensitivity),
    )
}

fn noise(
    experiment: &Experiment,
    hardware: &AccelerometerHardware,
    closed: &RebalanceLoop<f64>,
    rate_hz: Option<f64>,
) -> OutlookTopic {
    let brownian = 2.0 * hardware.sensed.device.mass.acceleration_density(hardware.force_density);
    let per_volt = closed.input_referred(TAU * LOW_HZ);
    let floor = brownian.sqrt() / MICRO_G;
    let mut topic = OutlookTopic::new("Noise at the input").with(
        "brownian_micro_g_per_root_hz",
        [floor],
        format!("The molecules: {floor:.1} µg/√Hz at every frequency."),
    );
    topic = match rate_hz {
        Some(rate_hz) => {
            let referred = |at_hz: f64| {
                (2.0 * hardware.noise_variance / rate_hz).sqrt() * closed.input_referred(TAU * at_hz) / MICRO_G
            };
            let (low, high) = (referred(LOW_HZ), referred(1e3));
            topic.with(
                "readout_micro_g_per_root_hz",
                [low, high],
                format!(
                    "The stated readout noise: {low:.0} µg/√Hz at {LOW_HZ:.0} Hz and {high:.0} µg/√Hz at 1 kHz. A loop \
                     changes neither, because it divides signal and noise by the same."
                ),
            )
        }
        None => topic.with(
            "readout_micro_g_per_root_hz",
            [],
            "The stated readout noise is that of a sample: its density follows with a sampling rate, which the file does \
             not state.",
        ),
    };
    // In phase with the carrier there is twice the density; the sensing capacitors divide what C4 feeds back.
    let (temperature, stated_hz) = match experiment.device::<AccelerometerTable>() {
        Ok(device) => {
            (device.proof_mass.temperature.si(), device.readout.carrier_frequency.as_ref().map(Quantity::si))
        }
        Err(_) => (0.0, None),
    };
    let carrier_hz = stated_hz.unwrap_or(ASSUMED_CARRIER_HZ);
    let stage = Mosfet::ASSUMED;
    let divided = 1.0 + 2.0 * closed.readout.plates.at_rest() / closed.readout.feedback_capacitance;
    let of = |density: f64| (2.0 * density).sqrt() * divided * per_volt / MICRO_G;
    let parts = [stage.thermal(temperature), stage.flicker(carrier_hz), stage.leakage(carrier_hz)].map(of);
    topic.with(
        "assumed_mosfet_micro_g_per_root_hz",
        parts,
        format!(
            "A MOSFET of ASSUMED values behind a carrier of {} MHz{}: thermal {:.2}, flicker {:.2}, leakage {:.3} \
             µg/√Hz at {LOW_HZ:.0} Hz.",
            1e-6 * carrier_hz,
            if stated_hz.is_none() { " (ASSUMED)" } else { "" },
            parts[0],
            parts[1],
            parts[2]
        ),
    )
}

/// What no filter can beat, from the noise and the stated acceleration.
fn bounds(
    hardware: &AccelerometerHardware,
    closed: &RebalanceLoop<f64>,
    (rate_hz, largest_feedback): (f64, f64),
) -> OutlookTopic {
    let topic = OutlookTopic::new("Bounds");
    let Ok(causal) = settled_acceleration_sd(hardware, 1.0 / rate_hz) else {
        return topic.with("causal_wiener_mg", [], "There is no settled filter for this device.");
    };
    let later = non_causal(hardware, closed, rate_hz);
    let largest = if hardware.has_feedback {
        closed.device.feedback_gain() * largest_feedback / closed.device.mass.mass
    } else {
        closed.device.static_pull_in(0.0).map_or(f64::NAN, |held| held.acceleration)
    };
    topic
        .with(
            "causal_wiener_mg",
            [causal / MILLI_G],
            format!(
                "The stated acceleration can be known to {:.3} mg rms while it is measured.",
                causal / MILLI_G
            ),
        )
        .with(
            "non_causal_wiener_mg",
            [later / MILLI_G],
            format!("Afterwards, from the whole recording, to {:.3} mg rms.", later / MILLI_G),
        )
        .with(
            "dynamic_range_db",
            [20.0 * (largest / causal).portable_log10(), largest / STANDARD_GRAVITY],
            format!(
                "From there to the {:.1} g at which {} are {:.0} dB.",
                largest / STANDARD_GRAVITY,
                if hardware.has_feedback {
                    "the feedback is as large as it may be"
                } else {
                    "the mass is pulled in"
                },
                20.0 * (largest / causal).portable_log10()
            ),
        )
}

/// √∫ S_a·N/(S_a + N) df in m/s²: what Wiener's filter leaves that knows the future, with the spectrum S_a of the
/// acceleration and N of all noise at the input (Wiener, Extrapolation, Interpolation, and Smoothing of Stationary Time
/// Series, 1949).
fn non_causal(hardware: &AccelerometerHardware, closed: &RebalanceLoop<f64>, rate_hz: f64) -> f64 {
    let prior = hardware.sensed.prior;
    let brownian = 2.0 * hardware.sensed.device.mass.acceleration_density(hardware.force_density);
    let readout = 2.0 * hardware.noise_variance / rate_hz;
    // Evenly in the logarithm, from far below the acceleration's band to half the sampling rate.
    let (from, to) = (1e-4 * prior.rate / TAU, 0.5 * rate_hz);
    let steps = 20_000_u32;
    let step = (to / from).portable_ln() / f64::from(steps);
    let left = |hz: f64| {
        let noise = brownian + readout * closed.input_referred(TAU * hz).powi(2);
        let signal = prior.spectrum(TAU * hz);
        signal * noise / (signal + noise)
    };
    let below = left(from) * from;
    let above: f64 = (0..steps)
        .map(|k| {
            let hz = from * ((f64::from(k) + 0.5) * step).portable_exp();
            left(hz) * hz * step
        })
        .sum();
    (below + above).sqrt()
}

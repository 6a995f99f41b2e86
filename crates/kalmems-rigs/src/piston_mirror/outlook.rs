//! What can be said of a piston mirror before anything is recorded.

use super::bound::motion_bound;
use super::mechanics::Mechanics;
use super::observability::ReadoutFault;
use super::phasor::{Drifting, Phasor, position_and_velocity};
use super::settings::{MotionKnowledge, PistonFilterSettings, PistonHardware, PistonSettings};
use crate::config::{DriveSource, Experiment};
use crate::outlook::{Outlook, OutlookTopic, Recorded};
use crate::piston_mirror::device::CarrierFrontEnd;
use crate::piston_mirror::device::PistonMirror;
use crate::simulate::{Balance, Drive, SimulateError, Stability, SteadyMotion, drive_of};
use kalmems_core::Portable;
use kalmems_core::{Covariance, FixedGain};
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::{CarrierDivider, PhasorDetector};
use std::f64::consts::TAU;

/// In people's units.
const NM: f64 = 1e9;
const ATTO: f64 = 1e18;

/// The motion that figures are for, and whether the file states it.
#[derive(Clone, Copy)]
struct StatedMotion {
    /// [A, f, φ, d₀, Ȧ].
    motion: [f64; 5],
    is_given: bool,
}

/// Front end, motion, information, observability and bandwidth.
pub fn outlook(experiment: &Experiment) -> Result<Outlook, SimulateError> {
    let hardware = PistonHardware::of(experiment)?;
    let settings = if experiment.estimate.is_some() { Some(PistonSettings::of(experiment)?) } else { None };
    let filters = settings.as_ref().map_or(&[][..], |settings| &settings.filters);
    let stated = stated_motion(experiment, &hardware, filters)?;
    let (rate_hz, is_given) = sampling_rate(experiment).map_or((20e3, false), |rate| (rate, true));
    let mut topics = vec![front_end(experiment, &hardware, &stated)];
    if let Some(mechanics) = &hardware.mechanics {
        topics.push(mirror(experiment, mechanics)?);
    }
    topics.push(signal(&hardware, &stated, (rate_hz, is_given)));
    topics.push(of_filters(&hardware, &stated, filters, rate_hz));
    topics.push(unseen(&hardware, &stated, rate_hz));
    topics.push(bandwidth(&hardware, &stated));
    Ok(Outlook::of(experiment, "piston_mirror", topics))
}

/// That of the simulation, of the first filter with a start, or half the reference distance at the resonance.
fn stated_motion(
    experiment: &Experiment,
    hardware: &PistonHardware,
    filters: &[PistonFilterSettings],
) -> Result<StatedMotion, SimulateError> {
    if let Some(simulate) = &experiment.simulate
        && matches!(simulate.drive, DriveSource::Prescribed(_))
    {
        let motion = super::simulation::start_of(experiment, simulate)?;
        return Ok(StatedMotion { motion, is_given: true });
    }
    let given = filters.iter().find_map(|filter| match filter.motion {
        MotionKnowledge::Steady { start: Some(([a, f, phase], _, rest)), .. } => {
            Some([a, f, phase, rest, 0.0])
        }
        MotionKnowledge::Drifting { start: Some((mean, _)), .. } => Some(mean),
        _ => None,
    });
    let resonance_hz = hardware.mechanics.map_or(500.0, |mechanics| mechanics.resonance_hz);
    let rest = hardware.plates.reference_distance;
    Ok(given.map_or(
        StatedMotion { motion: [0.5 * rest, resonance_hz, 0.0, rest, 0.0], is_given: false },
        |motion| StatedMotion { motion, is_given: true },
    ))
}

/// That of the simulation, or of the first recording that has one.
fn sampling_rate(experiment: &Experiment) -> Option<f64> {
    let simulated = experiment.simulate.as_ref().map(|simulate| simulate.sampling_rate.si());
    simulated.or_else(|| Recorded::of(experiment).rate_hz)
}

/// The nearest distance of the motion, the rest and the farthest.
fn distances(&[amplitude, _, _, rest, _]: &[f64; 5]) -> [f64; 3] {
    [rest - amplitude, rest, rest + amplitude]
}

fn front_end(experiment: &Experiment, hardware: &PistonHardware, stated: &StatedMotion) -> OutlookTopic {
    let at = distances(&stated.motion);
    let [near, rest, far] = at.map(|d| hardware.noise_density / hardware.plates.slope(d).abs() * NM);
    let of = if stated.is_given { "" } else { " (taken for this; the file states no motion)" };
    let topic = OutlookTopic::new("Front end").with(
        "position_noise_nm_per_root_hz",
        [near, rest, far],
        format!(
            "The stated {:.3} aF/√Hz are {near:.2} nm/√Hz at {:.3} mm, {rest:.2} at rest and {far:.2} at {:.3} mm{of}.",
            hardware.noise_density * ATTO,
            at[0] * 1e3,
            at[2] * 1e3
        ),
    );
    let Ok(device) = experiment.device::<PistonMirror>() else { return topic };
    let Some(circuit) = &device.readout.front_end else {
        return topic.with(
            "front_end_af_per_root_hz",
            [],
            "The file describes no carrier circuit, `[device.piston_mirror.readout.front_end]`, to set beside it.",
        );
    };
    let divider = divider(circuit);
    let base = hardware.plates.capacitance(stated.motion[3]);
    let computed = divider.capacitance_noise(circuit.voltage_noise.si(), base);
    let slope = divider.slope(base);
    let peak = computed * 2_f64.sqrt();
    let straight = (0..=200_u32)
        .map(|i| {
            let distance = at[0] + (at[2] - at[0]) * f64::from(i) / 200.0;
            let volts = divider.voltage(hardware.plates.capacitance(distance));
            let line = base + (volts - divider.voltage(base)) / slope;
            ((line - hardware.plates.capacitance(distance)) / hardware.plates.slope(distance)).abs()
        })
        .fold(0.0, f64::max);
    topic
        .with(
            "front_end_af_per_root_hz",
            [computed * ATTO, peak * ATTO, slope, hardware.noise_density / computed],
            format!(
                "The carrier circuit gives {slope:.3e} V/F at rest, so that its {:.3} nV/√Hz are {:.3} aF/√Hz, or \
                 {:.3} if its voltage is an amplitude; the file states {:.2} times that.",
                circuit.voltage_noise.si() * 1e9,
                computed * ATTO,
                peak * ATTO,
                hardware.noise_density / computed
            ),
        )
        .with(
            "straight_line_nm",
            [straight * NM],
            format!(
                "A straight line in place of its law would be wrong by up to {:.0} nm over the stroke.",
                straight * NM
            ),
        )
}

fn divider(circuit: &CarrierFrontEnd) -> CarrierDivider<f64> {
    CarrierDivider {
        excitation: circuit.excitation.si(),
        carrier_rate: TAU * circuit.carrier.si(),
        shunt_conductance: circuit.shunt.si().recip(),
        parallel_capacitance: circuit.parallel_capacitance.si(),
        input_conductance: 0.0,
        // Any: without an input current nothing drops across it.
        blocking_capacitance: 1.0,
    }
}

/// Pressures in Pa over which the quality factor is given.
const PRESSURES: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];

fn mirror(experiment: &Experiment, mechanics: &Mechanics) -> Result<OutlookTopic, SimulateError> {
    let quality = mechanics.damping.quality(mechanics.pressure);
    let resonance = mechanics.damping.resonance(mechanics.resonance_hz, mechanics.pressure);
    let over = PRESSURES.map(|p| mechanics.damping.quality(p));
    let mut topic = OutlookTopic::new("Mirror")
        .with(
            "resonance_hz_and_quality",
            [resonance, quality],
            format!(
                "At {:.3} Pa it swings freely at {resonance:.4} Hz with Q {quality:.0}: a motion falls to 1/e in \
                 {:.3} s.",
                mechanics.pressure,
                quality / (TAU * 0.5 * resonance)
            ),
        )
        .with(
            "quality_over_pressure",
            over,
            format!(
                "Q at 1, 10, 100 and 1000 Pa: {:.0}, {:.0}, {:.0}, {:.0}.",
                over[0], over[1], over[2], over[3]
            ),
        );
    let pulses = experiment.simulate.as_ref().filter(|s| matches!(s.drive, DriveSource::Square(_)));
    let Some(simulate) = pulses else {
        return Ok(topic.with(
            "drive",
            [],
            "The file names no pulses, `[simulate.drive.square]`, that drive it.",
        ));
    };
    let (drive, _) = drive_of(experiment, simulate)?;
    let device = mechanics.device(mechanics.pressure);
    if let Some(stability) = Stability::of(&device, &drive) {
        topic = topic.with(
            "pump_depth_over_threshold",
            [stability.pump_depth / stability.threshold()]
                .into_iter()
                .chain(stability.tongue_hz().into_iter().flatten())
                .collect::<Vec<f64>>(),
            format!("From rest: {stability}."),
        );
    }
    let (Some(balance), Some(period)) = (Balance::of(&device, &drive), drive.period_s()) else {
        return Ok(topic);
    };
    let motions = balance.motions_at(1.0 / period);
    let stable = motions.iter().filter(|motion| motion.is_stable);
    let Some(motion) = stable.max_by(|a, b| a.amplitude.total_cmp(&b.amplitude)) else {
        return Ok(topic.with("driven_amplitude_m", [], "The drive keeps no motion going at its frequency."));
    };
    let third = third_harmonic(&device, &drive, motion);
    Ok(topic
        .with(
            "driven_amplitude_m",
            [motion.amplitude, 0.5 / period],
            format!(
                "Driven, it can move by ±{:.1} um at {:.4} Hz, half of the drive's frequency.",
                motion.amplitude * 1e6,
                0.5 / period
            ),
        )
        .with(
            "third_harmonic_m",
            [third],
            format!(
                "The pulses also move it by {:.1} nm at three times that, which no filter here follows and no mean \
                 NIS shows.",
                third * NM
            ),
        ))
}

/// The amplitude in m of the third harmonic that the electrodes make of a motion: their force along it, on a mass
/// that is far above its resonance there.
fn third_harmonic(device: &ParametricScanner<f64>, drive: &Drive, motion: &SteadyMotion) -> f64 {
    const POINTS: u32 = 1440;
    let rate = 0.5 * TAU * motion.drive_hz;
    let (mut cosine, mut sine) = (0.0, 0.0);
    for point in 0..POINTS {
        // The middle of a part, so that none lies on a jump.
        let angle = TAU * (f64::from(point) + 0.5) / f64::from(POINTS);
        let displacement = motion.amplitude * (angle - motion.phase).portable_cos();
        let force = 0.5 * device.comb.slope(displacement) * drive.at(angle / rate).powi(2);
        let (s, c) = (3.0 * angle).portable_sin_cos();
        cosine += 2.0 / f64::from(POINTS) * force * c;
        sine += 2.0 / f64::from(POINTS) * force * s;
    }
    let stiffness = 9.0 * device.resonator.inertia * rate * rate - device.resonator.stiffness;
    cosine.portable_hypot(sine) / stiffness
}

fn signal(
    hardware: &PistonHardware,
    stated: &StatedMotion,
    (rate_hz, is_given): (f64, bool),
) -> OutlookTopic {
    let [amplitude, frequency, ..] = stated.motion;
    let of = if is_given { "" } else { " (taken for this; neither the file nor a recording says a rate)" };
    let sample = hardware.noise_variance(1.0 / rate_hz).sqrt();
    let one = distances(&stated.motion).map(|d| sample / hardware.plates.slope(d).abs() * NM);
    let mut topic = OutlookTopic::new("What the signal determines").with(
        "one_sample_nm",
        one,
        format!(
            "One sample at {:.1} kHz{of} by itself tells the distance to {:.0} nm nearest, {:.0} at rest and {:.0} \
             farthest.",
            rate_hz / 1e3,
            one[0],
            one[1],
            one[2]
        ),
    );
    topic = topic.with(
        "motion",
        stated.motion,
        format!(
            "Least standard deviations for a motion of ±{:.1} um at {frequency:.1} Hz, amplitude, its rate, \
             frequency, phase and rest position all unknown and constant:",
            amplitude * 1e6
        ),
    );
    // Information does not depend on the rate: a hundred samples per cycle, or what the file has if that is less.
    let density = (2.0 * hardware.noise_variance(1.0 / rate_hz) / rate_hz).sqrt();
    let dense = rate_hz.min(100.0 * frequency);
    for (name, seconds) in [("one cycle", 1.0 / frequency), ("20 ms", 20e-3), ("one second", 1.0)] {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
        let samples = (seconds * dense).round() as u32;
        if let Some(bound) = motion_bound(&hardware.plates, &stated.motion, (dense, samples), density) {
            let sd = |i: usize| bound.covariance.standard_deviation(i);
            topic = topic.with(
                "bounds",
                [seconds, sd(0), sd(1), sd(2), sd(3), sd(4), bound.position_rms_m],
                format!(
                    "of {name}: position {:.2} nm, amplitude {:.2} nm, rest {:.2} nm, phase {:.1e} rad, frequency \
                     {:.1e} Hz",
                    bound.position_rms_m * NM,
                    sd(0) * NM,
                    sd(3) * NM,
                    sd(2),
                    sd(1)
                ),
            );
        }
    }
    topic
}

/// The drift whose lag stands for others, relative per minute: that of Faller and Zangl, 2017, section IV.
const DRIFT: f64 = 0.2;

fn of_filters(
    hardware: &PistonHardware,
    stated: &StatedMotion,
    filters: &[PistonFilterSettings],
    rate_hz: f64,
) -> OutlookTopic {
    let mut topic = OutlookTopic::new("What its filters settle at");
    if filters.iter().all(|filter| matches!(filter.motion, MotionKnowledge::None)) {
        return topic.with("settled", [], "The file names no filter with states.");
    }
    let variance = hardware.noise_variance(1.0 / rate_hz);
    for filter in filters {
        match filter.motion {
            MotionKnowledge::None => {}
            MotionKnowledge::Drifting { density, .. } => {
                let drifting = Drifting::new(hardware.plates, density);
                let process = drifting.over(1.0 / rate_hz);
                let point = PhasorDetector { series: hardware.plates }.operating_point(
                    &process,
                    &stated.motion,
                    variance,
                );
                topic = match FixedGain::<f64, 5, 3>::steady_state(stated.motion, &point) {
                    Ok(lock) => {
                        let position = over_cycle(&stated.motion, lock.filtered_covariance());
                        let gain = lock.gain().times(&point.observation);
                        // Of a second-order loop the gain on the frequency is ω_n² per second of the phase.
                        let natural_hz = (TAU * gain.0[1][2] * rate_hz).max(0.0).sqrt() / TAU;
                        topic.with(
                            "settled_position_nm",
                            [position * NM, natural_hz],
                            format!(
                                "{}: {:.2} nm rms, as a filter and as a phase-locked loop with the same noise \
                                 (`steady_state`); the loop's natural frequency is {natural_hz:.2} Hz.",
                                filter.basics.name,
                                position * NM
                            ),
                        )
                    }
                    Err(why) => {
                        topic.with("settled_position_nm", [], format!("{}: {why}.", filter.basics.name))
                    }
                };
            }
            MotionKnowledge::Steady { density: [amplitude_density, _], .. } => {
                // A random walk of density q seen with σ0²: P² = q·σ0², and the lag is rate·σ0²/P = rate·√(σ0²/q).
                let rate = DRIFT * stated.motion[0] / 60.0;
                let one_second = amplitude_information(hardware, &stated.motion, 2.0 * variance / rate_hz);
                let lag = rate * one_second / amplitude_density.sqrt();
                topic = topic.with(
                    "lag_nm",
                    [lag * NM, one_second],
                    format!(
                        "{}: behind an amplitude that drifts by 20 % per minute it lags by {:.1} nm, which its mean \
                         NIS does not show.",
                        filter.basics.name,
                        lag * NM
                    ),
                );
            }
        }
    }
    topic
}

/// σ0 in m·√s: what one second leaves of the amplitude where the rest position is known, for a one-sided density in
/// F²/Hz.
fn amplitude_information(
    hardware: &PistonHardware,
    &[amplitude, _, _, rest, _]: &[f64; 5],
    density: f64,
) -> f64 {
    const POINTS: u32 = 256;
    let square = |k: u32| {
        let cosine = (TAU * f64::from(k) / f64::from(POINTS)).portable_cos();
        (hardware.plates.slope(rest + amplitude * cosine) * cosine).powi(2)
    };
    let mean = (0..POINTS).map(square).sum::<f64>() / f64::from(POINTS);
    (0.5 * density / mean).sqrt()
}

/// The root mean square over a cycle of the position's standard deviation in m.
fn over_cycle(motion: &[f64; 5], covariance: &Covariance<f64, 5>) -> f64 {
    const POINTS: u32 = 64;
    let square = |k: u32| {
        let mut there = *motion;
        there[2] = TAU * f64::from(k) / f64::from(POINTS);
        let (_, [g, _]) = position_and_velocity(&there);
        (0..5).map(|i| (0..5).map(|j| g[i] * covariance.get(i, j) * g[j]).sum::<f64>()).sum::<f64>()
    };
    ((0..POINTS).map(square).sum::<f64>() / f64::from(POINTS)).sqrt()
}

fn unseen(hardware: &PistonHardware, stated: &StatedMotion, rate_hz: f64) -> OutlookTopic {
    let motion = [stated.motion[0], stated.motion[3]];
    let variance = hardware.noise_variance(1.0 / rate_hz);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // one second of samples
    let updates = rate_hz as usize;
    let (gain, offset) =
        (ReadoutFault::gain(&hardware.plates, motion), ReadoutFault::offset(&hardware.plates, motion));
    let of = |name: &str, per: f64, unseen: &ReadoutFault| {
        let seen = unseen.detectable_from(variance, updates);
        let first = format!("{name} makes {:.1} nm rms", per * unseen.position_rms_m * NM);
        if seen.is_finite() {
            format!(
                "{first}; one second shows it in the mean NIS from {:.1} times that on, and could tell it to {:.3} \
                 times that as a state.",
                seen / per,
                unseen.attainable_deviation(variance, updates) / per
            )
        } else {
            format!(
                "{first}, and no record shows it: gain, amplitude and rest position are one for a parallel plate."
            )
        }
    };
    let values = |per: f64, unseen: &ReadoutFault| {
        [
            per * unseen.position_rms_m * NM,
            unseen.detectable_from(variance, updates) / per,
            per * unseen.amplitude_m * NM,
            per * unseen.rest_m * NM,
        ]
    };
    OutlookTopic::new("What the signal does not determine")
        .with("gain_nm_per_1e_4", values(1e-4, &gain), of("A gain that is 1e-4 too high", 1e-4, &gain))
        .with("offset_nm_per_af", values(1e-18, &offset), of("An offset of 1 aF", 1e-18, &offset))
        .with(
            "sign",
            [],
            "Amplitude and phase have one sign each in all that is said: (A, φ) and (−A, φ + π) are one motion, and \
             so are (f, φ) and (−f, −φ).",
        )
}

/// Bandwidths in Hz behind which each sample would be inverted by itself.
const BANDWIDTHS: [f64; 5] = [500.0, 2e3, 10e3, 50e3, 200e3];
/// The resolution that the spectrometer asks for, in m (Faller and Zangl, 2017, section II-A).
const WANTED_M: f64 = 50e-9;

/// What a filter of first order in place of an estimator does: noise falls with its bandwidth, and the motion with it.
fn bandwidth(hardware: &PistonHardware, stated: &StatedMotion) -> OutlookTopic {
    let [amplitude, frequency, _, rest, _] = stated.motion;
    let noise_at = |bandwidth: f64, distance: f64| {
        hardware.noise_density * bandwidth.sqrt() / hardware.plates.slope(distance).abs()
    };
    // |1 − 1/(1 + j·f/B)| of the motion's fundamental, rms.
    let lag = |bandwidth: f64| {
        let share = frequency / bandwidth;
        amplitude / 2_f64.sqrt() * share / (1.0 + share * share).sqrt()
    };
    let mut topic = OutlookTopic::new("Bandwidth, if each sample is taken by itself");
    for bandwidth in BANDWIDTHS {
        let [near, at_rest, far] = distances(&stated.motion).map(|d| noise_at(bandwidth, d) * NM);
        topic = topic.with(
            "bandwidth_hz_noise_and_lag_nm",
            [bandwidth, near, at_rest, far, lag(bandwidth) * NM],
            format!(
                "{:>6.1} kHz: noise of {near:.0} nm nearest, {at_rest:.0} at rest, {far:.0} farthest; a first-order \
                 filter of that corner is {:.0} nm off the motion",
                bandwidth / 1e3,
                lag(bandwidth) * NM
            ),
        );
    }
    let allowed = (WANTED_M / noise_at(1.0, rest + amplitude)).powi(2);
    topic.with(
        "bandwidth_for_50_nm_hz",
        [allowed, lag(allowed)],
        format!(
            "50 nm all along allow {allowed:.0} Hz of noise, and such a filter would be {:.1} um off the motion: a \
             sample by itself will not do.",
            lag(allowed) * 1e6
        ),
    )
}

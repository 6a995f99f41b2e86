//! What can be said of a piston mirror before anything is recorded.

use super::bound::motion_bound;
use super::device::{CarrierFrontEnd, PistonMirror};
use super::mechanics::Mechanics;
use super::observability::ReadoutFault;
use super::plates::plates;
use crate::config::{DriveSource, Experiment, FilterStart, Values};
use crate::outlook::{OutlookTopic, Recorded};
use crate::simulate::{Balance, Drive, SimulateError, Stability, SteadyMotion, drive_of};
use kalmems_core::Portable;
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::CarrierDivider;
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

/// Front end, mirror, information, and what the signal does not tell.
pub fn topics(experiment: &Experiment) -> Result<Vec<OutlookTopic>, SimulateError> {
    let mirror = experiment.device::<PistonMirror>()?;
    let stated = stated_motion(experiment, &mirror);
    let (rate_hz, is_given) = sampling_rate(experiment).map_or((20e3, false), |rate| (rate, true));
    let mut topics = vec![front_end(&mirror, &stated)];
    if let Some(driven) = &mirror.mirror {
        topics.push(of_mirror(experiment, &Mechanics::of(driven))?);
    }
    topics.push(signal(&mirror, &stated, (rate_hz, is_given)));
    topics.push(unseen(&mirror, &stated, rate_hz));
    Ok(topics)
}

/// That of the simulation, of the first filter with a start, or half the reference distance at the resonance.
fn stated_motion(experiment: &Experiment, mirror: &PistonMirror) -> StatedMotion {
    let filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let started = filters.filter_map(|filter| match &filter.start {
        Some(FilterStart::Values(values)) => Some(values),
        _ => None,
    });
    let motion = |values: &Values| {
        let of = |name: &str| values.get(name).map(|value| value.value().si());
        let rate = of("amplitude_rate").unwrap_or(0.0);
        Some([of("amplitude")?, of("frequency")?, of("phase").unwrap_or(0.0), of("offset")?, rate])
    };
    let given = experiment.simulate.iter().map(|simulate| &simulate.start).chain(started).find_map(motion);
    let resonance_hz = mirror.mirror.as_ref().map_or(500.0, |driven| driven.resonance.si());
    let rest = mirror.capacitance.reference_distance.si();
    given.map_or(
        StatedMotion { motion: [0.5 * rest, resonance_hz, 0.0, rest, 0.0], is_given: false },
        |motion| StatedMotion { motion, is_given: true },
    )
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

fn front_end(mirror: &PistonMirror, stated: &StatedMotion) -> OutlookTopic {
    let (plates, noise_density) = (plates(mirror), mirror.readout.noise_density.si());
    let at = distances(&stated.motion);
    let [near, rest, far] = at.map(|d| noise_density / plates.slope(d).abs() * NM);
    let of = if stated.is_given { "" } else { " (taken for this; the file states no motion)" };
    let topic = OutlookTopic::new("Front end").with(
        "position_noise_nm_per_root_hz",
        [near, rest, far],
        format!(
            "The stated {:.3} aF/√Hz are {near:.2} nm/√Hz at {:.3} mm, {rest:.2} at rest and {far:.2} at {:.3} mm{of}.",
            noise_density * ATTO,
            at[0] * 1e3,
            at[2] * 1e3
        ),
    );
    let Some(circuit) = &mirror.readout.front_end else {
        return topic.with(
            "front_end_af_per_root_hz",
            [],
            "The file describes no carrier circuit, `[device.piston_mirror.readout.front_end]`, to compare it with.",
        );
    };
    let divider = divider(circuit);
    let base = plates.capacitance(stated.motion[3]);
    let computed = divider.capacitance_noise(circuit.voltage_noise.si(), base);
    let slope = divider.slope(base);
    let peak = computed * 2_f64.sqrt();
    let straight = (0..=200_u32)
        .map(|i| {
            let distance = at[0] + (at[2] - at[0]) * f64::from(i) / 200.0;
            let volts = divider.voltage(plates.capacitance(distance));
            let line = base + (volts - divider.voltage(base)) / slope;
            ((line - plates.capacitance(distance)) / plates.slope(distance)).abs()
        })
        .fold(0.0, f64::max);
    topic
        .with(
            "front_end_af_per_root_hz",
            [computed * ATTO, peak * ATTO, slope, noise_density / computed],
            format!(
                "The carrier circuit gives {slope:.3e} V/F at rest, so that its {:.3} nV/√Hz are {:.3} aF/√Hz, or \
                 {:.3} if its voltage is an amplitude; the file states {:.2} times that.",
                circuit.voltage_noise.si() * 1e9,
                computed * ATTO,
                peak * ATTO,
                noise_density / computed
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

fn of_mirror(experiment: &Experiment, mechanics: &Mechanics) -> Result<OutlookTopic, SimulateError> {
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

fn signal(mirror: &PistonMirror, stated: &StatedMotion, (rate_hz, is_given): (f64, bool)) -> OutlookTopic {
    let plates = plates(mirror);
    let [amplitude, frequency, ..] = stated.motion;
    let of = if is_given { "" } else { " (taken for this; neither the file nor a recording says a rate)" };
    let sample = mirror.readout.noise_variance(1.0 / rate_hz).sqrt();
    let one = distances(&stated.motion).map(|d| sample / plates.slope(d).abs() * NM);
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
    let density = (2.0 * mirror.readout.noise_variance(1.0 / rate_hz) / rate_hz).sqrt();
    let dense = rate_hz.min(100.0 * frequency);
    for (name, seconds) in [("one cycle", 1.0 / frequency), ("20 ms", 20e-3), ("one second", 1.0)] {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
        let samples = (seconds * dense).round() as u32;
        if let Some(bound) = motion_bound(&plates, &stated.motion, (dense, samples), density) {
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

fn unseen(mirror: &PistonMirror, stated: &StatedMotion, rate_hz: f64) -> OutlookTopic {
    let plates = plates(mirror);
    let motion = [stated.motion[0], stated.motion[3]];
    let variance = mirror.readout.noise_variance(1.0 / rate_hz);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // one second of samples
    let updates = rate_hz as usize;
    let (gain, offset) = (ReadoutFault::gain(&plates, motion), ReadoutFault::offset(&plates, motion));
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

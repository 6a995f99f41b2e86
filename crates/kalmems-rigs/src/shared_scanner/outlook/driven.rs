//! What a drive does to a scanner: whether it starts, how far it swings, and when.

use super::super::settings::ScannerHardware;
use crate::outlook::{AmplitudeResponse, OutlookTopic, SmallMotionGrowth};
use crate::simulate::{
    Balance, Drive, Stability, StabilityMap, SteadyMotion, SweepHold, SweepStartUp, floquet_exponent,
    start_up, starting_factor, sweeps_both_ways,
};
use kalmems_core::Scalar;
use kalmems_models::dynamics::ParametricScanner;

/// Statements and figures about one drive.
pub struct Driven {
    pub topics: Vec<OutlookTopic>,
    /// That of the steady motion at the drive's frequency, or the largest within its sweep, in rad.
    pub amplitude: Option<f64>,
    pub response: Option<AmplitudeResponse>,
    pub start: Option<SmallMotionGrowth>,
}

/// Integration steps per half cycle of the motion, which is a period of the harmonic of the drive that pumps: the frequency
/// is right to 3e-6.
const STEPS: u32 = 24;
/// Likewise where growth is told, and where a start is waited for.
const FINE_STEPS: u32 = 64;
const START_STEPS: u32 = 48;
/// What disturbs a device at rest, in rad.
const DISTURBANCE: f64 = 1e-6;
/// What it is disturbed by at each frequency of a sweep, so that slow starts are seen too.
const AT_LEAST: f64 = 1e-3;
/// Frequencies of a sweep, and the points of a map along and across.
const SWEEP_POINTS: u32 = 43;
const MAP_POINTS: [u32; 2] = [161, 101];
/// Half cycles of the motion for which each frequency of a sweep is held at most: forty e-foldings of the motion at Q = 770.
const LONGEST_HOLD: f64 = 20_000.0;
/// A start that takes more steps than this is not waited for.
const LONGEST_START: f64 = 4e6;

impl Driven {
    /// For this device and drive.
    pub fn of(hardware: &ScannerHardware, drive: &Drive) -> Self {
        let scanner = &hardware.scanner;
        let Some(stability) = Stability::of(scanner, drive) else {
            let text = match drive {
                Drive::Constant { level } => {
                    format!("A constant {level} V starts no motion: nothing modulates the stiffness.")
                }
                _ => {
                    "A recorded drive has no one frequency: simulate it, or describe the device with a sine."
                        .to_owned()
                }
            };
            let topics = vec![OutlookTopic::new("Drive").with("drive", [], text)];
            return Self { topics, amplitude: None, response: None, start: None };
        };
        let curve = Balance::of(scanner, drive).map_or_else(Vec::new, |balance| balance.curve());
        let response = response(scanner, drive, &stability, curve);
        let motion =
            response.as_ref().map(|response| DrivenSteadyMotion::of(scanner, drive, &stability, response));
        let mut topics = vec![starts(scanner, drive, &stability)];
        topics.extend(motion.as_ref().map(|motion| motion.topic.clone()));
        Self {
            topics,
            amplitude: motion.and_then(|motion| motion.amplitude),
            response,
            start: map(scanner, drive, &stability),
        }
    }
}

fn starts(scanner: &ParametricScanner<f64>, drive: &Drive, stability: &Stability) -> OutlookTopic {
    let [depth, threshold] = [stability.pump_depth, stability.threshold()];
    let verdict = stability.to_string();
    let mut topic = OutlookTopic::new("Drive")
        .with("pump_depth_over_threshold", [depth / threshold], format!("The device {verdict}."))
        .with(
            "resonance_driven_hz",
            [stability.resonance_hz],
            format!(
                "With the drive's mean square the resonance at rest is {:.3} kHz; harmonic {} of the drive pumps, best at \
                 a drive of {:.3} kHz.",
                stability.resonance_hz / 1e3,
                stability.harmonic,
                best_hz(stability) / 1e3
            ),
        )
        .with(
            "pump_depth",
            [depth, threshold],
            format!("The stiffness is modulated by {:.3} %; the threshold 2/Q is {:.3} %.", 100.0 * depth, 100.0 * threshold),
        );
    if let (Some(factor), Some(peak)) = (starting_factor(scanner, drive), drive.peak_volts()) {
        let damping = scanner.resonator.damping * depth / threshold;
        let best = Stability::of(scanner, &drive.scaled(factor)).map_or(f64::NAN, |s| best_hz(&s));
        topic = topic.with(
            "needed_factor_volts_hz_damping",
            [factor, factor * peak, best, damping],
            format!(
                "At the threshold the voltages are {factor:.3} times as large, {:.1} V at the peak, at {:.3} kHz; or, with \
                 these voltages, the damping is {damping:.3e} N·m·s/rad.",
                factor * peak,
                best / 1e3
            ),
        );
    }
    if let Some(growth) = floquet_exponent(*scanner, drive, FINE_STEPS * stability.harmonic) {
        let hz = stability.drive_hz[0];
        let place = match stability.tongue_hz() {
            Some([low, high]) if (low..=high).contains(&hz) => String::new(),
            Some([low, _]) if hz < low => {
                format!(", {:.1} Hz below the frequencies that start a motion,", low - hz)
            }
            Some([_, high]) => format!(", {:.1} Hz above the frequencies that start a motion,", hz - high),
            None => String::new(),
        };
        let words = if growth > 0.0 { "grows by itself" } else { "dies" };
        topic = topic.with(
            "growth_rate_per_s",
            [growth],
            format!("At {:.3} kHz{place} a small motion {words}: {growth:+.1} /s.", hz / 1e3),
        );
    }
    topic
}

/// The frequency at which the pump is met best.
fn best_hz(stability: &Stability) -> f64 {
    2.0 * stability.resonance_hz / f64::from(stability.harmonic)
}

fn grid(from: f64, to: f64, points: u32) -> Vec<f64> {
    (0..points).map(|i| from + (to - from) * f64::from(i) / f64::from(points - 1)).collect()
}

fn span(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |span, value| {
        let [low, high] = span.unwrap_or([value, value]);
        Some([value.min(low), value.max(high)])
    })
}

/// Sweeps over all frequencies at which there is a motion, and a little beyond.
fn response(
    scanner: &ParametricScanner<f64>,
    drive: &Drive,
    stability: &Stability,
    balance: Vec<SteadyMotion>,
) -> Option<AmplitudeResponse> {
    let [low, high] = span(balance.iter().map(|motion| motion.drive_hz))?;
    let beyond = 0.12 * (high - low);
    let hold = hold(stability);
    let sweeps = sweeps_both_ways(*scanner, drive, &grid(low - beyond, high + beyond, SWEEP_POINTS), &hold)?;
    Some(AmplitudeResponse { sweeps, balance })
}

/// Forty times as long as a motion takes to fall to 1/e, as long as Q leaves that a matter of seconds.
fn hold(stability: &Stability) -> SweepHold {
    let harmonic = f64::from(stability.harmonic);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
    let periods = ((26.0 * stability.quality).clamp(500.0, LONGEST_HOLD) / harmonic).ceil() as u32;
    SweepHold { periods, steps_per_period: STEPS * stability.harmonic, disturbance: AT_LEAST }
}

/// From no drive to half again as much as is there, or as is needed.
fn map(scanner: &ParametricScanner<f64>, drive: &Drive, stability: &Stability) -> Option<SmallMotionGrowth> {
    let most = 1.5 * starting_factor(scanner, drive)?.max(1.0);
    let factor = grid(0.0, most, MAP_POINTS[1]);
    let at = |factor: f64| Stability::of(scanner, &drive.scaled(factor));
    let (still, largest) = (best_hz(&at(0.0)?), at(most)?);
    let edges = largest.tongue_hz().unwrap_or([best_hz(&largest); 2]);
    let [low, high] = span([still, edges[0], edges[1]].into_iter())?;
    let beyond = 0.1 * (high - low);
    let hz = grid(low - beyond, high + beyond, MAP_POINTS[0]);
    let tongue_hz = factor.iter().map(|factor| at(*factor).and_then(|s| s.tongue_hz())).collect();
    let map = StabilityMap::of(*scanner, drive, hz, factor, STEPS * stability.harmonic)?;
    Some(SmallMotionGrowth { map, peak_volts: drive.peak_volts()?, tongue_hz })
}

/// The steady motion.
struct DrivenSteadyMotion {
    topic: OutlookTopic,
    amplitude: Option<f64>,
}

impl DrivenSteadyMotion {
    fn of(
        scanner: &ParametricScanner<f64>,
        drive: &Drive,
        stability: &Stability,
        response: &AmplitudeResponse,
    ) -> Self {
        let stable: Vec<&SteadyMotion> = response.balance.iter().filter(|motion| motion.is_stable).collect();
        let by_amplitude = |a: &&&SteadyMotion, b: &&&SteadyMotion| a.amplitude.total_cmp(&b.amplitude);
        let by_frequency = |a: &&&SteadyMotion, b: &&&SteadyMotion| a.drive_hz.total_cmp(&b.drive_hz);
        let mut topic = OutlookTopic::new("Motion");
        let largest = stable.iter().max_by(by_amplitude);
        if let (Some(largest), Some(last)) = (largest, stable.iter().min_by(by_frequency)) {
            topic = topic.with(
                "largest_deg_at_hz_last_hz",
                [largest.amplitude.to_degrees(), largest.drive_hz, last.drive_hz],
                format!(
                    "The largest steady motion is {:.2}°, at a drive of {:.3} kHz; sweeping down, the motion is lost \
                     below {:.3} kHz.",
                    largest.amplitude.to_degrees(),
                    largest.drive_hz / 1e3,
                    last.drive_hz / 1e3
                ),
            );
        }
        topic = match response.sweeps.hysteresis_hz(AT_LEAST) {
            Some([low, high]) => topic.with(
                "hysteresis_hz",
                [low, high],
                format!(
                    "From {:.3} to {:.3} kHz sweeping down keeps a motion that sweeping up does not find (simulated \
                     sweeps in steps of {:.1} Hz): reach these frequencies from above.",
                    low / 1e3,
                    high / 1e3,
                    response.sweeps.up.windows(2).map(|p| p[1].drive_hz - p[0].drive_hz).fold(0.0, f64::max)
                ),
            ),
            None => topic.with("hysteresis_hz", [], "Sweeps up and down agree."),
        };
        let (Drive::Sine { frequency_hz, .. } | Drive::Square { frequency_hz, .. }) = drive else {
            return Self { topic, amplitude: largest.map(|motion| motion.amplitude) };
        };
        let balance = Balance::of(scanner, drive).map_or_else(Vec::new, |b| b.motions_at(*frequency_hz));
        let growth = floquet_exponent(*scanner, drive, FINE_STEPS * stability.harmonic).unwrap_or(f64::NAN);
        let motion = balance.iter().rev().find(|motion| motion.is_stable);
        topic = match motion {
            None => topic.with(
                "steady_deg_at_hz",
                [],
                format!("At {:.3} kHz there is no steady motion.", frequency_hz / 1e3),
            ),
            Some(motion) => topic.with(
                "steady_deg_at_hz",
                [motion.amplitude.to_degrees(), *frequency_hz],
                format!(
                    "At {:.3} kHz the steady amplitude is {:.2}°{} (harmonic balance).",
                    frequency_hz / 1e3,
                    motion.amplitude.to_degrees(),
                    if growth > 0.0 {
                        ""
                    } else {
                        " if reached from above; at rest the device stays at rest"
                    }
                ),
            ),
        };
        if let Some(motion) = motion.filter(|_| growth > 0.0) {
            let rate_hz = f64::from(START_STEPS * stability.harmonic) * frequency_hz;
            topic = starting(topic, scanner, (drive, rate_hz), motion, growth);
        }
        Self { topic, amplitude: motion.map(|motion| motion.amplitude) }
    }
}

/// How long it takes from almost nothing, with so many steps per second.
fn starting(
    topic: OutlookTopic,
    scanner: &ParametricScanner<f64>,
    (drive, rate_hz): (&Drive, f64),
    motion: &SteadyMotion,
    growth: f64,
) -> OutlookTopic {
    // Growth from the disturbance, and settling.
    let decay = 0.5 * scanner.resonator.damping / scanner.resonator.inertia;
    let expected_s = Scalar::ln(motion.amplitude / DISTURBANCE) / growth;
    let limit_s = 1.3 * expected_s + 10.0 / decay;
    let begun = (limit_s * rate_hz < LONGEST_START)
        .then(|| start_up(*scanner, drive, DISTURBANCE, rate_hz, limit_s))
        .flatten();
    match begun {
        Some(SweepStartUp { time_s, amplitude }) => topic.with(
            "start_up_s_and_deg",
            [time_s, amplitude.to_degrees()],
            format!(
                "From a disturbance of {:.0e} rad it reaches nine tenths of {:.2}° in {:.2} ms (simulated).",
                DISTURBANCE,
                amplitude.to_degrees(),
                1e3 * time_s
            ),
        ),
        None => topic.with(
            "start_up_s_and_deg",
            [expected_s, f64::NAN],
            format!(
                "From a disturbance of {:.0e} rad it takes about {:.1} ms, from the growth rate alone.",
                DISTURBANCE,
                1e3 * expected_s
            ),
        ),
    }
}

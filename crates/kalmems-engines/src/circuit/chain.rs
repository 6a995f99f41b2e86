//! The circuit in time.

use super::excitation::turned;
use super::{AmplitudeDetector, Circuit, Excitation, SineMotion};
use crate::signal::PortableComplex;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::circuit::{
    SampledCascade, SampledDiode, SampledSection, Section, SquareLaw, SynchronousDemodulator, Transimpedance,
};
use std::f64::consts::TAU;

/// Steps per cycle of the carrier below which the circuit is not simulated.
pub const SAMPLES_PER_CARRIER_CYCLE: f64 = 50.0;

/// What the circuit meets at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircuitInputs {
    /// C in F.
    pub capacitance: f64,
    /// Ċ = dC/dθ·θ̇ in F/s.
    pub capacitance_rate: f64,
    /// V in V, with the carrier.
    pub voltage: f64,
    /// V̇ in V/s, with the carrier.
    pub voltage_rate: f64,
    /// How many cycles the carrier's sine has gone through.
    pub carrier_cycles: f64,
    /// What the amplifier's noise adds to its output, in V.
    pub noise: f64,
}

/// The voltage behind each stage, in V.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stages {
    /// V_o1, behind the amplifier.
    pub amplified: f64,
    /// V_o2, behind the high-pass.
    pub passed: f64,
    /// V_o3, behind the detector.
    pub detected: f64,
    /// y_cap, behind both low-pass stages.
    pub output: f64,
}

impl Stages {
    /// In the order of the signal's way.
    pub fn in_order(&self) -> [f64; 4] {
        [self.amplified, self.passed, self.detected, self.output]
    }
}

/// A [`Circuit`], step by step, from rest.
///
/// Every pole is discretised exactly, with the input between the steps as the parabola through three of them; the
/// charge's derivative is computed, not differenced. It holds a few dozen numbers, however long it runs.
#[derive(Clone, Copy, Debug)]
pub struct Chain {
    transimpedance: Transimpedance<f64>,
    amplifier: Option<SampledSection<f64>>,
    high_pass: SampledCascade<f64>,
    detector: SampledDetector,
    low_pass: SampledCascade<f64>,
    noise: f64,
}

#[derive(Clone, Copy, Debug)]
enum SampledDetector {
    SquareLaw(SquareLaw<f64>),
    Diode(SampledDiode<f64>),
    Synchronous(SynchronousDemodulator<f64>),
}

impl Chain {
    /// In steps of 1/`rate_hz`, for a carrier of this frequency.
    pub fn new(circuit: &Circuit, carrier_hz: f64, rate_hz: f64) -> Self {
        let interval = 1.0 / rate_hz;
        let pole = |hz: f64| SampledSection::new(&Section::low_pass(TAU * hz), interval);
        Self {
            transimpedance: circuit.transimpedance,
            amplifier: circuit.amplifier_bandwidth_hz.map(pole),
            high_pass: SampledCascade::new(&circuit.high_pass.cascade, interval),
            detector: match circuit.detector {
                AmplitudeDetector::SquareLaw(law) => SampledDetector::SquareLaw(law),
                AmplitudeDetector::Diode(law) => SampledDetector::Diode(SampledDiode::new(law, interval)),
                AmplitudeDetector::Synchronous(law) => {
                    let phase = circuit.front_response(carrier_hz).portable_arg() + law.phase;
                    SampledDetector::Synchronous(SynchronousDemodulator { phase })
                }
            },
            low_pass: SampledCascade::new(&circuit.low_pass(), interval),
            noise: (0.5 * circuit.noise_density * rate_hz).sqrt(),
        }
    }

    /// The standard deviation in V of the noise in each step: white noise of the circuit's density up to half the rate.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// One step on, to an instant with these inputs.
    pub fn step(&mut self, inputs: &CircuitInputs) -> Stages {
        let CircuitInputs { capacitance, capacitance_rate, voltage, voltage_rate, .. } = *inputs;
        let current = self.transimpedance.voltage(capacitance, capacitance_rate, voltage, voltage_rate);
        let amplified = self.amplifier.as_mut().map_or(current, |pole| pole.step(current)) + inputs.noise;
        let passed = self.high_pass.step(amplified);
        let detected = match &mut self.detector {
            SampledDetector::SquareLaw(law) => law.voltage(passed),
            SampledDetector::Diode(diode) => diode.step(passed),
            SampledDetector::Synchronous(law) => {
                let cycles = inputs.carrier_cycles;
                law.voltage(passed, TAU * (cycles - cycles.floor()))
            }
        };
        Stages { amplified, passed, detected, output: self.low_pass.step(detected) }
    }
}

/// Runs the circuit without noise under a steady drive and motion, in steps of 1/`rate_hz` from `settle` steps before
/// 0 s on, and calls `each` with the time and the stages from 0 s on, `count` times.
pub fn run(
    circuit: &Circuit,
    excitation: &Excitation,
    (comb, motion): (&GaussianComb<f64>, &SineMotion),
    rate_hz: f64,
    (settle, count): (u32, u32),
    mut each: impl FnMut(f64, &Stages),
) {
    let mut chain = Chain::new(circuit, excitation.carrier_hz, rate_hz);
    for k in -i64::from(settle)..i64::from(count) {
        let time_s = k as f64 / rate_hz;
        let (angle, rate) = motion.at(time_s, excitation.drive_hz);
        let (voltage, voltage_rate) = excitation.at(time_s);
        let stages = chain.step(&CircuitInputs {
            capacitance: comb.capacitance(angle),
            capacitance_rate: comb.slope(angle) * rate,
            voltage,
            voltage_rate,
            carrier_cycles: excitation.carrier_hz * time_s,
            noise: 0.0,
        });
        if k >= 0 {
            each(time_s, &stages);
        }
    }
}

/// The coefficients of e^{jn·ω_dr·t} of the output, n = 0 to N − 1, from a run over `cycles` of the motion.
///
/// A Hann window over the run keeps the carrier's lines, which fit into no whole number of the motion's cycles, out.
pub(super) fn measured_harmonics<const N: usize>(
    circuit: &Circuit,
    excitation: &Excitation,
    device: (&GaussianComb<f64>, &SineMotion),
    (settle_s, cycles): (f64, u32),
) -> [super::Complex<f64>; N] {
    // Whole steps per cycle of the motion.
    let motion_hz = 0.5 * excitation.drive_hz;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturates
    let (per_cycle, settle) = {
        let per_cycle = (SAMPLES_PER_CARRIER_CYCLE * excitation.carrier_hz / motion_hz).ceil() as u32;
        (per_cycle, (settle_s * motion_hz * f64::from(per_cycle)).ceil() as u32)
    };
    let rate_hz = motion_hz * f64::from(per_cycle);
    let count = per_cycle * cycles;
    let mut sums = [super::Complex::default(); N];
    run(circuit, excitation, device, rate_hz, (settle, count), |time_s, stages| {
        let weight = 1.0 - turned(time_s * rate_hz / f64::from(count)).1;
        for (n, sum) in sums.iter_mut().enumerate() {
            let (sine, cosine) = turned(n as f64 * excitation.drive_hz * time_s);
            *sum += super::Complex::new(cosine, -sine) * (weight * stages.output);
        }
    });
    sums.map(|sum| sum / f64::from(count))
}

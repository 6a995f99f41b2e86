//! The circuit of an experiment file, and the signal through it.

use super::settings::{ScannerHardware, acceleration_density};
use super::simulation::{Sensing, SimulatedSensor};
use crate::circuit::{
    Adequacy, AdequacyError, AdequacySettings, AmplitudeDetector, Chain, Circuit, CircuitInputs, HighPass,
    SAMPLES_PER_CARRIER_CYCLE,
};
use crate::config::{ConfigError, ConfigFault, Experiment, Key, Quantity, Simulate};
use crate::shared_scanner::device::SharedScanner;
use crate::shared_scanner::device::{DetectorSource, ModulatedCircuit};
use crate::simulate::{Drive, Simulator, WhiteNoise};
use kalmems_core::Portable;
use kalmems_models::circuit::{DiodeEnvelope, SquareLaw, SynchronousDemodulator, Transimpedance};
use kalmems_models::dynamics::ParametricScanner;
use std::f64::consts::TAU;

/// The circuit and its carrier, as an experiment file describes them.
#[derive(Clone, Copy, Debug)]
pub struct SensingCircuit {
    circuit: Circuit,
    carrier: f64,
    carrier_hz: f64,
    /// That of the amplifier's noise, where noise is wanted.
    seed: Option<u64>,
}

/// The stream of the amplifier's noise.
const AMPLIFIER_NOISE: u64 = 1;

/// The error of phase at which an image of 300 pixels is one pixel off (Chen et al., shared electrodes, 2020, section II
/// A).
const ONE_PIXEL_DEG: f64 = 0.38;

impl SensingCircuit {
    /// Reads and checks what the file says.
    pub fn of(experiment: &Experiment, simulate: &Simulate, drive: &Drive) -> Result<Self, ConfigError> {
        let missing = || {
            let key = Key::from("device").child("shared_scanner").child("circuit");
            let remedy = "describe the circuit, or simulate without one".to_owned();
            experiment.error(key, ConfigFault::MissingKey { remedy })
        };
        let device = experiment.device::<SharedScanner>()?;
        let described = device.circuit.as_ref().ok_or_else(missing)?;
        let integration_rate_hz = simulate.integration_rate.si();
        let at = |keys: &[&str], fault: ConfigFault| {
            Err(experiment
                .error(keys[1..].iter().fold(Key::from(keys[0]), |key, name| key.child(name)), fault))
        };
        let Some(frequency) = &device.carrier.frequency else {
            let remedy = "a circuit needs the carrier; write `frequency = \"500 kHz\"`".to_owned();
            return at(
                &["device", "shared_scanner", "carrier", "frequency"],
                ConfigFault::MissingKey { remedy },
            );
        };
        let carrier_hz = frequency.si();
        if drive.slope(0.0).is_none() {
            let why = "the circuit takes the derivative of the drive, which a square wave and a recording do not have; \
                       simulate with a constant, a sine or a sweep, or without `[device.shared_scanner.circuit]`"
                .to_owned();
            return at(&["simulate", "drive"], ConfigFault::Value { why });
        }
        let least_hz = SAMPLES_PER_CARRIER_CYCLE * carrier_hz;
        if integration_rate_hz < least_hz * (1.0 - 1e-9) {
            let why = format!(
                "the circuit needs {SAMPLES_PER_CARRIER_CYCLE} steps per cycle of the carrier; write at least `{} MHz`",
                least_hz / 1e6
            );
            return at(&["simulate", "integration_rate"], ConfigFault::Value { why });
        }
        let Some(circuit) = circuit_of(described) else {
            let why = "a high-pass has 1 to 8 poles".to_owned();
            return at(
                &["device", "shared_scanner", "circuit", "high_pass", "order"],
                ConfigFault::Value { why },
            );
        };
        let settling = settling_s(&circuit) * integration_rate_hz;
        if settling > MOST_SETTLING {
            let why = format!(
                "the circuit settles over {settling:.1e} steps of `integration_rate`; expected up to {MOST_SETTLING:.0e}"
            );
            return at(&["device", "shared_scanner", "circuit"], ConfigFault::Value { why });
        }
        let seed = simulate.noise.then_some(simulate.seed);
        Ok(Self { circuit, carrier: device.carrier.amplitude.si(), carrier_hz, seed })
    }

    /// What a filter needs to know of it. `acceleration_density` is that of the filter.
    pub fn adequacy(
        &self,
        hardware: &ScannerHardware,
        (drive, start): (&Drive, [f64; 2]),
        acceleration_density: f64,
    ) -> Result<Adequacy, AdequacyError> {
        let setting = AdequacySettings {
            acceleration_density,
            noise_variance: hardware.noise_variance,
            carrier: self.carrier,
            carrier_hz: self.carrier_hz,
            permitted_phase_deg: ONE_PIXEL_DEG,
        };
        Adequacy::of(&self.circuit, &hardware.scanner, (drive, start), &setting)
    }
}

/// More than 30 time constants of the slowest stage, in s.
fn settling_s(circuit: &Circuit) -> f64 {
    let slowest_hz = circuit.low_pass_hz.into_iter().fold(f64::INFINITY, f64::min);
    let discharge_s = match circuit.detector {
        AmplitudeDetector::Diode(diode) => diode.load_resistance * diode.load_capacitance,
        AmplitudeDetector::SquareLaw(_) | AmplitudeDetector::Synchronous(_) => 0.0,
    };
    30.0 * discharge_s.max(1.0 / (TAU * slowest_hz))
}

/// Steps within which a circuit settles, at most: 1 s at 100 MHz.
const MOST_SETTLING: f64 = 1e8;

/// What is said of a circuit that no filter's model could be found for.
pub fn not_reduced(why: &dyn std::fmt::Display) -> String {
    format!("the circuit is not reduced to a filter's model: {why}")
}

/// q of a filter where the file describes none.
const USUAL_DENSITY: f64 = 1e4;

/// q of the first filter that the file describes, for which the circuit's model is judged.
pub fn density_asked(experiment: &Experiment) -> Result<f64, ConfigError> {
    let Some(estimate) = &experiment.estimate else { return Ok(USUAL_DENSITY) };
    let Some(first) = estimate.filters.iter().position(|filter| filter.method.claims()) else {
        return Ok(USUAL_DENSITY);
    };
    acceleration_density(experiment, estimate, first)
}

/// The circuit in SI.
fn circuit_of(described: &ModulatedCircuit) -> Option<Circuit> {
    let [first, second] = &described.low_pass;
    Some(Circuit {
        transimpedance: Transimpedance {
            feedback_resistance: described.feedback_resistance.si(),
            parasitic_capacitance: described.parasitic_capacitance.si(),
        },
        amplifier_bandwidth_hz: described.amplifier_bandwidth.as_ref().map(Quantity::si),
        high_pass: HighPass::new(described.high_pass.order, described.high_pass.cutoff.si())?,
        detector: match &described.detector {
            DetectorSource::SquareLaw(law) => {
                AmplitudeDetector::SquareLaw(SquareLaw { linear: law.linear.si(), square: law.square.si() })
            }
            DetectorSource::Diode(diode) => AmplitudeDetector::Diode(DiodeEnvelope {
                forward_drop: diode.forward_drop.si(),
                series_resistance: diode.series_resistance.si(),
                load_resistance: diode.load_resistance.si(),
                load_capacitance: diode.load_capacitance.si(),
            }),
            DetectorSource::Synchronous(law) => {
                AmplitudeDetector::Synchronous(SynchronousDemodulator { phase: law.phase.si() })
            }
        },
        low_pass_hz: [first.si(), second.si()],
        noise_density: described.noise_density.si(),
    })
}

impl SimulatedSensor<ParametricScanner<f64>, 2> for SensingCircuit {
    type Sensing<'a> = Circuitry<'a>;

    /// The circuit as it is when it has been on for long while the device was held where it starts.
    fn begin<'a>(
        &'a self,
        scanner: &'a ParametricScanner<f64>,
        drive: &'a Drive,
        rate_hz: f64,
        start: &[f64; 2],
    ) -> Circuitry<'a> {
        let noise = self.seed.map(|seed| WhiteNoise::new(seed, AMPLIFIER_NOISE));
        let chain = Chain::new(&self.circuit, self.carrier_hz, rate_hz);
        let mut sensing = Circuitry { chain, circuit: self, scanner, drive, noise, output: 0.0 };
        #[allow(clippy::cast_possible_truncation)] // at most MOST_SETTLING
        let steps = (settling_s(&self.circuit) * rate_hz).ceil() as i64;
        for k in -steps..=0 {
            sensing.step(&[start[0], 0.0], k as f64 / rate_hz);
        }
        sensing
    }
}

/// A [`SensingCircuit`] at work.
pub struct Circuitry<'a> {
    chain: Chain,
    circuit: &'a SensingCircuit,
    scanner: &'a ParametricScanner<f64>,
    drive: &'a Drive,
    noise: Option<WhiteNoise>,
    /// y_cap in V.
    output: f64,
}

impl Sensing<ParametricScanner<f64>, 2> for Circuitry<'_> {
    fn follow(&mut self, simulator: &Simulator<ParametricScanner<f64>, 2>) {
        self.step(simulator.state(), simulator.time_s());
    }

    fn sample(&mut self, _: &[f64; 2]) -> f64 {
        self.output
    }
}

impl Circuitry<'_> {
    fn step(&mut self, &[angle, rate]: &[f64; 2], time_s: f64) {
        let SensingCircuit { carrier, carrier_hz, .. } = *self.circuit;
        let cycles = carrier_hz * time_s;
        let (sine, cosine) = (TAU * (cycles - cycles.floor())).portable_sin_cos();
        let drive_slope = self.drive.slope(time_s).unwrap_or(f64::NAN);
        let noise = self.noise.as_mut().map_or(0.0, |noise| self.chain.noise() * noise.sample());
        let comb = &self.scanner.comb;
        let stages = self.chain.step(&CircuitInputs {
            capacitance: comb.capacitance(angle),
            capacitance_rate: comb.slope(angle) * rate,
            voltage: self.drive.at(time_s) + carrier * sine,
            voltage_rate: drive_slope + TAU * carrier_hz * carrier * cosine,
            carrier_cycles: cycles,
            noise,
        });
        self.output = stages.output;
    }
}

//! A recording of the scanner that is computed.

use super::circuit::{SensingCircuit, density_asked, not_reduced};
use super::past::DelayedState;
use super::settings::{ScannerHardware, state_at};
use crate::config::{ConfigError, ConfigFault, DriveSource, Experiment, Key, Simulate, Values};
use crate::recording::RecordingSource;
use crate::shared_scanner::device::SharedScanner;
use crate::simulate::{
    Converter, Drive, SimulateError, SimulatedColumn, SimulatedSample, Simulation, Simulator, Stability,
    WhiteNoise, drive_of,
};
use kalmems_core::{Dynamics, Measurement};
use std::ops::ControlFlow;

/// What makes a signal of a motion.
pub trait SimulatedSensor<D, const N: usize> {
    /// The sensor at work.
    type Sensing<'a>: Sensing<D, N>
    where
        Self: 'a,
        D: 'a;

    /// Begins where the device does.
    fn begin<'a>(
        &'a self,
        dynamics: &'a D,
        drive: &'a Drive,
        rate_hz: f64,
        start: &[f64; N],
    ) -> Self::Sensing<'a>;
}

/// A sensor beside a device that is being integrated.
pub trait Sensing<D, const N: usize> {
    /// Follows the device by one step.
    fn follow(&mut self, simulator: &Simulator<D, N>);

    /// The next sample of the signal in V.
    fn sample(&mut self, state: &[f64; N]) -> f64;
}

/// A readout that is a function of the state as it was a constant time ago, with white noise.
pub struct NoisyReadout<H> {
    law: H,
    delay_s: f64,
    /// The standard deviation of the noise in V.
    noise: f64,
    seed: u64,
}

impl<H> NoisyReadout<H> {
    /// The readout so many seconds late, with noise of this variance in V², where the file wants noise.
    pub fn new(law: H, delay_s: f64, noise_variance: f64, simulate: &Simulate) -> Self {
        let noise = if simulate.noise { noise_variance.sqrt() } else { 0.0 };
        Self { law, delay_s, noise, seed: simulate.seed }
    }
}

impl<D: Dynamics<f64, N, Input = f64> + Copy, H: Measurement<f64, N, 1>, const N: usize> SimulatedSensor<D, N>
    for NoisyReadout<H>
{
    type Sensing<'a>
        = SimulatedReadout<'a, H, N>
    where
        Self: 'a,
        D: 'a;

    fn begin<'a>(
        &'a self,
        _: &'a D,
        _: &'a Drive,
        rate_hz: f64,
        start: &[f64; N],
    ) -> SimulatedReadout<'a, H, N> {
        SimulatedReadout {
            readout: self,
            past: DelayedState::new(start, self.delay_s * rate_hz),
            noise: WhiteNoise::new(self.seed, SIGNAL_NOISE),
        }
    }
}

/// A [`NoisyReadout`] at work.
pub struct SimulatedReadout<'a, H, const N: usize> {
    readout: &'a NoisyReadout<H>,
    past: DelayedState<N>,
    noise: WhiteNoise,
}

impl<D: Dynamics<f64, N, Input = f64> + Copy, H: Measurement<f64, N, 1>, const N: usize> Sensing<D, N>
    for SimulatedReadout<'_, H, N>
{
    fn follow(&mut self, simulator: &Simulator<D, N>) {
        self.past.push(simulator.state());
    }

    fn sample(&mut self, _: &[f64; N]) -> f64 {
        let [clean] = self.readout.law.predict(&self.past.state());
        clean + self.readout.noise * self.noise.sample()
    }
}

/// A scanner of one axis or two under a drive, and what is read of it, rounded where there is a converter.
pub struct ScannerSimulation<D, Z, const N: usize> {
    dynamics: D,
    sensor: Z,
    drive: Drive,
    sources: Vec<RecordingSource>,
    start: [f64; N],
    integration_rate_hz: f64,
    steps_per_sample: u64,
    samples: u64,
    sampling_rate_hz: f64,
    converter: Option<Converter>,
    truth: &'static [SimulatedColumn],
    outlook: Option<String>,
}

/// The simulation of the scanner of one axis: its signal comes through the circuit where the file describes one.
pub fn simulation(experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
    let hardware = ScannerHardware::of(experiment)?;
    let scanner = hardware.scanner;
    let stability = |drive: &Drive| Stability::of(&scanner, drive).map(|stability| stability.to_string());
    let start = |key: &str, values: &Values| state_at(experiment, key, values);
    let truth = &SimulatedColumn::ANGLE_AND_RATE;
    if experiment.device::<SharedScanner>()?.circuit.is_some() {
        let density = density_asked(experiment)?;
        let circuit = |simulate: &Simulate, drive: &Drive| SensingCircuit::of(experiment, simulate, drive);
        let outlook = |circuit: &SensingCircuit, drive: &Drive, start: [f64; 2]| {
            let circuit = match circuit.adequacy(&hardware, (drive, start), density) {
                Ok(adequacy) => adequacy.to_string(),
                Err(why) => not_reduced(&why),
            };
            Some(stability(drive).map_or(circuit.clone(), |stability| format!("{stability}\n{circuit}")))
        };
        return Ok(Box::new(ScannerSimulation::of(experiment, scanner, circuit, start, truth, outlook)?));
    }
    let readout = |simulate: &Simulate, _: &Drive| {
        Ok(NoisyReadout::new(hardware.readout, hardware.delay_s, hardware.noise_variance, simulate))
    };
    let outlook = |_: &NoisyReadout<_>, drive: &Drive, _: [f64; 2]| stability(drive);
    Ok(Box::new(ScannerSimulation::of(experiment, scanner, readout, start, truth, outlook)?))
}

impl<D, Z, const N: usize> ScannerSimulation<D, Z, N> {
    /// Reads and checks what the file says of the simulation.
    pub fn of(
        experiment: &Experiment,
        dynamics: D,
        sensor: impl FnOnce(&Simulate, &Drive) -> Result<Z, ConfigError>,
        start: impl FnOnce(&str, &Values) -> Result<[f64; N], ConfigError>,
        truth: &'static [SimulatedColumn],
        outlook: impl FnOnce(&Z, &Drive, [f64; N]) -> Option<String>,
    ) -> Result<Self, SimulateError> {
        let Some(simulate) = &experiment.simulate else {
            let remedy =
                "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start` \
                          and one drive, such as `[simulate.drive.sine]`"
                    .to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }).into());
        };
        let recorded = matches!(simulate.drive, DriveSource::Recorded(_));
        if experiment.device::<SharedScanner>()?.carrier.included_in_drive && !recorded {
            let why = "a drive that is computed has no carrier in it; write `false`, or simulate with a recorded drive";
            let key = ["shared_scanner", "carrier", "included_in_drive"];
            let key = key.into_iter().fold(Key::from("device"), Key::child);
            return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }).into());
        }
        let start = start("simulate.start", &simulate.start)?;
        let (drive, source) = drive_of(experiment, simulate)?;
        let sensor = sensor(simulate, &drive)?;
        Ok(Self {
            dynamics,
            outlook: outlook(&sensor, &drive, start),
            sensor,
            truth,
            drive,
            sources: source.into_iter().collect(),
            start,
            integration_rate_hz: simulate.integration_rate.si(),
            steps_per_sample: simulate.steps_per_sample(),
            samples: simulate.samples(),
            sampling_rate_hz: simulate.sampling_rate.si(),
            converter: simulate.adc.as_ref().map(Converter::of),
        })
    }
}

/// What is recorded.
pub const RECORDED: [SimulatedColumn; 2] = [
    SimulatedColumn { meaning: "drive", column: "drive_V" },
    SimulatedColumn { meaning: "signal", column: "cap_V" },
];

/// The stream of the readout's noise.
pub const SIGNAL_NOISE: u64 = 0;

impl<D, Z, const N: usize> Simulation for ScannerSimulation<D, Z, N>
where
    D: Dynamics<f64, N, Input = f64> + Copy,
    Z: SimulatedSensor<D, N>,
{
    fn recorded(&self) -> &[SimulatedColumn] {
        &RECORDED
    }

    fn truth(&self) -> &[SimulatedColumn] {
        self.truth
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn sources(&self) -> &[RecordingSource] {
        &self.sources
    }

    fn outlook(&self) -> Option<String> {
        self.outlook.clone()
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let mut simulator =
            Simulator::new(self.dynamics, self.drive.clone(), self.integration_rate_hz, self.start);
        let mut sensing =
            self.sensor.begin(&self.dynamics, &self.drive, self.integration_rate_hz, &self.start);
        for k in 0..self.samples {
            if k > 0 {
                for _ in 0..self.steps_per_sample {
                    simulator.step();
                    sensing.follow(&simulator);
                }
            }
            let time_s = k as f64 / self.sampling_rate_hz;
            if !simulator.state().iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let analogue = sensing.sample(simulator.state());
            let signal = self.converter.map_or(analogue, |converter| converter.round(analogue));
            let sample =
                SimulatedSample { time_s, recorded: &[simulator.drive(), signal], truth: simulator.state() };
            if each(&sample).is_break() {
                return Err(SimulateError::Interrupted);
            }
        }
        Ok(())
    }
}

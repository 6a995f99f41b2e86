//! A recording of the scanner that is computed.

use super::settings::{Hardware, state_at};
use crate::config::{ConfigError, Device, DriveSource, Experiment, Fault, Key, Values};
use crate::recording::Source;
use crate::simulate::{
    Channel, Drive, Sample, SimulateError, Simulation, Simulator, Stability, WhiteNoise, drive_of,
};
use kalmems_core::{Dynamics, Measurement};
use std::ops::ControlFlow;

/// A scanner of one axis or two under a drive, and what is read of it: the demodulated signal with white noise, rounded
/// where there is a converter.
pub struct ScannerSimulation<D, H, const N: usize> {
    dynamics: D,
    readout: H,
    drive: Drive,
    sources: Vec<Source>,
    start: [f64; N],
    integration_rate_hz: f64,
    steps_per_sample: u64,
    samples: u64,
    sampling_rate_hz: f64,
    /// The standard deviation of the noise in V.
    noise: f64,
    seed: u64,
    converter: Option<Converter>,
    truth: &'static [Channel],
    outlook: Option<String>,
}

/// The simulation of the scanner of one axis.
pub fn simulation(experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
    let Hardware { scanner, readout, noise_variance } = Hardware::of(experiment)?;
    let outlook = |drive: &Drive| Stability::of(&scanner, drive).map(|stability| stability.to_string());
    let start = |key: &str, values: &Values| state_at(experiment, key, values);
    let simulation = ScannerSimulation::of(
        experiment,
        (scanner, readout, noise_variance),
        start,
        &[
            Channel { meaning: "angle", column: "angle_rad" },
            Channel { meaning: "rate", column: "rate_rad_per_s" },
        ],
        outlook,
    )?;
    Ok(Box::new(simulation))
}

impl<D, H, const N: usize> ScannerSimulation<D, H, N> {
    /// Reads and checks what the file says of the simulation.
    pub fn of(
        experiment: &Experiment,
        (dynamics, readout, noise_variance): (D, H, f64),
        start: impl FnOnce(&str, &Values) -> Result<[f64; N], ConfigError>,
        truth: &'static [Channel],
        outlook: impl FnOnce(&Drive) -> Option<String>,
    ) -> Result<Self, SimulateError> {
        let Some(simulate) = &experiment.simulate else {
            let remedy =
                "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start` \
                          and one drive, such as `[simulate.drive.sine]`"
                    .to_owned();
            return Err(experiment.error("simulate", Fault::MissingKey { remedy }).into());
        };
        let recorded = matches!(simulate.drive, DriveSource::Recorded(_));
        if let Device::SharedScanner(device) = &experiment.device
            && device.carrier.included_in_drive
            && !recorded
        {
            let why = "a drive that is computed has no carrier in it; write `false`, or simulate with a recorded drive";
            let key = ["shared_scanner", "carrier", "included_in_drive"];
            let key = key.into_iter().fold(Key::from("device"), Key::child);
            return Err(experiment.error(key, Fault::Value { why: why.to_owned() }).into());
        }
        let start = start("simulate.start", &simulate.start)?;
        let (drive, source) = drive_of(experiment, simulate)?;
        Ok(Self {
            dynamics,
            readout,
            outlook: outlook(&drive),
            truth,
            drive,
            sources: source.into_iter().collect(),
            start,
            integration_rate_hz: simulate.integration_rate.si(),
            steps_per_sample: simulate.steps_per_sample(),
            samples: simulate.samples(),
            sampling_rate_hz: simulate.sampling_rate.si(),
            noise: if simulate.noise { noise_variance.sqrt() } else { 0.0 },
            seed: simulate.seed,
            converter: simulate.adc.as_ref().map(|adc| Converter {
                low: adc.low.si(),
                high: adc.high.si(),
                steps: ((1_u64 << adc.bits) - 1) as f64,
            }),
        })
    }
}

/// The stream of the readout's noise.
const SIGNAL_NOISE: u64 = 0;

impl<D, H, const N: usize> Simulation for ScannerSimulation<D, H, N>
where
    D: Dynamics<f64, N, Input = f64> + Copy,
    H: Measurement<f64, N, 1>,
{
    fn recorded(&self) -> &'static [Channel] {
        &[Channel { meaning: "drive", column: "drive_V" }, Channel { meaning: "signal", column: "cap_V" }]
    }

    fn truth(&self) -> &'static [Channel] {
        self.truth
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn sources(&self) -> &[Source] {
        &self.sources
    }

    fn outlook(&self) -> Option<String> {
        self.outlook.clone()
    }

    fn run(&self, each: &mut dyn FnMut(&Sample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let mut simulator =
            Simulator::new(self.dynamics, self.drive.clone(), self.integration_rate_hz, self.start);
        let mut noise = WhiteNoise::new(self.seed, SIGNAL_NOISE);
        for k in 0..self.samples {
            if k > 0 {
                for _ in 0..self.steps_per_sample {
                    simulator.step();
                }
            }
            let time_s = k as f64 / self.sampling_rate_hz;
            if !simulator.state().iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let [clean] = self.readout.predict(simulator.state());
            let noisy = clean + self.noise * noise.sample();
            let signal = self.converter.map_or(noisy, |converter| converter.round(noisy));
            let sample = Sample { time_s, recorded: &[simulator.drive(), signal], truth: simulator.state() };
            if each(&sample).is_break() {
                return Err(SimulateError::Interrupted);
            }
        }
        Ok(())
    }
}

/// A converter of equidistant levels.
#[derive(Clone, Copy, Debug)]
struct Converter {
    low: f64,
    high: f64,
    steps: f64,
}

impl Converter {
    fn round(self, volts: f64) -> f64 {
        let step = (self.high - self.low) / self.steps;
        self.low + step * ((volts - self.low) / step).round().clamp(0.0, self.steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_converter_rounds_to_its_levels_and_clips() {
        let converter = Converter { low: -1.0, high: 2.0, steps: 3.0 };
        let rounded = [-5.0, -1.4, -0.6, -0.4, 0.9, 1.6, 9.0].map(|volts| converter.round(volts));
        assert_eq!(rounded, [-1.0, -1.0, -1.0, 0.0, 1.0, 2.0, 2.0]);
    }
}

//! A run of the accelerometer: open, in its loop, or with an observer in the loop.

use super::settings::AccelerometerHardware;
use super::varied_instrument::{VariedInstrument, settled};
use crate::simulate::{Drive, SimulateError, WhiteNoise};
use kalmems_core::{
    Covariance, Dynamics, FilterError, FixedGain, HeldEtdrk4, LinearProcess, Mat, Measurement, NoiseDensity,
    OperatingPoint, Process, Scalar, Scaled, Scales,
};
use kalmems_models::control::{Comparator, LoopStop, RebalanceLoop, SampledRebalance};
use kalmems_models::dynamics::{Accelerometer, SensedAcceleration};
use kalmems_models::readout::DifferentialReadout;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A simulated run of the accelerometer: all that it follows from.
#[derive(Clone, Debug)]
pub struct AccelerometerRun {
    /// The device and its noise.
    pub hardware: AccelerometerHardware,
    /// Its loop; that of a controller of zeros for an open one.
    pub closed: RebalanceLoop<f64>,
    /// When the controller acts, and how.
    pub acting: ControllerTiming,
    /// What the controller acts on.
    pub observer: ControllerInput,
    /// What is to be measured.
    pub acceleration: Acceleration,
    /// How many samples.
    pub samples: u64,
    /// Between two of them, in s.
    pub interval_s: f64,
    /// Integration steps per sample.
    pub steps: u32,
    /// Whether readout and molecules are noisy.
    pub noise: bool,
    /// The frequency of a carrier in full; `None` for its mean square.
    pub carrier_hz: Option<f64>,
    /// What is added to the feedback of a sampled controller.
    pub dither: Option<Drive>,
    /// Of the noise, and of an acceleration by chance.
    pub seed: u64,
}

/// When a controller acts, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControllerTiming {
    /// Once per sample.
    Sampled,
    /// At every step of the integration.
    Continuously,
    /// Once per sample, by one bit of its output.
    OneBit(Comparator),
}

/// What a controller acts on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControllerInput {
    /// The output.
    Output,
    /// What a settled filter makes of it that has the acceleration as a state.
    Estimate,
    /// What a settled filter makes of it that is told the acceleration: the thesis's.
    Told,
}

/// What is to be measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Acceleration {
    /// In m/s² and Hz.
    Sine {
        /// In m/s².
        amplitude: f64,
        /// In Hz.
        frequency_hz: f64,
    },
    /// As the device's prior says.
    Chance,
}

/// One sample of a run, with the truth behind it.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// In s.
    pub time_s: f64,
    /// What is to be measured, in m/s².
    pub acceleration: f64,
    /// Of the mass, in m.
    pub displacement: f64,
    /// Of the mass, in m/s.
    pub velocity: f64,
    /// The readout with its noise, in V.
    pub output: f64,
    /// What the controller acts on, in V.
    pub seen: f64,
    /// What is applied until the next sample, in V; its mean where the controller acts between.
    pub feedback: f64,
}

/// The streams of the three noises.
const SIGNAL_NOISE: u64 = 0;
const FORCE_NOISE: u64 = 1;
const ACCELERATION: u64 = 2;

impl AccelerometerRun {
    /// Every sample to `each`, until it breaks off.
    pub fn follow(&self, each: &mut dyn FnMut(&Moment) -> ControlFlow<()>) -> Result<(), SimulateError> {
        match (self.acting, self.observer) {
            (ControllerTiming::Continuously, _) => self.continuous(each),
            (_, ControllerInput::Output) => self.sampled(&mut NoLoopFilter, each),
            (_, ControllerInput::Estimate) => {
                self.sampled(&mut SettledFilter::sensed(&self.hardware, self.interval_s)?, each)
            }
            (_, ControllerInput::Told) => {
                self.sampled(&mut SettledFilter::told(&self.hardware, self.interval_s)?, each)
            }
        }
    }

    fn sampled(
        &self,
        observer: &mut dyn LoopFilter,
        each: &mut dyn FnMut(&Moment) -> ControlFlow<()>,
    ) -> Result<(), SimulateError> {
        let accelerations = self.accelerations();
        let mut run = self.start(self.interval_s, self.steps);
        let (mut signal_noise, mut force_noise) = self.noises();
        let (noise_sd, force_sd) = self.sizes(&run, 1.0);
        let mut forces = vec![0.0; self.steps as usize];
        for (k, acceleration) in accelerations.iter().enumerate() {
            let output = run.read(noise_sd * signal_noise.sample());
            let seen = observer.see(output);
            let time_s = k as f64 * self.interval_s;
            let feedback = run.answer(seen) + self.dither.as_ref().map_or(0.0, |dither| dither.at(time_s));
            emit(each, self.moment(k, *acceleration, run.state(), [output, seen, feedback]))?;
            observer.expect(*acceleration, feedback);
            let Some(next) = accelerations.get(k + 1) else { break };
            for force in &mut forces {
                *force = force_sd * force_noise.sample();
            }
            run.advance(feedback, [*acceleration, *next], &forces).map_err(|why| pulled_in(&why))?;
        }
        Ok(())
    }

    /// The controller meets the noise of its own band: of the same density, and so of `steps` times the variance.
    fn continuous(&self, each: &mut dyn FnMut(&Moment) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let accelerations = self.accelerations();
        let steps = f64::from(self.steps);
        let mut run = self.start(self.interval_s / steps, 1);
        let (mut signal_noise, mut force_noise) = self.noises();
        let (noise_sd, force_sd) = self.sizes(&run, steps);
        for (k, acceleration) in accelerations.iter().enumerate() {
            let (before, state) = (run.read(0.0), *run.state());
            let Some(next) = accelerations.get(k + 1) else {
                let output = before + noise_sd / steps.sqrt() * signal_noise.sample();
                let feedback = run.answer(output);
                return emit(each, self.moment(k, *acceleration, &state, [output, output, feedback]));
            };
            let (mut feedback, mut noise) = (0.0, 0.0);
            for step in 0..self.steps {
                let drawn = noise_sd * signal_noise.sample();
                let applied = run.answer(run.read(drawn));
                (feedback, noise) = (feedback + applied / steps, noise + drawn / steps);
                let at = |passed: u32| acceleration + (next - acceleration) * f64::from(passed) / steps;
                run.advance(applied, [at(step), at(step + 1)], &[force_sd * force_noise.sample()])
                    .map_err(|why| pulled_in(&why))?;
            }
            let output = before + noise;
            emit(each, self.moment(k, *acceleration, &state, [output, output, feedback]))?;
        }
        Ok(())
    }

    fn start(&self, interval_s: f64, steps: u32) -> SampledRebalance {
        let mut run = SampledRebalance::new(&self.closed, interval_s, steps);
        if let ControllerTiming::OneBit(comparator) = self.acting {
            run = run.with_comparator(comparator);
        }
        match self.carrier_hz {
            Some(carrier_hz) => run.with_carrier(carrier_hz),
            None => run,
        }
    }

    fn noises(&self) -> (WhiteNoise, WhiteNoise) {
        (WhiteNoise::new(self.seed, SIGNAL_NOISE), WhiteNoise::new(self.seed, FORCE_NOISE))
    }

    /// The standard deviations of a reading and of a step's force.
    fn sizes(&self, run: &SampledRebalance, readings: f64) -> (f64, f64) {
        if !self.noise {
            return (0.0, 0.0);
        }
        ((self.hardware.noise_variance * readings).sqrt(), run.force_sd(self.hardware.force_density))
    }

    fn moment(&self, k: usize, acceleration: f64, state: &[f64; 2], volts: [f64; 3]) -> Moment {
        let [displacement, velocity] = *state;
        let [output, seen, feedback] = volts;
        let time_s = k as f64 * self.interval_s;
        Moment { time_s, acceleration, displacement, velocity, output, seen, feedback }
    }

    /// The acceleration at all samples in m/s².
    fn accelerations(&self) -> Vec<f64> {
        let prior = self.hardware.sensed.prior;
        match self.acceleration {
            Acceleration::Sine { amplitude, frequency_hz } => (0..self.samples)
                .map(|k| amplitude * Scalar::sin(TAU * frequency_hz * k as f64 * self.interval_s))
                .collect(),
            Acceleration::Chance => {
                let mut noise = WhiteNoise::new(self.seed, ACCELERATION);
                let rate = prior.rate;
                let system = Mat([[0.0, 1.0], [-rate * rate, -2.0 * prior.damping_ratio * rate]]);
                let density = NoiseDensity::none().on::<1>(prior.density());
                let process =
                    LinearProcess::<f64, 2, 0>::exact(&system, &Mat::zero(), &density, self.interval_s);
                let root = process.noise.root();
                let mut state = [prior.rms * noise.sample(), prior.rms * rate * noise.sample()];
                let mut values = Vec::new();
                for _ in 0..self.samples {
                    values.push(state[0]);
                    let white = [noise.sample(), noise.sample()];
                    let pushed: [f64; 2] = root.times_vector(&white);
                    let moved = process.step(&state, &[]);
                    state = [moved[0] + pushed[0], moved[1] + pushed[1]];
                }
                values
            }
        }
    }
}

fn emit(each: &mut dyn FnMut(&Moment) -> ControlFlow<()>, moment: Moment) -> Result<(), SimulateError> {
    if each(&moment).is_break() { Err(SimulateError::Interrupted) } else { Ok(()) }
}

fn pulled_in(stopped: &LoopStop) -> SimulateError {
    SimulateError::PulledIn { why: stopped.to_string() }
}

/// What stands between the output and the controller.
trait LoopFilter {
    /// What the controller gets of an output, in V.
    fn see(&mut self, output: f64) -> f64;

    /// To the next sample under an acceleration in m/s², which most do not know, and a feedback in V.
    fn expect(&mut self, acceleration: f64, feedback: f64);
}

/// Nothing.
struct NoLoopFilter;

impl LoopFilter for NoLoopFilter {
    fn see(&mut self, output: f64) -> f64 {
        output
    }

    fn expect(&mut self, _: f64, _: f64) {}
}

/// What a model takes of what happens until the next sample.
trait StepInput {
    fn of(acceleration: f64, feedback: f64) -> Self;
}

/// What is recorded and nothing else.
impl StepInput for f64 {
    fn of(_: f64, feedback: f64) -> Self {
        feedback
    }
}

/// What is to be measured, too.
impl StepInput for [f64; 2] {
    fn of(acceleration: f64, feedback: f64) -> Self {
        [acceleration, feedback]
    }
}

/// A settled Kalman filter in the loop, in states of their own scales.
struct SettledFilter<D, const N: usize> {
    process: HeldEtdrk4<Scaled<D, f64, N>, f64, N>,
    readout: Scaled<DifferentialReadout<f64>, f64, N>,
    filter: FixedGain<f64, N, 1>,
}

impl SettledFilter<SensedAcceleration<f64>, 4> {
    /// One that has the acceleration as a state.
    fn sensed(hardware: &AccelerometerHardware, interval_s: f64) -> Result<Self, SimulateError> {
        let found = settled(hardware, interval_s).map_err(|why| SimulateError::NoObserver { why })?;
        let (VariedInstrument { process, readout, .. }, filter) = found;
        Ok(Self { process, readout, filter })
    }
}

impl SettledFilter<Accelerometer<f64>, 2> {
    /// One that is told it.
    fn told(hardware: &AccelerometerHardware, interval_s: f64) -> Result<Self, SimulateError> {
        let none = |why: String| SimulateError::NoObserver { why };
        let device = hardware.sensed.device;
        let scales = Scales::natural(&device).map_err(|why| none(why.to_string()))?;
        let brownian = device.mass.acceleration_density(hardware.force_density);
        let density = scales.scale_density(&NoiseDensity::none().on::<1>(brownian));
        let rest = (&[0.0; 2], &[0.0; 2]);
        let process = HeldEtdrk4::new(Scaled::new(device, scales), interval_s, &density, rest);
        let readout = Scaled::new(hardware.readout, scales);
        let noise = Covariance::from_variances([hardware.noise_variance]);
        let point = OperatingPoint::of(&process, (&readout, noise), rest);
        let filter = FixedGain::steady_state([0.0; 2], &point).map_err(|why| none(why.to_string()))?;
        Ok(Self { process, readout, filter })
    }
}

impl<D: Dynamics<f64, N, Input: StepInput> + Copy, const N: usize> LoopFilter for SettledFilter<D, N> {
    /// An output that is no number leaves it as it was.
    fn see(&mut self, output: f64) -> f64 {
        let _: Result<_, FilterError> = self.filter.update(&self.readout, &[output]);
        let [volts]: [f64; 1] = self.readout.predict(self.filter.mean());
        volts
    }

    fn expect(&mut self, acceleration: f64, feedback: f64) {
        let _ = self.filter.predict(&self.process, &D::Input::of(acceleration, feedback));
    }
}

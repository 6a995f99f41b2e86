//! Calibration records that are computed.

use super::tone::AxisSignals;
use crate::simulate::WhiteNoise;
use kalmems_core::Portable;
use kalmems_models::inertial::{SampleClock, SpecificForce, Triad};
use std::f64::consts::TAU;

/// A vibration about three axes at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vibration {
    /// In Hz.
    pub frequency_hz: f64,
    /// The amplitudes of the rates about x, y and z in rad/s.
    pub amplitude: [f64; 3],
    /// Their phases at t = 0 in rad.
    pub phase_rad: [f64; 3],
}

/// An instrument of three axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedInstrument {
    /// Its axes.
    pub triad: Triad<f64>,
    /// The standard deviation of one sample's white noise, in its unit.
    pub noise: f64,
    /// How fast its bias walks, in its unit per √s.
    pub random_walk: f64,
    /// The steps of its converter, in its unit; 0 for none.
    pub step: f64,
    /// The largest value it can show.
    pub full_scale: f64,
}

/// A unit with its clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedUnit {
    /// When it samples.
    pub clock: SampleClock<f64>,
    /// The gyroscopes.
    pub gyroscopes: SimulatedInstrument,
    /// The accelerometers, if there are any, where they are from the centre of rotation, and gravity in m/s² along the
    /// resting axes.
    pub accelerometers: Option<(SimulatedInstrument, SpecificForce<f64>, [f64; 3])>,
}

impl Vibration {
    /// ω(t) and ω̇(t) in rad/s and rad/s².
    pub fn rate(&self, time_s: f64) -> [[f64; 3]; 2] {
        let turn = TAU * self.frequency_hz;
        let at = |shift: f64| {
            std::array::from_fn(|axis| {
                self.amplitude[axis] * (turn * time_s + self.phase_rad[axis] + shift).portable_cos()
            })
        };
        let quarter = std::f64::consts::FRAC_PI_2;
        [at(0.0), at(quarter).map(|rate| rate * turn)]
    }

    /// The small angles in rad, of which the rates are the derivatives.
    pub fn tilt(&self, time_s: f64) -> [f64; 3] {
        let turn = TAU * self.frequency_hz;
        std::array::from_fn(|axis| {
            self.amplitude[axis] / turn * (turn * time_s + self.phase_rad[axis]).portable_sin()
        })
    }

    /// Samples of the rates with white noise of this standard deviation, for the axes that are wanted.
    pub fn reference(
        &self,
        times: impl Iterator<Item = f64>,
        wanted: [bool; 3],
        noise: f64,
        source: &mut WhiteNoise,
    ) -> AxisSignals {
        let mut signals =
            AxisSignals { time_s: Vec::new(), axes: wanted.map(|wanted| wanted.then(Vec::new)) };
        for t in times {
            signals.time_s.push(t);
            for (values, rate) in signals.axes.iter_mut().zip(self.rate(t)[0]) {
                if let Some(values) = values {
                    values.push(rate + noise * source.sample());
                }
            }
        }
        signals
    }
}

impl SimulatedInstrument {
    /// An ideal one.
    pub const IDEAL: Self = Self {
        triad: Triad { x: [1.0, 0.0, 0.0], y: [0.0, 1.0, 0.0], z: [0.0, 0.0, 1.0], bias: [0.0; 3] },
        noise: 0.0,
        random_walk: 0.0,
        step: 0.0,
        full_scale: f64::INFINITY,
    };

    /// What it shows of an input, with a bias that has walked so far.
    fn show(
        &self,
        input: [f64; 3],
        walked: &mut [f64; 3],
        interval_s: f64,
        source: &mut WhiteNoise,
    ) -> [f64; 3] {
        let ideal = self.triad.output(input);
        std::array::from_fn(|axis| {
            walked[axis] += self.random_walk * interval_s.sqrt() * source.sample();
            let value = ideal[axis] + walked[axis] + self.noise * source.sample();
            let stepped = if self.step > 0.0 { self.step * (value / self.step).round() } else { value };
            stepped.clamp(-self.full_scale, self.full_scale)
        })
    }
}

impl SimulatedUnit {
    /// What it records of a vibration: rates and forces, on its own nominal time.
    pub fn record(&self, vibration: &Vibration, samples: u32, source: &mut WhiteNoise) -> [AxisSignals; 2] {
        let empty = |there: bool| AxisSignals {
            time_s: Vec::new(),
            axes: std::array::from_fn(|_| there.then(Vec::new)),
        };
        let [mut rates, mut forces] = [empty(true), empty(self.accelerometers.is_some())];
        let interval_s = self.clock.true_rate().recip();
        let [mut of_rate, mut of_force] = [[0.0; 3]; 2];
        for k in 0..samples {
            let time_s = self.clock.time(f64::from(k));
            let nominal = f64::from(k) / self.clock.rate;
            let [rate, acceleration] = vibration.rate(time_s);
            push(&mut rates, nominal, self.gyroscopes.show(rate, &mut of_rate, interval_s, source));
            if let Some((instrument, force, gravity)) = &self.accelerometers {
                let tilt = vibration.tilt(time_s);
                let gravity = turned(*gravity, tilt);
                let felt = force.at(rate, acceleration, gravity);
                push(&mut forces, nominal, instrument.show(felt, &mut of_force, interval_s, source));
            }
        }
        [rates, forces]
    }
}

/// A vector at rest in the axes of a body that is turned by small angles: v − θ × v.
fn turned(v: [f64; 3], tilt: [f64; 3]) -> [f64; 3] {
    [
        v[0] - (tilt[1] * v[2] - tilt[2] * v[1]),
        v[1] - (tilt[2] * v[0] - tilt[0] * v[2]),
        v[2] - (tilt[0] * v[1] - tilt[1] * v[0]),
    ]
}

fn push(signals: &mut AxisSignals, time_s: f64, values: [f64; 3]) {
    signals.time_s.push(time_s);
    for (column, value) in signals.axes.iter_mut().zip(values) {
        if let Some(column) = column {
            column.push(value);
        }
    }
}

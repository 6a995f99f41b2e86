//! What the filters are given.

use super::{HELD_ANGLE, INTERVAL, System};
use kalmems_core::{Measurement, Nodes, NoiseDensity, Process, Rk4, Scalar};
use std::f64::consts::TAU;
use std::hint::black_box;

/// One sample.
#[derive(Clone, Copy, Debug)]
pub struct Sample<T> {
    /// The drive over the interval before it, in V.
    pub drive: Nodes<T>,
    /// The demodulated signal, in V.
    pub signal: T,
}

/// A ring-down from 0.15 rad under a small drive, seen with noise.
pub fn simulated<T: Scalar>(system: &System<f64>, length: usize) -> Vec<Sample<T>> {
    let process = Rk4::new(system.scanner, INTERVAL, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
    let drive = |k: usize, part: f64| 12.0 + 12.0 * f64::sin(TAU * 31.4e3 * (k as f64 + part) * INTERVAL);
    let mut noise = Noise::start();
    let mut truth = [0.15, 0.0];
    let samples: Vec<Sample<T>> = (0..length)
        .map(|k| {
            let nodes = Nodes { start: drive(k, 0.0), middle: drive(k, 0.5), end: drive(k, 1.0) };
            truth = process.step(&truth, &nodes);
            let [seen] = system.readout.predict(&truth);
            Sample {
                drive: Nodes {
                    start: T::of(nodes.start),
                    middle: T::of(nodes.middle),
                    end: T::of(nodes.end),
                },
                signal: T::of(seen + noise.next() * system.readout_variance.sqrt()),
            }
        })
        .collect();
    black_box(samples)
}

/// One sample of the mirror that a torque holds.
#[derive(Clone, Copy, Debug)]
pub struct HeldSample<T> {
    /// The torque over the interval before it, in N·m.
    pub torque: T,
    /// The demodulated signal, in V.
    pub signal: T,
}

/// An angle that swings by a tenth about where it is held, seen with noise.
pub fn held<T: Scalar>(system: &System<f64>, length: usize) -> Vec<HeldSample<T>> {
    let process = system.resonator();
    let stiffness = system.scanner.resonator.stiffness;
    let mut noise = Noise::start();
    let mut truth = [HELD_ANGLE, 0.0];
    let samples: Vec<HeldSample<T>> = (0..length)
        .map(|k| {
            let swing = 1.0 + 0.1 * f64::sin(TAU * 1e3 * k as f64 * INTERVAL);
            let torque = stiffness * HELD_ANGLE * swing;
            truth = process.step(&truth, &[torque]);
            let [seen] = system.readout.predict(&truth);
            HeldSample {
                torque: T::of(torque),
                signal: T::of(seen + noise.next() * system.readout_variance.sqrt()),
            }
        })
        .collect();
    black_box(samples)
}

/// Numbers of mean 0 and variance 1 (Irwin–Hall, twelve uniform ones each; xorshift, Marsaglia 2003).
pub struct Noise(u64);

impl Noise {
    pub fn start() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }

    pub fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

//! The circuit that makes a voltage of the shared electrodes' capacitance: in time, in lines, and reduced.
//!
//! A [`Circuit`] is an amplifier, a high-pass, a detector and two low-pass stages. [`Chain`] runs it step by step;
//! [`Bands`] says which lines each stage has under a steady drive and motion, without a simulation; the two are tested
//! against each other line by line. [`DriveRejection`] and [`Demodulation`] choose filters. [`ReducedCircuit`] says what of
//! it a filter needs to know, and [`Adequacy`] what it costs to know less.

mod adequacy;
mod bands;
mod chain;
mod design;
mod excitation;
mod harmonics;
mod reduced;
mod spectrum;

pub use adequacy::{Adequacy, AdequacyError, AdequacySettings, CircuitKnowledge, Cost};
pub use bands::Bands;
pub use chain::{Chain, CircuitInputs, SAMPLES_PER_CARRIER_CYCLE, Stages, run};
pub use design::{Demodulation, DesignError, DriveRejection, HighPassDesign, LowPassDesign};
pub use excitation::{Excitation, SineMotion};
pub use harmonics::{comb_harmonics, scaled_bessel};
pub use reduced::{FittedModel, ReducedCircuit};
pub use spectrum::{CircuitLine, CircuitSpectrum, Complex};

use kalmems_models::circuit::{
    Cascade, DiodeEnvelope, Section, SquareLaw, SynchronousDemodulator, Transimpedance,
};
use std::f64::consts::TAU;

/// An amplitude-modulating and demodulating circuit (Chen et al., shared electrodes, 2020, Figure 2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circuit {
    /// The amplifier.
    pub transimpedance: Transimpedance<f64>,
    /// Where the amplifier's gain has fallen by 3 dB; `None` for one that is fast enough not to matter.
    pub amplifier_bandwidth_hz: Option<f64>,
    /// What keeps the drive out.
    pub high_pass: HighPass,
    /// What makes an amplitude of the carrier.
    pub detector: AmplitudeDetector,
    /// The poles of the two low-pass stages behind the detector.
    pub low_pass_hz: [f64; 2],
    /// The density of the noise at the amplifier's output, one-sided, in V²/Hz, from 0 to half the simulation's rate. A
    /// detector that squares makes a mean of all of that band.
    pub noise_density: f64,
}

/// Butterworth's high-pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HighPass {
    order: usize,
    cutoff_hz: f64,
    cascade: Cascade<f64>,
}

impl HighPass {
    /// Of an order of 1 to 8; `None` for any other.
    pub fn new(order: usize, cutoff_hz: f64) -> Option<Self> {
        Cascade::high_pass(order, TAU * cutoff_hz).map(|cascade| Self { order, cutoff_hz, cascade })
    }

    /// How many poles it has.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Where its gain is 3 dB below 1.
    pub fn cutoff_hz(&self) -> f64 {
        self.cutoff_hz
    }

    /// Its response.
    pub fn response(&self, frequency_hz: f64) -> Complex<f64> {
        complex(self.cascade.response(TAU * frequency_hz))
    }
}

/// What makes an amplitude of the carrier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AmplitudeDetector {
    /// One that squares.
    SquareLaw(SquareLaw<f64>),
    /// A diode that charges a capacitor.
    Diode(DiodeEnvelope<f64>),
    /// One that multiplies by the carrier. The reference's phase counts from the carrier behind the high-pass: with 0
    /// the amplitude comes out whole.
    Synchronous(SynchronousDemodulator<f64>),
}

impl Circuit {
    /// The response of amplifier and high-pass.
    pub fn front_response(&self, frequency_hz: f64) -> Complex<f64> {
        self.amplifier_response(frequency_hz) * self.high_pass.response(frequency_hz)
    }

    /// The response of the amplifier's pole.
    pub fn amplifier_response(&self, frequency_hz: f64) -> Complex<f64> {
        self.amplifier_bandwidth_hz.map_or(Complex::new(1.0, 0.0), |bandwidth| {
            complex(Section::low_pass(TAU * bandwidth).response(TAU * frequency_hz))
        })
    }

    /// The response of the two low-pass stages.
    pub fn low_pass_response(&self, frequency_hz: f64) -> Complex<f64> {
        complex(self.low_pass().response(TAU * frequency_hz))
    }

    fn low_pass(&self) -> Cascade<f64> {
        Cascade::two_poles(self.low_pass_hz.map(|hz| TAU * hz))
    }
}

fn complex((re, im): (f64, f64)) -> Complex<f64> {
    Complex::new(re, im)
}

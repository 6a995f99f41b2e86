//! The drive of a regulated device, as it is synthesised.

use core::f64::consts::TAU;
use kalmems_core::{Covariance, Mat, Nodes, Process, Scalar};

/// V = V_o + V_1·sin 2α, where α goes on with the rate ω of the motion that is wanted: a parametric drive has twice the
/// motion's frequency.
///
/// Rate and amplitude may change from sample to sample; the phase goes on without a jump.
///
/// ```
/// use kalmems_models::control::Oscillator;
/// let mut drive = Oscillator { offset: 90.0, amplitude: 60.0, rate: 1e5, phase: 0.0 };
/// // An eighth of the motion's cycle later the sine is at its top.
/// drive.advance(std::f64::consts::FRAC_PI_4 / 1e5);
/// assert!((drive.voltage() - 150.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator<P> {
    /// V_o in V.
    pub offset: P,
    /// V_1 in V.
    pub amplitude: P,
    /// ω in rad/s: π times the frequency of the drive in Hz.
    pub rate: P,
    /// α in rad, from 0 to 2π: the phase of the motion whose maxima lie at every other of the drive's phases 0.
    pub phase: P,
}

impl<P: Scalar> Oscillator<P> {
    /// V now.
    pub fn voltage(&self) -> P {
        self.at(P::of(0.0))
    }

    /// V after so many seconds.
    fn at(&self, after: P) -> P {
        self.offset + self.amplitude * (self.phase + self.rate * after).twice().sin()
    }

    /// V at the start, the middle and the end of what is to come of an interval.
    pub fn nodes(&self, interval: P) -> Nodes<P> {
        Nodes { start: self.voltage(), middle: self.at(interval.half()), end: self.at(interval) }
    }

    /// So many seconds on, less than a cycle.
    pub fn advance(&mut self, interval: P) {
        let (phase, turn) = (self.phase + self.rate * interval, P::of(TAU));
        self.phase = if phase.lt(turn) { phase } else { phase - turn };
    }
}

/// What will drive a device: the input of each of the steps to come.
pub trait StepsAhead<I> {
    /// The input of the step with this number, 0 for the one that begins now.
    fn input(&self, step: u32) -> I;
}

/// A drive that goes on as it is, in steps of so many seconds.
impl<P: Scalar> StepsAhead<Nodes<P>> for (Oscillator<P>, P) {
    fn input(&self, step: u32) -> Nodes<P> {
        let (drive, interval) = self;
        let start = *interval * P::of(f64::from(step));
        Nodes {
            start: drive.at(start),
            middle: drive.at(start + interval.half()),
            end: drive.at(start + *interval),
        }
    }
}

/// The same input for ever.
impl<I: Copy> StepsAhead<Nodes<I>> for Nodes<I> {
    fn input(&self, _: u32) -> Self {
        *self
    }
}

/// How a state goes on from now, step by step.
pub trait StateStep<P, const N: usize> {
    /// The state after the step with this number, 0 for the one that begins now.
    fn step(&self, x: &[P; N], step: u32) -> [P; N];

    /// The same with its derivative by the state before.
    fn linearize(&self, x: &[P; N], step: u32) -> ([P; N], Mat<P, N, N>);

    /// What each step adds to the covariance.
    fn noise(&self) -> &Covariance<P, N>;
}

/// A process under the drive that is to come.
impl<P: Scalar, Q: Process<P, N>, A: StepsAhead<Q::Input>, const N: usize> StateStep<P, N> for (&Q, &A) {
    fn step(&self, x: &[P; N], step: u32) -> [P; N] {
        self.0.step(x, &self.1.input(step))
    }

    fn linearize(&self, x: &[P; N], step: u32) -> ([P; N], Mat<P, N, N>) {
        self.0.linearize(x, &self.1.input(step))
    }

    fn noise(&self) -> &Covariance<P, N> {
        self.0.noise().covariance()
    }
}

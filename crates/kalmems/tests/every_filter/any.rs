//! The devices of two states as one type.
//!
//! A filter dissolves into what it is used with. Met by every filter in every check, each device by itself would take
//! minutes to compile; what is chosen when the test runs is compiled once.

use crate::devices::{CombAndLight, Number, Stepped};
use kalmems_core::{
    Euler, LinearMeasurement, LinearProcess, Mat, Measurement, Nodes, Over, Process, ProcessNoise, Rk4,
    Scaled, ScaledProcess,
};
use kalmems_models::dynamics::{Duffing, ParametricScanner};
use kalmems_models::readout::DemodulatedComb;

/// A process, and what drives it over the interval before a sample.
type Driven<P, U> = (P, fn(usize) -> U);

type Scanner<T> = Rk4<ParametricScanner<T>, T, 2>;

macro_rules! one_of {
    (
        $(#[$doc:meta])* $any:ident, $ways:ident!: $($way:ident($kind:ty)),*;
    ) => {
        $(#[$doc])*
        pub enum $any<T: Number> {
            $($way($kind)),*
        }
        $(impl<T: Number> From<$kind> for $any<T> {
            fn from(one: $kind) -> Self {
                Self::$way(one)
            }
        })*
        macro_rules! $ways {
            ($self:expr, $one:ident => $what:expr) => {
                match $self {
                    $($any::$way($one) => $what),*
                }
            };
        }
    };
}

one_of! {
    /// One of the processes; its input is the sample that it leads to.
    AnyProcess, each_process!:
    Scanner(Driven<Scanner<T>, Nodes<T>>),
    ByEuler(Driven<Euler<ParametricScanner<T>, T, 2>, T>),
    Scaled(Driven<Rk4<Scaled<ParametricScanner<T>, T, 2>, T, 2>, Nodes<T>>),
    ScaledProcess(Driven<ScaledProcess<Scanner<T>, T, 2>, Nodes<T>>),
    Duffing(Driven<Rk4<Duffing<T>, T, 2>, Nodes<T>>),
    Linear(Driven<LinearProcess<T, 2, 1>, [T; 1]>);
}

impl<T: Number> Process<T, 2> for AnyProcess<T> {
    type Input = usize;

    fn step<S: Over<T>>(&self, x: &[S; 2], sample: &usize) -> [S; 2] {
        each_process!(self, driven => step(driven, x, *sample))
    }

    fn noise(&self) -> &ProcessNoise<T, 2> {
        each_process!(self, driven => driven.0.noise())
    }

    fn linearize(&self, x: &[T; 2], sample: &usize) -> ([T; 2], Mat<T, 2, 2>) {
        each_process!(self, driven => linearize(driven, x, *sample))
    }
}

#[inline(never)]
fn step<T: Number, P: Process<T, 2>, S: Over<T>>(
    (process, input): &Driven<P, P::Input>,
    x: &[S; 2],
    sample: usize,
) -> [S; 2] {
    process.step(x, &input(sample))
}

#[inline(never)]
fn linearize<T: Number, P: Process<T, 2>>(
    (process, input): &Driven<P, P::Input>,
    x: &[T; 2],
    sample: usize,
) -> ([T; 2], Mat<T, 2, 2>) {
    process.linearize(x, &input(sample))
}

one_of! {
    /// One number per sample.
    OneSensor, each_sensor!:
    Comb(DemodulatedComb<T>),
    Angle(LinearMeasurement<T, 2, 1>),
    Scaled(Scaled<DemodulatedComb<T>, T, 2>);
}

impl<T: Number> Measurement<T, 2, 1> for OneSensor<T> {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        each_sensor!(self, sensor => predict(sensor, x))
    }
}

one_of! {
    /// Two numbers per sample.
    TwoSensors, each_pair!:
    AngleAndRate(LinearMeasurement<T, 2, 2>),
    CombAndLight(CombAndLight<T>);
}

impl<T: Number> Measurement<T, 2, 2> for TwoSensors<T> {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 2] {
        each_pair!(self, sensors => predict(sensors, x))
    }
}

#[inline(never)]
fn predict<T: Number, H: Measurement<T, 2, M>, S: Over<T>, const M: usize>(sensor: &H, x: &[S; 2]) -> [S; M] {
    sensor.predict(x)
}

fn any<T, P, H, A, const M: usize>(device: Stepped<P, H, T, 2, M>) -> Stepped<AnyProcess<T>, A, T, 2, M>
where
    T: Number,
    P: Process<T, 2>,
    AnyProcess<T>: From<Driven<P, P::Input>>,
    A: From<H>,
{
    Stepped {
        process: (device.process, device.input).into(),
        input: |sample| sample,
        sensor: device.sensor.into(),
        start: device.start,
        noise: device.noise,
    }
}

/// A device with one sensor.
pub fn one<T, P, H>(device: Stepped<P, H, T, 2, 1>) -> Stepped<AnyProcess<T>, OneSensor<T>, T, 2, 1>
where
    T: Number,
    P: Process<T, 2>,
    AnyProcess<T>: From<Driven<P, P::Input>>,
    OneSensor<T>: From<H>,
{
    any(device)
}

/// A device with two sensors.
pub fn two<T, P, H>(device: Stepped<P, H, T, 2, 2>) -> Stepped<AnyProcess<T>, TwoSensors<T>, T, 2, 2>
where
    T: Number,
    P: Process<T, 2>,
    AnyProcess<T>: From<Driven<P, P::Input>>,
    TwoSensors<T>: From<H>,
{
    any(device)
}

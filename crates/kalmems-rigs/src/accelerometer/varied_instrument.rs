//! The instrument with other parameters than the experiment states, in any number.

use super::settings::AccelerometerHardware;
use crate::simulate::SimulateError;
use kalmems_core::{
    Covariance, FixedGain, HeldEtdrk4, NotAScale, NumericMeasurement, OperatingPoint, Parameters, Process,
    Scalar, Scaled, Scales,
};
use kalmems_models::dynamics::SensedAcceleration;
use kalmems_models::readout::DifferentialReadout;

/// What each parameter is multiplied by.
#[derive(Clone, Copy, Debug)]
pub struct Factors<T> {
    /// k.
    pub spring: T,
    /// b, and with it the density of the Brownian force.
    pub damping: T,
    /// m.
    pub mass: T,
    /// The variance of a sample.
    pub noise: T,
    /// The root mean square of the acceleration.
    pub acceleration: T,
    /// The natural rate of the acceleration's spectrum, 2π times its bandwidth.
    pub bandwidth: T,
}

impl<T: Scalar> Factors<T> {
    /// As the experiment states it.
    pub fn none() -> Self {
        let one = T::of(1.0);
        Self { spring: one, damping: one, mass: one, noise: one, acceleration: one, bandwidth: one }
    }
}

/// The step of an instrument with the acceleration as a state.
pub type VariedStep<T> = HeldEtdrk4<Scaled<SensedAcceleration<T>, T, 4>, T, 4>;

/// An instrument over one interval, with the acceleration as a state, in scaled states.
#[derive(Clone, Copy, Debug)]
pub struct VariedInstrument<T> {
    /// The unit of each state.
    pub scales: Scales<T, 4>,
    /// How it gets from one sample to the next.
    pub process: VariedStep<T>,
    /// How it is read.
    pub readout: Scaled<DifferentialReadout<T>, T, 4>,
    /// The variance of a sample in V².
    pub noise: Covariance<T, 1>,
}

impl<T: Scalar> VariedInstrument<T> {
    /// The instrument of these factors, discretised exactly at rest. The states have the scales of what is stated, so that
    /// those of different factors can be mixed.
    pub fn of(
        hardware: &AccelerometerHardware,
        factors: &Factors<T>,
        interval_s: f64,
    ) -> Result<Self, NotAScale> {
        let sizes: [f64; 4] = *Scales::natural(&hardware.sensed)?.sizes();
        let scales = Scales::new(sizes.map(T::of))?;
        let mut sensed = hardware.sensed.map(|_, value| T::of(value));
        let mass = &mut sensed.device.mass;
        mass.spring = mass.spring * factors.spring;
        mass.damping = mass.damping * factors.damping;
        mass.mass = mass.mass * factors.mass;
        sensed.prior.rms = sensed.prior.rms * factors.acceleration;
        sensed.prior.rate = sensed.prior.rate * factors.bandwidth;
        // 2·k_B·T·b.
        let force_density = factors.damping * T::of(hardware.force_density);
        let density = scales.scale_density(&sensed.noise(force_density));
        let rest = (&[T::of(0.0); 4], &T::of(0.0));
        Ok(Self {
            scales,
            process: HeldEtdrk4::new(Scaled::new(sensed, scales), T::of(interval_s), &density, rest),
            readout: Scaled::new(hardware.readout.map(|_, value| T::of(value)), scales),
            noise: Covariance::from_variances([factors.noise * T::of(hardware.noise_variance)]),
        })
    }

    /// Linearised at rest.
    pub fn at_rest(&self) -> OperatingPoint<T, 4, 1> {
        OperatingPoint {
            // The same as its derivative by dual numbers, which within those of a fit are a quarter of a megabyte of program.
            transition: self.process.transition(),
            observation: self.readout.linearized(&[T::of(0.0); 4]).1,
            process_noise: *self.process.noise().covariance(),
            measurement_noise: self.noise,
        }
    }
}

/// The standard deviation in m/s² that the Kalman filter claims of the acceleration once it has settled, with samples so many
/// seconds apart: of all causal filters the least, for an acceleration as the device's table says.
pub fn settled_acceleration_sd(
    hardware: &AccelerometerHardware,
    interval_s: f64,
) -> Result<f64, SimulateError> {
    let none = |why: String| SimulateError::NoObserver { why };
    let (instrument, settled) = settled(hardware, interval_s).map_err(none)?;
    Ok(instrument.scales.restore_covariance(settled.filtered_covariance()).standard_deviation(2))
}

/// The instrument as the experiment states it, and the filter in which it settles.
pub fn settled(
    hardware: &AccelerometerHardware,
    interval_s: f64,
) -> Result<(VariedInstrument<f64>, FixedGain<f64, 4, 1>), String> {
    let instrument =
        VariedInstrument::of(hardware, &Factors::none(), interval_s).map_err(|why| why.to_string())?;
    let filter = FixedGain::steady_state([0.0; 4], &instrument.at_rest()).map_err(|why| why.to_string())?;
    Ok((instrument, filter))
}

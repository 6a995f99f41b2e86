//! The models that the filters run on, in states of their own size.
//!
//! In SI a displacement of 10⁻¹⁰ m has a variance of 10⁻²⁰ m² beside one of the acceleration near 1. The scales are
//! powers of two, so that no bit of a result changes by them.

use super::data::ModelInput;
use super::settings::AccelerometerHardware;
use crate::estimate::{HeldSamples, butterworth, kalman_bucy};
use crate::simulate::SimulateError;
use kalmems_core::Portable;
use kalmems_core::filter::{ObserverError, Pole};
use kalmems_core::riccati::RiccatiError;
use kalmems_core::{
    Covariance, Dynamics, FixedGain, HeldEtdrk4, NoiseDensity, NotAScale, OperatingPoint, Scaled, Scales,
};
use kalmems_models::dynamics::{Accelerometer, SensedAcceleration, UncertainMechanics};
use kalmems_models::readout::DifferentialReadout;

/// The readout in scaled states.
pub type ScaledReadout<const N: usize> = Scaled<DifferentialReadout<f64>, f64, N>;
/// The step of a model.
pub type ModelStep<D, const N: usize> = HeldEtdrk4<Scaled<D, f64, N>, f64, N>;
/// The step of a model that is an observer itself, driven by its input and the last sample.
pub type ObserverStep<D, const N: usize> = HeldSamples<Scaled<D, f64, N>, ScaledReadout<N>, N>;

/// The step of a model over each of so many equal parts of the usual interval, and over half of one.
pub struct DividedStep<D, const N: usize> {
    /// Over a part.
    pub whole: ModelStep<D, N>,
    /// Over half of it.
    pub half: ModelStep<D, N>,
    /// The parts of the usual interval.
    pub parts: usize,
}

/// An instrument of `N` states with its noise.
#[derive(Clone, Copy, Debug)]
pub struct Instrument<D, const N: usize> {
    /// How it moves.
    pub dynamics: Scaled<D, f64, N>,
    /// How it is read.
    pub readout: ScaledReadout<N>,
    /// The unit of each state.
    pub scales: Scales<f64, N>,
    /// The density of its noise.
    pub density: NoiseDensity<f64, N>,
    /// The variance of one sample in V².
    pub noise_variance: f64,
    /// Of the mass on what is left of its spring, in rad/s.
    eigenvalues: [(f64, f64); 2],
}

impl Instrument<SensedAcceleration<f64>, 4> {
    /// With the acceleration as a state.
    pub fn sensed(hardware: &AccelerometerHardware) -> Result<Self, NotAScale> {
        let noise = hardware.sensed.noise(hardware.force_density);
        Self::new(hardware.sensed, hardware, &noise)
    }
}

impl Instrument<UncertainMechanics<f64>, 7> {
    /// With the acceleration and deviations of spring, damping and mass as states.
    pub fn uncertain(hardware: &AccelerometerHardware) -> Result<Self, NotAScale> {
        let stated = hardware.sensed.noise(hardware.force_density);
        let density = NoiseDensity::none().on::<1>(stated.get(1, 1)).on::<3>(stated.get(3, 3));
        Self::new(UncertainMechanics { sensed: hardware.sensed }, hardware, &density)
    }
}

impl Instrument<Accelerometer<f64>, 2> {
    /// With the acceleration as an input.
    pub fn known(hardware: &AccelerometerHardware) -> Result<Self, NotAScale> {
        let device = hardware.sensed.device;
        let brownian = device.mass.acceleration_density(hardware.force_density);
        Self::new(device, hardware, &NoiseDensity::none().on::<1>(brownian))
    }
}

impl<D: Dynamics<f64, N, Input: ModelInput> + Copy, const N: usize> Instrument<D, N> {
    fn new(
        dynamics: D,
        hardware: &AccelerometerHardware,
        density: &NoiseDensity<f64, N>,
    ) -> Result<Self, NotAScale> {
        let scales = Scales::natural(&dynamics)?;
        let device = &hardware.sensed.device;
        Ok(Self {
            dynamics: Scaled::new(dynamics, scales),
            readout: Scaled::new(hardware.readout, scales),
            scales,
            density: scales.scale_density(density),
            noise_variance: hardware.noise_variance,
            eigenvalues: device.mass.eigenvalues(device.softened_spring(0.0)),
        })
    }

    /// The step over an interval.
    pub fn over(&self, interval_s: f64) -> ModelStep<D, N> {
        HeldEtdrk4::new(self.dynamics, interval_s, &self.density, (&[0.0; N], &ModelInput::NONE))
    }

    /// The steps over an interval in so many parts.
    pub fn divided(&self, interval_s: f64, parts: usize) -> DividedStep<D, N> {
        let part_s = interval_s / parts as f64;
        DividedStep { whole: self.over(part_s), half: self.over(0.5 * part_s), parts }
    }

    /// The system over an interval, linearised at rest.
    pub fn at_rest(&self, interval_s: f64) -> OperatingPoint<f64, N, 1> {
        let noise = Covariance::from_variances([self.noise_variance]);
        OperatingPoint::of(&self.over(interval_s), (&self.readout, noise), (&[0.0; N], &ModelInput::NONE))
    }

    /// A gain that gives the error those poles of the device that are faster than this corner in rad/s, and for the rest
    /// Butterworth's pattern of the corner, sampled.
    ///
    /// To slow what decays fast by itself would take a gain that undoes the damping.
    pub fn luenberger(
        &self,
        mean: [f64; N],
        corner: f64,
        interval_s: f64,
    ) -> Result<FixedGain<f64, N, 1>, ObserverError<f64>> {
        let own: Vec<Pole<f64>> = match self.eigenvalues {
            [(re, im), _] if im != 0.0 => {
                let pair = Pole::Pair { real: re, imaginary: im };
                (re.portable_hypot(im) > corner && re < 0.0).then_some(pair).into_iter().collect()
            }
            both => both.into_iter().filter(|(re, _)| -re > corner).map(|(re, _)| Pole::Real(re)).collect(),
        };
        let taken: usize = own.iter().map(|pole| if matches!(pole, Pole::Real(_)) { 1 } else { 2 }).sum();
        let poles: Vec<Pole<f64>> = own
            .into_iter()
            .chain(butterworth(N.saturating_sub(taken), corner))
            .map(|pole| pole.sampled(interval_s))
            .collect();
        FixedGain::luenberger(mean, &poles, &self.at_rest(interval_s))
    }

    /// The observer with the gain of the continuous Kalman filter, and the system that its error is; see [`kalman_bucy`].
    pub fn kalman_bucy(
        &self,
        interval_s: f64,
    ) -> Result<(ObserverStep<D, N>, OperatingPoint<f64, N, 1>), RiccatiError> {
        let noise = (&self.density, self.noise_variance);
        kalman_bucy((self.dynamics, self.readout), noise, interval_s, ModelInput::NONE)
    }

    /// The sampling rate in Hz from which on Euler's method lets every motion of the mass at rest decay: |1 + λ·h| < 1 for both
    /// eigenvalues.
    pub fn euler_rate_hz(&self) -> f64 {
        let rate = |(re, im): &(f64, f64)| {
            if *re < 0.0 { (re * re + im * im) / (-2.0 * re) } else { f64::INFINITY }
        };
        self.eigenvalues.iter().map(rate).fold(0.0, f64::max)
    }

    /// The fastest motion of the mass at rest in 1/s.
    pub fn fastest(&self) -> f64 {
        self.eigenvalues.iter().map(|(re, im)| re.portable_hypot(*im)).fold(0.0, f64::max)
    }
}

/// The standard deviation in m/s² that the Kalman filter claims of the acceleration once it has settled, with samples so many
/// seconds apart: of all causal filters the least, for an acceleration as the device's table says.
pub fn settled_acceleration_sd(
    hardware: &AccelerometerHardware,
    interval_s: f64,
) -> Result<f64, SimulateError> {
    let none = |why: String| SimulateError::NoObserver { why };
    let instrument = Instrument::sensed(hardware).map_err(|why| none(why.to_string()))?;
    let settled = FixedGain::steady_state([0.0; 4], &instrument.at_rest(interval_s))
        .map_err(|why| none(why.to_string()))?;
    Ok(instrument.scales.restore_covariance(settled.filtered_covariance()).standard_deviation(2))
}

//! The accelerometer at 5 µs, the interval that its thesis allows: the filter that has the acceleration as a state, in
//! full and with the gain in which it settles.

use crate::system::signal::Noise;
use kalmems_core::{
    ContinuousDiscrete, Covariance, Ekf, Filter, FilterError, FixedGain, HeldEtdrk4, LinearMeasurement,
    LinearProcess, Mat, NoiseDensity, OperatingPoint, Process, Scalar, Scaled, Scales,
};
use kalmems_models::capacitance::DifferentialPlates;
use kalmems_models::dynamics::{Accelerometer, GaussMarkov, ProofMass, SensedAcceleration};
use kalmems_models::readout::DifferentialReadout;
use std::hint::black_box;

/// s between two samples.
const INTERVAL: f64 = 5e-6;
/// V² of a sample.
const VARIANCE: f64 = 9.8e-9;

type Model<T> = Scaled<SensedAcceleration<T>, T, 4>;

/// Models and signal.
pub struct Sensed<T> {
    dynamics: Model<T>,
    density: NoiseDensity<T, 4>,
    exact: HeldEtdrk4<Model<T>, T, 4>,
    readout: Scaled<DifferentialReadout<T>, T, 4>,
    settled: FixedGain<T, 4, 1>,
    linear: LinearProcess<T, 4, 1>,
    matrix: LinearMeasurement<T, 4, 1>,
    signal: Vec<T>,
}

/// A filter over the whole signal; the last acceleration in its own unit.
pub type Run<T> = fn(&Sensed<T>) -> Result<T, FilterError>;

fn instrument<T: Scalar>() -> (SensedAcceleration<T>, DifferentialReadout<T>) {
    let of = |value: f64| T::of(black_box(value));
    let plates = DifferentialPlates { area: of(1.86e-6), gap: of(2.3e-6), permittivity: of(3.541_675e-11) };
    let mass = ProofMass { mass: of(3.8e-9), damping: of(7e-4), squeezed: of(0.0), spring: of(3.0) };
    let device = Accelerometer { mass, plates, carrier_mean_square: of(0.18), bias: of(0.173) };
    let prior = GaussMarkov { rms: of(0.980_665), rate: of(314.159), damping_ratio: of(0.7) };
    let readout =
        DifferentialReadout { plates, carrier_amplitude: of(0.6), feedback_capacitance: of(20e-12) };
    (SensedAcceleration { device, prior }, readout)
}

impl<T: Scalar> Sensed<T> {
    /// With a signal of `length` samples: noise, as at rest. Gain and linear step are computed in `f64`, as before a run.
    pub fn simulated(length: usize) -> Self {
        let (sensed, readout) = instrument::<f64>();
        let scales = Scales::natural(&sensed).expect("scales");
        let density = scales.scale_density(&sensed.noise(5.8e-24));
        let dynamics = Scaled::new(sensed, scales);
        let exact = HeldEtdrk4::new(dynamics, INTERVAL, &density, (&[0.0; 4], &0.0));
        let noise = Covariance::from_variances([VARIANCE]);
        let point = OperatingPoint::of(&exact, (&Scaled::new(readout, scales), noise), (&[0.0; 4], &0.0));
        let gain = *FixedGain::steady_state([0.0; 4], &point).expect("a gain").gain();
        let moved: [f64; 4] = exact.step(&[0.0; 4], &1e-6);
        let of = |value: f64| T::of(black_box(value));
        let point = OperatingPoint {
            transition: Mat(point.transition.0.map(|row| row.map(of))),
            observation: Mat(point.observation.0.map(|row| row.map(of))),
            process_noise: Covariance::from_lower(Mat(point
                .process_noise
                .to_full()
                .0
                .map(|row| row.map(of)))),
            measurement_noise: Covariance::from_variances([of(VARIANCE)]),
        };
        let gain = Mat(gain.0.map(|row| row.map(of)));
        let (sensed, readout) = instrument::<T>();
        let scales = Scales::new(scales.sizes().map(of)).expect("scales");
        let density = scales.scale_density(&sensed.noise(of(5.8e-24)));
        let dynamics = Scaled::new(sensed, scales);
        let mut chance = Noise::start();
        let signal = (0..length).map(|_| T::of(VARIANCE.sqrt() * chance.next())).collect();
        Self {
            dynamics,
            density,
            exact: HeldEtdrk4::new(dynamics, of(INTERVAL), &density, (&[of(0.0); 4], &of(0.0))),
            readout: Scaled::new(readout, scales),
            settled: FixedGain::from_gain([of(0.0); 4], gain, &point).expect("a gain"),
            linear: LinearProcess {
                transition: point.transition,
                input: Mat(moved.map(|entry| [of(1e6 * entry)])),
                noise: point.process_noise.into(),
            },
            matrix: LinearMeasurement { matrix: point.observation },
            signal: black_box(signal),
        }
    }

    /// The feedback after a sample: the loop of the thesis.
    fn feedback(sample: T) -> T {
        sample * T::of(10.0)
    }

    /// The gain that was computed before, on the linear model.
    pub fn settled(&self) -> Result<T, FilterError> {
        let mut filter = self.settled;
        for sample in &self.signal {
            filter.update(&self.matrix, &[*sample])?;
            filter.predict(&self.linear, &[Self::feedback(*sample)])?;
        }
        Ok(filter.mean()[2])
    }

    /// The extended filter with the exact step, linearised anew at each.
    pub fn exact(&self) -> Result<T, FilterError> {
        let (mut filter, r) = Self::full();
        for sample in &self.signal {
            filter.update(&self.readout, &[*sample], &r)?;
            filter.predict(&self.exact, &Self::feedback(*sample))?;
        }
        Ok(filter.mean()[2])
    }

    /// The hybrid filter: mean and covariance by their differential equations, in steps of 2.5 µs.
    pub fn hybrid(&self) -> Result<T, FilterError> {
        let (mut filter, r) = Self::full();
        let maker =
            ContinuousDiscrete::new(self.dynamics, self.density, 0.5 * INTERVAL).expect("an interval");
        for sample in &self.signal {
            filter.update(&self.readout, &[*sample], &r)?;
            let feedback = Self::feedback(*sample);
            let process = maker.over(INTERVAL, filter.mean(), |_| feedback).expect("an interval");
            filter.predict(&process, &())?;
        }
        Ok(filter.mean()[2])
    }

    fn full() -> (Ekf<T, 4>, Covariance<T, 1>) {
        let start = Covariance::from_variances([T::of(1.0); 4]);
        (Ekf::new([T::of(0.0); 4], start), Covariance::from_variances([T::of(VARIANCE)]))
    }
}

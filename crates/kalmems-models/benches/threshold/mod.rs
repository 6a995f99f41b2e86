//! The threshold-sensing scanner's free decay at 500 kHz: the plain filter, and what the crossings cost beside it.

use crate::system::signal::Noise;
use kalmems_core::detect::{CubicFit, Detector, HoldLevel, SlopeKernel, Threshold, angle_at, angle_variance};
use kalmems_core::update::Gate;
use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearProcess, Mat, Measurement, Process, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::dynamics::MirrorResonator;
use kalmems_models::readout::CurrentReadout;
use std::hint::black_box;

/// s between two samples.
const INTERVAL: f64 = 2e-6;
/// V of a sample.
const NOISE: f64 = 0.0435;
/// Samples within which one maximum is kept.
const REACH: usize = 150;

type Stream<T> = Detector<T, 60, REACH, 400>;

/// Models and signal.
pub struct FreeDecay<T> {
    mirror: MirrorResonator<T>,
    process: LinearProcess<T, 2, 1>,
    readout: CurrentReadout<T>,
    detector: Stream<T>,
    fit: CubicFit<T, 90>,
    signal: Vec<T>,
}

/// A filter over the whole signal; the last angle and how many crossings were used.
pub type Run<T> = fn(&FreeDecay<T>) -> Result<(T, usize), FilterError>;

impl<T: Scalar> FreeDecay<T> {
    /// With a signal of `length` samples.
    pub fn simulated(length: usize) -> Self {
        let of = |value: f64| T::of(black_box(value));
        let mirror = MirrorResonator { natural_rate: of(3924.5), damping_ratio: of(0.0066) };
        let shape = CurveShape::Logistic;
        let comb = CombCurve { centre: of(0.0037), gain: of(2.82e-3), steepness: of(76.0), shape };
        let readout = CurrentReadout { comb, offset: of(0.0) };
        let process = mirror.exact(of(INTERVAL), of(1e3));
        let mut noise = Noise::start();
        let mut truth = start();
        let signal = (0..length)
            .map(|_| {
                truth = process.step(&truth, &[T::of(0.0)]);
                let [volts]: [T; 1] = readout.predict(&truth);
                volts + T::of(NOISE * noise.next())
            })
            .collect();
        let kernel = SlopeKernel::new(15.0).expect("a width");
        let hold = HoldLevel { deviations: 2.0, samples: 600 };
        let rate = 10.0 * INTERVAL;
        let threshold = Threshold::for_false_alarms(&kernel, NOISE, rate, REACH, Some(hold)).expect("a rate");
        Self {
            mirror,
            process,
            readout,
            detector: Detector::new(kernel, threshold, T::of(NOISE * NOISE)),
            fit: CubicFit::new(30.0).expect("a width"),
            signal: black_box(signal),
        }
    }

    /// The plain filter.
    pub fn plain(&self) -> Result<(T, usize), FilterError> {
        let r = Covariance::from_variances([T::of(NOISE * NOISE)]);
        let mut filter = filter();
        for sample in &self.signal {
            filter.predict(&self.process, &[T::of(0.0)])?;
            filter.update(&self.readout, &[*sample], &r)?;
        }
        Ok((filter.mean()[0], 0))
    }

    /// The detector alone.
    #[allow(clippy::unnecessary_wraps)] // of one type with the filters
    pub fn detector(&self) -> Result<(T, usize), FilterError> {
        let mut detector = self.detector;
        let found = self.signal.iter().filter(|sample| detector.push(**sample).is_some()).count();
        Ok((T::of(0.0), found))
    }

    /// The filter with the detector, each crossing applied at its own time.
    pub fn hybrid(&self) -> Result<(T, usize), FilterError> {
        let r = Covariance::from_variances([T::of(NOISE * NOISE)]);
        let (mut filter, mut detector) = (filter(), self.detector);
        let a: Mat<T, 2, 2> = self.mirror.system_matrix();
        let (gate, look_ahead) = (Gate { nis: T::of(16.0) }, T::of(Stream::<T>::LOOK_AHEAD as f64));
        let mut used = 0;
        for sample in &self.signal {
            filter.predict(&self.process, &[T::of(0.0)])?;
            filter.update(&self.readout, &[*sample], &r)?;
            if detector.push(*sample).is_none() {
                continue;
            }
            let Some(crossing) = detector.crossing(&self.fit, T::of(0.0)) else { continue };
            let late = (look_ahead - crossing.displacement) * T::of(INTERVAL);
            // The speed at a crossing, from the slope: dy/dt = h′·ω².
            let square = crossing.slope / (self.readout.comb.steepest() * T::of(INTERVAL));
            let variance = angle_variance(crossing.timing_variance, square.sqrt(), T::of(INTERVAL));
            let r = Covariance::from_variances([variance]);
            let seen = filter.update_where(&angle_at(&a, late), &[self.readout.comb.centre], &r, &gate)?;
            used += usize::from(seen.taken);
        }
        Ok((filter.mean()[0], used))
    }
}

fn filter<T: Scalar>() -> Ekf<T, 2> {
    Ekf::new(start(), Covariance::from_standard_deviations([T::of(5e-3), T::of(20.0)]))
}

/// Angle and rate at the first sample.
fn start<T: Scalar>() -> [T; 2] {
    [T::of(-0.102), T::of(413.4)]
}

//! The filters on their way through their samples.

use crate::by_hand::{scanner, scanner_rk4, scanner_samples};
use crate::generated::{threshold, threshold_samples};
use kalmems_core::{Covariance, Nodes, Scalar};

/// A filter on its way through a recording.
pub trait Run<T>: Sized {
    /// What comes with each sample.
    type Sample: Copy;
    /// How many samples follow the first.
    const STEPS: usize;

    /// The filter after the first sample; `None` where it was refused.
    fn begin() -> Option<Self>;
    /// Sample `k`, the first after the start being 1.
    fn sample(k: usize) -> Self::Sample;
    /// Goes on by one sample; whether nothing was refused.
    fn step(&mut self, sample: Self::Sample) -> bool;
    /// Mean and variance of angle and rate, in the units of the filter.
    fn says(&self) -> [T; 4];
}

/// An entry of a table; zero beyond its end.
#[inline(always)]
fn at<T: Scalar>(table: &[f32], k: usize) -> T {
    T::of(f64::from(table.get(k).copied().unwrap_or(0.0)))
}

fn said<T: Scalar>([angle, rate]: [T; 2], covariance: Covariance<T, 2>) -> [T; 4] {
    [angle, rate, covariance.get(0, 0), covariance.get(1, 1)]
}

/// The shared-electrode scanner by Euler's method.
pub struct Euler<T>(scanner::Estimator<T>);

impl<T: Scalar> Run<T> for Euler<T> {
    type Sample = (T, T);
    const STEPS: usize = scanner_samples::SIGNAL_V.len() - 1;

    fn begin() -> Option<Self> {
        let mut estimator = scanner::Estimator::new();
        estimator.begin(at(&scanner_samples::SIGNAL_V, 0)).ok()?;
        Some(Self(estimator))
    }

    fn sample(k: usize) -> (T, T) {
        (at(&scanner_samples::DRIVE_V, k.wrapping_sub(1)), at(&scanner_samples::SIGNAL_V, k))
    }

    #[inline(always)]
    fn step(&mut self, (drive_v, signal_v): (T, T)) -> bool {
        self.0.step(&drive_v, signal_v).is_ok()
    }

    fn says(&self) -> [T; 4] {
        said(self.0.mean(), self.0.covariance())
    }
}

/// The same by the Runge–Kutta method.
pub struct RungeKutta<T>(scanner_rk4::Estimator<T>);

impl<T: Scalar> Run<T> for RungeKutta<T> {
    type Sample = (Nodes<T>, T);
    const STEPS: usize = scanner_samples::SIGNAL_V.len() - 1;

    fn begin() -> Option<Self> {
        let mut estimator = scanner_rk4::Estimator::new();
        estimator.begin(at(&scanner_samples::SIGNAL_V, 0)).ok()?;
        Some(Self(estimator))
    }

    fn sample(k: usize) -> (Nodes<T>, T) {
        let drive = Nodes {
            start: at(&scanner_samples::DRIVE_V, k.wrapping_sub(1)),
            middle: at(&scanner_samples::MIDDLE_V, k),
            end: at(&scanner_samples::DRIVE_V, k),
        };
        (drive, at(&scanner_samples::SIGNAL_V, k))
    }

    #[inline(always)]
    fn step(&mut self, (drive, signal_v): (Nodes<T>, T)) -> bool {
        self.0.step(&drive, signal_v).is_ok()
    }

    fn says(&self) -> [T; 4] {
        said(self.0.mean(), self.0.covariance())
    }
}

/// The threshold-sensing scanner: detector and filter.
pub struct Threshold<T: Scalar>(threshold::Estimator<T>);

impl<T: Scalar> Run<T> for Threshold<T> {
    type Sample = T;
    const STEPS: usize = threshold_samples::SIGNAL_V.len() - 1;

    fn begin() -> Option<Self> {
        let mut estimator = threshold::Estimator::new();
        estimator.step(at(&threshold_samples::SIGNAL_V, 0), true).ok()?;
        Some(Self(estimator))
    }

    fn sample(k: usize) -> T {
        at(&threshold_samples::SIGNAL_V, k)
    }

    #[inline(always)]
    fn step(&mut self, signal_v: T) -> bool {
        self.0.step(signal_v, false).is_ok()
    }

    fn says(&self) -> [T; 4] {
        said(self.0.mean(), self.0.covariance())
    }
}

impl<T: Scalar> Threshold<T> {
    /// How many crossings there were.
    pub fn crossings(&self) -> u32 {
        self.0.crossings()
    }
}

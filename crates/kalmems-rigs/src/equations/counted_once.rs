//! An event that is found in samples which correct the filter themselves.
//!
//! The error of its time is that of these samples, whose noise would count twice: a filter that took it for independent would have errors of up to
//! three times the mean square that it claims. Its variance is doubled, and it corrects the mean alone: the covariance stays what the samples have made
//! it, and what a correction takes from it, K·S·Kᵀ, is given back. At most 1.25 of the claimed mean square are left then. Of samples that are taken for
//! λ times their variance, 1/λ of both.

use crate::estimate::{Filtering, MOST_STATES, Sensor, Transition};
use kalmems_core::FilterError;

/// What a filter claims before it is corrected by such an event.
pub struct ClaimBefore {
    variances: [f64; MOST_STATES],
    /// P·Hᵀ, which has the signs of the gain.
    towards: [f64; MOST_STATES],
}

/// The entries of a matrix of all states.
const ENTRIES: usize = MOST_STATES * MOST_STATES;

impl ClaimBefore {
    /// Before a correction by what this sensor reads.
    pub fn of(filter: &dyn Filtering, sensor: &dyn Sensor) -> Self {
        let n = filter.mean().len().min(MOST_STATES);
        let (mut lower, mut slopes) = ([0.0; ENTRIES], [0.0; MOST_STATES]);
        filter.covariance(&mut lower[..n * n]);
        sensor.linearize(&filter.mean()[..n], &mut slopes[..n]);
        let entry = |i: usize, j: usize| lower[i.max(j) * n + i.min(j)];
        let along = |i: usize| (0..n).map(|j| entry(i, j) * slopes[j]).sum();
        let of = |value: &dyn Fn(usize) -> f64| std::array::from_fn(|i| if i < n { value(i) } else { 0.0 });
        Self { variances: of(&|i| entry(i, i)), towards: of(&along) }
    }

    /// Gives the filter's covariance back what the correction took, or this share of it.
    pub fn give_back(&self, filter: &mut dyn Filtering, share: f64) -> Result<(), FilterError> {
        let n = filter.mean().len().min(MOST_STATES);
        let mut lower = [0.0; ENTRIES];
        filter.covariance(&mut lower[..n * n]);
        let taken = |i: usize| (share * (self.variances[i] - lower[i * n + i])).max(0.0).sqrt();
        let root = std::array::from_fn(|i| if i < n { taken(i).copysign(self.towards[i]) } else { 0.0 });
        filter.widen(&AddedNoise { root })
    }
}

/// A step that leaves the state where it is, with the noise w·wᵀ.
struct AddedNoise {
    root: [f64; MOST_STATES],
}

impl Transition for AddedNoise {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        to.copy_from_slice(x);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        to.copy_from_slice(x);
        for (place, entry) in jacobian.iter_mut().enumerate() {
            *entry = f64::from(u8::from(place % (x.len() + 1) == 0));
        }
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        let n = covariance.len().isqrt();
        root.fill(0.0);
        for i in 0..n {
            root[i * n] = self.root[i];
            for j in 0..=i {
                covariance[i * n + j] = self.root[i] * self.root[j];
            }
        }
    }
}

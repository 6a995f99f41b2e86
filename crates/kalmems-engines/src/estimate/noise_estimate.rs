//! The variance of a sample from the innovations.

use super::StateSeries;
use crate::units::kind;
use kalmems_core::adapt::InnovationWindow;
use kalmems_core::{Covariance, Innovation};
use std::iter;

/// Recursive least squares with forgetting for the one number R, fed back into the filter.
///
/// Each innovation gives z = ε² + H·P⁺·Hᵀ, whose mean is R. The least-squares estimate of a constant from the z with
/// weights λ, λ², … into the past is their weighted mean: [`InnovationWindow`] (the thesis's section 6.2 asks for it,
/// Zhang 2010).
#[derive(Clone, Debug)]
pub struct NoiseEstimate {
    window: InnovationWindow<f64, 1>,
    stated: f64,
    history: Vec<[f64; 2]>,
}

/// Samples that an estimate must be worth before it is used.
const LEAST: f64 = 200.0;

impl NoiseEstimate {
    /// From what is stated, remembering over so many samples.
    pub fn new(stated: f64, memory: f64) -> Self {
        Self { window: InnovationWindow::new(1.0 - memory.max(1.0).recip()), stated, history: Vec::new() }
    }

    /// In V², with its standard error: R·√(2/n) for n samples of equal weight. What is stated has none.
    fn current(&self) -> [f64; 2] {
        let samples = self.window.samples();
        // Not a number where there is no sample yet.
        if samples >= LEAST {
            let variance = self.window.measurement_noise().get(0, 0);
            [variance, variance * (2.0 / samples).sqrt()]
        } else {
            [self.stated, f64::NAN]
        }
    }

    /// In V².
    pub fn variance(&self) -> f64 {
        self.current()[0]
    }

    /// Counts a sample, by its innovation where it had one.
    pub fn add(&mut self, innovation: Option<&Innovation<f64, 1>>) {
        if let Some(innovation) = innovation {
            self.window.add(innovation, &Covariance::from_variances([self.variance()]));
        }
        self.history.push(self.current());
    }

    /// Goes on from here with another part of a segment.
    pub fn going_on(&mut self) {
        self.history.clear();
    }

    /// What was known at each of so many samples, with its standard error.
    pub fn series(&self, samples: usize) -> StateSeries {
        let history = self.history.iter().copied().chain(iter::repeat([f64::NAN; 2]));
        let (mean, sd) = history.take(samples).map(|[mean, sd]| (mean, sd)).unzip();
        StateSeries { name: "noise_variance", unit: "V2", kind: &kind::VOLTAGE_VARIANCE, mean, sd }
    }
}

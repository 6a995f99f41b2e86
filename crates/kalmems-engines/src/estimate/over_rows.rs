//! A filter that is led over rows of numbers by whoever has a model of one's own, and smoothed.

use super::any_filter::StateFilter;
use super::transition::{Sensor, Transition};
use kalmems_core::smooth::{Backward, Smoothed};
use kalmems_core::{Covariance, FilterError, Gaussian, Innovation};
use std::collections::VecDeque;

/// A filter of any number of states, which keeps as many of its steps as a smoother is to go back.
///
/// Matrices are whole, row by row.
pub trait RowFilter {
    /// The mean of the state.
    fn mean(&self) -> &[f64];

    /// Its covariance, written to `to`.
    fn covariance(&self, to: &mut [f64]);

    /// Moves the state by one step.
    fn predict(&mut self, transition: &dyn Transition) -> Result<(), FilterError>;

    /// Corrects the state with a number `y` of this noise variance, where its NIS is not above the largest that is believed.
    fn correct(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError>;

    /// Mean and covariance of the present state and of those before it, given all until now, from the newest back as long as `visit` asks for more.
    fn look_back(&self, visit: &mut dyn FnMut(&[f64], &[f64]) -> bool) -> Result<(), FilterError>;
}

/// Of `N` states.
pub(super) struct SizedRowFilter<const N: usize> {
    filter: Box<dyn StateFilter<N>>,
    mean: [f64; N],
    steps: VecDeque<Backward<f64, N>>,
    kept: usize,
}

impl<const N: usize> SizedRowFilter<N> {
    /// Keeps so many steps.
    pub(super) fn new(filter: Box<dyn StateFilter<N>>, kept: usize) -> Self {
        Self { mean: filter.mean(), filter, steps: VecDeque::new(), kept }
    }
}

/// Writes the whole of a covariance.
fn put<const N: usize>(covariance: &Covariance<f64, N>, to: &mut [f64]) {
    for (entry, value) in to.iter_mut().zip(covariance.to_full().0.as_flattened()) {
        *entry = *value;
    }
}

impl<const N: usize> RowFilter for SizedRowFilter<N> {
    fn mean(&self) -> &[f64] {
        &self.mean
    }

    fn covariance(&self, to: &mut [f64]) {
        put(&self.filter.known().covariance, to);
    }

    fn predict(&mut self, transition: &dyn Transition) -> Result<(), FilterError> {
        let before: Option<Gaussian<f64, N>> = (self.kept > 0).then(|| self.filter.known());
        let link = self.filter.step(transition)?;
        self.mean = self.filter.mean();
        if let Some(before) = before {
            if self.steps.len() == self.kept {
                self.steps.pop_front();
            }
            self.steps.push_back(Backward::new(&before, &link, &self.mean)?);
        }
        Ok(())
    }

    fn correct(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let innovation = self.filter.correct(sensor, y, variance, largest_nis);
        self.mean = self.filter.mean();
        innovation
    }

    fn look_back(&self, visit: &mut dyn FnMut(&[f64], &[f64]) -> bool) -> Result<(), FilterError> {
        let mut state = Smoothed::newest(&self.filter.known())?;
        let mut covariance = vec![0.0; N * N];
        let mut steps = self.steps.iter().rev();
        loop {
            put(&state.covariance(), &mut covariance);
            if !visit(&state.mean, &covariance) {
                return Ok(());
            }
            let Some(step) = steps.next() else { return Ok(()) };
            state = step.apply(&state);
        }
    }
}

//! How far the integration steps of a simulation change what it records.

use super::{SimulateError, SimulatedColumn, Simulation, SimulationStart};
use crate::config::{Experiment, Quantity};
use serde::Serialize;
use std::ops::ControlFlow;

/// What steps of half the length change in a recording that is computed, over its first samples and without any noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IntegrationError {
    /// The recorded column that changes most beside its noise.
    pub column: &'static str,
    /// The largest change of one of its samples, in its SI unit.
    pub largest: f64,
    /// The same in standard deviations of the noise of a sample; `None` of a recording without noise.
    pub in_noise_sd: Option<f64>,
    /// Samples that were compared.
    pub samples: usize,
}

/// What makes the simulation of an experiment.
type SimulationMaker<'m> = dyn Fn(&Experiment) -> Result<Box<dyn Simulation>, SimulateError> + 'm;

/// Steps from the beginning that are compared: fewer than a second's work of the slowest device, and the whole of most simulations.
const COMPARED_STEPS: f64 = 1_048_576.0;

/// Samples that are compared at least, and those that show the noise of a sample.
const LEAST_SAMPLES: usize = 4096;

/// The change in standard deviations of a sample's noise from which on longer steps are worth a remark.
const REMARKABLE: f64 = 0.05;

impl IntegrationError {
    /// Compares the simulation of an experiment with one in twice as many steps from where its recording begins; `simulate` makes both. What came
    /// before is the same for both: a device that a sweep catches is caught in one of several phases, whatever the steps.
    ///
    /// `None` where no recorded column depends on the steps.
    ///
    /// # Errors
    ///
    /// Those of the simulations.
    pub fn of(
        experiment: &Experiment,
        start: &SimulationStart,
        simulate: &SimulationMaker<'_>,
    ) -> Result<Option<Self>, SimulateError> {
        let Some(stated) = &experiment.simulate else { return Ok(None) };
        if simulate(experiment)?.is_exact() {
            return Ok(None);
        }
        let with = |noise: bool, steps_hz: Option<f64>| -> Result<_, SimulateError> {
            let (mut other, mut simulation) = (experiment.clone(), stated.clone());
            simulation.noise = noise;
            // A rate that is no number leaves the stated one, and no difference.
            if let Some(Ok(rate)) = steps_hz.map(|rate| Quantity::of(rate, "Hz")) {
                simulation.integration_rate = rate;
            }
            other.simulate = Some(simulation);
            let simulation = simulate(&other)?;
            let rate_hz = simulation.steps_per_s().unwrap_or_else(|| stated.integration_rate.si());
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
            let most = (COMPARED_STEPS * stated.sampling_rate.si() / rate_hz) as usize;
            let samples = if noise { LEAST_SAMPLES } else { most.max(LEAST_SAMPLES) };
            Ok((columns(&*simulation, start, samples)?, simulation.recorded().to_vec(), rate_hz))
        };
        let (coarse, names, rate_hz) = with(false, None)?;
        let (fine, ..) = with(false, Some(2.0 * rate_hz))?;
        let noisy = if stated.noise { Some(with(true, None)?.0) } else { None };
        let of_column = |(place, name): (usize, &SimulatedColumn)| {
            let changes = coarse[place].iter().zip(&fine[place]).map(|(a, b)| (a - b).abs());
            let largest = changes.fold(0.0, f64::max);
            let sd = noisy.as_ref().and_then(|noisy| noise_sd(&noisy[place], &coarse[place]));
            let in_noise_sd = sd.map(|sd| largest / sd);
            let samples = coarse[place].len().min(fine[place].len());
            (largest > 0.0).then_some(Self { column: name.column, largest, in_noise_sd, samples })
        };
        let beside_noise = |one: &Self| one.in_noise_sd.unwrap_or(0.0);
        let all = names.iter().enumerate().filter_map(of_column);
        Ok(all
            .max_by(|a, b| beside_noise(a).total_cmp(&beside_noise(b)).then(a.largest.total_cmp(&b.largest))))
    }

    /// Whether the steps show beside the noise.
    pub fn is_remarkable(&self) -> bool {
        self.in_noise_sd.is_some_and(|error| error > REMARKABLE)
    }
}

/// So many of the first samples of each recorded column, or as many as there are.
fn columns(
    simulation: &dyn Simulation,
    start: &SimulationStart,
    samples: usize,
) -> Result<Vec<Vec<f64>>, SimulateError> {
    let mut columns = vec![Vec::new(); simulation.recorded().len()];
    let mut count = 0;
    let ended = simulation.run_from(start, &mut |sample| {
        for (column, value) in columns.iter_mut().zip(sample.recorded) {
            column.push(*value);
        }
        count += 1;
        if count < samples { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    match ended {
        Ok(()) | Err(SimulateError::Interrupted) => Ok(columns),
        Err(other) => Err(other),
    }
}

/// The standard deviation of the noise of a sample, from what differs from sample to sample: a motion that noise moves is smooth beside it.
fn noise_sd(noisy: &[f64], without: &[f64]) -> Option<f64> {
    let differences: Vec<f64> = noisy.iter().zip(without).map(|(a, b)| a - b).collect();
    let steps = differences.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| step.is_finite());
    let (count, sum) = steps.fold((0_u32, 0.0), |(count, sum), step| (count + 1, sum + step * step));
    let variance = 0.5 * sum / f64::from(count);
    (variance > 0.0).then(|| variance.sqrt())
}

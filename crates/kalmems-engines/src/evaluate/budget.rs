//! What of a claimed uncertainty is due to what.

use crate::estimate::Trajectory;
use crate::progress::Interruption;
use serde::Serialize;
use std::sync::Arc;

/// The uncertainty that a filter claims of one state, by its causes: root mean squares after the settling time, whose squares add up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UncertaintyBudget {
    /// The state, by its name.
    #[serde(skip)]
    pub state: &'static str,
    /// Its SI unit, as column names have it.
    pub unit: &'static str,
    /// The whole claim.
    pub sd: f64,
    /// What of it the filter's own covariance has: the noise of signal and process, the start, parameters that are states.
    pub noise: f64,
    /// What of it the uncertain numbers of the device have, the largest first.
    pub device: Vec<DeviceUncertainty>,
}

/// The part of an uncertain number of the device, or of several whose errors hang together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceUncertainty {
    /// By the keys below the device's table.
    pub name: String,
    /// Its part in the claim, in the unit of the state.
    pub sd: f64,
    /// What the innovations tell of the number itself, in standard deviations of what is stated: mean and standard deviation. `None` of
    /// several numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub told: Option<[f64; 2]>,
}

/// Standard deviations from which on the innovations contradict what is stated of a number.
const CONTRADICTED: f64 = 5.0;

/// The share of what is stated below which the innovations tell a number far better.
const TOLD_BETTER: f64 = 0.2;

impl DeviceUncertainty {
    /// By how many of its stated standard deviations the innovations put the number elsewhere, where that is too far.
    pub fn contradicted(&self) -> Option<f64> {
        self.told.map(|[mean, _]| mean).filter(|mean| mean.abs() > CONTRADICTED)
    }

    /// Whether the recording tells the number far better than what is stated of it.
    pub fn is_told_better(&self) -> bool {
        self.told.is_some_and(|[_, sd]| sd < TOLD_BETTER)
    }
}

/// Sums of what a trajectory claims and of what that is due to.
#[derive(Clone)]
pub(super) struct BudgetRecord {
    states: Vec<(&'static str, &'static str)>,
    names: Vec<Arc<str>>,
    told: Vec<[f64; 2]>,
    count: f64,
    /// For each state the sum of the claimed variances, and of that of each direction.
    sums: Vec<(f64, Vec<f64>)>,
}

impl BudgetRecord {
    /// Of a trajectory that considers something; `None` of another.
    pub(super) fn of(trajectory: &Trajectory) -> Option<Self> {
        if trajectory.considered.is_empty() {
            return None;
        }
        // Parameters that are states have a table of their own.
        let is_parameter = |name: &str| trajectory.parameters.iter().any(|prior| prior.name == name);
        let states = trajectory.states.iter().take_while(|state| !is_parameter(state.name));
        let states: Vec<_> = states.map(|state| (state.name, state.unit)).collect();
        let names: Vec<Arc<str>> = trajectory.considered.iter().map(|one| Arc::clone(&one.name)).collect();
        let (told, none) = (vec![[0.0, 1.0]; names.len()], (0.0, vec![0.0; names.len()]));
        Some(Self { sums: vec![none; states.len()], states, names, told, count: 0.0 })
    }

    /// Takes samples in, those from the place on.
    pub(super) fn take(
        &mut self,
        trajectory: &Trajectory,
        scored: std::ops::Range<usize>,
        stop: &Interruption,
    ) {
        for k in scored {
            if stop.is_requested_at(k) {
                return;
            }
            let finite = |place: usize| {
                let sd = trajectory.states.get(place).and_then(|state| state.sd.get(k));
                sd.is_some_and(|sd| sd.is_finite())
            };
            if !(0..self.states.len()).all(finite) {
                continue;
            }
            self.count += 1.0;
            for (place, (variance, of)) in self.sums.iter_mut().enumerate() {
                *variance += trajectory.states[place].sd[k].powi(2);
                for (sum, one) in of.iter_mut().zip(&trajectory.considered) {
                    *sum += one.states[place][k].powi(2);
                }
            }
        }
        for (told, one) in self.told.iter_mut().zip(&trajectory.considered) {
            *told = one.told;
        }
    }

    /// What is known until now; nothing before the first sample.
    pub(super) fn budgets(&self) -> Vec<UncertaintyBudget> {
        if self.count == 0.0 {
            return Vec::new();
        }
        let root = |sum: f64| (sum.max(0.0) / self.count).sqrt();
        let one = (self.states.iter().zip(&self.sums)).map(|(&(state, unit), (variance, of))| {
            let mut device: Vec<(Arc<str>, f64, Option<[f64; 2]>)> = Vec::new();
            for ((name, told), sum) in self.names.iter().zip(&self.told).zip(of) {
                match device.iter_mut().find(|(own, ..)| own == name) {
                    // Several directions of numbers that hang together.
                    Some((_, own, told)) => (*own, *told) = (*own + sum, None),
                    None => device.push((Arc::clone(name), *sum, Some(*told))),
                }
            }
            device.sort_by(|a, b| b.1.total_cmp(&a.1));
            let noise = root(variance - of.iter().sum::<f64>());
            let device = device.into_iter().map(|(name, sum, told)| DeviceUncertainty {
                name: name.to_string(),
                sd: root(sum),
                told,
            });
            UncertaintyBudget { state, unit, sd: root(*variance), noise, device: device.collect() }
        });
        one.collect()
    }
}

//! The units of the filter: numbers near one, and as many constants as possible exactly one.

use super::error::EmitError;
use super::lower::cost;
use super::model::{EmittedModel, tidied};
use super::request::EmitRequest;
use super::rewrite::{rescaled, scalable};
use crate::device::Device;
use crate::graph::{Node, Variable};
use kalmems_core::Portable;

/// How far a unit may be from the typical size of its state.
const FARTHEST: f64 = 1e4;
/// How many units or factors are tried.
const MOST_TRIALS: usize = 200;
/// How large a model may be for trials.
const LARGEST: usize = 1500;

/// What a state of the filter is: x = origin + scale·z.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Units {
    pub(super) scale: Vec<f64>,
    pub(super) origins: Vec<f64>,
}

impl Units {
    pub(super) fn scale(&self, state: usize) -> f64 {
        self.scale.get(state).copied().unwrap_or(1.0)
    }

    pub(super) fn origin(&self, state: usize) -> f64 {
        self.origins.get(state).copied().unwrap_or_default()
    }

    /// Typical sizes as units.
    fn typical(request: &EmitRequest) -> Self {
        let size = request.size();
        let sd = |k: usize| request.start_covariance.get(k * (size + 1)).map_or(0.0, |p| p.sqrt());
        let typical = request.states.iter().enumerate().map(|(k, start)| {
            let size = start.typical.unwrap_or_else(|| (start.mean - start.origin).abs().max(sd(k))).abs();
            if size > 0.0 { size } else { 1.0 }
        });
        let free = request.free.iter();
        Self {
            scale: typical.chain(free.clone().map(|f| f.scale)).collect(),
            origins: request.states.iter().map(|s| s.origin).chain(free.map(|f| f.start)).collect(),
        }
    }

    /// The units in which a step takes the fewest operations, not far from the typical sizes; and the model in them.
    pub(super) fn chosen(device: &Device, request: &EmitRequest) -> Result<(Self, EmittedModel), EmitError> {
        let typical = Self::typical(request);
        let mut best = (typical.clone(), EmittedModel::of(device, request, &typical)?);
        if best.1.graph.below(&best.1.roots()).len() > LARGEST {
            return Ok(best);
        }
        let mut fewest = cost(&mut best.1);
        let mut trials = 0;
        let fits = |units: &Self| {
            let far = units.scale.iter().zip(&typical.scale).map(|(scale, typical)| scale / typical);
            far.into_iter().all(|far| (1.0 / FARTHEST..FARTHEST).contains(&far))
        };
        for state in 0..device.states().len() {
            for scale in natural(&best.1, state, best.0.scale(state)) {
                let mut units = best.0.clone();
                if let Some(slot) = units.scale.get_mut(state) {
                    *slot = scale;
                }
                if trials >= MOST_TRIALS || !fits(&units) {
                    continue;
                }
                let mut model = EmittedModel::of(device, request, &units)?;
                // States that are the rate of another one follow it, if that is better still.
                let followed = followed(&model, &units);
                if followed != units && fits(&followed) {
                    let mut other = EmittedModel::of(device, request, &followed)?;
                    if cost(&mut other) < cost(&mut model) {
                        (units, model) = (followed, other);
                    }
                }
                trials += 1;
                let found = cost(&mut model);
                if found < fewest {
                    (fewest, best) = (found, (units, model));
                }
            }
        }
        let (units, model) = best;
        Ok((units, sums_chosen(model)?))
    }
}

/// Units in which a state whose rate is another state gains exactly that in each sample.
fn followed(model: &EmittedModel, units: &Units) -> Units {
    let mut followed = units.clone();
    for (state, rate) in model.rates.iter().enumerate() {
        let own = followed.scale(state) / units.scale(state);
        let (of, coefficient) = match model.graph.node(rate.value) {
            Node::Sum { constant, terms } if constant.get() == 0.0 && terms.len() == 1 => match terms[..] {
                [(term, coefficient)] => (term, coefficient.get()),
                _ => continue,
            },
            _ => (rate.value, 1.0),
        };
        if let Some(Variable::State(index)) = model.graph.as_variable(of)
            && let Some(slot) =
                followed.scale.get_mut(index).filter(|_| index < model.moving && index != state)
        {
            *slot = units.scale(index) * own / coefficient.abs();
        }
    }
    followed
}

/// The units of a state in which a coefficient of it, or of a power of it, becomes one.
fn natural(model: &EmittedModel, state: usize, scale: f64) -> Vec<f64> {
    let mut found: Vec<f64> = Vec::new();
    for id in model.graph.below(&model.roots()) {
        let Node::Sum { terms, .. } = model.graph.node(id) else { continue };
        for (term, coefficient) in terms {
            let power = match model.graph.node(*term) {
                Node::Variable(Variable::State(index)) if *index == state => 1,
                Node::Product(factors) => match factors[..] {
                    [(of, power)] if model.graph.as_variable(of) == Some(Variable::State(state)) => power,
                    _ => continue,
                },
                _ => continue,
            };
            let natural = scale * coefficient.get().abs().portable_powf(-1.0 / f64::from(power));
            if natural.is_finite() && natural > 0.0 && !found.contains(&natural) {
                found.push(natural);
            }
        }
    }
    found
}

/// The model with coefficients moved into sums where that takes operations away.
fn sums_chosen(model: EmittedModel) -> Result<EmittedModel, EmitError> {
    let mut best = model;
    let mut fewest = cost(&mut best);
    let mut trials = 0;
    loop {
        let before = fewest;
        for (sum, sizes) in scalable(&best.graph, &best.roots()) {
            for size in sizes {
                trials += 1;
                if trials > MOST_TRIALS {
                    return Ok(best);
                }
                let mut model = best.clone();
                let roots = rescaled(&mut model.graph, &best.roots(), sum, size)?;
                let roots = tidied(&mut model.graph, &roots, model.moving)?;
                model.replace(&roots);
                let found = cost(&mut model);
                if found < fewest {
                    (fewest, best) = (found, model);
                }
            }
        }
        if fewest >= before {
            return Ok(best);
        }
    }
}

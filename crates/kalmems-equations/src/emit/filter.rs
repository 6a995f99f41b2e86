//! The filter as operations: the prediction, the corrections and what follows from parameters.

use super::error::EmitError;
use super::lower::{ExternalValues, Operand, lower};
use super::model::{EmittedModel, LinearizedNumber, Rarity, tidied};
use super::names::SourceNames;
use super::request::{EmitDigits, EmitGain, EmitRequest, StepMethod};
use super::routine::{Routine, StorageArray, Widths};
use super::runge_kutta;
use super::scale::Units;
use super::tape::{Tape, TapeId};
use crate::device::Device;
use crate::graph::{Graph, NodeId, Variable};

/// A filter in its units, ready to be written in any language.
#[derive(Clone, Debug)]
pub(super) struct FilterProgram {
    pub(super) units: Units,
    pub(super) names: SourceNames,
    /// The means at the start, and the lower triangle of the covariance row by row; none where the gain has settled.
    pub(super) start: (Vec<f64>, Vec<f64>),
    /// From parameters to the constants of the filter, in numbers of 64 bits.
    pub(super) configure: Option<Routine>,
    /// A stage of Runge and Kutta's method.
    pub(super) stage: Option<Routine>,
    pub(super) predict: Routine,
    /// The measurements of the request, and behind them its events.
    pub(super) updates: Vec<Routine>,
    /// Which arrays have 64 bits.
    pub(super) widths: Widths,
    /// How far each choice of digits was from what was expected, relative to the largest value of each state, in the order in which they
    /// were tried.
    pub(super) rehearsed: Vec<f64>,
}

/// What is common to the parts of a filter while it is made.
pub(super) struct Context<'a> {
    pub(super) request: &'a EmitRequest,
    pub(super) names: &'a SourceNames,
    pub(super) model: EmittedModel,
    /// The constants that follow from parameters.
    pub(super) constants: ExternalValues,
}

/// A matrix of operations, row by row.
pub(super) type OpMatrix = Vec<Vec<TapeId>>;

impl FilterProgram {
    pub(super) fn of(device: &Device, request: &EmitRequest) -> Result<Self, EmitError> {
        request.check(device)?;
        let names = SourceNames::of(device, request);
        let (units, model) = Units::chosen(device, request)?;
        let constants = ExternalValues::new("c", Rarity::Constant);
        let mut context = Context { request, names: &names, model, constants };
        let periods = device.periods(&request.parameters)?;
        let (predict, stage) = match request.method {
            StepMethod::Euler => (context.euler(&units, &periods)?, None),
            StepMethod::RungeKutta => runge_kutta::predict(&mut context, &units, &periods)?,
        };
        let variances = request.measures.iter().map(|m| m.variance);
        let variances: Vec<f64> = variances.chain(request.events.iter().map(|e| e.variance)).collect();
        let mut updates = Vec::new();
        for (place, variance) in variances.iter().enumerate() {
            updates.push(context.update(&units, place, *variance)?);
        }
        let configure = context.configure();
        let start = start(request, &units);
        let widths = Widths::default();
        let rehearsed = Vec::new();
        let mut program = Self { units, names, start, configure, stage, predict, updates, widths, rehearsed };
        program.widen(EmitDigits::Single);
        Ok(program)
    }

    /// Takes over how many digits the numbers have.
    pub(super) fn widen(&mut self, digits: EmitDigits) {
        let (mean, covariance) = match digits {
            EmitDigits::Single | EmitDigits::AsNeeded => (false, false),
            EmitDigits::DoubleMean => (true, self.start.1.is_empty()),
            EmitDigits::Double => (true, true),
        };
        self.widths = Widths { mean, covariance, constants: mean, stage: mean };
        let routines = self.configure.iter_mut().chain(&mut self.stage).chain([&mut self.predict]);
        routines.chain(&mut self.updates).for_each(|routine| routine.widen(self.widths));
        if let Some(configure) = &mut self.configure {
            configure.widen_all();
        }
    }
}

/// Means and covariance at the start in the filter's units.
fn start(request: &EmitRequest, units: &Units) -> (Vec<f64>, Vec<f64>) {
    let mean = request.states.iter().enumerate();
    let mut mean: Vec<f64> = mean.map(|(k, s)| (s.mean - s.origin) / units.scale(k)).collect();
    mean.resize(request.size(), 0.0);
    let mut covariance = Vec::new();
    if request.gain == EmitGain::Covariance {
        for i in 0..request.size() {
            for j in 0..=i {
                let value = request.start_covariance.get(i * request.size() + j).copied();
                covariance.push(value.unwrap_or_default() / (units.scale(i) * units.scale(j)));
            }
        }
    }
    (mean, covariance)
}

impl Context<'_> {
    /// Lowers expressions over the filter's states, with the inputs at this point of the interval.
    pub(super) fn lower(&mut self, tape: &mut Tape, roots: &[NodeId], point: &'static str) -> Vec<TapeId> {
        let names = self.names;
        let of_variable = |variable: Variable| Operand::Name(names.variable(variable, point));
        let moving = self.model.moving;
        lower(&mut self.model.graph, (tape, &mut self.constants), roots, moving, &of_variable)
    }

    /// A row of derivatives by all states.
    pub(super) fn row(&self, row: &LinearizedNumber) -> Vec<NodeId> {
        let mut full = vec![Graph::ZERO; self.model.size];
        for (column, slope) in &row.slopes {
            if let Some(slot) = full.get_mut(*column) {
                *slot = *slope;
            }
        }
        full
    }

    /// x′ = x + f, F = 1 + ∂f/∂x.
    fn euler(&mut self, units: &Units, periods: &[(usize, f64)]) -> Result<Routine, EmitError> {
        let (size, moving) = (self.model.size, self.model.moving);
        let mut roots = Vec::new();
        for (i, rate) in self.model.rates.clone().iter().enumerate() {
            let state = self.model.graph.variable(Variable::State(i));
            roots.push(self.model.graph.sum(0.0, &[(state, 1.0), (rate.value, 1.0)]));
            for (j, slope) in self.row(rate).into_iter().enumerate() {
                let own = if i == j { 1.0 } else { 0.0 };
                roots.push(self.model.graph.sum(own, &[(slope, 1.0)]));
            }
        }
        let roots = tidied(&mut self.model.graph, &roots, moving)?;
        let mut routine = Routine::default();
        let ids = self.lower(&mut routine.tape, &roots, "start");
        let rows: Vec<&[TapeId]> = ids.chunks(size + 1).collect();
        let next: Vec<TapeId> = rows.iter().filter_map(|row| row.first().copied()).collect();
        let jacobian: OpMatrix = rows.iter().map(|row| row.iter().skip(1).copied().collect()).collect();
        self.finish_prediction(&mut routine, (&next, jacobian), units, periods);
        Ok(routine)
    }

    /// Means with whole periods taken off, and F·P·Fᵀ + Q.
    pub(super) fn finish_prediction(
        &self,
        routine: &mut Routine,
        (next, mut jacobian): (&[TapeId], OpMatrix),
        units: &Units,
        periods: &[(usize, f64)],
    ) {
        let (size, moving) = (self.model.size, self.model.moving);
        for (i, value) in next.iter().enumerate() {
            routine.label(*value, format!("next_{}", self.names.plain_state(i)));
        }
        let tape = &mut routine.tape;
        for (i, value) in next.iter().enumerate() {
            let period = periods.iter().find(|(state, _)| *state == i).map(|(_, p)| p / units.scale(i));
            let value = period.map_or(*value, |period| wrapped(tape, *value, period));
            routine.outputs.push((StorageArray::Mean, i, value));
        }
        if self.request.gain != EmitGain::Covariance {
            return;
        }
        for (i, row) in jacobian.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                routine.label(*entry, format!("f{i}_{j}"));
            }
        }
        let tape = &mut routine.tape;
        let (zero, one) = (tape.literal(0.0), tape.literal(1.0));
        jacobian.extend((moving..size).map(|i| (0..size).map(|j| if i == j { one } else { zero }).collect()));
        let p = covariance(tape, size);
        // Products F·P, of which a row that is needed once more is there.
        let work = |tape: &Tape, row: &[TapeId]| -> usize {
            row.iter().filter_map(|id| tape.number(*id).map_or(Some(2), |n| (n != 0.0).then_some(1))).sum()
        };
        let rows: Vec<usize> = jacobian.iter().map(|row| work(tape, row)).collect();
        let at = |matrix: &OpMatrix, i: usize, j: usize| {
            matrix.get(i).and_then(|row| row.get(j)).copied().unwrap_or(zero)
        };
        let mut products = Vec::new();
        for i in 0..size {
            for j in 0..=i {
                // Σ (F·P)ₖ·F, with the rows' roles as fewer operations need them.
                let (left, right) = if rows.get(i) < rows.get(j) { (j, i) } else { (i, j) };
                let mut sum = tape.literal(self.noise(units, i, j));
                for k in 0..size {
                    let factor = at(&jacobian, right, k);
                    if tape.is(factor, 0.0) {
                        continue;
                    }
                    let mut product = zero;
                    for l in 0..size {
                        let term = tape.multiply(at(&jacobian, left, l), at(&p, l, k));
                        product = tape.add(product, term);
                    }
                    products.push((product, format!("fp{left}_{k}")));
                    let term = tape.multiply(product, factor);
                    sum = tape.add(sum, term);
                }
                routine.outputs.push((StorageArray::Covariance, i * (i + 1) / 2 + j, sum));
            }
        }
        for (product, name) in products {
            routine.label(product, name);
        }
    }

    /// Qᵢⱼ in the filter's units; what is too small for 32 bits is nothing beside any covariance.
    fn noise(&self, units: &Units, i: usize, j: usize) -> f64 {
        let states = self.model.moving;
        let of_state = self.request.process_noise.get(i * states + j).filter(|_| i < states && j < states);
        let of_free = i.checked_sub(states).and_then(|k| self.request.free.get(k)).filter(|_| i == j);
        let value = of_state.copied().or(of_free.map(|free| free.walk)).unwrap_or_default();
        let scaled = value / (units.scale(i) * units.scale(j));
        if scaled.abs() < f64::from(f32::MIN_POSITIVE) { 0.0 } else { scaled }
    }

    /// A correction by what a measurement or an event shows, whose noise is 1 in the filter's units.
    fn update(&mut self, units: &Units, place: usize, variance: f64) -> Result<Routine, EmitError> {
        let size = self.model.size;
        let Some(reading) = self.model.readings.get(place).cloned() else { return Ok(Routine::default()) };
        let is_event = place >= self.request.measures.len();
        let seen = self.model.graph.variable(SourceNames::MEASURED);
        let per_unit = if is_event { 0.0 } else { 1.0 / variance.sqrt() };
        let residual = self.model.graph.sum(0.0, &[(seen, per_unit), (reading.value, -1.0)]);
        let mut roots = vec![residual];
        let has_covariance = self.request.gain == EmitGain::Covariance;
        if has_covariance {
            roots.extend(self.row(&reading));
        }
        let roots = tidied(&mut self.model.graph, &roots, self.model.moving)?;
        let mut routine = Routine::default();
        let ids = self.lower(&mut routine.tape, &roots, "end");
        let Some((residual, h)) = ids.split_first() else { return Ok(routine) };
        let tape = &mut routine.tape;
        let x: Vec<TapeId> = (0..size).map(|i| tape.named(self.names.state(i))).collect();
        if let EmitGain::Settled(gains) = &self.request.gain {
            let settled = gains.get(place);
            for (i, x) in x.iter().enumerate() {
                let gain = settled.and_then(|settled| settled.gain.get(i)).copied().unwrap_or_default();
                let gain = tape.literal(gain * variance.sqrt() / units.scale(i));
                let step = tape.multiply(gain, *residual);
                routine.outputs.push((StorageArray::Mean, i, tape.add(*x, step)));
            }
            routine.variance = settled.map(|settled| tape.literal(settled.variance / variance));
        } else {
            let names: Vec<&str> = (0..size).map(|i| self.names.plain_state(i)).collect();
            joseph(&mut routine, *residual, (h, &x), &names);
        }
        routine.label(*residual, "innovation".to_owned());
        routine.residual = Some(*residual).filter(|_| !is_event);
        Ok(routine)
    }

    /// The constants that follow from parameters.
    fn configure(&mut self) -> Option<Routine> {
        if self.constants.nodes.is_empty() && self.request.adjustable.is_empty() {
            return None;
        }
        let mut routine = Routine::default();
        let roots = self.constants.nodes.clone();
        let names = self.names;
        let of_variable = |variable: Variable| Operand::Name(names.variable(variable, ""));
        let mut nothing = ExternalValues::new("", Rarity::Literal);
        let given = (&mut routine.tape, &mut nothing);
        let ids = lower(&mut self.model.graph, given, &roots, self.model.moving, &of_variable);
        routine.outputs =
            ids.into_iter().enumerate().map(|(k, id)| (StorageArray::Constants, k, id)).collect();
        Some(routine)
    }
}

/// The covariance as a full matrix of names.
fn covariance(tape: &mut Tape, size: usize) -> OpMatrix {
    let mut p = OpMatrix::new();
    for i in 0..size {
        p.push((0..size).map(|j| tape.named(SourceNames::covariance(i.max(j), i.min(j)))).collect());
    }
    p
}

/// A value with a whole period taken off or added where it is beyond half of one.
fn wrapped(tape: &mut Tape, value: TapeId, period: f64) -> TapeId {
    let [half, minus_half, whole] = [0.5 * period, -0.5 * period, period].map(|v| tape.literal(v));
    let (less, more) = (tape.subtract(value, whole), tape.add(value, whole));
    let low = tape.choice([value, minus_half, more, value]);
    tape.choice([half, value, less, low])
}

/// k = P·hᵀ/S with S = h·P·hᵀ + 1, x + k·residual, and (1 − k·h)·P·(1 − k·h)ᵀ + k·kᵀ.
///
/// With B = P − k·(P·hᵀ)ᵀ the last is B + (k − B·hᵀ)·kᵀ. The bracket is zero but for rounding, and takes away what
/// rounding left in B: a correction that is far better than the prediction leaves a variance with all its digits.
fn joseph(routine: &mut Routine, residual: TapeId, (h, x): (&[TapeId], &[TapeId]), names: &[&str]) {
    let tape = &mut routine.tape;
    let size = x.len();
    let (zero, one) = (tape.literal(0.0), tape.literal(1.0));
    let p = covariance(tape, size);
    let times_h = |tape: &mut Tape, row: &[TapeId], first: TapeId| {
        row.iter().zip(h).fold(first, |sum, (entry, h)| {
            let term = tape.multiply(*entry, *h);
            tape.add(sum, term)
        })
    };
    let g: Vec<TapeId> = p.iter().map(|row| times_h(tape, row, zero)).collect();
    let variance = times_h(tape, &g, one);
    let inverse = tape.divide(one, variance);
    let k: Vec<TapeId> = g.iter().map(|g| tape.multiply(*g, inverse)).collect();
    let mut b = p;
    for (i, ki) in k.iter().enumerate() {
        for (j, gj) in g.iter().enumerate().take(i + 1) {
            let term = tape.multiply(*ki, *gj);
            let Some(entry) = b.get(i).and_then(|row| row.get(j)).copied() else { continue };
            let value = tape.subtract(entry, term);
            for (row, column) in [(i, j), (j, i)] {
                if let Some(slot) = b.get_mut(row).and_then(|row| row.get_mut(column)) {
                    *slot = value;
                }
            }
        }
    }
    for (i, (x, ki)) in x.iter().zip(&k).enumerate() {
        let step = tape.multiply(*ki, residual);
        routine.outputs.push((StorageArray::Mean, i, tape.add(*x, step)));
    }
    for (i, (row, ki)) in b.iter().zip(&k).enumerate() {
        let minus = row.iter().zip(h).fold(*ki, |sum, (entry, h)| {
            let term = tape.multiply(*entry, *h);
            tape.subtract(sum, term)
        });
        for (j, (entry, kj)) in row.iter().zip(&k).enumerate().take(i + 1) {
            let term = tape.multiply(minus, *kj);
            routine.outputs.push((StorageArray::Covariance, i * (i + 1) / 2 + j, tape.add(*entry, term)));
        }
    }
    routine.variance = Some(variance);
    routine.label(variance, "variance".to_owned());
    routine.label(inverse, "inverse".to_owned());
    for ((h, g), (k, name)) in h.iter().zip(&g).zip(k.iter().zip(names)) {
        routine.label(*h, format!("h_{name}"));
        routine.label(*g, format!("ph_{name}"));
        routine.label(*k, format!("gain_{name}"));
    }
    for (i, row) in b.iter().enumerate() {
        row.iter().take(i + 1).enumerate().for_each(|(j, entry)| routine.label(*entry, format!("b{i}_{j}")));
    }
    routine.gains = k;
}

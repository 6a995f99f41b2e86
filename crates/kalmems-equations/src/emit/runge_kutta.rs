//! A step of fourth order with its Jacobian: Runge and Kutta's, or the exponential one of `exponential`.
//!
//! What one stage needs of the states is a function of its own, called four times. What follows from inputs and from parameters that
//! are states is computed outside of it, once for the start, the middle and the end of the interval.

use super::error::EmitError;
use super::exponential;
use super::filter::{Context, OpMatrix};
use super::lower::{ExternalValues, Operand, lower};
use super::model::{Rarity, rarities};
use super::routine::{Routine, StageCall, StorageArray};
use super::scale::Units;
use super::tape::{Tape, TapeId};
use crate::graph::{Graph, Node, NodeId, Variable};

/// The points of the inputs, how far a stage goes along the one before it, and its weight.
const STAGES: [(&str, f64, f64); 4] =
    [("start", 0.0, 1.0), ("middle", 0.5, 2.0), ("middle", 0.5, 2.0), ("last", 1.0, 1.0)];

/// The prediction, and the stage where it needs one.
pub(super) fn predict(
    context: &mut Context<'_>,
    units: &Units,
    periods: &[(usize, f64)],
) -> Result<(Routine, Option<Routine>), EmitError> {
    let (size, moving) = (context.model.size, context.model.moving);
    let rates = context.model.rates.clone();
    let weights = (!context.request.linear.is_empty()).then(|| exponential::weights(context.request, units));
    let affine = match &weights {
        Some(weights) => exponential::affine_rates(context, weights)?,
        None => vec![None; moving],
    };
    // The rates, and behind each its derivatives by all states.
    let roots: Vec<NodeId> =
        rates.iter().flat_map(|rate| [rate.value].into_iter().chain(context.row(rate))).collect();
    let rarity = rarities(&context.model.graph, &roots, moving);
    let is_of_stage = |root: &NodeId| {
        rarity.get(root.index()) == Some(&Rarity::Moving) && !is_linear(&context.model.graph, *root)
    };
    let rows = roots.chunks(size + 1).zip(&affine).filter(|(_, affine)| affine.is_none());
    let roots_of_stages = rows.flat_map(|(row, _)| row);
    let mut of_stage: Vec<NodeId> = roots_of_stages.filter(|root| is_of_stage(root)).copied().collect();
    of_stage.sort_unstable();
    of_stage.dedup();

    let mut held = ExternalValues::new("w", Rarity::Held);
    let mut stage = Routine::default();
    let of_variable = |variable: Variable| match variable {
        Variable::State(index) => Operand::Name(format!("z{index}")),
        Variable::Input(index) | Variable::Parameter(index) => Operand::Name(format!("w{index}")),
    };
    let given = (&mut stage.tape, &mut held);
    let ids = lower(&mut context.model.graph, given, &of_stage, moving, &of_variable);
    let of_states: Vec<usize> =
        (0..moving).filter(|i| stage_reads(&context.model.graph, &of_stage, *i)).collect();
    stage.parameters = of_states.iter().map(|i| format!("z{i}")).collect();
    stage.parameters.extend((0..held.nodes.len()).map(|k| format!("w{k}")));
    stage.outputs = ids.into_iter().enumerate().map(|(k, id)| (StorageArray::Stage, k, id)).collect();

    let stages = StageSource { roots, of_stage, of_states, held, affine, size, moving };
    let mut routine = Routine::default();
    let names = context.names;
    let x: Vec<_> = (0..moving).map(|i| routine.tape.named(names.state(i))).collect();
    let (next, jacobian) = match &weights {
        None => by_runge_kutta(context, &mut routine, &stages, &x),
        Some(weights) => exponential::steps(context, &mut routine, &stages, &x, weights),
    };
    context.finish_prediction(&mut routine, (&next, jacobian), units, periods);
    Ok((routine, (!stages.of_stage.is_empty()).then_some(stage)))
}

/// What a stage is made of.
pub(super) struct StageSource {
    /// The rates, and behind each its derivatives by all states.
    roots: Vec<NodeId>,
    /// Those that a function computes, and the states that it reads.
    of_stage: Vec<NodeId>,
    of_states: Vec<usize>,
    held: ExternalValues,
    /// For each rate that is A·x + g, with the row A of the linear part and g free of the states: g. None for the other rates.
    pub(super) affine: Vec<Option<NodeId>>,
    pub(super) size: usize,
    pub(super) moving: usize,
}

impl StageSource {
    /// The rates and their derivatives at a place, with the inputs of a point, in the stage of this number from 0 on.
    pub(super) fn at(
        &self,
        context: &mut Context<'_>,
        routine: &mut Routine,
        (number, point): (usize, &'static str),
        at: &[TapeId],
    ) -> (Vec<TapeId>, OpMatrix) {
        let (names, moving) = (context.names, self.moving);
        let zero = routine.tape.literal(0.0);
        let output = format!("k{}", number + 1);
        if !self.of_stage.is_empty() {
            let arguments = self.of_states.iter().filter_map(|i| at.get(*i)).copied();
            let mut arguments: Vec<TapeId> = arguments.collect();
            arguments.extend(context.lower(&mut routine.tape, &self.held.nodes, point));
            routine.calls.push(StageCall { arguments, output: output.clone() });
        }
        let (tape, constants) = (&mut routine.tape, &mut context.constants);
        let of_variable = |variable: Variable| match variable {
            Variable::State(index) if index < moving => at
                .get(index)
                .map_or_else(|| Operand::Name(names.variable(variable, point)), |id| Operand::Id(*id)),
            _ => Operand::Name(names.variable(variable, point)),
        };
        let is_inline = |root: &&NodeId| !self.of_stage.contains(root);
        let inline: Vec<NodeId> = self.roots.iter().filter(is_inline).copied().collect();
        let ids = lower(&mut context.model.graph, (&mut *tape, constants), &inline, moving, &of_variable);
        let mut ids = ids.into_iter();
        let mut values = Vec::with_capacity(self.roots.len());
        for root in &self.roots {
            values.push(match self.of_stage.iter().position(|of| of == root) {
                Some(place) => tape.named(format!("{output}[{place}]")),
                None => ids.next().unwrap_or(zero),
            });
        }
        let rows: Vec<&[_]> = values.chunks(self.size + 1).collect();
        let k = rows.iter().filter_map(|row| row.first().copied()).collect();
        let a = rows.iter().map(|row| row.iter().skip(1).copied().collect()).collect();
        (k, a)
    }
}

/// The step by Runge and Kutta's method.
fn by_runge_kutta(
    context: &mut Context<'_>,
    routine: &mut Routine,
    stages: &StageSource,
    x: &[TapeId],
) -> (Vec<TapeId>, OpMatrix) {
    let zero = routine.tape.literal(0.0);
    let mut last: Option<(Vec<_>, OpMatrix)> = None;
    let mut sums = (vec![zero; stages.moving], vec![vec![zero; stages.size]; stages.moving]);
    for (number, (point, onwards, weight)) in STAGES.into_iter().enumerate() {
        let tape = &mut routine.tape;
        let step = tape.literal(onwards);
        let mut at = x.to_vec();
        if let Some((k, _)) = &last {
            for (at, k) in at.iter_mut().zip(k) {
                let moved = tape.multiply(step, *k);
                *at = tape.add(*at, moved);
            }
        }
        let (k, a) = stages.at(context, routine, (number, point), &at);
        let tape = &mut routine.tape;
        let columns = onwards_along(tape, &a, last.as_ref().map(|(_, before)| before), step);
        let weight = tape.literal(weight);
        for (sum, k) in sums.0.iter_mut().zip(&k) {
            let term = tape.multiply(weight, *k);
            *sum = tape.add(*sum, term);
        }
        for (sum, k) in sums.1.iter_mut().flatten().zip(columns.iter().flatten()) {
            let term = tape.multiply(weight, *k);
            *sum = tape.add(*sum, term);
        }
        last = Some((k, columns));
    }
    finished(&mut routine.tape, x, sums)
}

/// The derivatives of a stage: K = B + c·A·K of the stage before, where B is A itself and ∂f/∂p behind it.
fn onwards_along(tape: &mut Tape, a: &OpMatrix, before: Option<&OpMatrix>, step: TapeId) -> OpMatrix {
    let zero = tape.literal(0.0);
    let mut columns = a.clone();
    let Some(before) = before else { return columns };
    for (row, of_row) in columns.iter_mut().zip(a) {
        for (j, entry) in row.iter_mut().enumerate() {
            let mut product = zero;
            for (factor, before) in of_row.iter().zip(before) {
                let term = tape.multiply(*factor, before.get(j).copied().unwrap_or(zero));
                product = tape.add(product, term);
            }
            let product = tape.multiply(step, product);
            *entry = tape.add(*entry, product);
        }
    }
    columns
}

/// x + Σ/6 and 1 + Σ/6.
fn finished(
    tape: &mut Tape,
    x: &[TapeId],
    (rates, columns): (Vec<TapeId>, OpMatrix),
) -> (Vec<TapeId>, OpMatrix) {
    let (sixth, one) = (tape.literal(1.0 / 6.0), tape.literal(1.0));
    let mut next = Vec::with_capacity(x.len());
    for (x, sum) in x.iter().zip(&rates) {
        let step = tape.multiply(sixth, *sum);
        next.push(tape.add(*x, step));
    }
    let mut jacobian = columns;
    for (i, row) in jacobian.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let step = tape.multiply(sixth, *entry);
            *entry = if i == j { tape.add(one, step) } else { step };
        }
    }
    (next, jacobian)
}

/// Whether an expression is a number or a sum of states with numbers, which needs no function.
fn is_linear(graph: &Graph, id: NodeId) -> bool {
    let is_variable = |id: NodeId| graph.as_variable(id).is_some();
    match graph.node(id) {
        Node::Number(_) | Node::Variable(_) => true,
        Node::Sum { terms, .. } => terms.iter().all(|(term, _)| is_variable(*term)),
        _ => false,
    }
}

/// Whether expressions depend on a state.
fn stage_reads(graph: &Graph, roots: &[NodeId], state: usize) -> bool {
    graph.below(roots).iter().any(|id| graph.as_variable(*id) == Some(Variable::State(state)))
}

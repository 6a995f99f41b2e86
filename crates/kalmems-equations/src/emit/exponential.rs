//! The step of [`Etdrk4`](kalmems_core::Etdrk4) with its Jacobian: the linear part and its exponentials are numbers of the source.

use super::error::EmitError;
use super::filter::{Context, OpMatrix};
use super::laws::expanded;
use super::request::EmitRequest;
use super::rewrite::substituted;
use super::routine::Routine;
use super::runge_kutta::StageSource;
use super::scale::Units;
use super::tape::{Tape, TapeId};
use crate::graph::{Graph, NodeId, Variable};
use crate::motion::MOST_STATES;
use kalmems_core::{EtdWeights, Mat};
use std::collections::HashMap;

/// The matrices of one step over one interval, in the units of the filter.
pub(super) type StepWeights = EtdWeights<f64, MOST_STATES>;

/// Those of a request with a linear part.
pub(super) fn weights(request: &EmitRequest, units: &Units) -> StepWeights {
    let moving = request.states.len();
    let entry = |i: usize, j: usize| {
        let known = request.linear.get(i * moving + j).filter(|_| i < moving && j < moving);
        let slope = known.copied().filter(|slope| slope.is_finite()).unwrap_or(0.0);
        slope * request.interval_s * units.scale(j) / units.scale(i)
    };
    let scaled = |i: usize, j: usize| if i < moving && j < moving { entry(i, j) } else { 0.0 };
    EtdWeights::new(Mat::from_fn(scaled), 1.0)
}

/// How far a number of a rate may be from that of the linear part, relative to the largest of its row.
const SAME: f64 = 1e-9;

/// For each rate that is A·x + g, with the row A of the linear part and g free of the states: g. None for the other rates.
pub(super) fn affine_rates(
    context: &mut Context<'_>,
    weights: &StepWeights,
) -> Result<Vec<Option<NodeId>>, EmitError> {
    let moving = context.model.moving;
    let at_rest: HashMap<NodeId, NodeId> = (0..moving)
        .map(|state| (context.model.graph.variable(Variable::State(state)), Graph::ZERO))
        .collect();
    let mut affine = Vec::with_capacity(moving);
    for (row, rate) in context.model.rates.clone().iter().enumerate() {
        let graph = &mut context.model.graph;
        let linear = &weights.linear.0[row];
        let largest = linear.iter().fold(0.0_f64, |largest, number| largest.max(number.abs()));
        let mut apart = *linear;
        let mut is_affine = true;
        for (column, slope) in &rate.slopes {
            match (graph.number(*slope), apart.get_mut(*column).filter(|_| *column < moving)) {
                (Some(number), Some(apart)) => *apart -= number,
                _ => is_affine = false,
            }
        }
        is_affine &= apart.iter().all(|apart| apart.abs() <= SAME * largest);
        affine.push(if is_affine {
            substituted(graph, &[rate.value], &at_rest, &mut expanded)?.first().copied()
        } else {
            None
        });
    }
    Ok(affine)
}

/// The step of a device whose rates are all affine: one matrix times the states, and what inputs add at the three points of the interval.
fn affine_step(
    context: &mut Context<'_>,
    routine: &mut Routine,
    rests: &[NodeId],
    x: &[TapeId],
    weights: &StepWeights,
) -> (Vec<TapeId>, OpMatrix) {
    let of_start = |i: usize, k: usize| {
        weights.to_end.0[i][k] - weights.bend_of_end.0[i][k] - 2.0 * weights.bend_of_middles.0[i][k]
    };
    let of_middle = |i: usize, k: usize| 2.0 * weights.bend_of_middles.0[i][k];
    let of_end = |i: usize, k: usize| weights.bend_of_end.0[i][k];
    let weights_of: [&dyn Fn(usize, usize) -> f64; 3] = [&of_start, &of_middle, &of_end];
    let rests_at = ["start", "middle", "last"].map(|point| context.lower(&mut routine.tape, rests, point));
    let moving = context.model.moving;
    let (mut next, mut jacobian) = (Vec::with_capacity(moving), OpMatrix::new());
    for (i, own) in x.iter().enumerate() {
        // What an input adds that has the same value at several points is added once.
        let mut added: Vec<(TapeId, f64)> = Vec::new();
        for (k, state) in x.iter().enumerate() {
            let along = (0..moving).map(|l| weights.to_end.0[i][l] * weights.linear.0[l][k]).sum();
            added.push((*state, along));
        }
        let tape = &mut routine.tape;
        jacobian.push(added.iter().map(|(_, along)| tape.literal(*along)).collect());
        for (rests, of) in rests_at.iter().zip(weights_of) {
            for (k, rest) in rests.iter().enumerate() {
                match added.iter_mut().find(|(known, _)| known == rest) {
                    Some((_, sum)) => *sum += of(i, k),
                    None => added.push((*rest, of(i, k))),
                }
            }
        }
        let sum = added.into_iter().fold(tape.literal(0.0), |sum, (of, factor)| {
            let factor = tape.literal(factor);
            let term = tape.multiply(factor, of);
            tape.add(sum, term)
        });
        next.push(tape.add(*own, sum));
    }
    add_identity(&mut routine.tape, &mut jacobian);
    (next, jacobian)
}

/// Adds 1 to the entries on the diagonal.
fn add_identity(tape: &mut Tape, matrix: &mut OpMatrix) {
    let one = tape.literal(1.0);
    for (i, row) in matrix.iter_mut().enumerate() {
        if let Some(entry) = row.get_mut(i) {
            *entry = tape.add(one, *entry);
        }
    }
}

/// A way from the start, and its derivatives by all states.
struct Way {
    moved: Vec<TapeId>,
    slopes: OpMatrix,
}

/// The states behind the interval, and their derivatives by all states.
pub(super) fn steps(
    context: &mut Context<'_>,
    routine: &mut Routine,
    stages: &StageSource,
    x: &[TapeId],
    weights: &StepWeights,
) -> (Vec<TapeId>, OpMatrix) {
    if let Some(rests) = stages.affine.iter().copied().collect::<Option<Vec<NodeId>>>() {
        return affine_step(context, routine, &rests, x, weights);
    }
    // A rate of which the linear part describes all is a bend of its inputs alone, and none without inputs.
    let rest_of = |row: &usize| stages.affine.get(*row).copied().flatten();
    let is_bent = |row: &usize| rest_of(row).is_none_or(|rest| context.model.graph.number(rest).is_none());
    let bent: Vec<usize> = (0..stages.moving).filter(is_bent).collect();
    let driven: Vec<(usize, NodeId)> = bent.iter().filter_map(|row| Some((*row, rest_of(row)?))).collect();
    let rests: Vec<NodeId> = driven.iter().map(|(_, rest)| *rest).collect();
    let rests_at_start = context.lower(&mut routine.tape, &rests, "start");
    let (rate, slopes) = stages.at(context, routine, (0, "start"), x);
    let start = Way { moved: rate, slopes };
    let all: Vec<usize> = (0..stages.moving).collect();
    let mut bends = Vec::new();
    let first = added(&mut routine.tape, None, (&weights.to_middle, &all), &start);
    let straight = added(&mut routine.tape, None, (&weights.to_end, &all), &start);
    let mut way = first;
    for (number, point, onwards) in [
        (1, "middle", &weights.bend_to_middle),
        (2, "middle", &weights.bend_to_end),
        (3, "last", &weights.bend_of_end),
    ] {
        let at: Vec<TapeId> =
            x.iter().zip(&way.moved).map(|(x, moved)| routine.tape.add(*x, *moved)).collect();
        let there = stages.at(context, routine, (number, point), &at);
        let rests_there = context.lower(&mut routine.tape, &rests, point);
        let tape = &mut routine.tape;
        let mut bend = bend(tape, weights, (&there, &start), (&way, &bent, &stages.affine));
        for ((row, _), (there, here)) in driven.iter().zip(rests_there.iter().zip(&rests_at_start)) {
            bend.moved[*row] = tape.subtract(*there, *here);
        }
        let from = if number == 1 { &way } else { &straight };
        way = added(&mut routine.tape, Some(from), (onwards, &bent), &bend);
        bends.push(bend);
    }
    for bend in bends.iter().take(2) {
        way = added(&mut routine.tape, Some(&way), (&weights.bend_of_middles, &bent), bend);
    }
    let tape = &mut routine.tape;
    let next = x.iter().zip(&way.moved).map(|(x, moved)| tape.add(*x, *moved)).collect();
    let mut jacobian = way.slopes;
    add_identity(tape, &mut jacobian);
    (next, jacobian)
}

/// A way and what these rows of another one add to it by a matrix.
fn added(
    tape: &mut Tape,
    way: Option<&Way>,
    (matrix, rows): (&Mat<f64, MOST_STATES, MOST_STATES>, &[usize]),
    of: &Way,
) -> Way {
    let (moving, zero) = (of.moved.len(), tape.literal(0.0));
    let blank = || Way {
        moved: vec![zero; moving],
        slopes: of.slopes.iter().map(|row| vec![zero; row.len()]).collect(),
    };
    let mut sum = way.map_or_else(blank, |way| Way { moved: way.moved.clone(), slopes: way.slopes.clone() });
    for i in 0..moving {
        for row in rows {
            let factor = tape.literal(matrix.0[i][*row]);
            let term = tape.multiply(factor, of.moved[*row]);
            sum.moved[i] = tape.add(sum.moved[i], term);
            for (entry, slope) in sum.slopes[i].iter_mut().zip(&of.slopes[*row]) {
                let term = tape.multiply(factor, *slope);
                *entry = tape.add(*entry, term);
            }
        }
    }
    sum
}

/// f(x + m) − f(x) − A·m in the rows that bend and are not affine, and its derivatives by all states; nothing in the others.
fn bend(
    tape: &mut Tape,
    weights: &StepWeights,
    (there, here): (&(Vec<TapeId>, OpMatrix), &Way),
    (way, bent, affine): (&Way, &[usize], &[Option<NodeId>]),
) -> Way {
    let zero = tape.literal(0.0);
    let blank = here.slopes.iter().map(|row| vec![zero; row.len()]).collect();
    let mut bend = Way { moved: vec![zero; here.moved.len()], slopes: blank };
    let is_affine = |row: &usize| affine.get(*row).is_some_and(Option::is_some);
    for row in bent.iter().copied().filter(|row| !is_affine(row)) {
        let minus_here = tape.negative(here.moved[row]);
        let mut value = tape.add(there.0[row], minus_here);
        for (j, moved) in way.moved.iter().enumerate() {
            let factor = tape.literal(-weights.linear.0[row][j]);
            let term = tape.multiply(factor, *moved);
            value = tape.add(value, term);
        }
        bend.moved[row] = value;
        for column in 0..here.slopes[row].len() {
            let minus_here = tape.negative(here.slopes[row][column]);
            let mut slope = tape.add(there.1[row][column], minus_here);
            for (j, of_way) in way.slopes.iter().enumerate() {
                let linear = tape.literal(-weights.linear.0[row][j]);
                let beyond = tape.add(there.1[row][j], linear);
                let term = tape.multiply(beyond, of_way[column]);
                slope = tape.add(slope, term);
            }
            bend.slopes[row][column] = slope;
        }
    }
    bend
}

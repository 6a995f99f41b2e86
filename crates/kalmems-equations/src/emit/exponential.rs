//! The step of [`Etdrk4`](kalmems_core::Etdrk4) with its Jacobian: the linear part and its exponentials are numbers of the source.

use super::filter::{Context, OpMatrix};
use super::request::EmitRequest;
use super::routine::Routine;
use super::runge_kutta::StageSource;
use super::scale::Units;
use super::tape::{Tape, TapeId};
use crate::motion::MOST_STATES;
use kalmems_core::{EtdWeights, Mat};

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
    let bent: Vec<usize> =
        (0..stages.moving).filter(|row| !stages.is_straight(&context.model.graph, *row)).collect();
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
        let bend = bend(&mut routine.tape, weights, (&there, &start), (&way, &bent));
        let from = if number == 1 { &way } else { &straight };
        way = added(&mut routine.tape, Some(from), (onwards, &bent), &bend);
        bends.push(bend);
    }
    for bend in bends.iter().take(2) {
        way = added(&mut routine.tape, Some(&way), (&weights.bend_of_middles, &bent), bend);
    }
    let tape = &mut routine.tape;
    let next = x.iter().zip(&way.moved).map(|(x, moved)| tape.add(*x, *moved)).collect();
    let one = tape.literal(1.0);
    let mut jacobian = way.slopes;
    for (i, row) in jacobian.iter_mut().enumerate() {
        if let Some(entry) = row.get_mut(i) {
            *entry = tape.add(one, *entry);
        }
    }
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

/// f(x + m) − f(x) − A·m in the rows that bend, and its derivatives by all states; nothing in the others.
fn bend(
    tape: &mut Tape,
    weights: &StepWeights,
    (there, here): (&(Vec<TapeId>, OpMatrix), &Way),
    (way, bent): (&Way, &[usize]),
) -> Way {
    let zero = tape.literal(0.0);
    let blank = here.slopes.iter().map(|row| vec![zero; row.len()]).collect();
    let mut bend = Way { moved: vec![zero; here.moved.len()], slopes: blank };
    for row in bent.iter().copied() {
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

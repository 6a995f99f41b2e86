//! Published laws as elementary functions, so that constants meet and an exponential is computed once.
//!
//! What is left of a law is a function of one number that the source has: Φ(z) = atanh(z)/z, ln cosh(u/2), and C/(ε₀·a) of two
//! disks over their distance in radii. Such a node has numbers for its other arguments.

use super::error::EmitError;
use super::rewrite::substituted;
use crate::graph::{Function, Graph, Node, NodeId, Variable};
use crate::laws::{self, LawId};
use kalmems_models::capacitance::VACUUM_PERMITTIVITY;
use std::collections::HashMap;

/// The first input that stands for an argument of a law; devices have fewer inputs.
const PLACEHOLDERS: usize = 1 << 20;
/// The highest derivative of a function of one number that the source has.
const HIGHEST: usize = 2;

/// A law, differentiated by these arguments, without laws but those of one number.
pub(super) fn expanded(
    graph: &mut Graph,
    law: LawId,
    by: &[u8],
    arguments: &[NodeId],
) -> Result<NodeId, EmitError> {
    if is_plain(law, arguments) && by.iter().all(|index| *index == 0) {
        return of_one_number(graph, law, by, arguments);
    }
    let places: Vec<Variable> = (0..arguments.len()).map(|k| Variable::Input(PLACEHOLDERS + k)).collect();
    let nodes: Vec<NodeId> = places.iter().map(|place| graph.variable(*place)).collect();
    let mut node = formula(graph, law, &nodes);
    for index in by {
        let Some(place) = places.get(usize::from(*index)) else { continue };
        node = graph.derivative(node, *place);
    }
    // Derivatives of what is left are laws of one number again.
    let values: HashMap<NodeId, NodeId> = nodes.into_iter().zip(arguments.iter().copied()).collect();
    let found = substituted(graph, &[node], &values, &mut |graph, law, by, arguments| {
        of_one_number(graph, law, by, arguments)
    })?;
    Ok(found.first().copied().unwrap_or(Graph::ZERO))
}

/// Whether it is in the form of one number already.
fn is_plain(law: LawId, arguments: &[NodeId]) -> bool {
    let is_one = |k: usize| arguments.get(k) == Some(&Graph::ONE);
    match law {
        LawId::Atanhc => true,
        LawId::Disks => is_one(1),
        LawId::LogisticCombChange => {
            arguments.get(1) == Some(&Graph::ZERO) && is_one(2) && is_one(3) && is_one(4)
        }
        _ => false,
    }
}

/// A derivative of a law of one number: the node itself, or what is simpler.
fn of_one_number(
    graph: &mut Graph,
    law: LawId,
    by: &[u8],
    arguments: &[NodeId],
) -> Result<NodeId, EmitError> {
    let too_high = EmitError::Law { law: laws::name(law), order: by.len(), by: by.to_vec() };
    match (law, arguments) {
        // −ln cosh(u/2) has the derivatives −tanh(u/2)/2 and −(1 − tanh²(u/2))/4.
        (LawId::LogisticCombChange, [u, ..]) if !by.is_empty() => {
            let half = graph.scaled(0.5, *u);
            let tanh = graph.call(Function::Tanh, half);
            let square = graph.product(&[(tanh, 2)]);
            match by.len() {
                1 => Ok(graph.scaled(-0.5, tanh)),
                2 => Ok(graph.sum(-0.25, &[(square, 0.25)])),
                _ => Err(too_high),
            }
        }
        _ if by.len() > HIGHEST => Err(too_high),
        _ => Ok(graph.law(law, by.to_vec(), arguments)),
    }
}

/// A law as a formula of its arguments.
fn formula(graph: &mut Graph, law: LawId, a: &[NodeId]) -> NodeId {
    match (law, a) {
        (LawId::GaussianComb, [angle, nominal, width, bias, ..]) => {
            let square = graph.product(&[(*angle, 2), (*width, -2)]);
            let minus = graph.scaled(-1.0, square);
            let bell = graph.call(Function::Exp, minus);
            let comb = graph.product(&[(*nominal, 1), (bell, 1)]);
            graph.sum(0.0, &[(comb, 1.0), (*bias, 1.0)])
        }
        // 1/(1 + e^{−u}) − 1/2 = tanh(u/2)/2.
        (LawId::LogisticComb, [angle, centre, gain, steepness, ..]) => {
            let u = steep(graph, *angle, *centre, *steepness);
            let half = graph.scaled(0.5, u);
            let tanh = graph.call(Function::Tanh, half);
            let product = graph.product(&[(tanh, 1), (*gain, 1)]);
            graph.scaled(0.5, product)
        }
        (LawId::LogisticCombChange, [angle, centre, gain, steepness, transimpedance, ..]) => {
            let u = steep(graph, *angle, *centre, *steepness);
            let plain = [u, Graph::ZERO, Graph::ONE, Graph::ONE, Graph::ONE];
            let integral = graph.law(law, Vec::new(), &plain);
            graph.product(&[(integral, 1), (*gain, 1), (*steepness, -1), (*transimpedance, -1)])
        }
        (LawId::TiltingPlate, [angle, near, far, along, gap, permittivity, ..]) => {
            tilting_plate(graph, [*angle, *near, *far, *along, *gap, *permittivity])
        }
        (LawId::Carrier, [capacitance, excitation, rate, shunt, parallel, input, blocking, ..]) => {
            carrier(graph, [*capacitance, *excitation, *rate, *shunt, *parallel, *input, *blocking])
        }
        (LawId::Disks, [distance, radius, ..]) => {
            let share = graph.product(&[(*distance, 1), (*radius, -1)]);
            let plain = graph.law(law, Vec::new(), &[share, Graph::ONE]);
            let product = graph.product(&[(plain, 1), (*radius, 1)]);
            graph.scaled(VACUUM_PERMITTIVITY, product)
        }
        (LawId::Atanhc, [z, ..]) => graph.law(law, Vec::new(), &[*z]),
        _ => Graph::ZERO,
    }
}

/// steepness·(angle − centre).
fn steep(graph: &mut Graph, angle: NodeId, centre: NodeId, steepness: NodeId) -> NodeId {
    let distance = graph.sum(0.0, &[(angle, 1.0), (centre, -1.0)]);
    graph.product(&[(distance, 1), (steepness, 1)])
}

/// ε·b·δ·Φ(z)/U with t = tan θ, U = D − m·t and z = δ·t/(2·U).
fn tilting_plate(graph: &mut Graph, [angle, near, far, along, gap, permittivity]: [NodeId; 6]) -> NodeId {
    let (sine, cosine) = (graph.call(Function::Sin, angle), graph.call(Function::Cos, angle));
    let tangent = graph.product(&[(sine, 1), (cosine, -1)]);
    let middle = graph.sum(0.0, &[(near, 0.5), (far, 0.5)]);
    let half = graph.sum(0.0, &[(far, 0.5), (near, -0.5)]);
    let nearer = graph.product(&[(middle, 1), (tangent, 1)]);
    let distance = graph.sum(0.0, &[(gap, 1.0), (nearer, -1.0)]);
    let z = graph.product(&[(half, 1), (tangent, 1), (distance, -1)]);
    let ratio = graph.law(LawId::Atanhc, Vec::new(), &[z]);
    let factors = [(permittivity, 1), (along, 1), (half, 1), (ratio, 1), (distance, -1)];
    let product = graph.product(&factors);
    graph.scaled(2.0, product)
}

/// The amplitude of a carrier behind a capacitance, as `CarrierDivider::voltage` of `kalmems-models` has it.
fn carrier(
    graph: &mut Graph,
    [capacitance, excitation, rate, shunt, parallel, input, blocking]: [NodeId; 7],
) -> NodeId {
    let reactance = graph.product(&[(rate, 1), (blocking, 1)]);
    let (input_square, square) = (graph.product(&[(input, 2)]), graph.product(&[(reactance, 2)]));
    let both = graph.sum(0.0, &[(input_square, 1.0), (square, 1.0)]);
    let through = graph.product(&[(input, 1), (square, 1), (both, -1)]);
    let conductance = graph.sum(0.0, &[(shunt, 1.0), (through, 1.0)]);
    let per_rate = graph.product(&[(conductance, 1), (rate, -1)]);
    let behind = graph.product(&[(input_square, 1), (reactance, 1), (both, -1), (rate, -1)]);
    let reactive = graph.sum(0.0, &[(capacitance, 1.0), (parallel, 1.0), (behind, 1.0)]);
    let (reactive_square, rest) = (graph.product(&[(reactive, 2)]), graph.product(&[(per_rate, 2)]));
    let length_square = graph.sum(0.0, &[(reactive_square, 1.0), (rest, 1.0)]);
    let length = graph.call(Function::Sqrt, length_square);
    let root = graph.call(Function::Sqrt, both);
    graph.product(&[(capacitance, 1), (length, -1), (excitation, 1), (reactance, 1), (root, -1)])
}

/// The function of one number that a node of a law is, and its order.
pub(super) fn plain(node: &Node) -> Option<(LawId, u8, NodeId)> {
    match node {
        Node::Law { law, by, arguments } => {
            let order = u8::try_from(by.len()).ok()?;
            Some((*law, order, arguments.first().copied()?))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{LAWS, MOST_ARGUMENTS, partial};
    use crate::program::{Program, RegisterCounts};

    /// Every law and its derivatives by each argument, taken apart, against the law of `kalmems-models` at points of its domain.
    #[test]
    fn laws_taken_apart_are_the_laws() {
        let points: [(LawId, &[f64]); 7] = [
            (LawId::GaussianComb, &[0.11, 5.7, 0.2, 9.8]),
            (LawId::LogisticComb, &[0.05, 0.0037, 2.8e-3, 76.0]),
            (LawId::LogisticCombChange, &[0.05, 0.0037, 2.8e-3, 76.0, 1e3]),
            (LawId::TiltingPlate, &[0.011, 0.99e-3, 1.39e-3, 0.4e-3, 19.2e-6, 8.85e-12]),
            (LawId::Carrier, &[1.3, 2.0, 0.7, 0.4, 0.9, 0.3, 1.7]),
            (LawId::Disks, &[0.9e-3, 1.1e-3]),
            (LawId::Atanhc, &[0.6]),
        ];
        assert_eq!(points.len(), LAWS.len());
        for (law, values) in points {
            let mut graph = Graph::new();
            let count = values.len();
            let arguments: Vec<NodeId> = (0..count).map(|k| graph.variable(Variable::Parameter(k))).collect();
            let mut native = [0.0; MOST_ARGUMENTS];
            native[..count].copy_from_slice(values);
            let all = 0..u8::try_from(count).unwrap();
            let orders =
                [vec![]].into_iter().chain(all.clone().map(|i| vec![i])).chain(all.map(|i| vec![0, i]));
            for by in orders {
                let node = expanded(&mut graph, law, &by, &arguments).unwrap();
                let counts = RegisterCounts { inputs: 0, parameters: count };
                let program = Program::of(&graph, &[node], counts, &[], &Vec::new().into()).unwrap();
                let found = program.work(values).get(program.outputs()[0]);
                // The node of one number stands for C/(ε₀·a), which the interpreter computes with ε₀.
                let unit = if law == LawId::Disks { VACUUM_PERMITTIVITY } else { 1.0 };
                let expected = unit * partial(law, &by, &native);
                let error = (found - expected).abs() / expected.abs().max(1e-300);
                assert!(error < 1e-9 || found == expected, "{law:?} by {by:?}: {found:e}, {expected:e}");
            }
        }
    }
}

//! Going over expressions: other variables, constants multiplied into sums, factors moved into sums that are shared.

use super::error::EmitError;
use crate::graph::{Graph, Node, NodeId};
use crate::laws::LawId;
use std::collections::HashMap;

/// The most terms of a sum that a constant is multiplied into.
const MOST_DISTRIBUTED: usize = 8;
/// Numbers this near to ±1, ±2 and ±1/2 are meant to be these: what scaling and scaling back leaves.
const NEAR: f64 = 1e-13;

/// What is made of a law.
pub(crate) type OfLaw<'a> =
    &'a mut dyn FnMut(&mut Graph, LawId, &[u8], &[NodeId]) -> Result<NodeId, EmitError>;

/// These expressions with other nodes instead of some, and laws as `of_law` has them.
pub(super) fn substituted(
    graph: &mut Graph,
    roots: &[NodeId],
    values: &HashMap<NodeId, NodeId>,
    of_law: OfLaw<'_>,
) -> Result<Vec<NodeId>, EmitError> {
    let mut made: HashMap<NodeId, NodeId> = HashMap::new();
    for id in graph.below(roots) {
        let node = graph.node(id).clone();
        let new = match values.get(&id) {
            Some(value) => *value,
            None => copied(graph, &node, &|part| made.get(&part).copied().unwrap_or(part), of_law)?,
        };
        made.insert(id, new);
    }
    Ok(roots.iter().map(|root| made.get(root).copied().unwrap_or(*root)).collect())
}

/// A node of other parts, made anew.
pub(crate) fn copied(
    graph: &mut Graph,
    node: &Node,
    part: &dyn Fn(NodeId) -> NodeId,
    of_law: OfLaw<'_>,
) -> Result<NodeId, EmitError> {
    Ok(match node {
        Node::Number(number) => graph.literal(number.get()),
        Node::Variable(variable) => graph.variable(*variable),
        Node::Sum { constant, terms } => {
            let parts: Vec<_> = terms.iter().map(|(term, c)| (part(*term), c.get())).collect();
            graph.sum(constant.get(), &parts)
        }
        Node::Product(factors) => {
            let parts: Vec<_> = factors.iter().map(|(factor, power)| (part(*factor), *power)).collect();
            graph.product(&parts)
        }
        Node::Call(function, at) => graph.call(*function, part(*at)),
        Node::Angle { y, x } => graph.angle(part(*y), part(*x)),
        Node::Choice { smaller, larger, then, otherwise } => {
            graph.choice(part(*smaller), part(*larger), part(*then), part(*otherwise))
        }
        Node::Law { law, by, arguments } => {
            let arguments: Vec<_> = arguments.iter().map(|argument| part(*argument)).collect();
            of_law(graph, *law, by, &arguments)?
        }
        Node::Curve { curve, order, at } => graph.curve(*curve, *order, at.map(&part)),
    })
}

/// Laws as they are. A `Result` as others have it.
#[allow(clippy::unnecessary_wraps)]
pub(crate) fn same_law(
    graph: &mut Graph,
    law: LawId,
    by: &[u8],
    arguments: &[NodeId],
) -> Result<NodeId, EmitError> {
    Ok(graph.law(law, by.to_vec(), arguments))
}

/// A number that is meant to be a power of two near one.
pub(super) fn snapped(value: f64) -> f64 {
    let near = [1.0, 2.0, 0.5].into_iter().find(|whole| (value.abs() / whole - 1.0).abs() < NEAR);
    near.map_or(value, |whole| whole.copysign(value))
}

/// How often each node is used by these expressions.
pub(super) fn uses(graph: &Graph, roots: &[NodeId]) -> Vec<u32> {
    let mut uses = vec![0_u32; graph.len()];
    let mut count = |id: NodeId| {
        if let Some(uses) = uses.get_mut(id.index()) {
            *uses += 1;
        }
    };
    for id in graph.below(roots) {
        graph.node(id).parts().into_iter().for_each(&mut count);
    }
    roots.iter().copied().for_each(count);
    uses
}

/// Constants multiplied into sums that nothing else uses, sums within sums taken apart, and numbers snapped.
///
/// `is_constant` says which nodes are constants of a program.
pub(super) fn distributed(
    graph: &mut Graph,
    roots: &[NodeId],
    is_constant: &dyn Fn(&Graph, NodeId) -> bool,
) -> Result<Vec<NodeId>, EmitError> {
    let uses = uses(graph, roots);
    let once = |id: NodeId| uses.get(id.index()) == Some(&1);
    let mut made: HashMap<NodeId, NodeId> = HashMap::new();
    for id in graph.below(roots) {
        let node = graph.node(id).clone();
        let part = |part: NodeId| made.get(&part).copied().unwrap_or(part);
        let new = match &node {
            Node::Sum { constant, terms } => {
                let mut sum = snapped(constant.get());
                let mut parts: Vec<(NodeId, f64)> = Vec::new();
                for (term, coefficient) in terms {
                    let (new, c) = (part(*term), snapped(coefficient.get()));
                    match inner(graph, new, c).filter(|_| once(*term)) {
                        Some((inner, of)) => {
                            sum += c * inner;
                            parts.extend(of.iter().map(|(part, scale)| (*part, snapped(c * scale))));
                        }
                        None => parts.push((new, c)),
                    }
                }
                graph.sum(snapped(sum), &parts)
            }
            Node::Product(factors) => {
                let parts: Vec<_> = factors.iter().map(|(f, power)| (part(*f), *power)).collect();
                into_sum(graph, factors, &parts, &once, is_constant).unwrap_or_else(|| graph.product(&parts))
            }
            _ => copied(graph, &node, &part, &mut same_law)?,
        };
        made.insert(id, new);
    }
    Ok(roots.iter().map(|root| made.get(root).copied().unwrap_or(*root)).collect())
}

/// The constant and the terms of a sum that a coefficient is worth multiplying into: not into several terms without one.
fn inner(graph: &Graph, id: NodeId, c: f64) -> Option<(f64, Vec<(NodeId, f64)>)> {
    let Node::Sum { constant, terms } = graph.node(id) else { return None };
    let without = terms.iter().filter(|(_, scale)| scale.get().abs() == 1.0).count();
    let worth = c.abs() == 1.0 || without <= 1;
    (worth && terms.len() <= MOST_DISTRIBUTED)
        .then(|| (constant.get(), terms.iter().map(|(term, scale)| (*term, scale.get())).collect()))
}

/// Constants times one sum that nothing else uses, as a sum.
fn into_sum(
    graph: &mut Graph,
    old: &[(NodeId, i32)],
    new: &[(NodeId, i32)],
    once: &dyn Fn(NodeId) -> bool,
    is_constant: &dyn Fn(&Graph, NodeId) -> bool,
) -> Option<NodeId> {
    let mut others = old.iter().zip(new).filter(|(_, (factor, _))| !is_constant(graph, *factor));
    let ((before, _), (sum, power)) = others.next()?;
    if others.next().is_some() || *power != 1 || new.len() < 2 || !once(*before) {
        return None;
    }
    let (constant, terms) = inner(graph, *sum, 2.0)?;
    let constants: Vec<_> = new.iter().filter(|(factor, _)| factor != sum).copied().collect();
    let mut parts = Vec::with_capacity(terms.len() + 1);
    for (term, scale) in terms {
        let mut factors = constants.clone();
        factors.push((term, 1));
        parts.push((graph.product(&factors), scale));
    }
    parts.push((graph.product(&constants), constant));
    Some(graph.sum(0.0, &parts))
}

/// The sums that are factors, and the coefficients that stand before products with them.
pub(super) fn scalable(graph: &Graph, roots: &[NodeId]) -> Vec<(NodeId, Vec<f64>)> {
    let mut found: Vec<(NodeId, Vec<f64>)> = Vec::new();
    for id in graph.below(roots) {
        let Node::Sum { terms, .. } = graph.node(id) else { continue };
        for (term, coefficient) in terms {
            let Node::Product(factors) = graph.node(*term) else { continue };
            for (factor, _) in factors.iter().filter(|(_, power)| *power == 1) {
                let is_sum = matches!(graph.node(*factor), Node::Sum { .. });
                let size = coefficient.get().abs();
                if !is_sum || size == 1.0 {
                    continue;
                }
                match found.iter_mut().find(|(sum, _)| sum == factor) {
                    Some((_, sizes)) if sizes.contains(&size) => {}
                    Some((_, sizes)) => sizes.push(size),
                    None => found.push((*factor, vec![size])),
                }
            }
        }
    }
    found
}

/// The expressions with a sum that carries a factor: `sum` becomes (factor·sum)/factor.
pub(super) fn rescaled(
    graph: &mut Graph,
    roots: &[NodeId],
    sum: NodeId,
    factor: f64,
) -> Result<Vec<NodeId>, EmitError> {
    let Node::Sum { constant, terms } = graph.node(sum).clone() else { return Ok(roots.to_vec()) };
    let parts: Vec<_> = terms.iter().map(|(term, c)| (*term, snapped(factor * c.get()))).collect();
    let scaled = graph.sum(factor * constant.get(), &parts);
    let back = graph.scaled(1.0 / factor, scaled);
    substituted(graph, roots, &HashMap::from([(sum, back)]), &mut same_law)
}

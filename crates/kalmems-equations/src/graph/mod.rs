//! Expressions as a graph in which equal parts are one node.

mod build;
mod derive;

pub(crate) use build::whole_power;

use crate::curve::CurveId;
use crate::laws::LawId;
use crate::limits::{MOST_NODES, MOST_PARTS, MOST_VISITS};
use crate::numeric;
use std::collections::HashMap;

/// A node of a [`Graph`]. A node is always behind those that it is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct NodeId(u32);

impl NodeId {
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// A number by its bits, so that it can be told from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ConstantBits(u64);

impl ConstantBits {
    pub(crate) const ZERO: Self = Self(0);
    pub(crate) const ONE: Self = Self(1.0_f64.to_bits());

    pub(crate) fn of(value: f64) -> Self {
        // One zero, and one way to be no number.
        Self(if value == 0.0 {
            0
        } else if value.is_nan() {
            f64::NAN.to_bits()
        } else {
            value.to_bits()
        })
    }

    pub(crate) fn get(self) -> f64 {
        f64::from_bits(self.0)
    }
}

/// What an expression can depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Variable {
    State(usize),
    Input(usize),
    Parameter(usize),
}

/// An elementary function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Function {
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tanh,
    Atanh,
    Atan,
    Asin,
    Acos,
    Floor,
}

impl Function {
    pub(crate) fn apply(self, x: f64) -> f64 {
        use kalmems_core::{Portable, Scalar};
        match self {
            Self::Sqrt => Scalar::sqrt(x),
            Self::Exp => Scalar::exp(x),
            Self::Ln => Scalar::ln(x),
            Self::Sin => Scalar::sin(x),
            Self::Cos => Scalar::cos(x),
            Self::Tanh => numeric::tanh(x),
            Self::Atanh => Scalar::atanh(x),
            Self::Atan => x.portable_atan(),
            Self::Asin => x.portable_asin(),
            Self::Acos => x.portable_acos(),
            Self::Floor => x.floor(),
        }
    }
}

/// A part of an expression, in the one form in which it can stand.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    Number(ConstantBits),
    Variable(Variable),
    /// constant + Σ coefficient·term; no term is a number or a sum of a constant or of a single term.
    Sum {
        constant: ConstantBits,
        terms: Box<[(NodeId, ConstantBits)]>,
    },
    /// Π factor^power; no factor is a number, a product or a single term with a coefficient.
    Product(Box<[(NodeId, i32)]>),
    Call(Function, NodeId),
    /// The angle in rad between −π and π of the point (x, y).
    Angle {
        y: NodeId,
        x: NodeId,
    },
    /// `then` where `smaller < larger`, `otherwise` elsewhere.
    Choice {
        smaller: NodeId,
        larger: NodeId,
        then: NodeId,
        otherwise: NodeId,
    },
    /// A law, differentiated by the arguments that `by` lists in order.
    Law {
        law: LawId,
        by: Box<[u8]>,
        arguments: Box<[NodeId]>,
    },
    /// A curve or a derivative of it.
    Curve {
        curve: CurveId,
        /// The order of the derivative by each argument.
        order: [u8; 2],
        /// The arguments; of a curve of one, 0 behind it.
        at: [NodeId; 2],
    },
}

impl Node {
    /// What it is made of.
    pub(crate) fn parts(&self) -> Vec<NodeId> {
        match self {
            Self::Number(_) | Self::Variable(_) => Vec::new(),
            Self::Sum { terms, .. } => terms.iter().map(|(term, _)| *term).collect(),
            Self::Product(factors) => factors.iter().map(|(factor, _)| *factor).collect(),
            Self::Call(_, at) => vec![*at],
            Self::Curve { at, .. } => at.to_vec(),
            Self::Angle { y, x } => vec![*y, *x],
            Self::Choice { smaller, larger, then, otherwise } => vec![*smaller, *larger, *then, *otherwise],
            Self::Law { arguments, .. } => arguments.to_vec(),
        }
    }
}

/// The places of all that these roots are made of, with them, in the order of a list of so many, in which parts are before the whole.
pub(crate) fn reached<I: Copy>(
    (count, roots): (usize, &[I]),
    place: impl Fn(I) -> usize,
    parts: impl Fn(I) -> Vec<I>,
) -> impl Iterator<Item = u32> {
    let mut seen = vec![false; count];
    let mut open = roots.to_vec();
    while let Some(one) = open.pop() {
        if let Some(seen) = seen.get_mut(place(one)).filter(|seen| !**seen) {
            *seen = true;
            open.extend(parts(one));
        }
    }
    (0_u32..).zip(seen).filter(|(_, seen)| *seen).map(|(place, _)| place)
}

/// What stopped a graph from growing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum GraphLimit {
    /// More nodes than allowed.
    TooLarge,
    /// A power beyond the largest.
    Power,
    /// A derivative of this order of a law or a curve, which has fewer.
    Order { function: String, order: usize, limit: usize },
}

/// Expressions, equal parts of which are one.
#[derive(Clone, Debug)]
pub(crate) struct Graph {
    nodes: Vec<Node>,
    /// Asked, never gone over.
    known: HashMap<Node, NodeId>,
    derivatives: HashMap<(NodeId, Variable), NodeId>,
    /// Why a result since the last look is not what was asked for.
    stop: Option<GraphLimit>,
    /// How many parts all nodes have together, and how many nodes were gone over.
    parts: usize,
    visits: usize,
    /// The curves' names and how many arguments each has.
    pub(crate) curves: Vec<(String, usize)>,
}

impl Graph {
    /// The number 0, which every graph begins with.
    pub(crate) const ZERO: NodeId = NodeId(0);
    /// The number 1.
    pub(crate) const ONE: NodeId = NodeId(1);

    pub(crate) fn new() -> Self {
        let mut graph = Self {
            nodes: Vec::new(),
            known: HashMap::new(),
            derivatives: HashMap::new(),
            stop: None,
            parts: 0,
            visits: 0,
            curves: Vec::new(),
        };
        graph.add(Node::Number(ConstantBits::ZERO));
        graph.add(Node::Number(ConstantBits::ONE));
        graph
    }

    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(crate) fn node(&self, id: NodeId) -> &Node {
        // Ids come from this graph alone, whose nodes are never removed.
        self.nodes.get(id.index()).unwrap_or(&Node::Number(ConstantBits::ZERO))
    }

    /// The number that a node is.
    pub(crate) fn number(&self, id: NodeId) -> Option<f64> {
        match self.node(id) {
            Node::Number(number) => Some(number.get()),
            _ => None,
        }
    }

    /// The variable that a node is.
    pub(crate) fn as_variable(&self, id: NodeId) -> Option<Variable> {
        match self.node(id) {
            Node::Variable(variable) => Some(*variable),
            _ => None,
        }
    }

    /// Why a result since the last look is not what was asked for.
    pub(crate) fn take_stop(&mut self) -> Option<GraphLimit> {
        self.stop.take()
    }

    fn stop(&mut self, why: GraphLimit) -> NodeId {
        self.stop.get_or_insert(why);
        Self::ZERO
    }

    /// The node, which is made where there is none yet.
    fn add(&mut self, node: Node) -> NodeId {
        if let Some(id) = self.known.get(&node) {
            return *id;
        }
        let parts = self.parts + node.parts().len();
        let fits = self.nodes.len() < MOST_NODES && parts < MOST_PARTS;
        let Some(id) = u32::try_from(self.nodes.len()).ok().filter(|_| fits) else {
            return self.stop(GraphLimit::TooLarge);
        };
        self.parts = parts;
        self.nodes.push(node.clone());
        self.known.insert(node, NodeId(id));
        NodeId(id)
    }

    /// All nodes that these are made of, with them, each behind its parts.
    pub(crate) fn below(&self, roots: &[NodeId]) -> Vec<NodeId> {
        let seen = reached((self.nodes.len(), roots), NodeId::index, |id| self.node(id).parts());
        seen.map(NodeId).collect()
    }

    /// Whether an expression depends on a variable of this kind.
    pub(crate) fn depends(&self, root: NodeId, of_kind: impl Fn(Variable) -> bool) -> bool {
        self.below(&[root]).iter().filter_map(|id| self.as_variable(*id)).any(of_kind)
    }

    /// Whether an expression is not smooth everywhere in the states, since a choice by one or a whole number of one stands in it.
    pub(crate) fn has_kink(&self, root: NodeId) -> bool {
        let moves = |variable| matches!(variable, Variable::State(_));
        let is_kink =
            |id: NodeId| matches!(self.node(id), Node::Choice { .. } | Node::Call(Function::Floor, _));
        self.below(&[root]).into_iter().any(|id| is_kink(id) && self.depends(id, moves))
    }

    /// Whether an expression has no choice, whole number or curve in it, so that it is analytic in its domain.
    pub(crate) fn is_smooth(&self, root: NodeId) -> bool {
        let is_kink = |id: &NodeId| {
            matches!(
                self.node(*id),
                Node::Choice { .. } | Node::Call(Function::Floor, _) | Node::Curve { .. }
            )
        };
        !self.below(&[root]).iter().any(is_kink)
    }

    /// As [`below`](Self::below), with a bound on how often that is done; nothing beyond it.
    fn visited(&mut self, root: NodeId) -> Vec<NodeId> {
        self.visits += self.nodes.len();
        if self.visits > MOST_VISITS {
            self.stop(GraphLimit::TooLarge);
            return Vec::new();
        }
        self.below(&[root])
    }

    /// What an expression depends on.
    pub(crate) fn variables(&mut self, root: NodeId) -> Vec<Variable> {
        let below = self.visited(root);
        let of = |id: &NodeId| match self.node(*id) {
            Node::Variable(variable) => Some(*variable),
            _ => None,
        };
        below.iter().filter_map(of).collect()
    }
}

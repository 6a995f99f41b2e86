//! Symbolic derivatives.

use super::{Function, Graph, Node, NodeId, Variable};

impl Graph {
    /// ∂root/∂variable.
    pub(crate) fn derivative(&mut self, root: NodeId, by: Variable) -> NodeId {
        if let Some(known) = self.derivatives.get(&(root, by)) {
            return *known;
        }
        // Each node stands behind its parts, so that their derivatives are there when they are needed.
        for id in self.visited(root) {
            if !self.derivatives.contains_key(&(id, by)) {
                let derivative = self.derivative_of_node(id, by);
                self.derivatives.insert((id, by), derivative);
            }
        }
        self.known_derivative(root, by)
    }

    fn known_derivative(&self, id: NodeId, by: Variable) -> NodeId {
        self.derivatives.get(&(id, by)).copied().unwrap_or(Self::ZERO)
    }

    fn derivative_of_node(&mut self, id: NodeId, by: Variable) -> NodeId {
        match self.node(id).clone() {
            Node::Number(_) => Self::ZERO,
            Node::Variable(variable) => {
                if variable == by {
                    Self::ONE
                } else {
                    Self::ZERO
                }
            }
            Node::Sum { terms, .. } => {
                let parts: Vec<_> =
                    terms.iter().map(|(term, c)| (self.known_derivative(*term, by), c.get())).collect();
                self.sum(0.0, &parts)
            }
            Node::Product(factors) => self.derivative_of_product(&factors, by),
            Node::Call(function, at) => {
                let inner = self.known_derivative(at, by);
                if inner == Self::ZERO {
                    return Self::ZERO;
                }
                let outer = self.slope(function, id, at);
                let slope = self.product(&[(outer, 1), (inner, 1)]);
                let rests = |id: &NodeId| matches!(self.node(*id), Node::Choice { .. });
                if function != Function::Sqrt || !self.below(&[at]).iter().any(rests) {
                    return slope;
                }
                // On the flat side of a `max` a root of 0 stays 0, where its slope would be 0 over 0.
                let moves = self.product(&[(inner, 2)]);
                self.choice(Self::ZERO, moves, slope, Self::ZERO)
            }
            Node::Choice { smaller, larger, then, otherwise } => {
                let (then, otherwise) =
                    (self.known_derivative(then, by), self.known_derivative(otherwise, by));
                self.choice(smaller, larger, then, otherwise)
            }
            Node::Law { law, by: orders, arguments } => {
                let mut parts = Vec::new();
                for (index, argument) in (0_u8..).zip(arguments.iter()) {
                    let inner = self.known_derivative(*argument, by);
                    if inner != Self::ZERO {
                        let mut orders = orders.to_vec();
                        orders.push(index);
                        let outer = self.law(law, orders, &arguments);
                        parts.push((self.product(&[(outer, 1), (inner, 1)]), 1.0));
                    }
                }
                self.sum(0.0, &parts)
            }
            Node::Curve { curve, order, at } => {
                let inner = self.known_derivative(at, by);
                if inner == Self::ZERO {
                    return Self::ZERO;
                }
                let outer = self.curve(curve, order + 1, at);
                self.product(&[(outer, 1), (inner, 1)])
            }
        }
    }

    /// Σ nₖ·aₖ′·aₖ^(nₖ−1)·Π of the others.
    fn derivative_of_product(&mut self, factors: &[(NodeId, i32)], by: Variable) -> NodeId {
        let mut parts = Vec::new();
        for (index, (factor, power)) in factors.iter().enumerate() {
            // (√a)ⁿ′ = n/2·(√a)ⁿ⁻²·a′, so that nothing is divided by a root of 0.
            let (of, less, half) = match self.node(*factor) {
                Node::Call(Function::Sqrt, at) if *power > 1 => (*at, 2, 0.5),
                _ => (*factor, 1, 1.0),
            };
            let inner = self.known_derivative(of, by);
            if inner == Self::ZERO {
                continue;
            }
            let mut of: Vec<_> = factors.to_vec();
            if let Some(lowered) = of.get_mut(index) {
                lowered.1 -= less;
            }
            of.push((inner, 1));
            parts.push((self.product(&of), half * f64::from(*power)));
        }
        self.sum(0.0, &parts)
    }

    /// The derivative of a function at `at`, whose value there is `value`.
    fn slope(&mut self, function: Function, value: NodeId, at: NodeId) -> NodeId {
        match function {
            Function::Sqrt => {
                let reciprocal = self.product(&[(value, -1)]);
                self.scaled(0.5, reciprocal)
            }
            Function::Exp => value,
            Function::Ln => self.product(&[(at, -1)]),
            Function::Sin => self.call(Function::Cos, at),
            Function::Cos => {
                let sine = self.call(Function::Sin, at);
                self.scaled(-1.0, sine)
            }
            Function::Tanh => {
                let square = self.product(&[(value, 2)]);
                self.sum(1.0, &[(square, -1.0)])
            }
            Function::Atanh => {
                let square = self.product(&[(at, 2)]);
                let rest = self.sum(1.0, &[(square, -1.0)]);
                self.product(&[(rest, -1)])
            }
        }
    }
}

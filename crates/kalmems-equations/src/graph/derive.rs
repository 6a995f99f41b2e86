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
                if function != Function::Sqrt || !self.rests_at_zero(at) {
                    return slope;
                }
                // A root of 0 that stays 0, as on the flat side of a `max`, would have the slope 0 over 0.
                let moves = self.product(&[(inner, 2)]);
                self.choice(Self::ZERO, moves, slope, Self::ZERO)
            }
            // (x·y′ − y·x′)/(x² + y²)
            Node::Angle { y, x } => {
                let (along_y, along_x) = (self.known_derivative(y, by), self.known_derivative(x, by));
                let towards = self.product(&[(x, 1), (along_y, 1)]);
                let away = self.product(&[(y, 1), (along_x, 1)]);
                let turned = self.sum(0.0, &[(towards, 1.0), (away, -1.0)]);
                if turned == Self::ZERO {
                    return Self::ZERO;
                }
                let squares = [self.product(&[(x, 2)]), self.product(&[(y, 2)])];
                let distance = self.sum(0.0, &squares.map(|square| (square, 1.0)));
                self.product(&[(turned, 1), (distance, -1)])
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
                let mut parts = Vec::new();
                for (index, argument) in at.iter().enumerate() {
                    let inner = self.known_derivative(*argument, by);
                    if inner != Self::ZERO {
                        let mut order = order;
                        order[index] += 1;
                        let outer = self.curve(curve, order, at);
                        parts.push((self.product(&[(outer, 1), (inner, 1)]), 1.0));
                    }
                }
                self.sum(0.0, &parts)
            }
        }
    }

    /// Whether an expression can be 0 with a slope of 0: a choice stands in it, or it is made of even powers of what moves.
    fn rests_at_zero(&self, at: NodeId) -> bool {
        let moves = |variable| !matches!(variable, Variable::Parameter(_));
        let is_square = |id: NodeId| match self.node(id) {
            Node::Product(factors) => {
                factors.iter().all(|(_, power)| *power > 0 && power % 2 == 0) && self.depends(id, moves)
            }
            _ => false,
        };
        let is_choice = |id: &NodeId| matches!(self.node(*id), Node::Choice { .. });
        let squares = match self.node(at) {
            Node::Sum { constant, terms } => {
                constant.get() == 0.0 && terms.iter().all(|(term, _)| is_square(*term))
            }
            _ => is_square(at),
        };
        squares || self.below(&[at]).iter().any(is_choice)
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
            Function::Atan => {
                let square = self.product(&[(at, 2)]);
                let whole = self.sum(1.0, &[(square, 1.0)]);
                self.product(&[(whole, -1)])
            }
            Function::Asin | Function::Acos => {
                // As a product, which keeps its digits near ±1.
                let ends = [self.sum(1.0, &[(at, -1.0)]), self.sum(1.0, &[(at, 1.0)])];
                let rest = self.product(&ends.map(|end| (end, 1)));
                let root = self.call(Function::Sqrt, rest);
                let reciprocal = self.product(&[(root, -1)]);
                self.scaled(if function == Function::Asin { 1.0 } else { -1.0 }, reciprocal)
            }
            Function::Floor => Self::ZERO,
        }
    }
}

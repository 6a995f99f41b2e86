//! Making nodes, each in the one form in which it can stand: a + (b + 1) − 1 is a + b, and x·x⁻¹ is 1.

use super::{ConstantBits, Function, Graph, GraphLimit, Node, NodeId, Variable};
use crate::curve::CurveId;
use crate::laws::{self, LawId};
use crate::limits::LARGEST_POWER;
use kalmems_core::Portable;

impl Graph {
    pub(crate) fn literal(&mut self, value: f64) -> NodeId {
        self.add(Node::Number(ConstantBits::of(value)))
    }

    pub(crate) fn variable(&mut self, variable: Variable) -> NodeId {
        self.add(Node::Variable(variable))
    }

    /// constant + Σ coefficient·term.
    pub(crate) fn sum(&mut self, mut constant: f64, parts: &[(NodeId, f64)]) -> NodeId {
        let mut terms: Vec<(NodeId, f64)> = Vec::with_capacity(parts.len());
        for (part, coefficient) in parts {
            match self.node(*part) {
                Node::Number(number) => constant += coefficient * number.get(),
                // A constant of a sum in the sum joins this one, and a single term with a coefficient is a term.
                Node::Sum { constant: inner, terms: of } => {
                    constant += coefficient * inner.get();
                    match of[..] {
                        [(term, scale)] => terms.push((term, coefficient * scale.get())),
                        _ if *inner == ConstantBits::ZERO => terms.push((*part, *coefficient)),
                        _ => {
                            let rest = Node::Sum { constant: ConstantBits::ZERO, terms: of.clone() };
                            terms.push((self.add(rest), *coefficient));
                        }
                    }
                }
                _ => terms.push((*part, *coefficient)),
            }
        }
        terms.sort_by_key(|(term, _)| *term);
        let mut merged: Vec<(NodeId, ConstantBits)> = Vec::with_capacity(terms.len());
        for (term, coefficient) in terms {
            match merged.last_mut().filter(|(last, _)| *last == term) {
                Some((_, sum)) => *sum = ConstantBits::of(sum.get() + coefficient),
                None => merged.push((term, ConstantBits::of(coefficient))),
            }
        }
        merged.retain(|(_, coefficient)| *coefficient != ConstantBits::ZERO);
        match merged[..] {
            [] => self.literal(constant),
            [(term, ConstantBits::ONE)] if constant == 0.0 => term,
            _ => self.add(Node::Sum { constant: ConstantBits::of(constant), terms: merged.into() }),
        }
    }

    pub(crate) fn scaled(&mut self, coefficient: f64, node: NodeId) -> NodeId {
        self.sum(0.0, &[(node, coefficient)])
    }

    /// Π factor^power.
    pub(crate) fn product(&mut self, parts: &[(NodeId, i32)]) -> NodeId {
        let mut coefficient = 1.0;
        let mut factors: Vec<(NodeId, i32)> = Vec::with_capacity(parts.len());
        let mut open: Vec<(NodeId, i32)> = parts.iter().rev().copied().collect();
        while let Some((part, power)) = open.pop() {
            match self.node(part) {
                Node::Number(number) => coefficient *= whole_power(number.get(), power),
                Node::Sum { constant: ConstantBits::ZERO, terms } if terms.len() == 1 => {
                    if let [(term, scale)] = terms[..] {
                        coefficient *= whole_power(scale.get(), power);
                        open.push((term, power));
                    }
                }
                Node::Product(of) => {
                    let raised: Option<Vec<_>> =
                        of.iter().map(|(f, p)| Some((*f, p.checked_mul(power)?))).collect();
                    match raised {
                        Some(raised) => factors.extend(raised),
                        None => return self.stop(GraphLimit::Power),
                    }
                }
                // √a² is a: wherever √a is a number, a is not negative.
                Node::Call(Function::Sqrt, at) if power % 2 == 0 => open.push((*at, power / 2)),
                _ => factors.push((part, power)),
            }
        }
        if coefficient == 0.0 {
            return Self::ZERO;
        }
        factors.sort_by_key(|(factor, _)| *factor);
        let mut merged: Vec<(NodeId, i32)> = Vec::with_capacity(factors.len());
        for (factor, power) in factors {
            match merged.last_mut().filter(|(last, _)| *last == factor) {
                Some((_, sum)) => *sum = sum.saturating_add(power),
                None => merged.push((factor, power)),
            }
        }
        self.gather_half_powers(&mut merged);
        merged.retain(|(_, power)| *power != 0);
        if merged.iter().any(|(_, power)| power.abs() > LARGEST_POWER) {
            return self.stop(GraphLimit::Power);
        }
        // What equal roots have become together is simpler than a root.
        let is_even_root = |(factor, power): &(NodeId, i32)| {
            power % 2 == 0 && matches!(self.node(*factor), Node::Call(Function::Sqrt, _))
        };
        let product = match merged[..] {
            [] => return self.literal(coefficient),
            [(factor, 1)] => factor,
            _ if merged.iter().any(is_even_root) => self.product(&merged),
            _ => self.add(Node::Product(merged.into())),
        };
        self.scaled(coefficient, product)
    }

    /// a·√a as √a³, so that the derivative 3/2·√a of a half power has no √a below a fraction bar, which would be no number at 0.
    fn gather_half_powers(&self, factors: &mut [(NodeId, i32)]) {
        for root in 0..factors.len() {
            let Some((node, power)) = factors.get(root).copied() else { continue };
            let Node::Call(Function::Sqrt, at) = self.node(node) else { continue };
            if power % 2 == 0 {
                continue;
            }
            let Some(whole) = factors.iter_mut().find(|(factor, _)| factor == at) else { continue };
            let taken = std::mem::take(&mut whole.1);
            if let Some((_, power)) = factors.get_mut(root) {
                *power = power.saturating_add(taken.saturating_mul(2));
            }
        }
    }

    pub(crate) fn call(&mut self, function: Function, at: NodeId) -> NodeId {
        match self.number(at) {
            Some(number) => self.literal(function.apply(number)),
            None => self.add(Node::Call(function, at)),
        }
    }

    /// The angle of the point (x, y).
    pub(crate) fn angle(&mut self, y: NodeId, x: NodeId) -> NodeId {
        match self.number(y).zip(self.number(x)) {
            Some((y, x)) => self.literal(y.portable_atan2(x)),
            None => self.add(Node::Angle { y, x }),
        }
    }

    /// `then` where `smaller < larger`, `otherwise` elsewhere.
    pub(crate) fn choice(
        &mut self,
        smaller: NodeId,
        larger: NodeId,
        then: NodeId,
        otherwise: NodeId,
    ) -> NodeId {
        if then == otherwise {
            return then;
        }
        match self.number(smaller).zip(self.number(larger)) {
            Some((a, b)) => {
                if a < b {
                    then
                } else {
                    otherwise
                }
            }
            None => self.add(Node::Choice { smaller, larger, then, otherwise }),
        }
    }

    /// A law, differentiated by the arguments that `by` lists.
    pub(crate) fn law(&mut self, law: LawId, mut by: Vec<u8>, arguments: &[NodeId]) -> NodeId {
        by.sort_unstable();
        if !laws::has_derivative(law, &by) {
            let (order, limit) = (by.len(), laws::highest_order(&by));
            return self.stop(GraphLimit::Order { function: laws::name(law).to_owned(), order, limit });
        }
        self.add(Node::Law { law, by: by.into(), arguments: arguments.into() })
    }

    /// A curve, or a derivative of it.
    pub(crate) fn curve(&mut self, curve: CurveId, order: [u8; 2], at: [NodeId; 2]) -> NodeId {
        let [whole, limit] = [order[0] + order[1], crate::curve::HIGHEST_ORDER].map(usize::from);
        if whole > limit {
            let function = self.curves.get(curve).cloned().unwrap_or_default().0;
            return self.stop(GraphLimit::Order { function, order: whole, limit });
        }
        self.add(Node::Curve { curve, order, at })
    }
}

/// xⁿ by repeated squares, as the interpreter computes it.
pub(crate) fn whole_power(x: f64, power: i32) -> f64 {
    let (mut base, mut left) = (if power < 0 { 1.0 / x } else { x }, power.unsigned_abs());
    let mut result = 1.0;
    while left > 0 {
        if left & 1 == 1 {
            result *= base;
        }
        base *= base;
        left >>= 1;
    }
    result
}

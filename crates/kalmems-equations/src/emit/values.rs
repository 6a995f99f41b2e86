//! Forms of nodes as operations.

use super::lower::{Coefficient, NodeForm, Operand, ProductTerm};
use super::pairs::{Atom, Pairs};
use super::tape::{CalledFunction, Tape, TapeId};
use crate::graph::{NodeId, Variable};
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Nodes and pairs on the tape.
pub(super) struct TapeValues<'a> {
    pub(super) tape: &'a mut Tape,
    pub(super) pairs: &'a Pairs,
    pub(super) prefix: &'static str,
    pub(super) of: HashMap<NodeId, TapeId>,
    pub(super) of_pair: HashMap<usize, TapeId>,
}

impl TapeValues<'_> {
    pub(super) fn node(&mut self, id: NodeId) -> TapeId {
        match self.of.get(&id) {
            Some(value) => *value,
            None => self.tape.literal(0.0),
        }
    }

    fn given(&mut self, place: usize) -> TapeId {
        let name = format!("{}{place}", self.prefix);
        self.tape.named(name)
    }

    pub(super) fn form(&mut self, form: &NodeForm, of_variable: &dyn Fn(Variable) -> Operand) -> TapeId {
        match form {
            NodeForm::Number(number) => self.tape.literal(*number),
            NodeForm::Given(place) => self.given(*place),
            NodeForm::Variable(variable) => match of_variable(*variable) {
                Operand::Name(name) => self.tape.named(name),
                Operand::Id(id) => id,
            },
            NodeForm::Sum(first, terms) => self.sum(*first, terms),
            NodeForm::Product((by, atoms)) => {
                let (by, product) = (self.coefficient(*by), self.product(atoms));
                self.tape.multiply(by, product)
            }
            NodeForm::Call(called, at, by) => {
                let (at, by) = (self.node(*at), self.tape.literal(*by));
                let at = self.tape.multiply(by, at);
                let value = self.tape.call(*called, at);
                // The law is −ln cosh.
                if *called == CalledFunction::LnCosh { self.tape.negative(value) } else { value }
            }
            NodeForm::CallOfTwo(called, at) => {
                let at = at.map(|at| self.node(at));
                self.tape.call_of_two(*called, at)
            }
            NodeForm::Angle([y, x]) => {
                let (y, x) = (self.node(*y), self.node(*x));
                self.angle(y, x)
            }
            NodeForm::Choice(parts) => {
                let parts = parts.map(|part| self.node(part));
                self.tape.choice(parts)
            }
        }
    }

    /// The angle of the point (x, y): the arc tangent of the smaller number over the larger one, and what of a turn is left out by that.
    fn angle(&mut self, y: TapeId, x: TapeId) -> TapeId {
        let zero = self.tape.literal(0.0);
        let mut size = |of: TapeId| {
            let opposite = self.tape.negative(of);
            self.tape.choice([of, zero, opposite, of])
        };
        let (high, wide) = (size(y), size(x));
        let above = self.tape.choice([high, wide, y, x]);
        let below = self.tape.choice([high, wide, x, y]);
        let ratio = self.tape.divide(above, below);
        let angle = self.tape.call(CalledFunction::Atan, ratio);
        let [half, quarter] = [PI, FRAC_PI_2].map(|turn| self.tape.literal(turn));
        let ([before, after], rest) =
            ([self.tape.subtract(angle, half), self.tape.add(angle, half)], self.tape.negative(angle));
        let behind = self.tape.choice([y, zero, before, after]);
        let along = self.tape.choice([x, zero, behind, angle]);
        let [down, up] = [self.tape.subtract(rest, quarter), self.tape.add(rest, quarter)];
        let across = self.tape.choice([y, zero, down, up]);
        self.tape.choice([high, wide, along, across])
    }

    fn coefficient(&mut self, coefficient: Coefficient) -> TapeId {
        match coefficient {
            Coefficient::Number(number) => self.tape.literal(number),
            Coefficient::Given(place) => self.given(place),
        }
    }

    fn sum(&mut self, first: Coefficient, terms: &[ProductTerm]) -> TapeId {
        let mut terms: Vec<(Coefficient, TapeId)> =
            terms.iter().map(|(by, atoms)| (*by, self.product(atoms))).collect();
        // What is there first is added first, and a sum does not begin with a sign.
        terms.sort_by_key(|(_, id)| *id);
        let mut sum = self.coefficient(first);
        let is_opposite = |by: &Coefficient| matches!(by, Coefficient::Number(c) if *c == -1.0);
        if self.tape.is(sum, 0.0)
            && let Some(start) = terms.iter().position(|(by, _)| !is_opposite(by))
        {
            let start = terms.remove(start);
            terms.insert(0, start);
        }
        for (by, value) in terms {
            sum = match by {
                Coefficient::Number(c) if c < 0.0 && !self.tape.is(sum, 0.0) => {
                    let by = self.tape.literal(-c);
                    let product = self.tape.multiply(by, value);
                    self.tape.subtract(sum, product)
                }
                by => {
                    let by = self.coefficient(by);
                    let product = self.tape.multiply(by, value);
                    self.tape.add(sum, product)
                }
            };
        }
        sum
    }

    fn product(&mut self, atoms: &[Atom]) -> TapeId {
        let mut product = None;
        for atom in self.pairs.reduced(atoms) {
            let value = self.atom(atom);
            product = Some(match product {
                Some(product) => self.tape.multiply(product, value),
                None => value,
            });
        }
        product.unwrap_or_else(|| self.tape.literal(1.0))
    }

    fn atom(&mut self, atom: Atom) -> TapeId {
        match atom {
            Atom::Given(place) => self.given(place),
            Atom::Node(node) => self.node(node),
            Atom::Inverse(node) => {
                let (one, value) = (self.tape.literal(1.0), self.node(node));
                self.tape.divide(one, value)
            }
            Atom::Power(node, power) => {
                let value = self.node(node);
                self.power(value, power)
            }
            Atom::Pair(place) => {
                if let Some(value) = self.of_pair.get(&place) {
                    return *value;
                }
                // A pair is made of pairs that were chosen before it, at most as many as a product has factors.
                let [a, b] = self.pairs.pair(place);
                let (a, b) = (self.atom(a), self.atom(b));
                let value = self.tape.multiply(a, b);
                self.of_pair.insert(place, value);
                value
            }
        }
    }

    /// xⁿ by repeated squares.
    fn power(&mut self, value: TapeId, power: i32) -> TapeId {
        let one = self.tape.literal(1.0);
        let (mut base, mut left) =
            (if power < 0 { self.tape.divide(one, value) } else { value }, power.unsigned_abs());
        let mut result = one;
        while left > 0 {
            if left & 1 == 1 {
                result = self.tape.multiply(result, base);
            }
            base = self.tape.multiply(base, base);
            left >>= 1;
        }
        result
    }
}

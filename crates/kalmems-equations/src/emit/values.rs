//! Forms of nodes as operations.

use super::lower::{Coefficient, NodeForm, Operand, ProductTerm};
use super::pairs::{Atom, Pairs};
use super::tape::{CalledFunction, Tape, TapeId};
use crate::graph::{NodeId, Variable};
use std::collections::HashMap;

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
            NodeForm::Choice(parts) => {
                let parts = parts.map(|part| self.node(part));
                self.tape.choice(parts)
            }
        }
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

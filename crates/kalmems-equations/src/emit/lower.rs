//! From the graph to operations.
//!
//! Products are lists of factors from which pairs that several lists have are taken first, so that they are computed once.
//! What changes more rarely than the program runs is given to it: the constants that follow from parameters, and, inside of a
//! stage, what follows from inputs.

use super::laws::plain;
use super::model::{EmittedModel, Rarity, rarities};
use super::pairs::{Atom, Pairs};
use super::tape::{CalledFunction, Tape, TapeId};
use super::values::TapeValues;
use crate::graph::{Function, Graph, Node, NodeId, Variable};
use crate::laws::LawId;
use std::collections::{BTreeMap, HashMap};

/// The largest power that is written as factors.
const LARGEST_AS_FACTORS: usize = 8;

/// Values that come from outside of a program, with the nodes that they are.
#[derive(Clone, Debug)]
pub(super) struct ExternalValues {
    /// What the names begin with; the place follows.
    pub(super) prefix: &'static str,
    /// Values that change at most as often as this.
    pub(super) limit: Rarity,
    pub(super) nodes: Vec<NodeId>,
}

impl ExternalValues {
    pub(super) fn new(prefix: &'static str, limit: Rarity) -> Self {
        Self { prefix, limit, nodes: Vec::new() }
    }

    fn place(&mut self, node: NodeId) -> usize {
        self.nodes.iter().position(|known| *known == node).unwrap_or_else(|| {
            self.nodes.push(node);
            self.nodes.len() - 1
        })
    }
}

/// What a product is multiplied by beside its factors.
#[derive(Clone, Copy, Debug)]
pub(super) enum Coefficient {
    Number(f64),
    Given(usize),
}

/// A coefficient and factors.
pub(super) type ProductTerm = (Coefficient, Vec<Atom>);

/// What a node is made of, as far as the program computes it.
#[derive(Clone, Debug)]
pub(super) enum NodeForm {
    Number(f64),
    Given(usize),
    Variable(Variable),
    Sum(Coefficient, Vec<ProductTerm>),
    Product(ProductTerm),
    Call(CalledFunction, NodeId, f64),
    CallOfTwo(CalledFunction, [NodeId; 2]),
    /// The angle of the point of these y and x.
    Angle([NodeId; 2]),
    Choice([NodeId; 4]),
}

/// The operations of these expressions, behind those that the tape has.
///
/// `of_variable` names the variables.
pub(super) fn lower(
    graph: &mut Graph,
    (tape, given): (&mut Tape, &mut ExternalValues),
    roots: &[NodeId],
    moving: usize,
    of_variable: &dyn Fn(Variable) -> Operand,
) -> Vec<TapeId> {
    let rarities = rarities(graph, roots, moving);
    let mut lowering = SourceLowering { graph, given, rarities, forms: BTreeMap::new() };
    lowering.collect(roots);
    let forms = lowering.forms;
    let mut pairs = Pairs::default();
    for form in forms.values() {
        match form {
            NodeForm::Sum(_, terms) => terms.iter().for_each(|(_, atoms)| pairs.note(atoms)),
            NodeForm::Product((_, atoms)) => pairs.note(atoms),
            _ => {}
        }
    }
    pairs.choose();
    let prefix = given.prefix;
    let mut values = TapeValues { tape, pairs: &pairs, prefix, of: HashMap::new(), of_pair: HashMap::new() };
    for (id, form) in &forms {
        let value = values.form(form, of_variable);
        values.of.insert(*id, value);
    }
    roots.iter().map(|root| values.node(*root)).collect()
}

/// What a variable is on the tape.
#[derive(Clone, Debug)]
pub(super) enum Operand {
    Name(String),
    Id(TapeId),
}

struct SourceLowering<'a> {
    graph: &'a mut Graph,
    given: &'a mut ExternalValues,
    rarities: Vec<Rarity>,
    forms: BTreeMap<NodeId, NodeForm>,
}

impl SourceLowering<'_> {
    fn rarity(&self, id: NodeId) -> Rarity {
        self.rarities.get(id.index()).copied().unwrap_or(Rarity::Literal)
    }

    /// Whether it comes from outside.
    fn is_given(&self, id: NodeId) -> bool {
        let rarity = self.rarity(id);
        rarity > Rarity::Literal && rarity <= self.given.limit
    }

    /// The forms of all nodes that the program computes.
    fn collect(&mut self, roots: &[NodeId]) {
        let mut open = roots.to_vec();
        while let Some(id) = open.pop() {
            if self.forms.contains_key(&id) {
                continue;
            }
            let form = self.form(id);
            let atoms = |terms: &[ProductTerm]| -> Vec<NodeId> {
                terms.iter().flat_map(|(_, atoms)| atoms.iter().filter_map(Atom::node)).collect()
            };
            match &form {
                NodeForm::Sum(_, terms) => open.extend(atoms(terms)),
                NodeForm::Product(term) => open.extend(atoms(std::slice::from_ref(term))),
                NodeForm::Call(_, at, _) => open.push(*at),
                NodeForm::CallOfTwo(_, parts) | NodeForm::Angle(parts) => open.extend(parts),
                NodeForm::Choice(parts) => open.extend(parts),
                NodeForm::Number(_) | NodeForm::Given(_) | NodeForm::Variable(_) => {}
            }
            self.forms.insert(id, form);
        }
    }

    fn form(&mut self, id: NodeId) -> NodeForm {
        if self.is_given(id) {
            return NodeForm::Given(self.given.place(id));
        }
        let node = self.graph.node(id).clone();
        match &node {
            Node::Number(number) => NodeForm::Number(number.get()),
            Node::Variable(variable) => NodeForm::Variable(*variable),
            Node::Sum { constant, terms } => {
                let (given, own): (Vec<_>, Vec<_>) =
                    terms.iter().copied().partition(|(term, _)| self.is_given(*term));
                let first = if given.is_empty() {
                    Coefficient::Number(constant.get())
                } else {
                    let parts: Vec<_> = given.iter().map(|(term, c)| (*term, c.get())).collect();
                    let sum = self.graph.sum(constant.get(), &parts);
                    Coefficient::Given(self.given.place(sum))
                };
                let terms = own.into_iter().map(|(term, c)| self.term(term, c.get())).collect();
                NodeForm::Sum(first, terms)
            }
            Node::Product(_) => NodeForm::Product(self.term(id, 1.0)),
            Node::Call(Function::Exp, at) if self.is_never_positive(*at) => {
                NodeForm::Call(CalledFunction::FallingExp, *at, 1.0)
            }
            Node::Call(function, at) => NodeForm::Call(called(*function), *at, 1.0),
            Node::Angle { y, x } => NodeForm::Angle([*y, *x]),
            Node::Choice { smaller, larger, then, otherwise } => {
                NodeForm::Choice([*smaller, *larger, *then, *otherwise])
            }
            Node::Law { .. } => match plain(&node) {
                Some((LawId::Disks, order, at)) => NodeForm::Call(CalledFunction::Disks(order), at, 1.0),
                // −ln cosh(u/2)
                Some((LawId::LogisticCombChange, _, at)) => NodeForm::Call(CalledFunction::LnCosh, at, 0.5),
                Some((_, order, at)) => NodeForm::Call(CalledFunction::Atanhc(order), at, 1.0),
                None => NodeForm::Number(f64::NAN),
            },
            Node::Curve { curve, order, at } => {
                let called = CalledFunction::Curve(*curve, *order);
                match self.graph.curves.get(*curve) {
                    Some((_, 2)) => NodeForm::CallOfTwo(called, *at),
                    _ => NodeForm::Call(called, at[0], 1.0),
                }
            }
        }
    }

    /// A coefficient times a node, as factors.
    fn term(&mut self, id: NodeId, coefficient: f64) -> ProductTerm {
        let factors = match self.graph.node(id) {
            Node::Product(factors) => factors.to_vec(),
            _ => vec![(id, 1)],
        };
        let (given, own): (Vec<_>, Vec<_>) =
            factors.into_iter().partition(|(factor, _)| self.is_given(*factor));
        let mut atoms: Vec<Atom> = Vec::new();
        let mut by = Coefficient::Number(coefficient);
        if !given.is_empty() {
            let product = self.graph.product(&given);
            if self.given.limit == Rarity::Constant {
                let product = self.graph.scaled(coefficient, product);
                by = Coefficient::Given(self.given.place(product));
            } else {
                atoms.push(Atom::Given(self.given.place(product)));
            }
        }
        for (factor, power) in own {
            let times = usize::try_from(power.unsigned_abs()).unwrap_or(usize::MAX);
            let atom = if power > 0 { Atom::Node(factor) } else { Atom::Inverse(factor) };
            if times <= LARGEST_AS_FACTORS {
                atoms.extend(std::iter::repeat_n(atom, times));
            } else {
                atoms.push(Atom::Power(factor, power));
            }
        }
        // What changes rarely is multiplied first.
        atoms.sort_by_key(|atom| (atom.node().map_or(Rarity::Literal, |node| self.rarity(node)), *atom));
        (by, atoms)
    }

    /// Whether a node can be seen to be nowhere above 0.
    fn is_never_positive(&self, id: NodeId) -> bool {
        let square = |factors: &[(NodeId, i32)]| factors.iter().all(|(_, power)| power % 2 == 0);
        match self.graph.node(id) {
            Node::Number(number) => number.get() <= 0.0,
            Node::Sum { constant, terms } => {
                let falls = |term: NodeId, c: f64| match self.graph.node(term) {
                    Node::Product(factors) => c <= 0.0 && square(factors),
                    _ => false,
                };
                constant.get() <= 0.0 && terms.iter().all(|(term, c)| falls(*term, c.get()))
            }
            _ => false,
        }
    }
}

fn called(function: Function) -> CalledFunction {
    match function {
        Function::Sqrt => CalledFunction::Sqrt,
        Function::Exp => CalledFunction::Exp,
        Function::Ln => CalledFunction::Ln,
        Function::Sin => CalledFunction::Sin,
        Function::Cos => CalledFunction::Cos,
        Function::Tanh => CalledFunction::Tanh,
        Function::Atanh => CalledFunction::Atanh,
        Function::Atan => CalledFunction::Atan,
        Function::Asin => CalledFunction::Asin,
        Function::Acos => CalledFunction::Acos,
        Function::Floor => CalledFunction::Floor,
    }
}

/// About how many instructions the rates, the measurements and their derivatives of a model take.
pub(super) fn cost(model: &mut EmittedModel) -> usize {
    let roots = model.roots();
    let (mut tape, mut given) = (Tape::default(), ExternalValues::new("c", Rarity::Constant));
    let name = |variable: Variable| Operand::Name(format!("{variable:?}"));
    let ids = lower(&mut model.graph, (&mut tape, &mut given), &roots, model.moving, &name);
    // A constant derivative that is not one multiplies the covariance from either side.
    let constants =
        ids.iter().filter(|id| tape.number(**id).is_some_and(|number| number != 0.0 && number.abs() != 1.0));
    tape.cost(&ids) + constants.count() * 2 * model.size
}

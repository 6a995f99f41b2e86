//! From the graph to instructions.
//!
//! What is computed is sorted by what it depends on: numbers and parameters alone, once for all; parameters that are states,
//! once a step; inputs; states. A factor that changes more rarely than a sum is multiplied into the terms of the sum where
//! nothing else uses it, and a product that one sum uses alone is computed with it.

use super::op::{Instruction, OpKind, REGISTERS, STATES};
use crate::curve::GROUPS;
use crate::graph::{ConstantBits, Graph, Node, NodeId, Variable};
use crate::laws::{LawId, MOST_ARGUMENTS};
use std::collections::HashMap;

/// What a number depends on: the rarest change that changes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stratum {
    Literal,
    Parameter,
    Step,
    Input,
    State,
}

/// How many strata there are.
const STRATA: usize = 5;

/// The most terms of a sum that a factor is multiplied into.
const MOST_DISTRIBUTED: usize = 6;

/// How many there are of what the first registers hold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegisterCounts {
    pub(crate) inputs: usize,
    pub(crate) parameters: usize,
}

/// Instructions by stratum, and where their results are.
#[derive(Clone, Debug, Default)]
pub(super) struct StratumCode {
    by_stratum: [Vec<Instruction>; STRATA],
    pub(super) literals: Vec<(u16, f64)>,
    pub(super) arguments: Vec<u16>,
    pub(super) outputs: Vec<u16>,
}

impl StratumCode {
    /// The instructions of a stratum.
    pub(super) fn of(&self, stratum: Stratum) -> &[Instruction] {
        self.by_stratum.get(stratum as usize).map_or(&[], Vec::as_slice)
    }
}

/// Instructions for these nodes; `None` where they need more registers than there are.
pub(super) fn lower(
    graph: &Graph,
    roots: &[NodeId],
    counts: RegisterCounts,
    free: &[usize],
) -> Option<StratumCode> {
    let mut lowering = ProgramLowering::new(graph, roots, counts, free);
    for id in lowering.demanded(roots) {
        lowering.lower(id);
        if lowering.is_full {
            return None;
        }
    }
    let outputs = roots.iter().map(|root| lowering.register(*root)).collect();
    (!lowering.is_full).then_some(StratumCode { outputs, ..lowering.code })
}

/// Nodes on their way to instructions.
pub(super) struct ProgramLowering<'a> {
    pub(super) graph: &'a Graph,
    counts: RegisterCounts,
    code: StratumCode,
    /// The stratum of each register that is taken.
    registers: Vec<Stratum>,
    is_full: bool,
    strata: Vec<Stratum>,
    uses: Vec<u32>,
    /// Asked, never gone over, as the three below.
    values: HashMap<NodeId, u16>,
    emitted: HashMap<(OpKind, [u16; 6]), u16>,
    literals: HashMap<ConstantBits, u16>,
    laws: HashMap<(LawId, Box<[NodeId]>), [u16; 3]>,
    curves: HashMap<(usize, [NodeId; 2], u16), [u16; 3]>,
}

impl<'a> ProgramLowering<'a> {
    fn new(graph: &'a Graph, roots: &[NodeId], counts: RegisterCounts, free: &[usize]) -> Self {
        let mut registers = vec![Stratum::State; STATES];
        registers.extend(vec![Stratum::Input; counts.inputs]);
        let of_parameter = |index| if free.contains(&index) { Stratum::Step } else { Stratum::Parameter };
        registers.extend((0..counts.parameters).map(of_parameter));
        let mut strata = vec![Stratum::Literal; graph.len()];
        let mut uses = vec![0; graph.len()];
        for id in graph.below(roots) {
            let parts = graph.node(id).parts();
            let stratum = match graph.node(id) {
                Node::Variable(Variable::State(_)) => Stratum::State,
                Node::Variable(Variable::Input(_)) => Stratum::Input,
                Node::Variable(Variable::Parameter(index)) => of_parameter(*index),
                _ => parts
                    .iter()
                    .filter_map(|part| strata.get(part.index()))
                    .max()
                    .copied()
                    .unwrap_or(Stratum::Literal),
            };
            if let Some(slot) = strata.get_mut(id.index()) {
                *slot = stratum;
            }
            for part in parts {
                count(&mut uses, part);
            }
        }
        for root in roots {
            count(&mut uses, *root);
        }
        let is_full = registers.len() >= REGISTERS;
        let code = StratumCode::default();
        let (values, emitted, literals) = (HashMap::new(), HashMap::new(), HashMap::new());
        let (laws, curves) = (HashMap::new(), HashMap::new());
        Self {
            graph,
            counts,
            code,
            registers,
            is_full,
            strata,
            uses,
            values,
            emitted,
            literals,
            laws,
            curves,
        }
    }

    fn stratum(&self, id: NodeId) -> Stratum {
        self.strata.get(id.index()).copied().unwrap_or(Stratum::Literal)
    }

    fn is_used_once(&self, id: NodeId) -> bool {
        self.uses.get(id.index()) == Some(&1)
    }

    /// The sum within a product that the other factors, which change more rarely, are multiplied into.
    pub(super) fn distributed(&self, factors: &[(NodeId, i32)]) -> Option<NodeId> {
        let highest = factors.iter().map(|(factor, _)| self.stratum(*factor)).max()?;
        let mut high = factors.iter().filter(|(factor, _)| self.stratum(*factor) == highest);
        let (only, rest) = (high.next()?, high.next());
        let is_short =
            matches!(self.graph.node(only.0), Node::Sum { terms, .. } if terms.len() <= MOST_DISTRIBUTED);
        let alone = rest.is_none() && only.1 == 1 && is_short && self.is_used_once(only.0);
        (alone && factors.len() > 1).then_some(only.0)
    }

    /// The factors of a product that is computed within the one sum that uses it.
    pub(super) fn fused(&self, term: NodeId) -> Option<&'a [(NodeId, i32)]> {
        match self.graph.node(term) {
            Node::Product(factors) if self.is_used_once(term) && self.distributed(factors).is_none() => {
                Some(factors)
            }
            _ => None,
        }
    }

    /// The nodes whose values this one needs in registers.
    fn needs(&self, id: NodeId) -> Vec<NodeId> {
        match self.graph.node(id) {
            Node::Sum { terms, .. } => {
                let mut needs = Vec::new();
                for (term, _) in terms {
                    match self.fused(*term) {
                        Some(factors) => needs.extend(factors.iter().map(|(factor, _)| *factor)),
                        None => needs.push(*term),
                    }
                }
                needs
            }
            Node::Product(factors) => match self.distributed(factors) {
                Some(sum) => {
                    let mut needs = self.needs(sum);
                    needs.extend(factors.iter().map(|(factor, _)| *factor).filter(|factor| *factor != sum));
                    needs
                }
                None => factors.iter().map(|(factor, _)| *factor).collect(),
            },
            node => node.parts(),
        }
    }

    /// The nodes that have a register of their own, each behind what it needs.
    fn demanded(&self, roots: &[NodeId]) -> Vec<NodeId> {
        let mut open = roots.to_vec();
        let mut demanded = vec![false; self.graph.len()];
        let mut all = Vec::new();
        while let Some(id) = open.pop() {
            if let Some(seen) = demanded.get_mut(id.index()).filter(|seen| !**seen) {
                *seen = true;
                all.push(id);
                open.extend(self.needs(id));
            }
        }
        all.sort_unstable();
        all
    }

    pub(super) fn register(&self, id: NodeId) -> u16 {
        self.values.get(&id).copied().unwrap_or_default()
    }

    fn take(&mut self, stratum: Stratum) -> u16 {
        let register = self.registers.len();
        if register >= REGISTERS {
            self.is_full = true;
            return 0;
        }
        self.registers.push(stratum);
        #[allow(clippy::cast_possible_truncation)] // below the number of registers
        let register = register as u16;
        register
    }

    pub(super) fn of_register(&self, register: u16) -> Stratum {
        self.registers.get(usize::from(register)).copied().unwrap_or(Stratum::State)
    }

    pub(super) fn literal(&mut self, value: f64) -> u16 {
        let number = ConstantBits::of(value);
        if let Some(register) = self.literals.get(&number) {
            return *register;
        }
        let register = self.take(Stratum::Literal);
        self.literals.insert(number, register);
        self.code.literals.push((register, value));
        register
    }

    /// An instruction of these registers in the stratum of the last to change; the one that is there where it is.
    pub(super) fn emit(&mut self, kind: OpKind, operands: &[u16]) -> u16 {
        let stratum = operands.iter().map(|r| self.of_register(*r)).max().unwrap_or(Stratum::Literal);
        let mut of = [0; 6];
        for (slot, operand) in of.iter_mut().zip(operands) {
            *slot = *operand;
        }
        self.push(kind, of, stratum)
    }

    fn push(&mut self, kind: OpKind, of: [u16; 6], stratum: Stratum) -> u16 {
        if let Some(register) = self.emitted.get(&(kind, of)) {
            return *register;
        }
        let to = self.take(stratum);
        if let Some(code) = self.code.by_stratum.get_mut(stratum as usize) {
            code.push(Instruction { kind, to, of });
        }
        self.emitted.insert((kind, of), to);
        to
    }

    fn lower(&mut self, id: NodeId) {
        let graph = self.graph;
        let register = match graph.node(id) {
            Node::Number(number) => self.literal(number.get()),
            Node::Variable(variable) => {
                let RegisterCounts { inputs, .. } = self.counts;
                let register = match variable {
                    Variable::State(index) => *index,
                    Variable::Input(index) => STATES + index,
                    Variable::Parameter(index) => STATES + inputs + index,
                };
                u16::try_from(register).unwrap_or_default()
            }
            Node::Sum { constant, terms } => self.sum(constant.get(), terms, self.stratum(id), None),
            Node::Product(factors) => self.product(factors, self.stratum(id)),
            Node::Call(function, at) => self.emit(OpKind::Call(*function), &[self.register(*at)]),
            Node::Angle { y, x } => self.emit(OpKind::Angle, &[self.register(*y), self.register(*x)]),
            Node::Choice { smaller, larger, then, otherwise } => {
                let parts = [smaller, larger, then, otherwise].map(|part| self.register(*part));
                self.emit(OpKind::Choice, &parts)
            }
            Node::Law { law, by, arguments } => self.law(*law, by, arguments, self.stratum(id)),
            Node::Curve { curve, order, at } => self.curve(*curve, *order, *at),
        };
        self.values.insert(id, register);
    }

    /// A power of a register.
    pub(super) fn power(&mut self, register: u16, power: i32) -> u16 {
        match power {
            1 => register,
            i32::MIN..=0 => {
                let reciprocal = self.emit(OpKind::Reciprocal, &[register]);
                self.power(reciprocal, -power)
            }
            2 => self.emit(OpKind::Multiply, &[register, register]),
            3 | 4 => {
                let square = self.power(register, 2);
                self.emit(OpKind::Multiply, &[square, if power == 3 { register } else { square }])
            }
            _ => {
                let stratum = self.of_register(register);
                #[allow(clippy::cast_possible_truncation)] // at most LARGEST_POWER
                let bits = (power as i16).cast_unsigned();
                self.push(OpKind::Power, [register, bits, 0, 0, 0, 0], stratum)
            }
        }
    }

    /// The product of registers, those that change rarely first.
    pub(super) fn multiplied(&mut self, mut registers: Vec<u16>) -> Option<u16> {
        registers.sort_by_key(|register| self.of_register(*register));
        registers.into_iter().reduce(|product, next| self.emit(OpKind::Multiply, &[product, next]))
    }

    fn law(&mut self, law: LawId, by: &[u8], arguments: &[NodeId], stratum: Stratum) -> u16 {
        let along_first = by.len() <= 2 && by.iter().all(|index| *index == 0);
        let key = (law, Box::from(arguments));
        if let Some(known) = self.laws.get(&key).filter(|_| along_first) {
            return known.get(by.len()).copied().unwrap_or_default();
        }
        if along_first {
            let (slope, bend) = (self.take(stratum), self.take(stratum));
            let mut of = [0, 0, 0, 0, slope, bend];
            let kind = if arguments.len() <= 4 {
                for (slot, argument) in of.iter_mut().zip(arguments) {
                    *slot = self.register(*argument);
                }
                OpKind::ShortLaw(law)
            } else {
                of[0] = self.listed(arguments);
                OpKind::Law(law)
            };
            let value = self.push(kind, of, stratum);
            self.laws.insert(key, [value, slope, bend]);
            return [value, slope, bend].get(by.len()).copied().unwrap_or_default();
        }
        let start = self.listed(arguments);
        let index = |k: usize| by.get(k).copied().unwrap_or_default().into();
        #[allow(clippy::cast_possible_truncation)] // at most three
        let order = by.len() as u16;
        self.push(OpKind::Partial(law), [start, order, index(0), index(1), index(2), 0], stratum)
    }

    /// Puts the registers of a law's arguments on the list, and says where they begin.
    fn listed(&mut self, arguments: &[NodeId]) -> u16 {
        let start = u16::try_from(self.code.arguments.len() / MOST_ARGUMENTS).unwrap_or_else(|_| {
            self.is_full = true;
            0
        });
        let mut places = [0; MOST_ARGUMENTS];
        for (place, argument) in places.iter_mut().zip(arguments) {
            *place = self.register(*argument);
        }
        self.code.arguments.extend(places);
        start
    }

    fn curve(&mut self, curve: usize, order: [u8; 2], at: [NodeId; 2]) -> u16 {
        let is_line = self.graph.curves.get(curve).is_none_or(|(_, arguments)| *arguments == 1);
        let in_group = |orders: &[[u8; 2]; 3]| orders.iter().position(|of| *of == order);
        let of_grid = || (0..).zip(&GROUPS).find_map(|(group, of)| Some((group, in_group(of)?)));
        let (group, place) = if is_line { Some((0, order[0].into())) } else { of_grid() }.unwrap_or_default();
        let known = self.curves.get(&(curve, at, group)).copied().unwrap_or_else(|| {
            let places = at.map(|at| self.register(at));
            let stratum = places.map(|place| self.of_register(place)).into_iter().max();
            let stratum = stratum.unwrap_or(Stratum::State);
            let (slope, bend) = (self.take(stratum), self.take(stratum));
            let index = u16::try_from(curve).unwrap_or_default();
            let value = self.push(OpKind::Curve, [places[0], index, places[1], group, slope, bend], stratum);
            self.curves.insert((curve, at, group), [value, slope, bend]);
            [value, slope, bend]
        });
        known.get(place).copied().unwrap_or_default()
    }
}

fn count(uses: &mut [u32], id: NodeId) {
    if let Some(uses) = uses.get_mut(id.index()) {
        *uses += 1;
    }
}

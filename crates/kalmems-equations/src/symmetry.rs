//! Which signs of a device's states its measurements cannot tell.
//!
//! A change S of some states, of the sign of each or, of one that comes round, by half its period, is a symmetry if f(S·x, u) = S·f(x, u) (without
//! the half period) and h(S·x, u) = h(x, u) for all states and inputs: the mirrored motion obeys the same equations and gives the same signals, so
//! that no recording tells which of both it was. It is found from the graph, by the parity of each expression. An input is known and stays as it
//! is: what enters with the sign of a state, as a force does, leaves no symmetry; a square or a size does.

use crate::device::Device;
use crate::graph::{ConstantBits, Function, Graph, Node, NodeId, Variable};
use crate::laws::{self, LawId, MOST_ARGUMENTS};
use crate::motion::MOST_STATES;
use std::f64::consts::PI;

/// What becomes of an expression when the signs of some states change.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Parity {
    /// It stays.
    Even,
    /// Its sign changes.
    Odd,
    /// A constant is added to it.
    Shifted(f64),
    /// Something else.
    Neither,
}

impl Parity {
    fn times(self, other: Self) -> Self {
        match (self, other) {
            (Self::Even, Self::Even) | (Self::Odd, Self::Odd) => Self::Even,
            (Self::Even, Self::Odd) | (Self::Odd, Self::Even) => Self::Odd,
            _ => Self::Neither,
        }
    }
}

/// The part of its size by which a shift may differ from one that is meant, by the rounding of the constants that it is made of.
const ROUNDING: f64 = 1e-12;

impl Parity {
    /// The change by a sum of shifts, whose sizes add up to this one: shifts that cancel leave none.
    fn shifted(by: f64, size: f64) -> Self {
        if by.abs() <= ROUNDING * size { Self::Even } else { Self::Shifted(by) }
    }

    /// The change of sine and cosine: half a turn changes their signs.
    fn of_shifted_circle(by: f64) -> Self {
        let half_turns = (by / PI).round();
        if (by - PI * half_turns).abs() > ROUNDING * by.abs() {
            Self::Neither
        } else if half_turns % 2.0 == 0.0 {
            Self::Even
        } else {
            Self::Odd
        }
    }
}

/// Groups of states that may change their signs together; of more, none of their unions is tried.
const MOST_GROUPS: usize = 10;

impl Device {
    /// The smallest sets of states, by their places, whose joint change leaves rates, measurements and events as they are: of the sign of each, or by
    /// half a period of one that comes round. Each of these changes, and each product of them, is arbitrary until something else than the signals
    /// states it. The sign of a phase that comes round is none of them: with the sign of its rate it is a matter of how turns are counted.
    pub fn hidden_signs(&self) -> Vec<Vec<usize>> {
        let comes_round = |state: &usize| self.periods.iter().any(|(other, _)| other == state);
        let mut groups = self.groups();
        groups.retain(|group| !group.iter().any(comes_round));
        groups.extend(self.periods.iter().map(|(state, _)| vec![*state]));
        if groups.len() > MOST_GROUPS {
            return Vec::new();
        }
        let states = |set: &u32| {
            let of_groups = groups.iter().enumerate().filter(|(place, _)| set >> place & 1 == 1);
            let mut states: Vec<usize> = of_groups.flat_map(|(_, group)| group.iter().copied()).collect();
            states.sort_unstable();
            states
        };
        let mut found: Vec<u32> = Vec::new();
        let mut tried: Vec<u32> = (1..1_u32 << groups.len()).collect();
        tried.sort_by_key(|set| set.count_ones());
        for set in tried {
            if !is_sum(set, &found) && self.is_hidden(&states(&set)) {
                found.push(set);
            }
        }
        found.iter().map(states).collect()
    }

    /// What becomes of each quantity when these states change: 1 where it stays, −1 where its sign changes, `None` where it becomes
    /// another one.
    pub fn signs_of_quantities(&self, states: &[usize]) -> Vec<Option<f64>> {
        let mut graph = self.graph.clone();
        let parities = Parities::of(&mut graph, &self.followed, &self.changes(states));
        let sign = |node: &NodeId| match parities.get(*node) {
            Parity::Even => Some(1.0),
            Parity::Odd => Some(-1.0),
            Parity::Shifted(_) | Parity::Neither => None,
        };
        self.followed.iter().map(sign).collect()
    }

    /// How each of the states changes when these do.
    fn changes(&self, states: &[usize]) -> Vec<Parity> {
        let of = |state: usize| {
            let period = self.periods.iter().find(|(other, _)| *other == state);
            match period {
                _ if !states.contains(&state) => Parity::Even,
                None => Parity::Odd,
                Some((_, node)) => {
                    self.graph.number(*node).map_or(Parity::Neither, |period| Parity::Shifted(0.5 * period))
                }
            }
        };
        (0..self.states.len()).map(of).collect()
    }

    /// States that can change their signs together alone, since one stands by itself in a term of the rate of another: a rate and its angle, a
    /// lag and what it follows.
    fn groups(&self) -> Vec<Vec<usize>> {
        let states = self.states.len().min(MOST_STATES);
        let mut group: Vec<usize> = (0..states).collect();
        for (state, rate) in self.rates.iter().enumerate().take(states) {
            let mut linked = Vec::new();
            self.alone_in_terms(*rate, &mut linked);
            for other in linked.into_iter().filter(|other| *other < states) {
                let (from, to) = (group[other], group[state]);
                group.iter_mut().filter(|own| **own == from).for_each(|own| *own = to);
            }
        }
        let members = |of: usize| (0..states).filter(|state| group[*state] == of).collect::<Vec<usize>>();
        (0..states).map(members).filter(|members| !members.is_empty()).collect()
    }

    /// The states that are the only one in a term of a sum, times what no state enters.
    fn alone_in_terms(&self, node: NodeId, to: &mut Vec<usize>) {
        let mut open = vec![node];
        while let Some(node) = open.pop() {
            match self.graph.node(node) {
                Node::Variable(Variable::State(state)) => to.push(*state),
                Node::Sum { terms, .. } => open.extend(terms.iter().map(|(term, _)| *term)),
                Node::Product(factors) => {
                    let is_state = |variable| matches!(variable, Variable::State(_));
                    let mut moving =
                        factors.iter().filter(|(factor, _)| self.graph.depends(*factor, is_state));
                    if let (Some((factor, 1)), None) = (moving.next(), moving.next()) {
                        open.push(*factor);
                    }
                }
                _ => {}
            }
        }
    }

    /// Whether rates, measurements, events and the sizes of noises stay as they are when these states change.
    fn is_hidden(&self, states: &[usize]) -> bool {
        let noises = || self.noise.iter().map(|noise| noise.node);
        let read = || self.readings.iter().chain(&self.crossings).copied().chain(noises());
        let of_resets = self
            .resets
            .iter()
            .flat_map(|reset| std::iter::once(reset.crossing).chain(reset.set.iter().map(|(_, node)| *node)));
        let roots: Vec<NodeId> = self.rates.iter().copied().chain(read()).chain(of_resets).collect();
        let mut graph = self.graph.clone();
        let changes = self.changes(states);
        let parities = Parities::of(&mut graph, &roots, &changes);
        let is = |node: NodeId, wanted: Parity| {
            (node == Graph::ZERO && matches!(wanted, Parity::Even | Parity::Odd))
                || parities.get(node) == wanted
        };
        let of_rate = |change: Parity| if let Parity::Shifted(_) = change { Parity::Even } else { change };
        let rates = self.rates.iter().zip(&changes).all(|(rate, change)| is(*rate, of_rate(*change)));
        let set =
            |(state, node): &(usize, NodeId)| changes.get(*state).is_some_and(|change| is(*node, *change));
        let resets =
            self.resets.iter().all(|reset| is(reset.crossing, Parity::Even) && reset.set.iter().all(set));
        rates && resets && read().all(|node| is(node, Parity::Even))
    }
}

/// Whether a set is the symmetric difference of some of these.
fn is_sum(set: u32, of: &[u32]) -> bool {
    (0..1_u32 << of.len()).any(|chosen| {
        let parts = of.iter().enumerate().filter(|(place, _)| chosen >> place & 1 == 1);
        parts.fold(0, |sum, (_, part)| sum ^ part) == set
    })
}

/// The parities of the expressions of a graph.
struct Parities(Vec<Parity>);

impl Parities {
    fn of(graph: &mut Graph, roots: &[NodeId], changes: &[Parity]) -> Self {
        let below = graph.below(roots);
        let mut parities = Self(vec![Parity::Neither; graph.len()]);
        for id in below {
            let node = graph.node(id).clone();
            let parity = parities.of_node(graph, &node, changes);
            if let Some(slot) = parities.0.get_mut(id.index()) {
                *slot = parity;
            }
        }
        parities
    }

    fn get(&self, id: NodeId) -> Parity {
        self.0.get(id.index()).copied().unwrap_or(Parity::Neither)
    }

    fn of_node(&self, graph: &mut Graph, node: &Node, changes: &[Parity]) -> Parity {
        match node {
            Node::Variable(Variable::State(state)) => changes.get(*state).copied().unwrap_or(Parity::Neither),
            Node::Number(_) | Node::Variable(_) => Parity::Even,
            Node::Sum { constant, terms } => self.of_sum(*constant, terms),
            Node::Product(factors) => factors.iter().fold(Parity::Even, |product, (factor, power)| {
                let of = self.get(*factor);
                product.times(if power % 2 == 0 && of == Parity::Odd { Parity::Even } else { of })
            }),
            Node::Call(function, at) => match (self.get(*at), function) {
                (Parity::Shifted(by), Function::Sin | Function::Cos) => Parity::of_shifted_circle(by),
                (Parity::Even, _) | (Parity::Odd, Function::Cos) => Parity::Even,
                (
                    Parity::Odd,
                    Function::Sin | Function::Tanh | Function::Atanh | Function::Atan | Function::Asin,
                ) => Parity::Odd,
                _ => Parity::Neither,
            },
            Node::Angle { y, x } => match (self.get(*y), self.get(*x)) {
                (of @ (Parity::Even | Parity::Odd), Parity::Even) => of,
                _ => Parity::Neither,
            },
            Node::Choice { smaller, larger, then, otherwise } => {
                self.of_choice(graph, [*smaller, *larger], [*then, *otherwise])
            }
            Node::Law { law, by, arguments } => {
                let mut rest = arguments.iter().skip(1).map(|argument| self.get(*argument));
                let first = arguments.first().map_or(Parity::Even, |argument| self.get(*argument));
                match first {
                    _ if rest.any(|parity| parity != Parity::Even) => Parity::Neither,
                    Parity::Even => Parity::Even,
                    Parity::Odd => of_law(*law, by, arguments.len()),
                    _ => Parity::Neither,
                }
            }
            Node::Curve { at, .. } if at.iter().all(|at| self.get(*at) == Parity::Even) => Parity::Even,
            Node::Curve { .. } => Parity::Neither,
        }
    }

    fn of_sum(&self, constant: ConstantBits, terms: &[(NodeId, ConstantBits)]) -> Parity {
        let parts = || terms.iter().map(|(term, factor)| (self.get(*term), factor.get()));
        if constant == ConstantBits::ZERO && !terms.is_empty() && parts().all(|(part, _)| part == Parity::Odd)
        {
            return Parity::Odd;
        }
        let (mut by, mut size) = (0.0, 0.0);
        for (part, factor) in parts() {
            match part {
                Parity::Even => {}
                Parity::Shifted(shift) => (by, size) = (by + factor * shift, size + (factor * shift).abs()),
                Parity::Odd | Parity::Neither => return Parity::Neither,
            }
        }
        Parity::shifted(by, size)
    }

    /// Of `then` where a < b and `otherwise` elsewhere. Where both sides of the comparison change their signs it turns round, so that each
    /// part stands in for the other; a third one, where the two sides are equal, stays.
    fn of_choice(&self, graph: &mut Graph, compared: [NodeId; 2], parts: [NodeId; 2]) -> Parity {
        let [then, otherwise] = parts;
        let is_odd = |id: NodeId| id == Graph::ZERO || self.get(id) == Parity::Odd;
        if compared.iter().all(|id| self.get(*id) == Parity::Even) {
            let of_parts = [self.get(then), self.get(otherwise)];
            return if of_parts[0] == of_parts[1] { of_parts[0] } else { Parity::Neither };
        }
        if !compared.iter().all(|id| is_odd(*id)) {
            return Parity::Neither;
        }
        if let Node::Choice { smaller, larger, then: greater, otherwise: equal } = *graph.node(otherwise)
            && [larger, smaller] == compared
        {
            let of_ends = self.of_choice(graph, compared, [then, greater]);
            let stays = equal == Graph::ZERO || self.get(equal) == of_ends;
            return if stays { of_ends } else { Parity::Neither };
        }
        let of_parts = [self.get(then), self.get(otherwise)];
        let opposite = graph.scaled(-1.0, then) == otherwise;
        match of_parts {
            [Parity::Odd, Parity::Odd] if opposite => Parity::Even,
            [Parity::Even, Parity::Even] if opposite => Parity::Odd,
            [Parity::Odd, Parity::Odd] if then == otherwise => Parity::Odd,
            [Parity::Even, Parity::Even] if then == otherwise => Parity::Even,
            _ => Parity::Neither,
        }
    }
}

/// The parity of a law in its first argument, or of a derivative of it, from its values at some places.
fn of_law(law: LawId, by: &[u8], arguments: usize) -> Parity {
    let mut parity = None;
    for at in [0.137, 0.291, 0.443] {
        let mut given = [0.0; MOST_ARGUMENTS];
        for (place, value) in given.iter_mut().enumerate().take(arguments) {
            *value = if place == 0 { at } else { 0.9 + 0.17 * place as f64 };
        }
        let [value, ..] = laws::along_first(law, &given);
        given[0] = -at;
        let [mirrored, ..] = laws::along_first(law, &given);
        let of = if mirrored == value {
            Parity::Even
        } else if mirrored == -value {
            Parity::Odd
        } else {
            return Parity::Neither;
        };
        if parity.is_some_and(|before| before != of) || !value.is_finite() {
            return Parity::Neither;
        }
        parity = Some(of);
    }
    let by_first = by.iter().filter(|argument| **argument == 0);
    let turned = by_first.fold(Parity::Even, |parity, _| parity.times(Parity::Odd));
    parity.map_or(Parity::Neither, |parity| parity.times(turned))
}

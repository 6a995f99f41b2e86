//! Products of two factors that several products have.

use crate::graph::NodeId;
use std::collections::{BTreeMap, BTreeSet};

/// A factor of a product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Atom {
    /// A value that comes from outside.
    Given(usize),
    /// Two factors that other products have too.
    Pair(usize),
    Node(NodeId),
    /// 1/x
    Inverse(NodeId),
    Power(NodeId, i32),
}

impl Atom {
    /// The node that it needs.
    pub(super) fn node(&self) -> Option<NodeId> {
        match self {
            Self::Given(_) | Self::Pair(_) => None,
            Self::Node(node) | Self::Inverse(node) | Self::Power(node, _) => Some(*node),
        }
    }
}

/// The most pairs that are chosen.
const MOST_PAIRS: usize = 200;
/// The most products in which pairs are looked for, and the most factors of one.
const MOST_PRODUCTS: usize = 300;
const MOST_FACTORS: usize = 32;

/// Products by what they were, and the pairs in them.
#[derive(Clone, Debug, Default)]
pub(super) struct Pairs {
    products: BTreeMap<Vec<Atom>, Vec<Atom>>,
    pairs: Vec<[Atom; 2]>,
}

impl Pairs {
    /// A product that will be computed.
    pub(super) fn note(&mut self, atoms: &[Atom]) {
        if atoms.len() > 1 && atoms.len() <= MOST_FACTORS && self.products.len() < MOST_PRODUCTS {
            self.products.insert(atoms.to_vec(), atoms.to_vec());
        }
    }

    /// Chooses pairs that at least two products have, the most frequent one first.
    pub(super) fn choose(&mut self) {
        while self.pairs.len() < MOST_PAIRS {
            let mut counts: BTreeMap<[Atom; 2], usize> = BTreeMap::new();
            // Products that have become the same are one.
            let different: BTreeSet<&Vec<Atom>> = self.products.values().collect();
            for atoms in different {
                let mut of_this: BTreeSet<[Atom; 2]> = BTreeSet::new();
                for (k, a) in atoms.iter().enumerate() {
                    for b in atoms.iter().skip(k + 1) {
                        of_this.insert(if a <= b { [*a, *b] } else { [*b, *a] });
                    }
                }
                for pair in of_this {
                    *counts.entry(pair).or_default() += 1;
                }
            }
            let best = counts.into_iter().filter(|(_, count)| *count > 1);
            // Of several as frequent the first one.
            let Some((pair, _)) = best.max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0))) else { return };
            let place = self.pairs.len();
            self.pairs.push(pair);
            for atoms in self.products.values_mut() {
                replace(atoms, pair, Atom::Pair(place));
            }
        }
    }

    /// The factors of a product that was noted, with pairs among them.
    pub(super) fn reduced(&self, atoms: &[Atom]) -> Vec<Atom> {
        self.products.get(atoms).cloned().unwrap_or_else(|| atoms.to_vec())
    }

    /// The factors of a pair.
    pub(super) fn pair(&self, place: usize) -> [Atom; 2] {
        self.pairs.get(place).copied().unwrap_or([Atom::Given(0); 2])
    }
}

/// Puts a pair instead of its factors, as often as they are there.
fn replace(atoms: &mut Vec<Atom>, [a, b]: [Atom; 2], pair: Atom) {
    loop {
        let Some(first) = atoms.iter().position(|atom| *atom == a) else { return };
        let second = atoms.iter().enumerate().position(|(k, atom)| k != first && *atom == b);
        let Some(second) = second else { return };
        atoms.remove(first.max(second));
        if let Some(slot) = atoms.get_mut(first.min(second)) {
            *slot = pair;
        }
    }
}

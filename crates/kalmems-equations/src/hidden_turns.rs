//! Which turns of a device's states its measurements cannot tell.
//!
//! Pairs of states of one unit, (x, y) → (x cos wα − y sin wα, x sin wα + y cos wα), and states that come round, φ → φ + wα, turn together. That is a
//! symmetry if the generator G of the turn has ∂h/∂x·G = 0 and ∂f/∂x·G = ∂G/∂x·f for all states and inputs (Olver, Applications of Lie Groups to
//! Differential Equations, 1993, theorem 2.71). G = Σ c·G_k over all such pairs and states is linear in c: the c are the null space of a matrix with a
//! row for each measurement and each rate at each of many random points. Smooth expressions that are equal there are equal everywhere, but for a
//! chance that is none; the derivatives are those of the graph, so that only rounding is left.

use crate::device::{Device, NoiseKind};
use crate::energy::{DECADES, XorshiftNormal};
use crate::motion::MOST_STATES;
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// A pair of states that turns, or a state that comes round and is shifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateTurn {
    /// The places of both states; twice that of one that comes round.
    pub places: [usize; 2],
    /// The angle in a common turn of 1 rad.
    pub rate: f64,
}

/// Points at which the derivatives are computed.
const POINTS: usize = 80;
/// Points at which they have to be finite.
const FEWEST: usize = 32;
/// ln 10⁶: how far above its unit a state may be at every other pair of points, as a rate is.
const LARGER: f64 = 13.815_510_557_964_274;
/// The rounding of terms that cancel, in parts of them.
const ROUNDING: f64 = 1e-11;
/// Parts of a row that are taken for 0 while the null space is sought.
const NOTHING: f64 = 1e-9;

/// What a row of the matrix is made of: for each generator the sum of its terms, and of their sizes.
type TurnRow = Vec<[f64; 2]>;

impl Device {
    /// The turns that leave rates, measurements and the densities of noises as they are, with the values of the parameters that the description
    /// states: for each turn the pairs of states, and the states that come round, which turn together. None is known of a device with events, resets, choices or curves,
    /// which random points may miss.
    pub fn hidden_turns(&self) -> Vec<Vec<StateTurn>> {
        if !self.crossings.is_empty() || !self.resets.is_empty() {
            return Vec::new();
        }
        let generators = self.generators();
        if self.rates.iter().chain(&self.readings).any(|node| !self.graph.is_smooth(*node)) {
            return Vec::new();
        }
        let rows = if generators.is_empty() { None } else { self.rows_of_turns(&generators) };
        let of = |rows: Vec<TurnRow>| {
            let found = null_space(&rows, generators.len()).into_iter();
            let holds = |c: &Vec<f64>| rows.iter().all(|row| cancels(row, c));
            found.filter(holds).filter_map(|c| self.turn(&generators, &c)).collect()
        };
        rows.map_or_else(Vec::new, of)
    }

    /// All pairs of states of one unit, and all states that come round, of those on which some measurement depends.
    fn generators(&self) -> Vec<[usize; 2]> {
        let comes_round = |state: usize| self.periods.iter().any(|(other, _)| *other == state);
        let unit = |state: usize| self.states.get(state).map(|named| named.unit.dimension());
        let is_one = |[i, j]: &[usize; 2]| {
            if i == j {
                comes_round(*i)
            } else {
                unit(*i) == unit(*j) && !comes_round(*i) && !comes_round(*j)
            }
        };
        let states = self.states.len().min(MOST_STATES);
        let pairs = (0..states).flat_map(|i| (i..states).map(move |j| [i, j]));
        let mut pairs: Vec<[usize; 2]> = pairs.filter(is_one).collect();
        if !pairs.is_empty() {
            let seen = self.seen_states();
            pairs.retain(|pair| pair.iter().all(|state| seen.contains(state)));
        }
        pairs
    }

    /// The states that enter a measurement, or the rate of one that does.
    fn seen_states(&self) -> Vec<usize> {
        let mut seen = vec![false; self.states.len().min(MOST_STATES)];
        let mut open = self.readings.clone();
        while let Some(node) = open.pop() {
            for (state, seen) in seen.iter_mut().enumerate().filter(|(_, seen)| !**seen) {
                let is_it = |variable| variable == crate::graph::Variable::State(state);
                if self.graph.depends(node, is_it) {
                    *seen = true;
                    open.extend(self.rates.get(state));
                }
            }
        }
        seen.into_iter().enumerate().filter(|(_, seen)| *seen).map(|(state, _)| state).collect()
    }

    /// What each generator makes of each measurement and rate at random points; `None` where too few of them are in the domain.
    fn rows_of_turns(&self, generators: &[[usize; 2]]) -> Option<Vec<TurnRow>> {
        let values = self.values();
        let periods = self.periods(&values).ok()?;
        let size =
            |state: usize| periods.iter().find(|(other, _)| *other == state).map_or(0.0, |(_, p)| p / TAU);
        let motion = self.motion(&[]).ok()?;
        let readouts: Vec<_> =
            (0..self.readings.len()).map(|k| self.readout(k, &[]).ok()).collect::<Option<_>>()?;
        let mut works: Vec<_> = readouts.iter().map(|readout| readout.work(&values)).collect();
        let (mut work, states) = (motion.work(&values), self.states.len());
        let mut chance = XorshiftNormal(0x9e37_79b9_7f4a_7c15);
        let (mut rows, mut finite) = (Vec::new(), 0);
        for point in 0..POINTS {
            // Small and large ones, all of one size at every other point: what is small next to another term shows at some of them.
            let largest = if point % 4 < 2 { 0.0 } else { LARGER };
            let common = Scalar::exp(chance.between(-DECADES, largest));
            let mut drawn = |state: usize| {
                let own = Scalar::exp(chance.between(-DECADES, largest));
                let of = if point % 2 == 0 { common } else { own };
                chance.between(-1.0, 1.0) * if size(state) > 0.0 { TAU * size(state) } else { of }
            };
            let x: Vec<f64> = (0..states).map(&mut drawn).collect();
            let inputs: Vec<f64> = self.inputs.iter().map(|_| 10.0 * chance.between(-1.0, 1.0)).collect();
            let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
            let mut is_finite = motion.linearize(&mut work, &x, &inputs, &mut rates, &mut jacobian);
            let mut here: Vec<TurnRow> = Vec::new();
            let along = |slopes: &[f64], [i, j]: [usize; 2]| {
                if i == j { [slopes[i] * size(i), 0.0] } else { [-slopes[i] * x[j], slopes[j] * x[i]] }
            };
            for (readout, work) in readouts.iter().zip(&mut works) {
                let mut slopes = vec![0.0; states];
                is_finite &= readout.linearize(work, &x, &inputs, &mut slopes).is_finite();
                here.push(generators.iter().map(|pair| summed(&along(&slopes, *pair))).collect());
            }
            for (row, slopes) in jacobian.chunks(states.max(1)).enumerate() {
                let of = |pair: &[usize; 2]| {
                    let [i, j] = *pair;
                    let [a, b] = along(slopes, *pair);
                    let turned = match row {
                        _ if i == j => 0.0,
                        _ if row == i => rates[j],
                        _ if row == j => -rates[i],
                        _ => 0.0,
                    };
                    summed(&[a, b, turned])
                };
                here.push(generators.iter().map(of).collect());
            }
            if is_finite {
                finite += 1;
                rows.append(&mut here);
            }
        }
        (finite >= FEWEST).then_some(rows)
    }

    /// The turn with these parts of the generators, if each state belongs to one pair and the noises of a pair are alike.
    fn turn(&self, generators: &[[usize; 2]], parts: &[f64]) -> Option<Vec<StateTurn>> {
        let first = parts.iter().copied().find(|part| *part != 0.0)?;
        let each = generators.iter().zip(parts).filter(|(_, part)| **part != 0.0);
        let turn: Vec<StateTurn> =
            each.map(|(places, part)| StateTurn { places: *places, rate: part / first }).collect();
        let mut turned = [false; MOST_STATES];
        for StateTurn { places: [i, j], .. } in &turn {
            let is_again = turned.get(*i)? | turned.get(*j)?;
            (turned[*i], turned[*j]) = (true, true);
            if is_again {
                return None;
            }
        }
        let noises = self.noise(&self.values(), &vec![0.0; self.states.len()]).ok()?;
        let density = |place: usize| {
            let of = |(kind, size): &(NoiseKind, f64)| {
                (*kind == NoiseKind::Rate { state: place }).then_some(*size)
            };
            noises.iter().find_map(of).unwrap_or(0.0)
        };
        let is_alike = |turn: &StateTurn| density(turn.places[0]) == density(turn.places[1]);
        (turn.iter().all(is_alike) && self.noise.iter().all(|noise| !noise.varies)).then_some(turn)
    }
}

/// A sum, and that of the sizes of its terms.
fn summed(terms: &[f64]) -> [f64; 2] {
    [terms.iter().sum(), terms.iter().map(|term| term.abs()).sum()]
}

/// Whether these parts of all generators cancel in a row.
fn cancels(row: &TurnRow, parts: &[f64]) -> bool {
    let each = || row.iter().zip(parts);
    let sum: f64 = each().map(|([sum, _], part)| part * sum).sum();
    let size: f64 = each().map(|([_, size], part)| (part * size).abs()).sum();
    sum.abs() <= ROUNDING * size
}

/// The nearest twelfth, if that is near: rates of phases are whole numbers and their ratios.
fn without_rounding(value: f64) -> f64 {
    let near = (12.0 * value).round() / 12.0;
    if (value - near).abs() < NOTHING { near } else { value }
}

/// A basis of what all rows take to 0, by Gauss and Jordan's elimination of each row by those before.
fn null_space(rows: &[TurnRow], columns: usize) -> Vec<Vec<f64>> {
    let mut reduced: Vec<(usize, Vec<f64>)> = Vec::new();
    for row in rows {
        let largest = row.iter().map(|[_, size]| *size).fold(0.0, f64::max);
        let mut left: Vec<f64> =
            row.iter().map(|[sum, _]| if largest > 0.0 { sum / largest } else { 0.0 }).collect();
        for (pivot, other) in &reduced {
            let factor = left[*pivot];
            left.iter_mut().zip(other).for_each(|(left, other)| *left -= factor * other);
        }
        let size = |column: &usize| left[*column].abs();
        let Some(pivot) = (0..columns).max_by(|a, b| size(a).total_cmp(&size(b))) else { continue };
        let value = left[pivot];
        if value.abs() <= NOTHING {
            continue;
        }
        for left in &mut left {
            *left /= value;
        }
        for (_, other) in &mut reduced {
            let factor = other[pivot];
            other.iter_mut().zip(&left).for_each(|(other, left)| *other -= factor * left);
        }
        reduced.push((pivot, left));
    }
    let is_free = |column: &usize| reduced.iter().all(|(pivot, _)| pivot != column);
    let basis = |free: usize| {
        let mut parts = vec![0.0; columns];
        parts[free] = 1.0;
        for (pivot, row) in &reduced {
            parts[*pivot] = without_rounding(-row[free]);
        }
        parts
    };
    (0..columns).filter(is_free).map(basis).collect()
}

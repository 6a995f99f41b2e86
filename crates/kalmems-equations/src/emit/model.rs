//! A device in the units of a filter: one graph of what a step and its corrections need.

use super::error::EmitError;
use super::laws::expanded;
use super::names::SourceNames;
use super::request::EmitRequest;
use super::rewrite::{copied, distributed, substituted};
use super::scale::Units;
use crate::curve::Curve;
use crate::device::{Device, fault_of};
use crate::graph::{Graph, Node, NodeId, Variable};
use crate::motion::whole;
use std::collections::HashMap;

/// How rarely a value changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Rarity {
    /// A number.
    Literal,
    /// With the parameters that a program may change.
    Constant,
    /// With inputs and with parameters that are states, which a step holds.
    Held,
    /// With the states of the device.
    Moving,
}

/// A number of the filter and its derivatives by the states that it depends on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LinearizedNumber {
    pub(super) value: NodeId,
    /// Columns and derivatives.
    pub(super) slopes: Vec<(usize, NodeId)>,
}

/// The device in the filter's units: z = (x − origin)/scale, the time in samples, what is measured in standard deviations.
#[derive(Clone, Debug)]
pub(super) struct EmittedModel {
    pub(super) graph: Graph,
    /// How many states move; behind them are the parameters that are states.
    pub(super) moving: usize,
    pub(super) size: usize,
    /// What each moving state gains in one interval by Euler's method.
    pub(super) rates: Vec<LinearizedNumber>,
    /// The measurements of the request, and behind them its events.
    pub(super) readings: Vec<LinearizedNumber>,
}

impl EmittedModel {
    /// Of a device in these units.
    pub(super) fn of(device: &Device, request: &EmitRequest, units: &Units) -> Result<Self, EmitError> {
        let moving = device.states().len();
        let mut graph = device.graph.clone();
        let readings = request.measures.iter().map(|m| (&device.readings, m.measure, m.variance));
        let events = request.events.iter().map(|e| (&device.crossings, e.event, e.variance));
        let mut roots: Vec<NodeId> = device.rates.clone();
        let mut factors: Vec<f64> = units.scale.iter().take(moving).map(|s| request.interval_s / s).collect();
        for (nodes, place, variance) in readings.chain(events) {
            roots.push(nodes.get(place).copied().unwrap_or(Graph::ZERO));
            factors.push(1.0 / variance.sqrt());
        }
        let values = in_units(device, request, units, &mut graph, &roots)?;
        let mut values: Vec<_> = values.iter().zip(&factors).map(|(v, by)| graph.scaled(*by, *v)).collect();
        let (rates, readings) = values.split_at_mut(moving);
        for event in readings.iter_mut().skip(request.measures.len()) {
            *event = taken_back(&mut graph, *event, rates, request.interval_s);
        }
        let values = tidied(&mut graph, &values, moving)?;

        let size = request.size();
        let (mut all, mut places) = (values.clone(), Vec::new());
        for (row, value) in values.iter().enumerate() {
            for column in 0..size {
                let slope = graph.derivative(*value, Variable::State(column));
                if slope != Graph::ZERO {
                    places.push((row, column));
                    all.push(slope);
                }
            }
        }
        let all = substituted(&mut graph, &all, &HashMap::new(), &mut expanded)?;
        let all = tidied(&mut graph, &all, moving)?;
        if let Some(stop) = graph.take_stop() {
            return Err(whole("derivative", fault_of(stop)).into());
        }
        let mut model = Self { graph, moving, size, rates: Vec::new(), readings: Vec::new() };
        model.take(&all, &places, values.len());
        Ok(model)
    }

    /// Takes the values and the slopes behind them.
    fn take(&mut self, all: &[NodeId], places: &[(usize, usize)], values: usize) {
        let slopes = all.iter().skip(values);
        let of = |row: usize| {
            let of_row = places.iter().zip(slopes.clone()).filter(move |((r, _), _)| *r == row);
            of_row.map(|((_, column), slope)| (*column, *slope)).filter(|(_, s)| *s != Graph::ZERO).collect()
        };
        let rows = all.iter().take(values).enumerate();
        let mut rows: Vec<LinearizedNumber> =
            rows.map(|(row, value)| LinearizedNumber { value: *value, slopes: of(row) }).collect();
        self.readings = rows.split_off(self.moving.min(rows.len()));
        self.rates = rows;
    }

    /// Every expression, and the same model with others in their place.
    pub(super) fn roots(&self) -> Vec<NodeId> {
        let rows = self.rates.iter().chain(&self.readings);
        rows.flat_map(|row| [row.value].into_iter().chain(row.slopes.iter().map(|(_, slope)| *slope)))
            .collect()
    }

    /// Puts expressions instead of those that [`roots`](Self::roots) lists.
    pub(super) fn replace(&mut self, roots: &[NodeId]) {
        let mut roots = roots.iter().copied();
        for row in self.rates.iter_mut().chain(&mut self.readings) {
            row.value = roots.next().unwrap_or(row.value);
            for (_, slope) in &mut row.slopes {
                *slope = roots.next().unwrap_or(*slope);
            }
        }
    }
}

/// The terms of a series in time behind its first one.
const SERIES: [f64; 3] = [-1.0, 0.5, -1.0 / 6.0];

/// What an expression was so long before the sample as a correction is handed: its series in time, with these gains of the states in one
/// interval of so many s.
fn taken_back(graph: &mut Graph, value: NodeId, rates: &[NodeId], interval_s: f64) -> NodeId {
    let seconds = graph.variable(SourceNames::MEASURED);
    let ago = graph.scaled(interval_s.recip(), seconds);
    let (mut terms, mut grown) = (vec![(value, 1.0)], value);
    for (power, coefficient) in (1..).zip(SERIES) {
        let mut growth = Vec::with_capacity(rates.len());
        for (state, rate) in rates.iter().enumerate() {
            let slope = graph.derivative(grown, Variable::State(state));
            growth.push((graph.product(&[(slope, 1), (*rate, 1)]), 1.0));
        }
        grown = graph.sum(0.0, &growth);
        terms.push((graph.product(&[(grown, 1), (ago, power)]), coefficient));
    }
    graph.sum(0.0, &terms)
}

/// How rarely each node of a graph changes, of those that these are made of.
pub(super) fn rarities(graph: &Graph, roots: &[NodeId], moving: usize) -> Vec<Rarity> {
    let mut rarities = vec![Rarity::Literal; graph.len()];
    for id in graph.below(roots) {
        let rarity = match graph.node(id) {
            Node::Variable(Variable::State(index)) if *index < moving => Rarity::Moving,
            Node::Variable(Variable::State(_) | Variable::Input(_)) => Rarity::Held,
            Node::Variable(Variable::Parameter(_)) => Rarity::Constant,
            node => {
                let parts = node.parts();
                let of = parts.iter().filter_map(|part| rarities.get(part.index())).max();
                of.copied().unwrap_or(Rarity::Literal)
            }
        };
        if let Some(slot) = rarities.get_mut(id.index()) {
            *slot = rarity;
        }
    }
    rarities
}

/// Constants multiplied into sums until that changes nothing.
pub(super) fn tidied(graph: &mut Graph, roots: &[NodeId], moving: usize) -> Result<Vec<NodeId>, EmitError> {
    let mut roots = roots.to_vec();
    for _ in 0..4 {
        let rarities = rarities(graph, &roots, moving);
        let is_constant =
            |_: &Graph, id: NodeId| rarities.get(id.index()).is_some_and(|r| *r <= Rarity::Constant);
        let next = distributed(graph, &roots, &is_constant)?;
        if next == roots {
            break;
        }
        roots = next;
    }
    Ok(roots)
}

/// Expressions of the device over the filter's states, without laws but those of one number, and with the numbers of parameters.
fn in_units(
    device: &Device,
    request: &EmitRequest,
    units: &Units,
    graph: &mut Graph,
    roots: &[NodeId],
) -> Result<Vec<NodeId>, EmitError> {
    let state = |graph: &mut Graph, index: usize| {
        let variable = graph.variable(Variable::State(index));
        graph.sum(units.origin(index), &[(variable, units.scale(index))])
    };
    let mut made: HashMap<NodeId, NodeId> = HashMap::new();
    for id in graph.below(roots) {
        let node = graph.node(id).clone();
        let part = |part: NodeId| made.get(&part).copied().unwrap_or(part);
        let new = match &node {
            Node::Variable(Variable::State(index)) => state(graph, *index),
            Node::Variable(Variable::Parameter(index)) => {
                match request.free.iter().position(|free| free.parameter == *index) {
                    Some(free) => state(graph, request.states.len() + free),
                    None if request.adjustable.contains(index) => id,
                    None => graph.literal(request.parameters.get(*index).copied().unwrap_or_default()),
                }
            }
            Node::Curve { curve, order, at } => {
                let (spans, size) = device.curves.get(*curve).map_or(([[0.0, 1.0]; 2], 1.0), Curve::extent);
                let mut places = [Graph::ZERO; 2];
                let mut scale = size;
                for (((place, at), [middle, half]), order) in places.iter_mut().zip(at).zip(spans).zip(order)
                {
                    *place = graph.sum(-middle / half, &[(part(*at), 1.0 / half)]);
                    scale /= half.powi((*order).into());
                }
                let plain = graph.curve(*curve, *order, places);
                graph.scaled(scale, plain)
            }
            _ => copied(graph, &node, &part, &mut expanded)?,
        };
        made.insert(id, new);
    }
    Ok(roots.iter().map(|root| made.get(root).copied().unwrap_or(*root)).collect())
}

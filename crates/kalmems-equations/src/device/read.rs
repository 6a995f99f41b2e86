//! From a description to a device.

use super::names::{DescriptionNames, ParsedText};
use super::resolve::{
    DefinitionSlot, DelayExpansion, ExternalQuantity, RateOf, ResolvedValue, Resolver, fault_of, unlike,
};
use super::turns::TurnMistake;
use super::{Device, DeviceEquation, Named, Parameter};
use crate::curve::Curve;
use crate::description::{CurvePoints, Description, NamedText};
use crate::error::{EquationError, EquationFault, nearest};
use crate::graph::{Graph, Variable};
use crate::quantity::UnitKnowledge;
use kalmems_units::{Dimension, Unit, Value as Quantified};
use std::sync::Arc;

pub(super) const SECOND: Dimension = Dimension::of([0, 0, 1, 0, 0, 0]);

impl Device {
    /// Reads all texts, checks names and units, and makes the graph.
    ///
    /// # Errors
    ///
    /// The first that is wrong, with its place.
    pub fn of(description: &Description) -> Result<Self, EquationError> {
        let mut read = ReadResult::begin(description)?;
        let rates = read.rates()?;
        // Named expressions are read whether something uses them or not, so that none is wrong unnoticed.
        let mut equations = Vec::new();
        for index in 0..read.resolver.lets.len() {
            read.resolver.named(index)?;
            if let Some((text, _)) = read.resolver.lets.get(index) {
                equations.push((text.entry.name.clone(), DeviceEquation::Text(text.clone())));
            }
        }
        for index in 0..read.resolver.delays.len() {
            read.resolver.delayed(index)?;
        }
        for (index, state) in read.states.iter().enumerate() {
            if let Some((RateOf::Text(text), _)) = read.resolver.rates.get(index) {
                equations.push((format!("d{}/dt", state.name), DeviceEquation::Text(text.clone())));
            }
        }
        let (measures, readings) = read.measures(&mut equations)?;
        let (quantities, followed) = read.quantities(&mut equations, &measures)?;
        let (events, crossings) = read.events(&mut equations, &measures)?;
        let noise = read.noise(&measures, &events)?;
        let resets = read.resets(&mut equations)?;
        let periods = read.periods()?;
        let energy = match &description.energy {
            Some(entry) => {
                let text = ParsedText::read(entry)?;
                equations.push(("E".to_owned(), DeviceEquation::Text(text.clone())));
                Some(read.resolver.value(&text)?.node)
            }
            None => None,
        };
        let ReadResult { mut resolver, states, mut inputs, parameters, curves, .. } = read;
        let own_inputs = inputs.len();
        let (rated_inputs, rates_of_inputs): (Vec<usize>, Vec<Named>) =
            std::mem::take(&mut resolver.input_rates).into_iter().map(|rate| (rate.of, rate.named)).unzip();
        inputs.extend(rates_of_inputs);
        let equations = resolver.used.into_iter().chain(equations).collect();
        Ok(Self {
            states,
            own_states: description.states.len(),
            inputs,
            own_inputs,
            rated_inputs,
            parameters,
            measures,
            quantities,
            events,
            graph: resolver.graph,
            curves: curves.into(),
            rates: rates.into_iter().map(|value| value.node).collect(),
            readings,
            followed,
            crossings,
            noise,
            resets,
            periods,
            energy,
            notices: resolver.notices,
            equations,
        })
    }
}

pub(super) struct ReadResult<'a> {
    pub(super) description: &'a Description,
    pub(super) resolver: Resolver,
    pub(super) states: Vec<Named>,
    inputs: Vec<Named>,
    parameters: Vec<Parameter>,
    curves: Vec<Curve>,
}

fn named(entry: &NamedText) -> Result<Named, EquationError> {
    let text = entry.text.trim();
    let unit = Unit::parse(if text.is_empty() { "1" } else { text })
        .map_err(|fault| EquationError::whole(&entry.place, &entry.text, fault.into()))?;
    Ok(Named { name: entry.name.as_str().into(), unit, unit_text: text.into() })
}

fn parameter(entry: &NamedText) -> Result<Parameter, EquationError> {
    let value = Quantified::parse(&entry.text)
        .map_err(|fault| EquationError::whole(&entry.place, &entry.text, fault.into()))?;
    let (_, unit_text) = value.parts();
    let named = Named { name: entry.name.as_str().into(), unit: value.unit(), unit_text: unit_text.into() };
    Ok(Parameter { named, value: value.si() })
}

impl<'a> ReadResult<'a> {
    /// Reads all texts that others refer to.
    fn begin(description: &'a Description) -> Result<Self, EquationError> {
        if description.states.is_empty() {
            let fault = EquationFault::Missing(
                "a device needs a state; add `[states]` with names and units".to_owned(),
            );
            return Err(EquationError::whole(&place("states"), "", fault));
        }
        let mut entries = description.states.clone();
        let mut rates = own_rates(description)?;
        for follower in &description.lag {
            let (of, time) = (ParsedText::read(&follower.of)?, ParsedText::read(&follower.time)?);
            entries.push(NamedText { name: follower.name.clone(), ..unit_of(&of)? });
            rates.push(RateOf::Lag(DelayExpansion { of, time, state: entries.len() - 1, order: 1 }));
        }
        let mut delays = Vec::new();
        for follower in &description.delay {
            if !matches!(follower.order, 1 | 2) {
                let why = format!("a delay of order {} is not known; expected 1 or 2", follower.order);
                return Err(EquationError::whole(&follower.of.place, "", EquationFault::Value(why)));
            }
            let (of, time) = (ParsedText::read(&follower.of)?, ParsedText::read(&follower.time)?);
            let expansion = DelayExpansion { of, time, state: entries.len(), order: follower.order };
            for which in 0..follower.order {
                let name = format!("{}_{}", follower.name, which + 1);
                entries.push(NamedText { name, ..unit_of(&expansion.of)? });
                rates.push(RateOf::Delay(expansion.clone(), which));
            }
            delays.push((expansion, DefinitionSlot::Open));
        }
        let names = DescriptionNames::of(description, &entries)?;
        let states: Vec<Named> = entries.iter().map(named).collect::<Result<_, _>>()?;
        let inputs: Vec<Named> = description.inputs.iter().map(named).collect::<Result<_, _>>()?;
        let parameters: Vec<Parameter> =
            description.parameters.iter().map(parameter).collect::<Result<_, _>>()?;
        let given = |named: &Named| ExternalQuantity::of(named.unit, &named.unit_text);
        let mut graph = Graph::new();
        let arguments = |points: &CurvePoints| if points.z.is_empty() { 1 } else { 2 };
        graph.curves =
            description.tables.iter().map(|points| (points.name.clone(), arguments(points))).collect();
        let resolver = Resolver {
            graph,
            names,
            given: [
                states.iter().map(given).collect(),
                inputs.iter().map(given).collect(),
                parameters.iter().map(|parameter| given(&parameter.named)).collect(),
            ],
            lets: texts(&description.lets)?.into_iter().map(|text| (text, DefinitionSlot::Open)).collect(),
            delays,
            rates: rates.into_iter().map(|rate| (rate, DefinitionSlot::Open)).collect(),
            input_rates: Vec::new(),
            plain: (description.parameters.iter().zip(&parameters))
                .map(|(entry, parameter)| parameter.named.unit_text.is_empty().then(|| entry.clone()))
                .collect(),
            curves: description.tables.iter().map(units_of_curve).collect::<Result<_, _>>()?,
            notices: Vec::new(),
            busy: Vec::new(),
            terms_read: 0,
            used: std::collections::BTreeMap::new(),
        };
        let curves = description.tables.iter().map(Curve::through).collect::<Result<_, _>>()?;
        Ok(Self { description, resolver, states, inputs, parameters, curves })
    }

    /// The rate of each state, in its unit per second.
    fn rates(&mut self) -> Result<Vec<ResolvedValue>, EquationError> {
        let mut rates = Vec::new();
        for index in 0..self.states.len() {
            let value = self.resolver.rate(index)?;
            let Some((RateOf::Text(text), _)) = self.resolver.rates.get(index).cloned() else {
                rates.push(value);
                continue;
            };
            let state = self.resolver.variable(Variable::State(index)).quantity;
            let wanted = state.over(UnitKnowledge::Exact(SECOND)).unwrap_or(UnitKnowledge::Any);
            let whole = 0..text.entry.text.len();
            if wanted.plus(value.quantity).is_none() {
                let because = format!("the rate of `{}` has", text.entry.name);
                let error = text.error(&whole, unlike("this", value.quantity, wanted.to_string(), because));
                let sides = [(value.node, value.quantity), (Graph::ZERO, wanted)];
                return Err(self.resolver.with_plain_parameters(error, sides));
            }
            let lacks = wanted.dimension().is_some_and(|wanted| value.quantity.lacks_angle_of(wanted));
            if lacks && value.in_cycles {
                let message = "all of this is in Hz, which are cycles per second, and the rate is in rad/s; write `2*pi` before it";
                self.resolver.notice(&text, &whole, message.to_owned());
            } else if let Some(mistake) = TurnMistake::of_rate(value) {
                self.resolver.notice(&text, &whole, mistake.remedy().to_owned());
            }
            rates.push(value);
        }
        Ok(rates)
    }

    fn measures(&mut self, equations: &mut Equations) -> Result<NamedNodes, EquationError> {
        self.read_of_states(&self.description.measure, ("a measurement", false), equations)
    }

    /// What follows from states, inputs and parameters.
    fn quantities(
        &mut self,
        equations: &mut Equations,
        measures: &[Named],
    ) -> Result<NamedNodes, EquationError> {
        let found = self.read_of_states(&self.description.quantities, ("a quantity", true), equations)?;
        for entry in &self.description.quantities {
            self.require_own_name(entry, measures)?;
        }
        Ok(found)
    }

    /// Refuses the name of a state, an input or a measurement for something else that a trajectory or a recording has.
    fn require_own_name(&self, entry: &NamedText, measures: &[Named]) -> Result<(), EquationError> {
        let others =
            [("a state", &self.states[..]), ("an input", &self.inputs[..]), ("a measurement", measures)];
        let is_named = |(_, all): &(&str, &[Named])| all.iter().any(|named| *named.name == entry.name);
        let Some((what, _)) = others.iter().find(|with| is_named(with)) else { return Ok(()) };
        let why = format!("it is {what} already; take another one");
        let fault = EquationFault::Name { name: entry.name.clone(), why };
        Err(EquationError::whole(&entry.place, "", fault))
    }

    /// Expressions with their units that depend on states, or, where that is enough, on parameters, which a filter may hold as states.
    fn read_of_states(
        &mut self,
        entries: &[NamedText],
        (what, by_parameters): (&str, bool),
        equations: &mut Equations,
    ) -> Result<NamedNodes, EquationError> {
        let (mut names, mut nodes) = (Vec::new(), Vec::new());
        for entry in entries {
            let text = ParsedText::read(entry)?;
            let Some((unit, span)) = text.tree.unit.clone() else {
                let why = format!("{what} states its unit; write it after `in`, such as `… in V`");
                return Err(text.error(&(0..entry.text.len()), EquationFault::Missing(why)));
            };
            let value = self.resolver.value(&text)?;
            let is_parameter = |variable: &Variable| matches!(variable, Variable::Parameter(_));
            let mut sees =
                by_parameters && self.resolver.graph.variables(value.node).iter().any(is_parameter);
            for state in 0..self.states.len() {
                sees |= self.resolver.graph.derivative(value.node, Variable::State(state)) != Graph::ZERO;
            }
            if let Some(stop) = self.resolver.graph.take_stop() {
                return Err(text.error(&(0..entry.text.len()), fault_of(stop)));
            }
            if !sees {
                return Err(text.error(&(0..span.start), EquationFault::Blind));
            }
            if names.iter().any(|named: &Named| *named.name == entry.name) {
                return Err(twice(entry, what));
            }
            let unit_text = text.word(&span).into();
            names.push(Named { name: entry.name.as_str().into(), unit, unit_text });
            nodes.push(value.node);
            equations.push((entry.name.clone(), DeviceEquation::Text(text)));
        }
        Ok((names, nodes))
    }

    fn events(&mut self, equations: &mut Equations, measures: &[Named]) -> Result<NamedNodes, EquationError> {
        let (mut names, mut nodes) = (Vec::new(), Vec::new());
        for entry in &self.description.events {
            let text = ParsedText::read(entry)?;
            let value = self.resolver.value(&text)?;
            let by_state = |variable: &Variable| matches!(variable, Variable::State(_));
            if !self.resolver.graph.variables(value.node).iter().any(by_state) {
                let fault = EquationFault::Value(
                    "this event does not depend on a state, so that no motion brings it about".to_owned(),
                );
                return Err(text.error(&(0..entry.text.len()), fault));
            }
            if names.iter().any(|named: &Named| *named.name == entry.name) {
                return Err(twice(entry, "an event"));
            }
            self.require_own_name(entry, measures)?;
            let text_of_unit = value.quantity.to_string();
            let unit = Unit::parse(&text_of_unit).unwrap_or(Unit::ONE);
            names.push(Named { name: entry.name.as_str().into(), unit, unit_text: text_of_unit.into() });
            nodes.push(value.node);
            equations.push((entry.name.clone(), DeviceEquation::Text(text)));
        }
        Ok((names, nodes))
    }
}

type Equations = Vec<(String, DeviceEquation)>;
type NamedNodes = (Vec<Named>, Vec<crate::graph::NodeId>);

fn place(key: &str) -> crate::description::TextPlace {
    crate::description::TextPlace { key: key.to_owned(), offset: None }
}

fn texts(entries: &[NamedText]) -> Result<Vec<Arc<ParsedText>>, EquationError> {
    entries.iter().map(ParsedText::read).collect()
}

pub(super) fn twice(entry: &NamedText, what: &str) -> EquationError {
    let why = format!("{what} of this name stands there already");
    EquationError::whole(&entry.place, "", EquationFault::Name { name: entry.name.clone(), why })
}

/// The unit behind `in`, which a follower states.
fn unit_of(of: &ParsedText) -> Result<NamedText, EquationError> {
    let Some((_, span)) = &of.tree.unit else {
        let fault = EquationFault::Missing(
            "what becomes a state states its unit; write it after `in`, such as `… in V`".to_owned(),
        );
        return Err(of.error(&(0..of.entry.text.len()), fault));
    };
    Ok(NamedText { text: of.word(span).to_owned(), ..of.entry.clone() })
}

/// The units of a curve's arguments and of its value.
fn units_of_curve(points: &CurvePoints) -> Result<Vec<UnitKnowledge>, EquationError> {
    let of = |unit: &String| match Unit::parse(unit) {
        Ok(unit) => Ok(UnitKnowledge::Exact(unit.dimension())),
        Err(fault) => Err(EquationError::whole(&points.place, unit, fault.into())),
    };
    let all = [&points.x_unit, &points.y_unit, &points.z_unit];
    all.into_iter().take(if points.z.is_empty() { 2 } else { 3 }).map(of).collect()
}

/// The text of each state's rate, in the order of the states.
fn own_rates(description: &Description) -> Result<Vec<RateOf>, EquationError> {
    let is_state = |name: &str| description.states.iter().any(|state| state.name == name);
    for (index, entry) in description.derivative.iter().enumerate() {
        if !is_state(&entry.name) {
            let suggestion = nearest(&entry.name, description.states.iter().map(|state| state.name.as_str()));
            let what = "a state, whose rate would stand here";
            let fault = EquationFault::Unknown { name: entry.name.clone(), what, suggestion };
            return Err(EquationError::whole(&entry.place, "", fault));
        }
        if description.derivative.iter().take(index).any(|before| before.name == entry.name) {
            return Err(twice(entry, "a rate"));
        }
    }
    let mut rates = Vec::new();
    for state in &description.states {
        let Some(entry) = description.derivative.iter().find(|entry| entry.name == state.name) else {
            let why = format!("the state `{0}` has no rate; add `{0} = \"…\"` to `[derivative]`", state.name);
            return Err(EquationError::whole(&state.place, "", EquationFault::Missing(why)));
        };
        rates.push(RateOf::Text(ParsedText::read(entry)?));
    }
    Ok(rates)
}

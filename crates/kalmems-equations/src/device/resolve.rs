//! From texts to the graph: names are looked up, functions inserted, units checked.

use super::names::{DescriptionNames, Meaning, ParsedText, is_of_the_language};
use super::turns::{ANGULAR_RATE, TurnMistake};
use super::{DeviceEquation, InputRate};
use crate::description::NamedText;
use crate::error::{EquationError, EquationFault, EquationNotice};
use crate::graph::{Graph, GraphLimit, NodeId, Variable};
use crate::limits::{DEEPEST_DEFINITION, LARGEST_POWER, MOST_NODES, MOST_NOTICES, MOST_TERMS};
use crate::quantity::UnitKnowledge;
use crate::syntax::TermForm;
use kalmems_units::{Dimension, Unit};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// An expression in the graph, and what is known of its unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ResolvedValue {
    pub(crate) node: NodeId,
    pub(crate) quantity: UnitKnowledge,
    /// Whether it is made of frequencies in Hz, which are cycles per second, without a factor π.
    pub(crate) in_cycles: bool,
    /// Whether π is a factor of it.
    pub(crate) has_pi: bool,
    /// Whether a rate in rad/s is a factor of it.
    pub(crate) in_radians: bool,
    /// What is wrong with the factor 2π of a part of it.
    pub(crate) turn: Option<TurnMistake>,
}

impl ResolvedValue {
    pub(crate) fn new(node: NodeId, quantity: UnitKnowledge) -> Self {
        Self { node, quantity, in_cycles: false, has_pi: false, in_radians: false, turn: None }
    }
}

/// A definition that others refer to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum DefinitionSlot {
    Open,
    Busy,
    Done(ResolvedValue),
}

/// A quantity that is given from outside.
#[derive(Clone, Debug)]
pub(crate) struct ExternalQuantity {
    pub(crate) unit: Unit,
    /// Whether it is written in Hz.
    pub(crate) in_cycles: bool,
}

impl ExternalQuantity {
    pub(crate) fn of(unit: Unit, text: &str) -> Self {
        let per_second = Dimension::of([0, 0, -1, 0, 0, 0]);
        Self { unit, in_cycles: unit.dimension() == per_second && text.contains("Hz") }
    }
}

/// A delay that states stand for.
#[derive(Clone, Debug)]
pub(crate) struct DelayExpansion {
    pub(crate) of: Arc<ParsedText>,
    pub(crate) time: Arc<ParsedText>,
    /// The first of its states.
    pub(crate) state: usize,
    pub(crate) order: u8,
}

/// What gives the rate of a state.
#[derive(Clone, Debug)]
pub(crate) enum RateOf {
    Text(Arc<ParsedText>),
    /// Of a lag.
    Lag(DelayExpansion),
    /// Of the first or the second state of a delay.
    Delay(DelayExpansion, u8),
}

pub(crate) struct Resolver {
    pub(crate) graph: Graph,
    pub(crate) names: DescriptionNames,
    /// States, inputs and parameters.
    pub(crate) given: [Vec<ExternalQuantity>; 3],
    pub(crate) lets: Vec<(Arc<ParsedText>, DefinitionSlot)>,
    pub(crate) delays: Vec<(DelayExpansion, DefinitionSlot)>,
    pub(crate) rates: Vec<(RateOf, DefinitionSlot)>,
    /// The inputs whose rates some expression needs, in the order in which these stand behind the stated inputs.
    pub(crate) input_rates: Vec<InputRate>,
    /// The units of each curve's arguments and of its value.
    pub(crate) curves: Vec<Vec<UnitKnowledge>>,
    /// The parameters that are written without a unit.
    pub(super) plain: Vec<Option<NamedText>>,
    pub(crate) notices: Vec<EquationNotice>,
    /// What is being resolved, the last one within those before it.
    pub(crate) busy: Vec<String>,
    pub(crate) terms_read: usize,
    /// The functions that were inserted, by their headers.
    pub(crate) used: BTreeMap<String, DeviceEquation>,
}

/// The values that the arguments of a function have.
pub(super) type ArgumentValues = Vec<(String, ResolvedValue)>;
pub(super) type Resolved = Result<ResolvedValue, EquationError>;

/// Says how far the definition at this place of a list is.
fn set<T>(definitions: &mut [(T, DefinitionSlot)], place: usize, slot: DefinitionSlot) {
    if let Some((_, own)) = definitions.get_mut(place) {
        *own = slot;
    }
}

impl Resolver {
    /// A text that stands alone.
    pub(crate) fn value(&mut self, text: &Arc<ParsedText>) -> Resolved {
        self.evaluate(text, &Vec::new())
    }

    /// The rate of a state.
    pub(crate) fn rate(&mut self, state: usize) -> Resolved {
        let begun = |of: &RateOf| match of {
            RateOf::Text(text) => (text.clone(), format!("rate of {}", text.entry.name)),
            RateOf::Lag(expansion) | RateOf::Delay(expansion, _) => {
                (expansion.of.clone(), format!("the rate of state {}", state + 1))
            }
        };
        self.defined(
            |own| &mut own.rates,
            (state, begun),
            |own, of| match of {
                RateOf::Text(text) => own.value(text),
                RateOf::Lag(expansion) => own.rate_of_lag(state, expansion),
                RateOf::Delay(expansion, which) => own.rate_of_delay(expansion, *which),
            },
        )
    }

    /// A named expression.
    pub(crate) fn named(&mut self, index: usize) -> Resolved {
        let begun = |text: &Arc<ParsedText>| (text.clone(), text.entry.name.clone());
        self.defined(|own| &mut own.lets, (index, begun), Self::value)
    }

    /// An expression a while ago.
    pub(crate) fn delayed(&mut self, index: usize) -> Resolved {
        let begun = |expansion: &DelayExpansion| (expansion.of.clone(), expansion.of.entry.name.clone());
        self.defined(|own| &mut own.delays, (index, begun), Self::output_of_delay)
    }

    /// The value of the definition at this place of a list, which is resolved where that has not been done. `begun` says of a
    /// definition where it stands and what a message calls it.
    fn defined<D: Clone>(
        &mut self,
        list: fn(&mut Self) -> &mut Vec<(D, DefinitionSlot)>,
        (place, begun): (usize, impl Fn(&D) -> (Arc<ParsedText>, String)),
        resolve: impl Fn(&mut Self, &D) -> Resolved,
    ) -> Resolved {
        let Some((definition, slot)) = list(self).get(place).cloned() else {
            return Ok(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any));
        };
        if let DefinitionSlot::Done(value) = slot {
            return Ok(value);
        }
        let (text, label) = begun(&definition);
        self.begin(&text, label, matches!(slot, DefinitionSlot::Busy))?;
        set(list(self), place, DefinitionSlot::Busy);
        let value = resolve(self, &definition)?;
        set(list(self), place, DefinitionSlot::Done(value));
        self.busy.pop();
        Ok(value)
    }

    /// Notes that a definition is being resolved; refuses one that is already, and too many.
    pub(super) fn begin(
        &mut self,
        text: &ParsedText,
        label: String,
        is_busy: bool,
    ) -> Result<(), EquationError> {
        let whole = 0..text.entry.text.len();
        if is_busy {
            let from = self.busy.iter().position(|other| *other == label).unwrap_or_default();
            let mut path: Vec<&str> = self.busy.iter().skip(from).map(String::as_str).collect();
            path.push(&label);
            return Err(text.error(&whole, EquationFault::Cycle(path.join(" -> "))));
        }
        if self.busy.len() >= DEEPEST_DEFINITION {
            let what = "definitions that wait for one another";
            return Err(text.error(&whole, EquationFault::TooLarge { what, limit: DEEPEST_DEFINITION }));
        }
        self.busy.push(label);
        Ok(())
    }

    pub(crate) fn variable(&mut self, variable: Variable) -> ResolvedValue {
        let (kind, index) = match variable {
            Variable::State(index) => (0, index),
            Variable::Input(index) => (1, index),
            Variable::Parameter(index) => (2, index),
        };
        let given = self.given.get(kind).and_then(|given| given.get(index));
        let dimension = given.map_or(Dimension::NONE, |given| given.unit.dimension());
        let in_cycles = given.is_some_and(|given| given.in_cycles);
        let node = self.graph.variable(variable);
        let turn = in_cycles.then_some(TurnMistake::MissingTwoPi);
        let in_radians = dimension == ANGULAR_RATE;
        ResolvedValue {
            in_cycles,
            in_radians,
            turn,
            ..ResolvedValue::new(node, UnitKnowledge::Exact(dimension))
        }
    }

    /// A text with the values of a function's arguments.
    pub(super) fn evaluate(&mut self, text: &Arc<ParsedText>, arguments: &ArgumentValues) -> Resolved {
        let mut values: Vec<ResolvedValue> = Vec::with_capacity(text.tree.terms.len());
        for term in &text.tree.terms {
            self.terms_read += 1;
            if self.terms_read > MOST_TERMS {
                let fault = EquationFault::TooLarge { what: "terms", limit: MOST_TERMS };
                return Err(text.error(&term.span, fault));
            }
            let value = self.term(text, arguments, &values, &term.form, &term.span)?;
            if let Some(stop) = self.graph.take_stop() {
                return Err(text.error(&term.span, fault_of(stop)));
            }
            if self.graph.number(value.node).is_some_and(|number| !number.is_finite()) {
                return Err(text.error(&term.span, EquationFault::NotFinite));
            }
            values.push(value);
        }
        let mut value = values.last().copied().unwrap_or(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any));
        if let Some((unit, span)) = &text.tree.unit {
            let wanted = UnitKnowledge::Exact(unit.dimension());
            if value.quantity.plus(wanted).is_none() {
                let root = text.tree.terms.last().map_or(0..0, |term| term.span.clone());
                let because = "stands after `in`".to_owned();
                let expected = text.word(span).to_owned();
                let error = text.error(&root, unlike("this", value.quantity, expected, because));
                return Err(
                    self.with_plain_parameters(error, [(value.node, value.quantity), (Graph::ZERO, wanted)])
                );
            }
            value.quantity = wanted;
        }
        Ok(value)
    }

    fn term(
        &mut self,
        text: &Arc<ParsedText>,
        arguments: &ArgumentValues,
        values: &[ResolvedValue],
        form: &TermForm,
        span: &Range<usize>,
    ) -> Resolved {
        let of = |id: &usize| {
            values.get(*id).copied().unwrap_or(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any))
        };
        match form {
            TermForm::Number(number, unit) => {
                let node = self.graph.literal(*number);
                let written = unit.map(|unit| ExternalQuantity::of(unit, text.word(span)));
                let in_cycles = written.is_some_and(|written| written.in_cycles);
                let turn = in_cycles.then_some(TurnMistake::MissingTwoPi);
                let quantity = match unit {
                    Some(unit) => UnitKnowledge::Exact(unit.dimension()),
                    None if *number == 0.0 => UnitKnowledge::Any,
                    None => UnitKnowledge::PLAIN,
                };
                Ok(ResolvedValue { in_cycles, turn, ..ResolvedValue::new(node, quantity) })
            }
            TermForm::Name(name) => self.name(text, arguments, name),
            TermForm::Negative(inner) => {
                let value = of(inner);
                Ok(ResolvedValue { node: self.graph.scaled(-1.0, value.node), ..value })
            }
            TermForm::Sum(parts) => {
                let parts: Vec<_> = parts.iter().map(|(minus, id)| (*minus, of(id), *id)).collect();
                self.sum(text, &parts)
            }
            TermForm::Product(parts) => {
                let parts: Vec<_> = parts.iter().map(|(over, id)| (*over, of(id))).collect();
                self.product(text, span, &parts)
            }
            TermForm::Power(base, exponent) => self.power(text, span, (of(base), of(exponent)), *exponent),
            TermForm::Comparison { smaller, larger } => {
                self.alike(text, (of(smaller), *smaller), (of(larger), *larger))?;
                Ok(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any))
            }
            TermForm::All(_) | TermForm::Any(_) | TermForm::Not(_) => {
                Ok(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any))
            }
            TermForm::Choice { condition, then, otherwise } => {
                let quantity = self.alike(text, (of(then), *then), (of(otherwise), *otherwise))?;
                let branches = [of(then).node, of(otherwise).node];
                let node = self.chosen(text, &|id| of(id).node, *condition, branches);
                self.notice_kink(text, span, "if", node);
                let in_cycles = of(then).in_cycles && of(otherwise).in_cycles;
                let turn = TurnMistake::of_sum([of(then), of(otherwise)].into_iter());
                Ok(ResolvedValue { in_cycles, turn, ..ResolvedValue::new(node, quantity) })
            }
            TermForm::Call(name, of_call) => {
                let parts: Vec<_> = of_call.iter().map(|id| (of(id), *id)).collect();
                self.call(text, (name, span), &parts)
            }
            TermForm::Partial { of: inner, by } => self.partial(text, arguments, of(inner), by),
            TermForm::Rate { of: inner } => self.total(text, span, of(inner)),
        }
    }

    fn name(&mut self, text: &ParsedText, arguments: &ArgumentValues, span: &Range<usize>) -> Resolved {
        let name = text.word(span);
        if let Some((_, value)) = arguments.iter().find(|(argument, _)| argument == name) {
            return Ok(*value);
        }
        if name == "pi" {
            let node = self.graph.literal(std::f64::consts::PI);
            return Ok(ResolvedValue { has_pi: true, ..ResolvedValue::new(node, UnitKnowledge::PLAIN) });
        }
        match self.names.get(name).cloned() {
            Some(Meaning::State(index)) => Ok(self.variable(Variable::State(index))),
            Some(Meaning::Input(index)) => Ok(self.variable(Variable::Input(index))),
            Some(Meaning::Parameter(index)) => Ok(self.variable(Variable::Parameter(index))),
            Some(Meaning::Let(index)) => self.named(index),
            Some(Meaning::Delay(index)) => self.delayed(index),
            Some(meaning) => {
                let expected = format!("write it with its arguments, such as `{name}(…)`");
                Err(text
                    .error(span, EquationFault::Use { name: name.to_owned(), is: meaning.words(), expected }))
            }
            None if is_of_the_language(name) => {
                let expected = format!("write it with its arguments, such as `{name}(…)`");
                Err(text
                    .error(span, EquationFault::Use { name: name.to_owned(), is: "a function", expected }))
            }
            None => Err(text.error(span, self.names.unknown(name, false))),
        }
    }

    /// Says that a slope jumps, where that is seen in the motion.
    pub(crate) fn notice_kink(
        &mut self,
        text: &ParsedText,
        span: &Range<usize>,
        function: &str,
        node: NodeId,
    ) {
        self.notice_jump(text, span, (function, "has a kink where its comparison changes sides"), node);
    }

    /// Says where a function is not smooth, if that is seen in the motion.
    pub(crate) fn notice_jump(
        &mut self,
        text: &ParsedText,
        span: &Range<usize>,
        (function, place): (&str, &str),
        node: NodeId,
    ) {
        let known = |notice: &EquationNotice| notice.span == *span && notice.place == text.entry.place;
        if self.notices.len() >= MOST_NOTICES || self.notices.iter().any(known) {
            return;
        }
        let by_state = |variable: &Variable| matches!(variable, Variable::State(_));
        if self.graph.variables(node).iter().any(by_state) {
            let message = format!("`{function}` {place}; filters take the slope of the side that holds");
            self.notice(text, span, message);
        }
    }

    pub(crate) fn notice(&mut self, text: &ParsedText, span: &Range<usize>, message: String) {
        let NamedText { place, text, .. } = text.entry.clone();
        let notice = EquationNotice { place, text, span: span.clone(), message };
        if self.notices.len() < MOST_NOTICES && !self.notices.contains(&notice) {
            self.notices.push(notice);
        }
    }
}

pub(crate) fn unlike(what: &str, found: UnitKnowledge, expected: String, because: String) -> EquationFault {
    EquationFault::Unlike { what: what.to_owned(), found: found.to_string(), expected, because }
}

/// What stopped the graph, in words.
pub(crate) fn fault_of(stop: GraphLimit) -> EquationFault {
    match stop {
        GraphLimit::TooLarge => EquationFault::TooLarge { what: "parts", limit: MOST_NODES },
        GraphLimit::Power => {
            EquationFault::Value(format!("a power is beyond {LARGEST_POWER}; expected a smaller one"))
        }
        GraphLimit::Order { function, order, limit } => EquationFault::Order { function, order, limit },
    }
}

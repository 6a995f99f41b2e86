//! Derivatives within expressions, and formulas that are inserted.

use super::names::{Formula, Meaning, ParsedText};
use super::resolve::{ArgumentValues, ExternalQuantity, Resolved, ResolvedValue, Resolver};
use super::{DeviceEquation, InputRate, Named};
use crate::error::{EquationError, EquationFault};
use crate::graph::{Graph, NodeId, Variable};
use crate::quantity::UnitKnowledge;
use kalmems_units::{Dimension, Unit};
use std::ops::Range;
use std::sync::Arc;

impl Resolver {
    /// The variable that a derivative is taken by.
    pub(super) fn partial(
        &mut self,
        text: &ParsedText,
        arguments: &ArgumentValues,
        of: ResolvedValue,
        by: &Range<usize>,
    ) -> Resolved {
        let name = text.word(by);
        let bound = arguments.iter().find(|(argument, _)| argument == name).map(|(_, value)| value.node);
        let variable = match (bound, self.names.get(name)) {
            (Some(node), _) => self.graph.as_variable(node),
            (None, Some(Meaning::State(index))) => Some(Variable::State(*index)),
            (None, Some(Meaning::Input(index))) => Some(Variable::Input(*index)),
            (None, Some(Meaning::Parameter(index))) => Some(Variable::Parameter(*index)),
            (None, None) => return Err(text.error(by, self.names.unknown(name, false))),
            (None, Some(_)) => None,
        };
        let Some(variable) = variable else {
            let is = match (bound, self.names.get(name)) {
                (None, Some(meaning)) => meaning.words(),
                _ => "an argument that stands for an expression",
            };
            let expected = "a derivative is taken by a state, an input or a parameter".to_owned();
            return Err(text.error(by, EquationFault::Use { name: name.to_owned(), is, expected }));
        };
        let by_quantity = self.variable(variable).quantity;
        let node = self.graph.derivative(of.node, variable);
        let quantity = of.quantity.over(by_quantity).unwrap_or(UnitKnowledge::Any);
        Ok(ResolvedValue::new(node, quantity))
    }

    /// The total derivative along the motion.
    pub(super) fn total(&mut self, text: &ParsedText, span: &Range<usize>, of: ResolvedValue) -> Resolved {
        let mut parts = Vec::new();
        for variable in self.graph.variables(of.node) {
            match variable {
                Variable::Parameter(_) => {}
                Variable::State(state) => {
                    let slope = self.graph.derivative(of.node, variable);
                    if slope != Graph::ZERO {
                        let rate = self.rate(state)?.node;
                        parts.push((self.graph.product(&[(slope, 1), (rate, 1)]), 1.0));
                    }
                }
                Variable::Input(input) => {
                    let slope = self.graph.derivative(of.node, variable);
                    if slope != Graph::ZERO {
                        let rate = self.rate_of_input(text, span, input)?;
                        parts.push((self.graph.product(&[(slope, 1), (rate, 1)]), 1.0));
                    }
                }
            }
        }
        let second = UnitKnowledge::Exact(Dimension::of([0, 0, 1, 0, 0, 0]));
        let quantity = of.quantity.over(second).unwrap_or(UnitKnowledge::Any);
        Ok(ResolvedValue::new(self.graph.sum(0.0, &parts), quantity))
    }

    /// The rate of an input: an input of its own behind the stated ones, which whoever knows the input's samples finds from them.
    fn rate_of_input(
        &mut self,
        text: &ParsedText,
        span: &Range<usize>,
        input: usize,
    ) -> Result<NodeId, EquationError> {
        let name = self.names.of_input(input);
        let [_, inputs, _] = &mut self.given;
        let stated = inputs.len() - self.input_rates.len();
        if let Some(rate) = input.checked_sub(stated).and_then(|place| self.input_rates.get(place)) {
            let input = self.names.of_input(rate.of);
            return Err(text.error(span, EquationFault::RateOfRate { input }));
        }
        let known = self.input_rates.iter().position(|rate| rate.of == input);
        let place = known.unwrap_or(self.input_rates.len());
        if known.is_none() {
            let dimension = inputs.get(input).map_or(Dimension::NONE, |given| given.unit.dimension());
            let unit_text = dimension.times(Dimension::of([0, 0, -1, 0, 0, 0])).to_string();
            let unit = Unit::parse(&unit_text).unwrap_or(Unit::ONE);
            inputs.push(ExternalQuantity::of(unit, ""));
            let name = format!("{name}_rate");
            if let Some(other) = self.names.get(&name) {
                let why = format!(
                    "it is {}, and `ddt` here needs the name for the rate of the input; take another one",
                    other.words()
                );
                return Err(text.error(span, EquationFault::Name { name, why }));
            }
            let named = Named { name: name.into(), unit, unit_text: unit_text.into() };
            self.input_rates.push(InputRate { of: input, named });
        }
        Ok(self.graph.variable(Variable::Input(stated + place)))
    }

    /// A formula with its arguments inserted.
    pub(crate) fn insert(
        &mut self,
        text: &ParsedText,
        call: (&Range<usize>, &Range<usize>),
        formula: &Arc<Formula>,
        found: &[ResolvedValue],
    ) -> Resolved {
        let name = text.word(call.0).to_owned();
        if found.len() != formula.arguments.len() {
            let (found, expected) = (found.len(), formula.arguments.len());
            return Err(text.error(call.1, EquationFault::Arguments { function: name, found, expected }));
        }
        self.begin(text, format!("{name}(…)"), self.busy.contains(&format!("{name}(…)")))?;
        let bound = formula.arguments.iter().cloned().zip(found.iter().copied()).collect();
        let value = self
            .evaluate(&formula.text, &bound)
            .map_err(|error| error.met_in(format!("in `{}` of {}", text.word(call.1), text.entry.place)))?;
        self.busy.pop();
        self.used.insert(formula.text.entry.name.clone(), DeviceEquation::Text(formula.text.clone()));
        Ok(value)
    }
}

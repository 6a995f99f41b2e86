//! Noises, and what is made of numbers and parameters alone: periods.

use super::names::ParsedText;
use super::read::{ReadResult, SECOND, twice};
use super::resolve::{ResolvedValue, unlike};
use super::{Named, Noise, NoiseKind};
use crate::error::{EquationError, EquationFault, nearest};
use crate::graph::{NodeId, Variable};
use crate::quantity::UnitKnowledge;
use kalmems_units::Unit;

impl ReadResult<'_> {
    pub(super) fn noise(
        &mut self,
        measures: &[Named],
        events: &[Named],
    ) -> Result<Vec<Noise>, EquationError> {
        let mut noise: Vec<Noise> = Vec::new();
        for entry in &self.description.noise {
            let text = ParsedText::read(entry)?;
            let whole = 0..entry.text.len();
            let value = self.resolver.value(&text)?;
            let state = self.states.iter().position(|named| *named.name == entry.name);
            let measure = measures.iter().position(|named| *named.name == entry.name);
            let square = |unit: Unit| UnitKnowledge::Exact(unit.dimension()).to_half_power(4);
            let per_second = |quantity: UnitKnowledge| quantity.over(UnitKnowledge::Exact(SECOND));
            let event = events.iter().position(|named| *named.name == entry.name);
            let refused = |wanted: UnitKnowledge, because: String| {
                text.error(&whole, unlike("this", value.quantity, wanted.to_string(), because))
            };
            let kind = match (state, measure, event) {
                (Some(state), ..) => {
                    let unit = self.states.get(state).map_or(Unit::ONE, |named| named.unit);
                    // Of the rate: (unit/s)² per Hz.
                    let wanted = square(unit).and_then(per_second).unwrap_or(UnitKnowledge::Any);
                    if wanted.plus(value.quantity).is_none() {
                        let because = format!("the power density of the rate of `{}` has", entry.name);
                        return Err(refused(wanted, because));
                    }
                    NoiseKind::Rate { state }
                }
                (None, Some(measure), _) => {
                    let unit = measures.get(measure).map_or(Unit::ONE, |named| named.unit);
                    let variance = square(unit).unwrap_or(UnitKnowledge::Any);
                    let density = variance.times(UnitKnowledge::Exact(SECOND));
                    if variance.plus(value.quantity).is_some() {
                        NoiseKind::Variance { measure }
                    } else if density.plus(value.quantity).is_some() {
                        NoiseKind::Density { measure }
                    } else {
                        let because = format!(
                            "a variance of one sample of `{}` has (or {density} as a density)",
                            entry.name
                        );
                        return Err(refused(variance, because));
                    }
                }
                (None, None, Some(event)) => {
                    let unit = events.get(event).map_or(Unit::ONE, |named| named.unit);
                    let variance = square(unit).unwrap_or(UnitKnowledge::Any);
                    let of_time = UnitKnowledge::Exact(SECOND).to_half_power(4).unwrap_or(UnitKnowledge::Any);
                    if of_time.plus(value.quantity).is_some() {
                        NoiseKind::EventTime { event }
                    } else if variance.plus(value.quantity).is_some() {
                        NoiseKind::Event { event }
                    } else {
                        let because = format!(
                            "the variance of the time of `{}` has (or {variance} as one of its expression)",
                            entry.name
                        );
                        return Err(refused(of_time, because));
                    }
                }
                (None, None, None) => {
                    let known = self.states.iter().chain(measures).chain(events).map(|named| &*named.name);
                    let suggestion = nearest(&entry.name, known);
                    let what = "a state, a measurement or an event, which a noise is of";
                    let fault = EquationFault::Unknown { name: entry.name.clone(), what, suggestion };
                    return Err(EquationError::whole(&entry.place, "", fault));
                }
            };
            if noise.iter().any(|other| other.kind == kind) {
                return Err(twice(entry, "a noise"));
            }
            let varies = !self.is_of_parameters_alone(value);
            if varies && matches!(kind, NoiseKind::EventTime { .. } | NoiseKind::Event { .. }) {
                self.of_parameters_alone(&text, value, "the noise of an event")?;
            }
            noise.push(Noise { kind, node: value.node, varies });
        }
        Ok(noise)
    }

    pub(super) fn periods(&mut self) -> Result<Vec<(usize, NodeId)>, EquationError> {
        let mut periods = Vec::new();
        for entry in &self.description.cyclic {
            let text = ParsedText::read(entry)?;
            let Some(state) = self.states.iter().position(|named| *named.name == entry.name) else {
                let suggestion = nearest(&entry.name, self.states.iter().map(|named| &*named.name));
                let what = "a state, which can be cyclic";
                let fault = EquationFault::Unknown { name: entry.name.clone(), what, suggestion };
                return Err(EquationError::whole(&entry.place, "", fault));
            };
            let value = self.resolver.value(&text)?;
            self.of_parameters_alone(&text, value, "a period")?;
            let unit = self.resolver.variable(Variable::State(state)).quantity;
            if unit.plus(value.quantity).is_none() {
                let because = format!("the state `{}` has", entry.name);
                let fault = unlike("this period", value.quantity, unit.to_string(), because);
                return Err(text.error(&(0..entry.text.len()), fault));
            }
            periods.push((state, value.node));
        }
        Ok(periods)
    }

    fn is_of_parameters_alone(&mut self, value: ResolvedValue) -> bool {
        let is_parameter = |variable: &Variable| matches!(variable, Variable::Parameter(_));
        self.resolver.graph.variables(value.node).iter().all(is_parameter)
    }

    fn of_parameters_alone(
        &mut self,
        text: &ParsedText,
        value: ResolvedValue,
        what: &str,
    ) -> Result<(), EquationError> {
        if self.is_of_parameters_alone(value) {
            return Ok(());
        }
        let fault = EquationFault::Value(format!(
            "{what} is made of numbers and parameters alone; this depends on a state or an input"
        ));
        Err(text.error(&(0..text.entry.text.len()), fault))
    }
}

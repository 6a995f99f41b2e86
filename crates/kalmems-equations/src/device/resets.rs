//! Resets: what passes zero, and what the states are then.

use super::DeviceEquation;
use super::names::ParsedText;
use super::read::{ReadResult, twice};
use super::resolve::unlike;
use crate::description::ResetText;
use crate::error::{EquationError, EquationFault, nearest};
use crate::graph::{NodeId, Variable};
use crate::resets::{CrossingDirection, DeviceReset};
use std::sync::Arc;

impl ReadResult<'_> {
    pub(super) fn resets(
        &mut self,
        equations: &mut Vec<(String, DeviceEquation)>,
    ) -> Result<Vec<DeviceReset>, EquationError> {
        let mut all = Vec::new();
        for entry in &self.description.when {
            let (passing, crossing) = passing(entry)?;
            let text = ParsedText::read(crossing)?;
            let node = self.resolver.value(&text)?.node;
            self.require_states(&text, node, "what a reset waits for")?;
            let by_state = |variable: &Variable| matches!(variable, Variable::State(_));
            if !self.resolver.graph.variables(node).iter().any(by_state) {
                let why = "this does not depend on a state, so that no motion makes it pass zero".to_owned();
                return Err(text.error(&(0..text.entry.text.len()), EquationFault::Value(why)));
            }
            equations.push((format!("{}: 0", entry.name), DeviceEquation::Text(text)));
            let set = self.set_states(entry, equations)?;
            all.push(DeviceReset { passing, crossing: node, set });
        }
        Ok(all)
    }

    fn set_states(
        &mut self,
        entry: &ResetText,
        equations: &mut Vec<(String, DeviceEquation)>,
    ) -> Result<Vec<(usize, NodeId)>, EquationError> {
        let mut set: Vec<(usize, NodeId)> = Vec::new();
        for entry_of_state in &entry.set {
            let text = ParsedText::read(entry_of_state)?;
            let name = &entry_of_state.name;
            let Some(state) = self.states.iter().position(|named| *named.name == *name) else {
                let suggestion = nearest(name, self.states.iter().map(|named| &*named.name));
                let what = "a state, which a reset sets";
                let fault = EquationFault::Unknown { name: name.clone(), what, suggestion };
                return Err(EquationError::whole(&entry_of_state.place, "", fault));
            };
            if set.iter().any(|(other, _)| *other == state) {
                return Err(twice(entry_of_state, "what a state is set to"));
            }
            let value = self.resolver.value(&text)?;
            self.require_states(&text, value.node, "what a state is set to")?;
            let unit = self.resolver.variable(Variable::State(state)).quantity;
            if unit.plus(value.quantity).is_none() {
                let because = format!("the state `{name}` has");
                let fault = unlike("this", value.quantity, unit.to_string(), because);
                return Err(text.error(&(0..text.entry.text.len()), fault));
            }
            set.push((state, value.node));
            equations.push((format!("{}: {name}⁺", entry.name), DeviceEquation::Text(text)));
        }
        if set.is_empty() {
            let why =
                format!("the reset `{0}` sets no state; write such as `set = {{ v = \"-v\" }}`", entry.name);
            return Err(EquationError::whole(&entry.place, "", EquationFault::Missing(why)));
        }
        Ok(set)
    }

    /// Refuses what depends on an input: when that passes zero is not a matter of the motion alone.
    fn require_states(
        &mut self,
        text: &Arc<ParsedText>,
        node: NodeId,
        what: &str,
    ) -> Result<(), EquationError> {
        let by_input = |variable: &Variable| matches!(variable, Variable::Input(_));
        if !self.resolver.graph.variables(node).iter().any(by_input) {
            return Ok(());
        }
        let why = format!("{what} is made of states and parameters; this depends on an input as well");
        Err(text.error(&(0..text.entry.text.len()), EquationFault::Value(why)))
    }
}

/// What passes zero, and which way.
fn passing(entry: &ResetText) -> Result<(CrossingDirection, &crate::description::NamedText), EquationError> {
    let ways = [
        (CrossingDirection::Rising, &entry.rises),
        (CrossingDirection::Falling, &entry.falls),
        (CrossingDirection::Either, &entry.crosses),
    ];
    let mut stated = ways.into_iter().filter_map(|(passing, text)| Some((passing, text.as_ref()?)));
    if let (Some(one), None) = (stated.next(), stated.next()) {
        return Ok(one);
    }
    let why = "write one of `rises`, `falls` and `crosses`: the expression that passes zero where it happens";
    Err(EquationError::whole(&entry.place, "", EquationFault::Missing(why.to_owned())))
}

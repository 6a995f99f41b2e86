//! Lags and delays as states.
//!
//! A lag is exactly one pole. A delay by τ is Padé's approximation of e^{−sτ} of the order n, numerator and denominator: its
//! gain is 1 at every frequency, and its phase is late by ωτ but for (ωτ)³/12 of the first order and (ωτ)⁵/720 of the
//! second. In the form that is used here no derivative of what is delayed is needed.

use super::names::ParsedText;
use super::resolve::{DelayExpansion, Resolved, ResolvedValue, Resolver, unlike};
use crate::graph::{NodeId, Variable};
use crate::quantity::UnitKnowledge;
use kalmems_units::Dimension;
use std::sync::Arc;

const SECOND: Dimension = Dimension::of([0, 0, 1, 0, 0, 0]);

impl Resolver {
    /// (u − x)/τ.
    pub(crate) fn rate_of_lag(&mut self, state: usize, expansion: &DelayExpansion) -> Resolved {
        let followed = self.value(&expansion.of)?;
        let time = self.time(&expansion.time)?;
        let own = self.variable(Variable::State(state));
        let difference = self.graph.sum(0.0, &[(followed.node, 1.0), (own.node, -1.0)]);
        let node = self.graph.product(&[(difference, 1), (time.node, -1)]);
        Ok(per_second(node, own))
    }

    /// Of the first order, v′ = 2·(u − v)/τ. Of the second, v′ = w/τ and w′ = 12·(u − v − w/2)/τ.
    pub(crate) fn rate_of_delay(&mut self, expansion: &DelayExpansion, which: u8) -> Resolved {
        let time = self.time(&expansion.time)?;
        let first = self.variable(Variable::State(expansion.state));
        let node = if expansion.order == 1 {
            let followed = self.value(&expansion.of)?;
            self.graph.sum(0.0, &[(followed.node, 2.0), (first.node, -2.0)])
        } else {
            let second = self.variable(Variable::State(expansion.state + 1)).node;
            if which == 0 {
                second
            } else {
                let followed = self.value(&expansion.of)?;
                self.graph.sum(0.0, &[(followed.node, 12.0), (first.node, -12.0), (second, -6.0)])
            }
        };
        let node = self.graph.product(&[(node, 1), (time.node, -1)]);
        Ok(per_second(node, first))
    }

    /// 2·v − u of the first order, u − w of the second.
    pub(crate) fn output_of_delay(&mut self, expansion: &DelayExpansion) -> Resolved {
        let followed = self.value(&expansion.of)?;
        let node = if expansion.order == 1 {
            let state = self.variable(Variable::State(expansion.state)).node;
            self.graph.sum(0.0, &[(state, 2.0), (followed.node, -1.0)])
        } else {
            let state = self.variable(Variable::State(expansion.state + 1)).node;
            self.graph.sum(0.0, &[(followed.node, 1.0), (state, -1.0)])
        };
        Ok(ResolvedValue::new(node, followed.quantity))
    }

    /// A time constant, in s.
    fn time(&mut self, text: &Arc<ParsedText>) -> Resolved {
        let time = self.value(text)?;
        if time.quantity.plus(UnitKnowledge::Exact(SECOND)).is_none() {
            let because = "a time constant has".to_owned();
            let fault = unlike("this", time.quantity, "s".to_owned(), because);
            return Err(text.error(&(0..text.entry.text.len()), fault));
        }
        Ok(time)
    }
}

/// The rate of a state.
fn per_second(node: NodeId, state: ResolvedValue) -> ResolvedValue {
    let quantity = state.quantity.over(UnitKnowledge::Exact(SECOND)).unwrap_or(UnitKnowledge::Any);
    ResolvedValue::new(node, quantity)
}

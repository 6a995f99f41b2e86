//! Parameters that are written as plain numbers, where units do not fit.

use super::resolve::Resolver;
use crate::error::{EquationError, EquationFault};
use crate::graph::{ConstantBits, Graph, Node, NodeId, Variable};
use crate::quantity::UnitKnowledge;

impl Resolver {
    /// An error about two units that differ, with the parameters without a unit in either expression: their places, and the unit that would make
    /// the two agree.
    pub(super) fn with_plain_parameters(
        &mut self,
        mut error: EquationError,
        sides: [(NodeId, UnitKnowledge); 2],
    ) -> EquationError {
        let [(left, of_left), (right, of_right)] = sides;
        for (node, found, wanted) in [(left, of_left, of_right), (right, of_right, of_left)] {
            for variable in self.graph.variables(node) {
                let Variable::Parameter(index) = variable else { continue };
                let Some(entry) = self.plain.get(index).cloned().flatten() else { continue };
                let unit = power_of(&self.graph, node, variable).and_then(|power| {
                    let missing =
                        wanted.over(found)?.dimension()?.without_angle().to_half_power(2 * power.signum())?;
                    (power.abs() == 1).then(|| format!("; with {missing} the units would agree"))
                });
                let why = format!("`{}` is written without a unit{}", entry.name, unit.unwrap_or_default());
                let at = EquationError::whole(&entry.place, &entry.text, EquationFault::Value(why));
                error = error.met_in(at.to_string());
            }
        }
        error
    }
}

/// The power in which a variable is a factor of an expression, if nothing else in it depends on the variable.
fn power_of(graph: &Graph, node: NodeId, variable: Variable) -> Option<i16> {
    let depends = |node: &NodeId| graph.depends(*node, |other| other == variable);
    let (mut node, mut power) = (node, 1_i32);
    loop {
        node = match graph.node(node) {
            Node::Variable(_) => return i16::try_from(power).ok(),
            Node::Sum { constant: ConstantBits::ZERO, terms } => match terms[..] {
                [(term, _)] => term,
                _ => return None,
            },
            Node::Product(factors) => {
                let mut of = factors.iter().filter(|(factor, _)| depends(factor));
                let ((factor, own), None) = (of.next()?, of.next()) else { return None };
                power = power.checked_mul(*own)?;
                *factor
            }
            _ => return None,
        };
    }
}

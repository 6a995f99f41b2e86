//! Operators and functions: what they do to the graph, and which units they take.

use super::DeviceEquation;
use super::names::{Meaning, ParsedText, is_of_the_language};
use super::resolve::{Resolved, ResolvedValue, Resolver, unlike};
use super::turns::TurnMistake;
use crate::error::{EquationError, EquationFault};
use crate::graph::{Function, Graph, NodeId};
use crate::laws;
use crate::quantity::{ANGLE, UnitKnowledge};
use crate::syntax::{TermForm, TermId};
use std::ops::Range;
use std::sync::Arc;

impl Resolver {
    /// A sum, of which each part is given with its sign and its place among the terms.
    pub(crate) fn sum(&mut self, text: &ParsedText, parts: &[(bool, ResolvedValue, usize)]) -> Resolved {
        let mut total = UnitKnowledge::Any;
        let mut first = None;
        for (_, value, id) in parts {
            // The part that the others are compared with is the first that has a unit of its own.
            let Some(sum) = total.plus(value.quantity) else {
                let because = format!("`{}` has", shown(text, first.unwrap_or(*id)));
                let what = format!("`{}`", shown(text, *id));
                let fault = unlike(&what, value.quantity, total.to_string(), because);
                let error = text.error(&span_of(text, *id), fault);
                let compared = parts.iter().find(|(_, _, id)| first == Some(*id));
                let other = compared.map_or(Graph::ZERO, |(_, value, _)| value.node);
                return Err(self.with_plain_parameters(error, [(value.node, value.quantity), (other, total)]));
            };
            if total == UnitKnowledge::Any && value.quantity != UnitKnowledge::Any {
                first = Some(*id);
            }
            total = sum;
        }
        let signed: Vec<_> =
            parts.iter().map(|(minus, value, _)| (value.node, if *minus { -1.0 } else { 1.0 })).collect();
        let node = self.graph.sum(0.0, &signed);
        let in_cycles =
            parts.iter().all(|(_, value, _)| value.in_cycles || value.quantity == UnitKnowledge::Any);
        let turn = TurnMistake::of_sum(parts.iter().map(|(_, value, _)| *value));
        Ok(ResolvedValue { in_cycles, turn, ..ResolvedValue::new(node, total) })
    }

    pub(crate) fn product(
        &mut self,
        text: &ParsedText,
        span: &Range<usize>,
        parts: &[(bool, ResolvedValue)],
    ) -> Resolved {
        let mut quantity = UnitKnowledge::PLAIN;
        for (over, value) in parts {
            quantity = if *over {
                if self.graph.number(value.node) == Some(0.0) {
                    return Err(text.error(span, EquationFault::NotFinite));
                }
                quantity.over(value.quantity).ok_or_else(|| text.error(span, EquationFault::NotFinite))?
            } else {
                quantity.times(value.quantity)
            };
        }
        let powers: Vec<_> =
            parts.iter().map(|(over, value)| (value.node, if *over { -1 } else { 1 })).collect();
        let node = self.graph.product(&powers);
        let has_pi = parts.iter().any(|(_, value)| value.has_pi);
        let in_cycles = !has_pi && parts.iter().any(|(over, value)| value.in_cycles && !over);
        let in_radians = parts.iter().any(|(over, value)| value.in_radians && !over);
        let turn = TurnMistake::of_product(parts, quantity.is_plain());
        Ok(ResolvedValue { node, quantity, in_cycles, has_pi, in_radians, turn })
    }

    pub(crate) fn power(
        &mut self,
        text: &ParsedText,
        span: &Range<usize>,
        (base, exponent): (ResolvedValue, ResolvedValue),
        exponent_id: usize,
    ) -> Resolved {
        if !exponent.quantity.is_plain() {
            let what = format!("the exponent `{}`", shown(text, exponent_id));
            let found = exponent.quantity.to_string();
            return Err(
                text.error(&span_of(text, exponent_id), EquationFault::NotPlain { what, found, remedy: "" })
            );
        }
        let number = self.graph.number(exponent.node);
        let halves = number.map(|number| 2.0 * number).filter(|h| h.fract() == 0.0 && h.abs() <= 2000.0);
        if let Some(halves) = halves {
            #[allow(clippy::cast_possible_truncation)] // bounded by the line above
            let halves = halves as i16;
            let quantity = base.quantity.to_half_power(halves).ok_or_else(|| {
                text.error(span, EquationFault::PowerOfUnit { found: base.quantity.to_string() })
            })?;
            let mut node = self.graph.product(&[(base.node, i32::from(halves.div_euclid(2)))]);
            if halves % 2 != 0 {
                let root = self.graph.call(Function::Sqrt, base.node);
                node = self.graph.product(&[(node, 1), (root, 1)]);
            }
            // What is below a fraction bar is a time.
            let turn = base.turn.filter(|_| halves > 0);
            let in_radians = base.in_radians && halves > 0;
            return Ok(ResolvedValue {
                has_pi: base.has_pi,
                in_radians,
                turn,
                ..ResolvedValue::new(node, quantity)
            });
        }
        if !base.quantity.is_plain() {
            return Err(text.error(span, EquationFault::PowerOfUnit { found: base.quantity.to_string() }));
        }
        let logarithm = self.graph.call(Function::Ln, base.node);
        let product = self.graph.product(&[(exponent.node, 1), (logarithm, 1)]);
        Ok(ResolvedValue::new(self.graph.call(Function::Exp, product), UnitKnowledge::PLAIN))
    }

    pub(crate) fn call(
        &mut self,
        text: &Arc<ParsedText>,
        call: (&Range<usize>, &Range<usize>),
        parts: &[(ResolvedValue, usize)],
    ) -> Resolved {
        let name = text.word(call.0).to_owned();
        let values: Vec<ResolvedValue> = parts.iter().map(|(value, _)| *value).collect();
        match self.names.get(&name).cloned() {
            Some(Meaning::Function(formula)) => return self.insert(text, call, &formula, &values),
            Some(Meaning::Curve(curve)) => return self.curve(text, call, curve, parts),
            Some(meaning) => {
                let expected = "write `*` for a product".to_owned();
                return Err(text.error(call.0, EquationFault::Use { name, is: meaning.words(), expected }));
            }
            None => {}
        }
        if let Some(law) = laws::of_name(&name) {
            return self.law(text, call, law, parts);
        }
        let counted = |expected: usize| {
            if parts.len() == expected {
                Ok(())
            } else {
                let fault = EquationFault::Arguments { function: name.clone(), found: parts.len(), expected };
                Err(text.error(call.1, fault))
            }
        };
        match (name.as_str(), parts) {
            ("hypot" | "atan2", [left, right]) => {
                let quantity = self.alike(text, *left, *right)?;
                let (a, b) = (left.0.node, right.0.node);
                if name == "atan2" {
                    let node = self.graph.angle(a, b);
                    let place =
                        "turns by 2*pi where its first argument changes its sign and its second is negative";
                    self.notice_jump(text, call.1, (&name, place), node);
                    return Ok(ResolvedValue::new(node, ANGLE));
                }
                let squares = [self.graph.product(&[(a, 2)]), self.graph.product(&[(b, 2)])];
                let square = self.graph.sum(0.0, &squares.map(|square| (square, 1.0)));
                Ok(ResolvedValue::new(self.graph.call(Function::Sqrt, square), quantity))
            }
            ("min" | "max", [left, right]) => {
                let quantity = self.alike(text, *left, *right)?;
                let (a, b) = (left.0.node, right.0.node);
                let (then, otherwise) = if name == "min" { (a, b) } else { (b, a) };
                let node = self.graph.choice(a, b, then, otherwise);
                self.notice_kink(text, call.1, &name, node);
                Ok(ResolvedValue {
                    in_cycles: left.0.in_cycles && right.0.in_cycles,
                    turn: TurnMistake::of_sum([left.0, right.0].into_iter()),
                    ..ResolvedValue::new(node, quantity)
                })
            }
            ("min" | "max" | "hypot" | "atan2", _) => {
                counted(2).and(Ok(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any)))
            }
            _ if !is_of_the_language(&name) => Err(text.error(call.0, self.names.unknown(&name, true))),
            (_, [only]) => self.function(text, call, &name, *only),
            _ => counted(1).and(Ok(ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any))),
        }
    }

    fn function(
        &mut self,
        text: &ParsedText,
        call: (&Range<usize>, &Range<usize>),
        name: &str,
        (of, id): (ResolvedValue, usize),
    ) -> Resolved {
        let plain = |node| Ok(ResolvedValue::new(node, UnitKnowledge::PLAIN));
        match name {
            "sqrt" => {
                let quantity = of.quantity.to_half_power(1).ok_or_else(|| {
                    text.error(call.1, EquationFault::PowerOfUnit { found: of.quantity.to_string() })
                })?;
                Ok(ResolvedValue::new(self.graph.call(Function::Sqrt, of.node), quantity))
            }
            "abs" => {
                let opposite = self.graph.scaled(-1.0, of.node);
                let node = self.graph.choice(of.node, Graph::ZERO, opposite, of.node);
                self.notice_kink(text, call.1, "abs", node);
                Ok(ResolvedValue { node, ..of })
            }
            "sign" => {
                let minus = self.graph.literal(-1.0);
                let below = self.graph.choice(of.node, Graph::ZERO, minus, Graph::ZERO);
                let node = self.graph.choice(Graph::ZERO, of.node, Graph::ONE, below);
                self.notice_jump(text, call.1, (name, "jumps where its argument changes its sign"), node);
                plain(node)
            }
            "sin" | "cos" | "tan" => {
                if !of.quantity.is_angle() {
                    let remedy = " or an angle";
                    return Err(not_plain(text, name, (of, id), remedy));
                }
                if of.in_cycles {
                    let message = format!(
                        "the argument of `{name}` counts cycles, since it is made of frequencies in Hz; write `2*pi` before it"
                    );
                    self.notice(text, call.1, message);
                }
                let (sine, cosine) =
                    (self.graph.call(Function::Sin, of.node), self.graph.call(Function::Cos, of.node));
                match name {
                    "sin" => plain(sine),
                    "cos" => plain(cosine),
                    _ => plain(self.graph.product(&[(sine, 1), (cosine, -1)])),
                }
            }
            _ => {
                if !of.quantity.is_plain() {
                    let remedy = "; divide by a reference with the same unit, angles included";
                    return Err(not_plain(text, name, (of, id), remedy));
                }
                let (function, unit) = match name {
                    "exp" => (Function::Exp, UnitKnowledge::PLAIN),
                    "ln" => (Function::Ln, UnitKnowledge::PLAIN),
                    "tanh" => (Function::Tanh, UnitKnowledge::PLAIN),
                    "atanh" => (Function::Atanh, UnitKnowledge::PLAIN),
                    "floor" => (Function::Floor, UnitKnowledge::PLAIN),
                    "asin" => (Function::Asin, ANGLE),
                    "acos" => (Function::Acos, ANGLE),
                    "atan" => (Function::Atan, ANGLE),
                    _ => return Err(text.error(call.0, self.names.unknown(name, true))),
                };
                let node = self.graph.call(function, of.node);
                if function == Function::Floor {
                    let place = "jumps where its argument passes a whole number";
                    self.notice_jump(text, call.1, (name, place), node);
                }
                Ok(ResolvedValue::new(node, unit))
            }
        }
    }

    /// The common unit of two expressions that are compared.
    pub(crate) fn alike(
        &mut self,
        text: &ParsedText,
        (left, left_id): (ResolvedValue, usize),
        (right, right_id): (ResolvedValue, usize),
    ) -> Result<UnitKnowledge, EquationError> {
        left.quantity.plus(right.quantity).ok_or_else(|| {
            let because = format!("`{}` has", shown(text, left_id));
            let what = format!("`{}`", shown(text, right_id));
            let fault = unlike(&what, right.quantity, left.quantity.to_string(), because);
            let error = text.error(&span_of(text, right_id), fault);
            self.with_plain_parameters(error, [(right.node, right.quantity), (left.node, left.quantity)])
        })
    }

    /// `then` where a condition holds, and `otherwise` elsewhere. Conditions are nested no deeper than brackets may be.
    pub(super) fn chosen(
        &mut self,
        text: &ParsedText,
        node: &dyn Fn(&TermId) -> NodeId,
        condition: TermId,
        [then, otherwise]: [NodeId; 2],
    ) -> NodeId {
        match text.tree.terms.get(condition).map(|term| &term.form) {
            Some(TermForm::Comparison { smaller, larger }) => {
                self.graph.choice(node(smaller), node(larger), then, otherwise)
            }
            Some(TermForm::All(parts)) => {
                parts.iter().rev().fold(then, |then, part| self.chosen(text, node, *part, [then, otherwise]))
            }
            Some(TermForm::Any(parts)) => parts
                .iter()
                .rev()
                .fold(otherwise, |otherwise, part| self.chosen(text, node, *part, [then, otherwise])),
            Some(TermForm::Not(of)) => self.chosen(text, node, *of, [otherwise, then]),
            // The grammar has nothing else in the place of a condition.
            _ => otherwise,
        }
    }

    fn law(
        &mut self,
        text: &ParsedText,
        call: (&Range<usize>, &Range<usize>),
        law: &'static laws::Law,
        parts: &[(ResolvedValue, usize)],
    ) -> Resolved {
        if parts.len() != law.arguments.len() {
            let (function, found, expected) = (law.name.to_owned(), parts.len(), law.arguments.len());
            return Err(text.error(call.1, EquationFault::Arguments { function, found, expected }));
        }
        let quantities: Vec<UnitKnowledge> = parts.iter().map(|(value, _)| value.quantity).collect();
        let quantity = law.check(&quantities).map_err(|(index, expected, because)| {
            let (value, id) =
                parts.get(index).copied().unwrap_or((ResolvedValue::new(Graph::ZERO, UnitKnowledge::Any), 0));
            let what = format!("the argument `{}` of `{}`", law.argument(index), law.name);
            text.error(&span_of(text, id), unlike(&what, value.quantity, expected, because))
        })?;
        self.used.insert(law.header(), DeviceEquation::Law(law.formula));
        let arguments: Vec<NodeId> = parts.iter().map(|(value, _)| value.node).collect();
        Ok(ResolvedValue::new(self.graph.law(law.id, Vec::new(), &arguments), quantity))
    }

    fn curve(
        &mut self,
        text: &ParsedText,
        call: (&Range<usize>, &Range<usize>),
        curve: usize,
        parts: &[(ResolvedValue, usize)],
    ) -> Resolved {
        let units = self.curves.get(curve).cloned().unwrap_or_default();
        let (result, places) = units.split_last().unwrap_or((&UnitKnowledge::Any, &[]));
        if parts.len() != places.len() {
            let (function, found, expected) = (text.word(call.0).to_owned(), parts.len(), places.len());
            return Err(text.error(call.1, EquationFault::Arguments { function, found, expected }));
        }
        let mut at = [Graph::ZERO; 2];
        for ((at, (value, id)), place) in at.iter_mut().zip(parts).zip(places) {
            if value.quantity.plus(*place).is_none() {
                let because = format!("the places of the curve `{}` have", text.word(call.0));
                let fault = unlike("the argument", value.quantity, place.to_string(), because);
                return Err(text.error(&span_of(text, *id), fault));
            }
            *at = value.node;
        }
        Ok(ResolvedValue::new(self.graph.curve(curve, [0; 2], at), *result))
    }
}

/// A term as it is written, not too long for a message.
fn shown(text: &ParsedText, id: usize) -> String {
    let written = text.word(&span_of(text, id));
    match written.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", written.get(..end).unwrap_or_default()),
        None => written.to_owned(),
    }
}

fn span_of(text: &ParsedText, id: usize) -> Range<usize> {
    text.tree.terms.get(id).map_or(0..0, |term| term.span.clone())
}

/// An argument that has to be a plain number.
fn not_plain(
    text: &ParsedText,
    function: &str,
    (of, id): (ResolvedValue, usize),
    remedy: &'static str,
) -> EquationError {
    let what = format!("the argument of `{function}`");
    text.error(&span_of(text, id), EquationFault::NotPlain { what, found: of.quantity.to_string(), remedy })
}

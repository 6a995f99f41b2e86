//! A part of the filter as statements of either language.

use super::error::EmitError;
use super::tape::{Called, Id, Op, Tape};
use std::collections::{BTreeSet, HashMap};

/// Where numbers are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Array {
    Mean,
    Covariance,
    Constants,
    /// What a stage returns.
    Stage,
}

/// A call of the stage of Runge and Kutta's method.
#[derive(Clone, Debug)]
pub(super) struct StageCall {
    pub(super) arguments: Vec<Id>,
    /// The array that holds the results.
    pub(super) output: String,
}

/// Operations, the calls among them, and where their results go.
#[derive(Clone, Debug, Default)]
pub(super) struct Routine {
    pub(super) tape: Tape,
    /// The names of what a stage is handed, in order.
    pub(super) parameters: Vec<String>,
    pub(super) calls: Vec<StageCall>,
    pub(super) outputs: Vec<(Array, usize, Id)>,
    /// The variance of an innovation, which must be positive.
    pub(super) variance: Option<Id>,
}

/// How a language writes what routines are made of.
pub(super) trait Syntax {
    /// A number.
    fn literal(&self, value: f64) -> Result<String, EmitError>;
    /// A statement that gives a value a name.
    fn declare(&self, name: &str, value: &str) -> String;
    /// A function's call.
    fn call(&self, called: Called, at: &str) -> String;
    /// The third where the first is below the second, the fourth elsewhere.
    fn choice(&self, parts: [&str; 4]) -> String;
    /// a·b + c, rounded once where a processor has an instruction for it; `None` where the language has no word for that.
    fn fused(&self, a: &str, b: &str, c: &str) -> Option<String>;
    /// A stage's call into an array.
    fn stage(&self, output: &str, arguments: &[String]) -> String;
}

/// The longest expression that is not given a name.
const LONGEST: usize = 72;

impl Routine {
    /// Everything that it computes.
    fn roots(&self) -> Vec<Id> {
        let calls = self.calls.iter().flat_map(|call| call.arguments.iter().copied());
        calls.chain(self.outputs.iter().map(|(_, _, id)| *id)).chain(self.variance).collect()
    }

    /// The names that come from outside, in order.
    pub(super) fn names(&self) -> BTreeSet<String> {
        let of = |id: &Id| match self.tape.op(*id) {
            Op::Name(name) => Some(self.tape.name_of(name).to_owned()),
            _ => None,
        };
        self.tape.below(&self.roots()).iter().filter_map(of).collect()
    }

    /// The functions that it calls.
    pub(super) fn called(&self) -> BTreeSet<Called> {
        let of = |id: &Id| match self.tape.op(*id) {
            Op::Call(called, _) => Some(called),
            _ => None,
        };
        self.tape.below(&self.roots()).iter().filter_map(of).collect()
    }

    /// How many operations of each kind it has: sums, products, divisions, calls and choices.
    pub(super) fn counts(&self) -> [usize; 5] {
        let mut counts = [0; 5];
        for id in self.tape.below(&self.roots()) {
            let place = match self.tape.op(id) {
                Op::Literal(_) | Op::Name(_) => continue,
                Op::Add(..) | Op::Subtract(..) | Op::Negative(_) => 0,
                Op::Multiply(..) => 1,
                Op::Divide(..) => 2,
                Op::Call(..) => 3,
                Op::Choice(_) => 4,
            };
            counts[place] += 1;
        }
        counts
    }

    /// Its statements, and behind them the expressions of the outputs and that of the variance.
    pub(super) fn written(&self, syntax: &dyn Syntax) -> Result<Written, EmitError> {
        let roots = self.roots();
        let mut uses = vec![0_usize; self.tape.len()];
        let mut count = |id: Id| {
            if let Some(uses) = uses.get_mut(id.index()) {
                *uses += 1;
            }
        };
        for id in self.tape.below(&roots) {
            self.tape.op(id).parts().into_iter().for_each(&mut count);
        }
        roots.iter().copied().for_each(&mut count);
        let mut writer = Writer {
            tape: &self.tape,
            syntax,
            uses,
            texts: HashMap::new(),
            statements: Vec::new(),
            temporaries: 0,
        };
        for call in &self.calls {
            writer.write(&call.arguments)?;
            let arguments: Vec<String> = call.arguments.iter().map(|id| writer.text(*id, 0)).collect();
            writer.statements.push(syntax.stage(&call.output, &arguments));
        }
        let wanted: Vec<Id> = self.outputs.iter().map(|(_, _, id)| *id).chain(self.variance).collect();
        writer.write(&wanted)?;
        let outputs = self.outputs.iter().map(|(array, place, id)| (*array, *place, writer.text(*id, 0)));
        let outputs = outputs.collect();
        let variance = self.variance.map(|id| writer.text(id, 0));
        Ok(Written { statements: writer.statements, outputs, variance })
    }
}

/// A routine as text.
pub(super) struct Written {
    pub(super) statements: Vec<String>,
    /// Where each result goes, and its expression.
    pub(super) outputs: Vec<(Array, usize, String)>,
    pub(super) variance: Option<String>,
}

struct Writer<'a> {
    tape: &'a Tape,
    syntax: &'a dyn Syntax,
    uses: Vec<usize>,
    /// Expressions with how tightly they bind: 1 a sum, 2 a product, 3 anything that needs no bracket.
    texts: HashMap<Id, (String, u8)>,
    statements: Vec<String>,
    temporaries: usize,
}

impl Writer<'_> {
    /// An expression, in brackets where it binds less tightly.
    fn text(&self, id: Id, binding: u8) -> String {
        match self.texts.get(&id) {
            Some((text, own)) if *own >= binding => text.clone(),
            Some((text, _)) => format!("({text})"),
            None => String::new(),
        }
    }

    /// Statements for what these need and is not there yet.
    fn write(&mut self, wanted: &[Id]) -> Result<(), EmitError> {
        for id in self.tape.below(wanted) {
            if self.texts.contains_key(&id) {
                continue;
            }
            let (text, binding) = self.expression(id)?;
            let is_plain = matches!(self.tape.op(id), Op::Literal(_) | Op::Name(_));
            let often = self.uses.get(id.index()).is_some_and(|uses| *uses > 1);
            if !is_plain && (often || text.len() > LONGEST) {
                let name = format!("t{}", self.temporaries);
                self.temporaries += 1;
                self.statements.push(self.syntax.declare(&name, &text));
                self.texts.insert(id, (name, 3));
            } else {
                self.texts.insert(id, (text, binding));
            }
        }
        Ok(())
    }

    /// The factors of a product that stands in one sum alone and has no name.
    fn factors(&self, id: Id) -> Option<[String; 2]> {
        match self.tape.op(id) {
            Op::Multiply(a, b) if self.texts.get(&id).is_some_and(|(_, binding)| *binding == 2) => {
                Some([self.text(a, 3), self.text(b, 3)])
            }
            _ => None,
        }
    }

    /// A sum with a product in it, where the language can round that once.
    fn fused(&self, op: Op) -> Option<String> {
        match op {
            Op::Add(a, b) => match (self.factors(b), self.factors(a)) {
                (Some([x, y]), _) => self.syntax.fused(&x, &y, &self.text(a, 0)),
                (None, Some([x, y])) => self.syntax.fused(&x, &y, &self.text(b, 0)),
                (None, None) => None,
            },
            Op::Subtract(a, b) => match (self.factors(b), self.factors(a)) {
                (Some([x, y]), _) => self.syntax.fused(&format!("-{x}"), &y, &self.text(a, 0)),
                (None, Some([x, y])) => self.syntax.fused(&x, &y, &format!("-{}", self.text(b, 3))),
                (None, None) => None,
            },
            _ => None,
        }
    }

    fn expression(&self, id: Id) -> Result<(String, u8), EmitError> {
        if let Some(fused) = self.fused(self.tape.op(id)) {
            return Ok((fused, 3));
        }
        let two = |sign: &str, (a, left): (Id, u8), (b, right): (Id, u8)| {
            format!("{} {sign} {}", self.text(a, left), self.text(b, right))
        };
        Ok(match self.tape.op(id) {
            Op::Literal(bits) => {
                let value = f64::from_bits(bits);
                (self.syntax.literal(value)?, if value < 0.0 { 2 } else { 3 })
            }
            Op::Name(name) => (self.tape.name_of(name).to_owned(), 3),
            Op::Add(a, b) => (two("+", (a, 1), (b, 2)), 1),
            Op::Subtract(a, b) => (two("-", (a, 1), (b, 2)), 1),
            Op::Multiply(a, b) => (two("*", (a, 2), (b, 3)), 2),
            Op::Divide(a, b) => (two("/", (a, 2), (b, 3)), 2),
            Op::Negative(a) => (format!("-{}", self.text(a, 3)), 2),
            Op::Call(called, at) => (self.syntax.call(called, &self.text(at, 0)), 3),
            Op::Choice(parts) => {
                let [a, b, c, d] = parts.map(|part| self.text(part, 1));
                (self.syntax.choice([&a, &b, &c, &d]), 3)
            }
        })
    }
}

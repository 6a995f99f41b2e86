//! A part of the filter as statements of either language.

use super::error::EmitError;
use super::tape::{CalledFunction, Tape, TapeId, TapeOp};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Write as _;

/// Where numbers are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StorageArray {
    Mean,
    Covariance,
    Constants,
    /// What a stage returns.
    Stage,
}

/// Which of the arrays hold numbers of 64 bits.
#[allow(clippy::struct_excessive_bools)] // one for each kind of array
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Widths {
    pub(super) mean: bool,
    pub(super) covariance: bool,
    pub(super) constants: bool,
    /// What a stage is handed and returns.
    pub(super) stage: bool,
}

impl Widths {
    pub(super) fn of(self, array: StorageArray) -> bool {
        match array {
            StorageArray::Mean => self.mean,
            StorageArray::Covariance => self.covariance,
            StorageArray::Constants => self.constants,
            StorageArray::Stage => self.stage,
        }
    }

    /// Whether a number from outside of a routine has 64 bits, by its name in the source.
    fn of_name(self, name: &str) -> bool {
        let digit_follows = |letter: char| {
            name.strip_prefix(letter).is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
        };
        match name {
            _ if name.starts_with("x_") => self.mean,
            // Parameters that the program may change, from which constants follow.
            _ if name.starts_with("p_") => true,
            _ if digit_follows('p') => self.covariance,
            _ if digit_follows('c') => self.constants,
            _ => self.stage && ['k', 'z', 'w'].into_iter().any(digit_follows),
        }
    }
}

/// A call of the stage of Runge and Kutta's method.
#[derive(Clone, Debug)]
pub(super) struct StageCall {
    pub(super) arguments: Vec<TapeId>,
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
    pub(super) outputs: Vec<(StorageArray, usize, TapeId)>,
    /// The variance of an innovation, which must be positive.
    pub(super) variance: Option<TapeId>,
    /// That innovation, of a measurement, whose samples are watched.
    pub(super) residual: Option<TapeId>,
    /// The gains of a correction.
    pub(super) gains: Vec<TapeId>,
    /// The names of results that have a meaning in the filter's equations.
    labels: HashMap<TapeId, String>,
    /// Which arrays have 64 bits, and which operations compute with as many; none where the list is shorter.
    pub(super) widths: Widths,
    wide: Vec<bool>,
}

/// How a language writes what routines are made of. `wide` says whether the numbers have 64 bits.
pub(super) trait Syntax {
    /// A number.
    fn literal(&self, value: f64, wide: bool) -> Result<String, EmitError>;
    /// A statement that gives a value a name.
    fn declare(&self, name: &str, value: &str, wide: bool) -> String;
    /// A function's call, of one argument or of two.
    fn call(&self, called: CalledFunction, at: &[String], wide: bool) -> String;
    /// The third where the first is below the second, the fourth elsewhere.
    fn choice(&self, parts: [&str; 4]) -> String;
    /// a·b + c in 32 bits, rounded once where a processor has an instruction for it; `None` where the language has no word for that.
    fn fused(&self, a: &str, b: &str, c: &str) -> Option<String>;
    /// A number of the other width as one of this width, from its text without and with brackets around a sum or a product.
    fn converted(&self, plain: &str, bracketed: &str, wide: bool) -> String;
    /// A stage's call into an array.
    fn stage(&self, output: &str, arguments: &[String]) -> String;
}

/// The longest expression that is not given a name.
const LONGEST: usize = 72;

impl Routine {
    /// Names a result. The first name stays, and each name is given once.
    pub(super) fn label(&mut self, id: TapeId, name: String) {
        if !self.labels.values().any(|known| *known == name) {
            self.labels.entry(id).or_insert(name);
        }
    }

    pub(super) fn is_wide(&self, id: TapeId) -> bool {
        self.wide.get(id.index()).copied().unwrap_or(false)
    }

    /// Takes over which arrays have 64 bits. Operations have as many where what they lead to has; of a mean without its covariance the
    /// gains are left out.
    pub(super) fn widen(&mut self, widths: Widths) {
        self.widths = widths;
        let mut open: Vec<TapeId> = Vec::new();
        for (array, _, id) in &self.outputs {
            if widths.of(*array) {
                open.push(*id);
            }
        }
        if widths.stage {
            open.extend(self.calls.iter().flat_map(|call| call.arguments.iter().copied()));
        }
        if widths.covariance {
            open.extend(self.variance);
        }
        let mut wide = vec![false; self.tape.len()];
        let is_gain = |id: &TapeId| !widths.covariance && self.gains.contains(id);
        while let Some(id) = open.pop() {
            match self.tape.op(id) {
                TapeOp::Name(_) => continue,
                _ if is_gain(&id) => continue,
                _ => {}
            }
            if let Some(slot) = wide.get_mut(id.index()).filter(|slot| !**slot) {
                *slot = true;
                open.extend(self.tape.op(id).parts());
            }
        }
        for (id, wide) in (0_u32..).map(TapeId).zip(&mut wide) {
            if let TapeOp::Name(name) = self.tape.op(id) {
                *wide = widths.of_name(self.tape.name_of(name));
            }
        }
        self.wide = wide;
    }

    /// Computes all in 64 bits, whatever the results have.
    pub(super) fn widen_all(&mut self) {
        self.wide = vec![true; self.tape.len()];
    }

    /// Everything that it computes.
    fn roots(&self) -> Vec<TapeId> {
        let calls = self.calls.iter().flat_map(|call| call.arguments.iter().copied());
        calls
            .chain(self.outputs.iter().map(|(_, _, id)| *id))
            .chain(self.variance)
            .chain(self.residual)
            .collect()
    }

    /// The names that come from outside, in order.
    pub(super) fn names(&self) -> BTreeSet<String> {
        let of = |id: &TapeId| match self.tape.op(*id) {
            TapeOp::Name(name) => Some(self.tape.name_of(name).to_owned()),
            _ => None,
        };
        self.tape.below(&self.roots()).iter().filter_map(of).collect()
    }

    /// The functions that it calls.
    pub(super) fn called(&self) -> BTreeSet<CalledFunction> {
        let of = |id: &TapeId| match self.tape.op(*id) {
            TapeOp::Call(called, _) | TapeOp::CallOfTwo(called, _) => Some(called),
            _ => None,
        };
        self.tape.below(&self.roots()).iter().filter_map(of).collect()
    }

    /// How many operations of each kind it has: sums, products, divisions, calls and choices.
    pub(super) fn counts(&self) -> [usize; 5] {
        self.counts_where(|_| true)
    }

    /// How many of these are in numbers of 64 bits; functions have 32.
    pub(super) fn wide_counts(&self) -> [usize; 5] {
        self.counts_where(|id| self.is_wide(id))
    }

    fn counts_where(&self, is_counted: impl Fn(TapeId) -> bool) -> [usize; 5] {
        let mut counts = [0; 5];
        for id in self.tape.below(&self.roots()).into_iter().filter(|id| is_counted(*id)) {
            let place = match self.tape.op(id) {
                TapeOp::Literal(_) | TapeOp::Name(_) => continue,
                TapeOp::Add(..) | TapeOp::Subtract(..) | TapeOp::Negative(_) => 0,
                TapeOp::Multiply(..) => 1,
                TapeOp::Divide(..) => 2,
                TapeOp::Call(..) | TapeOp::CallOfTwo(..) => 3,
                TapeOp::Choice(_) => 4,
            };
            counts[place] += 1;
        }
        counts
    }

    /// Its statements, and behind them the expressions of the outputs and that of the variance.
    pub(super) fn written(&self, syntax: &dyn Syntax) -> Result<Written, EmitError> {
        let roots = self.roots();
        let mut uses = vec![0_usize; self.tape.len()];
        let mut count = |id: TapeId| {
            if let Some(uses) = uses.get_mut(id.index()) {
                *uses += 1;
            }
        };
        for id in self.tape.below(&roots) {
            self.tape.op(id).parts().into_iter().for_each(&mut count);
        }
        roots.iter().copied().for_each(&mut count);
        let mut writer = RoutineWriter {
            routine: self,
            tape: &self.tape,
            syntax,
            uses,
            texts: HashMap::new(),
            statements: Vec::new(),
            temporaries: 0,
        };
        for call in &self.calls {
            writer.write(&call.arguments)?;
            let arguments = call.arguments.iter().map(|id| writer.text(*id, 0, self.widths.stage));
            let arguments = arguments.collect::<Result<Vec<String>, _>>()?;
            writer.statements.push(syntax.stage(&call.output, &arguments));
        }
        let outputs = self.outputs.iter().map(|(_, _, id)| *id);
        let wanted: Vec<TapeId> = outputs.chain(self.variance).chain(self.residual).collect();
        writer.write(&wanted)?;
        let mut outputs = Vec::with_capacity(self.outputs.len());
        for (array, place, id) in &self.outputs {
            outputs.push((*array, *place, writer.text(*id, 0, self.widths.of(*array))?));
        }
        let narrow = |id: TapeId| writer.text(id, 0, false);
        let (variance, residual) =
            (self.variance.map(narrow).transpose()?, self.residual.map(narrow).transpose()?);
        Ok(Written { statements: writer.statements, outputs, variance, residual })
    }
}

/// A routine as text.
pub(super) struct Written {
    pub(super) statements: Vec<String>,
    /// Where each result goes, and its expression.
    pub(super) outputs: Vec<(StorageArray, usize, String)>,
    pub(super) variance: Option<String>,
    pub(super) residual: Option<String>,
}

impl Written {
    /// Its statements, and the assignments of its results to these arrays, as both languages have them; `refusal` stands before these.
    pub(super) fn body(&self, arrays: ArrayNames, refusal: &str) -> String {
        let mut text = String::new();
        for statement in &self.statements {
            let _ = writeln!(text, "    {statement}");
        }
        text += refusal;
        for (array, place, value) in &self.outputs {
            let _ = writeln!(text, "    {}[{place}] = {value};", arrays.of(*array));
        }
        text
    }
}

/// What the arrays are called in the source.
#[derive(Clone, Copy)]
pub(super) struct ArrayNames {
    pub(super) mean: &'static str,
    pub(super) covariance: &'static str,
    /// Constants, and what a stage returns.
    pub(super) other: &'static str,
}

impl ArrayNames {
    /// Of a stage, which has one array alone.
    pub(super) const STAGE: Self = Self { mean: "to", covariance: "to", other: "to" };

    pub(super) fn of(self, array: StorageArray) -> &'static str {
        match array {
            StorageArray::Mean => self.mean,
            StorageArray::Covariance => self.covariance,
            StorageArray::Constants | StorageArray::Stage => self.other,
        }
    }
}

struct RoutineWriter<'a> {
    routine: &'a Routine,
    tape: &'a Tape,
    syntax: &'a dyn Syntax,
    uses: Vec<usize>,
    /// Expressions with how tightly they bind: 1 a sum, 2 a product, 3 anything that needs no bracket.
    texts: HashMap<TapeId, (String, u8)>,
    statements: Vec<String>,
    temporaries: usize,
}

impl RoutineWriter<'_> {
    /// An expression in numbers of this width, in brackets where it binds less tightly.
    fn text(&self, id: TapeId, binding: u8, wide: bool) -> Result<String, EmitError> {
        if let TapeOp::Literal(bits) = self.tape.op(id) {
            let value = f64::from_bits(bits);
            let text = self.syntax.literal(value, wide)?;
            return Ok(if value < 0.0 && binding > 2 { format!("({text})") } else { text });
        }
        if self.routine.is_wide(id) == wide {
            return Ok(self.own(id, binding));
        }
        Ok(self.syntax.converted(&self.own(id, 0), &self.own(id, 3), wide))
    }

    /// An expression in numbers of its own width.
    fn own(&self, id: TapeId, binding: u8) -> String {
        match self.texts.get(&id) {
            Some((text, own)) if *own >= binding => text.clone(),
            Some((text, _)) => format!("({text})"),
            None => String::new(),
        }
    }

    /// Statements for what these need and is not there yet.
    fn write(&mut self, wanted: &[TapeId]) -> Result<(), EmitError> {
        for id in self.tape.below(wanted) {
            if self.texts.contains_key(&id) || matches!(self.tape.op(id), TapeOp::Literal(_)) {
                continue;
            }
            let wide = self.routine.is_wide(id);
            let (text, binding) = self.expression(id, wide)?;
            let is_plain = matches!(self.tape.op(id), TapeOp::Name(_));
            let often = self.uses.get(id.index()).is_some_and(|uses| *uses > 1);
            if !is_plain && (often || text.len() > LONGEST) {
                let name = self.routine.labels.get(&id).cloned().unwrap_or_else(|| {
                    self.temporaries += 1;
                    format!("t{}", self.temporaries - 1)
                });
                self.statements.push(self.syntax.declare(&name, &text, wide));
                self.texts.insert(id, (name, 3));
            } else {
                self.texts.insert(id, (text, binding));
            }
        }
        Ok(())
    }

    /// The factors of a product in 32 bits that stands in one sum alone and has no name.
    fn factors(&self, id: TapeId) -> Result<Option<[String; 2]>, EmitError> {
        Ok(match self.tape.op(id) {
            TapeOp::Multiply(a, b)
                if !self.routine.is_wide(id)
                    && self.texts.get(&id).is_some_and(|(_, binding)| *binding == 2) =>
            {
                Some([self.text(a, 3, false)?, self.text(b, 3, false)?])
            }
            _ => None,
        })
    }

    /// A sum in 32 bits with a product in it, where the language can round that once.
    fn fused(&self, op: TapeOp) -> Result<Option<String>, EmitError> {
        let (TapeOp::Add(a, b) | TapeOp::Subtract(a, b)) = op else { return Ok(None) };
        let is_sum = matches!(op, TapeOp::Add(..));
        Ok(match (self.factors(b)?, self.factors(a)?) {
            (Some([x, y]), _) => {
                let x = if is_sum { x } else { format!("-{x}") };
                self.syntax.fused(&x, &y, &self.text(a, 0, false)?)
            }
            (None, Some([x, y])) => {
                let other =
                    if is_sum { self.text(b, 0, false)? } else { format!("-{}", self.text(b, 3, false)?) };
                self.syntax.fused(&x, &y, &other)
            }
            (None, None) => None,
        })
    }

    fn expression(&self, id: TapeId, wide: bool) -> Result<(String, u8), EmitError> {
        if !wide && let Some(fused) = self.fused(self.tape.op(id))? {
            return Ok((fused, 3));
        }
        let two = |sign: &str, (a, left): (TapeId, u8), (b, right): (TapeId, u8)| {
            Ok::<_, EmitError>(format!("{} {sign} {}", self.text(a, left, wide)?, self.text(b, right, wide)?))
        };
        Ok(match self.tape.op(id) {
            TapeOp::Literal(_) => (String::new(), 3),
            TapeOp::Name(name) => (self.tape.name_of(name).to_owned(), 3),
            TapeOp::Add(a, b) => (two("+", (a, 1), (b, 2))?, 1),
            TapeOp::Subtract(a, b) => (two("-", (a, 1), (b, 2))?, 1),
            TapeOp::Multiply(a, b) => (two("*", (a, 2), (b, 3))?, 2),
            TapeOp::Divide(a, b) => (two("/", (a, 2), (b, 3))?, 2),
            TapeOp::Negative(a) => (format!("-{}", self.text(a, 3, wide)?), 2),
            TapeOp::Call(called, at) => (self.syntax.call(called, &[self.text(at, 0, wide)?], wide), 3),
            TapeOp::CallOfTwo(called, [a, b]) => {
                let at = [self.text(a, 0, wide)?, self.text(b, 0, wide)?];
                (self.syntax.call(called, &at, wide), 3)
            }
            TapeOp::Choice([a, b, c, d]) => {
                let [a, b, c, d] = [
                    self.text(a, 1, wide)?,
                    self.text(b, 1, wide)?,
                    self.text(c, 1, wide)?,
                    self.text(d, 1, wide)?,
                ];
                (self.syntax.choice([&a, &b, &c, &d]), 3)
            }
        })
    }
}

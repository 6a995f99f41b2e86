//! From text to terms.

use super::token::{Token, TokenKind, token};
use super::tree::{SyntaxTree, Term, TermForm, TermId};
use crate::error::EquationFault;
use crate::limits::{DEEPEST_NESTING, LONGEST_TEXT};
use kalmems_units::{Unit, Value};
use std::ops::Range;

type SyntaxFailure = (Range<usize>, EquationFault);

/// Reads an expression, and behind `in` the unit that it is to have.
pub(crate) fn parse(text: &str) -> Result<SyntaxTree, SyntaxFailure> {
    if text.len() > LONGEST_TEXT {
        return Err((0..0, EquationFault::TooLong { length: text.len(), limit: LONGEST_TEXT }));
    }
    let next = token(text, 0)?;
    let mut parser = Parser { text, next, terms: Vec::new() };
    let whole = parser.expression(0, 0)?;
    parser.value(whole)?;
    let unit = parser.unit_of_the_whole()?;
    match parser.next.kind {
        TokenKind::End => Ok(SyntaxTree { terms: parser.terms, unit }),
        _ => Err(parser.unexpected("an operator such as `+` or `*`, or the end")),
    }
}

/// How tightly operators bind.
const OR: u8 = 1;
const AND: u8 = 2;
const COMPARISON: u8 = 3;
const SUM: u8 = 4;
const PRODUCT: u8 = 5;
const SIGN: u8 = 6;
const POWER: u8 = 7;

struct Parser<'a> {
    text: &'a str,
    next: Token,
    terms: Vec<Term>,
}

impl Parser<'_> {
    fn advance(&mut self) -> Result<Token, SyntaxFailure> {
        let following = token(self.text, self.next.span.end)?;
        Ok(std::mem::replace(&mut self.next, following))
    }

    fn word(&self, span: &Range<usize>) -> &str {
        self.text.get(span.clone()).unwrap_or_default()
    }

    fn unexpected(&self, expected: &str) -> SyntaxFailure {
        let found = match self.next.kind {
            TokenKind::End => "the end".to_owned(),
            _ => format!("`{}`", self.word(&self.next.span)),
        };
        (self.next.span.clone(), EquationFault::Syntax { found, expected: expected.to_owned() })
    }

    fn push(&mut self, form: TermForm, span: Range<usize>) -> Result<TermId, SyntaxFailure> {
        form.values().into_iter().try_for_each(|part| self.value(part))?;
        self.terms.push(Term { form, span });
        Ok(self.terms.len() - 1)
    }

    fn is_condition(&self, term: TermId) -> bool {
        self.terms.get(term).is_some_and(|term| term.form.is_condition())
    }

    /// Refuses a condition where a value is needed.
    fn value(&self, term: TermId) -> Result<(), SyntaxFailure> {
        if !self.is_condition(term) {
            return Ok(());
        }
        let expected = "a value; a condition stands in `if(condition, x, y)` alone, and joins others by `and`, `or` and `not`";
        let (found, expected) = ("a condition".to_owned(), expected.to_owned());
        Err((self.span(term), EquationFault::Syntax { found, expected }))
    }

    /// Refuses a value that was just read where a condition is needed.
    fn condition(&self, term: TermId) -> Result<(), SyntaxFailure> {
        if self.is_condition(term) {
            return Ok(());
        }
        Err(self.unexpected("a comparison by `<` or `>`, as in `if(a < b, x, y)`"))
    }

    /// Whether this word comes next.
    fn is_word(&self, word: &str) -> bool {
        self.next.kind == TokenKind::Name && self.word(&self.next.span) == word
    }

    fn span(&self, term: TermId) -> Range<usize> {
        self.terms.get(term).map_or(0..0, |term| term.span.clone())
    }

    fn is(&self, sign: char) -> bool {
        self.next.kind == TokenKind::Sign(sign)
    }

    fn expect(&mut self, sign: char, expected: &str) -> Result<Token, SyntaxFailure> {
        if self.is(sign) { self.advance() } else { Err(self.unexpected(expected)) }
    }

    /// An expression of operators that bind more tightly than `least`. Operators of one strength become one term with
    /// many parts, so that a long sum is not deep.
    fn expression(&mut self, least: u8, depth: usize) -> Result<TermId, SyntaxFailure> {
        if depth > DEEPEST_NESTING {
            return Err((self.next.span.clone(), EquationFault::TooDeep { limit: DEEPEST_NESTING }));
        }
        let mut left = self.prefix(depth)?;
        loop {
            left = match self.next.kind {
                TokenKind::Name if least < OR && self.is_word("or") => {
                    self.joined(left, ("or", TermForm::Any), OR, depth)?
                }
                TokenKind::Name if least < AND && self.is_word("and") => {
                    self.joined(left, ("and", TermForm::All), AND, depth)?
                }
                TokenKind::Sign(sign @ ('<' | '>')) if least < COMPARISON => {
                    self.advance()?;
                    let right = self.expression(COMPARISON, depth + 1)?;
                    let span = self.span(left).start..self.span(right).end;
                    let (smaller, larger) = if sign == '<' { (left, right) } else { (right, left) };
                    self.push(TermForm::Comparison { smaller, larger }, span)?
                }
                TokenKind::Sign('+' | '-') if least < SUM => {
                    let parts = self.chain(left, ['+', '-'], SUM, depth)?;
                    self.join(TermForm::Sum, parts)?
                }
                TokenKind::Sign('*' | '/') if least < PRODUCT => {
                    let parts = self.chain(left, ['*', '/'], PRODUCT, depth)?;
                    self.join(TermForm::Product, parts)?
                }
                TokenKind::Sign('^') if least < POWER => {
                    self.advance()?;
                    // To the right: a^b^c is a^(b^c). A sign may stand in front of the exponent.
                    let exponent = self.expression(POWER - 1, depth + 1)?;
                    let span = self.span(left).start..self.span(exponent).end;
                    self.push(TermForm::Power(left, exponent), span)?
                }
                _ => return Ok(left),
            };
        }
    }

    /// What is joined by operators of one strength, each with whether the second of the two stands before it.
    fn chain(
        &mut self,
        first: TermId,
        signs: [char; 2],
        strength: u8,
        depth: usize,
    ) -> Result<Vec<(bool, TermId)>, SyntaxFailure> {
        let mut parts = vec![(false, first)];
        while self.is(signs[0]) || self.is(signs[1]) {
            let inverse = self.is(signs[1]);
            self.advance()?;
            parts.push((inverse, self.expression(strength, depth + 1)?));
        }
        Ok(parts)
    }

    /// Conditions that this word joins.
    fn joined(
        &mut self,
        first: TermId,
        (word, form): (&str, fn(Vec<TermId>) -> TermForm),
        strength: u8,
        depth: usize,
    ) -> Result<TermId, SyntaxFailure> {
        self.condition(first)?;
        let (start, mut parts) = (self.span(first).start, vec![first]);
        while self.is_word(word) {
            self.advance()?;
            let part = self.expression(strength, depth + 1)?;
            self.condition(part)?;
            parts.push(part);
        }
        let end = parts.last().map_or(start, |last| self.span(*last).end);
        self.push(form(parts), start..end)
    }

    fn join(
        &mut self,
        form: fn(Vec<(bool, TermId)>) -> TermForm,
        parts: Vec<(bool, TermId)>,
    ) -> Result<TermId, SyntaxFailure> {
        let ends = parts.first().zip(parts.last()).map(|(a, b)| (a.1, b.1)).unwrap_or_default();
        let span = self.span(ends.0).start..self.span(ends.1).end;
        self.push(form(parts), span)
    }

    /// What can begin an expression.
    fn prefix(&mut self, depth: usize) -> Result<TermId, SyntaxFailure> {
        match self.next.kind {
            TokenKind::Sign('-') => {
                let sign = self.advance()?;
                let of = self.expression(SIGN, depth + 1)?;
                let span = sign.span.start..self.span(of).end;
                self.push(TermForm::Negative(of), span)
            }
            TokenKind::Sign('+') => {
                self.advance()?;
                self.expression(SIGN, depth + 1)
            }
            TokenKind::Sign('(') => {
                let open = self.advance()?;
                let inner = self.expression(0, depth + 1)?;
                let close = self.expect(')', "an operator or the `)` of this bracket")?;
                if let Some(term) = self.terms.get_mut(inner) {
                    term.span = open.span.start..close.span.end;
                }
                Ok(inner)
            }
            TokenKind::Number => self.number(),
            TokenKind::Name if self.is_word("not") => {
                let word = self.advance()?;
                let of = self.expression(AND, depth + 1)?;
                self.condition(of)?;
                let span = word.span.start..self.span(of).end;
                self.push(TermForm::Not(of), span)
            }
            TokenKind::Name => {
                let name = self.advance()?.span;
                if self.is('(') {
                    self.call(name, depth)
                } else {
                    self.push(TermForm::Name(name.clone()), name)
                }
            }
            _ => Err(self.unexpected("a number, a name or `(`")),
        }
    }

    fn number(&mut self) -> Result<TermId, SyntaxFailure> {
        let number = self.advance()?.span;
        if self.next.kind != TokenKind::Unit {
            let value = self.word(&number).parse().unwrap_or(f64::NAN);
            return self.push(TermForm::Number(value, None), number);
        }
        let bracket = self.advance()?.span;
        let unit = self.word(&(bracket.start + 1..bracket.end - 1)).trim().to_owned();
        let value = Value::parse(&format!("{} {unit}", self.word(&number)));
        let value = value.map_err(|fault| (bracket.clone(), EquationFault::Unit(fault)))?;
        self.push(TermForm::Number(value.si(), Some(value.unit())), number.start..bracket.end)
    }

    fn call(&mut self, name: Range<usize>, depth: usize) -> Result<TermId, SyntaxFailure> {
        match self.word(&name) {
            "if" => return self.choice(name, depth),
            "d" => return self.partial(name, depth),
            _ => {}
        }
        self.advance()?;
        let mut arguments = Vec::new();
        if !self.is(')') {
            loop {
                arguments.push(self.expression(0, depth + 1)?);
                if !self.is(',') {
                    break;
                }
                self.advance()?;
            }
        }
        let close = self.expect(')', "an operator, `,` or the `)` of this function")?;
        let span = name.start..close.span.end;
        if self.word(&name) == "ddt" {
            let [of] = arguments[..] else {
                let function = "ddt".to_owned();
                return Err((
                    span,
                    EquationFault::Arguments { function, found: arguments.len(), expected: 1 },
                ));
            };
            return self.push(TermForm::Rate { of }, span);
        }
        self.push(TermForm::Call(name, arguments), span)
    }

    /// `if(condition, then, otherwise)`.
    fn choice(&mut self, name: Range<usize>, depth: usize) -> Result<TermId, SyntaxFailure> {
        self.advance()?;
        let condition = self.expression(0, depth + 1)?;
        self.condition(condition)?;
        self.expect(',', "`,` and the value where the comparison holds")?;
        let then = self.expression(0, depth + 1)?;
        self.expect(',', "`,` and the value where the comparison does not hold")?;
        let otherwise = self.expression(0, depth + 1)?;
        let close = self.expect(')', "the `)` of this `if`")?;
        self.push(TermForm::Choice { condition, then, otherwise }, name.start..close.span.end)
    }

    /// `d(of, by)`.
    fn partial(&mut self, name: Range<usize>, depth: usize) -> Result<TermId, SyntaxFailure> {
        self.advance()?;
        let of = self.expression(0, depth + 1)?;
        self.expect(',', "`,` and the name of a state, an input or a parameter, as in `d(C, theta)`")?;
        if self.next.kind != TokenKind::Name {
            return Err(self.unexpected("the name of a state, an input or a parameter"));
        }
        let by = self.advance()?.span;
        let close = self.expect(')', "the `)` of this derivative")?;
        self.push(TermForm::Partial { of, by }, name.start..close.span.end)
    }

    /// What stands after `in`.
    fn unit_of_the_whole(&mut self) -> Result<Option<(Unit, Range<usize>)>, SyntaxFailure> {
        if self.next.kind != TokenKind::Name || self.word(&self.next.span) != "in" {
            return Ok(None);
        }
        let span = self.next.span.end..self.text.len();
        let text = self.word(&span);
        let start = span.start + (text.len() - text.trim_start().len());
        let span = start..start + text.trim().len();
        if span.is_empty() {
            let expected = "a unit after `in`, such as `V`".to_owned();
            return Err((span, EquationFault::Syntax { found: "the end".to_owned(), expected }));
        }
        let unit =
            Unit::parse(self.word(&span)).map_err(|fault| (span.clone(), EquationFault::Unit(fault)))?;
        self.next = Token { kind: TokenKind::End, span: self.text.len()..self.text.len() };
        Ok(Some((unit, span)))
    }
}

//! The words and signs of an expression.

use crate::error::EquationFault;
use kalmems_units::number_length;
use std::ops::Range;

/// What a piece of text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// A decimal number without a sign.
    Number,
    /// A name.
    Name,
    /// A unit in square brackets, brackets included.
    Unit,
    /// One of `+ - * / ^ ( ) , < >`.
    Sign(char),
    /// Nothing more.
    End,
}

/// A piece of the text.
#[derive(Clone, Debug)]
pub(crate) struct Token {
    pub(crate) kind: TokenKind,
    pub(crate) span: Range<usize>,
}

/// The token that begins at `from` or behind the white space there.
pub(crate) fn token(text: &str, from: usize) -> Result<Token, (Range<usize>, EquationFault)> {
    let rest = text.get(from..).unwrap_or_default();
    let start = from + (rest.len() - rest.trim_start().len());
    let rest = text.get(start..).unwrap_or_default();
    let Some(first) = rest.chars().next() else {
        return Ok(Token { kind: TokenKind::End, span: start..start });
    };
    let of = |kind, length: usize| Ok(Token { kind, span: start..start + length });
    if first.is_ascii_digit() || first == '.' {
        let length = number_length(rest);
        return if length == 0 { Err(stray(start, first)) } else { of(TokenKind::Number, length) };
    }
    if is_first_of_name(first) {
        let length = rest.find(|c: char| !is_of_name(c)).unwrap_or(rest.len());
        return of(TokenKind::Name, length);
    }
    match first {
        '+' | '-' | '*' | '/' | '^' | '(' | ')' | ',' | '<' | '>' => of(TokenKind::Sign(first), 1),
        '[' => match rest.find(']') {
            Some(end) => of(TokenKind::Unit, end + 1),
            None => Err((
                start..text.len(),
                EquationFault::Syntax { found: "`[`".to_owned(), expected: "a unit and then `]`".to_owned() },
            )),
        },
        _ => Err(stray(start, first)),
    }
}

/// Whether a name can begin with this character.
pub(crate) fn is_first_of_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

/// Whether a name can go on with this character.
pub(crate) fn is_of_name(c: char) -> bool {
    c.is_alphabetic() || c.is_ascii_digit() || c == '_'
}

/// A character that no expression has.
fn stray(start: usize, found: char) -> (Range<usize>, EquationFault) {
    let expected = match found {
        '−' | '–' => "`-` for a difference",
        '·' | '×' => "`*` for a product",
        '²' => "`^2` for a square",
        '³' => "`^3` for a cube",
        '=' => "an expression alone; its name is the key before it",
        '{' | '}' => "`(` and `)`",
        _ => "a number, a name, or one of + - * / ^ ( ) , < >",
    };
    let fault =
        EquationFault::Syntax { found: format!("`{}`", found.escape_debug()), expected: expected.to_owned() };
    (start..start + found.len_utf8(), fault)
}

//! The Python literals that NPY headers are made of.

use crate::refuse_if;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Literal {
    Text(String),
    Integer(u64),
    Flag(bool),
    Nothing,
    /// A list or a tuple.
    Several(Vec<Literal>),
    /// Keys that are texts, and values.
    Named(Vec<(String, Literal)>),
}

impl Literal {
    pub(super) fn text(&self) -> Option<&String> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }
}

/// Literals within one another.
const DEPTH: usize = 16;

/// Reads one literal and white space behind it. The place of the fault is a byte.
pub(super) fn parse(text: &str) -> Result<Literal, (usize, &'static str)> {
    let mut reader = LiteralReader { text, at: 0 };
    let literal = reader.literal(DEPTH)?;
    reader.space();
    if reader.at == text.len() { Ok(literal) } else { Err((reader.at, "the end")) }
}

struct LiteralReader<'a> {
    text: &'a str,
    at: usize,
}

impl LiteralReader<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn space(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    fn takes(&mut self, token: &str) -> bool {
        self.space();
        let there = self.rest().starts_with(token);
        if there {
            self.at += token.len();
        }
        there
    }

    fn literal(&mut self, depth: usize) -> Result<Literal, (usize, &'static str)> {
        refuse_if(depth == 0, || (self.at, "fewer brackets within one another"))?;
        for (token, literal) in
            [("True", Literal::Flag(true)), ("False", Literal::Flag(false)), ("None", Literal::Nothing)]
        {
            if self.takes(token) {
                return Ok(literal);
            }
        }
        for (begin, end) in [("[", "]"), ("(", ")")] {
            if self.takes(begin) {
                return self.until(end, |reader| reader.literal(depth - 1)).map(Literal::Several);
            }
        }
        if self.takes("{") {
            let entry = |reader: &mut Self| {
                let Literal::Text(key) = reader.literal(depth - 1)? else {
                    return Err((reader.at, "a quoted key"));
                };
                refuse_if(!reader.takes(":"), || (reader.at, "a colon"))?;
                Ok((key, reader.literal(depth - 1)?))
            };
            return self.until("}", entry).map(Literal::Named);
        }
        match self.rest().chars().next() {
            Some(quote @ ('\'' | '"')) => self.quoted(quote).map(Literal::Text),
            Some('0'..='9') => {
                let digits = self.rest().bytes().take_while(u8::is_ascii_digit).count();
                let number = self.rest()[..digits].parse().map_err(|_| (self.at, "a number below 2⁶⁴"))?;
                self.at += digits;
                // Python 2 marks long integers.
                if self.rest().starts_with('L') {
                    self.at += 1;
                }
                Ok(Literal::Integer(number))
            }
            _ => Err((self.at, "a value")),
        }
    }

    /// What stands between commas up to a bracket.
    fn until<T>(
        &mut self,
        end: &str,
        mut next: impl FnMut(&mut Self) -> Result<T, (usize, &'static str)>,
    ) -> Result<Vec<T>, (usize, &'static str)> {
        let mut values = Vec::new();
        while !self.takes(end) {
            values.push(next(self)?);
            if !self.takes(",") {
                return if self.takes(end) { Ok(values) } else { Err((self.at, "a comma")) };
            }
        }
        Ok(values)
    }

    fn quoted(&mut self, quote: char) -> Result<String, (usize, &'static str)> {
        let start = self.at;
        let mut text = String::new();
        let mut letters = self.rest().char_indices().skip(1);
        let end = loop {
            let Some((place, letter)) = letters.next() else { return Err((start, "a closing quote")) };
            if letter == quote {
                break place + 1;
            }
            if letter != '\\' {
                text.push(letter);
                continue;
            }
            let digits = match letters.next().map(|(_, escaped)| escaped) {
                Some(same @ ('\\' | '\'' | '"')) => {
                    text.push(same);
                    continue;
                }
                Some('x') => 2,
                Some('u') => 4,
                Some('U') => 8,
                _ => return Err((start, "a known escape")),
            };
            let mut code = 0;
            for _ in 0..digits {
                let digit = letters.next().and_then(|(_, digit)| digit.to_digit(16));
                code = code * 16 + u64::from(digit.ok_or((start, "hexadecimal digits"))?);
            }
            let letter = u32::try_from(code).ok().and_then(char::from_u32);
            text.push(letter.ok_or((start, "a Unicode character"))?);
        };
        self.at += end;
        Ok(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_numpy_writes() {
        let parsed = parse(
            "{'descr': [('a', '<f8'), ('b', '|S3', (2,)), ], 'fortran_order': False, 'shape': (3,), }  \n",
        );
        let text = |text: &str| Literal::Text(text.to_owned());
        let expected = Literal::Named(vec![
            (
                "descr".to_owned(),
                Literal::Several(vec![
                    Literal::Several(vec![text("a"), text("<f8")]),
                    Literal::Several(vec![
                        text("b"),
                        text("|S3"),
                        Literal::Several(vec![Literal::Integer(2)]),
                    ]),
                ]),
            ),
            ("fortran_order".to_owned(), Literal::Flag(false)),
            ("shape".to_owned(), Literal::Several(vec![Literal::Integer(3)])),
        ]);
        assert_eq!(parsed, Ok(expected));
        assert_eq!(parse(r"'\xb5m\'\u03b8'"), Ok(text("µm'θ")));
        assert_eq!(parse("()"), Ok(Literal::Several(vec![])));
    }

    #[test]
    fn what_is_none() {
        for text in [
            "",
            "{",
            "{'a' 1}",
            "[1 2]",
            "'a",
            "1.5",
            "99999999999999999999",
            r"'\q'",
            r"'\UFFFFFFFF'",
            "1 1",
            "µ",
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
        assert!(parse(&"[".repeat(100_000)).is_err());
    }
}

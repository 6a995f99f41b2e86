//! Vectors: names with an index and sums over an index, written out element by element before an expression is read.
//!
//! `x[2]` is the name `x_2`, a key such as `x[i=1..6]` stands for six, whose texts may use `i`, and `sum(i = 1..6, k[i]*x[i])` is a sum of six terms.

use crate::error::EquationFault;
use crate::limits::LONGEST_TEXT;
use crate::syntax::{is_first_of_name, is_of_name};
use kalmems_units::number_length;
use std::borrow::Cow;
use std::ops::Range;

/// The most elements that a key stands for, and terms of a sum over an index.
const MOST_ELEMENTS: i64 = 100;
/// How deep sums over an index may be nested.
const DEEPEST_SUM: usize = 8;

/// One of those that a key stands for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VectorElement {
    /// Its name: `x_3` of `x[1..6]`.
    pub name: String,
    /// The name and the value of the index that the text behind the key may use.
    pub index: Option<(String, i64)>,
}

type Failure = (Range<usize>, EquationFault);

/// The elements that a key stands for: of `x[1..6]` six, with a name for the index of `x[i=1..6]`, of `x[3]` one, and of a name itself.
///
/// # Errors
///
/// A range that is none, in words.
///
/// ```
/// use kalmems_equations::vector_elements;
/// let names: Vec<String> = vector_elements("x[i=2..4]")?.into_iter().map(|element| element.name).collect();
/// assert_eq!(names, ["x_2", "x_3", "x_4"]);
/// # Ok::<(), String>(())
/// ```
pub fn vector_elements(key: &str) -> Result<Vec<VectorElement>, String> {
    let Some((name, range)) = key.split_once('[').filter(|(name, _)| !name.contains('(')) else {
        return Ok(vec![VectorElement { name: key.to_owned(), index: None }]);
    };
    let name = name.trim();
    let shape = || format!("expected `{name}[1..6]`, `{name}[i=1..6]` or `{name}[3]`, found `{key}`");
    let range = range.trim().strip_suffix(']').ok_or_else(shape)?;
    let (index, range) = match range.split_once('=') {
        Some((index, range)) => (Some(index.trim()), range),
        None => (None, range),
    };
    let is_name = |text: &str| text.starts_with(is_first_of_name) && text.chars().all(is_of_name);
    if index.is_some_and(|index| !is_name(index)) {
        return Err(shape());
    }
    let whole = |text: &str| text.trim().parse::<i64>().ok().filter(|number| *number >= 0).ok_or_else(shape);
    let (first, last) = match range.split_once("..") {
        Some((first, last)) => (whole(first)?, whole(last)?),
        None => (whole(range)?, whole(range)?),
    };
    if last < first || last - first >= MOST_ELEMENTS {
        return Err(format!(
            "`{key}` stands for {} elements; expected a range that rises, of at most {MOST_ELEMENTS}",
            (last - first + 1).max(0)
        ));
    }
    let element = |value: i64| VectorElement {
        name: format!("{name}_{value}"),
        index: index.map(|index| (index.to_owned(), value)),
    };
    Ok((first..=last).map(element).collect())
}

/// The text behind a key for one of its elements: with its index as a number, with the names of elements, and sums over an index written out.
///
/// # Errors
///
/// An index that is no whole number, and a sum that is not written as one, in words.
pub fn text_of_element(text: &str, element: &VectorElement) -> Result<String, String> {
    let Some(index) = &element.index else { return Ok(text.to_owned()) };
    let written = WrittenOut { text, indices: vec![index.clone()], depth: 0 }.whole();
    written.map_err(|(span, fault)| format!("{fault}, at `{}`", text.get(span).unwrap_or_default()))
}

/// An expression with the names of elements, and sums over an index written out.
pub(crate) fn written_out(text: &str) -> Result<Cow<'_, str>, Failure> {
    // A unit stands in brackets too, behind a number.
    if text.len() > LONGEST_TEXT || !text.contains('[') && !text.contains("sum") {
        return Ok(Cow::Borrowed(text));
    }
    WrittenOut { text, indices: Vec::new(), depth: 0 }.whole().map(Cow::Owned)
}

/// A text with the values of the indices in it.
struct WrittenOut<'a> {
    text: &'a str,
    indices: Vec<(String, i64)>,
    depth: usize,
}

impl WrittenOut<'_> {
    fn whole(&self) -> Result<String, Failure> {
        self.part(0..self.text.len())
    }

    fn part(&self, span: Range<usize>) -> Result<String, Failure> {
        let (mut out, mut at) = (String::new(), span.start);
        while at < span.end {
            let rest = self.text.get(at..span.end).unwrap_or_default();
            let Some(first) = rest.chars().next() else { break };
            let length = if first.is_ascii_digit() || first == '.' {
                let number = number_length(rest).max(1);
                let behind = rest.get(number..).unwrap_or_default();
                let unit = behind.trim_start();
                match unit.find(']').filter(|_| unit.starts_with('[')) {
                    Some(end) => number + (behind.len() - unit.len()) + end + 1,
                    None => number,
                }
            } else if is_first_of_name(first) {
                let name = rest.find(|c: char| !is_of_name(c)).unwrap_or(rest.len());
                at += self.name(at..at + name, span.end, &mut out)?;
                continue;
            } else {
                first.len_utf8()
            };
            out.push_str(rest.get(..length).unwrap_or_default());
            at += length;
            if out.len() > LONGEST_TEXT {
                return Err((0..0, EquationFault::TooLong { length: out.len(), limit: LONGEST_TEXT }));
            }
        }
        Ok(out)
    }

    /// Writes what begins with a name, and says how long that is in the text.
    fn name(&self, span: Range<usize>, end: usize, out: &mut String) -> Result<usize, Failure> {
        let name = self.text.get(span.clone()).unwrap_or_default();
        let behind = self.text.get(span.end..end).unwrap_or_default();
        if name == "in" {
            // The unit of the whole.
            out.push_str(name);
            out.push_str(behind);
            return Ok(end - span.start);
        }
        if name == "sum" && behind.trim_start().starts_with('(') {
            let open = span.end + (behind.len() - behind.trim_start().len());
            return self.sum(span.start, open, end, out);
        }
        if behind.starts_with('[') {
            let close = behind.find(']').ok_or_else(|| {
                let expected = "a whole number and then `]`".to_owned();
                (span.end..end, EquationFault::Syntax { found: "`[`".to_owned(), expected })
            })?;
            let index = span.end + 1..span.end + close;
            let value = self.number(index.clone())?;
            if value < 0 {
                let why = format!("`{name}[{value}]` has an index below 0");
                return Err((index, EquationFault::Value(why)));
            }
            out.push_str(&format!("{name}_{value}"));
            return Ok(name.len() + close + 1);
        }
        match self.value(name) {
            Some(value) if value < 0 => out.push_str(&format!("({value})")),
            Some(value) => out.push_str(&value.to_string()),
            None => out.push_str(name),
        }
        Ok(name.len())
    }

    /// The value of an index.
    fn value(&self, name: &str) -> Option<i64> {
        self.indices.iter().rev().find(|(own, _)| own == name).map(|(_, value)| *value)
    }

    /// A whole number: sums and products of numbers and indices.
    fn number(&self, span: Range<usize>) -> Result<i64, Failure> {
        let text = self.text.get(span.clone()).unwrap_or_default();
        let factor = |text: &str| {
            let text = text.trim();
            text.parse::<i64>().ok().or_else(|| self.value(text))
        };
        let product =
            |text: &str| text.split('*').try_fold(1_i64, |product, part| product.checked_mul(factor(part)?));
        let (mut sum, mut sign, mut start) = (Some(0_i64), 1, 0);
        let ends = text.char_indices().filter(|(_, c)| matches!(c, '+' | '-'));
        for (end, next) in ends.map(|(at, c)| (at, if c == '-' { -1 } else { 1 })).chain([(text.len(), 1)]) {
            let part = text.get(start..end).unwrap_or_default();
            // A sign in front stands behind nothing.
            let is_sign = part.trim().is_empty() && start == 0 && end < text.len();
            if !is_sign {
                sum = sum.and_then(|sum| sum.checked_add(sign * product(part)?));
            }
            (sign, start) = (next, end + 1);
        }
        sum.ok_or_else(|| {
            let expected = "a whole number, or an index with what is added to it, such as `i + 1` after `x[i=1..6]` or in `sum(i = 1..6, …)`";
            let (found, expected) = (format!("`{}`", text.trim()), expected.to_owned());
            (span, EquationFault::Syntax { found, expected })
        })
    }

    /// `sum(i = 1..6, …)`, whose bracket opens at a place.
    fn sum(&self, start: usize, open: usize, end: usize, out: &mut String) -> Result<usize, Failure> {
        let malformed = |span: Range<usize>| {
            let expected =
                "an index, its range and what is summed, as in `sum(i = 1..6, k[i]*x[i])`".to_owned();
            (span, EquationFault::Syntax { found: "this".to_owned(), expected })
        };
        if self.depth >= DEEPEST_SUM {
            return Err((start..open, EquationFault::TooDeep { limit: DEEPEST_SUM }));
        }
        let (mut deep, mut close) = (0_usize, None);
        for (place, sign) in self.text.get(open..end).unwrap_or_default().char_indices() {
            deep = match sign {
                '(' => deep + 1,
                ')' => deep - 1,
                _ => deep,
            };
            if deep == 0 {
                close = Some(open + place);
                break;
            }
        }
        let close = close.ok_or_else(|| malformed(start..end))?;
        let head = self.text.get(open + 1..close).unwrap_or_default();
        let whole = || malformed(start..close + 1);
        let comma = head.find(',').ok_or_else(whole)?;
        let equals = head.find('=').filter(|equals| *equals < comma).ok_or_else(whole)?;
        let dots = head.find("..").filter(|dots| (equals..comma).contains(dots)).ok_or_else(whole)?;
        let index = head.get(..equals).unwrap_or_default().trim();
        if !index.starts_with(is_first_of_name) || !index.chars().all(is_of_name) {
            return Err(whole());
        }
        let first = self.number(open + 1 + equals + 1..open + 1 + dots)?;
        let last = self.number(open + 1 + dots + 2..open + 1 + comma)?;
        if last < first || last - first >= MOST_ELEMENTS {
            let why = format!(
                "the index `{index}` goes from {first} to {last}; expected a range that rises, of at most {MOST_ELEMENTS}"
            );
            return Err((start..close + 1, EquationFault::Value(why)));
        }
        let (mut terms, mut length) = (Vec::new(), 0);
        for value in first..=last {
            let indices = self.indices.iter().cloned().chain([(index.to_owned(), value)]).collect();
            let inner = WrittenOut { text: self.text, indices, depth: self.depth + 1 };
            terms.push(format!("({})", inner.part(open + 1 + comma + 1..close)?.trim()));
            length += terms.last().map_or(0, String::len);
            if length > LONGEST_TEXT {
                return Err((start..close + 1, EquationFault::TooLong { length, limit: LONGEST_TEXT }));
            }
        }
        out.push_str(&format!("({})", terms.join(" + ")));
        Ok(close + 1 - start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn out(text: &str) -> String {
        match written_out(text) {
            Ok(out) => out.into_owned(),
            Err((span, fault)) => format!("{fault}, at `{}`", text.get(span).unwrap_or_default()),
        }
    }

    #[test]
    fn sums_and_elements_are_written_out() {
        assert_eq!(out("x[2]*9.81[m/s^2] - y [3]"), "x_2*9.81[m/s^2] - y [3]");
        assert_eq!(out("sum(i = 1..3, k[i]*x[i + 1])"), "((k_1*x_2) + (k_2*x_3) + (k_3*x_4))");
        assert_eq!(
            out("2*sum(i=0..1, sum(j = i..1, a[2*i+j]*j*1[m])) in m"),
            "2*((((a_0*0*1[m]) + (a_1*1*1[m]))) + (((a_3*1*1[m])))) in m"
        );
        assert_eq!(out("summed + sum_1"), "summed + sum_1");
        let element = &vector_elements("v[i = 2 .. 3]").unwrap()[1];
        assert_eq!(
            text_of_element("k*(x[i+1] - i*x[ i - 1 ]) in m", element).unwrap(),
            "k*(x_4 - 3*x_2) in m"
        );
    }

    #[test]
    fn what_is_no_index_is_said() {
        for (text, says) in [
            ("x[i]", "found `i`; expected a whole number"),
            ("x[1 - 3]", "has an index below 0"),
            ("x[2", "found `[`; expected a whole number and then `]`"),
            ("sum(i, x[i])", "expected an index, its range and what is summed"),
            ("sum(i = 3..1, x[i])", "goes from 3 to 1"),
            ("sum(i = 1..1000, x[i])", "goes from 1 to 1000"),
            ("sum(i = 1..3, x[i]", "expected an index, its range and what is summed"),
        ] {
            assert!(out(text).contains(says), "{text}: {}", out(text));
        }
        for key in ["x[6..1]", "x[a..b]", "x[1..6", "x[1=1..6]", "x[0..100]"] {
            assert!(vector_elements(key).is_err(), "{key}");
        }
        // Bounded, whatever is nested.
        let deep = "sum(i = 1..100, ".repeat(7) + "x" + &")".repeat(7);
        assert!(out(&deep).contains("at most"), "{}", out(&deep).len());
    }
}

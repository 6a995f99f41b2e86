//! What is wrong with a description, and where.

use crate::description::TextPlace;
use kalmems_units::UnitError;
use std::fmt;
use std::ops::Range;

/// What is wrong with a description: the place, the text there with a mark under what is meant, what was found, what was
/// expected, and what to write.
///
/// ```
/// use kalmems_equations::{Description, Device};
/// let text = "[states]\nx = 'm'\n[derivative]\nx = '2[m/s] - xx/5[s]'\n";
/// let error = Device::of(&Description::read(text)?).unwrap_err();
/// assert_eq!(error.to_string(), "\
/// derivative.x: `xx` is not defined; did you mean `x`?
///     2[m/s] - xx/5[s]
///              ^^");
/// # Ok::<(), kalmems_equations::EquationError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EquationError(Box<Located>);

#[derive(Clone, Debug, PartialEq)]
struct Located {
    place: TextPlace,
    text: String,
    span: Range<usize>,
    fault: EquationFault,
    within: Vec<String>,
}

impl EquationError {
    pub(crate) fn new(place: &TextPlace, text: &str, span: Range<usize>, fault: EquationFault) -> Self {
        let (place, text) = (place.clone(), text.to_owned());
        Self(Box::new(Located { place, text, span, fault, within: Vec::new() }))
    }

    /// About a whole entry.
    pub(crate) fn whole(place: &TextPlace, text: &str, fault: EquationFault) -> Self {
        Self::new(place, text, 0..text.len(), fault)
    }

    /// The same, met while something else was read.
    pub(crate) fn met_in(mut self, what: String) -> Self {
        // The innermost ones say enough.
        if self.0.within.len() < 3 {
            self.0.within.push(what);
        }
        self
    }

    /// Where it is.
    pub fn place(&self) -> &TextPlace {
        &self.0.place
    }

    /// The part of the text that is meant, in bytes.
    pub fn span(&self) -> Range<usize> {
        self.0.span.clone()
    }

    /// What is wrong there.
    pub fn fault(&self) -> &EquationFault {
        &self.0.fault
    }
}

impl fmt::Display for EquationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Located { place, text, span, fault, within } = &*self.0;
        write!(f, "{place}: {fault}")?;
        write_marked(f, text, span)?;
        for what in within {
            write!(f, "\n  {what}")?;
        }
        Ok(())
    }
}

impl std::error::Error for EquationError {}

/// Something that is allowed and probably not meant.
#[derive(Clone, Debug, PartialEq)]
pub struct EquationNotice {
    pub(crate) place: TextPlace,
    pub(crate) text: String,
    pub(crate) span: Range<usize>,
    pub(crate) message: String,
}

impl EquationNotice {
    /// Where it is.
    pub fn place(&self) -> &TextPlace {
        &self.place
    }
}

impl fmt::Display for EquationNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.message)?;
        write_marked(f, &self.text, &self.span)
    }
}

/// Characters on either side of what is marked.
const AROUND: usize = 50;

/// The line of the text with the span, and carets below it.
fn write_marked(f: &mut fmt::Formatter<'_>, text: &str, span: &Range<usize>) -> fmt::Result {
    if text.trim().is_empty() {
        return Ok(());
    }
    let before = text.get(..span.start).unwrap_or_default();
    let line_start = before.rfind('\n').map_or(0, |end| end + 1);
    let line = text.get(line_start..).unwrap_or_default().lines().next().unwrap_or_default();
    // Counted in characters, each of which takes one column.
    let column = text.get(line_start..span.start).unwrap_or_default().chars().count();
    let marked = text.get(span.clone()).unwrap_or_default().lines().next().unwrap_or_default();
    let width = marked.trim_end().chars().count().max(1);
    let length = line.chars().count();
    let from = column.saturating_sub(AROUND);
    let to = length.min(column + width.min(AROUND) + AROUND);
    let shown: String = line.chars().skip(from).take(to - from).collect();
    let (left, right) = (if from > 0 { "…" } else { "" }, if to < length { "…" } else { "" });
    let indent = " ".repeat(column - from + left.chars().count());
    let carets = "^".repeat(width.min(to.saturating_sub(column)).max(1));
    write!(f, "\n    {left}{}{right}\n    {indent}{carets}", shown.trim_end())
}

/// What can be wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EquationFault {
    /// The file is not TOML, or a value in it is of the wrong kind.
    #[error("{0}")]
    File(String),
    /// Something else stands where the grammar expects something.
    #[error("found {found}; expected {expected}")]
    Syntax {
        /// What stands there.
        found: String,
        /// What can stand there.
        expected: String,
    },
    /// A unit or a value that cannot be read.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A name that nothing defines.
    #[error("`{name}` is not {what}{}", hint(suggestion.as_deref()))]
    Unknown {
        /// The name.
        name: String,
        /// What it should be.
        what: &'static str,
        /// A name that is near.
        suggestion: Option<String>,
    },
    /// An element that a vector does not have.
    #[error("`{name}` is not defined; `{stem}` has the elements {first} to {last}")]
    Index {
        /// The element.
        name: String,
        /// The vector.
        stem: String,
        /// The lowest index.
        first: u32,
        /// The highest index.
        last: u32,
    },
    /// A name that cannot be used, with the reason.
    #[error("`{name}` cannot be a name here: {why}")]
    Name {
        /// The name.
        name: String,
        /// Why not, and what to write.
        why: String,
    },
    /// A name that is used in another way than it was defined.
    #[error("`{name}` is {is}; {expected}")]
    Use {
        /// The name.
        name: String,
        /// What it was defined as.
        is: &'static str,
        /// What is expected there.
        expected: String,
    },
    /// The terms of a sum, or the two sides of a comparison or of an equation, have different dimensions.
    #[error("{what} has the unit {found}; expected {expected}, which {because}")]
    Unlike {
        /// What has the wrong unit.
        what: String,
        /// Its unit.
        found: String,
        /// The other unit.
        expected: String,
        /// Where the other unit comes from.
        because: String,
    },
    /// An argument that has to be a plain number.
    #[error("{what} has the unit {found}; expected a plain number{remedy}")]
    NotPlain {
        /// What has a unit.
        what: String,
        /// Its unit.
        found: String,
        /// What to write.
        remedy: &'static str,
    },
    /// A power that is not possible for something with a unit.
    #[error(
        "a power of something in {found} needs a whole or half exponent that is written as a number, such as `^2`"
    )]
    PowerOfUnit {
        /// The unit of the base.
        found: String,
    },
    /// A function with another number of arguments.
    #[error("`{function}` takes {expected} argument{}, found {found}", if *expected == 1 { "" } else { "s" })]
    Arguments {
        /// The function.
        function: String,
        /// How many stand there.
        found: usize,
        /// How many it takes.
        expected: usize,
    },
    /// Definitions that need each other.
    #[error("the definitions need each other: {0}")]
    Cycle(String),
    /// `ddt` of something that depends on the rate of an input.
    #[error(
        "`ddt` needs the second time derivative of the input `{input}`, which samples of it do not tell; write the expression with one \
         derivative of it at most"
    )]
    RateOfRate {
        /// The input.
        input: String,
    },
    /// A derivative of a higher order than a function has.
    #[error(
        "this needs a derivative of order {order} of `{function}`, which has {limit}; write the function as a formula"
    )]
    Order {
        /// The function.
        function: String,
        /// The order that is needed.
        order: usize,
        /// The highest order.
        limit: usize,
    },
    /// A number that is infinite or none.
    #[error("this is not a finite number, whatever the states are")]
    NotFinite,
    /// The value of a parameter or of a period that must be of another kind.
    #[error("{0}")]
    Value(String),
    /// A table, or an entry of it, that is missing.
    #[error("{0}")]
    Missing(String),
    /// A measurement, or a quantity, that does not depend on a state.
    #[error("this does not depend on a state, so that nothing can be estimated from it")]
    Blind,
    /// A text that is too long.
    #[error("the text has {length} bytes; at most {limit} are read")]
    TooLong {
        /// Its length in bytes.
        length: usize,
        /// The limit.
        limit: usize,
    },
    /// Nesting that is too deep.
    #[error("nested deeper than {limit} levels; give parts names in `[let]`")]
    TooDeep {
        /// The limit.
        limit: usize,
    },
    /// Expressions that grow beyond a bound.
    #[error("the expressions have more than {limit} {what} once everything is inserted; shorten them")]
    TooLarge {
        /// What is counted.
        what: &'static str,
        /// The limit.
        limit: usize,
    },
}

fn hint(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |s| format!("; did you mean `{s}`?"))
}

/// The name among several that is written nearly as this one.
pub(crate) fn nearest<'a>(name: &str, among: impl Iterator<Item = &'a str>) -> Option<String> {
    let lower = name.to_lowercase();
    let far = 1 + name.chars().count() / 4;
    among
        .map(|other| (strsim::damerau_levenshtein(&other.to_lowercase(), &lower), other))
        .filter(|(distance, _)| *distance <= far)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, other)| other.to_owned())
}

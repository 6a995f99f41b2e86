//! What the names of a description mean.

use crate::description::{Description, NamedText, TextPlace};
use crate::error::{EquationError, EquationFault, nearest};
use crate::laws;
use crate::limits::MOST_NAMES;
use crate::syntax::{self, SyntaxTree, is_first_of_name, is_of_name};
use crate::vectors::written_out;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A text with its terms.
#[derive(Debug)]
pub(crate) struct ParsedText {
    pub(crate) entry: NamedText,
    pub(crate) tree: SyntaxTree,
}

impl ParsedText {
    pub(crate) fn read(entry: &NamedText) -> Result<Arc<Self>, EquationError> {
        let wrong = |text: &str, (span, fault)| EquationError::new(&entry.place, text, span, fault);
        let text = written_out(&entry.text).map_err(|failure| wrong(&entry.text, failure))?;
        let tree = syntax::parse(&text).map_err(|failure| wrong(&text, failure))?;
        Ok(Arc::new(Self { entry: NamedText { text: text.into_owned(), ..entry.clone() }, tree }))
    }

    pub(crate) fn error(&self, span: &std::ops::Range<usize>, fault: EquationFault) -> EquationError {
        EquationError::new(&self.entry.place, &self.entry.text, span.clone(), fault)
    }

    pub(crate) fn word(&self, span: &std::ops::Range<usize>) -> &str {
        self.entry.text.get(span.clone()).unwrap_or_default()
    }
}

/// A function with the names of its arguments.
#[derive(Debug)]
pub(crate) struct Formula {
    pub(crate) arguments: Vec<String>,
    pub(crate) text: Arc<ParsedText>,
    /// Whether it is the reader's own and not the language's.
    pub(crate) is_own: bool,
}

/// What a name stands for.
#[derive(Clone, Debug)]
pub(crate) enum Meaning {
    State(usize),
    Input(usize),
    Parameter(usize),
    /// A named expression, by its place among them.
    Let(usize),
    /// An expression a while ago, by its place among the delays.
    Delay(usize),
    Function(Arc<Formula>),
    /// A curve of one argument or of two.
    Curve(usize),
}

impl Meaning {
    /// In words, with an article.
    pub(crate) fn words(&self) -> &'static str {
        match self {
            Self::State(_) => "a state",
            Self::Input(_) => "an input",
            Self::Parameter(_) => "a parameter",
            Self::Let(_) => "a named expression",
            Self::Delay(_) => "a delayed expression",
            Self::Function(_) => "a function",
            Self::Curve(_) => "a curve, which is a function of its arguments",
        }
    }
}

/// Functions of the language that are neither laws nor formulas.
pub(crate) const BUILT_IN: [&str; 22] = [
    "sqrt", "exp", "ln", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "tanh", "atanh", "abs",
    "sign", "floor", "hypot", "min", "max", "if", "d", "ddt", "in",
];

/// Words of the language that are neither numbers nor functions.
const WORDS: [&str; 3] = ["and", "or", "not"];

/// Entries of a table, and what each of them is by its place.
type EntriesAndMeaning<'a> = (&'a [NamedText], fn(usize) -> Meaning);

/// The names of a description.
#[derive(Debug, Default)]
pub(crate) struct DescriptionNames {
    known: BTreeMap<String, Meaning>,
}

impl DescriptionNames {
    /// Those of all tables, and the functions of the language that are formulas.
    ///
    /// `states` are those of the description with those that lags and delays add.
    pub(crate) fn of(description: &Description, states: &[NamedText]) -> Result<Self, EquationError> {
        let mut names = Self::default();
        for (header, formula) in laws::PRELUDE {
            let entry = NamedText::new("the language", header, formula);
            let (name, arguments) = header_of(&entry)?;
            let formula = Formula { arguments, text: ParsedText::read(&entry)?, is_own: false };
            names.known.insert(name, Meaning::Function(Arc::new(formula)));
        }
        let tables: [EntriesAndMeaning<'_>; 4] = [
            (states, Meaning::State),
            (&description.inputs, Meaning::Input),
            (&description.parameters, Meaning::Parameter),
            (&description.lets, Meaning::Let),
        ];
        for (table, meaning) in tables {
            for (index, entry) in table.iter().enumerate() {
                names.define(&entry.name, &entry.place, meaning(index))?;
            }
        }
        for (index, delay) in description.delay.iter().enumerate() {
            names.define(&delay.name, &delay.of.place, Meaning::Delay(index))?;
        }
        for (index, points) in description.tables.iter().enumerate() {
            names.define(&points.name, &points.place, Meaning::Curve(index))?;
        }
        for entry in &description.functions {
            let (name, arguments) = header_of(entry)?;
            let formula = Formula { arguments, text: ParsedText::read(entry)?, is_own: true };
            names.define(&name, &entry.place, Meaning::Function(Arc::new(formula)))?;
        }
        Ok(names)
    }

    fn define(&mut self, name: &str, place: &TextPlace, meaning: Meaning) -> Result<(), EquationError> {
        let refuse = |why: String| {
            Err(EquationError::whole(place, "", EquationFault::Name { name: name.to_owned(), why }))
        };
        if !is_name(name) {
            return refuse("a name is a letter or `_`, and letters, digits and `_` after it".to_owned());
        }
        if is_of_the_language(name) {
            return refuse("it is a word of the language; take another one".to_owned());
        }
        if let Some(other) = self.known.get(name) {
            return refuse(match other {
                Meaning::Function(formula) if !formula.is_own => {
                    "it is a function of the language; take another one".to_owned()
                }
                _ => format!("it is {} already; take another one", other.words()),
            });
        }
        if self.known.len() > MOST_NAMES + laws::PRELUDE.len() {
            let fault = EquationFault::TooLarge { what: "names", limit: MOST_NAMES };
            return Err(EquationError::whole(place, "", fault));
        }
        self.known.insert(name.to_owned(), meaning);
        Ok(())
    }

    pub(crate) fn get(&self, name: &str) -> Option<&Meaning> {
        self.known.get(name)
    }

    /// The name of an input.
    pub(crate) fn of_input(&self, input: usize) -> String {
        let is = |meaning: &Meaning| matches!(meaning, Meaning::Input(index) if *index == input);
        self.known.iter().find(|(_, meaning)| is(meaning)).map_or_else(String::new, |(name, _)| name.clone())
    }

    /// That a name is no element of the vector that it names one of.
    fn beyond_a_vector(&self, name: &str) -> Option<EquationFault> {
        let (stem, index) = name.rsplit_once('_')?;
        index.parse::<u32>().ok()?;
        let index_of = |known: &String| known.strip_prefix(stem)?.strip_prefix('_')?.parse::<u32>().ok();
        let there: Vec<u32> = self.known.keys().filter_map(index_of).collect();
        let (first, last) = (there.iter().min().copied()?, there.iter().max().copied()?);
        (there.len() > 1).then(|| EquationFault::Index {
            name: format!("{stem}[{index}]"),
            stem: stem.to_owned(),
            first,
            last,
        })
    }

    /// What is wrong with a name that is not there.
    pub(crate) fn unknown(&self, name: &str, functions: bool) -> EquationFault {
        if let Some(fault) = self.beyond_a_vector(name).filter(|_| !functions) {
            return fault;
        }
        let is_function = |meaning: &Meaning| matches!(meaning, Meaning::Function(_) | Meaning::Curve(_));
        let own = self.known.iter().filter(|(_, meaning)| is_function(meaning) == functions);
        let own = own.map(|(name, _)| name.as_str());
        let suggestion = if functions {
            let native = laws::LAWS.iter().map(|law| law.name);
            nearest(name, own.chain(BUILT_IN).chain(native).filter(|name| *name != "in"))
        } else {
            nearest(name, own.chain(["pi"]))
        };
        let what = if functions { "a function here" } else { "defined" };
        EquationFault::Unknown { name: name.to_owned(), what, suggestion }
    }
}

/// Whether the language itself uses this word.
pub(crate) fn is_of_the_language(name: &str) -> bool {
    name == "pi" || BUILT_IN.contains(&name) || WORDS.contains(&name) || laws::of_name(name).is_some()
}

fn is_name(name: &str) -> bool {
    name.starts_with(is_first_of_name) && name.chars().all(is_of_name)
}

/// `plate(angle, near)` as a name and the names of its arguments.
fn header_of(entry: &NamedText) -> Result<(String, Vec<String>), EquationError> {
    let refuse = |why: &str| {
        let fault = EquationFault::Name { name: entry.name.clone(), why: why.to_owned() };
        EquationError::whole(&entry.place, "", fault)
    };
    let header = entry.name.trim();
    let shape = "write the function with the names of its arguments, such as `\"plate(angle, gap)\"`";
    let (name, rest) = header.split_once('(').ok_or_else(|| refuse(shape))?;
    let inner = rest.strip_suffix(')').ok_or_else(|| refuse(shape))?;
    let arguments: Vec<String> = inner.split(',').map(|word| word.trim().to_owned()).collect();
    for (index, argument) in arguments.iter().enumerate() {
        if !is_name(argument) {
            return Err(refuse(shape));
        }
        if is_of_the_language(argument) {
            return Err(refuse(&format!("its argument `{argument}` is a word of the language")));
        }
        if arguments.iter().take(index).any(|before| before == argument) {
            return Err(refuse(&format!("its argument `{argument}` stands there twice")));
        }
    }
    Ok((name.trim().to_owned(), arguments))
}

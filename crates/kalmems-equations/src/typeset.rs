//! Equations as a reader knows them, in Unicode.

use crate::device::{Device, DeviceEquation, ParsedText};
use crate::syntax::{TermForm, is_of_name};

impl Device {
    /// Its equations, one line each: Greek letters for their names, indices, powers, roots and derivatives as they are
    /// written by hand.
    ///
    /// ```
    /// # use kalmems_equations::{Description, Device};
    /// let text = r#"
    /// [states]
    /// theta = "rad"
    /// omega = "rad/s"
    /// [parameters]
    /// omega_n = "100 rad/s"
    /// [derivative]
    /// theta = "omega"
    /// omega = "-omega_n^2*sin(theta) - 0.1[1/s]*omega"
    /// "#;
    /// let device = Device::of(&Description::read(text)?)?;
    /// assert_eq!(device.typeset(), ["dθ/dt = ω", "dω/dt = −ω_n²·sin θ − 0.1 1/s·ω"]);
    /// # Ok::<(), kalmems_equations::EquationError>(())
    /// ```
    pub fn typeset(&self) -> Vec<String> {
        let line = |(left, right): &(String, DeviceEquation)| {
            let text = match right {
                DeviceEquation::Text(text) => text,
                DeviceEquation::Law(formula) => return format!("{} = {formula}", header(left)),
            };
            let unit = text.tree.unit.as_ref().map(|(_, span)| format!("  in {}", text.word(span)));
            format!("{} = {}{}", header(left), expression(text), unit.unwrap_or_default())
        };
        self.equations.iter().map(line).collect()
    }
}

/// How tightly what was written holds together, from conditions that `or` joins to names.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum Precedence {
    Either,
    Both,
    Sum,
    Product,
    Power,
    Whole,
}

/// What is on the left: a name, the rate of one, or a function with its arguments.
fn header(left: &str) -> String {
    if let Some(state) = left.strip_prefix('d').and_then(|rest| rest.strip_suffix("/dt")) {
        return format!("d{}/dt", name(state));
    }
    match left.split_once('(') {
        Some((function, arguments)) => {
            let arguments: Vec<String> =
                arguments.trim_end_matches(')').split(',').map(|argument| name(argument.trim())).collect();
            format!("{function}({})", arguments.join(", "))
        }
        None => name(left),
    }
}

fn expression(text: &ParsedText) -> String {
    let mut parts: Vec<(String, Precedence)> = Vec::with_capacity(text.tree.terms.len());
    for term in &text.tree.terms {
        let at = |id: &usize| parts.get(*id).cloned().unwrap_or((String::new(), Precedence::Whole));
        // In brackets where it holds less tightly than what is around it.
        let within = |id: &usize, bond: Precedence| {
            let (part, own) = at(id);
            if own < bond { format!("({part})") } else { part }
        };
        let written = match &term.form {
            TermForm::Number(..) => (number(text.word(&term.span)), Precedence::Whole),
            TermForm::Name(span) => (name(text.word(span)), Precedence::Whole),
            TermForm::Negative(of) => (format!("−{}", within(of, Precedence::Product)), Precedence::Sum),
            TermForm::Sum(of) => {
                let mut sum = String::new();
                for (index, (minus, id)) in of.iter().enumerate() {
                    let sign = match (index, minus) {
                        (0, _) => "",
                        (_, true) => " − ",
                        (_, false) => " + ",
                    };
                    let bond = if index == 0 { Precedence::Sum } else { Precedence::Product };
                    sum.push_str(&format!("{sign}{}", within(id, bond)));
                }
                (sum, Precedence::Sum)
            }
            TermForm::Product(of) => {
                let mut product = String::new();
                for (index, (over, id)) in of.iter().enumerate() {
                    let sign = match (index, over) {
                        (0, _) => "",
                        (_, true) => "/",
                        (_, false) => "·",
                    };
                    let bond = if *over { Precedence::Power } else { Precedence::Product };
                    // A sign in front of the first factor needs no brackets.
                    let is_signed = index == 0 && at(id).0.starts_with('−');
                    let part = if is_signed && !at(id).0.contains(' ') { at(id).0 } else { within(id, bond) };
                    product.push_str(&format!("{sign}{part}"));
                }
                (product, Precedence::Product)
            }
            TermForm::Power(base, exponent) => {
                let base = within(base, Precedence::Whole);
                let exponent = at(exponent).0;
                match raised(&exponent) {
                    Some(raised) => (format!("{base}{raised}"), Precedence::Power),
                    None => (format!("{base}^({exponent})"), Precedence::Power),
                }
            }
            TermForm::Call(function, of) => {
                let arguments: Vec<String> = of.iter().map(|id| at(id).0).collect();
                let function = text.word(function);
                let first = arguments.first().cloned().unwrap_or_default();
                match function {
                    "sqrt" => (format!("√({first})"), Precedence::Power),
                    "abs" => (format!("|{first}|"), Precedence::Whole),
                    "floor" => (format!("⌊{first}⌋"), Precedence::Whole),
                    "exp" => (format!("exp({first})"), Precedence::Power),
                    "sin" | "cos" | "tan" | "ln" | "asin" | "acos" | "atan"
                        if first.chars().all(is_of_name) =>
                    {
                        (format!("{function} {first}"), Precedence::Power)
                    }
                    _ => (format!("{function}({})", arguments.join(", ")), Precedence::Power),
                }
            }
            TermForm::Comparison { smaller, larger } => {
                (format!("{} < {}", at(smaller).0, at(larger).0), Precedence::Sum)
            }
            TermForm::All(of) => {
                let parts: Vec<String> = of.iter().map(|id| within(id, Precedence::Both)).collect();
                (parts.join(" and "), Precedence::Both)
            }
            TermForm::Any(of) => {
                let parts: Vec<String> = of.iter().map(|id| at(id).0).collect();
                (parts.join(" or "), Precedence::Either)
            }
            TermForm::Not(of) => (format!("not {}", within(of, Precedence::Sum)), Precedence::Both),
            TermForm::Choice { condition, then, otherwise } => {
                let [condition, x, y] = [condition, then, otherwise].map(|id| at(id).0);
                (format!("{{{x} if {condition}, {y} else}}"), Precedence::Whole)
            }
            TermForm::Partial { of, by } => {
                (format!("∂{}/∂{}", within(of, Precedence::Whole), name(text.word(by))), Precedence::Power)
            }
            TermForm::Rate { of } => (format!("d{}/dt", within(of, Precedence::Whole)), Precedence::Power),
        };
        parts.push(written);
    }
    parts.pop().map(|(whole, _)| whole).unwrap_or_default()
}

/// A number with its unit behind it.
fn number(text: &str) -> String {
    // What is written in brackets stays so: a unit is raised with its number.
    if let Some(inner) = text.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')) {
        return format!("({})", number(inner.trim()));
    }
    let (digits, unit) = text.split_once('[').map_or((text, ""), |(digits, unit)| (digits.trim(), unit));
    let unit = unit.trim_end_matches(']').trim();
    let digits = match digits.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => match raised(exponent.trim_start_matches('+')) {
            Some(raised) => format!("{mantissa}·10{raised}"),
            None => digits.to_owned(),
        },
        None => digits.to_owned(),
    };
    if unit.is_empty() { digits } else { format!("{digits} {unit}") }
}

/// A whole number as superscripts.
fn raised(text: &str) -> Option<String> {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let (sign, digits) = match text.strip_prefix(['-', '−']) {
        Some(digits) => ("⁻", digits),
        None => ("", text),
    };
    let raised: Option<String> =
        digits.chars().map(|c| DIGITS.get(c.to_digit(10)? as usize).copied()).collect();
    raised.filter(|raised| !raised.is_empty()).map(|raised| format!("{sign}{raised}"))
}

/// A name with its Greek letter and its index.
fn name(text: &str) -> String {
    let (stem, index) = text.split_once('_').map_or((text, None), |(stem, index)| (stem, Some(index)));
    let stem = greek(stem).unwrap_or(stem);
    match index {
        None => stem.to_owned(),
        Some(index) => match lowered(index) {
            Some(lowered) => format!("{stem}{lowered}"),
            None => format!("{stem}_{index}"),
        },
    }
}

/// An index of digits as subscripts. Of letters only some have any, so that none is lowered.
fn lowered(text: &str) -> Option<String> {
    let lower = |c: char| char::from_u32(0x2080 + c.to_digit(10)?);
    let lowered: Option<String> = text.chars().map(lower).collect();
    lowered.filter(|lowered| !lowered.is_empty())
}

fn greek(name: &str) -> Option<&'static str> {
    const LETTERS: [(&str, &str); 34] = [
        ("alpha", "α"),
        ("beta", "β"),
        ("gamma", "γ"),
        ("delta", "δ"),
        ("epsilon", "ε"),
        ("zeta", "ζ"),
        ("eta", "η"),
        ("theta", "θ"),
        ("iota", "ι"),
        ("kappa", "κ"),
        ("lambda", "λ"),
        ("mu", "μ"),
        ("nu", "ν"),
        ("xi", "ξ"),
        ("pi", "π"),
        ("rho", "ρ"),
        ("sigma", "σ"),
        ("tau", "τ"),
        ("upsilon", "υ"),
        ("phi", "φ"),
        ("chi", "χ"),
        ("psi", "ψ"),
        ("omega", "ω"),
        ("Gamma", "Γ"),
        ("Delta", "Δ"),
        ("Theta", "Θ"),
        ("Lambda", "Λ"),
        ("Xi", "Ξ"),
        ("Pi", "Π"),
        ("Sigma", "Σ"),
        ("Upsilon", "Υ"),
        ("Phi", "Φ"),
        ("Psi", "Ψ"),
        ("Omega", "Ω"),
    ];
    LETTERS.iter().find(|(word, _)| *word == name).map(|(_, letter)| *letter)
}

//! The table of units and the grammar of compound ones.

use crate::Dimension;
use std::f64::consts::PI;

/// What is wrong with a value or a unit, in words that name what was found and what to write.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// The text does not start with a finite decimal number.
    #[error("`{found}` does not start with a finite number; write a number and a unit, such as `5.71 pF`")]
    Number {
        /// The text as found.
        found: String,
    },
    /// A word that is no unit.
    #[error("`{found}` is not a unit that is known here{}", hint(suggestion.as_deref()))]
    Unknown {
        /// The word as found.
        found: String,
        /// The nearest known unit, where one is near.
        suggestion: Option<String>,
    },
    /// The unit cannot be read, or could be read in two ways.
    #[error("cannot read the unit `{found}`: {why}")]
    Syntax {
        /// The unit as found.
        found: String,
        /// What is wrong and what to write.
        why: &'static str,
    },
    /// What is stated of a value's uncertainty cannot be read.
    #[error("cannot read the uncertainty of `{found}`: {why}")]
    Uncertainty {
        /// The value as found.
        found: String,
        /// What is wrong and what to write.
        why: String,
    },
    /// A value of another dimension than the one expected.
    #[error("`{found}` has the dimension {dimension}; expected {expected}, such as `{example}`")]
    Dimension {
        /// The value as found.
        found: String,
        /// Its dimension in base units.
        dimension: Dimension,
        /// The kind of quantity and its dimension.
        expected: String,
        /// A value that would be right.
        example: &'static str,
    },
}

fn hint(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |s| format!("; did you mean `{s}`?"))
}

/// A unit: a factor to SI and a dimension.
///
/// The factor is kept as `mantissa · 10^decimal`, so that `5.71 pF` becomes the same number as `5.71e-12`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    mantissa: f64,
    decimal: i32,
    dimension: Dimension,
}

/// Symbol, factor as mantissa and power of ten, exponents of kg m s A K rad, and whether SI prefixes apply.
type UnitRow = (&'static str, f64, i32, [i16; 6], bool);

const TABLE: &[UnitRow] = &[
    ("m", 1.0, 0, [0, 1, 0, 0, 0, 0], true),
    ("g", 1.0, -3, [1, 0, 0, 0, 0, 0], true),
    ("s", 1.0, 0, [0, 0, 1, 0, 0, 0], true),
    ("A", 1.0, 0, [0, 0, 0, 1, 0, 0], true),
    ("K", 1.0, 0, [0, 0, 0, 0, 1, 0], true),
    ("rad", 1.0, 0, [0, 0, 0, 0, 0, 1], true),
    ("deg", PI / 180.0, 0, [0, 0, 0, 0, 0, 1], true),
    ("dps", PI / 180.0, 0, [0, 0, -1, 0, 0, 1], true),
    ("Hz", 1.0, 0, [0, 0, -1, 0, 0, 0], true),
    ("N", 1.0, 0, [1, 1, -2, 0, 0, 0], true),
    ("Pa", 1.0, 0, [1, -1, -2, 0, 0, 0], true),
    ("bar", 1.0, 5, [1, -1, -2, 0, 0, 0], true),
    ("J", 1.0, 0, [1, 2, -2, 0, 0, 0], true),
    ("W", 1.0, 0, [1, 2, -3, 0, 0, 0], true),
    ("C", 1.0, 0, [0, 0, 1, 1, 0, 0], true),
    ("V", 1.0, 0, [1, 2, -3, -1, 0, 0], true),
    ("F", 1.0, 0, [-1, -2, 4, 2, 0, 0], true),
    ("ohm", 1.0, 0, [1, 2, -3, -2, 0, 0], true),
    ("Ω", 1.0, 0, [1, 2, -3, -2, 0, 0], true),
    ("Ohm", 1.0, 0, [1, 2, -3, -2, 0, 0], true),
    ("S", 1.0, 0, [-1, -2, 3, 2, 0, 0], true),
    ("H", 1.0, 0, [1, 2, -2, -2, 0, 0], true),
    ("min", 60.0, 0, [0, 0, 1, 0, 0, 0], false),
    ("h", 3600.0, 0, [0, 0, 1, 0, 0, 0], false),
    ("gn", 9.806_65, 0, [0, 1, -2, 0, 0, 0], true),
    ("%", 1.0, -2, [0; 6], false),
    ("ppm", 1.0, -6, [0; 6], false),
    ("1", 1.0, 0, [0; 6], false),
];

pub(crate) const PREFIXES: &[(&str, i32)] = &[
    ("a", -18),
    ("f", -15),
    ("p", -12),
    ("n", -9),
    ("u", -6),
    ("µ", -6),
    ("μ", -6),
    ("m", -3),
    ("c", -2),
    ("k", 3),
    ("M", 6),
    ("G", 9),
    ("T", 12),
];

impl Unit {
    /// The unit of a ratio.
    pub const ONE: Self = Self { mantissa: 1.0, decimal: 0, dimension: Dimension::NONE };

    /// What one of this unit is in SI.
    pub fn factor(&self) -> f64 {
        self.scale("1")
    }

    /// Its dimension.
    pub const fn dimension(&self) -> Dimension {
        self.dimension
    }

    /// The SI unit of a dimension.
    pub(crate) const fn coherent(dimension: Dimension) -> Self {
        Self { mantissa: 1.0, decimal: 0, dimension }
    }

    /// The SI unit of this dimension as column names have it: `V`, `rad_per_s`; base units where it has no name.
    pub fn si_header(&self) -> String {
        let named = TABLE.iter().find(|row| {
            row.1 == 1.0 && row.2 == 0 && row.0.is_ascii() && Dimension::of(row.3) == self.dimension
        });
        named.map_or_else(|| self.dimension.header(), |row| row.0.to_owned())
    }

    /// The SI value of a decimal number written in this unit; rounded once where the unit is a power of ten.
    pub(crate) fn scale(&self, number: &str) -> f64 {
        let (digits, exponent) = match number.split_once(['e', 'E']) {
            Some((digits, exponent)) => (digits, exponent.parse().unwrap_or(0)),
            None => (number, 0_i32),
        };
        let shifted = format!("{digits}e{}", exponent.saturating_add(self.decimal));
        // The caller has checked that `number` is one; nothing but a number can come out.
        shifted.parse::<f64>().unwrap_or(f64::NAN) * self.mantissa
    }

    /// Reads a compound unit such as `rad/s^2/V`, `N m`, `aF/sqrt(Hz)` or `V/(rad/s)`.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let mut parser = UnitParser { text, rest: text.trim() };
        let unit = parser.product(0)?;
        if parser.rest.is_empty() { Ok(unit) } else { Err(parser.error("a `)` without its `(`")) }
    }

    /// One symbol with an optional prefix, such as `pF`.
    pub(crate) fn symbol(word: &str) -> Option<Self> {
        let find = |w: &str| TABLE.iter().find(|row| row.0 == w);
        let build = |row: &UnitRow, prefix| Self {
            mantissa: row.1,
            decimal: row.2 + prefix,
            dimension: Dimension::of(row.3),
        };
        if let Some(row) = find(word) {
            return Some(build(row, 0));
        }
        PREFIXES.iter().find_map(|(prefix, power)| {
            let row = find(word.strip_prefix(prefix)?).filter(|row| row.4)?;
            Some(build(row, *power))
        })
    }

    pub(crate) fn times(self, other: Self) -> Self {
        Self {
            mantissa: self.mantissa * other.mantissa,
            decimal: self.decimal.saturating_add(other.decimal),
            dimension: self.dimension.times(other.dimension),
        }
    }

    /// Raised to half of `halves`; `None` where the dimension would not stay a whole half, or overflows.
    pub(crate) fn to_half_power(self, halves: i16) -> Option<Self> {
        let doubled = self.decimal.checked_mul(i32::from(halves))?;
        let rest = doubled.rem_euclid(2);
        Some(Self {
            mantissa: self.mantissa.powf(f64::from(halves) / 2.0)
                * if rest == 1 { 10_f64.sqrt() } else { 1.0 },
            decimal: (doubled - rest) / 2,
            dimension: self.dimension.to_half_power(halves)?,
        })
    }
}

/// The nearest known unit, prefixed ones included, for a message.
fn nearest(word: &str) -> Option<String> {
    let prefixed = TABLE
        .iter()
        .filter(|row| row.4)
        .flat_map(|row| PREFIXES.iter().map(move |(prefix, _)| format!("{prefix}{}", row.0)));
    let plain = TABLE.iter().filter(|row| row.0 != "1").map(|row| row.0.to_owned());
    let lower = word.to_lowercase();
    plain
        .chain(prefixed)
        .map(|u| (strsim::damerau_levenshtein(&u.to_lowercase(), &lower), u))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, u)| *distance <= 1 && (*distance == 0 || u.chars().count() > 1))
        .map(|(_, u)| u)
}

struct UnitParser<'a> {
    text: &'a str,
    rest: &'a str,
}

impl<'a> UnitParser<'a> {
    fn error(&self, why: &'static str) -> UnitError {
        UnitError::Syntax { found: self.text.trim().to_owned(), why }
    }

    fn skip_space(&mut self) -> bool {
        let trimmed = self.rest.trim_start();
        let skipped = trimmed.len() != self.rest.len();
        self.rest = trimmed;
        skipped
    }

    fn take(&mut self, c: char) -> bool {
        let Some(rest) = self.rest.strip_prefix(c) else { return false };
        self.rest = rest;
        true
    }

    /// Factors joined by a space, `*`, `·` or `/`; a `/` divides by the next factor alone.
    fn product(&mut self, depth: u8) -> Result<Unit, UnitError> {
        // Nesting is bounded so that no text can exhaust the stack.
        if depth > 8 {
            return Err(self.error("too many brackets"));
        }
        self.skip_space();
        let mut unit = self.factor(depth)?;
        let mut divided = false;
        loop {
            let spaced = self.skip_space();
            if self.rest.is_empty() || self.rest.starts_with(')') {
                return Ok(unit);
            }
            if self.take('/') {
                self.skip_space();
                let divisor = self.factor(depth)?;
                unit = unit
                    .times(divisor.to_half_power(-2).ok_or_else(|| self.error("the exponent is too large"))?);
                divided = true;
            } else if self.take('*') || self.take('·') || self.take('⋅') || spaced {
                if divided {
                    return Err(self
                        .error("a product after a `/` can be read in two ways; write `a c/b` or `a/(b c)`"));
                }
                self.skip_space();
                unit = unit.times(self.factor(depth)?);
            } else {
                return Err(self.error("two units must be joined by a space, `*` or `/`"));
            }
        }
    }

    fn factor(&mut self, depth: u8) -> Result<Unit, UnitError> {
        let base = if self.take('(') {
            self.bracket(depth)?
        } else if let Some(rest) = self.rest.strip_prefix("sqrt(") {
            self.rest = rest;
            self.root(depth)?
        } else if let Some(rest) = self.rest.strip_prefix("√(") {
            self.rest = rest;
            self.root(depth)?
        } else if self.take('√') {
            let word = self.word();
            self.half(Self::look_up(word)?)?
        } else {
            let word = self.word();
            if word.is_empty() {
                return Err(self.error("a unit is missing or a character cannot stand here"));
            }
            Self::look_up(word)?
        };
        let halves = self.exponent()?;
        base.to_half_power(halves).ok_or_else(|| self.error("the exponent cannot be applied to this unit"))
    }

    fn bracket(&mut self, depth: u8) -> Result<Unit, UnitError> {
        let inner = self.product(depth + 1)?;
        if self.take(')') { Ok(inner) } else { Err(self.error("a `(` without its `)`")) }
    }

    fn root(&mut self, depth: u8) -> Result<Unit, UnitError> {
        let inner = self.bracket(depth)?;
        self.half(inner)
    }

    fn half(&self, unit: Unit) -> Result<Unit, UnitError> {
        unit.to_half_power(1).ok_or_else(|| self.error("the root of this unit is not supported"))
    }

    fn word(&mut self) -> &'a str {
        let is_word = |c: char| c.is_alphabetic() || matches!(c, '%' | 'Ω' | 'µ');
        let end = self.rest.find(|c: char| !is_word(c)).unwrap_or(self.rest.len());
        // `1` is a unit of its own, as in 1/s; any other digit belongs to an exponent or is an error.
        let end = if end == 0 && self.rest.starts_with('1') { 1 } else { end };
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word
    }

    fn look_up(word: &str) -> Result<Unit, UnitError> {
        Unit::symbol(word)
            .ok_or_else(|| UnitError::Unknown { found: word.to_owned(), suggestion: nearest(word) })
    }

    /// `^2`, `^-1`, `^0.5`, `²` or a bare digit as in `s2`; 1 where there is none. In halves.
    fn exponent(&mut self) -> Result<i16, UnitError> {
        for (superscript, halves) in [("⁻¹", -2), ("⁻²", -4), ("⁻³", -6), ("²", 4), ("³", 6), ("⁴", 8)]
        {
            if let Some(rest) = self.rest.strip_prefix(superscript) {
                self.rest = rest;
                return Ok(halves);
            }
        }
        let marked = self.take('^');
        let end = self
            .rest
            .find(|c: char| !(c.is_ascii_digit() || (marked && matches!(c, '.' | '-'))))
            .unwrap_or(self.rest.len());
        let (number, rest) = self.rest.split_at(end);
        if number.is_empty() {
            return if marked { Err(self.error("an exponent is missing after `^`")) } else { Ok(2) };
        }
        self.rest = rest;
        let halves = number.parse::<f64>().unwrap_or(f64::NAN) * 2.0;
        if halves.fract() == 0.0 && halves.abs() <= 16.0 && halves != 0.0 {
            #[allow(clippy::cast_possible_truncation)] // bounded by the line above
            Ok(halves as i16)
        } else {
            Err(self.error("an exponent must be a whole or half number between -8 and 8, and not 0"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ColumnHeader;

    /// The readers of files normalise units without this table: what they put behind a name means the same here.
    #[test]
    fn a_unit_that_a_reader_of_files_normalises_is_the_same_unit_here() {
        let mut symbols: Vec<String> = TABLE.iter().map(|row| row.0.to_owned()).collect();
        for row in TABLE.iter().filter(|row| row.4) {
            symbols.extend(PREFIXES.iter().map(|(prefix, _)| format!("{prefix}{}", row.0)));
        }
        for symbol in symbols {
            let ending =
                kalmems_formats::unit_ending(&symbol).unwrap_or_else(|| panic!("{symbol} is not known"));
            let unit = Unit::symbol(&symbol).unwrap();
            let name = if matches!(symbol.as_str(), "min" | "h") { "time" } else { "x" };
            assert_eq!(
                ColumnHeader::parse(&format!("{name}_{ending}")).unit,
                Some(unit),
                "{symbol}: {ending}"
            );
        }
        for (text, unit) in [
            ("Volts", "V"),
            ("millivolts", "mV"),
            ("µV", "uV"),
            ("degrees per second", "deg/s"),
            ("°/s", "deg/s"),
            ("m/s²", "m/s^2"),
            ("m/s2", "m/s^2"),
            ("kΩ", "kohm"),
            ("V/√Hz", "V/sqrt(Hz)"),
            ("N·m", "N m"),
            ("Newtons", "N"),
            ("picofarads", "pF"),
            ("1/s", "1/s"),
        ] {
            let ending = kalmems_formats::unit_ending(text).unwrap();
            let found = ColumnHeader::parse(&format!("x_{ending}")).unit;
            assert_eq!(found, Some(Unit::parse(unit).unwrap()), "{text}: {ending}");
        }
    }

    /// A name whose last word could be a unit keeps its unit, with every symbol.
    #[test]
    fn a_name_that_ends_like_a_unit_keeps_the_unit_behind_it() {
        for row in TABLE {
            let text = format!("time_s,Channel_{} [V]\n0,1\n", row.0);
            let hints = kalmems_formats::Hints::default();
            let table = kalmems_formats::read_csv(std::io::Cursor::new(text.into_bytes()), &hints).unwrap();
            let name = &table.description().columns[1].name;
            assert_eq!(ColumnHeader::parse(name).unit, Some(Unit::parse("V").unwrap()), "{name}");
        }
    }
}

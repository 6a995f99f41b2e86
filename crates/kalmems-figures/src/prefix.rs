//! SI prefixes for the labels of an axis.

use crate::text::{power_of_ten, unit_sign};

/// Units that take a prefix when they stand first, as in V, V/√Hz and rad/s.
const TAKE_PREFIX: [&str; 20] = [
    "s", "m", "g", "A", "K", "V", "F", "C", "W", "J", "N", "Pa", "T", "H", "S", "Hz", "rad", "ohm", "Ohm",
    "Ω",
];

/// From 10⁻²⁴ to 10²⁴ in steps of 10³.
const PREFIXES: [&str; 17] =
    ["y", "z", "a", "f", "p", "n", "µ", "m", "", "k", "M", "G", "T", "P", "E", "Z", "Y"];

/// A unit in which values of some size are short to write.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Prefixed {
    /// As printed: `µs`, or `10⁻⁶ V²` where no prefix can stand.
    pub(crate) unit: String,
    /// The power of ten by which values are divided.
    pub(crate) exponent: i32,
    /// Whether the power stands there as a number.
    pub(crate) is_power: bool,
}

impl Prefixed {
    /// The unit times the power of ten of the first digit of a value.
    pub(crate) fn power(unit: &str, value: f64) -> Self {
        #[allow(clippy::cast_possible_truncation)] // a cast saturates, and exponents lie within ±400
        let exponent = (libm::log10(value.abs()) + 1e-9).floor() as i32;
        Self { unit: times_ten_to(exponent, &unit_sign(unit)), exponent, is_power: true }
    }

    /// What stands between a number and the unit.
    pub(crate) fn joint(&self) -> &'static str {
        if self.is_power { " · " } else { " " }
    }
}

/// The unit for values up to `largest`.
pub(crate) fn prefixed(unit: &str, largest: f64) -> Prefixed {
    // A unit that has a prefix takes another in its place: µm and not 10³ nm.
    if let Some((base, exponent)) = without_prefix(unit) {
        let scale = 10_f64.powi(exponent);
        let better = prefixed(base, largest * scale);
        // A plain number of the unit as it is reads as well.
        let is_fine = (1.0..1000.0).contains(&largest.abs()) || largest == 0.0 || !largest.is_finite();
        if is_fine || better.is_power {
            return Prefixed { unit: unit_sign(unit), exponent: 0, is_power: false };
        }
        return Prefixed { exponent: better.exponent - exponent, ..better };
    }
    let sign = unit_sign(unit);
    let plain = Prefixed { unit: sign.clone(), exponent: 0, is_power: false };
    let decade = libm::log10(largest.abs());
    if !decade.is_finite() {
        return plain;
    }
    #[allow(clippy::cast_possible_truncation)] // within ±400
    // The small amount holds 10⁻⁶ where its logarithm is rounded down.
    let thousands = ((decade + 1e-9) / 3.0).floor() as i32;
    let exponent = 3 * thousands;
    if exponent == 0 {
        return plain;
    }
    let symbol = usize::try_from(thousands + 8).ok().and_then(|i| PREFIXES.get(i));
    if let Some(symbol) = symbol.filter(|_| takes_prefix(unit)) {
        // Seconds and radians do not become kiloseconds.
        if exponent > 0 && matches!(unit.trim(), "s" | "rad") {
            return plain;
        }
        return Prefixed { unit: format!("{symbol}{sign}"), exponent, is_power: false };
    }
    // Without a prefix, numbers may be somewhat longer before a power of ten has to explain them.
    if (-2.0..5.0).contains(&decade) {
        return plain;
    }
    Prefixed { unit: times_ten_to(exponent, &sign), exponent, is_power: true }
}

/// A unit without the prefix that it has, and the prefix's power of ten: nm as m and −9.
fn without_prefix(unit: &str) -> Option<(&str, i32)> {
    const WRITTEN: [(char, i32); 9] =
        [('f', -15), ('p', -12), ('n', -9), ('u', -6), ('µ', -6), ('m', -3), ('k', 3), ('M', 6), ('G', 9)];
    let unit = unit.trim();
    // Such as m, Pa and Hz, which begin like a prefix or have none; the kilogram is a unit of its own.
    if takes_prefix(unit) || unit.starts_with("kg") {
        return None;
    }
    let first = unit.chars().next()?;
    let (_, exponent) = WRITTEN.iter().find(|(prefix, _)| *prefix == first)?;
    let base = unit.get(first.len_utf8()..)?;
    takes_prefix(base).then_some((base, *exponent))
}

fn times_ten_to(exponent: i32, sign: &str) -> String {
    let power = power_of_ten(exponent);
    if sign.is_empty() { power } else { format!("{power} {sign}") }
}

/// Whether the first symbol of a unit may have a prefix: yes for V/√Hz, no for V², whose prefix is squared.
fn takes_prefix(unit: &str) -> bool {
    let unit = unit.trim();
    let end = unit.find(|c: char| !c.is_alphabetic()).unwrap_or(unit.len());
    let (symbol, rest) = unit.split_at(end);
    TAKE_PREFIX.contains(&symbol) && rest.chars().next().is_none_or(|c| matches!(c, '/' | ' ' | '*' | '·'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_fits_the_size() {
        for (unit, largest, printed, exponent) in [
            ("s", 22.3e-3, "ms", -3),
            ("s", 1e-6, "µs", -6),
            ("s", 5e3, "s", 0),
            ("Hz", 15.7e3, "kHz", 3),
            ("F", 5.7e-12, "pF", -12),
            ("V", 1.0, "V", 0),
            ("V", 999.0, "V", 0),
            ("deg", 0.05, "deg", 0),
            ("deg", 12_000.0, "deg", 0),
            ("deg", 0.005, "10⁻³ deg", -3),
            ("%", 3.0, "%", 0),
            ("V^2", 3e-6, "10⁻⁶ V²", -6),
            ("V²", 3e-6, "10⁻⁶ V²", -6),
            ("kg m^2", 1e-14, "10⁻¹⁵ kg·m²", -15),
            ("N m", 1e-4, "µN·m", -6),
            ("1", 1e-9, "10⁻⁹", -9),
            ("V", 1e-30, "10⁻³⁰ V", -30),
            ("nm", 3e6, "mm", 6),
            ("nm", 30.0, "nm", 0),
            ("um/s", 2e-3, "nm/s", -3),
            ("mg", 5e4, "g", 3),
            ("fF", 1e-2, "aF", -3),
            ("mm^2", 1e6, "10⁶ mm²", 6),
            ("V", 0.0, "V", 0),
        ] {
            let got = prefixed(unit, largest);
            assert_eq!((got.unit.as_str(), got.exponent), (printed, exponent), "{unit} {largest}");
        }
    }
}

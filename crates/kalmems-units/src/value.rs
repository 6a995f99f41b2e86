//! A number with its unit, as written in an experiment file.

use super::uncertainty::{self, split};
use super::{Kind, Unit, UnitError};

/// A number with a unit, in SI, the text it came from, and its standard uncertainty where one is stated.
#[derive(Clone, Debug, PartialEq)]
pub struct Value {
    text: String,
    /// The unit as written, which may be that of value and uncertainty and stand behind both.
    unit_text: String,
    si: f64,
    unit: Unit,
    uncertainty: Option<f64>,
}

impl Value {
    /// Reads `"-0.3574 V/pF"`, `"15 kHz"`, `"0.3 %"` or, for a ratio, `"0.3"`; each with its standard uncertainty behind it, if that is
    /// stated: `"15 kHz ± 0.1 %"`, `"15 kHz ± 20 Hz"`, `"15.00 ± 0.02 kHz"`. `+/-` stands for ±. The per cent are those of the value,
    /// but for a ratio that is in per cent itself, `"5 % ± 1 %"`, where they are added.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let trimmed = text.trim();
        let wrong = || UnitError::Number { found: trimmed.to_owned() };
        let (value, stated) = split(trimmed);
        let (number, unit) = value.split_at(number_length(value));
        if number.is_empty() {
            return Err(wrong());
        }
        // Of `15.00 ± 0.02 kHz` the unit is that of both.
        let shared = stated.filter(|_| unit.trim().is_empty()).and_then(uncertainty::unit_of_both);
        let unit_text = shared.unwrap_or(unit).trim();
        let unit = if unit_text.is_empty() { Unit::ONE } else { Unit::parse(unit_text)? };
        let si = unit.scale(number);
        if !si.is_finite() {
            return Err(wrong());
        }
        let uncertainty =
            stated.map(|stated| uncertainty::parse(trimmed, stated, (si, unit, unit_text))).transpose()?;
        let [text, unit_text] = [trimmed, unit_text].map(str::to_owned);
        Ok(Self { text, unit_text, si, unit, uncertainty })
    }

    /// The standard uncertainty that is stated behind it, in SI.
    pub const fn uncertainty(&self) -> Option<f64> {
        self.uncertainty
    }

    /// The text as written, without the uncertainty.
    pub fn nominal(&self) -> String {
        match self.unit_text.as_str() {
            _ if self.uncertainty.is_none() => self.text.clone(),
            "" => self.number().to_owned(),
            unit => format!("{} {unit}", self.number()),
        }
    }

    fn number(&self) -> &str {
        &self.text[..number_length(&self.text)]
    }

    /// The value in SI units.
    pub const fn si(&self) -> f64 {
        self.si
    }

    /// The text as written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The unit as written.
    pub const fn unit(&self) -> Unit {
        self.unit
    }

    /// The number as written, and the unit as written behind it; the unit is empty for a plain ratio.
    pub fn parts(&self) -> (&str, &str) {
        (self.number(), &self.unit_text)
    }

    /// As a factor on numbers in a unit: the unit of the products, and what the number 1 becomes in SI, rounded once where
    /// both units are powers of ten.
    pub fn times_unit(&self, unit: Unit) -> (Unit, f64) {
        let product = unit.times(self.unit);
        (product, product.scale(self.parts().0))
    }

    /// The SI value, where its dimension is that of `kind`.
    pub fn of_kind(&self, kind: &Kind) -> Result<f64, UnitError> {
        if kind.accepts(self.unit.dimension()) {
            return Ok(self.si);
        }
        Err(UnitError::Dimension {
            found: self.text.clone(),
            dimension: self.unit.dimension(),
            expected: kind.to_string(),
            example: kind.example,
        })
    }
}

/// The length of the decimal number that `text` starts with, its sign included; 0 if it starts with none.
pub fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let sign = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    let whole = digits(sign);
    let mut end = sign + whole;
    let mut count = whole;
    if bytes.get(end) == Some(&b'.') {
        let fraction = digits(end + 1);
        count += fraction;
        end += 1 + fraction;
    }
    if count == 0 {
        return 0;
    }
    // An exponent counts only where digits follow it: `5 eggs` has none.
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kind;

    #[test]
    fn decimal_units_round_once() {
        for (text, si) in [
            ("1.10e-4 N m", 1.10e-4),
            ("5.71 pF", 5.71e-12),
            ("-0.3574 V/pF", -0.3574e12),
            ("0.151 aF/sqrt(Hz)", 0.151e-18),
            ("3782.5 rad/s^2/V", 3782.5),
            ("17.86 kohm", 17.86e3),
            ("17.86 kΩ", 17.86e3),
            ("1.92e-4 V^2", 1.92e-4),
            ("8 ms", 8e-3),
            ("1.15e-14 kg m²", 1.15e-14),
            ("0.3 %", 0.3e-2),
            ("624.6 Hz", 624.6),
            ("90V", 90.0),
            ("2.82e-3 V s/rad", 2.82e-3),
            ("50 V/(m/s)", 50.0),
            ("1 mm^2", 1e-6),
            (".5 µm", 0.5e-6),
        ] {
            assert_eq!(Value::parse(text).unwrap().si().to_bits(), f64::to_bits(si), "{text}");
        }
    }

    #[test]
    fn other_units_multiply() {
        let rate = Value::parse("0.1 deg/s").unwrap();
        approx::assert_relative_eq!(rate.si(), 0.1 * std::f64::consts::PI / 180.0, max_relative = 1e-15);
        assert!(rate.of_kind(&kind::ANGULAR_RATE).is_ok());
        approx::assert_relative_eq!(Value::parse("20 %/min").unwrap().si(), 0.2 / 60.0, max_relative = 1e-15);
        approx::assert_relative_eq!(
            Value::parse("1 V/sqrt(kHz)").unwrap().si(),
            1.0 / 1000_f64.sqrt(),
            max_relative = 1e-15
        );
    }

    /// The second method: fend, a unit calculator with exact rationals, on every unit of the five systems.
    #[test]
    fn agrees_with_an_exact_unit_calculator() {
        for (ours, theirs, si) in [
            ("17.86 kohm", "17.86 kiloohm", "ohm"),
            ("5.71 pF", "5.71 picofarad", "farad"),
            ("-0.3574 V/pF", "-0.3574 volt/picofarad", "volt/farad"),
            ("3782.5 rad/s^2/V", "3782.5 radian/second^2/volt", "radian/second^2/volt"),
            ("19.2 um", "19.2 micrometer", "meter"),
            ("2.82 mV s/rad", "2.82 millivolt second/radian", "volt second/radian"),
            ("1 mm^2", "1 millimeter^2", "meter^2"),
            ("3 bar", "3 bar", "pascal"),
            ("5 mN/m", "5 millinewton/meter", "newton/meter"),
        ] {
            let mut context = fend_core::Context::new();
            let answer = fend_core::evaluate(&format!("{theirs} / (1 {si}) to 30 dp"), &mut context)
                .unwrap_or_else(|e| panic!("{theirs}: {e}"));
            let answer = answer.get_main_result().trim_start_matches("approx. ").to_owned();
            let number: f64 = answer.split_whitespace().next().unwrap().parse().unwrap();
            approx::assert_relative_eq!(Value::parse(ours).unwrap().si(), number, max_relative = 1e-13);
        }
    }

    #[test]
    fn an_angle_is_no_frequency_and_no_ratio() {
        let rate = Value::parse("100 rad/s").unwrap();
        assert!(rate.of_kind(&kind::FREQUENCY).is_err());
        assert!(Value::parse("100 Hz").unwrap().of_kind(&kind::ANGULAR_RATE).is_err());
        assert!(Value::parse("0.2").unwrap().of_kind(&kind::ANGLE).is_err());
        assert!(Value::parse("1.1e-4 N m/rad").unwrap().of_kind(&kind::STIFFNESS).is_ok());
    }

    #[test]
    fn a_wrong_value_is_refused_with_the_reason() {
        for (text, message) in [
            ("", "does not start with a finite number"),
            ("fast", "does not start with a finite number"),
            ("nan V", "does not start with a finite number"),
            ("1e999 V", "does not start with a finite number"),
            ("5 FF", "`FF` is not a unit"),
            ("5 Farad", "`Farad` is not a unit"),
            ("5 hz", "did you mean `Hz`?"),
            ("5 V/rad s", "can be read in two ways"),
            ("5 V/(m/s", "a `(` without its `)`"),
            ("5 V)", "a `)` without its `(`"),
            ("5 V^", "an exponent is missing"),
            ("5 V^99", "an exponent must be"),
            ("5 V//s", "a unit is missing"),
            ("5 ((((((((((V))))))))))", "too many brackets"),
        ] {
            let error = Value::parse(text).unwrap_err().to_string();
            assert!(error.contains(message), "{text}: {error}");
        }
        let error = Value::parse("3 V").unwrap().of_kind(&kind::STIFFNESS).unwrap_err().to_string();
        insta::assert_snapshot!(error, @"`3 V` has the dimension V; expected a torsional stiffness (N m), such as `1.10e-4 N m`");
    }
}

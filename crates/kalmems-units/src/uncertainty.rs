//! The standard uncertainty that is stated behind a value.

use super::{Unit, UnitError, number_length};

/// What stands between a value and its uncertainty.
const MARKS: [&str; 2] = ["±", "+/-"];

/// A value and what is stated of its uncertainty, as they are written.
pub(crate) fn split(text: &str) -> (&str, Option<&str>) {
    let first = MARKS.iter().filter_map(|mark| Some((text.find(mark)?, mark))).min();
    first
        .map_or((text, None), |(place, mark)| (text[..place].trim(), Some(text[place + mark.len()..].trim())))
}

/// The unit of `0.02 kHz` where that is the unit of the value before it, too: any but per cent.
pub(crate) fn unit_of_both(stated: &str) -> Option<&str> {
    Some(stated[number_length(stated)..].trim()).filter(|unit| !unit.is_empty() && *unit != "%")
}

/// The standard uncertainty in SI of a value in SI, of this unit.
pub(crate) fn parse(
    whole: &str,
    stated: &str,
    (si, unit, unit_text): (f64, Unit, &str),
) -> Result<f64, UnitError> {
    let refused = |why: String| UnitError::Uncertainty { found: whole.to_owned(), why };
    let (number, own) = stated.split_at(number_length(stated));
    let own = own.trim();
    if number.is_empty() || number.starts_with(['-', '+']) {
        return Err(refused("after ± a number of 0 or more is expected, such as `± 0.3 %`".to_owned()));
    }
    let found = match own {
        "%" if unit_text != "%" => si.abs() * Unit::parse("%")?.scale(number),
        "" if unit == Unit::ONE => Unit::ONE.scale(number),
        "" => {
            let why = format!(
                "the uncertainty has no unit; write `± {number} {unit_text}`, or per cent of the value"
            );
            return Err(refused(why));
        }
        own => {
            let own = Unit::parse(own)?;
            if own.dimension() != unit.dimension() {
                let why = format!(
                    "the uncertainty has the dimension {}, the value {}",
                    own.dimension(),
                    unit.dimension()
                );
                return Err(refused(why));
            }
            own.scale(number)
        }
    };
    if found.is_finite() { Ok(found) } else { Err(refused("the uncertainty is not finite".to_owned())) }
}

#[cfg(test)]
mod tests {
    use crate::Value;

    #[test]
    fn uncertainties_are_read_in_every_form() {
        for (text, si, sd, nominal) in [
            ("1.1033e-4 N m ± 0.3 %", 1.1033e-4, 1.1033e-4 * 3e-3, "1.1033e-4 N m"),
            ("15 kHz ± 20 Hz", 15e3, 20.0, "15 kHz"),
            ("15.00 ± 0.02 kHz", 15e3, 20.0, "15.00 kHz"),
            ("-2 V +/- 10 mV", -2.0, 0.01, "-2 V"),
            ("-2 V ± 1 %", -2.0, 0.02, "-2 V"),
            ("0.0021 ± 5 %", 0.0021, 0.0021 * 0.05, "0.0021"),
            ("0.0021 ± 0.0001", 0.0021, 0.0001, "0.0021"),
            ("5 % ± 1 %", 0.05, 0.01, "5 %"),
            ("3 N/m ± 0", 3.0, f64::NAN, "3 N/m"),
        ] {
            let value = Value::parse(text);
            if sd.is_nan() {
                assert!(value.is_err(), "{text}: {value:?}");
                continue;
            }
            let value = value.unwrap();
            assert_eq!((value.si(), value.text(), &*value.nominal()), (si, text, nominal));
            approx::assert_relative_eq!(value.uncertainty().unwrap(), sd, max_relative = 1e-15);
            assert_eq!(Value::parse(nominal).unwrap().si(), si);
        }
        assert_eq!(Value::parse("3 N/m").unwrap().uncertainty(), None);
    }

    #[test]
    fn a_wrong_uncertainty_is_refused_with_the_reason() {
        for (text, message) in [
            ("3 N/m ±", "a number of 0 or more is expected"),
            ("3 N/m ± -1 %", "a number of 0 or more is expected"),
            ("3 N/m ± 0.1", "write `± 0.1 N/m`"),
            ("3 N/m ± 1 V", "the uncertainty has the dimension"),
            ("3 N/m ± 1 Furlong", "`Furlong` is not a unit"),
            ("± 3 %", "does not start with a finite number"),
            ("3 N/m ± 1 % ± 2 %", "cannot read the unit"),
            ("3 N/m ± 1e999 N/m", "is not finite"),
        ] {
            let error = Value::parse(text).unwrap_err().to_string();
            assert!(error.contains(message), "{text}: {error}");
        }
    }
}

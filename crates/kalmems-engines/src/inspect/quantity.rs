//! Quantities as people read them: five digits, and a prefix before the unit.

use crate::units::{ColumnHeader, Unit};

/// Units to choose from where a column is not in SI.
const SI_UNITS: &[&str] = &[
    "V",
    "A",
    "F",
    "C",
    "ohm",
    "S",
    "H",
    "Hz",
    "m",
    "s",
    "K",
    "rad",
    "rad/s",
    "rad/s²",
    "m/s",
    "m/s²",
    "N",
    "N m",
    "Pa",
    "W",
    "N/m",
    "1/m",
    "m²",
    "V²",
    "V/√(Hz)",
    "F/√(Hz)",
];

const PREFIXES: &[(i32, &str)] = &[
    (-18, "a"),
    (-15, "f"),
    (-12, "p"),
    (-9, "n"),
    (-6, "µ"),
    (-3, "m"),
    (0, ""),
    (3, "k"),
    (6, "M"),
    (9, "G"),
    (12, "T"),
];

/// The SI unit of a column's values; empty where it has none.
pub(super) fn si_unit(header: &ColumnHeader) -> String {
    let Some(unit) = header.unit else { return String::new() };
    if header.unit_text == "1" {
        return String::new();
    }
    if let Some(length) = header.unit_text.strip_prefix("per_").filter(|_| unit.factor() == 1.0) {
        return format!("1/{length}");
    }
    // Compared as parsed, so that the factor is exactly 1.
    if unit.factor().to_bits() == 1_f64.to_bits() {
        return header
            .unit_text
            .replace("_per_rtHz", "/√Hz")
            .replace("_per_", "/")
            .replace('_', " ")
            .replace('2', "²")
            .replace('3', "³");
    }
    let same = |symbol: &&&str| Unit::parse(symbol).is_ok_and(|u| u.dimension() == unit.dimension());
    let known = SI_UNITS.iter().find(same).map(|symbol| symbol.replace("√(Hz)", "√Hz"));
    known.unwrap_or_else(|| match unit.dimension().to_string().as_str() {
        "1" => String::new(),
        base => base.to_owned(),
    })
}

/// A value in SI with its unit, such as `31.35 kHz`.
pub fn quantity(value: f64, unit: &str) -> String {
    let Some((exponent, power, prefix)) = prefix(value, unit) else {
        return join(&number(value), unit);
    };
    let scaled = format!("{value:.4e}").parse().unwrap_or(value) / 10_f64.powi(power);
    let decimals = usize::try_from(4 - (exponent - power)).unwrap_or(0);
    format!("{} {prefix}{unit}", trimmed(&format!("{scaled:.decimals$}")))
}

/// The unit with the prefix that fits a value in SI, and how many of it one of the unit is: for 31350 Hz `kHz` and 0.001.
pub fn fitting_unit(value: f64, unit: &str) -> (String, f64) {
    match prefix(value, unit) {
        Some((_, power, prefix)) => (format!("{prefix}{unit}"), 10_f64.powi(-power)),
        None => (unit.to_owned(), 1.0),
    }
}

/// The exponent of a value's first digit, and the power of ten with the prefix that fits; `None` where none may stand before the unit.
fn prefix(value: f64, unit: &str) -> Option<(i32, i32, &'static str)> {
    let first = unit.split([' ', '/']).next().unwrap_or_default();
    let takes_prefix =
        !first.is_empty() && first.chars().all(char::is_alphabetic) && !matches!(first, "kg" | "deg");
    if !takes_prefix || value == 0.0 || !value.is_finite() {
        return None;
    }
    let rounded = format!("{value:.4e}");
    let exponent: i32 = rounded.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0);
    let power = exponent.div_euclid(3) * 3;
    let (_, prefix) = PREFIXES.iter().find(|(p, _)| *p == power)?;
    Some((exponent, power, prefix))
}

/// A number of five digits, with an exponent where it is very small or large.
pub(super) fn number(value: f64) -> String {
    let exponential = format!("{value:.4e}");
    let Ok(rounded) = exponential.parse::<f64>() else { return exponential };
    if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) {
        return format!("{rounded}");
    }
    match exponential.split_once('e') {
        Some((digits, exponent)) => format!("{}e{exponent}", trimmed(digits)),
        None => exponential,
    }
}

fn join(number: &str, unit: &str) -> String {
    if unit.is_empty() { number.to_owned() } else { format!("{number} {unit}") }
}

/// Without zeros at the end of the decimals.
fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_those_of_si() {
        for (column, unit) in [
            ("cap_V", "V"),
            ("cap_pF", "F"),
            ("gyro_rad_per_s", "rad/s"),
            ("gyro_dps", "rad/s"),
            ("accel_m_per_s2", "m/s²"),
            ("accel_gn", "m/s²"),
            ("noise_nV_per_rtHz", "V/√Hz"),
            ("noise_V_per_rtHz", "V/√Hz"),
            ("load_g", "kg"),
            ("nis_1", ""),
            ("part_ppm", ""),
            ("wavenumber_per_m", "1/m"),
            ("wavenumber_per_cm", "1/m"),
            ("record", ""),
        ] {
            assert_eq!(si_unit(&ColumnHeader::parse(column)), unit, "{column}");
        }
    }

    #[test]
    fn the_unit_fits_the_value() {
        for (value, unit, fitting) in [
            (31350.0, "Hz", ("kHz", 1e-3)),
            (2.2e-4, "rad", ("µrad", 1e6)),
            (0.0, "V", ("V", 1.0)),
            (5e-3, "deg", ("deg", 1.0)),
        ] {
            assert_eq!(fitting_unit(value, unit), (fitting.0.to_owned(), fitting.1));
        }
    }

    #[test]
    fn quantities_have_five_digits_and_a_prefix() {
        for (value, unit, text) in [
            (31350.0, "Hz", "31.35 kHz"),
            (-0.093_14, "V", "-93.14 mV"),
            (0.999_999_9, "V", "1 V"),
            (999.999_9, "V", "1 kV"),
            (7.906_687_064e-14, "F", "79.067 fF"),
            (0.0, "V", "0 V"),
            (12.0, "rad/s", "12 rad/s"),
            (5e-3, "m²", "0.005 m²"),
            (5e-7, "kg", "5e-7 kg"),
            (1e-30, "V", "1e-30 V"),
            (-123_456.0, "", "-123460"),
            (1.234_567e9, "", "1.2346e9"),
            (100.0, "V", "100 V"),
            (f64::NAN, "V", "NaN V"),
        ] {
            assert_eq!(quantity(value, unit), text);
        }
    }
}

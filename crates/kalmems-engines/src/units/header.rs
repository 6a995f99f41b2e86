//! Column names with units: `name_unit`.

use super::Unit;

/// A column's name as the recording has it, and the unit that its ending says.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The whole name, such as `gyro_rad_per_s`; what an experiment file refers to.
    pub column: String,
    /// The unit, or `None` where the ending is no unit, as in `sample_index`.
    pub unit: Option<Unit>,
    /// The unit as it stands there, such as `rad_per_s`; empty where there is none.
    pub unit_text: String,
    /// Whether the settings say the unit and not the name.
    pub is_stated: bool,
}

impl Header {
    /// Takes the longest ending that is a unit: `damping_N_m_s` is in N·m·s, `cap1A_on_V` in V.
    ///
    /// In an ending, `per` divides by the next word, digits are exponents (`s2`), and `rt` marks a square
    /// root (`F_per_rtHz`). `_1` says that a column has no dimension.
    pub fn parse(column: &str) -> Self {
        let column = column.trim();
        let words: Vec<&str> = column.split('_').collect();
        // A wavenumber is a number per length: nothing stands before the `per` of its unit.
        if let ["wavenumber", "per", length] = words[..]
            && let Some(unit) = Unit::symbol(length).and_then(|unit| unit.to_half_power(-2))
        {
            let unit_text = format!("per_{length}");
            return Self { column: column.to_owned(), unit: Some(unit), unit_text, is_stated: false };
        }
        // The first word is always a name, so that a column called `m` is not taken for metres.
        for start in 1..words.len() {
            // What stands after a `per` is no unit by itself.
            if words[start - 1] == "per" {
                break;
            }
            if let Some(unit) = ending(&words[start..]) {
                return Self {
                    column: column.to_owned(),
                    unit: Some(unit),
                    unit_text: words[start..].join("_"),
                    is_stated: false,
                };
            }
        }
        Self { column: column.to_owned(), unit: None, unit_text: String::new(), is_stated: false }
    }
}

fn ending(words: &[&str]) -> Option<Unit> {
    let mut unit = Unit::ONE;
    let mut sign = 2;
    let mut divided = false;
    let mut expects_unit = true;
    for word in words {
        if *word == "per" {
            // Nothing before `per`, or two of them in a row, is no unit.
            if expects_unit {
                return None;
            }
            (sign, divided, expects_unit) = (-2, true, true);
            continue;
        }
        // After a division each further factor needs its own `per`: `V_per_m_s` could be read in two ways.
        if divided && !expects_unit {
            return None;
        }
        unit = unit.times(factor(word)?.to_half_power(sign)?);
        expects_unit = false;
    }
    if expects_unit { None } else { Some(unit) }
}

fn factor(word: &str) -> Option<Unit> {
    if let Some(root) = word.strip_prefix("rt") {
        return Unit::symbol(root)?.to_half_power(1);
    }
    if word == "1" {
        return Some(Unit::ONE);
    }
    let digits = word.find(|c: char| c.is_ascii_digit()).unwrap_or(word.len());
    let (symbol, exponent) = word.split_at(digits);
    let exponent = if exponent.is_empty() { 1 } else { exponent.parse::<i16>().ok()? };
    if !(1..=8).contains(&exponent) {
        return None;
    }
    Unit::symbol(symbol)?.to_half_power(2 * exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_unit_ending_wins() {
        for (column, unit, text) in [
            ("time_s", "s", "s"),
            ("cap1A_on_V", "V", "V"),
            ("gyro_rad_per_s", "rad/s", "rad_per_s"),
            ("accel_m_per_s2", "m/s^2", "m_per_s2"),
            ("damping_N_m_s", "N m s", "N_m_s"),
            ("gain_rad_per_s_per_V", "rad/s/V", "rad_per_s_per_V"),
            ("density_F_per_rtHz", "F/sqrt(Hz)", "F_per_rtHz"),
            ("readout_V2", "V^2", "V2"),
            ("nis_1", "1", "1"),
            ("wavenumber_per_cm", "1/cm", "per_cm"),
            ("wavenumber_per_m", "1/m", "per_m"),
        ] {
            let header = Header::parse(column);
            assert_eq!(header.unit, Some(Unit::parse(unit).unwrap()), "{column}");
            assert_eq!(header.unit_text, text, "{column}");
        }
    }

    #[test]
    fn si_endings_read_back() {
        for (text, ending) in [
            ("mV", "V"),
            ("deg/s", "rad_per_s"),
            ("Hz", "Hz"),
            ("%", "1"),
            ("mm/s^2", "m_per_s2"),
            ("um", "m"),
        ] {
            let unit = Unit::parse(text).unwrap();
            let found = unit.si_header();
            assert_eq!(found, ending);
            let back = Header::parse(&format!("x_{found}")).unit.unwrap();
            assert_eq!((back.dimension(), back.factor()), (unit.dimension(), 1.0), "{text}: {found}");
        }
        // Without a name of their own: base units that read back.
        for text in ["aF/sqrt(Hz)", "rad/s^2/V", "rad^2/s^3", "1/V"] {
            let unit = Unit::parse(text).unwrap();
            let back = Header::parse(&format!("x_{}", unit.si_header())).unit.unwrap();
            assert_eq!(back.dimension(), unit.dimension(), "{text}: {}", unit.si_header());
        }
    }

    #[test]
    fn what_is_no_unit_is_none() {
        for column in ["sample_index", "record", "direction", "m", "x_per_s", "x_V_per", "x_V_per_m_s2x", ""]
        {
            assert_eq!(Header::parse(column).unit, None, "{column}");
        }
    }
}

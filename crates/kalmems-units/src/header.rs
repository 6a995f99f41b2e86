//! Column names with units: `name_unit`.

use crate::Unit;

/// A column's name as the recording has it, and the unit that its ending says.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnHeader {
    /// The whole name, such as `gyro_rad_per_s`; what an experiment file refers to.
    pub column: String,
    /// The unit, or `None` where the ending is no unit, as in `sample_index`.
    pub unit: Option<Unit>,
    /// The unit as it stands there, such as `rad_per_s`; empty where there is none.
    pub unit_text: String,
    /// Whether the settings say the unit and not the name.
    pub is_stated: bool,
}

impl ColumnHeader {
    /// Takes the longest ending that is a unit: `damping_N_m_s` is in N·m·s, `cap1A_on_V` in V.
    ///
    /// In an ending, `per` divides by the next word, digits are exponents (`s2`), and `rt` marks a square
    /// root (`F_per_rtHz`). `_1` says that a column has no dimension.
    ///
    /// `g` is the acceleration of free fall where the name says that it is an acceleration (`accel_g`, `ax_mg`), and gram
    /// elsewhere (`load_g`); `gn` is the acceleration in any column. `min` and `h` are minutes and hours in the name of a time (`time_min`)
    /// and words of a name elsewhere (`pos_min`). Where no ending is a unit, the last word is read as
    /// the files of instruments are: `time_sec`, `drive_Volts`, `rate_deg/s`.
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
            let name = &words[..start];
            if matches!(words[start..], ["min" | "h"]) && !says_time(name) {
                break;
            }
            if let Some(unit) = ending(&words[start..], says_acceleration(name)) {
                return Self {
                    column: column.to_owned(),
                    unit: Some(unit),
                    unit_text: words[start..].join("_"),
                    is_stated: false,
                };
            }
        }
        let word = words
            .split_last()
            .and_then(|(last, name)| name.last().filter(|before| **before != "per").and(spelt(last)));
        let unit = word.as_deref().and_then(|word| ending(&word.split('_').collect::<Vec<_>>(), false));
        let unit_text = word.filter(|_| unit.is_some()).unwrap_or_default();
        Self { column: column.to_owned(), unit, unit_text, is_stated: false }
    }
}

/// A column among others of its file: `Voltage_1` beside `Voltage_0` or `Voltage_2` is numbered, and `_1` no unit.
impl ColumnHeader {
    /// The name of a column among these, and its unit.
    pub fn parse_among<'a>(column: &str, mut names: impl Iterator<Item = &'a str>) -> Self {
        let header = Self::parse(column);
        let Some(stem) = column.trim().strip_suffix("_1").filter(|_| header.unit_text == "1") else {
            return header;
        };
        let is_numbered = |name: &str| {
            let number = name.trim().strip_prefix(stem).and_then(|rest| rest.strip_prefix('_'));
            number.is_some_and(|number| number != "1" && number.parse::<u32>().is_ok())
        };
        if names.any(is_numbered) {
            return Self { unit: None, unit_text: String::new(), ..header };
        }
        header
    }
}

/// Whether the words of a name say that it is a time: `time`, `t`, `duration_of`.
fn says_time(words: &[&str]) -> bool {
    const TIMES: [&str; 8] = ["t", "zeit", "temps", "tiempo", "tempo", "tijd", "clock", "duration"];
    let mut words = words.iter().flat_map(|word| word.split_whitespace()).map(str::to_lowercase);
    words.any(|word| word.starts_with("time") || word == "elapsed" || TIMES.contains(&word.as_str()))
}

/// Whether the words of a name say that it is an acceleration: `accel`, `Acceleration`, `ax`.
fn says_acceleration(words: &[&str]) -> bool {
    let mut words = words.iter().flat_map(|word| word.split_whitespace()).map(str::to_lowercase);
    words.any(|word| word.starts_with("acc") || matches!(word.as_str(), "a" | "ax" | "ay" | "az"))
}

/// The ending for which a word stands that is spelt out; one or two letters at the end of a name are no unit.
fn spelt(word: &str) -> Option<String> {
    let letters = word.chars().count();
    // `cap_second` is the second one, and `cap_min` the smallest.
    let other = word.eq_ignore_ascii_case("second")
        || word == "min"
        || letters < 3 && !word.eq_ignore_ascii_case("hz");
    (!other).then(|| kalmems_formats::unit_ending(word))?
}

fn ending(words: &[&str], acceleration: bool) -> Option<Unit> {
    let mut unit = Unit::ONE;
    let mut sign = 2;
    let mut divided = false;
    let mut expects_unit = true;
    for (index, word) in words.iter().enumerate() {
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
        // A ratio times a unit is a name that ends with a number, such as `CH_1` in V; `1_per_s` is none.
        if *word == "1" && words.len() > 1 && (index > 0 || words.get(1) != Some(&"per")) {
            return None;
        }
        let gravity =
            || word.strip_suffix('g').filter(|prefix| matches!(*prefix, "" | "m" | "u" | "µ" | "μ" | "n"));
        let factor = match gravity().filter(|_| acceleration) {
            Some(prefix) => Unit::symbol(&format!("{prefix}gn"))?,
            None => factor(word)?,
        };
        unit = unit.times(factor.to_half_power(sign)?);
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
            ("time_min", "min", "min"),
            ("Elapsed Time_h", "h", "h"),
            ("pos_minutes", "min", "min"),
            ("rate_rad_per_h", "rad/h", "rad_per_h"),
        ] {
            let header = ColumnHeader::parse(column);
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
            let back = ColumnHeader::parse(&format!("x_{found}")).unit.unwrap();
            assert_eq!((back.dimension(), back.factor()), (unit.dimension(), 1.0), "{text}: {found}");
        }
        // Without a name of their own: base units that read back.
        for text in ["aF/sqrt(Hz)", "rad/s^2/V", "rad^2/s^3", "1/V"] {
            let unit = Unit::parse(text).unwrap();
            let back = ColumnHeader::parse(&format!("x_{}", unit.si_header())).unit.unwrap();
            assert_eq!(back.dimension(), unit.dimension(), "{text}: {}", unit.si_header());
        }
    }

    #[test]
    fn g_is_an_acceleration_in_the_name_of_an_acceleration() {
        for (column, unit) in [
            ("accel_g", "gn"),
            ("Acceleration_g", "gn"),
            ("x acc_mg", "mgn"),
            ("ax_g", "gn"),
            ("accel_ug_per_rtHz", "ugn/sqrt(Hz)"),
            ("load_g", "g"),
            ("proof_mass_mg", "mg"),
            ("accel_kg", "kg"),
            ("accel_m_per_s2", "m/s^2"),
        ] {
            assert_eq!(ColumnHeader::parse(column).unit, Some(Unit::parse(unit).unwrap()), "{column}");
        }
    }

    #[test]
    fn units_that_are_spelt_out_are_read() {
        for (column, unit, text) in [
            ("time_sec", "s", "s"),
            ("time_Seconds", "s", "s"),
            ("drive_Volts", "V", "V"),
            ("drive_millivolts", "mV", "mV"),
            ("rate_deg/s", "deg/s", "deg_per_s"),
            ("f_hz", "Hz", "Hz"),
            ("CH_1_V", "V", "V"),
            ("x_1_per_s", "1/s", "1_per_s"),
        ] {
            let header = ColumnHeader::parse(column);
            assert_eq!(header.unit, Some(Unit::parse(unit).unwrap()), "{column}");
            assert_eq!((header.column.as_str(), header.unit_text.as_str()), (column, text));
        }
        for column in [
            "cap_second",
            "pos_v",
            "rate_per_min",
            "x_per_sec",
            "Channel A",
            "CH1",
            "CH 1",
            "Volts",
            "temp_Celsius",
            "x_left",
        ] {
            assert_eq!(ColumnHeader::parse(column).unit, None, "{column}");
        }
    }

    #[test]
    fn what_is_no_unit_is_none() {
        for column in [
            "sample_index",
            "record",
            "direction",
            "m",
            "x_per_s",
            "x_V_per",
            "x_V_per_m_s2x",
            "pos_min",
            "sig_h",
            "gyro_rad[1]",
            "q[1]",
            "",
        ] {
            assert_eq!(ColumnHeader::parse(column).unit, None, "{column}");
        }
    }

    #[test]
    fn a_numbered_column_has_no_unit_and_one_without_neighbours_is_a_ratio() {
        let unit =
            |column: &str, names: &[&str]| ColumnHeader::parse_among(column, names.iter().copied()).unit;
        let names = ["time_s", "Voltage_0", "Voltage_1", "Voltage_2", "nis_1"];
        assert_eq!(unit("Voltage_1", &names), None);
        assert_eq!(unit("nis_1", &names), Some(Unit::ONE));
        assert_eq!(unit("nis_1", &["nis_1", "nis_V"]), Some(Unit::ONE));
    }
}

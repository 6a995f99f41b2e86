//! Units as people, instruments and programs write them, as the name of a column ends with them.

/// Words for units, in lower case; they are known in any case, and with an `s` behind them.
const WORDS: [(&str, &str); 27] = [
    ("second", "s"),
    ("sec", "s"),
    ("minute", "min"),
    ("hour", "h"),
    ("volt", "V"),
    ("ampere", "A"),
    ("amp", "A"),
    ("hertz", "Hz"),
    ("watt", "W"),
    ("farad", "F"),
    ("coulomb", "C"),
    ("ohm", "ohm"),
    ("siemen", "S"),
    ("henry", "H"),
    ("joule", "J"),
    ("newton", "N"),
    ("pascal", "Pa"),
    ("kelvin", "K"),
    ("celsius", "degC"),
    ("meter", "m"),
    ("metre", "m"),
    ("gram", "g"),
    ("radian", "rad"),
    ("degree", "deg"),
    ("percent", "%"),
    // Symbols whose case is often lost and that cannot be taken for another.
    ("v", "V"),
    ("hz", "Hz"),
];

/// Symbols that take a prefix; their case counts.
const SYMBOLS: [&str; 19] =
    ["m", "g", "s", "A", "K", "rad", "deg", "dps", "Hz", "N", "Pa", "bar", "J", "W", "C", "V", "F", "S", "H"];
/// Symbols that take a prefix and have several spellings.
const SPELLINGS: [(&str, &str); 4] = [("ohm", "ohm"), ("Ohm", "ohm"), ("OHM", "ohm"), ("gn", "gn")];
/// Symbols that take none.
const WHOLE: [&str; 6] = ["min", "h", "%", "ppm", "1", "degC"];

/// Prefixes as symbols, whose case counts, and as words.
const PREFIXES: [(&str, &str); 12] = [
    ("a", "atto"),
    ("f", "femto"),
    ("p", "pico"),
    ("n", "nano"),
    ("u", "micro"),
    ("m", "milli"),
    ("c", "centi"),
    ("k", "kilo"),
    ("M", "mega"),
    ("G", "giga"),
    ("T", "tera"),
    ("", ""),
];

/// Signs, and what they are replaced with before a unit is read.
const SIGNS: [(&str, &str); 21] = [
    ("⁻¹", "^-1"),
    ("⁻²", "^-2"),
    ("⁻³", "^-3"),
    ("⁻⁴", "^-4"),
    ("−", "-"),
    ("µ", "u"),
    ("μ", "u"),
    ("Ω", "ohm"),
    ("\u{2126}", "ohm"),
    ("℃", "degC"),
    ("deg C", "degC"),
    ("Deg C", "degC"),
    ("° C", "degC"),
    ("°", "deg"),
    ("º", "deg"),
    ("²", "^2"),
    ("³", "^3"),
    ("**", "^"),
    ("·", " "),
    ("⋅", " "),
    ("*", " "),
];

/// The unit that a text is, as the name of a column ends with it: `V` for `Volts`, `m_per_s2` for `m/s²`. `None` where
/// it is none that is known.
///
/// One reading serves every format: header rows and brackets of text, attributes of HDF5, properties of TDMS. The case
/// of a symbol counts (`mV`, `MV`), that of a word does not (`Volts`, `VOLTS`, `Millivolt`). Products are written with a
/// blank, `·` or `*`, quotients with `/` or `per`, or as negative powers (`rad s^-1`, `m·s⁻²`, `m s-2`, as the SI brochure and the
/// conventions of climatologists write them); powers as `^2`, `²`, or with the digit alone behind a `/` (`m/s2`); a root of frequency is `√Hz`, `sqrt(Hz)` or `rtHz`. `g` stays what it is: whether gram or the acceleration of free fall
/// is meant shows in what the column holds.
pub fn unit_ending(text: &str) -> Option<String> {
    let mut text = text.trim().trim_end_matches('.').to_owned();
    if text.len() > 64 {
        return None;
    }
    for (sign, plain) in SIGNS {
        text = text.replace(sign, plain);
    }
    let text = text
        .replace("√(Hz)", "rtHz")
        .replace("sqrt(Hz)", "rtHz")
        .replace('√', "rt")
        .replace("Hz^0.5", "rtHz");
    let text = text.replace(" per ", "/");
    let mut parts = text.split('/');
    let mut factors: Vec<(String, i32)> = Vec::new();
    let mut negative = Vec::new();
    for word in parts.next()?.split_whitespace() {
        // Where powers are written behind the symbols, `m2` is no name.
        let (symbol, power) = factor(word, text.contains('-'))?;
        if power < 0 { negative.push((symbol, -power)) } else { factors.push((symbol, power)) }
    }
    // Of both ways to write a quotient at a time nobody knows what is meant.
    if !negative.is_empty() && text.contains('/') {
        return None;
    }
    if factors.is_empty() && !negative.is_empty() {
        factors.push(("1".to_owned(), 1));
    }
    let above = factors.len();
    factors.append(&mut negative);
    for part in parts {
        let inside = part.trim().strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let mut words = inside.unwrap_or(part).split_whitespace();
        let first = factor(words.next()?, true)?;
        // Behind a `/` several factors can be read in two ways, but for brackets.
        if words.clone().next().is_some() && inside.is_none() {
            return None;
        }
        for below in std::iter::once(Some(first)).chain(words.map(|word| factor(word, true))) {
            let (symbol, power) = below.filter(|(_, power)| *power > 0)?;
            match factors.iter_mut().skip(above).find(|(known, _)| *known == symbol) {
                Some((_, known)) => *known += power,
                None => factors.push((symbol, power)),
            }
        }
    }
    if above == 0 || factors.len() > 4 {
        return None;
    }
    let word = |(index, (symbol, power)): (usize, &(String, i32))| {
        let power = if *power == 1 { String::new() } else { power.to_string() };
        format!("{}{symbol}{power}", if index < above { "" } else { "per_" })
    };
    Some(factors.iter().enumerate().map(word).collect::<Vec<_>>().join("_"))
}

/// A symbol or a word with its power; digits alone are a power behind a `/` and beside negative powers only, as `V1` is a name.
fn factor(word: &str, digits_are_powers: bool) -> Option<(String, i32)> {
    if word == "1" {
        return Some(("1".to_owned(), 1));
    }
    let digits = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let (symbol, power) = match word.split_once('^').or_else(|| word.split_at_checked(word.find('-')?)) {
        Some((symbol, power)) => (symbol, power.parse().ok()?),
        None if digits_are_powers && digits.len() < word.len() => {
            (digits, word.get(digits.len()..)?.parse().ok()?)
        }
        None => (word, 1),
    };
    if !(1..=8).contains(&i32::abs(power)) || symbol == "1" {
        return None;
    }
    if let Some(root) = symbol.strip_prefix("rt") {
        return Some((format!("rt{}", symbol_of(root)?), power));
    }
    Some((symbol_of(symbol).or_else(|| symbol_of_word(symbol))?, power))
}

/// A symbol with its prefix, as it is written in names.
fn symbol_of(text: &str) -> Option<String> {
    if WHOLE.contains(&text) {
        return Some(text.to_owned());
    }
    // The longest first: `min` is not milli-inch, nor `Pa` pico-year.
    PREFIXES.iter().rev().find_map(|(prefix, _)| {
        let rest = text.strip_prefix(prefix)?;
        let plain = SYMBOLS.iter().find(|symbol| **symbol == rest);
        let spelt = || SPELLINGS.iter().find(|(spelling, _)| *spelling == rest).map(|(_, symbol)| symbol);
        Some(format!("{prefix}{}", plain.or_else(spelt)?))
    })
}

/// The symbol of a word with its prefix, itself a word or a symbol.
fn symbol_of_word(text: &str) -> Option<String> {
    let lower = text.to_lowercase();
    let of_word = |word: &str| {
        let known = |word: &str| WORDS.iter().find(|(known, _)| *known == word).map(|(_, symbol)| *symbol);
        let singular = word.strip_suffix("ies").map(|stem| format!("{stem}y"));
        let singular = singular.or_else(|| word.strip_suffix('s').filter(|w| w.len() > 2).map(str::to_owned));
        known(word).or_else(|| known(&singular?)).filter(|symbol| *symbol != "degC")
    };
    if let "celsius" | "degc" | "degreec" | "degcelsius" = lower.as_str() {
        return Some("degC".to_owned());
    }
    PREFIXES.iter().rev().find_map(|(symbol, word)| {
        let spelt = lower.strip_prefix(word).and_then(of_word);
        // Of a prefix that is a symbol the case counts, but for those that have no other meaning.
        let short = || {
            let rest =
                text.strip_prefix(symbol).or_else(|| text.strip_prefix('K').filter(|_| *symbol == "k"))?;
            // Whether capitals write milli or mega is not known, and neither is it of `mhz`.
            let ambiguous = match *symbol {
                "m" => rest == "hz",
                "M" => !rest.eq_ignore_ascii_case("hz") && rest.chars().all(char::is_uppercase),
                _ => false,
            };
            (!ambiguous).then(|| of_word(&rest.to_lowercase()))?
        };
        let unit = spelt.or_else(short)?;
        (symbol.is_empty() || !WHOLE.contains(&unit)).then(|| format!("{symbol}{unit}"))
    })
}

#[cfg(test)]
mod tests {
    use super::unit_ending;

    #[test]
    fn one_unit_has_one_ending_however_it_is_written() {
        for (texts, ending) in [
            (&["s", "Sec", "sec", "SEC", "Second", "seconds", "Second(s)", " s ", "sec."][..], "s"),
            (&["ms", "msec", "mSec", "millisecond", "Milliseconds"], "ms"),
            (&["us", "µs", "μs", "usec", "microseconds"], "us"),
            (&["V", "v", "Volt", "VOLT", "Volts", "volts"], "V"),
            (&["mV", "mv", "mVolts", "millivolt", "Millivolts"], "mV"),
            (&["MV", "Megavolt"], "MV"),
            (&["A", "Amp", "Amps", "ampere", "Amperes"], "A"),
            (&["Hz", "hz", "HZ", "hertz"], "Hz"),
            (&["kHz", "khz", "KHz", "kilohertz"], "kHz"),
            (&["pF", "picofarad", "picofarads"], "pF"),
            (&["F", "Farad", "farads"], "F"),
            (&["ohm", "Ohm", "Ω", "\u{2126}", "Ohms", "OHM"], "ohm"),
            (&["kΩ", "kOhm", "kohm", "kiloohm"], "kohm"),
            (&["deg", "°", "º", "degree", "Degrees"], "deg"),
            (&["degC", "°C", "° C", "℃", "Celsius", "deg C", "Deg C"], "degC"),
            (&["deg/s", "°/s", "deg/sec", "degrees per second", "degrees/second"], "deg_per_s"),
            (&["dps"], "dps"),
            (&["m/s^2", "m/s²", "m/s2", "m/s/s", "m/s**2", "meters/second^2"], "m_per_s2"),
            (&["rad/s", "rad s^-1", "rad·s⁻¹", "rad s-1", "rad s⁻¹", "rad*s^-1"], "rad_per_s"),
            (&["m s^-2", "m·s⁻²", "m s-2", "m s−2"], "m_per_s2"),
            (&["kg m^2 s^-2", "kg·m²·s⁻²", "kg m2 s-2"], "kg_m2_per_s2"),
            (&["W m-2 K-1", "W m^-2 K^-1"], "W_per_m2_per_K"),
            (&["s^-1", "s⁻¹", "s-1"], "1_per_s"),
            (&["N m", "N·m", "N*m", "newton meters"], "N_m"),
            (&["V/√Hz", "V/sqrt(Hz)", "V/rtHz", "V/√(Hz)", "V/Hz^0.5"], "V_per_rtHz"),
            (&["V^2", "V²"], "V2"),
            (&["V/(m/s)"], ""),
            (&["1/s"], "1_per_s"),
            (&["g"], "g"),
            (&["Newtons", "N"], "N"),
            (&["%", "percent"], "%"),
            (&["min", "minutes"], "min"),
            (&["siemens", "S"], "S"),
            (&["henries", "H"], "H"),
        ] {
            for text in texts {
                let expected = Some(ending.to_owned()).filter(|ending| !ending.is_empty());
                // What stands in brackets behind a word is its plural.
                let text = text.replace("(s)", "s");
                assert_eq!(unit_ending(&text), expected, "{text}");
            }
        }
    }

    #[test]
    fn what_is_no_unit_has_no_ending() {
        for text in [
            "",
            " ",
            ".",
            "left",
            "ok",
            "V1",
            "A2",
            "x",
            "Time",
            "Channel A",
            "CH1",
            "CH 1",
            "counts",
            "a.u.",
            "mhz",
            "/s",
            "V/",
            "V//s",
            "V/s^-1",
            "m s^-1/kg",
            "a-1",
            "1-2",
            "V-",
            "x-s",
            "V/m s",
            "V^",
            "V^99",
            "s s s s s",
            "1 2",
            "in",
            "none",
            "K9",
            "mV rms",
            "°F",
            "MSEC",
            "Vs",
            "From Custom Scale",
        ] {
            assert_eq!(unit_ending(text), None, "{text}");
        }
        assert_eq!(unit_ending(&"V ".repeat(1000)), None);
    }
}

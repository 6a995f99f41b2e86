//! A spectrum in the exchange format of the spectroscopists.

use std::io::{self, Write};

/// The longest line that the format allows.
const LINE: usize = 80;
/// Ordinates are whole numbers up to this.
const LARGEST: f64 = 999_999_999.0;

/// A spectrum at equal steps of the wavenumber.
#[derive(Clone, Copy, Debug)]
pub struct JcampSpectrum<'a> {
    /// A line of text; what is not printable ASCII becomes `?`.
    pub title: &'a str,
    /// The lowest wavenumber in 1/cm.
    pub first_per_cm: f64,
    /// The step in 1/cm.
    pub step_per_cm: f64,
    /// The width of a line at half its height in 1/cm.
    pub resolution_per_cm: f64,
    /// The values, in arbitrary units.
    pub values: &'a [f64],
}

/// Writes a spectrum as JCAMP-DX 4.24 (McDonald and Wilks, Applied Spectroscopy 42, 151, 1988), in the form that any
/// reader takes: whole numbers in columns, no compression.
///
/// Each line of data begins with its wavenumber, by which a reader checks that nothing is lost. Values are rounded to 10⁻⁹ of the
/// largest.
pub fn write_jcamp(spectrum: &JcampSpectrum<'_>, w: &mut dyn Write) -> io::Result<()> {
    let largest = spectrum.values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let factor = if largest > 0.0 { largest / LARGEST } else { 1.0 };
    // The factor as it is written is the one that counts.
    let factor: f64 = format!("{factor:.9e}").parse().unwrap_or(factor);
    let whole: Vec<f64> = spectrum.values.iter().map(|value| (value / factor).round()).collect();
    let x = |index: usize| spectrum.first_per_cm + spectrum.step_per_cm * index as f64;
    let last = whole.len().saturating_sub(1);
    let range = whole.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], y| [a.min(*y), b.max(*y)]);
    let title: String =
        spectrum.title.chars().map(|c| if c == ' ' || c.is_ascii_graphic() { c } else { '?' }).collect();
    writeln!(w, "##TITLE={title}")?;
    writeln!(w, "##JCAMP-DX=4.24 $$ kalmems {}", env!("CARGO_PKG_VERSION"))?;
    writeln!(w, "##DATA TYPE=INFRARED SPECTRUM")?;
    writeln!(w, "##ORIGIN=kalmems {}", env!("CARGO_PKG_VERSION"))?;
    writeln!(w, "##OWNER=not stated")?;
    writeln!(w, "##XUNITS=1/CM")?;
    writeln!(w, "##YUNITS=ARBITRARY UNITS")?;
    writeln!(w, "##RESOLUTION={:.6}", spectrum.resolution_per_cm)?;
    for (label, value) in [("FIRSTX", x(0)), ("LASTX", x(last)), ("DELTAX", spectrum.step_per_cm)] {
        writeln!(w, "##{label}={value:.9}")?;
    }
    writeln!(w, "##MAXY={:e}", range[1] * factor)?;
    writeln!(w, "##MINY={:e}", range[0] * factor)?;
    writeln!(w, "##XFACTOR=1")?;
    writeln!(w, "##YFACTOR={factor:.9e}")?;
    writeln!(w, "##NPOINTS={}", whole.len())?;
    writeln!(w, "##FIRSTY={:e}", whole.first().map_or(0.0, |y| y * factor))?;
    writeln!(w, "##XYDATA=(X++(Y..Y))")?;
    let mut line = String::new();
    for (index, value) in whole.iter().enumerate() {
        let cell = format!(" {value:.0}");
        if line.len() + cell.len() > LINE {
            writeln!(w, "{line}")?;
            line.clear();
        }
        if line.is_empty() {
            line = format!("{:.9}", x(index));
        }
        line += &cell;
    }
    if !line.is_empty() {
        writeln!(w, "{line}")?;
    }
    writeln!(w, "##END=")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Reads the form (X++(Y..Y)) by the rules of the format: labels without regard to case and blanks, comments from `$$`,
    /// lines of at most 80 characters, each checked by its abscissa, first and last ones and their number by the header.
    fn read(text: &str) -> (BTreeMap<String, String>, Vec<f64>) {
        assert!(text.is_ascii() && text.lines().all(|line| line.len() <= 80));
        let mut labels = BTreeMap::new();
        let mut order = Vec::new();
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for line in text.lines() {
            let line = line.split("$$").next().unwrap().trim_end();
            if let Some(rest) = line.strip_prefix("##") {
                let (label, value) = rest.split_once('=').unwrap();
                let label: String =
                    label.to_uppercase().chars().filter(|c| !matches!(c, ' ' | '-' | '/' | '_')).collect();
                order.push(label.clone());
                assert!(labels.insert(label, value.trim().to_owned()).is_none());
            } else {
                assert_eq!(order.last().unwrap(), "XYDATA");
                rows.push(line.split_whitespace().map(|cell| cell.parse().unwrap()).collect());
            }
        }
        assert_eq!(order[..3], ["TITLE", "JCAMPDX", "DATATYPE"]);
        assert_eq!(order.last().unwrap(), "END");
        for required in ["ORIGIN", "OWNER", "XUNITS", "YUNITS"] {
            assert!(!labels[required].is_empty(), "{required}");
        }
        let number = |label: &str| labels[label].parse::<f64>().unwrap();
        let (first, last, points) = (number("FIRSTX"), number("LASTX"), number("NPOINTS"));
        let step = (last - first) / (points - 1.0);
        assert!((number("DELTAX") - step).abs() < 1e-8);
        let mut values = Vec::new();
        for row in &rows {
            let expected = first + step * values.len() as f64;
            assert!((row[0] * number("XFACTOR") - expected).abs() < 1e-6, "{} {expected}", row[0]);
            for whole in &row[1..] {
                assert!(whole.fract() == 0.0 && whole.abs() < f64::from(i32::MAX));
                values.push(whole * number("YFACTOR"));
            }
        }
        assert_eq!(values.len() as f64, points);
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
        assert!(close(number("FIRSTY"), values[0]));
        assert!(close(number("MAXY"), values.iter().copied().fold(f64::NEG_INFINITY, f64::max)));
        assert!(close(number("MINY"), values.iter().copied().fold(f64::INFINITY, f64::min)));
        (labels, values)
    }

    #[test]
    fn what_is_written_is_read_by_the_rules_of_the_format() {
        let values: Vec<f64> =
            (0..1000).map(|k| 3.7e-5 * (-((f64::from(k) - 400.0) / 60.0).powi(2)).exp() - 1e-9).collect();
        let spectrum = JcampSpectrum {
            title: "two µ lines",
            first_per_cm: 1500.0 + 1.0 / 3.0,
            step_per_cm: 0.1 / 3.0,
            resolution_per_cm: 6.4,
            values: &values,
        };
        let mut written = Vec::new();
        write_jcamp(&spectrum, &mut written).unwrap();
        let (labels, found) = read(&String::from_utf8(written).unwrap());
        assert_eq!(labels["TITLE"], "two ? lines");
        assert_eq!((labels["XUNITS"].as_str(), labels["JCAMPDX"].as_str()), ("1/CM", "4.24"));
        for (found, value) in found.iter().zip(&values) {
            assert!((found - value).abs() < 3.7e-5 * 0.6e-9, "{found} {value}");
        }
        // A spectrum of nothing, and one that is nowhere positive.
        for values in [vec![0.0; 5], vec![-3.0, -1.0, -2.0]] {
            let mut written = Vec::new();
            write_jcamp(&JcampSpectrum { values: &values, ..spectrum }, &mut written).unwrap();
            let (_, found) = read(&String::from_utf8(written).unwrap());
            assert!(found.iter().zip(&values).all(|(f, v)| (f - v).abs() < 1e-8));
        }
    }
}

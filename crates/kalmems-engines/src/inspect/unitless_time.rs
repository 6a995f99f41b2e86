//! A column that may be the time and whose name has no unit, and the unit that somebody states for it.

use super::quantity::{number, quantity};
use crate::recording::{ColumnReading, DeclaredColumn};
use crate::units::{Unit, kind};
use kalmems_formats::Hints;
use serde::Serialize;

/// A column that may be the time: it is called so or is the first, its numbers grow, and its name has no unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnitlessTime {
    /// Its name.
    pub column: String,
    /// Its first number.
    pub first: f64,
    /// Its last number.
    pub last: f64,
    /// By how much it grows from a row to the next.
    pub step: f64,
}

/// Rates in Hz at which instruments sample a micro-electromechanical device.
const RATES: std::ops::RangeInclusive<f64> = 1.0..=1e10;

impl UnitlessTime {
    /// The units in which the samples follow each other at a rate that instruments have; of all where there is none.
    pub fn units(&self) -> Vec<&'static str> {
        let all = ["s", "ms", "us", "ns"];
        let is_usual = |unit: &&str| {
            Unit::parse(unit).is_ok_and(|unit| RATES.contains(&(1.0 / (self.step * unit.factor()))))
        };
        let usual: Vec<&str> = all.into_iter().filter(is_usual).collect();
        if usual.is_empty() { all.to_vec() } else { usual }
    }

    /// What the column shows.
    pub fn sentence(&self) -> String {
        let Self { column, first, last, step } = self;
        let (first, last, step) = (number(*first), number(*last), number(*step));
        format!(
            "`{column}` may be the time, as it grows from {first} to {last} in steps of {step}; its name has no unit, such as `{column}_s`."
        )
    }

    /// The sampling rate that a unit would mean, such as `1 MHz`.
    pub fn rate_in(&self, unit: &str) -> Option<String> {
        let factor = Unit::parse(unit).ok()?.factor();
        Some(quantity(1.0 / (self.step * factor), "Hz"))
    }
}

/// What somebody states of a file that is to be inspected.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedFile {
    /// How it is written, where that cannot be told from it.
    pub hints: Hints,
    /// Which column is the time, and in which unit.
    pub time: Option<StatedTime>,
    /// The rate at which its rows follow each other in Hz, whatever its columns say.
    pub rate_hz: Option<f64>,
}

/// The column that is the time, with its unit, as somebody states it.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedTime {
    /// The column.
    pub column: String,
    /// The unit as it was written.
    pub unit_text: String,
    pub(super) unit: Unit,
}

impl StatedTime {
    /// A column with its unit; `None` where that is no unit of time.
    pub fn new(column: &str, unit: &str) -> Option<Self> {
        let known = Unit::parse(unit).ok().filter(|unit| kind::TIME.accepts(unit.dimension()))?;
        Some(Self { column: column.to_owned(), unit_text: unit.to_owned(), unit: known })
    }

    /// The column as a reader of recordings takes it.
    pub(super) fn declared(&self) -> DeclaredColumn {
        let reading =
            ColumnReading { unit: Some((self.unit_text.clone(), self.unit)), ..ColumnReading::default() };
        DeclaredColumn {
            column: self.column.clone(),
            key: DeclaredColumn::CLOCK.to_owned(),
            usual_unit: Some("s"),
            reading: Some(reading),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_with_the_rate_of_no_instrument_are_left_out() {
        let units = |step: f64| UnitlessTime { column: "t".to_owned(), first: 0.0, last: 1.0, step }.units();
        assert_eq!(units(1e-6), ["s", "ms"]);
        assert_eq!(units(1.0), ["s", "ms", "us", "ns"]);
        assert_eq!(units(1e9), ["ns"]);
        assert_eq!(units(1e30), ["s", "ms", "us", "ns"]);
        let time = UnitlessTime { column: "t".to_owned(), first: 0.0, last: 24.0, step: 1e-3 };
        assert_eq!(
            (time.rate_in("s"), time.rate_in("ms")),
            (Some("1 kHz".to_owned()), Some("1 MHz".to_owned()))
        );
        assert!(StatedTime::new("t", "V").is_none() && StatedTime::new("t", "ms").is_some());
    }
}

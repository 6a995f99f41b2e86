//! Names and kinds that a reader's own file brings in, kept once for as long as the program runs.
//!
//! The names of the published devices stand in the program, and types that hold a name hold a `&'static str`. A device that is
//! described in a file has names of its own. They are few and come again with every reading of the file, so that each is kept
//! once and lives as long as those of the program do.

use crate::{Dimension, Kind, Unit, kind};
use std::sync::Mutex;

/// What is kept: each different value once.
#[derive(Debug)]
pub struct Interner<T: ?Sized + 'static>(Mutex<Vec<&'static T>>);

impl<T: ?Sized + PartialEq + 'static> Interner<T> {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// The kept value that equals this one; `make` makes it where there is none yet.
    pub fn get(&self, value: &T, make: impl FnOnce() -> Box<T>) -> &'static T {
        // A thread that stopped while it held the list has left it whole.
        let mut kept = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(found) = kept.iter().find(|kept| **kept == value) {
            return found;
        }
        let new: &'static T = Box::leak(make());
        kept.push(new);
        new
    }
}

impl<T: ?Sized + PartialEq + 'static> Default for Interner<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// A name, kept.
///
/// ```
/// let own = String::from("deflection");
/// assert!(std::ptr::eq(kalmems_units::name(&own), kalmems_units::name("deflection")));
/// ```
pub fn name(text: &str) -> &'static str {
    static NAMES: Interner<str> = Interner::new();
    NAMES.get(text, || text.into())
}

/// Kinds that a dimension alone tells.
static TOLD_BY_DIMENSION: [&Kind; 16] = [
    &kind::RATIO,
    &kind::ANGLE,
    &kind::ANGULAR_RATE,
    &kind::FREQUENCY,
    &kind::TIME,
    &kind::LENGTH,
    &kind::AREA,
    &kind::MASS,
    &kind::PRESSURE,
    &kind::VOLTAGE,
    &kind::VOLTAGE_VARIANCE,
    &kind::CAPACITANCE,
    &kind::RESISTANCE,
    &kind::TEMPERATURE,
    &kind::VELOCITY,
    &kind::ACCELERATION,
];

/// Random walks that have a kind of their own.
static DRIFTS: [&Kind; 6] = [
    &kind::RATIO_DRIFT,
    &kind::FREQUENCY_DRIFT,
    &kind::LENGTH_DRIFT,
    &kind::VELOCITY_DRIFT,
    &kind::VOLTAGE_DRIFT,
    &kind::CAPACITANCE_DRIFT,
];

impl Kind {
    /// The kind of a quantity of which no more is known than its unit, as it is written, such as `rad/s`.
    ///
    /// ```
    /// use kalmems_units::{Kind, Unit, kind};
    /// let of = |text: &str| Kind::of_unit(Unit::parse(text).unwrap(), text);
    /// assert_eq!(of("um/s"), &kind::VELOCITY);
    /// assert_eq!(of("V s/rad").name, "a value in V s/rad");
    /// ```
    pub fn of_unit(unit: Unit, text: &str) -> &'static Self {
        let text = if text.trim().is_empty() { "1" } else { text.trim() };
        Self::among(&TOLD_BY_DIMENSION, unit.dimension(), ("a value in", text))
    }

    /// The kind of a random walk of such a quantity: the variance that a time adds, by that time.
    pub fn drift(&self) -> &'static Self {
        let per_second = self.dimension.times(self.dimension).times(Dimension::of([0, 0, -1, 0, 0, 0]));
        Self::among(&DRIFTS, per_second, ("a variance per time, in", &per_second.to_string()))
    }

    fn among(kinds: &[&'static Self], dimension: Dimension, (what, text): (&str, &str)) -> &'static Self {
        static OTHERS: Interner<Kind> = Interner::new();
        if let Some(kind) = kinds.iter().find(|kind| kind.dimension == dimension) {
            return kind;
        }
        let (name, example) = (name(&format!("{what} {text}")), name(&format!("1 {text}")));
        let kind = Self { name, dimension, angle_counts: false, example };
        OTHERS.get(&kind, || Box::new(Self { ..kind }))
    }

    /// The ending of a column's name that has such a quantity in SI: `rad_per_s`.
    pub fn ending(&self) -> &'static str {
        name(&Unit::coherent(self.dimension).si_header())
    }
}

#[cfg(test)]
mod tests {
    use crate::{ColumnHeader, Dimension, Kind, Unit, kind};

    #[test]
    fn the_ending_of_a_kind_is_read_back_as_its_unit() {
        // A noise density, of half a power of a unit, is no column of a recording.
        for kind in kind::ALL.iter().filter(|kind| !kind.ending().contains("rt")) {
            let column = format!("value_{}", kind.ending());
            let unit = ColumnHeader::parse(&column).unit;
            assert_eq!(unit.map(|unit| unit.dimension()), Some(kind.dimension), "{column}");
        }
    }

    #[test]
    fn a_kind_is_the_same_however_often_it_is_asked_for() {
        let unit = Unit::parse("V/K").unwrap();
        assert!(std::ptr::eq(Kind::of_unit(unit, "V/K"), Kind::of_unit(unit, " V/K")));
        assert_eq!(Kind::of_unit(unit, "V/K").to_string(), "a value in V/K (V/K)");
    }

    #[test]
    fn a_random_walk_adds_a_variance_per_time() {
        assert_eq!(kind::VOLTAGE.drift(), &kind::VOLTAGE_DRIFT);
        assert_eq!(kind::RATIO.drift(), &kind::RATIO_DRIFT);
        let drift = Kind::of_unit(Unit::parse("V/K").unwrap(), "V/K").drift();
        assert_eq!(drift.dimension, Dimension::of([2, 4, -7, -2, -2, 0]));
    }
}

//! Physical dimensions as exponents of the SI base units, and of the angle.

use std::fmt;

/// The symbols behind the exponents of a [`Dimension`], in its order.
const SYMBOLS: [&str; 6] = ["kg", "m", "s", "A", "K", "rad"];

/// Exponents of kg, m, s, A, K and rad, in halves: a noise density in V/√Hz has half an exponent.
///
/// The angle is counted although the SI calls it dimensionless: it keeps rad/s apart from Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension {
    halves: [i16; 6],
}

impl Dimension {
    /// No dimension: a ratio.
    pub const NONE: Self = Self { halves: [0; 6] };

    /// From whole exponents of kg, m, s, A, K and rad.
    pub const fn of(exponents: [i16; 6]) -> Self {
        let mut halves = [0; 6];
        let mut i = 0;
        while i < 6 {
            halves[i] = 2 * exponents[i];
            i += 1;
        }
        Self { halves }
    }

    /// From exponents in halves, as a noise density has them.
    pub const fn of_halves(halves: [i16; 6]) -> Self {
        Self { halves }
    }

    /// The dimension of a product.
    #[must_use]
    pub const fn times(self, other: Self) -> Self {
        let mut halves = self.halves;
        let mut i = 0;
        while i < 6 {
            halves[i] = halves[i].saturating_add(other.halves[i]);
            i += 1;
        }
        Self { halves }
    }

    /// The dimension raised to half of `halves`; `None` where the exponent would not be a whole half.
    pub fn to_half_power(self, halves: i16) -> Option<Self> {
        let mut result = self;
        for e in &mut result.halves {
            let doubled = e.checked_mul(halves)?;
            if doubled % 2 != 0 {
                return None;
            }
            *e = doubled / 2;
        }
        Some(result)
    }

    /// As the ending of a column name: `rad_per_s`, `V_s_per_rad`; `1` for a ratio.
    pub(crate) fn header(self) -> String {
        let (unit, rest) =
            self.named().map_or((None, self), |(symbol, halves, rest)| (Some((symbol, halves)), rest));
        let parts = || {
            let rest = SYMBOLS.into_iter().zip(rest.halves);
            unit.into_iter().chain(rest).filter(|(_, halves)| *halves != 0)
        };
        let mut words = Vec::new();
        for above in [true, false] {
            for (symbol, halves) in parts().filter(|(_, halves)| (*halves > 0) == above) {
                if !above {
                    words.push("per".to_owned());
                }
                let halves = halves.unsigned_abs();
                words.push(match (halves % 2, halves / 2) {
                    (0, 1) => symbol.to_owned(),
                    (0, whole) => format!("{symbol}{whole}"),
                    (_, 0) => format!("rt{symbol}"),
                    (_, whole) => format!("{symbol}{whole}_rt{symbol}"),
                });
            }
            if above && words.is_empty() {
                words.push("1".to_owned());
            }
        }
        words.join("_")
    }

    /// The same without the angle: N·m and N·m/rad become one.
    #[must_use]
    pub const fn without_angle(self) -> Self {
        let mut halves = self.halves;
        halves[5] = 0;
        Self { halves }
    }
}

/// Units with names of their own, in which forces, energies and what is electrical are shorter.
const NAMED: [(&str, Dimension); 6] = [
    ("N", Dimension::of([1, 1, -2, 0, 0, 0])),
    ("V", Dimension::of([1, 2, -3, -1, 0, 0])),
    ("F", Dimension::of([-1, -2, 4, 2, 0, 0])),
    ("ohm", Dimension::of([1, 2, -3, -2, 0, 0])),
    ("C", Dimension::of([0, 0, 1, 1, 0, 0])),
    ("W", Dimension::of([1, 2, -3, 0, 0, 0])),
];

impl Dimension {
    /// The shortest way to write it with one of the named units that leaves neither kg nor A: the unit, its exponent in
    /// halves, and what is left.
    fn named(self) -> Option<(&'static str, i16, Self)> {
        let length = |of: Self| of.halves.iter().map(|e| e.unsigned_abs()).sum::<u16>();
        let ways = NAMED
            .iter()
            .flat_map(|(symbol, unit)| [-4, -2, -1, 1, 2, 4].map(|halves| (*symbol, unit, halves)));
        let left = ways.filter_map(|(symbol, unit, halves)| {
            let rest = self.times(unit.to_half_power(-halves)?);
            (rest.halves[0] == 0 && rest.halves[3] == 0).then_some((symbol, halves, rest))
        });
        let shortest = left.min_by_key(|(_, halves, rest)| halves.unsigned_abs() + length(*rest))?;
        (shortest.1.unsigned_abs() + length(shortest.2) < length(self)).then_some(shortest)
    }
}

impl fmt::Display for Dimension {
    /// In the units of the SI, such as `N m s` or `rad/s`, as a reader of units takes it; `1` for a ratio.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = self.named();
        let (unit, rest) =
            named.map_or((None, *self), |(symbol, halves, rest)| (Some((symbol, halves)), rest));
        let parts = || unit.into_iter().chain(SYMBOLS.into_iter().zip(rest.halves));
        let mut first = true;
        for (symbol, halves) in parts().filter(|(_, halves)| *halves > 0) {
            if !first {
                f.write_str(" ")?;
            }
            first = false;
            write_power(f, symbol, halves)?;
        }
        if first {
            f.write_str("1")?;
        }
        for (symbol, halves) in parts().filter(|(_, halves)| *halves < 0) {
            f.write_str("/")?;
            write_power(f, symbol, -halves)?;
        }
        Ok(())
    }
}

/// A symbol with its exponent, of which this is the double.
fn write_power(f: &mut fmt::Formatter<'_>, symbol: &str, halves: i16) -> fmt::Result {
    match halves {
        2 => f.write_str(symbol),
        h if h % 2 == 0 => write!(f, "{symbol}^{}", h / 2),
        1 => write!(f, "sqrt({symbol})"),
        h => write!(f, "sqrt({symbol}^{h})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kind;

    #[test]
    fn a_dimension_is_written_as_one_would_write_its_unit() {
        let of = |kind: &crate::Kind| kind.dimension.to_string();
        assert_eq!(of(&kind::CAPACITANCE), "F");
        assert_eq!(of(&kind::VOLTAGE_DRIFT), "V^2/s");
        assert_eq!(of(&kind::CAPACITANCE_DENSITY), "F sqrt(s)");
        assert_eq!(of(&kind::ANGULAR_RATE), "rad/s");
        assert_eq!(of(&kind::RATIO), "1");
        assert_eq!(Dimension::of([1, 2, -2, 0, 0, 0]).to_string(), "N m");
        assert_eq!(Dimension::of([1, 2, 0, 0, 0, 0]).to_string(), "kg m^2");
        assert_eq!(Dimension::of([0, 1, -2, 0, 0, 0]).to_string(), "m/s^2");
        assert_eq!(Dimension::of([-1, -3, 4, 2, 0, 0]).to_string(), "F/m");
        assert_eq!(Dimension::of([0, 0, -1, 0, 0, 0]).to_string(), "1/s");
        // What is written is read as the same.
        for kind in kind::ALL {
            let read = crate::Unit::parse(&of(kind)).unwrap();
            assert_eq!(read.dimension(), kind.dimension, "{kind}");
        }
    }
}

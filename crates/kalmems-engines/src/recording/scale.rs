//! How the numbers of a column become SI.

use crate::units::Unit;

/// How the numbers of a column become SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    /// A power of ten, 0 where they are SI already or have no unit: the exponent is changed in the text, so that `5.71` in pF
    /// is the number 5.71e-12.
    Decimal(i32),
    /// Any other factor.
    Factor(f64),
}

impl Scale {
    pub(crate) fn of(unit: Option<Unit>) -> Self {
        let factor = unit.map_or(1.0, |u| u.factor());
        let power = factor.log10().round();
        if power.is_nan() || power.abs() > 300.0 {
            return Self::Factor(factor);
        }
        #[allow(clippy::cast_possible_truncation)] // bounded by the line above
        let power = power as i32;
        if format!("1e{power}").parse() == Ok(factor) { Self::Decimal(power) } else { Self::Factor(factor) }
    }

    /// The power of ten with which the numbers are read.
    pub(crate) const fn power(self) -> i32 {
        match self {
            Self::Decimal(power) => power,
            Self::Factor(_) => 0,
        }
    }
}

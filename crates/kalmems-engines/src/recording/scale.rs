//! How the numbers of a column become SI.

use crate::units::Unit;
use kalmems_core::Portable;

/// How the numbers of a column become SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ColumnScale {
    /// A power of ten, 0 where they are SI already or have no unit: the exponent is changed in the text, so that `5.71` in pF
    /// is the number 5.71e-12.
    Decimal(i32),
    /// Any other factor.
    Factor(f64),
    /// A power of ten, and `factor · number + offset` after it.
    Affine {
        /// The power of ten.
        power: i32,
        /// The factor.
        factor: f64,
        /// What is added, in SI.
        offset: f64,
    },
}

impl ColumnScale {
    pub(crate) fn of(unit: Option<Unit>) -> Self {
        Self::of_factor(unit.map_or(1.0, |u| u.factor()))
    }

    /// Numbers times a factor, with an offset in SI added.
    pub(super) fn of_factor_and_offset(factor: f64, offset: f64) -> Self {
        match Self::of_factor(factor.abs()) {
            Self::Decimal(power) if offset == 0.0 && factor > 0.0 => Self::Decimal(power),
            Self::Decimal(power) => Self::Affine { power, factor: factor.signum(), offset },
            _ if offset == 0.0 => Self::Factor(factor),
            _ => Self::Affine { power: 0, factor, offset },
        }
    }

    fn of_factor(factor: f64) -> Self {
        let power = factor.portable_log10().round();
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
            Self::Decimal(power) | Self::Affine { power, .. } => power,
            Self::Factor(_) => 0,
        }
    }
}

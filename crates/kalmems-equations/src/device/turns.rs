//! Whether a number counts turns or radians: a factor 2π that is missing, or there twice.

use super::resolve::ResolvedValue;
use kalmems_units::Dimension;

/// rad/s.
pub(crate) const ANGULAR_RATE: Dimension = Dimension::of([0, 0, -1, 0, 0, 1]);

/// What is wrong with the factor 2π in a part of an expression, should it be a rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TurnMistake {
    /// A frequency in Hz is a factor, and 2π is none.
    MissingTwoPi,
    /// A rate in rad/s and 2π are factors.
    TwoPiTwice,
}

impl TurnMistake {
    /// What to do about it.
    pub(crate) const fn remedy(self) -> &'static str {
        match self {
            Self::MissingTwoPi => {
                "a frequency in Hz is a factor here, and `2*pi` is none: Hz are cycles per second, and the angular frequency of an \
                 oscillation, like the rate of a decay, is 2*pi times as large; write `2*pi` before it, or give the number in `1/s` if it \
                 counts no cycles"
            }
            Self::TwoPiTwice => {
                "a rate in rad/s and `2*pi` are factors here: rad/s count radians already; leave `2*pi` out, or give the rate in Hz"
            }
        }
    }

    /// That of a sum: the first of its parts.
    pub(crate) fn of_sum(mut parts: impl Iterator<Item = ResolvedValue>) -> Option<Self> {
        parts.find_map(|value| value.turn)
    }

    /// That of a product, by the factors and whether each is below the fraction bar. A number without a unit is no rate any more.
    pub(crate) fn of_product(parts: &[(bool, ResolvedValue)], is_plain: bool) -> Option<Self> {
        let has_pi = parts.iter().any(|(_, value)| value.has_pi);
        let above = parts.iter().filter(|(over, _)| !over).map(|(_, value)| *value);
        if has_pi || is_plain { None } else { Self::of_sum(above) }
    }

    /// That of the rate of a state. The rate of an angle that is a product of π and a rate in rad/s, and of nothing else that has a unit, has one
    /// factor too many.
    pub(crate) fn of_rate(value: ResolvedValue) -> Option<Self> {
        let is_angular_rate = value.quantity.dimension() == Some(ANGULAR_RATE);
        if is_angular_rate && value.has_pi && value.in_radians { Some(Self::TwoPiTwice) } else { value.turn }
    }
}

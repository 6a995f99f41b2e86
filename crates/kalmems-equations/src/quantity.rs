//! The units of expressions, and what is compared with what.
//!
//! The angle is a dimension of its own where it tells a mistake, and none where it would raise false alarms: ½·C′(θ)·V² is in
//! N·m/rad and is added to a torque in N·m. So sums, comparisons and equations do not look at it; the arguments of exp, ln,
//! atanh and of powers that are not whole do.

use kalmems_units::Dimension;

/// What is known of an expression's unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnitKnowledge {
    /// The number 0, which is a value in any unit.
    Any,
    /// A dimension, the angle included.
    Exact(Dimension),
    /// A dimension whose angle is not known, since terms with different ones were added.
    UpToAngle(Dimension),
}

const RADIAN: Dimension = Dimension::of([0, 0, 0, 0, 0, 1]);
/// The unit of an angle.
pub(crate) const ANGLE: UnitKnowledge = UnitKnowledge::Exact(RADIAN);

impl UnitKnowledge {
    pub(crate) const PLAIN: Self = Self::Exact(Dimension::NONE);

    /// The dimension, where it has one; the angle may be missing.
    pub(crate) fn dimension(self) -> Option<Dimension> {
        match self {
            Self::Any => None,
            Self::Exact(dimension) | Self::UpToAngle(dimension) => Some(dimension),
        }
    }

    fn map2(self, other: Self, of: impl Fn(Dimension, Dimension) -> Option<Dimension>) -> Option<Self> {
        Some(match (self, other) {
            (Self::Any, _) | (_, Self::Any) => Self::Any,
            (Self::Exact(a), Self::Exact(b)) => Self::Exact(of(a, b)?),
            (Self::Exact(a) | Self::UpToAngle(a), Self::Exact(b) | Self::UpToAngle(b)) => {
                Self::UpToAngle(of(a, b)?)
            }
        })
    }

    pub(crate) fn times(self, other: Self) -> Self {
        self.map2(other, |a, b| Some(a.times(b))).unwrap_or(Self::Any)
    }

    /// `None` where the exponents overflow.
    pub(crate) fn over(self, other: Self) -> Option<Self> {
        self.map2(other, |a, b| Some(a.times(b.to_half_power(-2)?)))
    }

    /// Raised to half of `halves`; `None` where an exponent would not be a whole half.
    pub(crate) fn to_half_power(self, halves: i16) -> Option<Self> {
        Some(match self {
            Self::Any => Self::Any,
            Self::Exact(dimension) => Self::Exact(dimension.to_half_power(halves)?),
            Self::UpToAngle(dimension) => Self::UpToAngle(dimension.to_half_power(halves)?),
        })
    }

    /// Whether the two can be added, the angle apart; and what the sum is.
    pub(crate) fn plus(self, other: Self) -> Option<Self> {
        match (self, other) {
            (Self::Any, known) | (known, Self::Any) => Some(known),
            (Self::Exact(a), Self::Exact(b)) if a == b => Some(self),
            _ => {
                let (a, b) = (self.dimension()?.without_angle(), other.dimension()?.without_angle());
                (a == b).then_some(Self::UpToAngle(a))
            }
        }
    }

    /// Whether it is a plain number, the angle included.
    pub(crate) fn is_plain(self) -> bool {
        match self {
            Self::Any => true,
            Self::Exact(dimension) => dimension == Dimension::NONE,
            Self::UpToAngle(dimension) => dimension.without_angle() == Dimension::NONE,
        }
    }

    /// Whether it is an angle or a plain number.
    pub(crate) fn is_angle(self) -> bool {
        self.dimension().is_none_or(|dimension| dimension.without_angle() == Dimension::NONE)
    }

    /// Whether an angle and nothing else is missing in it to be `wanted`.
    pub(crate) fn lacks_angle_of(self, wanted: Dimension) -> bool {
        matches!(self, Self::Exact(found) if found.times(RADIAN) == wanted)
    }
}

impl std::fmt::Display for UnitKnowledge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.dimension() {
            Some(dimension) => dimension.fmt(f),
            None => f.write_str("any"),
        }
    }
}

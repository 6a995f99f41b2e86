//! Which sign a value may have where physics says so.

use crate::units::{Kind, Value};
use std::fmt::Debug;

/// Which values are possible besides the right dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Every value, as for an offset.
    Any,
    /// Above 0, as for a mass.
    Positive,
    /// 0 or more, as for a damping.
    NotNegative,
    /// Any but 0, as for a gain.
    NotZero,
}

impl Sign {
    /// The SI value, if it has the dimension of `kind` and this sign; otherwise what is wrong, in words.
    pub(super) fn check(self, value: &Value, kind: &Kind) -> Result<f64, String> {
        let unitless = value.parts().1.is_empty();
        if unitless && !kind.accepts(value.unit().dimension()) {
            return Err(format!(
                "`{}` has no unit; expected {kind}, such as `\"{}\"`",
                value.text(),
                kind.example
            ));
        }
        let si = value.of_kind(kind).map_err(|e| e.to_string())?;
        let (fits, found, expected) = match self {
            Self::Any => return Ok(si),
            Self::Positive => (si > 0.0, "is not above 0", "above 0"),
            Self::NotNegative => (si >= 0.0, "is below 0", "of 0 or more"),
            Self::NotZero => (si != 0.0, "is 0", "other than 0"),
        };
        if fits {
            return Ok(si);
        }
        let (text, name, example) = (value.text(), kind.name, kind.example);
        Err(format!("`{text}` {found}; expected {name} {expected}, such as `{example}`"))
    }

    /// As an addition to the name of a kind: empty, or ` above 0`.
    pub(super) const fn suffix(self) -> &'static str {
        match self {
            Self::Any => "",
            Self::Positive => " above 0",
            Self::NotNegative => " of 0 or more",
            Self::NotZero => " other than 0",
        }
    }
}

/// A [`Sign`] known to the compiler.
pub trait SignOf: Debug + Clone + PartialEq {
    /// Which one.
    const SIGN: Sign;
}

macro_rules! signs {
    ($($name:ident)+) => { $(
        #[doc = concat!("Marks a [`Quantity`](super::Quantity) with [`Sign::", stringify!($name), "`].")]
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum $name {}
        impl SignOf for $name {
            const SIGN: Sign = Sign::$name;
        }
    )+ };
}

signs! { Any Positive NotNegative NotZero }

//! Two numbers side by side: the smallest lanes there are, to see that each lane goes its own way.

use kalmems_core::{Mask, Scalar};
use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

#[derive(Clone, Copy, Debug)]
pub struct Pair(pub [f64; 2]);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairMask(pub [bool; 2]);

impl Mask for PairMask {
    fn and(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i] & other.0[i]))
    }
    fn or(self, other: Self) -> Self {
        Self(from_fn(|i| self.0[i] | other.0[i]))
    }
    fn not(self) -> Self {
        Self(self.0.map(|m| !m))
    }
    fn all(self) -> bool {
        self.0 == [true; 2]
    }
    fn any(self) -> bool {
        self.0 != [false; 2]
    }
}

macro_rules! operator {
    ($trait:ident, $name:ident) => {
        impl $trait for Pair {
            type Output = Self;
            fn $name(self, other: Self) -> Self {
                Self(from_fn(|i| $trait::$name(self.0[i], other.0[i])))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl Neg for Pair {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

macro_rules! function {
    ($($name:ident)*) => {
        $(fn $name(self) -> Self {
            Self(self.0.map(Scalar::$name))
        })*
    };
}

impl Scalar for Pair {
    type Mask = PairMask;
    fn of(value: f64) -> Self {
        Self([value; 2])
    }
    fn lt(self, other: Self) -> PairMask {
        PairMask(from_fn(|i| self.0[i] < other.0[i]))
    }
    fn is_finite(self) -> PairMask {
        PairMask(self.0.map(f64::is_finite))
    }
    fn select(mask: PairMask, yes: Self, no: Self) -> Self {
        Self(from_fn(|i| if mask.0[i] { yes.0[i] } else { no.0[i] }))
    }
    function!(sqrt exp ln sin cos atanh);
}

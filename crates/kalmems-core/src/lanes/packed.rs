//! A register as a [`Scalar`].

use super::arithmetic::arithmetic;
use crate::Scalar;
use crate::math::{self, Register};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// The numbers of a register, side by side.
///
/// It must not be named outside: code over an instruction set's registers is sound only where [`super::Isa`] has found
/// that set.
#[derive(Clone, Copy, Debug)]
pub struct Packed<V>(pub(super) V);

arithmetic!(Packed(0));

/// Functions of the register.
macro_rules! each {
    ($($method:ident = $function:path),*) => {$(
        #[inline(always)]
        fn $method(self) -> Self {
            Self($function(self.0))
        }
    )*};
}

impl<V: Register> Scalar for Packed<V> {
    type Mask = V::Mask;

    #[inline(always)]
    fn of(value: f64) -> Self {
        Self(V::splat(V::Float::of(value)))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> V::Mask {
        self.0.lt(other.0)
    }
    #[inline(always)]
    fn is_finite(self) -> V::Mask {
        self.0.is_finite()
    }
    #[inline(always)]
    fn select(mask: V::Mask, yes: Self, no: Self) -> Self {
        Self(V::select(mask, yes.0, no.0))
    }
    each!(abs = Register::abs, sqrt = Register::sqrt);
    each!(exp = math::exp, ln = math::ln, sin = math::sin, cos = math::cos, atanh = math::atanh);
}

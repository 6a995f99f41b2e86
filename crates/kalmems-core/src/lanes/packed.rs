//! A register as a [`Scalar`].

use crate::Scalar;
use crate::math::{self, Register};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// The numbers of a register, side by side.
///
/// It must not be named outside: code over an instruction set's registers is sound only where [`super::Isa`] has found
/// that set.
#[derive(Clone, Copy, Debug)]
pub struct Packed<V>(pub(super) V);

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<V: Register> $trait for Packed<V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<V: Register> Neg for Packed<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
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
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Self(math::exp(self.0))
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self(math::ln(self.0))
    }
    #[inline(always)]
    fn sin(self) -> Self {
        Self(math::sin(self.0))
    }
    #[inline(always)]
    fn cos(self) -> Self {
        Self(math::cos(self.0))
    }
    #[inline(always)]
    fn atanh(self) -> Self {
        Self(math::atanh(self.0))
    }
}

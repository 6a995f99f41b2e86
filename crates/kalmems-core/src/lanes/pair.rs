//! Two registers as one.

use super::arithmetic::arithmetic;
use crate::Mask;
use crate::math::Register;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// Two registers, every operation on both; pairs of pairs make more.
#[derive(Clone, Copy, Debug)]
pub struct Pair<A>(A, A);

impl<M: Mask> Mask for Pair<M> {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0.and(other.0), self.1.and(other.1))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0.or(other.0), self.1.or(other.1))
    }
    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0.not(), self.1.not())
    }
    #[inline(always)]
    fn all(self) -> bool {
        self.0.and(self.1).all()
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.0.or(self.1).any()
    }
}

arithmetic!(Pair(0, 1));

/// Functions of each register by itself.
macro_rules! each {
    ($($method:ident),*) => {$(
        #[inline(always)]
        fn $method(self) -> Self {
            Self(self.0.$method(), self.1.$method())
        }
    )*};
}

/// Functions of a register of each.
macro_rules! both {
    ($($method:ident),*) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            Self(self.0.$method(other.0), self.1.$method(other.1))
        }
    )*};
}

impl<V: Register> Register for Pair<V> {
    type Float = V::Float;
    type Mask = Pair<V::Mask>;
    const WIDTH: usize = 2 * V::WIDTH;

    #[inline(always)]
    fn from_fn(mut f: impl FnMut(usize) -> V::Float) -> Self {
        let first = V::from_fn(&mut f);
        Self(first, V::from_fn(|i| f(V::WIDTH + i)))
    }
    #[inline(always)]
    fn load(values: &[V::Float], rest: V::Float) -> Self {
        let more = values.get(V::WIDTH..).unwrap_or_default();
        Self(V::load(values, rest), V::load(more, rest))
    }
    #[inline(always)]
    fn store(self, values: &mut [V::Float]) {
        self.0.store(values);
        if let Some(more) = values.get_mut(V::WIDTH..) {
            self.1.store(more);
        }
    }
    #[inline(always)]
    fn lane(self, index: usize) -> Option<V::Float> {
        if index < V::WIDTH { self.0.lane(index) } else { self.1.lane(index - V::WIDTH) }
    }
    #[inline(always)]
    fn is_set(mask: Self::Mask, index: usize) -> bool {
        if index < V::WIDTH { V::is_set(mask.0, index) } else { V::is_set(mask.1, index - V::WIDTH) }
    }
    #[inline(always)]
    fn splat(value: V::Float) -> Self {
        Self(V::splat(value), V::splat(value))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        Pair(self.0.lt(other.0), self.1.lt(other.1))
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(V::select(mask.0, yes.0, no.0), V::select(mask.1, yes.1, no.1))
    }
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        Pair(self.0.is_finite(), self.1.is_finite())
    }
    #[inline(always)]
    fn map(self, f: fn(V::Float) -> V::Float) -> Self {
        Self(self.0.map(f), self.1.map(f))
    }
    #[inline(always)]
    fn is_odd(self) -> Self::Mask {
        Pair(self.0.is_odd(), self.1.is_odd())
    }
    each!(sqrt, halved_bits, exponent_as_integer, integer_as_exponent, second_bit_as_sign);
    both!(at_most, at_least, and, xor, plus_bits, minus_bits);
}

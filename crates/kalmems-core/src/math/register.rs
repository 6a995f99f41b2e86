//! What the elementary functions are written over.

use super::constants::Constants;
use crate::lanes::{FUSED_F32, mac_f32, mac_f64, sqrt_f32, sqrt_f64};
use crate::{Mask, Scalar};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A register of floating-point numbers, one or several, that can also be treated as the integers of their bits.
///
/// Every operation is one instruction or a few on each number by itself, and rounds as IEEE 754 says.
pub trait Register:
    Copy
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// One of the numbers.
    type Float: Constants + Scalar;
    /// One truth value for each.
    type Mask: Mask;

    /// How many there are.
    const WIDTH: usize;
    /// Whether [`mac`](Register::mac) rounds once.
    const FUSED: bool = false;

    /// The numbers `f(0)`, `f(1)`, …
    fn from_fn(f: impl FnMut(usize) -> Self::Float) -> Self;
    /// The first numbers of a slice, and `rest` where it has no more.
    fn load(values: &[Self::Float], rest: Self::Float) -> Self;
    /// Writes as many numbers as a slice takes.
    fn store(self, values: &mut [Self::Float]);
    /// One number, if there is such a one.
    fn lane(self, index: usize) -> Option<Self::Float>;
    /// Whether one number's truth value is set; not where there is no such number.
    fn is_set(mask: Self::Mask, index: usize) -> bool;

    /// The same number everywhere.
    fn splat(value: Self::Float) -> Self;
    /// `a < b`; false where either is not a number.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask is set, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// The smaller of a number and a bound; what is not a number stays so.
    fn at_most(self, bound: Self) -> Self;
    /// The larger of a number and a bound; what is not a number stays so.
    fn at_least(self, bound: Self) -> Self;
    /// Neither infinite nor not a number.
    fn is_finite(self) -> Self::Mask;
    /// √x, correctly rounded.
    fn sqrt(self) -> Self;
    /// `self + a·b`.
    #[inline(always)]
    fn mac(self, a: Self, b: Self) -> Self {
        self + a * b
    }
    /// What a function makes of each number: slow, for what is rare.
    fn map(self, f: fn(Self::Float) -> Self::Float) -> Self;

    /// The bits set in both.
    fn and(self, other: Self) -> Self;
    /// The bits set in one of the two.
    fn xor(self, other: Self) -> Self;
    /// The sum of the bits as integers, modulo their size.
    fn plus_bits(self, other: Self) -> Self;
    /// The difference of the bits as integers, modulo their size.
    fn minus_bits(self, other: Self) -> Self;
    /// The bits shifted right by one.
    fn halved_bits(self) -> Self;
    /// The exponent's bits and the sign moved down to where an integer's begin.
    fn exponent_as_integer(self) -> Self;
    /// The lowest bits moved up to where the exponent's are, with nothing below.
    fn integer_as_exponent(self) -> Self;
    /// The second-lowest bit moved up to where the sign is, and rubbish below.
    fn second_bit_as_sign(self) -> Self;
    /// Whether the lowest bit is set.
    fn is_odd(self) -> Self::Mask;

    /// |x|.
    #[inline(always)]
    fn abs(self) -> Self {
        self.and(Self::splat(Self::Float::ALL_BUT_SIGN))
    }
    /// The sign, and nothing else.
    #[inline(always)]
    fn sign(self) -> Self {
        self.and(Self::splat(Self::Float::SIGN))
    }
}

macro_rules! single {
    ($float:ident, $sqrt:ident, $mac:ident, $fused:expr) => {
        impl Register for $float {
            type Float = Self;
            type Mask = bool;
            const WIDTH: usize = 1;
            const FUSED: bool = $fused;

            #[inline(always)]
            fn from_fn(mut f: impl FnMut(usize) -> Self) -> Self {
                f(0)
            }
            #[inline(always)]
            fn load(values: &[Self], rest: Self) -> Self {
                values.first().copied().unwrap_or(rest)
            }
            #[inline(always)]
            fn store(self, values: &mut [Self]) {
                if let Some(first) = values.first_mut() {
                    *first = self;
                }
            }
            #[inline(always)]
            fn lane(self, index: usize) -> Option<Self> {
                (index == 0).then_some(self)
            }
            #[inline(always)]
            fn is_set(mask: bool, index: usize) -> bool {
                mask && index == 0
            }

            #[inline(always)]
            fn splat(value: Self) -> Self {
                value
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn at_most(self, bound: Self) -> Self {
                if bound < self { bound } else { self }
            }
            #[inline(always)]
            fn at_least(self, bound: Self) -> Self {
                if bound > self { bound } else { self }
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $float::is_finite(self)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            #[inline(always)]
            fn mac(self, a: Self, b: Self) -> Self {
                $mac(self, a, b)
            }
            #[inline(always)]
            fn map(self, f: fn(Self) -> Self) -> Self {
                f(self)
            }

            #[inline(always)]
            fn and(self, other: Self) -> Self {
                Self::from_bits(self.to_bits() & other.to_bits())
            }
            #[inline(always)]
            fn xor(self, other: Self) -> Self {
                Self::from_bits(self.to_bits() ^ other.to_bits())
            }
            #[inline(always)]
            fn plus_bits(self, other: Self) -> Self {
                Self::from_bits(self.to_bits().wrapping_add(other.to_bits()))
            }
            #[inline(always)]
            fn minus_bits(self, other: Self) -> Self {
                Self::from_bits(self.to_bits().wrapping_sub(other.to_bits()))
            }
            #[inline(always)]
            fn halved_bits(self) -> Self {
                Self::from_bits(self.to_bits() >> 1)
            }
            #[inline(always)]
            fn exponent_as_integer(self) -> Self {
                Self::from_bits(self.to_bits() >> (Self::MANTISSA_DIGITS - 1))
            }
            #[inline(always)]
            fn integer_as_exponent(self) -> Self {
                Self::from_bits(self.to_bits() << (Self::MANTISSA_DIGITS - 1))
            }
            #[inline(always)]
            fn second_bit_as_sign(self) -> Self {
                Self::from_bits(self.to_bits() << (8 * size_of::<Self>() - 2))
            }
            #[inline(always)]
            fn is_odd(self) -> bool {
                self.to_bits() & 1 != 0
            }
        }
    };
}

single!(f64, sqrt_f64, mac_f64, false);
single!(f32, sqrt_f32, mac_f32, FUSED_F32);

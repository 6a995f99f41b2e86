//! What the elementary functions are written over.

use super::constants::Constants;
use super::fused::{FUSED_F32, mac_f32, mac_f64};
use super::sqrt::{sqrt_f32, sqrt_f64};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A floating-point number that can also be treated as the integer of its bits.
///
/// Every operation is one instruction or a few, and rounds as IEEE 754 says.
pub trait Register:
    Constants
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Whether [`mac`](Register::mac) rounds once.
    const FUSED: bool = false;

    /// `a < b`; false where either is not a number.
    fn lt(self, other: Self) -> bool;
    /// `yes` where the condition holds, `no` elsewhere.
    fn select(condition: bool, yes: Self, no: Self) -> Self;
    /// The smaller of a number and a bound; what is not a number stays so.
    fn at_most(self, bound: Self) -> Self;
    /// The larger of a number and a bound; what is not a number stays so.
    fn at_least(self, bound: Self) -> Self;
    /// Neither infinite nor not a number.
    fn is_finite(self) -> bool;
    /// √x, correctly rounded.
    fn sqrt(self) -> Self;
    /// `self + a·b`.
    #[inline(always)]
    fn mac(self, a: Self, b: Self) -> Self {
        self + a * b
    }

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
    fn is_odd(self) -> bool;

    /// |x|.
    #[inline(always)]
    fn abs(self) -> Self {
        self.and(Self::ALL_BUT_SIGN)
    }
    /// The sign, and nothing else.
    #[inline(always)]
    fn sign(self) -> Self {
        self.and(Self::SIGN)
    }
}

macro_rules! single {
    ($float:ident, $sqrt:ident, $mac:ident, $fused:expr) => {
        impl Register for $float {
            const FUSED: bool = $fused;

            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(condition: bool, yes: Self, no: Self) -> Self {
                if condition { yes } else { no }
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

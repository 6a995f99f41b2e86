//! The natural logarithm.

use super::Register;

/// ln x = k·ln 2 + ln m with x = 2ᵏ·m and m between √½ and √2.
///
/// With f = m − 1 and s = f/(2 + f), ln m = 2·atanh s = f − s·(f − 2·s²·P(s²)), the form that keeps f's exactness.
/// −∞ at zero, not a number below.
#[inline(always)]
pub(crate) fn ln<R: Register>(x: R) -> R {
    let c = R::LN;
    let zero = R::ZERO;
    // Subnormal numbers are made normal first.
    let small = x.lt(R::MIN_POSITIVE);
    let scaled = R::select(small, x * c.lift, x);
    // √½ becomes 1, so that the exponent's bits are k plus the bias.
    let moved = scaled.plus_bits(c.one_minus_root_half);
    let k = exponent(moved) - R::select(small, c.lift_exponent, zero);
    let m = moved.and(c.mantissa).plus_bits(c.root_half);

    let f = m - R::ONE;
    let s = f / (f + R::TWO);
    let z = s * s;
    let series = R::ATANH.tail.at(z, z * z) * z;
    let shortfall = s * (f - (series + series));
    let y = k * c.ln_2[0] - ((shortfall - k * c.ln_2[1]) - f);

    let below = R::select(x.lt(zero), R::NAN, -R::INFINITY);
    let y = R::select(zero.lt(x), y, below);
    // +∞ is its own logarithm, and what is not a number stays so.
    R::select(x.lt(R::INFINITY), y, x)
}

/// The exponent of a positive number, as a number.
#[inline(always)]
pub(super) fn exponent<R: Register>(x: R) -> R {
    let c = R::LN;
    // Below the bits of a power of two that has no fraction, an integer is added to it.
    x.exponent_as_integer().plus_bits(c.integers) - c.biased_integers
}

//! The exponential function.

use super::Register;
use super::constants::Constants;

/// eˣ = 2ⁿ·eʳ with n = round(x/ln 2) and |r| ≤ ½·ln 2.
///
/// No table: lanes would have to gather from it. Zero below the least subnormal, infinite above the largest number.
#[inline(always)]
pub(crate) fn exp<R: Register>(x: R) -> R {
    let c = R::Float::EXP;
    // Beyond these bounds the result is zero or infinite, and 2ⁿ could not be put together.
    let x = x.at_most(R::splat(c.highest)).at_least(R::splat(c.lowest));
    // The sum is too large to have a fraction: its lowest bits are n plus twice the exponent's bias.
    let shifted = x * R::splat(c.per_ln_2) + R::splat(c.shift);
    let n = shifted - R::splat(c.shift);
    // ln 2 in two parts, the first so short that its product with n is exact.
    let high = x - n * R::splat(c.ln_2[0]);
    let low = n * R::splat(c.ln_2[1]);
    let r = high - low;
    let square = r * r;
    let e_r = R::splat(R::Float::ONE) + (high + (square * c.tail.at(r, square) - low));
    // 2ⁿ in two factors of half the exponent: n itself is too large for one at both ends of the range.
    let half = shifted.halved_bits();
    let other_half = shifted.minus_bits(half);
    e_r * half.integer_as_exponent() * other_half.integer_as_exponent()
}

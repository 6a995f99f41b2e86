//! The inverse hyperbolic tangent.

use super::Register;
use super::ln::exponent;

/// atanh x = ½·ln(u/v) with u = 1 + |x| and v = 1 − |x|, and the sign of x.
///
/// u/v = 2ᵏ·m with m from about 1 to about 2, found in the difference of the bits of u and v (log₂ u is within 0.0861
/// of a line between powers of two); then atanh x = k·½·ln 2 + atanh s with s = (u − 2ᵏ·v)/(u + 2ᵏ·v). The terms have
/// one sign, so that no digits cancel. What u and v lose by rounding is carried along, so that nothing is lost near
/// zero (where s = x) nor near one. ±∞ at ±1, not a number beyond.
#[inline(always)]
pub(crate) fn atanh<R: Register>(x: R) -> R {
    let c = R::ATANH;
    let one = R::ONE;
    let size = x.abs();
    let u = one + size;
    let u_rest = size - (u - one);
    let v = one - size;
    let v_rest = (one - v) - size;

    let ratio = u.minus_bits(v).plus_bits(one);
    let power = ratio.and(R::INFINITY);
    let k = exponent(ratio);
    let scaled = v * power;
    let s = ((u - scaled) + (u_rest - v_rest * power)) / (u + scaled);
    let z = s * s;
    let rest = s * z * c.tail.at(z, z * z) + k * c.half_ln_2[1];
    let y = k * c.half_ln_2[0] + (s + rest);

    let is_one = size.lt(R::TWO) & !one.lt(size);
    let outside = R::select(is_one, R::INFINITY, R::NAN);
    R::select(size.lt(one), y, outside).xor(x.sign())
}

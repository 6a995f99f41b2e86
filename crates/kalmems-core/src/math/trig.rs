//! Sine and cosine.

use super::Register;
use super::constants::Constants;
use crate::Mask;

/// An angle as n·π/2 + r with |r| ≤ π/4.
struct ReducedAngle<R: Register> {
    /// r rounded.
    r: R,
    /// What r lost by that.
    rest: R,
    /// A number whose lowest bits are n.
    quadrant: R,
    /// Where r is not good to its last bit: beyond the range that π/2 in parts is made for, and where an angle is
    /// so close to a multiple of π/2 that all its digits cancel.
    bad: R::Mask,
}

/// Cody and Waite's reduction (Software Manual for the Elementary Functions, 1980): π/2 in parts, all but the last so
/// short that their products with n are exact.
#[inline(always)]
fn reduce<R: Register>(size: R) -> ReducedAngle<R> {
    let c = R::Float::TRIG;
    // The sum is too large to have a fraction.
    let quadrant = size * R::splat(c.two_per_pi) + R::splat(c.shift);
    let n = quadrant - R::splat(c.shift);
    let mut r = size - n * R::splat(c.half_pi);
    let mut rest = R::splat(R::Float::ZERO);
    for part in c.half_pi_rest {
        let product = n * R::splat(*part);
        let next = r - product;
        rest = rest + ((r - next) - product);
        r = next;
    }
    let inside = size.lt(R::splat(c.bound));
    let beyond = size.lt(R::splat(R::Float::INFINITY)).and(inside.not());
    let bad = beyond.or(r.abs().lt(n * R::splat(c.cancelled)));
    ReducedAngle { r, rest, quadrant, bad }
}

/// sin(r + rest) and cos(r + rest).
#[inline(always)]
fn in_first_octant<R: Register>(r: R, rest: R) -> (R, R) {
    let c = R::Float::TRIG;
    let one = R::splat(R::Float::ONE);
    let z = r * r;
    let z2 = z * z;
    let half = z * R::splat(R::Float::HALF);
    let near = one - half;
    let sin = r + (r * (z * c.sin.at(z, z2)) + rest * near);
    let cos = near + (((one - near) - half) + (z2 * c.cos.at(z, z2) - r * rest));
    (sin, cos)
}

/// The sine.
///
/// Up to the bound of the reduction (2²⁰·π/2 in f64, 2¹²·π/2 in f32) without a branch. Beyond it, and for the few
/// angles nearest to multiples of π/2, `libm` reduces exactly, number by number. Not a number at infinity.
#[inline(always)]
pub(crate) fn sin<R: Register>(x: R) -> R {
    let reduced = reduce(x.abs());
    let (sin, cos) = in_first_octant(reduced.r, reduced.rest);
    let y = R::select(reduced.quadrant.is_odd(), cos, sin);
    let y = y.xor(reduced.quadrant.second_bit_as_sign().sign()).xor(x.sign());
    exactly_where(reduced.bad, x, y, R::Float::sin_exactly_reduced)
}

/// The cosine; see [`sin`].
#[inline(always)]
pub(crate) fn cos<R: Register>(x: R) -> R {
    let reduced = reduce(x.abs());
    let (sin, cos) = in_first_octant(reduced.r, reduced.rest);
    let y = R::select(reduced.quadrant.is_odd(), sin, cos);
    let y = y.xor((reduced.quadrant + R::splat(R::Float::ONE)).second_bit_as_sign().sign());
    exactly_where(reduced.bad, x, y, R::Float::cos_exactly_reduced)
}

/// `f(x)` where the mask is set, `y` elsewhere.
#[inline(always)]
fn exactly_where<R: Register>(mask: R::Mask, x: R, y: R, f: fn(R::Float) -> R::Float) -> R {
    if mask.any() { R::select(mask, x.map(f), y) } else { y }
}

//! Sine and cosine.

use super::Register;

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
    bad: bool,
}

/// Cody and Waite's reduction (Software Manual for the Elementary Functions, 1980): π/2 in parts, all but the last so
/// short that their products with n are exact.
#[inline(always)]
fn reduce<R: Register>(size: R) -> ReducedAngle<R> {
    let c = R::TRIG;
    // The sum is too large to have a fraction.
    let quadrant = size * c.two_per_pi + c.shift;
    let n = quadrant - c.shift;
    let mut r = size - n * c.half_pi;
    let mut rest = R::ZERO;
    for part in c.half_pi_rest {
        let product = n * *part;
        let next = r - product;
        rest = rest + ((r - next) - product);
        r = next;
    }
    let inside = size.lt(c.bound);
    let beyond = size.lt(R::INFINITY) && !inside;
    let bad = beyond | r.abs().lt(n * c.cancelled);
    ReducedAngle { r, rest, quadrant, bad }
}

/// sin(r + rest) and cos(r + rest).
#[inline(always)]
fn in_first_octant<R: Register>(r: R, rest: R) -> (R, R) {
    let c = R::TRIG;
    let one = R::ONE;
    let z = r * r;
    let z2 = z * z;
    let half = z * R::HALF;
    let near = one - half;
    let sin = r + (r * (z * c.sin.at(z, z2)) + rest * near);
    let cos = near + (((one - near) - half) + (z2 * c.cos.at(z, z2) - r * rest));
    (sin, cos)
}

/// The sine.
///
/// Up to the bound of the reduction (2²⁰·π/2 in f64, 2¹²·π/2 in f32) without a branch. Beyond it, and for the few
/// angles nearest to multiples of π/2, `libm` reduces exactly. Not a number at infinity.
#[inline(always)]
pub(crate) fn sin<R: Register>(x: R) -> R {
    let reduced = reduce(x.abs());
    let (sin, cos) = in_first_octant(reduced.r, reduced.rest);
    let y = R::select(reduced.quadrant.is_odd(), cos, sin);
    let y = y.xor(reduced.quadrant.second_bit_as_sign().sign()).xor(x.sign());
    if reduced.bad { x.sin_exactly_reduced() } else { y }
}

/// The cosine; see [`sin`].
#[inline(always)]
pub(crate) fn cos<R: Register>(x: R) -> R {
    let reduced = reduce(x.abs());
    let (sin, cos) = in_first_octant(reduced.r, reduced.rest);
    let y = R::select(reduced.quadrant.is_odd(), sin, cos);
    let y = y.xor((reduced.quadrant + R::ONE).second_bit_as_sign().sign());
    if reduced.bad { x.cos_exactly_reduced() } else { y }
}

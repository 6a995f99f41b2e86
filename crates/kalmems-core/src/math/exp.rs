//! The exponential function.

use super::Register;

/// eˣ = 2ⁿ·eʳ with n = round(x/ln 2) and |r| ≤ ½·ln 2.
///
/// No table. Zero below the least subnormal, infinite above the largest number.
#[inline(always)]
pub(crate) fn exp<R: Register>(x: R) -> R {
    if !R::FUSED {
        return anywhere(x);
    }
    // A small processor: nearly always an exponent can be added. Elsewhere a call that is never made would cost registers.
    if x.abs().lt(R::EXP.near) { near(x) } else { x.exp_anywhere() }
}

/// eˣ where 2ⁿ is a normal number and so is the result.
#[inline(always)]
fn near<R: Register>(x: R) -> R {
    let c = R::EXP;
    // The sum is too large to have a fraction: its lowest bits are n.
    let shifted = c.shift.mac(x, c.per_ln_2);
    e_r(x, shifted - c.shift).plus_bits(shifted.integer_as_exponent())
}

/// eˣ of any number.
#[inline(always)]
pub(super) fn anywhere<R: Register>(x: R) -> R {
    let c = R::EXP;
    // Beyond these bounds the result is zero or infinite, and 2ⁿ could not be put together.
    let x = x.at_most(c.highest).at_least(c.lowest);
    // The lowest bits are n plus twice the exponent's bias.
    let shifted = c.biased_shift.mac(x, c.per_ln_2);
    let e_r = e_r(x, shifted - c.biased_shift);
    // 2ⁿ in two factors of half the exponent: n itself is too large for one at both ends of the range.
    let half = shifted.halved_bits();
    let other_half = shifted.minus_bits(half);
    e_r * half.integer_as_exponent() * other_half.integer_as_exponent()
}

/// eʳ with r = x − n·ln 2.
#[inline(always)]
fn e_r<R: Register>(x: R, n: R) -> R {
    let c = R::EXP;
    // ln 2 in two parts, the first so short that its product with n is exact.
    let high = x.mac(n, -c.ln_2[0]);
    if R::FUSED {
        let r = high.mac(n, -c.ln_2[1]);
        let square = r * r;
        return R::ONE + r.mac(square, c.tail.at(r, square));
    }
    // What r loses when it is rounded is brought back in the sum.
    let low = n * -c.ln_2[1];
    let r = high + low;
    let square = r * r;
    R::ONE + (high + low.mac(square, c.tail.at(r, square)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With either way of scaling the bits are the same, so that only fused multiplications can tell processors apart.
    #[test]
    fn near_is_anywhere_to_the_last_bit() {
        for k in -100_000..=100_000 {
            let x = f64::from(k) * 5.119_9e-3;
            assert_eq!(near(x), anywhere(x), "{x}");
            let x = k as f32 * 6.399e-4;
            assert_eq!(near(x), anywhere(x), "{x}");
        }
    }
}

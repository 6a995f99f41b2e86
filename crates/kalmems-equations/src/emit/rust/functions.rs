// --- EXP
/// e^x: x = n ln 2 + r, a polynomial in r, and n added to the exponent.
pub(super) fn exp(x: f32) -> f32 {
    if !(x > -86.0) {
        // Near the smallest number, and not a number of what is none.
        return if x <= -86.0 { 0.0 } else { x };
    }
    if x > 88.7 {
        return f32::INFINITY;
    }
    let count = 12_582_912.0 + x * core::f32::consts::LOG2_E;
    let n = count - 12_582_912.0;
    let high = x - n * 0.693_145_75;
    let low = n * -1.428_606_8e-6;
    let r = high + low;
    let square = r * r;
    let tail = (0.001_381_458_1 * square + 0.041_668_39) * square + 0.499_999_94;
    let tail = tail + (0.008_368_727_8 * square + 0.166_665_21) * r;
    let value = 1.0 + (high + (low + square * tail));
    // In two steps, since 2^n alone may be too large.
    let half = f32::from_bits((count.to_bits().wrapping_sub(1) << 23).wrapping_add(0x3F80_0000));
    value * half * 2.0
}
// --- FALLING_EXP
/// e^x for x <= 0: x = n ln 2 + r, a polynomial in r, and n added to the exponent.
#[inline(always)]
pub(super) fn falling_exp(x: f32) -> f32 {
    if !(x > -64.0) {
        // Below 2e-28, and not a number of what is none.
        return if x <= -64.0 { 0.0 } else { x };
    }
    let count = 12_582_912.0 + x * core::f32::consts::LOG2_E;
    let n = count - 12_582_912.0;
    let high = x - n * 0.693_145_75;
    let low = n * -1.428_606_8e-6;
    let r = high + low;
    let square = r * r;
    let tail = (0.001_381_458_1 * square + 0.041_668_39) * square + 0.499_999_94;
    let tail = tail + (0.008_368_727_8 * square + 0.166_665_21) * r;
    let value = 1.0 + (high + (low + square * tail));
    f32::from_bits(value.to_bits().wrapping_add(count.to_bits() << 23))
}
// --- LN
/// ln x: x = m 2^n with m between sqrt(1/2) and sqrt(2), and a series in (m - 1)/(m + 1).
pub(super) fn ln(x: f32) -> f32 {
    if !(x > 0.0) || x == f32::INFINITY {
        return if x == 0.0 {
            f32::NEG_INFINITY
        } else if x > 0.0 {
            x
        } else {
            f32::NAN
        };
    }
    // A number without a leading one is made larger by 2^24.
    let (x, more) = if x < f32::MIN_POSITIVE { (x * 16_777_216.0, 24.0) } else { (x, 0.0) };
    let shifted = x.to_bits().wrapping_sub(0x3F35_04F3);
    let n = ((shifted as i32) >> 23) as f32 - more;
    let m = f32::from_bits((shifted & 0x007F_FFFF).wrapping_add(0x3F35_04F3));
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    let series = ((0.222_222_22 * square + 0.285_714_3) * square + 0.4) * square + 0.666_666_7;
    n * 0.693_145_75 + (n * 1.428_606_8e-6 + (2.0 * s + s * square * series))
}
// --- SIN_COS
/// sin r and cos r for |r| <= pi/4, and which quarter of a turn x = quarter pi/2 + r is in.
pub(super) fn reduced(x: f32) -> (f32, f32, u32) {
    let count = 12_582_912.0 + x * core::f32::consts::FRAC_2_PI;
    let n = count - 12_582_912.0;
    let r = ((x - n * 1.570_312_5) - n * 4.837_512_97e-4) - n * 7.549_789_95e-8;
    let square = r * r;
    let sine = ((2.755_731_9e-6 * square - 1.984_127e-4) * square + 8.333_333_3e-3) * square - 0.166_666_67;
    let cosine = ((-2.755_731_9e-7 * square + 2.480_158_7e-5) * square - 1.388_888_9e-3) * square + 0.041_666_667;
    // What 1 - square/2 loses by rounding is added with the small terms.
    let half = 0.5 * square;
    let near = 1.0 - half;
    let cosine = near + (((1.0 - near) - half) + square * square * cosine);
    (r + r * square * sine, cosine, count.to_bits() & 3)
}
// --- SIN
pub(super) fn sin(x: f32) -> f32 {
    let (sine, cosine, quarter) = reduced(x);
    let value = if quarter & 1 == 0 { sine } else { cosine };
    if quarter & 2 == 0 { value } else { -value }
}
// --- COS
pub(super) fn cos(x: f32) -> f32 {
    let (sine, cosine, quarter) = reduced(x);
    let value = if quarter & 1 == 0 { cosine } else { sine };
    if quarter == 1 || quarter == 2 { -value } else { value }
}
// --- TANH
/// tanh x: Lambert's continued fraction near 0, and by e^x elsewhere.
pub(super) fn tanh(x: f32) -> f32 {
    let square = x * x;
    if square < 0.4 {
        let above = (square + 378.0) * square + 17_325.0;
        let below = (28.0 * square + 3150.0) * square + 62_370.0;
        return x * (above * square + 135_135.0) / (below * square + 135_135.0);
    }
    let left = falling_exp(if x < 0.0 { 2.0 * x } else { -2.0 * x });
    let size = (1.0 - left) / (1.0 + left);
    if x < 0.0 { -size } else { size }
}
// --- ATANH
/// atanh x: a series near 0, and by a logarithm elsewhere.
pub(super) fn atanh(x: f32) -> f32 {
    let square = x * x;
    if square < 0.09 {
        let series = ((0.076_923_08 * square + 0.090_909_09) * square + 0.111_111_11) * square + 0.142_857_14;
        return x + x * square * ((series * square + 0.2) * square + 0.333_333_33);
    }
    0.5 * ln((1.0 + x) / (1.0 - x))
}
// --- SQRT
/// sqrt x: Heron's method from half the exponent.
pub(super) fn sqrt(x: f32) -> f32 {
    if !(x > 0.0) || x == f32::INFINITY {
        return if x < 0.0 { f32::NAN } else { x };
    }
    let (x, back) = if x < f32::MIN_POSITIVE { (x * 16_777_216.0, 1.0 / 4096.0) } else { (x, 1.0) };
    let mut root = f32::from_bits((x.to_bits() >> 1).wrapping_add(0x1FBB_4F2E));
    root = 0.5 * (root + x / root);
    root = 0.5 * (root + x / root);
    root = 0.5 * (root + x / root);
    root * back
}
// --- ATAN
/// atan x: an eighth of a turn or two taken off, and a polynomial in what is left.
pub(super) fn atan(x: f32) -> f32 {
    let size = if x < 0.0 { -x } else { x };
    let (start, t) = if size > 2.414_213_6 {
        (core::f32::consts::FRAC_PI_2, -1.0 / size)
    } else if size > 0.414_213_57 {
        (core::f32::consts::FRAC_PI_4, (size - 1.0) / (size + 1.0))
    } else {
        (0.0, size)
    };
    let square = t * t;
    let series = (-0.064_519_28 * square + 0.107_437_31) * square - 0.142_639_56;
    let series = (series * square + 0.199_995_4) * square - 0.333_333_32;
    let angle = start + (t + t * square * series);
    if x < 0.0 { -angle } else { angle }
}
// --- ASIN
/// asin x by the arc tangent.
pub(super) fn asin(x: f32) -> f32 {
    atan(x / sqrt((1.0 - x) * (1.0 + x)))
}
// --- ACOS
/// acos x by the arc tangent of half of it.
pub(super) fn acos(x: f32) -> f32 {
    2.0 * atan(sqrt((1.0 - x) / (1.0 + x)))
}
// --- FLOOR
/// The largest whole number that is not above x.
pub(super) fn floor(x: f32) -> f32 {
    // Larger numbers are whole, and what is no number stays that.
    if !(x > -8_388_608.0 && x < 8_388_608.0) {
        return x;
    }
    let whole = x as i32 as f32;
    if whole > x { whole - 1.0 } else { whole }
}
// --- LN_COSH
/// ln cosh x
pub(super) fn ln_cosh(x: f32) -> f32 {
    let square = x * x;
    if square < 0.25 {
        let series = (2.565_794_5e-4 * square - 7.386_029_6e-4) * square + 2.186_948_8e-3;
        let series = ((series * square - 6.746_031_7e-3) * square + 0.022_222_222) * square - 0.083_333_333;
        return square * (series * square + 0.5);
    }
    let size = if x < 0.0 { -x } else { x };
    (size - core::f32::consts::LN_2) + ln(1.0 + falling_exp(-2.0 * size))
}
// --- ATANHC
/// atanh(z)/z and its first two derivatives.
pub(super) fn atanhc(z: f32, order: u32) -> f32 {
    let square = z * z;
    if square < 0.25 {
        // 1 + z^2/3 + z^4/5 + ..., differentiated term by term.
        let (mut sum, mut k) = (0.0, 14.0);
        while k >= 0.0 {
            let term = match order {
                0 => 1.0 / (2.0 * k + 1.0),
                1 => (2.0 * k + 2.0) / (2.0 * k + 3.0),
                _ => (2.0 * k + 2.0) * (2.0 * k + 1.0) / (2.0 * k + 3.0),
            };
            sum = sum * square + term;
            k -= 1.0;
        }
        return if order == 1 { sum * z } else { sum };
    }
    let value = atanh(z) / z;
    if order == 0 {
        return value;
    }
    let rest = 1.0 / (1.0 - square);
    let slope = (rest - value) / z;
    if order == 1 { slope } else { 2.0 * (rest * rest - slope / z) }
}
// --- END

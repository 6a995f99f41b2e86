//! The numbers of the elementary functions, for each precision.
//!
//! Polynomials and constants in parts are what `tools/minimax.py` prints: minimax approximations by Remez's exchange
//! in 60 digits, rounded to the precision, with an error of at most 2^−56.4 of the function in f64 and 2^−28 in f32.

#![allow(clippy::unreadable_literal, clippy::excessive_precision, clippy::struct_field_names)]

use super::exp::anywhere;
use super::polynomial::Polynomial;

/// What [`super::exp`] needs.
pub struct Exp<F: 'static> {
    /// From here on the result is infinite.
    pub highest: F,
    /// From here on the result is zero.
    pub lowest: F,
    pub per_ln_2: F,
    /// Below this magnitude 2ⁿ is a normal number and so is the result.
    pub near: F,
    /// 1.5 times the number from which on all are integers.
    pub shift: F,
    /// The same plus twice the exponent's bias.
    pub biased_shift: F,
    pub ln_2: [F; 2],
    /// (eʳ − 1 − r)/r².
    pub tail: Polynomial<F>,
}

/// What [`super::ln`] needs.
pub struct Ln<F> {
    /// A power of two that makes subnormal numbers normal.
    pub lift: F,
    pub lift_exponent: F,
    /// √½, rounded.
    pub root_half: F,
    /// The difference of the bits of 1 and of √½.
    pub one_minus_root_half: F,
    /// The bits of the mantissa.
    pub mantissa: F,
    /// The power of two that is the first of the numbers that are all integers.
    pub integers: F,
    /// The same plus the exponent's bias.
    pub biased_integers: F,
    pub ln_2: [F; 2],
}

/// What [`super::atanh`] needs, and [`super::ln`] too.
pub struct Atanh<F: 'static> {
    pub half_ln_2: [F; 2],
    /// (atanh(s)/s − 1)/s² as a polynomial in s².
    pub tail: Polynomial<F>,
}

/// What [`super::sin`] and [`super::cos`] need.
pub struct Trig<F: 'static> {
    /// Up to here π/2 in parts is good.
    pub bound: F,
    /// r less than this times n has lost more digits than π/2 in parts has to spare.
    pub cancelled: F,
    pub two_per_pi: F,
    /// 1.5 times the number from which on all are integers.
    pub shift: F,
    /// The first part of π/2.
    pub half_pi: F,
    /// The others.
    pub half_pi_rest: &'static [F],
    /// (sin r − r)/r³ as a polynomial in r².
    pub sin: Polynomial<F>,
    /// (cos r − 1 + r²/2)/r⁴ as a polynomial in r².
    pub cos: Polynomial<F>,
}

/// The numbers of one precision.
pub trait Constants: Copy + Default + 'static {
    const ZERO: Self;
    const HALF: Self;
    const ONE: Self;
    const TWO: Self;
    const INFINITY: Self;
    const NAN: Self;
    const MIN_POSITIVE: Self;
    /// The sign's bit.
    const SIGN: Self;
    /// All bits but the sign's.
    const ALL_BUT_SIGN: Self;
    const EXP: Exp<Self>;
    const LN: Ln<Self>;
    const ATANH: Atanh<Self>;
    const TRIG: Trig<Self>;

    /// eˣ however large x is.
    fn exp_anywhere(self) -> Self;
    /// `libm`'s sine.
    fn sin_exactly_reduced(self) -> Self;
    /// `libm`'s cosine.
    fn cos_exactly_reduced(self) -> Self;
}

macro_rules! common {
    ($float:ident, $sin:ident, $cos:ident) => {
        const ZERO: Self = 0.0;
        const HALF: Self = 0.5;
        const ONE: Self = 1.0;
        const TWO: Self = 2.0;
        const INFINITY: Self = $float::INFINITY;
        const NAN: Self = $float::NAN;
        const MIN_POSITIVE: Self = $float::MIN_POSITIVE;
        const SIGN: Self = -0.0;
        const ALL_BUT_SIGN: Self = $float::from_bits(!Self::SIGN.to_bits());

        #[cold]
        #[inline(never)]
        fn exp_anywhere(self) -> Self {
            anywhere(self)
        }
        fn sin_exactly_reduced(self) -> Self {
            libm::$sin(self)
        }
        fn cos_exactly_reduced(self) -> Self {
            libm::$cos(self)
        }
    };
}

impl Constants for f64 {
    common!(f64, sin, cos);

    const EXP: Exp<Self> = Exp {
        highest: 710.0,
        lowest: -746.0,
        per_ln_2: core::f64::consts::LOG2_E,
        near: 512.0,
        shift: 6755399441055744.0,
        biased_shift: 6755399441055744.0 + 2046.0,
        ln_2: [0.6931471805598903, 5.497923018708371e-14],
        tail: Polynomial {
            even: &[
                0.5000000000000011,
                0.04166666666653001,
                0.0013888888943675705,
                2.480149304630282e-05,
                2.7630268840925584e-07,
            ],
            odd: &[
                0.16666666666666413,
                0.00833333333349465,
                0.00019841269506275727,
                2.75575865434609e-06,
                2.5000041259882955e-08,
            ],
        },
    };
    const LN: Ln<Self> = Ln {
        lift: 18014398509481984.0, // 2⁵⁴
        lift_exponent: 54.0,
        root_half: core::f64::consts::FRAC_1_SQRT_2,
        one_minus_root_half: Self::from_bits(1.0_f64.to_bits() - core::f64::consts::FRAC_1_SQRT_2.to_bits()),
        mantissa: Self::from_bits((1 << 52) - 1),
        integers: 4503599627370496.0, // 2⁵²
        biased_integers: 4503599627370496.0 + 1023.0,
        ln_2: [0.6931471805598903, 5.497923018708371e-14],
    };
    const ATANH: Atanh<Self> = Atanh {
        half_ln_2: [0.34657359027994517, 2.7489615093541856e-14],
        tail: Polynomial {
            even: &[
                0.3333333333333337,
                0.1428571428806902,
                0.09090917158964398,
                0.06670773821980688,
                0.05649770520670926,
                0.09190950639440094,
            ],
            odd: &[
                0.19999999999984747,
                0.11111110930092119,
                0.07692082269149489,
                0.05832953527993811,
                0.028947246432668314,
            ],
        },
    };
    const TRIG: Trig<Self> = Trig {
        bound: 1647099.0,                 // 2²⁰·π/2
        cancelled: 5.421010862427522e-20, // 2⁻⁶⁴
        two_per_pi: core::f64::consts::FRAC_2_PI,
        shift: 6755399441055744.0,
        half_pi: 1.5707963267341256,
        half_pi_rest: &[6.077100506303966e-11, 2.0222662487959506e-21],
        sin: Polynomial {
            even: &[-0.1666666666666663, -0.00019841269829566803, -2.5050746437853246e-08],
            odd: &[0.008333333333322092, 2.7557313613200682e-06, 1.589615098094598e-10],
        },
        cos: Polynomial {
            even: &[0.041666666666666595, 2.480158728882648e-05, 2.0875699800733945e-09],
            odd: &[-0.0013888888888873017, -2.7557314171819446e-07, -1.135848136555656e-11],
        },
    };
}

impl Constants for f32 {
    common!(f32, sinf, cosf);

    const EXP: Exp<Self> = Exp {
        highest: 89.0,
        lowest: -104.0,
        per_ln_2: core::f32::consts::LOG2_E,
        near: 64.0,
        shift: 12582912.0,
        biased_shift: 12582912.0 + 254.0,
        ln_2: [0.693145752, 1.42860677e-06],
        tail: Polynomial {
            even: &[0.49999994, 0.041668389, 0.00138145813],
            odd: &[0.166665211, 0.00836872775],
        },
    };
    const LN: Ln<Self> = Ln {
        lift: 33554432.0, // 2²⁵
        lift_exponent: 25.0,
        root_half: core::f32::consts::FRAC_1_SQRT_2,
        one_minus_root_half: Self::from_bits(1.0_f32.to_bits() - core::f32::consts::FRAC_1_SQRT_2.to_bits()),
        mantissa: Self::from_bits((1 << 23) - 1),
        integers: 8388608.0, // 2²³
        biased_integers: 8388608.0 + 127.0,
        ln_2: [0.693145752, 1.42860677e-06],
    };
    const ATANH: Atanh<Self> = Atanh {
        half_ln_2: [0.346572876, 7.14303383e-07],
        tail: Polynomial { even: &[0.333333433, 0.14323169, 0.127695426], odd: &[0.199989229, 0.105503477] },
    };
    const TRIG: Trig<Self> = Trig {
        bound: 6433.0,            // 2¹²·π/2
        cancelled: 5.8207661e-11, // 2⁻³⁴
        two_per_pi: core::f32::consts::FRAC_2_PI,
        shift: 12582912.0,
        half_pi: 1.5703125,
        half_pi_rest: &[0.000483751297, 7.54953362e-08, 2.56334407e-12],
        sin: Polynomial { even: &[-0.166666672, -0.0001983931], odd: &[0.00833332911, 2.71810336e-06] },
        cos: Polynomial { even: &[0.0416666456, 2.44329749e-05], odd: &[-0.00138873141] },
    };
}

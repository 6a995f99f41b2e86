//! Elementary functions of one `f64` for what is computed once, such as an evaluation.

use crate::Scalar;

/// Elementary functions whose results are the same to the last bit on every platform.
///
/// The methods of `f64` in `std` are those of the platform's library and differ between machines in the last digit. Whatever
/// enters a file of results takes these. Sine, cosine, exponential and logarithm are those of [`Scalar`], the others those of
/// `libm`. They are not inlined: in a loop over samples take [`Scalar`].
///
/// ```
/// use kalmems_core::Portable;
/// assert_eq!(1000_f64.portable_log10(), 3.0);
/// assert_eq!(3_f64.portable_hypot(4.0), 5.0);
/// assert!((1_f64.portable_atan2(1.0) - std::f64::consts::FRAC_PI_4).abs() < 1e-16);
/// ```
pub trait Portable: Copy {
    /// The sine of an angle in rad.
    #[must_use]
    fn portable_sin(self) -> Self;

    /// The cosine of an angle in rad.
    #[must_use]
    fn portable_cos(self) -> Self;

    /// The tangent of an angle in rad.
    #[must_use]
    fn portable_tan(self) -> Self;

    /// The angle in rad between −π/2 and π/2 that has this sine.
    #[must_use]
    fn portable_asin(self) -> Self;

    /// The angle in rad between 0 and π that has this cosine.
    #[must_use]
    fn portable_acos(self) -> Self;

    /// The angle in rad between −π/2 and π/2 that has this tangent.
    #[must_use]
    fn portable_atan(self) -> Self;

    /// eˣ.
    #[must_use]
    fn portable_exp(self) -> Self;

    /// eˣ − 1, accurate near 0.
    #[must_use]
    fn portable_exp_m1(self) -> Self;

    /// The natural logarithm.
    #[must_use]
    fn portable_ln(self) -> Self;

    /// ln(1 + x), accurate near 0.
    #[must_use]
    fn portable_ln_1p(self) -> Self;

    /// The logarithm to the base 10, exact at its powers.
    #[must_use]
    fn portable_log10(self) -> Self;

    /// The logarithm to the base 2, exact at its powers.
    #[must_use]
    fn portable_log2(self) -> Self;

    /// The hyperbolic sine.
    #[must_use]
    fn portable_sinh(self) -> Self;

    /// The hyperbolic cosine.
    #[must_use]
    fn portable_cosh(self) -> Self;

    /// The hyperbolic tangent.
    #[must_use]
    fn portable_tanh(self) -> Self;

    /// The number that has this hyperbolic sine.
    #[must_use]
    fn portable_asinh(self) -> Self;

    /// The cube root.
    #[must_use]
    fn portable_cbrt(self) -> Self;

    /// xʸ.
    #[must_use]
    fn portable_powf(self, exponent: Self) -> Self;

    /// √(x² + y²) without an overflow on the way.
    #[must_use]
    fn portable_hypot(self, other: Self) -> Self;

    /// The angle in rad between −π and π of the point (x, y), of which this number is y.
    #[must_use]
    fn portable_atan2(self, x: Self) -> Self;

    /// Sine and cosine of an angle in rad.
    #[must_use]
    fn portable_sin_cos(self) -> (Self, Self) {
        (self.portable_sin(), self.portable_cos())
    }
}

impl Portable for f64 {
    #[inline(never)]
    fn portable_sin(self) -> Self {
        Scalar::sin(self)
    }

    #[inline(never)]
    fn portable_cos(self) -> Self {
        Scalar::cos(self)
    }

    #[inline(never)]
    fn portable_tan(self) -> Self {
        libm::tan(self)
    }

    #[inline(never)]
    fn portable_asin(self) -> Self {
        libm::asin(self)
    }

    #[inline(never)]
    fn portable_acos(self) -> Self {
        libm::acos(self)
    }

    #[inline(never)]
    fn portable_atan(self) -> Self {
        libm::atan(self)
    }

    #[inline(never)]
    fn portable_exp(self) -> Self {
        Scalar::exp(self)
    }

    #[inline(never)]
    fn portable_exp_m1(self) -> Self {
        libm::expm1(self)
    }

    #[inline(never)]
    fn portable_ln(self) -> Self {
        Scalar::ln(self)
    }

    #[inline(never)]
    fn portable_ln_1p(self) -> Self {
        libm::log1p(self)
    }

    #[inline(never)]
    fn portable_log10(self) -> Self {
        libm::log10(self)
    }

    #[inline(never)]
    fn portable_log2(self) -> Self {
        libm::log2(self)
    }

    #[inline(never)]
    fn portable_sinh(self) -> Self {
        libm::sinh(self)
    }

    #[inline(never)]
    fn portable_cosh(self) -> Self {
        libm::cosh(self)
    }

    #[inline(never)]
    fn portable_tanh(self) -> Self {
        libm::tanh(self)
    }

    #[inline(never)]
    fn portable_asinh(self) -> Self {
        libm::asinh(self)
    }

    #[inline(never)]
    fn portable_cbrt(self) -> Self {
        libm::cbrt(self)
    }

    #[inline(never)]
    fn portable_powf(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }

    #[inline(never)]
    fn portable_hypot(self, other: Self) -> Self {
        libm::hypot(self, other)
    }

    #[inline(never)]
    fn portable_atan2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
}

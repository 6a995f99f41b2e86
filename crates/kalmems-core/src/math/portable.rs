//! Elementary functions of one `f64` for what is computed once, such as an evaluation.

use crate::Scalar;

/// The trait and what each function is of an `f64`, from a list of them.
macro_rules! portable {
    ($($(#[$doc:meta])* $method:ident($($other:ident),*) = $function:path;)*) => {
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
            $(
                $(#[$doc])*
                #[must_use]
                fn $method(self $(, $other: Self)*) -> Self;
            )*

            /// Sine and cosine of an angle in rad.
            #[must_use]
            fn portable_sin_cos(self) -> (Self, Self) {
                (self.portable_sin(), self.portable_cos())
            }
        }

        impl Portable for f64 {
            $(
                #[inline(never)]
                fn $method(self $(, $other: Self)*) -> Self {
                    $function(self $(, $other)*)
                }
            )*
        }
    };
}

portable! {
    /// The sine of an angle in rad.
    portable_sin() = Scalar::sin;
    /// The cosine of an angle in rad.
    portable_cos() = Scalar::cos;
    /// The tangent of an angle in rad.
    portable_tan() = libm::tan;
    /// The angle in rad between −π/2 and π/2 that has this sine.
    portable_asin() = libm::asin;
    /// The angle in rad between 0 and π that has this cosine.
    portable_acos() = libm::acos;
    /// The angle in rad between −π/2 and π/2 that has this tangent.
    portable_atan() = libm::atan;
    /// eˣ.
    portable_exp() = Scalar::exp;
    /// eˣ − 1, accurate near 0.
    portable_exp_m1() = libm::expm1;
    /// The natural logarithm.
    portable_ln() = Scalar::ln;
    /// ln(1 + x), accurate near 0.
    portable_ln_1p() = libm::log1p;
    /// The logarithm to the base 10, exact at its powers.
    portable_log10() = libm::log10;
    /// The logarithm to the base 2, exact at its powers.
    portable_log2() = libm::log2;
    /// The hyperbolic sine.
    portable_sinh() = libm::sinh;
    /// The hyperbolic cosine.
    portable_cosh() = libm::cosh;
    /// The hyperbolic tangent.
    portable_tanh() = libm::tanh;
    /// The number that has this hyperbolic sine.
    portable_asinh() = libm::asinh;
    /// The complementary error function, 2/√π·∫e^(−t²)dt from this number on, accurate where it is small.
    portable_erfc() = libm::erfc;
    /// The cube root.
    portable_cbrt() = libm::cbrt;
    /// xʸ.
    portable_powf(exponent) = libm::pow;
    /// √(x² + y²) without an overflow on the way.
    portable_hypot(other) = libm::hypot;
    /// The angle in rad between −π and π of the point (x, y), of which this number is y.
    portable_atan2(x) = libm::atan2;
}

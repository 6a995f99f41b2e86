//! Complex numbers, for responses at one frequency.

use core::ops::{Add, Div, Mul};
use kalmems_core::Scalar;

/// re + j·im.
///
/// ```
/// use kalmems_models::control::Complex;
/// let z = Complex { re: 3.0_f64, im: 4.0 };
/// assert_eq!(z.size(), 5.0);
/// assert_eq!(z / z, Complex { re: 1.0, im: 0.0 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Complex<P> {
    /// The real part.
    pub re: P,
    /// The imaginary part.
    pub im: P,
}

impl<P: Scalar> Complex<P> {
    /// A real number.
    pub fn real(re: P) -> Self {
        Self { re, im: P::of(0.0) }
    }

    /// e^{jφ}, φ in rad.
    pub fn turned(angle: P) -> Self {
        Self { re: angle.cos(), im: angle.sin() }
    }

    /// |z|.
    pub fn size(self) -> P {
        (self.re.sq() + self.im.sq()).sqrt()
    }
}

impl<P: Scalar> Add for Complex<P> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl<P: Scalar> Mul for Complex<P> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl<P: Scalar> Div for Complex<P> {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let square = other.re.sq() + other.im.sq();
        Self {
            re: (self.re * other.re + self.im * other.im) / square,
            im: (self.im * other.re - self.re * other.im) / square,
        }
    }
}

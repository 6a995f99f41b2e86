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

impl<P: Scalar> Complex<P> {
    /// The angle in rad, from −π to π; 0 of 0.
    ///
    /// ```
    /// use kalmems_models::control::Complex;
    /// let z = Complex { re: -1.0_f64, im: 1.0 };
    /// assert!((z.angle() - 0.75 * core::f64::consts::PI).abs() < 1e-15);
    /// ```
    pub fn angle(self) -> P {
        let zero = P::of(0.0);
        if !self.size().gt(zero) {
            return zero;
        }
        let above = self.im.gt(zero);
        if above { -Self { re: self.re, im: -self.im }.angle_below() } else { self.angle_below() }
    }

    /// The angle in rad of what lies in the lower half of the plane, from −π to 0.
    pub(super) fn angle_below(self) -> P {
        let (zero, one) = (P::of(0.0), P::of(1.0));
        // The tangent t of half the angle, below 0 as the angle is, by whichever form loses no digits.
        let size = self.size();
        let mut tangent =
            if self.re.lt(zero) { (size - self.re) / -self.im } else { -self.im / (size + self.re) };
        let half_turn = P::of(core::f64::consts::PI);
        if !tangent.is_finite() {
            return -half_turn;
        }
        let beyond = tangent.gt(one);
        if beyond {
            tangent = tangent.recip();
        }
        // φ = −2·atan(−t), by halving until its series is short.
        let mut factor = one;
        for _ in 0..4 {
            tangent = tangent / (one + (one + tangent.sq()).sqrt());
            factor = factor.twice();
        }
        // |t| is below 0.05: t^13/13 is below the last digit.
        let square = tangent.sq();
        let mut series = zero;
        for k in (0..7).rev() {
            let term = P::of(1.0 / f64::from(2 * k + 1));
            series = term - square * series;
        }
        let half = series * tangent * factor;
        let half = if beyond { half_turn.half() - half } else { half };
        -half.twice()
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

//! One or two poles of a filter.

use kalmems_core::{Mat, Scalar};
use kalmems_macros::model;

/// ẋ = A·x + B·u, y = C·x + D·u with at most two states: what filters are put together from.
///
/// The states are those of the low-pass and the band-pass that belong to the poles, so that all of them are of the
/// size of the input and A of the size of the corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section<P> {
    a: Mat<P, 2, 2>,
    b: [P; 2],
    c: [P; 2],
    d: P,
}

#[model]
impl<P: Scalar> Section<P> {
    /// p/(s + p) for a pole p in rad/s.
    ///
    /// ```
    /// use kalmems_models::circuit::Section;
    /// let (re, im) = Section::low_pass(2.0_f64).response(2.0);
    /// assert!((re - 0.5).abs() < 1e-15 && (im + 0.5).abs() < 1e-15);
    /// ```
    pub fn low_pass(pole: P) -> Self {
        let (zero, one) = (P::of(0.0), P::of(1.0));
        Self { a: Mat([[-pole, zero], [zero, -pole]]), b: [pole, zero], c: [one, zero], d: zero }
    }

    /// s/(s + p) for a pole p in rad/s.
    pub fn high_pass(pole: P) -> Self {
        let low = Self::low_pass(pole);
        Self { c: [-low.c[0], low.c[1]], d: P::of(1.0), ..low }
    }

    /// s²/(s² + s·ω/Q + ω²) for a corner ω in rad/s and a quality factor Q.
    pub fn high_pass_pair(corner: P, quality: P) -> Self {
        let (zero, per_quality) = (P::of(0.0), quality.recip());
        Self {
            a: Mat([[zero, corner], [-corner, -(corner * per_quality)]]),
            b: [zero, corner],
            c: [-P::of(1.0), -per_quality],
            d: P::of(1.0),
        }
    }

    /// The real and imaginary part of y/u at a rate ω in rad/s: C·(jω − A)⁻¹·B + D.
    pub fn response(&self, rate: P) -> (P, P) {
        let Mat([[a, b], [c, d]]) = self.a;
        let [u, v] = self.b;
        // The adjoint of jω − A times B, and its determinant, as real and imaginary parts.
        let real = self.c[0] * (b * v - d * u) + self.c[1] * (c * u - a * v);
        let imaginary = rate * (self.c[0] * u + self.c[1] * v);
        let (re, im) = (a * d - b * c - rate.sq(), -(rate * (a + d)));
        let scale = (re.sq() + im.sq()).recip();
        ((real * re + imaginary * im) * scale + self.d, (imaginary * re - real * im) * scale)
    }

    /// A, B, C and D.
    pub fn state_space(&self) -> (&Mat<P, 2, 2>, &[P; 2], &[P; 2], P) {
        (&self.a, &self.b, &self.c, self.d)
    }
}

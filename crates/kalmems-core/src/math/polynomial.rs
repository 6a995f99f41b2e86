//! Polynomials.

use super::Register;

/// c₀ + c₁·x + c₂·x² + …, the coefficients of even and of odd powers apart.
///
/// Two chains of half the length, which a processor runs beside each other.
pub struct Polynomial<F: 'static> {
    /// c₀, c₂, c₄, …
    pub even: &'static [F],
    /// c₁, c₃, c₅, …
    pub odd: &'static [F],
}

impl<F: Register> Polynomial<F> {
    /// The value at `x`, whose square is given too.
    #[inline(always)]
    pub fn at(&self, x: F, square: F) -> F {
        horner(self.even, square).mac(horner(self.odd, square), x)
    }
}

/// Horner's scheme.
#[inline(always)]
fn horner<R: Register>(coefficients: &[R], x: R) -> R {
    let mut highest_first = coefficients.iter().rev();
    let mut value = highest_first.next().copied().unwrap_or_default();
    for c in highest_first {
        value = c.mac(value, x);
    }
    value
}

//! Two disks with their fringing field, as a series.

use kalmems_core::Scalar;
use kalmems_models::capacitance::{CoaxialDisks, VACUUM_PERMITTIVITY};
use std::sync::OnceLock;

/// Terms of the series.
const TERMS: usize = 64;
/// The nearest and the farthest distance in radii.
pub(crate) const RANGE: [f64; 2] = [0.13, 40.0];

/// C of two coaxial disks without thickness, `distance` apart, both lengths in m.
///
/// C/(ε₀·a) depends on κ = d/a alone. Love's integral equation is solved once at Chebyshev's points of ln κ, and the
/// logarithm of C/(ε₀·a) is Chebyshev's series through them: within 1e-11 of the solution from 0.13 to 40 radii, as the test
/// below measures. Not a number elsewhere.
pub(crate) fn capacitance<S: Scalar>(distance: S, radius: S) -> S {
    let [low, high] = RANGE.map(f64::ln_of);
    let place = (distance / radius).ln();
    let x = (place + place - S::of(low + high)) * S::of(1.0 / (high - low));
    let (mut b1, mut b2) = (S::of(0.0), S::of(0.0));
    let [first, rest @ ..] = coefficients();
    for c in rest.iter().rev() {
        (b1, b2) = (x.twice() * b1 - b2 + S::of(*c), b1);
    }
    let logarithm = x * b1 - b2 + S::of(*first);
    let inside = x.abs().lt(S::of(1.0 + 1e-12));
    S::select(inside, logarithm.exp() * radius * S::of(VACUUM_PERMITTIVITY), S::of(f64::NAN))
}

trait Logarithm {
    fn ln_of(self) -> f64;
}

impl Logarithm for f64 {
    fn ln_of(self) -> f64 {
        Scalar::ln(self)
    }
}

/// Chebyshev's coefficients of ln(C/(ε₀·a)) over ln κ between the ends of [`RANGE`].
pub(crate) fn coefficients() -> &'static [f64; TERMS] {
    static COEFFICIENTS: OnceLock<[f64; TERMS]> = OnceLock::new();
    COEFFICIENTS.get_or_init(|| {
        let [low, high] = RANGE.map(f64::ln_of);
        let angle = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / TERMS as f64;
        let mut values = [0.0; TERMS];
        for (k, value) in values.iter_mut().enumerate() {
            let place = 0.5 * (low + high) + 0.5 * (high - low) * Scalar::cos(angle(k));
            let solved = CoaxialDisks { radius: 1.0 }.capacitance(Scalar::exp(place));
            *value = solved.map_or(f64::NAN, |c| f64::ln_of(c / VACUUM_PERMITTIVITY));
        }
        let mut series = [0.0; TERMS];
        for (j, term) in series.iter_mut().enumerate() {
            let sum: f64 = values.iter().enumerate().map(|(k, v)| v * Scalar::cos(j as f64 * angle(k))).sum();
            *term = sum * if j == 0 { 1.0 } else { 2.0 } / TERMS as f64;
        }
        series
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_the_solution_of_loves_equation() {
        let mut worst: f64 = 0.0;
        for k in 0..200 {
            let kappa = 0.131 * 1.029_f64.powi(k);
            if kappa > 39.9 {
                break;
            }
            let exact = CoaxialDisks { radius: 1.9e-3 }.capacitance(kappa * 1.9e-3).unwrap();
            worst = worst.max((capacitance(kappa * 1.9e-3, 1.9e-3) / exact - 1.0).abs());
        }
        assert!(worst < 1e-11, "{worst:e}");
        assert!(capacitance(0.12_f64, 1.0).is_nan() && capacitance(41.0_f64, 1.0).is_nan());
    }
}

//! Vertical comb fingers, tilting far out of their plane.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// C(θ) = C₀·exp(−(θ/θ₀)²) + C_b.
///
/// The capacitance of comb fingers that leave each other as the mirror tilts: symmetric, bounded, with a tail
/// (Chen et al., shared electrodes, 2020, equation 13).
///
/// ```
/// use kalmems_models::capacitance::GaussianComb;
/// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
/// assert!((comb.capacitance(0.0_f64) / 15.5e-12 - 1.0).abs() < 1e-15);
/// assert_eq!(comb.slope(0.0), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct GaussianComb<P> {
    /// C₀ in F: what the fingers add at rest.
    pub nominal: P,
    /// θ₀ in rad: where that has fallen to 1/e. Positive.
    pub angular_width: P,
    /// C_b in F: what does not move.
    pub bias: P,
}

#[model]
impl<P: Scalar> GaussianComb<P> {
    /// C(θ) in F, θ in rad.
    pub fn capacitance<S: Over<P>>(&self, angle: S) -> S {
        self.overlap(angle) * self.nominal + self.bias
    }

    /// dC/dθ = C″(0)·θ·exp(−(θ/θ₀)²) in F/rad.
    pub fn slope<S: Over<P>>(&self, angle: S) -> S {
        angle * (self.overlap(angle) * self.curvature_at_rest())
    }

    /// C″(0) = −2·C₀/θ₀² in F/rad².
    pub fn curvature_at_rest(&self) -> P {
        -(self.nominal.twice() * self.angular_width.sq().recip())
    }

    /// d²C/dθ² = (4·θ²/θ₀² − 2)/θ₀²·C₀·exp(−(θ/θ₀)²) in F/rad².
    pub fn curvature<S: Over<P>>(&self, angle: S) -> S {
        let per_width = self.angular_width.sq().recip();
        let bracket = angle.sq() * (per_width * P::of(4.0)) - P::of(2.0);
        bracket * self.overlap(angle) * (self.nominal * per_width)
    }

    /// exp(−(θ/θ₀)²): what is left of the fingers' share at rest.
    pub fn overlap<S: Over<P>>(&self, angle: S) -> S {
        (angle.sq() * -self.angular_width.sq().recip()).exp()
    }
}

//! Comb fingers that turn past each other.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// ε₀ in F/m.
const VACUUM: f64 = 8.854_187_812_8e-12;

/// C(θ) = ε₀·ε_r·n·A(θ)/D of fingers in the plane of a mirror that tilts about an axis at their side (Chen,
/// dissertation, 2018, equation 63), with A from the fingers' geometry.
///
/// At the distance r from the axis a finger has moved by r·tan|θ| against the one beside it, and as much of its height
/// t is no longer opposite: A = ∫ max(0, t − r·tan|θ|) dr from r₁ to r₂. Fringing fields and the turn of the fingers'
/// ends, of the order of θ², are left out. The slope jumps at θ = 0; fringing rounds the jump to a
/// [`CombCurve`](super::CombCurve), whose N_g is [`gain`](CombFingers::gain).
///
/// ```
/// use kalmems_models::capacitance::CombFingers;
/// let fingers = CombFingers { pairs: 100.0, gap: 5e-6, height: 30e-6, inner: 300e-6, outer: 450e-6, permittivity: 1.0 };
/// // At rest they are opposite each other over their whole area.
/// let at_rest: f64 = fingers.capacitance(0.0);
/// assert!((at_rest - 8.8542e-12 * 100.0 * 150e-6 * 30e-6 / 5e-6).abs() < 1e-17);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct CombFingers<P> {
    /// n: the pairs of facing sides.
    pub pairs: P,
    /// D in m: the distance between facing sides.
    pub gap: P,
    /// t in m: the height of the fingers, normal to the mirror.
    pub height: P,
    /// r₁ in m: where the overlap begins, from the axis.
    pub inner: P,
    /// r₂ in m: where it ends.
    pub outer: P,
    /// ε_r; 1 in air.
    pub permittivity: P,
}

#[model]
impl<P: Scalar> CombFingers<P> {
    /// C(θ) in F, θ in rad below a right angle.
    pub fn capacitance<S: Over<P>>(&self, angle: S) -> S {
        let tangent = (angle.sin() / angle.cos()).abs();
        let reach = self.reach(tangent);
        let mean_height = -(tangent * (reach + self.inner).half() - self.height);
        (reach - self.inner) * mean_height * self.per_area()
    }

    /// dC/dθ = −sign(θ)·ε₀·ε_r·n/D·(1 + tan²θ)·(r² − r₁²)/2 in F/rad, with r up to where fingers are opposite; 0 at
    /// θ = 0, in the middle of the jump.
    pub fn slope<S: Over<P>>(&self, angle: S) -> S {
        let zero = S::lift(P::of(0.0));
        let tangent = angle.sin() / angle.cos();
        let reach = self.reach(tangent.abs());
        let moved = (reach.sq() - self.inner.sq()).half() * (tangent.sq() + P::of(1.0)) * self.per_area();
        S::select(angle.lt(zero), moved, S::select(zero.lt(angle), -moved, zero))
    }

    /// N_g = R_s·V_bias·ε₀·ε_r·n·(r₂² − r₁²)/D in V·s/rad: by how much −R_s·V_bias·dC/dθ jumps at θ = 0, with
    /// R_s·V_bias in Ω·V.
    pub fn gain(&self, transimpedance: P) -> P {
        (self.outer.sq() - self.inner.sq()) * self.per_area() * transimpedance
    }

    /// Up to which distance from the axis fingers are opposite: t/tan|θ|, between r₁ and r₂.
    fn reach<S: Over<P>>(&self, tangent: S) -> S {
        let (inner, outer, height) = (S::lift(self.inner), S::lift(self.outer), S::lift(self.height));
        let beyond = height.lt(tangent * self.outer);
        // Where they are opposite up to r₂ the quotient is not used, and may be infinite.
        let end = S::select(beyond, height / S::select(beyond, tangent, S::lift(P::of(1.0))), outer);
        S::select(end.lt(inner), inner, end)
    }

    /// ε₀·ε_r·n/D in F/m².
    fn per_area(&self) -> P {
        self.permittivity * self.pairs * P::of(VACUUM) / self.gap
    }
}

//! A mass on springs, in a gas.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// m·ẍ + b(x)·ẋ + k·x = F (Zhang 2010, equation 2-1, with x = y − z).
///
/// Of the damping a share s comes from the film of gas that is squeezed out of two gaps, which grows as the mass nears
/// a plate: b(x) = b₀·(1 − s + s·½·[(1 − x/d₀)⁻³ + (1 + x/d₀)⁻³]). The thesis's equation 2-14 has a minus between
/// the two, which would leave no damping at rest. s = 0 is the linear law, s = 1 the film alone. b₀ is measured: its
/// equation 2-13 with d₀³, as the units want it, gives 3.3 N·s/m where its Table I has 7·10⁻⁴.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct ProofMass<P> {
    /// m in kg. Positive.
    pub mass: P,
    /// b₀ in N·s/m: the damping at rest.
    pub damping: P,
    /// s, from 0 to 1: the share of it that is squeezed gas.
    pub squeezed: P,
    /// k in N/m.
    pub spring: P,
}

#[model]
impl<P: Scalar> ProofMass<P> {
    /// b in N·s/m, with x over the gap as `share`.
    pub fn damping_at<S: Over<P>>(&self, share: S) -> S {
        let (near, far) = (-(share - P::of(1.0)), share + P::of(1.0));
        let film = ((near.sq() * near).recip() + (far.sq() * far).recip()).half();
        ((film - P::of(1.0)) * self.squeezed + P::of(1.0)) * self.damping
    }

    /// ẍ in m/s², with x in m, x over the gap, ẋ in m/s and F in N.
    pub fn acceleration<S: Over<P>>(&self, x: S, share: S, velocity: S, force: S) -> S {
        (force - self.damping_at(share) * velocity - x * self.spring) * self.mass.recip()
    }

    /// The density of the Brownian acceleration that a force of this density makes: S_F/m², in the unit of S_F per kg².
    pub fn acceleration_density(&self, force_density: P) -> P {
        force_density * self.mass.sq().recip()
    }

    /// ω_n = √(k/m) in rad/s (equation 2-3), of this spring in N/m: with or without what a voltage takes from it.
    pub fn natural_rate(&self, spring: P) -> P {
        (spring / self.mass).sqrt()
    }

    /// ζ = b₀/(2·√(k·m)) (equation 2-3): above 1 nothing swings.
    pub fn damping_ratio(&self, spring: P) -> P {
        self.damping / (spring * self.mass).sqrt().twice()
    }
}

impl<P: Scalar> ProofMass<P> {
    /// The eigenvalues of the motion about rest on this spring in N/m, as real and imaginary parts in rad/s, the
    /// slower one first.
    ///
    /// Without loss of digits where the two are far apart. A spring below 0 gives one eigenvalue above 0.
    ///
    /// ```
    /// use kalmems_models::dynamics::ProofMass;
    /// let mass = ProofMass { mass: 1.0_f64, damping: 3.0, squeezed: 0.0, spring: 2.0 };
    /// assert_eq!(mass.eigenvalues(2.0), [(-1.0, 0.0), (-2.0, 0.0)]);
    /// assert_eq!(ProofMass { damping: 0.0, ..mass }.eigenvalues(4.0), [(0.0, 2.0), (0.0, -2.0)]);
    /// ```
    pub fn eigenvalues(&self, spring: P) -> [(P, P); 2] {
        let zero = P::of(0.0);
        let (half, square) = ((self.damping / self.mass).half(), spring / self.mass);
        let root = half.sq() - square;
        if root.lt(zero) {
            let swing = (-root).sqrt();
            return [(zero - half, swing), (zero - half, -swing)];
        }
        let fast = -(half + root.sqrt());
        // Their product is k/m.
        let slow = if fast.lt(zero) { square / fast } else { zero };
        [(slow, zero), (fast, zero)]
    }
}

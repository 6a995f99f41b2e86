//! A mass on a torsion spring.

use kalmems_core::{LinearProcess, Mat, NoiseDensity, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// J·θ̈ + b·θ̇ + k·θ = T (Chen et al., shared electrodes, 2020, equation 9).
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct TorsionalResonator<P> {
    /// J in kg·m². Positive.
    pub inertia: P,
    /// b in N·m·s (per rad).
    pub damping: P,
    /// k in N·m (per rad).
    pub stiffness: P,
}

#[model]
impl<P: Scalar> TorsionalResonator<P> {
    /// θ̈ = (T − b·θ̇ − k·θ)/J in rad/s², with θ in rad, θ̇ in rad/s and T in N·m.
    pub fn acceleration<S: Over<P>>(&self, angle: S, rate: S, torque: S) -> S {
        torque * self.inertia.recip() - angle * self.square_rate() - self.braking(rate)
    }

    /// b·θ̇/J in rad/s²: what the damping takes from θ̈.
    pub fn braking<S: Over<P>>(&self, rate: S) -> S {
        rate * self.decay_rate()
    }

    /// b/J in 1/s: what the damping takes from θ̈ per rate.
    pub fn decay_rate(&self) -> P {
        self.damping * self.inertia.recip()
    }

    /// ω₀ = √(k/J) in rad/s.
    pub fn natural_rate(&self) -> P {
        (self.stiffness / self.inertia).sqrt()
    }

    /// ω₀² = k/J in rad²/s².
    pub fn square_rate(&self) -> P {
        self.stiffness * self.inertia.recip()
    }

    /// ½·J·θ̇² + ½·k·θ² in J.
    pub fn energy(&self, angle: P, rate: P) -> P {
        (self.inertia * rate.sq() + self.stiffness * angle.sq()).half()
    }

    /// A of ẋ = A·x + B·T for x = [θ, θ̇].
    pub fn system_matrix(&self) -> Mat<P, 2, 2> {
        let per_inertia = self.inertia.recip();
        Mat([[P::of(0.0), P::of(1.0)], [-(self.stiffness * per_inertia), -(self.damping * per_inertia)]])
    }
}

impl<P: Scalar> TorsionalResonator<P> {
    /// The exact step over one interval, driven by a torque held over it and by white angular acceleration of
    /// this density in rad²/s³.
    ///
    /// For a torque that was sampled, give the mean of both ends.
    pub fn exact(&self, interval: P, acceleration_density: P) -> LinearProcess<P, 2, 1> {
        let input = Mat([[P::of(0.0)], [self.inertia.recip()]]);
        let noise = NoiseDensity::none().on::<1>(acceleration_density);
        LinearProcess::exact(&self.system_matrix(), &input, &noise, interval)
    }
}

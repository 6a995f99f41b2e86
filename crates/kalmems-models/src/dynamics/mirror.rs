//! A mirror known by its free decay.

use kalmems_core::{Dynamics, LinearProcess, Mat, NoiseDensity, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// θ̈ + 2ζω_n·θ̇ + ω_n²·θ = a, states [θ, θ̇], input a in rad/s² (Chen, dissertation, 2018, equation 68, with the
/// input vector that is left out there).
///
/// ```
/// use kalmems_core::Process;
/// use kalmems_models::dynamics::MirrorResonator;
/// let mirror = MirrorResonator { natural_rate: 3924.0_f64, damping_ratio: 0.0 };
/// // A quarter of a cycle turns all angle into rate, in one step.
/// let quarter = mirror.exact(std::f64::consts::FRAC_PI_2 / 3924.0, 0.0);
/// let [angle, rate] = quarter.step(&[0.1, 0.0], &[0.0]);
/// assert!(angle.abs() < 1e-15 && (rate + 392.4).abs() < 1e-10);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct MirrorResonator<P> {
    /// ω_n in rad/s. Positive.
    pub natural_rate: P,
    /// ζ.
    pub damping_ratio: P,
}

#[model]
impl<P: Scalar> MirrorResonator<P> {
    /// θ̈ in rad/s², with θ in rad, θ̇ in rad/s and the other acceleration in rad/s².
    pub fn acceleration<S: Over<P>>(&self, angle: S, rate: S, other: S) -> S {
        other - angle * self.natural_rate.sq() - rate * (self.damping_ratio * self.natural_rate).twice()
    }

    /// A of ẋ = A·x + B·a.
    pub fn system_matrix(&self) -> Mat<P, 2, 2> {
        let damping = (self.damping_ratio * self.natural_rate).twice();
        Mat([[P::of(0.0), P::of(1.0)], [-self.natural_rate.sq(), -damping]])
    }
}

impl<P: Scalar> MirrorResonator<P> {
    /// The exact step over an interval under an acceleration held over it, and white angular acceleration of this
    /// density in rad²/s³.
    ///
    /// Euler's step, which the papers print (Chen, dissertation, 2018, equation 70), changes the damping by
    /// −ω_n·T/2: at 500 kHz it makes 0.0027 of 0.0066.
    pub fn exact(&self, interval: P, acceleration_density: P) -> LinearProcess<P, 2, 1> {
        let input = Mat([[P::of(0.0)], [P::of(1.0)]]);
        let noise = NoiseDensity::none().on::<1>(acceleration_density);
        LinearProcess::exact(&self.system_matrix(), &input, &noise, interval)
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for MirrorResonator<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], acceleration: &T) -> [S; 2] {
        [x[1], self.acceleration(x[0], x[1], S::lift(*acceleration))]
    }

    /// A hundredth of a radian, and the rate of the free swing that goes so far.
    fn natural_scales(&self) -> [T; 2] {
        [T::of(0.01), self.natural_rate * T::of(0.01)]
    }
}

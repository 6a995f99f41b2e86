//! A proof mass between plates that sense it and push it back.

use super::{GaussMarkov, ProofMass};
use crate::bisection::halved;
use crate::capacitance::DifferentialPlates;
use kalmems_core::{Dynamics, NoiseDensity, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// m·ẍ + b(x)·ẋ + k·x = m·a + F_el, states [x, ẋ] in m and m/s, inputs [a in m/s², v_F in V].
///
/// F_el = ½·ε·A·[(V_c² + (V_B − v_F)²)/(d₀ − x)² − (V_c² + (V_B + v_F)²)/(d₀ + x)²], the carrier averaged to its mean
/// square V_c² (Zhang 2010, equations 2-1 and 2-15). A positive feedback v_F pushes to −x; carrier, bias and feedback
/// all soften the spring. The thesis's equation 2-16 has ½ over all three squares, where the average over the carrier
/// halves its own alone.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::{capacitance::DifferentialPlates, dynamics::{Accelerometer, ProofMass}};
/// let device = Accelerometer {
///     mass: ProofMass { mass: 3.8e-9, damping: 7e-4, squeezed: 0.0, spring: 3.0 },
///     plates: DifferentialPlates { area: 1.86e-6, gap: 2.3e-6, permittivity: 3.54e-11 },
///     carrier_mean_square: 0.18,
///     bias: 0.1,
/// };
/// let [velocity, pushed] = device.derivative(&[0.0_f64, 0.0], &[1.0, 0.01]);
/// assert_eq!(velocity, 0.0);
/// assert!((pushed - (1.0 - device.feedback_gain() * 0.01 / 3.8e-9)).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct Accelerometer<P> {
    /// The mass on its springs.
    pub mass: ProofMass<P>,
    /// What senses it and pushes it.
    pub plates: DifferentialPlates<P>,
    /// V_c² in V²: the mean square of the carrier, half the square of its amplitude where it is a sine.
    pub carrier_mean_square: P,
    /// V_B in V; 0 where there is no feedback.
    pub bias: P,
}

/// Where the plates begin to pull more than the spring holds, at a feedback that does not change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticPullIn<P> {
    /// x in m: beyond it there is no equilibrium that holds.
    pub displacement: P,
    /// a in m/s²: the constant acceleration that leads there.
    pub acceleration: P,
}

/// Halvings of an interval: more than f64 has digits.
const HALVINGS: u32 = 64;

#[model]
impl<P: Scalar> Accelerometer<P> {
    /// The mean squares of the voltages to both plates in V².
    pub fn squares(&self, feedback: P) -> [P; 2] {
        [
            (self.bias - feedback).sq() + self.carrier_mean_square,
            (self.bias + feedback).sq() + self.carrier_mean_square,
        ]
    }

    /// F_el in N, with x in m and v_F in V.
    pub fn electrostatic_force<S: Over<P>>(&self, x: S, feedback: P) -> S {
        self.plates.force(x, self.squares(feedback))
    }

    /// k_el = 2·ε·A·(V_c² + V_B² + v_F²)/d₀³ in N/m: what the voltages take from the spring at rest.
    pub fn electrostatic_spring(&self, feedback: P) -> P {
        self.plates.force_slope(P::of(0.0), self.squares(feedback))
    }

    /// k − k_el in N/m at rest: what is left to hold the mass.
    pub fn softened_spring(&self, feedback: P) -> P {
        self.mass.spring - self.electrostatic_spring(feedback)
    }

    /// 2·ε·A·V_B/d₀² in N/V: the force to −x per feedback at rest (equation 2-17).
    pub fn feedback_gain(&self) -> P {
        (self.plates.permittivity * self.plates.area * self.bias).twice() / self.plates.gap.sq()
    }

    /// V_B = d₀·√(m·a/(ε·A)) in V: the bias with which the feedback v_F = V_B/2 holds this acceleration in m/s²
    /// (equation 2-18). With v_F = V_B, as far as the law is monotonous, a bias smaller by √2 would do.
    pub fn bias_for(&self, acceleration: P) -> P {
        self.plates.gap
            * (self.mass.mass * acceleration / (self.plates.permittivity * self.plates.area)).sqrt()
    }

    /// ẍ in m/s².
    pub fn response<S: Over<P>>(&self, x: S, velocity: S, acceleration: S, feedback: P) -> S {
        let share = x * self.plates.gap.recip();
        acceleration + self.mass.acceleration(x, share, velocity, self.electrostatic_force(x, feedback))
    }
}

impl<P: Scalar> Accelerometer<P> {
    /// The pull-in towards the first plate at a feedback in V that does not change; `None` where the plates pull more
    /// than the spring holds wherever the mass is.
    ///
    /// The net force k·x − F_el that an acceleration has to bring up grows up to the pull-in and falls beyond it. That
    /// towards the second plate is that of the opposite feedback, mirrored.
    pub fn static_pull_in(&self, feedback: P) -> Option<StaticPullIn<P>> {
        let squares = self.squares(feedback);
        let holds = |x: P| self.plates.force_slope(x, squares).lt(self.mass.spring);
        // Where the plates pull least: both sides' V²/gap⁴ are the same there.
        let ratio = (squares[1] / squares[0]).sqrt().sqrt();
        let one = P::of(1.0);
        let low = self.plates.gap * ((ratio - one) / (ratio + one));
        if !holds(low) {
            return None;
        }
        let (low, _) = halved((low, self.plates.gap), HALVINGS, |x| !holds(x));
        let net = self.mass.spring * low - self.plates.force(low, squares);
        Some(StaticPullIn { displacement: low, acceleration: net / self.mass.mass })
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for Accelerometer<T> {
    type Input = [T; 2];

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], input: &[T; 2]) -> [S; 2] {
        [x[1], self.response(x[0], x[1], S::lift(input[0]), input[1])]
    }

    /// 10⁻⁴ of the gap, and that at the mass's own rate.
    fn natural_scales(&self) -> [T; 2] {
        let length = self.plates.gap * T::of(1e-4);
        [length, length * self.mass.natural_rate(self.mass.spring)]
    }
}

/// An [`Accelerometer`] under the carrier itself: states [x, ẋ], inputs [a in m/s², v_F in V, v₁ in V].
///
/// The carrier is v₁ on the first plate and −v₁ on the second, with the bias against it (equation 2-15). A mean square
/// that the device states comes on top. Its average over the carrier's period is the device with v₁ = 0 and the carrier
/// in its mean square.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct CarrierDriven<P> {
    /// The instrument.
    pub device: Accelerometer<P>,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for CarrierDriven<T> {
    type Input = [T; 3];

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], input: &[T; 3]) -> [S; 2] {
        let at_once = Accelerometer { bias: self.device.bias - input[2], ..self.device };
        [x[1], at_once.response(x[0], x[1], S::lift(input[0]), input[1])]
    }
}

/// An [`Accelerometer`] whose acceleration is not known: states [x, ẋ, a, ȧ], input v_F in V.
///
/// The acceleration is a state like the others, a [`GaussMarkov`] process of stated size and bandwidth. The thesis's
/// observer has it as a known input, which an instrument that is to measure it cannot have.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SensedAcceleration<P> {
    /// The instrument.
    pub device: Accelerometer<P>,
    /// What is known of the acceleration beforehand, in m/s².
    pub prior: GaussMarkov<P>,
}

#[model]
impl<P: Scalar> SensedAcceleration<P> {
    /// The densities of what drives it: a force of the two-sided density `force_density` in N²/Hz, and the process
    /// behind the acceleration.
    pub fn noise(&self, force_density: P) -> NoiseDensity<P, 4> {
        let brownian = self.device.mass.acceleration_density(force_density);
        NoiseDensity::none().on::<1>(brownian).on::<3>(self.prior.density())
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 4> for SensedAcceleration<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 4], feedback: &T) -> [S; 4] {
        let [slope, curvature] = self.prior.derivative(x[2], x[3]);
        [x[1], self.device.response(x[0], x[1], x[2], *feedback), slope, curvature]
    }

    /// What the acceleration's standard deviation does to the mass on its spring, at the acceleration's rate.
    fn natural_scales(&self) -> [T; 4] {
        let (rms, rate) = (self.prior.rms, self.prior.rate);
        let length = self.device.mass.mass * rms / self.device.mass.spring;
        [length, length * rate, rms, rms * rate]
    }
}

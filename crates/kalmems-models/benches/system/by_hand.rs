//! The process with its Jacobian by hand.

use kalmems_core::{Covariance, Euler, Mat, Nodes, Over, Process, ProcessNoise, Scalar};
use kalmems_models::dynamics::ParametricScanner;

/// A step by Euler's method that gives its own Jacobian, as a user writes it who does not trust dual numbers.
pub struct EulerByHand<T> {
    euler: Euler<ParametricScanner<T>, T, 2>,
    laws: Laws<T>,
}

impl<T: Scalar> EulerByHand<T> {
    pub fn new(scanner: ParametricScanner<T>, interval: T, noise: Covariance<T, 2>) -> Self {
        Self { euler: Euler::new(scanner, interval, noise), laws: Laws::of(&scanner, interval) }
    }
}

/// The constants of the law of motion, put together once.
#[derive(Clone, Copy)]
pub struct Laws<T> {
    /// −1/θ₀².
    pub exponent: T,
    /// −C₀/θ₀²/J.
    pub pull: T,
    /// V_c²/2.
    pub carrier: T,
    /// k/J.
    pub stiffness: T,
    /// b/J.
    pub damping: T,
    /// h.
    pub interval: T,
}

impl<T: Scalar> Laws<T> {
    pub fn of(scanner: &ParametricScanner<T>, interval: T) -> Self {
        let per_inertia = scanner.resonator.inertia.recip();
        let exponent = -scanner.comb.angular_width.sq().recip();
        Self {
            exponent,
            pull: scanner.comb.nominal * exponent * per_inertia,
            carrier: scanner.carrier_mean_square,
            stiffness: scanner.resonator.stiffness * per_inertia,
            damping: scanner.resonator.damping * per_inertia,
            interval,
        }
    }

    /// θ̈/θ at rest: minus the stiffness over J, the electrodes' included.
    #[inline(always)]
    pub fn spring(&self, angle: T, voltage: T) -> T {
        (angle.sq() * self.exponent).exp() * (self.pull * (voltage.sq() + self.carrier)) - self.stiffness
    }

    /// One step by Runge–Kutta's method, the spring at its start being known already.
    #[inline(always)]
    pub fn runge_kutta(&self, spring: T, angle: T, rate: T, voltage: &Nodes<T>) -> [T; 2] {
        let (h, half) = (self.interval, self.interval.half());
        let acceleration = |spring: T, angle: T, rate: T| angle * spring - rate * self.damping;
        let moved = |angle: T, rate: T, voltage: T| acceleration(self.spring(angle, voltage), angle, rate);
        let a1 = acceleration(spring, angle, rate);
        let rate2 = rate + a1 * half;
        let a2 = moved(angle + rate * half, rate2, voltage.middle);
        let rate3 = rate + a2 * half;
        let a3 = moved(angle + rate2 * half, rate3, voltage.middle);
        let rate4 = rate + a3 * h;
        let a4 = moved(angle + rate3 * h, rate4, voltage.end);
        let sixth = h * T::of(1.0 / 6.0);
        [
            angle + (rate + (rate2 + rate3).twice() + rate4) * sixth,
            rate + (a1 + (a2 + a3).twice() + a4) * sixth,
        ]
    }

    /// θ̈ and ∂θ̈/∂θ, of one exp.
    #[inline(always)]
    pub fn acceleration_and_slope(&self, angle: T, rate: T, voltage: T) -> (T, T) {
        let exponent = angle.sq() * self.exponent;
        let pull = exponent.exp() * (self.pull * (voltage.sq() + self.carrier));
        let acceleration = angle * (pull - self.stiffness) - rate * self.damping;
        (acceleration, pull * (exponent.twice() + T::of(1.0)) - self.stiffness)
    }
}

impl<T: Scalar> Process<T, 2> for EulerByHand<T> {
    type Input = T;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; 2], voltage: &T) -> [S; 2] {
        self.euler.step(x, voltage)
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, 2> {
        self.euler.noise()
    }

    #[inline(always)]
    fn linearize(&self, &[angle, rate]: &[T; 2], voltage: &T) -> ([T; 2], Mat<T, 2, 2>) {
        let h = self.laws.interval;
        let (acceleration, slope) = self.laws.acceleration_and_slope(angle, rate, *voltage);
        let f = Mat([[T::of(1.0), h], [slope * h, T::of(1.0) - self.laws.damping * h]]);
        ([angle + rate * h, rate + acceleration * h], f)
    }
}

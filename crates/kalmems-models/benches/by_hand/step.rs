//! A step of Runge–Kutta's with its Jacobian by hand.

use crate::system::Laws;
use kalmems_core::{Nodes, Scalar};

/// x′ and ∂x′/∂x.
pub struct Step<T> {
    pub angle: T,
    pub rate: T,
    pub f00: T,
    pub f01: T,
    pub f10: T,
    pub f11: T,
}

impl<T: Scalar> Step<T> {
    /// Stage by stage: the first row of each derivative is the second row of what it is taken at.
    #[inline(always)]
    pub fn runge_kutta(laws: &Laws<T>, angle: T, rate: T, voltage: &Nodes<T>) -> Self {
        let one = T::of(1.0);
        let (h, half) = (laws.interval, laws.interval.half());
        let damping = laws.damping;

        let (a1, s1) = laws.acceleration_and_slope(angle, rate, voltage.start);

        let rate2 = rate + a1 * half;
        let (a2, s2) = laws.acceleration_and_slope(angle + rate * half, rate2, voltage.middle);
        let m2 = (s1 * half, one - damping * half);
        let k2 = (s2 - damping * m2.0, s2 * half - damping * m2.1);

        let rate3 = rate + a2 * half;
        let (a3, s3) = laws.acceleration_and_slope(angle + rate2 * half, rate3, voltage.middle);
        let m3 = (k2.0 * half, one + k2.1 * half);
        let k3 = (s3 * (one + m2.0 * half) - damping * m3.0, s3 * (m2.1 * half) - damping * m3.1);

        let rate4 = rate + a3 * h;
        let (a4, s4) = laws.acceleration_and_slope(angle + rate3 * h, rate4, voltage.end);
        let m4 = (k3.0 * h, one + k3.1 * h);
        let k4 = (s4 * (one + m3.0 * h) - damping * m4.0, s4 * (m3.1 * h) - damping * m4.1);

        let sixth = h * T::of(1.0 / 6.0);
        Self {
            angle: angle + (rate + (rate2 + rate3).twice() + rate4) * sixth,
            rate: rate + (a1 + (a2 + a3).twice() + a4) * sixth,
            f00: one + ((m2.0 + m3.0).twice() + m4.0) * sixth,
            f01: (one + (m2.1 + m3.1).twice() + m4.1) * sixth,
            f10: (s1 + (k2.0 + k3.0).twice() + k4.0) * sixth,
            f11: one + ((k2.1 + k3.1).twice() + k4.1 - damping) * sixth,
        }
    }
}

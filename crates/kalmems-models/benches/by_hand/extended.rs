//! The extended Kalman filter by hand.

use super::{Readout, State};
use crate::system::{Innovations, Laws, Outcome, System};
use kalmems_core::{FilterError, Nodes, Scalar};

/// The filter with its models.
pub struct Extended<T> {
    state: State<T>,
    laws: Laws<T>,
    readout: Readout<T>,
    q: [T; 3],
    innovations: Innovations<T>,
}

/// x′ and ∂x′/∂x.
struct Step<T> {
    angle: T,
    rate: T,
    f00: T,
    f01: T,
    f10: T,
    f11: T,
}

impl<T: Scalar<Mask = bool>> Extended<T> {
    pub fn new(system: &System<T>) -> Self {
        let q = &system.process_noise;
        Self {
            state: State::start(system),
            laws: Laws::of(&system.scanner, system.interval),
            readout: Readout::of(system),
            q: [q.get(0, 0), q.get(1, 0), q.get(1, 1)],
            innovations: Innovations::none(),
        }
    }

    pub fn outcome(&self) -> Outcome<T> {
        self.state.outcome(self.innovations)
    }

    /// Euler's step: x + h·f, I + h·∂f/∂x. F₀₀ is 1.
    #[inline(always)]
    pub fn predict_euler(&mut self, voltage: T) -> Result<(), FilterError> {
        let State { angle, rate, p00, p10, p11 } = self.state;
        let h = self.laws.interval;
        let (acceleration, slope) = self.laws.acceleration_and_slope(angle, rate, voltage);
        let f10 = slope * h;
        let f11 = T::of(1.0) - self.laws.damping * h;
        let fp00 = p00 + p10 * h;
        let fp01 = p10 + p11 * h;
        let fp10 = f10 * p00 + f11 * p10;
        let fp11 = f10 * p10 + f11 * p11;
        self.state = State {
            angle: angle + rate * h,
            rate: rate + acceleration * h,
            p00: fp00 + fp01 * h + self.q[0],
            p10: fp10 + fp11 * h + self.q[1],
            p11: fp10 * f10 + fp11 * f11 + self.q[2],
        }
        .checked()?;
        Ok(())
    }

    /// Runge–Kutta's step, with the variational equation through the same four stages.
    #[inline(always)]
    pub fn predict_runge_kutta(&mut self, voltage: &Nodes<T>) -> Result<(), FilterError> {
        let State { p00, p10, p11, .. } = self.state;
        let Step { angle, rate, f00, f01, f10, f11 } = self.runge_kutta(voltage);
        let fp00 = f00 * p00 + f01 * p10;
        let fp01 = f00 * p10 + f01 * p11;
        let fp10 = f10 * p00 + f11 * p10;
        let fp11 = f10 * p10 + f11 * p11;
        self.state = State {
            angle,
            rate,
            p00: fp00 * f00 + fp01 * f01 + self.q[0],
            p10: fp10 * f00 + fp11 * f01 + self.q[1],
            p11: fp10 * f10 + fp11 * f11 + self.q[2],
        }
        .checked()?;
        Ok(())
    }

    /// Stage by stage: the first row of each derivative is the second row of what it is taken at.
    #[inline(always)]
    fn runge_kutta(&self, voltage: &Nodes<T>) -> Step<T> {
        let State { angle, rate, .. } = self.state;
        let one = T::of(1.0);
        let (h, half) = (self.laws.interval, self.laws.interval.half());
        let damping = self.laws.damping;

        let (a1, s1) = self.laws.acceleration_and_slope(angle, rate, voltage.start);

        let rate2 = rate + a1 * half;
        let (a2, s2) = self.laws.acceleration_and_slope(angle + rate * half, rate2, voltage.middle);
        let m2 = (s1 * half, one - damping * half);
        let k2 = (s2 - damping * m2.0, s2 * half - damping * m2.1);

        let rate3 = rate + a2 * half;
        let (a3, s3) = self.laws.acceleration_and_slope(angle + rate2 * half, rate3, voltage.middle);
        let m3 = (k2.0 * half, one + k2.1 * half);
        let k3 = (s3 * (one + m2.0 * half) - damping * m3.0, s3 * (m2.1 * half) - damping * m3.1);

        let rate4 = rate + a3 * h;
        let (a4, s4) = self.laws.acceleration_and_slope(angle + rate3 * h, rate4, voltage.end);
        let m4 = (k3.0 * h, one + k3.1 * h);
        let k4 = (s4 * (one + m3.0 * h) - damping * m4.0, s4 * (m3.1 * h) - damping * m4.1);

        let sixth = h * T::of(1.0 / 6.0);
        Step {
            angle: angle + (rate + (rate2 + rate3).twice() + rate4) * sixth,
            rate: rate + (a1 + (a2 + a3).twice() + a4) * sixth,
            f00: one + ((m2.0 + m3.0).twice() + m4.0) * sixth,
            f01: (one + (m2.1 + m3.1).twice() + m4.1) * sixth,
            f10: (s1 + (k2.0 + k3.0).twice() + k4.0) * sixth,
            f11: one + ((k2.1 + k3.1).twice() + k4.1 - damping) * sixth,
        }
    }

    /// H = [h, 0], so that A = I − K·H has its second column from I. Joseph's form.
    #[inline(always)]
    pub fn update(&mut self, y: T) -> Result<(), FilterError> {
        if !y.is_finite() {
            return Err(FilterError::NonFiniteMeasurement);
        }
        let State { angle, rate, p00, p10, p11 } = self.state;
        let r = self.readout.variance;
        let (predicted, h) = self.readout.value_and_slope(angle);
        let residual = y - predicted;
        let hp0 = h * p00;
        let hp1 = h * p10;
        let variance = hp0 * h + r;
        if !(variance.gt(T::of(0.0)) & variance.is_finite()) {
            return Err(FilterError::InnovationNotPositive);
        }
        let recip = variance.recip();
        let (k0, k1) = (hp0 * recip, hp1 * recip);
        let a00 = T::of(1.0) - k0 * h;
        let a10 = k1 * h;
        let ap10 = p10 - a10 * p00;
        let ap11 = p11 - a10 * p10;
        let (kr0, kr1) = (k0 * r, k1 * r);
        self.state = State {
            angle: angle + k0 * residual,
            rate: rate + k1 * residual,
            p00: a00 * p00 * a00 + kr0 * k0,
            p10: ap10 * a00 + kr1 * k0,
            p11: ap11 - ap10 * a10 + kr1 * k1,
        }
        .checked()?;
        self.innovations.add(residual, variance, residual.sq() * recip);
        Ok(())
    }
}

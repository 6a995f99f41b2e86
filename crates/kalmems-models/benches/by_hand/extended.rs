//! The extended Kalman filter by hand.

use super::{Readout, State, Step};
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

impl<T: Scalar> Extended<T> {
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
        let State { angle, rate, p00, p10, p11 } = self.state;
        let Step { angle, rate, f00, f01, f10, f11 } = Step::runge_kutta(&self.laws, angle, rate, voltage);
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

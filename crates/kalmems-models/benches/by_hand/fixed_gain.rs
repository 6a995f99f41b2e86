//! The filter with a constant gain by hand.
//!
//! There is so little to it that the readout's law is most of what it computes. So the law is taken as the model
//! states it, and not put together as for the other filters: what is compared is the filter, to the bit.

use crate::system::{Innovations, Outcome, System};
use kalmems_core::{FilterError, Scalar};
use kalmems_models::readout::DemodulatedComb;

/// The filter with its models, on a mirror that a torque holds at an angle.
pub struct FixedGain<T> {
    angle: T,
    rate: T,
    /// Φ, by rows.
    transition: [T; 4],
    /// Γ.
    input: [T; 2],
    readout: DemodulatedComb<T>,
    /// −1/θ₀².
    exponent: T,
    /// K.
    gain: [T; 2],
    /// P, and S and its reciprocal: what the gain settles in.
    covariance: [T; 3],
    variance: T,
    recip: T,
    innovations: Innovations<T>,
}

impl<T: Scalar> FixedGain<T> {
    /// With the gain and the covariances that the library finds, since neither costs anything per sample.
    pub fn new(system: &System<T>) -> Self {
        let process = system.resonator();
        let settled = system.settled();
        let [angle, rate] = *settled.mean();
        let p = settled.filtered_covariance();
        let k = settled.gain();
        let h = system.operating_point().observation;
        let variance = settled.predicted_covariance().transformed(&h).get(0, 0) + system.readout_variance;
        Self {
            angle,
            rate,
            transition: [
                process.transition[(0, 0)],
                process.transition[(0, 1)],
                process.transition[(1, 0)],
                process.transition[(1, 1)],
            ],
            input: [process.input[(0, 0)], process.input[(1, 0)]],
            readout: system.readout,
            exponent: -system.readout.comb.angular_width.sq().recip(),
            gain: [k[(0, 0)], k[(1, 0)]],
            covariance: [p.get(0, 0), p.get(1, 0), p.get(1, 1)],
            variance,
            recip: variance.recip(),
            innovations: Innovations::none(),
        }
    }

    pub fn outcome(&self) -> Outcome<T> {
        Outcome {
            mean: [self.angle, self.rate],
            covariance: self.covariance,
            innovations: Some(self.innovations),
        }
    }

    /// Φ·x + Γ·u.
    #[inline(always)]
    pub fn predict(&mut self, torque: T) -> Result<(), FilterError> {
        let [f00, f01, f10, f11] = self.transition;
        let [g0, g1] = self.input;
        let angle = f00 * self.angle + f01 * self.rate + g0 * torque;
        let rate = f10 * self.angle + f11 * self.rate + g1 * torque;
        self.take(angle, rate, FilterError::NonFiniteState)
    }

    /// x + K·(y − h(x)). What is not finite in y is not finite in that.
    #[inline(always)]
    pub fn update(&mut self, y: T) -> Result<(), FilterError> {
        let DemodulatedComb { comb, gain, offset } = self.readout;
        let capacitance = (self.angle.sq() * self.exponent).exp() * comb.nominal + comb.bias;
        let residual = y - (capacitance * gain + offset);
        let [k0, k1] = self.gain;
        let (angle, rate) = (self.angle + k0 * residual, self.rate + k1 * residual);
        let reason =
            if y.is_finite() { FilterError::NonFiniteState } else { FilterError::NonFiniteMeasurement };
        self.take(angle, rate, reason)?;
        self.innovations.add(residual, self.variance, residual * (residual * self.recip));
        Ok(())
    }

    #[inline(always)]
    fn take(&mut self, angle: T, rate: T, reason: FilterError) -> Result<(), FilterError> {
        if !(angle.is_finite() & rate.is_finite()) {
            return Err(reason);
        }
        (self.angle, self.rate) = (angle, rate);
        Ok(())
    }
}

//! A controller of two gains.

use super::Complex;
use kalmems_core::Scalar;
use kalmems_macros::{Parameters, model};

/// u = K_p·y + K_i·∫y dt (Zhang 2010, Figure 9).
///
/// The thesis's K_p = 10 and K_i = 1/s put its corner K_i/K_p at 0.1 rad/s: for most signals there is no integral action.
///
/// ```
/// use kalmems_models::control::PiController;
/// let controller = PiController { proportional: 2.0, integral: 10.0 };
/// // Half a second of a constant 3: 2·3 + 10·3·0.5.
/// let (_, total) = controller.step(0.0, 3.0, 0.5);
/// assert_eq!(controller.output(total, 3.0), 21.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct PiController<P> {
    /// K_p in output per input.
    pub proportional: P,
    /// K_i in output per input and second.
    pub integral: P,
}

#[model]
impl<P: Scalar> PiController<P> {
    /// u from the integral of y up to now and y.
    pub fn output(&self, integral: P, y: P) -> P {
        self.proportional * y + self.integral * integral
    }

    /// u at a sample, and the integral an interval later, with the sample held until then.
    pub fn step(&self, integral: P, y: P, interval: P) -> (P, P) {
        (self.output(integral, y), integral + y * interval)
    }

    /// K_p + K_i/(jω), with ω in rad/s and not 0.
    pub fn response(&self, rate: P) -> Complex<P> {
        Complex { re: self.proportional, im: -(self.integral / rate) }
    }
}

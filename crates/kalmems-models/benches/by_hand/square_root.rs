//! The extended Kalman filter in square-root form by hand.

use super::{Readout, Step};
use crate::system::{Innovations, Laws, Outcome, System};
use kalmems_core::{Cholesky, FilterError, Nodes, Scalar};

/// The filter with its models.
pub struct SquareRoot<T> {
    state: Factor<T>,
    laws: Laws<T>,
    readout: Readout<T>,
    /// W₀₀, W₁₀, W₁₁ of Q = W·Wᵀ.
    w: [T; 3],
    innovations: Innovations<T>,
}

/// Mean and factor in scalars: P = S·Sᵀ.
#[derive(Clone, Copy)]
struct Factor<T> {
    angle: T,
    rate: T,
    s00: T,
    s10: T,
    s11: T,
}

impl<T: Scalar> Factor<T> {
    /// Itself, if it is finite.
    #[inline(always)]
    fn checked(self) -> Result<Self, FilterError> {
        let finite = self.angle.is_finite()
            & self.rate.is_finite()
            & self.s00.is_finite()
            & self.s10.is_finite()
            & self.s11.is_finite();
        if finite { Ok(self) } else { Err(FilterError::NonFiniteState) }
    }
}

impl<T: Scalar> SquareRoot<T> {
    pub fn new(system: &System<T>) -> Self {
        let s = Cholesky::of_semidefinite(&system.start_covariance);
        let w = Cholesky::of_semidefinite(&system.process_noise);
        let [angle, rate] = system.start_mean;
        Self {
            state: Factor { angle, rate, s00: s[(0, 0)], s10: s[(1, 0)], s11: s[(1, 1)] },
            laws: Laws::of(&system.scanner, system.interval),
            readout: Readout::of(system),
            w: [w[(0, 0)], w[(1, 0)], w[(1, 1)]],
            innovations: Innovations::none(),
        }
    }

    pub fn outcome(&self) -> Outcome<T> {
        let Factor { angle, rate, s00, s10, s11 } = self.state;
        Outcome {
            mean: [angle, rate],
            covariance: [s00.sq(), s10 * s00, s10.sq() + s11.sq()],
            innovations: Some(self.innovations),
        }
    }

    /// Euler's step: x + h·f, I + h·∂f/∂x. F₀₀ is 1.
    #[inline(always)]
    pub fn predict_euler(&mut self, voltage: T) -> Result<(), FilterError> {
        let Factor { angle, rate, s00, s10, s11 } = self.state;
        let h = self.laws.interval;
        let (acceleration, slope) = self.laws.acceleration_and_slope(angle, rate, voltage);
        let f11 = T::of(1.0) - self.laws.damping * h;
        let moved = [[s00 + s10 * h, s11 * h], [slope * h * s00 + f11 * s10, f11 * s11]];
        self.rotate(angle + rate * h, rate + acceleration * h, moved)
    }

    /// Runge–Kutta's step, with the variational equation through the same four stages.
    #[inline(always)]
    pub fn predict_runge_kutta(&mut self, voltage: &Nodes<T>) -> Result<(), FilterError> {
        let Factor { angle, rate, s00, s10, s11 } = self.state;
        let Step { angle, rate, f00, f01, f10, f11 } = Step::runge_kutta(&self.laws, angle, rate, voltage);
        let moved = [[f00 * s00 + f01 * s10, f01 * s11], [f10 * s00 + f11 * s10, f11 * s11]];
        self.rotate(angle, rate, moved)
    }

    /// [F·S, W] made triangular: two rotations of the first row, and the length of what they leave of the second.
    #[inline(always)]
    fn rotate(&mut self, angle: T, rate: T, [[a, b], [c, d]]: [[T; 2]; 2]) -> Result<(), FilterError> {
        let [w00, w10, w11] = self.w;
        let square = a.sq() + b.sq();
        let first = square.sqrt();
        let s00 = (square + w00.sq()).sqrt();
        let (cos, sin) = rotation(a, b, first);
        let (p, q) = (c * cos + d * sin, d * cos - c * sin);
        let (cos, sin) = rotation(first, w00, s00);
        let (s10, left) = (p * cos + w10 * sin, w10 * cos - p * sin);
        let s11 = (q.sq() + (left.sq() + w11.sq())).sqrt();
        self.state = Factor { angle, rate, s00, s10, s11 }.checked()?;
        Ok(())
    }

    /// H = [h, 0], so that the measurement sees the first column of S alone. Carlson's form.
    #[inline(always)]
    pub fn update(&mut self, y: T) -> Result<(), FilterError> {
        if !y.is_finite() {
            return Err(FilterError::NonFiniteMeasurement);
        }
        let Factor { angle, rate, s00, s10, s11 } = self.state;
        let r = self.readout.variance;
        let (predicted, h) = self.readout.value_and_slope(angle);
        let residual = y - predicted;
        let f = h * s00;
        let variance = f.sq() + r;
        if !(variance.gt(T::of(0.0)) & variance.is_finite()) {
            return Err(FilterError::InnovationNotPositive);
        }
        let recip = variance.recip();
        let weighted = residual * recip;
        let along = f * weighted;
        let keep = (r * recip).sqrt();
        self.state = Factor {
            angle: angle + s00 * along,
            rate: rate + s10 * along,
            s00: s00 * keep,
            s10: s10 * keep,
            s11,
        }
        .checked()?;
        self.innovations.add(residual, variance, residual * weighted);
        Ok(())
    }
}

/// The cosine and sine that turn (a, b) into (length, 0); where that is zero, nothing is turned.
#[inline(always)]
fn rotation<T: Scalar>(a: T, b: T, length: T) -> (T, T) {
    if length.gt(T::of(0.0)) {
        let recip = length.recip();
        (a * recip, b * recip)
    } else {
        (T::of(1.0), T::of(0.0))
    }
}

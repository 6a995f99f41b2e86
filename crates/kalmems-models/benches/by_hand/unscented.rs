//! The unscented Kalman filter by hand.

use super::{Readout, State};
use crate::system::{Innovations, Laws, Outcome, System};
use kalmems_core::{FilterError, Nodes, Scalar};

/// The filter with its models; the points lie √3 out, α = 1, β = 2, κ = 1.
pub struct Unscented<T> {
    state: State<T>,
    laws: Laws<T>,
    readout: Readout<T>,
    q: [T; 3],
    innovations: Innovations<T>,
    /// √3.
    spread: T,
    /// The weight of an outer point.
    outer: T,
    /// The weight of the centre in a covariance.
    centre: T,
}

/// The columns of √3·L: the first moves both states, the second the rate alone.
struct Offsets<T> {
    first: [T; 2],
    second: T,
}

impl<T: Scalar> Unscented<T> {
    pub fn new(system: &System<T>) -> Self {
        let q = &system.process_noise;
        Self {
            state: State::start(system),
            laws: Laws::of(&system.scanner, system.interval),
            readout: Readout::of(system),
            q: [q.get(0, 0), q.get(1, 0), q.get(1, 1)],
            innovations: Innovations::none(),
            spread: T::of(3.0).sqrt(),
            outer: T::of(1.0 / 6.0),
            centre: T::of(7.0 / 3.0),
        }
    }

    pub fn outcome(&self) -> Outcome<T> {
        self.state.outcome(self.innovations)
    }

    /// One reciprocal: of the first pivot's root.
    #[inline(always)]
    fn offsets(&self) -> Result<Offsets<T>, FilterError> {
        let State { p00, p10, p11, .. } = self.state;
        let zero = T::of(0.0);
        let l00 = p00.sqrt();
        let l10 = p10 * l00.recip();
        let pivot = p11 - l10.sq();
        if !(p00.gt(zero) & p00.is_finite() & pivot.gt(zero) & pivot.is_finite()) {
            return Err(FilterError::CovarianceNotPositive);
        }
        Ok(Offsets { first: [l00 * self.spread, l10 * self.spread], second: pivot.sqrt() * self.spread })
    }

    /// Euler's step. Three of the five points share their angle, and with it their exp.
    #[inline(always)]
    pub fn predict_euler(&mut self, voltage: T) -> Result<(), FilterError> {
        let Offsets { first: [a, b], second: c } = self.offsets()?;
        let State { angle, rate, .. } = self.state;
        let h = self.laws.interval;
        let pull = |angle: T| angle * self.laws.spring(angle, voltage);
        let step =
            |pull: T, angle: T, rate: T| [angle + rate * h, rate + (pull - rate * self.laws.damping) * h];
        let here = pull(angle);
        let points = [
            step(here, angle, rate),
            step(pull(angle + a), angle + a, rate + b),
            step(pull(angle - a), angle - a, rate - b),
            step(here, angle, rate + c),
            step(here, angle, rate - c),
        ];
        self.gather(&points)
    }

    /// Runge–Kutta's step of each point.
    #[inline(always)]
    pub fn predict_runge_kutta(&mut self, voltage: &Nodes<T>) -> Result<(), FilterError> {
        let Offsets { first: [a, b], second: c } = self.offsets()?;
        let State { angle, rate, .. } = self.state;
        let here = self.laws.spring(angle, voltage.start);
        let points = [
            self.laws.runge_kutta(here, angle, rate, voltage),
            self.laws.runge_kutta(self.laws.spring(angle + a, voltage.start), angle + a, rate + b, voltage),
            self.laws.runge_kutta(self.laws.spring(angle - a, voltage.start), angle - a, rate - b, voltage),
            self.laws.runge_kutta(here, angle, rate + c, voltage),
            self.laws.runge_kutta(here, angle, rate - c, voltage),
        ];
        self.gather(&points)
    }

    /// Mean and covariance of the moved points.
    #[inline(always)]
    fn gather(&mut self, [centre, p1, m1, p2, m2]: &[[T; 2]; 5]) -> Result<(), FilterError> {
        let mean = |i: usize| {
            let c = centre[i];
            c + ((p1[i] - c) + (m1[i] - c) + ((p2[i] - c) + (m2[i] - c))) * self.outer
        };
        let (angle, rate) = (mean(0), mean(1));
        let d = |p: &[T; 2]| (p[0] - angle, p[1] - rate);
        let (c, d1, e1, d2, e2) = (d(centre), d(p1), d(m1), d(p2), d(m2));
        let weighted = |c: T, outer: T| c * self.centre + outer * self.outer;
        self.state = State {
            angle,
            rate,
            p00: weighted(c.0 * c.0, d1.0 * d1.0 + e1.0 * e1.0 + (d2.0 * d2.0 + e2.0 * e2.0)) + self.q[0],
            p10: weighted(c.0 * c.1, d1.0 * d1.1 + e1.0 * e1.1 + (d2.0 * d2.1 + e2.0 * e2.1)) + self.q[1],
            p11: weighted(c.1 * c.1, d1.1 * d1.1 + e1.1 * e1.1 + (d2.1 * d2.1 + e2.1 * e2.1)) + self.q[2],
        }
        .checked()?;
        Ok(())
    }

    /// The second pair of points has the centre's angle and reading. P⁺ is summed over corrected points.
    #[inline(always)]
    pub fn update(&mut self, y: T) -> Result<(), FilterError> {
        if !y.is_finite() {
            return Err(FilterError::NonFiniteMeasurement);
        }
        let Offsets { first: [a, b], second: c } = self.offsets()?;
        let State { angle, rate, .. } = self.state;
        let r = self.readout.variance;
        let centre = self.readout.value(angle);
        let plus = self.readout.value(angle + a);
        let minus = self.readout.value(angle - a);
        let predicted = centre + ((plus - centre) + (minus - centre)) * self.outer;
        let (dc, dp, dm) = (centre - predicted, plus - predicted, minus - predicted);
        let variance = dc * dc * self.centre + (dp * dp + dm * dm + (dc * dc).twice()) * self.outer + r;
        if !(variance.gt(T::of(0.0)) & variance.is_finite()) {
            return Err(FilterError::InnovationNotPositive);
        }
        let recip = variance.recip();
        let cross = (dp - dm) * self.outer * recip;
        let (k0, k1) = (a * cross, b * cross);
        let residual = y - predicted;

        let (c0, c1) = (k0 * dc, k1 * dc);
        let (p0, p1) = (a - k0 * dp, b - k1 * dp);
        let (m0, m1) = (a + k0 * dm, b + k1 * dm);
        let (q1, n1) = (c - c1, c + c1);
        let (kr0, kr1) = (k0 * r, k1 * r);
        self.state = State {
            angle: angle + k0 * residual,
            rate: rate + k1 * residual,
            p00: c0 * c0 * self.centre + (p0 * p0 + m0 * m0 + (c0 * c0).twice()) * self.outer + kr0 * k0,
            p10: c0 * c1 * self.centre + (p0 * p1 + m0 * m1 + (c0 * c1).twice()) * self.outer + kr1 * k0,
            p11: c1 * c1 * self.centre + (p1 * p1 + m1 * m1 + (q1 * q1 + n1 * n1)) * self.outer + kr1 * k1,
        }
        .checked()?;
        self.innovations.add(residual, variance, residual.sq() * recip);
        Ok(())
    }
}

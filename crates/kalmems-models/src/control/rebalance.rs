//! The force-rebalance loop in the frequency domain.

use super::{Complex, PiController};
use crate::bisection::halved;
use crate::dynamics::Accelerometer;
use crate::readout::DifferentialReadout;
use kalmems_core::Scalar;

/// An accelerometer whose readout acts back on it through a controller, linear about rest.
///
/// With X(s) = 1/(m·s² + b·s + k − k_el), the readout's S, the force per feedback g, the controller's C(s) and a delay
/// τ the loop is L = g·C·e^{−sτ}·S·X, and the output is
/// y = [S·X·(m·a + F_B) + n]/(1 + L) (Zhang 2010, equations 3-11 and 3-14, with the plates' pull in X in either case and
/// the noise n before the controller).
///
/// Signal and noise are divided by the same 1 + L: at each frequency the loop changes nothing about their ratio, be n
/// the readout's noise or F_B the molecules'. The thesis finds otherwise (its equations 3-12 to 3-17) because it counts
/// the plates' pull in the open loop alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RebalanceLoop<P> {
    /// The instrument, biased.
    pub device: Accelerometer<P>,
    /// Its readout.
    pub readout: DifferentialReadout<P>,
    /// The controller; both gains 0 for an open loop.
    pub controller: PiController<P>,
    /// τ in s: from the sample to the force, half an interval for what is held included.
    pub delay: P,
}

/// How far a loop is from oscillating.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins<P> {
    /// Where |L| = 1, in rad/s; `None` where it is below everywhere.
    pub crossover: Option<P>,
    /// What the phase of L lacks there to −180°, in rad; below 0 for a loop that is unstable.
    pub phase: Option<P>,
    /// 1/|L| where L first is real and negative beyond the crossover of the controller's corner; `None` where it is
    /// nowhere in the band.
    pub gain: Option<P>,
    /// The largest |1/(1 + L)|: by how much the loop amplifies a disturbance at worst.
    pub peak_sensitivity: P,
}

impl<P: Scalar> RebalanceLoop<P> {
    /// X in m/N, at ω in rad/s.
    pub fn compliance(&self, rate: P) -> Complex<P> {
        let mass = &self.device.mass;
        let spring = self.device.softened_spring(P::of(0.0));
        Complex::real(P::of(1.0)) / Complex { re: spring - mass.mass * rate.sq(), im: mass.damping * rate }
    }

    /// L.
    pub fn open_loop(&self, rate: P) -> Complex<P> {
        let gain = self.device.feedback_gain() * self.readout.sensitivity();
        let delayed = self.controller.response(rate) * Complex::turned(-(rate * self.delay));
        Complex::real(gain) * delayed * self.compliance(rate)
    }

    /// 1/(1 + L).
    pub fn sensitivity(&self, rate: P) -> Complex<P> {
        let one = Complex::real(P::of(1.0));
        one / (one + self.open_loop(rate))
    }

    /// The phase of [`response`](Self::response) in rad, from its two factors, so that it passes −180° without a jump.
    pub fn phase(&self, rate: P) -> P {
        let (sensitivity, compliance) = (self.sensitivity(rate), self.compliance(rate));
        sensitivity.angle() + compliance.angle()
    }

    /// y/a in V/(m/s²).
    pub fn response(&self, rate: P) -> Complex<P> {
        Complex::real(self.device.mass.mass) * self.readout_response(rate) * self.sensitivity(rate)
    }

    /// S·X in V/N: what a force does at the readout before the loop answers.
    fn readout_response(&self, rate: P) -> Complex<P> {
        Complex::real(self.readout.sensitivity()) * self.compliance(rate)
    }

    /// x/a in s²: how far the mass moves.
    pub fn displacement(&self, rate: P) -> Complex<P> {
        Complex::real(self.device.mass.mass) * self.compliance(rate) * self.sensitivity(rate)
    }

    /// The acceleration that a readout noise of 1 V looks like, in m/s² per V: 1/(m·S·|X|), whatever the loop does.
    pub fn input_referred(&self, rate: P) -> P {
        (self.readout_response(rate).size() * self.device.mass.mass).recip()
    }

    /// The angular frequency in rad/s above `from` at which |y/a| has fallen by √2 from what it is there; `None` where it
    /// has not below `to`.
    pub fn bandwidth(&self, from: P, to: P) -> Option<P> {
        let level = self.response(from).size() * P::of(core::f64::consts::FRAC_1_SQRT_2);
        crossing(from, to, &|rate| self.response(rate).size().lt(level))
    }

    /// The margins, sought from `from` to `to` in rad/s.
    pub fn margins(&self, from: P, to: P) -> Margins<P> {
        let one = P::of(1.0);
        let loud = |rate: P| self.open_loop(rate).size().gt(one);
        let crossover = if loud(from) { crossing(from, to, &|rate| !loud(rate)) } else { None };
        // The phase from its parts, none of which jumps.
        let lag = |rate: P| rate * self.delay - self.continuous_phase(rate);
        let half_turn = P::of(core::f64::consts::PI);
        let turned = crossing(from, to, &|rate| lag(rate).gt(half_turn));
        let mut peak = P::of(0.0);
        for step in 0..=GRID {
            let size = self.sensitivity(at(from, to, step)).size();
            peak = P::select(size.gt(peak), size, peak);
        }
        Margins {
            crossover,
            phase: crossover.map(|rate| half_turn - lag(rate)),
            gain: turned.map(|rate| self.open_loop(rate).size().recip()),
            peak_sensitivity: peak,
        }
    }

    /// The phase of C·X in rad, from −270° to 0.
    fn continuous_phase(&self, rate: P) -> P {
        let controller = self.controller.response(rate);
        let compliance = self.compliance(rate);
        controller.angle_below() + compliance.angle_below()
    }
}

/// Frequencies that are looked at between two ends.
const GRID: u32 = 2000;
/// Halvings of the interval between two of them.
const HALVINGS: u32 = 60;

/// The frequency at this place of a logarithmic grid.
fn at<P: Scalar>(from: P, to: P, step: u32) -> P {
    from * ((to / from).ln() * P::of(f64::from(step) / f64::from(GRID))).exp()
}

/// Where something first becomes true.
fn crossing<P: Scalar>(from: P, to: P, is_beyond: &dyn Fn(P) -> bool) -> Option<P> {
    let first = (0..=GRID).find(|step| is_beyond(at(from, to, *step)))?;
    let ends = (at(from, to, first.saturating_sub(1)), at(from, to, first));
    Some(halved(ends, HALVINGS, is_beyond).1)
}

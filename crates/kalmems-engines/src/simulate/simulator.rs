//! The motion of a device under a drive.

use super::Drive;
use kalmems_core::{Dynamics, Mat, Nodes, NoiseDensity, Process, Rk4};

/// Integrates a device's motion by the Runge–Kutta method of fourth order, in steps of one interval.
///
/// The drive is computed at the ends and the middle of each step, and a step in which it jumps is cut there. Times
/// are counted, not added up.
///
/// ```
/// use kalmems_engines::simulate::{Drive, Simulator};
/// use kalmems_models::dynamics::Duffing;
/// // An undamped swing of 1 kHz at 100 steps per cycle comes back to where it was.
/// let rate = std::f64::consts::TAU * 1e3;
/// let spring = Duffing { damping: 0.0, stiffness: rate * rate, cubic: 0.0, gain: 0.0 };
/// let mut simulator = Simulator::new(spring, Drive::Constant { level: 0.0 }, 1e5, [1.0, 0.0]);
/// for _ in 0..100 {
///     simulator.step();
/// }
/// assert!((simulator.time_s() - 1e-3).abs() < 1e-15);
/// assert!((simulator.state()[0] - 1.0).abs() < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct Simulator<D, const N: usize> {
    dynamics: D,
    drive: Drive,
    rate_hz: f64,
    whole: Rk4<D, f64, N>,
    state: [f64; N],
    steps: u64,
}

impl<D: Dynamics<f64, N, Input = f64> + Copy, const N: usize> Simulator<D, N> {
    /// From a state at 0 s, in `rate_hz` steps per second.
    pub fn new(dynamics: D, drive: Drive, rate_hz: f64, start: [f64; N]) -> Self {
        Self { dynamics, drive, rate_hz, whole: over(dynamics, 1.0 / rate_hz), state: start, steps: 0 }
    }

    /// The time that is reached.
    pub fn time_s(&self) -> f64 {
        self.steps as f64 / self.rate_hz
    }

    /// The state there.
    pub fn state(&self) -> &[f64; N] {
        &self.state
    }

    /// The drive there, in V.
    pub fn drive(&self) -> f64 {
        self.drive.at(self.time_s())
    }

    /// One step on.
    pub fn step(&mut self) {
        self.step_with(Process::step);
    }

    /// One step on, and the derivative of its end by its start.
    pub fn linearized_step(&mut self) -> Mat<f64, N, N> {
        let mut transition = Mat::identity();
        self.step_with(|process, state, nodes| {
            let (next, jacobian) = process.linearize(state, nodes);
            transition = jacobian.times(&transition);
            next
        });
        transition
    }

    fn step_with(&mut self, mut advance: impl FnMut(&Rk4<D, f64, N>, &[f64; N], &Nodes<f64>) -> [f64; N]) {
        let (from_s, to_s) = (self.time_s(), (self.steps + 1) as f64 / self.rate_hz);
        let (dynamics, whole, state) = (self.dynamics, &self.whole, &mut self.state);
        self.drive.parts(from_s, to_s, &mut |start, end, nodes| {
            *state = if start == from_s && end == to_s {
                advance(whole, state, nodes)
            } else {
                advance(&over(dynamics, end - start), state, nodes)
            };
        });
        self.steps += 1;
    }
}

fn over<D: Dynamics<f64, N, Input = f64>, const N: usize>(dynamics: D, interval_s: f64) -> Rk4<D, f64, N> {
    Rk4::new(dynamics, interval_s, &NoiseDensity::none(), (&[0.0; N], &0.0))
}

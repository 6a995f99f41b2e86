//! What a simulated device did a constant time ago.

use std::collections::VecDeque;

/// The state of a device that is being integrated, a constant number of steps ago, between the steps by a cubic.
///
/// Before its first step the device was where it starts.
pub struct DelayedState<const N: usize> {
    /// The newest last; as many as the cubic reaches back.
    states: VecDeque<[f64; N]>,
    /// Those of the oldest states, the oldest first.
    weights: [f64; 4],
}

impl<const N: usize> DelayedState<N> {
    /// So many steps back, 0 or more.
    pub fn new(start: &[f64; N], steps: f64) -> Self {
        if steps == 0.0 {
            return Self { states: VecDeque::from([*start]), weights: [1.0, 0.0, 0.0, 0.0] };
        }
        // Four states around the time wanted, which lies between the second and the third where there is a later one.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
        let reach = (steps as usize + 2).max(3);
        let at = reach as f64 - steps;
        let weights = std::array::from_fn(|i| {
            let i = i as f64;
            (0..4).map(f64::from).filter(|j| *j != i).map(|j| (at - j) / (i - j)).product()
        });
        Self { states: VecDeque::from(vec![*start; reach + 1]), weights }
    }

    /// A step further.
    pub fn push(&mut self, state: &[f64; N]) {
        self.states.pop_front();
        self.states.push_back(*state);
    }

    /// The state that long ago.
    pub fn state(&self) -> [f64; N] {
        std::array::from_fn(|i| self.states.iter().zip(self.weights).map(|(state, w)| w * state[i]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_read_exactly_and_a_start_is_held() {
        let cubic = |t: f64| 3.0 - t + 0.5 * t * t - 0.02 * t * t * t;
        for steps in [0.0, 0.3, 1.0, 1.6, 2.0, 7.0, 29.25] {
            let mut past = DelayedState::new(&[cubic(0.0), -1.0], steps);
            for k in 1..60 {
                past.push(&[cubic(f64::from(k)), f64::from(k) - 1.0]);
                let [first, second] = past.state();
                let then = f64::from(k) - steps;
                if then >= 3.0 {
                    assert!(
                        (first - cubic(then)).abs() < 1e-12 * cubic(60.0).abs(),
                        "{steps} steps before {k}"
                    );
                    assert!((second - (then - 1.0)).abs() < 1e-12);
                } else if then <= -2.0 {
                    assert_eq!(second, -1.0);
                }
            }
        }
    }
}

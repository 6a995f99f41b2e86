//! What the first filter of a stream that claims an uncertainty says last: the answer of a stream, which has no end to look back from.

use crate::estimate::{Trajectory, TrajectoryKind};
use crate::inspect::quantity;
use crate::results::{shown_for_people, value_and_sd};
use crate::units::kind;

/// The state that describes an oscillation.
const AMPLITUDE: &str = "amplitude";

/// The last estimate of a quantity.
#[derive(Clone, Debug)]
pub(super) struct LastEstimate {
    filter: String,
    quantity: &'static str,
    unit: &'static str,
    is_angle: bool,
    time_s: f64,
    mean: f64,
    sd: f64,
}

impl LastEstimate {
    /// Takes what the filters say of the next samples; of the first one that claims an uncertainty the amplitude, if it has one, else its first state.
    pub(super) fn take(last: &mut Option<Self>, trajectories: &[Trajectory]) {
        let claims = |one: &&Trajectory| one.kind == TrajectoryKind::Filtered && one.claims();
        let Some(trajectory) = trajectories.iter().find(claims) else { return };
        let Some(state) = trajectory.state(AMPLITUDE).or_else(|| trajectory.states.first()) else { return };
        let numbers = state.mean.iter().zip(&state.sd).zip(&trajectory.time_s);
        let Some(((mean, sd), time_s)) = numbers.rev().find(|((mean, _), _)| mean.is_finite()) else {
            return;
        };
        let known = last.get_or_insert_with(|| Self {
            filter: trajectory.name.clone(),
            quantity: state.name,
            unit: state.unit,
            is_angle: state.unit == "rad" || state.kind.name == kind::ANGLE.name,
            time_s: f64::NAN,
            mean: f64::NAN,
            sd: f64::NAN,
        });
        (known.time_s, known.mean, known.sd) = (*time_s, *mean, *sd);
    }

    /// `amplitude: 8.921 deg at 24 ms, ± 0.011 deg (one standard deviation, claimed by EKF)`.
    pub(super) fn sentence(&self) -> String {
        let (unit, factor) = shown_for_people(self.unit, self.is_angle);
        let [value, sd] = value_and_sd(self.mean * factor, self.sd * factor, &unit);
        format!(
            "{}: {value} at {}, ± {sd} (one standard deviation, claimed by {})",
            self.quantity.replace('_', " "),
            quantity(self.time_s, "s"),
            self.filter
        )
    }
}

//! The signs of angles that no signal tells, as an experiment states them.

use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{ConfigError, ConfigFault, Estimate, Experiment, ExtremeSign, Key};
use crate::estimate::{AnswerPast, SegmentPart, StatedSign, Trajectory};

/// The sign of one angle: which one it is, its rate, the states and the quantities that change their signs with it.
#[derive(Clone, Debug)]
pub struct AngleSign {
    axis: usize,
    rate: usize,
    states: Vec<usize>,
    quantities: Vec<usize>,
    is_positive: bool,
}

impl AngleSign {
    /// Those that an experiment states: `first_peak` of the first angle of the table `angles`, `first_peak_y` of the second.
    pub fn stated(
        experiment: &Experiment,
        estimate: &Estimate,
        (own, table): (&OwnDevice, &EquationsTable),
    ) -> Result<Vec<Self>, ConfigError> {
        let stated = [("first_peak", estimate.first_peak), ("first_peak_y", estimate.first_peak_y)];
        let stated = stated.into_iter().enumerate();
        let mut all = Vec::new();
        for (axis, name, sign) in stated.filter_map(|(axis, (name, sign))| Some((axis, name, sign?))) {
            let is_positive = sign == ExtremeSign::Positive;
            let one = Self::of(own, table, (axis, is_positive)).map_err(|why| {
                experiment.error(Key::from("estimate").child(name), ConfigFault::Value { why })
            })?;
            all.push(one);
        }
        Ok(all)
    }

    fn of(
        own: &OwnDevice,
        table: &EquationsTable,
        (axis, is_positive): (usize, bool),
    ) -> Result<Self, String> {
        let device = &own.device;
        let named = table.angles.iter().nth(axis);
        let states = named.and_then(|(angle, rate)| Some([device.state(angle)?, device.state(rate.trim())?]));
        let Some([angle, rate]) = states else {
            return Err("it is the sign of an angle: name the state and its rate in `[device.equations.angles]`, such as `angle = \"rate\"`, \
                        or leave it out"
                .to_owned());
        };
        let Some(states) = own.hidden_signs.iter().find(|group| group.contains(&angle)) else {
            return Err("the signal of this device says itself which way it moves; leave it out".to_owned());
        };
        let mut quantities = Vec::new();
        for (place, sign) in device.signs_of_quantities(states).into_iter().enumerate() {
            let Some(sign) = sign else {
                let name =
                    device.quantities().get(place).map_or_else(String::new, |named| named.name.to_string());
                return Err(format!(
                    "of the mirrored motion the quantity `{name}` is another one, neither the same nor the opposite; leave one of both out"
                ));
            };
            quantities.extend((sign < 0.0).then_some(place));
        }
        Ok(Self { axis, rate, states: states.clone(), quantities, is_positive })
    }

    /// The same in a trajectory, behind whose states the quantities stand.
    fn in_trajectory(&self, trajectory: &Trajectory) -> StatedSign {
        let quantities = self.quantities.iter().map(|place| trajectory.own_states + place);
        let states = self.states.iter().copied().chain(quantities).collect();
        StatedSign { axis: self.axis, rate: self.rate, states, is_positive: self.is_positive }
    }
}

/// Gives an answer the signs that are stated, by the first turning point of each angle behind a time in s of its own; what is not stated stays hidden,
/// for the states and for the quantities that follow from them.
pub fn orient(
    trajectory: &mut Trajectory,
    (own, signs): (&OwnDevice, &[AngleSign]),
    past: &mut AnswerPast,
    peaks_s: &[f64],
) {
    trajectory.periods.clone_from(&own.periods);
    trajectory.hidden_turns.clone_from(&own.hidden_turns);
    for sign in signs {
        let stated = sign.in_trajectory(trajectory);
        if let Some(peak_s) = peaks_s.get(sign.axis).or(peaks_s.last()) {
            past.orient(trajectory, &stated, *peak_s);
        }
    }
    let is_open = |(group, _): &(&Vec<usize>, &Vec<usize>)| signs.iter().all(|sign| sign.states != **group);
    let with_quantities = |(group, odd): (&Vec<usize>, &Vec<usize>)| {
        let mut here = trajectory.states.iter().enumerate().skip(trajectory.own_states);
        let named = odd.iter().filter_map(|place| own.device.quantities().get(*place));
        let quantities = named.filter_map(|named| here.find(|(_, state)| state.name == &*named.name));
        group.iter().copied().chain(quantities.map(|(place, _)| place)).collect()
    };
    let all = own.hidden_signs.iter().zip(&own.odd_quantities);
    trajectory.hidden_signs = all.filter(is_open).map(with_quantities).collect();
}

/// What has to be known of the sign of a motion that was calibrated for the first stretch of a record, in a later one.
pub fn sign_after_restart(part: &SegmentPart, is_calibrated: bool) -> Vec<String> {
    if !(is_calibrated && part.begins && part.segment.stretch.number > 1) {
        return Vec::new();
    }
    vec![
        "the sign of the motion is taken from `estimate.first_peak` anew in this stretch; it was calibrated for the first one, \
         and behind a gap the motion may have the other sign"
            .to_owned(),
    ]
}

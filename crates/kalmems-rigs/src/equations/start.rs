//! Where a filter starts that takes its start from the signal.

use super::course::EquationCourse;
use super::filter_task::EquationFilterTask;
use super::model::EquationModel;
use super::own_device::{OwnDevice, modes_of};
use crate::estimate::{
    BatchStart, EstimateError, HiddenSwing, MeanAndCovariance, SignalStart, StartAgain, StartSearch,
    StatePrior, TurnedStates, rows_for_start, rows_to_start_again, start_again_from_signal,
    start_from_signal,
};
use kalmems_equations::{MOST_STATES, Mode, shape};
use std::f64::consts::TAU;

/// A mode is an oscillation whose phase a start can have where its rate is this part of its size at least.
const OSCILLATES: f64 = 0.3;
/// Oscillations whose phases are sought; the amplitudes of the faster ones follow by themselves.
const MOST_SHAPES: usize = 3;
/// The difference of two rates of axes that are alike, relative to them.
const ALIKE: f64 = 1e-9;

/// The modes of a device where a search begins: a resonance that is a state is where the file says that it is.
struct FreeMotion {
    /// The slopes of the rates there, row by row.
    linear: Vec<f64>,
    modes: Vec<Mode>,
}

impl FreeMotion {
    fn about(own: &OwnDevice, prior: &[StatePrior]) -> Self {
        let states = own.device.states().len();
        let about: Vec<f64> = prior.iter().take(states).map(|prior| prior.mean).collect();
        let mut linear = own.linear_about(&about);
        // A state whose size is known need not be found from the signal: how it goes does not say how long a start is looked for.
        for (place, slope) in linear.iter_mut().enumerate() {
            if own.sized.contains(&(place / states)) || own.sized.contains(&(place % states)) {
                *slope = 0.0;
            }
        }
        let modes = modes_of(&linear, states);
        Self { linear, modes }
    }

    fn oscillating(&self) -> impl Iterator<Item = &Mode> {
        self.modes.iter().filter(|mode| mode.rate > OSCILLATES * mode.size())
    }
}

/// The period of its slowest free oscillation in s, or, without one, how long a state that comes round takes where the search begins, or
/// else its longest time constant.
fn cycle_s(own: &OwnDevice, prior: &[StatePrior]) -> f64 {
    let free = FreeMotion::about(own, prior);
    let period_s = free.oscillating().map(|mode| TAU / mode.rate).fold(0.0, f64::max);
    let decays = free.modes.iter().map(Mode::size).filter(|size| *size > 0.0);
    if period_s > 0.0 {
        return period_s;
    }
    turn_s(own, prior).unwrap_or_else(|| decays.map(f64::recip).fold(0.0, f64::max))
}

/// How long the slowest of the states that come round takes for a turn where the search begins, where one moves there.
fn turn_s(own: &OwnDevice, prior: &[StatePrior]) -> Option<f64> {
    let motion = &own.motion;
    let at: Vec<f64> = prior.iter().take(own.device.states().len()).map(|prior| prior.mean).collect();
    let mut rates = vec![0.0; at.len()];
    motion.rates(&mut motion.work(&own.values), &at, &vec![0.0; own.device.inputs().len()], &mut rates);
    let turns = own.periods.iter().filter_map(|(state, period)| {
        let turn_s = period / rates.get(*state)?.abs();
        turn_s.is_finite().then_some(turn_s)
    });
    turns.reduce(f64::max)
}

/// The rows that are looked at, at most, and one behind them.
pub fn most_rows((own, prior): (&OwnDevice, &[StatePrior]), interval_s: f64) -> usize {
    rows_for_start((cycle_s(own, prior), interval_s), own.device.states().len())
}

/// A shape of a free oscillation, and what the generator of each hidden turn makes of it: that is one as well, with the same rate.
fn with_turned(shape: [Vec<f64>; 2], turns: &[Vec<TurnedStates>]) -> Vec<[Vec<f64>; 2]> {
    let generated = |turn: &Vec<TurnedStates>| {
        shape.each_ref().map(|part| {
            let mut turned = vec![0.0; part.len()];
            for TurnedStates { places: [first, second], rate } in turn {
                if let (Some(a), Some(b)) = (part.get(*first), part.get(*second))
                    && first != second
                {
                    (turned[*first], turned[*second]) = (-rate * b, rate * a);
                }
            }
            turned
        })
    };
    let turned: Vec<[Vec<f64>; 2]> = turns.iter().map(generated).collect();
    std::iter::once(shape).chain(turned).collect()
}

/// What the search knows of a device and of a filter's states.
fn search(own: &OwnDevice, prior: Vec<StatePrior>) -> StartSearch {
    let states = own.device.states().len();
    let mut search = StartSearch { prior, ..StartSearch::default() };
    search.periods.clone_from(&own.periods);
    let free = FreeMotion::about(own, &search.prior);
    let mut slowest: Vec<&Mode> = free.oscillating().collect();
    slowest.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    if !own.hidden_turns.is_empty() {
        // Axes that are alike have one rate, and one of its shapes is found.
        slowest.dedup_by(|a, b| (a.rate - b.rate).abs() <= ALIKE * b.rate);
    }
    let shapes = slowest.into_iter().take(MOST_SHAPES);
    let shapes = shapes.filter_map(|mode| shape(&free.linear, states, mode));
    search.shapes = shapes.flat_map(|shape| with_turned(shape, &own.hidden_turns)).collect();
    search.turns.clone_from(&own.hidden_turns);
    let known: Vec<(usize, usize)> = own.motion.sparsity().collect();
    let own_states = own.device.own_states().min(states);
    // Of signs that no signal tells either is taken: an experiment states it afterwards, or it is said to be arbitrary.
    search.hidden.clone_from(&own.hidden_signs);
    search.mirrored = groups(own_states, &known);
    search.mirrored.retain(|group| {
        let is_own = |hidden: &&Vec<usize>| hidden.iter().filter(|state| **state < own_states).eq(group);
        !search.hidden.iter().any(|hidden| is_own(&hidden))
    });
    search
}

/// How a filter that has lost the signal is started again, by what is known of its states before.
pub struct LaterStart {
    cycle_s: f64,
    search: StartSearch,
}

impl LaterStart {
    pub fn of(own: &OwnDevice, prior: Vec<StatePrior>) -> Self {
        Self { cycle_s: cycle_s(own, &prior), search: search(own, prior) }
    }

    /// The rows that it is started again by.
    pub fn rows(&self, own: &OwnDevice, interval_s: f64) -> usize {
        rows_to_start_again((self.cycle_s, interval_s), own.device.states().len())
    }
}

/// States that depend on each other both ways, such as a displacement and its rate: what may have another sign together.
pub fn groups(states: usize, hangs_on: &[(usize, usize)]) -> Vec<Vec<usize>> {
    let mut reaches = [[false; MOST_STATES]; MOST_STATES];
    for (row, column) in hangs_on.iter().filter(|(row, column)| *row < states && *column < states) {
        reaches[*row][*column] = true;
    }
    for through in 0..states {
        for i in 0..states {
            for j in 0..states {
                reaches[i][j] |= reaches[i][through] && reaches[through][j];
            }
        }
    }
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (state, reached) in reaches.iter().enumerate().take(states) {
        let other = groups.iter_mut().find(|group| reached[group[0]] && reaches[group[0]][state]);
        match other {
            Some(group) => group.push(state),
            None => groups.push(vec![state]),
        }
    }
    groups
}

impl EquationFilterTask<'_> {
    /// The start of one of the filter's models from the signal; `None` where the file states one.
    pub fn start(
        &self,
        model: &EquationModel,
        channels: &[usize],
        steps: usize,
    ) -> Result<Option<BatchStart>, EstimateError> {
        if let Some(sine) = self.sine {
            return self.start_of_sine(sine, (model, channels, steps));
        }
        let Some(prior) = self.filter.prior() else { return Ok(None) };
        let cycle_s = cycle_s(self.own, &prior);
        let mut search = search(self.own, prior);
        search.seeds = self.shown_start()?.into_iter().collect();
        let states = self.filter.basics.states(self.own.states());
        let of = SignalStart {
            place: self.data.place,
            basics: &self.filter.basics,
            states: (&states, self.own.device.states().len()),
            sizes: &[],
            cycle_s,
        };
        let mut course = EquationCourse::new(model, (self.data, &self.own.between), (channels, &[]), steps);
        start_from_signal(&mut course, &self.data.samples, &search, of).map(Some)
    }
}

impl EquationFilterTask<'_> {
    /// How a filter on one of its models is started again where it has lost the signal.
    ///
    /// Where the file states where it starts nothing is known of a later start, but of parameters.
    pub fn start_again<'b>(
        &'b self,
        model: &'b EquationModel,
        channels: &'b [usize],
        steps: usize,
    ) -> Option<StartAgain<'b>> {
        if let Some(sine) = self.sine {
            return self.start_sine_again(sine, (model, channels, steps));
        }
        let basics = &self.filter.basics;
        let later = self.filter.later_start();
        let rows = later.rows(self.own, self.data.samples.interval_s);
        let rule = basics.reacquisition(self.data.motion.frequency_hz, self.data.start_s, rows)?;
        Some(StartAgain::by(rule, move |rows, held| {
            let behind_s = self.data.time_s.get(rows.end).copied()?;
            let of = (self.data, &*self.own.between);
            let mut course = EquationCourse::new(model, of, (channels, &[]), steps);
            let found = start_again_from_signal(&mut course, rows, &later.search, &basics.readout)?;
            Some(self.with_the_signs_before(found, behind_s, held))
        }))
    }

    /// What is known at a time in s, with the signs that the swings had before which no signal tells: a drive holds the phases of the motion, and so its signs.
    fn with_the_signs_before(
        &self,
        mut known: MeanAndCovariance,
        time_s: f64,
        held: (f64, &[f64]),
    ) -> MeanAndCovariance {
        if !self.data.motion.is_driven {
            return known;
        }
        for ([angle, rate], motion_hz) in self.own.swinging_angles().into_iter().zip(self.motions_hz()) {
            let hidden = self.own.hidden_signs.iter().find(|group| group.contains(&angle));
            let Some(mirrored) = hidden.filter(|group| !self.own.comes_round(group)) else { continue };
            let swing = HiddenSwing { states: [angle, rate], rate: TAU * motion_hz, mirrored };
            known = swing.with_the_sign_before(known, time_s, held);
        }
        known
    }

    /// The state of the first sample as the lines of several axes in the signal show it, where the table says what they mean. Of an axis that stands still every
    /// small motion has the same likelihood: that is refused.
    fn shown_start(&self) -> Result<Option<Vec<f64>>, EstimateError> {
        let (Some(_), Some(first_s)) = (self.data.sines, self.data.time_s.first()) else { return Ok(None) };
        let shown = self.first_swings(&[]).map_err(|why| EstimateError::NoStart {
            place: self.data.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why: why.to_string(),
        })?;
        Ok(shown.map(|swings| {
            let mut state = self.own.rest.clone();
            for (axis, swing) in self.own.axes.iter().zip(swings) {
                for (place, value) in axis.states.into_iter().zip(swing.at(*first_s)) {
                    state[place] = value;
                }
            }
            state
        }))
    }
}

/// How a course goes on behind a start from the signal.
pub fn start_of(all: &[Option<BatchStart>], index: usize) -> Option<&BatchStart> {
    all.get(index).and_then(Option::as_ref)
}

//! Where a filter starts that takes its start from the signal.

use super::course::EquationCourse;
use super::model::EquationModel;
use super::segment::OneFilter;
use super::settings::OwnDevice;
use super::short;
use crate::estimate::{Around, BatchStart, EstimateError, NoBatchStart, Prior, StartSearch, batch_start};
use kalmems_equations::{MOST_STATES, Mode, shape};
use std::f64::consts::TAU;

/// Periods of the slowest free oscillation that the start is first sought in.
const PERIODS: f64 = 3.0;
/// A mode is an oscillation whose phase a start can have where its rate is this part of its size at least.
const OSCILLATES: f64 = 0.3;
/// Oscillations whose phases are sought; the amplitudes of the faster ones follow by themselves.
const MOST_SHAPES: usize = 3;
/// The first rows are doubled so often where they do not tell the start.
const DOUBLINGS: u32 = 2;
/// Samples for each state, at least.
const SAMPLES_PER_STATE: usize = 20;

fn oscillating(own: &OwnDevice) -> impl Iterator<Item = &Mode> {
    own.modes.iter().filter(|mode| mode.rate > OSCILLATES * mode.size())
}

/// The rows that a start is first sought in, at this interval in s.
fn first_rows(own: &OwnDevice, interval_s: f64) -> usize {
    let period_s = oscillating(own).map(|mode| TAU / mode.rate).fold(0.0, f64::max);
    let decays = own.modes.iter().map(Mode::size).filter(|size| *size > 0.0);
    let longest_s = if period_s > 0.0 { period_s } else { decays.map(f64::recip).fold(0.0, f64::max) };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, saturating
    let rows = (PERIODS * longest_s / interval_s).ceil() as usize;
    rows.clamp(SAMPLES_PER_STATE * own.device.states().len(), Around::LONGEST_HEAD >> (DOUBLINGS + 1))
}

/// The rows that are looked at, at most, and one behind them.
pub fn most_rows(own: &OwnDevice, interval_s: f64) -> usize {
    (first_rows(own, interval_s) << DOUBLINGS) + 1
}

/// What the search knows of a device and of a filter's states.
fn search(own: &OwnDevice, prior: Vec<Prior>) -> StartSearch {
    let states = own.device.states().len();
    let mut search = StartSearch { prior, ..StartSearch::default() };
    search.periods = own.device.periods(&own.values).unwrap_or_default();
    let Ok(motion) = own.device.motion(&[]) else { return search };
    let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
    let inputs = vec![0.0; own.device.inputs().len()];
    motion.linearize(&mut motion.work(&own.values), &own.rest, &inputs, &mut rates, &mut jacobian);
    let mut slowest: Vec<&Mode> = oscillating(own).collect();
    slowest.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    let shapes = slowest.into_iter().take(MOST_SHAPES);
    search.shapes = shapes.filter_map(|mode| shape(&jacobian, states, mode)).collect();
    let known: Vec<(usize, usize)> = motion.sparsity().collect();
    search.mirrored = groups(own.device.own_states().min(states), &known);
    search
}

/// States that hang on each other both ways, such as a displacement and its rate: what may have another sign together.
fn groups(states: usize, hangs_on: &[(usize, usize)]) -> Vec<Vec<usize>> {
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

impl OneFilter<'_> {
    /// The start of one of the filter's models from the signal; `None` where the file states one.
    pub fn start(
        &self,
        model: &EquationModel,
        channels: &[usize],
        steps: usize,
    ) -> Result<Option<BatchStart>, EstimateError> {
        let Some(prior) = self.filter.prior(self.own) else { return Ok(None) };
        let search = search(self.own, prior);
        let fresh = &self.data.samples.fresh;
        let first = first_rows(self.own, self.data.samples.interval_s);
        let mut course = EquationCourse::new(model, (self.data, &self.own.between), (channels, &[]), steps);
        let mut why = NoBatchStart::NotFitted;
        let mut until = fresh.start;
        for doubling in 0..=DOUBLINGS {
            let end = (fresh.start + (first << doubling)).min(fresh.end);
            if end == until {
                break;
            }
            until = end;
            match batch_start(&mut course, fresh.start..end, &search) {
                Ok(start) => return Ok(Some(start)),
                Err(found) => why = found,
            }
        }
        let lasting_s = self.data.time_s[until.saturating_sub(1)] - self.data.time_s[fresh.start];
        Err(EstimateError::NoStart {
            place: self.data.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why: self.told(&why, lasting_s),
        })
    }

    /// Why there is no start, in words.
    fn told(&self, why: &NoBatchStart, lasting_s: f64) -> String {
        let states = self.filter.basics.states(&self.own.states());
        let name = |place: &usize| states.get(*place).map_or("?", |(name, ..)| name);
        let lasting = short(lasting_s);
        match why {
            NoBatchStart::NotFitted => format!(
                "no motion of the device was found that its first {lasting} s follow from; the inputs, the noise or the device are not \
                 as described"
            ),
            NoBatchStart::Undetermined(lost) => {
                let names: Vec<String> = lost.iter().map(|place| format!("`{}`", name(place))).collect();
                format!(
                    "its first {lasting} s do not tell {}; say in `start_sd` how far from rest that may be",
                    names.join(" and ")
                )
            }
            NoBatchStart::Ambiguous(both) => {
                let text = |start: &Vec<f64>| {
                    let own = start.iter().zip(&states).take(self.own.device.own_states());
                    let each: Vec<String> = own
                        .map(|(value, (name, _, kind))| {
                            format!("{name} = \"{value:.4e} {}\"", kind.dimension)
                        })
                        .collect();
                    format!("`{{ {} }}`", each.join(", "))
                };
                let [one, other] = both.each_ref().map(text);
                format!(
                    "its first {lasting} s follow equally well from {one} and from {other}, which is for you to decide"
                )
            }
        }
    }
}

/// How a course goes on behind a start from the signal.
pub fn start_of(all: &[Option<BatchStart>], index: usize) -> Option<&BatchStart> {
    all.get(index).and_then(Option::as_ref)
}

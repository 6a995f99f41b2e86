//! A filter that takes its start from the first samples of its way.

use super::engine::{Course, DerivedQuantities, Filtering, held_course};
use super::signal_watch::ALARM;
use super::{
    AnyKnownStateStep, BatchStart, EstimateError, FilterBasics, MeanAndCovariance, NoBatchStart,
    Reacquisition, ReadoutState, RowsAround, SampleCounts, SampleSelection, StartSearch, StateName,
    StatePrior, Trajectory, WithReadout, batch_start,
};
use kalmems_core::{FilterError, Innovation, Portable};
use std::ops::Range;

/// Cycles of the slowest motion that the start is first sought in.
const CYCLES: f64 = 3.0;
/// The first rows are doubled so often where they do not tell the start.
const DOUBLINGS: u32 = 2;
/// Samples for each state, at least.
const SAMPLES_PER_STATE: usize = 20;

/// The rows that a start is first sought in, of a motion with this cycle in s and so many states.
fn first_rows((cycle_s, interval_s): (f64, f64), states: usize) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, saturating
    let rows = (CYCLES * cycle_s / interval_s).ceil() as usize;
    rows.clamp(SAMPLES_PER_STATE * states.max(1), RowsAround::LONGEST_HEAD >> (DOUBLINGS + 1))
}

/// The rows that [`start_from_signal`] looks at, at most, and one behind them: what an estimator's first part has to have.
pub fn rows_for_start(motion: (f64, f64), states: usize) -> usize {
    (first_rows(motion, states) << DOUBLINGS) + 1
}

/// Rows that a filter is started again by, at most: each block of a stream has them before it.
const MOST_AGAIN: usize = 8192;

/// The rows that a filter is started again by that has lost its signal, of a motion with this cycle in s, this interval in s and so many states:
/// an estimator has to have them before its new rows.
pub fn rows_to_start_again(motion: (f64, f64), states: usize) -> usize {
    first_rows(motion, states).min(MOST_AGAIN)
}

/// What these rows of a course tell of the states at the row behind them, and of those of the readout; `None` where no motion of the device
/// explains them, be it that there is none or that the signal is not the device's.
pub fn start_again_from_signal(
    course: &mut dyn Course,
    rows: Range<usize>,
    search: &StartSearch,
    readout: &[ReadoutState],
) -> Option<MeanAndCovariance> {
    let search = StartSearch { tells_behind: true, ..search.clone() };
    let found = batch_start_with(course, rows, &search, readout).ok();
    found.filter(|found| found.mean_square <= ALARM)?.behind
}

/// [`batch_start`] with these states of the readout behind those of the motion.
pub fn batch_start_with(
    course: &mut dyn Course,
    rows: Range<usize>,
    search: &StartSearch,
    readout: &[ReadoutState],
) -> Result<BatchStart, NoBatchStart> {
    if readout.is_empty() {
        return batch_start(course, rows, search);
    }
    batch_start(&mut WithReadout::new(course, readout), rows, search)
}

/// A swing of a device whose signal is the same for both signs of it.
#[derive(Clone, Copy, Debug)]
pub struct HiddenSwing<'a> {
    /// The places of its angle and of the rate of that.
    pub states: [usize; 2],
    /// How fast a drive lets it swing, in rad/s.
    pub rate: f64,
    /// The states that change their signs with it.
    pub mirrored: &'a [usize],
}

impl HiddenSwing<'_> {
    /// Gives what is known at a time in s the sign that the swing had when it was known at another time in s.
    pub fn with_the_sign_before(
        &self,
        known: MeanAndCovariance,
        time_s: f64,
        (held_s, held): (f64, &[f64]),
    ) -> MeanAndCovariance {
        let of = |states: &[f64]| -> Option<[f64; 2]> {
            let [angle, rate] = self.states;
            Some([*states.get(angle)?, *states.get(rate)? / self.rate])
        };
        let (Some([angle, velocity]), Some([found, found_velocity])) = (of(held), of(&known.mean)) else {
            return known;
        };
        let (sine, cosine) = (self.rate * (time_s - held_s)).portable_sin_cos();
        let expected = [angle * cosine + velocity * sine, velocity * cosine - angle * sine];
        let has_the_other = expected[0] * found + expected[1] * found_velocity < 0.0;
        if has_the_other { known.mirrored(self.mirrored) } else { known }
    }
}

/// How a filter of a course is started again.
pub struct StartAgain<'a> {
    rule: Reacquisition,
    seek: Box<dyn StartSearcher + 'a>,
}

/// Seeks a start in rows, with the time in s and the state at which the signal was not lost yet: what is known at the row behind these rows.
trait StartSearcher: FnMut(Range<usize>, (f64, &[f64])) -> Option<MeanAndCovariance> {}

impl<F: FnMut(Range<usize>, (f64, &[f64])) -> Option<MeanAndCovariance>> StartSearcher for F {}

impl<'a> StartAgain<'a> {
    /// By this rule; `seek` is given the rows, and the time in s and the state at which the signal was not lost yet, and tells what is known at the
    /// row behind these rows.
    pub fn by(
        rule: Reacquisition,
        seek: impl FnMut(Range<usize>, (f64, &[f64])) -> Option<MeanAndCovariance> + 'a,
    ) -> Self {
        Self { rule, seek: Box::new(seek) }
    }
}

/// Of which filter a start is sought, and what is said where there is none.
#[derive(Clone, Copy, Debug)]
pub struct SignalStart<'a> {
    /// The recording and its segment.
    pub place: &'a str,
    /// The filter.
    pub basics: &'a FilterBasics,
    /// Its states, and how many of them are the motion's own.
    pub states: (&'a [StateName], usize),
    /// The unit of each state in SI, where they are not in SI.
    pub sizes: &'a [f64],
    /// One cycle of the slowest motion in s.
    pub cycle_s: f64,
}

/// The start of a filter by the first rows of a course that the first fresh ones of a segment are: see [`batch_start`].
///
/// Three cycles are looked at, and twice and four times as many where they do not tell it.
pub fn start_from_signal(
    course: &mut dyn Course,
    samples: &SampleSelection,
    search: &StartSearch,
    of: SignalStart,
) -> Result<BatchStart, EstimateError> {
    if of.basics.readout.is_empty() {
        return sought(course, samples, search, of);
    }
    sought(&mut WithReadout::new(course, &of.basics.readout), samples, search, of)
}

fn sought(
    course: &mut dyn Course,
    samples: &SampleSelection,
    search: &StartSearch,
    of: SignalStart,
) -> Result<BatchStart, EstimateError> {
    let SampleSelection { ref fresh, interval_s, .. } = *samples;
    let first = first_rows((of.cycle_s, interval_s), of.states.1);
    let mut why = NoBatchStart::NotFitted;
    let mut until = fresh.start;
    for doubling in 0..=DOUBLINGS {
        let end = (fresh.start + (first << doubling)).min(fresh.end);
        if end == until {
            break;
        }
        until = end;
        match batch_start(course, fresh.start..end, search) {
            Ok(start) => return Ok(start),
            Err(found) => why = found,
        }
    }
    let time_s = course.time_s();
    let at = |row: usize| time_s.get(row).copied().unwrap_or(f64::NAN);
    let lasting_s = at(until.saturating_sub(1)) - at(fresh.start);
    Err(EstimateError::NoStart {
        place: of.place.to_owned(),
        filter: of.basics.name.clone(),
        why: why.told(of, lasting_s),
    })
}

impl NoBatchStart {
    /// In words, after this time in s.
    fn told(&self, of: SignalStart, lasting_s: f64) -> String {
        let (states, own) = of.states;
        let behind = of.basics.readout.iter().map(ReadoutState::name);
        let states: Vec<StateName> = states.iter().copied().chain(behind).collect();
        let size = |place: usize| of.sizes.get(place).copied().unwrap_or(1.0);
        let name = |place: &usize| states.get(*place).map_or("?", |(name, ..)| name);
        let lasting = kalmems_figures::significant(lasting_s);
        match self {
            Self::NotFitted => format!(
                "no motion of the device was found that its first {lasting} s follow from; the inputs, the noise or the device are not \
                 as described"
            ),
            Self::Undetermined(lost) => {
                let names: Vec<String> = lost.iter().map(|place| format!("`{}`", name(place))).collect();
                format!(
                    "its first {lasting} s do not tell {}; say in `start_sd` how far from rest that may be",
                    names.join(" and ")
                )
            }
            Self::TooManyStates { states, most } => format!(
                "it would have {states} states, and a start from the signal is found for at most {most}; state `start` and `start_sd`"
            ),
            Self::Ambiguous(both) => {
                let text = |start: &Vec<f64>| {
                    let each: Vec<String> = (start.iter().zip(&states).take(own).enumerate())
                        .map(|(place, (value, (name, _, kind)))| {
                            format!("{name} = \"{:.4e} {}\"", value * size(place), kind.dimension)
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

impl FilterBasics {
    /// What is known before the first sample of its states behind those of the motion: of parameters, and of the readout.
    pub fn priors(&self) -> impl Iterator<Item = StatePrior> + '_ {
        let parameters =
            self.parameters().iter().map(|tracked| StatePrior { mean: 0.0, sd: Some(tracked.sd) });
        parameters.chain(self.readout.iter().map(ReadoutState::prior))
    }
}

/// Goes on from a start, where one was found and no other part has been before.
pub fn begun(left: Option<MeanAndCovariance>, start: Option<&BatchStart>) -> Option<MeanAndCovariance> {
    left.or_else(|| start.map(|start| start.first.clone()))
}

/// A course whose first samples have told the start of the filter: they do not correct it a second time, and behind them it is at what they
/// say, noise of the motion included.
pub struct StartedCourse<'a, C> {
    course: C,
    /// How the filter is started again, where it is.
    again: Option<StartAgain<'a>>,
    /// The row from which on samples correct the filter, and what is known there, where that is not what a prediction says.
    begins: Option<(usize, Option<AnyKnownStateStep>)>,
    /// What stands for the innovations of further signals before.
    none: Vec<[f64; 2]>,
    /// Whether the sample before was not used.
    is_silent: bool,
}

impl<'a, C: Course> StartedCourse<'a, C> {
    /// Of this course; nothing of it is changed where there is no start.
    pub fn new(course: C, start: Option<&BatchStart>) -> Self {
        let started = start.map(|start| (start.row, start.behind.as_ref().map(AnyKnownStateStep::from)));
        let none = if started.is_some() {
            vec![[f64::NAN; 2]; course.signals().len().saturating_sub(1)]
        } else {
            Vec::new()
        };
        Self { course, again: None, begins: started, none, is_silent: false }
    }

    /// The same, on which a filter that has lost its signal is started again so, where that is told.
    #[must_use]
    pub fn starting_again(self, again: Option<StartAgain<'a>>) -> Self {
        Self { again, ..self }
    }

    /// The course itself.
    pub fn into_inner(self) -> C {
        self.course
    }
}

impl<C: Course> Course for StartedCourse<'_, C> {
    held_course!();

    fn further_innovations(&self) -> &[[f64; 2]] {
        if self.is_silent { &self.none } else { self.course.further_innovations() }
    }

    fn predict_phases(&mut self, filter: &dyn Filtering, k: usize) {
        self.course.predict_phases(filter, k);
    }

    fn reacquisition(&self) -> Option<Reacquisition> {
        self.again.as_ref().map(|again| again.rule)
    }

    fn start_again(&mut self, row: usize, held: (f64, &[f64])) -> Option<MeanAndCovariance> {
        let again = self.again.as_mut()?;
        let first = row.checked_sub(again.rule.rows)?;
        (again.seek)(first..row, held)
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        self.course.advance(filter, to, counts)?;
        match &self.begins {
            Some((row, Some(known))) if *row == to => filter.take_over(known),
            _ => Ok(()),
        }
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        self.is_silent = self.begins.as_ref().is_some_and(|(row, _)| k < *row);
        if self.is_silent {
            counts.for_start += 1;
            return Ok(None);
        }
        self.course.correct(filter, k, counts)
    }
}

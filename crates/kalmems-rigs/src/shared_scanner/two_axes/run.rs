//! A filter on its way through a segment, for whichever model it has.

use crate::config::Method;
use crate::estimate::driven::{DrivenCourse, DrivenSegment, HYBRID_STEPS, Plant};
use crate::estimate::{
    AnyFilter, BatchStart, Course, EstimateError, FilterBasics, FilterPast, MeanAndCovariance, Reacquisition,
    StartAgain, StartedCourse, StateName, Trajectory, answers_of_bank, begun, follow,
};
use crate::progress::Progress;
use std::ops::Range;

/// How a start is sought again.
pub struct SearchAgain<'a> {
    /// When, by which rows.
    pub rule: Reacquisition,
    /// On a course, in these rows, with the time in s and the state at which the signal was not lost yet: what is known at the row behind them.
    #[allow(clippy::type_complexity)] // the rows and the state of one search
    pub seek: Box<dyn Fn(&mut dyn Course, Range<usize>, (f64, &[f64])) -> Option<MeanAndCovariance> + 'a>,
}

/// A filter on its way through a segment.
pub struct TwoAxisFilterRun<'a> {
    /// The filter.
    pub filter: &'a FilterBasics,
    /// The segment.
    pub data: &'a DrivenSegment<'a>,
    /// The variance of the signal's noise per sample, in V².
    pub noise_variance: f64,
    /// Where it says how far it has come.
    pub progress: &'a dyn Progress,
    /// Where it starts, or each model of a bank does, where all of the first samples say that.
    pub starts: Vec<Option<BatchStart>>,
    /// How its start is sought again where it has lost the signal.
    pub again: Option<SearchAgain<'a>>,
}

impl TwoAxisFilterRun<'_> {
    /// Likewise, from a start that all of the first samples have told.
    #[must_use]
    pub fn started(self, start: Option<BatchStart>) -> Self {
        Self { starts: vec![start], ..self }
    }

    /// The start of the model with this place.
    fn start(&self, model: usize) -> Option<&BatchStart> {
        self.starts.get(model).and_then(Option::as_ref)
    }

    /// Follows the filter, at first from what `start` says.
    pub fn run<P: Plant>(
        &self,
        plant: &P,
        states: &[StateName],
        past: &mut FilterPast,
        start: impl FnOnce() -> Result<MeanAndCovariance, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let mut trajectories = self.follow(plant, states, past, |left| self.filter.begin(left, start))?;
        if self.filter.method == Method::Model {
            trajectories.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(trajectories)
    }

    /// Follows a filter for each of these models side by side, and what they say together.
    pub fn bank<P: Plant>(
        &self,
        plants: &[P],
        states: &[StateName],
        past: &mut FilterPast,
        start: impl Fn() -> Result<MeanAndCovariance, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = |(model, plant)| -> Result<Box<dyn Course + '_>, EstimateError> {
            let course = DrivenCourse::new(plant, self.noise_variance, self.data);
            let course = course.map_err(|why| self.filter.no_model(why))?;
            Ok(Box::new(StartedCourse::new(course, self.start(model))))
        };
        let courses = plants.iter().enumerate().map(course).collect::<Result<Vec<_>, _>>()?;
        let way = (courses, &self.data.samples);
        let start = |model| begun(None, self.start(model)).map_or_else(&start, Ok);
        answers_of_bank((self.filter, past), start, way, states, self.progress)
    }

    /// Follows the filter that `begin` makes.
    pub fn follow<P: Plant>(
        &self,
        plant: &P,
        states: &[StateName],
        past: &mut FilterPast,
        begin: impl FnOnce(Option<MeanAndCovariance>) -> Result<AnyFilter, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = DrivenCourse::new(plant, self.noise_variance, self.data);
        let course = match self.filter.method {
            Method::HybridEkf => course.and_then(|course| course.in_steps(HYBRID_STEPS)),
            _ => course,
        };
        let course = course.map_err(|why| self.filter.no_model(why))?;
        // An observer forgets its start.
        let corrects = self.filter.gain().is_none();
        let course = StartedCourse::new(course, self.start(0).filter(|_| corrects));
        let again = self.again.as_ref().map(|again| {
            StartAgain::by(again.rule, |rows, held| {
                let mut course = DrivenCourse::new(plant, self.noise_variance, self.data).ok()?;
                (again.seek)(&mut course, rows, held)
            })
        });
        let mut course = course.starting_again(again);
        let begin = |left| begin(begun(left, self.start(0)));
        follow((self.filter, past), begin, (&mut course, &self.data.samples), states, self.progress)
    }
}

//! Several models of one device side by side.

use super::any_filter::AnyFilter;
use super::engine::Filtering;
use super::gate::SampleGate;
use super::step_watch::plan_steps;
use super::transition::{Sensor, Transition};
use super::{
    AnyKnownStateStep, Course, DerivedQuantities, EstimateError, FilterBasics, FilterPast, MeanAndCovariance,
    SampleCounts, SampleSelection, SignalName, StateName, Trajectory, follow,
};
use crate::progress::Progress;
use kalmems_core::Portable;
use kalmems_core::{FilterError, Innovation};

/// The most models side by side: three values of each of three parameters.
pub const MOST_MODELS: usize = 27;

/// Takes a filter for each of these models through new samples, side by side along the course of each: the trajectory of what
/// they say together, each weighed by the likelihood of the samples.
///
/// They go on where the past left them; `start` says what the model of each index knows at the first sample of the segment.
pub fn answers_of_bank(
    (filter, past): (&FilterBasics, &mut FilterPast),
    start: impl Fn(usize) -> Result<MeanAndCovariance, EstimateError>,
    (mut courses, samples): (Vec<Box<dyn Course + '_>>, &SampleSelection),
    states: &[StateName],
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    // What steps the first model needs, the others need as well.
    if filter.steps.is_none()
        && past.steps.is_none()
        && let Some(first) = courses.first_mut()
    {
        let watch = past.watch(filter, (first.time_s(), samples));
        let known = start(0)?;
        let one = || filter.begin(Some(known.clone()), || Ok(MeanAndCovariance::default())).ok();
        let one = || one().map(|filter| filter.watching_steps(watch.clone()));
        past.steps = Some(plan_steps(&one, &mut **first, samples));
    }
    if let Some(steps) = filter.steps.or(past.steps) {
        for course in &mut courses {
            course.divide(steps);
        }
    }
    let models = if let Some(models) = past.bank.take() {
        models
    } else {
        let member = |model| filter.begin(past.left().cloned(), || start(model));
        let members = (0..courses.len()).map(member).collect::<Result<_, _>>()?;
        let time_s = courses.first().map_or(&[][..], |course| course.time_s());
        BankFilters::new(members, &past.watch(filter, (time_s, samples)))
    };
    let mut bank = BankCourse::new(courses, models);
    let begin = |left| filter.begin(left, || start(0));
    let told = follow((filter, past), begin, (&mut bank, samples), states, progress);
    past.bank = Some(bank.models);
    told
}

/// The filters of all models on their way, and how likely each is; kept from one part of a segment to the next.
pub(super) struct BankFilters {
    filters: Vec<Box<dyn Filtering + Send>>,
    log_weights: Vec<f64>,
}

impl BankFilters {
    /// All equally likely at first.
    fn new(filters: Vec<AnyFilter>, watch: &SampleGate) -> Self {
        let log_weights = vec![-(filters.len() as f64).portable_ln(); filters.len()];
        let on_its_way = |filter: AnyFilter| filter.on_its_way(watch.clone());
        Self { filters: filters.into_iter().map(on_its_way).collect(), log_weights }
    }

    /// The likeliest one, by its place.
    fn likeliest(&self) -> usize {
        let places = self.log_weights.iter().enumerate();
        places.max_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(place, _)| place)
    }

    /// The mixture of what all of them know, over the given storage: Σ w·x, and Σ w·(P + (x − x̄)(x − x̄)ᵀ).
    fn mix(&self, mean: &mut [f64], covariance: &mut [f64], of_one: &mut [f64]) {
        let n = mean.len();
        mean.fill(0.0);
        covariance.fill(0.0);
        let members =
            || self.filters.iter().zip(&self.log_weights).map(|(filter, l)| (filter, l.portable_exp()));
        for (filter, weight) in members() {
            mean.iter_mut().zip(filter.mean()).for_each(|(mean, x)| *mean += weight * x);
        }
        for (filter, weight) in members() {
            filter.covariance(of_one);
            let apart = |i: usize| filter.mean()[i] - mean[i];
            for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                covariance[i * n + j] += weight * (of_one[i * n + j] + apart(i) * apart(j));
            }
        }
    }

    /// ln p of a sample, of all its signals, by the mixture; `None` where none was taken.
    fn log_density(&mut self) -> Option<f64> {
        let weighted = |(filter, weight): (&mut Box<dyn Filtering + Send>, &f64)| {
            Some(weight + filter.watch()?.log_density()?)
        };
        let densities = self.filters.iter_mut().zip(&self.log_weights).map(weighted);
        densities.collect::<Option<Vec<f64>>>().map(|densities| log_sum(&densities))
    }

    /// Weighs them by the likelihood of what was taken of a sample.
    fn weigh(&mut self) {
        let of = |filter: &mut Box<dyn Filtering + Send>| {
            filter.watch().map_or(0.0, |watch| watch.taken_log_likelihood())
        };
        let mut is_told = false;
        for (weight, filter) in self.log_weights.iter_mut().zip(&mut self.filters) {
            let more = of(filter);
            is_told |= more != 0.0;
            *weight += more;
        }
        if is_told {
            let total = log_sum(&self.log_weights);
            self.log_weights.iter_mut().for_each(|l| *l -= total);
        }
    }
}

/// ln Σ eˡ.
fn log_sum(all: &[f64]) -> f64 {
    let largest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    largest + all.iter().map(|l| (l - largest).portable_exp()).sum::<f64>().portable_ln()
}

/// A bank on its way through a segment: a course for each model. The filter that is led through it takes over what the bank
/// says; it is one that holds a covariance, not a root.
struct BankCourse<'a> {
    courses: Vec<Box<dyn Course + 'a>>,
    models: BankFilters,
    mean: Vec<f64>,
    covariance: Vec<f64>,
    /// Room for the covariance of one model.
    of_one: Vec<f64>,
    innovations: Vec<Innovation<f64, 1>>,
    /// Innovation and standard deviation of the mixture by each signal after the first one.
    further: Vec<[f64; 2]>,
    /// How likely each model is by the signals of a sample so far.
    log_weights: Vec<f64>,
}

impl<'a> BankCourse<'a> {
    /// Along the course of each model, from where the models were left.
    fn new(courses: Vec<Box<dyn Course + 'a>>, models: BankFilters) -> Self {
        let states = models.filters.first().map_or(0, |filter| filter.mean().len());
        let square = vec![0.0; states * states];
        let (covariance, of_one) = (square.clone(), square);
        let (mean, log_weights) = (vec![0.0; states], models.log_weights.clone());
        let (innovations, further) = (Vec::new(), Vec::new());
        Self { courses, models, mean, covariance, of_one, innovations, further, log_weights }
    }

    /// Mixes the innovations of the signals after the first one, each with the weights that the signals before it leave.
    fn mix_further(&mut self) {
        self.further.clear();
        let signals = self.courses.first().map_or(0, |course| course.further_innovations().len());
        if signals == 0 {
            return;
        }
        self.log_weights.clone_from(&self.models.log_weights);
        if self.innovations.len() == self.courses.len() && self.innovations.iter().all(|one| one.taken) {
            let each = self.log_weights.iter_mut().zip(&self.innovations);
            each.for_each(|(weight, one)| *weight += one.log_likelihood());
        }
        for signal in 0..signals {
            let total = log_sum(&self.log_weights);
            let of = |course: &dyn Course| course.further_innovations().get(signal).copied();
            let found = || {
                let models = self.courses.iter().zip(&self.log_weights);
                models.filter_map(|(course, l)| Some((of(&**course)?, (l - total).portable_exp())))
            };
            let residual: f64 = found().map(|([one, _], w)| w * one).sum();
            let variance: f64 = found().map(|([one, sd], w)| w * (sd * sd + (one - residual).powi(2))).sum();
            self.further.push([residual, variance.sqrt()]);
            if residual.is_finite() {
                for (course, weight) in self.courses.iter().zip(&mut self.log_weights) {
                    if let Some([one, sd]) = of(&**course) {
                        *weight -= 0.5 * (one / sd).powi(2) + sd.portable_ln();
                    }
                }
            }
        }
    }

    /// Corrects the likeliest model, whose gate decides for all of them: weights would not be those of one set of samples otherwise.
    fn correct_leader(
        &mut self,
        leader: usize,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let Some(member) = self.models.filters.get_mut(leader) else { return Ok(None) };
        if let (Some(watch), Some(led)) = (member.watch(), filter.watch()) {
            watch.lead(led);
        }
        let innovation = self.courses[leader].correct(&mut **member, k, counts)?;
        if let (Some(watch), Some(led)) = (member.watch(), filter.watch()) {
            led.adopt_decisions(watch);
        }
        Ok(innovation)
    }

    /// Puts the led filter where the bank is.
    fn lead(&mut self, filter: &mut dyn Filtering) -> Result<(), FilterError> {
        self.models.mix(&mut self.mean, &mut self.covariance, &mut self.of_one);
        filter.predict(&Mixture { mean: &self.mean, covariance: &self.covariance })
    }
}

impl Course for BankCourse<'_> {
    fn time_s(&self) -> &[f64] {
        self.courses.first().map_or(&[], |course| course.time_s())
    }

    fn signal(&self) -> &[f64] {
        self.courses.first().map_or(&[], |course| course.signal())
    }

    fn signals(&self) -> Vec<SignalName> {
        self.courses.first().map_or_else(Vec::new, |course| course.signals())
    }

    fn further_innovations(&self) -> &[[f64; 2]] {
        &self.further
    }

    fn derived(&self) -> Option<DerivedQuantities> {
        self.courses.first().and_then(|course| course.derived())
    }

    /// All models begin again, equally likely.
    fn begin_again(
        &mut self,
        filter: &mut dyn Filtering,
        known: &AnyKnownStateStep,
    ) -> Result<(), FilterError> {
        for member in &mut self.models.filters {
            member.take_over(known)?;
        }
        let equally = -(self.models.filters.len() as f64).portable_ln();
        self.models.log_weights.fill(equally);
        self.lead(filter)
    }

    /// What is known of the whole is the mean over the models, each with its weight at the end: a mean of log-likelihoods, which is
    /// not above that of the mixture.
    fn conclude(&self, trajectory: &mut Trajectory) {
        let mut mean = 0.0;
        for (course, log_weight) in self.courses.iter().zip(&self.models.log_weights) {
            course.conclude(trajectory);
            mean += log_weight.portable_exp() * trajectory.crossings_log_likelihood;
        }
        trajectory.crossings_log_likelihood = mean;
    }

    /// What each model counts is the same.
    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let before = *counts;
        for (course, member) in self.courses.iter_mut().zip(&mut self.models.filters) {
            *counts = before;
            course.advance(&mut **member, to, counts)?;
        }
        self.lead(filter)
    }

    /// The innovation is that of the mixture; the models are weighed by all signals.
    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let before = *counts;
        let leader = self.models.likeliest();
        let of_leader = self.correct_leader(leader, filter, k, counts)?;
        self.innovations.clear();
        for (model, (course, member)) in self.courses.iter_mut().zip(&mut self.models.filters).enumerate() {
            if model == leader {
                self.innovations.extend(of_leader);
                continue;
            }
            if let (Some(watch), Some(led)) = (member.watch(), filter.watch()) {
                watch.follow_other(led);
            }
            *counts = before;
            self.innovations.extend(course.correct(&mut **member, k, counts)?);
        }
        self.mix_further();
        if let (Some(density), Some(led)) = (self.models.log_density(), filter.watch()) {
            led.set_log_density(density);
        }
        if self.innovations.len() < self.courses.len() {
            // Without the first signal; another one may have corrected them.
            self.models.weigh();
            return self.lead(filter).map(|()| None);
        }
        let weights = || self.models.log_weights.iter().map(|l| l.portable_exp());
        let found = || self.innovations.iter().zip(weights());
        let residual: f64 = found().map(|(one, w)| w * one.residual[0]).sum();
        let spread =
            |one: &Innovation<f64, 1>| one.covariance.get(0, 0) + (one.residual[0] - residual).powi(2);
        let variance: f64 = found().map(|(one, w)| w * spread(one)).sum();
        // As a filter says it that knows its state exactly and takes all of that for noise.
        let mut innovation = filter.update_within(&ZeroMeasurement, residual, variance, NEVER)?;
        innovation.taken = self.innovations.iter().all(|one| one.taken);
        self.models.weigh();
        self.lead(filter)?;
        Ok(Some(innovation))
    }
}

/// A normalised innovation squared that no innovation is below.
const NEVER: f64 = -1.0;

/// Expects nothing, whatever the state is.
struct ZeroMeasurement;

impl Sensor for ZeroMeasurement {
    fn read(&self, _: &[f64]) -> f64 {
        0.0
    }

    fn linearize(&self, _: &[f64], slopes: &mut [f64]) -> f64 {
        slopes.fill(0.0);
        0.0
    }
}

/// A step to what the bank knows, whatever was before; without a root, which the led filter does not ask for.
struct Mixture<'a> {
    mean: &'a [f64],
    covariance: &'a [f64],
}

impl Transition for Mixture<'_> {
    fn advance(&self, _: &[f64], to: &mut [f64]) {
        to.copy_from_slice(self.mean);
    }

    fn linearize(&self, _: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        to.copy_from_slice(self.mean);
        jacobian.fill(0.0);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        covariance.copy_from_slice(self.covariance);
        root.fill(0.0);
    }
}

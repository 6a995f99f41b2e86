//! A filter that is chosen when the program runs, and so is its number of states.

use super::answers::{AnswerRun, FilterRunStart};
use super::engine::Filtering;
use super::gate::SampleGate;
use super::linked::LinkedFilter;
use super::over_rows::{RowFilter, SizedRowFilter};
use super::solved_gain::{continuous_gain, settled_gain};
use super::transition::{Sensor, SensorMeasurement, Transition, TransitionProcess};
use super::{ConstantGain, GainOf, ModelAlone, ParameterCorrelation, StateName};
use crate::config::Method;
use kalmems_core::Portable;
use kalmems_core::filter::Pole;
use kalmems_core::update::Gate;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, FixedGain, Gaussian, Innovation, IteratedEkf, Mat, OperatingPoint,
    SchmidtEkf, SigmaPoints, SquareRootEkf, SquareRootUkf, StateTransition, Ukf,
};
use std::f64::consts::PI;

/// A filter of `N` states, of whatever kind.
///
/// A filter of the core dissolves into the loop that it is used in. That is what makes it fast, and what takes long to
/// compile where every filter meets every model in every loop. Behind this it is compiled once for each number of states;
/// a step costs about ten calls by a table.
pub trait StateFilter<const N: usize>: Send {
    /// What it knows of the state.
    fn known(&self) -> Gaussian<f64, N>;

    /// The mean of that.
    fn mean(&self) -> [f64; N];

    /// Moves the state by one step.
    fn step(&mut self, transition: &dyn Transition) -> Result<StateTransition<f64, N>, FilterError>;

    /// Corrects the state with a sample `y` of this noise variance, where its NIS is not above the largest that is believed.
    fn correct(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError>;

    /// Another one that is as this one.
    fn copied(&self) -> Box<dyn StateFilter<N>>;
}

impl<F: Filter<f64, N> + Clone + Send + 'static, const N: usize> StateFilter<N> for F {
    fn known(&self) -> Gaussian<f64, N> {
        Gaussian::from(self)
    }

    fn mean(&self) -> [f64; N] {
        *Filter::mean(self)
    }

    fn step(&mut self, transition: &dyn Transition) -> Result<StateTransition<f64, N>, FilterError> {
        self.predict_linked(&TransitionProcess::<N>::of(transition), &())
    }

    fn correct(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let variance = Covariance::from_variances([variance]);
        self.update_where(&SensorMeasurement(sensor), &[y], &variance, &Gate { nis: largest_nis })
    }

    fn copied(&self) -> Box<dyn StateFilter<N>> {
        Box::new(self.clone())
    }
}

/// Mean and covariance of any number of states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeanAndCovariance {
    /// The mean.
    pub mean: Vec<f64>,
    /// The lower triangle of the covariance, row by row.
    pub lower: Vec<f64>,
}

impl MeanAndCovariance {
    /// Uncorrelated states, each with its mean and its standard deviation.
    pub fn apart(states: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let (mean, sd): (Vec<f64>, Vec<f64>) = states.into_iter().unzip();
        let lower = (0..mean.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let lower = lower.map(|(i, j)| if i == j { sd[i] * sd[i] } else { 0.0 }).collect();
        Self { mean, lower }
    }

    /// How the errors of some states hang together, by their names, pair by pair; nothing of one whose variance is zero.
    pub(super) fn correlations(
        &self,
        states: &[StateName],
        of: &[&'static str],
    ) -> Vec<ParameterCorrelation> {
        let place = |name: &str| states.iter().position(|(own, ..)| *own == name);
        let covariance = |i: usize, j: usize| {
            let (i, j) = (i.max(j), i.min(j));
            self.lower.get(i * (i + 1) / 2 + j).copied()
        };
        let mut all = Vec::new();
        for (k, second) in of.iter().enumerate() {
            for first in of.iter().take(k) {
                let (Some(i), Some(j)) = (place(first), place(second)) else { continue };
                let parts = (covariance(i, j), covariance(i, i), covariance(j, j));
                let (Some(both), Some(own), Some(other)) = parts else { continue };
                let correlation = both / (own * other).sqrt();
                if correlation.is_finite() {
                    all.push(ParameterCorrelation { names: [first, second], correlation });
                }
            }
        }
        all
    }

    /// The same with states behind them that are uncorrelated with all others.
    #[must_use]
    pub fn with(mut self, states: impl IntoIterator<Item = (f64, f64)>) -> Self {
        for (mean, sd) in states {
            self.lower.extend(self.mean.iter().map(|_| 0.0));
            self.lower.push(sd * sd);
            self.mean.push(mean);
        }
        self
    }

    /// The same with the state of this index, of this standard deviation and behind those it is correlated with, part of each of
    /// these: so much of it is added to each.
    pub fn correlate(&mut self, source: usize, parts: &[(usize, f64)], sd: f64) {
        let mut add = |i: usize, j: usize, value: f64| {
            if let Some(entry) = self.lower.get_mut(i * (i + 1) / 2 + j) {
                *entry += value;
            }
        };
        for (i, part) in parts {
            add(source, *i, part * sd * sd);
            for (j, other) in parts.iter().filter(|(j, _)| j <= i) {
                add(*i, *j, part * other * sd * sd);
            }
        }
    }

    /// The same with the other sign of these states.
    #[must_use]
    pub(super) fn mirrored(mut self, states: &[usize]) -> Self {
        for (_, mean) in self.mean.iter_mut().enumerate().filter(|(place, _)| states.contains(place)) {
            *mean = -*mean;
        }
        let places = (0..self.mean.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for (entry, (i, j)) in self.lower.iter_mut().zip(places) {
            if states.contains(&i) != states.contains(&j) {
                *entry = -*entry;
            }
        }
        self
    }

    /// As the core has them; what is missing is not a number.
    pub fn gaussian<const N: usize>(&self) -> Gaussian<f64, N> {
        let of = |values: &[f64], place: usize| values.get(place).copied().unwrap_or(f64::NAN);
        let lower = |i: usize, j: usize| if j <= i { of(&self.lower, i * (i + 1) / 2 + j) } else { 0.0 };
        Gaussian {
            mean: std::array::from_fn(|i| of(&self.mean, i)),
            covariance: Covariance::from_lower(Mat::from_fn(lower)),
        }
    }
}

impl<const N: usize> From<Gaussian<f64, N>> for MeanAndCovariance {
    fn from(Gaussian { mean, covariance }: Gaussian<f64, N>) -> Self {
        let lower = (0..N).flat_map(|i| (0..=i).map(move |j| (i, j)));
        Self { mean: mean.to_vec(), lower: lower.map(|(i, j)| covariance.get(i, j)).collect() }
    }
}

impl<const N: usize> From<([f64; N], Covariance<f64, N>)> for MeanAndCovariance {
    fn from((mean, covariance): ([f64; N], Covariance<f64, N>)) -> Self {
        Gaussian { mean, covariance }.into()
    }
}

/// Iterations that the iterated filter takes at most.
const ITERATIONS: usize = 10;

/// When the iterated filter has settled, in standard deviations.
const SETTLED: f64 = 1e-3;

/// How a filter of the core is made.
#[derive(Clone, Copy, Debug)]
pub struct FilterKind {
    /// Its method.
    pub method: Method,
    /// How it spreads sigma points.
    pub points: SigmaPoints<f64>,
    /// From which state on, where that is asked for, they are considered and not estimated.
    pub considered_from: usize,
}

impl FilterKind {
    /// The same of more states than [`MOST_OF_EVERY_METHOD`]; `None` for a method that is not compiled for so many.
    fn of_many<const N: usize>(self, known: &MeanAndCovariance) -> Option<Box<dyn StateFilter<N>>> {
        let Gaussian { mean, covariance } = known.gaussian::<N>();
        match self.method {
            Method::Model => Some(Box::new(ModelAlone::new(mean))),
            Method::SquareRootEkf => Some(Box::new(SquareRootEkf::new(mean, covariance))),
            Method::Ekf | Method::EulerEkf | Method::HybridEkf => Some(Box::new(Ekf::new(mean, covariance))),
            _ => None,
        }
    }

    /// From this mean and covariance; the extended filter for a method that is a matter of the process and not of the filter.
    fn from<const N: usize>(self, known: &MeanAndCovariance) -> Box<dyn StateFilter<N>> {
        let Gaussian { mean, covariance } = known.gaussian::<N>();
        match self.method {
            Method::Model => Box::new(ModelAlone::new(mean)),
            Method::IteratedEkf => Box::new(IteratedEkf::<_, N, ITERATIONS>::new(mean, covariance, SETTLED)),
            Method::SquareRootEkf => Box::new(SquareRootEkf::new(mean, covariance)),
            Method::Ukf => Box::new(Ukf::new(mean, covariance, self.points)),
            Method::SquareRootUkf => Box::new(SquareRootUkf::new(mean, covariance, self.points)),
            Method::ConsiderEkf => {
                let considered = std::array::from_fn(|i| i >= self.considered_from);
                Box::new(SchmidtEkf::new(mean, covariance, considered))
            }
            Method::Ekf
            | Method::EulerEkf
            | Method::LockIn
            | Method::DirectInversion
            | Method::HybridEkf
            | Method::SteadyState
            | Method::KalmanBucy
            | Method::Luenberger
            | Method::Bank => Box::new(Ekf::new(mean, covariance)),
        }
    }
}

fn constant_gain<const N: usize>(
    gain: (GainOf, f64),
    at: &MeanAndCovariance,
    start: &MeanAndCovariance,
    (transition, sensor, variance): (&dyn Transition, &dyn Sensor, f64),
) -> Result<ConstantGain<N>, String> {
    let (at, mean) = (at.gaussian::<N>().mean, start.gaussian::<N>().mean);
    let noise = Covariance::from_variances([variance]);
    let point = OperatingPoint::of(
        &TransitionProcess::<N>::of(transition),
        (&SensorMeasurement(sensor), noise),
        (&at, &()),
    );
    let gain = match gain {
        (GainOf::Settled, _) => {
            let gain = settled_gain(&point).map_err(|why| why.to_string())?;
            FixedGain::from_gain(mean, gain, &point).map_err(|why| why.to_string())?
        }
        (GainOf::Poles(corner), interval_s) => {
            let poles: Vec<Pole<f64>> =
                placed(N, corner, transition).map(|pole| pole.sampled(interval_s)).collect();
            FixedGain::luenberger(mean, &poles, &point).map_err(|why| why.to_string())?
        }
        (GainOf::Continuous, interval_s) => {
            let none = || "its motion is known from sample to sample alone; use `steady_state`".to_owned();
            let motion = transition.continuous().ok_or_else(none)?;
            // Over an interval h the gain P·Hᵀ/(R·h) adds P·Hᵀ/R of what a sample leaves.
            let gain = continuous_gain(&motion, &point.observation.0[0], variance * interval_s);
            let gain = gain.map_err(|why| why.to_string())?.scaled(interval_s);
            FixedGain::from_gain(mean, gain, &point).map_err(|why| why.to_string())?
        }
    };
    Ok(ConstantGain::new(&gain, &point))
}

/// The poles of an observer of this corner in rad/s: those of the motion itself that decay faster, which a gain could only slow, and for the rest a
/// Butterworth low-pass's.
fn placed(states: usize, corner: f64, transition: &dyn Transition) -> impl Iterator<Item = Pole<f64>> {
    let size = |pole: &Pole<f64>| if matches!(pole, Pole::Real(_)) { 1 } else { 2 };
    let decays = |pole: &Pole<f64>| match pole {
        Pole::Real(real) | Pole::Pair { real, .. } => -real > corner,
    };
    let own = transition.continuous().map_or_else(Vec::new, |motion| motion.poles);
    let own: Vec<Pole<f64>> = own.into_iter().filter(decays).collect();
    let taken: usize = own.iter().map(size).sum();
    own.into_iter().chain(butterworth(states.saturating_sub(taken), corner))
}

/// The poles of a Butterworth low-pass of this order and corner in rad/s.
pub fn butterworth(order: usize, corner: f64) -> impl Iterator<Item = Pole<f64>> {
    let pairs = (0..order / 2).map(move |k| {
        let angle = PI * (2 * k + 1) as f64 / (2 * order) as f64;
        Pole::Pair { real: -corner * angle.portable_sin(), imaginary: corner * angle.portable_cos() }
    });
    pairs.chain((order % 2 == 1).then_some(Pole::Real(-corner)))
}

/// What is written out for each number of states: the filters of the core know theirs when they are compiled, those of many states for a few
/// methods alone.
macro_rules! for_each_size {
    ($($variant:ident $states:literal)* ; $($large:ident $many:literal)*) => {
        /// The most states that a filter by any method can have.
        pub const MOST_OF_EVERY_METHOD: usize = { let sizes = [$($states),*]; sizes[sizes.len() - 1] };
        /// The most states that a filter can have.
        pub const MOST_STATES: usize = { let sizes = [$($many),*]; sizes[sizes.len() - 1] };

        /// A filter of as many states as there are.
        pub enum AnyFilter {
            $(
                #[doc = concat!("Of ", stringify!($states), ".")]
                $variant(Box<dyn StateFilter<$states>>),
            )*
            $(
                #[doc = concat!("Of ", stringify!($many), ".")]
                $large(Box<dyn StateFilter<$many>>),
            )*
        }

        $(
            impl From<Box<dyn StateFilter<$states>>> for AnyFilter {
                fn from(filter: Box<dyn StateFilter<$states>>) -> Self {
                    Self::$variant(filter)
                }
            }
        )*
        $(
            impl From<Box<dyn StateFilter<$many>>> for AnyFilter {
                fn from(filter: Box<dyn StateFilter<$many>>) -> Self {
                    Self::$large(filter)
                }
            }
        )*

        impl AnyFilter {
            /// This one.
            pub fn this<const N: usize>(filter: impl StateFilter<N> + 'static) -> Self
            where
                Self: From<Box<dyn StateFilter<N>>>,
            {
                let filter: Box<dyn StateFilter<N>> = Box::new(filter);
                filter.into()
            }

            /// The filter of a kind, from this mean and covariance; `None` for no states, for more than [`MOST_STATES`], and
            /// for a method that has no filter of so many.
            pub fn of(kind: FilterKind, known: &MeanAndCovariance) -> Option<Self> {
                match known.mean.len() {
                    $($states => Some(Self::$variant(kind.from::<$states>(known))),)*
                    $($many => kind.of_many::<$many>(known).map(Self::$large),)*
                    _ => None,
                }
            }

            /// A filter with one gain for all times: that for the model linearised at a mean, with poles sampled in this interval in s.
            pub fn of_constant_gain(
                gain: (GainOf, f64),
                (at, start): (&MeanAndCovariance, &MeanAndCovariance),
                (transition, sensor, variance): (&dyn Transition, &dyn Sensor, f64),
            ) -> Result<Self, String> {
                match start.mean.len() {
                    $($states => constant_gain::<$states>(gain, at, start, (transition, sensor, variance))
                        .map(|filter| Self::$variant(Box::new(filter))),)*
                    states => Err(format!("there is no constant gain of {states} states")),
                }
            }

            /// The gain of such a filter, for each state what it adds of an innovation, and the variance of that innovation.
            pub fn constant_gain_of(
                gain: (GainOf, f64),
                (at, start): (&MeanAndCovariance, &MeanAndCovariance),
                (transition, sensor, variance): (&dyn Transition, &dyn Sensor, f64),
            ) -> Result<(Vec<f64>, f64), String> {
                match start.mean.len() {
                    $($states => constant_gain::<$states>(gain, at, start, (transition, sensor, variance))
                        .map(|filter| {
                            let at = at.gaussian::<$states>().mean;
                            (filter.gain().to_vec(), filter.innovation_variance((&SensorMeasurement(sensor), &at), variance))
                        }),)*
                    states => Err(format!("there is no constant gain of {states} states")),
                }
            }

            /// As a course leads it, and how it takes its samples.
            pub(super) fn on_its_way(self, watch: SampleGate) -> Box<dyn Filtering + Send> {
                match self {
                    $(Self::$variant(filter) => Box::new(LinkedFilter::<$states>::new(filter, watch)),)*
                    $(Self::$large(filter) => Box::new(LinkedFilter::<$many>::new(filter, watch)),)*
                }
            }

            /// The same, with the error of its steps followed.
            pub(super) fn watching_steps(self, watch: SampleGate) -> Box<dyn Filtering> {
                match self {
                    $(Self::$variant(filter) => {
                        Box::new(LinkedFilter::<$states>::new(filter, watch).watching_steps(false))
                    })*
                    $(Self::$large(filter) => {
                        Box::new(LinkedFilter::<$many>::new(filter, watch).watching_steps(false))
                    })*
                }
            }

            /// Over rows of numbers, with so many of its steps kept for a smoother.
            pub fn over_rows(self, kept: usize) -> Box<dyn RowFilter> {
                match self {
                    $(Self::$variant(filter) => Box::new(SizedRowFilter::<$states>::new(filter, kept)),)*
                    $(Self::$large(filter) => Box::new(SizedRowFilter::<$many>::new(filter, kept)),)*
                }
            }

            /// Takes it on its way.
            pub(super) fn run(self, begun: FilterRunStart) -> Result<Box<dyn AnswerRun>, FilterError> {
                match self {
                    $(Self::$variant(filter) => begun.of::<$states>(filter),)*
                    $(Self::$large(filter) => begun.of::<$many>(filter),)*
                }
            }
        }
    };
}

for_each_size!(One 1 Two 2 Three 3 Four 4 Five 5 Six 6 Seven 7 Eight 8 Nine 9 Ten 10 Eleven 11 Twelve 12;
    Thirteen 13 Fourteen 14 Fifteen 15 Sixteen 16 Seventeen 17 Eighteen 18 Nineteen 19 Twenty 20 TwentyOne 21 TwentyTwo 22
    TwentyThree 23 TwentyFour 24);

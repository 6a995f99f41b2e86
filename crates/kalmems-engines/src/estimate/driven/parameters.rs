//! Parameters of a device that are states of a filter, as its models meet them.

use crate::estimate::{MOST_STATES, Parameter, Sensor, Tracked};
use kalmems_core::augmentation::{AddedState, AugmentationError, ParametricMeasurement};
use kalmems_core::{Dual, Measurement, Parameters};

/// The most parameters that a filter can have as states: of a motion with more there is no filter, which is refused before
/// any step.
pub const MOST_PARAMETERS: usize = MOST_STATES;

/// Which parameter of one model each state behind those of the motion enters.
pub(super) struct Places {
    /// The parameter's index, where it enters this model, and the state.
    states: Vec<(Option<usize>, AddedState<f64>)>,
}

impl Places {
    /// In a model of type `M`.
    pub(super) fn of<M: Parameters<f64>>(
        tracked: &[Tracked],
        place: fn(&Parameter) -> Option<&'static str>,
    ) -> Result<Self, AugmentationError> {
        let mut states: Vec<(Option<usize>, AddedState<f64>)> = Vec::new();
        for (state, tracked) in tracked.iter().take(MOST_PARAMETERS).enumerate() {
            tracked.added.check(state)?;
            let index = place(tracked.parameter)
                .map(|name| M::index_of(name).ok_or(AugmentationError::NoSuchParameter { state }))
                .transpose()?;
            let twice = states.iter().any(|(other, _)| index.is_some() && *other == index);
            if let Some(parameter) = index.filter(|_| twice).and_then(M::name) {
                return Err(AugmentationError::EnteredTwice { parameter, state });
            }
            states.push((index, tracked.added));
        }
        Ok(Self { states })
    }

    /// How many states there are.
    pub(super) fn count(&self) -> usize {
        self.states.len()
    }

    /// The value of a parameter with these deviations, which of them moves it, and how far one of that does; a scale of 0
    /// where none does.
    #[inline]
    pub(super) fn varied(&self, parameter: usize, nominal: f64, deviations: &[f64]) -> (usize, f64, f64) {
        for (i, (index, added)) in self.states.iter().enumerate() {
            if *index == Some(parameter) {
                return (i, added.scale, nominal + deviations[i] * added.scale);
            }
        }
        (0, 0.0, nominal)
    }

    /// How much of each deviation is left after an interval, and the variance that is added to it.
    pub(super) fn over(&self, interval_s: f64) -> [(f64, f64); MOST_PARAMETERS] {
        let mut all = [(1.0, 0.0); MOST_PARAMETERS];
        for (step, (_, added)) in all.iter_mut().zip(&self.states) {
            *step = added.drift.over(interval_s);
        }
        all
    }
}

/// A readout of `M` states and of parameters behind them.
pub struct ParametricReadout<H, const M: usize> {
    readout: H,
    places: Places,
}

impl<H: Parameters<f64>, const M: usize> ParametricReadout<H, M> {
    /// These parameters as states; `place` says where each enters.
    pub fn new(
        readout: H,
        tracked: &[Tracked],
        place: fn(&Parameter) -> Option<&'static str>,
    ) -> Result<Self, AugmentationError> {
        Ok(Self { places: Places::of::<H>(tracked, place)?, readout })
    }
}

impl<H: ParametricMeasurement<f64, M, 1>, const M: usize> ParametricReadout<H, M> {
    /// What is read, with the derivatives by the states from `first` on.
    #[inline(never)]
    fn columns<const W: usize>(&self, x: &[f64], first: usize, slopes: &mut [f64]) -> f64 {
        let variable = |i: usize, value: f64, slope: f64| {
            Dual::<f64, W>::new(value, std::array::from_fn(|k| if first + k == i { slope } else { 0.0 }))
        };
        let model = self.readout.map(|parameter, nominal| {
            let (i, scale, value) = self.places.varied(parameter, nominal, &x[M..]);
            variable(M + i, value, scale)
        });
        let [y] = H::predict_of(&model, &std::array::from_fn(|i| variable(i, x[i], 1.0)));
        for (entry, slope) in slopes[first..].iter_mut().zip(y.gradient()) {
            *entry = slope;
        }
        y.value()
    }
}

/// Derivatives of a readout that are computed at once.
const AT_ONCE: usize = 4;

impl<H: ParametricMeasurement<f64, M, 1>, const M: usize> Sensor for ParametricReadout<H, M> {
    #[inline(never)]
    fn read(&self, x: &[f64]) -> f64 {
        let model = self.readout.map(|parameter, nominal| self.places.varied(parameter, nominal, &x[M..]).2);
        let [y] = H::predict_of(&model, &std::array::from_fn(|i| x[i]));
        y
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let mut y = f64::NAN;
        for first in (0..x.len()).step_by(AT_ONCE) {
            y = self.columns::<AT_ONCE>(x, first, slopes);
        }
        y
    }
}

/// A readout of the first `M` states alone, whatever is behind them.
pub struct OfMotion<H, const M: usize>(pub H);

impl<H: Measurement<f64, M, 1>, const M: usize> Sensor for OfMotion<H, M> {
    #[inline(never)]
    fn read(&self, x: &[f64]) -> f64 {
        let [y] = self.0.predict(&std::array::from_fn(|i| x[i]));
        y
    }

    #[inline(never)]
    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let ([y], jacobian) = self.0.linearize(&std::array::from_fn(|i| x[i]));
        slopes.fill(0.0);
        slopes[..M].copy_from_slice(&jacobian.0[0]);
        y
    }
}

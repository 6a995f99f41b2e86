//! Smoothing while samples arrive.

use super::{Backward, Smoothed};
use crate::update::Policy;
use crate::{
    Covariance, Filter, FilterError, Gaussian, Innovation, NumericMeasurement, NumericProcess, Scalar,
    StateTransition,
};
use core::marker::PhantomData;

/// A filter that also says, after each sample, what the state was `LAG` samples ago.
///
/// It is a [`Filter`] itself: predictions and updates go through it to the filter inside. A prediction is a
/// step of the lag; the updates between two predictions belong to one sample, and there may be none, or
/// declined ones. The answer is that of the [fixed-interval smoother](super::smooth_interval) over all data
/// up to now. No allocation; the memory is `LAG` + 1 steps of 2·N² + 2·N numbers.
///
/// The `LAG` backward steps from now to then are not taken at each sample. Steps taken together are again a
/// step ([`Backward::after`]), and a window that slides over a sequence of such products needs, on average,
/// two products per sample whatever its length: one running product of the newer part, and products to the
/// end of the older part, made anew when the newer part has become `LAG` long (van Herk, Pattern Recognition
/// Letters 13, 517, 1992, for maxima). So [`smoothed`](Self::smoothed) takes two backward steps; the worst
/// sample, one in `LAG`, costs `LAG` products, about what a sweep would cost at every sample.
///
/// ```
/// use kalmems_core::smooth::FixedLag;
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, LinearProcess, Mat};
/// let walk = LinearProcess::<f64, 1, 0> {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([1.0]).into(),
/// };
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let start = Ekf::new([0.0], Covariance::from_variances([1.0]));
/// let mut filter = FixedLag::<f64, _, 1, 4>::new(start);
/// let mut smoothed = 0;
/// for k in 0..10 {
///     filter.predict(&walk, &[])?;
///     if k != 5 {
///         // Sample 5 is missing.
///         filter.update(&level, &[1.0], &Covariance::from_variances([2.0]))?;
///     }
///     smoothed += usize::from(filter.smoothed().is_some()); // the state of sample k − 4
/// }
/// // The first prediction led to sample 0; the state before it is one more.
/// assert_eq!(smoothed, 7);
/// // At the end the newer ones: 3, 2, 1 and 0 samples ago.
/// let rest = [3, 2, 1, 0].map(|lag| filter.lagged(lag).unwrap().mean[0]);
/// assert_eq!(rest[3], filter.mean()[0]);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy)]
pub struct FixedLag<T: Scalar, F, const N: usize, const LAG: usize> {
    filter: F,
    /// Before `newer`: single steps, newest last. From there on: products of a step with all after it.
    steps: [Backward<T, N>; LAG],
    /// How many single steps `steps` begins with.
    newer: usize,
    /// Their product.
    product: Option<Backward<T, N>>,
    /// How many steps there are in all, at most `LAG`.
    filled: usize,
    scalar: PhantomData<T>,
}

impl<T: Scalar, F, const N: usize, const LAG: usize> FixedLag<T, F, N, LAG> {
    /// Wraps a filter. Its present state is the first that can be asked for.
    pub fn new(filter: F) -> Self {
        let steps = [Backward::identity(); LAG];
        Self { filter, steps, newer: 0, product: None, filled: 0, scalar: PhantomData }
    }

    /// The filter inside.
    pub const fn filter(&self) -> &F {
        &self.filter
    }

    /// Takes in the step to a new sample, and forgets the oldest.
    #[inline(always)]
    fn push(&mut self, step: Backward<T, N>) {
        // The oldest product makes room, once there are LAG steps. Without a lag there is nothing to keep.
        let Some(place) = self.steps.get_mut(self.newer) else { return };
        *place = step;
        self.product = Some(match &self.product {
            Some(product) => product.after(&step),
            None => step,
        });
        self.newer += 1;
        if self.filled < LAG {
            self.filled += 1;
        }
        if self.newer == LAG {
            let mut later: Option<Backward<T, N>> = None;
            for step in self.steps.iter_mut().rev() {
                *step = match &later {
                    Some(later) => step.after(later),
                    None => *step,
                };
                later = Some(*step);
            }
            self.newer = 0;
            self.product = None;
        }
    }
}

impl<T: Scalar, F: Filter<T, N>, const N: usize, const LAG: usize> FixedLag<T, F, N, LAG> {
    /// The state `LAG` samples ago, given all measurements until now; `None` before there were so many
    /// predictions, or if the present covariance is not positive semi-definite.
    #[inline(always)]
    pub fn smoothed(&self) -> Option<Smoothed<T, N>> {
        self.lagged(LAG)
    }

    /// The state `lag` samples ago, at most `LAG`, given all measurements until now.
    ///
    /// Takes at most `lag` backward steps. At the end of a recording it gives the states that have not become
    /// `LAG` samples old.
    #[inline(always)]
    pub fn lagged(&self, lag: usize) -> Option<Smoothed<T, N>> {
        if lag > self.filled {
            return None;
        }
        let now = Gaussian { mean: *self.filter.mean(), covariance: self.filter.covariance() };
        let mut smoothed = Smoothed::newest(&now).ok()?;
        if lag <= self.newer {
            for step in self.steps.iter().take(self.newer).rev().take(lag) {
                smoothed = step.apply(&smoothed);
            }
            return Some(smoothed);
        }
        if let Some(product) = &self.product {
            smoothed = product.apply(&smoothed);
        }
        let older = self.steps.get(LAG - (lag - self.newer))?;
        Some(older.apply(&smoothed))
    }
}

impl<T: Scalar, F: Filter<T, N> + Clone, const N: usize, const LAG: usize> Filter<T, N>
    for FixedLag<T, F, N, LAG>
{
    #[inline(always)]
    fn mean(&self) -> &[T; N] {
        self.filter.mean()
    }

    #[inline(always)]
    fn covariance(&self) -> Covariance<T, N> {
        self.filter.covariance()
    }

    /// Moves the state by one step, which is one step of the lag. Refused as well where [`Backward::new`]
    /// refuses.
    #[inline(always)]
    fn predict_linked<P: NumericProcess<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<T, N>, FilterError> {
        let before = Gaussian { mean: *self.filter.mean(), covariance: self.filter.covariance() };
        let mut moved = self.filter.clone();
        let link = moved.predict_linked(process, u)?;
        let step = Backward::new(&before, &link, moved.mean())?;
        self.filter = moved;
        self.push(step);
        Ok(link)
    }

    #[inline(always)]
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        self.filter.update_where(measurement, y, r, policy)
    }
}

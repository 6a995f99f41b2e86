//! Smoothing a whole recording, in little memory.

use super::{Backward, Smoothed};
use crate::{FilterError, Gaussian, Scalar, StateTransition};
use core::fmt;

/// What happens to a filter at each sample of a recording, as often as it is asked.
///
/// A sample may be asked for again, in ascending order from any sample on, and must then do to the bit the
/// same. A missing sample corrects nothing; a policy may decline a correction. An error ends the smoothing.
///
/// [`smooth_interval`] shows one at work.
///
/// ```
/// use kalmems_core::smooth::SmoothingCourse;
/// use kalmems_core::{Covariance, Filter, FilterError, LinearMeasurement, LinearProcess, StateTransition, Mat};
/// /// A level that walks at random, some samples missing.
/// struct Recording<'a> {
///     walk: LinearProcess<f64, 1, 0>,
///     levels: &'a [Option<f64>],
/// }
/// impl<F: Filter<f64, 1>> SmoothingCourse<f64, F, 1> for Recording<'_> {
///     type Error = FilterError;
///     fn samples(&self) -> usize {
///         self.levels.len()
///     }
///     fn advance(&mut self, filter: &mut F, _: usize) -> Result<StateTransition<f64, 1>, FilterError> {
///         filter.predict_linked(&self.walk, &[])
///     }
///     fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
///         if let Some(level) = self.levels.get(sample).copied().flatten() {
///             let seen = LinearMeasurement { matrix: Mat([[1.0]]) };
///             filter.update(&seen, &[level], &Covariance::from_variances([1.0]))?;
///         }
///         Ok(())
///     }
/// }
/// ```
pub trait SmoothingCourse<T: Scalar, F, const N: usize> {
    /// Why a sample could not be processed.
    type Error;

    /// How many samples there are.
    fn samples(&self) -> usize;

    /// Moves the filter from sample `sample` − 1 to `sample`, which is at least 1.
    fn advance(&mut self, filter: &mut F, sample: usize) -> Result<StateTransition<T, N>, Self::Error>;

    /// Corrects the filter with what was measured at `sample`.
    fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), Self::Error>;
}

/// Why a recording could not be smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SmoothingError<E> {
    /// The course failed at a sample, or whoever took its smoothed state.
    Course {
        /// The sample.
        sample: usize,
        /// What it said.
        cause: E,
    },
    /// The step on from a sample, or the last state, has a covariance with a negative direction or is not
    /// finite.
    Step {
        /// The sample.
        sample: usize,
        /// What was refused.
        cause: FilterError,
    },
    /// Checkpoints times block are fewer than the samples.
    Storage {
        /// How many samples there are.
        samples: usize,
        /// For how many there is room.
        room: usize,
    },
}

impl<E: fmt::Display> fmt::Display for SmoothingError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Course { sample, cause } => write!(f, "sample {sample}: {cause}"),
            Self::Step { sample, cause } => write!(f, "the smoother's step at sample {sample}: {cause}"),
            Self::Storage { samples, room } => {
                write!(
                    f,
                    "{samples} samples, and room for {room}: more checkpoints or longer blocks are needed"
                )
            }
        }
    }
}

impl<E: core::error::Error> core::error::Error for SmoothingError<E> {}

/// Smooths all samples of a recording, from the last to the first, and hands each to `each`.
///
/// `start` is the filter as it is before the correction at sample 0. One forward pass leaves a copy of the
/// filter in `checkpoints` at the first sample of every block; then each block, the last first, is run
/// forward once more from its copy, its steps kept in `block`, and swept backward. With C checkpoints and
/// blocks of B samples, C·B ≥ n samples can be smoothed. The filter takes 2·n − B steps; about √n of each
/// need the least memory. What the storage held before does not matter. Of the filter nothing is asked but what it knows
/// of the state; every [`Filter`](crate::Filter) says that.
///
/// A recording that is held in memory is one block: one checkpoint, and a block of n, and the filter runs
/// once. The results are the same to the bit however the recording is divided.
///
/// ```
/// use kalmems_core::smooth::{Backward, SmoothingCourse, smooth_interval};
/// use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearMeasurement, LinearProcess, StateTransition, Mat};
/// /// Levels in memory, some missing, on a random walk.
/// struct Levels<'a>(&'a [Option<f64>], LinearProcess<f64, 1, 0>);
/// impl<F: Filter<f64, 1>> SmoothingCourse<f64, F, 1> for Levels<'_> {
///     type Error = FilterError;
///     fn samples(&self) -> usize {
///         self.0.len()
///     }
///     fn advance(&mut self, filter: &mut F, _: usize) -> Result<StateTransition<f64, 1>, FilterError> {
///         filter.predict_linked(&self.1, &[])
///     }
///     fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
///         let level = LinearMeasurement { matrix: Mat([[1.0]]) };
///         match self.0[sample] {
///             Some(y) => filter.update(&level, &[y], &Covariance::from_variances([1.0])).map(|_| ()),
///             None => Ok(()),
///         }
///     }
/// }
/// let walk = LinearProcess {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([0.1]).into(),
/// };
/// let start = Ekf::new([0.0], Covariance::from_variances([1e6]));
/// let mut levels = Levels(&[Some(1.0), None, Some(3.0)], walk);
/// let mut means = [0.0; 3];
/// smooth_interval(&start, &mut levels, &mut [start; 2], &mut [Backward::identity(); 2], |k, smoothed| {
///     means[k] = smoothed.mean[0];
///     Ok(())
/// })?;
/// assert!((means[1] - 2.0).abs() < 1e-5); // half-way
/// # Ok::<(), kalmems_core::smooth::SmoothingError<FilterError>>(())
/// ```
pub fn smooth_interval<T: Scalar, F: Clone, C: SmoothingCourse<T, F, N>, const N: usize>(
    start: &F,
    course: &mut C,
    checkpoints: &mut [F],
    block: &mut [Backward<T, N>],
    mut each: impl FnMut(usize, &Smoothed<T, N>) -> Result<(), C::Error>,
) -> Result<(), SmoothingError<C::Error>>
where
    Gaussian<T, N>: for<'a> From<&'a F>,
{
    let samples = course.samples();
    let room = checkpoints.len().saturating_mul(block.len());
    if room < samples {
        return Err(SmoothingError::Storage { samples, room });
    }
    let length = block.len();
    leave_checkpoints(start, course, checkpoints, length)?;

    let mut later: Option<Smoothed<T, N>> = None;
    let mut end = samples;
    for (index, checkpoint) in checkpoints.iter().enumerate().rev() {
        let first = index.saturating_mul(length);
        if first >= end {
            continue;
        }
        let mut filter = checkpoint.clone();
        for (step, sample) in block.iter_mut().zip(first..end) {
            let next = sample + 1;
            if next == samples {
                break;
            }
            let before = Gaussian::from(&filter);
            let link = course.advance(&mut filter, next).map_err(at(next))?;
            *step = Backward::new(&before, &link, &Gaussian::from(&filter).mean)
                .map_err(|cause| SmoothingError::Step { sample, cause })?;
            if next < end {
                course.correct(&mut filter, next).map_err(at(next))?;
            }
        }
        for (step, sample) in block.iter().zip(first..end).rev() {
            let smoothed = match &later {
                Some(later) => step.apply(later),
                None => Smoothed::newest(&Gaussian::from(&filter))
                    .map_err(|cause| SmoothingError::Step { sample, cause })?,
            };
            each(sample, &smoothed).map_err(at(sample))?;
            later = Some(smoothed);
        }
        end = first;
    }
    Ok(())
}

/// The first pass: a copy of the filter as it is after the first sample of each block.
fn leave_checkpoints<T: Scalar, F: Clone, C: SmoothingCourse<T, F, N>, const N: usize>(
    start: &F,
    course: &mut C,
    checkpoints: &mut [F],
    length: usize,
) -> Result<(), SmoothingError<C::Error>> {
    let samples = course.samples();
    let mut filter = start.clone();
    let mut sample = 0;
    for (index, checkpoint) in checkpoints.iter_mut().enumerate() {
        let first = index.saturating_mul(length);
        if first >= samples {
            break;
        }
        while sample <= first {
            if sample > 0 {
                course.advance(&mut filter, sample).map_err(at(sample))?;
            }
            course.correct(&mut filter, sample).map_err(at(sample))?;
            sample += 1;
        }
        *checkpoint = filter.clone();
    }
    Ok(())
}

fn at<E>(sample: usize) -> impl Fn(E) -> SmoothingError<E> {
    move |cause| SmoothingError::Course { sample, cause }
}

//! Measurements that come late, by going back to when they were made.

use core::fmt;

/// What a sample does to a filter, as often as it is asked.
///
/// It holds the models; what changes from sample to sample is the record. Replaying the same record on the
/// same filter must do to the bit the same. A record has room for what may come late, and says at what time
/// it belongs.
///
/// [`History`] shows one at work.
///
/// ```
/// use kalmems_core::update::Replay;
/// use kalmems_core::{Covariance, Filter, FilterError, LinearMeasurement, LinearProcess, Mat};
/// /// A level that walks at random; a record is what was seen of it, if anything.
/// struct Level(LinearProcess<f64, 1, 0>);
/// impl<F: Filter<f64, 1>> Replay<F> for Level {
///     type Record = Option<f64>;
///     type Error = FilterError;
///     fn replay(&self, filter: &mut F, seen: &Option<f64>) -> Result<(), FilterError> {
///         filter.predict(&self.0, &[])?;
///         if let Some(y) = seen {
///             let level = LinearMeasurement { matrix: Mat([[1.0]]) };
///             filter.update(&level, &[*y], &Covariance::from_variances([1.0]))?;
///         }
///         Ok(())
///     }
/// }
/// ```
pub trait Replay<F> {
    /// Inputs and measurements of one sample, those that may come late among them.
    type Record: Copy;
    /// Why a sample could not be processed.
    type Error;

    /// Moves the filter on to the sample and corrects it with what the record holds.
    fn replay(&self, filter: &mut F, record: &Self::Record) -> Result<(), Self::Error>;
}

/// A filter with its last `LAG` samples, so that a measurement can still be inserted where it belongs.
///
/// For each sample it keeps a copy of the filter from before it, and the record. A measurement about a sample
/// `age` samples ago is put into that record; the filter goes back to its copy, and that sample and all since
/// are processed again: `age` + 1 samples of work, and the same to the bit as if it had come in time. Nothing
/// is approximated, process noise, nonlinear models and policies included, where [`Delayed`](crate::Delayed)
/// costs one update and leaves out the process noise since: a second late, its errors can be larger than
/// without the measurement (the test `process_noise_makes_looking_back_worse_with_the_delay` prints a table
/// for a mass that is pushed at random). No allocation; memory for `LAG` filters and records.
///
/// ```
/// use kalmems_core::update::{History, HistoryError, Replay};
/// use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearMeasurement, LinearProcess, Mat};
/// /// A level that walks at random, seen at each sample, and now and then by a better sensor that is late.
/// struct Level(LinearProcess<f64, 1, 0>);
/// #[derive(Clone, Copy)]
/// struct Sample {
///     now: f64,
///     late: Option<f64>,
/// }
/// impl Replay<Ekf<f64, 1>> for Level {
///     type Record = Sample;
///     type Error = FilterError;
///     fn replay(&self, filter: &mut Ekf<f64, 1>, sample: &Sample) -> Result<(), FilterError> {
///         let level = LinearMeasurement { matrix: Mat([[1.0]]) };
///         filter.predict(&self.0, &[])?;
///         filter.update(&level, &[sample.now], &Covariance::from_variances([1.0]))?;
///         if let Some(y) = sample.late {
///             filter.update(&level, &[y], &Covariance::from_variances([0.01]))?;
///         }
///         Ok(())
///     }
/// }
/// let walk = LinearProcess {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([0.1]).into(),
/// };
/// let start = Ekf::new([0.0], Covariance::from_variances([1.0]));
/// let mut filter = History::<_, _, 8>::new(start, Level(walk));
/// for k in 0..20 {
///     filter.push(Sample { now: f64::from(k), late: None })?;
/// }
/// // About the sample before the one before.
/// filter.amend(2, |sample| sample.late = Some(17.1))?;
/// assert_eq!(filter.amend(8, |_| ()), Err(HistoryError::TooOld { age: 8, kept: 8 }));
/// # Ok::<(), HistoryError<FilterError>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct History<F, R: Replay<F>, const LAG: usize> {
    filter: F,
    replay: R,
    /// The filter before each sample, and the sample; a ring.
    samples: [Option<(F, R::Record)>; LAG],
    /// The place of the newest.
    newest: usize,
    /// How many there are.
    kept: usize,
}

/// Why a sample or a late measurement was not taken; everything is then as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HistoryError<E> {
    /// The sample is no longer kept, or there has been none.
    TooOld {
        /// How many samples ago.
        age: usize,
        /// How many samples are kept.
        kept: usize,
    },
    /// A sample could not be processed.
    Replay {
        /// How many samples ago.
        age: usize,
        /// What it said.
        cause: E,
    },
}

impl<E: fmt::Display> fmt::Display for HistoryError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooOld { age, kept } => {
                write!(f, "{age} samples ago is too old: the last {kept} are kept")
            }
            Self::Replay { age, cause } => write!(f, "the sample {age} samples ago: {cause}"),
        }
    }
}

impl<E: core::error::Error> core::error::Error for HistoryError<E> {}

impl<F: Copy, R: Replay<F>, const LAG: usize> History<F, R, LAG> {
    /// Starts with a filter as it is before the first sample.
    pub fn new(filter: F, replay: R) -> Self {
        const { assert!(LAG > 0, "a history keeps at least one sample") };
        Self { filter, replay, samples: [None; LAG], newest: 0, kept: 0 }
    }

    /// The filter as it is after the newest sample.
    #[inline(always)]
    pub const fn filter(&self) -> &F {
        &self.filter
    }

    /// Processes a new sample, and forgets the oldest where there are `LAG`.
    #[inline(always)]
    pub fn push(&mut self, record: R::Record) -> Result<(), HistoryError<R::Error>> {
        let before = self.filter;
        let mut filter = before;
        self.replay.replay(&mut filter, &record).map_err(|cause| HistoryError::Replay { age: 0, cause })?;
        self.filter = filter;
        self.newest = if self.newest + 1 < LAG { self.newest + 1 } else { 0 };
        if let Some(place) = self.samples.get_mut(self.newest) {
            *place = Some((before, record));
        }
        self.kept = if self.kept < LAG { self.kept + 1 } else { LAG };
        Ok(())
    }

    /// Changes the record of the sample `age` samples ago, 0 being the newest, and processes it and all since
    /// again.
    ///
    /// Where that fails the record is put back, and the samples are processed as they were.
    #[inline(always)]
    pub fn amend(
        &mut self,
        age: usize,
        change: impl FnOnce(&mut R::Record),
    ) -> Result<(), HistoryError<R::Error>> {
        let too_old = HistoryError::TooOld { age, kept: self.kept };
        if age >= self.kept {
            return Err(too_old);
        }
        let place = self.place(age);
        let Some(Some((_, record))) = self.samples.get_mut(place) else { return Err(too_old) };
        let old = *record;
        change(record);
        let outcome = self.reprocess(age);
        if outcome.is_err() {
            if let Some(Some((_, record))) = self.samples.get_mut(place) {
                *record = old;
            }
            // These samples were processed before, to the bit as now.
            self.reprocess(age)?;
        }
        outcome
    }

    /// Processes the sample `age` samples ago and all since, each from the filter that the one before leaves.
    #[inline(always)]
    fn reprocess(&mut self, age: usize) -> Result<(), HistoryError<R::Error>> {
        let mut filter = match self.samples.get(self.place(age)) {
            Some(Some((before, _))) => *before,
            _ => return Err(HistoryError::TooOld { age, kept: self.kept }),
        };
        for age in (0..=age).rev() {
            let place = self.place(age);
            if let Some(Some((before, record))) = self.samples.get_mut(place) {
                *before = filter;
                self.replay
                    .replay(&mut filter, record)
                    .map_err(|cause| HistoryError::Replay { age, cause })?;
            }
        }
        self.filter = filter;
        Ok(())
    }

    /// Where the sample `age` samples ago is.
    #[inline(always)]
    fn place(&self, age: usize) -> usize {
        if age <= self.newest { self.newest - age } else { self.newest + LAG - age }
    }
}

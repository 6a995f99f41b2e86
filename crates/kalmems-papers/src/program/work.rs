//! Points of a computation over threads.

use super::{Effort, ReproduceError};
use crate::progress::{Progress, map_on_threads};
use std::sync::Mutex;

/// What a point of a computation gave.
pub trait PointResult<T> {
    /// It, or why there is nothing.
    fn computed(self) -> Result<T, ReproduceError>;
}

/// Nothing where the work was stopped.
impl<T> PointResult<T> for Option<T> {
    fn computed(self) -> Result<T, ReproduceError> {
        self.ok_or(ReproduceError::Interrupted)
    }
}

impl<T> PointResult<T> for Result<T, ReproduceError> {
    fn computed(self) -> Result<T, ReproduceError> {
        self
    }
}

/// What a part of a program computes with.
#[derive(Clone, Copy)]
pub struct PartWork<'a> {
    /// How much is computed.
    pub effort: Effort,
    /// The first seed of the noise.
    pub seed: u64,
    /// How many threads compute.
    pub threads: usize,
    /// Hears how far the work has come, and may stop it.
    pub progress: &'a dyn Progress,
}

impl PartWork<'_> {
    /// What `point` makes of 0 to `count` − 1, in this order; see [`map_on_threads`]. The error is that of the first of the points that have one.
    pub fn map<T: Send, R: PointResult<T>>(
        &self,
        what: &str,
        size: (usize, u64),
        point: impl Fn(usize, &dyn Progress) -> R + Sync,
    ) -> Result<Vec<T>, ReproduceError> {
        let failed: Mutex<Option<(usize, ReproduceError)>> = Mutex::new(None);
        let kept = |index: usize, why: ReproduceError| {
            let mut failed = failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if failed.as_ref().is_none_or(|(first, _)| index < *first) {
                *failed = Some((index, why));
            }
        };
        let point = |index: usize, progress: &dyn Progress| {
            point(index, progress).computed().map_err(|why| kept(index, why)).ok()
        };
        let found = map_on_threads((self.progress, what), self.threads, size, point);
        let failed = failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        found.ok_or_else(|| failed.map_or(ReproduceError::Interrupted, |(_, why)| why))
    }
}

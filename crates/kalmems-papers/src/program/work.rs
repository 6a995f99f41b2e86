//! Points of a computation over threads.

use super::{Effort, ReproduceError};
use crate::progress::{Progress, map_on_threads};

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
    /// What `point` makes of 0 to `count` − 1, in this order; see [`map_on_threads`].
    pub fn map<T: Send>(
        &self,
        what: &str,
        size: (usize, u64),
        point: impl Fn(usize, &dyn Progress) -> Option<T> + Sync,
    ) -> Result<Vec<T>, ReproduceError> {
        map_on_threads((self.progress, what), self.threads, size, point).ok_or(ReproduceError::Interrupted)
    }
}

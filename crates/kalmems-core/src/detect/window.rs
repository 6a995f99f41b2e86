//! The newest samples, side by side in memory.

use crate::Scalar;

/// The last `LENGTH` samples as one slice.
///
/// Each is written twice, `LENGTH` apart, so that a slice of that length always begins at the oldest.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleWindow<T, const LENGTH: usize> {
    samples: [[T; LENGTH]; 2],
    oldest: usize,
}

impl<T: Scalar, const LENGTH: usize> SampleWindow<T, LENGTH> {
    /// Without a sample yet: not numbers.
    pub fn new() -> Self {
        Self { samples: [[T::of(f64::NAN); LENGTH]; 2], oldest: 0 }
    }

    /// Takes in a sample and forgets the oldest.
    #[inline(always)]
    pub fn push(&mut self, sample: T) {
        for half in &mut self.samples {
            if let Some(place) = half.get_mut(self.oldest) {
                *place = sample;
            }
        }
        self.oldest = if self.oldest + 1 < LENGTH { self.oldest + 1 } else { 0 };
    }

    /// All samples, the oldest first.
    #[inline(always)]
    pub fn samples(&self) -> &[T] {
        self.samples.as_flattened().get(self.oldest..self.oldest + LENGTH).unwrap_or(&[])
    }

    /// The newest `count` samples, or none where there are not as many.
    #[inline(always)]
    pub fn newest(&self, count: usize) -> &[T] {
        self.samples().get(LENGTH.wrapping_sub(count)..).unwrap_or(&[])
    }
}

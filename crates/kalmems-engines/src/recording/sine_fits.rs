//! Sines that were fitted to rows of a column, so that who asks for them again finds them.

use crate::signal::Sine;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// What was fitted to a column. Copies of a column have it in common, as long as none of them is changed.
///
/// A diagnosis or an identification runs a filter some hundred times over the same drive.
#[derive(Clone, Debug, Default)]
pub(super) struct SineFits(Arc<Mutex<Vec<SineFit>>>);

#[derive(Debug)]
struct SineFit {
    rows: Range<usize>,
    count: usize,
    /// Nothing where no such sines were found.
    sines: Vec<Sine>,
}

/// Columns with the same numbers are the same, whatever was fitted to them.
impl PartialEq for SineFits {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl SineFits {
    /// So many sines in these rows; `fit` finds them where nobody has asked for them before, and gives `None` where it is stopped.
    pub(super) fn get(
        &self,
        rows: Range<usize>,
        count: usize,
        fit: impl FnOnce() -> Option<Vec<Sine>>,
    ) -> Vec<Sine> {
        // Another thread that asks for the same fit waits for it.
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(fit) = known.iter().find(|fit| fit.rows == rows && fit.count == count) {
            return fit.sines.clone();
        }
        let Some(sines) = fit() else { return Vec::new() };
        known.push(SineFit { rows, count, sines: sines.clone() });
        sines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SINE: Sine =
        Sine { offset: 0.0, amplitude: 1.0, frequency_hz: 50.0, phase_rad: 0.0, residual_rms: 0.0 };

    #[test]
    fn rows_are_fitted_once_and_again_after_a_fit_that_was_stopped() {
        let fits = SineFits::default();
        assert!(fits.get(0..10, 1, || None).is_empty());
        assert_eq!(fits.get(0..10, 1, || Some(vec![SINE])), [SINE]);
        assert_eq!(fits.clone().get(0..10, 1, || unreachable!()), [SINE]);
        // Other rows, and other numbers of sines, are other fits; that there are none is known as well.
        assert!(fits.get(0..10, 2, || Some(Vec::new())).is_empty());
        assert!(fits.get(0..10, 2, || unreachable!()).is_empty());
        assert_eq!(fits.get(5..10, 1, || Some(vec![SINE; 1])), [SINE]);
    }
}

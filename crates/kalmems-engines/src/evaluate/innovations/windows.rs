//! Whether level and size of the innovations stay the same over the recording.

use super::{InnovationMoments, InnovationTest, TestPlace, TestResult};
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Windows at most; where they are full, each two neighbours become one, so that a recording of any length has between half
/// of these and these.
const MOST: usize = 40;

/// Innovations of the shortest window.
const SHORTEST: usize = 64;

/// Sums over a part of a recording.
#[derive(Clone, Copy, Debug)]
struct WindowSums {
    from_s: f64,
    to_s: f64,
    count: f64,
    sum: f64,
    squares: f64,
}

/// A recording in windows of one length.
#[derive(Clone, Debug)]
pub struct InnovationWindows {
    /// Innovations of a window.
    length: usize,
    /// Those of the last one.
    filled: usize,
    all: Vec<WindowSums>,
}

impl Default for InnovationWindows {
    fn default() -> Self {
        Self { length: SHORTEST, filled: SHORTEST, all: Vec::new() }
    }
}

impl InnovationWindows {
    /// Takes an innovation in.
    #[inline]
    pub fn take(&mut self, time_s: f64, z: f64) {
        if self.filled == self.length {
            self.begin(time_s);
        }
        if let Some(window) = self.all.last_mut() {
            window.to_s = time_s;
            window.count += 1.0;
            window.sum += z;
            window.squares += z * z;
        }
        self.filled += 1;
    }

    fn begin(&mut self, time_s: f64) {
        if self.all.len() == MOST {
            self.all = self.all.chunks(2).map(|pair| pair[0].with(pair.get(1))).collect();
            self.length *= 2;
        }
        self.all.push(WindowSums { from_s: time_s, to_s: time_s, count: 0.0, sum: 0.0, squares: 0.0 });
        self.filled = 0;
    }

    /// The windows that are whole, or nearly so.
    fn whole(&self) -> &[WindowSums] {
        let ends =
            if 2 * self.filled < self.length { self.all.len().saturating_sub(1) } else { self.all.len() };
        &self.all[..ends]
    }

    /// Whether the level stays at zero: Σ (Σz)²/n over the windows is χ² of a filter that is right. One-sided, with the
    /// claimed variance: a careful filter leaves less.
    pub fn level(&self) -> Option<TestResult> {
        let windows = self.whole();
        let statistic: f64 = windows.iter().map(|w| w.sum * w.sum / w.count).sum();
        let p_value = ChiSquared::new(windows.len() as f64).ok()?.sf(statistic);
        let worst = windows.iter().max_by(|a, b| a.sum.abs().total_cmp(&b.sum.abs()))?;
        let (place, size) = (Some(worst.place()), worst.sum / worst.count);
        Some(TestResult { test: InnovationTest::Level, p_value, size, place, signal: None })
    }

    /// Whether the variance is larger than claimed in some window: of a careful filter, whose claim may be too large by a factor
    /// that changes.
    pub fn excess(&self) -> Option<TestResult> {
        let windows = self.whole();
        let chance = |w: &WindowSums| ChiSquared::new(w.count).map_or(1.0, |chi| chi.sf(w.squares));
        let worst = windows.iter().map(|w| (chance(w), w)).min_by(|a, b| a.0.total_cmp(&b.0));
        let (chance, worst) = worst?;
        let p_value = (windows.len() as f64 * chance).min(1.0);
        let (size, place) = (worst.squares / worst.count, Some(worst.place()));
        Some(TestResult { test: InnovationTest::Windows, p_value, size, place, signal: None })
    }

    /// Whether the variance is the same in all windows. The mean of n squares of a normal number is nearly normal as its cube
    /// root (Wilson & Hilferty, Proceedings of the National Academy of Sciences 17, 684, 1931), here with the variance of z²
    /// as it was measured, and `inflation` for squares that are correlated.
    pub fn steadiness(&self, moments: &InnovationMoments, inflation: f64) -> Option<TestResult> {
        let windows = self.whole();
        if windows.len() < MOST / 4 {
            return None;
        }
        let (mean, variance) = (moments.mean_square(), moments.variance_of_squares() * inflation);
        let deviation = |w: &WindowSums| {
            let ninth = variance / (9.0 * w.count * mean * mean);
            ((w.squares / (w.count * mean)).portable_cbrt() - 1.0 + ninth) / ninth.sqrt()
        };
        let statistic: f64 = windows.iter().map(|w| deviation(w).powi(2)).sum();
        let p_value = ChiSquared::new(windows.len() as f64 - 1.0).ok()?.sf(statistic);
        let worst = windows.iter().max_by(|a, b| deviation(a).abs().total_cmp(&deviation(b).abs()))?;
        let size = worst.squares / (worst.count * mean);
        let place = Some(worst.place());
        Some(TestResult { test: InnovationTest::Windows, p_value, size, place, signal: None })
    }
}

impl WindowSums {
    fn with(self, next: Option<&Self>) -> Self {
        next.map_or(self, |next| Self {
            from_s: self.from_s,
            to_s: next.to_s,
            count: self.count + next.count,
            sum: self.sum + next.sum,
            squares: self.squares + next.squares,
        })
    }

    fn place(&self) -> TestPlace {
        TestPlace::Span { from_s: self.from_s, to_s: self.to_s }
    }
}

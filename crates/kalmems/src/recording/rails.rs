//! The diagnosis of a column's values: constant, or saturated.
//!
//! A saturated signal repeats its highest or lowest value. So does the turning point of a sine that is rounded
//! coarsely, and so does a signal that has settled; neither must be taken for saturation. A run of `n` rows at an
//! extreme value, `n` at least [`SATURATION_RUN`], is looked at together with the `n` rows before and after it.
//!
//! - A smooth peak that stays for `n` rows within one step of rounding is a parabola there: `n` rows further out it
//!   has left its top by 3² − 1² = 8 steps, and a ninth by rounding. A clipped signal leaves it by more than
//!   [`SATURATION_STEPS`]. The step is the distance from the extreme value to the next one that the column ever
//!   takes, so a signal that switches between two levels never leaves by more than one.
//! - A clipped signal runs into its rail: within the nearest `n`/8 rows it leaves the value by an eighth of what it
//!   leaves it by within `n` rows if it is straight there, by a fourteenth if it is a clipped parabola. One that
//!   settles creeps: [`SATURATION_CREEP`] divides the two.

use super::FindingKind as Kind;
use super::findings::{Findings, Place, short};
use super::segment::Lines;
use std::ops::Range;

/// The shortest run of rows at an extreme value that can be saturation.
pub const SATURATION_RUN: usize = 8;

/// By how many steps the signal must leave the extreme value next to the run: twice those of a smooth peak.
pub const SATURATION_STEPS: f64 = 16.0;

/// How many times as far the signal may be from the extreme value in all the rows next to the run as in the nearest
/// eighth of them.
pub const SATURATION_CREEP: f64 = 24.0;

/// Checks a column: `column` is its position in the header, `segments` the rows of each segment.
pub(super) fn check(
    values: &[f64],
    column: usize,
    segments: &[Range<usize>],
    lines: &Lines,
    findings: &mut Findings,
) {
    let Some((low, high)) = extremes(values) else { return };
    let place = |segment, row| Place { column: Some(column), segment, line: lines.of(row) };
    if low.level.to_bits() == high.level.to_bits() {
        if values.iter().filter(|v| !v.is_nan()).count() > 1 {
            findings.add(Kind::Constant, place(None, 0), || format!("always {}", short(low.level)));
        }
        return;
    }
    for (index, rows) in segments.iter().enumerate() {
        let Some(part) = values.get(rows.clone()) else { continue };
        if segments.len() > 1
            && part.len() >= SATURATION_RUN
            && let Some((only, _)) = extremes(part).filter(|(low, high)| low.level >= high.level)
        {
            findings.add(Kind::Constant, place(Some(index), rows.start), || {
                format!("always {} in this segment", short(only.level))
            });
            continue;
        }
        let found =
            [("highest", high), ("lowest", low)].map(|(name, rail)| (name, rail.level, rail.runs(part)));
        let first = found.iter().filter(|f| f.2.samples > 0).map(|f| f.2.first).min().unwrap_or(0);
        let samples = found.iter().map(|f| f.2.samples).sum();
        findings.add_many(Kind::Saturation, place(Some(index), rows.start + first), samples, || {
            let parts: Vec<String> = found
                .iter()
                .filter(|f| f.2.samples > 0)
                .map(|(name, level, runs)| {
                    format!("at its {name} value {} in runs of up to {} rows", short(*level), runs.longest)
                })
                .collect();
            format!("stays {}", parts.join(" and "))
        });
    }
}

/// An extreme value and the distance to the next one that occurs.
#[derive(Clone, Copy)]
struct Rail {
    level: f64,
    step: f64,
}

#[derive(Default)]
struct Runs {
    first: usize,
    longest: usize,
    samples: usize,
}

impl Rail {
    fn runs(self, values: &[f64]) -> Runs {
        let mut runs = Runs::default();
        let mut start = 0;
        // Exactly equal is what is meant: a clipped signal repeats the value of its rail.
        #[allow(clippy::float_cmp)]
        for run in values.chunk_by(|a, b| a == b) {
            let end = start + run.len();
            if run.len() >= SATURATION_RUN
                && run.first() == Some(&self.level)
                && self.is_clipped(values, start, end)
            {
                if runs.samples == 0 {
                    runs.first = start;
                }
                runs.longest = runs.longest.max(run.len());
                runs.samples += run.len();
            }
            start = end;
        }
        runs
    }

    /// Whether the signal runs into the level on both sides of the run; where the record ends too early on both
    /// sides, on one of them.
    fn is_clipped(self, values: &[f64], start: usize, end: usize) -> bool {
        let length = end - start;
        let before = values.get(start.saturating_sub(length)..start).unwrap_or_default();
        let after = values.get(end..values.len().min(end + length)).unwrap_or_default();
        let runs_in = |side: &[f64], near: &[f64]| {
            let (far, near) = (self.departure(side), self.departure(near));
            far > SATURATION_STEPS * self.step && far <= SATURATION_CREEP * near
        };
        let nearest = |side: &[f64]| side.len().min(side.len() / 8 + 1);
        let in_before = runs_in(before, before.split_at(before.len() - nearest(before)).1);
        let in_after = runs_in(after, after.split_at(nearest(after)).0);
        match (before.len() == length, after.len() == length) {
            (true, true) => in_before && in_after,
            (true, false) => in_before,
            (false, true) => in_after,
            (false, false) => in_before || in_after,
        }
    }

    /// How far values are from the level at most, passing over NaN.
    fn departure(self, values: &[f64]) -> f64 {
        values.iter().map(|v| (v - self.level).abs()).fold(0.0, f64::max)
    }
}

/// The lowest and the highest value, passing over NaN; `None` where there is no other.
fn extremes(values: &[f64]) -> Option<(Rail, Rail)> {
    let numbers = || values.iter().copied().filter(|v| !v.is_nan());
    let low = numbers().reduce(f64::min)?;
    let high = numbers().reduce(f64::max)?;
    let nearest = |level: f64| {
        numbers().map(|v| (v - level).abs()).filter(|d| *d > 0.0).reduce(f64::min).unwrap_or(f64::INFINITY)
    };
    Some((Rail { level: low, step: nearest(low) }, Rail { level: high, step: nearest(high) }))
}

//! Up to which difference a number of ours counts as the paper's.

use kalmems_figures::number;
use serde::Serialize;

/// Up to which difference two numbers count as the same, and why no closer and no further.
///
/// It is what the paper's own statement leaves open: the rounding of its digits, the chance of its runs, what it does not print. A
/// tolerance in which a difference vanishes that the paper itself makes something of would let everything agree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CheckTolerance {
    size: ToleranceSize,
    because: &'static str,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum ToleranceSize {
    /// Of the paper's value.
    Part(f64),
    /// In the unit of the quantity.
    Difference(f64),
}

/// Half a unit in the last place is not representable in general: a difference that is this much beyond it is still within.
const ROUNDING: f64 = 1.0 + 1e-9;

impl CheckTolerance {
    /// This part of the paper's value.
    pub const fn part(part: f64, because: &'static str) -> Self {
        Self { size: ToleranceSize::Part(part), because }
    }

    /// This difference, in the unit of the quantity. Decibels, which are a logarithm, are compared so.
    pub const fn difference(difference: f64, because: &'static str) -> Self {
        Self { size: ToleranceSize::Difference(difference), because }
    }

    /// Half of the last digit that the paper prints, given as what a 1 in its place is worth.
    pub const fn digit(last: f64) -> Self {
        Self::difference(0.5 * last, "rounding of the printed digits")
    }

    /// None: both are counts.
    pub const COUNT: Self = Self::difference(0.0, "a count");

    /// Whether ours counts as the paper's.
    pub(super) fn admits(self, paper: f64, ours: f64) -> bool {
        (ours - paper).abs() <= self.in_units(paper) * ROUNDING
    }

    /// In the unit of the quantity.
    pub(super) fn in_units(self, paper: f64) -> f64 {
        match self.size {
            ToleranceSize::Part(part) => part * paper.abs(),
            ToleranceSize::Difference(difference) => difference,
        }
    }

    /// `±10 %: …` or `±1 dB: …`.
    pub(super) fn words(self, unit: &str) -> String {
        let size = match self.size {
            ToleranceSize::Part(part) => format!("{} %", number((1e4 * part).round() / 100.0)),
            ToleranceSize::Difference(difference) if unit.is_empty() => number(difference),
            ToleranceSize::Difference(difference) => format!("{} {unit}", number(difference)),
        };
        format!("±{size}: {}", self.because)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_a_part_or_a_difference_and_says_why() {
        let tenth = CheckTolerance::part(0.1, "no spread is stated");
        assert!(tenth.admits(-20.0, -22.0) && !tenth.admits(-20.0, -22.1) && !tenth.admits(20.0, f64::NAN));
        assert_eq!(tenth.words("deg"), "±10 %: no spread is stated");
        let level = CheckTolerance::difference(1.0, "chance of a run");
        assert!(level.admits(-40.0, -39.0) && !level.admits(4.0, 5.1));
        assert_eq!(level.words("dB"), "±1 dB: chance of a run");
        // 0.285 is rounded to 0.29 and to 0.28.
        assert!(
            CheckTolerance::digit(0.01).admits(0.29, 0.285)
                && !CheckTolerance::digit(0.01).admits(0.29, 0.2849)
        );
        assert_eq!(CheckTolerance::digit(1e-4).words("rad"), "±5e-5 rad: rounding of the printed digits");
        assert!(CheckTolerance::COUNT.admits(2.0, 2.0) && !CheckTolerance::COUNT.admits(2.0, 3.0));
    }
}

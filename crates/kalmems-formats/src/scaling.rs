//! What a file says is to be done to its numbers: values that stand for none, factors and offsets, tables.

use crate::CellFinding;
use crate::element::{Element, ExactNumber};
use crate::records::AbsentRows;

/// Applied to the numbers of a column before they are handed over. The missing values are compared with the numbers as
/// they are in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Scaling {
    /// Numbers that say that there is none.
    pub(crate) missing: Vec<ExactNumber>,
    /// One after the other.
    pub(crate) steps: Vec<ScalingStep>,
}

/// A function of the number before it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ScalingStep {
    /// factor·x + offset.
    Linear { factor: f64, offset: f64 },
    /// The sum of the coefficients, the lowest first, times powers of x.
    Polynomial(Vec<f64>),
    /// Points that straight lines join, in the order of what they are of; held at the ends.
    Table { from: Vec<f64>, to: Vec<f64> },
}

impl Scaling {
    pub(crate) fn is_none(&self) -> bool {
        self.missing.is_empty() && self.steps.is_empty()
    }

    /// Puts NaN, and the row in `absent`, where the file says that there is no number. `cells` are the numbers as they are in the file.
    pub(crate) fn mark<'a>(
        &self,
        element: Element,
        cells: impl Iterator<Item = &'a [u8]>,
        numbers: &mut [f64],
        absent: &mut AbsentRows,
    ) {
        if self.missing.is_empty() {
            return;
        }
        for (row, (cell, number)) in cells.zip(numbers).enumerate() {
            let exact = element.exact(cell);
            if self.missing.iter().any(|missing| missing.is(exact)) {
                *number = f64::NAN;
                absent.push((row, CellFinding::Missing));
            }
        }
    }

    /// Puts what the file means for the numbers that it holds.
    pub(crate) fn apply(&self, numbers: &mut [f64]) {
        for step in &self.steps {
            step.apply(numbers);
        }
    }
}

impl ScalingStep {
    fn apply(&self, numbers: &mut [f64]) {
        match self {
            Self::Linear { factor, offset } => {
                for number in numbers {
                    *number = *number * factor + offset;
                }
            }
            Self::Polynomial(coefficients) => {
                for number in numbers {
                    let x = *number;
                    *number = coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient);
                }
            }
            Self::Table { from, to } => {
                for number in numbers {
                    *number = between(from, to, *number);
                }
            }
        }
    }

    /// What it does, for people.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Linear { factor, offset } => format!("{factor}·x + {offset}"),
            Self::Polynomial(coefficients) => {
                format!("a polynomial of degree {}", coefficients.len().saturating_sub(1))
            }
            Self::Table { from, .. } => format!("a table of {} points, held at its ends", from.len()),
        }
    }
}

fn between(from: &[f64], to: &[f64], x: f64) -> f64 {
    let after = from.partition_point(|start| *start <= x);
    let (Some(before), true) = (after.checked_sub(1), !x.is_nan()) else {
        return if x.is_nan() { x } else { to.first().copied().unwrap_or(f64::NAN) };
    };
    let (Some(end), Some(next)) = (from.get(after), to.get(after)) else { return to[before] };
    if x == from[before] {
        return to[before];
    }
    (next - to[before]) / (end - from[before]) * (x - from[before]) + to[before]
}

/// The steps of a column in words: `V = 0.5·x + 2`.
pub(crate) fn text(steps: &[ScalingStep]) -> String {
    steps.iter().map(ScalingStep::text).collect::<Vec<_>>().join(", then ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::ElementKind;

    fn applied(steps: Vec<ScalingStep>, mut numbers: Vec<f64>) -> Vec<f64> {
        let scaling = Scaling { missing: Vec::new(), steps };
        scaling.apply(&mut numbers);
        numbers
    }

    #[test]
    fn steps_follow_one_another() {
        let steps = vec![
            ScalingStep::Linear { factor: 2.0, offset: 1.0 },
            ScalingStep::Polynomial(vec![1.0, 0.0, 0.5]),
            ScalingStep::Table { from: vec![0.0, 10.0, 20.0], to: vec![5.0, 15.0, 0.0] },
        ];
        // 3 → 5.5 → 10.5; 5 → 13.5 → 15 − 1.5·3.5; far beyond the table its last point.
        assert_eq!(applied(steps, vec![1.0, 2.0, 100.0]), [10.5, 9.75, 0.0]);
        let table = ScalingStep::Table { from: vec![0.0, 1.0], to: vec![3.0, 4.0] };
        let numbers = applied(vec![table], vec![-1.0, 0.0, 1.0, f64::NAN]);
        assert_eq!(numbers[..3], [3.0, 3.0, 4.0]);
        assert!(numbers[3].is_nan());
    }

    #[test]
    fn missing_values_are_those_of_the_file() {
        let element = Element::little(ElementKind::Signed, 8);
        let cells = [-9999_i64, 1, i64::MIN, i64::MIN + 1].map(i64::to_le_bytes);
        let mut numbers: Vec<f64> = vec![-9999.0, 1.0, i64::MIN as f64, i64::MIN as f64];
        let mut absent = Vec::new();
        let scaling = Scaling {
            missing: vec![ExactNumber::Float(-9999.0), ExactNumber::Integer(i128::from(i64::MIN))],
            steps: vec![ScalingStep::Linear { factor: 1.0, offset: 0.0 }],
        };
        scaling.mark(element, cells.iter().map(<[u8; 8]>::as_slice), &mut numbers, &mut absent);
        scaling.apply(&mut numbers);
        // The last is the same number of f64, and another of 64 bits.
        assert_eq!(absent, [0, 2].map(|row| (row, CellFinding::Missing)));
        assert!(numbers[0].is_nan() && numbers[2].is_nan() && numbers[3] < -9e18);
    }
}

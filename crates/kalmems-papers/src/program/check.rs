//! One statement of a paper against what was computed.

use kalmems_figures::significant;
use serde::Serialize;

/// What is computed over several runs, one per seed: the middle and the ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SeedSpread {
    /// The median.
    pub median: f64,
    /// The smallest.
    pub low: f64,
    /// The largest.
    pub high: f64,
    /// How many runs.
    pub runs: usize,
}

impl SeedSpread {
    /// A number that no chance enters.
    pub const fn exact(value: f64) -> Self {
        Self { median: value, low: value, high: value, runs: 1 }
    }

    /// Over these runs. Not a number where there is none, or where one of them is not a number.
    pub fn of(runs: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = runs.into_iter().collect();
        if sorted.is_empty() || sorted.iter().any(|v| v.is_nan()) {
            return Self { median: f64::NAN, low: f64::NAN, high: f64::NAN, runs: sorted.len() };
        }
        sorted.sort_by(f64::total_cmp);
        let (n, last) = (sorted.len(), sorted.len() - 1);
        Self { median: sorted[last / 2].midpoint(sorted[n / 2]), low: sorted[0], high: sorted[last], runs: n }
    }

    /// The median, and the ends where there are several runs: `0.045 (0.044 … 0.047)`.
    pub fn to_text(&self) -> String {
        if self.median.is_nan() {
            return "none".to_owned();
        }
        let median = significant(self.median);
        if self.runs == 1 {
            return median;
        }
        format!("{median} ({} … {})", significant(self.low), significant(self.high))
    }
}

/// A statement of a paper and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Check {
    /// A number.
    Value {
        /// What it is.
        quantity: String,
        /// Its unit as the paper has it; empty for none.
        unit: &'static str,
        /// The paper's.
        paper: f64,
        /// Ours.
        ours: SeedSpread,
        /// The relative difference up to which the two count as the same.
        tolerance: f64,
    },
    /// A statement that holds or does not: an order, a direction, that something happens.
    Claim {
        /// The statement.
        statement: String,
        /// What the paper gives for it.
        paper: String,
        /// What was found.
        ours: String,
        /// Whether that bears the statement out.
        holds: bool,
    },
}

impl Check {
    /// A number against the paper's.
    pub fn value(
        quantity: impl Into<String>,
        unit: &'static str,
        paper: f64,
        ours: SeedSpread,
        tolerance: f64,
    ) -> Self {
        Self::Value { quantity: quantity.into(), unit, paper, ours, tolerance }
    }

    /// A statement against what was found.
    pub fn claim(
        statement: impl Into<String>,
        paper: impl Into<String>,
        ours: impl Into<String>,
        holds: bool,
    ) -> Self {
        Self::Claim { statement: statement.into(), paper: paper.into(), ours: ours.into(), holds }
    }

    /// Whether ours bears out the paper's.
    pub fn holds(&self) -> bool {
        match self {
            Self::Value { paper, ours, tolerance, .. } => {
                (ours.median - paper).abs() <= tolerance * paper.abs()
            }
            Self::Claim { holds, .. } => *holds,
        }
    }

    /// What is compared, with its unit.
    pub fn subject(&self) -> String {
        match self {
            Self::Value { quantity, unit: "", .. } => quantity.clone(),
            Self::Value { quantity, unit, .. } => format!("{quantity} ({unit})"),
            Self::Claim { statement, .. } => statement.clone(),
        }
    }

    /// What the paper gives.
    pub fn paper(&self) -> String {
        match self {
            Self::Value { paper, .. } => format!("{paper}"),
            Self::Claim { paper, .. } => paper.clone(),
        }
    }

    /// What was computed.
    pub fn ours(&self) -> String {
        match self {
            Self::Value { ours, .. } => ours.to_text(),
            Self::Claim { ours, .. } => ours.clone(),
        }
    }

    /// How the two compare: `agrees, +0.4 %`, `16 times smaller`, `holds`. Decibels are a logarithm and compared by their difference.
    pub fn comparison(&self) -> String {
        match self {
            Self::Value { paper, ours, unit, .. } => {
                let difference = if *unit == "dB" {
                    format!("{:+.1} dB", ours.median - paper)
                } else {
                    difference(*paper, ours.median)
                };
                if self.holds() { format!("agrees, {difference}") } else { difference }
            }
            Self::Claim { holds: true, .. } => "holds".to_owned(),
            Self::Claim { holds: false, .. } => "does not hold".to_owned(),
        }
    }

    /// Up to which difference the two count as the same; nothing of a statement.
    pub fn within(&self) -> String {
        match self {
            Self::Value { paper, unit: "dB", tolerance, .. } => {
                format!("±{} dB", plain(tolerance * paper.abs()))
            }
            Self::Value { tolerance, .. } => format!("±{} %", plain(100.0 * tolerance)),
            Self::Claim { .. } => "–".to_owned(),
        }
    }

    /// How far ours is from the paper's, as a factor above 1; infinite for a claim that does not hold.
    fn distance(&self) -> f64 {
        match self {
            Self::Value { paper, ours, .. } if *paper == ours.median => 1.0,
            Self::Value { paper, ours, .. } => {
                let ratio = ours.median / paper;
                if ratio > 0.0 { ratio.max(1.0 / ratio) } else { f64::INFINITY }
            }
            Self::Claim { holds: true, .. } => 1.0,
            Self::Claim { holds: false, .. } => f64::INFINITY,
        }
    }
}

/// Up to two decimals, without zeros at their end.
fn plain(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A factor where it is beyond 2, else a percentage.
fn difference(paper: f64, ours: f64) -> String {
    let ratio = ours / paper;
    if !ratio.is_finite() {
        "cannot be compared".to_owned()
    } else if ratio >= 2.0 {
        format!("{} times larger", significant(ratio))
    } else if ratio > 0.0 && ratio <= 0.5 {
        format!("{} times smaller", significant(1.0 / ratio))
    } else {
        let tenths = (1000.0 * (ratio - 1.0)).round();
        if tenths == 0.0 { "0.0 %".to_owned() } else { format!("{:+.1} %", tenths / 10.0) }
    }
}

/// What came of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ItemVerdict {
    /// Every number agrees and every statement holds.
    Reproduced,
    /// Numbers differ, but every statement about order and direction holds.
    SameTrend,
    /// A statement does not hold, or numbers differ and there is no statement.
    DoesNotReproduce,
}

impl ItemVerdict {
    /// What follows from these checks. Without any, nothing is reproduced.
    pub fn of(checks: &[Check]) -> Self {
        let (claims, values): (Vec<&Check>, Vec<&Check>) =
            checks.iter().partition(|check| matches!(check, Check::Claim { .. }));
        let (claims_hold, values_agree) =
            (claims.iter().all(|c| c.holds()), values.iter().all(|v| v.holds()));
        if checks.is_empty() || !claims_hold {
            Self::DoesNotReproduce
        } else if values_agree {
            Self::Reproduced
        } else if claims.is_empty() {
            Self::DoesNotReproduce
        } else {
            Self::SameTrend
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::SameTrend => "same trend",
            Self::DoesNotReproduce => "does not reproduce",
        }
    }
}

/// The check that says most of a verdict: the one that is furthest off.
pub(super) fn decisive(checks: &[Check]) -> Option<&Check> {
    // Of equals the first.
    checks.iter().rev().max_by(|a, b| a.distance().total_cmp(&b.distance()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(paper: f64, ours: f64) -> Check {
        Check::value("error", "deg", paper, SeedSpread::exact(ours), 0.1)
    }

    fn claim(holds: bool) -> Check {
        Check::claim("the second is smaller", "1.4 times", "1.0 times", holds)
    }

    #[test]
    fn the_verdict_follows_from_the_checks() {
        let cases: [(&[Check], ItemVerdict); 9] = [
            (&[], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 1.09)], ItemVerdict::Reproduced),
            (&[value(-1.0, -0.91), claim(true)], ItemVerdict::Reproduced),
            (&[claim(true)], ItemVerdict::Reproduced),
            (&[value(1.0, 1.2), claim(true)], ItemVerdict::SameTrend),
            (&[value(1.0, 1.2)], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 1.0), claim(false)], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 1.0), value(1.0, 0.1)], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, f64::NAN)], ItemVerdict::DoesNotReproduce),
        ];
        for (checks, verdict) in cases {
            assert_eq!(ItemVerdict::of(checks), verdict, "{checks:?}");
        }
    }

    #[test]
    fn a_comparison_is_a_percentage_or_a_factor() {
        for (paper, ours, words) in [
            (2.73, 2.8, "agrees, +2.6 %"),
            (0.38, 0.024, "15.8 times smaller"),
            (0.18, 1.116, "6.20 times larger"),
            (1.0, 0.7, "-30.0 %"),
            (1.0, f64::NAN, "cannot be compared"),
            (0.0, 1.0, "cannot be compared"),
        ] {
            assert_eq!(value(paper, ours).comparison(), words);
        }
        assert_eq!(value(2.73, 2.8).within(), "±10 %");
        let level = Check::value("spurious line", "dB", -40.0, SeedSpread::exact(-38.5), 0.05);
        assert_eq!((level.comparison().as_str(), level.within().as_str()), ("agrees, +1.5 dB", "±2 dB"));
    }

    #[test]
    fn the_decisive_check_is_the_furthest_off() {
        let checks = [value(1.0, 1.3), value(1.0, 0.2), value(1.0, 3.0)];
        assert_eq!(decisive(&checks), Some(&checks[1]));
        let checks = [value(1.0, 0.2), claim(false), claim(false)];
        assert_eq!(decisive(&checks), Some(&checks[1]));
        assert_eq!(decisive(&[]), None);
    }

    #[test]
    fn a_spread_has_its_median_between_its_ends() {
        assert_eq!(SeedSpread::of([3.0, 1.0, 2.0]), SeedSpread { median: 2.0, low: 1.0, high: 3.0, runs: 3 });
        assert_eq!(SeedSpread::of([4.0, 1.0]), SeedSpread { median: 2.5, low: 1.0, high: 4.0, runs: 2 });
        assert_eq!(SeedSpread::of([4.0, 1.0]).to_text(), "2.50 (1.00 … 4.00)");
        assert!(SeedSpread::of([]).median.is_nan() && SeedSpread::of([1.0, f64::NAN]).median.is_nan());
    }
}

//! One statement of a paper against what was computed.

use super::CheckTolerance;
use kalmems_core::Portable;
use kalmems_figures::{significant, with_short_numbers};
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
        self.written(significant)
    }

    /// The same with numbers that `write` writes.
    fn written(&self, write: impl Fn(f64) -> String) -> String {
        if self.median.is_nan() {
            return "none".to_owned();
        }
        let median = write(self.median);
        if self.runs == 1 {
            return median;
        }
        format!("{median} ({} … {})", write(self.low), write(self.high))
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
        /// Up to which difference the two count as the same.
        tolerance: CheckTolerance,
        /// Why ours had to come out so, where it was put in: then it shows that the computation is right, and nothing of the paper.
        given: Option<&'static str>,
    },
    /// A statement that holds or does not: an order, a direction, that something happens.
    Claim {
        /// The statement.
        statement: String,
        /// What the paper gives for it.
        paper: String,
        /// What was found.
        ours: String,
        /// By which rule, or which test at which level, that is decided.
        rule: String,
        /// Whether that bears the statement out.
        holds: bool,
        /// Why it had to, where what was found was put in.
        given: Option<&'static str>,
    },
}

impl Check {
    /// A number against the paper's.
    pub fn value(
        quantity: impl Into<String>,
        unit: &'static str,
        paper: f64,
        ours: SeedSpread,
        tolerance: CheckTolerance,
    ) -> Self {
        Self::Value { quantity: quantity.into(), unit, paper, ours, tolerance, given: None }
    }

    /// A statement against what was found, with the rule that decides.
    pub fn claim(
        statement: impl Into<String>,
        paper: impl Into<String>,
        ours: impl Into<String>,
        rule: impl Into<String>,
        holds: bool,
    ) -> Self {
        let (statement, paper, ours, rule) = (statement.into(), paper.into(), ours.into(), rule.into());
        Self::Claim { statement, paper, ours, rule, holds, given: None }
    }

    /// The same of a figure that was an input, for this reason: an agreement is circular.
    #[must_use]
    pub fn circular(mut self, why: &'static str) -> Self {
        let (Self::Value { given, .. } | Self::Claim { given, .. }) = &mut self;
        *given = Some(why);
        self
    }

    /// Whether ours bears out the paper's.
    pub fn holds(&self) -> bool {
        match self {
            Self::Value { paper, ours, tolerance, .. } => tolerance.admits(*paper, ours.median),
            Self::Claim { holds, .. } => *holds,
        }
    }

    /// Whether it agrees because it was put in.
    pub fn is_circular(&self) -> bool {
        let (Self::Value { given, .. } | Self::Claim { given, .. }) = self;
        given.is_some() && self.holds()
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
            Self::Value { paper, .. } => kalmems_figures::number(*paper),
            Self::Claim { paper, .. } => paper.clone(),
        }
    }

    /// What was computed, to as many digits as show whether it is within the tolerance.
    pub fn ours(&self) -> String {
        match self {
            Self::Value { paper, ours, tolerance, .. } => {
                // Of a number that is far away no digit more is needed.
                let near = (0.5..2.0).contains(&(ours.median / paper));
                let step = if near { tolerance.in_units(*paper) } else { 0.0 };
                ours.written(|value| to_step(value, step))
            }
            Self::Claim { ours, .. } => ours.clone(),
        }
    }

    /// How the two compare: `agrees, +0.4 %`, `16 times smaller`, `holds`. Decibels are a logarithm and compared by their difference.
    pub fn comparison(&self) -> String {
        let (agrees, holds) = if self.is_circular() { ("circular", "circular") } else { ("agrees", "holds") };
        match self {
            Self::Value { paper, ours, unit, .. } => {
                let difference = if *unit == "dB" {
                    format!("{:+.1} dB", ours.median - paper)
                } else {
                    difference(*paper, ours.median)
                };
                if self.holds() { format!("{agrees}, {difference}") } else { difference }
            }
            Self::Claim { holds: true, .. } => holds.to_owned(),
            Self::Claim { holds: false, .. } => "does not hold".to_owned(),
        }
    }

    /// By what the comparison is decided: the tolerance with its reason, or the rule; and why it is circular.
    pub fn criterion(&self) -> String {
        let (criterion, given) = match self {
            Self::Value { unit, tolerance, given, .. } => (tolerance.words(unit), given),
            Self::Claim { rule, given, .. } => (rule.clone(), given),
        };
        match given {
            Some(why) => format!("{criterion}; {why}"),
            None => criterion,
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

/// Three significant digits, or so many more that a tenth of the step is seen.
fn to_step(value: f64, step: f64) -> String {
    let places = |size: f64| size.abs().portable_log10().floor();
    let needed = places(value) - places(step) + 2.0;
    if step == 0.0 || !needed.is_finite() || needed <= 3.0 {
        return with_short_numbers(&readable(value));
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // above 3, and few
    let digits = needed.min(9.0) as usize;
    let decimals = (digits as f64 - 1.0 - places(value)).max(0.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, and few
    let decimals = decimals as usize;
    if (1e-4..1e6).contains(&value.abs()) {
        format!("{value:.decimals$}")
    } else {
        format!("{value:.*e}", digits - 1)
    }
}

/// Three significant digits, with an exponent where zeros would have to be counted.
fn readable(value: f64) -> String {
    let is_plain = value == 0.0 || !value.is_finite() || (1e-4..1e6).contains(&value.abs());
    if is_plain { significant(value) } else { format!("{value:.2e}") }
}

/// A factor where it is beyond 2, else a percentage.
fn difference(paper: f64, ours: f64) -> String {
    let ratio = ours / paper;
    if !ratio.is_finite() {
        "cannot be compared".to_owned()
    } else if ratio < 0.0 {
        "of the other sign".to_owned()
    } else if ratio >= 2.0 {
        format!("{} times larger", readable(ratio))
    } else if ratio > 0.0 && ratio <= 0.5 {
        format!("{} times smaller", readable(1.0 / ratio))
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
    /// All that agrees was an input: nothing of the paper is confirmed or refuted.
    Circular,
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
        } else if checks.iter().all(Check::is_circular) {
            Self::Circular
        } else if values_agree {
            Self::Reproduced
        } else if claims.iter().all(|claim| claim.is_circular()) {
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
            Self::Circular => "circular",
            Self::DoesNotReproduce => "does not reproduce",
        }
    }
}

/// The check that says most of a verdict: the one that is furthest off, and of those that hold one that is not circular.
pub(super) fn decisive(checks: &[Check]) -> Option<&Check> {
    let key = |check: &Check| (!check.holds(), !check.is_circular());
    // Of equals the first.
    checks.iter().rev().max_by(|a, b| key(a).cmp(&key(b)).then(a.distance().total_cmp(&b.distance())))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TENTH: CheckTolerance = CheckTolerance::part(0.1, "no spread is stated");

    fn value(paper: f64, ours: f64) -> Check {
        Check::value("error", "deg", paper, SeedSpread::exact(ours), TENTH)
    }

    fn claim(holds: bool) -> Check {
        Check::claim("the second is smaller", "1.4 times", "1.0 times", "at least 1.2 times", holds)
    }

    #[test]
    fn the_verdict_follows_from_the_checks() {
        let given = |check: Check| check.circular("it was put in");
        let cases: [(&[Check], ItemVerdict); 14] = [
            (&[], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 1.09)], ItemVerdict::Reproduced),
            (&[value(-1.0, -0.91), claim(true)], ItemVerdict::Reproduced),
            (&[claim(true)], ItemVerdict::Reproduced),
            (&[value(1.0, 1.2), claim(true)], ItemVerdict::SameTrend),
            (&[value(1.0, 1.2)], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 1.0), claim(false)], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 1.0), value(1.0, 0.1)], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, f64::NAN)], ItemVerdict::DoesNotReproduce),
            (&[given(value(1.0, 1.0)), given(claim(true))], ItemVerdict::Circular),
            (&[given(value(1.0, 1.0)), value(1.0, 1.0)], ItemVerdict::Reproduced),
            (&[given(value(1.0, 1.0)), claim(true)], ItemVerdict::Reproduced),
            // What was put in and does not come out is an error, whoever made it.
            (&[given(value(1.0, 2.0))], ItemVerdict::DoesNotReproduce),
            (&[value(1.0, 2.0), given(claim(true))], ItemVerdict::DoesNotReproduce),
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
            (800.0, -9.95, "of the other sign"),
            (1.0, f64::NAN, "cannot be compared"),
            (0.0, 1.0, "cannot be compared"),
        ] {
            assert_eq!(value(paper, ours).comparison(), words);
        }
        assert_eq!(value(2.73, 2.8).criterion(), "±10 %: no spread is stated");
        let level = CheckTolerance::difference(2.0, "chance of a run");
        let level = Check::value("spurious line", "dB", -40.0, SeedSpread::exact(-38.5), level);
        assert_eq!(
            (level.comparison().as_str(), level.criterion().as_str()),
            ("agrees, +1.5 dB", "±2 dB: chance of a run")
        );
        assert_eq!(claim(true).criterion(), "at least 1.2 times");
        let given = value(2.0, 2.0).circular("it was put in");
        assert_eq!(
            (given.comparison().as_str(), given.criterion().as_str()),
            ("circular, 0.0 %", "±10 %: no spread is stated; it was put in")
        );
        assert_eq!(value(11.62, 1.06e-6).comparison(), "1.10e7 times smaller");
    }

    /// A difference as small as the tolerance is seen in the digits.
    #[test]
    fn numbers_have_the_digits_that_the_tolerance_asks_for() {
        let ours = |paper, ours, tolerance| {
            Check::value(
                "f",
                "Hz",
                paper,
                SeedSpread { median: ours, low: ours, high: ours, runs: 1 },
                tolerance,
            )
            .ours()
        };
        assert_eq!(ours(624.6, 624.599_87, CheckTolerance::digit(0.1)), "624.600");
        assert_eq!(ours(-2.407_52e7, -2.406_873_2e7, CheckTolerance::part(3e-3, "chance")), "-2.4069e7");
        assert_eq!(ours(1.0008, 0.999_97, CheckTolerance::digit(1e-4)), "0.999970");
        assert_eq!(ours(0.38, 0.024_01, TENTH), "0.0240");
        assert_eq!(ours(11.62, 1.06e-6, TENTH), "1.06e-6");
        assert_eq!(ours(4.034e-5, 15.445_849_2, TENTH), "15.4");
        assert_eq!(ours(2.0, 2.0, CheckTolerance::COUNT), "2.00");
    }

    #[test]
    fn the_decisive_check_is_the_furthest_off() {
        let checks = [value(1.0, 1.3), value(1.0, 0.2), value(1.0, 3.0)];
        assert_eq!(decisive(&checks), Some(&checks[1]));
        let checks = [value(1.0, 0.2), claim(false), claim(false)];
        assert_eq!(decisive(&checks), Some(&checks[1]));
        // What agrees because it was put in explains no verdict that others bear.
        let checks = [value(1.0, 1.09).circular("it was put in"), claim(true)];
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

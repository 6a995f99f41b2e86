//! Tests of statements about chance: of what is claimed of a mean, an order, or a distribution.

use crate::evaluate::normal_tail;

/// The level of the tests: what they find where there is nothing, in this share of all cases.
pub const LEVEL: f64 = 0.05;

/// How often one of two was better, pair by pair, and how probable as many are where neither is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignTest {
    /// Pairs in which it was.
    pub better: usize,
    /// All pairs.
    pub pairs: usize,
    /// The probability of as many or more, each pair being decided by a coin.
    pub p_value: f64,
}

impl SignTest {
    /// Of pairs; each says whether the first of it is better.
    pub fn of(pairs: impl IntoIterator<Item = bool>) -> Self {
        let (mut better, mut count) = (0, 0);
        for is_better in pairs {
            better += usize::from(is_better);
            count += 1;
        }
        Self { better, pairs: count, p_value: at_least(better, count, 0.5) }
    }

    /// Whether it is better beyond chance.
    pub fn holds(self) -> bool {
        self.p_value <= LEVEL
    }

    /// `in 18 of 20, p = 0.0002`.
    pub fn to_text(self) -> String {
        format!("in {} of {}, {}", self.better, self.pairs, p_words(self.p_value))
    }
}

/// The probability of this many successes or more of so many.
pub fn at_least(successes: usize, of: usize, probability: f64) -> f64 {
    let mut tail = 0.0;
    for k in successes..=of {
        // C(n, k)·p^k·q^(n−k), factor by factor, so that nothing overflows.
        let mut term = 1.0;
        let mut failures = of - k;
        for i in 0..k {
            term *= (of - i) as f64 / (k - i) as f64 * probability;
            while term > 1.0 && failures > 0 {
                term *= 1.0 - probability;
                failures -= 1;
            }
        }
        for _ in 0..failures {
            term *= 1.0 - probability;
        }
        tail += term;
    }
    f64::min(tail, 1.0)
}

/// Page's test of a trend: whether `N` conditions, compared in each of several runs, grow in the order in which they stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrendTest {
    /// L: the sum over runs and conditions of place times rank.
    pub weighted_ranks: f64,
    /// How probable as large a sum is where the order is one of chance.
    pub p_value: f64,
}

impl TrendTest {
    /// Page, Journal of the American Statistical Association 58, 216 (1963), with his normal approximation, corrected for
    /// continuity.
    pub fn of<const N: usize>(runs: &[[f64; N]]) -> Self {
        let mut weighted_ranks = 0.0;
        for run in runs {
            for (place, value) in run.iter().enumerate() {
                let below = run.iter().filter(|other| *other < value).count() as f64;
                let same = run.iter().filter(|other| *other == value).count() as f64;
                weighted_ranks += (place + 1) as f64 * (below + 0.5 * (same + 1.0));
            }
        }
        Self { weighted_ranks, p_value: chance_of_ranks(weighted_ranks, runs.len() as f64, N as f64) }
    }

    /// Whether it grows beyond chance.
    pub fn holds(self) -> bool {
        self.p_value <= LEVEL
    }
}

/// How probable as large a sum of ranks is in `n` runs of `k` conditions without a trend.
fn chance_of_ranks(weighted_ranks: f64, n: f64, k: f64) -> f64 {
    let mean = n * k * (k + 1.0).powi(2) / 4.0;
    let variance = n * (k * (k + 1.0)).powi(2) * (k - 1.0) / 144.0;
    normal_tail((weighted_ranks - 0.5 - mean) / variance.sqrt())
}

/// `p = 0.012`, or `p < 0.0001`.
pub fn p_words(p_value: f64) -> String {
    if p_value < 1e-4 { "p < 0.0001".to_owned() } else { format!("p = {p_value:.4}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_of_binomials() {
        // 1 − 0.95⁴, and 1/2¹⁰·(1 + 10).
        assert!((at_least(1, 4, 0.05) - (1.0 - 0.95_f64.powi(4))).abs() < 1e-15);
        assert!((at_least(9, 10, 0.5) - 11.0 / 1024.0).abs() < 1e-15);
        assert!((at_least(0, 7, 0.3) - 1.0).abs() < 1e-14);
        // Of many it neither overflows nor vanishes: half of 2000 coins, P(X ≥ n/2) = ½ + ½·P(X = n/2).
        let middle = at_least(1000, 2000, 0.5);
        assert!((middle - 0.5 - 0.5 * 0.017_839).abs() < 1e-5, "{middle}");
        let found = SignTest::of([true, true, false, true, true]);
        assert_eq!((found.better, found.pairs), (4, 5));
        assert!((found.p_value - 6.0 / 32.0).abs() < 1e-15 && !found.holds());
        assert_eq!(found.to_text(), "in 4 of 5, p = 0.1875");
    }

    /// The critical sums of Page's Table 2 for four conditions at 5 %: of 6 runs 163, of 10 runs 266.
    #[test]
    fn the_test_of_a_trend_has_pages_critical_values() {
        let ordered = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(TrendTest::of(&[ordered; 3]).weighted_ranks, 90.0);
        assert_eq!(TrendTest::of(&[[7.0; 4]; 2]).weighted_ranks, 50.0);
        for (runs, critical) in [(6.0, 163.0), (10.0, 266.0)] {
            let chance = |sum| chance_of_ranks(sum, runs, 4.0);
            assert!(chance(critical) <= LEVEL && chance(critical - 1.0) > LEVEL, "{runs}");
        }
    }

    /// Of three runs all 24³ outcomes: what the approximation says of a sum is within 0.012 of the share that reaches it.
    #[test]
    fn the_approximation_is_near_the_exact_distribution() {
        let all = permutations();
        let mut sums = Vec::new();
        for a in &all {
            for b in &all {
                for c in &all {
                    sums.push(TrendTest::of(&[*a, *b, *c]));
                }
            }
        }
        for found in sums.iter().step_by(7) {
            let reached = sums.iter().filter(|other| other.weighted_ranks >= found.weighted_ranks).count();
            let exact = reached as f64 / sums.len() as f64;
            assert!((exact - found.p_value).abs() < 0.012, "{found:?} {exact}");
        }
    }

    fn permutations() -> Vec<[f64; 4]> {
        let mut all = Vec::new();
        for a in 1..=4 {
            for b in 1..=4 {
                for c in 1..=4 {
                    let d = 10 - a - b - c;
                    if a != b && b != c && a != c && (1..=4).contains(&d) && ![a, b, c].contains(&d) {
                        all.push([a, b, c, d].map(f64::from));
                    }
                }
            }
        }
        all
    }
}

//! How the mean of a rate over a time spreads from one such time to the next: Allan's deviation and its relatives.

/// Which of the deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deviation {
    /// Allan's, from neighbouring means that do not overlap.
    Allan,
    /// Allan's from all means, overlapping: the same expectation with less spread. The usual one.
    Overlapping,
    /// The modified one, over means of means, which tells white from flicker noise of the phase.
    Modified,
    /// The modified one as a time, τ/√3 times it.
    Time,
    /// Hadamard's, from third differences: no linear drift of the rate is in it.
    Hadamard,
    /// Hadamard's from all means, overlapping.
    OverlappingHadamard,
    /// The total one: the record continued by its mirror images, for the longest times. What the mirrors take from flicker
    /// and random-walk noise is not put back.
    Total,
}

/// A deviation at one averaging time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AllanDeviation {
    /// m: how many intervals are averaged over.
    pub factor: usize,
    /// τ = m·τ₀ in s.
    pub time_s: f64,
    /// The deviation, in the unit of the rate; that of [`Deviation::Time`] in s times it.
    pub deviation: f64,
    /// How many differences it is the mean square of.
    pub terms: usize,
}

impl Deviation {
    /// The deviation of a rate that is sampled every `interval_s`, at averaging times of so many intervals.
    ///
    /// Averaging times that the record is too short for are left out. The formulas are those of Riley, Handbook of
    /// Frequency Stability Analysis (NIST Special Publication 1065, 2008), section 5.2, on the phase
    /// x_k = τ₀·Σ(rate − its mean), N of them: second differences over m intervals for Allan's, (7) to (16), third
    /// differences for Hadamard's, (17) to (19), and the doubly mirrored record for the total one, (23).
    /// The mean changes none of these differences; without it their digits last.
    pub fn of(self, rate: &[f64], interval_s: f64, factors: &[usize]) -> Vec<AllanDeviation> {
        self.of_phase(&phase(rate, interval_s), interval_s, factors)
    }

    /// The same from the phase, the rate's integral at the ends of the intervals: one value more than intervals.
    pub fn of_phase(self, phase: &[f64], interval_s: f64, factors: &[usize]) -> Vec<AllanDeviation> {
        factors.iter().filter_map(|factor| self.at(phase, interval_s, *factor)).collect()
    }

    fn at(self, phase: &[f64], interval_s: f64, factor: usize) -> Option<AllanDeviation> {
        let (m, count) = (factor, phase.len());
        if m == 0 {
            return None;
        }
        let time_s = m as f64 * interval_s;
        let averaged = |terms: usize, squares: f64, norm: f64| {
            let deviation = (squares / (norm * terms as f64)).sqrt() / time_s;
            (terms > 0).then_some(AllanDeviation { factor, time_s, deviation, terms })
        };
        let second = |i: usize| phase[i + 2 * m] - 2.0 * phase[i + m] + phase[i];
        let third = |i: usize| phase[i + 3 * m] - phase[i] - 3.0 * (phase[i + 2 * m] - phase[i + m]);
        let squares = |terms: usize, step: usize, difference: &dyn Fn(usize) -> f64| {
            (0..terms).map(|k| difference(k * step).powi(2)).sum::<f64>()
        };
        // How many pieces of this length have `after` more behind their first.
        let apart = |after: usize| (count.saturating_sub(1) / m).saturating_sub(after);
        match self {
            Self::Allan => {
                let terms = apart(1);
                averaged(terms, squares(terms, m, &second), 2.0)
            }
            Self::Overlapping => {
                let terms = count.saturating_sub(2 * m);
                averaged(terms, squares(terms, 1, &second), 2.0)
            }
            Self::Hadamard => {
                let terms = apart(2);
                averaged(terms, squares(terms, m, &third), 6.0)
            }
            Self::OverlappingHadamard => {
                let terms = count.saturating_sub(3 * m);
                averaged(terms, squares(terms, 1, &third), 6.0)
            }
            Self::Modified => {
                let terms = (count + 1).saturating_sub(3 * m);
                averaged(terms, modified(m, terms, second), 2.0 * (m as f64).powi(2))
            }
            Self::Time => Self::Modified.at(phase, interval_s, factor).map(|averaged| AllanDeviation {
                deviation: averaged.deviation * time_s / 3.0_f64.sqrt(),
                ..averaged
            }),
            Self::Total => {
                let terms = if m < count { count.saturating_sub(2) } else { 0 };
                let around = |k: usize| mirrored(phase, k, m, true) + mirrored(phase, k, m, false);
                averaged(terms, squares(terms, 1, &|k| around(k + 1) - 2.0 * phase[k + 1]), 2.0)
            }
        }
    }
}

/// Averaging factors 1, 2, 4, … up to half of so many samples.
pub fn octaves(samples: usize) -> Vec<usize> {
    std::iter::successors(Some(1_usize), |m| m.checked_mul(2)).take_while(|m| 2 * m <= samples).collect()
}

/// x_0 = 0 and x_k = τ₀·Σ(rate − mean).
pub(super) fn phase(rate: &[f64], interval_s: f64) -> Vec<f64> {
    let mean = rate.iter().sum::<f64>() / rate.len().max(1) as f64;
    let mut sum = 0.0;
    let rest = rate.iter().map(|rate| {
        sum += (rate - mean) * interval_s;
        sum
    });
    std::iter::once(0.0).chain(rest).collect()
}

/// Σ(Σ second differences over m)², each sum from the one before.
fn modified(m: usize, terms: usize, second: impl Fn(usize) -> f64) -> f64 {
    let mut squares = 0.0;
    let mut sum = 0.0;
    for k in 0..terms {
        if k % m == 0 {
            // From the start again, before what is added and taken away leaves its rounding.
            sum = (k..k + m).map(&second).sum();
        } else {
            sum += second(k + m - 1) - second(k - 1);
        }
        squares += sum * sum;
    }
    squares
}

/// The phase m after or before k, in the record continued by its mirror images about its ends.
fn mirrored(phase: &[f64], k: usize, m: usize, later: bool) -> f64 {
    let last = phase.len() - 1;
    match (later, k.checked_sub(m)) {
        (true, _) if k + m <= last => phase[k + m],
        (true, _) => 2.0 * phase[last] - phase[2 * last - k - m],
        (false, Some(at)) => phase[at],
        (false, None) => 2.0 * phase[0] - phase[m - k],
    }
}

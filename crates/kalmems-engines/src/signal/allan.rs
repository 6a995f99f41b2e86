//! How the mean of a rate over a time spreads from one such time to the next: Allan's deviation and its relatives.

use std::collections::BTreeMap;

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
        if factor == 0 {
            return None;
        }
        let time_s = factor as f64 * interval_s;
        if let Self::Allan | Self::Hadamard = self {
            // Means that do not overlap are neighbours in every m-th phase.
            let sparse: Vec<f64> = phase.iter().copied().step_by(factor).collect();
            let all = if self == Self::Allan { Self::Overlapping } else { Self::OverlappingHadamard };
            let found = all.at(&sparse, time_s, 1)?;
            return Some(AllanDeviation { factor, ..found });
        }
        if self == Self::Total {
            let terms = if factor < phase.len() { phase.len().saturating_sub(2) } else { 0 };
            let around = |k: usize| {
                mirrored(phase, k, factor, true) + mirrored(phase, k, factor, false) - 2.0 * phase[k]
            };
            let squares: f64 = (1..=terms).map(|k| around(k).powi(2)).sum();
            let deviation = (squares / (2 * terms) as f64).sqrt() / time_s;
            return (terms > 0).then_some(AllanDeviation { factor, time_s, deviation, terms });
        }
        let mut sums = DifferenceSums::new(factor, 1);
        sums.advance(phase, &[], true);
        self.of_sums(&sums, interval_s, interval_s)
    }

    /// The deviation that sums tell, of a phase in units of `unit` times the rate.
    pub(super) fn of_sums(self, sums: &DifferenceSums, unit: f64, interval_s: f64) -> Option<AllanDeviation> {
        let factor = sums.step * sums.spacing;
        let [squares, terms] = match self {
            Self::Total => sums.total()?,
            _ => sums.of_kind(self.kind()),
        };
        let averages = if self.kind() == AVERAGED { sums.step as f64 } else { 1.0 };
        let norm = NORMS[self.kind()] * averages * averages;
        let time_s = factor as f64 * interval_s;
        let deviation = (squares / (norm * terms)).sqrt() / (factor as f64 * unit);
        let deviation = if self == Self::Time { deviation * time_s / 3.0_f64.sqrt() } else { deviation };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count
        let terms = terms as usize;
        (terms > 0).then_some(AllanDeviation { factor, time_s, deviation, terms })
    }

    const fn kind(self) -> usize {
        match self {
            Self::Allan | Self::Overlapping | Self::Total => SECOND,
            Self::Hadamard | Self::OverlappingHadamard => THIRD,
            Self::Modified | Self::Time => AVERAGED,
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

/// Second differences, third ones, and second ones averaged over the averaging time; and the mean square of each in units of the variance.
const SECOND: usize = 0;
const THIRD: usize = 1;
const AVERAGED: usize = 2;
const NORMS: [f64; 3] = [2.0, 6.0, 2.0];

/// A mean counts if at most one in so many of its samples is missing.
const TOLERATED: usize = 10;

/// The sums of the squared differences of a phase over so many of its steps.
#[derive(Clone)]
pub(super) struct DifferenceSums {
    step: usize,
    /// Samples from one phase to the next.
    spacing: usize,
    /// Of differences without a missing sample, and of all that count.
    of: [SquareSums; 2],
    /// Of the differences that reach over the ends of a stretch, in its mirror images; their number; and of which numbers of phases.
    mirrored: (f64, usize),
    mirrored_phases: Vec<usize>,
    /// Whether there is a stretch with samples missing at its ends.
    open: bool,
}

#[derive(Clone, Default)]
struct SquareSums {
    squares: [f64; 3],
    terms: [usize; 3],
    /// Second differences that followed one another until now, and how often so many did.
    run: usize,
    runs: BTreeMap<usize, usize>,
}

impl SquareSums {
    fn add(&mut self, kind: usize, square: f64) {
        self.squares[kind] += square;
        self.terms[kind] += 1;
    }

    fn end_run(&mut self) {
        if self.run > 0 {
            *self.runs.entry(self.run).or_default() += 1;
        }
        self.run = 0;
    }
}

impl DifferenceSums {
    pub fn new(step: usize, spacing: usize) -> Self {
        let of = [SquareSums::default(), SquareSums::default()];
        Self { step, spacing, of, mirrored: (0.0, 0), mirrored_phases: Vec::new(), open: false }
    }

    pub const fn step(&self) -> usize {
        self.step
    }

    pub const fn has_terms(&self) -> bool {
        self.of[1].terms[SECOND] > 0
    }

    /// The sums that count: those of differences without a missing sample, where these are half of all or more.
    const fn chosen(&self) -> &SquareSums {
        let [complete, all] = &self.of;
        if 2 * complete.terms[SECOND] >= all.terms[SECOND] { complete } else { all }
    }

    /// The sum of the squares and their number.
    fn of_kind(&self, kind: usize) -> [f64; 2] {
        let chosen = self.chosen();
        [chosen.squares[kind], chosen.terms[kind] as f64]
    }

    /// The same with the mirror images; none where a stretch has no whole ends.
    fn total(&self) -> Option<[f64; 2]> {
        let [squares, terms] = self.of_kind(SECOND);
        let (at_ends, count) = self.mirrored;
        (!self.open).then_some([squares + at_ends, terms + count as f64])
    }

    /// The numbers of phases of the stretches that were mirrored.
    pub fn mirrored_phases(&self) -> impl Iterator<Item = usize> + '_ {
        self.mirrored_phases.iter().map(|phases| (phases - 1) * self.spacing + 1)
    }

    /// Lengths in samples of stretches of differences that follow one another, and how often each is there.
    pub fn stretches(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let of = |(run, count): (&usize, &usize)| ((run - 1 + 2 * self.step) * self.spacing, *count);
        self.chosen().runs.iter().map(of)
    }

    /// Forms the differences that begin at the first of these phases and at the following ones, up to the last from which a third difference
    /// fits, and where the phases end all of them. `missing` counts the samples that are missing until each phase; empty if none is.
    pub fn advance(&mut self, phase: &[f64], missing: &[u32], ends: bool) {
        if missing.first() == missing.last() {
            self.complete(phase, ends);
        } else {
            self.with_missing(phase, missing, ends);
        }
        if ends {
            self.of.iter_mut().for_each(SquareSums::end_run);
        }
    }

    fn complete(&mut self, phase: &[f64], ends: bool) {
        let m = self.step;
        let count = phase.len().saturating_sub(3 * m);
        let second = |k: usize| (phase[k + 2 * m] - phase[k + m]) - (phase[k + m] - phase[k]);
        let (mut squares, mut terms) = ([0.0; 3], [count; 3]);
        if phase.len() >= 3 * m {
            let mut averaged: f64 = (0..m).map(second).sum();
            let later = phase[m..].iter().zip(&phase[2 * m..]).zip(&phase[3 * m..]);
            for (a, ((b, c), d)) in phase.iter().zip(later) {
                let (first, middle, last) = (b - a, c - b, d - c);
                let second = middle - first;
                let third = (last - middle) - second;
                squares[SECOND] += second * second;
                squares[THIRD] += third * third;
                squares[AVERAGED] += averaged * averaged;
                averaged += third;
            }
            if ends {
                squares[AVERAGED] += averaged * averaged;
                terms[AVERAGED] += 1;
            }
        }
        if ends {
            terms[SECOND] = phase.len().saturating_sub(2 * m);
            squares[SECOND] += (count..terms[SECOND]).map(|k| second(k).powi(2)).sum::<f64>();
        }
        for sums in &mut self.of {
            for kind in [SECOND, THIRD, AVERAGED] {
                sums.squares[kind] += squares[kind];
                sums.terms[kind] += terms[kind];
            }
            sums.run += terms[SECOND];
        }
    }

    fn with_missing(&mut self, phase: &[f64], missing: &[u32], ends: bool) {
        let m = self.step;
        let samples = m * self.spacing;
        let gone = |from: usize, to: usize| missing[to].wrapping_sub(missing[from]) as usize;
        // The mean times the averaging time; none of too few samples.
        let mean = |from: usize| {
            let gone = gone(from, from + m);
            let there = samples as f64 / (samples - gone.min(samples - 1)) as f64;
            (TOLERATED * gone <= samples).then(|| (phase[from + m] - phase[from]) * there)
        };
        let second = |from: usize| Some(mean(from + m)? - mean(from)?);
        // The variance of white noise is larger by the samples that are missing.
        let weight =
            |from: usize, to: usize| 1.0 - gone(from, to) as f64 / ((to - from) * self.spacing) as f64;
        let count = phase.len().saturating_sub(3 * m);
        let starts = if ends { phase.len().saturating_sub(2 * m) } else { count };
        let has_average = phase.len() >= 3 * m;
        let [complete, all] = &mut self.of;
        let (mut averaged, mut summed) = (0.0, 0);
        for difference in (0..if has_average { m } else { 0 }).filter_map(second) {
            averaged += difference;
            summed += 1;
        }
        for start in 0..starts {
            let mut add = |kind: usize, difference: f64, last: usize| {
                let square = weight(start, last) * difference * difference;
                all.add(kind, square);
                if gone(start, last) == 0 {
                    complete.add(kind, square);
                }
            };
            let here = second(start);
            if let Some(difference) = here {
                add(SECOND, difference, start + 2 * m);
            }
            if summed == m && has_average && (start < count || (start == count && ends)) {
                add(AVERAGED, averaged, start + 3 * m - 1);
            }
            if start < count {
                let next = second(start + m);
                if let (Some(here), Some(next)) = (here, next) {
                    add(THIRD, next - here, start + 3 * m);
                }
                averaged += next.unwrap_or(0.0) - here.unwrap_or(0.0);
                summed = summed + usize::from(next.is_some()) - usize::from(here.is_some());
            }
            for (sums, follows) in
                [(&mut *complete, gone(start, start + 2 * m) == 0), (&mut *all, here.is_some())]
            {
                if follows { sums.run += 1 } else { sums.end_run() }
            }
        }
    }

    /// The differences in the mirror images of a stretch of so many phases, by its beginning and its end of twice the averaging time each; none
    /// where samples are missing there.
    pub fn mirror(&mut self, ends: Option<(&[f64], &[f64])>, phases: usize) {
        let Some((head, tail)) = ends else {
            self.open = true;
            return;
        };
        let m = self.step;
        let last = tail.len() - 1;
        let squares = (1..m).map(|k| {
            let at_head = 2.0 * head[0] - head[m - k] - 2.0 * head[k] + head[k + m];
            let at_tail = 2.0 * tail[last] - tail[last - (m - k)] - 2.0 * tail[last - k] + tail[last - k - m];
            at_head * at_head + at_tail * at_tail
        });
        self.mirrored.0 += squares.sum::<f64>();
        self.mirrored.1 += 2 * (m - 1);
        self.mirrored_phases.push(phases);
    }
}

//! Values that stay the same in the middle of a signal that moves: a converter that hung, a transfer that repeated a block.
//!
//! A signal that is rounded coarsely repeats its values as well. So a run of rows counts only where its neighbours tell that it cannot be:
//! of the differences of consecutive rows before and after it half are three steps of rounding at least, and white noise as large as that
//! repeats a value sixteen times once in 10¹³ rows. The step is the smallest difference that the column has shown; one that is found
//! later is smaller, so that what counts once counts for ever.

/// The shortest run of equal rows that counts, and the differences on either side that are looked at.
pub const STUCK_RUN: usize = 16;
/// Steps of rounding that half of the differences beside it have to be.
const STEPS: f64 = 3.0;
/// Runs that are kept; those behind are counted.
const KEPT: usize = 1 << 10;

/// A run of equal rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EqualRows {
    /// Its first row, and how many it has.
    pub(super) start: usize,
    pub(super) rows: usize,
    pub(super) value: f64,
    pub(super) segment: usize,
    /// The line of its first row.
    pub(super) line: usize,
}

/// Looks for such runs in one column, row by row.
#[derive(Default)]
pub(super) struct StuckValues {
    last: Option<f64>,
    /// The last differences of consecutive rows before the present run, in a ring, and how many there were.
    before: [f64; STUCK_RUN],
    known: usize,
    step: f64,
    /// Where the present run began, its line, and its rows.
    present: Option<(usize, usize, usize)>,
    /// A run whose rows after it are not all there.
    waiting: Option<(EqualRows, Vec<f64>)>,
    found: Vec<EqualRows>,
    /// How many of these were told while the values came.
    told: usize,
    /// Rows whose value is that of the row before.
    repeated: usize,
}

impl StuckValues {
    /// The next value, of this row; `line` is asked for where a run begins to count.
    pub(super) fn take(&mut self, value: f64, (row, segment): (usize, usize), line: impl Fn(usize) -> usize) {
        let Some(last) = self.last.replace(value).filter(|last| last.is_finite() && value.is_finite()) else {
            return self.interrupt_for(value);
        };
        let difference = (value - last).abs();
        if difference > 0.0 && (self.step == 0.0 || difference < self.step) {
            self.step = difference;
        }
        if let Some((run, after)) = &mut self.waiting {
            after.push(difference);
            if after.len() == STUCK_RUN {
                if is_moving(after.iter().copied(), self.step) && self.found.len() < KEPT {
                    self.found.push(*run);
                }
                self.waiting = None;
            }
        }
        if difference == 0.0 {
            self.repeated += 1;
            let (_, at, rows) = self.present.get_or_insert((row - 1, 0, 1));
            *rows += 1;
            if *rows == STUCK_RUN {
                *at = line(row + 1 - STUCK_RUN);
            }
            return;
        }
        let run = self.present.take();
        if let Some((start, line, rows)) = run.filter(|(_, _, rows)| *rows >= STUCK_RUN) {
            if self.known >= STUCK_RUN && is_moving(self.before.iter().copied(), self.step) {
                let run = EqualRows { start, rows, value: last, segment, line };
                self.waiting = Some((run, vec![difference]));
            }
            self.known = 0;
        } else {
            // Rows that repeated less often are differences of 0.
            let repeated = run.map_or(0, |(_, _, rows)| rows - 1);
            (0..repeated).for_each(|_| self.push(0.0));
        }
        self.push(difference);
    }

    /// Where a value is missing, or a stretch ends, nothing goes on.
    pub(super) fn interrupt(&mut self) {
        self.last = None;
        self.interrupt_for(f64::NAN);
    }

    fn interrupt_for(&mut self, value: f64) {
        if !value.is_finite() {
            self.last = None;
        }
        self.known = 0;
        (self.present, self.waiting) = (None, None);
    }

    fn push(&mut self, difference: f64) {
        self.before[self.known % STUCK_RUN] = difference;
        self.known += 1;
    }

    /// Rows whose value is that of the row before.
    pub(super) const fn repeated(&self) -> usize {
        self.repeated
    }

    /// The next run that was found and not told yet, as far as it is between these levels now.
    pub(super) fn next_between(&mut self, levels: [f64; 2]) -> Option<EqualRows> {
        loop {
            let run = *self.found.get(self.told)?;
            self.told += 1;
            if counts(&run, levels) {
                return Some(run);
            }
        }
    }

    /// The runs at neither the lowest nor the highest value, which may be those of a rail, nor at 0, which is what a generator shows that is
    /// switched off.
    pub(super) fn finish(self, levels: [f64; 2]) -> Vec<EqualRows> {
        self.found.into_iter().filter(|run| counts(run, levels)).collect()
    }
}

fn counts(run: &EqualRows, [low, high]: [f64; 2]) -> bool {
    run.value > low && run.value < high && run.value != 0.0
}

/// Whether half of these differences are some steps at least.
fn is_moving(differences: impl Iterator<Item = f64>, step: f64) -> bool {
    let large = differences.filter(|difference| *difference >= STEPS * step).count();
    step > 0.0 && 2 * large >= STUCK_RUN
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nearly normal numbers of variance 1: sums of twelve that are uniform, by a linear congruence.
    struct NearlyNormal(u64);

    impl NearlyNormal {
        fn sample(&mut self) -> f64 {
            let mut uniform = || {
                self.0 =
                    self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                f64::from(u32::try_from(self.0 >> 32).unwrap()) / f64::from(u32::MAX)
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    fn found(values: &[f64]) -> Vec<(usize, usize)> {
        let mut stuck = StuckValues::default();
        for (row, value) in values.iter().enumerate() {
            stuck.take(*value, (row, 0), |row| row + 2);
        }
        let numbers = || values.iter().copied().filter(|value| value.is_finite());
        let extremes = [numbers().fold(f64::INFINITY, f64::min), numbers().fold(f64::NEG_INFINITY, f64::max)];
        let runs = stuck.finish(extremes);
        assert!(runs.iter().all(|run| run.line == run.start + 2), "{runs:?}");
        runs.into_iter().map(|run| (run.start, run.rows)).collect()
    }

    /// A sine with noise, rounded to steps of 1.
    fn rounded(amplitude: f64, noise: f64) -> Vec<f64> {
        let mut chance = NearlyNormal(3);
        (0..20_000)
            .map(|k| (amplitude * (0.01 * f64::from(k)).sin() + noise * chance.sample()).round())
            .collect()
    }

    #[test]
    fn a_stuck_value_is_found_where_the_signal_moves() {
        for (amplitude, noise) in [(1000.0, 5.0), (3e5, 0.0), (0.0, 40.0)] {
            let mut values = rounded(amplitude, noise);
            assert_eq!(found(&values), [], "{amplitude} {noise}");
            // On a flank, and for long.
            let held = values[3001];
            values[3001..3041].fill(held);
            let held = values[9000];
            values[9000..9500].fill(held);
            assert_eq!(found(&values), [(3001, 40), (9000, 500)], "{amplitude} {noise}");
        }
    }

    #[test]
    fn coarse_steps_levels_and_slow_channels_are_none() {
        // Steps that are coarse against the noise, and turning points.
        for (amplitude, noise) in [(3.0, 0.1), (50.0, 0.3), (0.4, 0.4), (2000.0, 0.0)] {
            assert_eq!(found(&rounded(amplitude, noise)), [], "{amplitude} {noise}");
        }
        // Two levels, and a channel that is sampled more slowly than it is written.
        let levels: Vec<f64> = (0..4000).map(|k| f64::from(k / 50 % 2)).collect();
        let slow: Vec<f64> = (0..9000).map(|k| (f64::from(k / 20) * 0.3).sin()).collect();
        assert!(found(&levels).is_empty() && found(&slow).is_empty());
        // A generator that is switched on and off.
        let switched: Vec<f64> =
            (0..9000).map(|k| if k / 1500 % 2 == 0 { 0.0 } else { (f64::from(k) * 0.3).sin() }).collect();
        assert!(found(&switched).is_empty());
        // Missing values tell nothing of what is beside them.
        let mut missing = rounded(1000.0, 5.0);
        missing[4000..4010].fill(f64::NAN);
        let held = missing[4010];
        missing[4010..4050].fill(held);
        assert!(found(&missing).is_empty());
    }
}

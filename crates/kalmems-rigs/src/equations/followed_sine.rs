//! The sine of the drive while a record goes on.

use crate::signal::{Sine, fit_sine};
use kalmems_core::Portable;
use kalmems_core::{Covariance, Ldl, Mat};
use std::f64::consts::TAU;
use std::ops::Range;

/// The sine that a drive follows, told from what came before.
///
/// In the head of a record it is the sine that fits the head best. After it, each block of rows has the sine that the head
/// and the blocks before it tell: by its residuals a block says how far its amplitude, offset and phase are off, and
/// amplitude and offset become the mean of what was seen, phase and frequency the straight line through the phases. The
/// line's recursive form needs no block twice (the gains of a polynomial of first degree with growing memory; Brookner,
/// Tracking and Kalman Filtering Made Easy, 1998, chapter 5). After [`MEMORY`] blocks the gains stay, so that a generator may
/// drift.
#[derive(Clone, Debug)]
pub struct DriveSine {
    /// That of each block that a row may still be asked for, from its first row on, counted from the record's first.
    sines: Vec<(usize, Sine)>,
    /// Rows that were taken, and those of a block.
    rows: usize,
    block: usize,
    /// From how many blocks the sine is known, and the time of the middle of the last of them in s.
    blocks: f64,
    middle_s: f64,
    /// The present block.
    present: SineBlock,
}

/// Over how many blocks a sine is known at most.
const MEMORY: f64 = 64.0;

/// What is summed over a block: the residuals r of a sine of phase ψ, and their products with cos ψ and sin ψ.
#[derive(Clone, Copy, Debug, Default)]
struct SineBlock {
    rows: usize,
    first_s: f64,
    /// Σ of cos, sin, cos², cos·sin, r, r·cos, r·sin and r².
    sums: [f64; 8],
}

impl SineBlock {
    fn add(&mut self, sine: &Sine, time_s: f64, volts: f64) {
        let (s, c) = (TAU * sine.frequency_hz * time_s + sine.phase_rad).portable_sin_cos();
        let r = volts - (sine.offset + sine.amplitude * c);
        if self.rows == 0 {
            self.first_s = time_s;
        }
        self.rows += 1;
        for (sum, term) in self.sums.iter_mut().zip([c, s, c * c, c * s, r, r * c, r * s, r * r]) {
            *sum += term;
        }
    }

    /// Offset, cosine and sine that fit the residuals best; `None` where the rows do not determine them.
    fn fitted(&self) -> Option<[f64; 3]> {
        let n = self.rows as f64;
        let [c, s, cc, cs, r, rc, rs, _] = self.sums;
        let ldl = Ldl::of(&Covariance::from_lower(Mat([[n, 0.0, 0.0], [c, cc, 0.0], [s, cs, n - cc]])));
        let found: [f64; 3] = ldl.solve(&[r, rc, rs]);
        (ldl.positive && found.iter().all(|value| value.is_finite())).then_some(found)
    }

    /// The root mean square of what the sine left.
    fn residual_rms(&self) -> f64 {
        let [.., squares] = self.sums;
        (squares / self.rows.max(1) as f64).sqrt()
    }
}

/// The numbers that a sine and what it is known from are written as.
pub const NUMBERS: usize = 19;

impl DriveSine {
    /// From the head of a record, its samples with the usual interval; blocks have so many rows. `None` where the head follows
    /// no steady sine.
    pub fn of_head(time_s: &[f64], volts: &[f64], (interval_s, block): (f64, usize)) -> Option<Self> {
        let sine = fit_sine(time_s, volts, interval_s).filter(Sine::is_steady)?;
        let (rows, block) = (time_s.len(), block.max(1));
        Some(Self {
            sines: vec![(0, sine)],
            rows,
            block,
            blocks: (rows as f64 / block as f64).clamp(1.0, MEMORY),
            middle_s: time_s.last()? - 0.5 * interval_s * rows.min(block) as f64,
            present: SineBlock::default(),
        })
    }

    /// The present one.
    pub fn sine(&self) -> Sine {
        // There is always one.
        self.sines.last().map_or(NOTHING, |(_, sine)| *sine)
    }

    /// Takes new rows of the record; those that were taken with the head are passed over. `Err` is the time in s of a block
    /// that leaves more of the drive than a steady sine does.
    pub fn take(&mut self, time_s: &[f64], volts: &[f64], fresh: Range<usize>) -> Result<(), f64> {
        for k in fresh {
            let sine = self.sine();
            self.present.add(&sine, time_s[k], volts[k]);
            self.rows += 1;
            if self.present.rows < self.block {
                continue;
            }
            let block = std::mem::take(&mut self.present);
            if !(Sine { residual_rms: block.residual_rms(), ..sine }).is_steady() {
                return Err(block.first_s);
            }
            let middle_s = block.first_s.midpoint(time_s[k]);
            self.sines.push((self.rows, self.moved(&sine, &block, middle_s)));
            self.middle_s = middle_s;
            self.blocks = (self.blocks + 1.0).min(MEMORY);
        }
        Ok(())
    }

    /// The sine after another block.
    fn moved(&self, sine: &Sine, block: &SineBlock, middle_s: f64) -> Sine {
        let Some([offset, cosine, sine_part]) = block.fitted() else { return *sine };
        let (along, k) = (sine.amplitude + cosine, self.blocks);
        // (A + a)·cos ψ + b·sin ψ.
        let ahead = (-sine_part).portable_atan2(along);
        let (position, rate) =
            (2.0 * (2.0 * k + 1.0) / ((k + 1.0) * (k + 2.0)), 6.0 / ((k + 1.0) * (k + 2.0)));
        let frequency_hz = sine.frequency_hz + rate * ahead / (TAU * (middle_s - self.middle_s));
        let turns = (sine.frequency_hz - frequency_hz) * middle_s;
        let phase_rad = sine.phase_rad + position * ahead + TAU * turns;
        Sine {
            offset: sine.offset + offset / (k + 1.0),
            amplitude: sine.amplitude + (along.portable_hypot(sine_part) - sine.amplitude) / (k + 1.0),
            frequency_hz,
            phase_rad: phase_rad - TAU * (phase_rad / TAU).round(),
            residual_rms: block.residual_rms(),
        }
    }

    /// The sines of the rows of a part that begins so many rows before the next one, each with the rows that it is for;
    /// those of earlier rows are forgotten.
    pub fn over(&mut self, before: usize, rows: usize) -> Vec<(Range<usize>, Sine)> {
        let first = self.rows.saturating_sub(before);
        let unused = self.sines.iter().skip(1).take_while(|(from, _)| *from <= first).count();
        self.sines.drain(..unused);
        let starts = || self.sines.iter().map(|(from, _)| from.saturating_sub(first).min(rows));
        let ends = starts().skip(1).chain([rows]);
        starts().zip(ends).map(|(from, to)| from..to).zip(self.sines.iter().map(|(_, sine)| *sine)).collect()
    }

    /// From what another run left.
    pub fn resumed(numbers: &[f64]) -> Option<Self> {
        let numbers: [f64; NUMBERS] = numbers.try_into().ok()?;
        let [offset, amplitude, frequency_hz, phase_rad, residual_rms, rest @ ..] = numbers;
        let [block, blocks, middle_s, present, first_s, rows, sums @ ..] = rest;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts, saturating
        let count = |number: f64| number as usize;
        Some(Self {
            sines: vec![(0, Sine { offset, amplitude, frequency_hz, phase_rad, residual_rms })],
            rows: count(rows),
            block: count(block).max(1),
            blocks,
            middle_s,
            present: SineBlock { rows: count(present), first_s, sums },
        })
    }

    /// All that another run needs to go on.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let Sine { offset, amplitude, frequency_hz, phase_rad, residual_rms } = self.sine();
        let (block, rows, first_s) = (self.block as f64, self.present.rows as f64, self.present.first_s);
        let sine = [offset, amplitude, frequency_hz, phase_rad, residual_rms];
        let place = [block, self.blocks, self.middle_s, rows, first_s, self.rows as f64];
        let mut all = sine.into_iter().chain(place).chain(self.present.sums);
        std::array::from_fn(|_| all.next().unwrap_or(0.0))
    }
}

/// By how much of its amplitude a drive has left its sine.
const LEFT: f64 = 0.1;

/// The time in s of the first sample in which a drive has left a sine; `None` where it changes too slowly for that.
pub fn leaves_at(sine: &Sine, time_s: &[f64], volts: &[f64]) -> Option<f64> {
    let has_left =
        |(time_s, volts): &(&f64, &f64)| (*volts - sine.at(**time_s)).abs() > LEFT * sine.amplitude;
    time_s.iter().zip(volts).find(has_left).map(|(time_s, _)| *time_s)
}

/// No sine.
const NOTHING: Sine =
    Sine { offset: 0.0, amplitude: 0.0, frequency_hz: 0.0, phase_rad: 0.0, residual_rms: 0.0 };

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    const INTERVAL: f64 = 1.6e-6;
    const BLOCK: usize = 4096;
    /// Of a drive of 1 V, in V.
    const NOISE: f64 = 3e-4;

    /// The root mean square of how far the sines of the rows after the head are from the drive without its noise, in V; the
    /// sines are found in parts of this length.
    fn off(rows: usize, length: usize, truth: impl Fn(f64) -> f64, seed: u64) -> (f64, DriveSine) {
        let mut noise = WhiteNoise::new(seed, 0);
        let time: Vec<f64> = (0..rows).map(|k| 3.0 + k as f64 * INTERVAL).collect();
        let volts: Vec<f64> = time.iter().map(|t| truth(*t) + NOISE * noise.sample()).collect();
        let head = (INTERVAL, BLOCK);
        let mut drive = DriveSine::of_head(&time[..BLOCK], &volts[..BLOCK], head).unwrap();
        let (mut sum, mut from) = (0.0, BLOCK);
        while from < rows {
            let end = (from + length).min(rows);
            let before = from.min(100);
            // A part has some rows before, and one after.
            let there = from - before..(end + 1).min(rows);
            let (t, v) = (&time[there.clone()], &volts[there.clone()]);
            drive.take(t, v, before..before + end - from).unwrap();
            for (rows, sine) in drive.over(before + end - from, there.len()) {
                let fresh = rows.start.max(before)..rows.end.min(before + end - from);
                for t in t.get(fresh).unwrap_or_default() {
                    sum += (sine.at(*t) - truth(*t)).powi(2);
                }
            }
            // As another run would.
            let left = drive.numbers();
            drive = DriveSine { sines: drive.sines, ..DriveSine::resumed(&left).unwrap() };
            from = end;
        }
        ((sum / (rows - BLOCK) as f64).sqrt(), drive)
    }

    /// Offset, amplitude and the line through k phases tell the next block: with variances of one, two and two times R/N,
    /// which are worth one times each in the voltage, and the line's prediction 2(2k + 1)/(k(k − 1)) times that of a phase, and
    /// 1/(k(k² − 1)) more over a block's length. The head alone knows its frequency to 24·R/N over the square of its duration.
    #[test]
    fn a_steady_drive_is_known_from_all_that_was_seen_of_it() {
        let truth = |t: f64| 0.013 + (TAU * 1700.0 * t + 0.3).cos();
        let rows = 61 * BLOCK;
        let (mean, all) = (0..32).fold((0.0, Vec::new()), |(sum, mut all), seed| {
            let (rms, drive) = off(rows, 10_007, truth, seed);
            all.push(drive.sine());
            (sum + rms * rms / 32.0, all)
        });
        let one = NOISE * NOISE / BLOCK as f64;
        let ahead = |k: f64| {
            let line = if k < 2.0 { 14.0 } else { (4.0 * k + 2.0 + 1.0 / (k + 1.0)) / (k * (k - 1.0)) };
            one * (1.0 / k + 1.0 / k + line)
        };
        let expected = (1..=60).map(|k| ahead(f64::from(k))).sum::<f64>() / 60.0;
        println!("{:.3e} V rms, {:.3e} expected", mean.sqrt(), expected.sqrt());
        // 100 seeds are 5 % above; 32 know it to 7 %.
        assert!((0.85..1.2).contains(&(mean / expected).sqrt()), "{mean} {expected}");
        for sine in all {
            // A line through 61 phases: √(24·R/N/61³) over 2π·6.6 ms is 1.2 µHz.
            assert!((sine.frequency_hz - 1700.0).abs() < 6e-6, "{sine:?}");
            assert!((sine.amplitude - 1.0).abs() < 5e-6 && (sine.offset - 0.013).abs() < 5e-6, "{sine:?}");
        }
    }

    /// Whatever the parts, and whoever goes on, the sines are the same to the last bit.
    #[test]
    fn the_parts_do_not_matter() {
        let truth = |t: f64| (TAU * 1700.0 * t + 0.3).cos();
        let bits = |length: usize| {
            let (rms, drive) = off(9 * BLOCK + 77, length, truth, 5);
            (rms.to_bits(), drive.numbers().map(f64::to_bits))
        };
        let whole = bits(usize::MAX / 2);
        for length in [1000, 4096, 9999] {
            assert_eq!(bits(length), whole);
        }
    }

    /// A generator that drifts by a millihertz in a second is followed; one that jumps is told.
    #[test]
    fn a_drift_of_the_drive_is_followed_and_a_jump_is_reported() {
        let drifting = |t: f64| (TAU * (1700.0 * t + 0.5e-3 * (t - 3.0).powi(2)) + 0.3).cos();
        let (rms, _) = off(300 * BLOCK, 65_536, drifting, 1);
        println!("{rms:.3e} V rms");
        // What the gains that stay follow late by, 2π·ḟ·T²·(k + 1)·(k + 2)/6 at k = 64, is 0.2 mrad.
        assert!(rms < 3e-4, "{rms}");
        let time: Vec<f64> = (0..4 * BLOCK).map(|k| k as f64 * INTERVAL).collect();
        let volts: Vec<f64> = (time.iter().enumerate())
            .map(|(k, t)| (TAU * 1700.0 * t + if k > 2 * BLOCK + 2000 { 0.1 } else { 0.0 }).cos())
            .collect();
        let mut drive = DriveSine::of_head(&time[..BLOCK], &volts[..BLOCK], (INTERVAL, BLOCK)).unwrap();
        assert_eq!(drive.take(&time, &volts, BLOCK..4 * BLOCK), Err(time[2 * BLOCK]));
    }
}

//! Whether there is anything in a signal but noise.

use kalmems_core::Portable;
use std::f64::consts::TAU;

/// Cycles of the motion that are judged together.
pub const CYCLES: usize = 50;

/// The highest harmonic of the motion that is looked at. The signal of an electrode that senses both directions alike has the
/// even ones alone.
const HARMONICS: usize = 4;

/// The share of windows of white noise in which something is found.
pub const FOUND_BY_CHANCE: f64 = 1e-9;

/// The share of a cycle's samples that must be there for it to be looked at.
const PRESENT: f64 = 0.75;

/// A cycle with so many times the median square of the amplitudes has an absurd sample, such as one of 1000 V, and is left out; noise has such a
/// cycle less than once in 10²⁰. If more than one cycle in ten is such, the signal has become another one, and all are taken.
const DISTURBED: f64 = 16.0;
const DISTURBED_SHARE: usize = 10;

/// Samples of a cycle at least; fewer tell nothing of it.
const LEAST: f64 = 6.0;

/// Watches whether a signal has something at the harmonics of the motion.
///
/// Each cycle of the motion has an amplitude \\(c_j\\) with a phase at each harmonic, by its samples less their mean. Of noise, \\(c_j\\) and
/// \\(c_{j+1}\\) have nothing to do with each other; of a motion they are alike but for a turn that is the same from cycle to
/// cycle, whether its frequency is known well or not. So what is compared is
/// \\(\rho = |\sum c_{j+1}\,\bar c_j| / \sum |c_j|^2\\) over a window of [`CYCLES`]: near 1 for a motion, and of noise, of whatever variance
/// and smooth spectrum, above \\(r\\) with a probability of about \\(e^{-n r^2}\\), \\(n\\) being the number of pairs.
#[derive(Default)]
pub struct NoiseWatch {
    axes: Vec<AxisContent>,
    /// Whether it was said that there is only noise.
    raised: bool,
}

/// A change of what is in the signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalContent {
    /// When the window ended that shows it, in s.
    pub time_s: f64,
    /// Whether there is nothing but noise.
    pub noise_only: bool,
}

/// The signal at the harmonics of one axis.
struct AxisContent {
    frequency_hz: f64,
    start_s: f64,
    interval_s: f64,
    /// The present cycle by its number, and its sums.
    number: f64,
    cycle: CycleSums,
    /// Whether the next cycle follows the one before without a pause.
    follows: bool,
    /// The amplitudes of the window's cycles, and whether each follows the one before; that before the window stands first.
    window: Vec<(CycleAmplitudes, bool)>,
    /// What the last window showed: the ratio of each harmonic, and whether there was anything.
    ratios: [f64; HARMONICS],
    found: Option<bool>,
}

type RealAndImaginary = [f64; 2];

type CycleAmplitudes = [RealAndImaginary; HARMONICS];

/// Sums over a cycle: of what the signal is beside its first value, and of the waves themselves.
#[derive(Clone, Copy, Default)]
struct CycleSums {
    count: f64,
    first: f64,
    sum: f64,
    signal: [RealAndImaginary; HARMONICS],
    waves: [RealAndImaginary; HARMONICS],
}

impl NoiseWatch {
    /// Begins anew with a stretch of samples, of motions with these frequencies in Hz. What was said before stands until it is
    /// known better.
    pub fn begin(&mut self, frequencies_hz: impl Iterator<Item = f64>, start_s: f64, interval_s: f64) {
        let axis = |frequency_hz| AxisContent {
            frequency_hz,
            start_s,
            interval_s,
            number: 0.0,
            cycle: CycleSums::default(),
            follows: false,
            window: Vec::with_capacity(CYCLES + 1),
            ratios: [0.0; HARMONICS],
            found: None,
        };
        self.axes = frequencies_hz.filter(|hz| hz * interval_s * LEAST < 1.0).map(axis).collect();
    }

    /// Whether there is only noise, as far as that is known.
    pub const fn is_noise_only(&self) -> bool {
        self.raised
    }

    /// Takes samples; what has changed.
    pub fn take(&mut self, time_s: &[f64], signal: &[f64]) -> Vec<SignalContent> {
        let mut changes = Vec::new();
        for (time_s, y) in time_s.iter().zip(signal) {
            let mut judged = false;
            for axis in &mut self.axes {
                judged |= axis.take(*time_s, *y);
            }
            if !judged {
                continue;
            }
            let found = self.axes.iter().any(|axis| axis.found == Some(true));
            let nowhere = self.axes.iter().all(|axis| axis.found == Some(false));
            let noise_only = if self.raised { !found } else { nowhere };
            if noise_only != self.raised {
                self.raised = noise_only;
                changes.push(SignalContent { time_s: *time_s, noise_only });
            }
        }
        changes
    }
}

impl AxisContent {
    /// Takes a sample; whether a window was judged.
    fn take(&mut self, time_s: f64, y: f64) -> bool {
        let turns = (time_s - self.start_s) * self.frequency_hz;
        let number = turns.floor();
        let mut judged = false;
        if number != self.number {
            judged = self.end_cycle();
            self.follows &= number == self.number + 1.0;
            self.number = number;
        }
        if y.is_finite() {
            self.cycle.take(TAU * (turns - number), y);
        }
        judged
    }

    fn end_cycle(&mut self) -> bool {
        let cycle = std::mem::take(&mut self.cycle);
        if cycle.count * self.interval_s * self.frequency_hz < PRESENT {
            self.follows = false;
            return false;
        }
        self.window.push((cycle.amplitudes(), std::mem::replace(&mut self.follows, true)));
        if self.window.len() <= CYCLES {
            return false;
        }
        let is_left_out = self.disturbed();
        let pairs: Vec<[&CycleAmplitudes; 2]> = (1..self.window.len())
            .filter(|k| self.window[*k].1 && !is_left_out[*k] && !is_left_out[*k - 1])
            .map(|k| [&self.window[k - 1].0, &self.window[k].0])
            .collect();
        // With pairs too few to tell, the window says what the one before said.
        if 2 * pairs.len() > CYCLES {
            self.ratios = std::array::from_fn(|i| self.ratio(i, &pairs));
            let bound = bound(FOUND_BY_CHANCE / HARMONICS as f64, pairs.len());
            self.found = Some(self.ratios.iter().any(|ratio| *ratio > bound));
        }
        self.window.drain(..CYCLES);
        true
    }

    /// Which cycles of the window have an absurd sample.
    fn disturbed(&self) -> Vec<bool> {
        let squares: Vec<f64> = self.window.iter().map(|(c, _)| c.iter().map(|c| square(*c)).sum()).collect();
        let mut sorted = squares.clone();
        sorted.sort_by(f64::total_cmp);
        let bound = DISTURBED * sorted[sorted.len() / 2];
        let is_disturbed: Vec<bool> = squares.iter().map(|square| *square > bound).collect();
        let count = is_disturbed.iter().filter(|is_so| **is_so).count();
        if count * DISTURBED_SHARE > squares.len() { vec![false; squares.len()] } else { is_disturbed }
    }

    /// How alike the amplitudes of neighbouring cycles are at a harmonic; 0 where there are none.
    fn ratio(&self, i: usize, pairs: &[[&CycleAmplitudes; 2]]) -> f64 {
        let (mut product, mut both) = ([0.0; 2], 0.0);
        for [before, now] in pairs {
            product = plus(product, times(now[i], [before[i][0], -before[i][1]]));
            both += 0.5 * (square(before[i]) + square(now[i]));
        }
        // A harmonic near or above half the sampling rate is that of another frequency.
        let is_seen = (i + 1) as f64 * self.frequency_hz * self.interval_s < 0.45;
        if is_seen && both > 0.0 { product[0].portable_hypot(product[1]) / both } else { 0.0 }
    }
}

/// What a ratio is above with this probability, of noise and so many pairs.
fn bound(chance: f64, pairs: usize) -> f64 {
    (-chance.portable_ln() / pairs as f64).sqrt()
}

impl CycleSums {
    fn take(&mut self, phase: f64, y: f64) {
        if self.count == 0.0 {
            self.first = y;
        }
        let y = y - self.first;
        self.count += 1.0;
        self.sum += y;
        let (sin, cos) = phase.portable_sin_cos();
        let turn = [cos, -sin];
        let mut wave = turn;
        for i in 0..HARMONICS {
            self.signal[i] = plus(self.signal[i], [y * wave[0], y * wave[1]]);
            self.waves[i] = plus(self.waves[i], wave);
            wave = times(wave, turn);
        }
    }

    /// The amplitudes of the signal less its mean.
    fn amplitudes(&self) -> [RealAndImaginary; HARMONICS] {
        let mean = self.sum / self.count;
        std::array::from_fn(|i| plus(self.signal[i], [-mean * self.waves[i][0], -mean * self.waves[i][1]]))
    }
}

fn square([re, im]: RealAndImaginary) -> f64 {
    re * re + im * im
}

fn plus(a: RealAndImaginary, b: RealAndImaginary) -> RealAndImaginary {
    [a[0] + b[0], a[1] + b[1]]
}

fn times(a: RealAndImaginary, b: RealAndImaginary) -> RealAndImaginary {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::Pcg64;
    use rand_pcg::rand_core::Rng;

    const MOTION_HZ: f64 = 15_675.0;
    const INTERVAL_S: f64 = 3e-6;

    fn normal(chance: &mut Pcg64) -> f64 {
        let mut uniform = || ((chance.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
        (-2.0 * uniform().ln()).sqrt() * (TAU * uniform()).cos()
    }

    fn watching() -> NoiseWatch {
        let mut watch = NoiseWatch::default();
        watch.begin(std::iter::once(MOTION_HZ), 0.0, INTERVAL_S);
        watch
    }

    /// The ratios of each window of a signal, whose samples are told by their time.
    fn windows(count: usize, mut signal: impl FnMut(f64) -> f64) -> Vec<([f64; HARMONICS], bool)> {
        let mut watch = watching();
        let axis = &mut watch.axes[0];
        let mut windows = Vec::new();
        let mut k = 0;
        while windows.len() < count {
            let time_s = f64::from(k) * INTERVAL_S;
            k += 1;
            if axis.take(time_s, signal(time_s)) {
                windows.push((axis.ratios, axis.found.unwrap()));
            }
        }
        windows
    }

    /// White noise, and noise of one pole at a tenth of the sampling rate, each on a level that is large beside it.
    #[test]
    fn noise_is_taken_for_a_motion_as_seldom_as_is_said() {
        let mut chance = Pcg64::new(3, 4);
        let mut low = 0.0;
        for pole in [0.0, (-TAU * 0.1_f64).exp()] {
            let noise = |_: f64| {
                low = pole * low + (1.0 - pole) * normal(&mut chance);
                3.7 + 0.014 * low
            };
            let windows = windows(4000, noise);
            for probability in [1e-1, 1e-2, 1e-3] {
                let bound = bound(probability, CYCLES - 1);
                let above = windows.iter().flat_map(|(ratios, _)| ratios).filter(|r| **r > bound).count();
                let share = above as f64 / (windows.len() * HARMONICS) as f64;
                println!("pole {pole:.2}: {share:.5} where {probability} is said");
                // Within three standard errors of a count, the formula being exact for many cycles alone.
                let error = 3.0 * (probability / (windows.len() * HARMONICS) as f64).sqrt();
                assert!(share < 1.1 * probability + error, "{pole}: {share}");
            }
            assert!(windows.iter().all(|(_, found)| !found));
        }
    }

    /// By the share of the motion in the signal's variance, at the second harmonic, with a frequency that is known well and
    /// one that is 2 % off.
    #[test]
    fn a_motion_is_taken_for_noise_as_seldom_as_the_book_states() {
        let mut chance = Pcg64::new(5, 6);
        for (hz, share, lowest, highest) in [
            (MOTION_HZ, 0.5, 0.0, 0.0),
            (MOTION_HZ, 0.3, 0.0, 0.0),
            (1.02 * MOTION_HZ, 0.3, 0.0, 0.0),
            (MOTION_HZ, 0.2, 0.05, 0.15),
            (MOTION_HZ, 0.1, 0.5, 1.0),
        ] {
            let amplitude = f64::sqrt(2.0 * share / (1.0 - share));
            let windows = windows(1000, |time_s| {
                50.0 + amplitude * (2.0 * TAU * hz * time_s).cos() + normal(&mut chance)
            });
            let missed = windows.iter().filter(|(_, found)| !found).count() as f64 / windows.len() as f64;
            println!(
                "share {share}, {:.0} % off: {missed:.4} taken for noise",
                100.0 * (hz / MOTION_HZ - 1.0)
            );
            assert!((lowest..=highest).contains(&missed), "{share}: {missed}");
        }
    }

    #[test]
    fn noise_only_is_said_within_100_cycles_and_taken_back_within_100() {
        let mut chance = Pcg64::new(7, 8);
        let mut watch = watching();
        let time: Vec<f64> = (0..60_000).map(|k| f64::from(k) * INTERVAL_S).collect();
        // A motion up to 60 ms, nothing up to 120 ms, in it rows without a signal, and the motion again.
        let signal: Vec<f64> = (time.iter())
            .map(|t| match *t {
                t if (0.08..0.09).contains(&t) => f64::NAN,
                t if (0.06..0.12).contains(&t) => 0.3 * normal(&mut chance),
                t => (2.0 * TAU * MOTION_HZ * t).cos() + 0.3 * normal(&mut chance),
            })
            .collect();
        let mut changes = Vec::new();
        for (time, signal) in time.chunks(777).zip(signal.chunks(777)) {
            changes.extend(watch.take(time, signal));
        }
        let [only, over] = changes[..] else { panic!("{changes:?}") };
        let cycles = |s: f64| s * MOTION_HZ;
        assert!(only.noise_only && (0.0..100.0).contains(&cycles(only.time_s - 0.06)), "{only:?}");
        assert!(!over.noise_only && (0.0..100.0).contains(&cycles(over.time_s - 0.12)), "{over:?}");
        // A few absurd samples hide neither a motion nor noise.
        let mut spiky = signal.clone();
        for k in [10_000, 10_050, 10_400, 19_990, 30_000, 45_000] {
            spiky[k] = 1000.0;
        }
        let mut watch = watching();
        assert_eq!(watch.take(&time, &spiky), changes);
        // A signal that does not move at all is no motion either.
        let mut watch = watching();
        assert!(!watch.take(&time, &vec![1.25; time.len()]).is_empty() && watch.is_noise_only());
    }
}

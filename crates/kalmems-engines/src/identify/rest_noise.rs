//! The noise of a device that does not move.

use super::{Whiteness, fit_affine};
use crate::signal::fourier_transform;
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// What a record without motion says of the noise.
#[derive(Clone, Debug, PartialEq)]
pub struct StillNoise {
    /// The mean.
    pub mean: f64,
    /// The variance of one sample.
    pub variance: f64,
    /// The interval that holds the variance 95 times in 100.
    pub interval: [f64; 2],
    /// The standard deviation of the variance.
    pub variance_deviation: f64,
    /// Whether it is white.
    pub whiteness: Whiteness,
    /// What the level gains per second, and the standard deviation of that for the noise as it is.
    pub drift: [f64; 2],
    /// Lines in the spectrum that noise alone would hardly have: frequency in Hz and amplitude, the largest first.
    pub lines: Vec<[f64; 2]>,
}

impl StillNoise {
    /// Whether the level moves more than noise would make it seem to, once in a thousand times.
    pub fn drifts(&self) -> bool {
        self.drift[0].abs() > 3.29 * self.drift[1]
    }
}

/// Lines that are named at most.
const LINES: usize = 5;

/// Samples of a still record that are looked at together.
pub const STRETCH: usize = 1 << 18;

/// The variance of a record without motion; samples that are not finite are passed over. `None` of fewer than 32
/// samples, or where nothing varies. See [`StillRecord`].
pub fn fit_still(time_s: &[f64], y: &[f64], interval_s: f64) -> Option<StillNoise> {
    let mut record = StillRecord::new(interval_s);
    record.take(time_s, y);
    record.finish()
}

/// A record without motion, sample after sample, in bounded memory.
///
/// The interval of its variance is that of χ² with n − 1 degrees of freedom where the noise is white. Else the samples
/// count as fewer: n·(1 − ρ²)/(1 + ρ²), with ρ the correlation of neighbours, which is right for noise of which each
/// sample is ρ times the last one and something new. A line stands above what the largest of all lines of white noise
/// reaches once in a thousand records (Fisher, Proceedings of the Royal Society A 125, 54, 1929).
///
/// Of a record of more than 262 144 samples each stretch of so many is looked at by itself, and they are put together:
/// the variance is that about the mean of all; whiteness that of [`Whiteness::of_stretches`]; the drift the line nearest to
/// the levels and slopes of the stretches, each with its own variance; and a line of the spectrum one in the mean of their
/// periodograms (Bartlett, Biometrika 37, 1, 1950), which of m stretches of white noise is χ² with 2m degrees of freedom,
/// over 2m.
#[derive(Debug)]
pub struct StillRecord {
    interval_s: f64,
    time_s: Vec<f64>,
    y: Vec<f64>,
    stretches: Vec<StillStretch>,
    periodograms: StretchPeriodograms,
}

/// What one stretch says.
#[derive(Debug)]
struct StillStretch {
    /// Finite samples.
    count: f64,
    mean: f64,
    /// Σ(y − mean)².
    square: f64,
    whiteness: Whiteness,
    /// The middle of its times in s, the level there and the slope, each with its variance.
    middle_s: f64,
    level: [f64; 2],
    slope: [f64; 2],
}

impl StillRecord {
    /// A record of nothing yet, sampled at this interval in s.
    pub const fn new(interval_s: f64) -> Self {
        let periodograms = StretchPeriodograms {
            length: 0,
            count: 0,
            power: Vec::new(),
            square: 0.0,
            degrees_of_freedom: 0.0,
        };
        Self { interval_s, time_s: Vec::new(), y: Vec::new(), stretches: Vec::new(), periodograms }
    }

    /// The interval in s.
    pub const fn interval_s(&self) -> f64 {
        self.interval_s
    }

    /// The next samples and their times.
    pub fn take(&mut self, mut time_s: &[f64], mut y: &[f64]) {
        while !y.is_empty() {
            let more = y.len().min(STRETCH - self.y.len());
            self.time_s.extend_from_slice(&time_s[..more]);
            self.y.extend_from_slice(&y[..more]);
            (time_s, y) = (&time_s[more..], &y[more..]);
            if self.y.len() == STRETCH {
                self.close();
            }
        }
    }

    /// What all of it says.
    pub fn finish(mut self) -> Option<StillNoise> {
        self.close();
        let n: f64 = self.stretches.iter().map(|s| s.count).sum();
        let mean = self.stretches.iter().map(|s| s.count * s.mean).sum::<f64>() / n;
        let square: f64 = self.stretches.iter().map(|s| s.square + s.count * (s.mean - mean).powi(2)).sum();
        let variance = square / (n - 1.0);
        if n < 32.0 || variance.is_nan() || variance <= 0.0 {
            return None;
        }
        let whiteness: Vec<Whiteness> = self.stretches.iter().map(|s| s.whiteness).collect();
        let whiteness = Whiteness::of_stretches(&whiteness);
        let rho = if whiteness.is_white() { 0.0 } else { whiteness.neighbours.clamp(-0.999, 0.999) };
        let degrees = ((n - 1.0) * (1.0 - rho * rho) / (1.0 + rho * rho)).max(1.0);
        let chi = ChiSquared::new(degrees).ok()?;
        Some(StillNoise {
            mean,
            variance,
            interval: [0.975, 0.025].map(|p| variance * degrees / chi.inverse_cdf(p)),
            variance_deviation: variance * (2.0 / degrees).sqrt(),
            whiteness,
            drift: drift(&self.stretches),
            lines: self.periodograms.lines(self.interval_s),
        })
    }

    /// Looks at the samples that have come together. What is too short to say anything of a slope is let go.
    fn close(&mut self) {
        let (time_s, y) = (&self.time_s, &self.y);
        if let Some(trend) = fit_affine(time_s, y) {
            let finite = || y.iter().copied().filter(|v| v.is_finite());
            let count = finite().count() as f64;
            let mean = finite().sum::<f64>() / count;
            let seen = time_s.iter().zip(y).filter(|(_, v)| v.is_finite());
            let middle_s = seen.map(|(t, _)| t).sum::<f64>() / count;
            let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
            let (level, slope) = (trend.at(middle_s), trend.slope());
            let square = centred.iter().filter(|v| v.is_finite()).map(|v| v * v).sum();
            let whiteness = Whiteness::of(&centred);
            // The rest of a long record has other frequencies.
            if self.stretches.is_empty() || y.len() == STRETCH {
                self.periodograms.add(&centred, square, count - 1.0);
            }
            self.stretches.push(StillStretch {
                count,
                mean,
                square,
                whiteness,
                middle_s,
                level: [level.value, level.deviation.powi(2)],
                slope: [slope.value, slope.deviation.powi(2)],
            });
        }
        self.time_s.clear();
        self.y.clear();
    }
}

/// The line nearest to all levels and slopes: its slope and the standard deviation of that.
fn drift(stretches: &[StillStretch]) -> [f64; 2] {
    let weight: f64 = stretches.iter().map(|s| 1.0 / s.level[1]).sum();
    let middle_s = stretches.iter().map(|s| s.middle_s / s.level[1]).sum::<f64>() / weight;
    let (mut information, mut sum) = (0.0, 0.0);
    for stretch in stretches {
        let from_s = stretch.middle_s - middle_s;
        information += from_s * from_s / stretch.level[1] + 1.0 / stretch.slope[1];
        sum += from_s * stretch.level[0] / stretch.level[1] + stretch.slope[0] / stretch.slope[1];
    }
    [sum / information, information.portable_powf(-0.5)]
}

/// The sum of the periodograms of stretches of one length.
#[derive(Debug)]
struct StretchPeriodograms {
    length: usize,
    count: u32,
    power: Vec<f64>,
    /// The squares of all their samples, each from the mean of its stretch.
    square: f64,
    degrees_of_freedom: f64,
}

impl StretchPeriodograms {
    fn add(&mut self, centred: &[f64], square: f64, degrees_of_freedom: f64) {
        let mut input: Vec<f64> = centred.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect();
        let spectrum = fourier_transform(&mut input);
        self.length = centred.len();
        self.count += 1;
        self.power.resize(spectrum.len(), 0.0);
        for (sum, line) in self.power.iter_mut().zip(&spectrum) {
            *sum += line.norm_sqr();
        }
        self.square += square;
        self.degrees_of_freedom += degrees_of_freedom;
    }

    fn lines(&self, interval_s: f64) -> Vec<[f64; 2]> {
        let n = self.length as f64;
        let inner = self.power.iter().enumerate().skip(1).take(self.length.div_ceil(2).saturating_sub(1));
        let variance = self.square / self.degrees_of_freedom;
        // Twice the sum of |Y|²/(n·σ²) of white noise is χ² with two degrees of freedom for each.
        let once = 1e-3 / inner.clone().count() as f64;
        let Ok(chi) = ChiSquared::new(2.0 * f64::from(self.count)) else { return Vec::new() };
        let limit = 0.5 * chi.inverse_cdf(1.0 - once) * n * variance;
        let amplitude = |power: f64| 2.0 * (power / f64::from(self.count)).sqrt() / n;
        let mut above: Vec<[f64; 2]> = inner
            .filter(|(_, power)| **power > limit)
            .map(|(bin, power)| [bin as f64 / (n * interval_s), amplitude(*power)])
            .collect();
        above.sort_by(|a, b| b[1].total_cmp(&a[1]));
        above.truncate(LINES);
        above
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use statrs::distribution::{Binomial, DiscreteCDF};

    const COUNT: usize = 400;

    fn record(seed: u64, extra: impl Fn(f64) -> f64) -> StillNoise {
        let mut noise = WhiteNoise::new(seed, 8);
        let time: Vec<f64> = (0..COUNT).map(|k| k as f64 * 1e-6).collect();
        let y: Vec<f64> = time.iter().map(|t| 0.85 + 0.0139 * noise.sample() + extra(*t)).collect();
        fit_still(&time, &y, 1e-6).unwrap()
    }

    /// 2000 records of white noise: the interval holds the truth as often as it says (within what a binomial of 99 %
    /// allows), and the false alarms are the few that they should be.
    #[test]
    fn the_interval_holds_the_variance() {
        let (mut inside, mut drifting, mut lined, mut coloured) = (0_u64, 0, 0, 0);
        for seed in 0..2000 {
            let still = record(seed, |_| 0.0);
            inside += u64::from((still.interval[0]..still.interval[1]).contains(&0.0139_f64.powi(2)));
            drifting += u32::from(still.drifts());
            lined += u32::from(!still.lines.is_empty());
            coloured += u32::from(!still.whiteness.is_white());
        }
        let below = Binomial::new(0.95, 2000).unwrap().cdf(inside);
        println!("{inside} of 2000 inside; {drifting} drift, {lined} have lines, {coloured} are not white");
        assert!((0.005..0.995).contains(&below), "{inside}");
        // 2 in 2000 are expected of each; 10 come by chance once in 20 000 times.
        assert!(drifting < 10 && lined < 10 && coloured < 12, "{drifting} {lined} {coloured}");
    }

    #[test]
    fn a_drift_and_a_line_are_seen() {
        let drifting = record(1, |t| 60.0 * t);
        assert!(drifting.drifts(), "{drifting:?}");
        let hum = record(2, |t| 0.01 * (std::f64::consts::TAU * 25e3 * t).sin());
        assert!((hum.lines[0][0] - 25e3).abs() < 1.0 && (hum.lines[0][1] - 0.01).abs() < 3e-3, "{hum:?}");
    }

    #[test]
    fn what_does_not_vary_has_no_noise() {
        let time: Vec<f64> = (0..100).map(f64::from).collect();
        assert!(fit_still(&time, &[1.0; 100], 1.0).is_none());
        assert!(fit_still(&time[..20], &[1.0; 20], 1.0).is_none());
    }

    /// A long record in pieces of any size: what is said is one, and that of the long sums where those are of all.
    #[test]
    fn a_long_record_is_looked_at_in_stretches() {
        let long = |extra: &dyn Fn(f64) -> f64, pieces: usize| {
            let mut noise = WhiteNoise::new(7, 0);
            let count = 2 * STRETCH + 50_000;
            let time: Vec<f64> = (0..count).map(|k| k as f64 * 1e-6).collect();
            let y: Vec<f64> = time.iter().map(|t| 0.85 + 0.0139 * noise.sample() + extra(*t)).collect();
            let mut record = StillRecord::new(1e-6);
            for (time, y) in time.chunks(pieces).zip(y.chunks(pieces)) {
                record.take(time, y);
            }
            (record.finish().unwrap(), fit_affine(&time, &y).unwrap())
        };
        let (white, line) = long(&|_| 0.0, 1000);
        assert_eq!(white, long(&|_| 0.0, 777_777).0);
        assert!(white.whiteness.is_white() && !white.drifts() && white.lines.is_empty(), "{white:?}");
        assert!(white.interval[0] < 0.0139_f64.powi(2) && 0.0139_f64.powi(2) < white.interval[1]);
        // The line through all samples is the one of levels and slopes, but for how their variances differ.
        let [slope, deviation] = white.drift;
        assert!((slope - line.slope).abs() < 0.05 * deviation, "{slope} {}", line.slope);
        assert!((deviation / line.slope().deviation - 1.0).abs() < 5e-3, "{deviation}");

        // Ten standard deviations of the slope of all, which no stretch would see by itself.
        let (drifting, _) = long(&|t| 10.0 * deviation * t, 4096);
        assert!((drifting.drift[0] - slope - 10.0 * deviation).abs() < 1e-6 * deviation && drifting.drifts());
        // 34 times the power of the noise in its line of a stretch is seen.
        let hum_hz = 6554.0 / (STRETCH as f64 * 1e-6);
        let amplitude = 2.0 * 0.0139 * (34.0 / STRETCH as f64).sqrt();
        let (hum, _) = long(&|t| amplitude * (std::f64::consts::TAU * hum_hz * t).sin(), 4096);
        assert_eq!(hum.lines.len(), 1, "{hum:?}");
        assert!((hum.lines[0][0] - hum_hz).abs() < 1e-6 && (hum.lines[0][1] / amplitude - 1.0).abs() < 0.2);
    }
}

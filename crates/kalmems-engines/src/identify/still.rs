//! The noise of a device that does not move.

use super::{Whiteness, fit_affine};
use realfft::RealFftPlanner;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// What a record without motion says of the noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Still {
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

impl Still {
    /// Whether the level moves more than noise would make it seem to, once in a thousand times.
    pub fn drifts(&self) -> bool {
        self.drift[0].abs() > 3.29 * self.drift[1]
    }
}

/// Lines that are named at most.
const LINES: usize = 5;

/// The variance of a record without motion; samples that are not finite are passed over. `None` of fewer than 32
/// samples, or where nothing varies.
///
/// Its interval is that of χ² with n − 1 degrees of freedom where the noise is white. Else the samples count
/// as fewer: n·(1 − ρ²)/(1 + ρ²), with ρ the correlation of neighbours, which is right for noise of which each sample
/// is ρ times the last one and something new. A line stands above what the largest of all lines of white noise
/// reaches once in a thousand records (Fisher, Proceedings of the Royal Society A 125, 54, 1929).
pub fn fit_still(time_s: &[f64], y: &[f64], interval_s: f64) -> Option<Still> {
    let trend = fit_affine(time_s, y)?;
    let finite = || y.iter().copied().filter(|v| v.is_finite());
    let count = finite().count();
    if count < 32 {
        return None;
    }
    let n = count as f64;
    let mean = finite().sum::<f64>() / n;
    let centred: Vec<f64> = y.iter().map(|v| v - mean).collect();
    let square: f64 = centred.iter().filter(|v| v.is_finite()).map(|v| v * v).sum();
    let variance = square / (n - 1.0);
    if variance.is_nan() || variance <= 0.0 {
        return None;
    }
    let whiteness = Whiteness::of(&centred);
    let rho = if whiteness.is_white() { 0.0 } else { whiteness.neighbours.clamp(-0.999, 0.999) };
    let degrees = ((n - 1.0) * (1.0 - rho * rho) / (1.0 + rho * rho)).max(1.0);
    let chi = ChiSquared::new(degrees).ok()?;
    let interval = [0.975, 0.025].map(|p| variance * degrees / chi.inverse_cdf(p));
    Some(Still {
        mean,
        variance,
        interval,
        variance_deviation: variance * (2.0 / degrees).sqrt(),
        whiteness,
        drift: [trend.slope, trend.slope().deviation],
        lines: lines(&centred, variance, interval_s),
    })
}

fn lines(centred: &[f64], variance: f64, interval_s: f64) -> Vec<[f64; 2]> {
    let n = centred.len();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut input: Vec<f64> = centred.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect();
    let mut spectrum = fft.make_output_vec();
    if fft.process(&mut input, &mut spectrum).is_err() {
        return Vec::new();
    }
    // |Y|²/(n·σ²) of white noise is exponential with a mean of 1.
    let inner = spectrum.iter().enumerate().skip(1).take(n.div_ceil(2).saturating_sub(1));
    let limit = (inner.clone().count() as f64 / 1e-3).ln() * n as f64 * variance;
    let mut above: Vec<[f64; 2]> = inner
        .filter(|(_, line)| line.norm_sqr() > limit)
        .map(|(bin, line)| [bin as f64 / (n as f64 * interval_s), 2.0 * line.norm_sqr().sqrt() / n as f64])
        .collect();
    above.sort_by(|a, b| b[1].total_cmp(&a[1]));
    above.truncate(LINES);
    above
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use statrs::distribution::{Binomial, DiscreteCDF};

    const COUNT: usize = 400;

    fn record(seed: u64, extra: impl Fn(f64) -> f64) -> Still {
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
}

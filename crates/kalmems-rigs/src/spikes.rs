//! Single samples that are none of the signal, found without a model of it.

use std::borrow::Cow;

/// Samples before one that it is compared with.
pub(crate) const BEFORE: usize = 5;

/// How many standard deviations of the noise a sample is off that is no sample: one that is not moves the response of the detector by two of
/// its own.
const OFF: f64 = 12.0;

/// How many times as far it is off as the samples before it are from each other: the lag of their median behind a slope is 1.5 times.
const STEEP: f64 = 6.0;

/// The signal, where a sample is far off the median of the five before it that of these in its place. A burst is left as it is.
pub(crate) fn without_spikes(signal: &[f64], noise: f64) -> Cow<'_, [f64]> {
    let mut cleaned = Cow::Borrowed(signal);
    for (k, near) in signal.windows(BEFORE + 1).enumerate() {
        let (now, before) = (near[BEFORE], &near[..BEFORE]);
        // Nearly always one look is enough: a spike is far from the sample before it, and from the one before that, which may be one too.
        if (now - before[BEFORE - 1]).abs() <= 0.5 * OFF * noise
            || (now - before[BEFORE - 2]).abs() <= 0.5 * OFF * noise
            || !near.iter().all(|y| y.is_finite())
        {
            continue;
        }
        let mut sorted: [f64; BEFORE] = std::array::from_fn(|i| before[i]);
        sorted.sort_by(f64::total_cmp);
        let (median, spread) = (sorted[2], sorted[3] - sorted[1]);
        if (now - median).abs() > (OFF * noise).max(STEEP * spread) {
            cleaned.to_mut()[k + BEFORE] = median;
        }
    }
    cleaned
}

#[cfg(test)]
mod tests {
    use super::without_spikes;
    use crate::simulate::WhiteNoise;

    /// The sum of all noise is that of the signal: edges as steep as they come are no spikes.
    #[test]
    fn spikes_go_and_edges_stay() {
        let mut noise = WhiteNoise::new(5, 0);
        for steepness in [0.01, 1.0, 30.0] {
            let signal: Vec<f64> = (0..5000)
                .map(|k| 100.0 * (steepness * 0.05 * f64::from(k)).sin().tanh() + noise.sample())
                .collect();
            assert_eq!(without_spikes(&signal, 1.0), signal, "{steepness}");
        }
        let mut signal: Vec<f64> = (0..5000).map(|k| (0.01 * f64::from(k)).sin() + noise.sample()).collect();
        let clean = signal.clone();
        for k in (50..4950).step_by(97) {
            signal[k] += if k % 2 == 0 { 30.0 } else { -30.0 };
        }
        let cleaned = without_spikes(&signal, 1.0);
        let off = cleaned.iter().zip(&clean).filter(|(own, clean)| (*own - *clean).abs() > 6.0).count();
        assert_eq!(off, 0);
    }
}

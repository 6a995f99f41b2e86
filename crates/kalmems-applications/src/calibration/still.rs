//! The parts of a record in which a unit is still, or turns at a constant rate.
//!
//! The record is divided into blocks. A block is still if each channel varies in it about as little as in the quietest quarter of all
//! blocks, and if no gyroscope shows a constant rate there. The blocks at the ends of a still part are left out, as a motion begins and ends
//! slowly.

use std::ops::Range;

/// Blocks of the shortest still part.
const BLOCKS: usize = 8;
/// The fewest samples of a block.
const SHORTEST_BLOCK: usize = 8;
/// Up to this ratio to the lower quartile of the variances of all blocks a block is still: of white noise in blocks of eight samples one block in
/// 10⁷ exceeds it.
const QUIET: f64 = 10.0;
/// A mean rate counts as motion from this part of the largest one on, and from this many standard deviations of a sample.
const CONSTANT_RATE: f64 = 0.02;
const DEVIATIONS: f64 = 8.0;
/// Variances below this part of the square of a channel's range are those of its resolution.
const RESOLUTION: f64 = 1e-5;

/// A channel of a segment, and whether its mean shows motion.
#[derive(Clone, Copy)]
pub(super) struct StillChannel<'a> {
    pub values: &'a [f64],
    /// True of a gyroscope, whose mean rate is its bias if it is still.
    pub is_rate: bool,
}

/// The mean and the variance of a channel in a block.
#[derive(Clone, Copy)]
struct BlockMoments {
    mean: f64,
    variance: f64,
}

/// The rows of the still parts with at least `shortest` samples, block by block of the channels of one segment without a gap.
pub(super) fn still_parts(channels: &[StillChannel], shortest: usize) -> Vec<Range<usize>> {
    let rows = channels.iter().map(|channel| channel.values.len()).min().unwrap_or(0);
    let block = (shortest / BLOCKS).max(SHORTEST_BLOCK);
    let count = rows / block;
    let mut still = vec![true; count];
    for channel in channels {
        let blocks: Vec<BlockMoments> = channel.values.chunks_exact(block).take(count).map(moments).collect();
        let variance = quantile(blocks.iter().map(|block| block.variance), 0.25);
        let range = blocks.iter().map(|block| block.mean).filter(|mean| mean.is_finite());
        let (low, high) = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let quiet = QUIET * variance.max((RESOLUTION * (high - low)).powi(2));
        for (still, block) in still.iter_mut().zip(&blocks) {
            // A variance that is not a number is that of a block with missing samples.
            *still &= block.variance <= quiet;
        }
        if channel.is_rate {
            let quiet_means = blocks.iter().filter(|block| block.variance <= quiet).map(|block| block.mean);
            let bias = quantile(quiet_means, 0.5);
            let largest = (high - bias).max(bias - low);
            let limit = (DEVIATIONS * variance.sqrt()).max(CONSTANT_RATE * largest);
            for (still, block) in still.iter_mut().zip(&blocks) {
                *still &= (block.mean - bias).abs() <= limit;
            }
        }
    }
    let mut parts = Vec::new();
    let mut first = None;
    for (place, is_still) in still.iter().copied().chain([false]).enumerate() {
        match (first, is_still) {
            (None, true) => first = Some(place),
            (Some(from), false) => {
                let part = (from + 1) * block..place.saturating_sub(1) * block;
                if part.len() >= shortest.max(1) {
                    parts.push(part);
                }
                first = None;
            }
            _ => {}
        }
    }
    parts
}

fn moments(values: &[f64]) -> BlockMoments {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    BlockMoments { mean, variance: square / (values.len() - 1) as f64 }
}

/// The value below which this part of the finite ones lies; 0 of none.
fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    if values.is_empty() {
        return 0.0;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place in the list
    let place = (part * (values.len() - 1) as f64) as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    #[test]
    fn still_parts_lie_between_the_motions_and_a_constant_rate_is_no_rest() {
        let mut noise = WhiteNoise::new(3, 0);
        let mut rate: Vec<f64> = (0..4000).map(|_| 0.02 + 1e-3 * noise.sample()).collect();
        // A turn that swells and fades, and one at a constant rate about the vertical, which no accelerometer sees.
        for (k, value) in rate.iter_mut().enumerate() {
            if (1000..1400).contains(&k) {
                *value += (std::f64::consts::PI * (k - 1000) as f64 / 400.0).sin().powi(2);
            }
            if (2500..3000).contains(&k) {
                *value += 0.3;
            }
        }
        rate[3500] = f64::NAN;
        let force: Vec<f64> = (0..4000).map(|_| 9.8 + 1e-2 * noise.sample()).collect();
        let channels =
            [(&rate, true), (&force, false)].map(|(values, is_rate)| StillChannel { values, is_rate });
        let found = still_parts(&channels, 200);
        let [a, b, c, d] = &found[..] else { panic!("{found:?}") };
        assert!(a.start < 60 && (940..=1000).contains(&a.end), "{a:?}");
        assert!((1400..1460).contains(&b.start) && (2440..=2500).contains(&b.end), "{b:?}");
        assert!((3000..3060).contains(&c.start) && (3440..=3500).contains(&c.end), "{c:?}");
        assert!((3500..3560).contains(&d.start) && d.end > 3900, "{d:?}");
        assert_eq!(still_parts(&channels, 3000), []);
        assert_eq!(still_parts(&[], 10), []);
    }
}

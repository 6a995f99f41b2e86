//! A bit that a converter or a transfer dropped: of every 2·2ᵇ steps of its values only 2ᵇ occur.
//!
//! A converter's values lie on a grid. With bit b always 0 or always 1, all of them lie, by their remainder of division by 2·2ᵇ steps, within 2ᵇ
//! steps. So do those of a signal that stays at a few levels; but a signal that passes over the steps of the missing bit fills the ranges up to
//! their edges, and it jumps by the weight of the bit between rows, or leaves out several ranges one after the other. The lowest bit cannot be
//! missed: without it the values lie on a grid of twice the step.
//!
//! A signal whose highest bit is dropped has a single range. It goes beyond one end and goes on at the other: it moves on in the same direction
//! before and behind a jump of its whole range, and it jumps as often down as up, which a sawtooth does not.

/// The first rows of a column, which are looked at.
pub(super) const DROPPED_BIT_ROWS: usize = 1 << 15;
/// Fewer different values tell no grid.
const LEAST_VALUES: usize = 64;
/// Steps from the lowest to the highest value beyond which there is no converter.
const MOST_STEPS: f64 = 16_777_216.0;
/// The part of a step by which values that lie on a grid are beside it, rounded as they are to decimal digits.
const BESIDE: f64 = 0.02;
/// The part of the 2ᵇ steps that occur, at least.
const FILLED: f64 = 0.9;
/// The part of the samples in the outer quarters of these steps, at least; half of them are there where all are as frequent.
const OUTER: f64 = 0.25;
/// Ranges without a value between others that tell it without a jump, and jumps that tell it otherwise.
const GAPS: usize = 3;
const JUMPS: usize = 8;
/// How far the median of these jumps may be from the weight of the bit.
const JUMP_WIDTH: f64 = 0.03;

/// The first rows of a column.
#[derive(Default)]
pub(super) struct DroppedBit {
    values: Vec<f64>,
    is_decided: bool,
}

/// What was found, in the unit of the column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum DroppedBitFinding {
    /// The weight of the bit, and the step.
    Between { weight: f64, step: f64 },
    /// The values jump by this much, so often, while the signal moves on.
    Highest { jump: f64, jumps: usize },
}

impl DroppedBit {
    /// The next value; what the first rows show once they are there.
    pub(super) fn take(&mut self, value: f64) -> Option<DroppedBitFinding> {
        if self.is_decided {
            return None;
        }
        self.values.push(value);
        if self.values.len() < DROPPED_BIT_ROWS {
            return None;
        }
        self.decide()
    }

    /// What the rows show that are there, where it was not asked before.
    pub(super) fn decide(&mut self) -> Option<DroppedBitFinding> {
        if std::mem::replace(&mut self.is_decided, true) {
            return None;
        }
        found_in(&std::mem::take(&mut self.values))
    }
}

fn found_in(values: &[f64]) -> Option<DroppedBitFinding> {
    let mut different: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    different.sort_by(f64::total_cmp);
    different.dedup();
    let lowest = *different.first()?;
    if different.len() < LEAST_VALUES {
        return None;
    }
    let step = different.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    // The smallest of many differences is short by their rounding; the mean of all of them is not.
    let rough = |value: f64| (value - lowest) / step;
    let highest = different.last().copied().unwrap_or(lowest);
    let steps = rough(highest).round();
    if !(1.0..MOST_STEPS).contains(&steps) {
        return None;
    }
    let step = (highest - lowest) / steps;
    let in_steps = |value: f64| (value - lowest) / step;
    let is_beside = |value: &f64| (in_steps(*value) - in_steps(*value).round()).abs() > BESIDE;
    if different.iter().any(is_beside) {
        return None;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to MOST_STEPS
    let code = |value: &f64| value.is_finite().then(|| in_steps(*value).round() as usize);
    let codes: Vec<Option<usize>> = values.iter().map(code).collect();
    let mut weight = 2;
    while 2 * weight <= codes.iter().flatten().max()? + weight {
        if is_missing(&codes, weight) {
            return Some(DroppedBitFinding::Between { weight: weight as f64 * step, step });
        }
        weight *= 2;
    }
    let jumps = jumps_on(values, highest - lowest);
    (jumps >= JUMPS).then_some(DroppedBitFinding::Highest { jump: highest - lowest, jumps })
}

/// Whether half of the remainders of division by this power of two, in one range, may be without a code. It is looked at in 64 parts: counts of all
/// remainders take megabytes for a fine converter.
fn may_leave_half_out(codes: &[Option<usize>], period: usize) -> bool {
    let Some(finer) = period.trailing_zeros().checked_sub(u64::BITS.trailing_zeros()) else { return true };
    let part = |code: &usize| 1_u64 << ((code & (period - 1)) >> finer);
    let without = !codes.iter().flatten().fold(0, |with, code| with | part(code));
    // Runs of 2, 4, 8, 16 and 31 parts, round the end: half of the remainders have 31 whole parts in them.
    let run = [1, 2, 4, 8, 15].into_iter().fold(without, |run, further| run & run.rotate_right(further));
    run != 0
}

/// Whether the bit of this weight in steps, a power of two, is the same in all of these.
fn is_missing(codes: &[Option<usize>], weight: usize) -> bool {
    let period = 2 * weight;
    if !may_leave_half_out(codes, period) {
        return false;
    }
    let mut samples = vec![0_usize; period];
    codes.iter().flatten().for_each(|code| samples[code % period] += 1);
    let occupied: Vec<usize> = (0..period).filter(|k| samples[*k] > 0).collect();
    let (Some(first), Some(last)) = (occupied.first(), occupied.last()) else { return false };
    // The longest range of remainders that do not occur, and where the next one begins.
    let inner = occupied.windows(2).map(|pair| (pair[1] - pair[0], pair[1]));
    let Some((gap, begin)) = inner.chain([(period - last + first, *first)]).max() else { return false };
    let filled = period - gap + 1;
    if filled > weight || (filled as f64) < FILLED * weight as f64 {
        return false;
    }
    let quarter = filled / 4;
    let outer: usize = (0..filled)
        .filter(|k| *k < quarter || *k >= filled - quarter)
        .map(|k| samples[(begin + k) % period])
        .sum();
    let all: usize = samples.iter().sum();
    if (outer as f64) < OUTER * all as f64 {
        return false;
    }
    let mut ranges: Vec<usize> =
        codes.iter().flatten().map(|code| (code + period - begin) / period).collect();
    ranges.sort_unstable();
    ranges.dedup();
    let gaps = ranges.len().saturating_sub(1);
    gaps >= GAPS || (gaps >= 1 && jumps_by(codes, weight))
}

/// Whether rows jump by this many steps, as where a signal passes over the steps of a bit.
fn jumps_by(codes: &[Option<usize>], weight: usize) -> bool {
    let pairs = codes.windows(2).filter_map(|pair| Some(pair[0]?.abs_diff(pair[1]?) as f64));
    let in_weights = pairs.map(|difference| difference / weight as f64);
    let mut large: Vec<f64> = in_weights.filter(|size| (0.5..1.5).contains(size)).collect();
    large.sort_by(f64::total_cmp);
    large.len() >= JUMPS && large.get(large.len() / 2).is_some_and(|size| (size - 1.0).abs() < JUMP_WIDTH)
}

/// How often rows jump by nearly this range while the signal moves on in the opposite direction; 0 where it jumps to one side alone, or
/// otherwise as well.
fn jumps_on(values: &[f64], range: f64) -> usize {
    let (mut counts, mut others) = ([0_usize; 2], 0_usize);
    for around in values.windows(6) {
        let [a, _, before, behind, _, f] = *around else { continue };
        let jump = behind - before;
        if (0.25 * range..0.75 * range).contains(&jump.abs()) {
            return 0;
        }
        if jump.abs() < 0.75 * range {
            continue;
        }
        let is_on = |slope: f64| slope * jump < 0.0 && slope.abs() < 0.25 * range;
        if is_on(before - a) && is_on(f - behind) {
            counts[usize::from(jump > 0.0)] += 1;
        } else {
            others += 1;
        }
    }
    let [down, up] = counts;
    if 4 * down.min(up) >= down + up && others < down + up { down + up } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of the variance 1, the sum of twelve uniform numbers by splitmix64.
    fn normal(place: u64, seed: u64) -> f64 {
        let uniform = |k: u64| {
            let z = (seed << 32).wrapping_add(12 * place + k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 * 0.5_f64.powi(53)
        };
        (0..12).map(uniform).sum::<f64>() - 6.0
    }

    /// A sine with noise in steps of a converter, centred between `0` and `2 · amplitude`.
    fn signal(amplitude: f64, noise: f64, seed: u64) -> Vec<i64> {
        #[allow(clippy::cast_possible_truncation)] // a code
        let code = |k: u64| {
            let angle = 0.0137 * k as f64;
            (1.2 * amplitude + amplitude * angle.sin() + noise * normal(k, seed)).round() as i64
        };
        (0..20_000).map(code).collect()
    }

    /// The same as volts, with a bit that is always 0, or always 1.
    fn without(codes: &[i64], bit: u32, is_one: bool, step: f64) -> Vec<f64> {
        let mask = 1_i64 << bit;
        let code = |code: &i64| if is_one { code | mask } else { code & !mask };
        codes.iter().map(|own| code(own) as f64 * step - 1.0).collect()
    }

    #[test]
    fn a_bit_that_is_dropped_is_found_with_its_weight() {
        for (amplitude, noise) in [(3000.0, 3.0), (900.0, 20.0), (20_000.0, 100.0)] {
            let codes = signal(amplitude, noise, 5);
            for bit in 3..9 {
                for is_one in [false, true] {
                    let found = found_in(&without(&codes, bit, is_one, 3.05e-4));
                    let Some(DroppedBitFinding::Between { weight, .. }) = found else {
                        panic!("{amplitude} {noise} {bit} {is_one}: {found:?}")
                    };
                    let truth = f64::from(1_u32 << bit) * 3.05e-4;
                    assert!((weight / truth - 1.0).abs() < 1e-6, "{bit}: {weight} {truth}");
                }
            }
        }
    }

    #[test]
    fn a_highest_bit_that_is_dropped_is_found_by_its_jumps() {
        // From 410 to 4510: the middle of 4096 is passed, with the bit of 2048 and that of 4096 in it.
        let codes = signal(2050.0, 2.0, 7);
        let folded: Vec<f64> = codes.iter().map(|code| (code & 2047) as f64).collect();
        assert!(matches!(found_in(&folded), Some(DroppedBitFinding::Highest { .. })));
        assert!(found_in(&without(&codes, 11, false, 1e-3)).is_some());
    }

    #[test]
    fn signals_with_all_bits_levels_and_sawteeth_are_none() {
        for (amplitude, noise) in
            [(3000.0, 3.0), (900.0, 20.0), (20_000.0, 100.0), (0.0, 50.0), (200.0, 0.3), (0.0, 3.0)]
        {
            for seed in 0..20 {
                let codes = signal(amplitude, noise, seed);
                let values: Vec<f64> = codes.iter().map(|code| *code as f64 * 3.05e-4).collect();
                assert_eq!(found_in(&values), None, "{amplitude} {noise} {seed}");
            }
        }
        let mut place = 0;
        let mut chance = || {
            place += 1;
            normal(place, 1)
        };
        let floats: Vec<f64> = (0..9000).map(|_| chance()).collect();
        assert_eq!(found_in(&floats), None);
        for period in [256, 200, 64] {
            let levels = |k: usize, noise: f64| ((k / 37) % 5 * period) as f64 + noise;
            let levels: Vec<f64> = (0..9000).map(|k| levels(k, (8.0 * chance()).round())).collect();
            assert_eq!(found_in(&levels), None, "levels {period}");
            let square: Vec<f64> =
                (0..9000).map(|k| ((k / 37) % 2 * period) as f64 + (8.0 * chance()).round()).collect();
            assert_eq!(found_in(&square), None, "square {period}");
        }
        let sawtooth: Vec<f64> =
            (0..9000).map(|k| f64::from(k * 7 % 2048) + (2.0 * chance()).round()).collect();
        assert_eq!(found_in(&sawtooth), None);
    }
}

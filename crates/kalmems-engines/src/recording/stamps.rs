//! What stamps of time say of how they were made: rounded far from zero, or taken by a host that gets its samples in bursts.

use super::findings::short;
use super::time::{TIME_TOLERANCE, median as middle};

/// Fewer steps show no habit.
const FEWEST_STEPS: usize = 64;
/// Fewer long steps show none either.
const FEWEST_BURSTS: usize = 4;

/// Rows over which the rate of bursts is looked for, the fewest first, and how many such windows have to be there.
const WINDOWS: [usize; 3] = [64, 512, 4096];
const FEWEST_WINDOWS: usize = 8;

/// The slope by least squares of times over their rows, by the intervals that are the usual one but for rounding, where that is so
/// coarse that the usual one is a multiple of it and nothing else. In the slope the `i`-th of `n` intervals has the weight `i (n + 1 - i)`.
pub(super) fn slope_of_rounded(intervals: &[f64], median: f64, resolution_s: f64) -> f64 {
    let is_near = |interval: &&f64| (**interval - median).abs() <= 2.0 * resolution_s;
    let count = intervals.iter().filter(is_near).count();
    let weighted = intervals.iter().filter(is_near).zip(1..).map(|(interval, i)| {
        let weight = i as f64 * (count + 1 - i) as f64;
        (weight, weight * interval)
    });
    let (weights, sum) =
        weighted.fold((0.0, 0.0), |(weights, sum), (weight, part)| (weights + weight, sum + part));
    if count > 0 { sum / weights } else { median }
}

/// To how many s the times of a text were rounded, where they are those of a steady clock but for that: all intervals are one of two
/// or three neighbours of a grid, and no time is off the clock by more than the grid's width.
pub(super) fn rounding_of(times: &[f64]) -> Option<f64> {
    let (first, last) = (times.first()?, times.last()?);
    let mean = (last - first) / (times.len() - 1) as f64;
    if times.len() <= FEWEST_STEPS || !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    let steps = || times.iter().zip(times.iter().skip(1)).map(|(before, after)| after - before);
    let low = steps().fold(f64::INFINITY, f64::min);
    let high = steps().fold(f64::NEG_INFINITY, f64::max);
    // What two times are apart by their own rounding is none of the grid.
    let slack = (8.0 * f64::EPSILON * last.abs().max(first.abs())).max(1e-6 * mean);
    let above = |step: f64| (step - low > slack).then_some(step - low);
    let grid = steps().filter_map(above).fold(f64::INFINITY, f64::min);
    let is_steady = grid.is_finite()
        && high - low <= 2.0 * grid + slack
        && times.iter().enumerate().all(|(k, time)| (time - first - k as f64 * mean).abs() <= grid + slack)
        && steps().all(|step| {
            let count = (step - low) / grid;
            (count - count.round()).abs() * grid <= slack
        });
    // Digits are cut off by a power of ten.
    let is_decimal = format!("{grid:.3e}").starts_with("1.000e");
    // A step of none or of two is a row twice or one that is missing, unless it comes as often as only rounding makes it.
    let usual = |count: f64| steps().filter(|step| ((step - low) / grid - count).abs() < 0.5).count();
    let others = times.len() - 1 - usual(0.0).max(usual(1.0)).max(usual(2.0));
    let is_rounding = low > 1.5 * grid || others > times.len() / 10;
    (is_steady && is_decimal && is_rounding && (TIME_TOLERANCE * mean..=mean).contains(&grid)).then_some(grid)
}

/// How rows arrive that come in bursts, however long each is: most of them right behind the one before, so that the usual interval
/// says nothing of their rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct ArrivalPattern {
    /// The mean interval.
    pub(super) mean_s: f64,
    /// What is usually waited for the next burst.
    pub(super) wait_s: f64,
}

impl ArrivalPattern {
    /// From one row to the next so much has to pass, by the usual wait, until samples count as missing: bursts are as late as the
    /// way of the samples makes them.
    const FAR: f64 = 10.0;

    /// Finds them where the median interval is less than half of the mean one over windows of many rows, of which a gap is in few.
    pub(super) fn of(times: &[f64], median: f64) -> Option<Self> {
        let usual_s = WINDOWS.into_iter().find_map(|window| {
            let starts = (0..times.len().checked_sub(window + 1)?).step_by(window / 2);
            let slope = |start: usize| Some((times.get(start + window)? - times.get(start)?) / window as f64);
            let mut slopes: Vec<f64> = starts.filter_map(slope).filter(|slope| *slope > 0.0).collect();
            let enough = slopes.len() >= FEWEST_WINDOWS;
            let usual_s = middle(&mut slopes).filter(|slope| enough && slope.is_finite())?;
            (median < 0.5 * usual_s).then_some(usual_s)
        })?;
        let steps = || times.iter().zip(times.iter().skip(1)).map(|(before, after)| after - before);
        let wait_s = middle(&mut steps().filter(|step| *step > usual_s).collect::<Vec<_>>())?;
        // From the beginning of one burst to that of another, as what is cut at both ends does not count; a gap as a usual wait.
        let begin = steps().position(|step| step > usual_s)?;
        let end = steps().enumerate().rfind(|(_, step)| *step > usual_s)?.0;
        let passed = steps().take(end + 1).skip(begin + 1).filter(|step| *step >= 0.0);
        let passed_s: f64 = passed.map(|step| if step > Self::FAR * wait_s { wait_s } else { step }).sum();
        let mean_s = passed_s / (end - begin) as f64;
        (mean_s > 0.0).then_some(Self { mean_s, wait_s })
    }

    /// How many samples are missing within an interval, of which one is expected every `expected_s`; 0 where that cannot be told
    /// from a burst that is late.
    pub(super) fn missing(&self, interval_s: f64, expected_s: f64) -> f64 {
        if interval_s > Self::FAR * self.wait_s {
            ((interval_s - self.wait_s) / expected_s).round()
        } else {
            0.0
        }
    }
}

/// What to say of times that are rounded to more than a small part of their interval; `in_text` where digits are missing and not bits.
pub(super) fn rounded(interval_s: f64, resolution_s: f64, in_text: bool) -> Option<String> {
    let part = resolution_s / interval_s;
    (part > TIME_TOLERANCE).then(|| {
        if in_text {
            return format!(
                "the times are those of a steady clock, rounded to {} s, {:.0} % of an interval of {} s",
                short(resolution_s),
                100.0 * part,
                short(interval_s)
            );
        }
        format!(
            "so far from zero the file's binary numbers are {} s apart, {:.0} % of an interval of {} s, and the times are \
             rounded to them",
            short(resolution_s),
            100.0 * part,
            short(interval_s)
        )
    })
}

/// Times that come in bursts.
pub(super) struct BurstTimes {
    /// The step after which the first one ends.
    pub(super) first: usize,
    /// How many there are.
    pub(super) count: usize,
    /// In words.
    pub(super) detail: String,
}

/// Finds bursts in the steps from row to row: runs of short steps, about as long as one another, with a long step between
/// them, in which at least half of the time passes.
pub(super) fn bursts(times: &[f64]) -> Option<BurstTimes> {
    let steps = || times.iter().zip(times.iter().skip(1)).map(|(before, after)| after - before);
    let count = times.len().saturating_sub(1);
    let (first, last) = (times.first()?, times.last()?);
    let mean = (last - first) / count as f64;
    // A time that goes back or is none makes this false or the runs uneven.
    if count < FEWEST_STEPS || !(mean > 0.0 && mean.is_finite()) {
        return None;
    }
    let mut sorted: Vec<f64> = steps().filter(|step| *step >= 0.0).collect();
    let middle = sorted.len() / 2;
    let (_, median, _) =
        sorted.get(middle).is_some().then(|| sorted.select_nth_unstable_by(middle, f64::total_cmp))?;
    let median = *median;
    if median >= 0.5 * mean {
        return None;
    }
    let long: Vec<(usize, f64)> = steps().enumerate().filter(|(_, step)| *step > 2.0 * mean).collect();
    let in_long: f64 = long.iter().map(|(_, step)| step).sum();
    if long.len() < FEWEST_BURSTS || in_long < 0.5 * (last - first) {
        return None;
    }
    let runs =
        || long.iter().zip(long.iter().skip(1)).map(|((before, _), (after, _))| (after - before) as f64);
    let rows = runs().sum::<f64>() / (long.len() - 1) as f64;
    let spread = (runs().map(|run| (run - rows).powi(2)).sum::<f64>() / (long.len() - 1) as f64).sqrt();
    if spread > 0.5 * rows {
        return None;
    }
    // From the beginning of one burst to that of another, so that what is cut at both ends does not count.
    let ((begin, _), (end, long_s)) = (long.first()?, long.last()?);
    let rate_hz = (end - begin) as f64 / (times.get(end + 1)? - times.get(begin + 1)?);
    let usual = if median > 0.0 { format!("{} s", short(median)) } else { "nothing".to_owned() };
    Some(BurstTimes {
        first: begin + 1,
        count: long.len(),
        detail: format!(
            "the rows come in bursts of about {rows:.0}, mostly with {usual} from one to the next and then with intervals \
             such as {} s: on average a row comes every {} s, which is a rate of {} Hz",
            short(*long_s),
            short(rate_hz.recip()),
            short(rate_hz)
        ),
    })
}

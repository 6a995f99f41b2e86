//! The recorded drive, between its samples and where samples are missing.

use crate::config::Experiment;
use crate::estimate::SampleSelection;
use crate::progress::Interruption;
use crate::recording::{RecordingColumn, Segment};
use crate::signal::{
    SLOPE_REACH, Sine, cubic_between, fit_sine, fit_sine_near, fit_sine_until, quintic_middle, sample_slopes,
    white_noise_variance,
};
use kalmems_core::Nodes;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::ops::Range;

/// The drive over the rows of a part of a segment.
#[derive(Clone, Debug)]
pub struct SegmentDrive<'a> {
    time_s: &'a [f64],
    volts: &'a [f64],
    /// Where it is a column of a recording.
    column: Option<ColumnRows<'a>>,
    /// The sine that it follows, where it follows one: over all that is there, or over the first part.
    sine: Option<Sine>,
    /// The sine that its first rows follow.
    first_sine: Option<Sine>,
    /// The sines that stand in for rows without a drive, each from a row on.
    stand_ins: Vec<(usize, Sine)>,
    /// What the drive will do, by the rows from which on.
    coming: Vec<ForeseenSine>,
    unknown: Option<(f64, usize)>,
    lag: InterpolationLag,
}

/// How many samples behind an interval are waited for, to know the drive in its middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InterpolationLag(u32);

impl Default for InterpolationLag {
    fn default() -> Self {
        Self(2)
    }
}

impl InterpolationLag {
    /// As an experiment states it.
    pub fn of(experiment: &Experiment) -> Self {
        experiment.estimate.as_ref().map_or(Self::default(), |estimate| Self(estimate.interpolation_lag))
    }

    /// One that waits for so many samples.
    pub const fn waiting_for(samples: u32) -> Self {
        Self(samples)
    }

    /// The samples behind an interval that are waited for.
    pub const fn samples(self) -> u32 {
        self.0
    }

    /// The rows before and behind the new ones of a part that the drive between its samples asks for.
    pub const fn rows_around(self) -> (usize, usize) {
        (5, self.0 as usize)
    }
}

/// Rows of a recording's column from one on.
#[derive(Clone, Copy, Debug)]
struct ColumnRows<'a> {
    column: &'a RecordingColumn,
    first: usize,
}

impl ColumnRows<'_> {
    /// So many sines in these of the rows, which the column keeps.
    fn sines(&self, rows: &Range<usize>, count: usize, fit: impl FnOnce() -> Option<Vec<Sine>>) -> Vec<Sine> {
        self.column.sines(self.first + rows.start..self.first + rows.end, count, fit)
    }
}

/// Rows that a sine is fitted to which stands in for missing ones: a missing drive comes from what the block of rows before
/// its own block follows, so that it is the same whether the later rows are known or not. In the first block it comes from
/// that block.
pub const BLOCK: usize = 4096;

/// A sample beyond so many times the largest value of the first sine, or the median of the first block, is an error of the recording and not the
/// drive: no sine and no constant is fitted to it.
const ABSURD: f64 = 1e6;

/// The median of what is not 0 among the sizes of some samples; `None` if all are 0.
fn typical_size(volts: &[f64]) -> Option<f64> {
    let mut sizes: Vec<f64> =
        volts.iter().map(|v| v.abs()).filter(|size| size.is_finite() && *size > 0.0).collect();
    let middle = sizes.len() / 2;
    (!sizes.is_empty()).then(|| *sizes.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The samples without those that are larger, which are missing then.
fn without_larger(volts: &[f64], largest: f64) -> Cow<'_, [f64]> {
    let is_sound = |v: &f64| v.is_nan() || v.abs() <= largest;
    if volts.iter().all(is_sound) {
        return Cow::Borrowed(volts);
    }
    volts.iter().map(|v| if is_sound(v) { *v } else { f64::NAN }).collect()
}

/// Standard deviations of what a sine leaves within which samples are on it.
const ON_THE_SINE: f64 = 6.0;

/// What is kept of the drive of a segment from one part to the next.
#[derive(Clone, Debug, Default)]
pub struct DrivePast {
    sine: Option<Sine>,
    first_sine: Option<Sine>,
    /// The constant that its first rows are, where they follow no sine.
    first_level: Option<Sine>,
    /// The size above which a sample is an error of the recording; `None` until the first block.
    largest: Option<f64>,
    /// Rows of the segment before the new ones of the next part.
    rows: usize,
    /// The block before the present one, with its sine once that was asked for, and the present one as far as it is known.
    last: DriveBlock,
    present: DriveBlock,
    fitted: OnceCell<Option<Sine>>,
    /// The sines that stand in, by the rows of the segment from which on.
    stand_ins: Vec<(usize, Sine)>,
    /// Whether it is asked what the drive will do; and the sine that tells, by the rows of the segment from which on.
    pub foresees: bool,
    pub(in crate::estimate) lag: InterpolationLag,
    coming: Vec<ForeseenSine>,
}

/// What tells how the drive goes on from a row of the segment on.
#[derive(Clone, Copy, Debug)]
struct ForeseenSine {
    row: usize,
    sine: Option<Sine>,
    /// Whether what it leaves of its block is the noise of the samples: one whose amplitude drifts leaves more.
    leaves_noise: bool,
}

/// The largest root mean square of what a sine leaves, in deviations of the noise that neighbouring samples show.
const OF_NOISE: f64 = 1.5;

impl ForeseenSine {
    /// From this row on, by the block with these samples.
    fn of(row: usize, sine: Option<Sine>, volts: &[f64]) -> Self {
        let leaves_noise = sine.is_some_and(|sine| {
            white_noise_variance(volts).is_none_or(|noise| sine.residual_rms <= OF_NOISE * noise.sqrt())
        });
        Self { row, sine, leaves_noise }
    }
}

#[derive(Clone, Debug, Default)]
struct DriveBlock {
    time_s: Vec<f64>,
    volts: Vec<f64>,
}

impl DriveBlock {
    /// The sine near one that came before.
    fn sine_like(&self, before: Option<&Sine>) -> Option<Sine> {
        let before = before.filter(|sine| sine.amplitude > 0.0)?;
        fit_sine_near(&self.time_s, &self.volts, before.frequency_hz).filter(Sine::is_steady)
    }
}

/// Rows by which a drive that is no more than a constant and noise may depend on itself.
const LAGS: usize = 8;

/// The constant that a drive is, such as that of a free decay, which is nothing: a sine without amplitude. `None` where its
/// rows depend on each other, so that they tell more than their mean does.
fn level(volts: &[f64]) -> Option<Sine> {
    let known = || volts.iter().copied().filter(|v| v.is_finite());
    let count = known().count();
    if count < 4 * LAGS {
        return None;
    }
    // From the first on, so that the mean of a constant is that constant and not rounded as often as it has rows.
    let first = known().next()?;
    let offset = first + known().map(|v| v - first).sum::<f64>() / count as f64;
    let product = |lag: usize| {
        let pairs = volts.iter().zip(volts.iter().skip(lag)).map(|(a, b)| (a - offset) * (b - offset));
        pairs.filter(|product| product.is_finite()).sum::<f64>()
    };
    let (variance, bound) = (product(0), 4.0 / (count as f64).sqrt());
    // A constant whose mean is rounded has no variance to speak of.
    let constant = variance <= count as f64 * (4.0 * f64::EPSILON * offset).powi(2);
    let white = || (1..=LAGS).all(|lag| product(lag).abs() <= bound * variance);
    let residual_rms = (variance / count as f64).sqrt();
    (constant || white()).then_some(Sine {
        offset,
        amplitude: 0.0,
        frequency_hz: 0.0,
        phase_rad: 0.0,
        residual_rms,
    })
}

impl DrivePast {
    /// Of a segment that begins, where so many samples behind an interval are waited for.
    pub(crate) fn waiting_for(lag: InterpolationLag) -> Self {
        Self { lag, ..Self::default() }
    }

    /// Of a segment that goes on from where another run left it, when its drive followed this sine.
    pub(crate) fn resumed(sine: Option<Sine>) -> Self {
        let (fitted, coming) =
            (OnceCell::from(sine), vec![ForeseenSine { row: BLOCK, sine, leaves_noise: true }]);
        Self { sine, first_sine: sine, rows: BLOCK, fitted, coming, ..Self::default() }
    }

    /// The sine that the drive was last known to follow.
    pub(crate) fn known(&self) -> Option<Sine> {
        let coming = self.coming.iter().rev().find_map(|coming| coming.sine);
        let fitted = self.fitted.get().copied().flatten().filter(|sine| sine.amplitude > 0.0);
        coming.or(fitted).or(self.sine)
    }

    /// Finds the sine that tells what the drive will do from the rows of a new block on: that of the block before. Of the
    /// first block, whose samples these are, it is its own.
    fn foresee(&mut self, first: &[f64], interval_s: f64) {
        let is_known = self.coming.last().is_some_and(|coming| coming.row == self.rows);
        if !self.foresees || !self.present.time_s.is_empty() || is_known {
            return;
        }
        let (sine, volts) = if self.rows == 0 {
            (self.first_sine, first)
        } else {
            let before = self.coming.iter().rev().find_map(|coming| coming.sine.as_ref());
            // A drive that has changed is looked for anew; of a block that follows no sine, the one before it is kept.
            let anew = || fit_sine(&self.last.time_s, &self.last.volts, interval_s).filter(Sine::is_steady);
            (self.last.sine_like(before).or_else(anew).or(before.copied()), &*self.last.volts)
        };
        self.coming.push(ForeseenSine::of(self.rows, sine, volts));
    }

    /// Goes through new rows, block by block, and finds the sine for each block with rows whose drive is missing.
    fn take(&mut self, time_s: &[f64], volts: &[f64], rows: &Range<usize>, interval_s: f64) {
        let of_sine = self.first_sine.map(|sine| ABSURD * (sine.offset.abs() + sine.amplitude));
        let largest = of_sine.or(self.largest).unwrap_or(f64::INFINITY);
        let mut from = rows.start;
        while from < rows.end {
            let end = rows.end.min(from + BLOCK - self.present.time_s.len());
            self.foresee(&volts[from..rows.end.min(from + BLOCK)], interval_s);
            self.stand_in_for(time_s, volts, from..end, interval_s);
            self.present.time_s.extend_from_slice(&time_s[from..end]);
            self.present.volts.extend_from_slice(&without_larger(&volts[from..end], largest));
            self.rows += end - from;
            if self.present.time_s.len() == BLOCK {
                self.last = std::mem::take(&mut self.present);
                self.fitted = OnceCell::new();
            }
            from = end;
        }
        // The row behind the new ones is looked at as well: the drive before it is interpolated through it.
        self.stand_in_for(time_s, volts, from..(from + 1).min(time_s.len()), interval_s);
    }

    /// Finds the sine for rows of the present block, where it is needed.
    fn stand_in_for(&mut self, time_s: &[f64], volts: &[f64], mut rows: Range<usize>, interval_s: f64) {
        if !rows.any(|k| missing(time_s, volts, k, interval_s) > 0) {
            return;
        }
        let begins = self.rows - self.present.time_s.len();
        let sine = if begins == 0 {
            self.first_sine.or(self.first_level)
        } else {
            let before = self.stand_ins.last().map(|(_, sine)| sine).or(self.first_sine.as_ref());
            let fitted = || self.last.sine_like(before).or_else(|| level(&self.last.volts));
            *self.fitted.get_or_init(fitted)
        };
        // Where a block follows no sine, what the blocks before it followed stands in.
        if let Some(sine) = sine {
            self.stand_ins.push((begins, sine));
        }
    }
}

/// Rows without a drive at row `k` or, by the times, before it.
fn missing(time_s: &[f64], volts: &[f64], k: usize, interval_s: f64) -> usize {
    let interval = if k > 0 { time_s[k] - time_s[k - 1] } else { interval_s };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, saturating
    let left_out = (interval / interval_s - 0.5) as usize;
    usize::from(!volts[k].is_finite()) + left_out
}

impl<'a> SegmentDrive<'a> {
    /// Takes all the samples of a segment and looks for a steady sine in them.
    pub fn new(time_s: &'a [f64], volts: &'a [f64], interval_s: f64) -> Self {
        let samples = SampleSelection::whole(time_s.len(), interval_s);
        Self::of(time_s, volts, &samples, &mut DrivePast::default(), &Interruption::never())
    }

    /// The same with as many samples behind an interval as are waited for.
    #[must_use]
    pub fn waiting_for(self, lag: InterpolationLag) -> Self {
        Self { lag, ..self }
    }

    /// Takes the samples of a part of a segment; those that are new go on where the past left off. What it gives where it is stopped means
    /// nothing.
    pub fn of(
        time_s: &'a [f64],
        volts: &'a [f64],
        samples: &SampleSelection,
        past: &mut DrivePast,
        stop: &Interruption,
    ) -> Self {
        Self::of_rows((time_s, volts, None), samples, past, stop)
    }

    /// The same of a segment's rows of a column, whose sines are fitted once for all who ask for them.
    pub fn of_column(
        (column, segment): (&'a RecordingColumn, &Segment),
        time_s: &'a [f64],
        samples: &SampleSelection,
        past: &mut DrivePast,
        stop: &Interruption,
    ) -> Self {
        let rows = ColumnRows { column, first: segment.rows.start };
        Self::of_rows((time_s, column.of(segment), Some(rows)), samples, past, stop)
    }

    fn of_rows(
        (time_s, volts, column): (&'a [f64], &'a [f64], Option<ColumnRows<'a>>),
        samples: &SampleSelection,
        past: &mut DrivePast,
        stop: &Interruption,
    ) -> Self {
        let (fresh, interval_s) = (&samples.fresh, samples.interval_s);
        let before = past.rows;
        if before == 0 {
            let end = fresh.end.min(fresh.start + BLOCK);
            past.largest = typical_size(&volts[fresh.start..end]).map(|size| ABSURD * size);
            let volts = without_larger(volts, past.largest.unwrap_or(f64::INFINITY));
            let fit = |rows: Range<usize>| {
                let fitted = || fit_sine_until(&time_s[rows.clone()], &volts[rows.clone()], interval_s, stop);
                let unless_stopped = || {
                    let sine = fitted();
                    (!stop.is_requested()).then(|| sine.into_iter().collect())
                };
                let sine = match column {
                    Some(column) => column.sines(&rows, 1, unless_stopped).first().copied(),
                    None => fitted(),
                };
                sine.filter(Sine::is_steady)
                    // What is left of a constant when its mean is taken off is rounding, and no drive.
                    .filter(|sine| sine.amplitude > 1e-12 * sine.offset.abs())
            };
            past.first_sine = fit(fresh.start..end);
            past.first_level = past.first_sine.is_none().then(|| level(&volts[fresh.start..end])).flatten();
            past.sine = if end == fresh.end { past.first_sine } else { fit(fresh.clone()) };
        }
        // What no later part asks for is forgotten; that of the block before the first row may still be.
        let (first, oldest) =
            (before.saturating_sub(fresh.start), before.saturating_sub(fresh.start + BLOCK));
        let unused = past.stand_ins.iter().skip(1).take_while(|(row, _)| *row < oldest).count();
        past.stand_ins.drain(..unused);
        // Rows before the new ones may be gone over again, as a smoother does.
        let passed = past.coming.iter().skip(1).take_while(|coming| coming.row <= first).count();
        past.coming.drain(..passed);
        past.take(time_s, volts, fresh, interval_s);
        // What is given in advance is as the next parts will find it.
        let missing = |k: &usize| missing(time_s, volts, *k, interval_s);
        let mut ahead = past.stand_ins.clone();
        if (fresh.end + 1..time_s.len()).any(|k| missing(&k) > 0) {
            let mut later = past.clone();
            later.take(time_s, volts, &(fresh.end..time_s.len()), interval_s);
            ahead = later.stand_ins;
        }
        let mut stand_ins: Vec<(usize, Sine)> = Vec::new();
        for (row, sine) in &ahead {
            let row = row.saturating_sub(first);
            stand_ins.pop_if(|(before, _)| *before == row);
            stand_ins.push((row, *sine));
        }
        let from_first =
            |coming: &ForeseenSine| ForeseenSine { row: coming.row.saturating_sub(first), ..*coming };
        let coming = past.coming.iter().map(from_first).collect();
        let (sine, first_sine) = (past.sine, past.first_sine);
        let mut drive =
            Self { time_s, volts, column, sine, first_sine, stand_ins, coming, unknown: None, lag: past.lag };
        let mut unknown = fresh.clone().filter(|k| missing(k) > 0 && drive.substitute(*k).is_none());
        if let Some(first) = unknown.next() {
            let count = missing(&first) + unknown.map(|k| missing(&k)).sum::<usize>();
            drive.unknown = Some((time_s[first], count));
        }
        drive
    }

    /// When its samples were taken, in s.
    pub fn time_s(&self) -> &'a [f64] {
        self.time_s
    }

    /// Its samples in V.
    pub fn volts(&self) -> &'a [f64] {
        self.volts
    }

    /// So many sines that `fit` finds in these of its rows, nothing where there are none; the recording that it is a column of keeps them.
    pub fn fitted_sines(
        &self,
        rows: &Range<usize>,
        count: usize,
        fit: impl FnOnce() -> Vec<Sine>,
    ) -> Vec<Sine> {
        match &self.column {
            Some(column) => column.sines(rows, count, || Some(fit())),
            None => fit(),
        }
    }

    /// The sine that the drive follows, where it follows one.
    pub fn sine(&self) -> Option<&Sine> {
        self.sine.as_ref()
    }

    /// The sine that its first rows follow, as many as [`BLOCK`]: what a start may know.
    pub fn first_sine(&self) -> Option<&Sine> {
        self.first_sine.as_ref()
    }

    /// The sine that stands in for the drive at row `k`, or on the way to it, where that is missing.
    pub fn substitute(&self, k: usize) -> Option<&Sine> {
        let next = self.stand_ins.partition_point(|(row, _)| *row <= k);
        self.stand_ins.get(next.checked_sub(1)?).map(|(_, sine)| sine)
    }

    /// The sine by which the drive goes on behind row `k`, as far as the rows before its block tell; where it was asked for.
    pub fn continuation(&self, k: usize) -> Option<&Sine> {
        self.foreseen(k)?.sine.as_ref()
    }

    fn foreseen(&self, k: usize) -> Option<&ForeseenSine> {
        let next = self.coming.partition_point(|coming| coming.row <= k);
        self.coming.get(next.checked_sub(1)?)
    }

    /// The sample at `k`, or what stands in for it where it is missing; whether it was missing.
    #[inline]
    pub fn sample(&self, k: usize) -> (f64, bool) {
        let v = self.volts[k];
        if v.is_finite() { (v, false) } else { self.stand_in(k) }
    }

    /// What stands in for the missing sample at `k`.
    #[inline(never)]
    fn stand_in(&self, k: usize) -> (f64, bool) {
        match self.substitute(k) {
            Some(sine) => (sine.at(self.time_s[k]), true),
            None => (self.volts[k], false),
        }
    }

    /// Its rate at each sample, per s: that of the sine by which it goes on, where that was asked for, leaves noise alone, and the samples around are on it as well
    /// as noise lets them, and else that of the polynomial through those, which has all of their noise.
    pub fn rates(&self, interval_s: f64) -> Vec<f64> {
        let value = |k: usize| self.sample(k).0;
        let mut rates = sample_slopes(self.time_s, value, interval_s);
        for (k, rate) in rates.iter_mut().enumerate() {
            let foreseen = self.foreseen(k).filter(|coming| coming.leaves_noise);
            let sine = foreseen.and_then(|coming| coming.sine.as_ref());
            let Some(sine) = sine.filter(|sine| sine.amplitude > 0.0) else { continue };
            let around = k.saturating_sub(SLOPE_REACH)..(k + SLOPE_REACH + 1).min(self.time_s.len());
            let bound = ON_THE_SINE * sine.residual_rms;
            if around.into_iter().all(|k| (value(k) - sine.at(self.time_s[k])).abs() <= bound) {
                *rate = sine.rate_at(self.time_s[k]);
            }
        }
        rates
    }

    /// Where nothing tells what the drive was at new rows: the time of the first such row and how many there are, gaps in
    /// the time included. `None` where the drive is known throughout, if only by a sine.
    pub fn unknown(&self) -> Option<(f64, usize)> {
        self.unknown
    }

    /// The drive at the ends and in the middle of the interval that ends at sample `to`.
    ///
    /// In the middle it is on the polynomial through six samples, as many behind it as are waited for; a drive that is held between samples, and even the cubic
    /// through four, costs far more than the integrator does (see [`Nodes`]).
    pub fn nodes(&self, to: usize) -> Nodes<f64> {
        let middle = quintic_middle(self.time_s, |k| self.sample(k).0, to, self.lag.0 as usize);
        Nodes { start: self.sample(to - 1).0, middle, end: self.sample(to).0 }
    }

    /// The same with the middle on the cubic through the four samples around it.
    pub fn nodes_on_cubic(&self, to: usize) -> Nodes<f64> {
        let at_s = self.time_s[to - 1].midpoint(self.time_s[to]);
        let middle = cubic_between(self.time_s, |k| self.sample(k).0, to, at_s);
        Nodes { start: self.sample(to - 1).0, middle, end: self.sample(to).0 }
    }

    /// The same with the middle on this sine, corrected by the polynomial through what the samples differ from it.
    pub fn nodes_along(&self, sine: &Sine, to: usize) -> Nodes<f64> {
        let middle = self.time_s[to - 1].midpoint(self.time_s[to]);
        let beside = |k: usize| self.sample(k).0 - sine.at(self.time_s[k]);
        let middle = sine.at(middle) + quintic_middle(self.time_s, beside, to, self.lag.0 as usize);
        Nodes { start: self.sample(to - 1).0, middle, end: self.sample(to).0 }
    }

    /// The drive over one of so many parts of an interval, by the parabola through its nodes.
    #[inline]
    pub fn nodes_of_part(Nodes { start, middle, end }: &Nodes<f64>, step: usize, steps: usize) -> Nodes<f64> {
        let at = |halves: usize| {
            let s = halves as f64 / (2 * steps) as f64;
            start * (2.0 * s - 1.0) * (s - 1.0) + 4.0 * middle * s * (1.0 - s) + end * s * (2.0 * s - 1.0)
        };
        Nodes { start: at(2 * step), middle: at(2 * step + 1), end: at(2 * step + 2) }
    }

    /// The drive from its sine, for a sub-step of an interval in which samples are missing.
    pub fn nodes_from_sine(sine: &Sine, from_s: f64, to_s: f64) -> Nodes<f64> {
        Nodes { start: sine.at(from_s), middle: sine.at(from_s.midpoint(to_s)), end: sine.at(to_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_rate_of_a_steady_drive_has_not_the_noise_of_its_samples() {
        let time_s: Vec<f64> = (0..3 * BLOCK).map(|k| k as f64 * 1e-6).collect();
        // White enough: a fixed sequence without a line.
        let noise = |k: usize| ((k * k * 7919 + k * 104_729) % 1009) as f64 / 1009.0 - 0.5;
        let mut samples: Vec<f64> =
            time_s.iter().enumerate().map(|(k, t)| volts(*t) + 0.1 * noise(k)).collect();
        let stops = 2 * BLOCK + 100;
        samples[stops..].fill(90.0);
        let mut past = DrivePast { foresees: true, ..DrivePast::default() };
        let selection = SampleSelection::whole(time_s.len(), 1e-6);
        let drive = SegmentDrive::of(&time_s, &samples, &selection, &mut past, &Interruption::never());
        let rates = drive.rates(1e-6);
        let rate = TAU * 31_350.0;
        let truth = |k: usize| 90.0 * rate * (rate * time_s[k] - 0.4).cos();
        let off = |rows: Range<usize>| rows.map(|k| (rates[k] - truth(k)).abs()).fold(0.0, f64::max);
        // A difference of these samples would be off by up to 1e5 V/s.
        assert!(off(0..stops - SLOPE_REACH) < 2e3, "{}", off(0..stops - SLOPE_REACH));
        assert!(rates[stops + SLOPE_REACH..].iter().all(|rate| *rate == 0.0));
    }

    fn volts(t: f64) -> f64 {
        90.0 + 90.0 * (TAU * 31_350.0 * t - 0.4).sin()
    }

    #[test]
    fn the_middle_is_on_a_polynomial_even_at_the_ends_and_with_jitter() {
        let time: Vec<f64> =
            (0..3000).map(|i| f64::from(i) * 1e-6 + 2e-7 * f64::from(i * 7919 % 11) / 11.0).collect();
        let v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
        let drive = SegmentDrive::new(&time, &v, 1e-6);
        for to in 1..time.len() {
            let middle = time[to - 1].midpoint(time[to]);
            // The sixth derivative over 6! times the products of distances, 90 V·(2π·0.03135)⁶·(225/64)/720: 0.026 mV inside for even
            // samples, up to four times as much with this jitter; at the ends 945/225 times that.
            let edge = to < 3 || to > time.len() - 3;
            let bound = if edge { 6e-4 } else { 1e-4 };
            assert!((drive.nodes(to).middle - volts(middle)).abs() < bound, "{to}");
            // Of the cubic, 90 V·(2π·0.03135)⁴·(9/16)/24 = 3.2 mV and what the jitter adds.
            assert!((drive.nodes_on_cubic(to).middle - volts(middle)).abs() < 0.015, "{to}");
        }
    }

    #[test]
    fn missing_samples_of_the_drive_come_from_its_sine_and_are_reported() {
        let time: Vec<f64> = (0..3000).map(|i| f64::from(i) * 1e-6).collect();
        let mut v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
        v[1000..1040].fill(f64::NAN);
        let drive = SegmentDrive::new(&time, &v, 1e-6);
        let (value, missing) = drive.sample(1020);
        assert!(missing && (value - volts(time[1020])).abs() < 1e-4);
        assert!(!drive.sample(999).1);
        // Without a sine there is nothing to take it from.
        let sweep: Vec<f64> = time.iter().map(|t| (TAU * (3e4 + 1e7 * t) * t).sin()).collect();
        let mut sweep = sweep;
        sweep[5] = f64::NAN;
        let drive = SegmentDrive::new(&time, &sweep, 1e-6);
        assert!(drive.sine().is_none() && drive.sample(5).0.is_nan());
        assert_eq!(drive.unknown(), Some((time[5], 1)));
    }

    /// A block whose only large sample is 1e100 would else be noise about a constant of 2e96 V.
    #[test]
    fn an_absurd_sample_of_the_drive_does_not_move_the_sine_that_stands_in_for_the_next_block() {
        let time: Vec<f64> = (0..3 * BLOCK).map(|k| k as f64 * 1e-6).collect();
        let mut v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
        let missing = 2 * BLOCK + 100;
        v[missing] = f64::NAN;
        for absurd in [1e100, -1e300, f64::MAX] {
            v[BLOCK + 500] = absurd;
            let (value, is_missing) = SegmentDrive::new(&time, &v, 1e-6).sample(missing);
            assert!(is_missing && (value - volts(time[missing])).abs() < 1e-3, "{absurd:e}: {value:e}");
        }
    }

    #[test]
    fn a_drive_that_is_off_stays_off_over_a_gap() {
        let time: Vec<f64> =
            (0..9000).map(|k| f64::from(k) * 1e-6 + if k > 6000 { 2e-4 } else { 0.0 }).collect();
        // Exactly nothing, a constant, and the noise of a converter about it.
        // Splitmix64: numbers that do not depend on each other.
        let noise = |k: u32| {
            let z = u64::from(k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f64 / 16_777_216.0 - 0.5
        };
        for (level, scale) in [(0.0, 0.0), (12.3, 0.0), (0.0, 1e-3), (-4.0, 0.2)] {
            let mut v: Vec<f64> = (0..9000).map(|k| level + scale * noise(k)).collect();
            v[100] = f64::NAN;
            let drive = SegmentDrive::new(&time, &v, 1e-6);
            assert!(drive.sine().is_none() && drive.unknown().is_none(), "{level} {scale}");
            let over = SegmentDrive::nodes_from_sine(drive.substitute(6001).unwrap(), time[6000], time[6001]);
            // A mean is rounded, once for each of the rows.
            let rounding = 9000.0 * f64::EPSILON * level.abs();
            assert!(
                (over.middle - level).abs() <= 0.1 * scale + rounding,
                "{level} {scale}: {}",
                over.middle
            );
        }
    }
}

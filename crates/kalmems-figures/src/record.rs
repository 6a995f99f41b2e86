//! What a series keeps of its samples beside the picture: all of them where they are few, else the extremes of groups of
//! consecutive ones, in bounded memory.

use crate::decimate::is_drawable;

/// Groups that a record has at most; beyond that neighbours are joined.
const GROUPS: usize = 1 << 15;
/// Where abscissae are at equal steps they deviate from that by less than this share of a step.
const EQUAL: f64 = 1e-3;

/// Samples as they arrive, of one abscissa and as many values for each as there are channels.
///
/// A recording of any length may pass: what is kept of it is at most 2¹⁵ groups of consecutive samples with the lowest and the
/// highest value of each channel in them. A recording of no more samples than that is kept whole.
///
/// ```
/// use kalmems_figures::Track;
/// let mut track = Track::new(1);
/// for i in 0..100_000 {
///     track.push(f64::from(i), &[f64::from(i % 7)]);
/// }
/// assert_eq!((track.samples(), track.groups()), (100_000, 25_000));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Samples of a group.
    per_group: usize,
    /// Samples that the last group still takes.
    room: usize,
    samples: usize,
    rises: bool,
    /// Of the first sample of each group.
    x: Vec<f64>,
    last_x: f64,
    channels: Vec<Extremes>,
}

/// The lowest and the highest value of each group; not a number where a group has none.
#[derive(Clone, Debug, Default)]
struct Extremes {
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Track {
    /// A track with so many channels and no samples yet.
    pub fn new(channels: usize) -> Self {
        Self {
            per_group: 1,
            room: 0,
            samples: 0,
            rises: true,
            x: Vec::new(),
            last_x: f64::NEG_INFINITY,
            channels: vec![Extremes::default(); channels],
        }
    }

    /// How many samples have passed.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// How many groups are kept of them.
    pub fn groups(&self) -> usize {
        self.x.len()
    }

    /// Takes a sample. A value that is not finite, or that is not there, leaves a gap; a sample whose abscissa is not finite is
    /// left out.
    pub fn push(&mut self, x: f64, values: &[f64]) {
        if !is_drawable(x) {
            return;
        }
        if self.room == 0 {
            if self.x.len() == GROUPS {
                self.join();
            }
            self.x.push(x);
            for channel in &mut self.channels {
                channel.low.push(f64::NAN);
                channel.high.push(f64::NAN);
            }
            self.room = self.per_group;
        }
        self.room -= 1;
        self.samples += 1;
        self.rises &= x >= self.last_x;
        self.last_x = x;
        for (channel, value) in self.channels.iter_mut().zip(values) {
            if is_drawable(*value)
                && let (Some(low), Some(high)) = (channel.low.last_mut(), channel.high.last_mut())
            {
                // `min` and `max` take the number where the other is none.
                *low = low.min(*value);
                *high = high.max(*value);
            }
        }
    }

    /// A track of one channel of which groups of so many samples are known alone: where each begins, its lowest and its highest value.
    pub fn of_groups(per_group: usize, groups: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        let mut track = Self::new(1);
        for (x, low, high) in groups {
            track.push(x, &[low]);
            if let Some(top) = track.channels.first_mut().and_then(|channel| channel.high.last_mut()) {
                *top = top.max(high);
            }
        }
        track.per_group *= per_group.max(1);
        track.samples *= per_group.max(1);
        track
    }

    /// Whether it has each sample that has passed.
    pub(crate) fn is_whole(&self) -> bool {
        self.per_group == 1
    }

    /// Where each group begins, with the lowest value of a lower and the highest of an upper channel.
    pub(crate) fn extremes(&self, [lower, upper]: [usize; 2]) -> Vec<(f64, f64, f64)> {
        let (Some(lower), Some(upper)) = (self.channels.get(lower), self.channels.get(upper)) else {
            return Vec::new();
        };
        let values = lower.low.iter().zip(&upper.high);
        self.x.iter().zip(values).map(|(x, (low, high))| (*x, *low, *high)).collect()
    }

    /// Joins each two neighbouring groups.
    fn join(&mut self) {
        self.per_group *= 2;
        self.x = self.x.iter().copied().step_by(2).collect();
        for channel in &mut self.channels {
            channel.low = joined(&channel.low, 2, f64::min);
            channel.high = joined(&channel.high, 2, f64::max);
        }
    }

    /// What a series keeps of it: the values between a lower and an upper channel, which may be the same one.
    pub(crate) fn record(&self, [lower, upper]: [usize; 2]) -> Option<Record> {
        // Groups of samples that go to and fro mean nothing.
        if self.x.is_empty() || (!self.rises && self.per_group > 1) {
            return None;
        }
        let is_single = lower == upper;
        let (lower, upper) = (self.channels.get(lower)?, self.channels.get(upper)?);
        let values = if self.per_group > 1 {
            RecordValues::Extremes { low: PackedValues::of(&lower.low), high: PackedValues::of(&upper.high) }
        } else if std::ptr::eq(lower, upper) {
            RecordValues::Samples(PackedValues::of(&lower.low))
        } else {
            let pairs = || lower.low.iter().zip(&upper.high);
            let middle: Vec<f64> = pairs().map(|(low, high)| f64::midpoint(*low, *high)).collect();
            let half: Vec<f64> = pairs().map(|(low, high)| (high - low) / 2.0).collect();
            RecordValues::Band { middle: PackedValues::of(&middle), half: PackedValues::of(&half) }
        };
        let (x, last_x) = (Abscissae::of(&self.x), self.last_x);
        let (per_group, samples, rises) = (self.per_group, self.samples, self.rises);
        Some(Record { per_group, samples, rises, is_single, x, last_x, values })
    }
}

/// About what a track has a band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BandCentre {
    /// About its value.
    Value,
    /// About zero.
    Zero,
}

/// What the numbers of a track are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampledQuantity<'a> {
    /// The unit of value and half width; empty where it has no name.
    pub unit: &'a str,
    /// Where there is a half width of a band beside the value: about what the band lies.
    pub band: Option<BandCentre>,
}

/// What a series keeps of its samples, each value to 2⁻¹⁶ of the span of all.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Record {
    /// Samples of a group.
    pub(crate) per_group: usize,
    pub(crate) samples: usize,
    /// Whether the abscissae never fall.
    pub(crate) rises: bool,
    /// Whether it is of one value at each sample, and no band.
    pub(crate) is_single: bool,
    pub(crate) x: Abscissae,
    /// Of the last sample.
    pub(crate) last_x: f64,
    pub(crate) values: RecordValues,
}

/// The values of a record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RecordValues {
    /// Each sample.
    Samples(PackedValues),
    /// The middle of a band at each sample, and half of its width, which may be far smaller than the middle.
    Band {
        /// Between the edges.
        middle: PackedValues,
        /// From the middle to an edge.
        half: PackedValues,
    },
    /// The lowest and the highest value of each group.
    Extremes {
        /// The lowest.
        low: PackedValues,
        /// The highest.
        high: PackedValues,
    },
}

impl Record {
    /// Numbers that it takes to write it.
    pub(crate) fn size(&self) -> usize {
        let values = match &self.values {
            RecordValues::Samples(values) => values.multiples.len(),
            RecordValues::Band { middle, .. } => 2 * middle.multiples.len(),
            RecordValues::Extremes { low, .. } => 2 * low.multiples.len(),
        };
        values + if let Abscissae::Each(x) = &self.x { 2 * x.len() } else { 0 }
    }

    /// The same with groups of so many times as many samples; none where its samples go to and fro.
    pub(crate) fn coarser(&self, times: usize) -> Option<Self> {
        if !self.rises {
            return None;
        }
        let (low, high): (Vec<f64>, Vec<f64>) = match &self.values {
            RecordValues::Samples(values) => (values.all().collect(), values.all().collect()),
            RecordValues::Band { middle, half } => {
                middle.all().zip(half.all()).map(|(middle, half)| (middle - half, middle + half)).unzip()
            }
            RecordValues::Extremes { low, high } => (low.all().collect(), high.all().collect()),
        };
        let x: Vec<f64> = match &self.x {
            Abscissae::Equal(first, step, count) => (0..*count).map(|i| first + step * i as f64).collect(),
            Abscissae::Each(x) => x.clone(),
        };
        let x: Vec<f64> = x.into_iter().step_by(times).collect();
        let values = RecordValues::Extremes {
            low: PackedValues::of(&joined(&low, times, f64::min)),
            high: PackedValues::of(&joined(&high, times, f64::max)),
        };
        Some(Self { per_group: self.per_group * times, x: Abscissae::of(&x), values, ..*self })
    }
}

/// One value for each `times` of them.
fn joined(values: &[f64], times: usize, of: fn(f64, f64) -> f64) -> Vec<f64> {
    values.chunks(times).map(|group| group.iter().copied().fold(f64::NAN, of)).collect()
}

/// Where the groups begin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Abscissae {
    /// At equal steps: the first, the step, and how many.
    Equal(f64, f64, usize),
    /// Wherever they are.
    Each(Vec<f64>),
}

impl Abscissae {
    pub(crate) fn of(x: &[f64]) -> Self {
        let (Some(first), Some(last)) = (x.first(), x.last()) else { return Self::Each(Vec::new()) };
        let step = (last - first) / (x.len() - 1).max(1) as f64;
        let deviates = |(i, x): (usize, &f64)| (x - (first + step * i as f64)).abs() > EQUAL * step.abs();
        if step <= 0.0 || x.iter().enumerate().any(deviates) {
            return Self::Each(x.to_vec());
        }
        Self::Equal(*first, step, x.len())
    }
}

/// Numbers as an offset plus a multiple of a power of two, with 15 bits behind the first of each multiple: the upper
/// three bytes of it as a number of 32 bits, of which the last is zero.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PackedValues {
    pub(crate) offset: f64,
    pub(crate) unit: f64,
    pub(crate) multiples: Vec<u32>,
}

impl PackedValues {
    pub(crate) fn of(values: &[f64]) -> Self {
        let (offset, unit) = offset_and_unit(values);
        let multiples =
            values.iter().map(|v| if is_drawable(*v) { short((v - offset) / unit) } else { NONE });
        Self { offset, unit, multiples: multiples.collect() }
    }

    fn all(&self) -> impl Iterator<Item = f64> + '_ {
        self.multiples.iter().map(|multiple| self.offset + self.unit * f64::from(f32::from_bits(*multiple)))
    }
}

/// An offset and a power of two, by which numbers lose no digits to their distance from zero and none is too large for 32 bits. Numbers of which
/// none can be drawn have 0 and 1.
pub(crate) fn offset_and_unit(values: &[f64]) -> (f64, f64) {
    let finite = values.iter().filter(|v| is_drawable(**v));
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let span = high - low;
    if span.is_nan() || span < 0.0 {
        return (0.0, 1.0);
    }
    let offset = if low.abs().max(high.abs()) > 8.0 * span { f64::midpoint(low, high) } else { 0.0 };
    let largest = (high - offset).abs().max((low - offset).abs());
    #[allow(clippy::cast_possible_truncation)] // the exponent of a number
    let unit = if largest > 0.0 {
        2_f64.powi(libm::log2(largest).floor().clamp(-1000.0, 1000.0) as i32)
    } else {
        1.0
    };
    (offset, unit)
}

/// Not a number.
const NONE: u32 = 0x7fc0_0000;

/// The bits of the nearest number whose last eight are zero.
fn short(value: f64) -> u32 {
    #[allow(clippy::cast_possible_truncation)] // rounded on purpose
    let bits = (value as f32).to_bits();
    bits.saturating_add(0x80) & !0xff
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(values: &PackedValues) -> Vec<f64> {
        values.all().collect()
    }

    #[test]
    fn few_samples_are_kept_each_and_to_a_small_part_of_their_span() {
        let value = |i: u32| 1e-12 + 1e-16 * (f64::from(i) / 50.0).sin();
        let mut track = Track::new(1);
        for i in 0..20_000 {
            track.push(5.0 + 1e-6 * f64::from(i), &[if i == 77 { f64::NAN } else { value(i) }]);
        }
        let record = track.record([0, 0]).unwrap();
        assert!(matches!(record.x, Abscissae::Equal(_, _, 20_000)));
        let RecordValues::Samples(values) = &record.values else { panic!("not each") };
        for (i, kept) in (0..).zip(all(values)) {
            assert!((kept - value(i)).abs() < 2e-16 * 2e-5 || (i == 77 && kept.is_nan()), "{i}");
        }
    }

    #[test]
    fn a_band_that_is_narrow_against_what_it_goes_along_keeps_its_width() {
        let mut track = Track::new(2);
        for i in 0..1000 {
            let middle = (f64::from(i) / 50.0).sin();
            track.push(f64::from(i), &[middle - 1e-7, middle + 1e-7]);
        }
        let RecordValues::Band { half, .. } = track.record([0, 1]).unwrap().values else { panic!("no band") };
        assert!(half.all().all(|half| (half - 1e-7).abs() < 1e-11));
    }

    #[test]
    fn no_extreme_of_many_samples_is_lost_and_memory_has_a_bound() {
        let mut track = Track::new(2);
        let value = |i: u32| {
            if i == 654_321 { -9.0 } else { f64::from(i.wrapping_mul(2_654_435_761) >> 8) }
        };
        for i in 0..1_000_000 {
            track.push(f64::from(i), &[value(i), value(i) + 1.0]);
        }
        let record = track.record([0, 1]).unwrap();
        assert_eq!((record.per_group, record.samples, record.size()), (32, 1_000_000, 62_500));
        let coarser = record.coarser(4).unwrap();
        for (record, size) in [(record, 32), (coarser, 128)] {
            assert_eq!(record.per_group, size);
            let RecordValues::Extremes { low, high } = &record.values else { panic!("no groups") };
            let samples: Vec<u32> = (0..1_000_000).collect();
            let groups = samples.chunks(size).zip(all(low).into_iter().zip(all(high)));
            for (group, (low, high)) in groups {
                let values = || group.iter().map(|i| value(*i));
                let near = |a: f64, b: f64| (a - b).abs() < 4e-5 * 2_f64.powi(24);
                assert!(near(low, values().fold(f64::INFINITY, f64::min)));
                assert!(near(high, values().fold(0.0, f64::max) + 1.0));
            }
        }
    }

    #[test]
    fn numbers_of_any_size_are_kept() {
        for size in [1e-300, 1e-20, 1.0, 1e20, 1e300] {
            let values = all(&PackedValues::of(&[-size, 0.0, 0.3 * size, f64::NAN, size]));
            assert!((values[2] - 0.3 * size).abs() < 2e-5 * size, "{size}");
            assert_eq!(values[1], 0.0);
        }
        assert_eq!(all(&PackedValues::of(&[4.0, 4.0])), [4.0, 4.0]);
        assert!(PackedValues::of(&[]).multiples.is_empty());
    }

    #[test]
    fn a_way_to_and_fro_is_kept_while_it_is_short() {
        let circle = |count: u32| {
            let mut track = Track::new(1);
            (0..count).for_each(|i| track.push(f64::from(i).cos(), &[f64::from(i).sin()]));
            track.record([0, 0])
        };
        assert!(circle(100).is_some_and(|record| !record.rises && record.coarser(2).is_none()));
        assert_eq!(circle(100_000), None);
    }
}

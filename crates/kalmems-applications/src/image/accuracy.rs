//! How well a phase must be known for an image.

use std::collections::BTreeMap;

/// The pixel, counted from 1, that a position in (0, 1] falls into: ⌈n·x⌉ (Chen et al. 2020, (2)).
///
/// The position 0 itself gives 0, and positions outside of the field give numbers outside of 1 to `pixels`.
#[allow(clippy::cast_possible_truncation)] // saturates far outside of any image
pub fn pixel_index(position: f64, pixels: usize) -> i64 {
    (position * pixels as f64).ceil() as i64
}

/// The phase errors of one axis that keep an image within a permitted shift.
///
/// With 2m pixels along the axis, x = ½·sin ψ + ½ and the pixel k = ⌈2m·x⌉, a phase error δφ moves a sample by
/// δk = ⌈m·sin(ψ + δφ)⌉ − ⌈m·sin ψ⌉. For |δφ| ≤ p/m no sample moves by more than p (Chen et al. 2020, (5)–(7); the
/// corresponding equation (79) of Chen's dissertation of 2018 lacks a factor of 2π). The bound is exact with the ceiling:
/// the largest difference within it is 2m·sin(δφ/2) < p before rounding, and a whole p cannot become more by it. It is
/// tight as well: some sample moves by p from just below it, and by p + 1 from a part of (p² + 3)/24m² beyond it.
///
/// Samples of the forward pass move one way and those of the backward pass the other way, so that what is one in the
/// object appears twice, up to 2m·δφ apart: an image blurs by twice the bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseAccuracy {
    /// In rad: within it, no sample moves by more than the permitted shift.
    pub one_pass_rad: f64,
    /// In rad: within it, forward and backward pass are no further apart than the permitted shift. Half of the other.
    pub both_passes_rad: f64,
}

impl PhaseAccuracy {
    /// For this many pixels (2m) along the axis, and a permitted shift (p) in pixels.
    pub fn of(pixels: u32, shift: u32) -> Self {
        let one_pass_rad = 2.0 * f64::from(shift) / f64::from(pixels);
        Self { one_pass_rad, both_passes_rad: one_pass_rad / 2.0 }
    }

    /// For both axes of an image, such that no sample is further off than `shift` pixels, straight across both axes.
    ///
    /// The axes' errors add as the sides of a right angle, so that each may take 1/√2 of what it may take alone.
    pub fn of_two_axes(pixels: [u32; 2], shift: u32) -> [Self; 2] {
        pixels.map(|pixels| {
            let alone = Self::of(pixels, shift);
            let share = std::f64::consts::FRAC_1_SQRT_2;
            Self { one_pass_rad: share * alone.one_pass_rad, both_passes_rad: share * alone.both_passes_rad }
        })
    }
}

/// How many samples moved by how many pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ShiftHistogram {
    counts: BTreeMap<i64, u64>,
}

impl ShiftHistogram {
    /// Counts the samples whose position is taken for `believed` and is `real`, along one axis.
    pub fn of(pairs: impl IntoIterator<Item = (f64, f64)>, pixels: usize) -> Self {
        let mut counts = BTreeMap::new();
        for (believed, real) in pairs {
            *counts.entry(pixel_index(real, pixels) - pixel_index(believed, pixels)).or_default() += 1;
        }
        Self { counts }
    }

    /// Shifts in pixels, from the lowest up, with the number of samples of each.
    pub fn counts(&self) -> impl Iterator<Item = (i64, u64)> + '_ {
        self.counts.iter().map(|(shift, count)| (*shift, *count))
    }

    /// The part of the samples that moved by this much; 0 of none.
    pub fn share(&self, shift: i64) -> f64 {
        let total: u64 = self.counts.values().sum();
        self.counts.get(&shift).map_or(0.0, |count| *count as f64 / total as f64)
    }

    /// The largest shift, whichever way.
    pub fn largest(&self) -> u64 {
        self.counts.keys().map(|shift| shift.unsigned_abs()).max().unwrap_or(0)
    }
}

//! Samples sorted into pixels.

use super::accuracy::pixel_index;
use super::picture::Picture;

/// The mean of the samples in each pixel, kept up as they come: memory for the image, none for the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    size: [usize; 2],
    mean: Vec<f64>,
    count: Vec<u32>,
    samples: u64,
    scatter: f64,
}

impl Raster {
    /// An empty one of this width and height.
    pub fn new(size: [usize; 2]) -> Self {
        let pixels = size[0] * size[1];
        Self { size, mean: vec![0.0; pixels], count: vec![0; pixels], samples: 0, scatter: 0.0 }
    }

    /// Takes a sample at a position. Whether it lies in the field of view, its edges included; if not, it is not taken.
    pub fn add(&mut self, position: [f64; 2], value: f64) -> bool {
        let (Some(column), Some(row)) = (pixel(position[0], self.size[0]), pixel(position[1], self.size[1]))
        else {
            return false;
        };
        let index = row * self.size[0] + column;
        let (Some(mean), Some(count)) = (self.mean.get_mut(index), self.count.get_mut(index)) else {
            return false;
        };
        // Welford's recursion: no large sums that cancel.
        *count += 1;
        let change = value - *mean;
        *mean += change / f64::from(*count);
        self.scatter += change * (value - *mean);
        self.samples += 1;
        true
    }

    /// Width and height in pixels.
    pub const fn size(&self) -> [usize; 2] {
        self.size
    }

    /// How many samples it took.
    pub const fn samples(&self) -> u64 {
        self.samples
    }

    /// How many pixels have at least one sample.
    pub fn filled(&self) -> usize {
        self.count.iter().filter(|count| **count > 0).count()
    }

    /// The part of the pixels that have at least one sample; 0 of none.
    pub fn coverage(&self) -> f64 {
        if self.count.is_empty() { 0.0 } else { self.filled() as f64 / self.count.len() as f64 }
    }

    /// Samples in each pixel, row by row.
    pub fn counts(&self) -> &[u32] {
        &self.count
    }

    /// The sum of the squares of what each sample differs from the mean of its pixel.
    pub const fn scatter(&self) -> f64 {
        self.scatter
    }

    /// The means; NaN in pixels without a sample.
    pub fn picture(&self) -> Picture {
        let pixels = self.mean.iter().zip(&self.count);
        let values = pixels.map(|(mean, count)| if *count > 0 { *mean } else { f64::NAN }).collect();
        Picture::of_values(self.size, values)
    }
}

fn pixel(position: f64, pixels: usize) -> Option<usize> {
    if !(0.0..=1.0).contains(&position) {
        return None;
    }
    // The edge at 0 belongs to the first pixel, as the one at 1 does to the last.
    usize::try_from(pixel_index(position, pixels).max(1) - 1).ok()
}

/// The two directions of an axis, each with a raster of its own: a phase error shifts them apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Passes {
    /// While the position grows.
    pub forward: Raster,
    /// While it falls.
    pub backward: Raster,
}

impl Passes {
    /// Empty ones of this width and height.
    pub fn new(size: [usize; 2]) -> Self {
        Self { forward: Raster::new(size), backward: Raster::new(size) }
    }

    /// Takes a sample as [`Raster::add`] does.
    pub fn add(&mut self, position: [f64; 2], forward: bool, value: f64) -> bool {
        if forward { self.forward.add(position, value) } else { self.backward.add(position, value) }
    }

    /// Both in one, as if the samples had not been told apart.
    pub fn together(&self) -> Raster {
        let mut both = self.forward.clone();
        both.samples += self.backward.samples;
        both.scatter += self.backward.scatter + self.mismatch_sum();
        let other = self.backward.mean.iter().zip(&self.backward.count);
        for ((mean, count), (m, n)) in both.mean.iter_mut().zip(&mut both.count).zip(other) {
            *count += n;
            if *n > 0 {
                *mean += (m - *mean) * f64::from(*n) / f64::from(*count);
            }
        }
        both
    }

    /// The root mean square of the difference between the passes, over the pixels that both have; NaN of none.
    pub fn difference_rms(&self) -> f64 {
        let squares = self.pairs().map(|(difference, _)| difference * difference);
        let (sum, count) = squares.fold((0.0, 0_usize), |(sum, n), square| (sum + square, n + 1));
        (sum / count as f64).sqrt()
    }

    /// The variance that the difference between the passes accounts for, per pixel that both have; NaN of none.
    pub fn mismatch(&self) -> f64 {
        self.mismatch_sum() / self.pairs().count() as f64
    }

    fn mismatch_sum(&self) -> f64 {
        self.pairs().map(|(difference, weight)| weight * difference * difference).sum()
    }

    /// The difference of each pixel that both passes have, with the weight n₁·n₂/(n₁ + n₂).
    fn pairs(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let means = self.forward.mean.iter().zip(&self.backward.mean);
        let counts = self.forward.count.iter().zip(&self.backward.count);
        means.zip(counts).filter(|(_, (a, b))| **a > 0 && **b > 0).map(|((a, b), (n, m))| {
            let (n, m) = (f64::from(*n), f64::from(*m));
            (a - b, n * m / (n + m))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_counts_and_scatter_are_those_of_the_samples() {
        let mut raster = Raster::new([2, 1]);
        let far = 1e9; // a large offset must not cost the scatter its digits
        for value in [1.0, 2.0, 6.0] {
            assert!(raster.add([0.25, 0.5], far + value));
        }
        assert!(raster.add([1.0, 1.0], far) && raster.add([0.0, 0.0], far + 3.0));
        for outside in [[1.1, 0.5], [-1e-9, 0.5], [0.5, 1.1], [f64::NAN, 0.5]] {
            assert!(!raster.add(outside, 0.0));
        }
        assert_eq!((raster.counts(), raster.samples(), raster.coverage()), (&[4, 1][..], 5, 1.0));
        assert_eq!(raster.picture().values(), [far + 3.0, far]);
        // About the mean of 3: 4 + 1 + 9 + 0.
        assert!((raster.scatter() - 14.0).abs() < 1e-6, "{}", raster.scatter());
    }

    #[test]
    fn passes_together_are_the_raster_of_all_samples() {
        let (mut passes, mut all) = (Passes::new([5, 4]), Raster::new([5, 4]));
        for k in 0..400_u32 {
            let position = [f64::from(k * 37 % 101) / 100.0, f64::from(k * 53 % 97) / 96.0];
            let value = f64::from(k * 29 % 83);
            passes.add(position, k % 3 == 0, value);
            all.add(position, value);
        }
        let both = passes.together();
        assert_eq!(both.counts(), all.counts());
        assert!((both.scatter() - all.scatter()).abs() < 1e-9 * all.scatter());
        for (a, b) in both.picture().values().iter().zip(all.picture().values()) {
            assert!((a - b).abs() < 1e-9);
        }
    }
}

//! A picture of grey values, where there are any.

/// Grey values row by row from the top; NaN where nothing is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    size: [usize; 2],
    values: Vec<f64>,
}

impl Picture {
    /// From `width·height` values; `None` if there are more or fewer.
    pub fn new(size: [usize; 2], values: Vec<f64>) -> Option<Self> {
        (size[0].checked_mul(size[1])? == values.len()).then_some(Self { size, values })
    }

    /// From exactly `width·height` values.
    pub(super) const fn of_values(size: [usize; 2], values: Vec<f64>) -> Self {
        Self { size, values }
    }

    /// The mean of a scene over each pixel, from `finer`² points in it.
    pub fn of_scene(size: [usize; 2], finer: usize, scene: impl Fn([f64; 2]) -> f64) -> Self {
        let [width, height] = size;
        let along = |pixel: usize, part: usize, pixels: usize| {
            (pixel as f64 + (part as f64 + 0.5) / finer as f64) / pixels as f64
        };
        let mut values = Vec::with_capacity(width * height);
        for row in 0..height {
            for column in 0..width {
                let points = (0..finer * finer)
                    .map(|i| scene([along(column, i % finer, width), along(row, i / finer, height)]));
                values.push(points.sum::<f64>() / (finer * finer) as f64);
            }
        }
        Self { size, values }
    }

    /// Width and height in pixels.
    pub const fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The values, row by row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value in a column and a row counted from 0; NaN outside.
    pub fn at(&self, column: usize, row: usize) -> f64 {
        let inside = column < self.size[0] && row < self.size[1];
        if inside { self.values[row * self.size[0] + column] } else { f64::NAN }
    }

    /// How many pixels have no value.
    pub fn empty(&self) -> usize {
        self.values.iter().filter(|v| v.is_nan()).count()
    }

    /// The smallest and the largest value; `None` where there is none.
    pub fn range(&self) -> Option<[f64; 2]> {
        let finite = self.values.iter().copied().filter(|v| v.is_finite());
        let range =
            finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        (range[0] <= range[1]).then_some(range)
    }

    /// The same with each value mapped.
    #[must_use]
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self { size: self.size, values: self.values.iter().map(|v| f(*v)).collect() }
    }

    /// The part that begins at a column and a row; cut where it would leave the picture.
    #[must_use]
    pub fn crop(&self, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Self {
        let columns = left.min(self.size[0])..left.saturating_add(width).min(self.size[0]);
        let rows = top.min(self.size[1])..top.saturating_add(height).min(self.size[1]);
        let size = [columns.len(), rows.len()];
        let values = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
        Self { size, values: values.map(|(column, row)| self.at(column, row)).collect() }
    }

    /// For the eye: empty pixels take the mean of their eight neighbours that have a value; how many did.
    ///
    /// One round, so that a hole wider than two pixels stays one.
    #[must_use]
    pub fn filled_from_neighbours(&self) -> (Self, usize) {
        let [width, height] = self.size;
        let mut values = self.values.clone();
        let mut count = 0;
        for (i, value) in values.iter_mut().enumerate().filter(|(_, v)| v.is_nan()) {
            let (column, row) = (i % width, i / width);
            let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
            let around = near(row, height).flat_map(|r| near(column, width).map(move |c| (c, r)));
            let around = around.map(|(c, r)| self.at(c, r)).filter(|v| v.is_finite());
            let (sum, found) = around.fold((0.0, 0_u32), |(sum, n), v| (sum + v, n + 1));
            if found > 0 {
                *value = sum / f64::from(found);
                count += 1;
            }
        }
        (Self { size: self.size, values }, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fill_takes_neighbouring_pixels_and_counts_them() {
        let nan = f64::NAN;
        let picture = Picture::new([3, 3], vec![nan, nan, nan, nan, nan, nan, nan, nan, 7.0]).unwrap();
        let (filled, count) = picture.filled_from_neighbours();
        assert_eq!((count, filled.empty(), picture.empty()), (3, 5, 8));
        assert_eq!([filled.at(1, 1), filled.at(2, 1), filled.at(1, 2)], [7.0; 3]);
    }

    #[test]
    fn a_pixel_is_the_mean_of_the_scene_over_it() {
        let ramp = Picture::of_scene([4, 2], 3, |[x, y]| x + 10.0 * y);
        for (column, row) in [(0, 0), (3, 0), (2, 1)] {
            let centre = (column as f64 + 0.5) / 4.0 + 10.0 * (row as f64 + 0.5) / 2.0;
            assert!((ramp.at(column, row) - centre).abs() < 1e-12);
        }
        assert!(ramp.at(4, 0).is_nan());
        let part = ramp.crop([2, 1], [9, 9]);
        assert_eq!((part.size(), part.at(0, 0)), ([2, 1], ramp.at(2, 1)));
    }
}

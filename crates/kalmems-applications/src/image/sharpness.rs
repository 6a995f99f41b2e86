//! How sharp an image is, without knowing what it should show.

use super::raster::{Passes, Raster};

/// A measure of sharpness that a wrong phase makes worse; less is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharpness {
    /// The variance of the samples about the mean of their pixel: Σ(I − Ī)²/(samples − pixels).
    ///
    /// Samples of one pixel show one piece of the object, whichever way and whenever the spot came by. With white noise
    /// this is the least-squares estimate of the phase, the image itself being what is not known.
    WithinPixel,
    /// The variance between the mean of the forward and that of the backward pass, per pixel that both have: what the
    /// measure above has of one axis' directions, without what the other axis' directions and different frames tell.
    PassMismatch,
    /// Minus the mean square of the difference of neighbours, as autofocus has it (gradient energy).
    ///
    /// Noise is a gradient as well, the more so the fewer samples a pixel has.
    Gradient,
}

impl Sharpness {
    /// Of passes, which are those of the axis whose phase is sought; NaN where there is too little to tell.
    pub fn of(self, passes: &Passes) -> f64 {
        match self {
            Self::WithinPixel => {
                let all = passes.together();
                all.scatter() / (all.samples() as f64 - all.filled() as f64).max(0.0)
            }
            Self::PassMismatch => passes.mismatch(),
            Self::Gradient => -gradient(&passes.together()),
        }
    }
}

fn gradient(raster: &Raster) -> f64 {
    let picture = raster.picture();
    let [width, height] = picture.size();
    let (mut sum, mut count) = (0.0, 0_usize);
    for row in 0..height {
        for column in 0..width {
            let here = picture.at(column, row);
            for next in [picture.at(column + 1, row), picture.at(column, row + 1)] {
                let square = (next - here) * (next - here);
                if square.is_finite() {
                    sum += square;
                    count += 1;
                }
            }
        }
    }
    sum / count as f64
}

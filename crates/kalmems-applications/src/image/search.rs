//! The phase that makes an image sharpest.

use super::raster::{Passes, Raster};
use super::scan::ImageScan;
use super::sharpness::Sharpness;
use crate::progress::Progress;
use serde::Serialize;

/// A phase that was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FoundPhase {
    /// How far the axis is ahead of its trajectory, in rad.
    pub phase_rad: f64,
    /// Its standard error in rad, from the curvature of the measure and what its two sides differ by; detail within pixels
    /// counts as noise. Only for [`Sharpness::WithinPixel`]; NaN for others.
    pub sd_rad: f64,
    /// The measure at its best.
    pub best: f64,
}

/// A phase at which the sharpness was measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TriedPhase {
    /// How far the axis is taken to be ahead of its trajectory, in rad.
    pub phase_rad: f64,
    /// The measure there: the less, the sharper.
    pub measure: f64,
    /// Pixels along the axis of the image that was measured. Images of different sizes have different measures.
    pub pixels: usize,
}

/// What a search of phases gave, for x and for y.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhaseSearchResult {
    /// What was found; `None` of an axis that was not searched.
    pub found: [Option<FoundPhase>; 2],
    /// Where the measure was taken: over the last range with coarse steps, and about the best with fine ones.
    pub tried: [Vec<TriedPhase>; 2],
}

/// Why no phase was found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PhaseSearchError {
    /// The measure says nothing.
    #[error(
        "too few samples for a search: expected several per pixel; give fewer pixels or a longer recording"
    )]
    TooFew,
    /// The best lies at the end of what was searched.
    #[error(
        "the image is sharpest at the end of the search of the axis {axis}, {} deg, if at all: give a wider \
         `search`, or another `phase` to start from", .phase_rad.to_degrees()
    )]
    AtEnd {
        /// `x` or `y`.
        axis: &'static str,
        /// The end in rad.
        phase_rad: f64,
    },
    /// There is no best.
    #[error(
        "the image of the axis {axis} is no sharper at one phase than at its neighbours; expected an object with detail \
         that is swept in both directions"
    )]
    Flat {
        /// `x` or `y`.
        axis: &'static str,
    },
    /// Stopped from outside.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

/// How much coarser than wanted an image may be.
const COARSER: [usize; 4] = [1, 2, 4, 8];
/// Pixels that an image of the first, wide search keeps along an axis: coarser ones blur what the passes are matched by.
const FEWEST: usize = 48;
/// The part of the pixels that an image must fill to be searched: which pixels of a sparser one have samples of several
/// passes changes with the phase, and draws the minimum along.
const COVERED: f64 = 0.99;
/// Points of a parabola on each side of its middle.
const SIDE: i32 = 4;
/// Samples that are kept per pixel of a coarse image, and the fewest that one in so many are taken of.
const PER_PIXEL: usize = 8;
const THINNEST: usize = 61;

/// Searches the phase of each axis that has a range, `start ± range` in rad, from coarse to fine; `None` for others.
///
/// First through the whole range with half the pixels, half a pixel at a step and one axis after the other; twice, as an
/// axis is matched better once the other is right. Then around what was best with as many pixels as leave none empty. At
/// last a parabola through nine points over one pixel to each side. With forward and backward pass split by twice the
/// phase error the measure is even about the true phase, so that a parabola has its vertex there even where the measure is
/// no parabola.
pub fn search_phases(
    scan: &ImageScan,
    start_rad: [f64; 2],
    ranges_rad: [Option<f64>; 2],
    sharpness: Sharpness,
    progress: &dyn Progress,
) -> Result<PhaseSearchResult, PhaseSearchError> {
    let tried = [Vec::new(), Vec::new()];
    let mut search = PhaseSearch { scan, sharpness, phases: start_rad, progress, done: 0, tried };
    let axes: Vec<(usize, f64)> = (0..2)
        .filter(|axis| scan.axis(*axis).is_some())
        .filter_map(|axis| Some((axis, ranges_rad[axis]?)))
        .collect();
    progress.begin("searching the phase", 0);
    let finest = search.finest();
    let fewest = axes.iter().map(|(axis, _)| search.size(2 * finest)[*axis]).min().unwrap_or(0);
    let first = if fewest >= FEWEST { 2 * finest } else { finest };
    let mut reach = [0.0; 2];
    for round in 0..axes.len() {
        for (axis, range) in axes.iter().copied() {
            reach[axis] = search.step(axis, first, start_rad[axis], range)?;
            let farthest = (search.phases[axis] - start_rad[axis]).abs() + reach[axis] / 2.0 > range;
            if farthest && round + 1 == axes.len() {
                return Err(PhaseSearchError::AtEnd { axis: NAMES[axis], phase_rad: search.phases[axis] });
            }
        }
    }
    let wide = search.tried.clone();
    for (axis, _) in axes.iter().copied() {
        search.step(axis, finest, search.phases[axis], reach[axis])?;
    }
    let mut found = [None; 2];
    // Twice: the second axis was not at its best when the first was.
    for _ in 0..2 {
        for (axis, range) in axes.iter().copied() {
            let fit = search.vertex(axis, finest)?;
            search.phases[axis] = fit.phase_rad;
            if (fit.phase_rad - start_rad[axis]).abs() > range {
                return Err(PhaseSearchError::AtEnd { axis: NAMES[axis], phase_rad: fit.phase_rad });
            }
            found[axis] = Some(fit);
        }
    }
    let mut tried = wide;
    for (all, fine) in tried.iter_mut().zip(search.tried) {
        all.extend(fine);
    }
    Ok(PhaseSearchResult { found, tried })
}

const NAMES: [&str; 2] = ["x", "y"];

struct PhaseSearch<'a> {
    scan: &'a ImageScan,
    sharpness: Sharpness,
    phases: [f64; 2],
    progress: &'a dyn Progress,
    done: u64,
    /// Of each axis what was measured last.
    tried: [Vec<TriedPhase>; 2],
}

/// One axis of a search: what does not change while its phase does.
struct FixedAxisData {
    axis: usize,
    size: [usize; 2],
    every: usize,
    other: Vec<(f64, bool)>,
}

impl PhaseSearch<'_> {
    /// How much coarser the finest image is that has (nearly) no empty pixel.
    fn finest(&self) -> usize {
        let [x, y] = [0, 1].map(|axis| self.scan.positions(axis, self.phases[axis], 1));
        let full = |coarser: &usize| {
            let mut raster = Raster::new(self.size(*coarser));
            for ((x, _), (y, _)) in x.iter().zip(&y) {
                raster.add([*x, *y], 0.0);
            }
            raster.coverage() >= COVERED
        };
        COARSER.into_iter().find(full).unwrap_or(8)
    }

    fn fixed(&self, axis: usize, coarser: usize, every: usize) -> FixedAxisData {
        let size = self.size(coarser);
        let other = self.scan.positions(1 - axis, self.phases[1 - axis], every);
        FixedAxisData { axis, size, every, other }
    }

    fn size(&self, coarser: usize) -> [usize; 2] {
        self.scan.size().map(|pixels| pixels.div_ceil(coarser))
    }

    fn passes(&mut self, fixed: &FixedAxisData, phase_rad: f64) -> Result<Passes, PhaseSearchError> {
        self.done += 1;
        if self.progress.reached(self.done).is_break() {
            return Err(PhaseSearchError::Interrupted);
        }
        let mut passes = Passes::new(fixed.size);
        let along = self.scan.positions(fixed.axis, phase_rad, fixed.every);
        let intensities = self.scan.intensity.iter().step_by(fixed.every);
        for (((a, rising), (b, _)), intensity) in along.into_iter().zip(&fixed.other).zip(intensities) {
            if intensity.is_finite() {
                let position = if fixed.axis == 0 { [a, *b] } else { [*b, a] };
                passes.add(position, rising, *intensity);
            }
        }
        Ok(passes)
    }

    /// The best of the phases half a pixel apart within `reach` of `middle` becomes the present one; one step and a half,
    /// how far a finer search reaches.
    fn step(
        &mut self,
        axis: usize,
        coarser: usize,
        middle: f64,
        reach: f64,
    ) -> Result<f64, PhaseSearchError> {
        let size = self.size(coarser);
        let spare = self.scan.time_s.len() / (PER_PIXEL * size[0] * size[1]).max(1);
        // Odd, so that it is less likely to keep step with the motion.
        let fixed = self.fixed(axis, coarser, spare.clamp(1, THINNEST) | 1);
        let step = 1.0 / fixed.size[axis] as f64;
        #[allow(clippy::cast_possible_truncation)] // a few
        let side = (reach / step).floor().clamp(1.0, 1e4) as i32;
        let mut best: Option<(f64, f64)> = None;
        self.tried[axis].clear();
        for i in -side..=side {
            let phase = middle + f64::from(i) * step;
            let value = self.sharpness.of(&self.passes(&fixed, phase)?);
            self.tried[axis].push(TriedPhase { phase_rad: phase, measure: value, pixels: size[axis] });
            if value.is_finite() && best.is_none_or(|(_, least)| value < least) {
                best = Some((phase, value));
            }
        }
        let (phase, _) = best.ok_or(PhaseSearchError::TooFew)?;
        self.phases[axis] = phase;
        Ok(1.5 * step)
    }

    /// The vertex of a parabola over one pixel to each side of the present phase.
    fn vertex(&mut self, axis: usize, coarser: usize) -> Result<FoundPhase, PhaseSearchError> {
        let fixed = self.fixed(axis, coarser, 1);
        let step = 2.0 / fixed.size[axis] as f64 / f64::from(SIDE);
        let mut middle = self.phases[axis];
        for _ in 0..4 {
            let (mut values, mut freedom) = ([0.0; 2 * SIDE as usize + 1], 0.0);
            self.tried[axis].clear();
            for (i, value) in (-SIDE..=SIDE).zip(&mut values) {
                let phase_rad = middle + f64::from(i) * step;
                let passes = self.passes(&fixed, phase_rad)?;
                *value = self.sharpness.of(&passes);
                let tried = TriedPhase { phase_rad, measure: *value, pixels: fixed.size[axis] };
                self.tried[axis].push(tried);
                if i == 0 {
                    let all = passes.together();
                    freedom = all.samples() as f64 - all.filled() as f64;
                }
            }
            if values.iter().any(|v| !v.is_finite()) {
                return Err(PhaseSearchError::TooFew);
            }
            let parabola = Parabola::through(&values);
            if parabola.curvature <= 0.0 || parabola.vertex.abs() > f64::from(SIDE) {
                return Err(PhaseSearchError::Flat { axis: NAMES[axis] });
            }
            middle += parabola.vertex * step;
            if parabola.vertex.abs() < 0.5 {
                let sd_rad = match self.sharpness {
                    // With J = Σ(I − Ī)²/σ² the variance is 2/J'', and J is the measure times freedom/σ².
                    Sharpness::WithinPixel => {
                        let noise = parabola.least / (parabola.curvature * freedom);
                        step * (noise + parabola.vertex_variance).sqrt()
                    }
                    _ => f64::NAN,
                };
                return Ok(FoundPhase { phase_rad: middle, sd_rad, best: parabola.least });
            }
        }
        Err(PhaseSearchError::Flat { axis: NAMES[axis] })
    }
}

/// The parabola that fits nine values at −4, −3, … 4 best.
struct Parabola {
    curvature: f64,
    vertex: f64,
    /// By what the parabola leaves.
    vertex_variance: f64,
    least: f64,
}

impl Parabola {
    fn through(values: &[f64; 2 * SIDE as usize + 1]) -> Self {
        // Orthogonal polynomials: 1, u and u² − 20/3 have sums of squares of 9, 60 and 308.
        let points = || (-SIDE..=SIDE).map(f64::from).zip(values);
        let mean = values.iter().sum::<f64>() / 9.0;
        let slope = points().map(|(u, v)| u * v).sum::<f64>() / 60.0;
        let curvature = points().map(|(u, v)| (u * u - 20.0 / 3.0) * v).sum::<f64>() / 308.0;
        let at = |u: f64| mean + slope * u + curvature * (u * u - 20.0 / 3.0);
        let vertex = -slope / (2.0 * curvature);
        // Only what is odd about the middle moves the vertex; that the measure is no parabola is even. Half the difference
        // of two points has half the variance of one, and one of the four is spent on the slope.
        let left = |u: f64, v: f64| v - at(u);
        let mirrored = points().zip(values.iter().rev()).filter(|((u, _), _)| *u > 0.0);
        let odd = mirrored.map(|((u, v), opposite)| (left(u, *v) - left(-u, *opposite)) / 2.0);
        let variance = 2.0 * odd.map(|x| x * x).sum::<f64>() / 3.0;
        let vertex_variance = variance / 60.0 / (4.0 * curvature * curvature);
        Self { curvature, vertex, vertex_variance, least: at(vertex) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_found_again() {
        let values: Vec<f64> = (-4..=4).map(|u| 3.0 + 0.2 * (f64::from(u) - 0.7).powi(2)).collect();
        let parabola = Parabola::through(&values.try_into().unwrap());
        assert!((parabola.vertex - 0.7).abs() < 1e-12 && (parabola.curvature - 0.2).abs() < 1e-12);
        assert!((parabola.least - 3.0).abs() < 1e-12 && parabola.vertex_variance < 1e-25);
    }
}

//! The zero crossing of the smoothed signal.

use super::DetectError;
use crate::Scalar;

/// How often a fit is moved onto the crossing that it found.
const MOVES: usize = 3;

/// A zero crossing near a detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<T> {
    /// Its time after the sample that was asked about, in samples.
    pub displacement: T,
    /// The slope of the smoothed signal there, in its unit per sample.
    pub slope: T,
    /// The variance of its time that noise causes, in samples²: that of the smoothed signal over slope².
    pub timing_variance: T,
}

/// A cubic fitted to `REACH` samples on each side, weighted by a Gaussian of s samples, and where it is zero.
///
/// The steepest slope is not at the threshold angle: the speed changes while the edge is passed. The zero is, because
/// the gain of the sensor is zero there whatever the speed, as long as the signal's offset is known. A cubic follows
/// the edge closely enough that smoothing does not move it.
///
/// Least squares with Gaussian weights need four sums Σ w·u^j·y, u = n/s: fixed kernels, the even ones over sums and the
/// odd ones over differences of the samples on both sides. The fit is moved by whole samples until the zero is within
/// half a sample of its centre, three times at most; then its value there has the noise of the kernel for the value at
/// the centre, σ²·Σk₀².
#[derive(Clone, Copy, Debug)]
pub struct CubicFit<T, const REACH: usize> {
    /// The Gaussian at 1 … `REACH`; one at 0.
    weights: [T; REACH],
    /// 1/s.
    scale: T,
    /// Σ w·u^(2i) over all samples, i = 0 … 3.
    moments: [T; 4],
    /// Σk₀².
    noise_gain: T,
}

/// The numbers of a [`CubicFit`] for any reach, in f64: for a table that is made before a program is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubicDesign {
    /// The standard deviation of the Gaussian in samples.
    pub width: f64,
    /// Σ w·u^(2i) over all samples, i = 0 … 3.
    pub moments: [f64; 4],
    /// Σk₀²: the variance of the fitted value at the centre, per variance of white noise.
    pub noise_gain: f64,
}

impl CubicDesign {
    /// For a Gaussian of standard deviation `width` samples and `reach` samples on each side.
    ///
    /// # Errors
    /// Where the width is not a positive number.
    pub fn new(width: f64, reach: usize) -> Result<Self, DetectError> {
        if !(width > 0.0 && width.is_finite()) {
            return Err(DetectError::Width { samples: width });
        }
        let mut design = Self { width, moments: [1.0, 0.0, 0.0, 0.0], noise_gain: 0.0 };
        for n in 1..=reach {
            let mut term = 2.0 * design.weight(n);
            for moment in &mut design.moments {
                *moment += term;
                term *= (n as f64 / width).sq();
            }
        }
        let [zeroth, second, fourth, _] = design.moments;
        let value = |n: usize| {
            design.weight(n) * (fourth - second * (n as f64 / width).sq()) / (zeroth * fourth - second.sq())
        };
        let mut noise = value(0).sq();
        for n in 1..=reach {
            noise += 2.0 * value(n).sq();
        }
        Ok(Self { noise_gain: noise, ..design })
    }

    /// The Gaussian at n; one at 0.
    pub fn weight(&self, n: usize) -> f64 {
        Scalar::exp(-(n as f64 / self.width).sq() / 2.0)
    }
}

impl<T: Scalar, const REACH: usize> CubicFit<T, REACH> {
    /// The fit with a Gaussian of standard deviation `width` samples.
    ///
    /// # Errors
    /// Where the width is not a positive number.
    pub fn new(width: f64) -> Result<Self, DetectError> {
        let design = CubicDesign::new(width, REACH)?;
        let mut weights = [T::of(0.0); REACH];
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight = T::of(design.weight(i + 1));
        }
        Ok(Self::of_table(weights, &design))
    }

    /// The fit of a design whose Gaussian at 1 … `REACH` stands in a table. A microcontroller then computes no
    /// exponential before its first sample.
    #[inline(always)]
    pub fn of_table(weights: [T; REACH], design: &CubicDesign) -> Self {
        const { assert!(REACH > 1, "a cubic needs four samples") };
        let (moments, noise_gain) = (design.moments.map(T::of), T::of(design.noise_gain));
        Self { weights, scale: T::of(1.0 / design.width), moments, noise_gain }
    }

    /// The zero of `signal` − `offset` near the sample `centre`.
    ///
    /// None where there is no simple zero within two s of a centre, or where a sample that the fit needs is beyond the
    /// ends or not a number.
    pub fn crossing(&self, signal: &[T], centre: usize, offset: T, noise_variance: T) -> Option<Crossing<T>> {
        let (half, one) = (T::of(0.5), T::of(1.0));
        let (mut centre, mut moved) = (centre, T::of(0.0));
        for move_number in 0..=MOVES {
            let cubic = self.fit(signal, centre, offset)?;
            let zero = zero_near_the_centre(&cubic)?;
            let mut left = zero / self.scale;
            if move_number == MOVES || !left.abs().gt(half) {
                let slope = slope(&cubic, zero) * self.scale;
                let timing_variance = noise_variance * self.noise_gain / slope.sq();
                let crossing = Crossing { displacement: moved + left, slope, timing_variance };
                return timing_variance.is_finite().then_some(crossing);
            }
            // By whole samples; the zero is within two s, so that this ends.
            while left.gt(half) {
                (centre, moved, left) = (centre.checked_add(1)?, moved + one, left - one);
            }
            while left.lt(-half) {
                (centre, moved, left) = (centre.checked_sub(1)?, moved - one, left + one);
            }
        }
        None
    }

    /// The coefficients of 1, u, u², u³ around a sample.
    fn fit(&self, signal: &[T], centre: usize, offset: T) -> Option<[T; 4]> {
        let window = signal.get(centre.checked_sub(REACH)?..=centre.checked_add(REACH)?)?;
        let (before, after) = (window.get(..REACH)?, window.get(REACH + 1..)?);
        let mut sums = [*window.get(REACH)? - offset, T::of(0.0), T::of(0.0), T::of(0.0)];
        let mut u = T::of(0.0);
        for ((weight, earlier), later) in self.weights.iter().zip(before.iter().rev()).zip(after) {
            u = u + self.scale;
            let even = *weight * ((*later - offset) + (*earlier - offset));
            let odd = *weight * u * (*later - *earlier);
            sums[0] = sums[0] + even;
            sums[1] = sums[1] + odd;
            sums[2] = sums[2] + even * u.sq();
            sums[3] = sums[3] + odd * u.sq();
        }
        let [m0, m2, m4, m6] = self.moments;
        let (even, odd) = ((m0 * m4 - m2.sq()).recip(), (m2 * m6 - m4.sq()).recip());
        let cubic = [
            (m4 * sums[0] - m2 * sums[2]) * even,
            (m6 * sums[1] - m4 * sums[3]) * odd,
            (m0 * sums[2] - m2 * sums[0]) * even,
            (m2 * sums[3] - m4 * sums[1]) * odd,
        ];
        cubic.iter().all(|coefficient| coefficient.is_finite()).then_some(cubic)
    }
}

/// The cubic's derivative.
fn slope<T: Scalar>(cubic: &[T; 4], u: T) -> T {
    cubic[1] + u * (cubic[2].twice() + u * cubic[3] * T::of(3.0))
}

/// The zero that Newton's method finds from the centre, within |u| ≤ 2.
fn zero_near_the_centre<T: Scalar>(cubic: &[T; 4]) -> Option<T> {
    let mut u = T::of(0.0);
    for _ in 0..32 {
        let value = cubic[0] + u * (cubic[1] + u * (cubic[2] + u * cubic[3]));
        let step = value / slope(cubic, u);
        u = u - step;
        // Not a number is not within either.
        if !u.abs().lt(T::of(2.0)) {
            return None;
        }
        // 1e-6 s: the next step would be the square of it.
        if step.abs().lt(T::of(1e-6)) {
            return Some(u);
        }
    }
    None
}

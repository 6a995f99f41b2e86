//! The derivative of a Gaussian.

use super::{DetectError, NoiseMaxima};
use crate::Scalar;

/// The slope of a signal, smoothed by a Gaussian of standard deviation s samples, from `HALF` samples on each side.
///
/// r_k = Σₙ g_n·(x_{k+n} − x_{k−n}), n = 1 … `HALF`, with g_n ∝ n·exp(−n²/2s²), so that Σ over both sides of n·g_n
/// is one: a ramp of slope 1 per sample gives r = 1, and `r` is in the signal's unit per sample. The antisymmetry
/// halves the products. What is smoothed out most is noise; a rising edge gives a positive maximum, a falling one a
/// negative, and the sign tells a crossing from a turning point. Four s on each side hold all but 3·10⁻⁴ of its
/// largest weight.
///
/// Source: Canny, IEEE Trans. Pattern Analysis and Machine Intelligence 8, 679 (1986); for threshold sensing Chen &
/// others, IEEE Trans. Industrial Electronics 67, 1328 (2020).
///
/// ```
/// use kalmems_core::detect::SlopeKernel;
/// let kernel = SlopeKernel::<f64, 60>::new(15.0)?;
/// let ramp: Vec<f64> = (0..121).map(|k| 3.0 + 0.25 * f64::from(k)).collect();
/// assert!((kernel.response(&ramp) - 0.25).abs() < 1e-12);
/// # Ok::<(), kalmems_core::detect::DetectError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SlopeKernel<T, const HALF: usize> {
    weights: [T; HALF],
    /// The variances of the response and of its derivative by the sample, per variance of white noise.
    noise_gain: T,
    jitter_gain: T,
    /// [`SlopeDesign::moments`].
    moments: [f64; 3],
}

/// The numbers of a [`SlopeKernel`] for any length, in f64: for a table that is made before a program is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeDesign {
    width: f64,
    /// Σn·n·e^(−n²/2s²) over both sides.
    ramp: f64,
    moments: [f64; 3],
}

/// e^(−n²/2s²).
fn bell(n: f64, width: f64) -> f64 {
    Scalar::exp(-(n / width).sq() / 2.0)
}

impl SlopeDesign {
    /// For rising edges, of a Gaussian of standard deviation `width` samples, with `half` samples on each side.
    ///
    /// # Errors
    /// Where the width is not a positive number.
    pub fn new(width: f64, half: usize) -> Result<Self, DetectError> {
        if !(width > 0.0 && width.is_finite()) {
            return Err(DetectError::Width { samples: width });
        }
        // The kernel n·e^(−n²/2s²) and its derivatives by n, summed over both sides.
        let (mut ramp, mut squares) = (0.0, [0.0, 0.5, 0.0]);
        for i in 0..half {
            let n = (i + 1) as f64;
            let u = (n / width).sq();
            ramp += 2.0 * n * n * bell(n, width);
            let derivatives = [n, 1.0 - u, n * (u - 3.0) / width.sq()];
            for (square, derivative) in squares.iter_mut().zip(derivatives) {
                *square += (derivative * bell(n, width)).sq();
            }
        }
        Ok(Self { width, ramp, moments: squares.map(|square| 2.0 * square / ramp.sq()) })
    }

    /// g_n, n = 1 … `half`.
    pub fn weight(&self, n: usize) -> f64 {
        n as f64 * bell(n as f64, self.width) / self.ramp
    }

    /// The variance of the response to white noise of variance one per sample.
    pub const fn noise_gain(&self) -> f64 {
        self.moments[0]
    }

    /// λ₀, λ₂ and λ₄: the variances of the response and of its first two derivatives by the sample, per variance of white
    /// noise.
    pub const fn moments(&self) -> [f64; 3] {
        self.moments
    }
}

impl<T: Scalar, const HALF: usize> SlopeKernel<T, HALF> {
    /// The kernel for rising edges, of a Gaussian of standard deviation `width` samples.
    ///
    /// # Errors
    /// Where the width is not a positive number.
    pub fn new(width: f64) -> Result<Self, DetectError> {
        let design = SlopeDesign::new(width, HALF)?;
        let mut weights = [T::of(0.0); HALF];
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight = T::of(design.weight(i + 1));
        }
        Ok(Self::of_table(weights, design.moments))
    }

    /// The kernel of a [`SlopeDesign`] whose numbers stand in a table: its weights at 1 … `HALF`, with the opposite sign
    /// for falling edges, and its moments. A microcontroller then computes no exponential before its first sample.
    #[inline(always)]
    pub fn of_table(weights: [T; HALF], moments: [f64; 3]) -> Self {
        const { assert!(HALF > 0, "a slope needs a sample on each side") };
        let [noise, jitter, _] = moments;
        Self { weights, noise_gain: T::of(noise), jitter_gain: T::of(jitter), moments }
    }

    /// The same for falling edges: all responses change their sign.
    #[must_use]
    pub fn falling(mut self) -> Self {
        for weight in &mut self.weights {
            *weight = -*weight;
        }
        self
    }

    /// How many samples a response is made of: 2·`HALF` + 1.
    pub const fn length(&self) -> usize {
        2 * HALF + 1
    }

    /// The response at the middle of a window of 2·`HALF` + 1 samples, the oldest first; not a number for a window of
    /// another length. The sample in the middle has no weight.
    // A function of its own: within a detector a Cortex-M4F computes the address of each sample from the detector's, two
    // instructions more for each.
    #[inline(never)]
    pub fn response(&self, window: &[T]) -> T {
        let (Some(before), Some(after)) = (window.get(..HALF), window.get(HALF + 1..)) else {
            return T::of(f64::NAN);
        };
        if after.len() != HALF {
            return T::of(f64::NAN);
        }
        // Four sums side by side: each waits for its own last addition alone.
        let (weights, last_weights) = self.weights.as_chunks::<4>();
        let (after, last_after) = after.as_chunks::<4>();
        let (last_before, before) = before.as_rchunks::<4>();
        let mut sums = [T::of(0.0); 4];
        for ((w, a), b) in weights.iter().zip(after).zip(before.iter().rev()) {
            for i in 0..4 {
                sums[i] = sums[i] + w[i] * (a[i] - b[3 - i]);
            }
        }
        for ((w, a), b) in last_weights.iter().zip(last_after).zip(last_before.iter().rev()) {
            sums[0] = sums[0] + *w * (*a - *b);
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3])
    }

    /// The responses at all samples of a signal; not a number where one of the 2·`HALF` + 1 samples is missing (not
    /// finite, or beyond the ends). What of `out` is longer than the signal is filled in the same way.
    pub fn responses(&self, signal: &[T], out: &mut [T])
    where
        T: Scalar,
    {
        let length = self.length();
        out.fill(T::of(f64::NAN));
        let mut whole = 0;
        for (k, sample) in signal.iter().enumerate() {
            whole = if sample.is_finite() { whole + 1 } else { 0 };
            if whole < length {
                continue;
            }
            if let (Some(window), Some(response)) = (signal.get(k + 1 - length..=k), out.get_mut(k - HALF)) {
                *response = self.response(window);
            }
        }
    }

    /// The standard deviation of the response to white noise of standard deviation `noise` per sample.
    pub fn noise_deviation(&self, noise: T) -> T {
        noise.abs() * self.noise_gain.sqrt()
    }

    /// The variance of a maximum's time, in samples², where the response to the edge alone curves by `curvature` per
    /// sample² (negative at a maximum) and the white noise has `noise_variance` per sample.
    ///
    /// For small displacements Canny's σ_c² = σ²·∫f′² / (∫f′·y′)²: noise tilts the response by r′, and the maximum moves by
    /// −r′/r″. With σ² per sample and t in samples no interval appears; printed with seconds the noise must be a density
    /// (Chen 2018, equation 65, corrected).
    ///
    /// Where σ_c exceeds the distance 1/β over which the response's noise changes, β² = λ₂/λ₀, the edge has several maxima,
    /// and the highest of them is nearer than the first one moved would be: at a height of u standard deviations above the
    /// edge's their density falls by e^{−u·κ·t²/2} as well, κ = −r″ over the response's noise, so that
    /// 1/σ_t² = 1/σ_c² + ū·κ with the mean height ū of the highest. By Rice's formula for the maxima and the chance of none
    /// higher, that is
    ///
    /// σ_t² = σ_c² / (1 + q²/(3 + 0.57·q)), q = β·σ_c,
    ///
    /// to 5 % of σ_t up to q = 40 (test `the_highest_of_several_maxima_is_as_near_as_rice_predicts`); on free decays of the
    /// scanner it holds at all signal-to-noise ratios (test `slow_times_and_angles_are_as_well_known_as_predicted`).
    ///
    /// Without noise an edge with a bell-shaped slope of variance w² gives r″ = −r/(s² + w²).
    pub fn timing_variance(&self, noise_variance: T, curvature: T) -> T {
        let small = noise_variance * self.jitter_gain / curvature.sq();
        let square = small * self.jitter_gain / self.noise_gain;
        let competing = square / (T::of(3.0) + T::of(0.57) * square.sqrt());
        small / (T::of(1.0) + competing)
    }

    /// How often the response to white noise has maxima.
    pub fn noise_maxima(&self) -> NoiseMaxima {
        NoiseMaxima::of_moments(self.moments)
    }
}

//! The core's kernel and fit in the sizes that are compiled.

use kalmems_core::detect::{self, CubicFit, DetectError, SlopeKernel, Threshold};

/// The zero crossing is fitted with a Gaussian of this many widths of the detector's.
const FIT_WIDTHS: f64 = 2.0;

/// How many samples are needed around a crossing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelWindow {
    /// On each side of a response.
    pub half: usize,
    /// On each side of the centre of a fit.
    pub fit: usize,
    /// The least distance between crossings.
    pub reach: usize,
}

impl KernelWindow {
    /// For a Gaussian of this width and this distance, in samples: the smallest kernel that holds four widths on each side.
    pub fn of(width: f64, separation: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // positive, and beyond the signal is its end
        let reach = separation.round().clamp(1.0, f64::from(u32::MAX)) as usize;
        // 30 µs of 2 µs are 15 samples but for rounding, and must not get the next kernel.
        let fits = |samples: f64| width <= samples * (1.0 + 1e-6);
        let (half, fit) = match () {
            () if fits(15.0) => (60, 90),
            () if fits(60.0) => (240, 360),
            () => (960, 1440),
        };
        Self { half, fit, reach }
    }

    /// How many samples after it a crossing is known: when no higher response can follow, and the fit of its zero has had room
    /// to move by three eighths of itself.
    pub const fn look_ahead(&self) -> usize {
        let (peak, zero) = (self.half + self.reach + 1, self.fit + 3 * self.fit / 8);
        if peak > zero { peak } else { zero }
    }

    /// How many samples before the last a search that goes on looks at.
    pub const fn look_back(&self) -> usize {
        let (peak, zero) = (self.half + self.reach + 2, 2 * self.fit);
        self.look_ahead() + if peak > zero { peak } else { zero }
    }
}

/// A kernel and a fit of one size.
pub trait CrossingKernel {
    /// The responses to a signal; see [`SlopeKernel::responses`].
    fn responses(&self, signal: &[f64], out: &mut [f64]);

    /// The same for falling edges.
    fn falling(&mut self);

    /// The standard deviation of the response to noise of this standard deviation.
    fn noise_deviation(&self, noise: f64) -> f64;

    /// The variance of a maximum's time in samples².
    fn timing_variance(&self, noise_variance: f64, curvature: f64) -> f64;

    /// The zero crossing near a sample.
    fn crossing(
        &self,
        signal: &[f64],
        centre: usize,
        offset: f64,
        noise_variance: f64,
    ) -> Option<detect::Crossing<f64>>;

    /// False alarms per sample above so many standard deviations.
    fn detections(&self, deviations: f64, reach: usize) -> f64;

    /// The threshold with this rate of false alarms per sample.
    fn threshold(
        &self,
        noise: f64,
        per_sample: f64,
        reach: usize,
        hold: Option<detect::HoldLevel>,
    ) -> Result<Threshold<f64>, DetectError>;
}

/// The kernel of this window, for a Gaussian of this width in samples.
pub fn kernel(window: KernelWindow, width: f64) -> Result<Box<dyn CrossingKernel + Send>, DetectError> {
    match window.half {
        60 => Ok(Box::new(OfSize::<60, 90>::new(width)?)),
        240 => Ok(Box::new(OfSize::<240, 360>::new(width)?)),
        _ => Ok(Box::new(OfSize::<960, 1440>::new(width)?)),
    }
}

struct OfSize<const HALF: usize, const FIT: usize> {
    kernel: SlopeKernel<f64, HALF>,
    fit: CubicFit<f64, FIT>,
}

impl<const HALF: usize, const FIT: usize> OfSize<HALF, FIT> {
    fn new(width: f64) -> Result<Self, DetectError> {
        Ok(Self { kernel: SlopeKernel::new(width)?, fit: CubicFit::new(FIT_WIDTHS * width)? })
    }
}

impl<const HALF: usize, const FIT: usize> CrossingKernel for OfSize<HALF, FIT> {
    fn responses(&self, signal: &[f64], out: &mut [f64]) {
        self.kernel.responses(signal, out);
    }

    fn falling(&mut self) {
        self.kernel = self.kernel.falling();
    }

    fn noise_deviation(&self, noise: f64) -> f64 {
        self.kernel.noise_deviation(noise)
    }

    fn timing_variance(&self, noise_variance: f64, curvature: f64) -> f64 {
        self.kernel.timing_variance(noise_variance, curvature)
    }

    fn crossing(
        &self,
        signal: &[f64],
        centre: usize,
        offset: f64,
        noise_variance: f64,
    ) -> Option<detect::Crossing<f64>> {
        self.fit.crossing(signal, centre, offset, noise_variance)
    }

    fn detections(&self, deviations: f64, reach: usize) -> f64 {
        self.kernel.noise_maxima().detections(deviations, reach)
    }

    fn threshold(
        &self,
        noise: f64,
        per_sample: f64,
        reach: usize,
        hold: Option<detect::HoldLevel>,
    ) -> Result<Threshold<f64>, DetectError> {
        Threshold::for_false_alarms(&self.kernel, noise, per_sample, reach, hold)
    }
}

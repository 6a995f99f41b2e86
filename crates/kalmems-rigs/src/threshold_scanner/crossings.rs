//! When the signal passes the threshold.

use super::settings::{Acceptance, DetectorSettings};
use crate::config::Timing;
use kalmems_core::detect::{
    CubicFit, DetectError, Hold, Peak, SlopeKernel, Threshold, angle_variance, peaks,
};
use kalmems_models::capacitance::CombCurve;

/// A crossing of the threshold.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    sample: Instant,
    parabola: Instant,
    zero: Option<Instant>,
    /// The sample at which a detector that runs with the signal knows of it.
    pub known_at: usize,
}

/// One reading of when a crossing was.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    /// When, in s.
    pub time_s: f64,
    /// The variance of the angle then, in rad²: that of the time, by the square of the rate.
    pub angle_variance: f64,
    /// How fast the signal rises, in V/s.
    pub volts_per_s: f64,
}

impl Crossing {
    /// When it was; `None` where the signal passes its offset nowhere near.
    pub fn at(&self, timing: Timing) -> Option<Instant> {
        match timing {
            Timing::Sample => Some(self.sample),
            Timing::Parabola => Some(self.parabola),
            Timing::ZeroCrossing => self.zero,
        }
    }
}

#[cfg(test)]
impl Crossing {
    /// The same at another sample, of those that are so far apart.
    pub fn moved_to(&self, sample: usize, interval_s: f64) -> Self {
        let by_s = sample as f64 * interval_s - self.sample.time_s;
        let moved = |instant: Instant| Instant { time_s: instant.time_s + by_s, ..instant };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample's own place
        let own = (self.sample.time_s / interval_s).round() as usize;
        Self {
            sample: moved(self.sample),
            parabola: moved(self.parabola),
            zero: self.zero.map(moved),
            known_at: self.known_at - own + sample,
        }
    }
}

/// What a detector found.
pub struct Found {
    /// In the order of time.
    pub crossings: Vec<Crossing>,
    /// The largest response in standard deviations of that to noise.
    pub rising: f64,
    /// The largest response of the other sign.
    pub falling: f64,
    /// The smallest response that counts.
    pub threshold: f64,
    /// How many crossings noise alone would be taken for.
    pub by_noise: f64,
}

/// A signal in which crossings are looked for.
#[derive(Clone, Copy)]
pub struct Signal<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// In V, without what the drive adds.
    pub volts: &'a [f64],
    /// The usual interval in s.
    pub interval_s: f64,
    /// The variance of one sample in V².
    pub noise_variance: f64,
    /// What it is without motion, in V, as far as is known.
    pub offset: f64,
    /// The comb that makes it.
    pub comb: CombCurve<f64>,
    /// How often the threshold is passed while the device moves, per s.
    pub passes_hz: f64,
}

/// The zero crossing is fitted with a Gaussian of this many widths of the detector's.
const FIT_WIDTHS: f64 = 2.0;

/// A variance of 1/12 sample²: a time that is known to the sample.
const OF_A_SAMPLE: f64 = 1.0 / 12.0;

/// Looks for crossings with the smallest kernel that holds four widths on each side.
pub fn find(signal: Signal, settings: &DetectorSettings) -> Result<Found, DetectError> {
    let width = settings.width_s / signal.interval_s;
    // 30 µs of 2 µs are 15 samples but for rounding, and must not get the next kernel.
    let fits = |samples: f64| width <= samples * (1.0 + 1e-9);
    if fits(15.0) {
        with::<60, 90>(signal, settings, width)
    } else if fits(60.0) {
        with::<240, 360>(signal, settings, width)
    } else {
        with::<960, 1440>(signal, settings, width)
    }
}

fn with<const HALF: usize, const FIT: usize>(
    signal: Signal,
    settings: &DetectorSettings,
    width: f64,
) -> Result<Found, DetectError> {
    let upright = SlopeKernel::<f64, HALF>::new(width)?;
    let noise = signal.noise_variance.sqrt();
    let deviation = upright.noise_deviation(noise);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // positive, and beyond the signal is its end
    let reach = (settings.separation_s / signal.interval_s).round().max(1.0) as usize;
    let threshold = match settings.acceptance {
        Acceptance::Deviations(deviations) => Threshold::fixed(deviations * deviation),
        Acceptance::FalseAlarms { per_s, keep } => {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating
            let samples = (2.0 / (signal.passes_hz * signal.interval_s)) as u32;
            let hold = keep.map(|deviations| Hold { deviations, samples });
            Threshold::for_false_alarms(&upright, noise, per_s * signal.interval_s, reach, hold)?
        }
    };
    let steepest = signal.comb.steepest();
    let kernel = if steepest < 0.0 { upright.falling() } else { upright };
    let mut slope = vec![0.0; signal.volts.len()];
    kernel.responses(signal.volts, &mut slope);
    let largest = |sign: f64| slope.iter().map(|r| sign * r).fold(0.0, f64::max) / deviation;
    let found: Vec<Peak<f64>> = peaks(&slope, reach, threshold).collect();
    let fit = CubicFit::<f64, FIT>::new(FIT_WIDTHS * width)?;
    let mut offsets = Offsets::new(signal.offset);
    let crossings = found.iter().map(|peak| {
        #[allow(clippy::cast_possible_truncation)] // an index of the signal
        let index = peak.index as usize;
        let offset = offsets.at(index, signal.volts);
        let instant = |after: f64, slope: f64, variance: f64| {
            // y′ = h′·ω² where h is 0.
            let rate = (slope / signal.interval_s / steepest).abs().sqrt();
            Instant {
                time_s: signal.time_s[index] + after * signal.interval_s,
                angle_variance: angle_variance(variance, rate, signal.interval_s),
                volts_per_s: slope * steepest.signum() / signal.interval_s,
            }
        };
        let jitter = kernel.timing_variance(signal.noise_variance, peak.curvature);
        let zero = fit.crossing(signal.volts, index, offset, signal.noise_variance);
        Crossing {
            sample: instant(0.0, peak.height, jitter + OF_A_SAMPLE),
            parabola: instant(peak.fraction, peak.height, jitter),
            zero: zero.map(|zero| instant(zero.displacement, zero.slope, zero.timing_variance)),
            known_at: index + HALF + reach + 1,
        }
    });
    Ok(Found {
        crossings: crossings.collect(),
        rising: largest(1.0),
        falling: largest(-1.0),
        threshold: threshold.acquire() / deviation,
        by_noise: kernel.noise_maxima().detections(threshold.acquire() / deviation, reach)
            * signal.volts.len() as f64,
    })
}

/// What the signal is without motion, from what came before.
///
/// From one crossing to the next the capacitance returns to its peak, so that the current in between adds up to nothing:
/// the mean of the signal from the first crossing on is its offset.
struct Offsets {
    known: f64,
    first: Option<usize>,
    next: usize,
    sum: f64,
    count: usize,
}

impl Offsets {
    fn new(known: f64) -> Self {
        Self { known, first: None, next: 0, sum: 0.0, count: 0 }
    }

    /// At this crossing, each of which is later than the one before.
    fn at(&mut self, index: usize, volts: &[f64]) -> f64 {
        if self.first.is_none() {
            self.first = Some(index);
            self.next = index;
            return self.known;
        }
        for y in volts.get(self.next..index).unwrap_or_default() {
            if y.is_finite() {
                self.sum += y;
                self.count += 1;
            }
        }
        self.next = index;
        if self.count == 0 { self.known } else { self.sum / self.count as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use kalmems_core::detect::Detector;
    use kalmems_models::capacitance::CurveShape;

    /// The rig looks at a whole recording; a detector that runs with the signal finds the same, bit by bit, at the sample
    /// that the rig tells its filters.
    #[test]
    fn a_stream_finds_what_the_rig_finds_when_the_rig_says_it_is_known() {
        type Stream = Detector<f64, 60, 150, 400>;
        let comb = CombCurve { centre: 0.0037, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic };
        let (rate, interval_s, noise) = (3924.5, 2e-6, 0.0435);
        let mut white = WhiteNoise::new(3, 0);
        let time_s: Vec<f64> = (0..40_000).map(|k| f64::from(k) * interval_s).collect();
        let mut volts: Vec<f64> = time_s
            .iter()
            .map(|t| {
                let (sine, cosine) = (rate * t).sin_cos();
                let amplitude = 0.15 * (-26.0 * t).exp();
                comb.sensitivity(amplitude * sine) * amplitude * rate * cosine + 0.01 + noise * white.sample()
            })
            .collect();
        // And a gap.
        volts[20_000..20_050].fill(f64::NAN);
        for acceptance in [
            Acceptance::Deviations(2.0),
            Acceptance::Deviations(4.0),
            Acceptance::FalseAlarms { per_s: 10.0, keep: Some(2.0) },
        ] {
            let settings = DetectorSettings { width_s: 30e-6, separation_s: 300e-6, acceptance };
            let noise_variance = noise * noise;
            let signal = Signal {
                time_s: &time_s,
                volts: &volts,
                interval_s,
                noise_variance,
                offset: 0.0,
                comb,
                passes_hz: rate / std::f64::consts::PI,
            };
            let batch = find(signal, &settings).unwrap().crossings;
            let kernel = SlopeKernel::<f64, 60>::new(15.0).unwrap();
            let threshold = match acceptance {
                Acceptance::Deviations(sds) => Threshold::fixed(sds * kernel.noise_deviation(noise)),
                Acceptance::FalseAlarms { per_s, keep } => {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundreds
                    let samples = (2.0 / (signal.passes_hz * interval_s)) as u32;
                    let hold = keep.map(|deviations| Hold { deviations, samples });
                    Threshold::for_false_alarms(&kernel, noise, per_s * interval_s, 150, hold).unwrap()
                }
            };
            let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
            let mut stream = Stream::new(kernel, threshold, noise_variance);
            let mut offsets = Offsets::new(0.0);
            let mut found = 0;
            for (k, volts_now) in volts.iter().chain([f64::NAN; Stream::LOOK_AHEAD].iter()).enumerate() {
                let Some(detection) = stream.push(*volts_now) else { continue };
                let mine = &batch[found];
                found += 1;
                let index = usize::try_from(detection.index).unwrap();
                assert_eq!(mine.known_at, k);
                assert_eq!(mine.sample.time_s, time_s[index]);
                assert!(
                    (mine.parabola.time_s - time_s[index] - detection.fraction * interval_s).abs() < 1e-12
                );
                // Near the ends of the recording the memory of the stream is not full.
                if (400..volts.len()).contains(&k) {
                    let offset = offsets.at(index, &volts);
                    let zero = stream.crossing(&fit, offset);
                    // Beside the gap neither has one.
                    assert_eq!(zero.is_some(), mine.zero.is_some(), "{index}");
                    let Some((zero, mine)) = zero.zip(mine.zero) else { continue };
                    let apart_s = mine.time_s - time_s[index] - zero.displacement * interval_s;
                    assert!(apart_s.abs() < 1e-12, "{index}: {apart_s:e}");
                }
            }
            assert_eq!(found, batch.len());
            assert!(found > 60, "{found}");
        }
    }
}

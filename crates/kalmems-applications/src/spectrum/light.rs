//! A light and a detector, simulated along a known motion.

use super::scans::DetectorSignal;
use super::track::{PositionTrack, TrackPosition};
use crate::config::Quantity;
use crate::simulate::WhiteNoise;
use crate::spectrum::file::Light;
use kalmems_core::Scalar;
use std::f64::consts::{PI, TAU};

/// Steps of the low-pass stage from one sample to the next: at three samples per fringe a straight line from step to step
/// leaves 0.9999 of it.
const STEPS: u32 = 64;

/// The intensity at a path difference in m: Σ h·e^{−(π·w·x)²}·cos(2π·ν·x), of the spectrum Σ h·e^{−((ν′−ν)/w)²}.
pub fn intensity(light: &Light, path_m: f64) -> f64 {
    let each = light.sources.iter().map(|source| {
        let width = source.width.as_ref().map_or(0.0, Quantity::si);
        let envelope = Scalar::exp(-(PI * width * path_m).powi(2));
        source.height.si() * envelope * Scalar::cos(TAU * source.wavenumber.si() * path_m)
    });
    each.sum()
}

/// What the detector gives, with times as its own clock shows them.
///
/// It is later than the motion by the delay of the light's trajectory. Its clock shows t·(1 + skew) when that of the
/// trajectory shows t. Where the trajectory has no position there is no sample.
pub fn detect(light: &Light, track: &PositionTrack) -> DetectorSignal {
    let [begin, end] = track.span_s();
    let start = light.start.as_ref().map_or(begin, Quantity::si);
    let skew = light.clock_skew.as_ref().map_or(0.0, Quantity::si);
    let interval = light.rate.si().recip();
    let (bursts, each, period) = match &light.bursts {
        Some(bursts) => (bursts.count, bursts.duration.si(), bursts.period.si()),
        None => (1, (end - start) * (1.0 + skew), 0.0),
    };
    let zero = light.zero_path.si();
    let scale = light.trajectory.path_per_position();
    let delay = light.trajectory.delay_s();
    let seen = |time: f64| match track.at(time - delay) {
        TrackPosition::At(position) => intensity(light, scale * (position - zero)),
        TrackPosition::InGap | TrackPosition::Beyond => f64::NAN,
    };
    // What a first-order stage keeps of its state over one step.
    let kept = light
        .low_pass
        .as_ref()
        .map(|corner| Scalar::exp(-TAU * corner.si() * interval / (f64::from(STEPS) * (1.0 + skew))));
    let sd = light.noise.as_ref().map_or(0.0, Quantity::si);
    let mut noise = WhiteNoise::new(light.seed.unwrap_or(1).into(), 0);
    let mut detector = DetectorSignal { time_s: Vec::new(), value: Vec::new() };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let samples = (each / interval).round() as u64;
    for burst in 0..bursts {
        let first = start + f64::from(burst) * period;
        let mut stage = LowPass { state: f64::NAN, before: f64::NAN };
        for k in 0..samples {
            let shown = first + k as f64 * interval;
            let time = shown / (1.0 + skew);
            let clean = match kept {
                Some(kept) => stage.to(time, interval / (1.0 + skew), kept, seen),
                None => seen(time),
            };
            let value = clean + sd * noise.sample();
            if value.is_finite() {
                detector.time_s.push(shown);
                detector.value.push(value);
            }
        }
    }
    detector
}

/// A first-order stage, settled at its first sample.
struct LowPass {
    state: f64,
    before: f64,
}

impl LowPass {
    /// Its output at a time; its input is a straight line from each step to the next.
    fn to(&mut self, time_s: f64, interval_s: f64, kept: f64, input: impl Fn(f64) -> f64) -> f64 {
        if !self.state.is_finite() {
            self.before = input(time_s);
            self.state = self.before;
            return self.state;
        }
        // −ln(kept) is the step over the time constant.
        let part = (1.0 - kept) / -Scalar::ln(kept);
        for step in (0..STEPS).rev() {
            let now = input(time_s - interval_s * f64::from(step) / f64::from(STEPS));
            self.state = kept * self.state + (part - kept) * self.before + (1.0 - part) * now;
            self.before = now;
        }
        self.state
    }
}

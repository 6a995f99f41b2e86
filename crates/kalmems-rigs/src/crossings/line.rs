//! The signal around a crossing as a model of the device gives it.

use kalmems_core::Scalar;
use kalmems_models::capacitance::CombCurve;
use kalmems_models::dynamics::MirrorResonator;
use std::f64::consts::TAU;

/// The signal around a crossing of its level, without noise and but for a constant, of a motion that passes there at a rate and in a direction.
pub trait CrossingWaveform: Send + Sync {
    /// How often the level is crossed while the device moves, per s.
    fn passes_hz(&self) -> f64;

    /// The rate of the motion, in its unit per s, at which the signal rises by so much per sample where the level is crossed.
    fn rate(&self, slope: f64) -> f64;

    /// How much the signal rises per sample there at this rate.
    fn slope(&self, rate: f64) -> f64;

    /// The signal at each sample from so many before a crossing to as many after it, at a rate with its sign.
    fn samples(&self, rate: f64, reach: usize) -> Vec<f64>;
}

/// y(τ) = h(θ(τ))·θ̇(τ) in V, without offset and noise, of a mirror that passes θ_c at τ = 0.
///
/// The motion is the free one: a drive pulls with a torque that is zero at θ_c and, half a cycle around it, a few hundredths of the
/// spring's.
#[derive(Clone, Copy, Debug)]
pub struct CombWaveform {
    /// The free motion.
    pub resonator: MirrorResonator<f64>,
    /// The comb.
    pub comb: CombCurve<f64>,
    /// The usual interval of the samples in s.
    pub interval_s: f64,
}

impl CrossingWaveform for CombWaveform {
    /// The rate in rad/s at which the signal rises by `slope` V per sample where θ_c is passed: ẏ = h′·θ̇² where h is 0.
    fn rate(&self, slope: f64) -> f64 {
        (slope / self.interval_s / self.comb.steepest()).abs().sqrt()
    }

    fn passes_hz(&self) -> f64 {
        2.0 * (self.resonator.natural_rate / TAU)
    }

    fn slope(&self, rate: f64) -> f64 {
        rate * rate * self.comb.steepest().abs() * self.interval_s
    }

    fn samples(&self, rate: f64, reach: usize) -> Vec<f64> {
        (0..=2 * reach).map(|k| self.volts(rate, k as f64 - reach as f64)).collect()
    }
}

impl CombWaveform {
    /// The signal in V at this time in samples after θ_c is passed at `rate`, in rad/s and with its sign.
    ///
    /// θ = e^{−ζω_n·τ}·(θ_c·cos ω_d·τ + B·sin ω_d·τ) with B = (θ̇_c + ζω_n·θ_c)/ω_d and ω_d² = ω_n²·(1 − ζ²).
    fn volts(&self, rate: f64, after: f64) -> f64 {
        let MirrorResonator { natural_rate, damping_ratio } = self.resonator;
        let decay = damping_ratio * natural_rate;
        // A mirror that does not swing passes nothing twice; its signal is not this one.
        let damped = natural_rate * (1.0 - damping_ratio * damping_ratio).max(f64::EPSILON).sqrt();
        let (time_s, start) = (after * self.interval_s, self.comb.centre);
        let left = Scalar::exp(-decay * time_s);
        let (sine, cosine) = (Scalar::sin(damped * time_s), Scalar::cos(damped * time_s));
        let quadrature = (rate + decay * start) / damped;
        let angle = left * (start * cosine + quadrature * sine);
        let speed = left * (rate * cosine - (start * damped + decay * quadrature) * sine);
        self.comb.sensitivity(angle) * speed
    }
}

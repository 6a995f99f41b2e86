//! What the noise of the stage's sensors does to a scale factor, by the ways it takes.

use crate::fit::{ByDual, FitError, FitSettings, ResidualLaw, fit};
use crate::simulate::WhiteNoise;
use kalmems_core::Portable;
use kalmems_core::{Mat, Over};
use kalmems_models::capacitance::TiltingPlate;
use kalmems_models::dynamics::TorsionalResonator;
use std::f64::consts::TAU;

/// A stage that tilts over plates, each with its amplifier, and how it is calibrated and used (Chen, dissertation, 2018,
/// section 3.6.4 and Figure 3.16).
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseStudy {
    /// The plates and the gains η of their amplifiers in V·Ω.
    pub channels: Vec<(TiltingPlate<f64>, f64)>,
    /// The stage per moment of inertia: J = 1 kg·m².
    pub stage: TorsionalResonator<f64>,
    /// The frequency of the drive in Hz.
    pub frequency_hz: f64,
    /// The amplitudes in rad that gap and gain are identified at, with the angle known.
    pub training_rad: Vec<f64>,
    /// The amplitude in rad that the gyroscope is calibrated at.
    pub test_rad: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// Samples of a record.
    pub samples: usize,
    /// The variance of the drive as the filter takes it, as an angular acceleration, in rad²/s⁴ per sample.
    pub drive_variance: f64,
}

/// Relative standard deviations of a scale factor by the way that noise takes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct NoiseShare {
    /// The standard deviation of one sample of each channel in V.
    pub noise_v: f64,
    /// By identified gaps, the gains being known.
    pub by_gap: f64,
    /// By identified gains, the gaps being known.
    pub by_gain: f64,
    /// By both as they were identified together: their errors belong to each other and nearly cancel.
    pub by_both: f64,
    /// By a filter with the true model: the root of the mean variance of its rate, by the rate's amplitude.
    pub by_filter: f64,
}

impl NoiseStudy {
    /// The standard deviations over so many identifications from noise of this seed.
    ///
    /// Gap and gain of each channel are fitted to its waveforms over all training amplitudes by least squares. Then the
    /// amplitude that all channels together tell of a test record without noise is compared with the true one: with the
    /// identified gaps and true gains, true gaps and identified gains, and both. The filter's part is its covariance at
    /// the test amplitude once it has settled.
    pub fn run(&self, noise_v: f64, runs: usize, seed: u64) -> Result<NoiseShare, FitError> {
        let mut squares = [0.0; 3];
        for run in 0..runs {
            let mut found = Vec::new();
            for (channel, (plate, gain)) in self.channels.iter().enumerate() {
                let stream = (run * self.channels.len() + channel) as u64;
                let training = Training { study: self, plate, gain: *gain, noise_v, noise: [seed, stream] };
                found.push(fit(&ByDual(training), &FitSettings::from_start([1.0; 2]))?.parameters);
            }
            let ways: [&dyn Fn([f64; 2]) -> [f64; 2]; 3] =
                [&|[gap, _]| [gap, 1.0], &|[_, gain]| [1.0, gain], &|both| both];
            for (square, way) in squares.iter_mut().zip(ways) {
                let believed: Vec<[f64; 2]> = found.iter().map(|found| way(*found)).collect();
                let test = Test { study: self, believed: &believed };
                let [amplitude] = fit(&ByDual(test), &FitSettings::from_start([1.0]))?.parameters;
                // Gyroscope by reference: a reference that is too large makes a scale factor that is too small.
                *square += (amplitude.recip() - 1.0).powi(2);
            }
        }
        let [by_gap, by_gain, by_both] = squares.map(|square| (square / runs as f64).sqrt());
        Ok(NoiseShare { noise_v, by_gap, by_gain, by_both, by_filter: self.by_filter(noise_v) })
    }

    /// The waveform of a channel: η·C′(θ)·θ̇ of θ = a·sin(ωt).
    fn signal<S: Over<f64>>(&self, plate: &TiltingPlate<S>, gain: S, amplitude: S, sample: usize) -> S {
        let rate = TAU * self.frequency_hz;
        let (s, c) = (rate * sample as f64 / self.rate_hz).portable_sin_cos();
        plate.slope(amplitude * s) * gain * amplitude * (rate * c)
    }

    /// The covariance of a filter of [θ, θ̇] that knows the plates, over a period once it repeats itself.
    fn by_filter(&self, noise_v: f64) -> f64 {
        let process = self.stage.exact(self.rate_hz.recip(), 0.0);
        let (a, b) = (process.transition, process.input);
        let rate = TAU * self.frequency_hz;
        let per_period = self.rate_hz / self.frequency_hz;
        let mut p = Mat([[self.test_rad.powi(2), 0.0], [0.0, (rate * self.test_rad).powi(2)]]);
        let (mut sum, mut count) = (0.0, 0_usize);
        let settled = (PERIODS * per_period).round();
        let mut k = 0.0;
        while k < settled + per_period {
            let at = |i: usize, j: usize| -> f64 {
                let carried: f64 =
                    (0..2).map(|m| (0..2).map(|n| a.0[i][m] * p.0[m][n] * a.0[j][n]).sum::<f64>()).sum();
                carried + b.0[i][0] * self.drive_variance * b.0[j][0]
            };
            p = Mat([[at(0, 0), at(0, 1)], [at(1, 0), at(1, 1)]]);
            let (s, c) = (rate * k / self.rate_hz).portable_sin_cos();
            let (angle, speed) = (self.test_rad * s, self.test_rad * rate * c);
            for (plate, gain) in &self.channels {
                let slope = plate.slope(kalmems_core::Dual::<f64, 1>::variable(angle, 0));
                let h = [gain * slope.gradient()[0] * speed, gain * slope.value()];
                let ph = [p.0[0][0] * h[0] + p.0[0][1] * h[1], p.0[1][0] * h[0] + p.0[1][1] * h[1]];
                let s = h[0] * ph[0] + h[1] * ph[1] + noise_v * noise_v;
                p = Mat::from_fn(|i, j| p.0[i][j] - ph[i] * ph[j] / s);
            }
            if k >= settled {
                (sum, count) = (sum + p.0[1][1], count + 1);
            }
            k += 1.0;
        }
        (sum / count as f64).sqrt() / (rate * self.test_rad)
    }
}

/// Periods after which the filter's covariance repeats itself: a resonator of a quality of 100 forgets in 30.
const PERIODS: f64 = 200.0;

/// Gap and gain by their true values.
struct Training<'a> {
    study: &'a NoiseStudy,
    plate: &'a TiltingPlate<f64>,
    gain: f64,
    noise_v: f64,
    noise: [u64; 2],
}

impl ResidualLaw<2> for Training<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 2], each: &mut impl FnMut(S)) {
        let mut noise = WhiteNoise::new(self.noise[0], self.noise[1]);
        let believed = with_gap(self.plate, p[0]);
        for amplitude in &self.study.training_rad {
            for sample in 0..self.study.samples {
                let shown = self.study.signal(self.plate, self.gain, *amplitude, sample);
                let measured = shown + self.noise_v * noise.sample();
                let model = self.study.signal(&believed, p[1] * self.gain, S::lift(*amplitude), sample);
                each((model - S::lift(measured)) * self.noise_v.recip());
            }
        }
    }
}

/// The amplitude by the true one.
struct Test<'a> {
    study: &'a NoiseStudy,
    believed: &'a [[f64; 2]],
}

impl ResidualLaw<1> for Test<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 1], each: &mut impl FnMut(S)) {
        // One period, which is all there is without noise.
        let samples = (self.study.rate_hz / self.study.frequency_hz).round();
        for ((plate, gain), [gap, factor]) in self.study.channels.iter().zip(self.believed) {
            let believed = with_gap(plate, S::lift(*gap));
            let mut sample = 0;
            while (sample as f64) < samples {
                let shown = self.study.signal(plate, *gain, self.study.test_rad, sample);
                let amplitude = p[0] * self.study.test_rad;
                let model = self.study.signal(&believed, S::lift(factor * gain), amplitude, sample);
                each((model - S::lift(shown)) * 1e3);
                sample += 1;
            }
        }
    }
}

/// The plate with so many times its gap.
fn with_gap<S: Over<f64>>(plate: &TiltingPlate<f64>, factor: S) -> TiltingPlate<S> {
    TiltingPlate {
        w1: S::lift(plate.w1),
        w2: S::lift(plate.w2),
        w3: S::lift(plate.w3),
        w4: S::lift(plate.w4),
        gap: factor * plate.gap,
        permittivity: S::lift(plate.permittivity),
    }
}

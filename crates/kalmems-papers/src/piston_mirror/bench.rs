//! The published mirror, moved, read and estimated.

use super::published::{circuit, results};
use crate::estimate::{Past, RowsAround, SampleSelection, Trajectory};
use crate::program::ReproduceError;
use crate::progress::Progress;
use crate::simulate::WhiteNoise;
use kalmems_rigs::piston_mirror::{
    COEFFICIENTS, MotionKnowledge, PartData, PistonSegment, PistonSettings, Plates, estimate_segment,
};
use kalmems_rigs::published;
use std::f64::consts::TAU;
use std::path::Path;

/// Amplitude in m, frequency in Hz and rest position in m.
pub const MIRROR: [f64; 3] = [0.5e-3, 500.0, 1e-3];
/// The density that the printed circuit has, in F/√Hz.
pub const COMPUTED_NOISE: f64 = 0.393e-18;
/// The phase at 0 s; any.
const PHASE: f64 = 0.7;
/// How long a filter settles, in s.
pub const SKIP_S: f64 = 1.0;

/// C(d).
pub fn plates() -> Plates {
    let mut coefficients = [0.0; COEFFICIENTS];
    coefficients[1] = circuit::BASE;
    Plates { reference_distance: MIRROR[2], coefficients }
}

/// Amplitude's rate in m/s for a drift relative per minute.
pub fn rate(drift: f64) -> f64 {
    drift * MIRROR[0] / 60.0
}

/// What is moved and read.
#[derive(Clone, Copy)]
pub struct PistonRun {
    /// Relative, per minute.
    pub drift: f64,
    /// In Hz.
    pub sampling_hz: f64,
    /// In F/√Hz.
    pub noise: f64,
    /// In s.
    pub duration_s: f64,
    /// Of the noise.
    pub seed: u64,
}

/// That of P Figure 6, as short as a settled filter allows.
pub const RUN: PistonRun = PistonRun {
    drift: results::DRIFT,
    sampling_hz: results::SAMPLING_HZ,
    noise: circuit::NOISE,
    duration_s: 2.0,
    seed: 1,
};

/// What came of one filter.
pub struct PistonFilterResult {
    /// What it says.
    pub trajectory: Trajectory,
    /// True minus estimated position in m, from [`SKIP_S`] on, and the true position.
    pub errors: Vec<[f64; 2]>,
    /// The mean of true minus estimated amplitude in m.
    pub lag: f64,
    /// What it claims of the amplitude at the end, in m.
    pub claim: f64,
}

impl PistonFilterResult {
    /// The root mean square of the position's error in m.
    pub fn rms(&self) -> f64 {
        (self.errors.iter().map(|[e, _]| e * e).sum::<f64>() / self.errors.len() as f64).sqrt()
    }
}

/// The filters: three states as published, with this density of the amplitude in m²/s, and five, both smoothed or not.
pub fn settings(amplitude_density: f64) -> Result<PistonSettings, ReproduceError> {
    let text = include_str!("device.toml");
    let failed = super::failed("the published mirror");
    let experiment =
        published().parse(text, Path::new("piston_mirror/device.toml")).map_err(|e| failed(e.into()))?;
    let mut settings = PistonSettings::of(&experiment).map_err(|e| failed(e.into()))?;
    for filter in &mut settings.filters {
        if let MotionKnowledge::Steady { density: [amplitude, _], .. } = &mut filter.motion {
            *amplitude = amplitude_density;
        }
    }
    Ok(settings)
}

impl PistonRun {
    /// What the filters make of it; only those of these keys. `None` where the work was stopped.
    pub fn estimate(
        &self,
        settings: &PistonSettings,
        keys: &[&str],
        progress: &dyn Progress,
    ) -> Option<Vec<PistonFilterResult>> {
        let plates = plates();
        let interval_s = 1.0 / self.sampling_hz;
        let deviation = self.noise * (0.5 * self.sampling_hz).sqrt();
        let mut noise = WhiteNoise::new(self.seed, 0);
        let [amplitude, frequency, rest] = MIRROR;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some millions
        let samples = (self.duration_s * self.sampling_hz).round() as u64;
        let time_s: Vec<f64> = (0..samples).map(|k| k as f64 * interval_s).collect();
        let position = |t: f64| {
            let turns = frequency * t;
            rest + (amplitude + rate(self.drift) * t) * (TAU * (turns - turns.floor()) + PHASE).cos()
        };
        let signal: Vec<f64> =
            time_s.iter().map(|t| plates.capacitance(position(*t)) + deviation * noise.sample()).collect();
        let data = PistonSegment {
            time_s: &time_s,
            signal: &signal,
            interval_s,
            noise_variance: deviation * deviation,
            motion_hz: None,
        };
        let mut settings = settings.clone();
        settings.hardware.noise_density = self.noise;
        settings.filters.retain(|filter| keys.contains(&filter.basics.key.as_str()));
        for filter in &mut settings.filters {
            if let MotionKnowledge::Steady { start: Some((mean, ..)), .. } = &mut filter.motion {
                mean[2] = PHASE;
            }
        }
        let whole = PartData {
            data,
            samples: SampleSelection::whole(time_s.len(), interval_s),
            head: 0..time_s.len().min(RowsAround::LONGEST_HEAD),
            place: "the simulated recording",
        };
        let (trajectories, _) = estimate_segment(&settings, &whole, &mut Past::default(), progress).ok()?;
        let judged = trajectories.into_iter().filter_map(|trajectory| {
            let scored = trajectory.scored(SKIP_S);
            let estimated = &trajectory.state("position")?.mean;
            let errors = scored
                .clone()
                .map(|k| {
                    let truth = position(time_s[k]);
                    [truth - estimated[k], truth]
                })
                .collect();
            let state = trajectory.state("amplitude")?;
            let late = |k: usize| amplitude + rate(self.drift) * time_s[k] - state.mean[k];
            let lag = scored.clone().map(late).sum::<f64>() / scored.len() as f64;
            let claim = state.sd.last().copied()?;
            Some(PistonFilterResult { trajectory, errors, lag, claim })
        });
        Some(judged.collect())
    }
}

/// σ0 in m·√s: what one second leaves of the amplitude, all else known, for a one-sided density in F/√Hz.
pub fn one_second(noise: f64) -> f64 {
    const POINTS: u32 = 1000;
    let plates = plates();
    let square = |k: u32| {
        let cosine = (TAU * f64::from(k) / f64::from(POINTS)).cos();
        (plates.slope(MIRROR[2] + MIRROR[0] * cosine) * cosine).powi(2)
    };
    let mean = (0..POINTS).map(square).sum::<f64>() / f64::from(POINTS);
    noise * (0.5 / mean).sqrt()
}

/// The density in m²/s with which three states lag by so many metres behind [`results::DRIFT`]: from
/// lag = rate·σ0²/sd² and sd⁴ = q·σ0².
pub fn density_for_lag(lag: f64, noise: f64) -> f64 {
    (rate(results::DRIFT) * one_second(noise) / lag).powi(2)
}

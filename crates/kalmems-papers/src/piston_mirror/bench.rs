//! The published mirror, moved, read and estimated.

use super::published::{circuit, results};
use crate::config::Experiment;
use crate::estimate::Trajectory;
use crate::program::ReproduceError;
use crate::progress::Progress;
use crate::simulate::WhiteNoise;
use kalmems_engines::recording::RecordingFromRows;
use kalmems_rigs::piston_mirror::{COEFFICIENTS, Plates};
use kalmems_rigs::published;
use std::f64::consts::TAU;
use std::path::Path;
use toml::{Table, Value};

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

/// The filters: three states as published, with this density of the amplitude in m²/s, and five, smoothed or not.
pub fn filters(amplitude_density: f64, smooth: bool) -> Result<Table, ReproduceError> {
    let failed = super::failed("the published mirror");
    let mut document: Table =
        include_str!("device.toml").parse().map_err(|e: toml::de::Error| failed(e.into()))?;
    for filter in filters_of(&mut document) {
        let name = filter.get("name").and_then(Value::as_str).unwrap_or_default().to_owned();
        if name == "three"
            && let Some(noise) = filter.get_mut("process_noise").and_then(Value::as_table_mut)
        {
            noise.insert("amplitude".to_owned(), format!("{amplitude_density:e} m^2/s").into());
        }
        if name == "five" {
            filter.insert("smooth".to_owned(), smooth.into());
        }
    }
    Ok(document)
}

fn filters_of(document: &mut Table) -> impl Iterator<Item = &mut Table> {
    let filters =
        document.get_mut("estimate").and_then(|estimate| estimate.get_mut("filter")?.as_array_mut());
    filters.into_iter().flatten().filter_map(Value::as_table_mut)
}

impl PistonRun {
    /// What the filters make of it; only those of these names. `None` where the work was stopped, or nothing came of it.
    pub fn estimate(
        &self,
        document: &Table,
        names: &[&str],
        progress: &dyn Progress,
    ) -> Option<Vec<PistonFilterResult>> {
        let plates = plates();
        let interval_s = 1.0 / self.sampling_hz;
        let deviation = self.noise * (0.5 * self.sampling_hz).sqrt();
        let mut noise = WhiteNoise::new(self.seed, 0);
        let [amplitude, frequency, rest] = MIRROR;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some millions
        let samples = (self.duration_s * self.sampling_hz).round() as u64;
        let position = |t: f64| {
            let turns = frequency * t;
            rest + (amplitude + rate(self.drift) * t) * (TAU * (turns - turns.floor()) + PHASE).cos()
        };
        let experiment = self.experiment(document, names)?;
        let rig = published().rig(&experiment).ok()?;
        let layout = rig.layout(&experiment, 0).ok()?;
        let mut rows = RecordingFromRows::new("recording.csv", &["time_s", "cap_F"], &layout).ok()?;
        for k in 0..samples {
            let time_s = k as f64 * interval_s;
            rows.push(&[time_s, plates.capacitance(position(time_s)) + deviation * noise.sample()]);
        }
        let recording = rows.finish().ok()?;
        let estimates = rig.estimate(&experiment, 0, &recording, progress).ok()?;
        let judged = estimates.into_iter().next()?.trajectories.into_iter().filter_map(|trajectory| {
            let scored = trajectory.scored(SKIP_S);
            let estimated = &trajectory.state("position")?.mean;
            let errors = scored
                .clone()
                .map(|k| {
                    let truth = position(trajectory.time_s[k]);
                    [truth - estimated[k], truth]
                })
                .collect();
            let state = trajectory.state("amplitude")?;
            let late = |k: usize| amplitude + rate(self.drift) * trajectory.time_s[k] - state.mean[k];
            let lag = scored.clone().map(late).sum::<f64>() / scored.len() as f64;
            let claim = state.sd.last().copied()?;
            Some(PistonFilterResult { trajectory, errors, lag, claim })
        });
        Some(judged.collect())
    }

    /// The experiment with its noise and these filters.
    fn experiment(&self, document: &Table, names: &[&str]) -> Option<Experiment> {
        let mut document = document.clone();
        let mirror = document.get_mut("device")?.get_mut("piston_mirror")?;
        let density = format!("{:e} F/sqrt(Hz)", self.noise).into();
        mirror.get_mut("readout")?.as_table_mut()?.insert("noise_density".to_owned(), density);
        let filters = document.get_mut("estimate")?.get_mut("filter")?.as_array_mut()?;
        filters.retain(|filter| {
            filter.get("name").and_then(Value::as_str).is_some_and(|name| names.contains(&name))
        });
        let text = toml::to_string(&document).ok()?;
        published().parse(&text, Path::new("piston_mirror/device.toml")).ok()
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

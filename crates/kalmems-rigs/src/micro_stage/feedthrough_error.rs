//! What the noise of the record with the bias off makes of an estimated motion.

use super::course::StageChannel;
use super::segment::StageSamples;
use crate::estimate::{Contribution, StateSeries, Trajectory};
use crate::recording::OF_RECORD;
use kalmems_core::Portable;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

/// An error of the rate with the drive's frequency, which all samples of a record have in common.
///
/// A filter takes the sine that is wrong in a signal y = c·θ̇ + … for motion. Its channels have the weights of their information, w ∝ c²/R with the
/// variance R of a sample, so that independent errors with the standard deviations s of each component make one of the rate with
/// ρ = √Σ(w·s/c)², and one of the angle with ρ/ω. That is to first order in the angle, where c = η·C′(0).
pub struct FeedthroughError {
    /// ρ in rad/s for each volt of the drive, of each of its two components.
    rate_per_volt: f64,
}

impl FeedthroughError {
    /// `None` where nothing was taken off that has noise.
    pub fn of(channels: &[StageChannel], samples: &StageSamples) -> Option<Self> {
        let known = channels.iter().map(|channel| {
            let per_rate = channel.current.gain * channel.current.plate.slope(0.0);
            (per_rate, per_rate * per_rate / channel.noise_variance, channel.feedthrough_sd)
        });
        let all: f64 = known.clone().map(|(_, information, _)| information).sum();
        let square: f64 =
            known.map(|(per_rate, information, sd)| (information / all * sd / per_rate).powi(2)).sum();
        (square > 0.0 && square.is_finite() && samples.drive_hz > 0.0)
            .then(|| Self { rate_per_volt: square.sqrt() })
    }

    /// Puts it into the claims of an answer, whose rate was divided by this scale.
    pub fn widen(&self, trajectory: &mut Trajectory, samples: &StageSamples, scale: f64) {
        if !trajectory.claims() {
            return;
        }
        let mut moved = [[Vec::new(), Vec::new()], [Vec::new(), Vec::new()]];
        for time_s in &trajectory.time_s {
            let begun =
                |rows: &Range<usize>| samples.time_s.get(rows.start).is_some_and(|from_s| from_s <= time_s);
            let sine = samples.sines.iter().rev().find(|(rows, _)| begun(rows)).or(samples.sines.first());
            let Some((_, sine)) = sine else { return };
            let (turn, error) = (TAU * sine.frequency_hz, self.rate_per_volt * sine.amplitude);
            let (sine, cosine) = (turn * time_s + sine.phase_rad).portable_sin_cos();
            for ([angle, rate], [of_angle, of_rate]) in
                moved.iter_mut().zip([[sine, cosine], [-cosine, sine]])
            {
                angle.push(error / turn * of_angle);
                rate.push(error / scale * of_rate);
            }
        }
        let name: Arc<str> = format!("{OF_RECORD}feedthrough").into();
        let nothing = vec![0.0; trajectory.time_s.len()];
        let contribution = |[angle, rate]: [Vec<f64>; 2]| {
            let mut parts = [("angle", angle), ("rate", rate)];
            let of_state = |state: &StateSeries| {
                let known = parts.iter_mut().find(|(name, _)| *name == state.name);
                known.map_or_else(|| nothing.clone(), |(_, part)| std::mem::take(part))
            };
            let states = trajectory.states.iter().map(of_state).collect();
            Contribution { name: Arc::clone(&name), states, told: [0.0, 1.0] }
        };
        let contributions = moved.map(contribution).to_vec();
        trajectory.widen(contributions);
    }
}

//! What the noise of the record with the bias off makes of an estimated motion.

use super::course::StageChannel;
use super::segment::StageSamples;
use crate::estimate::{Contribution, Trajectory};
use crate::recording::OF_RECORD;
use kalmems_core::Portable;
use std::f64::consts::TAU;
use std::sync::Arc;

/// An error of the rate with the drive's frequency, which all samples of a record have in common.
///
/// A filter takes the sine that is wrong in a signal y = c·θ̇ + … for motion. Its channels have the weights of their information, w ∝ c²/R with the
/// variance R of a sample, so that independent errors with the standard deviations s of each component make one of the rate with
/// ρ = √Σ(w·s/c)², and one of the angle with ρ/ω. That is to first order in the angle, where c = η·C′(0).
pub struct FeedthroughError {
    /// ρ in rad/s, of each of its two components.
    rate: f64,
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
        (square > 0.0 && square.is_finite() && samples.drive_hz > 0.0).then(|| Self { rate: square.sqrt() })
    }

    /// Puts it into the claims of an answer, whose rate was divided by this scale.
    pub fn widen(&self, trajectory: &mut Trajectory, samples: &StageSamples, scale: f64) {
        let Some(first_s) = trajectory.time_s.first().filter(|_| trajectory.claims()) else { return };
        let first = samples.time_s.partition_point(|time_s| time_s < first_s);
        let mut moved = [[Vec::new(), Vec::new()], [Vec::new(), Vec::new()]];
        let rows = samples.sines.iter().flat_map(|(rows, sine)| rows.clone().map(move |row| (row, sine)));
        let of_answer = rows.skip_while(|(row, _)| *row < first).take(trajectory.time_s.len());
        for (row, sine) in of_answer {
            let turn = TAU * sine.frequency_hz;
            let (sine, cosine) = (turn * samples.time_s[row] + sine.phase_rad).portable_sin_cos();
            for ([angle, rate], [of_angle, of_rate]) in
                moved.iter_mut().zip([[sine, cosine], [-cosine, sine]])
            {
                angle.push(self.rate / turn * of_angle);
                rate.push(self.rate / scale * of_rate);
            }
        }
        let name: Arc<str> = format!("{OF_RECORD}feedthrough").into();
        let nothing = vec![0.0; trajectory.time_s.len()];
        let contribution = |[angle, rate]: [Vec<f64>; 2]| {
            let mut parts = [("angle", angle), ("rate", rate)];
            let of_state = |state: &crate::estimate::StateSeries| {
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

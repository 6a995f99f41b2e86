//! How far a sample's place is uncertain across the field of view.

use super::search::FoundPhase;

/// Parts of the field of view, from one edge to the other.
const PARTS: usize = 40;

/// The uncertainty of places of samples in a part of the field of view, one standard deviation each, as angles in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceUncertainty {
    /// The middle of the part.
    pub angle_rad: f64,
    /// By the phase that was found: at an angle x of a sine of amplitude A a phase error δ moves a sample by √(A² − x²)·δ. 0 without a search.
    pub by_phase_rad: f64,
    /// By the trajectory, root mean square of what its filter claims there; `None` where that is not known. It includes what the uncertain
    /// numbers of the device add, which is common to all samples and is not averaged away within a pixel.
    pub by_trajectory_rad: Option<f64>,
}

impl PlaceUncertainty {
    /// Both together.
    pub fn together_rad(&self) -> f64 {
        let by_trajectory = self.by_trajectory_rad.unwrap_or(0.0);
        (self.by_phase_rad * self.by_phase_rad + by_trajectory * by_trajectory).sqrt()
    }
}

/// Across a field of view of ±`half_field_rad`, of a trajectory with this amplitude whose samples have angles and claimed standard deviations in rad.
pub(super) fn across_the_field(
    (half_field_rad, amplitude_rad): (f64, f64),
    found: Option<FoundPhase>,
    samples: Option<(&[f64], &[f64])>,
) -> Vec<PlaceUncertainty> {
    let mut sums = [(0.0, 0.0); PARTS];
    let (angles, claimed) = samples.unwrap_or_default();
    let width = 2.0 * half_field_rad / PARTS as f64;
    for (angle, sd) in angles.iter().zip(claimed).filter(|(angle, sd)| angle.is_finite() && sd.is_finite()) {
        let place = (angle + half_field_rad) / width;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // one of a few parts
        if place >= 0.0
            && let Some((count, sum)) = sums.get_mut(place as usize)
        {
            (*count, *sum) = (*count + 1.0, *sum + sd * sd);
        }
    }
    let phase_sd_rad = found.map_or(0.0, |found| found.sd_rad);
    let part = |(place, (count, sum)): (usize, &(f64, f64))| {
        let angle_rad = (place as f64 + 0.5) * width - half_field_rad;
        let speed = (amplitude_rad.powi(2) - angle_rad * angle_rad).max(0.0).sqrt();
        let by_trajectory_rad = (*count > 0.0).then(|| (sum / count).sqrt());
        PlaceUncertainty { angle_rad, by_phase_rad: speed * phase_sd_rad, by_trajectory_rad }
    };
    sums.iter().enumerate().map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_and_trajectory_add_up_where_the_samples_are() {
        let angles: Vec<f64> = (0..20_000).map(|k| 0.1 * f64::sin(0.0123 * f64::from(k))).collect();
        let sds: Vec<f64> = angles.iter().map(|angle| 1e-3 * (1.0 + 10.0 * angle.abs())).collect();
        let found = FoundPhase { phase_rad: 0.0, sd_rad: 0.02, best: 0.0 };
        let all = across_the_field((0.08, 0.1), Some(found), Some((&angles, &sds)));
        assert_eq!(all.len(), PARTS);
        for part in &all {
            let own = 1e-3 * (1.0 + 10.0 * part.angle_rad.abs());
            assert!((part.by_trajectory_rad.unwrap() - own).abs() < 2e-5, "{part:?}");
            let phase = 0.02 * (0.01 - part.angle_rad.powi(2)).sqrt();
            assert!((part.together_rad() - phase.hypot(own)).abs() < 2e-5, "{part:?}");
        }
        let alone = across_the_field((0.08, 0.1), None, None);
        assert!(alone.iter().all(|part| part.by_trajectory_rad.is_none() && part.together_rad() == 0.0));
    }
}

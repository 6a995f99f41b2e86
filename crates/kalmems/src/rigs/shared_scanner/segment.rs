//! The estimates of one segment.

use super::course::ScannerCourse;
use super::data::SegmentData;
use super::settings::Settings;
use crate::estimate::{ModelAlone, Progress, Trajectory, follow, judge_lock};
use crate::signal::extremes_of_rate;
use crate::units::{Kind, kind};
use kalmems_core::{Ekf, Filter, Ukf};

/// The states of the scanner: name, unit in column names, kind.
pub const STATES: [(&str, &str, &Kind); 2] =
    [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];

/// Runs the wanted ones of model alone, extended and unscented Kalman filter. `None` where the work was stopped.
pub fn estimate(settings: &Settings, data: &SegmentData, progress: &dyn Progress) -> Option<Vec<Trajectory>> {
    let mut trajectories = Vec::new();
    if let Some(start) = settings.model {
        let mut model = run(("model", "Model alone"), ModelAlone::new(start), settings, data, progress)?;
        for state in &mut model.states {
            // The model alone claims no uncertainty; zeros would look like a claim.
            state.sd.clear();
        }
        trajectories.push(model);
    }
    if let Some(start) = &settings.ekf {
        let filter = Ekf::new(start.mean, start.covariance);
        trajectories.push(run(("ekf", "EKF"), filter, settings, data, progress)?);
    }
    if let Some((start, points)) = &settings.ukf {
        let filter = Ukf::new(start.mean, start.covariance, *points);
        trajectories.push(run(("ukf", "UKF"), filter, settings, data, progress)?);
    }
    Some(trajectories)
}

fn run<F: Filter<f64, 2>>(
    name: (&'static str, &'static str),
    filter: F,
    settings: &Settings,
    data: &SegmentData,
    progress: &dyn Progress,
) -> Option<Trajectory> {
    let mut course = ScannerCourse::new(settings, data);
    let mut trajectory = follow(name, filter, &mut course, &STATES, progress)?;
    orient(&mut trajectory, settings, data);
    let start_s = data.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
    trajectory.lock = judge_lock(
        data.time_s,
        (&trajectory.states[0].mean, data.signal),
        (&trajectory.innovation, &trajectory.nis),
        data.motion(settings),
        start_s,
    );
    Some(trajectory)
}

/// Gives the motion the sign that the experiment states.
///
/// θ → −θ is an exact symmetry of plant and sensor, and the filters keep it: had the filter started mirrored, its
/// answer would be the mirrored one to the last bit. So the answer is mirrored, and says so.
fn orient(trajectory: &mut Trajectory, settings: &Settings, data: &SegmentData) {
    let Some(positive) = settings.first_peak_positive else { return };
    let peak = data.first_drive_peak(settings);
    let from = data.time_s.partition_point(|t| *t < peak);
    let extremes = extremes_of_rate(&data.time_s[from..], &trajectory.states[1].mean[from..]);
    if extremes.first().is_some_and(|extreme| extreme.maximum != positive) {
        trajectory.mirrored = true;
        for state in &mut trajectory.states {
            for mean in &mut state.mean {
                *mean = -*mean;
            }
        }
    }
}

//! Errors of an angle that oscillates: in the angle, in its phase against the drive, in its amplitude.

use super::value::turned_to;
use super::{Claim, PartErrors, ReferenceLag, ReferenceMotion};
use crate::estimate::{SegmentEstimate, Trajectory, is_the_only_one};
use crate::progress::Interruption;
use crate::signal::{
    Extreme, GAP, Sine, extremes_of_angle, extremes_of_rate, fit_cycles_until, usual_interval,
};
use kalmems_core::{Portable, Scalar};
use serde::Serialize;
use std::f64::consts::TAU;

/// What is compared: from when on, and how fast the motion goes.
#[derive(Clone, Copy, Debug)]
pub struct ComparisonExtent<'a> {
    /// The end of the settling time in s; what comes before is not scored.
    pub from_s: f64,
    /// The frequency of the motion in Hz.
    pub motion_hz: f64,
    /// The drive, where it is a steady sine.
    pub drive: Option<&'a Sine>,
}

/// All errors of one trajectory.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MotionErrors {
    /// The angle, by its name among the states.
    #[serde(skip_serializing_if = "is_the_only_one")]
    pub of: &'static str,
    /// The angle, sample by sample.
    pub angle: AngleErrors,
    /// The root mean square error of the phase shift, in degrees of the motion's cycle: the timing of each
    /// angle peak against the drive peak before it, between estimate and reference.
    pub peak_phase_rmse_deg: Option<f64>,
    /// The mean phase shift from a drive peak to the angle peak after it, in the reference.
    pub phase_shift_reference_deg: Option<f64>,
    /// The same in the estimate.
    pub phase_shift_estimate_deg: Option<f64>,
    /// Angle peaks of the reference that were compared.
    pub peaks: usize,
    /// Angle peaks of the reference without a peak of the same sign within half a cycle in the estimate.
    pub peaks_without_partner: usize,
    /// The root mean square error of the phase of a sine fitted to each cycle, in degrees of the cycle.
    pub cycle_phase_rmse_deg: Option<f64>,
    /// The root mean square error of the amplitude of that sine, in degrees.
    pub amplitude_rmse_deg: Option<f64>,
    /// The mean amplitude of the reference, in degrees.
    pub amplitude_reference_deg: Option<f64>,
    /// Whether the mirrored estimate would fit much better: the sign that the experiment states is then wrong.
    pub sign_disagrees: bool,
    /// The angle's errors in parts of the recording, where those are wanted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartErrors>,
    /// By how much more the reference is late than the experiment states, where that explains most of the error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_lag: Option<ReferenceLag>,
    /// The errors of the other angles, where the device has several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_angles: Vec<MotionErrors>,
    /// The error of the angle over time, for plots.
    #[serde(skip)]
    pub error: ErrorSeries,
    /// The phase error of each peak, for plots.
    #[serde(skip)]
    pub phase: Vec<PhasePoint>,
}

impl MotionErrors {
    /// Those of each angle, this one's first.
    pub fn each(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.other_angles)
    }
}

/// The error of the angle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AngleErrors {
    /// Its root mean square in degrees.
    pub rmse_deg: f64,
    /// The same in percent of the reference's peak-to-peak angle.
    pub rmse_percent_of_peak_to_peak: f64,
    /// The largest, in degrees.
    pub largest_deg: f64,
    /// Samples compared.
    pub samples: usize,
    /// The share of them within three standard deviations; `None` for a model that claims none.
    pub within_three_sigma: Option<f64>,
    /// The comparison of the errors with their claimed standard deviations; `None` for a model that claims none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub claim: Option<Claim>,
}

/// Estimate minus reference at the reference's times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorSeries {
    /// In s.
    pub time_s: Vec<f64>,
    /// In SI.
    pub error: Vec<f64>,
    /// The estimate's standard deviation in SI; empty for a model that claims none.
    pub sd: Vec<f64>,
}

/// The error of one peak's timing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhasePoint {
    /// The time of the reference's peak in s.
    pub time_s: f64,
    /// Estimate minus reference, in degrees of the motion's cycle.
    pub error_deg: f64,
}

/// Compares each trajectory of a segment with the references, one per angle, and the first angle in so many equal parts of the duration beside
/// the whole. `None` of one where nothing can be compared, as of a device without angles, and where the work is stopped.
pub fn evaluate_angles(
    estimate: &SegmentEstimate,
    references: &[ReferenceMotion],
    parts: u32,
    stop: &Interruption,
) -> Vec<Option<MotionErrors>> {
    let from_s = estimate.from_s();
    let time = &estimate.segment.time;
    let end_s = time.at(time.len().saturating_sub(1)) + time.interval_s().unwrap_or(0.0);
    let one = |trajectory: &Trajectory| {
        let known = references.iter().map(|one| (one.states[0], &one.time_s[..], &one.angle[..]));
        let turned = turned_to(trajectory, known, from_s);
        let trajectory = turned.as_ref().unwrap_or(trajectory);
        let mut found = references.iter().filter_map(|reference| {
            let other = estimate.other_axes.iter().find(|axis| axis.angle == reference.states[0]);
            let (motion, drive) = other.map_or((estimate.motion, estimate.drive.as_ref()), |axis| {
                (axis.motion, axis.drive.as_ref())
            });
            let extent = ComparisonExtent { from_s, motion_hz: motion.frequency_hz, drive };
            let mut errors = evaluate_motion(trajectory, reference, extent, stop)?;
            // Where the signal is that of the mirrored motion too, half a cycle and the other sign look the same.
            if !estimate.sign_is_hidden {
                errors.reference_lag =
                    ReferenceLag::of(trajectory, reference, (from_s, motion.frequency_hz), stop);
            }
            Some(errors)
        });
        let mut first = found.next()?;
        first.other_angles = found.collect();
        if parts > 1 {
            first.parts = first.error.parts(time.start_s(), end_s, parts);
        }
        Some(first)
    };
    estimate.trajectories.iter().map(one).collect()
}

/// Compares a trajectory with the reference. `None` where not one sample can be compared, and where the work is stopped.
pub fn evaluate_motion(
    trajectory: &Trajectory,
    reference: &ReferenceMotion,
    extent: ComparisonExtent,
    stop: &Interruption,
) -> Option<MotionErrors> {
    if trajectory.time_s.is_empty() {
        return None;
    }
    let (estimated, sd) = reference.estimate_at(trajectory, stop);
    let from = reference.time_s.partition_point(|t| *t < extent.from_s);
    let time_s = &reference.time_s[from..];
    let (truth, estimated) = (&reference.angle[from..], &estimated[from..]);
    let sd = sd.get(from..).unwrap_or_default();
    let error: Vec<f64> = estimated.iter().zip(truth).map(|(e, r)| e - r).collect();

    let series = ErrorSeries { time_s: time_s.to_vec(), error, sd: sd.to_vec() };
    let place = trajectory.states.iter().position(|state| state.name == reference.states[0]);
    let claim =
        place.and_then(|place| Claim::of(&series, truth, (trajectory, place), reference.accuracy, stop));
    let angle = angle_errors(&series.error, truth, claim)?;

    let mirrored = rms(estimated.iter().zip(truth).map(|(e, r)| -e - r))?;
    if let Some(place) = place.filter(|place| trajectory.hides_sign(*place))
        && mirrored < angle.rmse_deg.to_radians()
    {
        // Nothing has stated the sign: the reference does.
        return evaluate_motion(&trajectory.mirrored_in(place), reference, extent, stop);
    }
    let sign_disagrees = mirrored < 0.5 * angle.rmse_deg.to_radians();

    if stop.is_requested() {
        return None;
    }
    let (ours, theirs) = extremes(trajectory, reference, extent);
    let phase = phase_errors(&ours, &theirs, extent.motion_hz);
    let shift = |extremes: &[Extreme]| mean_phase_shift(extremes, extent);

    let cycles = paired_cycles(time_s, (estimated, truth), extent.motion_hz, stop);
    Some(MotionErrors {
        of: reference.states[0],
        angle,
        peak_phase_rmse_deg: rms(phase.iter().map(|p| p.error_deg)),
        phase_shift_reference_deg: shift(&theirs),
        phase_shift_estimate_deg: shift(&ours),
        peaks: phase.len(),
        peaks_without_partner: theirs.len() - phase.len(),
        cycle_phase_rmse_deg: rms(cycles.iter().map(|c| c.phase)).map(f64::to_degrees),
        amplitude_rmse_deg: rms(cycles.iter().map(|c| c.amplitude)).map(f64::to_degrees),
        amplitude_reference_deg: mean(cycles.iter().map(|c| c.reference)).map(f64::to_degrees),
        sign_disagrees,
        parts: Vec::new(),
        reference_lag: None,
        other_angles: Vec::new(),
        error: series,
        phase,
    })
}

fn angle_errors(error: &[f64], truth: &[f64], claim: Option<Claim>) -> Option<AngleErrors> {
    let finite = || error.iter().copied().filter(|e| e.is_finite());
    let rmse = rms(finite())?;
    let range =
        |f: fn(f64, f64) -> f64, start| truth.iter().copied().filter(|a| a.is_finite()).fold(start, f);
    let peak_to_peak = range(f64::max, f64::NEG_INFINITY) - range(f64::min, f64::INFINITY);
    Some(AngleErrors {
        rmse_deg: rmse.to_degrees(),
        rmse_percent_of_peak_to_peak: 100.0 * rmse / peak_to_peak,
        largest_deg: finite().map(f64::abs).fold(0.0, f64::max).to_degrees(),
        samples: finite().count(),
        within_three_sigma: claim.map(|claim| claim.within),
        claim,
    })
}

/// The turning points of both, found in the same way: by the rates where the reference has one, else by angles.
fn extremes(
    trajectory: &Trajectory,
    reference: &ReferenceMotion,
    extent: ComparisonExtent,
) -> (Vec<Extreme>, Vec<Extreme>) {
    let [angle, rate] = reference.states.map(|name| trajectory.state(name));
    let both = angle.zip(rate).map(|(angle, rate)| {
        reference.rate.as_ref().map_or_else(
            || {
                (
                    extremes_of_angle(&trajectory.time_s, &angle.mean, extent.motion_hz),
                    extremes_of_angle(&reference.time_s, &reference.angle, extent.motion_hz),
                )
            },
            |known| {
                (extremes_of_rate(&trajectory.time_s, &rate.mean), extremes_of_rate(&reference.time_s, known))
            },
        )
    });
    let (mut ours, mut theirs) = both.unwrap_or_default();
    // Half a cycle more of the estimate, so that a peak just before the end of the settling time has a partner.
    ours.retain(|e| e.time_s >= extent.from_s - 0.5 / extent.motion_hz);
    // A peak in a gap of the estimate, or after its end, is not compared.
    let longest = GAP * usual_interval(&trajectory.time_s);
    let covered = |time: f64| {
        let next = trajectory.time_s.partition_point(|t| *t < time);
        let ends = (next > 0).then(|| (trajectory.time_s[next - 1], trajectory.time_s.get(next)));
        ends.is_some_and(|(before, after)| after.is_some_and(|after| after - before <= longest))
    };
    theirs.retain(|e| e.time_s >= extent.from_s && covered(e.time_s));
    (ours, theirs)
}

/// Pairs each peak of the reference with the nearest one of the same sign, and takes the difference in phase.
fn phase_errors(ours: &[Extreme], theirs: &[Extreme], motion_hz: f64) -> Vec<PhasePoint> {
    theirs
        .iter()
        .filter_map(|reference| {
            let near = ours.partition_point(|e| e.time_s < reference.time_s);
            // Peaks of one sign are a cycle apart: the nearest is within two places on each side.
            let candidates = ours.get(near.saturating_sub(2)..(near + 2).min(ours.len()))?;
            let difference = candidates
                .iter()
                .filter(|e| e.maximum == reference.maximum)
                .map(|e| e.time_s - reference.time_s)
                .min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
            let error_deg = difference * motion_hz * 360.0;
            (error_deg.abs() <= 180.0).then_some(PhasePoint { time_s: reference.time_s, error_deg })
        })
        .collect()
}

/// The mean of the phase from the drive peak before each angle peak, in degrees of the motion's cycle, averaged
/// on the circle of the drive's cycle.
pub fn mean_phase_shift(extremes: &[Extreme], extent: ComparisonExtent) -> Option<f64> {
    let drive = extent.drive?;
    let (mut c, mut s) = (0.0, 0.0);
    for extreme in extremes.iter().filter(|e| e.time_s >= extent.from_s) {
        let phase = TAU * drive.frequency_hz * extreme.time_s + drive.phase_rad;
        c += Scalar::cos(phase);
        s += Scalar::sin(phase);
    }
    let turns = s.portable_atan2(c) / TAU;
    (!extremes.is_empty()).then(|| (turns - turns.floor()) / drive.frequency_hz * extent.motion_hz * 360.0)
}

/// Differences between the sines of one cycle.
struct CycleError {
    phase: f64,
    amplitude: f64,
    reference: f64,
}

fn paired_cycles(
    time_s: &[f64],
    (estimated, truth): (&[f64], &[f64]),
    motion_hz: f64,
    stop: &Interruption,
) -> Vec<CycleError> {
    let Some(start) = time_s.first() else { return Vec::new() };
    let ours = fit_cycles_until(stop, time_s, estimated, (motion_hz, *start));
    let theirs = fit_cycles_until(stop, time_s, truth, (motion_hz, *start));
    let mut ours = ours.iter().peekable();
    theirs
        .iter()
        .filter_map(|reference| {
            while ours.next_if(|c| c.start_s < reference.start_s).is_some() {}
            let cycle = ours.next_if(|c| c.start_s == reference.start_s)?;
            let phase = cycle.phase_rad - reference.phase_rad;
            Some(CycleError {
                phase: phase - TAU * (phase / TAU).round(),
                amplitude: cycle.amplitude - reference.amplitude,
                reference: reference.amplitude,
            })
        })
        .collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0_usize, 0.0), |(n, s), v| (n + 1, s + v));
    (count > 0).then(|| sum / count as f64)
}

fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    mean(values.filter(|v| v.is_finite()).map(|v| v * v)).map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use super::super::Accuracy;
    use super::*;
    use crate::estimate::TrajectoryKind;
    use crate::units::kind;
    use approx::assert_abs_diff_eq;

    const MOTION_HZ: f64 = 15_675.0;
    const ANGLE: [&str; 2] = ["angle", "rate"];

    fn motion(n: u32, amplitude: f64, lag_deg: f64, delay_s: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..n).map(|i| f64::from(i) * 1e-6).collect();
        let phase = |t: f64| TAU * MOTION_HZ * (t + delay_s) - 1.1 - lag_deg.to_radians();
        let angle = time.iter().map(|t| amplitude * phase(*t).cos()).collect();
        let rate = time.iter().map(|t| -TAU * MOTION_HZ * amplitude * phase(*t).sin()).collect();
        (time, angle, rate)
    }

    fn trajectory(amplitude: f64, lag_deg: f64) -> Trajectory {
        let (time_s, angle, rate) = motion(6000, amplitude, lag_deg, 0.0);
        let (n, signal) = (time_s.len(), vec![0.0; time_s.len()]);
        let states = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];
        let samples = (&*time_s, &*signal, &(0..n));
        let mut blank = Trajectory::blank(("ekf", "EKF"), TrajectoryKind::Filtered, samples, &states);
        for (state, mean) in blank.states.iter_mut().zip([angle, rate]) {
            (state.mean, state.sd) = (mean, vec![1e-3; n]);
        }
        blank
    }

    fn drive() -> Sine {
        Sine {
            offset: 90.0,
            amplitude: 90.0,
            frequency_hz: 2.0 * MOTION_HZ,
            phase_rad: 0.4,
            residual_rms: 0.0,
        }
    }

    #[test]
    fn a_known_lag_and_amplitude_are_found() {
        let drive = drive();
        let extent = ComparisonExtent { from_s: 1e-3, motion_hz: MOTION_HZ, drive: Some(&drive) };
        for with_rate in [true, false] {
            let (time_s, angle, rate) = motion(6000, 0.15, 0.0, 0.0);
            let reference = ReferenceMotion {
                states: ANGLE,
                time_s,
                angle,
                rate: with_rate.then_some(rate),
                accuracy: Accuracy::default(),
            };
            let errors =
                evaluate_motion(&trajectory(0.151, 2.0), &reference, extent, &Interruption::never()).unwrap();
            assert_abs_diff_eq!(errors.peak_phase_rmse_deg.unwrap(), 2.0, epsilon = 2e-3);
            assert_abs_diff_eq!(errors.cycle_phase_rmse_deg.unwrap(), 2.0, epsilon = 1e-6);
            assert_abs_diff_eq!(errors.amplitude_rmse_deg.unwrap(), 1e-3_f64.to_degrees(), epsilon = 1e-9);
            // √½ of the chord between two phasors of 0.151 and 0.15 rad, 2° apart.
            let chord = (1e-3_f64.powi(2) + 4.0 * 0.151 * 0.15 * 1_f64.to_radians().sin().powi(2)).sqrt();
            assert_abs_diff_eq!(errors.angle.rmse_deg, (chord / 2_f64.sqrt()).to_degrees(), epsilon = 2e-3);
            assert_abs_diff_eq!(
                errors.angle.rmse_percent_of_peak_to_peak,
                errors.angle.rmse_deg / 0.3_f64.to_degrees() * 100.0,
                epsilon = 1e-3
            );
            assert!(errors.peaks > 150 && errors.peaks_without_partner == 0 && !errors.sign_disagrees);
            // The angle's peak is at 1.1 rad of the motion; the drive's at −0.4 rad of the drive, half of that in motion.
            let expected = (1.1_f64 + 0.2).to_degrees();
            assert_abs_diff_eq!(errors.phase_shift_reference_deg.unwrap(), expected, epsilon = 1e-3);
            assert_abs_diff_eq!(errors.phase_shift_estimate_deg.unwrap(), expected + 2.0, epsilon = 1e-2);
        }
    }

    #[test]
    fn a_reference_between_the_samples_and_late_is_met_by_a_cubic() {
        let extent = ComparisonExtent { from_s: 1e-3, motion_hz: MOTION_HZ, drive: None };
        let (time_s, angle, rate) = motion(5000, 0.15, 0.0, 0.37e-6);
        let time_s = time_s.iter().map(|t| t + 0.37e-6).collect();
        let errors = evaluate_motion(
            &trajectory(0.15, 0.0),
            &ReferenceMotion {
                states: ANGLE,
                time_s,
                angle,
                rate: Some(rate),
                accuracy: Accuracy::default(),
            },
            extent,
            &Interruption::never(),
        )
        .unwrap();
        // The cubic's error is h⁴·ω⁴·A/384, 4e-8 rad.
        assert!(errors.angle.rmse_deg < 5e-6, "{errors:?}");
        assert_eq!(errors.angle.within_three_sigma, Some(1.0));
        assert_eq!(errors.phase_shift_reference_deg, None);
    }

    #[test]
    fn a_wrong_sign_of_the_angle_is_reported() {
        let extent = ComparisonExtent { from_s: 1e-3, motion_hz: MOTION_HZ, drive: None };
        let (time_s, angle, rate) = motion(6000, 0.15, 180.0, 0.0);
        let errors = evaluate_motion(
            &trajectory(0.15, 0.0),
            &ReferenceMotion {
                states: ANGLE,
                time_s,
                angle,
                rate: Some(rate),
                accuracy: Accuracy::default(),
            },
            extent,
            &Interruption::never(),
        )
        .unwrap();
        assert!(errors.sign_disagrees);
        assert_abs_diff_eq!(errors.peak_phase_rmse_deg.unwrap(), 180.0, epsilon = 0.1);
    }

    #[test]
    fn nothing_to_compare_is_none() {
        let extent = ComparisonExtent { from_s: 1.0, motion_hz: MOTION_HZ, drive: None };
        let (time_s, angle, _) = motion(6000, 0.15, 0.0, 0.0);
        assert!(
            evaluate_motion(
                &trajectory(0.15, 0.0),
                &ReferenceMotion { states: ANGLE, time_s, angle, rate: None, accuracy: Accuracy::default() },
                extent,
                &Interruption::never(),
            )
            .is_none()
        );
    }
}

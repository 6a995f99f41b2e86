//! What a reader must know of an estimate that its mean NIS does not say.

use super::data::PistonSegment;
use super::observability::ReadoutFault;
use super::plates::{capacitance_range, last_term_m};
use super::range::SamplesOutOfRange;
use super::settings::PistonHardware;
use crate::estimate::{Restart, Trajectory, TrajectoryKind};
use crate::inspect::quantity;
use kalmems_core::Portable;
use kalmems_figures::significant;

/// The gain error that stands for others: the effect goes with it.
const GAIN: f64 = 1e-4;
/// In people's unit.
const NM: f64 = 1e9;

/// What is counted of a segment until its end, where the remarks are made.
#[derive(Clone, Debug, Default)]
pub struct RemarkTally {
    beyond: Option<SamplesOutOfRange>,
    /// One per trajectory.
    of: Vec<TrajectoryCounts>,
}

/// What is counted of one trajectory.
#[derive(Clone, Debug, Default)]
struct TrajectoryCounts {
    updates: usize,
    outside: Option<OutsidePositions>,
}

/// Positions outside the table of the capacitance.
#[derive(Clone, Copy, Debug)]
struct OutsidePositions {
    count: usize,
    near: f64,
    far: f64,
}

/// Standard deviations by which a frequency differs that has changed.
const CHANGED: f64 = 5.0;

/// Of each filter that was started again in a part what the new start says of the frequency, where that is another one than before.
pub fn changes_of_frequency(trajectories: &[Trajectory]) -> Vec<String> {
    let filters = trajectories.iter().filter(|trajectory| trajectory.kind == TrajectoryKind::Filtered);
    let change = |trajectory: &Trajectory, restart: &Restart| {
        let (before, now) = (*restart.before.get(1)?, *restart.known.mean.get(1)?);
        let sd = restart.known.lower.get(2)?.sqrt();
        let lost_s =
            trajectory.lock.lost_spans.iter().rev().find(|[from_s, _]| *from_s <= restart.time_s)?[0];
        ((now - before).abs() > CHANGED * sd).then(|| {
            format!(
                "{}: at {} the frequency of the motion stepped from {} to {} Hz, which the samples until {} show with a standard deviation of {}",
                trajectory.name,
                quantity(lost_s, "s"),
                digits(before, sd),
                digits(now, sd),
                quantity(restart.time_s, "s"),
                quantity(sd, "Hz"),
            )
        })
    };
    let each =
        filters.flat_map(|trajectory| trajectory.restarts.iter().filter_map(|one| change(trajectory, one)));
    each.collect()
}

/// A number with the digits that this standard deviation of it leaves.
fn digits(value: f64, sd: f64) -> String {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to 9
    let decimals = (1.0 - sd.portable_log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

impl RemarkTally {
    /// Counts what a part of the segment has.
    pub fn add(
        &mut self,
        hardware: &PistonHardware,
        beyond: Option<SamplesOutOfRange>,
        trajectories: &[Trajectory],
    ) {
        match (&mut self.beyond, beyond) {
            (Some(all), Some(later)) => all.add(&later),
            (None, later) => self.beyond = later,
            (Some(_), None) => {}
        }
        self.of.resize_with(trajectories.len(), TrajectoryCounts::default);
        for (counted, trajectory) in self.of.iter_mut().zip(trajectories) {
            counted.updates += trajectory.counts.updates;
            counted.count_outside(hardware, trajectory);
        }
    }

    /// The remarks on the estimates of a segment that ends with these trajectories; `data` has its noise.
    pub fn remarks(
        &self,
        hardware: &PistonHardware,
        data: &PistonSegment,
        trajectories: &[Trajectory],
    ) -> Vec<String> {
        let counted = || self.of.iter().zip(trajectories);
        let followed =
            counted().find_map(|(counted, trajectory)| FinalEstimate::of(trajectory, counted.updates));
        let mut said = Vec::new();
        if let Some(followed) = &followed {
            said.extend(of_gain(hardware, data, followed));
        }
        said.extend(self.beyond.map(|beyond| of_range(hardware, data, beyond, followed.as_ref())));
        said.extend(counted().filter_map(|(counted, t)| Some(outside_table(hardware, t, counted.outside?))));
        said.extend(of_bandwidth(hardware, data, followed.as_ref()));
        said
    }
}

impl TrajectoryCounts {
    fn count_outside(&mut self, hardware: &PistonHardware, trajectory: &Trajectory) {
        let [nearest, farthest] = hardware.table_m;
        // Direct inversion has noise of its own, which is no distance.
        let (Some(_), Some(position)) = (trajectory.state("amplitude"), trajectory.state("position")) else {
            return;
        };
        for d in position.mean.iter().copied().filter(|d| *d < nearest || *d > farthest) {
            let outside =
                self.outside.get_or_insert(OutsidePositions { count: 0, near: f64::INFINITY, far: 0.0 });
            outside.count += 1;
            (outside.near, outside.far) = (outside.near.min(d), outside.far.max(d));
        }
    }
}

/// What a filter that claims something says at its end.
struct FinalEstimate {
    amplitude: f64,
    rest: f64,
    position_sd: f64,
    updates: usize,
}

impl FinalEstimate {
    fn of(trajectory: &Trajectory, updates: usize) -> Option<Self> {
        let last =
            |name: &str| trajectory.state(name)?.mean.last().copied().filter(|value| value.is_finite());
        let (amplitude, phase, position) = (last("amplitude")?, last("phase")?, last("position")?);
        let position_sd = *trajectory.state("position")?.sd.last()?;
        let rest = position - amplitude * phase.portable_cos();
        Some(Self { amplitude, rest, position_sd, updates })
    }
}

fn of_gain(hardware: &PistonHardware, data: &PistonSegment, followed: &FinalEstimate) -> Option<String> {
    let unseen = ReadoutFault::gain(&hardware.plates, [followed.amplitude, followed.rest]);
    let effect = significant(GAIN * unseen.position_rms_m * NM);
    let seen = unseen.detectable_from(data.noise_variance, followed.updates);
    let first = format!(
        "a gain of the readout, or a reference distance, that is wrong by {GAIN:e} makes the position wrong by \
         {effect} nm rms"
    );
    if !unseen.position_rms_m.is_finite() {
        return None;
    }
    Some(if seen.is_finite() {
        format!(
            "{first}; the mean NIS shows it only where the gain is wrong by more than {seen:.1e}, which is {} nm rms: \
             calibrate it by a known distance",
            significant(seen * unseen.position_rms_m * NM)
        )
    } else {
        format!(
            "{first}, and no mean NIS shows it, however long the recording: for a parallel plate gain, amplitude \
             and rest position are one. Calibrate it by a known distance, or by a line of a spectrum whose place is \
             known"
        )
    })
}

fn of_range(
    hardware: &PistonHardware,
    data: &PistonSegment,
    beyond: SamplesOutOfRange,
    followed: Option<&FinalEstimate>,
) -> String {
    let range = capacitance_range(&hardware.plates, hardware.table_m).map(|c| significant(c * 1e15));
    let first = format!(
        "{} samples hold a capacitance that the device has at no distance of its table, the first {:.4e} F at {} s; \
         it has {} to {} fF. They were left out, predicted and not corrected",
        beyond.count, beyond.first[1], beyond.first[0], range[0], range[1]
    );
    let Some(followed) = followed else { return first };
    // What one of them would move: the gain P·Hᵀ/R of a settled filter, times what it is off.
    let slope = hardware.plates.slope(followed.rest).abs();
    let moved = followed.position_sd.powi(2) * slope / data.noise_variance * beyond.largest_f.abs();
    format!(
        "{first}: taken for the motion, one of them would move the position by up to {} nm",
        significant(moved * NM)
    )
}

fn outside_table(hardware: &PistonHardware, trajectory: &Trajectory, outside: OutsidePositions) -> String {
    let [nearest, farthest] = hardware.table_m;
    let OutsidePositions { count, near, far } = outside;
    let (worst, end) = if near < nearest { (near, nearest) } else { (far, farthest) };
    format!(
        "{}: {count} samples lie outside the table of the capacitance, from {} to {} mm, the farthest at {:.4} mm. \
         There the series is extrapolated: its last term alone is worth {} nm of the distance, against {} nm at the \
         table's end",
        trajectory.name,
        significant(nearest * 1e3),
        significant(farthest * 1e3),
        worst * 1e3,
        significant(last_term_m(&hardware.plates, worst) * NM),
        significant(last_term_m(&hardware.plates, end) * NM),
    )
}

fn of_bandwidth(
    hardware: &PistonHardware,
    data: &PistonSegment,
    followed: Option<&FinalEstimate>,
) -> Option<String> {
    let bandwidth_hz = hardware.bandwidth_hz?;
    let rate_hz = 1.0 / data.interval_s;
    let factor = (2.0 * bandwidth_hz / rate_hz).sqrt();
    // A bandwidth of half the rate, as printed in a file.
    if (factor - 1.0).abs() < 1e-6 {
        return None;
    }
    let rest = followed.map_or(hardware.plates.reference_distance, |f| f.rest);
    let sample = data.noise_variance.sqrt() / hardware.plates.slope(rest).abs();
    let (now, without) = (significant(sample * NM), significant(sample / factor * NM));
    Some(if factor > 1.0 {
        format!(
            "sampled at {rate_hz:.0} Hz, below twice the bandwidth of {bandwidth_hz:.0} Hz: noise is folded, and a \
             sample is uncertain by {now} nm instead of {without} nm at {:.3} mm; at {:.0} Hz, or behind a filter \
             of {:.0} Hz, the position would be about {factor:.1} times as well known",
            rest * 1e3,
            2.0 * bandwidth_hz,
            0.5 * rate_hz
        )
    } else {
        format!(
            "sampled at {rate_hz:.0} Hz, above twice the bandwidth of {bandwidth_hz:.0} Hz: the noise of neighbours \
             is alike, and the filter takes it for white of the same density. The mean NIS is {:.2} for a filter \
             that is right",
            factor * factor
        )
    })
}

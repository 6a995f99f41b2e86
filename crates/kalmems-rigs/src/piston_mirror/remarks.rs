//! What a reader must know of an estimate that its mean NIS does not say.

use super::data::SegmentData;
use super::observability::Unseen;
use super::plates::{capacitance_range, last_term_m};
use super::range::Beyond;
use super::settings::Hardware;
use crate::estimate::Trajectory;
use crate::report::significant;

/// The gain error that stands for others: the effect goes with it.
const GAIN: f64 = 1e-4;
/// In people's unit.
const NM: f64 = 1e9;

/// The remarks on the estimates of a segment; `data` has the signal as it was recorded.
pub fn remarks(
    hardware: &Hardware,
    data: &SegmentData,
    beyond: Option<Beyond>,
    trajectories: &[Trajectory],
) -> Vec<String> {
    let followed = trajectories.iter().find_map(Followed::of);
    let mut said = Vec::new();
    if let Some(followed) = &followed {
        said.extend(of_gain(hardware, data, followed));
    }
    said.extend(beyond.map(|beyond| of_range(hardware, data, beyond, followed.as_ref())));
    said.extend(trajectories.iter().filter_map(|t| outside_table(hardware, t)));
    said.extend(of_bandwidth(hardware, data, followed.as_ref()));
    said
}

/// What a filter that claims something says at its end.
struct Followed {
    amplitude: f64,
    rest: f64,
    position_sd: f64,
    updates: usize,
}

impl Followed {
    fn of(trajectory: &Trajectory) -> Option<Self> {
        let last =
            |name: &str| trajectory.state(name)?.mean.last().copied().filter(|value| value.is_finite());
        let (amplitude, phase, position) = (last("amplitude")?, last("phase")?, last("position")?);
        let position_sd = *trajectory.state("position")?.sd.last()?;
        let rest = position - amplitude * phase.cos();
        Some(Self { amplitude, rest, position_sd, updates: trajectory.counts.updates })
    }
}

fn of_gain(hardware: &Hardware, data: &SegmentData, followed: &Followed) -> Option<String> {
    let unseen = Unseen::gain(&hardware.plates, [followed.amplitude, followed.rest]);
    let effect = significant(GAIN * unseen.position_rms_m * NM);
    let seen = unseen.seen_from(data.noise_variance, followed.updates);
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

fn of_range(hardware: &Hardware, data: &SegmentData, beyond: Beyond, followed: Option<&Followed>) -> String {
    let range = capacitance_range(&hardware.plates, hardware.table_m).map(|c| significant(c * 1e15));
    let first = format!(
        "{} samples hold a capacitance that the device has at no distance of its table, the first {:.4e} F at {} s; \
         it has {} to {} fF. They were left out, predicted and not corrected",
        beyond.count, data.signal[beyond.first], data.time_s[beyond.first], range[0], range[1]
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

fn outside_table(hardware: &Hardware, trajectory: &Trajectory) -> Option<String> {
    let [nearest, farthest] = hardware.table_m;
    // Direct inversion has noise of its own, which is no distance.
    trajectory.state("amplitude")?;
    let position = trajectory.state("position")?;
    let outside = || position.mean.iter().copied().filter(|d| *d < nearest || *d > farthest);
    let count = outside().count();
    let (near, far) = outside().fold((f64::INFINITY, 0.0_f64), |(n, f), d| (n.min(d), f.max(d)));
    let (worst, end) = if near < nearest { (near, nearest) } else { (far, farthest) };
    (count > 0).then(|| {
        format!(
            "{}: {count} samples lie outside the table of the capacitance, from {} to {} mm, the farthest at {:.4} \
             mm. There the series is extrapolated: its last term alone is worth {} nm of the distance, against {} \
             nm at the table's end",
            trajectory.name,
            significant(nearest * 1e3),
            significant(farthest * 1e3),
            worst * 1e3,
            significant(last_term_m(&hardware.plates, worst) * NM),
            significant(last_term_m(&hardware.plates, end) * NM),
        )
    })
}

fn of_bandwidth(hardware: &Hardware, data: &SegmentData, followed: Option<&Followed>) -> Option<String> {
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

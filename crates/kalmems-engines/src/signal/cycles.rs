//! Amplitude and phase, cycle by cycle.

use super::fit_sine_at;
use crate::progress::Interruption;

/// One cycle's sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Where the cycle begins, in s.
    pub start_s: f64,
    /// The amplitude, in the signal's unit.
    pub amplitude: f64,
    /// The phase of the cosine against the cycle's beginning, in rad, in (−π, π].
    pub phase_rad: f64,
}

/// Fits a sine of this frequency to each whole cycle from `start_s` on. A cycle with fewer than eight finite
/// samples is left out; those within a gap cost nothing, however long it is.
pub fn fit_cycles(time_s: &[f64], y: &[f64], frequency_hz: f64, start_s: f64) -> Vec<Cycle> {
    fit_cycles_until(&Interruption::never(), time_s, y, (frequency_hz, start_s))
}

/// The same, of the cycles until the work is stopped.
pub(crate) fn fit_cycles_until(
    stop: &Interruption,
    time_s: &[f64],
    y: &[f64],
    (frequency_hz, start_s): (f64, f64),
) -> Vec<Cycle> {
    let Some(last) = time_s.last() else { return Vec::new() };
    let mut cycles = Vec::new();
    let mut first = time_s.partition_point(|t| *t < start_s);
    let mut index = 0.0;
    loop {
        let start = start_s + index / frequency_hz;
        let next = start_s + (index + 1.0) / frequency_hz;
        // So far from the start that numbers do not tell two cycles apart, there is none to be fitted.
        if next > *last || next <= start || stop.is_requested_at(cycles.len()) {
            break;
        }
        let end = first + time_s[first..].partition_point(|t| *t < next);
        index += 1.0;
        if end == first {
            let ahead = time_s.get(first).map_or(0.0, |t| ((t - start_s) * frequency_hz).floor());
            index = index.max(ahead);
            continue;
        }
        let local: Vec<f64> = time_s[first..end].iter().map(|t| t - start).collect();
        let values = &y[first..end];
        first = end;
        if values.iter().filter(|v| v.is_finite()).count() < 8 {
            continue;
        }
        if let Some(fit) = fit_sine_at(&local, values, frequency_hz) {
            cycles.push(Cycle { start_s: start, amplitude: fit.amplitude, phase_rad: fit.phase_rad });
        }
    }
    cycles
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use std::f64::consts::TAU;

    #[test]
    fn amplitude_and_phase_of_each_cycle() {
        let time: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
        // The amplitude grows from cycle to cycle; the phase is −0.4 throughout.
        let y: Vec<f64> = time
            .iter()
            .map(|t| (1.0 + ((t - 0.013) * 10.0).floor()) * (TAU * 10.0 * (t - 0.013) - 0.4).cos())
            .collect();
        let cycles = fit_cycles(&time, &y, 10.0, 0.013);
        assert_eq!(cycles.len(), 9);
        for (k, cycle) in cycles.iter().enumerate() {
            assert_abs_diff_eq!(cycle.start_s, 0.013 + 0.1 * k as f64, epsilon = 1e-12);
            assert_abs_diff_eq!(cycle.amplitude, 1.0 + k as f64, epsilon = 1e-9);
            assert_abs_diff_eq!(cycle.phase_rad, -0.4, epsilon = 1e-9);
        }
    }

    #[test]
    fn cycles_without_samples_are_left_out() {
        let time: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
        let y: Vec<f64> = time
            .iter()
            .map(|t| if (0.2..0.3).contains(t) { f64::NAN } else { (TAU * 10.0 * t).cos() })
            .collect();
        assert_eq!(fit_cycles(&time, &y, 10.0, 0.0).len(), 8);
        assert!(fit_cycles(&[], &[], 10.0, 0.0).is_empty());
    }

    #[test]
    fn a_gap_of_any_length_is_passed_over_at_once() {
        for end in [1e9, 1e300, f64::MAX] {
            let mut time: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
            time.extend((0..1000).map(|i| end + f64::from(i) * 1e-3));
            let y: Vec<f64> = time.iter().map(|t| (TAU * 10.0 * (t % 1.0)).cos()).collect();
            let cycles = fit_cycles(&time, &y, 10.0, 0.0);
            // Beyond 1e15 s no two samples are apart.
            assert_eq!(cycles.len(), if end < 1e10 { 19 } else { 10 }, "{end}");
        }
    }
}

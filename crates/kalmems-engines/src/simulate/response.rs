//! Amplitudes of a driven motion: over the drive's frequency, and from a small start.

use super::{Drive, Simulator};
use crate::progress::{Progress, Silent, map_on_threads, processors};
use kalmems_core::Dynamics;
use serde::Serialize;

/// How to hold each frequency of a [`stepped_sweep`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepSettings {
    /// The offset of the drive in V.
    pub offset: f64,
    /// Its amplitude in V.
    pub amplitude: f64,
    /// How many periods of the drive each frequency is held; the last tenth is judged.
    pub periods: u32,
    /// Integration steps per period.
    pub steps_per_period: u32,
    /// What keeps a device from lying perfectly still, in rad: at each new frequency the motion is at least this
    /// large.
    pub disturbance: f64,
}

/// The amplitude of the motion at one drive frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SweepPoint {
    /// The frequency of the drive.
    pub drive_hz: f64,
    /// The largest deflection in the judged time, in the unit of the first state.
    pub amplitude: f64,
}

/// The amplitude at each of these frequencies of a sine drive, in their order, each from the motion before.
///
/// Slow sweeps up and down differ where a device has two steady motions at one frequency. Frequencies change
/// when the drive's phase is 0, so that the drive has no jump.
pub fn stepped_sweep<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    frequencies_hz: impl IntoIterator<Item = f64>,
    settings: &SweepSettings,
) -> Vec<SweepPoint> {
    let SweepSettings { offset, amplitude, periods, steps_per_period, disturbance } = *settings;
    let hold = SweepHold { periods, steps_per_period, disturbance };
    let drives = frequencies_hz
        .into_iter()
        .map(|frequency_hz| (frequency_hz, Drive::Sine { offset, amplitude, frequency_hz, phase_rad: 0.0 }));
    held_in_turn(dynamics, drives, &hold)
}

/// How each frequency of [`sweeps_both_ways`] is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepHold {
    /// How many periods of the drive; the last tenth is judged.
    pub periods: u32,
    /// Integration steps per period.
    pub steps_per_period: u32,
    /// At each new frequency the motion is at least this large, in rad.
    pub disturbance: f64,
}

/// A slow sweep down in frequency and one up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sweeps {
    /// From the highest frequency to the lowest.
    pub down: Vec<SweepPoint>,
    /// From the lowest to the highest.
    pub up: Vec<SweepPoint>,
}

impl Sweeps {
    /// The lowest and the highest frequency at which one way found a motion and the other none: ten times as large as
    /// the other's, and larger than `least`, in rad. `None` where both ways agree.
    pub fn hysteresis_hz(&self, least: f64) -> Option<[f64; 2]> {
        let differs = |(down, up): (&SweepPoint, &SweepPoint)| {
            let (larger, smaller) = (down.amplitude.max(up.amplitude), down.amplitude.min(up.amplitude));
            (larger > least && larger > 10.0 * smaller).then_some(up.drive_hz)
        };
        self.down.iter().rev().zip(&self.up).filter_map(differs).fold(None, |span, hz| {
            let [low, high] = span.unwrap_or([hz, hz]);
            Some([hz.min(low), hz.max(high)])
        })
    }
}

/// The amplitude at each of these rising frequencies of a drive, sweeping down and sweeping up, as
/// [`stepped_sweep`] has it; the two ways are computed at the same time. `None` where the drive does not repeat.
pub fn sweeps_both_ways<D: Dynamics<f64, 2, Input = f64> + Copy + Send + Sync>(
    dynamics: D,
    drive: &Drive,
    frequencies_hz: &[f64],
    hold: &SweepHold,
) -> Option<Sweeps> {
    let drives: Option<Vec<(f64, Drive)>> =
        frequencies_hz.iter().map(|hz| Some((*hz, drive.held_at(*hz)?))).collect();
    let drives = drives?;
    let work = (&Silent as &dyn Progress, "sweeps");
    let ways = map_on_threads(work, processors(), (2, 1), |way, _| {
        Some(match way {
            0 => held_in_turn(dynamics, drives.iter().rev().cloned(), hold),
            _ => held_in_turn(dynamics, drives.iter().cloned(), hold),
        })
    })?;
    let [down, up] = ways.try_into().ok()?;
    Some(Sweeps { down, up })
}

/// One drive after the other, each from the motion before.
fn held_in_turn<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    drives: impl Iterator<Item = (f64, Drive)>,
    hold: &SweepHold,
) -> Vec<SweepPoint> {
    let steps = hold.periods * hold.steps_per_period;
    let mut state = [hold.disturbance, 0.0];
    drives
        .map(|(drive_hz, drive)| {
            let rate_hz = drive_hz * f64::from(hold.steps_per_period);
            let mut simulator = Simulator::new(dynamics, drive, rate_hz, state);
            let mut largest = 0.0_f64;
            for step in 0..steps {
                simulator.step();
                if step >= steps - steps / 10 {
                    largest = largest.max(simulator.state()[0].abs());
                }
            }
            let lies_still = largest < hold.disturbance;
            state = if lies_still { [hold.disturbance, 0.0] } else { *simulator.state() };
            SweepPoint { drive_hz, amplitude: largest }
        })
        .collect()
}

/// How a motion started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepStartUp {
    /// When the motion first reached nine tenths of its final amplitude.
    pub time_s: f64,
    /// The final amplitude, in the unit of the first state.
    pub amplitude: f64,
}

/// Starts a device from a small displacement and waits until `limit_s`. `None` where it is not ten times as large
/// then.
///
/// The final amplitude is the largest deflection in the last tenth of the time.
pub fn start_up<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    drive: &Drive,
    displacement: f64,
    rate_hz: f64,
    limit_s: f64,
) -> Option<SweepStartUp> {
    let run = || Simulator::new(dynamics, drive.clone(), rate_hz, [displacement, 0.0]);
    let mut simulator = run();
    let mut amplitude = 0.0_f64;
    while simulator.time_s() < limit_s {
        simulator.step();
        if simulator.time_s() >= 0.9 * limit_s {
            amplitude = amplitude.max(simulator.state()[0].abs());
        }
    }
    if amplitude.is_nan() || amplitude < 10.0 * displacement.abs() {
        return None;
    }
    let mut again = run();
    while again.state()[0].abs() < 0.9 * amplitude {
        again.step();
    }
    Some(SweepStartUp { time_s: again.time_s(), amplitude })
}
